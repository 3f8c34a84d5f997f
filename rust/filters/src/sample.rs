//! What a filter is given: readings with the time they stand for, and the surroundings.

use imufit_attitude::Frame;
use nalgebra::Vector3;

use crate::FilterError;

/// Specific force in the body frame, m/s^2: points up at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpecificForce(pub Vector3<f64>);

/// Angular rate of the body in the body frame, rad/s, right-handed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AngularRate(pub Vector3<f64>);

/// Magnetic flux density in the body frame, uT.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FluxDensity(pub Vector3<f64>);

/// A sensor of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor {
    /// Accelerometer.
    Acc,
    /// Gyroscope.
    Gyr,
    /// Magnetometer.
    Mag,
}

impl Sensor {
    /// The prefix of its columns.
    pub fn name(self) -> &'static str {
        match self {
            Self::Acc => "acc",
            Self::Gyr => "gyr",
            Self::Mag => "mag",
        }
    }
}

/// A usable reading and the time it stands for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading<T> {
    /// Finite; not zero for a direction.
    pub value: T,
    /// Time since the last usable reading of the same sensor, s; 0 for the first one and after a gap.
    pub dt: f64,
}

/// One step's input: what is usable of one row.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Mean angular rate over `dt`, from the rates at both ends (trapezoidal rule).
    pub omega: Option<Reading<AngularRate>>,
    /// The turn by `omega` that no reading confirms, rad: standard deviation about each axis ([`crate::bridge`](crate)).
    pub unsure_turn: f64,
    /// Standard deviation of the angle between `f` and the vertical, rad: what an acceleration adds to the noise.
    pub unsure_tilt: f64,
    /// Specific force that is fit to show the vertical (no free fall).
    pub f: Option<Reading<SpecificForce>>,
    /// Flux density.
    pub m: Option<Reading<FluxDensity>>,
}

impl Sample {
    /// The directions of this sample as those of a first row.
    #[must_use]
    pub fn without_time(self) -> Self {
        Self {
            omega: None,
            unsure_turn: 0.0,
            unsure_tilt: 0.0,
            f: self.f.map(|f| Reading { dt: 0.0, ..f }),
            m: self.m.map(|m| Reading { dt: 0.0, ..m }),
        }
    }
}

/// The reference frame and what points where in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Environment {
    frame: Frame,
    gravity: f64,
    field_north: Vector3<f64>,
    field: Option<Vector3<f64>>,
}

impl Environment {
    /// A frame, the magnitude of gravity (m/s^2) and, where it is known, the magnetic flux density in the reference
    /// frame (uT). Most filters use only its horizontal direction, and `quest` its dip as well; without one the field
    /// points north.
    pub fn new(frame: Frame, gravity: f64, field: Option<Vector3<f64>>) -> Result<Self, FilterError> {
        if !(gravity.is_finite() && gravity > 0.0) {
            return Err(FilterError::Environment(format!(
                "gravity is {gravity} m/s^2: give a positive magnitude"
            )));
        }
        let field_north = match field {
            None => frame.north(),
            Some(m) => horizontal(&m, &frame.up(), 1e-6).ok_or_else(|| {
                FilterError::Environment(format!(
                    "mag_reference [{}, {}, {}] has no horizontal part, so that it shows no heading: leave it out",
                    m.x, m.y, m.z
                ))
            })?,
        };
        Ok(Self {
            frame,
            gravity,
            field_north,
            field: field.and_then(|m| m.try_normalize(0.0)),
        })
    }

    /// The reference frame.
    pub fn frame(&self) -> Frame {
        self.frame
    }

    /// Magnitude of gravity, m/s^2.
    pub fn gravity(&self) -> f64 {
        self.gravity
    }

    /// The vertical: direction of the specific force at rest.
    pub fn up(&self) -> Vector3<f64> {
        self.frame.up()
    }

    /// Direction of the field's horizontal part, in the reference frame (north where no field is given).
    pub fn field_north(&self) -> Vector3<f64> {
        self.field_north
    }

    /// Direction of the whole field, in the reference frame, where one is given.
    pub fn field(&self) -> Option<Vector3<f64>> {
        self.field
    }
}

/// The direction of `m` across `up`; `None` where the sine of the angle between them is below `sine`.
pub(crate) fn horizontal(m: &Vector3<f64>, up: &Vector3<f64>, sine: f64) -> Option<Vector3<f64>> {
    let direction = m.try_normalize(0.0)?;
    let across = direction - up * direction.dot(up);
    let length = across.norm();
    (length.is_finite() && length >= sine && length > 0.0).then(|| across / length)
}
