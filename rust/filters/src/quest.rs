//! Attitude from weighted vectors, QUEST (Shuster and Oh 1981); paper C names it as the next comparison.
//!
//! Wahba's problem: the rotation that makes `sum_i a_i |v_i - R w_i|^2` least for the directions w_i in the body and v_i in
//! the reference frame. The quaternion is the eigenvector of Davenport's matrix
//!
//! ```text
//! B = sum a_i v_i w_i^T,  S = B + B^T,  sigma = tr B,  z = sum a_i w_i x v_i,   K = [ sigma  z^T ; z  S - sigma I ]
//! ```
//!
//! to its largest eigenvalue, which for two vectors is
//! `lambda^2 = a_1^2 + a_2^2 + 2 a_1 a_2 (cos alpha cos beta + sin alpha sin beta)` with the angles alpha and beta between the two in
//! either frame. Shuster and Oh's formula for the vector `q / q_w` fails near half a turn; their cure, the method of
//! sequential rotations, solves the problem for a reference that is turned by half a turn about one of its axes, which comes
//! to taking another column of the adjugate of `K - lambda I`. All four are at hand here, each of them the quaternion times
//! one of its components, and the largest is taken: any rotation is found to the same precision.
//!
//! **The dip.** The two pairs contradict each other as soon as the angle between field and vertical is another one than in
//! the reference, and QUEST shares the contradiction out by the weights: a wrong dip tilts the attitude. So the field with
//! its dip is the second reference only where it is given (`mag_reference` of the log, or a reference attitude from which
//! it follows) and `dip` is 1. Otherwise the dip that is measured is taken for the true one: the pairs never contradict each
//! other, the weights have no effect, and the attitude is TRIAD's, which no dip can tilt.
//!
//! Weights further apart than the arithmetic carries (and one of them zero) give the limit: the heavier vector is met
//! exactly, as TRIAD does. Rows without a usable pair, and the recovery after them, are those of [`triad`](crate::triad): one
//! row.

use imufit_attitude::{Quaternion, Real};
use nalgebra::{Matrix3, SimdBool, Vector3};

use crate::filter::{Filter, Usage, split_state};
use crate::mahony::square_of_sine;
use crate::parameter::Parameter;
use crate::triad::{attitude_from_pairs, levelled};
use crate::{Environment, Sample};

/// Weights, the field's dip, and how close to parallel is too close.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "k_1",
        default: 1.0,
        unit: "1",
        meaning: "weight of the specific force (one over the variance of its direction): larger meets it more closely against the field",
    },
    Parameter {
        name: "k_2",
        default: 0.1,
        unit: "1",
        meaning: "weight of the magnetic field: larger lets the field's inclination into roll and pitch, and disturbances with it",
    },
    Parameter {
        name: "dip",
        default: 1.0,
        unit: "1",
        meaning: "1: a field given with the log is compared as a whole, so that its inclination counts for roll and pitch; 0: only its horizontal direction, which no wrong dip can tilt",
    },
    Parameter {
        name: "min_angle",
        default: 0.035,
        unit: "rad",
        meaning: "where field and specific force are closer to parallel than this, the heading is held: smaller accepts noisier headings",
    },
];

/// Below this distance between the two largest eigenvalues (of weights with the sum 1) the heavier vector is met exactly.
const DISTANCE: f64 = 1e-6;

/// Two directions and their weights, with the sum 1.
struct Weighted<'a, T> {
    body: [&'a Vector3<T>; 2],
    reference: [&'a Vector3<T>; 2],
    weights: [T; 2],
}

impl<T: Real> Weighted<'_, T> {
    /// The eigenvector of K to its largest eigenvalue.
    fn solve(&self) -> Quaternion<T> {
        let [w_1, w_2] = self.body;
        let [v_1, v_2] = self.reference;
        let [a_1, a_2] = self.weights;
        let b = (v_1 * w_1.transpose()) * a_1 + (v_2 * w_2.transpose()) * a_2;
        let z = w_1.cross(v_1) * a_1 + w_2.cross(v_2) * a_2;
        let sigma = b.trace();
        let cosines = w_1.dot(w_2) * v_1.dot(v_2);
        let sines = w_1.cross(w_2).norm() * v_1.cross(v_2).norm();
        let lambda = (a_1 * a_1 + a_2 * a_2 + (a_1 * a_2) * (cosines + sines) * T::splat(2.0)).simd_sqrt();
        let m = b + b.transpose() - Matrix3::from_diagonal_element(sigma + lambda);
        let top = sigma - lambda;
        // adj([top z^T; z m]): det(m), then -adj(m) z, then top adj(m) + the adjugate's part from z.
        let adjugate = adjugate_of_symmetric(&m);
        let (w, v) = (m.column(0).dot(&adjugate.column(0)), -(adjugate * z));
        let rest = adjugate * top - outer_part(&m, &z);
        let diagonal = rest.diagonal();
        let column = |k: usize| (v[k], rest.column(k).into_owned());
        let choose = |which: T::SimdBool, (w, v): (T, Vector3<T>), (other_w, other_v): (T, Vector3<T>)| {
            (
                w.select(which, other_w),
                v.zip_map(&other_v, |x, other| x.select(which, other)),
            )
        };
        let [x, y, z] = [0, 1, 2].map(|k| diagonal[k].simd_abs());
        let found = choose(y.simd_ge(z), column(1), column(2));
        let found = choose(x.simd_ge(y) & x.simd_ge(z), column(0), found);
        let w_size = w.simd_abs();
        let largest = w_size.simd_ge(x) & w_size.simd_ge(y) & w_size.simd_ge(z);
        let (w, v) = choose(largest, (w, v), found);
        Quaternion::from_components(w, v)
    }
}

