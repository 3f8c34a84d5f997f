//! Any filter over the rows of a log. The rules for time, gaps, values that are not finite, free fall, slow sensors
//! and the start stand here and nowhere else:
//!
//! 1. **Time.** A row whose time is not finite or not later than the last good row is passed over; the attitude is held.
//! 2. **Gap.** A step longer than `max_gap` is not integrated: the attitude is held, and the filter goes on from there.
//! 3. **Missing readings.** A reading with NaN or infinity (or one whose square is not a number of the machine) is not
//!    used. The next rate is integrated over the whole time since the last one (trapezoidal rule) as long as that is no
//!    gap, which also is the rule for a gyro slower than the log; a direction stands for the time since the last one.
//! 4. **Free fall.** A specific force shorter than `free_fall` times gravity shows no vertical and is not used.
//! 5. **Clipped readings.** A specific force with a component at the end of the accelerometer's range (`acc_range`) points
//!    somewhere else than the true one and is not used. A rate at the end of the gyro's range (`gyr_range`) is too small
//!    but closer than any guess: it is used and counted.
//! 6. **Start.** See [`Start`]. Rows before it have no attitude: NaN.
//!
//! The output is causal and depends only on the rows and the state: cut anywhere, hand the state over, and the result
//! is the same bit by bit.

use imufit_attitude::Quaternion;
use nalgebra::{Matrix3, Vector3};

use crate::columns::{Columns, Row};
use crate::filter::{Description, Filter, Usage};
use crate::memory::Memory;
use crate::rules::clipped;
use crate::triad::attitude_from_vectors;
use crate::{
    AngularRate, Environment, FilterError, FluxDensity, Reading, Rules, Sample, Sensor, Skipped, SpecificForce, Start,
};

/// Below this angle (rad) between field and vertical the start takes no heading from the field.
const START_MIN_ANGLE: f64 = 0.035;

/// Reads a value if the machine can square it; counts it otherwise.
fn usable(value: Option<Vector3<f64>>, missing: &mut usize, not_finite: &mut usize) -> Option<Vector3<f64>> {
    let value = value?;
    if value.norm_squared().is_finite() {
        return Some(value);
    }
    let only_nan = value.iter().all(|x| x.is_nan());
    *(if only_nan { missing } else { not_finite }) += 1;
    None
}

/// A filter with the rules around it: the same object serves a whole log, pieces of one, and a running device.
pub struct Replay {
    name: &'static str,
    needs: &'static [Sensor],
    filter: Box<dyn Filter>,
    environment: Environment,
    rules: Rules,
    start: Start,
    memory: Memory,
}

impl Replay {
    /// The filter of that description with settings by name.
    pub fn new(
        description: &'static Description,
        settings: &[(String, f64)],
        environment: Environment,
        rules: Rules,
        start: Start,
    ) -> Result<Self, FilterError> {
        let filter = description.build(&environment, settings)?;
        let Description { name, needs, .. } = *description;
        Ok(Self {
            name,
            needs,
            filter,
            environment,
            rules,
            start,
            memory: Memory::EMPTY,
        })
    }

    /// The filter's name.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Back to before the first row.
    pub fn reset(&mut self) {
        self.filter.reset(Quaternion::IDENTITY);
        self.memory = Memory::EMPTY;
    }

    /// Goes on at the next row, whatever its time, with a filter in that state.
    pub(crate) fn resume(&mut self, filter: &[f64]) -> bool {
        let taken = self.filter.set_state(filter);
        if taken {
            self.memory = Memory {
                started: true,
                ..Memory::EMPTY
            };
        }
        taken
    }

    /// The state of the filter alone.
    pub(crate) fn filter_state(&self) -> Vec<f64> {
        self.filter.state()
    }

    /// The filter's attitude after the last row.
    pub(crate) fn attitude(&self) -> Quaternion {
        self.filter.attitude()
    }

    /// Covariance of its error, where the filter keeps one.
    pub(crate) fn attitude_covariance(&self) -> Option<Matrix3<f64>> {
        self.filter.attitude_covariance()
    }

    /// All that the next row's attitude depends on, to be handed to another replay with the same settings.
    pub fn state(&self) -> Vec<f64> {
        let mut state = self.memory.to_array().to_vec();
        state.extend(self.filter.state());
        state
    }

    /// Takes over what [`Replay::state`] gave.
    pub fn set_state(&mut self, state: &[f64]) -> Result<(), FilterError> {
        let expected = Memory::LENGTH + self.filter.state().len();
        let error = FilterError::State {
            filter: self.name,
            came: state.len(),
            expected,
        };
        let Some((own, of_filter)) = state.split_at_checked(Memory::LENGTH) else {
            return Err(error);
        };
        let Some(memory) = Memory::from_slice(own) else {
            return Err(error);
        };
        if !self.filter.set_state(of_filter) {
            return Err(error);
        }
        self.memory = memory;
        Ok(())
    }

    /// Fills `attitude`, four values `w x y z` for each row of `columns`; NaN before the start.
    pub fn run(&mut self, columns: &Columns<'_>, attitude: &mut [f64]) -> Result<Skipped, FilterError> {
        columns.check()?;
        let present = |wanted: Sensor| {
            columns
                .sensors()
                .iter()
                .any(|(s, column)| *s == wanted && column.is_some())
        };
        self.check_sensors(present)?;
        let (came, expected) = (attitude.len() / 4, columns.t.len());
        if attitude.len() != 4 * expected {
            return Err(FilterError::Length {
                name: "attitude",
                came,
                expected,
            });
        }
        let mut skipped = Skipped::default();
        for (k, out) in attitude.chunks_exact_mut(4).enumerate() {
            self.advance(&columns.row(k), out, &mut skipped);
        }
        Ok(skipped)
    }

