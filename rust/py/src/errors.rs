//! Each core error to one Python exception: what the caller passed was unusable, so all are `ValueError`.

use imufit_attitude::InvalidAttitude;
use imufit_filters::FilterError;
use imufit_model::effect::EffectError;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// The text of a core error as a `ValueError`.
pub fn value_error(message: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(message.to_string())
}

/// An error of the attitude crate.
pub fn from_attitude(error: InvalidAttitude) -> PyErr {
    value_error(error)
}

/// An error of the filters crate.
pub fn from_filters(error: FilterError) -> PyErr {
    value_error(error)
}

/// An `imufit.errors.InputError`: what a user can put right.
pub fn input_error(py: Python<'_>, problem: impl std::fmt::Display) -> PyErr {
    let made = py
        .import("imufit.errors")
        .and_then(|m| m.getattr("InputError")?.call1((problem.to_string(),)));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// An `imufit.errors.InputError` that names a row.
pub fn input_error_in_row(py: Python<'_>, problem: impl std::fmt::Display, row: usize) -> PyErr {
    let made = || {
        let place = PyDict::new(py);
        place.set_item("row", row)?;
        let class = py.import("imufit.errors")?.getattr("InputError")?;
        class.call((problem.to_string(),), Some(&place))
    };
    made().map_or_else(|error: PyErr| error, PyErr::from_value)
}

/// An error of an effect; a user's own exception comes out as it went in.
pub fn from_effect(error: EffectError) -> PyErr {
    match (&error, crate::raised::take()) {
        (EffectError::User { .. }, Some(raised)) => raised,
        (EffectError::Contract { .. }, _) => Python::attach(|py| input_error(py, &error)),
        _ => value_error(error),
    }
}
