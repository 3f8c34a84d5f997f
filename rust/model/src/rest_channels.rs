//! The channels of evidence where rests stand in for a reference.
//!
//! Three of them are those of the gyroscope, at rest. What else is known is no vector: the length of gravity, the length of
//! the field, which axis of a labelled pose points up, and where the gyroscope carries the direction of gravity from one rest to the next.

use crate::sensor::{CHANNELS, Sensor, channel_name};

/// Length of the mean specific force of a rest, less gravity, m/s^2.
pub const FORCE_NORM: usize = 0;
/// Direction of gravity carried from one rest to the next by the gyroscope, less the one found there, in units of its noise.
pub const TURN: usize = 1;
/// Direction of the specific force of a labelled pose less the axis that points up, rad.
pub const POSE: usize = 2;
/// First of the three channels of the mean rate of a rest, rad/s.
pub const RATE: usize = 3;
/// Length of the magnetic field, less a constant, uT.
pub const FIELD_NORM: usize = 6;

/// What the channels are called; empty for those that nothing is known of.
pub const NAMES: [&str; CHANNELS] = [
    "acc_norm", "turn", "acc_pose", "gyr_x", "gyr_y", "gyr_z", "mag_norm", "", "",
];

/// Name of a channel of evidence: another one where rests stand in for a reference.
pub fn name(channel: usize, rests: bool) -> String {
    if rests {
        NAMES[channel].to_string()
    } else {
        channel_name(channel)
    }
}

/// Active parameters of each channel from those of each sensor and axis.
pub fn active(axes: &[Vec<usize>]) -> Vec<Vec<usize>> {
    let of = |sensors: &[Sensor]| {
        let lists = sensors.iter().flat_map(|s| &axes[3 * s.index()..3 * s.index() + 3]);
        let mut all: Vec<usize> = lists.flatten().copied().collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    let mut out = vec![Vec::new(); CHANNELS];
    out[FORCE_NORM] = of(&[Sensor::Acc]);
    out[POSE] = of(&[Sensor::Acc]);
    out[TURN] = of(&[Sensor::Acc, Sensor::Gyr]);
    out[FIELD_NORM] = of(&[Sensor::Mag]);
    out[RATE..RATE + 3].clone_from_slice(&axes[RATE..RATE + 3]);
    out
}

/// Sensors that a channel tells of.
pub const fn sensors(channel: usize) -> &'static [Sensor] {
    match channel {
        FORCE_NORM | POSE => &[Sensor::Acc],
        TURN => &[Sensor::Acc, Sensor::Gyr],
        FIELD_NORM => &[Sensor::Mag],
        _ => &[Sensor::Gyr],
    }
}
