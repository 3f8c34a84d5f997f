//! Any filter over the rows of a log. The rules for time, gaps, values that are not finite, free fall, slow sensors
//! and the start stand here and nowhere else:
//!
//! 1. **Time.** A row whose time is not finite or not later than the last good row is passed over; the attitude is held.
//! 2. **Gap.** A step longer than `max_gap` is not integrated: the attitude is held, and the filter goes on from there.
//! 3. **Missing readings.** A reading with NaN or infinity (or one whose square is not a number of the machine) is not
//!    used. The next rate is integrated over the whole time since the last one (trapezoidal rule) as long as that is no
//!    gap, which also is the rule for a gyro slower than the log; a direction stands for the time since the last one.
//! 4. **Free fall.** A specific force shorter than `free_fall` times gravity shows no vertical and is not used.
//! 5. **Start.** See [`Start`]. Rows before it have no attitude: NaN.
//!
//! The output is causal and depends only on the rows and the state: cut anywhere, hand the state over, and the result
//! is the same bit by bit.

use std::ops::AddAssign;

use imufit_attitude::Quaternion;
use nalgebra::Vector3;

use crate::filter::{Description, Filter, Parameter, Usage, fill};
use crate::triad::attitude_from_vectors;
use crate::{AngularRate, Environment, FilterError, FluxDensity, Reading, Sample, Sensor, SpecificForce};

/// The settings of the rules above.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "max_gap",
        default: 1.0,
        unit: "s",
        meaning: "a longer step is a gap: larger integrates across more of what was not measured",
    },
    Parameter {
        name: "free_fall",
        default: 0.2,
        unit: "1",
        meaning: "a specific force shorter than this part of gravity is not used: larger refuses more of a throw",
    },
];

/// Below this angle (rad) between field and vertical the start takes no heading from the field.
const START_MIN_ANGLE: f64 = 0.035;
/// Values that a replay adds to the state of its filter.
const OWN_STATE: usize = 10;

/// [`PARAMETERS`] with values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rules {
    /// Longest step that is integrated, s.
    pub max_gap: f64,
    /// Least specific force that shows the vertical, in parts of gravity.
    pub free_fall: f64,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            max_gap: PARAMETERS[0].default,
            free_fall: PARAMETERS[1].default,
        }
    }
}

impl Rules {
    /// From settings by name.
    pub fn from_settings(settings: &[(String, f64)]) -> Result<Self, FilterError> {
        let values = fill("replay", PARAMETERS, settings)?;
        let value = |at: usize| values.get(at).copied().unwrap_or(PARAMETERS[at].default);
        Ok(Self {
            max_gap: value(0),
            free_fall: value(1),
        })
    }
}

/// How the first attitude is found.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Start {
    /// From the first row with a usable specific force and field (TRIAD). Without a field, whether the log has none,
    /// none comes within `max_gap`, or it is parallel to gravity: inclination from the specific force, heading 0.
    /// Without a usable specific force within `max_gap`: the identity.
    #[default]
    Vectors,
    /// Given, at the first row not before `time` (s).
    Given {
        /// The row it belongs to, or earlier.
        time: f64,
        /// The attitude there.
        attitude: Quaternion,
    },
}

/// Columns of a log, row by row: n times, 3 n readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Columns<'a> {
    /// Time, s.
    pub t: &'a [f64],
    /// Specific force, m/s^2.
    pub acc: Option<&'a [f64]>,
    /// Angular rate, rad/s.
    pub gyr: Option<&'a [f64]>,
    /// Magnetic flux density, uT.
    pub mag: Option<&'a [f64]>,
}

