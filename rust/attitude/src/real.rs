//! The numbers that attitudes are made of.

use nalgebra::SimdRealField;

/// A real number of double precision, or several side by side (lanes) that go through the same computation.
///
/// `f64` is one; [`Lanes`] are four. A comparison gives one truth value per lane, and `select` takes the place of a
/// branch; one implementation serves both, and each lane has the bits that `f64` alone would have.
pub trait Real: SimdRealField<Element = f64, SimdBool: Send + Sync> + Copy + Send + Sync {}

impl<T: SimdRealField<Element = f64, SimdBool: Send + Sync> + Copy + Send + Sync> Real for T {}

/// Four numbers side by side.
pub type Lanes = simba::simd::AutoF64x4;

#[cfg(test)]
mod tests {
    use nalgebra::{SimdValue, Vector3};
    use proptest::prelude::*;

    use super::*;
    use crate::{Euler, Quaternion};

    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![6 => -4.0..4.0, 2 => -0.05..0.05, 1 => prop::sample::select(vec![0.0, 1e-200, 1e300, f64::INFINITY, f64::NAN])]
    }

    /// Whatever can be computed of two rotation vectors.
    fn all<T: Real>(a: &Vector3<T>, b: &Vector3<T>) -> Vec<T> {
        let (p, q) = (Quaternion::exp(a), Quaternion::exp(b));
        let Euler { roll, pitch, yaw } = Euler::from_quaternion(p);
        let mut found = (p * q).to_array().to_vec();
        found.extend([roll, pitch, yaw, q.angle()]);
        found.extend(Euler { roll, pitch, yaw }.to_quaternion().to_array());
        found.extend(q.log().iter());
        found.extend(p.turned(b, T::splat(0.1)).rotate_back(b).iter());
        found.extend(p.twist(&Vector3::z()).canonical().to_array());
        found
    }

    proptest! {
        #[test]
        fn a_lane_has_the_bits_of_a_number_alone(a in prop::array::uniform12(number()), b in prop::array::uniform12(number())) {
            let of = |numbers: &[f64; 12], lane: usize| Vector3::from_column_slice(&numbers[3 * lane..3 * lane + 3]);
            let lanes = |numbers: &[f64; 12]| {
                Vector3::from_fn(|row, _| Lanes::from([of(numbers, 0)[row], of(numbers, 1)[row], of(numbers, 2)[row], of(numbers, 3)[row]]))
            };
            let together = all(&lanes(&a), &lanes(&b));
            for lane in 0..4 {
                let alone = all(&of(&a, lane), &of(&b, lane));
                for (x, y) in together.iter().zip(alone) {
                    prop_assert!(x.extract(lane).to_bits() == y.to_bits() || y.is_nan() && x.extract(lane).is_nan());
                }
            }
        }
    }
}
