//! Angular rate, acceleration and its rate from a rotation vector and its derivatives.

use nalgebra::{Matrix3, Vector3};

/// Body rate, rad/s, and its first two derivatives, rad/s^2 and rad/s^3.
#[derive(Clone, Copy, Debug)]
pub struct RotationRates {
    /// Angular rate.
    pub omega: Vector3<f64>,
    /// Angular acceleration.
    pub alpha: Vector3<f64>,
    /// Its derivative in the body frame.
    pub alpha_rate: Vector3<f64>,
}

/// Rates of the attitude exp(phi) from phi (of up to half a knot's turn) and its first three derivatives.
pub fn rates(phi: Vector3<f64>, d: Vector3<f64>, dd: Vector3<f64>, ddd: Vector3<f64>) -> RotationRates {
    // omega = J_r d with J_r = 1 - a [phi] + b [phi]^2, where a and b are series in s = |phi|^2.
    let s = phi.norm_squared();
    let a = 0.5 - s / 24.0 + s * s / 720.0 - s * s * s / 40320.0;
    let b = 1.0 / 6.0 - s / 120.0 + s * s / 5040.0 - s * s * s / 362_880.0;
    let (s_rate, s_bend) = (2.0 * phi.dot(&d), 2.0 * (d.norm_squared() + phi.dot(&dd)));
    let a_slope = -1.0 / 24.0 + s / 360.0 - s * s / 13440.0;
    let b_slope = -1.0 / 120.0 + s / 2520.0 - s * s / 120_960.0;
    let (a_rate, b_rate) = (s_rate * a_slope, s_rate * b_slope);
    let a_bend = s_bend * a_slope + s_rate * s_rate * (1.0 / 360.0 - s / 6720.0);
    let b_bend = s_bend * b_slope + s_rate * s_rate * (1.0 / 2520.0 - s / 60480.0);
    let jacobian = |v: &Vector3<f64>| v - a * phi.cross(v) + b * phi.cross(&phi.cross(v));
    let jacobian_rate = |v: &Vector3<f64>| {
        let turned = phi.cross(v);
        -a_rate * turned - a * d.cross(v)
            + b_rate * phi.cross(&turned)
            + b * (d.cross(&turned) + phi.cross(&d.cross(v)))
    };
    let pd = phi.cross(&d);
    let bend = -a_bend * pd - a * dd.cross(&d)
        + b_bend * phi.cross(&pd)
        + 2.0 * b_rate * d.cross(&pd)
        + b * (dd.cross(&pd) + phi.cross(&dd.cross(&d)));
    RotationRates {
        omega: jacobian(&d),
        alpha: jacobian(&dd) + jacobian_rate(&d),
        alpha_rate: jacobian(&ddd) + 2.0 * jacobian_rate(&dd) + bend,
    }
}

/// Right Jacobian of SO(3).
pub fn right_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    let cross = phi.cross_matrix();
    let (a, b) = if angle < 1e-4 {
        (0.5 - angle * angle / 24.0, 1.0 / 6.0 - angle * angle / 120.0)
    } else {
        (
            (1.0 - angle.cos()) / angle.powi(2),
            (angle - angle.sin()) / angle.powi(3),
        )
    };
    Matrix3::identity() - cross * a + cross * cross * b
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A rotation vector that bends, and its first three derivatives.
    fn bent(t: f64) -> [Vector3<f64>; 4] {
        let p = Vector3::new(0.2, -0.1, 0.15);
        let (q, r, u) = (
            Vector3::new(1.0, 2.0, -1.5),
            Vector3::new(-3.0, 1.0, 4.0),
            Vector3::new(5.0, -8.0, 2.0),
        );
        [
            p + q * t + r * (t * t / 2.0) + u * (t * t * t / 6.0),
            q + r * t + u * (t * t / 2.0),
            r + u * t,
            u,
        ]
    }

    #[test]
    fn each_rate_is_the_difference_quotient_of_the_one_before() {
        let at = |t: f64| {
            let [phi, d, dd, ddd] = bent(t);
            rates(phi, d, dd, ddd)
        };
        let h = 1e-5;
        let (before, now, after) = (at(-h), at(0.0), at(h));
        let [phi, d, ..] = bent(0.0);
        assert!((now.omega - right_jacobian(&phi) * d).norm() < 1e-8);
        assert!(((after.omega - before.omega) / (2.0 * h) - now.alpha).norm() < 1e-7);
        assert!(((after.alpha - before.alpha) / (2.0 * h) - now.alpha_rate).norm() < 1e-6);
    }
}
