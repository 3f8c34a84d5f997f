//! Whether the body rests: angular rate and specific force that stay at their means.
//!
//! Only differences from the mean of the last half second count, so that neither a gyro bias nor a tilt is motion. A rate
//! that is constant but larger than any bias is a turn.

use imufit_attitude::Real;
use nalgebra::{SimdBool, Vector3};

/// Time constant of the means, s.
const MEAN_TIME: f64 = 0.5;
/// How long both readings must have stayed at their means, s.
const CALM_TIME: f64 = 1.5;

/// What differs from rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Limits<T> {
    /// Departure of the rate from its mean, rad/s.
    pub gyr: T,
    /// Departure of the specific force from its mean, m/s^2.
    pub acc: T,
    /// Largest mean rate that may be a bias, rad/s.
    pub bias: T,
}

/// Means of both sensors and the time since something moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Rest<T> {
    pub rate: Vector3<f64>,
    pub force: Vector3<f64>,
    /// Time since a reading last departed from its mean, s; negative before the first reading.
    pub calm: T,
}

impl<T: Real> Rest<T> {
    pub fn unknown() -> Self {
        Self {
            rate: Vector3::zeros(),
            force: Vector3::zeros(),
            calm: T::splat(-1.0),
        }
    }

    /// Takes a rate and a specific force that stand for `dt`, and tells whether the body rests.
    pub fn update(&mut self, rate: &Vector3<f64>, force: &Vector3<f64>, dt: f64, limits: &Limits<T>) -> T::SimdBool {
        let (zero, enough) = (T::splat(0.0), T::splat(CALM_TIME));
        let first = self.calm.simd_lt(zero);
        if first.all() {
            (self.rate, self.force, self.calm) = (*rate, *force, zero);
            return !first;
        }
        let (from_rate, from_force) = (rate - self.rate, force - self.force);
        let weight = -(-dt / MEAN_TIME).exp_m1();
        self.rate += from_rate * weight;
        self.force += from_force * weight;
        let beyond = |departure: &Vector3<f64>, limit: T| T::splat(departure.amax()).simd_gt(limit);
        let moved = beyond(&from_rate, limits.gyr) | beyond(&from_force, limits.acc) | beyond(&self.rate, limits.bias);
        self.calm = zero.select(moved, (self.calm + T::splat(dt)).simd_min(enough));
        self.calm.simd_ge(enough)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits<f64> = Limits {
        gyr: 0.035,
        acc: 0.5,
        bias: 0.06,
    };

    fn rests(rate: impl Fn(f64) -> f64) -> bool {
        let mut rest = Rest::unknown();
        let force = Vector3::z() * 9.81;
        (0..400).fold(false, |_, k| {
            rest.update(&(Vector3::x() * rate(0.01 * f64::from(k))), &force, 0.01, &LIMITS)
        })
    }

    #[test]
    fn a_biased_gyro_rests_and_a_turn_does_not() {
        assert!(rests(|_| 0.02));
        assert!(!rests(|_| 0.2));
        assert!(!rests(|t| 0.3 * (6.0 * t).sin()));
    }

    #[test]
    fn after_a_jerk_it_rests_again_in_three_seconds() {
        let jerk = |t: f64| if (1.0..1.1).contains(&t) { 0.5 } else { 0.0 };
        assert!(rests(jerk));
        assert!(!rests(|t| jerk(t - 2.0)));
    }
}
