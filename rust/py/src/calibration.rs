//! `rust/calibration`: the judge of poses, and the three costs.

use std::collections::HashMap;

use imufit_calibration::CalibrationError;
use imufit_calibration::affine::Affine;
use imufit_calibration::criteria::Criteria;
use imufit_calibration::norm_cost::{self, Weighing};
use imufit_calibration::pose::{Flaw, Pose};
use imufit_calibration::pose_judge::{PoseJudge, State};
use imufit_calibration::rests::{self, Readings};
use imufit_calibration::side::Side;
use imufit_calibration::solution::{Elements, Form, Solution};
use imufit_calibration::{turns, vector_cost};
use nalgebra::{DMatrix, Matrix3, Rotation3, Vector3};
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::arrays::{Column, Rows, vector};
use crate::computing::compute;
use crate::errors::{input_error, value_error};

/// Criteria by name, the others at their defaults.
fn criteria(settings: Option<HashMap<String, f64>>) -> PyResult<Criteria> {
    let mut criteria = Criteria::default();
    for (name, value) in settings.unwrap_or_default() {
        if !(value > 0.0 && value.is_finite()) {
            return Err(value_error(format!("{name} is {value}: pass a number above zero")));
        }
        match name.as_str() {
            "window" => criteria.window = value,
            "hold" => criteria.hold = value,
            "fewest" => criteria.fewest = (value as usize).max(2),
            "bridge" => criteria.bridge = value,
            "creep" => criteria.creep = value,
            "acc_noise" => criteria.acc_noise = Some(value),
            "gyr_noise" => criteria.gyr_noise = Some(value),
            _ => {
                return Err(value_error(format!(
                    "{name} is no criterion: use window, hold, fewest, bridge, creep, acc_noise or gyr_noise"
                )));
            }
        }
    }
    Ok(criteria)
}

fn three(v: &Vector3<f64>) -> [f64; 3] {
    [v.x, v.y, v.z]
}

fn pose_dict<'py>(py: Python<'py>, pose: &Pose) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("rows", pose.rows)?;
    dict.set_item("time", pose.time)?;
    dict.set_item("knocks", pose.knocks.clone())?;
    dict.set_item("n", pose.n)?;
    dict.set_item("mean", three(&pose.mean))?;
    dict.set_item("deviation", three(&pose.deviation))?;
    dict.set_item("variance", three(&pose.variance))?;
    dict.set_item("rate", pose.rate.as_ref().map(|(mean, _)| three(mean)))?;
    dict.set_item("rate_variance", pose.rate.as_ref().map(|(_, variance)| three(variance)))?;
    dict.set_item("side", pose.side.number())?;
    dict.set_item("label", pose.label.map(Side::number))?;
    let flaw = pose.flaw.as_ref().map(|flaw| match flaw {
        Flaw::Short(seconds) => ("short", *seconds),
        Flaw::Crept(angle) => ("crept", *angle),
        Flaw::Unsteady(times) => ("unsteady", *times),
    });
    dict.set_item("flaw", flaw)?;
    Ok(dict)
}

/// Poses of a whole log: `labels` (n,) holds the number of a side in +x -x +y -y +z -z, or -1.
#[pyfunction]
#[pyo3(signature = (t, acc, gyr=None, labels=None, settings=None))]
fn find_rests<'py>(
    py: Python<'py>,
    t: &Bound<'py, PyAny>,
    acc: &Bound<'py, PyAny>,
    gyr: Option<&Bound<'py, PyAny>>,
    labels: Option<&Bound<'py, PyAny>>,
    settings: Option<HashMap<String, f64>>,
) -> PyResult<Bound<'py, PyDict>> {
    let t = Column::new("t", t)?;
    let n = t.len();
    let acc = Rows::<3>::with_rows("acc", acc, "t", n)?;
    let gyr = Rows::<3>::optional_with_rows("gyr", gyr, "t", n)?;
    let labels = Rows::<1>::optional_with_rows("labels", labels, "t", n)?;
    let criteria = criteria(settings)?;
    let readings = Readings {
        t: t.values()?,
        acc: acc.values()?,
        gyr: gyr.as_ref().map(Rows::values).transpose()?,
    };
    let sides: Option<Vec<Option<Side>>> = labels.as_ref().map(Rows::values).transpose()?.map(|values| {
        let side = |v: &f64| if *v >= 0.0 { Side::new(*v as usize) } else { None };
        values.iter().map(side).collect()
    });
    let found = compute(py, || rests::find(&readings, sides.as_deref(), &criteria))?;
    let dict = PyDict::new(py);
    let poses: PyResult<Vec<_>> = found.poses.iter().map(|pose| pose_dict(py, pose)).collect();
    dict.set_item("poses", PyList::new(py, poses?)?)?;
    dict.set_item("acc_noise", found.noise.0)?;
    dict.set_item("gyr_noise", found.noise.1)?;
    dict.set_item("step", found.step)?;
    Ok(dict)
}

