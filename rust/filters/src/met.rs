//! How surely the field shows the heading: its direction against those met so far.
//!
//! A lost attitude turns the field as it turns the force and leaves its dip as it is; a disturbed field has another dip, or one
//! that changes with the body's turns. [`crate::field`] makes a departure of the dip a standard deviation of the heading. What
//! windows with a sound attitude depart by on average counts as well: within a field that scatters any heading may be shown.

use imufit_attitude::Real;
use nalgebra::Vector3;

use crate::field::Field;

/// Time constant of what the field was so far, s: that of `mekf`.
const MEMORY: f64 = 10.0;
/// Departure at which a window is learned half as fast, rad.
const USUAL: f64 = 0.1;

/// Numbers of it in a state.
pub(crate) const NUMBERS: usize = 5;

/// Directions of the field so far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Met<T> {
    /// Horizontal and vertical part of the direction.
    field: Field<T>,
    /// Mean variance of the heading that windows so far have shown, rad^2.
    scatter: T,
}

impl<T: Real> Met<T> {
    pub fn nothing() -> Self {
        Self {
            field: Field::unknown(),
            scatter: T::splat(0.0),
        }
    }

    /// Together with a field, seen from a level attitude, that stands for `time`; and the variance of the heading that it
    /// shows, rad^2.
    pub fn with(mut self, field: &Vector3<T>, up: &Vector3<T>, time: f64) -> (Self, T) {
        let (vertical, length) = (field.dot(up), field.norm().simd_max(T::splat(f64::MIN_POSITIVE)));
        let horizontal = (field - up * vertical).norm();
        let (memory, usual) = (T::splat(MEMORY), T::splat(USUAL));
        let variance = self
            .field
            .update(horizontal / length, vertical / length, time, memory, usual);
        let share = T::splat(time) / self.field.time;
        let shown = variance.simd_max(self.scatter);
        self.scatter += (variance - self.scatter) * share;
        (self, shown)
    }

    /// Lane by lane `self` where the condition holds, else `other`.
    pub fn select(self, condition: T::SimdBool, other: Self) -> Self {
        Self {
            field: self.field.select(condition, other.field),
            scatter: self.scatter.select(condition, other.scatter),
        }
    }

    pub fn numbers(&self) -> [T; NUMBERS] {
        let Field {
            horizontal,
            vertical,
            time,
            departure,
        } = self.field;
        [horizontal, vertical, time, departure, self.scatter]
    }

    pub fn from_numbers([horizontal, vertical, time, departure, scatter]: [T; NUMBERS]) -> Self {
        Self {
            field: Field {
                horizontal,
                vertical,
                time,
                departure,
            },
            scatter,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A field at an angle below the horizon.
    fn dipping(angle: f64) -> Vector3<f64> {
        Vector3::new(angle.cos(), 0.0, -angle.sin()) * 48.0
    }

    /// The standard deviation of the heading, rad, that a field shows after a minute of windows with such fields.
    fn after(dip: impl Fn(i32) -> f64, field: &Vector3<f64>) -> f64 {
        let (mut met, up) = (Met::nothing(), Vector3::z());
        for k in 0..40 {
            (met, _) = met.with(&dipping(dip(k)), &up, 1.5);
        }
        met.with(field, &up, 1.5).1.sqrt()
    }

    #[test]
    fn a_field_that_was_met_shows_the_heading_however_it_is_turned() {
        let turned = Vector3::new(0.0, -1.1_f64.cos(), -1.1_f64.sin());
        assert!(after(|_| 1.1, &turned) < 1e-9);
    }

    #[test]
    fn a_field_of_another_dip_and_one_that_scatters_show_none() {
        let dip = after(|_| 1.1, &dipping(1.3));
        assert!((dip - 2.0 * 0.1_f64.sin() / 1.1_f64.cos()).abs() < 0.01, "{dip}");
        let scatter = after(|k| if k % 2 == 0 { 0.9 } else { 1.3 }, &dipping(1.1));
        assert!(scatter > 0.3, "{scatter}");
    }

    #[test]
    fn the_first_field_is_taken() {
        assert!(Met::nothing().with(&dipping(1.1), &Vector3::z(), 1.5).1 <= 0.0);
    }
}
