//! HMC5883L (the magnetometer of the GY-86 board, papers A and C): three fields behind six registers.
//!
//! Figures from the maker's data sheet (HMC5883L, revision E, tables 9 and 13): gains by the bits GN of configuration register B,
//! and the order X, Z, Y of the data registers 0x03 to 0x08, high byte first.

use crate::DeviceError;

/// Address on the bus.
pub const ADDRESS: u8 = 0x1E;
/// Bytes of a reading: the data registers 0x03 to 0x08.
pub const BYTES: usize = 6;

/// A gain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// End of the recommended range, uT.
    pub range: f64,
    /// Counts for 1 gauss, which is 100 uT.
    pub sensitivity: f64,
}

const fn gain(range: f64, sensitivity: f64) -> Gain {
    Gain { range, sensitivity }
}

/// By the bits GN 2 to 0: bits 7 to 5 of configuration register B.
pub const GAINS: [Gain; 8] = [
    gain(88.0, 1370.0),
    gain(130.0, 1090.0),
    gain(190.0, 820.0),
    gain(250.0, 660.0),
    gain(400.0, 440.0),
    gain(470.0, 390.0),
    gain(560.0, 330.0),
    gain(810.0, 230.0),
];

/// Rates of continuous measurement, Hz, by the bits DO 2 to 0: bits 4 to 2 of configuration register A. 7 is reserved.
pub const RATES: [f64; 7] = [0.75, 1.5, 3.0, 7.5, 15.0, 30.0, 75.0];

/// What a channel reads whose field is beyond the range.
pub const OVERFLOW: i16 = -4096;

/// uT of one count, by configuration register B.
pub fn scale(register_b: u8) -> Result<f64, DeviceError> {
    let gn = register_b >> 5;
    let refused = DeviceError::Selection {
        name: "gn",
        came: gn,
        register: "configuration register B",
    };
    GAINS
        .get(usize::from(gn))
        .map(|gain| 100.0 / gain.sensitivity)
        .ok_or(refused)
}

/// Field along x, y, z, uT, from six data registers; NaN beyond the range.
pub fn decode(registers: &[u8; BYTES], scale: f64) -> [f64; 3] {
    let field = |at: usize| match i16::from_be_bytes([registers[at], registers[at + 1]]) {
        OVERFLOW => f64::NAN,
        count => f64::from(count) * scale,
    };
    [field(0), field(4), field(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_come_in_the_order_x_z_y() {
        let scale = scale(0x20).unwrap();
        let [x, y, z] = decode(&[0x04, 0x42, 0xFF, 0xFF, 0x00, 0x6D], scale);
        assert!((x - 100.0).abs() < 1e-12 && (y - 10.0).abs() < 1e-12 && (z + 100.0 / 1090.0).abs() < 1e-12);
    }

    #[test]
    fn a_field_beyond_the_range_is_none() {
        assert!(decode(&[0xF0, 0x00, 0, 0, 0, 0], 1.0)[0].is_nan());
    }
}
