//! Rotation matrices `r_nb` from and to quaternions, and the rotation nearest to a matrix that is none.

use nalgebra::{Matrix3, Vector3};

use crate::{Quaternion, Real};

/// The matrix of an attitude: its columns are the body's axes in the reference frame.
#[inline(always)]
pub fn matrix_from_quaternion<T: Real>(q: Quaternion<T>) -> Matrix3<T> {
    let [w, x, y, z] = q.to_array();
    let (one, two) = (T::splat(1.0), T::splat(2.0));
    Matrix3::new(
        one - two * (y * y + z * z),
        two * (x * y - w * z),
        two * (x * z + w * y),
        two * (x * y + w * z),
        one - two * (x * x + z * z),
        two * (y * z - w * x),
        two * (x * z - w * y),
        two * (y * z + w * x),
        one - two * (x * x + y * y),
    )
}

/// The attitude of a rotation matrix (Shepperd 1978: divide by the largest of the four candidates).
///
/// `None` where an entry is not finite. A matrix that is no rotation must go through [`nearest_rotation`] first.
pub fn quaternion_from_matrix(r: &Matrix3<f64>) -> Option<Quaternion> {
    r.iter().all(|x| x.is_finite()).then(|| quaternion_of_rotation(r))
}

/// [`quaternion_from_matrix`] for a matrix that is known to be a rotation.
pub fn quaternion_of_rotation<T: Real>(r: &Matrix3<T>) -> Quaternion<T> {
    let (a, b, c) = (r[(0, 0)], r[(1, 1)], r[(2, 2)]);
    let (trace, one, two) = (a + b + c, T::splat(1.0), T::splat(2.0));
    let plus = Vector3::new(r[(2, 1)] + r[(1, 2)], r[(0, 2)] + r[(2, 0)], r[(1, 0)] + r[(0, 1)]);
    let minus = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]);
    let by_x = (minus.x, Vector3::new(one + two * a - trace, plus.z, plus.y));
    let by_y = (minus.y, Vector3::new(plus.z, one + two * b - trace, plus.x));
    let by_z = (minus.z, Vector3::new(plus.y, plus.x, one + two * c - trace));
    let choose = |which: T::SimdBool, (w, v): (T, Vector3<T>), (other_w, other_v): (T, Vector3<T>)| {
        (
            w.select(which, other_w),
            v.zip_map(&other_v, |x, other| x.select(which, other)),
        )
    };
    let imaginary = choose(b.simd_ge(c), by_y, by_z);
    let imaginary = choose(a.simd_ge(b) & a.simd_ge(c), by_x, imaginary);
    let real = trace.simd_ge(a) & trace.simd_ge(b) & trace.simd_ge(c);
    let (w, v) = choose(real, (one + trace, minus), imaginary);
    Quaternion::from_components(w, v)
}

/// The rotation nearest to `m` in the sense of the Frobenius norm, by singular value decomposition
/// (orthogonal Procrustes problem with determinant +1).
///
/// `None` where an entry is not finite or where the rank is below two, so that the rotation is not determined.
pub fn nearest_rotation(m: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    if !m.iter().all(|value| value.is_finite()) {
        return None;
    }
    let svd = m.try_svd(true, true, f64::EPSILON, 200)?;
    let (u, v_t) = (svd.u?, svd.v_t?);
    if svd.singular_values[1] <= 1e-12 * svd.singular_values[0] {
        return None;
    }
    let sign = (u.determinant() * v_t.determinant()).signum();
    Some(u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn vector(limit: f64) -> impl Strategy<Value = Vector3<f64>> {
        [-limit..limit, -limit..limit, -limit..limit].prop_map(Vector3::from)
    }

    proptest! {
        #[test]
        fn quaternion_to_matrix_and_back_is_the_same_attitude(r in vector(6.0)) {
            let q = Quaternion::exp(&r);
            let matrix = matrix_from_quaternion(q);
            let back = quaternion_from_matrix(&matrix).unwrap();
            prop_assert!((q.inverse() * back).angle() < 1e-14);
            prop_assert!((matrix.determinant() - 1.0).abs() < 1e-13);
        }

        #[test]
        fn matrix_and_quaternion_turn_a_vector_alike(r in vector(6.0), x in vector(6.0)) {
            let q = Quaternion::exp(&r);
            prop_assert!((matrix_from_quaternion(q) * x - q.rotate(&x)).norm() < 1e-13);
        }

        #[test]
        fn nearest_rotation_undoes_a_small_deformation(r in vector(3.0), s in vector(0.2)) {
            let rotation = matrix_from_quaternion(Quaternion::exp(&r));
            let stretch = Matrix3::from_diagonal(&(Vector3::repeat(1.0) + s));
            let nearest = nearest_rotation(&(rotation * stretch)).unwrap();
            prop_assert!((nearest - rotation).norm() < 1e-12);
        }
    }

    #[test]
    fn half_turns_keep_their_axis() {
        for axis in [
            Vector3::x(),
            Vector3::y(),
            Vector3::z(),
            Vector3::new(1.0, 2.0, -3.0).normalize(),
        ] {
            let q = Quaternion::exp(&(axis * std::f64::consts::PI));
            let back = quaternion_from_matrix(&matrix_from_quaternion(q)).unwrap();
            assert!((q.inverse() * back).angle() < 1e-7);
        }
    }

    #[test]
    fn a_reflection_goes_to_a_rotation_and_a_flat_matrix_to_none() {
        let nearest = nearest_rotation(&Matrix3::from_diagonal(&Vector3::new(1.0, 0.9, -0.1))).unwrap();
        assert!((nearest.determinant() - 1.0).abs() < 1e-12);
        assert!(nearest_rotation(&Matrix3::from_diagonal(&Vector3::new(1.0, 0.0, 0.0))).is_none());
        assert!(nearest_rotation(&Matrix3::repeat(f64::NAN)).is_none());
    }
}
