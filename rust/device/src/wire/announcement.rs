//! What a device says of its samples: who it is, how its clock ticks, and what each stream of numbers means.

use crate::hmc5883l;
use crate::mpu6050::{self, Frame as Burst, Scales};

/// Version of the protocol.
pub const VERSION: u8 = 1;
/// Streams that a device may have: a bit each in a sample.
pub const STREAMS: usize = 8;

/// Kind of number in which a stream's channels come, low byte first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Number {
    /// 16 bits, signed.
    I16,
    /// 32 bits, signed.
    I32,
    /// 32 bits, IEEE 754.
    F32,
}

impl Number {
    const ALL: [Self; 3] = [Self::I16, Self::I32, Self::F32];

    /// Its bytes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::I16 => 2,
            Self::I32 | Self::F32 => 4,
        }
    }
}

/// One channel of a stream of counts.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Column of a log, such as `acc_x` (m/s^2) or `motor_current`.
    pub name: String,
    /// What one count is, SI units.
    pub scale: f32,
    /// Value of count 0.
    pub offset: f32,
    /// Value at which readings clip; 0 if that is not known.
    pub range: f32,
}

/// What the numbers of a stream are.
#[derive(Debug, Clone, PartialEq)]
pub enum Form {
    /// Numbers of channels with scales of their own.
    Counts(Number, Vec<Channel>),
    /// Registers 0x3B to 0x48 of an MPU6050 as they are read, with the setting of `SMPLRT_DIV`, `CONFIG`, `GYRO_CONFIG` and `ACCEL_CONFIG`.
    Mpu6050([u8; 4]),
    /// Registers 0x03 to 0x08 of an HMC5883L as they are read, with the setting of configuration registers A and B and the mode register.
    Hmc5883l([u8; 3]),
}

impl Form {
    /// Bytes of a sample.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Counts(number, channels) => number.bytes() * channels.len(),
            Self::Mpu6050(_) => Burst::WithTemperature.bytes(),
            Self::Hmc5883l(_) => hmc5883l::BYTES,
        }
    }

    /// Number of columns that it fills.
    pub fn width(&self) -> usize {
        match self {
            Self::Counts(_, channels) => channels.len(),
            Self::Mpu6050(_) => 7,
            Self::Hmc5883l(_) => 3,
        }
    }

    /// Columns of a log that it fills.
    pub fn columns(&self) -> Vec<&str> {
        match self {
            Self::Counts(_, channels) => channels.iter().map(|c| c.name.as_str()).collect(),
            Self::Mpu6050(_) => vec!["acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z", "temp"],
            Self::Hmc5883l(_) => vec!["mag_x", "mag_y", "mag_z"],
        }
    }

    /// Value at which each column's readings clip; 0 if that is not known.
    pub fn ranges(&self) -> Vec<f64> {
        match self {
            Self::Counts(_, channels) => channels.iter().map(|c| f64::from(c.range)).collect(),
            Self::Mpu6050([_, _, gyro_config, accel_config]) => {
                let acc = mpu6050::selected(&mpu6050::ACCELEROMETER, *accel_config).range * crate::STANDARD_GRAVITY;
                let gyr = mpu6050::selected(&mpu6050::GYRO, *gyro_config).range.to_radians();
                vec![acc, acc, acc, gyr, gyr, gyr, 0.0]
            }
            Self::Hmc5883l(registers) => {
                let gain = hmc5883l::GAINS.get(usize::from(registers[1] >> 5));
                vec![gain.map_or(0.0, |g| g.range); 3]
            }
        }
    }

    /// Adds the values of a sample, SI units.
    fn decode(&self, bytes: &[u8], values: &mut Vec<f64>) {
        match self {
            Self::Counts(number, channels) => {
                for (channel, bytes) in channels.iter().zip(bytes.chunks_exact(number.bytes())) {
                    let count = match (number, bytes) {
                        (Number::I16, &[a, b]) => f64::from(i16::from_le_bytes([a, b])),
                        (Number::I32, &[a, b, c, d]) => f64::from(i32::from_le_bytes([a, b, c, d])),
                        (Number::F32, &[a, b, c, d]) => f64::from(f32::from_le_bytes([a, b, c, d])),
                        _ => f64::NAN,
                    };
                    values.push(count * f64::from(channel.scale) + f64::from(channel.offset));
                }
            }
            Self::Mpu6050([_, _, gyro_config, accel_config]) => {
                let scales = Scales::of_registers(*accel_config, *gyro_config);
                let readings = bytes.try_into().map(|block| mpu6050::decode_block(block, &scales));
                values.extend(readings.unwrap_or([f64::NAN; 7]));
            }
            Self::Hmc5883l(registers) => {
                let field = match (<&[u8; hmc5883l::BYTES]>::try_from(bytes), hmc5883l::scale(registers[1])) {
                    (Ok(bytes), Ok(scale)) => hmc5883l::decode(bytes, scale),
                    _ => [f64::NAN; 3],
                };
                values.extend(field);
            }
        }
    }
}

