//! Which effect is missing: evidences of effects, of their rivals and of causes without a name, and a verdict that may abstain.
//!
//! One criterion answers every question: the marginal likelihood of the log. A question puts columns beside a stack of effects; its Bayes
//! factor says how much better the log is predicted with them, every parameter integrated over what such sensors have, and the noise of the
//! zeros over all its strengths. All of it works on [`imufit_fit::evidence::Evidence`]; no function here sees a row of the log.

pub mod agreement;
pub mod asked;
pub mod bins;
pub mod courses;
pub mod criterion;
pub mod decided;
pub mod dictionary;
pub mod estimate;
pub mod finding;
pub mod held_out;
pub mod problem;
mod recent;
pub mod revision;
pub mod scatter;
pub mod search;
pub mod similarity;
pub mod stack;
pub mod varying;
pub mod verdict;
pub mod zeros;
