//! The three sensors and their channels.

/// A three-axis sensor of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Sensor {
    /// Accelerometer: specific force, m/s^2.
    Acc,
    /// Gyroscope: angular rate, rad/s.
    Gyr,
    /// Magnetometer: magnetic flux density, uT.
    Mag,
}

impl Sensor {
    /// All sensors, in the order of the channels.
    pub const ALL: [Self; 3] = [Self::Acc, Self::Gyr, Self::Mag];

    /// Position in [`Sensor::ALL`].
    pub const fn index(self) -> usize {
        match self {
            Self::Acc => 0,
            Self::Gyr => 1,
            Self::Mag => 2,
        }
    }

    /// Prefix of the sensor's columns and effect ids.
    pub const fn prefix(self) -> &'static str {
        match self {
            Self::Acc => "acc",
            Self::Gyr => "gyr",
            Self::Mag => "mag",
        }
    }

    /// The sensor with this prefix.
    pub fn from_prefix(prefix: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|s| s.prefix() == prefix)
    }

    /// Unit of the sensor's readings.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Acc => "m/s^2",
            Self::Gyr => "rad/s",
            Self::Mag => "uT",
        }
    }

    /// What the sensor is called in a sentence.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Acc => "accelerometer",
            Self::Gyr => "gyroscope",
            Self::Mag => "magnetometer",
        }
    }
}

/// Names of the three axes.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// Number of channels: three sensors of three axes.
pub const CHANNELS: usize = 9;

/// Name of a channel such as `gyr_x`, from its index `3 * sensor + axis`.
pub fn channel_name(channel: usize) -> String {
    format!("{}_{}", Sensor::ALL[channel / 3].prefix(), AXES[channel % 3])
}
