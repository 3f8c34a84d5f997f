//! A user's Python function as an effect. Its exception comes out unchanged.

use std::sync::Arc;

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
use crate::raised;

/// The column of a log that holds the sensor's temperature.
const TEMPERATURE: &str = "temp";

/// What a user's function is asked for; the word that it is told.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Asked {
    /// Columns at the parameters of a model.
    Columns,
    /// Columns of a candidate at trial values.
    Candidate,
    /// What it adds to the reading.
    Added,
}

impl Asked {
    const fn word(self) -> &'static str {
        match self {
            Self::Columns => "columns",
            Self::Candidate => "candidate",
            Self::Added => "added",
        }
    }
}

/// An effect that a Python function computes.
pub struct PythonEffect {
    /// Description.
    pub card: Card,
    /// The sensor.
    pub sensor: [Sensor; 1],
    /// Columns of the log that it reads: `temp`, covariates.
    pub needs: Vec<String>,
    /// What signs its parameters can have.
    pub sign: Sign,
    /// Time that it looks back, s.
    pub memory: f64,
    /// Least and largest value of each parameter; empty where none is searched for.
    pub limits: Vec<(f64, f64)>,
    /// Called with a dict of arrays, parameters and what is asked; returns (n, 3, p) float64. Has `trials` and `centred`.
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
    /// True for a parameter whose column there is.
    fn has_column(&self, parameter: usize, asked: Asked) -> bool {
        match self.card.parameters[parameter].found {
            Found::Steps => true,
            Found::SearchThenSteps => asked == Asked::Columns || (self.tried_at_full_size() && parameter == 0),
            Found::Search => asked != Asked::Columns && self.tried_at_full_size() && parameter == 0,
        }
    }

