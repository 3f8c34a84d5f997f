//! The module `imufit._imufit`: registration, nothing else.
#![allow(clippy::needless_pass_by_value)] // arguments that pyo3 extracts are owned, and so are errors in `map_err`

mod allan;
mod arrays;
mod attitude;
mod calibration;
mod computing;
mod correction;
mod device;
mod errors;
mod filters;
mod fit;
mod inference;
mod model;
mod pyramid;
mod python_effect;
mod raised;
mod replay_arguments;
mod rests;
mod trials;
mod verdict;
mod window;
mod wire;

use pyo3::prelude::*;

#[pymodule]
fn _imufit(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("NORM_SEEN", imufit_calibration::norm_cost::SEEN)?;
    allan::register(m)?;
    attitude::register(m)?;
    calibration::register(m)?;
    device::register(m)?;
    wire::register(m)?;
    filters::register(m)?;
    trials::register(m)?;
    model::register(m)?;
    python_effect::register(m)?;
    correction::register(m)?;
    fit::register(m)?;
    rests::register(m)?;
    inference::register(m)?;
    verdict::register(m)?;
    pyramid::register(m)?;
    Ok(())
}
