//! Ideal readings: what a perfect sensor would have read, and how fast that changes.
//!
//! f = R^T (a - g), omega from the reference attitude, m = R^T m_ref with R body to reference.

use nalgebra::{UnitQuaternion, Vector3};

use crate::facts::LogFacts;
use crate::reference::{self, Kinematics, Widths};
use crate::triple::Triple;
use crate::window::Window;

/// What effects of the reference change before the ideal readings are taken.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceChange {
    /// The reference is late by this much, s: it is read at t + delay.
    pub delay: f64,
    /// Turns vectors of the reference's body frame into the sensor's: x_sensor = alignment^-1 x.
    pub alignment: UnitQuaternion<f64>,
    /// Turns vectors of the true reference frame into the recorded one (a table that is not level).
    pub tilt: UnitQuaternion<f64>,
}

impl Default for ReferenceChange {
    fn default() -> Self {
        Self {
            delay: 0.0,
            alignment: UnitQuaternion::identity(),
            tilt: UnitQuaternion::identity(),
        }
    }
}

impl ReferenceChange {
    /// Both changes, one after the other.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            delay: self.delay + other.delay,
            alignment: self.alignment * other.alignment,
            tilt: self.tilt * other.tilt,
        }
    }
}

/// Ideal readings of the core rows of a window, with their time derivatives. NaN where the reference does not tell.
#[derive(Clone, Debug, Default)]
pub struct Ideal {
    /// Angular rate, rad/s.
    pub omega: Triple,
    /// Angular acceleration, rad/s^2.
    pub alpha: Triple,
    /// Specific force, m/s^2.
    pub f: Triple,
    /// Its time derivative in the body frame.
    pub f_rate: Triple,
    /// Magnetic flux density, uT.
    pub m: Triple,
    /// Its time derivative in the body frame.
    pub m_rate: Triple,
    /// Attitude of the sensor, body to reference frame.
    pub attitude: Vec<UnitQuaternion<f64>>,
}

impl Ideal {
    /// Ideal readings of the window's core rows.
    pub fn new(window: &Window, facts: &LogFacts, change: &ReferenceChange) -> Self {
        let spacing = Some(facts.reference_dt);
        let rows = reference::kinematics(
            window,
            Widths {
                value: facts.attitude_smoothing,
                columns: facts.attitude_columns,
            },
            facts.position_smoothing.map(|value| Widths {
                value,
                columns: facts.position_columns.unwrap_or(value),
            }),
            spacing,
            change.delay,
        );
        let mut ideal = Self::default();
        for k in &rows {
            ideal.push(k.as_ref(), facts, change);
        }
        ideal
    }

    fn push(&mut self, k: Option<&Kinematics>, facts: &LogFacts, change: &ReferenceChange) {
        let Some(k) = k else {
            let nan = Vector3::repeat(f64::NAN);
            for triple in [
                &mut self.omega,
                &mut self.alpha,
                &mut self.f,
                &mut self.f_rate,
                &mut self.m,
                &mut self.m_rate,
            ] {
                triple.push(&nan);
            }
            self.attitude.push(UnitQuaternion::identity());
            return;
        };
        let attitude = change.tilt * k.attitude * change.alignment;
        let omega = change.alignment.inverse_transform_vector(&k.omega);
        let alpha = change.alignment.inverse_transform_vector(&k.alpha);
        let f = attitude.inverse_transform_vector(&(k.acceleration - facts.gravity));
        let f_rate = attitude.inverse_transform_vector(&k.jerk) - omega.cross(&f);
        let m = attitude.inverse_transform_vector(&facts.field);
        self.omega.push(&omega);
        self.alpha.push(&alpha);
        self.f.push(&f);
        self.f_rate.push(&f_rate);
        self.m.push(&m);
        self.m_rate.push(&-omega.cross(&m));
        self.attitude.push(attitude);
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.attitude.len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.attitude.is_empty()
    }
}
