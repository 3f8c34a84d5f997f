//! Evidence of a log: block Gram matrices of all columns, noise, and the normal equations solved from them.
//!
//! A log is gone over in windows; everything here is additive over windows, so that a log need not fit in memory and parts of it, or logs of one
//! sensor, can be added up.

pub mod bin_sums;
pub mod bins;
pub mod block_equations;
pub mod block_sums;
pub mod bounded;
pub mod evidence;
pub mod gram;
pub mod noise;
pub mod normal_equations;
pub mod part;
pub mod place_field;
pub mod profile;
pub mod reference_noise;
pub mod reference_step;
pub mod reference_width;
pub mod residual;
pub mod rests;
pub mod rounding;
pub mod saturated;
pub mod survey;
pub mod travel;
pub mod whitening;