/// Judges sample after sample whether the sensor lies still, long enough, and which side is up.
#[pyclass(name = "PoseJudge", module = "imufit._imufit")]
struct PyPoseJudge(PoseJudge);

#[pymethods]
impl PyPoseJudge {
    /// A judge with some criteria by name, the others at their defaults.
    #[new]
    #[pyo3(signature = (settings=None))]
    fn new(settings: Option<HashMap<String, f64>>) -> PyResult<Self> {
        Ok(Self(PoseJudge::new(criteria(settings)?)))
    }

    /// Judges one sample: t (s), acc (three numbers, m/s^2), gyr (three numbers, rad/s, or None); NaN is missing.
    #[pyo3(signature = (t, acc, gyr=None))]
    fn step<'py>(
        &mut self,
        py: Python<'py>,
        t: f64,
        acc: [f64; 3],
        gyr: Option<[f64; 3]>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let judged = self.0.step(t, acc.into(), gyr.map(Vector3::from));
        let dict = PyDict::new(py);
        dict.set_item(
            "state",
            match judged.state {
                State::Moving => "moving",
                State::Settling => "settling",
                State::Held => "held",
            },
        )?;
        dict.set_item("side", judged.side.map(Side::number))?;
        dict.set_item("progress", judged.progress)?;
        dict.set_item("unrest", judged.unrest)?;
        dict.set_item("open", judged.open)?;
        dict.set_item("closed", judged.closed.map(|p| pose_dict(py, &p)).transpose()?)?;
        Ok(dict)
    }

    /// Ends the stream: the open pose, if there is one.
    fn finish<'py>(&mut self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        self.0.finish().map(|p| pose_dict(py, &p)).transpose()
    }
}

fn nested(matrix: &Matrix3<f64>) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
}

fn rows_of<'py>(py: Python<'py>, values: &[Vector3<f64>]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = values.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
    PyArray1::from_vec(py, flat).reshape([values.len(), 3])
}

fn matrix_of<'py>(py: Python<'py>, values: &DMatrix<f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let flat: Vec<f64> = values.transpose().iter().copied().collect();
    PyArray1::from_vec(py, flat).reshape([values.nrows(), values.ncols()])
}

