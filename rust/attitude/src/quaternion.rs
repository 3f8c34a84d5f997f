//! Unit quaternions, Hamilton, scalar first (paper C, eqs. (3) and (4): `q = [eta, eps]`, `eta = cos(angle / 2)`).
//!
//! A [`Quaternion`] is unit by construction: each operation that could leave the unit sphere renormalises.
//! `q` and `-q` are the same attitude; results are not forced onto one half of the sphere, so that a filter's output
//! stays continuous ([`Quaternion::canonical`] does that where it matters).
//!
//! The components are [`Real`]: one `f64`, or several attitudes side by side.

use std::ops::Mul;

use nalgebra::{Matrix4x3, SimdBool, Vector3};

use crate::Real;

/// Square of the half angle, rad^2, up to which the exponential map takes its series.
const SERIES: f64 = 0.01;
/// The same for the first three terms of the series.
const SHORT_SERIES: f64 = 5e-6;

/// An attitude as a unit quaternion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quaternion<T = f64> {
    w: T,
    v: Vector3<T>,
}

impl<T: Real> Default for Quaternion<T> {
    fn default() -> Self {
        Quaternion::IDENTITY.splat()
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

    /// The same attitude in every lane.
    pub fn splat<T: Real>(self) -> Quaternion<T> {
        Quaternion {
            w: T::splat(self.w),
            v: self.v.map(T::splat),
        }
    }
}

impl<T: Real> Quaternion<T> {
    /// The components `[w, x, y, z]`.
    pub fn to_array(self) -> [T; 4] {
        [self.w, self.v.x, self.v.y, self.v.z]
    }

    /// The attitude of one lane.
    ///
    /// # Panics
    /// Where there is no such lane.
    pub fn lane(self, lane: usize) -> Quaternion {
        Quaternion {
            w: self.w.extract(lane),
            v: self.v.map(|x| x.extract(lane)),
        }
    }

    /// Lane by lane `self` where the condition holds, else `other`.
    #[must_use]
    pub fn select(self, condition: T::SimdBool, other: Self) -> Self {
        Self {
            w: self.w.select(condition, other.w),
            v: self.v.zip_map(&other.v, |a, b| a.select(condition, b)),
        }
    }

    /// The scalar part.
    pub fn w(self) -> T {
        self.w
    }

    /// The vector part.
    pub fn vector(self) -> Vector3<T> {
        self.v
    }

    #[inline(always)]
    fn norm_squared(self) -> T {
        self.w * self.w + self.v.dot(&self.v)
    }

    fn scaled(self, scale: T) -> Self {
        Self {
            w: self.w * scale,
            v: self.v * scale,
        }
    }

    /// The components as they were written by [`Quaternion::to_array`], bit by bit, for a state that is handed over.
    /// `None` where they are not a unit quaternion.
    pub fn from_unit(components: [T; 4]) -> Option<Self> {
        let [w, x, y, z] = components;
        let q = Self {
            w,
            v: Vector3::new(x, y, z),
        };
        let off = (q.norm_squared() - T::splat(1.0)).simd_abs();
        off.simd_lt(T::splat(1e-9)).all().then_some(q)
    }

    /// The shortest rotation that takes the direction of `from` into that of `to`.
    ///
    /// Opposite directions leave the axis open: one perpendicular to `from` is taken. A zero vector gives the identity.
    pub fn between(from: &Vector3<T>, to: &Vector3<T>) -> Self {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let (length_from, length_to) = (from.norm(), to.norm());
        let (a, b) = (from / length_from, to / length_to);
        let w = one + a.dot(&b);
        let opposite = w.simd_le(T::splat(1e-12));
        let found = Self { w, v: a.cross(&b) };
        let found = if opposite.any() {
            let x_is_across = a.x.simd_abs().simd_lt(T::splat(0.6));
            let axis = Vector3::new(one.select(x_is_across, zero), zero.select(x_is_across, one), zero);
            let half_turn = Self {
                w: zero,
                v: a.cross(&axis),
            };
            half_turn.select(opposite, found)
        } else {
            found
        };
        let directions = length_from.simd_gt(zero) & length_to.simd_gt(zero);
        found.renormalised().select(directions, Self::default())
    }

    /// From components of any length that is a number of the machine; the identity where it is not or is zero.
    pub fn from_components(w: T, v: Vector3<T>) -> Self {
        Self { w, v }.renormalised()
    }

    /// Back onto the unit sphere.
    #[must_use]
    pub fn renormalised(self) -> Self {
        let square = self.norm_squared();
        let found = self.scaled(T::splat(1.0) / square.simd_sqrt());
        let sound = square.simd_gt(T::splat(0.0)) & square.simd_le(T::splat(f64::MAX));
        if sound.all() {
            found
        } else {
            found.select(sound, Self::default())
        }
    }

    /// Back onto the unit sphere from close to it: one step of Newton's method for the inverse square root, which leaves
    /// the square of an error. What products of unit quaternions lose in rounding disappears.
    #[inline(always)]
    #[must_use]
    pub fn kept(self) -> Self {
        self.scaled(T::splat(1.5) - self.norm_squared() * T::splat(0.5))
    }

