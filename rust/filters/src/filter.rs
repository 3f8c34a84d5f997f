//! The trait of all filters.

use imufit_attitude::{Quaternion, Real};
use nalgebra::{Matrix3, SimdBool};

use crate::Sample;

/// What a step could not use of the sample it was given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Usage {
    /// All that the filter looks at.
    Full,
    /// The field was too close to the vertical to show a heading.
    NoHeading,
}

/// An attitude filter: sample in, attitude out. It may rely on each reading being finite and each `dt` not negative.
///
/// With [`Lanes`](imufit_attitude::Lanes) for `T` several settings of one filter go through the same samples side by side.
pub trait Filter<T: Real = f64>: Send + Sync {
    /// Advances to the time of `sample`.
    fn step(&mut self, sample: &Sample) -> Usage;

    /// The attitude `q_nb` after the last step, unit within 1e-12.
    fn attitude(&self) -> Quaternion<T>;

    /// Covariance of the error of the attitude, reference frame, rad^2; `None` for a filter that keeps none.
    fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        None
    }

    /// Whether it finds a lost attitude again, see [`crate::lost`](crate); a filter that holds on to nothing has none to lose.
    fn find_itself(&mut self, _on: bool) {}

    /// Starts over at `attitude`, everything learned forgotten.
    fn reset(&mut self, attitude: Quaternion);

    /// All that the next step depends on.
    fn state(&self) -> Vec<T>;

    /// Takes over what [`Filter::state`] gave; `false`, and nothing changed, where it does not fit.
    fn set_state(&mut self, state: &[T]) -> bool;
}

/// The four components of an attitude at the head of a state, and the rest.
pub(crate) fn split_state<T: Real, const REST: usize>(state: &[T]) -> Option<(Quaternion<T>, [T; REST])> {
    let (head, rest) = state.split_at_checked(4)?;
    let q = Quaternion::from_unit(head.try_into().ok()?)?;
    let rest: [T; REST] = rest.try_into().ok()?;
    let finite = |value: &T| value.simd_abs().simd_le(T::splat(f64::MAX)).all();
    rest.iter().all(finite).then_some((q, rest))
}
