//! Passes over a log: survey, evidence, noise.

use std::sync::Arc;

use imufit_attitude::Frame;
use imufit_fit::bins::Bins;
use imufit_fit::evidence::{Evidence, Layout};
use imufit_fit::noise::PastProducts;
use imufit_fit::profile::{self, Profile};
use imufit_fit::reference_noise;
use imufit_fit::survey::{Given, Survey};
use imufit_model::rig::Rig;
use imufit_model::sensor::CHANNELS;
use imufit_model::sensor_model::SensorModel;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::computing::compute;
use crate::errors::{from_effect, value_error};
use crate::model::{PyEffect, PyFacts};
use crate::rests::RestArrays;
use crate::window::ChunkArrays;

/// The rig of a log from the number of its axis and the attitude at the angle zero.
fn rig_of((axis, zero): (usize, [f64; 4])) -> PyResult<Rig> {
    if axis > 2 || !zero.iter().all(|v| v.is_finite()) {
        return Err(value_error("rig must be an axis (0, 1, 2) and a quaternion"));
    }
    let [w, x, y, z] = zero;
    Ok(Rig {
        axis: Vector3::ith(axis, 1.0),
        zero: UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)),
        knots: Vec::new(),
    })
}

/// First pass over a log.
#[pyclass(name = "Survey", module = "imufit._imufit")]
pub struct PySurvey(Survey);

#[pymethods]
impl PySurvey {
    #[new]
    /// `rig`: axis of a one-axis rig (x, y or z of the body) and the reference attitude at its angle zero.
    #[pyo3(signature = (n, frame, gravity, mag_reference, covariates, rig=None))]
    fn new(
        n: usize,
        frame: &str,
        gravity: f64,
        mag_reference: Option<[f64; 3]>,
        covariates: Vec<String>,
        rig: Option<(usize, [f64; 4])>,
    ) -> PyResult<Self> {
        let frame: Frame = frame.parse().map_err(value_error)?;
        Ok(Self(Survey::new(Given {
            n,
            frame,
            gravity: -frame.up() * gravity,
            field: mag_reference.map(Vector3::from),
            covariates,
            rig: rig.map(rig_of).transpose()?,
        })))
    }

    /// Adds the core rows of a chunk.
    fn add(&mut self, py: Python<'_>, chunk: &Bound<'_, PyDict>) -> PyResult<()> {
        let arrays = ChunkArrays::new(chunk)?;
        let window = arrays.window()?;
        compute(py, || self.0.add(&window))?;
        Ok(())
    }

    /// Mean square difference of neighbouring reference widths over what noise explains: (attitude, position).
    fn widths(&self) -> (Vec<f64>, Vec<f64>) {
        let (attitude, position) = self.0.widths();
        (attitude.excess(), position.excess())
    }

    /// The facts of the log.
    fn finish(&self) -> PyFacts {
        let (attitude, position) = self.0.widths();
        let (attitude_noise, position_noise) = (attitude.noise(), position.noise());
        let (facts, samples) = self.0.clone().finish();
        let mut bins = Bins::new(&[&samples]);
        bins.centre_temperature(facts.temperature_mean);
        PyFacts {
            facts,
            bins,
            samples: Arc::new(samples),
            attitude_noise,
            position_noise,
        }
    }
}

/// Gram matrices of every effect's columns and the residual, block by block.
#[pyclass(name = "Evidence", module = "imufit._imufit")]
pub struct PyEvidence(pub Evidence);

