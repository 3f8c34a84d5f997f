//! The module `imufit._imufit`: registration, nothing else.
#![allow(missing_docs)]

mod arrays;
mod attitude;
mod errors;
mod filters;
mod fit;
mod inference;
mod model;
mod python_effect;
mod window;

use pyo3::prelude::*;

#[pymodule]
fn _imufit(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    attitude::register(m)?;
    filters::register(m)?;
    model::register(m)?;
    fit::register(m)?;
    inference::register(m)?;
    Ok(())
}