impl<'a> Columns<'a> {
    fn sensors(&self) -> [(Sensor, Option<&'a [f64]>); 3] {
        [
            (Sensor::Acc, self.acc),
            (Sensor::Gyr, self.gyr),
            (Sensor::Mag, self.mag),
        ]
    }

    /// The same columns in pieces of at most `rows` rows.
    pub fn windows(self, rows: usize) -> impl Iterator<Item = Self> {
        let piece =
            move |column: Option<&'a [f64]>, from: usize, to: usize| column.and_then(|c| c.get(3 * from..3 * to));
        (0..self.t.len()).step_by(rows.max(1)).map(move |from| {
            let to = (from + rows.max(1)).min(self.t.len());
            let [acc, gyr, mag] = [self.acc, self.gyr, self.mag].map(|column| piece(column, from, to));
            Self {
                t: &self.t[from..to],
                acc,
                gyr,
                mag,
            }
        })
    }

    fn check(&self) -> Result<(), FilterError> {
        for (sensor, column) in self.sensors() {
            if let Some(column) = column.filter(|column| column.len() != 3 * self.t.len()) {
                let (name, came, expected) = (sensor.name(), column.len() / 3, self.t.len());
                return Err(FilterError::Length { name, came, expected });
            }
        }
        Ok(())
    }

    fn reading(column: Option<&[f64]>, row: usize) -> Option<Vector3<f64>> {
        let xyz = column?.get(3 * row..3 * row + 3)?;
        Some(Vector3::new(xyz[0], xyz[1], xyz[2]))
    }
}

/// Rows of which something was not used, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Skipped {
    /// Time NaN or infinite: the row was passed over.
    pub time_not_finite: usize,
    /// Time not later than the row before: the row was passed over.
    pub time_not_increasing: usize,
    /// A step too long to be integrated.
    pub gap: usize,
    /// No specific force (NaN).
    pub acc_missing: usize,
    /// A specific force with an infinite or absurd value.
    pub acc_not_finite: usize,
    /// No angular rate (NaN).
    pub gyr_missing: usize,
    /// An angular rate with an infinite or absurd value.
    pub gyr_not_finite: usize,
    /// No field (NaN).
    pub mag_missing: usize,
    /// A field with an infinite or absurd value.
    pub mag_not_finite: usize,
    /// Specific force too short to show the vertical.
    pub free_fall: usize,
    /// Field too close to the vertical to show a heading.
    pub no_heading: usize,
    /// Rows before the start.
    pub not_started: usize,
}

impl Skipped {
    /// Reason and rows, in a fixed order.
    pub fn by_reason(&self) -> [(&'static str, usize); 12] {
        [
            ("time_not_finite", self.time_not_finite),
            ("time_not_increasing", self.time_not_increasing),
            ("gap", self.gap),
            ("acc_missing", self.acc_missing),
            ("acc_not_finite", self.acc_not_finite),
            ("gyr_missing", self.gyr_missing),
            ("gyr_not_finite", self.gyr_not_finite),
            ("mag_missing", self.mag_missing),
            ("mag_not_finite", self.mag_not_finite),
            ("free_fall", self.free_fall),
            ("no_heading", self.no_heading),
            ("not_started", self.not_started),
        ]
    }
}

impl AddAssign for Skipped {
    fn add_assign(&mut self, other: Self) {
        self.time_not_finite += other.time_not_finite;
        self.time_not_increasing += other.time_not_increasing;
        self.gap += other.gap;
        self.acc_missing += other.acc_missing;
        self.acc_not_finite += other.acc_not_finite;
        self.gyr_missing += other.gyr_missing;
        self.gyr_not_finite += other.gyr_not_finite;
        self.mag_missing += other.mag_missing;
        self.mag_not_finite += other.mag_not_finite;
        self.free_fall += other.free_fall;
        self.no_heading += other.no_heading;
        self.not_started += other.not_started;
    }
}

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

/// What is remembered from row to row; times are NaN where there is none.
#[derive(Debug, Clone, Copy)]
struct Memory {
    started: bool,
    /// First good row, for the limits of [`Start::Vectors`].
    first: f64,
    /// Last good row.
    last: f64,
    t_acc: f64,
    t_gyr: f64,
    t_mag: f64,
    omega: Vector3<f64>,
}

impl Memory {
    const EMPTY: Self = Self {
        started: false,
        first: f64::NAN,
        last: f64::NAN,
        t_acc: f64::NAN,
        t_gyr: f64::NAN,
        t_mag: f64::NAN,
        omega: Vector3::new(0.0, 0.0, 0.0),
    };
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

    /// All that the next row's attitude depends on, to be handed to another replay with the same settings.
    pub fn state(&self) -> Vec<f64> {
        let Memory {
            started,
            first,
            last,
            t_acc,
            t_gyr,
            t_mag,
            omega,
        } = self.memory;
        let started = if started { 1.0 } else { 0.0 };
        let mut state = vec![
            started, first, last, t_acc, t_gyr, t_mag, omega.x, omega.y, omega.z, 0.0,
        ];
        state.extend(self.filter.state());
        state
    }