    /// The attitude `w x y z` after one more row, NaN before the start: what [`Replay::run`] does row by row.
    pub fn step(&mut self, row: &Row) -> Result<([f64; 4], Skipped), FilterError> {
        self.check_sensors(|sensor| row.has(sensor))?;
        let (mut attitude, mut skipped) = ([f64::NAN; 4], Skipped::default());
        self.advance(row, &mut attitude, &mut skipped);
        Ok((attitude, skipped))
    }

    fn check_sensors(&self, present: impl Fn(Sensor) -> bool) -> Result<(), FilterError> {
        match self.needs.iter().find(|sensor| !present(**sensor)) {
            None => Ok(()),
            Some(sensor) => Err(FilterError::MissingSensor {
                filter: self.name,
                sensor: sensor.name(),
            }),
        }
    }

    /// One row, and the attitude after it.
    fn advance(&mut self, row: &Row, out: &mut [f64], skipped: &mut Skipped) {
        self.take(row, skipped);
        if self.memory.started {
            out.copy_from_slice(&self.filter.attitude().to_array());
        } else {
            skipped.not_started += 1;
            out.fill(f64::NAN);
        }
    }

    fn take(&mut self, row: &Row, skipped: &mut Skipped) {
        let t = row.t;
        if !t.is_finite() {
            skipped.time_not_finite += 1;
            return;
        }
        if t <= self.memory.last {
            skipped.time_not_increasing += 1;
            return;
        }
        if t - self.memory.last > self.rules.max_gap {
            skipped.gap += 1;
            self.memory.forget_readings();
        }
        self.memory.last = t;
        let mut sample = self.sample(row, skipped);
        if !self.memory.started {
            self.try_to_start(row, &sample);
            // The attitude at the start is the one at this row: no time has passed since.
            sample = sample.without_time();
        }
        if self.memory.started && self.filter.step(&sample) == Usage::NoHeading {
            skipped.no_heading += 1;
        }
    }

    /// What is usable of a row, with the time that it stands for.
    fn sample(&mut self, row: &Row, skipped: &mut Skipped) -> Sample {
        let Skipped {
            acc_missing,
            acc_not_finite,
            gyr_missing,
            gyr_not_finite,
            mag_missing,
            mag_not_finite,
            ..
        } = skipped;
        let acc = usable(row.acc, acc_missing, acc_not_finite);
        let gyr = usable(row.gyr, gyr_missing, gyr_not_finite);
        let mag = usable(row.mag, mag_missing, mag_not_finite);

        let (t, max_gap) = (row.t, self.rules.max_gap);
        // NaN, the first reading, fails every comparison and gives 0.
        let since = |last: f64| if t - last > 0.0 { (t - last).min(max_gap) } else { 0.0 };
        let memory = &mut self.memory;
        let mut sample = Sample::default();
        if let Some(omega) = gyr {
            skipped.gyr_clipped += usize::from(clipped(&omega, self.rules.gyr_range));
            if t - memory.t_gyr <= max_gap {
                let value = AngularRate((memory.omega + omega) * 0.5);
                sample.omega = Some(Reading {
                    value,
                    dt: t - memory.t_gyr,
                });
            } else if !memory.t_gyr.is_nan() {
                skipped.gap += 1;
            }
            (memory.t_gyr, memory.omega) = (t, omega);
        }
        if let Some(f) = acc {
            if clipped(&f, self.rules.acc_range) {
                skipped.acc_clipped += 1;
            } else if f.norm() > self.rules.free_fall * self.environment.gravity() {
                sample.f = Some(Reading {
                    value: SpecificForce(f),
                    dt: since(memory.t_acc),
                });
            } else {
                skipped.free_fall += 1;
            }
            memory.t_acc = t;
        }
        if let Some(m) = mag {
            sample.m = Some(Reading {
                value: FluxDensity(m),
                dt: since(memory.t_mag),
            });
            memory.t_mag = t;
        }
        sample
    }

    fn try_to_start(&mut self, row: &Row, sample: &Sample) {
        let t = row.t;
        if self.memory.first.is_nan() {
            self.memory.first = t;
        }
        let waited = t - self.memory.first >= self.rules.max_gap;
        let attitude = match self.start {
            Start::Given { time, attitude } => (t >= time).then_some(attitude),
            Start::Vectors => match (sample.f, sample.m) {
                (Some(f), Some(m)) => {
                    let found = attitude_from_vectors(&f.value, &m.value, &self.environment, START_MIN_ANGLE);
                    Some(found.unwrap_or_else(|| self.level(&f.value)))
                }
                (Some(f), None) if waited || row.mag.is_none() => Some(self.level(&f.value)),
                (None, _) if waited || row.acc.is_none() => Some(Quaternion::IDENTITY),
                _ => None,
            },
        };
        if let Some(attitude) = attitude {
            self.filter.reset(attitude);
            self.memory.started = true;
        }
    }

    /// Inclination from the specific force, heading (yaw) 0.
    fn level(&self, f: &SpecificForce) -> Quaternion {
        crate::accel::attitude_from_specific_force(f, &self.environment, 0.0)
    }
}
