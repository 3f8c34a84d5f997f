//! MPU6050 (paper B's sensor): accelerometer, thermometer and gyro behind one block of registers.
//!
//! Figures from the maker's product specification (PS-MPU-6000A-00, sections 6.1 and 6.2) and register map
//! (RM-MPU-6000A-00). The accelerometer reads +1 g on the axis that points up, which is the specific force; the gyro is
//! right-handed about the same axes.

use crate::{DeviceError, STANDARD_GRAVITY};

/// Address on the bus with pin AD0 low.
pub const ADDRESS: u8 = 0x68;
/// Address on the bus with pin AD0 high.
pub const ADDRESS_AD0_HIGH: u8 = 0x69;

/// Registers by the names of the register map. A reading is two bytes from its `_H` on, high byte first.
pub const REGISTERS: [(&str, u8); 22] = [
    ("SMPLRT_DIV", 0x19),
    ("CONFIG", 0x1A),
    ("GYRO_CONFIG", 0x1B),
    ("ACCEL_CONFIG", 0x1C),
    ("FIFO_EN", 0x23),
    ("INT_PIN_CFG", 0x37),
    ("INT_ENABLE", 0x38),
    ("INT_STATUS", 0x3A),
    ("ACCEL_XOUT_H", 0x3B),
    ("ACCEL_YOUT_H", 0x3D),
    ("ACCEL_ZOUT_H", 0x3F),
    ("TEMP_OUT_H", 0x41),
    ("GYRO_XOUT_H", 0x43),
    ("GYRO_YOUT_H", 0x45),
    ("GYRO_ZOUT_H", 0x47),
    ("SIGNAL_PATH_RESET", 0x68),
    ("USER_CTRL", 0x6A),
    ("PWR_MGMT_1", 0x6B),
    ("PWR_MGMT_2", 0x6C),
    ("FIFO_COUNTH", 0x72),
    ("FIFO_R_W", 0x74),
    ("WHO_AM_I", 0x75),
];

/// A full-scale range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FullScale {
    /// Its end, g or deg/s.
    pub range: f64,
    /// Counts for 1 g or 1 deg/s.
    pub sensitivity: f64,
}

/// Of the accelerometer, g, by `AFS_SEL`.
pub const ACCELEROMETER: [FullScale; 4] = [
    FullScale {
        range: 2.0,
        sensitivity: 16384.0,
    },
    FullScale {
        range: 4.0,
        sensitivity: 8192.0,
    },
    FullScale {
        range: 8.0,
        sensitivity: 4096.0,
    },
    FullScale {
        range: 16.0,
        sensitivity: 2048.0,
    },
];

/// Of the gyro, deg/s, by `FS_SEL`.
pub const GYRO: [FullScale; 4] = [
    FullScale {
        range: 250.0,
        sensitivity: 131.0,
    },
    FullScale {
        range: 500.0,
        sensitivity: 65.5,
    },
    FullScale {
        range: 1000.0,
        sensitivity: 32.8,
    },
    FullScale {
        range: 2000.0,
        sensitivity: 16.4,
    },
];

/// The thermometer: counts for 1 degC, and the temperature of count 0.
pub const TEMPERATURE_SENSITIVITY: f64 = 340.0;
/// See [`TEMPERATURE_SENSITIVITY`].
pub const TEMPERATURE_OFFSET: f64 = 36.53;

/// What the digital low-pass filter does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LowPass {
    /// Bandwidth of the accelerometer, Hz.
    pub acc_bandwidth: f64,
    /// Delay of the accelerometer, s.
    pub acc_delay: f64,
    /// Bandwidth of the gyro, Hz.
    pub gyr_bandwidth: f64,
    /// Delay of the gyro, s.
    pub gyr_delay: f64,
    /// Rate of the gyro, Hz, which `SMPLRT_DIV` + 1 divides. The accelerometer's is 1000 Hz.
    pub gyr_rate: f64,
}

const fn low_pass(acc_bandwidth: f64, acc_delay: f64, gyr_bandwidth: f64, gyr_delay: f64, gyr_rate: f64) -> LowPass {
    LowPass {
        acc_bandwidth,
        acc_delay,
        gyr_bandwidth,
        gyr_delay,
        gyr_rate,
    }
}

/// By `DLPF_CFG` 0 to 6; 7 is reserved.
pub const LOW_PASS: [LowPass; 7] = [
    low_pass(260.0, 0.0, 256.0, 0.98e-3, 8000.0),
    low_pass(184.0, 2.0e-3, 188.0, 1.9e-3, 1000.0),
    low_pass(94.0, 3.0e-3, 98.0, 2.8e-3, 1000.0),
    low_pass(44.0, 4.9e-3, 42.0, 4.8e-3, 1000.0),
    low_pass(21.0, 8.5e-3, 20.0, 8.3e-3, 1000.0),
    low_pass(10.0, 13.8e-3, 10.0, 13.4e-3, 1000.0),
    low_pass(5.0, 19.0e-3, 5.0, 18.6e-3, 1000.0),
];