/// Adjugate of a symmetric matrix.
fn adjugate_of_symmetric<T: Real>(m: &Matrix3<T>) -> Matrix3<T> {
    let columns = [
        m.column(0).into_owned(),
        m.column(1).into_owned(),
        m.column(2).into_owned(),
    ];
    Matrix3::from_columns(&[
        columns[1].cross(&columns[2]),
        columns[2].cross(&columns[0]),
        columns[0].cross(&columns[1]),
    ])
}

/// What z adds to the lower right part of the adjugate of `[top z^T; z m]`: `-[z]x^T m [z]x` with the cross product matrix.
fn outer_part<T: Real>(m: &Matrix3<T>, z: &Vector3<T>) -> Matrix3<T> {
    let cross = z.cross_matrix();
    cross.transpose() * m * cross
}

/// The filter: no memory but the attitude it holds.
#[derive(Debug, Clone)]
pub struct Quest<T = f64> {
    environment: Environment,
    weights: [T; 2],
    dip: T,
    least_square: T,
    q: Quaternion<T>,
}

impl<T: Real> Quest<T> {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[T]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(T::splat(PARAMETERS[at].default));
        let (k_1, k_2) = (value(0), value(1));
        let sum = k_1 + k_2;
        let (zero, half) = (T::splat(0.0), T::splat(0.5));
        let weighed = sum.simd_gt(zero);
        Self {
            environment: *environment,
            weights: [k_1, k_2].map(|k| (k / sum).select(weighed, half)),
            dip: value(2),
            least_square: square_of_sine(value(3)),
            q: Quaternion::default(),
        }
    }

    /// The attitude of one pair of readings, and in which lanes there is one.
    fn measured(&self, f: &Vector3<T>, m: &Vector3<T>) -> (Quaternion<T>, T::SimdBool) {
        let up = self.environment.up().map(T::splat);
        let north = self.environment.field_north().map(T::splat);
        let (by_triad, apart) = attitude_from_pairs((f, m), (&up, &north), self.least_square);
        let Some(field) = self.environment.field() else {
            return (by_triad, apart);
        };
        let field = field.map(T::splat);
        let (by_field, _) = attitude_from_pairs((m, f), (&field, &up), self.least_square);
        let (w_1, w_2) = (f / f.norm(), m / m.norm());
        let [a_1, a_2] = self.weights;
        let found = Weighted {
            body: [&w_1, &w_2],
            reference: [&up, &field],
            weights: self.weights,
        }
        .solve();
        let across = w_1.cross(&w_2);
        let distance = a_1 * a_2 * across.dot(&across);
        let limit = by_field.select(a_2.simd_gt(a_1), by_triad);
        let found = found.select(distance.simd_ge(T::splat(DISTANCE)), limit);
        let whole = self.dip.simd_gt(T::splat(0.0));
        (found.select(whole, by_triad), apart)
    }
}

impl<T: Real> Filter<T> for Quest<T> {
    fn step(&mut self, sample: &Sample) -> Usage {
        let Some(f) = sample.f else {
            return Usage::Full;
        };
        let held = || levelled(self.q, &f.value, self.environment.frame());
        let Some(m) = sample.m else {
            self.q = held();
            return Usage::Full;
        };
        let (q, apart) = self.measured(&f.value.0.map(T::splat), &m.value.0.map(T::splat));
        if apart.all() {
            self.q = q;
            return Usage::Full;
        }
        self.q = q.select(apart, held());
        Usage::NoHeading
    }

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
    use imufit_attitude::Frame;
    use proptest::prelude::*;

