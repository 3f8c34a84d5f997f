//! The state as numbers: attitude, bias, velocity, scale column by column, the covariance's triangle, rest, field, force.

use imufit_attitude::{Quaternion, Real};
use nalgebra::{Matrix3, Vector3};

use super::Mekf;
use super::covariance::{BIAS, SCALE, SPEED, TRIANGLE, places};
use crate::field::Field;
use crate::filter::split_state;
use crate::rest::Rest;
use crate::usual::Usual;

/// Numbers before the triangle: attitude, bias, velocity, scale.
const ESTIMATES: usize = 4 + 3 + 2 + 9;
/// Numbers of a state beyond the attitude.
const REST_OF_STATE: usize = ESTIMATES - 4 + TRIANGLE + 7 + 4 + 1 + 5;

/// The state with which a pass the other way round begins at `attitude`: bias and scale are kept with their certainty,
/// the bias, like every rate, with its sign changed; attitude and velocity are to be found anew.
pub(crate) fn turned_back<T: Real>(state: &[T], attitude: Quaternion<T>) -> Vec<T> {
    let mut state = state.to_vec();
    let at = ESTIMATES.min(state.len());
    let (head, triangle) = state.split_at_mut(at);
    for (value, own) in head.iter_mut().zip(attitude.to_array()) {
        *value = own;
    }
    for value in head.iter_mut().skip(4).take(3) {
        *value = -*value;
    }
    for value in head.iter_mut().skip(7).take(2) {
        *value = T::splat(0.0);
    }
    let is_bias = |i: usize| (BIAS..SPEED).contains(&i);
    let is_lost = |i: usize| i < BIAS || (SPEED..SCALE).contains(&i);
    for (value, (i, j)) in triangle.iter_mut().zip(places()) {
        if i != j && (is_lost(i) || is_lost(j)) {
            *value = T::splat(0.0);
        } else if is_bias(i) != is_bias(j) {
            *value = -*value;
        }
    }
    state
}

impl<T: Real> Mekf<T> {
    pub(super) fn numbers(&self) -> Vec<T> {
        let mut state = self.q.to_array().to_vec();
        state.extend(self.bias.iter().chain(&self.velocity).chain(self.scale.iter()));
        state.extend(self.covariance.triangle());
        let (Rest { rate, force, calm }, field) = (self.rest, self.field);
        state.extend(rate.iter().chain(force.iter()).map(|x| T::splat(*x)));
        state.extend([
            calm,
            field.horizontal,
            field.vertical,
            field.time,
            field.departure,
            T::splat(self.since_force),
        ]);
        state.extend(
            self.force
                .iter()
                .chain(&[self.usual.0, self.doubted])
                .map(|x| T::splat(*x)),
        );
        state
    }

    pub(super) fn set_numbers(&mut self, state: &[T]) -> bool {
        let Some((q, rest)) = split_state::<T, REST_OF_STATE>(state) else {
            return false;
        };
        let vector = |at: usize| Vector3::new(rest[at], rest[at + 1], rest[at + 2]);
        (self.q, self.bias, self.velocity) = (q, vector(0), [rest[3], rest[4]]);
        self.scale = Matrix3::from_column_slice(&rest[5..14]);
        self.covariance.set_triangle(&rest[14..14 + TRIANGLE]);
        let at = 14 + TRIANGLE;
        // What depends on no setting is the same in every lane.
        let common = |at: usize| vector(at).map(|x| x.extract(0));
        self.rest = Rest {
            rate: common(at),
            force: common(at + 3),
            calm: rest[at + 6],
        };
        self.field = Field {
            horizontal: rest[at + 7],
            vertical: rest[at + 8],
            time: rest[at + 9],
            departure: rest[at + 10],
        };
        self.since_force = rest[at + 11].extract(0);
        let alone = |at: usize| rest[at].extract(0);
        (self.force, self.usual, self.doubted) = (common(at + 12), Usual(alone(at + 15)), alone(at + 16));
        true
    }
}
