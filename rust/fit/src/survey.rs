//! First pass over a log: what has to be known of the whole before evidence is taken.

use std::sync::Arc;

use imufit_model::bandwidth::Bandwidth;
use imufit_model::facts::{Frame, LogFacts};
use imufit_model::gravity_course::{GravityCourse, GravityParts};
use imufit_model::kinematics_memory::KinematicsMemory;
use imufit_model::rig::Rig;
use imufit_model::sensor::Sensor;
use imufit_model::smoothing::Smoothing;
use imufit_model::temperature_course::{Parts, TemperatureCourse};
use imufit_model::usual_step::usual_step;
use imufit_model::vibration;
use imufit_model::window::Window;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::bins::{Bins, CovariateSamples, FORCES, RATES};
use crate::place_field::PlaceField;
use crate::reference_step::ReferenceStep;
use crate::reference_width::{self, SampledRow, SampledRows};
use crate::rounding::SensorSteps;
use crate::travel::Travel;

/// Fraction of the golden ratio, in units of 2^-64.
const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
/// Rows looked at more closely, at most.
const SAMPLES: usize = 8192;
/// Rows on which the width of the reference polynomial is judged, at most.
const BANDWIDTH_SAMPLES: usize = 4096;

/// What the caller knows before the first pass.
#[derive(Clone, Debug)]
pub struct Given {
    /// Number of rows of the log.
    pub n: usize,
    /// The reference frame.
    pub frame: Frame,
    /// Gravity in the reference frame, m/s^2.
    pub gravity: Vector3<f64>,
    /// Reference field, uT, if known.
    pub field: Option<Vector3<f64>>,
    /// Names of the covariates.
    pub covariates: Vec<String>,
    /// The one-axis rig, its knots still to be found.
    pub rig: Option<Rig>,
}

/// Running sums of the first pass.
#[derive(Clone, Debug)]
pub struct Survey {
    given: Given,
    t_first: f64,
    t_last: f64,
    steps: Vec<f64>,
    sensor_steps: [Vec<f64>; 3],
    counts: [usize; 3],
    temperature: (f64, usize),
    temperature_parts: Parts,
    gravity_parts: GravityParts,
    covariates: Vec<(f64, usize)>,
    field_of_place: PlaceField,
    attitude_width: Bandwidth,
    position_width: Bandwidth,
    reference_step: ReferenceStep,
    has_position: bool,
    origin: Option<Vector3<f64>>,
    width_rows: SampledRows,
    samples: Vec<Vec<f64>>,
    travel: Option<Travel>,
    /// Power of the vibration at some rows.
    shaking: Vec<f64>,
    /// Steps of each sensor.
    rounding: [SensorSteps; 3],
}

/// Rows to either side in which two readings of a sensor are looked for where the reference has rows of its own: enough for a reference
/// that is thirty times as fast.
const BETWEEN: usize = 64;
/// Attitudes further apart than so many usual steps have nothing known between them: one that was not seen.
const GAP: f64 = 2.5;

/// A sensor's reading at a row and its change from two rows before to two rows after, or, where the reference has rows of its own
/// (`apart`), from two of its readings before to two after; NaN where not known.
fn around(window: &Window, sensor: Sensor, row: usize, apart: bool) -> (Vector3<f64>, Vector3<f64>) {
    let unknown = Vector3::repeat(f64::NAN);
    let Some(y) = window.reading(sensor) else {
        return (unknown, unknown);
    };
    let at = |i: usize| Vector3::new(y[3 * i], y[3 * i + 1], y[3 * i + 2]);
    let known = |i: &usize| !apart || at(*i).iter().all(|x| x.is_finite());
    let before = (row.saturating_sub(BETWEEN)..row).rev().filter(known).nth(1);
    let after = (row + 1..window.len().min(row + 1 + BETWEEN)).filter(known).nth(1);
    let change = before
        .zip(after)
        .map_or(unknown, |(before, after)| at(after) - at(before));
    (at(row), change)
}