    /// What the function returns, by row, axis and parameter, finite wherever everything is known.
    fn call<'py>(
        &self,
        py: Python<'py>,
        rows: &Rows,
        parameters: &[f64],
        asked: Asked,
    ) -> PyResult<PyReadonlyArray3<'py, f64>> {
        let window = PyDict::new(py);
        window.set_item("t", PyArray1::from_slice(py, rows.t))?;
        window.set_item("t_start", rows.facts.t_start)?;
        window.set_item("dt", rows.facts.dt)?;
        window.set_item("history", rows.history)?;
        window.set_item("temperature_mean", rows.facts.temperature_mean)?;
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
        let means = PyDict::new(py);
        for (name, mean) in rows.facts.covariates.iter().zip(&rows.facts.covariate_means) {
            means.set_item(name, mean)?;
        }
        window.set_item("means", means)?;
        let result = self
            .function
            .bind(py)
            .call1((window, parameters.to_vec(), asked.word()))?;
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
            let i = rows.history + i;
            if row.iter().any(|v| !v.is_finite()) && known(i) {
                let problem = format!(
                    "effect {}: the value is not finite at t = {} s",
                    self.card.id, rows.t[i]
                );
                return Err(input_error(py, problem));
            }
        }
        Ok(array)
    }

    /// The same, with an exception kept for whoever turns the core error into a Python one.
    fn called<T>(&self, ask: impl FnOnce(Python<'_>) -> PyResult<T>) -> Result<T, EffectError> {
        Python::attach(|py| {
            ask(py).map_err(|error| {
                let message = error.to_string();
                raised::keep(error);
                EffectError::User {
                    effect: self.card.id.clone(),
                    message,
                }
            })
        })
    }

    fn fill(&self, rows: &Rows, parameters: &[f64], asked: Asked, out: &mut Columns) -> Result<(), EffectError> {
        self.called(|py| {
            let array = self.call(py, rows, parameters, asked)?;
            let view = array.as_array();
            for parameter in (0..parameters.len()).filter(|p| self.has_column(*p, asked)) {
                for axis in 0..3 {
                    out.set(parameter, axis, view.outer_iter().map(|row| row[[axis, parameter]]));
                }
            }
            Ok(())
        })
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
        if self.memory > 0.0 && facts.rests {
            return Some("what was before a rest is not known without a reference attitude".to_string());
        }
        self.needs
            .iter()
            .find(|c| !has(c))
            .map(|c| format!("the log has no column {c}"))
    }

    fn centred_columns(&self) -> Vec<String> {
        Python::attach(|py| {
            let centred = self.function.bind(py).getattr("centred");
            centred.and_then(|names| names.extract()).unwrap_or_default()
        })
    }

    fn memory(&self) -> f64 {
        self.memory
    }

    fn columns_are_quotients(&self) -> bool {
        true
    }

    fn limits(&self) -> Vec<(f64, f64)> {
        self.limits.clone()
    }

    fn tried_at_full_size(&self) -> bool {
        self.card.parameters.iter().all(|p| p.found != Found::Steps)
    }

    fn jumps(&self) -> bool {
        self.tried_at_full_size()
    }

    fn strongly_curved(&self) -> bool {
        self.tried_at_full_size()
    }

    fn search(&self, _: &LogFacts, found: Option<(&[f64], usize)>) -> Vec<Vec<f64>> {
        if self.card.parameters.iter().all(|p| p.found == Found::Steps) {
            return Vec::new();
        }
        Python::attach(|py| {
            let (found, round) = found.map_or((None, 0), |(at, round)| (Some(at.to_vec()), round));
            let trials = self.function.bind(py).call_method1("trials", (found, round));
            trials.and_then(|grid| grid.extract()).unwrap_or_default()
        })
    }

    fn sign(&self) -> Sign {
        self.sign
    }

    fn columns(&self, rows: &Rows, _: Sensor, parameters: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        self.fill(rows, parameters, Asked::Columns, out)
    }

    fn candidate_columns(&self, rows: &Rows, _: Sensor, trial: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        self.fill(rows, trial, Asked::Candidate, out)
    }

    fn added(&self, rows: &Rows, _: Sensor, parameters: &[f64]) -> Result<Option<Triple>, EffectError> {
        if self.card.parameters.iter().all(|p| p.found == Found::Steps) {
            return Ok(None);
        }
        let values = self.called(|py| {
            let array = self.call(py, rows, parameters, Asked::Added)?;
            let view = array.as_array();
            let axis = |axis: usize| view.outer_iter().map(|row| row[[axis, 0]]).collect();
            Ok(Triple(std::array::from_fn(axis)))
        })?;
        Ok(Some(values))
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

/// An effect made of a Python function, in SI units.
///
/// `parameters` are (name, unit, typical size or None, how found: `steps`, `search_then_steps`, `search`); `words` the words of its
/// card; `needs` the covariates that it reads; `traits` its `scope`, `reach`, `affine` and `sign` as far as they are not the default;
/// `memory` how far it looks back, s; `limits` the least and the largest value of each parameter. `function` gets a dict (t, t_start and
/// dt (s), omega, alpha, f, m, x (n, 3), temperature (n,) or None, temperature_mean, columns and means by name, history: how many rows
/// are only of the past), the parameters and `columns`, `candidate` or `added`; it returns (n - history, 3, p), or p = 1 for `added`.
#[pyfunction]
#[pyo3(signature = (id, sensor, parameters, words, stage, needs, traits, memory, limits, function))]
#[allow(clippy::too_many_arguments)] // keyword arguments of one Python call
fn python_effect(
    id: String,
    sensor: &str,
    parameters: Vec<(String, String, Option<f64>, String)>,
    words: &Bound<'_, PyDict>,
    stage: &str,
    needs: Vec<String>,
    traits: &Bound<'_, PyDict>,
    memory: f64,
    limits: Vec<(f64, f64)>,
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
    let parameters = parameters
        .into_iter()
        .map(|(name, unit, typical, found)| {
            let found = match found.as_str() {
                "steps" => Found::Steps,
                "search_then_steps" => Found::SearchThenSteps,
                "search" => Found::Search,
                other => return Err(value_error(format!("{name} is found by {other:?}, which is not known"))),
            };
            Ok(Parameter {
                name,
                unit,
                typical,
                found,
            })
        })
        .collect::<PyResult<_>>()?;
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
        parameters,
    };
    Ok(PyEffect(Arc::new(PythonEffect {
        card,
        sensor: [sensor],
        needs,
        sign,
        memory,
        limits,
        function,
    })))
}

/// Registers this file's part of the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(python_effect, m)?)
}
