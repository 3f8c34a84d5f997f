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

/// The noises that the gains follow from.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Noise {
    /// Density of the rate, rad/s/sqrt(Hz).
    pub gyr: f64,
    /// Random walk of the bias, rad/s/sqrt(s).
    pub walk: f64,
    /// Density of the measured angle, rad*sqrt(s).
    pub acc: f64,
}

impl Noise {
    /// Variance of a measured angle that stands for `dt`, rad^2.
    pub fn angle_variance(&self, dt: f64) -> f64 {
        self.acc * self.acc / dt
    }
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
pub(crate) fn slowest(k_a: f64, beta: f64) -> f64 {
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
