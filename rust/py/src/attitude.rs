//! `rust/attitude` for tables of quaternions. Rows that are no attitude (NaN, zero) give NaN.

use std::convert::Infallible;

use imufit_attitude::matrix::{matrix_from_quaternion, nearest_rotation, quaternion_from_matrix};
use imufit_attitude::{AttitudeError, Euler, Frame, Quaternion, Rmse};
use nalgebra::{Matrix3, Vector3};
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Mask, Rows, filled_rows};
use crate::computing::compute;
use crate::errors::from_attitude;

type Table<'py> = PyResult<Bound<'py, PyArray2<f64>>>;

/// A table of `C` numbers a row from a table of `A` numbers a row.
fn map_rows<'py, const A: usize, const C: usize>(
    py: Python<'py>,
    input: &Rows<'py, A>,
    convert: impl Fn(&[f64]) -> Option<[f64; C]> + Send,
) -> Table<'py> {
    let values = input.values()?;
    let fill = move |out: &mut [f64]| -> Result<(), Infallible> {
        for (row, out) in values.chunks_exact(A).zip(out.chunks_exact_mut(C)) {
            out.copy_from_slice(&convert(row).unwrap_or([f64::NAN; C]));
        }
        Ok(())
    };
    Ok(filled_rows::<C, _, _>(py, input.len(), fill, |never| match never {})?.0)
}

/// A table of `C` numbers a row from two tables with as many rows.
fn zip_rows<'py, const A: usize, const B: usize, const C: usize>(
    py: Python<'py>,
    a: &Rows<'py, A>,
    b: &Rows<'py, B>,
    convert: impl Fn(&[f64], &[f64]) -> Option<[f64; C]> + Send,
) -> Table<'py> {
    let (left, right) = (a.values()?, b.values()?);
    let fill = move |out: &mut [f64]| -> Result<(), Infallible> {
        for ((x, y), out) in left
            .chunks_exact(A)
            .zip(right.chunks_exact(B))
            .zip(out.chunks_exact_mut(C))
        {
            out.copy_from_slice(&convert(x, y).unwrap_or([f64::NAN; C]));
        }
        Ok(())
    };
    Ok(filled_rows::<C, _, _>(py, a.len(), fill, |never| match never {})?.0)
}

/// Products a * b of quaternions, row by row: (n, 4), scalar first.
#[pyfunction]
fn quaternion_product<'py>(py: Python<'py>, a: &Bound<'py, PyAny>, b: &Bound<'py, PyAny>) -> Table<'py> {
    let a = Rows::<4>::new("a", a)?;
    let b = Rows::<4>::with_rows("b", b, "a", a.len())?;
    zip_rows(py, &a, &b, |a, b| {
        Some((Quaternion::from_row(a)? * Quaternion::from_row(b)?).to_array())
    })
}

/// Quaternions (n, 4) of rotation vectors (n, 3), rad.
#[pyfunction]
fn quaternion_from_rotation_vector<'py>(py: Python<'py>, vector: &Bound<'py, PyAny>) -> Table<'py> {
    map_rows(py, &Rows::<3>::new("vector", vector)?, |r| {
        let r = Vector3::from_column_slice(r);
        r.norm_squared().is_finite().then(|| Quaternion::exp(&r).to_array())
    })
}

/// Attitudes (n, 4) after each of n turns (n, 3), rad, that follow one another, each about the axes of the body as it then stands; NaN is no
/// turn.
#[pyfunction]
fn chained_turns<'py>(py: Python<'py>, vector: &Bound<'py, PyAny>) -> Table<'py> {
    let vector = Rows::<3>::new("vector", vector)?;
    let values = vector.values()?;
    let fill = move |out: &mut [f64]| -> Result<(), Infallible> {
        let mut q = Quaternion::IDENTITY;
        for (turn, out) in values.chunks_exact(3).zip(out.chunks_exact_mut(4)) {
            let turn = Vector3::from_column_slice(turn);
            if turn.norm_squared().is_finite() {
                q = (q * Quaternion::exp(&turn)).renormalised();
            }
            out.copy_from_slice(&q.to_array());
        }
        Ok(())
    };
    Ok(filled_rows::<4, _, _>(py, vector.len(), fill, |never| match never {})?.0)
}