/// A solution in paper A's form and as a sensor model.
fn solution_dict<'py>(py: Python<'py>, solution: &Solution, affine: &Affine) -> PyResult<Bound<'py, PyDict>> {
    let unusable = || {
        input_error(
            py,
            "the readings do not react to the motion on some axis: nothing can be inverted",
        )
    };
    let dict = PyDict::new(py);
    let split = affine.split().ok_or_else(unusable)?;
    let forward = affine.forward().ok_or_else(unusable)?;
    let (split_errors, forward_errors) = affine.errors(&solution.affine_covariance()).ok_or_else(unusable)?;
    dict.set_item("matrix", nested(&affine.matrix))?;
    dict.set_item("bias", three(&affine.offset))?;
    dict.set_item("scale", three(&split.scale))?;
    dict.set_item("misalignment", nested(&split.misalignment))?;
    dict.set_item("scale_error", three(&split_errors.scale))?;
    dict.set_item("misalignment_error", nested(&split_errors.misalignment))?;
    let errors = solution.errors();
    let b = solution.form.of_matrix();
    dict.set_item("bias_error", [errors[b], errors[b + 1], errors[b + 2]])?;
    dict.set_item("model_gain", nested(&forward.gain))?;
    dict.set_item("model_bias", three(&forward.bias))?;
    dict.set_item("model_gain_error", nested(&forward_errors.gain))?;
    dict.set_item("model_bias_error", three(&forward_errors.bias))?;
    let (c, d) = solution.form.temperature(&solution.parameters);
    let (c_error, d_error) = solution.form.temperature(&errors);
    // First order in the temperature: reading = (I + gain + s T) x + bias + k T undoes A y + b + c T + d T y.
    let g = Matrix3::identity() + forward.gain;
    let s = -(g * Matrix3::from_diagonal(&d) * g).diagonal();
    let k = -(g * c) + Matrix3::from_diagonal(&s) * affine.matrix * forward.bias;
    dict.set_item("model_scale_temperature", three(&s))?;
    dict.set_item("model_bias_temperature", three(&k))?;
    dict.set_item("model_scale_temperature_error", three(&d_error))?;
    dict.set_item("model_bias_temperature_error", three(&c_error))?;
    let first = solution.form.parameters();
    dict.set_item(
        "extra",
        solution.parameters.iter().skip(first).copied().collect::<Vec<f64>>(),
    )?;
    dict.set_item("extra_error", errors.iter().skip(first).copied().collect::<Vec<f64>>())?;
    dict.set_item("condition", solution.condition)?;
    dict.set_item("freedom", solution.freedom)?;
    dict.set_item("excess", solution.excess.sqrt())?;
    dict.set_item("residuals", rows_of(py, &solution.residuals)?)?;
    dict.set_item("held_out", rows_of(py, &solution.held_out)?)?;
    dict.set_item("held_out_length", PyArray1::from_slice(py, &solution.held_out_length))?;
    dict.set_item("correlation", matrix_of(py, &solution.correlation())?)?;
    Ok(dict)
}

fn from_calibration(py: Python<'_>, error: CalibrationError) -> PyErr {
    input_error(py, error)
}

fn vectors(rows: &Rows<'_, 3>) -> PyResult<Vec<Vector3<f64>>> {
    Ok(rows.values()?.chunks_exact(3).map(Vector3::from_column_slice).collect())
}

/// Paper A's vector cost: readings, their variances and the targets (n, 3), m/s^2.
///
/// `tilt` (n, 6) has the targets' change by a tilt of the table about its x and its y axis; with it the tilt is fitted.
#[pyfunction]
#[pyo3(signature = (
    readings, variances, targets, gravity, tilt=None, temperature=None, scale_temperature=false, leave_out=true
))]
#[allow(clippy::too_many_arguments)] // keyword arguments of one Python call
fn vector_calibration<'py>(
    py: Python<'py>,
    readings: &Bound<'py, PyAny>,
    variances: &Bound<'py, PyAny>,
    targets: &Bound<'py, PyAny>,
    gravity: f64,
    tilt: Option<&Bound<'py, PyAny>>,
    temperature: Option<&Bound<'py, PyAny>>,
    scale_temperature: bool,
    leave_out: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let readings = Rows::<3>::new("readings", readings)?;
    let n = readings.len();
    let variances = Rows::<3>::with_rows("variances", variances, "readings", n)?;
    let targets = Rows::<3>::with_rows("targets", targets, "readings", n)?;
    let tilt = Rows::<6>::optional_with_rows("tilt", tilt, "readings", n)?;
    let temperature = Column::optional_with_rows("temperature", temperature, "readings", n)?;
    let (readings, variances, targets) = (vectors(&readings)?, vectors(&variances)?, vectors(&targets)?);
    let tilts = tilt.as_ref().map(Rows::values).transpose()?;
    let temperatures = temperature.as_ref().map(Rows::values).transpose()?;
    let items: Vec<vector_cost::Item> = (0..n)
        .map(|k| vector_cost::Item {
            reading: readings[k],
            variance: variances[k],
            target: targets[k],
            tilt: std::array::from_fn(|axis| {
                tilts.map_or(Vector3::zeros(), |t| {
                    Vector3::from_column_slice(&t[6 * k + 3 * axis..6 * k + 3 * axis + 3])
                })
            }),
            temperature: temperatures.map_or(0.0, |t| t[k]),
        })
        .collect();
    let form = Form {
        bias_temperature: temperatures.is_some(),
        scale_temperature: temperatures.is_some() && scale_temperature,
        ..Form::FULL
    };
    let solution = compute(py, || {
        vector_cost::fit(&items, form, tilts.is_some(), gravity, leave_out)
    })?
    .map_err(|error| from_calibration(py, error))?;
    solution_dict(py, &solution, &solution.affine())
}

