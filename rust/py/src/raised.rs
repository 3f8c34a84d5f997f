//! The exception that a user's function raised last, on its way through the core.

use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;

static RAISED: Mutex<Option<PyErr>> = Mutex::new(None);

/// Keeps the exception behind an `EffectError::User` for whoever turns the core error into a Python one.
pub fn keep(error: PyErr) {
    *RAISED.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
}

/// Takes the exception behind an `EffectError::User`.
pub fn take() -> Option<PyErr> {
    RAISED.lock().unwrap_or_else(PoisonError::into_inner).take()
}
