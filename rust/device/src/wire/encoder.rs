//! Samples to bytes, as a device does it: for emulated devices and for tests.

use super::announcement::{Announcement, Form, Number, STREAMS};
use super::frame::{self, Frame};
use crate::hmc5883l;
use crate::mpu6050;

/// A device that speaks the protocol.
pub struct Encoder {
    announcement: Announcement,
    start: u8,
    sequence: u16,
}

impl Encoder {
    /// A device at its start.
    pub fn new(announcement: Announcement, start: u8) -> Self {
        Self {
            announcement,
            start,
            sequence: 0,
        }
    }

    /// What it announces.
    pub fn announcement(&self) -> &Announcement {
        &self.announcement
    }

    fn framed(&mut self, kind: u8, payload: &[u8]) -> Vec<u8> {
        let sequence = self.sequence;
        self.sequence = sequence.wrapping_add(1);
        frame::encode(&Frame {
            kind,
            start: self.start,
            sequence,
            payload,
        })
    }

    /// The announcement as a frame.
    pub fn announce(&mut self) -> Vec<u8> {
        let payload = self.announcement.encode();
        self.framed(frame::ANNOUNCEMENT, &payload)
    }

    /// A message as a frame.
    pub fn text(&mut self, text: &str) -> Vec<u8> {
        self.framed(frame::TEXT, text.as_bytes())
    }

    /// A sample as a frame: SI values of all columns, rounded to counts and clipped at the range. A stream whose values are NaN is not in it.
    pub fn sample(&mut self, stamp: u32, values: &[f64]) -> Vec<u8> {
        let mut payload = stamp.to_le_bytes().to_vec();
        payload.push(0);
        let mut rest = values;
        for (k, stream) in self.announcement.streams.iter().enumerate().take(STREAMS) {
            let (own, after) = rest.split_at_checked(stream.form.width()).unwrap_or((rest, &[]));
            rest = after;
            if own.iter().any(|v| !v.is_nan()) {
                payload[4] |= 1 << k;
                counts(&stream.form, own, &mut payload);
            }
        }
        self.framed(frame::SAMPLE, &payload)
    }
}

/// The nearest count; the ends of the converter beyond them.
fn count16(value: f64) -> i16 {
    value.round().clamp(f64::from(i16::MIN), f64::from(i16::MAX)) as i16
}

fn counts(form: &Form, values: &[f64], out: &mut Vec<u8>) {
    let value = |k: usize| values.get(k).copied().unwrap_or(f64::NAN);
    match form {
        Form::Counts(number, channels) => {
            for (k, channel) in channels.iter().enumerate() {
                let end = f64::from(channel.range);
                let clipped = if end > 0.0 { value(k).clamp(-end, end) } else { value(k) };
                let count = (clipped - f64::from(channel.offset)) / f64::from(channel.scale);
                match number {
                    Number::I16 => out.extend(count16(count).to_le_bytes()),
                    Number::I32 => out.extend((count.round() as i32).to_le_bytes()),
                    Number::F32 => out.extend((count as f32).to_le_bytes()),
                }
            }
        }
        Form::Mpu6050([_, _, gyro_config, accel_config]) => {
            let acc = mpu6050::selected(&mpu6050::ACCELEROMETER, *accel_config).sensitivity / crate::STANDARD_GRAVITY;
            let gyr = mpu6050::selected(&mpu6050::GYRO, *gyro_config).sensitivity * 1_f64.to_degrees();
            let temp = (value(6) - mpu6050::TEMPERATURE_OFFSET) * mpu6050::TEMPERATURE_SENSITIVITY;
            let force = (0..3).map(|k| value(k) * acc);
            let rate = (3..6).map(|k| value(k) * gyr);
            for count in force.chain([temp]).chain(rate) {
                out.extend(count16(count).to_be_bytes());
            }
        }
        Form::Hmc5883l([_, b, _]) => {
            let scale = hmc5883l::scale(*b).unwrap_or(1.0);
            for axis in [0, 2, 1] {
                let count = (value(axis) / scale).round();
                // The converter has 12 bits.
                let beyond = !(-2048.0..=2047.0).contains(&count);
                let count = if beyond { hmc5883l::OVERFLOW } else { count as i16 };
                out.extend(count.to_be_bytes());
            }
        }
    }
}