/// Rotation vectors (n, 3), rad, of quaternions (n, 4).
#[pyfunction]
fn rotation_vector_from_quaternion<'py>(py: Python<'py>, q: &Bound<'py, PyAny>) -> Table<'py> {
    map_rows(py, &Rows::<4>::new("q", q)?, |q| {
        Some(Quaternion::from_row(q)?.log().into())
    })
}

/// Roll, pitch, yaw (n, 3), rad, of quaternions (n, 4): R = Rz(yaw) Ry(pitch) Rx(roll), roll 0 at gimbal lock.
#[pyfunction]
fn euler_from_quaternion<'py>(py: Python<'py>, q: &Bound<'py, PyAny>) -> Table<'py> {
    map_rows(py, &Rows::<4>::new("q", q)?, |q| {
        let Euler { roll, pitch, yaw } = Euler::from_quaternion(Quaternion::from_row(q)?);
        Some([roll, pitch, yaw])
    })
}

/// Quaternions (n, 4) of roll, pitch, yaw (n, 3), rad.
#[pyfunction]
fn quaternion_from_euler<'py>(py: Python<'py>, euler: &Bound<'py, PyAny>) -> Table<'py> {
    map_rows(py, &Rows::<3>::new("euler", euler)?, |angles| {
        let [roll, pitch, yaw] = <[f64; 3]>::try_from(angles).ok()?;
        (roll + pitch + yaw)
            .is_finite()
            .then(|| Euler { roll, pitch, yaw }.to_quaternion().to_array())
    })
}

/// Matrices (n, 9), row by row, of quaternions (n, 4).
#[pyfunction]
fn matrix_from_quaternion_rows<'py>(py: Python<'py>, q: &Bound<'py, PyAny>) -> Table<'py> {
    map_rows(py, &Rows::<4>::new("q", q)?, |q| {
        let matrix = matrix_from_quaternion(Quaternion::from_row(q)?).transpose();
        <[f64; 9]>::try_from(matrix.as_slice()).ok()
    })
}

/// Quaternions (n, 4) of the rotations nearest to matrices (n, 9), row by row.
#[pyfunction]
fn quaternion_from_matrix_rows<'py>(py: Python<'py>, matrix: &Bound<'py, PyAny>) -> Table<'py> {
    map_rows(py, &Rows::<9>::new("matrix", matrix)?, |m| {
        let nearest = nearest_rotation(&Matrix3::from_row_slice(m))?;
        Some(quaternion_from_matrix(&nearest)?.to_array())
    })
}

/// Body vectors x (n, 3) in the reference frame: R(q) x.
#[pyfunction]
fn rotate<'py>(py: Python<'py>, q: &Bound<'py, PyAny>, x: &Bound<'py, PyAny>) -> Table<'py> {
    let q = Rows::<4>::new("q", q)?;
    let x = Rows::<3>::with_rows("x", x, "q", q.len())?;
    zip_rows(py, &q, &x, |q, x| {
        Some(Quaternion::from_row(q)?.rotate(&Vector3::from_column_slice(x)).into())
    })
}

/// Reference vectors x (n, 3) in the body frame: R(q)^T x.
#[pyfunction]
fn rotate_back<'py>(py: Python<'py>, q: &Bound<'py, PyAny>, x: &Bound<'py, PyAny>) -> Table<'py> {
    let q = Rows::<4>::new("q", q)?;
    let x = Rows::<3>::with_rows("x", x, "q", q.len())?;
    zip_rows(py, &q, &x, |q, x| {
        Some(
            Quaternion::from_row(q)?
                .rotate_back(&Vector3::from_column_slice(x))
                .into(),
        )
    })
}

/// Attitudes q (n, 4) in the frame `source`, told in the frame `target` ("NED", "ENU", "NWU").
#[pyfunction]
fn convert_frame<'py>(py: Python<'py>, q: &Bound<'py, PyAny>, source: &str, target: &str) -> Table<'py> {
    let (source, target): (Frame, Frame) = (
        source.parse().map_err(from_attitude)?,
        target.parse().map_err(from_attitude)?,
    );
    let turn = source.into_frame(target);
    map_rows(py, &Rows::<4>::new("q", q)?, |q| {
        Some((turn * Quaternion::from_row(q)?).to_array())
    })
}

