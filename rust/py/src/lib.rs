//! The module `imufit._imufit`: registration, nothing else.
#![allow(missing_docs)]

use pyo3::prelude::*;

#[pymodule]
fn _imufit(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    Ok(())
}