/// What a frame holds. The FIFO writes what it was told to in the order of the registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Frame {
    /// The block of registers 0x3B to 0x48: accelerometer, thermometer, gyro.
    WithTemperature,
    /// Accelerometer and gyro, as the FIFO delivers them without the thermometer.
    WithoutTemperature,
}

impl Frame {
    /// Its bytes.
    pub fn bytes(self) -> usize {
        match self {
            Self::WithTemperature => 14,
            Self::WithoutTemperature => 12,
        }
    }

    /// Byte at which the gyro begins.
    fn gyro(self) -> usize {
        self.bytes() - 6
    }
}

/// n decoded frames, row by row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Readings {
    /// Specific force, m/s^2: 3 n.
    pub acc: Vec<f64>,
    /// Angular rate, rad/s: 3 n.
    pub gyr: Vec<f64>,
    /// Temperature, degC: n, or none.
    pub temp: Vec<f64>,
    /// Whether a component of the specific force stands at an end of the converter: 3 n.
    pub acc_clipped: Vec<bool>,
    /// Whether a component of the angular rate does: 3 n.
    pub gyr_clipped: Vec<bool>,
}

/// The selected ranges, with the size of a count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// m/s^2 of one count.
    acc: f64,
    /// rad/s of one count.
    gyr: f64,
}

/// The range that a register selects: bits 4 and 3 of `ACCEL_CONFIG` or `GYRO_CONFIG`.
pub const fn selected(ranges: &[FullScale; 4], register: u8) -> FullScale {
    ranges[(register >> 3 & 3) as usize]
}

impl Scales {
    /// By the registers `ACCEL_CONFIG` and `GYRO_CONFIG`.
    pub fn of_registers(accel_config: u8, gyro_config: u8) -> Self {
        Self::of(selected(&ACCELEROMETER, accel_config), selected(&GYRO, gyro_config))
    }

    /// By `AFS_SEL` (accelerometer) and `FS_SEL` (gyro).
    pub fn new(afs_sel: u8, fs_sel: u8) -> Result<Self, DeviceError> {
        let refuse = |name, came, register| DeviceError::Selection { name, came, register };
        let acc = ACCELEROMETER
            .get(usize::from(afs_sel))
            .ok_or_else(|| refuse("afs_sel", afs_sel, "ACCEL_CONFIG"))?;
        let gyr = GYRO
            .get(usize::from(fs_sel))
            .ok_or_else(|| refuse("fs_sel", fs_sel, "GYRO_CONFIG"))?;
        Ok(Self::of(*acc, *gyr))
    }

    fn of(acc: FullScale, gyr: FullScale) -> Self {
        Self {
            acc: STANDARD_GRAVITY / acc.sensitivity,
            gyr: 1_f64.to_radians() / gyr.sensitivity,
        }
    }
}

/// A big-endian number in two's complement.
fn count(bytes: &[u8], at: usize) -> i16 {
    let byte = |at: usize| bytes.get(at).copied().unwrap_or(0);
    i16::from_be_bytes([byte(at), byte(at + 1)])
}

fn triple(bytes: &[u8], at: usize, scale: f64, values: &mut Vec<f64>, clipped: &mut Vec<bool>) {
    for axis in 0..3 {
        let count = count(bytes, at + 2 * axis);
        values.push(f64::from(count) * scale);
        clipped.push(count == i16::MIN || count == i16::MAX);
    }
}

/// Temperature of a count, degC.
fn temperature(count: i16) -> f64 {
    f64::from(count) / TEMPERATURE_SENSITIVITY + TEMPERATURE_OFFSET
}

/// Decodes the block of registers 0x3B to 0x48: specific force, m/s^2; angular rate, rad/s; temperature, degC.
pub fn decode_block(block: &[u8; 14], scales: &Scales) -> [f64; 7] {
    let at = |at: usize| count(block, at);
    let acc = |at_byte: usize| f64::from(at(at_byte)) * scales.acc;
    let gyr = |at_byte: usize| f64::from(at(at_byte)) * scales.gyr;
    [acc(0), acc(2), acc(4), gyr(8), gyr(10), gyr(12), temperature(at(6))]
}

