//! The Allan deviation of a sensor at rest.
//!
//! | file | holds |
//! |---|---|
//! | [`deviation`] | the overlapping estimator, one pass for each averaging time, over pieces with lost samples |
//! | [`freedom`] | its equivalent degrees of freedom under each kind of noise |
//! | [`scatter`] | the standard deviation of one sample without what wanders slowly |
#![cfg_attr(test, allow(clippy::float_cmp))]

pub mod deviation;
pub mod freedom;
pub mod scatter;

pub use deviation::{Variance, allan_variance};
pub use freedom::{NoiseKind, degrees_of_freedom};
pub use scatter::scatter;
