//! `rust/filters/src/trials.rs`: many settings of a filter over one log.

use std::collections::HashMap;

use imufit_filters::trials::{self, Conditions, Judgement, Score};
use imufit_filters::{Rules, catalogue};
use numpy::{PyArray3, PyReadonlyArray1};
use pyo3::prelude::*;

use crate::arrays::Rows;
use crate::computing::pool;
use crate::errors::{from_filters, value_error};
use crate::replay_arguments::{Readings, look, sorted, start_of, surroundings};

/// The numbers of a [`Score`].
const NUMBERS: usize = 12;

fn numbers(score: &Score) -> [f64; NUMBERS] {
    let (f, m) = (&score.inclination, &score.heading);
    let [total, heading, inclination] = score.squares;
    [
        score.rows as f64,
        total,
        heading,
        inclination,
        f.n as f64,
        f.length,
        f.square,
        f.product,
        m.n as f64,
        m.length,
        m.square,
        m.product,
    ]
}

/// Scores (settings, parts, 12) of a filter with each of `settings` over one log, in one pass: rows with reference; sums of
/// the squared total, heading and inclination error, rad^2; then of the surprises of the specific force and of the field
/// each their number, the sums of their lengths (rad), of their squares and of the products of neighbours (rad^2).
///
/// `part` (n,) uint8 says what a row counts for, below `parts`; `horizon` s is the time of a prediction, 0 for none.
#[pyfunction]
#[pyo3(signature = (
    name, settings, t, acc=None, gyr=None, mag=None, *, part, parts, reference=None, horizon=0.0, frame="NED",
    gravity=9.80665, mag_reference=None, rules=None, initial=None, start_time=None
))]
#[allow(clippy::too_many_arguments)] // keyword arguments of one Python call
fn filter_trials<'py>(
    py: Python<'py>,
    name: &str,
    settings: Vec<HashMap<String, f64>>,
    t: &Bound<'py, PyAny>,
    acc: Option<&Bound<'py, PyAny>>,
    gyr: Option<&Bound<'py, PyAny>>,
    mag: Option<&Bound<'py, PyAny>>,
    part: PyReadonlyArray1<'py, u8>,
    parts: usize,
    reference: Option<&Bound<'py, PyAny>>,
    horizon: f64,
    frame: &str,
    gravity: f64,
    mag_reference: Option<&Bound<'py, PyAny>>,
    rules: Option<HashMap<String, f64>>,
    initial: Option<&Bound<'py, PyAny>>,
    start_time: Option<f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let readings = Readings::new(t, acc, gyr, mag)?;
    let columns = readings.columns()?;
    let reference = Rows::<4>::optional_with_rows("reference", reference, "t", readings.n())?;
    let judgement = Judgement {
        reference: reference.as_ref().map(Rows::values).transpose()?,
        part: part
            .as_slice()
            .map_err(|_| value_error("part is not contiguous: pass np.ascontiguousarray(part)"))?,
        parts,
        horizon,
    };
    let rules = Rules::from_settings(&sorted(rules)).map_err(from_filters)?;
    let conditions = Conditions {
        environment: surroundings(frame, gravity, mag_reference)?,
        rules,
        start: start_of(initial, start_time)?,
    };
    let description = catalogue::find(name).map_err(from_filters)?;
    let settings: Vec<_> = settings.into_iter().map(|each| sorted(Some(each))).collect();
    let pool = pool(py)?;
    let scored = || trials::run(description, &settings, conditions, &columns, &judgement, &pool, look);
    #[allow(clippy::disallowed_methods)] // it looks for Ctrl-C on this thread
    let scores = py.detach(scored)?;
    let nested: Vec<Vec<Vec<f64>>> = scores
        .iter()
        .map(|parts| parts.iter().map(|score| numbers(score).to_vec()).collect())
        .collect();
    Ok(PyArray3::from_vec3(py, &nested)?)
}

/// Adds this file's function to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(filter_trials, m)?)
}
