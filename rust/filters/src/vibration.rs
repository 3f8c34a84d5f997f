//! How much of the specific force is vibration: what makes an accelerometer's angle worse than its noise.
//!
//! A machine at work shakes the sensor. Gravity turns with the body, and the gyro says how; what is left when that is
//! taken out comes from accelerations. So the mean specific force of the last `vibration_time` is carried along with
//! the angular rate, in the body frame, and what a reading deviates from it, over gravity, is the disturbance `v` of the
//! vertical, rad. Neither an error of the attitude nor a constant bias of the accelerometer takes part in it, so that a
//! filter that has not settled is not slowed down. The variance of the angle is
//!
//! ```text
//! max( mean of |v|^2 / 3 over vibration_time,  |v|^2 / 16 )
//! ```
//!
//! The mean is exponential. The second term answers at the first reading of a blow: 16 is the 99.9 % point of chi^2 with
//! three degrees of freedom, so that noise alone seldom exceeds its own variance by it.

use imufit_attitude::Quaternion;
use nalgebra::Vector3;

/// Point of chi^2 with three degrees of freedom that 1 of 1000 exceeds.
const ONE_IN_THOUSAND: f64 = 16.27;

/// Mean and power; a mean of zero is that of no reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Vibration {
    /// Specific force over gravity, body frame.
    pub mean: Vector3<f64>,
    /// Mean of |v|^2 / 3.
    pub power: f64,
}

impl Vibration {
    pub const NONE: Self = Self {
        mean: Vector3::new(0.0, 0.0, 0.0),
        power: 0.0,
    };

    /// Carries the mean along with a turn of the body.
    pub fn turn(&mut self, omega: &Vector3<f64>, dt: f64) {
        self.mean = Quaternion::exp(&(omega * dt)).rotate_back(&self.mean);
    }

    /// The variance of the angle that `reading` (specific force over gravity) shows, rad^2; `dt` is the time since the
    /// reading before, 0 for the first one and after a gap.
    pub fn variance(&mut self, reading: &Vector3<f64>, dt: f64, time: f64) -> f64 {
        if !reading.norm_squared().is_finite() {
            return f64::INFINITY;
        }
        if dt <= 0.0 || self.mean == Vector3::zeros() {
            self.mean = *reading;
            return self.power;
        }
        let weight = -(-dt / time.max(f64::MIN_POSITIVE)).exp_m1();
        let v = reading - self.mean;
        let square = v.norm_squared();
        let next = Self {
            mean: self.mean + v * weight,
            power: self.power + (square / 3.0 - self.power) * weight,
        };
        if next.mean.norm_squared().is_finite() && next.power.is_finite() {
            *self = next;
        }
        self.power.max(square / ONE_IN_THOUSAND)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_and_a_constant_bias_are_no_vibration_and_shaking_has_its_variance() {
        let (dt, rate, bias) = (0.005, Vector3::new(0.3, -0.8, 0.5), Vector3::new(0.03, -0.02, 0.04));
        let mut seen = Vibration::NONE;
        let mut q = Quaternion::IDENTITY;
        for _ in 0..2000 {
            q = q.turned(&rate, dt);
            seen.turn(&rate, dt);
            seen.variance(&(q.rotate_back(&Vector3::z())), dt, 0.5);
        }
        assert!(seen.power < 1e-20);
        // A sine of amplitude 0.2 on one axis: 0.02 over the three of them.
        let mut seen = Vibration::NONE;
        for k in 0..4000 {
            let shaken = 0.2 * (2.0 * std::f64::consts::PI * 31.0 * dt * f64::from(k)).sin();
            seen.variance(&(Vector3::z() + bias + Vector3::x() * shaken), dt, 0.5);
        }
        assert!((seen.power - 0.02 / 3.0).abs() < 2e-4, "{}", seen.power);
    }

    #[test]
    fn a_blow_is_seen_at_its_first_reading_and_forgotten_afterwards() {
        let mut seen = Vibration::NONE;
        let still = Vector3::z();
        for _ in 0..100 {
            seen.variance(&still, 0.01, 0.5);
        }
        assert!(seen.variance(&(still + Vector3::x()), 0.01, 0.5) > 0.06);
        let after: Vec<f64> = (0..500).map(|_| seen.variance(&still, 0.01, 0.5)).collect();
        assert!(after[10] > 0.001 && after[499] < 1e-5);
    }

    #[test]
    fn no_reading_of_any_size_leaves_a_value_that_is_not_finite() {
        let mut seen = Vibration::NONE;
        for size in [1e150, -1e150, 1e-300, 1e160, 0.0] {
            seen.variance(&Vector3::new(size, -size, size), 0.01, 0.0);
            assert!(seen.power.is_finite() && seen.mean.norm_squared().is_finite());
        }
    }
}
