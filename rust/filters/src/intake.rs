//! What a filter gets of the rows of a log. The rules for time, gaps, values that are not finite, free fall, slow sensors
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
//! 6. **Lever arm.** Where the accelerometer sits at a known place of a rigid arm (`lever_x`, `lever_y`, `lever_z`), what
//!    filters and free fall see is the specific force at the joint: the rate and its change since the row before tell what the
//!    turn adds. A row without a rate takes the last ones.
//! 7. **Single bad rate.** A rate that its neighbours do not allow is bridged and counted ([`crate::bridge`]).
//! 8. **Start.** See [`Start`]. Rows before it have no attitude: NaN.

use std::f64::consts::PI;

use imufit_attitude::{Quaternion, Real};
use nalgebra::Vector3;

use crate::bridge::Turned;
use crate::columns::{Columns, Row};
use crate::filter::{Filter, Usage};
use crate::lever_arm::LeverArm;
use crate::memory::Memory;
use crate::rules::clipped;
use crate::triad::attitude_from_vectors;
use crate::{AngularRate, Environment, FluxDensity, Reading, Rules, Sample, Skipped, SpecificForce, Start};

/// Below this angle (rad) between field and vertical the start takes no heading from the field.
const START_MIN_ANGLE: f64 = 0.035;

/// Length of a specific force over gravity from which on it holds more acceleration than gravity, whose direction may be any.
const SHOCK: f64 = 2.0;

/// Reads a value if the machine can square it; counts it otherwise.
#[inline(always)]
fn usable(value: Option<Vector3<f64>>, missing: &mut usize, not_finite: &mut usize) -> Option<Vector3<f64>> {
    let value = value?;
    if value.norm_squared().is_finite() {
        return Some(value);
    }
    let only_nan = value.iter().all(|x| x.is_nan());
    *(if only_nan { missing } else { not_finite }) += 1;
    None
}

/// The rules, and what they remember from row to row.
#[derive(Debug, Clone)]
pub struct Intake {
    environment: Environment,
    rules: Rules,
    start: Start,
    /// Square of the least specific force that shows the vertical, (m/s^2)^2.
    least_square: f64,
    /// Square of the one that is a shock, (m/s^2)^2.
    shock_square: f64,
    lever: LeverArm,
    pub(crate) memory: Memory,
}

/// A filter that goes through the rows of a log. One that can be cloned has a loop of its own with its step inside.
pub trait Rows<T: Real = f64>: Filter<T> {
    /// All rows of `columns` one after the other, and the attitude after each of them, `w x y z`.
    fn rows(&mut self, intake: &mut Intake, columns: &Columns<'_>, attitude: &mut [T], skipped: &mut Skipped);
}

impl<T: Real, F: Filter<T> + Clone> Rows<T> for F {
    fn rows(&mut self, intake: &mut Intake, columns: &Columns<'_>, attitude: &mut [T], skipped: &mut Skipped) {
        all_rows(self, intake, columns, attitude, skipped);
    }
}

fn all_rows<T: Real, F: Filter<T> + Clone>(
    filter: &mut F,
    intake: &mut Intake,
    columns: &Columns<'_>,
    attitude: &mut [T],
    skipped: &mut Skipped,
) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the processor has what the function is compiled for.
        #[allow(unsafe_code)]
        unsafe {
            with_avx2(filter, intake, columns, attitude, skipped);
        }
        return;
    }
    one_by_one(filter, intake, columns, attitude, skipped);
}

/// The same operations with the same results, in fewer instructions.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn with_avx2<T: Real, F: Filter<T> + Clone>(
    filter: &mut F,
    intake: &mut Intake,
    columns: &Columns<'_>,
    attitude: &mut [T],
    skipped: &mut Skipped,
) {
    one_by_one(filter, intake, columns, attitude, skipped);
}