/// Up, north and the magnetic field (uT) that is assumed where none is known, as vectors of a frame.
#[pyfunction]
fn frame_vectors<'py>(py: Python<'py>, frame: &str) -> PyResult<Bound<'py, PyDict>> {
    let frame: Frame = frame.parse().map_err(from_attitude)?;
    let vectors = PyDict::new(py);
    vectors.set_item("up", <[f64; 3]>::from(frame.up()))?;
    vectors.set_item("north", <[f64; 3]>::from(frame.north()))?;
    vectors.set_item("field", <[f64; 3]>::from(frame.default_field()))?;
    Ok(vectors)
}

/// Errors row by row, rad, (n, 6): total, heading, inclination, roll, pitch, yaw of e = estimate * reference^-1.
#[pyfunction]
fn attitude_errors<'py>(py: Python<'py>, estimate: &Bound<'py, PyAny>, reference: &Bound<'py, PyAny>) -> Table<'py> {
    let estimate = Rows::<4>::new("estimate", estimate)?;
    let reference = Rows::<4>::with_rows("reference", reference, "estimate", estimate.len())?;
    zip_rows(py, &estimate, &reference, |a, b| {
        let error = AttitudeError::between(Quaternion::from_row(a)?, Quaternion::from_row(b)?);
        let Euler { roll, pitch, yaw } = error.euler;
        Some([error.total, error.heading, error.inclination, roll, pitch, yaw])
    })
}

/// Root mean square errors, rad, over the rows with both attitudes (and mask True): a dict, or None without such a row.
#[pyfunction]
#[pyo3(signature = (estimate, reference, mask=None))]
fn attitude_rmse<'py>(
    py: Python<'py>,
    estimate: &Bound<'py, PyAny>,
    reference: &Bound<'py, PyAny>,
    mask: Option<&Bound<'py, PyAny>>,
) -> PyResult<Option<Bound<'py, PyDict>>> {
    let estimate = Rows::<4>::new("estimate", estimate)?;
    let reference = Rows::<4>::with_rows("reference", reference, "estimate", estimate.len())?;
    let mask = Mask::optional_with_rows("mask", mask, "estimate", estimate.len())?;
    let (a, b) = (estimate.values()?, reference.values()?);
    let flags = mask.as_ref().map(Mask::values).transpose()?;
    let Some(rmse) = compute(py, || Rmse::over(a, b, flags))?.map_err(from_attitude)? else {
        return Ok(None);
    };
    let errors = PyDict::new(py);
    let Rmse {
        rows,
        total,
        heading,
        inclination,
        roll,
        pitch,
        yaw,
        sd,
    } = rmse;
    errors.set_item("rows", rows)?;
    for (name, value) in [
        ("total", total),
        ("heading", heading),
        ("inclination", inclination),
        ("roll", roll),
        ("pitch", pitch),
        ("yaw", yaw),
        ("sd", sd),
    ] {
        errors.set_item(name, value)?;
    }
    Ok(Some(errors))
}

/// Adds this file's functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_function(wrap_pyfunction!(quaternion_product, m)?)?;
    m.add_function(wrap_pyfunction!(quaternion_from_rotation_vector, m)?)?;
    m.add_function(wrap_pyfunction!(chained_turns, m)?)?;
    m.add_function(wrap_pyfunction!(rotation_vector_from_quaternion, m)?)?;
    m.add_function(wrap_pyfunction!(euler_from_quaternion, m)?)?;
    m.add_function(wrap_pyfunction!(quaternion_from_euler, m)?)?;
    m.add_function(wrap_pyfunction!(matrix_from_quaternion_rows, m)?)?;
    m.add_function(wrap_pyfunction!(quaternion_from_matrix_rows, m)?)?;
    m.add_function(wrap_pyfunction!(rotate, m)?)?;
    m.add_function(wrap_pyfunction!(rotate_back, m)?)?;
    m.add_function(wrap_pyfunction!(convert_frame, m)?)?;
    m.add_function(wrap_pyfunction!(frame_vectors, m)?)?;
    m.add_function(wrap_pyfunction!(attitude_errors, m)?)?;
    m.add_function(wrap_pyfunction!(attitude_rmse, m)?)
}
