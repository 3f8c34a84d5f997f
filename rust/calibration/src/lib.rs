//! Calibration without a precise reference: poses at rest against gravity, turns between them, free rotation in a
//! constant field.
//!
//! Everything is in the form of paper A of the documentation: `corrected = A reading + b` with `A = C K`, C with a unit
//! diagonal (misalignment), K diagonal (scale). [`affine`] converts to the sensor model's `reading = G corrected + bias`.

pub mod affine;
pub mod criteria;
pub mod moving_window;
pub mod norm_cost;
pub mod pose;
pub mod pose_judge;
pub mod quantisation;
pub mod rests;
pub mod side;
pub mod solution;
pub mod turns;
pub mod vector_cost;

/// Why data cannot be calibrated from.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// Fewer equations than unknowns, or equations that repeat each other.
    #[error("{unknowns} unknowns cannot be found from {equations} equations")]
    Underdetermined {
        /// Unknown parameters.
        unknowns: usize,
        /// Independent equations.
        equations: usize,
    },
    /// The iteration left the region where the model holds.
    #[error("no calibration fits these readings: the iteration does not converge")]
    Diverged,
    /// A number that is no reading.
    #[error("{0} is not finite")]
    NotFinite(&'static str),
}