/// Paper A's magnitude cost: corrected readings (n, 3) have the length `length`; `groups` (n,) are left out together.
///
/// `variances` (n,) of the lengths makes the readings means of poses; without them they are single readings in motion,
/// weighed by their own scatter. `up` (n, 3), unit vectors or NaN, adds the constant dip. Without `misalignment` scale
/// and bias alone are fitted.
#[pyfunction]
#[pyo3(signature = (
    readings, groups, length, variances=None, up=None, temperature=None, scale_temperature=false, misalignment=true,
    leave_out=true
))]
#[allow(clippy::too_many_arguments)] // keyword arguments of one Python call
fn magnitude_calibration<'py>(
    py: Python<'py>,
    readings: &Bound<'py, PyAny>,
    groups: &Bound<'py, PyAny>,
    length: f64,
    variances: Option<&Bound<'py, PyAny>>,
    up: Option<&Bound<'py, PyAny>>,
    temperature: Option<&Bound<'py, PyAny>>,
    scale_temperature: bool,
    misalignment: bool,
    leave_out: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let readings = Rows::<3>::new("readings", readings)?;
    let n = readings.len();
    let groups = Column::with_rows("groups", groups, "readings", n)?;
    let variances = Column::optional_with_rows("variances", variances, "readings", n)?;
    let up = Rows::<3>::optional_with_rows("up", up, "readings", n)?;
    let temperature = Column::optional_with_rows("temperature", temperature, "readings", n)?;
    let readings = vectors(&readings)?;
    let groups = groups.values()?;
    let weights = variances.as_ref().map(Rows::values).transpose()?;
    let ups = up.as_ref().map(vectors).transpose()?;
    let temperatures = temperature.as_ref().map(Rows::values).transpose()?;
    let items: Vec<norm_cost::Item> = (0..n)
        .map(|k| norm_cost::Item {
            reading: readings[k],
            variance: weights.map_or(0.0, |w| w[k]),
            up: ups.as_ref().map(|u| u[k]).filter(|u| u.iter().all(|x| x.is_finite())),
            temperature: temperatures.map_or(0.0, |t| t[k]),
            group: groups[k].max(0.0) as usize,
        })
        .collect();
    let form = Form {
        bias_temperature: temperatures.is_some(),
        scale_temperature: temperatures.is_some() && scale_temperature,
        matrix: if misalignment {
            Elements::Symmetric
        } else {
            Elements::Diagonal
        },
    };
    let weighing = if weights.is_some() {
        Weighing::Poses
    } else {
        Weighing::Readings
    };
    let solution = compute(py, || {
        norm_cost::fit(&items, form, ups.is_some(), length, weighing, leave_out)
    })?
    .map_err(|error| from_calibration(py, error))?;
    solution_dict(py, &solution, &solution.affine())
}

/// A turn as Python hands it over: first and last row, bias before and after, up before and after, variance.
type Span = (usize, usize, [f64; 3], [f64; 3], [f64; 3], [f64; 3], f64);

fn turns_of(t: &[f64], gyr: &[f64], spans: &[Span]) -> PyResult<Vec<turns::Turn>> {
    let one = |(first, last, before, after, up_before, up_after, variance): &Span| {
        if *first >= *last || *last >= t.len() {
            return Err(value_error(format!(
                "the turn from row {first} to row {last} lies outside the log"
            )));
        }
        let (before, after) = (Vector3::from(*before), Vector3::from(*after));
        let length = t[*last] - t[*first];
        let rows = (*first..=*last).filter(|row| gyr[3 * row..3 * row + 3].iter().all(|x| x.is_finite()));
        let (times, rate) = rows
            .map(|row| {
                let share = (t[row] - t[*first]) / length;
                let rate = Vector3::from_column_slice(&gyr[3 * row..3 * row + 3]);
                (t[row], rate - before * (1.0 - share) - after * share)
            })
            .unzip();
        Ok(turns::Turn {
            t: times,
            rate,
            up: [Vector3::from(*up_before), Vector3::from(*up_after)],
            variance: *variance,
        })
    };
    spans.iter().map(one).collect()
}

