//! `rust/device`: bytes of a sensor to arrays in SI units.

use imufit_device::mpu6050::{self, Frame, FullScale, Scales};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{Bytes, table};
use crate::computing::compute;
use crate::errors::input_error;

type Table<'py, T> = Bound<'py, PyArray2<T>>;
type Decoded<'py> = (
    Table<'py, f64>,
    Table<'py, f64>,
    Option<Bound<'py, PyArray1<f64>>>,
    Table<'py, bool>,
    Table<'py, bool>,
);

/// A burst of n whole MPU6050 frames, uint8, to acc (n, 3) m/s^2, gyr (n, 3) rad/s, temp (n,) degC or None, and whether
/// a channel of acc and of gyr (n, 3) stands at an end of the converter.
#[pyfunction]
#[pyo3(signature = (data, afs_sel=0, fs_sel=0, temperature=true))]
fn mpu6050_decode<'py>(
    py: Python<'py>,
    data: &Bound<'py, PyAny>,
    afs_sel: u8,
    fs_sel: u8,
    temperature: bool,
) -> PyResult<Decoded<'py>> {
    let data = Bytes::new("data", data)?;
    let bytes = data.values()?;
    let frame = if temperature {
        Frame::WithTemperature
    } else {
        Frame::WithoutTemperature
    };
    let scales = Scales::new(afs_sel, fs_sel).map_err(|error| input_error(py, error))?;
    let found = compute(py, || mpu6050::decode(bytes, frame, &scales))?;
    let readings = found.map_err(|error| input_error(py, error))?;
    Ok((
        table::<_, 3>(py, readings.acc)?,
        table::<_, 3>(py, readings.gyr)?,
        temperature.then(|| PyArray1::from_vec(py, readings.temp)),
        table::<_, 3>(py, readings.acc_clipped)?,
        table::<_, 3>(py, readings.gyr_clipped)?,
    ))
}

/// Addresses, registers, ranges and low-pass filters of the MPU6050, as its maker states them.
#[pyfunction]
fn mpu6050_facts(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let facts = PyDict::new(py);
    facts.set_item("address", mpu6050::ADDRESS)?;
    facts.set_item("address_ad0_high", mpu6050::ADDRESS_AD0_HIGH)?;
    let registers = PyDict::new(py);
    for (name, address) in mpu6050::REGISTERS {
        registers.set_item(name, address)?;
    }
    facts.set_item("registers", registers)?;
    let scales = |scales: [FullScale; 4]| PyList::new(py, scales.map(|scale| (scale.range, scale.sensitivity)));
    facts.set_item("acc", scales(mpu6050::ACCELEROMETER)?)?;
    facts.set_item("gyr", scales(mpu6050::GYRO)?)?;
    let low_pass = mpu6050::LOW_PASS.map(|filter| {
        (
            filter.acc_bandwidth,
            filter.acc_delay,
            filter.gyr_bandwidth,
            filter.gyr_delay,
            filter.gyr_rate,
        )
    });
    facts.set_item("low_pass", PyList::new(py, low_pass)?)?;
    Ok(facts)
}

/// Adds this file's functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(mpu6050_decode, m)?)?;
    m.add_function(wrap_pyfunction!(mpu6050_facts, m)?)
}
