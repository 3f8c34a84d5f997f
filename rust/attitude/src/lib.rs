//! Attitude of a body frame b (the sensor's) in a reference frame n.
//!
//! One convention everywhere: `q_nb` (Hamilton, scalar first) and `r_nb` take body vectors into the reference frame,
//! `x_n = r_nb x_b`, and rotations compose like matrices: `q_nc = q_nb * q_bc`. Angles are in radians.
//! The symbols follow the paper on TRIAD with the nonlinear complementary filter (paper C of the documentation).
#![cfg_attr(test, allow(clippy::float_cmp))]
#![allow(clippy::inline_always)] // a row of a replay is a hundred operations: a call between them is felt

pub mod attitude_error;
pub mod euler;
pub mod frame;
pub mod matrix;
pub mod quaternion;
pub mod real;

pub use attitude_error::{AttitudeError, Rmse};
pub use euler::Euler;
pub use frame::Frame;
pub use quaternion::Quaternion;
pub use real::{Lanes, Real};

/// What cannot be turned into an attitude or a frame.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InvalidAttitude {
    /// A frame's name that is not in the list.
    #[error("frame {0:?} is unknown: use \"NED\", \"ENU\" or \"NWU\"")]
    UnknownFrame(String),
    /// Two columns that belong together have different lengths.
    #[error("{name} has {came} rows but {other} has {expected}: pass one row per sample in both")]
    Length {
        /// The argument that does not fit.
        name: &'static str,
        /// Its rows.
        came: usize,
        /// The argument it was compared with.
        other: &'static str,
        /// The rows of that one.
        expected: usize,
    },
}
