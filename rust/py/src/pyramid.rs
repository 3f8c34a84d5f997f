//! `rust/pyramid`: arrays in, the points of a screen out.

use std::sync::{PoisonError, RwLock};

use imufit_pyramid::{Line, Pyramid, thinned as thinned_rows};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::arrays::Column;
use crate::computing::compute;
use crate::errors::value_error;

type Points<'py> = (
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<f64>>,
);

fn points(py: Python<'_>, line: Line) -> Points<'_> {
    (
        PyArray1::from_vec(py, line.t),
        PyArray1::from_vec(py, line.low),
        PyArray1::from_vec(py, line.high),
    )
}

/// Refuses a window that is none.
fn check_window(begin: f64, end: f64, pixels: usize) -> PyResult<()> {
    if begin.is_finite() && end >= begin && pixels > 0 {
        return Ok(());
    }
    Err(value_error(format!(
        "{pixels} pixels from {begin} to {end} s are not a window: pass finite times that ascend, and a pixel at least"
    )))
}

/// Smallest and largest values of the columns of a log, fed chunk by chunk; may be asked while it is fed.
#[pyclass(name = "Pyramid", frozen, module = "imufit._imufit")]
struct PyPyramid(RwLock<Pyramid>);

#[pymethods]
impl PyPyramid {
    /// A pyramid of one column for each of `gaps`, the longest times between two samples without a gap, s.
    #[new]
    #[pyo3(signature = (gaps, block = 128))]
    fn new(gaps: Vec<f64>, block: usize) -> PyResult<Self> {
        if block == 0 || gaps.iter().any(|gap| gap.is_nan()) {
            return Err(value_error(
                "a block needs a row at least, and a gap a length".to_owned(),
            ));
        }
        Ok(Self(RwLock::new(Pyramid::new(&gaps, block))))
    }

    /// Takes the next rows: times (n,) s, ascending, and an array (n,) for each column, NaN where a sample is missing.
    fn feed(&self, py: Python<'_>, t: &Bound<'_, PyAny>, values: &Bound<'_, PyList>) -> PyResult<()> {
        let t = Column::new("t", t)?;
        let columns = values
            .iter()
            .map(|column| Column::with_rows("values", &column, "t", t.len()))
            .collect::<PyResult<Vec<_>>>()?;
        let slices = columns.iter().map(Column::values).collect::<PyResult<Vec<_>>>()?;
        let t = t.values()?;
        compute(py, || {
            self.0.write().unwrap_or_else(PoisonError::into_inner).feed(t, &slices)
        })?
        .map_err(|error| value_error(error.to_string()))
    }

    /// Points of a window of some columns: for each time, smallest and largest value, at most twice as many as pixels.
    fn lines<'py>(
        &self,
        py: Python<'py>,
        columns: Vec<usize>,
        begin: f64,
        end: f64,
        pixels: usize,
    ) -> PyResult<Vec<Points<'py>>> {
        check_window(begin, end, pixels)?;
        let lines = compute(py, || {
            let pyramid = self.0.read().unwrap_or_else(PoisonError::into_inner);
            match columns.iter().find(|&&column| column >= pyramid.columns()) {
                Some(column) => Err(format!("column {column} is not one of the {}", pyramid.columns())),
                None => Ok(pyramid.lines(&columns, begin, end, pixels)),
            }
        })?
        .map_err(value_error)?;
        Ok(lines.into_iter().map(|line| points(py, line)).collect())
    }

    /// First row, and the row after the last one, that a window is drawn from.
    fn rows_between(&self, begin: f64, end: f64) -> (usize, usize) {
        self.0
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .rows_between(begin, end)
    }

    /// Number of rows so far.
    #[getter]
    fn rows(&self) -> usize {
        self.0.read().unwrap_or_else(PoisonError::into_inner).rows()
    }

    /// Times of the first and the last row, s; None before the first one.
    #[getter]
    fn span(&self) -> Option<(f64, f64)> {
        self.0.read().unwrap_or_else(PoisonError::into_inner).span()
    }

    /// Bytes that it takes.
    #[getter]
    fn bytes(&self) -> usize {
        self.0.read().unwrap_or_else(PoisonError::into_inner).bytes()
    }
}

/// Points of a window of one column in memory, as those of a pyramid, or the samples themselves if they are few.
#[pyfunction]
fn thinned<'py>(
    py: Python<'py>,
    t: &Bound<'py, PyAny>,
    values: &Bound<'py, PyAny>,
    gap: f64,
    begin: f64,
    end: f64,
    pixels: usize,
) -> PyResult<Points<'py>> {
    check_window(begin, end, pixels)?;
    let t = Column::new("t", t)?;
    let values = Column::with_rows("values", values, "t", t.len())?;
    let (t, values) = (t.values()?, values.values()?);
    let line = compute(py, || thinned_rows(t, values, gap, begin, end, pixels))?;
    Ok(points(py, line))
}

/// Adds this file's class and function to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(thinned, m)?)?;
    m.add_class::<PyPyramid>()
}