/// One stream: numbers that come at one rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Stream {
    /// Samples a second, as the device means it to be; 0 if it has none.
    pub rate: f32,
    /// What its numbers are.
    pub form: Form,
}

/// What a device says of its samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Announcement {
    /// Who it is, for people.
    pub name: String,
    /// How long a tick of its clock is, ns.
    pub tick: u32,
    /// Its streams; a sample says by a bit each which it holds.
    pub streams: Vec<Stream>,
}

/// Takes an announcement apart.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn bytes(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.bytes(N)?.try_into().ok()
    }

    fn byte(&mut self) -> Option<u8> {
        self.array().map(|[b]| b)
    }

    fn float(&mut self) -> Option<f32> {
        self.array().map(f32::from_le_bytes).filter(|v| v.is_finite())
    }

    fn text(&mut self) -> Option<String> {
        let n = self.byte()?;
        let text = std::str::from_utf8(self.bytes(usize::from(n))?).ok()?;
        Some(text.to_string())
    }
}

fn text(text: &str, out: &mut Vec<u8>) {
    let mut end = text.len().min(255);
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    out.push(end as u8);
    out.extend_from_slice(&text.as_bytes()[..end]);
}

impl Announcement {
    /// Reads the payload of a frame; `None` if it makes no sense.
    pub fn decode(payload: &[u8]) -> Option<Self> {
        let mut reader = Reader(payload);
        if reader.byte()? != VERSION {
            return None;
        }
        let tick = u32::from_le_bytes(reader.array()?);
        let name = reader.text()?;
        let count = usize::from(reader.byte()?);
        let streams: Option<Vec<Stream>> = (0..count).map(|_| Self::stream(&mut reader)).collect();
        let found = Self {
            name,
            tick,
            streams: streams?,
        };
        let columns = found.columns();
        let mut names: Vec<&&str> = columns.iter().collect();
        names.sort_unstable();
        names.dedup();
        let unique = names.len() == columns.len() && !columns.contains(&"");
        (reader.0.is_empty() && tick > 0 && (1..=STREAMS).contains(&count) && unique).then_some(found)
    }

    fn stream(reader: &mut Reader) -> Option<Stream> {
        let form = reader.byte()?;
        let rate = reader.float()?;
        let form = match form {
            0 => {
                let number = *Number::ALL.get(usize::from(reader.byte()?))?;
                let channels = reader.byte()?;
                let channel = |_| {
                    Some(Channel {
                        name: reader.text()?,
                        scale: reader.float()?,
                        offset: reader.float()?,
                        range: reader.float()?,
                    })
                };
                let channels: Option<Vec<Channel>> = (0..channels).map(channel).collect();
                Form::Counts(number, channels.filter(|c| !c.is_empty())?)
            }
            1 => Form::Mpu6050(reader.array()?),
            2 => Form::Hmc5883l(reader.array()?),
            _ => return None,
        };
        Some(Stream { rate, form })
    }

