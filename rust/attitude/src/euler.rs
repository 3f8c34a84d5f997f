//! Euler angles roll phi, pitch theta, yaw psi of `R = Rz(psi) Ry(theta) Rx(phi)` (paper C, eqs. (1) and (2)).
//!
//! Element (1, 3) of matrix (2) is misprinted in the paper; multiplied out it is
//! `cos psi sin theta cos phi + sin psi sin phi`. The code multiplies the three rotations and does not use the matrix.
//!
//! Ranges: roll and yaw in (-pi, pi], pitch in [-pi/2, pi/2]. At pitch = +-90 degrees (gimbal lock) only
//! yaw -+ roll is determined; there **roll is set to 0** and yaw carries the rest. The half angles are taken from the
//! quaternion as `(roll + yaw) / 2` and `(roll - yaw) / 2`, so that the angles of an attitude close to gimbal lock still
//! compose to that attitude to machine precision.

use std::f64::consts::PI;

use nalgebra::{Matrix3, SimdBool, Vector3};

use crate::{Quaternion, Real};

/// Below this length the half angle that gimbal lock leaves open is taken as undetermined.
const GIMBAL: f64 = 1e-12;

/// Roll, pitch and yaw, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Euler<T = f64> {
    /// About the body's x axis.
    pub roll: T,
    /// About the y axis.
    pub pitch: T,
    /// About the reference frame's z axis.
    pub yaw: T,
}

/// An angle brought into (-pi, pi].
pub fn wrap<T: Real>(angle: T) -> T {
    let turn = T::splat(2.0 * PI);
    let turned = angle - turn * (angle / turn).simd_round();
    (turned + turn).select(turned.simd_le(T::splat(-PI)), turned)
}

impl<T: Real> Euler<T> {
    /// The angles of an attitude, with roll = 0 at gimbal lock.
    pub fn from_quaternion(q: Quaternion<T>) -> Self {
        let [w, x, y, z] = q.to_array();
        let (zero, two, gimbal) = (T::splat(0.0), T::splat(2.0), T::splat(GIMBAL));
        // cos(theta/2) - sin(theta/2) and cos(theta/2) + sin(theta/2): one of them vanishes at gimbal lock.
        let (minus, plus) = ((x + z).simd_hypot(w - y), (x - z).simd_hypot(w + y));
        let pitch = two * (plus - minus).simd_atan2(plus + minus);
        let (half_sum, half_difference) = ((x + z).simd_atan2(w - y), (x - z).simd_atan2(w + y));
        let (up, down) = (minus.simd_lt(gimbal), plus.simd_lt(gimbal));
        let yaw = (two * half_sum).select(down, half_sum - half_difference);
        Self {
            roll: wrap(zero.select(up | down, half_sum + half_difference)),
            pitch,
            yaw: wrap((-two * half_difference).select(up, yaw)),
        }
    }

    /// The attitude of these angles.
    pub fn to_quaternion(self) -> Quaternion<T> {
        let zero = T::splat(0.0);
        Quaternion::exp(&Vector3::new(zero, zero, self.yaw))
            * Quaternion::exp(&Vector3::new(zero, self.pitch, zero))
            * Quaternion::exp(&Vector3::new(self.roll, zero, zero))
    }

    /// The matrix of `d[roll, pitch, yaw]/dt = T omega` with the body's angular rate; `None` at gimbal lock (of any lane).
    pub fn rate_matrix(self) -> Option<Matrix3<T>> {
        let ((sp, cp), (st, ct)) = (self.roll.simd_sin_cos(), self.pitch.simd_sin_cos());
        if ct.simd_abs().simd_lt(T::splat(GIMBAL)).any() {
            return None;
        }
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        Some(Matrix3::new(
            one,
            sp * st / ct,
            cp * st / ct,
            zero,
            cp,
            -sp,
            zero,
            sp / ct,
            cp / ct,
        ))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::Rotation3;
    use proptest::prelude::*;

    use super::*;
    use crate::matrix::matrix_from_quaternion;

    proptest! {
        #[test]
        fn angles_to_quaternion_and_back(roll in -3.1_f64..3.1, pitch in -1.57..1.5, yaw in -3.1..3.1) {
            let back = Euler::from_quaternion(Euler { roll, pitch, yaw }.to_quaternion());
            let loss = 1e-14 / f64::cos(pitch);
            prop_assert!((back.roll - roll).abs() < loss);
            prop_assert!((back.pitch - pitch).abs() < 1e-14);
            prop_assert!((back.yaw - yaw).abs() < loss);
        }

        #[test]
        fn the_order_is_yaw_then_pitch_then_roll(roll in -3.0_f64..3.0, pitch in -1.5..1.5, yaw in -3.0..3.0) {
            let ours = matrix_from_quaternion(Euler { roll, pitch, yaw }.to_quaternion());
            let product = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw)
                * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch)
                * Rotation3::from_axis_angle(&Vector3::x_axis(), roll);
            prop_assert!((ours - product.matrix()).norm() < 1e-14);
            let element_13 = yaw.cos() * pitch.sin() * roll.cos() + yaw.sin() * roll.sin();
            prop_assert!((ours[(0, 2)] - element_13).abs() < 1e-14);
        }

        #[test]
        fn near_and_at_gimbal_lock_the_angles_still_compose_to_the_attitude(
            roll in -3.0_f64..3.0, below in 0.0..1e-6, sign in prop::sample::select(vec![-1.0, 1.0]), yaw in -3.0..3.0
        ) {
            let q = Euler { roll, pitch: sign * (FRAC_PI_2 - below), yaw }.to_quaternion();
            let back = Euler::from_quaternion(q).to_quaternion();
            prop_assert!((q.inverse() * back).angle() < 1e-11);
        }

        #[test]
        fn rate_matrix_is_the_derivative_of_the_angles(
            roll in -3.0_f64..3.0, pitch in -1.2..1.2, yaw in -3.0..3.0, x in -2.0..2.0, y in -2.0..2.0, z in -2.0..2.0
        ) {
            let (h, omega) = (1e-6_f64, Vector3::<f64>::new(x, y, z));
            let angles = Euler { roll, pitch, yaw };
            let q = angles.to_quaternion();
            let (a, b) = (Euler::from_quaternion(q.turned(&omega, h)), Euler::from_quaternion(q.turned(&omega, -h)));
            let rate = angles.rate_matrix().unwrap() * omega;
            prop_assert!((wrap(a.roll - b.roll) / (2.0 * h) - rate.x).abs() < 1e-7);
            prop_assert!((wrap(a.pitch - b.pitch) / (2.0 * h) - rate.y).abs() < 1e-7);
            prop_assert!((wrap(a.yaw - b.yaw) / (2.0 * h) - rate.z).abs() < 1e-7);
        }
    }

    #[test]
    fn gimbal_lock_has_no_roll() {
        for pitch in [FRAC_PI_2, -FRAC_PI_2] {
            let back = Euler::from_quaternion(
                Euler {
                    roll: 0.4,
                    pitch,
                    yaw: 0.9,
                }
                .to_quaternion(),
            );
            assert!((back.pitch - pitch).abs() < 1e-7);
            assert!(
                back.roll.abs() < 1e-3
                    || Euler {
                        roll: 0.0,
                        pitch,
                        yaw: 0.0
                    }
                    .rate_matrix()
                    .is_none()
            );
        }
        assert!(
            Euler {
                roll: 0.0,
                pitch: FRAC_PI_2,
                yaw: 0.0
            }
            .rate_matrix()
            .is_none()
        );
    }
}
