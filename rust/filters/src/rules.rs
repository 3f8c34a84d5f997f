//! The settings of the rules that [`replay`](crate::replay) states.

use nalgebra::Vector3;

use crate::FilterError;
use crate::parameter::{Parameter, fill};

/// The settings of the rules.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "max_gap",
        default: 1.0,
        unit: "s",
        meaning: "a longer step is a gap: larger integrates across more of what was not measured",
    },
    Parameter {
        name: "free_fall",
        default: 0.2,
        unit: "1",
        meaning: "a specific force shorter than this part of gravity is not used: larger refuses more of a throw",
    },
    Parameter {
        name: "acc_range",
        default: 0.0,
        unit: "m/s^2",
        meaning: "end of the accelerometer's range: a specific force with a component there is clipped and not used. 0: not known",
    },
    Parameter {
        name: "gyr_range",
        default: 0.0,
        unit: "rad/s",
        meaning: "end of the gyro's range: a rate with a component there is clipped; it is used, being the best there is, and counted. 0: not known",
    },
    Parameter {
        name: "lever_x",
        default: 0.0,
        unit: "m",
        meaning: "where the accelerometer is, body axis x, seen from a joint that stands still: its acceleration about the joint is taken out. All three 0: not done",
    },
    Parameter {
        name: "lever_y",
        default: 0.0,
        unit: "m",
        meaning: "the same, body axis y",
    },
    Parameter {
        name: "lever_z",
        default: 0.0,
        unit: "m",
        meaning: "the same, body axis z",
    },
    Parameter {
        name: "lever_time",
        default: 0.005,
        unit: "s",
        meaning: "time constant of the angular acceleration that the lever arm needs: larger takes noise out of it and comes later",
    },
    Parameter {
        name: "recovery",
        default: 1.0,
        unit: "1",
        meaning: "1: a lost attitude is found again and a single bad rate is bridged; 0: the equations of the filter alone",
    },
];

/// A reading this close to the end of the range is at it: the last step of a 12 bit converter, so that a range counts
/// as reached whether it is given as its nominal value or as the largest number that the sensor delivers.
const END: f64 = 1.0 - 1.0 / 2048.0;

/// [`PARAMETERS`] with values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rules {
    /// Longest step that is integrated, s.
    pub max_gap: f64,
    /// Least specific force that shows the vertical, in parts of gravity.
    pub free_fall: f64,
    /// End of the accelerometer's range, m/s^2; 0 where it is not known.
    pub acc_range: f64,
    /// End of the gyro's range, rad/s; 0 where it is not known.
    pub gyr_range: f64,
    /// The accelerometer seen from a joint that stands still, body frame, m; 0 where there is none.
    pub lever: Vector3<f64>,
    /// Time constant of the angular acceleration, s.
    pub lever_time: f64,
    /// Whether a lost attitude is found again and a single bad rate is bridged.
    pub recovery: bool,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            max_gap: PARAMETERS[0].default,
            free_fall: PARAMETERS[1].default,
            acc_range: PARAMETERS[2].default,
            gyr_range: PARAMETERS[3].default,
            lever: Vector3::new(PARAMETERS[4].default, PARAMETERS[5].default, PARAMETERS[6].default),
            lever_time: PARAMETERS[7].default,
            recovery: PARAMETERS[8].default > 0.0,
        }
    }
}

impl Rules {
    /// From settings by name.
    pub fn from_settings(settings: &[(String, f64)]) -> Result<Self, FilterError> {
        let values = fill("replay", PARAMETERS, settings)?;
        let value = |at: usize| values.get(at).copied().unwrap_or(PARAMETERS[at].default);
        Ok(Self {
            max_gap: value(0),
            free_fall: value(1),
            acc_range: value(2),
            gyr_range: value(3),
            lever: Vector3::new(value(4), value(5), value(6)),
            lever_time: value(7),
            recovery: value(8) > 0.0,
        })
    }
}

/// Whether a component of the reading stands at the end of the range or beyond it.
pub(crate) fn clipped(reading: &Vector3<f64>, range: f64) -> bool {
    range > 0.0 && reading.amax() >= range * END
}