    /// The payload of a frame.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = vec![VERSION];
        out.extend(self.tick.to_le_bytes());
        text(&self.name, &mut out);
        out.push(self.streams.len() as u8);
        for stream in &self.streams {
            let form = match &stream.form {
                Form::Counts(..) => 0,
                Form::Mpu6050(_) => 1,
                Form::Hmc5883l(_) => 2,
            };
            out.push(form);
            out.extend(stream.rate.to_le_bytes());
            match &stream.form {
                Form::Counts(number, channels) => {
                    out.push(*number as u8);
                    out.push(channels.len() as u8);
                    for channel in channels {
                        text(&channel.name, &mut out);
                        for value in [channel.scale, channel.offset, channel.range] {
                            out.extend(value.to_le_bytes());
                        }
                    }
                }
                Form::Mpu6050(registers) => out.extend(registers),
                Form::Hmc5883l(registers) => out.extend(registers),
            }
        }
        out
    }

    /// Columns of a log that the streams fill, in their order.
    pub fn columns(&self) -> Vec<&str> {
        self.streams.iter().flat_map(|s| s.form.columns()).collect()
    }

    /// Value at which each column's readings clip; 0 if that is not known.
    pub fn ranges(&self) -> Vec<f64> {
        self.streams.iter().flat_map(|s| s.form.ranges()).collect()
    }

    /// Adds a sample's values, SI units, NaN where it does not hold a stream; its stamp. `None`, and nothing added, if it is no sample of these.
    pub fn sample(&self, payload: &[u8], values: &mut Vec<f64>) -> Option<u32> {
        let (head, mut rest) = payload.split_at_checked(5)?;
        let &[a, b, c, d, held] = head else { return None };
        let is_held = |k: usize| k < STREAMS && held >> k & 1 == 1;
        let held_streams = self.streams.iter().enumerate().filter(|(k, _)| is_held(*k));
        let bytes: usize = held_streams.map(|(_, s)| s.form.bytes()).sum();
        if bytes != rest.len() || usize::from(held) >> self.streams.len() != 0 {
            return None;
        }
        for (k, stream) in self.streams.iter().enumerate() {
            if is_held(k) {
                let (own, after) = rest.split_at_checked(stream.form.bytes())?;
                stream.form.decode(own, values);
                rest = after;
            } else {
                values.extend(std::iter::repeat_n(f64::NAN, stream.form.width()));
            }
        }
        Some(u32::from_le_bytes([a, b, c, d]))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn form() -> impl Strategy<Value = Form> {
        let channel =
            ("[a-z_]{1,12}", -1e3f32..1e3, -1e3f32..1e3, 0f32..1e3).prop_map(|(name, scale, offset, range)| Channel {
                name,
                scale,
                offset,
                range,
            });
        let number = prop::sample::select(Number::ALL.to_vec());
        prop_oneof![
            (number, prop::collection::vec(channel, 1..9))
                .prop_map(|(number, channels)| Form::Counts(number, channels)),
            any::<[u8; 4]>().prop_map(Form::Mpu6050),
            any::<[u8; 3]>().prop_map(Form::Hmc5883l),
        ]
    }

    proptest! {
        #[test]
        fn an_announcement_comes_back_unless_two_columns_share_a_name(
            name in "\\PC{0,40}", tick in 1u32.., rates in prop::collection::vec((0f32..2000.0, form()), 1..9),
        ) {
            let streams = rates.into_iter().map(|(rate, form)| Stream { rate, form }).collect();
            let sent = Announcement { name, tick, streams };
            let mut names = sent.columns();
            names.sort_unstable();
            let unique = names.windows(2).all(|w| w[0] != w[1]);
            prop_assert_eq!(Announcement::decode(&sent.encode()), unique.then_some(sent));
        }

        #[test]
        fn what_is_cut_off_is_none(form in form(), at: prop::sample::Index) {
            let sent = Announcement { name: "x".into(), tick: 1, streams: vec![Stream { rate: 1.0, form }] };
            let bytes = sent.encode();
            prop_assert_eq!(Announcement::decode(&bytes[..at.index(bytes.len())]), None);
        }
    }

    #[test]
    fn registers_of_both_chips_are_read_as_their_makers_say() {
        let announcement = Announcement {
            name: "GY-86".into(),
            tick: 1000,
            streams: vec![
                Stream {
                    rate: 1000.0,
                    form: Form::Mpu6050([0, 1, 0x08, 0x10]),
                },
                Stream {
                    rate: 75.0,
                    form: Form::Hmc5883l([0x18, 0x20, 0]),
                },
            ],
        };
        let mut payload = vec![0, 0, 0, 0, 1];
        // 8 g and 500 deg/s: 4096 counts for 1 g, 65.5 for 1 deg/s.
        payload.extend([0, 0, 0, 0, 0x10, 0, 0, 0, 0, 131, 0, 0, 0, 0]);
        let mut values = Vec::new();
        assert_eq!(announcement.sample(&payload, &mut values), Some(0));
        assert!((values[2] - 9.80665).abs() < 1e-12 && (values[3] - 2f64.to_radians()).abs() < 1e-12);
        assert!(values[7..].iter().all(|v| v.is_nan()) && values.len() == 10);
        assert!((announcement.ranges()[0] - 8.0 * 9.80665).abs() < 1e-12 && announcement.ranges()[7] == 130.0);
    }
}
