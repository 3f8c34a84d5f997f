//! What sensors deliver, decoded to SI units: one device a file, with its registers, ranges and filters as data; and the wire
//! protocol in which a microcontroller sends it.
#![cfg_attr(test, allow(clippy::float_cmp))]

pub mod hmc5883l;
pub mod lines;
pub mod mpu6050;
pub mod pieces;
pub mod wire;

/// Standard gravity, m/s^2: the g of data sheets.
pub const STANDARD_GRAVITY: f64 = 9.80665;

/// What cannot be decoded.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// A full-scale selection that the device does not have.
    #[error("{name} = {came} selects no range: it is 0, 1, 2 or 3, bits 4 and 3 of {register}")]
    Selection {
        /// `afs_sel` or `fs_sel`.
        name: &'static str,
        /// What came.
        came: u8,
        /// Where it stands in the device.
        register: &'static str,
    },
    /// Bytes that do not make whole frames.
    #[error(
        "{bytes} bytes are not whole frames of {frame} bytes: frame {index}, from byte {start} on, ends after {over} bytes"
    )]
    Truncated {
        /// Bytes that came.
        bytes: usize,
        /// Bytes of a frame.
        frame: usize,
        /// Number of the frame that is not whole, counted from 0.
        index: usize,
        /// Its first byte, counted from 0.
        start: usize,
        /// Its bytes.
        over: usize,
    },
}
