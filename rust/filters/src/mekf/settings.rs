//! Settings of the filter.

use imufit_attitude::Real;

use crate::parameter::Parameter;

/// Noise densities, speeds and the field's errors, so that the filter does not depend on the rate of the log.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "gyr_noise",
        default: 2e-3,
        unit: "rad/s/sqrt(Hz)",
        meaning: "noise density of the angular rate, its errors in fast turns included: larger follows accelerometer and field faster",
    },
    Parameter {
        name: "bias_walk",
        default: 1.7e-4,
        unit: "rad/s/sqrt(s)",
        meaning: "random walk of the gyro bias: larger learns a changing bias faster and takes more motion for bias",
    },
    Parameter {
        name: "acc_noise",
        default: 0.02,
        unit: "m/s^2/sqrt(Hz)",
        meaning: "noise density of the specific force: larger follows the accelerometer more slowly",
    },
    Parameter {
        name: "speed",
        default: 0.5,
        unit: "m/s",
        meaning: "horizontal speeds that occur, root mean square: larger follows the accelerometer more slowly and lets longer accelerations pass",
    },
    Parameter {
        name: "speed_time",
        default: 0.5,
        unit: "s",
        meaning: "time over which a speed lasts: larger follows the accelerometer more slowly",
    },
    Parameter {
        name: "mag_noise",
        default: 0.01,
        unit: "rad",
        meaning: "standard deviation of the heading that an undisturbed field shows: larger trusts the gyro for longer",
    },
    Parameter {
        name: "mag_time",
        default: 5.0,
        unit: "s",
        meaning: "time over which an error of the field lasts: larger trusts the gyro for longer",
    },
    Parameter {
        name: "mag_departure",
        default: 0.6,
        unit: "1",
        meaning: "weight of the field's departure from what it was so far: larger ignores a disturbed field more, 0 never does",
    },
    Parameter {
        name: "mag_memory",
        default: 10.0,
        unit: "s",
        meaning: "time constant of what the field was so far: larger accepts a changed field later",
    },
    Parameter {
        name: "angle_start",
        default: 0.2,
        unit: "rad",
        meaning: "uncertainty of the initial attitude and of that after a gap",
    },
    Parameter {
        name: "bias_start",
        default: 0.02,
        unit: "rad/s",
        meaning: "uncertainty of the initial bias of zero; a mean rate beyond three times it is never rest",
    },
    Parameter {
        name: "scale_start",
        default: 0.003,
        unit: "1",
        meaning: "uncertainty of the gyro's scale factors and misalignments; 0 takes the gyro for calibrated",
    },
    Parameter {
        name: "rest_gyr",
        default: 0.035,
        unit: "rad/s",
        meaning: "departure of the rate from its mean that still is rest: larger finds rest in more motion",
    },
    Parameter {
        name: "rest_acc",
        default: 0.5,
        unit: "m/s^2",
        meaning: "departure of the specific force from its mean that still is rest: larger finds rest in more motion",
    },
    Parameter {
        name: "rest_noise",
        default: 5e-4,
        unit: "rad/s/sqrt(Hz)",
        meaning: "noise density of the bias that a rest shows: smaller follows a rest faster",
    },
    Parameter {
        name: "min_angle",
        default: 0.035,
        unit: "rad",
        meaning: "where the field is closer to the vertical than this it is not used: smaller accepts noisier headings",
    },
];

#[derive(Debug, Clone, Copy)]
pub(super) struct Values<T> {
    pub gyr_noise: T,
    pub bias_walk: T,
    pub acc_noise: T,
    pub speed: T,
    pub speed_time: T,
    pub mag_noise: T,
    pub mag_time: T,
    pub mag_departure: T,
    pub mag_memory: T,
    pub angle_start: T,
    pub bias_start: T,
    pub scale_start: T,
    pub rest_gyr: T,
    pub rest_acc: T,
    pub rest_noise: T,
    pub min_angle: T,
}

impl<T: Real> Values<T> {
    /// In the order of [`PARAMETERS`]; what is missing has its default.
    pub fn new(values: &[T]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(T::splat(PARAMETERS[at].default));
        Self {
            gyr_noise: value(0),
            bias_walk: value(1),
            acc_noise: value(2),
            speed: value(3),
            speed_time: value(4),
            mag_noise: value(5),
            mag_time: value(6),
            mag_departure: value(7),
            mag_memory: value(8),
            angle_start: value(9),
            bias_start: value(10),
            scale_start: value(11),
            rest_gyr: value(12),
            rest_acc: value(13),
            rest_noise: value(14),
            min_angle: value(15),
        }
    }
}
