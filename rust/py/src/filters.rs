//! `rust/filters`: one class that serves a whole log, pieces of one, and a running device.

use std::collections::HashMap;

use imufit_filters::accel::tilt_rows;
use imufit_filters::{
    Columns, FILTERS, FilterError, Parameter, Replay, Row, Rules, Skipped, Smoother, catalogue, steady_state_gain,
};
use nalgebra::Vector3;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{self, Column, Rows, filled_rows};
use crate::errors::from_filters;
use crate::replay_arguments::{Readings, Stop, look, sorted, start_of, surroundings};

/// Rows between two looks for Ctrl-C.
const WINDOW: usize = 1 << 18;

/// An attitude filter with the rules for gaps, NaN, free fall and the start around it.
#[pyclass(name = "Filter", module = "imufit._imufit")]
struct PyFilter {
    replay: Replay,
    /// Of all rows since the last reset.
    skipped: Skipped,
}

type Run<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyDict>);

#[pymethods]
impl PyFilter {
    /// A filter by name; `settings` of the filter and `rules` of the replay by name, the others at their defaults.
    #[new]
    #[pyo3(signature = (
        name, *, frame="NED", gravity=9.80665, mag_reference=None, settings=None, rules=None, initial=None, start_time=None
    ))]
    #[allow(clippy::too_many_arguments)] // keyword arguments of one Python call
    fn new(
        name: &str,
        frame: &str,
        gravity: f64,
        mag_reference: Option<&Bound<'_, PyAny>>,
        settings: Option<HashMap<String, f64>>,
        rules: Option<HashMap<String, f64>>,
        initial: Option<&Bound<'_, PyAny>>,
        start_time: Option<f64>,
    ) -> PyResult<Self> {
        let environment = surroundings(frame, gravity, mag_reference)?;
        let start = start_of(initial, start_time)?;
        let build = || {
            let rules = Rules::from_settings(&sorted(rules))?;
            Replay::new(catalogue::find(name)?, &sorted(settings), environment, rules, start)
        };
        Ok(Self {
            replay: build().map_err(from_filters)?,
            skipped: Skipped::default(),
        })
    }

    /// The filter's name.
    #[getter]
    fn name(&self) -> &'static str {
        self.replay.name()
    }

    /// Attitudes (n, 4), scalar first, for the next rows, and the rows of which something was not used, by reason.
    ///
    /// `t` (n,) s; `acc` (n, 3) m/s^2; `gyr` (n, 3) rad/s; `mag` (n, 3) uT.
    #[pyo3(signature = (t, acc=None, gyr=None, mag=None))]
    fn run<'py>(
        &mut self,
        py: Python<'py>,
        t: &Bound<'py, PyAny>,
        acc: Option<&Bound<'py, PyAny>>,
        gyr: Option<&Bound<'py, PyAny>>,
        mag: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Run<'py>> {
        let readings = Readings::new(t, acc, gyr, mag)?;
        let columns = readings.columns()?;
        let replay = &mut self.replay;
        let fill = |out: &mut [f64]| run_in_windows(replay, &columns, out);
        let (attitude, skipped) = filled_rows::<4, _, _>(py, readings.n(), fill, PyErr::from)?;
        self.skipped += skipped;
        Ok((attitude, reasons(py, &skipped)?))
    }

    /// The attitude (4,), scalar first, after one more row; NaN before the start. The same step as in `run`.
    ///
    /// `t` s; `acc`, `gyr`, `mag` three numbers each in m/s^2, rad/s, uT: None for a sensor that is not there at all, NaN
    /// for one that has no reading in this row.
    #[pyo3(signature = (t, acc=None, gyr=None, mag=None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        t: f64,
        acc: Option<&Bound<'py, PyAny>>,
        gyr: Option<&Bound<'py, PyAny>>,
        mag: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let reading = |name, value: Option<&Bound<'py, PyAny>>| {
            value
                .map(|value| arrays::reading(name, value).map(Vector3::from))
                .transpose()
        };
        let row = Row {
            t,
            acc: reading("acc", acc)?,
            gyr: reading("gyr", gyr)?,
            mag: reading("mag", mag)?,
        };
        let (attitude, skipped) = self.replay.step(&row).map_err(from_filters)?;
        self.skipped += skipped;
        Ok(PyArray1::from_slice(py, &attitude))
    }

    /// Rows of which something was not used, by reason, since the filter was made or reset.
    #[getter]
    fn skipped<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        reasons(py, &self.skipped)
    }

    /// All that the next row depends on, (k,): hand it to another filter with the same settings.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.replay.state())
    }

    #[setter]
    fn set_state(&mut self, state: &Bound<'_, PyAny>) -> PyResult<()> {
        let state = Column::new("state", state)?;
        self.replay.set_state(state.values()?).map_err(from_filters)
    }

    /// Back to before the first row.
    fn reset(&mut self) {
        self.replay.reset();
        self.skipped = Skipped::default();
    }
}

/// The reasons that there were, with their rows.
fn reasons<'py>(py: Python<'py>, skipped: &Skipped) -> PyResult<Bound<'py, PyDict>> {
    let reasons = PyDict::new(py);
    for (reason, rows) in skipped.by_reason() {
        if rows > 0 {
            reasons.set_item(reason, rows)?;
        }
    }
    Ok(reasons)
}

