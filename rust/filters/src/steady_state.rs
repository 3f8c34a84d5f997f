//! Where the Kalman filter of angle and gyro bias settles: gain and time constant for readings at equal intervals.
//!
//! With the predicted covariance P, `S = p_aa + r`, `k_a = p_aa / S` and `k_b = p_ab / S`, the Riccati equation of
//! `[theta, b]` in steady state is `q_b = k_b^2 S` and, after elimination of P, with `u = sqrt(1 - k_a)` and
//! `beta = -k_b dt = b_0 u / sqrt(r)`, `b_0 = dt sqrt(q_b)`,
//!
//! ```text
//! (1/u - u)^2 - (b_0 / sqrt(r)) (1/u + u) - q_a / r = 0
//! ```
//!
//! a quadratic equation for `1/u + u`. Nothing below divides by r, so that r = 0 (k_a = 1) is no special case.

use crate::FilterError;
use crate::kalman::{Noise, PARAMETERS};
use crate::parameter::fill;

/// The gains of a filter that has settled, and how long a disturbance lasts in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyState {
    /// Part of the innovation by which the angle is corrected.
    pub angle: f64,
    /// Correction of the bias per innovation, 1/s; not positive.
    pub bias: f64,
    /// Time in which the slowest part of an error falls to 1/e, s; infinite for a filter without correction. Where the
    /// bias has no random walk it is not corrected, and the time is that of the angle.
    pub time_constant: f64,
}

/// For the filter's settings by name and readings `dt` seconds apart.
pub fn steady_state_gain(settings: &[(String, f64)], dt: f64) -> Result<SteadyState, FilterError> {
    let refuse = |name, value, range| {
        let filter = "kalman";
        Err(FilterError::Setting {
            filter,
            name,
            value,
            range,
        })
    };
    if !(dt.is_finite() && dt > 0.0) {
        return refuse("dt", dt, "a positive number of seconds");
    }
    let noise = Noise::from_values(&fill("kalman", PARAMETERS, settings)?);
    let Some((angle, bias)) = gains(&noise, dt, noise.angle_variance(dt)) else {
        return refuse("dt", dt, "beyond all measure with these noises");
    };
    let time_constant = -dt / slowest(angle, -bias * dt);
    Ok(SteadyState {
        angle,
        bias,
        time_constant,
    })
}

/// Gains of angle and bias (1/s) for readings `dt` apart whose angle has the variance `r`; `None` where the noises are
/// beyond the range of the machine.
pub(crate) fn gains(noise: &Noise, dt: f64, r: f64) -> Option<(f64, f64)> {
    let (q_a, b_0) = (noise.gyr * noise.gyr * dt, dt * noise.walk * dt.sqrt());
    // W = (1/u + u) sqrt(r) and D = (1/u - u) sqrt(r).
    let w = 0.5 * (b_0 + (b_0 * b_0 + 4.0 * (4.0 * r + q_a)).sqrt());
    let d = (b_0 * w + q_a).sqrt();
    if w + d == 0.0 {
        return Some((0.0, 0.0));
    }
    let (angle, bias) = (2.0 * d / (w + d), -2.0 * noise.walk * dt.sqrt() / (w + d));
    (angle.is_finite() && bias.is_finite()).then_some((angle, bias))
}

/// Logarithm of the largest magnitude of the poles of `(I - K H) F`; a pole is `1 - s` with `s^2 - (k_a + beta) s + beta = 0`.
fn slowest(k_a: f64, beta: f64) -> f64 {
    if beta == 0.0 {
        return (-k_a).ln_1p();
    }
    let sum = k_a + beta;
    let discriminant = sum * sum - 4.0 * beta;
    if discriminant < 0.0 {
        return 0.5 * (-k_a).ln_1p();
    }
    // The smaller root is the slower pole as long as both lie between 0 and 1; beyond 1 the larger may have more magnitude.
    let (root, small) = (discriminant.sqrt(), 2.0 * beta / (sum + discriminant.sqrt()));
    let large = 0.5 * (sum + root);
    let magnitude = |s: f64| if s < 1.0 { (-s).ln_1p() } else { (s - 1.0).ln() };
    magnitude(small).max(magnitude(large))
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, RowVector2};
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn one_more_reading_changes_nothing(gyr in -4.0..-2.0, walk in -5.0..-2.0, acc in -4.0..-1.0, dt in -3.0..0.0) {
            let [gyr, walk, acc, dt] = [gyr, walk, acc, dt].map(|power: f64| 10_f64.powf(power));
            let settings = [("gyr_noise", gyr), ("bias_walk", walk), ("acc_noise", acc)].map(|(name, value)| (name.to_owned(), value));
            let found = steady_state_gain(&settings, dt).unwrap();
            let (f, h) = (Matrix2::new(1.0, -dt, 0.0, 1.0), RowVector2::new(1.0, 0.0));
            let (q, r) = (Matrix2::new(gyr * gyr * dt, 0.0, 0.0, walk * walk * dt), acc * acc / dt);
            // The covariance before a reading that has these gains, and before the next one.
            let s = r / (1.0 - found.angle);
            let (p_aa, p_ab) = (found.angle * s, found.bias * s);
            let p_bb = q[(1, 1)] - found.angle * found.bias * s / dt;
            let before = Matrix2::new(p_aa, p_ab, p_ab, p_bb);
            let gain = before * h.transpose() / (p_aa + r);
            let after = f * (before - gain * (h * before)) * f.transpose() + q;
            for (now, next) in before.iter().zip(&after) {
                prop_assert!((now - next).abs() < 1e-9 * now.abs(), "{before} {after}");
            }
            let closed = (Matrix2::identity() - gain * h) * f;
            let largest = closed.complex_eigenvalues().iter().map(|z| z.norm()).fold(0.0, f64::max);
            let rate = dt / found.time_constant;
            prop_assert!((rate + largest.ln()).abs() < 1e-6 * rate + 1e-9, "{found:?} {largest}");
        }
    }

    #[test]
    fn the_ends_of_the_range_have_their_limits() {
        let of = |values: [f64; 3], dt: f64| {
            let names = ["gyr_noise", "bias_walk", "acc_noise"];
            let settings: Vec<_> = names.iter().map(|name| (*name).to_owned()).zip(values).collect();
            steady_state_gain(&settings, dt)
        };
        let held = of([0.0, 0.0, 1e-2], 0.01).unwrap();
        assert_eq!((held.angle, held.bias, held.time_constant), (0.0, 0.0, f64::INFINITY));
        let followed = of([1e-3, 0.0, 0.0], 0.01).unwrap();
        assert_eq!((followed.angle, followed.time_constant), (1.0, 0.0));
        // Without a bias the gain is that of a random walk seen through white noise.
        let (q, r): (f64, f64) = (1e-6 * 0.01, 1e-4 / 0.01);
        let p = 0.5 * (q + (q * q + 4.0 * q * r).sqrt());
        assert!((of([1e-3, 0.0, 1e-2], 0.01).unwrap().angle - p / (p + r)).abs() < 1e-12);
        let refused = |dt: f64, why: &str| of([1e-3, 0.0, 1e-2], dt).unwrap_err().to_string().contains(why);
        assert!(refused(0.0, "dt = 0 is out of range") && refused(1e-315, "beyond all measure"));
    }
}