#[pymethods]
impl PyEvidence {
    /// `effects` with their parameters are the model; `candidates` are asked for their columns only, at the values given
    /// (which matter for parameters that are searched for); `filters` has the taps of a whitening filter for each of the nine channels.
    #[new]
    fn new(
        facts: &PyFacts,
        effects: Vec<(PyRef<'_, PyEffect>, Vec<f64>)>,
        candidates: Vec<(PyRef<'_, PyEffect>, Vec<f64>)>,
        blocks: usize,
        filters: Vec<Vec<f64>>,
    ) -> PyResult<Self> {
        if blocks < 2 || filters.len() != CHANNELS {
            return Err(value_error(format!("need at least 2 blocks and {CHANNELS} filters")));
        }
        let effects = effects.into_iter().map(|(e, p)| (e.0.clone(), p)).collect();
        let candidates = candidates.into_iter().map(|(e, p)| (e.0.clone(), p)).collect();
        let model = SensorModel::new(effects, candidates, &facts.facts).map_err(from_effect)?;
        let layout = Layout {
            model,
            facts: facts.facts.clone(),
            bins: facts.bins.clone(),
            blocks,
            filters,
        };
        Ok(Self(Evidence::new(Arc::new(layout))))
    }

    /// Adds the core rows of a chunk.
    fn add(&mut self, py: Python<'_>, chunk: &Bound<'_, PyDict>) -> PyResult<()> {
        let arrays = ChunkArrays::new(chunk)?;
        let window = arrays.window()?;
        compute(py, || self.0.add(&window))?.map_err(from_effect)
    }

    /// Adds what the rests of a log tell: `stills`, `poses`, `path` and `field` as chunks; `rest` and `block` of each
    /// still; `turns` as (first row, one past the last, rest before, rest after, 1/noise, block); `labelled` as (rest, axis that points up, block); `field_block`.
    fn add_rests(&mut self, py: Python<'_>, rests: &Bound<'_, PyDict>) -> PyResult<()> {
        let arrays = RestArrays::new(rests)?;
        let rests = arrays.rests(Some(self.0.layout.blocks))?;
        compute(py, || self.0.add_rests(&rests))?.map_err(from_effect)
    }

    /// Variance of a row of each of the nine channels, from stretches of rests that follow each other; NaN where too few do.
    fn rest_scatter(&self, py: Python<'_>, rests: &Bound<'_, PyDict>) -> PyResult<Vec<f64>> {
        let arrays = RestArrays::new(rests)?;
        let rests = arrays.rests(None)?;
        let layout = &self.0.layout;
        let scatter = compute(py, || rests.scatter(&layout.model, &layout.facts))?;
        scatter.map(|v| v.to_vec()).map_err(from_effect)
    }

    /// Adds evidence of other rows, taken for the same layout.
    fn merge(&mut self, other: &Self) -> PyResult<()> {
        if !self.0.layout.same(&other.0.layout) {
            return Err(value_error("evidence of different layouts cannot be added"));
        }
        self.0.merge(other.0.clone());
        Ok(())
    }

    /// Empty evidence of the same layout with other whitening filters.
    fn with_filters(&self, filters: Vec<Vec<f64>>) -> PyResult<Self> {
        if filters.len() != CHANNELS {
            return Err(value_error(format!("need {CHANNELS} filters")));
        }
        let mut layout = (*self.0.layout).clone();
        layout.filters = filters;
        Ok(Self(Evidence::new(Arc::new(layout))))
    }

    /// Variance that white noise of the reference (attitude in rad, position in m) gives to the whitened residual of each of the nine
    /// channels, through the effects of the evidence.
    fn reference_variance(&self, attitude: f64, position: f64) -> PyResult<Vec<f64>> {
        let found = reference_noise::variance(&self.0.layout, attitude, position).map_err(from_effect)?;
        Ok(found.to_vec())
    }

    /// Blocks of time that the evidence is kept in.
    #[getter]
    fn blocks(&self) -> usize {
        self.0.layout.blocks
    }

    /// Number of samples of a channel.
    fn count(&self, channel: usize) -> usize {
        self.0.count(channel)
    }

    /// Parameters whose columns can be non-zero in a channel.
    fn active(&self, channel: usize) -> Vec<usize> {
        self.0.layout.model.active()[channel].clone()
    }

    /// Gram matrix (a + 1, a + 1) of `[columns | residual]` of a channel with its a active parameters, summed over all
    /// blocks or of one block; None without samples.
    #[pyo3(signature = (channel, block=None))]
    fn gram<'py>(&self, py: Python<'py>, channel: usize, block: Option<usize>) -> Option<Bound<'py, PyArray2<f64>>> {
        let blocks: Vec<usize> = block.map_or_else(|| (0..self.0.layout.blocks).collect(), |b| vec![b]);
        let mut parts = blocks.into_iter().filter_map(|b| self.0.get(b, channel));
        let mut sum = parts.next()?.gram.clone();
        for part in parts {
            sum.add(&part.gram, 1.0);
        }
        let n = sum.columns();
        Some(PyArray2::from_owned_array(
            py,
            numpy::ndarray::Array2::from_shape_fn((n, n), |(i, j)| sum.at(i, j)),
        ))
    }
}

/// Search for a parameter inside a candidate effect: each trial's columns against the residual of a model.
#[pyclass(name = "Profile", module = "imufit._imufit")]
pub struct PyProfile(pub Profile);