/// The whole log, with a look for Ctrl-C between windows.
fn run_in_windows(replay: &mut Replay, columns: &Columns<'_>, out: &mut [f64]) -> Result<Skipped, Stop> {
    if columns.t.len() <= WINDOW {
        return Ok(replay.run(columns, out)?);
    }
    let mut skipped = Skipped::default();
    for (window, out) in columns.windows(WINDOW).zip(out.chunks_mut(4 * WINDOW)) {
        skipped += replay.run(&window, out)?;
        look()?;
    }
    Ok(skipped)
}

/// Attitudes (n, 4), scalar first, of the filter `mekf` forwards and backwards over a whole log, and the rows of which
/// something was not used, by reason. Settings are those of `mekf`, everything else as in `Filter`.
#[pyfunction]
#[pyo3(signature = (
    t, acc=None, gyr=None, mag=None, *, frame="NED", gravity=9.80665, mag_reference=None, settings=None, rules=None,
    initial=None, start_time=None
))]
#[allow(clippy::too_many_arguments)] // keyword arguments of one Python call
fn smooth<'py>(
    py: Python<'py>,
    t: &Bound<'py, PyAny>,
    acc: Option<&Bound<'py, PyAny>>,
    gyr: Option<&Bound<'py, PyAny>>,
    mag: Option<&Bound<'py, PyAny>>,
    frame: &str,
    gravity: f64,
    mag_reference: Option<&Bound<'py, PyAny>>,
    settings: Option<HashMap<String, f64>>,
    rules: Option<HashMap<String, f64>>,
    initial: Option<&Bound<'py, PyAny>>,
    start_time: Option<f64>,
) -> PyResult<Run<'py>> {
    let environment = surroundings(frame, gravity, mag_reference)?;
    let start = start_of(initial, start_time)?;
    let build = || {
        let rules = Rules::from_settings(&sorted(rules))?;
        Smoother::new(&sorted(settings), environment, rules, start)
    };
    let smoother = build().map_err(from_filters)?;
    let readings = Readings::new(t, acc, gyr, mag)?;
    let columns = readings.columns()?;
    let fill = |out: &mut [f64]| smoother.run(&columns, out, look);
    let (attitude, skipped) = filled_rows::<4, _, _>(py, readings.n(), fill, PyErr::from)?;
    Ok((attitude, reasons(py, &skipped)?))
}

fn describe<'py>(py: Python<'py>, parameters: &[Parameter]) -> PyResult<Bound<'py, PyDict>> {
    let described = PyDict::new(py);
    for parameter in parameters {
        let entry = PyDict::new(py);
        entry.set_item("default", parameter.default)?;
        entry.set_item("unit", parameter.unit)?;
        entry.set_item("meaning", parameter.meaning)?;
        described.set_item(parameter.name, entry)?;
    }
    Ok(described)
}

/// The filters by name: summary, needed sensors, and settings with default, unit and meaning.
#[pyfunction]
fn filter_descriptions(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let filters = PyDict::new(py);
    for filter in &FILTERS {
        let entry = PyDict::new(py);
        entry.set_item("summary", filter.summary)?;
        entry.set_item(
            "needs",
            PyList::new(py, filter.needs.iter().map(|sensor| sensor.name()))?,
        )?;
        entry.set_item("settings", describe(py, filter.parameters)?)?;
        filters.set_item(filter.name, entry)?;
    }
    Ok(filters)
}

/// The settings of the rules for gaps and free fall, with default, unit and meaning.
#[pyfunction]
fn replay_rules(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    describe(py, imufit_filters::rules::PARAMETERS)
}

/// Angles of n readings (n, 3) of specific force as eqs. (1) to (3) of paper B have them, (n, 3), rad: pitch, roll,
/// inclination of z; NaN where a reading shows no direction.
#[pyfunction]
fn tilt_angles<'py>(py: Python<'py>, acc: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let acc = Rows::<3>::new("acc", acc)?;
    let values = acc.values()?;
    let fill = |out: &mut [f64]| {
        tilt_rows(values, out);
        Ok::<_, FilterError>(())
    };
    Ok(filled_rows::<3, _, _>(py, acc.len(), fill, from_filters)?.0)
}

/// The Kalman filter when it has settled with readings `dt` s apart: gain of the angle, gain of the bias (1/s) and time
/// constant (s).
#[pyfunction]
#[pyo3(signature = (dt, settings=None))]
fn kalman_steady_state(dt: f64, settings: Option<HashMap<String, f64>>) -> PyResult<(f64, f64, f64)> {
    let found = steady_state_gain(&sorted(settings), dt).map_err(from_filters)?;
    Ok((found.angle, found.bias, found.time_constant))
}

/// Adds this file's class and functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<PyFilter>()?;
    m.add_function(wrap_pyfunction!(filter_descriptions, m)?)?;
    m.add_function(wrap_pyfunction!(tilt_angles, m)?)?;
    m.add_function(wrap_pyfunction!(kalman_steady_state, m)?)?;
    m.add_function(wrap_pyfunction!(smooth, m)?)?;
    m.add_function(wrap_pyfunction!(replay_rules, m)?)
}