/// The attitude that stands in a row.
fn attitude_at(window: &Window, row: usize) -> Option<UnitQuaternion<f64>> {
    let q = window.attitude.map(|q| &q[4 * row..4 * row + 4])?;
    Some(UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3])))
}

/// Rows of a window in which the attitude is known: sensors and reference may stand in rows of their own.
struct Attitudes {
    rows: Vec<usize>,
    /// Usual time between them, s.
    spacing: f64,
}

impl Attitudes {
    fn of(window: &Window) -> Self {
        let known = |i: &usize| {
            let of_row = |q: &[f64]| q[4 * i..4 * i + 4].iter().all(|v| v.is_finite());
            window.attitude.is_some_and(of_row)
        };
        let rows: Vec<usize> = (0..window.len()).filter(known).collect();
        let times: Vec<f64> = rows.iter().map(|k| window.t[*k]).collect();
        Self {
            spacing: usual_step(&times),
            rows,
        }
    }

    /// The attitude at a row, on the shortest way between those before and after where the row has none itself.
    fn between(&self, window: &Window, row: usize) -> Option<UnitQuaternion<f64>> {
        let after = self.rows.partition_point(|k| *k < row);
        let next = *self.rows.get(after)?;
        if next == row {
            return attitude_at(window, row);
        }
        let last = *self.rows.get(after.checked_sub(1)?)?;
        let step = window.t[next] - window.t[last];
        if step > GAP * self.spacing {
            return None;
        }
        let part = (window.t[row] - window.t[last]) / step;
        attitude_at(window, last)?.try_slerp(&attitude_at(window, next)?, part, f64::EPSILON)
    }

    /// The attitude nearest in time to a row, no further away than the attitudes lie apart.
    fn nearest(&self, window: &Window, row: usize) -> Option<UnitQuaternion<f64>> {
        let after = self.rows.partition_point(|k| *k < row);
        let around = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let away = |k: &usize| (window.t[*k] - window.t[row]).abs();
        let near = around.filter_map(|k| self.rows.get(k).copied());
        let nearest = near.min_by(|a, b| away(a).total_cmp(&away(b)))?;
        let close = nearest == row || away(&nearest) <= self.spacing;
        attitude_at(window, nearest).filter(|_| close)
    }
}

/// Middle of a sample; NaN if empty.
fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return f64::NAN;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Puts the components of vectors, and their size where there is a place for it, in the place of other samples, if there are any.
fn put(samples: &mut [Vec<f64>], vectors: &[Vector3<f64>]) {
    if vectors.is_empty() {
        return;
    }
    for (k, sample) in samples.iter_mut().enumerate() {
        let of = |v: &Vector3<f64>| v.as_slice().get(k).copied().unwrap_or_else(|| v.norm());
        *sample = vectors.iter().map(of).filter(|v| v.is_finite()).collect();
    }
}

impl Survey {
    /// An empty survey.
    pub fn new(given: Given) -> Self {
        let axes = Bins::covariate_names(&given.covariates).len();
        Self {
            t_first: f64::NAN,
            t_last: f64::NAN,
            steps: Vec::new(),
            sensor_steps: Default::default(),
            counts: [0; 3],
            temperature: (0.0, 0),
            temperature_parts: Parts::new(given.n),
            gravity_parts: GravityParts::new(given.n),
            covariates: vec![(0.0, 0); given.covariates.len()],
            field_of_place: PlaceField::default(),
            attitude_width: Bandwidth::of_attitude(),
            position_width: Bandwidth::of_position(),
            reference_step: ReferenceStep::default(),
            has_position: false,
            origin: None,
            width_rows: SampledRows::new(),
            samples: vec![Vec::new(); axes],
            travel: given.rig.clone().map(Travel::new),
            shaking: Vec::new(),
            rounding: Default::default(),
            given,
        }
    }

    /// True of about `most` rows, spread evenly: multiples of the golden ratio (Weyl 1916), whose steps no pattern of rows has.
    fn sampled(&self, row: usize, most: usize) -> bool {
        let every = self.given.n.div_ceil(most).max(1) as u64;
        (row as u64).wrapping_mul(GOLDEN) <= u64::MAX / every
    }