#[pymethods]
impl PyProfile {
    /// `effects` with their parameters are the model; `trials` are values of every parameter of the candidate.
    #[new]
    fn new(
        facts: &PyFacts,
        effects: Vec<(PyRef<'_, PyEffect>, Vec<f64>)>,
        candidate: &PyEffect,
        trials: Vec<Vec<f64>>,
    ) -> PyResult<Self> {
        let effects = effects.into_iter().map(|(e, p)| (e.0.clone(), p)).collect();
        let trials = trials.into_iter().map(|p| (candidate.0.clone(), p)).collect();
        let model = SensorModel::new(effects, trials, &facts.facts).map_err(from_effect)?;
        Ok(Self(Profile::new(model, facts.facts.clone())))
    }

    /// Adds the core rows of a chunk.
    fn add(&mut self, py: Python<'_>, chunk: &Bound<'_, PyDict>) -> PyResult<()> {
        let arrays = ChunkArrays::new(chunk)?;
        let window = arrays.window()?;
        compute(py, || self.0.add(&window))?.map_err(from_effect)
    }

    /// Adds what the rests of a log tell, see `Evidence.add_rests`.
    fn add_rests(&mut self, py: Python<'_>, rests: &Bound<'_, PyDict>) -> PyResult<()> {
        let arrays = RestArrays::new(rests)?;
        let rests = arrays.rests(None)?;
        compute(py, || self.0.add_rests(&rests))?.map_err(from_effect)
    }
}

/// Number of a trial, the candidate's parameters, their standard deviations, drop of the sum of squares, that of the mirrored trial, samples.
type BestTrial = (usize, Vec<f64>, Vec<f64>, f64, f64, f64);

/// Largest size that is worth a trial, from searches of several logs whose first trial is zero; infinite where nothing would change.
#[pyfunction]
fn furthest_trial(searches: Vec<PyRef<'_, PyProfile>>) -> f64 {
    let logs: Vec<&Profile> = searches.iter().map(|s| &s.0).collect();
    let furthest = imufit_fit::profile::furthest(&logs);
    if furthest.is_nan() { f64::INFINITY } else { furthest }
}

/// Number of the best trial of searches over several logs for the same trials, the candidate's parameters as a step finds
/// them, their standard deviation where they are the mean of trials of that size (else zero), the drop of the sum of
/// squares in units of the noise, that of a trial of the other sign, and the samples of the channels that it acts on;
/// None where no sample can be used.
#[pyfunction]
fn best_trial(py: Python<'_>, profiles: Vec<PyRef<'_, PyProfile>>) -> PyResult<Option<BestTrial>> {
    let logs: Vec<&Profile> = profiles.iter().map(|p| &p.0).collect();
    let best = compute(py, || profile::best(&logs))?;
    Ok(best.map(|best| {
        (
            best.trial,
            best.parameters,
            best.spread,
            best.gain,
            best.mirrored,
            best.samples,
        )
    }))
}

/// Residual of each of the nine channels over the core rows of a chunk, (rows,), SI units (magnetometer uT), after a
/// step of all parameters, (p,); None for a sensor that the log has not.
#[pyfunction]
fn evaluate<'py>(
    py: Python<'py>,
    evidence: &PyEvidence,
    chunk: &Bound<'py, PyDict>,
    step: Vec<f64>,
) -> PyResult<Vec<Option<Bound<'py, PyArray1<f64>>>>> {
    let layout = &evidence.0.layout;
    if step.len() != layout.model.parameters() {
        return Err(value_error("step must have one number per parameter"));
    }
    let arrays = ChunkArrays::new(chunk)?;
    let window = arrays.window()?;
    let residuals = compute(py, || layout.model.residuals(&window, &layout.facts, &step))?.map_err(from_effect)?;
    Ok(residuals
        .into_iter()
        .map(|r| r.map(|r| PyArray1::from_vec(py, r)))
        .collect())
}

/// Products of the residual with its own past, from which whitening filters come.
#[pyclass(name = "PastProducts", module = "imufit._imufit")]
pub struct PyPastProducts(PastProducts);

#[pymethods]
impl PyPastProducts {
    #[new]
    fn new() -> Self {
        Self(PastProducts::default())
    }

    /// Adds the core rows of a chunk: the residual of the evidence's layout less its columns times `step`.
    fn add(
        &mut self,
        py: Python<'_>,
        chunk: &Bound<'_, PyDict>,
        evidence: &PyEvidence,
        step: Vec<f64>,
    ) -> PyResult<()> {
        if step.len() != evidence.0.layout.model.parameters() {
            return Err(value_error("step must have one number per parameter"));
        }
        let arrays = ChunkArrays::new(chunk)?;
        let window = arrays.window()?;
        compute(py, || self.0.add(&window, &evidence.0, &step))?.map_err(from_effect)
    }

    /// Whitening filter of each of the nine channels, its taps; empty where the residual is white.
    fn filters(&self) -> Vec<Vec<f64>> {
        (0..CHANNELS).map(|channel| self.0.filter(channel)).collect()
    }
}

/// Registers this file's part of the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<PySurvey>()?;
    m.add_class::<PyEvidence>()?;
    m.add_class::<PyProfile>()?;
    m.add_class::<PyPastProducts>()?;
    m.add_function(wrap_pyfunction!(furthest_trial, m)?)?;
    m.add_function(wrap_pyfunction!(best_trial, m)?)?;
    m.add_function(wrap_pyfunction!(evaluate, m)?)?;
    Ok(())
}
