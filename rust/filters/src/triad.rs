//! Attitude from two vectors (paper C; Black 1964).
//!
//! The paper writes the columns `[a : m : a x m]`, a rotation only where a and m are orthogonal, which the Earth's field
//! is not to gravity. The standard triad is used: `t1 = a/|a|`, `t2 = (a x m)/|a x m|`, `t3 = t1 x t2`, for the measured
//! pair in the body and for the known pair in the reference frame, and `R = [t1 t2 t3]_n [t1 t2 t3]_b^T`. The first
//! vector is met exactly, of the second only the direction across the first is used; the dip of the field plays no part.

use imufit_attitude::matrix::quaternion_of_rotation;
use imufit_attitude::{Frame, Quaternion, Real};
use nalgebra::{Matrix3, SimdBool, Vector3};

use crate::filter::{Filter, Usage, split_state};
use crate::mahony::square_of_sine;
use crate::parameter::Parameter;
use crate::{Environment, FluxDensity, Sample, SpecificForce};

/// How close to parallel is too close.
pub const PARAMETERS: &[Parameter] = &[Parameter {
    name: "min_angle",
    default: 0.035,
    unit: "rad",
    meaning: "where field and specific force are closer to parallel than this, the heading is held: smaller accepts noisier headings",
}];

/// The matrix with the columns t1, t2, t3, and whether the sine of the angle between a and m has at least the given square.
pub(crate) fn triad<T: Real>(a: &Vector3<T>, m: &Vector3<T>, least_square: T) -> (Matrix3<T>, T::SimdBool) {
    let (a, m) = (a / a.norm(), m / m.norm());
    let across = a.cross(&m);
    let square = across.dot(&across);
    // A vector of length zero makes NaN, which fails every comparison.
    let apart = square.simd_gt(T::splat(0.0)) & square.simd_ge(least_square);
    let t2 = across / square.simd_sqrt();
    (Matrix3::from_columns(&[a, t2, a.cross(&t2)]), apart)
}

/// The attitude that takes the directions (a, m) of the body into those of the reference frame, a exactly; and whether
/// there is one.
pub(crate) fn attitude_from_pairs<T: Real>(
    body: (&Vector3<T>, &Vector3<T>),
    reference: (&Vector3<T>, &Vector3<T>),
    least_square: T,
) -> (Quaternion<T>, T::SimdBool) {
    let (seen, apart) = triad(body.0, body.1, least_square);
    let (known, known_apart) = triad(reference.0, reference.1, T::splat(0.0));
    (quaternion_of_rotation(&(known * seen.transpose())), apart & known_apart)
}

/// The attitude for which `f` points up and the field's horizontal part north (or along the field given in the
/// surroundings); `None` where the two are parallel within `min_angle` (rad).
pub fn attitude_from_vectors(
    f: &SpecificForce,
    m: &FluxDensity,
    environment: &Environment,
    min_angle: f64,
) -> Option<Quaternion> {
    let reference = (&environment.up(), &environment.field_north());
    let (q, apart) = attitude_from_pairs((&f.0, &m.0), reference, square_of_sine(min_angle));
    apart.then_some(q)
}

/// The attitude nearest to `q` for which `f` points up.
pub fn levelled<T: Real>(q: Quaternion<T>, f: &SpecificForce, frame: Frame) -> Quaternion<T> {
    Quaternion::between(&q.rotate(&f.0.map(T::splat)), &frame.up().map(T::splat)) * q
}

