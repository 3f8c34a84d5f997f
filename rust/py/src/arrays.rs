//! numpy arrays from and to slices: the one place that looks at shapes, types and memory.
//!
//! Nothing is copied. An array is taken as it is, C-contiguous float64, or refused with the argument's name, what came
//! and what to do. The borrow of rust-numpy is kept while the GIL is released; another Python thread that writes into
//! the array meanwhile is the caller's fault.

use numpy::{
    Element, PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArray,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::intern;
use pyo3::prelude::*;

/// A borrowed table of `n` rows with `C` numbers each, row by row; `C = 1` is a column of shape (n,).
pub struct Rows<'py, const C: usize> {
    array: PyReadonlyArrayDyn<'py, f64>,
    name: &'static str,
    n: usize,
}

/// A column of shape (n,).
pub type Column<'py> = Rows<'py, 1>;

impl<'py, const C: usize> Rows<'py, C> {
    /// The argument `name`: shape (n,) for `C = 1`, else (n, C).
    pub fn new(name: &'static str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let (array, n) = borrow::<f64, C>(name, value, "float64")?;
        Ok(Self { array, name, n })
    }

    /// The argument `name` with `n` rows, as many as `other` has.
    pub fn with_rows(name: &'static str, value: &Bound<'py, PyAny>, other: &str, n: usize) -> PyResult<Self> {
        let rows = Self::new(name, value)?;
        same_rows(name, rows.n, other, n)?;
        Ok(rows)
    }

    /// The argument `name` with `n` rows, as many as `other` has, if it is not `None`.
    pub fn optional_with_rows(
        name: &'static str,
        value: Option<&Bound<'py, PyAny>>,
        other: &str,
        n: usize,
    ) -> PyResult<Option<Self>> {
        value.map(|value| Self::with_rows(name, value, other, n)).transpose()
    }

    /// Rows.
    pub fn len(&self) -> usize {
        self.n
    }

    /// The numbers, row by row: `C * len()` of them.
    pub fn values(&self) -> PyResult<&[f64]> {
        self.array.as_slice().map_err(|_| not_contiguous(self.name))
    }
}

/// A borrowed mask of shape (n,), dtype bool.
pub struct Mask<'py> {
    array: PyReadonlyArrayDyn<'py, bool>,
    name: &'static str,
}

impl<'py> Mask<'py> {
    /// The argument `name` with `n` rows, as many as `other` has, if it is not `None`.
    pub fn optional_with_rows(
        name: &'static str,
        value: Option<&Bound<'py, PyAny>>,
        other: &str,
        n: usize,
    ) -> PyResult<Option<Self>> {
        let Some(value) = value else {
            return Ok(None);
        };
        let (array, came) = borrow::<bool, 1>(name, value, "bool")?;
        same_rows(name, came, other, n)?;
        Ok(Some(Self { array, name }))
    }

    /// The flags.
    pub fn values(&self) -> PyResult<&[bool]> {
        self.array.as_slice().map_err(|_| not_contiguous(self.name))
    }
}

/// A borrowed run of bytes, shape (n,), dtype uint8.
pub struct Bytes<'py> {
    array: PyReadonlyArrayDyn<'py, u8>,
    name: &'static str,
}

impl<'py> Bytes<'py> {
    /// The argument `name`.
    pub fn new(name: &'static str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let (array, _) = borrow::<u8, 1>(name, value, "uint8")?;
        Ok(Self { array, name })
    }

    /// The bytes.
    pub fn values(&self) -> PyResult<&[u8]> {
        self.array.as_slice().map_err(|_| not_contiguous(self.name))
    }
}

