//! What the functions around filters take in common: readings, surroundings, start, settings, and a look for Ctrl-C.

use std::collections::HashMap;

use imufit_attitude::Frame;
use imufit_filters::{Columns, Environment, FilterError, Start};
use nalgebra::Vector3;
use pyo3::prelude::*;

use crate::arrays::{self, Column, Rows};
use crate::errors::{from_attitude, from_filters};

/// Borrowed columns of a log: `t` (n,) s; `acc` (n, 3) m/s^2; `gyr` (n, 3) rad/s; `mag` (n, 3) uT.
pub struct Readings<'py> {
    t: Column<'py>,
    acc: Option<Rows<'py, 3>>,
    gyr: Option<Rows<'py, 3>>,
    mag: Option<Rows<'py, 3>>,
}

impl<'py> Readings<'py> {
    /// Columns with as many rows as `t`.
    pub fn new(
        t: &Bound<'py, PyAny>,
        acc: Option<&Bound<'py, PyAny>>,
        gyr: Option<&Bound<'py, PyAny>>,
        mag: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Self> {
        let t = Column::new("t", t)?;
        let n = t.len();
        Ok(Self {
            acc: Rows::optional_with_rows("acc", acc, "t", n)?,
            gyr: Rows::optional_with_rows("gyr", gyr, "t", n)?,
            mag: Rows::optional_with_rows("mag", mag, "t", n)?,
            t,
        })
    }

    /// Number of rows.
    pub fn n(&self) -> usize {
        self.t.len()
    }

    /// The memory of the columns.
    pub fn columns(&self) -> PyResult<Columns<'_>> {
        Ok(Columns {
            t: self.t.values()?,
            acc: self.acc.as_ref().map(Rows::values).transpose()?,
            gyr: self.gyr.as_ref().map(Rows::values).transpose()?,
            mag: self.mag.as_ref().map(Rows::values).transpose()?,
        })
    }
}

/// Frame, gravity (m/s^2) and field in the reference frame (uT).
pub fn surroundings(frame: &str, gravity: f64, mag_reference: Option<&Bound<'_, PyAny>>) -> PyResult<Environment> {
    let frame: Frame = frame.parse().map_err(from_attitude)?;
    let field = mag_reference
        .map(|m| arrays::vector("mag_reference", m))
        .transpose()?
        .map(Vector3::from);
    Environment::new(frame, gravity, field).map_err(from_filters)
}

/// The attitude at the first row from that time on; without one from the vectors.
pub fn start_of(initial: Option<&Bound<'_, PyAny>>, start_time: Option<f64>) -> PyResult<Start> {
    Ok(match initial {
        None => Start::Vectors,
        Some(q) => Start::Given {
            time: start_time.unwrap_or(f64::NEG_INFINITY),
            attitude: arrays::quaternion("initial", q)?,
        },
    })
}

/// Settings in the order of their names, so that the first wrong one is always the same.
pub fn sorted(settings: Option<HashMap<String, f64>>) -> Vec<(String, f64)> {
    let mut settings: Vec<_> = settings.unwrap_or_default().into_iter().collect();
    settings.sort_by(|a, b| a.0.cmp(&b.0));
    settings
}

/// What ends a run early.
pub enum Stop {
    /// The filter's own.
    Filter(FilterError),
    /// Ctrl-C.
    Signal(PyErr),
}

impl From<FilterError> for Stop {
    fn from(error: FilterError) -> Self {
        Self::Filter(error)
    }
}

impl From<Stop> for PyErr {
    fn from(stop: Stop) -> Self {
        match stop {
            Stop::Filter(error) => from_filters(error),
            Stop::Signal(error) => error,
        }
    }
}

/// Whether somebody pressed Ctrl-C.
pub fn look() -> Result<(), Stop> {
    #[allow(clippy::redundant_closure_for_method_calls)] // the path is not general enough over the lifetime
    Python::attach(|py| py.check_signals()).map_err(Stop::Signal)
}