/// What TRIAD says of a sample: the attitude, and in which lanes the field had a part in it.
///
/// On rows without a usable field (a slow magnetometer, a field along the specific force) the attitude `held` is turned
/// by the least rotation that makes the specific force point up, so that roll and pitch stay fresh and the heading is
/// held. `None` without a usable specific force.
pub(crate) fn measured<T: Real>(
    sample: &Sample,
    held: Quaternion<T>,
    environment: &Environment,
    least_square: T,
) -> Option<(Quaternion<T>, T::SimdBool)> {
    let f = sample.f?.value;
    let (q, apart) = match sample.m {
        Some(m) => attitude_from_pairs(
            (&f.0.map(T::splat), &m.value.0.map(T::splat)),
            (
                &environment.up().map(T::splat),
                &environment.field_north().map(T::splat),
            ),
            least_square,
        ),
        None => (held, T::splat(0.0).simd_gt(T::splat(0.0))),
    };
    if apart.all() {
        return Some((q, apart));
    }
    Some((q.select(apart, levelled(held, &f, environment.frame())), apart))
}

/// The filter: no memory but the attitude it holds.
///
/// Rows without a usable field keep roll and pitch fresh and hold the heading; on rows without a usable specific force
/// (free fall, NaN, clipped) the attitude is held. With the first good pair of readings, also after a gap, the attitude is
/// the measured one again: recovered in one row.
#[derive(Debug, Clone)]
pub struct Triad<T = f64> {
    environment: Environment,
    least_square: T,
    q: Quaternion<T>,
}

impl<T: Real> Triad<T> {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[T]) -> Self {
        let min_angle = values.first().copied().unwrap_or(T::splat(PARAMETERS[0].default));
        Self {
            environment: *environment,
            least_square: square_of_sine(min_angle),
            q: Quaternion::default(),
        }
    }
}

impl<T: Real> Filter<T> for Triad<T> {
    #[inline]
    fn step(&mut self, sample: &Sample) -> Usage {
        let Some((q, apart)) = measured(sample, self.q, &self.environment, self.least_square) else {
            return Usage::Full;
        };
        self.q = q;
        if sample.m.is_some() && !apart.all() {
            Usage::NoHeading
        } else {
            Usage::Full
        }
    }

    #[inline]
    fn attitude(&self) -> Quaternion<T> {
        self.q
    }

    fn reset(&mut self, attitude: Quaternion) {
        self.q = attitude.splat();
    }

    fn state(&self) -> Vec<T> {
        self.q.to_array().to_vec()
    }

    fn set_state(&mut self, state: &[T]) -> bool {
        let found = split_state::<T, 0>(state);
        if let Some((q, [])) = found {
            self.q = q;
        }
        found.is_some()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn ideal_vectors_give_the_attitude(x in -3.0..3.0, y in -3.0..3.0, z in -3.0..3.0, k in 0usize..3, east in -8.0..8.0) {
            let frame = Frame::ALL[k];
            let field = frame.default_field() + frame.east() * east;
            let environment = Environment::new(frame, 9.81, Some(field)).unwrap();
            let q = Quaternion::exp(&Vector3::new(x, y, z));
            let (f, m) = (q.rotate_back(&(frame.up() * 9.81)), q.rotate_back(&field));
            let found = attitude_from_vectors(&SpecificForce(f), &FluxDensity(m), &environment, 0.03).unwrap();
            prop_assert!((q.inverse() * found).angle() < 1e-12);
        }

        #[test]
        fn levelling_meets_the_vertical_and_turns_no_more_than_needed(x in -3.0..3.0, y in -3.0..3.0, z in -3.0..3.0, tilt in 0.0..1.0) {
            let q = Quaternion::exp(&Vector3::new(x, y, z));
            let true_q = Quaternion::exp(&(Vector3::x() * tilt)) * q;
            let f = SpecificForce(true_q.rotate_back(&Vector3::z()));
            let found = levelled(q, &f, Frame::Enu);
            prop_assert!((true_q.inverse() * found).angle() < 1e-12);
        }
    }

    #[test]
    fn a_field_along_gravity_gives_no_attitude() {
        let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
        let (f, m) = (
            SpecificForce(Vector3::z() * -9.81),
            FluxDensity(Vector3::new(0.5, 0.0, 50.0)),
        );
        assert!(attitude_from_vectors(&f, &m, &environment, 0.035).is_none());
        assert!(attitude_from_vectors(&f, &FluxDensity(Vector3::zeros()), &environment, 0.0).is_none());
    }
}
