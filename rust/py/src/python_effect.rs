//! A user's Python function as an effect. Its exception comes out unchanged.

use std::sync::{Arc, Mutex, PoisonError};

use imufit_model::card::{Affine, Card, Found, Parameter, Reach, Scope, Stage, Traits};
use imufit_model::effect::{Columns, Effect, EffectError, Rows, Sign};
use imufit_model::facts::LogFacts;
use imufit_model::sensor::Sensor;
use imufit_model::triple::Triple;
use numpy::{PyArray1, PyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::{input_error, value_error};
use crate::model::PyEffect;

/// The column of a log that holds the sensor's temperature.
const TEMPERATURE: &str = "temp";

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
    /// Columns of the log that it reads: `temp`, covariates.
    pub needs: Vec<String>,
    /// What signs its parameters can have.
    pub sign: Sign,
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
        let has = |column: &str| match column {
            TEMPERATURE => facts.has_temperature,
            _ => facts.covariate(column).is_some(),
        };
        self.needs
            .iter()
            .find(|c| !has(c))
            .map(|c| format!("the log has no column {c}"))
    }

    fn centred_column(&self) -> Option<&str> {
        // A function gets the temperature less its mean, and every other column as it is.
        self.needs.iter().map(String::as_str).find(|c| *c == TEMPERATURE)
    }

    fn sign(&self) -> Sign {
        self.sign
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

/// What a user says of an effect, from `scope`, `reach`, `affine` and `sign` by name; what is left out is the default.
fn declared(words: &Bound<'_, PyDict>) -> PyResult<(Traits, Sign)> {
    let word = |key: &str| -> PyResult<Option<String>> {
        let value = words.get_item(key)?;
        value.map_or(Ok(None), |v| v.extract())
    };
    let unknown = |key: &str, given: &str| value_error(format!("{key} is {given:?}, which is not known"));
    let mut traits = Traits::default();
    if let Some(given) = word("scope")? {
        traits.scope = match given.as_str() {
            "sensor" => Scope::Sensor,
            "log" => Scope::Log,
            other => return Err(unknown("scope", other)),
        };
    }
    if let Some(given) = word("reach")? {
        traits.reach = match given.as_str() {
            "row" => Reach::Row,
            "neighbours" => Reach::Neighbours,
            "history" => Reach::History,
            other => return Err(unknown("reach", other)),
        };
    }
    if let Some(given) = word("affine")? {
        traits.affine = Some(match given.as_str() {
            "offset" => Affine::Offset,
            "scale" => Affine::Scale,
            "matrix" => Affine::Matrix,
            other => return Err(unknown("affine", other)),
        });
    }
    let sign = match word("sign")?.as_deref() {
        None | Some("any") => Sign::Any,
        Some("rather_positive") => Sign::RatherPositive,
        Some("positive") => Sign::Positive,
        Some(other) => return Err(unknown("sign", other)),
    };
    Ok((traits, sign))
}

/// An effect made of a Python function that returns d reading / d parameters, (n, 3, p), float64, in SI units.
///
/// `parameters` are (name, unit, typical size or None); `words` the words of its card; `needs` the covariates that it
/// reads; `traits` its `scope`, `reach`, `affine` and `sign` as far as they are not the default. `function` gets a dict: t, t_start (s), omega, alpha, f, m, x (n, 3), temperature (n,) or None,
/// columns by name.
#[pyfunction]
#[pyo3(signature = (id, sensor, parameters, words, stage, needs, traits, function))]
#[allow(clippy::too_many_arguments)] // keyword arguments of one Python call
fn python_effect(
    id: String,
    sensor: &str,
    parameters: Vec<(String, String, Option<f64>)>,
    words: &Bound<'_, PyDict>,
    stage: &str,
    needs: Vec<String>,
    traits: &Bound<'_, PyDict>,
    function: Py<PyAny>,
) -> PyResult<PyEffect> {
    let (traits, sign) = declared(traits)?;
    let sensor = Sensor::from_prefix(sensor)
        .ok_or_else(|| value_error(format!("sensor is {sensor:?}: pass acc, gyr or mag")))?;
    let stage = match stage {
        "input" => Stage::Input,
        "gain" => Stage::Gain,
        "offset" => Stage::Offset,
        other => return Err(value_error(format!("stage is {other:?}: pass input, gain or offset"))),
    };
    let word =
        |key: &str| -> PyResult<String> { words.get_item(key)?.map_or_else(|| Ok(String::new()), |v| v.extract()) };
    let card = Card {
        name: word("name")?,
        physics: word("physics")?,
        formula: word("formula")?,
        signature: word("signature")?,
        mistaken_for: word("mistaken_for")?,
        confirm: word("confirm")?,
        shares: 1.0,
        id,
        stage,
        traits,
        parameters: parameters
            .into_iter()
            .map(|(name, unit, typical)| Parameter {
                name,
                unit,
                typical,
                found: Found::Steps,
            })
            .collect(),
    };
    Ok(PyEffect(Arc::new(PythonEffect {
        card,
        sensor: [sensor],
        needs,
        sign,
        function,
    })))
}

/// Registers this file's part of the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(python_effect, m)?)
}