#[inline(always)]
fn one_by_one<T: Real, F: Filter<T> + Clone>(
    filter: &mut F,
    intake: &mut Intake,
    columns: &Columns<'_>,
    attitude: &mut [T],
    skipped: &mut Skipped,
) {
    let mut k = 0;
    while k < columns.t.len() {
        k += intake.full_rows(filter, columns, k, attitude, skipped);
        if let Some(out) = attitude.get_mut(4 * k..4 * k + 4) {
            intake.advance(filter, &columns.row(k), out, skipped);
        }
        k += 1;
    }
}

/// The readings of a column from row `from` on.
fn threes(column: &[f64], from: usize) -> &[[f64; 3]] {
    column.get(3 * from..).unwrap_or_default().as_chunks().0
}

impl Intake {
    pub(crate) fn new(environment: Environment, rules: Rules, start: Start) -> Self {
        Self {
            environment,
            rules,
            start,
            least_square: (rules.free_fall * environment.gravity()).powi(2),
            shock_square: (SHOCK * environment.gravity()).powi(2),
            lever: LeverArm {
                arm: rules.lever,
                time: rules.lever_time,
            },
            memory: Memory::EMPTY,
        }
    }

    /// One row for the filter, and the attitude after it, `w x y z`.
    #[inline(never)]
    pub(crate) fn advance<T: Real, F: Filter<T> + ?Sized>(
        &mut self,
        filter: &mut F,
        row: &Row,
        out: &mut [T],
        skipped: &mut Skipped,
    ) {
        self.take(filter, row, skipped);
        if self.memory.started {
            out.copy_from_slice(&filter.attitude().to_array());
        } else {
            skipped.not_started += 1;
            out.fill(T::splat(f64::NAN));
        }
    }

    /// Rows to which no rule applies, from row `from` on: all three sensors, after a row of the same kind, no lever arm. What
    /// [`Intake::advance`] would do with them, in fewer steps and with the filter in the registers. How many there were.
    #[inline(always)]
    fn full_rows<T: Real, F: Filter<T> + Clone>(
        &mut self,
        filter: &mut F,
        columns: &Columns<'_>,
        from: usize,
        attitude: &mut [T],
        skipped: &mut Skipped,
    ) -> usize {
        let Memory {
            started,
            mut last,
            t_acc,
            t_gyr,
            t_mag,
            mut omega,
            mut bridge,
            ..
        } = self.memory;
        let (Some(acc), Some(gyr), Some(mag)) = (columns.acc, columns.gyr, columns.mag) else {
            return 0;
        };
        // A sensor that has read at the last row; NaN, none yet, fails every comparison.
        if !(started && t_acc >= last && t_gyr >= last && t_mag >= last) || self.lever.is_some() || bridge.is_open() {
            return 0;
        }
        let (rules, least_square) = (self.rules, self.least_square);
        let mut running = filter.clone();
        let (mut rows, mut no_heading) = (0, 0);
        let readings = threes(acc, from).iter().zip(threes(gyr, from)).zip(threes(mag, from));
        let (outs, _) = attitude.get_mut(4 * from..).unwrap_or_default().as_chunks_mut::<4>();
        for ((t, ((acc, gyr), mag)), out) in columns.t.iter().skip(from).zip(readings).zip(outs) {
            let [acc, gyr, mag] = [acc, gyr, mag].map(|xyz| Vector3::from(*xyz));
            let (dt, square) = (t - last, acc.norm_squared());
            // NaN fails every comparison; a sum that overflows is looked at again by the rules.
            let usable = dt > 0.0
                && dt <= rules.max_gap
                && square > least_square
                && square + (gyr.norm_squared() + mag.norm_squared()) <= f64::MAX;
            let change = (gyr - omega).norm_squared();
            if !usable
                || clipped(&acc, rules.acc_range)
                || clipped(&gyr, rules.gyr_range)
                || (rules.recovery && bridge.doubts(change))
            {
                break;
            }
            let sample = Sample {
                omega: Some(Reading {
                    value: AngularRate((omega + gyr) * 0.5),
                    dt,
                }),
                f: Some(Reading {
                    value: SpecificForce(acc),
                    dt,
                }),
                m: Some(Reading {
                    value: FluxDensity(mag),
                    dt,
                }),
                unsure_turn: 0.0,
                unsure_tilt: self.unsure_tilt(square),
            };
            no_heading += usize::from(running.step(&sample) == Usage::NoHeading);
            *out = running.attitude().to_array();
            (last, omega) = (*t, gyr);
            rows += 1;
        }
        if rows > 0 {
            *filter = running;
            skipped.no_heading += no_heading;
            let memory = &mut self.memory;
            (memory.last, memory.t_acc, memory.t_gyr, memory.t_mag) = (last, last, last, last);
            (memory.omega, memory.bridge) = (omega, bridge);
        }
        rows
    }