    /// Takes over what [`Replay::state`] gave.
    pub fn set_state(&mut self, state: &[f64]) -> Result<(), FilterError> {
        let expected = OWN_STATE + self.filter.state().len();
        let error = FilterError::State {
            filter: self.name,
            came: state.len(),
            expected,
        };
        let Some((own, of_filter)) = state.split_at_checked(OWN_STATE) else {
            return Err(error);
        };
        let &[started, first, last, t_acc, t_gyr, t_mag, x, y, z, _] = own else {
            return Err(error);
        };
        if !(x + y + z).is_finite() || !self.filter.set_state(of_filter) {
            return Err(error);
        }
        let omega = Vector3::new(x, y, z);
        self.memory = Memory {
            started: started > 0.5,
            first,
            last,
            t_acc,
            t_gyr,
            t_mag,
            omega,
        };
        Ok(())
    }

    /// Fills `attitude`, four values `w x y z` for each row of `columns`; NaN before the start.
    pub fn run(&mut self, columns: &Columns<'_>, attitude: &mut [f64]) -> Result<Skipped, FilterError> {
        columns.check()?;
        let present = |sensor: &Sensor| {
            columns
                .sensors()
                .iter()
                .any(|(s, column)| s == sensor && column.is_some())
        };
        if let Some(sensor) = self.needs.iter().find(|sensor| !present(sensor)) {
            return Err(FilterError::MissingSensor {
                filter: self.name,
                sensor: sensor.name(),
            });
        }
        let (came, expected) = (attitude.len() / 4, columns.t.len());
        if attitude.len() != 4 * expected {
            return Err(FilterError::Length {
                name: "attitude",
                came,
                expected,
            });
        }
        let mut skipped = Skipped::default();
        for (row, out) in attitude.chunks_exact_mut(4).enumerate() {
            self.advance(columns, row, &mut skipped);
            if self.memory.started {
                out.copy_from_slice(&self.filter.attitude().to_array());
            } else {
                skipped.not_started += 1;
                out.fill(f64::NAN);
            }
        }
        Ok(skipped)
    }

    /// One row.
    fn advance(&mut self, columns: &Columns<'_>, row: usize, skipped: &mut Skipped) {
        let t = columns.t[row];
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
            let Memory { started, first, .. } = self.memory;
            self.memory = Memory {
                started,
                first,
                ..Memory::EMPTY
            };
        }
        self.memory.last = t;
        let mut sample = self.sample(columns, row, t, skipped);
        if !self.memory.started {
            self.try_to_start(columns, t, &sample);
            // The attitude at the start is the one at this row: no time has passed since.
            sample = sample.without_time();
        }
        if self.memory.started && self.filter.step(&sample) == Usage::NoHeading {
            skipped.no_heading += 1;
        }
    }

