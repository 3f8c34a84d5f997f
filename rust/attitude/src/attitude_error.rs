//! How far an estimated attitude is from a reference.
//!
//! `e = q_est * q_ref^-1` is the rotation, seen in the **reference frame**, that takes the reference attitude into the
//! estimate. It is split into the *heading* (twist about the vertical) and the *inclination* (the remaining swing,
//! about a horizontal axis), as Laidig et al. 2021 (BROAD) do; roll, pitch and yaw errors are the Euler angles of `e`,
//! and so free of the gimbal lock of the two attitudes.

use nalgebra::Vector3;

use crate::{Euler, InvalidAttitude, Quaternion};

/// The error of one row, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeError {
    /// Axis times angle of the error, in the reference frame.
    pub vector: Vector3<f64>,
    /// Angle of the whole error, in [0, pi].
    pub total: f64,
    /// Rotation about the vertical (z of every frame), in (-pi, pi].
    pub heading: f64,
    /// Rotation about a horizontal axis, in [0, pi].
    pub inclination: f64,
    /// Roll, pitch and yaw of the error.
    pub euler: Euler,
}

impl AttitudeError {
    /// The error of the estimate `q_est` against the reference `q_ref`.
    pub fn between(q_est: Quaternion, q_ref: Quaternion) -> Self {
        let e = (q_est * q_ref.inverse()).canonical();
        let [w, x, y, z] = e.to_array();
        Self {
            vector: e.log(),
            total: e.angle(),
            heading: 2.0 * z.atan2(w),
            inclination: 2.0 * x.hypot(y).atan2(w.hypot(z)),
            euler: Euler::from_quaternion(e),
        }
    }
}

/// Root mean square errors over the rows that count, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rmse {
    /// Rows that counted.
    pub rows: usize,
    /// Of the whole error.
    pub total: f64,
    /// Of the part about the vertical.
    pub heading: f64,
    /// Of the part about a horizontal axis.
    pub inclination: f64,
    /// Of the error's roll.
    pub roll: f64,
    /// Of the error's pitch.
    pub pitch: f64,
    /// Of the error's yaw.
    pub yaw: f64,
    /// Spread of the error vector about its mean: `total^2 = |mean error vector|^2 + sd^2`.
    pub sd: f64,
}

impl Rmse {
    /// Over the rows `[w, x, y, z]` of `estimate` and `reference` where both are attitudes and `mask`, if given, is
    /// not `false`. `None` where no row counts.
    pub fn over(estimate: &[f64], reference: &[f64], mask: Option<&[bool]>) -> Result<Option<Self>, InvalidAttitude> {
        let (n, expected) = (estimate.len() / 4, reference.len() / 4);
        if n != expected {
            return Err(InvalidAttitude::Length {
                name: "estimate",
                came: n,
                other: "reference",
                expected,
            });
        }
        if let Some(mask) = mask.filter(|mask| mask.len() != n) {
            let came = mask.len();
            return Err(InvalidAttitude::Length {
                name: "mask",
                came,
                other: "estimate",
                expected: n,
            });
        }
        let mut rows = 0usize;
        let mut squares = [0.0; 6];
        let (mut mean, mut spread) = (Vector3::zeros(), 0.0);
        for (k, (a, b)) in estimate.chunks_exact(4).zip(reference.chunks_exact(4)).enumerate() {
            let counts = mask.is_none_or(|mask| mask.get(k).copied().unwrap_or(false));
            let (true, Some(a), Some(b)) = (counts, Quaternion::from_row(a), Quaternion::from_row(b)) else {
                continue;
            };
            let error = AttitudeError::between(a, b);
            let Euler { roll, pitch, yaw } = error.euler;
            for (sum, value) in
                squares
                    .iter_mut()
                    .zip([error.total, error.heading, error.inclination, roll, pitch, yaw])
            {
                *sum += value * value;
            }
            // Welford's update keeps the spread of a small error around a large mean.
            rows += 1;
            let before = error.vector - mean;
            mean += before / rows as f64;
            spread += before.dot(&(error.vector - mean));
        }
        if rows == 0 {
            return Ok(None);
        }
        let [total, heading, inclination, roll, pitch, yaw] = squares.map(|sum| (sum / rows as f64).sqrt());
        Ok(Some(Self {
            rows,
            total,
            heading,
            inclination,
            roll,
            pitch,
            yaw,
            sd: (spread / rows as f64).sqrt(),
        }))
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
        fn heading_and_inclination_are_twist_and_swing(r in vector(2.0), psi in -3.0..3.0, tilt in 0.0..3.0, a in 0.0..6.0) {
            let q_ref = Quaternion::exp(&r);
            let swing = Quaternion::exp(&(Vector3::new(f64::cos(a), f64::sin(a), 0.0) * tilt));
            let error = swing * Quaternion::exp(&(Vector3::z() * psi));
            let found = AttitudeError::between(error * q_ref, q_ref);
            prop_assert!(f64::abs(found.heading - psi) < 1e-12);
            prop_assert!(f64::abs(found.inclination - tilt) < 1e-12);
            prop_assert!(f64::abs(found.total - error.angle()) < 1e-12);
        }

        #[test]
        fn the_error_does_not_depend_on_the_sign_of_a_quaternion(a in vector(3.0), b in vector(3.0)) {
            let (p, q) = (Quaternion::exp(&a), Quaternion::exp(&b));
            let [w, x, y, z] = p.to_array();
            let flipped = Quaternion::new(-w, -x, -y, -z).unwrap();
            let (one, two) = (AttitudeError::between(p, q), AttitudeError::between(flipped, q));
            prop_assert!((one.vector - two.vector).norm() < 1e-12);
        }
    }

    #[test]
    fn rmse_counts_only_rows_with_reference_and_mask() {
        let turned = Quaternion::exp(&Vector3::new(0.0, 0.0, 0.1)).to_array();
        let estimate: Vec<f64> = [turned, turned, [f64::NAN; 4], turned].concat();
        let identity = Quaternion::IDENTITY.to_array();
        let reference: Vec<f64> = [identity, [f64::NAN; 4], identity, identity].concat();
        let rmse = Rmse::over(&estimate, &reference, None).unwrap().unwrap();
        assert_eq!(rmse.rows, 2);
        assert_relative_eq!(rmse.heading, 0.1, epsilon = 1e-14);
        assert!(rmse.inclination < 1e-15 && rmse.sd < 1e-15);
        assert_eq!(Rmse::over(&estimate, &reference, Some(&[false; 4])), Ok(None));
        assert!(Rmse::over(&estimate, &reference, Some(&[true; 3])).is_err());
    }

    #[test]
    fn total_is_mean_and_spread() {
        let rows: Vec<f64> = [0.3, 0.1, -0.05]
            .iter()
            .flat_map(|&x| Quaternion::exp(&Vector3::new(x, 0.02, 0.0)).to_array())
            .collect();
        let reference = Quaternion::IDENTITY.to_array().repeat(3);
        let rmse = Rmse::over(&rows, &reference, None).unwrap().unwrap();
        let mean = Vector3::new(0.35 / 3.0, 0.02, 0.0).norm_squared();
        assert_relative_eq!(rmse.total.powi(2), mean + rmse.sd.powi(2), epsilon = 1e-15);
    }
}