    /// The product without the renormalisation: for chains of products that end with [`Quaternion::kept`].
    #[inline(always)]
    #[must_use]
    pub fn times(self, other: Self) -> Self {
        Self {
            w: self.w * other.w - self.v.dot(&other.v),
            v: other.v * self.w + self.v * other.w + self.v.cross(&other.v),
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
        let negative = self.w.simd_lt(T::splat(0.0));
        Self { w: -self.w, v: -self.v }.select(negative, self)
    }

    /// Exponential map: the rotation by the vector `r` (axis times angle, rad); the identity where that is not finite.
    #[inline(always)]
    pub fn exp(r: &Vector3<T>) -> Self {
        Self::exp_of_half(&(r * T::splat(0.5)))
    }

    /// The rotation by twice the vector `h`.
    ///
    /// Up to 0.2 rad, which is a step of any filter, from the series of cosine and sine, whose first term left out is
    /// below 3e-17; beyond that from the functions themselves.
    #[inline(always)]
    pub fn exp_of_half(h: &Vector3<T>) -> Self {
        let square = h.dot(h);
        let tiny = square.simd_le(T::splat(SHORT_SERIES));
        let short = Self::short_series(h, square);
        if tiny.all() {
            return short;
        }
        // Lane by lane, so that each has the bits that it would have alone.
        let series = short.select(tiny, Self::series(h, square));
        let small = square.simd_le(T::splat(SERIES));
        if small.all() {
            return series;
        }
        series.select(small, Self::circle(&(h + h)))
    }

    /// [`Quaternion::exp_of_half`] for a half angle whose square is very small.
    #[inline(always)]
    fn short_series(h: &Vector3<T>, square: T) -> Self {
        let c = T::splat;
        let cosine = (c(1.0) - square * c(0.5)) + square * square * c(1.0 / 24.0);
        let sinc = (c(1.0) - square * c(1.0 / 6.0)) + square * square * c(1.0 / 120.0);
        Self { w: cosine, v: h * sinc }
    }

    /// [`Quaternion::exp_of_half`] for a half angle whose square is small.
    #[inline(always)]
    fn series(h: &Vector3<T>, square: T) -> Self {
        let c = T::splat;
        let fourth = square * square;
        let cosine = (c(1.0) - square * c(1.0 / 2.0))
            + fourth * ((c(1.0 / 24.0) - square * c(1.0 / 720.0)) + fourth * c(1.0 / 40_320.0));
        let sinc = (c(1.0) - square * c(1.0 / 6.0))
            + fourth * ((c(1.0 / 120.0) - square * c(1.0 / 5_040.0)) + fourth * c(1.0 / 362_880.0));
        Self { w: cosine, v: h * sinc }
    }

    /// [`Quaternion::exp`] for any angle but zero.
    #[cold]
    fn circle(r: &Vector3<T>) -> Self {
        let angle = r.norm();
        let (sine, cosine) = (angle * T::splat(0.5)).simd_sin_cos();
        let found = Self {
            w: cosine,
            v: r * (sine / angle),
        }
        .renormalised();
        found.select(angle.simd_le(T::splat(f64::MAX)), Self::default())
    }

    /// Logarithm: the shortest rotation vector (axis times angle in [0, pi], rad).
    pub fn log(self) -> Vector3<T> {
        let q = self.canonical();
        let sine = q.v.norm();
        let (zero, two) = (T::splat(0.0), T::splat(2.0));
        let quotient = two * sine.simd_atan2(q.w) / sine;
        q.v * quotient.select(sine.simd_gt(zero), two)
    }

    /// The angle of the rotation in [0, pi], rad.
    pub fn angle(self) -> T {
        self.v.norm().simd_atan2(self.w.simd_abs()) * T::splat(2.0)
    }

    /// Takes a vector from the body into the reference frame.
    #[inline(always)]
    pub fn rotate(self, x: &Vector3<T>) -> Vector3<T> {
        let t = (self.v + self.v).cross(x);
        (x + t * self.w) + self.v.cross(&t)
    }

    /// Takes a vector from the reference into the body frame.
    #[inline(always)]
    pub fn rotate_back(self, x: &Vector3<T>) -> Vector3<T> {
        self.inverse().rotate(x)
    }

    /// The z axis of the reference frame, seen from the body: the third row of the matrix.
    #[inline(always)]
    pub fn vertical(self) -> Vector3<T> {
        let (w, v, one) = (self.w, self.v, T::splat(1.0));
        let (x2, y2) = (v.x + v.x, v.y + v.y);
        Vector3::new(x2 * v.z - y2 * w, y2 * v.z + x2 * w, one - (x2 * v.x + y2 * v.y))
    }

    /// The part of the rotation about a unit axis (twist); the rest is `self * twist^-1` (swing).
    #[must_use]
    pub fn twist(self, axis: &Vector3<T>) -> Self {
        let along = axis * self.v.dot(axis);
        Self { w: self.w, v: along }.renormalised()
    }

    /// The matrix T_q of `dq/dt = T_q omega` with the body's angular rate (paper C, eq. (7)), rows `w x y z`.
    pub fn rate_matrix(self) -> Matrix4x3<T> {
        let (w, v) = (self.w, self.v);
        Matrix4x3::new(-v.x, -v.y, -v.z, w, -v.z, v.y, v.z, w, -v.x, -v.y, v.x, w) * T::splat(0.5)
    }

    /// The attitude after turning with the constant body rate `omega` (rad/s) for `dt` s: the exact solution of
    /// `dq/dt = T_q omega`.
    #[inline(always)]
    #[must_use]
    pub fn turned(self, omega: &Vector3<T>, dt: T) -> Self {
        self * Self::exp(&(omega * dt))
    }
}

impl<T: Real> Mul for Quaternion<T> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.times(other).kept()
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
        for axis in [Vector3::<f64>::x(), Vector3::y(), Vector3::z()] {
            assert_relative_eq!(Quaternion::between(&axis, &-axis).rotate(&axis), -axis, epsilon = 1e-15);
        }
    }

    #[test]
    fn tiny_and_infinite_rotation_vectors_are_the_identity() {
        assert_eq!(Quaternion::exp(&Vector3::repeat(1e-200)).w(), 1.0);
        assert_eq!(Quaternion::exp(&Vector3::repeat(f64::INFINITY)), Quaternion::IDENTITY);
    }
}