/// Decodes a burst of whole frames.
pub fn decode(bytes: &[u8], frame: Frame, scales: &Scales) -> Result<Readings, DeviceError> {
    let (n, over) = (bytes.len() / frame.bytes(), bytes.len() % frame.bytes());
    if over > 0 {
        return Err(DeviceError::Truncated {
            bytes: bytes.len(),
            frame: frame.bytes(),
            index: n,
            start: n * frame.bytes(),
            over,
        });
    }
    let has_temperature = frame == Frame::WithTemperature;
    let mut readings = Readings {
        acc: Vec::with_capacity(3 * n),
        gyr: Vec::with_capacity(3 * n),
        temp: Vec::with_capacity(if has_temperature { n } else { 0 }),
        acc_clipped: Vec::with_capacity(3 * n),
        gyr_clipped: Vec::with_capacity(3 * n),
    };
    for block in bytes.chunks_exact(frame.bytes()) {
        triple(block, 0, scales.acc, &mut readings.acc, &mut readings.acc_clipped);
        triple(
            block,
            frame.gyro(),
            scales.gyr,
            &mut readings.gyr,
            &mut readings.gyr_clipped,
        );
        if has_temperature {
            readings.temp.push(temperature(count(block, 6)));
        }
    }
    Ok(readings)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn block(counts: [i16; 7]) -> Vec<u8> {
        counts.iter().flat_map(|count| count.to_be_bytes()).collect()
    }

    #[test]
    fn the_figures_of_the_data_sheet() {
        // 1 g up on z, 131 LSB for 1 deg/s, and the temperature of count -521: 35 degC.
        let scales = Scales::new(0, 0).unwrap();
        let still = decode(
            &block([0, 0, 16384, -521, 131, -131, 0]),
            Frame::WithTemperature,
            &scales,
        )
        .unwrap();
        assert_eq!(still.acc, [0.0, 0.0, STANDARD_GRAVITY]);
        assert!((still.gyr[0] - 1_f64.to_radians()).abs() < 1e-16 && still.gyr[1] == -still.gyr[0]);
        assert!((still.temp[0] - 34.997_647_058_823_53).abs() < 1e-12);
        assert!(!still.acc_clipped.iter().chain(&still.gyr_clipped).any(|flag| *flag));
    }

    #[test]
    fn the_ends_of_the_converter_are_flagged_on_their_channel() {
        let scales = Scales::new(3, 3).unwrap();
        let ends = decode(
            &block([i16::MAX, -32767, i16::MIN, 0, 32766, i16::MAX, 0]),
            Frame::WithTemperature,
            &scales,
        );
        let ends = ends.unwrap();
        assert_eq!(ends.acc_clipped, [true, false, true]);
        assert_eq!(ends.gyr_clipped, [false, true, false]);
        assert_eq!(ends.acc[2], -16.0 * STANDARD_GRAVITY);
    }

    #[test]
    fn what_is_no_range_or_no_frame_is_refused_by_name() {
        assert!(
            Scales::new(4, 0)
                .unwrap_err()
                .to_string()
                .contains("afs_sel = 4 selects no range")
        );
        assert!(Scales::new(0, 9).unwrap_err().to_string().contains("GYRO_CONFIG"));
        let scales = Scales::new(0, 0).unwrap();
        let error = decode(&[0; 31], Frame::WithTemperature, &scales)
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("31 bytes") && error.contains("frame 2, from byte 28 on, ends after 3 bytes"),
            "{error}"
        );
        assert!(decode(&[0; 24], Frame::WithoutTemperature, &scales).is_ok());
        assert!(decode(&[], Frame::WithoutTemperature, &scales).unwrap().acc.is_empty());
    }

    proptest! {
        #[test]
        fn every_count_comes_back_from_every_range(counts in prop::array::uniform7(any::<i16>()), afs_sel in 0u8..4, fs_sel in 0u8..4) {
            let scales = Scales::new(afs_sel, fs_sel).unwrap();
            let whole = decode(&block(counts), Frame::WithTemperature, &scales).unwrap();
            let ranges = (ACCELEROMETER[usize::from(afs_sel)], GYRO[usize::from(fs_sel)]);
            let registers = Scales::of_registers(0xE7 | afs_sel << 3, 0xE7 | fs_sel << 3);
            let of_block = decode_block(&block(counts).try_into().unwrap(), &registers);
            prop_assert_eq!(of_block[..3].to_vec(), whole.acc.clone());
            prop_assert_eq!(of_block[3..6].to_vec(), whole.gyr.clone());
            prop_assert_eq!(of_block[6], whole.temp[0]);
            for axis in 0..3 {
                let g = whole.acc[axis] / STANDARD_GRAVITY * ranges.0.sensitivity;
                prop_assert_eq!(g.round(), f64::from(counts[axis]));
                let degrees = whole.gyr[axis].to_degrees() * ranges.1.sensitivity;
                prop_assert_eq!(degrees.round(), f64::from(counts[4 + axis]));
            }
            let without: Vec<u8> = block(counts).into_iter().enumerate().filter(|(at, _)| !(6..8).contains(at)).map(|(_, byte)| byte).collect();
            let motion = decode(&without, Frame::WithoutTemperature, &scales).unwrap();
            prop_assert_eq!(&motion.acc, &whole.acc);
            prop_assert_eq!(&motion.gyr, &whole.gyr);
            prop_assert!(motion.temp.is_empty());
        }
    }
}
