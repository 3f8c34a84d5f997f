//! Inclination from the specific force (paper B, eqs. (1) to (3)).
//!
//! The paper takes each angle as an arc tangent of a quotient, which loses the quadrant and mixes two definitions:
//! eq. (2) is the angle of the body's y axis to the horizontal plane, not the roll of `Rz Ry Rx`. Its "yaw", eq. (3), is
//! the [`inclination`] of z from the vertical: gravity carries no heading. The filter uses the quadrant-safe form
//!
//! ```text
//! up_b = f / |f|,   third row of R times the sign of up:   pitch = asin-free atan2,   roll = atan2
//! ```
//!
//! and keeps the heading it started with; [`tilt_as_printed`] is the paper's form.

use imufit_attitude::{Euler, Quaternion};
use nalgebra::Vector3;

use crate::filter::{Filter, Usage, split_state};
use crate::parameter::Parameter;
use crate::{Environment, Sample, SpecificForce};

/// None: the filter has no memory.
pub const PARAMETERS: &[Parameter] = &[];

/// The angle between the body's z axis and the upward vertical, rad, in [0, pi]: eq. (3), which the paper calls yaw.
///
/// The printed arc tangent of a quotient agrees with it as long as z points up; upside down it is less by pi.
pub fn inclination(f: &SpecificForce) -> f64 {
    f.0.x.hypot(f.0.y).atan2(f.0.z)
}

/// Angles as eqs. (1) to (3) print them, rad: pitch, roll, [`inclination`].
///
/// Pitch and roll are the angles of the body's x and y axes above the horizontal plane: they lie in [-pi/2, pi/2]
/// whichever way up the sensor is.
pub fn tilt_as_printed(f: &SpecificForce) -> [f64; 3] {
    let (x, y, z) = (f.0.x, f.0.y, f.0.z);
    [x.atan2(y.hypot(z)), y.atan2(x.hypot(z)), inclination(f)]
}

/// [`tilt_as_printed`] for n readings, row by row; NaN where a reading shows no direction.
pub fn tilt_rows(acc: &[f64], out: &mut [f64]) {
    for (reading, angles) in acc.chunks_exact(3).zip(out.chunks_exact_mut(3)) {
        let f = Vector3::from_column_slice(reading);
        let usable = f.norm_squared().is_finite() && f != Vector3::zeros();
        angles.copy_from_slice(&if usable {
            tilt_as_printed(&SpecificForce(f))
        } else {
            [f64::NAN; 3]
        });
    }
}

/// Roll and pitch of `R = Rz Ry Rx` for which the reading points up, in all quadrants, and the given yaw.
pub fn attitude_from_specific_force(f: &SpecificForce, environment: &Environment, yaw: f64) -> Quaternion {
    // The third row of R is the reference frame's z axis in the body: up in ENU and NWU, down in NED.
    let z: Vector3<f64> = f.0 * environment.up().z;
    let (pitch, roll) = ((-z.x).atan2(z.y.hypot(z.z)), z.y.atan2(z.z));
    Euler { roll, pitch, yaw }.to_quaternion()
}

/// The filter.
#[derive(Debug, Clone)]
pub struct Accel {
    environment: Environment,
    q: Quaternion,
    yaw: f64,
}

impl Accel {
    /// In these surroundings.
    pub fn new(environment: &Environment) -> Self {
        Self {
            environment: *environment,
            q: Quaternion::IDENTITY,
            yaw: 0.0,
        }
    }
}

impl Filter for Accel {
    fn step(&mut self, sample: &Sample) -> Usage {
        if let Some(f) = sample.f {
            self.q = attitude_from_specific_force(&f.value, &self.environment, self.yaw);
        }
        Usage::Full
    }

    fn attitude(&self) -> Quaternion {
        self.q
    }

    fn reset(&mut self, attitude: Quaternion) {
        self.q = attitude;
        self.yaw = Euler::from_quaternion(attitude).yaw;
    }

    fn state(&self) -> Vec<f64> {
        let [w, x, y, z] = self.q.to_array();
        vec![w, x, y, z, self.yaw]
    }

    fn set_state(&mut self, state: &[f64]) -> bool {
        let found = split_state(state);
        if let Some((q, [yaw])) = found {
            (self.q, self.yaw) = (q, yaw);
        }
        found.is_some()
    }
}

#[cfg(test)]
mod tests {
    use imufit_attitude::Frame;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn every_attitude_comes_back_in_all_quadrants(roll in -3.1..3.1, pitch in -1.5..1.5, yaw in -3.1..3.1, k in 0usize..3) {
            let environment = Environment::new(Frame::ALL[k], 9.81, None).unwrap();
            let q = Euler { roll, pitch, yaw }.to_quaternion();
            let f = SpecificForce(q.rotate_back(&(environment.up() * 9.81)));
            let found = attitude_from_specific_force(&f, &environment, yaw);
            prop_assert!((q.inverse() * found).angle() < 1e-12);
        }

        #[test]
        fn the_printed_pitch_is_the_pitch_and_the_printed_yaw_is_an_inclination(roll in -1.5..1.5, pitch in -1.5..1.5) {
            let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
            let q = Euler { roll, pitch, yaw: 0.3 }.to_quaternion();
            let f = SpecificForce(q.rotate_back(&(environment.up() * 9.81)));
            let [printed_pitch, _, _] = tilt_as_printed(&f);
            let [_, _, inclination] = tilt_as_printed(&SpecificForce(-f.0));
            prop_assert!((printed_pitch - pitch).abs() < 1e-12);
            prop_assert!((inclination.cos() - roll.cos() * pitch.cos()).abs() < 1e-12);
        }
    }
}