    /// What is usable of a row, with the time that it stands for.
    fn sample(&mut self, columns: &Columns<'_>, row: usize, t: f64, skipped: &mut Skipped) -> Sample {
        let Skipped {
            acc_missing,
            acc_not_finite,
            gyr_missing,
            gyr_not_finite,
            mag_missing,
            mag_not_finite,
            ..
        } = skipped;
        let acc = usable(Columns::reading(columns.acc, row), acc_missing, acc_not_finite);
        let gyr = usable(Columns::reading(columns.gyr, row), gyr_missing, gyr_not_finite);
        let mag = usable(Columns::reading(columns.mag, row), mag_missing, mag_not_finite);

        let max_gap = self.rules.max_gap;
        // NaN, the first reading, fails every comparison and gives 0.
        let since = |last: f64| if t - last > 0.0 { (t - last).min(max_gap) } else { 0.0 };
        let memory = &mut self.memory;
        let mut sample = Sample::default();
        if let Some(omega) = gyr {
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
            if f.norm() > self.rules.free_fall * self.environment.gravity() {
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

    fn try_to_start(&mut self, columns: &Columns<'_>, t: f64, sample: &Sample) {
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
                (Some(f), None) if waited || columns.mag.is_none() => Some(self.level(&f.value)),
                (None, _) if waited || columns.acc.is_none() => Some(Quaternion::IDENTITY),
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

#[cfg(test)]
mod tests {
    use imufit_attitude::Frame;
    use proptest::prelude::*;

    use super::*;
    use crate::filter::{FILTERS, find};

    fn replay_of(name: &str, start: Start) -> Replay {
        let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
        Replay::new(find(name).unwrap(), &[], environment, Rules::default(), start).unwrap()
    }

    /// A number of a log, now and then an impossible one.
    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![
            12 => -20.0..20.0,
            1 => prop::sample::select(vec![
                f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, 1e300, -1e300, 1e-320, f64::MAX
            ]),
        ]
    }

    fn rows(n: usize) -> impl Strategy<Value = (Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>)> {
        let step = prop_oneof![20 => 0.001..0.05, 1 => -0.1..0.0, 1 => 1.0..3.0, 1 => Just(f64::NAN)];
        let times = prop::collection::vec(step, n).prop_map(|steps| {
            let mut t = 0.0;
            steps
                .iter()
                .map(|step: &f64| {
                    if step.is_nan() {
                        f64::NAN
                    } else {
                        t += step;
                        t
                    }
                })
                .collect()
        });
        let column = || prop::collection::vec(number(), 3 * n);
        (times, column(), column(), column())
    }

    proptest! {
        #[test]
        fn any_rows_give_unit_attitudes_and_any_cut_gives_the_same_bits((t, acc, gyr, mag) in rows(60), cut in 0usize..60) {
            for description in &FILTERS {
                let columns = Columns { t: &t, acc: Some(&acc), gyr: Some(&gyr), mag: Some(&mag) };
                let mut whole = vec![0.0; 4 * t.len()];
                let mut replay = replay_of(description.name, Start::Vectors);
                replay.run(&columns, &mut whole).unwrap();
                for q in whole.chunks(4).filter(|q| !q[0].is_nan()) {
                    let norm: f64 = q.iter().map(|x| x * x).sum();
                    prop_assert!((norm - 1.0).abs() < 1e-12);
                }
                prop_assert!(replay.state()[OWN_STATE..].iter().all(|value| value.is_finite()));

                let mut pieces = vec![0.0; 4 * t.len()];
                let (head, tail) = pieces.split_at_mut(4 * cut);
                let mut first = replay_of(description.name, Start::Vectors);
                let part = |from: usize, to: usize| Columns {
                    t: &t[from..to], acc: Some(&acc[3 * from..3 * to]),
                    gyr: Some(&gyr[3 * from..3 * to]), mag: Some(&mag[3 * from..3 * to]),
                };
                first.run(&part(0, cut), head).unwrap();
                let mut second = replay_of(description.name, Start::Vectors);
                second.set_state(&first.state()).unwrap();
                second.run(&part(cut, t.len()), tail).unwrap();
                let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
                prop_assert_eq!(bits(&whole), bits(&pieces));
            }
        }
    }

    #[test]
    fn a_filter_without_its_sensor_and_columns_of_other_length_are_refused_by_name() {
        let t = [0.0, 0.1];
        let columns = Columns {
            t: &t,
            acc: None,
            gyr: Some(&[0.0; 6]),
            mag: None,
        };
        let error = replay_of("mahony", Start::Vectors)
            .run(&columns, &mut [0.0; 8])
            .unwrap_err();
        assert!(error.to_string().contains("mahony needs acc"));
        let columns = Columns {
            t: &t,
            acc: None,
            gyr: Some(&[0.0; 3]),
            mag: None,
        };
        let error = replay_of("gyro", Start::Vectors)
            .run(&columns, &mut [0.0; 8])
            .unwrap_err();
        assert!(error.to_string().contains("gyr has 1 rows but t has 2"));
    }

    #[test]
    fn a_foreign_state_and_an_unknown_setting_are_refused() {
        let state = replay_of("gyro", Start::Vectors).state();
        assert!(replay_of("mahony", Start::Vectors).set_state(&state).is_err());
        assert!(replay_of("mahony", Start::Vectors).set_state(&[]).is_err());
        let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
        let error = find("mahony")
            .unwrap()
            .build(&environment, &[("kp".to_owned(), 1.0)])
            .err()
            .unwrap();
        assert!(error.to_string().contains("k_p"));
        assert!(find("mahoney").err().unwrap().to_string().contains("mahony"));
    }
}
