//! Which effect is missing: ranking by held-out error, a gate that survives correlated noise, rivals, and a verdict that may abstain.
//!
//! All of it works on [`imufit_fit::evidence::Evidence`]; no function here sees a row of the log.

pub mod agreement;
pub mod changes;
pub mod confounding;
pub mod dependence;
pub mod drift;
pub mod estimate;
pub mod held_out;
pub mod jackknife;
pub mod orthonormal;
pub mod part;
pub mod problem;
pub mod residual;
pub mod revision;
pub mod saturated;
pub mod screening;
pub mod selection;
pub mod together;
pub mod verdict;
