//! Reference frames: where gravity, up and north point, and the way from one frame to another.
//!
//! | frame | x | y | z | up |
//! |---|---|---|---|---|
//! | NED | north | east | down | -z |
//! | ENU | east | north | up | +z |
//! | NWU | north | west | up | +z |
//!
//! An accelerometer at rest reads specific force `f = R^T (0 - g)`: it points **up**. The vector v_01 = `[0 0 1]` of
//! paper C is the direction of gravity in NED, so that the reading's sign is to be flipped there; here the measured
//! direction is compared with [`Frame::up`] in every frame.

use std::str::FromStr;

use nalgebra::{Matrix3, Vector3};

use crate::matrix::quaternion_from_matrix;
use crate::{InvalidAttitude, Quaternion};

/// Horizontal part of the field that is assumed where nothing is known, uT.
const HORIZONTAL_FIELD: f64 = 20.0;
/// Vertical (downward) part of that field, uT.
const DOWNWARD_FIELD: f64 = 44.0;

/// A reference frame fixed to the Earth.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Frame {
    /// North, east, down.
    #[default]
    Ned,
    /// East, north, up.
    Enu,
    /// North, west, up.
    Nwu,
}

impl Frame {
    /// All frames.
    pub const ALL: [Self; 3] = [Self::Ned, Self::Enu, Self::Nwu];

    /// The name in a log's metadata.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ned => "NED",
            Self::Enu => "ENU",
            Self::Nwu => "NWU",
        }
    }

    /// The unit vector that points up.
    pub fn up(self) -> Vector3<f64> {
        match self {
            Self::Ned => -Vector3::z(),
            Self::Enu | Self::Nwu => Vector3::z(),
        }
    }

    /// The unit vector that points north.
    pub fn north(self) -> Vector3<f64> {
        match self {
            Self::Ned | Self::Nwu => Vector3::x(),
            Self::Enu => Vector3::y(),
        }
    }

    /// The unit vector that points east.
    pub fn east(self) -> Vector3<f64> {
        self.north().cross(&self.up())
    }

    /// The vector of gravity (it points down) for its magnitude, m/s^2.
    pub fn gravity(self, magnitude: f64) -> Vector3<f64> {
        self.up() * -magnitude
    }

    /// The magnetic flux density assumed where neither metadata nor data give one, uT: to the north, and down as at
    /// middle northern latitudes.
    pub fn default_field(self) -> Vector3<f64> {
        self.north() * HORIZONTAL_FIELD - self.up() * DOWNWARD_FIELD
    }

    /// The rotation that takes vectors of this frame into the frame `to`: `q_to_b = frame.into_frame(to) * q_frame_b`.
    pub fn into_frame(self, to: Self) -> Quaternion {
        let axes = |frame: Self| Matrix3::from_columns(&[frame.north(), frame.east(), frame.up()]);
        quaternion_from_matrix(&(axes(to) * axes(self).transpose())).unwrap_or_default()
    }
}

impl FromStr for Frame {
    type Err = InvalidAttitude;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let found = Self::ALL
            .into_iter()
            .find(|frame| frame.name().eq_ignore_ascii_case(name.trim()));
        found.ok_or_else(|| InvalidAttitude::UnknownFrame(name.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn names_are_parsed_and_others_are_refused() {
        for frame in Frame::ALL {
            assert_eq!(frame.name().to_lowercase().parse::<Frame>(), Ok(frame));
        }
        let error = "XYZ".parse::<Frame>().unwrap_err();
        assert!(error.to_string().contains("XYZ") && error.to_string().contains("NED"));
    }

    #[test]
    fn axes_point_where_their_names_say() {
        assert_eq!(Frame::Ned.east(), Vector3::y());
        assert_eq!(Frame::Enu.east(), Vector3::x());
        assert_eq!(Frame::Nwu.east(), -Vector3::y());
        assert_eq!(Frame::Ned.gravity(9.81), Vector3::new(0.0, 0.0, 9.81));
    }

    #[test]
    fn conversion_keeps_up_north_and_the_field_and_has_an_inverse() {
        for from in Frame::ALL {
            for to in Frame::ALL {
                let q = from.into_frame(to);
                assert_relative_eq!(q.rotate(&from.up()), to.up(), epsilon = 1e-15);
                assert_relative_eq!(q.rotate(&from.default_field()), to.default_field(), epsilon = 1e-13);
                assert!((to.into_frame(from) * q).angle() < 1e-15);
            }
        }
    }
}
