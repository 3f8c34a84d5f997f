//! A chunk of a log as a window of borrowed columns.

use imufit_model::window::Window;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Column, Rows};
use crate::errors::value_error;

/// Borrowed arrays of one chunk.
pub struct ChunkArrays<'py> {
    t: Column<'py>,
    readings: [Option<Rows<'py, 3>>; 3],
    temperature: Option<Column<'py>>,
    attitude: Option<Rows<'py, 4>>,
    position: Option<Rows<'py, 3>>,
    reference_exact: Option<Column<'py>>,
    covariates: Vec<Column<'py>>,
    offset: usize,
    begin: usize,
    end: usize,
}

fn item<'py>(chunk: &Bound<'py, PyDict>, key: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
    Ok(chunk.get_item(key)?.filter(|v| !v.is_none()))
}

fn number(chunk: &Bound<'_, PyDict>, key: &str) -> PyResult<usize> {
    item(chunk, key)?
        .ok_or_else(|| value_error(format!("the chunk has no {key}")))?
        .extract()
}

impl<'py> ChunkArrays<'py> {
    /// Borrows the arrays of a chunk: t, acc, gyr, mag, temp, ref_q, ref_p, ref_exact, covariates (a list), offset,
    /// begin, end.
    pub fn new(chunk: &Bound<'py, PyDict>) -> PyResult<Self> {
        let t = Column::new(
            "t",
            &item(chunk, "t")?.ok_or_else(|| value_error("the chunk has no t"))?,
        )?;
        let n = t.len();
        let mut covariates = Vec::new();
        if let Some(list) = item(chunk, "covariates")? {
            for column in list.try_iter()? {
                covariates.push(Column::with_rows("covariates", &column?, "t", n)?);
            }
        }
        let (begin, end) = (number(chunk, "begin")?, number(chunk, "end")?);
        if begin > end || end > n {
            return Err(value_error(format!(
                "rows {begin} to {end} are not within the {n} rows of the chunk"
            )));
        }
        let sensor = |key: &'static str| Rows::<3>::optional_with_rows(key, item(chunk, key)?.as_ref(), "t", n);
        Ok(Self {
            readings: [sensor("acc")?, sensor("gyr")?, sensor("mag")?],
            temperature: Column::optional_with_rows("temp", item(chunk, "temp")?.as_ref(), "t", n)?,
            attitude: Rows::optional_with_rows("ref_q", item(chunk, "ref_q")?.as_ref(), "t", n)?,
            position: sensor("ref_p")?,
            reference_exact: Column::optional_with_rows("ref_exact", item(chunk, "ref_exact")?.as_ref(), "t", n)?,
            covariates,
            offset: number(chunk, "offset")?,
            begin,
            end,
            t,
        })
    }

    /// The window on these arrays.
    pub fn window(&self) -> PyResult<Window<'_>> {
        let [acc, gyr, mag] = &self.readings;
        Ok(Window {
            t: self.t.values()?,
            readings: [
                acc.as_ref().map(Rows::values).transpose()?,
                gyr.as_ref().map(Rows::values).transpose()?,
                mag.as_ref().map(Rows::values).transpose()?,
            ],
            temperature: self.temperature.as_ref().map(Rows::values).transpose()?,
            attitude: self.attitude.as_ref().map(Rows::values).transpose()?,
            position: self.position.as_ref().map(Rows::values).transpose()?,
            reference_exact: self.reference_exact.as_ref().map(Rows::values).transpose()?,
            covariates: self.covariates.iter().map(Rows::values).collect::<PyResult<_>>()?,
            offset: self.offset,
            begin: self.begin,
            end: self.end,
        })
    }
}