    fn take<T: Real, F: Filter<T> + ?Sized>(&mut self, filter: &mut F, row: &Row, skipped: &mut Skipped) {
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
            if let Some(attitude) = self.start(row, &sample) {
                filter.reset(attitude);
                self.memory.started = true;
            }
            // The attitude at the start is the one at this row: no time has passed since.
            sample = sample.without_time();
        }
        if self.memory.started && filter.step(&sample) == Usage::NoHeading {
            skipped.no_heading += 1;
        }
    }

    /// What a specific force of that square, (m/s^2)^2, misses the vertical by, rad: what is beyond [`SHOCK`].
    #[inline(always)]
    fn unsure_tilt(&self, square: f64) -> f64 {
        if !self.rules.recovery || square <= self.shock_square {
            return 0.0;
        }
        (square.sqrt() / self.environment.gravity() - SHOCK).min(PI)
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
            if self.lever.is_some() && t - memory.t_gyr > 0.0 && t - memory.t_gyr <= max_gap {
                self.lever
                    .turn(&mut memory.alpha, &memory.omega, &omega, t - memory.t_gyr);
            }
            skipped.gyr_clipped += usize::from(clipped(&omega, self.rules.gyr_range));
            let dt = t - memory.t_gyr;
            let mut believed = true;
            if dt <= max_gap {
                let value = match memory.bridge.turn(&memory.omega, &omega, dt, self.rules.recovery) {
                    Turned::Mean(mean, unsure) => {
                        sample.unsure_turn = unsure;
                        mean
                    }
                    Turned::Bridged(mean) => {
                        skipped.gyr_bridged += 1;
                        mean
                    }
                    Turned::Held => {
                        believed = false;
                        memory.omega
                    }
                };
                let value = AngularRate(value);
                sample.omega = Some(Reading { value, dt });
            } else {
                memory.bridge.span = 0.0;
                skipped.gap += usize::from(!memory.t_gyr.is_nan());
            }
            memory.t_gyr = t;
            if believed {
                memory.omega = omega;
            }
        }
        if let Some(reading) = acc {
            let f = if self.lever.is_some() {
                self.lever.at_joint(&reading, &memory.omega, &memory.alpha)
            } else {
                reading
            };
            if clipped(&reading, self.rules.acc_range) {
                skipped.acc_clipped += 1;
            } else if !f.norm_squared().is_finite() {
                skipped.acc_not_finite += 1;
            } else if f.norm_squared() > self.least_square {
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
        if let Some(f) = &sample.f {
            sample.unsure_tilt = self.unsure_tilt(f.value.0.norm_squared());
        }
        sample
    }

    /// The attitude at this row if it can be the first one.
    #[cold]
    fn start(&mut self, row: &Row, sample: &Sample) -> Option<Quaternion> {
        let t = row.t;
        if self.memory.first.is_nan() {
            self.memory.first = t;
        }
        let waited = t - self.memory.first >= self.rules.max_gap;
        match self.start {
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
        }
    }

    /// Inclination from the specific force, heading (yaw) 0.
    fn level(&self, f: &SpecificForce) -> Quaternion {
        crate::accel::attitude_from_specific_force(f, &self.environment, 0.0)
    }
}