    use super::*;
    use crate::{FluxDensity, Reading, SpecificForce};

    fn sample(f: Vector3<f64>, m: Vector3<f64>) -> Sample {
        Sample {
            omega: None,
            f: Some(Reading {
                value: SpecificForce(f),
                dt: 0.01,
            }),
            m: Some(Reading {
                value: FluxDensity(m),
                dt: 0.01,
            }),
            ..Sample::default()
        }
    }

    /// The optimum for two vectors in closed form: the normals of the two planes meet, and within the plane the
    /// contradiction is shared out.
    fn in_the_plane(
        f: &Vector3<f64>,
        m: &Vector3<f64>,
        up: &Vector3<f64>,
        field: &Vector3<f64>,
        weights: [f64; 2],
    ) -> Quaternion {
        let (first, _) = attitude_from_pairs((f, m), (up, field), 0.0);
        let delta = up.angle(field) - f.angle(m);
        let turn = (weights[1] * delta.sin()).atan2(weights[0] + weights[1] * delta.cos());
        Quaternion::exp(&(up.cross(field).normalize() * turn)) * first
    }

    proptest! {
        #[test]
        fn it_is_the_optimum_for_any_rotation_also_half_turns(
            x in -1.0..1.0, y in -1.0..1.0, z in -1.0..1.0, angle in 0.0..3.2, half in any::<bool>(),
            off in -0.3..0.3, k_2 in 0.01..5.0
        ) {
            let axis = Vector3::new(x, y, z);
            prop_assume!(axis.norm() > 0.1);
            let frame = Frame::Ned;
            let field = frame.default_field();
            let environment = Environment::new(frame, 9.81, Some(field)).unwrap();
            let angle = if half { std::f64::consts::PI + 1e-5 * (angle - 1.6) } else { angle };
            let q = Quaternion::exp(&(axis.normalize() * angle));
            let f = q.rotate_back(&(frame.up() * 9.81));
            // A field with another dip and a heading error.
            let m = q.rotate_back(&Quaternion::exp(&Vector3::new(off, off, 0.1)).rotate(&field));
            let mut filter = Quest::new(&environment, &[1.0, k_2]);
            prop_assert_eq!(filter.step(&sample(f, m)), Usage::Full);
            let expected = in_the_plane(&f, &m, &frame.up(), &field, [1.0, k_2]);
            prop_assert!((expected.inverse() * filter.attitude()).angle() < 1e-11);
        }

        #[test]
        fn half_turns_about_the_axes_are_found(axis in 0usize..3) {
            let frame = Frame::Enu;
            let environment = Environment::new(frame, 9.81, Some(frame.default_field())).unwrap();
            let mut half = Vector3::zeros();
            half[axis] = std::f64::consts::PI;
            let q = Quaternion::exp(&half);
            let mut filter = Quest::<f64>::new(&environment, &[]);
            filter.step(&sample(q.rotate_back(&frame.up()), q.rotate_back(&frame.default_field())));
            prop_assert!((q.inverse() * filter.attitude()).angle() < 1e-12);
        }
    }

    #[test]
    fn weights_far_apart_meet_the_heavier_vector_exactly() {
        let frame = Frame::Ned;
        let field = frame.default_field();
        let environment = Environment::new(frame, 9.81, Some(field)).unwrap();
        let (f, m) = (Vector3::new(0.3, -0.2, -9.7), Vector3::new(20.0, 3.0, 30.0));
        for (weights, heavier, known) in [
            ([1.0, 0.0], f, frame.up()),
            ([1e-20, 1e9], m, field),
            ([1.0, 1e-30], f, frame.up()),
        ] {
            let mut filter = Quest::new(&environment, &weights);
            filter.step(&sample(f, m));
            assert!((filter.attitude().rotate(&heavier.normalize()) - known.normalize()).norm() < 1e-14);
        }
    }

    #[test]
    fn without_a_known_dip_a_wrong_one_does_not_tilt() {
        let frame = Frame::Ned;
        let (f, m) = (frame.up() * 9.81, frame.default_field() - frame.up() * 30.0);
        let given = Environment::new(frame, 9.81, Some(frame.default_field())).unwrap();
        let unknown = Environment::new(frame, 9.81, None).unwrap();
        for (environment, dip, tilted) in [(given, 1.0, true), (given, 0.0, false), (unknown, 1.0, false)] {
            let mut filter = Quest::new(&environment, &[1.0, 1.0, dip]);
            filter.step(&sample(f, m));
            assert_eq!(filter.attitude().angle() > 0.05, tilted);
            assert!(tilted || filter.attitude().angle() < 1e-12);
        }
    }
}
