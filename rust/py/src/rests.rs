//! Rests that stand in for a reference attitude.

use std::sync::Arc;

use imufit_attitude::Frame;
use imufit_fit::bins::{Bins, CovariateSamples};
use imufit_fit::rests::{Labelled, Rests, Stills, Turn};
use imufit_model::facts::LogFacts;
use imufit_model::sensor_model::SensorModel;
use nalgebra::Vector3;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::computing::compute;
use crate::errors::{from_effect, value_error};
use crate::model::{PyEffect, PyFacts};
use crate::window::ChunkArrays;

/// First row, one past the last, number of the rest before and after, inverse of the noise (1/rad), block.
type TurnNumbers = (usize, usize, usize, usize, f64, usize);

/// Number of the rest, unit vector of the axis that points up, block.
type LabelledNumbers = (usize, [f64; 3], usize);

/// Borrowed arrays of the rests of a log: the chunks `stills`, `poses`, `path`, `field`; of each still its `rest` and `block`; `turns` and `labelled` rests; the `field_block` of each row of the field.
pub struct RestArrays<'py> {
    chunks: [ChunkArrays<'py>; 4],
    rest: Vec<usize>,
    block: Vec<usize>,
    turns: Vec<TurnNumbers>,
    labelled: Vec<LabelledNumbers>,
    field_block: Vec<usize>,
}

impl<'py> RestArrays<'py> {
    /// Borrows the arrays of a dict.
    pub fn new(rests: &Bound<'py, PyDict>) -> PyResult<Self> {
        let item = |key: &str| {
            rests
                .get_item(key)?
                .ok_or_else(|| value_error(format!("the rests have no {key}")))
        };
        let chunk = |key: &str| ChunkArrays::new(item(key)?.cast::<PyDict>()?);
        Ok(Self {
            chunks: [chunk("stills")?, chunk("poses")?, chunk("path")?, chunk("field")?],
            rest: item("rest")?.extract()?,
            block: item("block")?.extract()?,
            turns: item("turns")?.extract()?,
            labelled: item("labelled")?.extract()?,
            field_block: item("field_block")?.extract()?,
        })
    }

    /// The rests, whose blocks must be fewer than `blocks`.
    pub fn rests(&self, blocks: Option<usize>) -> PyResult<Rests<'_>> {
        let [stills, poses, path, field] = &self.chunks;
        let (stills, poses, path, field) = (stills.window()?, poses.window()?, path.window()?, field.window()?);
        let n = stills.len();
        if [self.rest.len(), self.block.len()] != [n; 2] || self.field_block.len() != field.len() {
            return Err(value_error(
                "every still needs a rest and a block, every row of the field a block",
            ));
        }
        let within = |block: usize| blocks.is_none_or(|blocks| block < blocks);
        let sound = |t: &TurnNumbers| t.0 + 2 <= t.1 && t.1 <= path.len() && t.2.max(t.3) < poses.len() && within(t.5);
        if !self.turns.iter().all(sound) {
            return Err(value_error("a turn lies outside the path, the poses or the blocks"));
        }
        let sound = |l: &LabelledNumbers| l.0 < poses.len() && within(l.2) && l.1.iter().all(|v| v.is_finite());
        if !self.labelled.iter().all(sound) {
            return Err(value_error("a labelled rest lies outside the poses or the blocks"));
        }
        if !self.block.iter().chain(&self.field_block).all(|b| within(*b)) {
            return Err(value_error("there is no such block"));
        }
        let turns = self
            .turns
            .iter()
            .map(|(first, end, before, after, weight, block)| Turn {
                rows: *first..*end,
                before: *before,
                after: *after,
                weight: *weight,
                block: *block,
            });
        let labelled = self.labelled.iter().map(|(rest, up, block)| Labelled {
            rest: *rest,
            up: Vector3::from(*up),
            block: *block,
        });
        Ok(Rests {
            stills: Stills {
                means: stills,
                rest: self.rest.clone(),
                block: self.block.clone(),
            },
            poses,
            labelled: labelled.collect(),
            path,
            turns: turns.collect(),
            field,
            field_block: self.field_block.clone(),
        })
    }
}

/// True if the columns of an effect are known without a reference.
#[pyfunction]
fn rests_tell(py: Python<'_>, effect: &PyEffect, facts: &PyFacts, rests: &Bound<'_, PyDict>) -> PyResult<bool> {
    let arrays = RestArrays::new(rests)?;
    let rests = arrays.rests(None)?;
    let trial = effect.0.search(&facts.facts, None).into_iter().next();
    let trial = trial.unwrap_or_else(|| vec![0.0; effect.0.card().parameters.len()]);
    let told = || {
        let model = SensorModel::new(Vec::new(), vec![(effect.0.clone(), trial)], &facts.facts)?;
        rests.tell(&model, &facts.facts)
    };
    compute(py, told)?.map_err(from_effect)
}

/// Facts of a log without a reference. `rows`: number, first and last time (s), time between them (s). `field`: length of the
/// field, uT. `sensors`: those that tell anything. `samples` of every covariate are for its bins, see `Bins::covariate_names`.
#[pyfunction]
#[pyo3(signature = (rows, frame, gravity, field, sensors, covariates, covariate_means, temperature_mean, samples))]
#[allow(clippy::too_many_arguments)]
fn facts_at_rest(
    rows: (usize, f64, f64, f64),
    frame: &str,
    gravity: f64,
    field: Option<f64>,
    sensors: [bool; 3],
    covariates: Vec<String>,
    covariate_means: Vec<f64>,
    temperature_mean: Option<f64>,
    samples: Vec<Vec<f64>>,
) -> PyResult<PyFacts> {
    let frame: Frame = frame.parse().map_err(value_error)?;
    let names = Bins::covariate_names(&covariates);
    if samples.len() != names.len() || covariate_means.len() != covariates.len() {
        return Err(value_error("every covariate needs samples and a mean"));
    }
    let facts = LogFacts::at_rest(
        rows,
        frame,
        gravity,
        field,
        sensors,
        temperature_mean,
        covariates,
        covariate_means,
    );
    let samples = CovariateSamples {
        names,
        values: samples,
        rows: facts.n,
        rate_noise: 0.0,
        force_noise: 0.0,
    };
    let mut bins = Bins::new(&[&samples]);
    bins.centre_temperature(facts.temperature_mean);
    Ok(PyFacts {
        facts,
        bins,
        samples: Arc::new(samples),
        attitude_noise: f64::NAN,
        position_noise: f64::NAN,
    })
}

/// Names of the channels where rests stand in for a reference; empty for those that nothing is known of.
#[pyfunction]
fn rest_channels() -> Vec<&'static str> {
    imufit_model::rest_channels::NAMES.to_vec()
}

/// Registers this file's part of the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(rests_tell, m)?)?;
    m.add_function(wrap_pyfunction!(facts_at_rest, m)?)?;
    m.add_function(wrap_pyfunction!(rest_channels, m)?)?;
    Ok(())
}