/// A table of rows with `C` values each that takes over the memory of `values`.
pub fn table<T: Element, const C: usize>(py: Python<'_>, values: Vec<T>) -> PyResult<Bound<'_, PyArray2<T>>> {
    let n = values.len() / C;
    PyArray1::from_vec(py, values).reshape([n, C])
}

/// A new table of `n` rows with `C` numbers each, filled by `fill`, which runs without the GIL.
pub fn filled_rows<const C: usize, T, E>(
    py: Python<'_>,
    n: usize,
    fill: impl Send + FnOnce(&mut [f64]) -> Result<T, E>,
    to_python: impl FnOnce(E) -> PyErr,
) -> PyResult<(Bound<'_, PyArray2<f64>>, T)>
where
    T: Send,
    E: Send,
{
    // numpy's empty: `fill` writes every number, and zeros first are felt beside a filter.
    let array = py
        .import(intern!(py, "numpy"))?
        .call_method1(intern!(py, "empty"), ((n, C),))?;
    let array = array.cast_into::<PyArray2<f64>>()?;
    let result = fill_array(
        py,
        array
            .try_readwrite()
            .map_err(|error| PyValueError::new_err(error.to_string()))?,
        fill,
    )?
    .map_err(to_python)?;
    Ok((array, result))
}

fn fill_array<D: numpy::ndarray::Dimension, R: Send>(
    py: Python<'_>,
    mut array: PyReadwriteArray<'_, f64, D>,
    fill: impl Send + FnOnce(&mut [f64]) -> R,
) -> PyResult<R> {
    let values = array.as_slice_mut()?;
    #[allow(clippy::disallowed_methods)] // it looks for Ctrl-C, which Python tells the thread that asked
    let filled = py.detach(|| fill(values));
    Ok(filled)
}

/// Three numbers `[x, y, z]`, finite, from any sequence.
pub fn vector(name: &str, value: &Bound<'_, PyAny>) -> PyResult<[f64; 3]> {
    numbers(name, value, "three numbers x, y, z")
}

/// Three numbers `[x, y, z]` from an array or any other sequence; NaN and infinity pass.
pub fn reading(name: &str, value: &Bound<'_, PyAny>) -> PyResult<[f64; 3]> {
    if let Ok(array) = value.cast::<PyArray1<f64>>()
        && let Ok(values) = array.try_readonly()
        && let Ok(&[x, y, z]) = values.as_slice()
    {
        return Ok([x, y, z]);
    }
    let refuse = |came: String| PyValueError::new_err(format!("{name} is {came}: pass three numbers x, y, z"));
    let values: Vec<f64> = value.extract().map_err(|_| refuse(describe(value)))?;
    <[f64; 3]>::try_from(values).map_err(|values| refuse(format!("{} numbers", values.len())))
}

/// A quaternion `[w, x, y, z]` from any sequence.
pub fn quaternion(name: &str, value: &Bound<'_, PyAny>) -> PyResult<imufit_attitude::Quaternion> {
    let [w, x, y, z] = numbers(name, value, "a quaternion w, x, y, z (scalar first)")?;
    imufit_attitude::Quaternion::new(w, x, y, z)
        .ok_or_else(|| PyValueError::new_err(format!("{name} is zero: pass a quaternion w, x, y, z (scalar first)")))
}

fn numbers<const C: usize>(name: &str, value: &Bound<'_, PyAny>, wanted: &str) -> PyResult<[f64; C]> {
    let refuse = |came: String| PyValueError::new_err(format!("{name} is {came}: pass {wanted}"));
    let values: Vec<f64> = value.extract().map_err(|_| refuse(describe(value)))?;
    if !values.iter().all(|x| x.is_finite()) {
        return Err(refuse(format!("{values:?}, not finite")));
    }
    <[f64; C]>::try_from(values).map_err(|values| refuse(format!("{} numbers", values.len())))
}

fn borrow<'py, T: Element, const C: usize>(
    name: &'static str,
    value: &Bound<'py, PyAny>,
    dtype: &str,
) -> PyResult<(PyReadonlyArrayDyn<'py, T>, usize)> {
    let untyped = value.cast::<PyUntypedArray>().map_err(|_| {
        let came = describe(value);
        PyTypeError::new_err(format!(
            "{name} is {came}: pass a numpy array (np.asarray({name}, dtype={dtype}))"
        ))
    })?;
    let n = rows::<C>(name, untyped.shape())?;
    let array = value.cast::<PyArrayDyn<T>>().map_err(|_| {
        let came = untyped.dtype();
        let order = if came.is_native_byteorder() == Some(false) {
            ", other byte order"
        } else {
            ""
        };
        PyTypeError::new_err(format!(
            "{name} has dtype {came}{order}: it must be {dtype}. Pass np.ascontiguousarray({name}, dtype={dtype})."
        ))
    })?;
    let aligned: bool = value.getattr("flags")?.getattr("aligned")?.extract()?;
    if !(array.is_c_contiguous() && aligned) {
        return Err(not_contiguous(name));
    }
    let borrowed = array
        .try_readonly()
        .map_err(|_| PyValueError::new_err(format!("{name} is being written to by another call: pass a copy")))?;
    Ok((borrowed, n))
}

/// The number of rows of a shape (n,) or (n, C).
fn rows<const C: usize>(name: &str, shape: &[usize]) -> PyResult<usize> {
    let came = match shape {
        [n] => format!("({n},)"),
        _ => format!(
            "({})",
            shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
        ),
    };
    let refuse = |wanted: String| Err(PyValueError::new_err(format!("{name} has shape {came}: {wanted}")));
    match *shape {
        [n] if C == 1 => Ok(n),
        [n, columns] if C > 1 && columns == C => Ok(n),
        [_, 1] | [1, _] if C == 1 => refuse(format!("it must be one number per sample, (n,). Pass {name}.ravel().")),
        [columns, _] if C > 1 && columns == C => refuse(format!(
            "rows must be samples, (n, {C}). Pass np.ascontiguousarray({name}.T)."
        )),
        _ if C == 1 => refuse("it must be one number per sample, (n,).".to_owned()),
        _ => refuse(format!("rows must be samples, (n, {C}).")),
    }
}

fn not_contiguous(name: &str) -> PyErr {
    PyValueError::new_err(format!(
        "{name} is not C-contiguous (a slice or a transpose of another array): pass np.ascontiguousarray({name})."
    ))
}

/// Refuses the argument `name` unless it has as many rows as `other`.
pub fn same_rows(name: &str, came: usize, other: &str, expected: usize) -> PyResult<()> {
    if came == expected {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "{name} has {came} rows but {other} has {expected}: pass one row per sample"
    )))
}

fn describe(value: &Bound<'_, PyAny>) -> String {
    value
        .get_type()
        .name()
        .map_or_else(|_| "an object".to_owned(), |name| format!("of type {name}"))
}