/// Gyro against gravity: turns from rest to rest, `t` (n,) s and `gyr` (n, 3) rad/s. `bias` is that of the readings. The angles that the
/// turns miss are given with the bias taken out (`before`) and by the readings `as_read`.
#[pyfunction]
fn turn_calibration<'py>(
    py: Python<'py>,
    t: &Bound<'py, PyAny>,
    gyr: &Bound<'py, PyAny>,
    spans: Vec<Span>,
    bias: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyDict>> {
    let t = Column::new("t", t)?;
    let gyr = Rows::<3>::with_rows("gyr", gyr, "t", t.len())?;
    let bias = Vector3::from(vector("bias", bias)?);
    let turns = turns_of(t.values()?, gyr.values()?, &spans)?;
    let solution = compute(py, || turns::fit(&turns))?.map_err(|error| from_calibration(py, error))?;
    let dict = solution_dict(py, &solution, &turns::affine(&solution, &bias))?;
    let as_read: Vec<Span> = spans
        .iter()
        .map(|&(a, b, _, _, up, then, v)| (a, b, [0.0; 3], [0.0; 3], up, then, v))
        .collect();
    let as_read = turns_of(t.values()?, gyr.values()?, &as_read)?;
    for (name, turns) in [("before", &turns), ("as_read", &as_read)] {
        let missed: Vec<f64> = turns.iter().map(|turn| turn.angle(&Matrix3::identity())).collect();
        dict.set_item(name, PyArray1::from_vec(py, missed))?;
    }
    let way: Vec<f64> = turns.iter().map(turns::Turn::way).collect();
    dict.set_item("way", PyArray1::from_vec(py, way))?;
    Ok(dict)
}

/// Attitudes (n, 9), body to table row by row, of poses with these `sides` (n, 3) up, from the turns between them.
///
/// `spans` has a turn or None for each pair of neighbours; None is returned where the headings do not follow.
#[pyfunction]
fn table_attitudes<'py>(
    py: Python<'py>,
    t: &Bound<'py, PyAny>,
    gyr: &Bound<'py, PyAny>,
    spans: Vec<Option<Span>>,
    sides: &Bound<'py, PyAny>,
    matrix: [[f64; 3]; 3],
) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
    let t = Column::new("t", t)?;
    let gyr = Rows::<3>::with_rows("gyr", gyr, "t", t.len())?;
    let sides = vectors(&Rows::<3>::new("sides", sides)?)?;
    let matrix = Matrix3::from_fn(|i, j| matrix[i][j]);
    let rotations: PyResult<Vec<Option<Rotation3<f64>>>> = spans
        .into_iter()
        .map(|span| {
            let Some(span) = span else { return Ok(None) };
            let turns = turns_of(t.values()?, gyr.values()?, &[span])?;
            Ok(turns.first().map(|turn| turn.integrate(&matrix).0))
        })
        .collect();
    let Some(attitudes) = turns::attitudes_on_table(&sides, &rotations?) else {
        return Ok(None);
    };
    let flat: Vec<f64> = attitudes
        .iter()
        .flat_map(|r| r.matrix().transpose().iter().copied().collect::<Vec<f64>>())
        .collect();
    Ok(Some(PyArray1::from_vec(py, flat).reshape([attitudes.len(), 9])?))
}

/// Centre and radius of the sphere nearest to readings (n, 3), or None.
#[pyfunction]
fn sphere(readings: &Bound<'_, PyAny>) -> PyResult<Option<([f64; 3], f64)>> {
    let readings = vectors(&Rows::<3>::new("readings", readings)?)?;
    Ok(norm_cost::sphere(readings.into_iter()).map(|(centre, radius)| (three(&centre), radius)))
}

/// Adds this file's class and functions to the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<PyPoseJudge>()?;
    m.add_function(wrap_pyfunction!(find_rests, m)?)?;
    m.add_function(wrap_pyfunction!(vector_calibration, m)?)?;
    m.add_function(wrap_pyfunction!(magnitude_calibration, m)?)?;
    m.add_function(wrap_pyfunction!(turn_calibration, m)?)?;
    m.add_function(wrap_pyfunction!(table_attitudes, m)?)?;
    m.add_function(wrap_pyfunction!(sphere, m)?)
}
