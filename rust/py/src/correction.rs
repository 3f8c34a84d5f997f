//! Corrected readings of a log.

use std::sync::Arc;

use imufit_attitude::Frame;
use imufit_model::correction::{CorrectionError, correct};
use imufit_model::effect::{Effect, EffectError};
use imufit_model::facts::LogFacts;
use imufit_model::triple::Triple;
use numpy::{PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::computing::compute;
use crate::errors::{from_effect, input_error, input_error_in_row, value_error};
use crate::model::PyEffect;
use crate::window::ChunkArrays;

/// Corrected readings (n, 3) or None for each of acc, gyr and mag, and how many samples of each were lost.
type Corrections<'py> = (Vec<Option<Bound<'py, PyArray2<f64>>>>, [usize; 3]);

fn table<'py>(py: Python<'py>, x: &Triple) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let array = PyArray2::zeros(py, [x.len(), 3], false);
    let mut rows = array.try_readwrite()?;
    for (i, row) in rows.as_slice_mut()?.chunks_exact_mut(3).enumerate() {
        for (axis, value) in row.iter_mut().enumerate() {
            *value = x.axis(axis)[i];
        }
    }
    drop(rows);
    Ok(array)
}

fn from_correction(py: Python<'_>, error: CorrectionError) -> PyErr {
    match error {
        CorrectionError::Effect(error @ EffectError::MissingColumn { .. }) => input_error(py, error),
        CorrectionError::Effect(error) => from_effect(error),
        CorrectionError::Singular { row, .. } | CorrectionError::Unreached { row, .. } => {
            input_error_in_row(py, &error, row)
        }
        CorrectionError::Lacking { .. } | CorrectionError::Restless { .. } => input_error(py, error),
    }
}

/// Undoes effects, each with its parameters, on all rows of a chunk, which is a whole log.
///
/// `frame` is that of the log's reference; `covariates` names the chunk's covariates; means that are None are those of the log.
#[pyfunction]
#[pyo3(signature = (chunk, effects, frame, covariates, covariate_means, temperature_mean=None))]
fn correct_readings<'py>(
    py: Python<'py>,
    chunk: &Bound<'py, PyDict>,
    effects: Vec<(PyRef<'_, PyEffect>, Vec<f64>)>,
    frame: &str,
    covariates: Vec<String>,
    covariate_means: Vec<Option<f64>>,
    temperature_mean: Option<f64>,
) -> PyResult<Corrections<'py>> {
    let effects: Vec<(Arc<dyn Effect>, Vec<f64>)> = effects.iter().map(|(e, p)| (e.0.clone(), p.clone())).collect();
    let frame: Frame = frame.parse().map_err(value_error)?;
    let arrays = ChunkArrays::new(chunk)?;
    let window = arrays.window()?;
    let corrected = compute(py, || {
        let facts = LogFacts::without_reference(&window, frame, covariates, &covariate_means, temperature_mean);
        correct(&window, &facts, &effects)
    })?
    .map_err(|error| from_correction(py, error))?;
    let readings = corrected
        .readings
        .iter()
        .map(|r| r.as_ref().map(|x| table(py, x)).transpose())
        .collect::<PyResult<_>>()?;
    Ok((readings, corrected.lost))
}

/// Registers this file's part of the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(correct_readings, m)?)?;
    Ok(())
}
