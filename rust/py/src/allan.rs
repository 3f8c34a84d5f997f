//! `rust/allan`: arrays in, deviations out.

use imufit_allan::{NoiseKind, allan_variance, degrees_of_freedom, scatter};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::arrays::Column;
use crate::computing::compute;
use crate::errors::value_error;

type Deviations<'py> = (Bound<'py, PyArray1<f64>>, Vec<usize>);

fn columns<'py>(pieces: &Bound<'py, PyList>) -> PyResult<Vec<Column<'py>>> {
    pieces.iter().map(|piece| Column::new("pieces", &piece)).collect()
}

/// Overlapping Allan deviations (k,) of pieces of evenly spaced samples at averaging times of `factors` samples, and the
/// differences that each is the mean of. NaN is a lost sample.
#[pyfunction]
fn allan_deviation<'py>(
    py: Python<'py>,
    pieces: &Bound<'py, PyList>,
    factors: Vec<usize>,
) -> PyResult<Deviations<'py>> {
    let columns = columns(pieces)?;
    let values = columns.iter().map(Column::values).collect::<PyResult<Vec<_>>>()?;
    let found = compute(py, || allan_variance(&values, &factors))?;
    let deviations = found.iter().map(|variance| variance.value.sqrt()).collect();
    Ok((
        PyArray1::from_vec(py, deviations),
        found.iter().map(|variance| variance.terms).collect(),
    ))
}

/// Equivalent degrees of freedom of the Allan variance of `samples` readings at an averaging time of `factor` of them,
/// under noise of that kind: "quantisation", "white", "flicker" or "walk".
#[pyfunction]
fn allan_freedom(kind: &str, samples: usize, factor: usize) -> PyResult<f64> {
    let kind = match kind {
        "quantisation" => NoiseKind::Quantisation,
        "white" => NoiseKind::White,
        "flicker" => NoiseKind::Flicker,
        "walk" => NoiseKind::Walk,
        _ => {
            return Err(value_error(format!(
                "{kind:?} is no kind of noise: use quantisation, white, flicker or walk"
            )));
        }
    };
    Ok(degrees_of_freedom(kind, samples, factor))
}

/// Standard deviation of one sample about the means of blocks of `rows`; NaN is a lost sample.
#[pyfunction]
fn block_scatter(py: Python<'_>, pieces: &Bound<'_, PyList>, rows: usize) -> PyResult<f64> {
    let columns = columns(pieces)?;
    let values = columns.iter().map(Column::values).collect::<PyResult<Vec<_>>>()?;
    compute(py, || scatter(&values, rows))
}

/// Adds this file's functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(allan_deviation, m)?)?;
    m.add_function(wrap_pyfunction!(allan_freedom, m)?)?;
    m.add_function(wrap_pyfunction!(block_scatter, m)?)
}
