//! Unit quaternions, Hamilton, scalar first (paper C, eqs. (3) and (4): `q = [eta, eps]`, `eta = cos(angle / 2)`).
//!
//! A [`Quaternion`] is unit by construction: each operation that could leave the unit sphere renormalises.
//! `q` and `-q` are the same attitude; results are not forced onto one half of the sphere, so that a filter's output
//! stays continuous ([`Quaternion::canonical`] does that where it matters).

use std::ops::Mul;

use nalgebra::{Matrix4x3, Vector3};

/// An attitude as a unit quaternion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quaternion {
    w: f64,
    v: Vector3<f64>,
}

impl Default for Quaternion {
    fn default() -> Self {
        Self::IDENTITY
    }
}

impl Quaternion {
    /// No rotation.
    pub const IDENTITY: Self = Self {
        w: 1.0,
        v: Vector3::new(0.0, 0.0, 0.0),
    };

    /// From four components of any finite, nonzero length; `None` otherwise.
    pub fn new(w: f64, x: f64, y: f64, z: f64) -> Option<Self> {
        let largest = w.abs().max(x.abs()).max(y.abs()).max(z.abs());
        if !(w + x + y + z).is_finite() || largest < f64::MIN_POSITIVE {
            return None;
        }
        // The division by the largest component keeps the squares inside the range of a double.
        let (w, v) = (w / largest, Vector3::new(x, y, z) / largest);
        Some(Self { w, v }.renormalised())
    }

    /// From one row `[w, x, y, z]` of a table; `None` for another length, a zero or a value that is not finite.
    pub fn from_row(row: &[f64]) -> Option<Self> {
        match *row {
            [w, x, y, z] => Self::new(w, x, y, z),
            _ => None,
        }
    }

    /// The components `[w, x, y, z]`.
    pub fn to_array(self) -> [f64; 4] {
        [self.w, self.v.x, self.v.y, self.v.z]
    }

    /// The scalar part.
    pub fn w(self) -> f64 {
        self.w
    }

    /// The vector part.
    pub fn vector(self) -> Vector3<f64> {
        self.v
    }

    /// The components as they were written by [`Quaternion::to_array`], bit by bit, for a state that is handed over.
    /// `None` where they are not a unit quaternion.
    pub fn from_unit(components: [f64; 4]) -> Option<Self> {
        let [w, x, y, z] = components;
        let q = Self {
            w,
            v: Vector3::new(x, y, z),
        };
        ((q.norm_squared() - 1.0).abs() < 1e-9).then_some(q)
    }

    fn norm_squared(self) -> f64 {
        self.w * self.w + self.v.norm_squared()
    }

    /// Back onto the unit sphere.
    #[must_use]
    pub fn renormalised(self) -> Self {
        let scale = 1.0 / self.norm_squared().sqrt();
        if scale.is_finite() {
            Self {
                w: self.w * scale,
                v: self.v * scale,
            }
        } else {
            Self::IDENTITY
        }
    }

    /// The opposite rotation.
    #[must_use]
    pub fn inverse(self) -> Self {
        Self { w: self.w, v: -self.v }
    }

    /// The same attitude with a scalar part that is not negative.
    #[must_use]
    pub fn canonical(self) -> Self {
        if self.w < 0.0 {
            Self { w: -self.w, v: -self.v }
        } else {
            self
        }
    }

    /// Exponential map: the rotation by the vector `r` (axis times angle, rad).
    pub fn exp(r: &Vector3<f64>) -> Self {
        let angle = r.norm();
        if !angle.is_finite() {
            return Self::IDENTITY;
        }
        let (sine, cosine) = (0.5 * angle).sin_cos();
        let scale = if angle > 0.0 { sine / angle } else { 0.5 };
        Self {
            w: cosine,
            v: r * scale,
        }
        .renormalised()
    }

    /// Logarithm: the shortest rotation vector (axis times angle in [0, pi], rad).
    pub fn log(self) -> Vector3<f64> {
        let q = self.canonical();
        let sine = q.v.norm();
        if sine > 0.0 {
            q.v * (2.0 * sine.atan2(q.w) / sine)
        } else {
            q.v * 2.0
        }
    }

    /// The angle of the rotation in [0, pi], rad.
    pub fn angle(self) -> f64 {
        2.0 * self.v.norm().atan2(self.w.abs())
    }

    /// Takes a vector from the body into the reference frame.
    pub fn rotate(self, x: &Vector3<f64>) -> Vector3<f64> {
        let t = self.v.cross(x) * 2.0;
        x + t * self.w + self.v.cross(&t)
    }

    /// Takes a vector from the reference into the body frame.
    pub fn rotate_back(self, x: &Vector3<f64>) -> Vector3<f64> {
        self.inverse().rotate(x)
    }

