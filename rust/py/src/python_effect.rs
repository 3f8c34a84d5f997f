//! A user's Python function as an effect. Its exception comes out unchanged.

use std::sync::{Mutex, PoisonError};

use imufit_model::card::Card;
use imufit_model::effect::{Columns, Effect, EffectError, Rows};
use imufit_model::facts::LogFacts;
use imufit_model::sensor::Sensor;
use imufit_model::triple::Triple;
use numpy::{PyArray1, PyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::input_error;

/// The exception a user's function raised last; taken by whoever turns the core error into a Python one.
static RAISED: Mutex<Option<PyErr>> = Mutex::new(None);

/// The exception behind an [`EffectError::User`].
pub fn take_raised() -> Option<PyErr> {
    RAISED.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// An effect whose columns a Python function computes.
pub struct PythonEffect {
    /// Description.
    pub card: Card,
    /// The sensor.
    pub sensor: [Sensor; 1],
    /// Covariates it reads.
    pub needs: Vec<String>,
    /// Called with a dict of arrays; returns (n, 3, p) float64.
    pub function: Py<PyAny>,
}

fn table<'py>(py: Python<'py>, triple: &Triple) -> Bound<'py, PyArray2<f64>> {
    let n = triple.len();
    PyArray2::from_owned_array(
        py,
        numpy::ndarray::Array2::from_shape_fn((n, 3), |(i, axis)| triple.0[axis][i]),
    )
}

impl PythonEffect {
    fn call(&self, py: Python<'_>, rows: &Rows, out: &mut Columns) -> PyResult<()> {
        let window = PyDict::new(py);
        window.set_item("t", PyArray1::from_slice(py, rows.t))?;
        window.set_item("t_start", rows.facts.t_start)?;
        window.set_item("omega", table(py, &rows.ideal.omega))?;
        window.set_item("alpha", table(py, &rows.ideal.alpha))?;
        window.set_item("f", table(py, &rows.ideal.f))?;
        window.set_item("m", table(py, &rows.ideal.m))?;
        window.set_item("x", table(py, rows.x))?;
        window.set_item("temperature", rows.temperature.map(|t| PyArray1::from_slice(py, t)))?;
        let columns = PyDict::new(py);
        for (name, values) in rows.facts.covariates.iter().zip(rows.covariates) {
            columns.set_item(name, PyArray1::from_slice(py, values))?;
        }
        window.set_item("columns", columns)?;
        let result = self.function.bind(py).call1((window,))?;
        let array: PyReadonlyArray3<f64> = result.extract()?;
        let view = array.as_array();
        let known = |i: usize| {
            let ideal = &rows.ideal;
            let ideal = [&ideal.omega, &ideal.alpha, &ideal.f, &ideal.m, rows.x];
            rows.attitude(i).coords.iter().all(|v| v.is_finite())
                && ideal.iter().all(|triple| triple.row(i).iter().all(|v| v.is_finite()))
                && rows.temperature.is_none_or(|t| t[i].is_finite())
                && rows.covariates.iter().all(|c| c[i].is_finite())
        };
        for (i, row) in view.outer_iter().enumerate() {
            if let Some(k) = row.iter().position(|v| !v.is_finite()).filter(|_| known(i)) {
                let (id, name) = (
                    &self.card.id,
                    &self.card.parameters[k % self.card.parameters.len()].name,
                );
                let problem = format!("effect {id}: column {name} is not finite at t = {} s", rows.t[i]);
                return Err(input_error(py, problem));
            }
        }
        for parameter in 0..self.card.parameters.len() {
            for axis in 0..3 {
                out.set(parameter, axis, (0..rows.len()).map(|i| view[[i, axis, parameter]]));
            }
        }
        Ok(())
    }
}

impl Effect for PythonEffect {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &self.sensor
    }

    fn not_testable(&self, facts: &LogFacts) -> Option<String> {
        if !facts.sensors[self.sensor[0].index()] {
            return Some(format!("the log has no {}", self.sensor[0].name()));
        }
        self.needs
            .iter()
            .find(|c| facts.covariate(c).is_none())
            .map(|c| format!("the log has no column {c}"))
    }

    fn columns(&self, rows: &Rows, _: Sensor, _: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        Python::attach(|py| {
            self.call(py, rows, out).map_err(|error| {
                let message = error.to_string();
                *RAISED.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                EffectError::User {
                    effect: self.card.id.clone(),
                    message,
                }
            })
        })
    }
}