    /// Adds the core rows of a window.
    pub fn add(&mut self, window: &Window) {
        let core = window.begin..window.end;
        if core.is_empty() {
            return;
        }
        if self.t_first.is_nan() {
            self.t_first = window.t[window.begin];
        }
        self.t_last = window.t[window.end - 1];
        for sensor in Sensor::ALL {
            let Some(y) = window.reading(sensor) else { continue };
            let at = |i: usize| [y[3 * i], y[3 * i + 1], y[3 * i + 2]];
            let mut last: [Option<usize>; 2] = [None; 2];
            for i in core.clone().filter(|i| at(*i).iter().all(|v| v.is_finite())) {
                self.counts[sensor.index()] += 1;
                let row = window.offset + i;
                if let [first, Some(second)] = last
                    && self.sampled(row, SAMPLES)
                {
                    self.sensor_steps[sensor.index()].push(window.t[i] - window.t[second]);
                    let part = row as f64 / self.given.n.max(1) as f64;
                    let readings = [at(first.unwrap_or(second)), at(second), at(i)];
                    self.rounding[sensor.index()].add(part, readings);
                }
                last = [last[1], Some(i)];
            }
        }
        let attitudes = Attitudes::of(window);
        let passed = window.t[window.len() - 1] - window.t[0];
        let power = vibration::power(window, passed / (window.len().max(2) - 1) as f64);
        for i in core.clone() {
            let row = window.offset + i;
            if self.sampled(row, SAMPLES) {
                self.shaking.extend(power.get(i - window.begin).filter(|p| **p > 0.0));
            }
            if i > 0 && self.sampled(row, SAMPLES) {
                self.steps.push(window.t[i] - window.t[i - 1]);
            }
            if let Some(v) = window.temperature.map(|t| t[i]).filter(|v| v.is_finite()) {
                self.temperature.0 += v;
                self.temperature.1 += 1;
                self.temperature_parts.add(row, window.t[i], v);
            }
            for (sum, column) in self.covariates.iter_mut().zip(&window.covariates) {
                if column[i].is_finite() {
                    sum.0 += column[i];
                    sum.1 += 1;
                }
            }
            if self.given.field.is_none()
                && let Some(m) = window.reading(Sensor::Mag).map(|m| &m[3 * i..3 * i + 3])
                && m.iter().all(|v| v.is_finite())
                && let Some(q) = attitudes.nearest(window, i)
            {
                self.field_of_place.add(q, Vector3::new(m[0], m[1], m[2]));
            }
            let measured = window.reference_exact.is_none_or(|e| e[i] > 0.5);
            let known = attitude_at(window, i).filter(|q| measured && q.coords.iter().all(|v| v.is_finite()));
            if let Some(q) = known {
                self.reference_step.add(q);
                let force = q.inverse_transform_vector(&-self.given.gravity);
                self.gravity_parts.add(row, window.t[i], force);
                if let Some(travel) = self.travel.as_mut() {
                    travel.add(window.t[i], &q);
                }
            }
            if self.sampled(row, SAMPLES) {
                let at = |s: Sensor, a: usize| window.reading(s).map_or(f64::NAN, |y| y[3 * i + a]);
                let rate = Vector3::new(at(Sensor::Gyr, 0), at(Sensor::Gyr, 1), at(Sensor::Gyr, 2));
                let fixed = [
                    window.t[i],
                    window.temperature.map_or(f64::NAN, |t| t[i]),
                    at(Sensor::Acc, 0),
                    at(Sensor::Acc, 1),
                    at(Sensor::Acc, 2),
                    rate.x,
                    rate.y,
                    rate.z,
                    rate.norm(),
                ];
                let values = fixed.into_iter().chain(window.covariates.iter().map(|c| c[i]));
                for (sample, value) in self.samples.iter_mut().zip(values) {
                    if value.is_finite() {
                        sample.push(value);
                    }
                }
            }
        }
        let rows: Vec<usize> = core
            .filter(|i| self.sampled(window.offset + i, BANDWIDTH_SAMPLES))
            .collect();
        for &i in &rows {
            if let Some(attitude) = attitudes.between(window, i) {
                let apart = attitudes.rows.binary_search(&i).is_err();
                let [rate, force] = [Sensor::Gyr, Sensor::Acc].map(|sensor| around(window, sensor, i, apart));
                self.width_rows
                    .insert(window.offset + i, SampledRow { rate, force, attitude });
            }
        }
        self.attitude_width.add(window, rows.iter().copied());
        if let Some(p) = window.position {
            let known = |i: &usize| p[3 * i..3 * i + 3].iter().all(|v| v.is_finite());
            let first = || {
                rows.iter()
                    .copied()
                    .find(known)
                    .map(|i| Vector3::new(p[3 * i], p[3 * i + 1], p[3 * i + 2]))
            };
            self.origin = self.origin.or_else(first);
            // The rows looked at may all lie between those of a reference that has rows of its own.
            self.has_position |= p.iter().step_by(3).any(|v| v.is_finite());
            self.position_width.add(window, rows.into_iter());
        }
    }

