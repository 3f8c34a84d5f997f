//! Where the first attitude comes from.

use imufit_attitude::Quaternion;

/// How the first attitude is found.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Start {
    /// From the first row with a usable specific force and field (TRIAD). Without a field, whether the log has none,
    /// none comes within `max_gap`, or it is parallel to gravity: inclination from the specific force, heading 0.
    /// Without a usable specific force within `max_gap`: the identity.
    #[default]
    Vectors,
    /// Given, at the first row not before `time` (s).
    Given {
        /// The row it belongs to, or earlier.
        time: f64,
        /// The attitude there.
        attitude: Quaternion,
    },
}