    /// The shortest rotation that takes the direction of `from` into that of `to`.
    ///
    /// Opposite directions leave the axis open: one perpendicular to `from` is taken. A zero vector gives the identity.
    pub fn between(from: &Vector3<f64>, to: &Vector3<f64>) -> Self {
        let (Some(a), Some(b)) = (from.try_normalize(0.0), to.try_normalize(0.0)) else {
            return Self::IDENTITY;
        };
        let w = 1.0 + a.dot(&b);
        if w > 1e-12 {
            return Self { w, v: a.cross(&b) }.renormalised();
        }
        let axis = if a.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
        Self {
            w: 0.0,
            v: a.cross(&axis),
        }
        .renormalised()
    }

    /// The part of the rotation about a unit axis (twist); the rest is `self * twist^-1` (swing).
    #[must_use]
    pub fn twist(self, axis: &Vector3<f64>) -> Self {
        let along = axis * self.v.dot(axis);
        Self { w: self.w, v: along }.renormalised()
    }

    /// The matrix T_q of `dq/dt = T_q omega` with the body's angular rate (paper C, eq. (7)), rows `w x y z`.
    pub fn rate_matrix(self) -> Matrix4x3<f64> {
        let (w, v) = (self.w, self.v);
        Matrix4x3::new(-v.x, -v.y, -v.z, w, -v.z, v.y, v.z, w, -v.x, -v.y, v.x, w) * 0.5
    }

    /// The attitude after turning with the constant body rate `omega` (rad/s) for `dt` s: the exact solution of
    /// `dq/dt = T_q omega`.
    #[must_use]
    pub fn turned(self, omega: &Vector3<f64>, dt: f64) -> Self {
        self * Self::exp(&(omega * dt))
    }
}

impl Mul for Quaternion {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let w = self.w * other.w - self.v.dot(&other.v);
        let v = other.v * self.w + self.v * other.w + self.v.cross(&other.v);
        Self { w, v }.renormalised()
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    use super::*;

    fn vector(limit: f64) -> impl Strategy<Value = Vector3<f64>> {
        [-limit..limit, -limit..limit, -limit..limit].prop_map(Vector3::from)
    }

    proptest! {
        #[test]
        fn exp_and_log_are_inverse_below_pi(r in vector(1.8)) {
            prop_assert!((Quaternion::exp(&r).log() - r).norm() < 1e-13);
        }

        #[test]
        fn products_keep_the_norm_and_compose_like_rotations(a in vector(9.0), b in vector(9.0), x in vector(5.0)) {
            let (p, q) = (Quaternion::exp(&a), Quaternion::exp(&b));
            prop_assert!(((p * q).norm_squared() - 1.0).abs() < 1e-15);
            prop_assert!(((p * q).rotate(&x) - p.rotate(&q.rotate(&x))).norm() < 1e-13);
            prop_assert!(((p * p.inverse()).rotate(&x) - x).norm() < 1e-13);
        }

        #[test]
        fn between_turns_one_direction_into_the_other(a in vector(3.0), b in vector(3.0)) {
            prop_assume!(a.norm() > 1e-3 && b.norm() > 1e-3);
            let turned = Quaternion::between(&a, &b).rotate(&a.normalize());
            prop_assert!((turned - b.normalize()).norm() < 1e-9);
        }

        #[test]
        fn rate_matrix_is_the_derivative_of_a_turn(r in vector(3.0), omega in vector(2.0)) {
            let q = Quaternion::exp(&r);
            let h = 1e-6;
            let (ahead, behind) = (q.turned(&omega, h).to_array(), q.turned(&omega, -h).to_array());
            let rate = q.rate_matrix() * omega;
            for i in 0..4 {
                prop_assert!(((ahead[i] - behind[i]) / (2.0 * h) - rate[i]).abs() < 1e-8);
            }
        }

        #[test]
        fn any_numbers_give_a_unit_quaternion_or_none(w in any::<f64>(), x in any::<f64>(), y in any::<f64>(), z in any::<f64>()) {
            if let Some(q) = Quaternion::new(w, x, y, z) {
                prop_assert!((q.norm_squared() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn opposite_directions_turn_by_half_a_turn() {
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            assert_relative_eq!(Quaternion::between(&axis, &-axis).rotate(&axis), -axis, epsilon = 1e-15);
        }
    }

    #[test]
    fn tiny_and_infinite_rotation_vectors_are_the_identity() {
        assert_eq!(Quaternion::exp(&Vector3::repeat(1e-200)).w(), 1.0);
        assert_eq!(Quaternion::exp(&Vector3::repeat(f64::INFINITY)), Quaternion::IDENTITY);
    }
}