    /// The facts, and samples of every covariate.
    pub fn finish(mut self) -> (LogFacts, CovariateSamples) {
        let mean = |(sum, n): (f64, usize)| if n == 0 { f64::NAN } else { sum / n as f64 };
        let of_readings = self.field_of_place.estimate();
        let estimated = of_readings.is_some();
        let field = self.given.field.or(of_readings).unwrap_or_default();
        let dt = median(&mut self.steps);
        let attitude_smoothing = reference_width::of_attitude(&self.attitude_width, &self.width_rows, self.given.n);
        let position_smoothing = self.has_position.then(|| {
            reference_width::of_position(
                &self.position_width,
                &self.attitude_width,
                attitude_smoothing,
                &self.width_rows,
                self.given.n,
            )
        });
        // What columns are made of is smoother than what readings are compared with.
        let attitude_columns = self.attitude_width.for_columns(attitude_smoothing);
        let position_columns = position_smoothing.map(|s| self.position_width.for_columns(s));
        let forces = self.forces(position_columns);
        let attitude_noise = self.attitude_width.noise();
        let rate_noise = self.attitude_width.derivative_noise(attitude_columns);
        let force_noise = attitude_noise * self.given.gravity.norm()
            + position_columns.map_or(0.0, |s| self.position_width.derivative_noise(s));
        let found = std::mem::take(&mut self.rounding).map(SensorSteps::finish);
        let (steps, steps_crossed) = (found.map(|(steps, _)| steps), found.map(|(_, crossed)| crossed));
        let facts = LogFacts {
            n: self.given.n,
            t_start: self.t_first,
            t_end: self.t_last,
            dt,
            frame: self.given.frame,
            gravity: self.given.gravity,
            field,
            field_estimated: estimated,
            temperature_mean: mean(self.temperature),
            covariate_means: self.covariates.iter().map(|c| mean(*c)).collect(),
            sensors: std::array::from_fn(|s| {
                self.counts[s] > 0 && (s != Sensor::Mag.index() || self.given.field.is_some() || estimated)
            }),
            sensor_dt: std::array::from_fn(|s| {
                let step = median(&mut self.sensor_steps[s]);
                if step.is_finite() { step } else { dt }
            }),
            has_temperature: self.temperature.1 > 0,
            temperature_course: TemperatureCourse::of(&self.temperature_parts).map(Arc::new),
            gravity_course: GravityCourse::of(&self.gravity_parts).map(Arc::new),
            attitude_smoothing,
            position_smoothing,
            silent_axes: self.silent_axes(attitude_columns, field),
            silent_accelerations: self.attitude_width.noisy_axes(attitude_columns),
            offset_unseen: if estimated {
                self.field_of_place.unseen(attitude_noise) * field.norm()
            } else {
                Matrix3::zeros()
            },
            noise_shares: [
                self.force_noise_shares(),
                self.attitude_width.noise_shares(attitude_columns),
            ],
            shaking_varies: vibration::varies(&mut self.shaking, dt, steps[Sensor::Acc.index()]),
            column_noise: [force_noise, rate_noise, attitude_noise * field.norm()],
            ideal_noise: [
                attitude_noise * self.given.gravity.norm()
                    + position_smoothing.map_or(0.0, |s| self.position_width.derivative_noise(s)),
                self.attitude_width.derivative_noise(attitude_smoothing),
                attitude_noise * field.norm(),
            ],
            position_origin: self.origin.unwrap_or_default(),
            attitude_columns,
            position_columns,
            attitude_bends: self.attitude_width.for_bends(attitude_columns),
            position_bends: position_columns.map(|s| self.position_width.for_bends(s)),
            reference_dt: self.attitude_width.spacing().unwrap_or(dt),
            reference_packet: self.attitude_width.packet(),
            reference_step: self.reference_step.finish(),
            ranges: [None; 3],
            steps,
            steps_crossed,
            rig: self.travel.take().map(|t| t.finish(self.attitude_width.noise())),
            covariates: self.given.covariates.clone(),
            rests: false,
            kinematics: KinematicsMemory::default(),
        };
        let mut values = self.samples;
        let rates = (self.attitude_width.derivatives(attitude_columns)).map(|(_, rate)| Vector3::from(rate));
        put(&mut values[RATES], &rates.collect::<Vec<_>>());
        put(&mut values[FORCES], &forces);
        let samples = CovariateSamples {
            names: Bins::covariate_names(&self.given.covariates),
            values,
            rows: self.given.n,
            rate_noise,
            force_noise,
        };
        (facts, samples)
    }

