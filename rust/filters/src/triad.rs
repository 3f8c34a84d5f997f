//! Attitude from two vectors (paper C; Black 1964).
//!
//! The paper writes the columns `[a : m : a x m]`, a rotation only where a and m are orthogonal, which the Earth's field
//! is not to gravity. The standard triad is used: `t1 = a/|a|`, `t2 = (a x m)/|a x m|`, `t3 = t1 x t2`, for the measured
//! pair in the body and for the known pair in the reference frame, and `R = [t1 t2 t3]_n [t1 t2 t3]_b^T`. The first
//! vector is met exactly, of the second only the direction across the first is used; the dip of the field plays no part.

use imufit_attitude::matrix::quaternion_from_matrix;
use imufit_attitude::{Frame, Quaternion};
use nalgebra::{Matrix3, Vector3};

use crate::filter::{Filter, Parameter, Usage, split_state};
use crate::{Environment, FluxDensity, Sample, SpecificForce};

/// How close to parallel is too close.
pub const PARAMETERS: &[Parameter] = &[Parameter {
    name: "min_angle",
    default: 0.035,
    unit: "rad",
    meaning: "where field and specific force are closer to parallel than this, the heading is held: smaller accepts noisier headings",
}];

/// The matrix with the columns t1, t2, t3; `None` where the sine of the angle between a and m is below `sine`.
fn triad(a: &Vector3<f64>, m: &Vector3<f64>, sine: f64) -> Option<Matrix3<f64>> {
    let (a, m) = (a.try_normalize(0.0)?, m.try_normalize(0.0)?);
    let across = a.cross(&m);
    let length = across.norm();
    if !(length.is_finite() && length > 0.0 && length >= sine) {
        return None;
    }
    let t2 = across / length;
    Some(Matrix3::from_columns(&[a, t2, a.cross(&t2)]))
}

/// The attitude for which `f` points up and the field's horizontal part north (or along the field given in the
/// surroundings); `None` where the two are parallel within `min_angle` (rad).
pub fn attitude_from_vectors(
    f: &SpecificForce,
    m: &FluxDensity,
    environment: &Environment,
    min_angle: f64,
) -> Option<Quaternion> {
    let body = triad(&f.0, &m.0, min_angle.min(1.5).sin())?;
    let reference = triad(&environment.up(), &environment.field_north(), 0.0)?;
    quaternion_from_matrix(&(reference * body.transpose()))
}

/// The attitude nearest to `q` for which `f` points up.
pub fn levelled(q: Quaternion, f: &SpecificForce, frame: Frame) -> Quaternion {
    Quaternion::between(&q.rotate(&f.0), &frame.up()) * q
}

/// The filter: no memory but the attitude it holds.
///
/// On rows without a usable field (a slow magnetometer, a field along the specific force) the last attitude is turned
/// by the least rotation that makes the specific force point up, so that roll and pitch stay fresh and the heading is
/// held; on rows without a usable specific force the attitude is held.
#[derive(Debug, Clone)]
pub struct Triad {
    environment: Environment,
    min_angle: f64,
    q: Quaternion,
}

impl Triad {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[f64]) -> Self {
        let min_angle = values.first().copied().unwrap_or(PARAMETERS[0].default);
        Self {
            environment: *environment,
            min_angle,
            q: Quaternion::IDENTITY,
        }
    }
}

impl Filter for Triad {
    fn step(&mut self, sample: &Sample) -> Usage {
        let Some(f) = sample.f else {
            return Usage::Full;
        };
        let measured = sample
            .m
            .and_then(|m| attitude_from_vectors(&f.value, &m.value, &self.environment, self.min_angle));
        self.q = measured.unwrap_or_else(|| levelled(self.q, &f.value, self.environment.frame()));
        if sample.m.is_some() && measured.is_none() {
            Usage::NoHeading
        } else {
            Usage::Full
        }
    }

    fn attitude(&self) -> Quaternion {
        self.q
    }

    fn reset(&mut self, attitude: Quaternion) {
        self.q = attitude;
    }

    fn state(&self) -> Vec<f64> {
        self.q.to_array().to_vec()
    }

    fn set_state(&mut self, state: &[f64]) -> bool {
        let found = split_state::<0>(state);
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
