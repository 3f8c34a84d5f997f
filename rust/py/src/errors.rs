//! Each core error to one Python exception: what the caller passed was unusable, so all are `ValueError`.

use imufit_attitude::InvalidAttitude;
use imufit_filters::FilterError;
use imufit_model::effect::EffectError;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

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

/// An error of an effect; a user's own exception comes out as it went in.
pub fn from_effect(error: EffectError) -> PyErr {
    match (&error, crate::python_effect::take_raised()) {
        (EffectError::User { .. }, Some(raised)) => raised,
        _ => value_error(error),
    }
}