    /// Part that noise of the attitude makes of the mean square of the specific force along each axis. Of a body that translates only the
    /// readings tell how large that is.
    fn force_noise_shares(&self) -> [f64; 3] {
        let noise = (self.attitude_width.noise() * self.given.gravity.norm()).powi(2);
        let mut square = Vector3::<f64>::zeros();
        let mut n = 0.0;
        for row in self.width_rows.values() {
            let held = row.attitude.inverse_transform_vector(&-self.given.gravity);
            let force = if self.has_position { row.force.0 } else { held };
            if force.iter().all(|v| v.is_finite()) {
                square += force.component_mul(&force);
                n += 1.0;
            }
        }
        std::array::from_fn(|axis| {
            if noise > 0.0 {
                (n * noise / square[axis]).min(1.0)
            } else {
                0.0
            }
        })
    }

    /// Specific forces in the sampled rows by the reference, its accelerations by this width.
    fn forces(&self, width: Option<Smoothing>) -> Vec<Vector3<f64>> {
        let of = |row: &SampledRow, acceleration: Vector3<f64>| {
            (row.attitude).inverse_transform_vector(&(acceleration - self.given.gravity))
        };
        match width {
            None => self.width_rows.values().map(|row| of(row, Vector3::zeros())).collect(),
            Some(width) => (self.position_width.derivatives(width))
                .filter_map(|(at, a)| Some(of(self.width_rows.get(&at)?, Vector3::from(a))))
                .collect(),
        }
    }

    /// For each sensor the axes along which its ideal reading is nothing but the noise of the reference.
    fn silent_axes(&self, attitude: Smoothing, field: Vector3<f64>) -> [[bool; 3]; 3] {
        let noise = self.attitude_width.noise();
        let silent = |v: Vector3<f64>| reference_width::silent_axes(&self.width_rows, &v, noise);
        // A body that translates is accelerated along every axis.
        let acc = if self.has_position {
            [false; 3]
        } else {
            silent(-self.given.gravity)
        };
        [
            acc,
            reference_width::still_axes(&self.attitude_width, attitude),
            silent(field),
        ]
    }

    /// How the widths of the reference polynomials compare: noise and excess differences (attitude, position).
    pub fn widths(&self) -> (&Bandwidth, &Bandwidth) {
        (&self.attitude_width, &self.position_width)
    }
}
