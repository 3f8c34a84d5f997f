//! Multiplicative extended Kalman filter (Markley 2003) that tells disturbances by how long they last.
//!
//! Errors that it estimates, with one covariance: attitude (3, reference frame: `q = exp(a) q^`), gyro bias `b` (3),
//! horizontal velocity `v` (2), gyro scale and misalignment `K` (9, row by row), so that a reading is
//! `w_m = w + b + K w_m + noise`.
//!
//! ```text
//! prediction    q' = q exp((w_m - b - K w_m) dt),   da = -R (db + dK w_m) dt,   dv = (a x R f) dt
//! velocity      0 = v + noise        what is carried about by hand or by a machine does not run away
//! heading       angle from the horizontal part of R m to that of the known field
//! rest          w_m = b + noise,  0 = v + less noise
//! ```
//!
//! **Accelerations.** The specific force is no measurement of the vertical here: it is integrated to a velocity, and a
//! tilt shows as a velocity that grows. A short acceleration is answered by the opposite one soon after and
//! leaves nothing, whatever its size, so that none has to be detected and nothing is thrown away. The speeds that occur
//! (`speed`, correlated over `speed_time`) decide how fast the tilt follows.
//!
//! **Field.** It turns the heading and never roll or pitch: those rows of the gain are zero (the covariance takes
//! account of that, Joseph form). Disturbances last, so that their variance counts over `mag_time`; it grows
//! with the departure of the field's horizontal and vertical part from what they were so far ([`crate::field`]): a magnet
//! is weighted out at once, and a field that stays is learned with the time constant `mag_memory`.
//!
//! **Bias.** At rest ([`crate::rest`]) the rate is the bias, heading included. In motion velocity and heading show it.
//!
//! **Gaps and missing readings.** After a gap the tilt is set from the first specific force within its spread and found
//! again within 10 s in motion and 5 s at rest; the heading within 30 s. While the specific force is
//! missing (free fall, clipping) the velocity becomes uncertain by gravity times that time. Without a magnetometer the
//! heading is that of the integrated rate.

use imufit_attitude::Quaternion;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::field::Field;
use crate::filter::{Filter, Parameter, Usage, split_state};
use crate::intake::{Intake, all_rows};
use crate::rest::{Limits, Rest, matrix};
use crate::{Columns, Environment, Sample, Skipped};

/// Errors: attitude 3 (reference frame), gyro bias 3, horizontal velocity 2, gyro scale and misalignment 9.
pub(crate) const STATES: usize = 17;
const BIAS: usize = 3;
const SPEED: usize = 6;
const SCALE: usize = 8;
/// Numbers of the lower triangle.
const TRIANGLE: usize = STATES * (STATES + 1) / 2;
/// Numbers of a state beyond the attitude.
const REST_OF_STATE: usize = 3 + 2 + 9 + TRIANGLE + 7 + 4 + 1;

/// Velocity noise density at rest, m/s*sqrt(s).
const STANDING: f64 = 0.01;
/// Variance of the tilt that the first specific force shows, which may be accelerated, rad^2.
const FIRST_TILT: f64 = 0.01;
/// Variance of the turn during a gap, rad^2.
const GAP: f64 = 1.0;

type Covariance = SMatrix<f64, STATES, STATES>;
type Errors = SVector<f64, STATES>;

/// The state with which a pass the other way round begins at `attitude`: bias and scale are kept with their certainty,
/// the bias, like every rate, with its sign changed; attitude and velocity are to be found anew.
pub(crate) fn turned_back(state: &[f64], attitude: Quaternion) -> Vec<f64> {
    let mut state = state.to_vec();
    let at = (4 + 3 + 2 + 9).min(state.len());
    let (head, triangle) = state.split_at_mut(at);
    for (value, own) in head.iter_mut().zip(attitude.to_array()) {
        *value = own;
    }
    for value in head.iter_mut().skip(4).take(3) {
        *value = -*value;
    }
    for value in head.iter_mut().skip(7).take(2) {
        *value = 0.0;
    }
    let places = (0..STATES).flat_map(|j| (0..=j).map(move |i| (i, j)));
    let is_bias = |i: usize| (BIAS..SPEED).contains(&i);
    let is_lost = |i: usize| i < BIAS || (SPEED..SCALE).contains(&i);
    for (value, (i, j)) in triangle.iter_mut().zip(places) {
        if i != j && (is_lost(i) || is_lost(j)) {
            *value = 0.0;
        } else if is_bias(i) != is_bias(j) {
            *value = -*value;
        }
    }
    state
}

/// Noise densities, speeds and the field's errors, so that the filter does not depend on the rate of the log.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "gyr_noise",
        default: 3e-3,
        unit: "rad/s/sqrt(Hz)",
        meaning: "noise density of the angular rate, its errors in fast turns included: larger follows accelerometer and field faster",
    },
    Parameter {
        name: "bias_walk",
        default: 1.7e-4,
        unit: "rad/s/sqrt(s)",
        meaning: "random walk of the gyro bias: larger learns a changing bias faster and takes more motion for bias",
    },
    Parameter {
        name: "acc_noise",
        default: 0.02,
        unit: "m/s^2/sqrt(Hz)",
        meaning: "noise density of the specific force: larger follows the accelerometer more slowly",
    },
    Parameter {
        name: "speed",
        default: 0.5,
        unit: "m/s",
        meaning: "horizontal speeds that occur, root mean square: larger follows the accelerometer more slowly and lets longer accelerations pass",
    },
    Parameter {
        name: "speed_time",
        default: 0.5,
        unit: "s",
        meaning: "time over which a speed lasts: larger follows the accelerometer more slowly",
    },
    Parameter {
        name: "mag_noise",
        default: 0.01,
        unit: "rad",
        meaning: "standard deviation of the heading that an undisturbed field shows: larger trusts the gyro for longer",
    },
    Parameter {
        name: "mag_time",
        default: 5.0,
        unit: "s",
        meaning: "time over which an error of the field lasts: larger trusts the gyro for longer",
    },
    Parameter {
        name: "mag_departure",
        default: 0.6,
        unit: "1",
        meaning: "weight of the field's departure from what it was so far: larger ignores a disturbed field more, 0 never does",
    },
    Parameter {
        name: "mag_memory",
        default: 10.0,
        unit: "s",
        meaning: "time constant of what the field was so far: larger accepts a changed field later",
    },
    Parameter {
        name: "angle_start",
        default: 0.2,
        unit: "rad",
        meaning: "uncertainty of the initial attitude and of that after a gap",
    },
    Parameter {
        name: "bias_start",
        default: 0.02,
        unit: "rad/s",
        meaning: "uncertainty of the initial bias of zero; a mean rate beyond three times it is never rest",
    },
    Parameter {
        name: "scale_start",
        default: 0.005,
        unit: "1",
        meaning: "uncertainty of the gyro's scale factors and misalignments; 0 takes the gyro for calibrated",
    },
    Parameter {
        name: "rest_gyr",
        default: 0.035,
        unit: "rad/s",
        meaning: "departure of the rate from its mean that still is rest: larger finds rest in more motion",
    },
    Parameter {
        name: "rest_acc",
        default: 0.5,
        unit: "m/s^2",
        meaning: "departure of the specific force from its mean that still is rest: larger finds rest in more motion",
    },
    Parameter {
        name: "rest_noise",
        default: 5e-4,
        unit: "rad/s/sqrt(Hz)",
        meaning: "noise density of the bias that a rest shows: smaller believes a rest faster",
    },
    Parameter {
        name: "min_angle",
        default: 0.035,
        unit: "rad",
        meaning: "where the field is closer to the vertical than this it is not used: smaller accepts noisier headings",
    },
];

#[derive(Debug, Clone, Copy)]
struct Values {
    gyr_noise: f64,
    bias_walk: f64,
    acc_noise: f64,
    speed: f64,
    speed_time: f64,
    mag_noise: f64,
    mag_time: f64,
    mag_departure: f64,
    mag_memory: f64,
    angle_start: f64,
    bias_start: f64,
    scale_start: f64,
    rest_gyr: f64,
    rest_acc: f64,
    rest_noise: f64,
    min_angle: f64,
}

/// The filter.
#[derive(Debug, Clone)]
pub struct Mekf {
    environment: Environment,
    values: Values,
    q: Quaternion,
    bias: Vector3<f64>,
    /// Horizontal, reference frame, m/s.
    velocity: [f64; 2],
    scale: Matrix3<f64>,
    covariance: Covariance,
    rest: Rest,
    field: Field,
    /// Time turned since the last specific force, s; -1 where the next one shows the vertical.
    since_force: f64,
}

impl Mekf {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[f64]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(PARAMETERS[at].default);
        let values = Values {
            gyr_noise: value(0),
            bias_walk: value(1),
            acc_noise: value(2),
            speed: value(3),
            speed_time: value(4),
            mag_noise: value(5),
            mag_time: value(6),
            mag_departure: value(7),
            mag_memory: value(8),
            angle_start: value(9),
            bias_start: value(10),
            scale_start: value(11),
            rest_gyr: value(12),
            rest_acc: value(13),
            rest_noise: value(14),
            min_angle: value(15),
        };
        let mut filter = Self {
            environment: *environment,
            values,
            q: Quaternion::IDENTITY,
            bias: Vector3::zeros(),
            velocity: [0.0; 2],
            scale: Matrix3::zeros(),
            covariance: Covariance::zeros(),
            rest: Rest::UNKNOWN,
            field: Field::UNKNOWN,
            since_force: 0.0,
        };
        filter.reset(Quaternion::IDENTITY);
        filter
    }

    /// Turns by a reading and lets the uncertainty grow.
    fn turn(&mut self, reading: &Vector3<f64>, dt: f64) {
        let v = self.values;
        let r = matrix(self.q);
        self.q = self.q.turned(&(reading - self.bias - self.scale * reading), dt);
        let mut a = SMatrix::<f64, 3, STATES>::zeros();
        for i in 0..3 {
            for j in 0..3 {
                a[(i, BIAS + j)] = -r[(i, j)] * dt;
                for k in 0..3 {
                    a[(i, SCALE + 3 * j + k)] = -r[(i, j)] * reading[k] * dt;
                }
            }
        }
        self.carry(0, &a);
        let (angle, walk) = (v.gyr_noise * v.gyr_noise * dt, v.bias_walk * v.bias_walk * dt);
        for i in 0..3 {
            self.covariance[(i, i)] += angle;
            self.covariance[(BIAS + i, BIAS + i)] += walk;
        }
    }

    /// P <- (I + A) P (I + A)^T, A being nonzero in N rows from `first` only. P stays symmetric to the bit.
    fn carry<const N: usize>(&mut self, first: usize, a: &SMatrix<f64, N, STATES>) {
        let ap = a * self.covariance;
        let apa = ap * a.transpose();
        if !(ap.norm_squared().is_finite() && apa.norm_squared().is_finite()) {
            return;
        }
        let p = &mut self.covariance;
        let within = |j: usize| (first..first + N).contains(&j);
        for i in 0..N {
            for j in (0..STATES).filter(|j| !within(*j)) {
                p[(first + i, j)] += ap[(i, j)];
                p[(j, first + i)] = p[(first + i, j)];
            }
            for j in 0..=i {
                p[(first + i, first + j)] += ap[(i, first + j)] + ap[(j, first + i)] + apa[(i, j)];
                p[(first + j, first + i)] = p[(first + i, first + j)];
            }
        }
    }

    /// Integrates the specific force to velocity and compares it with the speeds there are.
    fn accelerate(&mut self, f: &Vector3<f64>, dt: f64) {
        let v = self.values;
        let (lost, blind) = (self.since_force < 0.0, self.since_force - dt);
        self.since_force = 0.0;
        if lost {
            self.level(f);
        }
        let force = self.q.rotate(f);
        self.velocity[0] += force.x * dt;
        self.velocity[1] += force.y * dt;
        let a = SMatrix::<f64, 2, STATES>::from_fn(|i, j| match (i, j) {
            (0, 1) => force.z * dt,
            (0, 2) => -force.y * dt,
            (1, 0) => -force.z * dt,
            (1, 2) => force.x * dt,
            _ => 0.0,
        });
        self.carry(SPEED, &a);
        for i in 0..2 {
            let at = (SPEED + i, SPEED + i);
            self.covariance[at] += v.acc_noise * v.acc_noise * dt;
            if blind > 0.01 * dt {
                let sd = self.covariance[at].sqrt();
                self.covariance[at] += (sd + self.environment.gravity() * blind).powi(2) - sd * sd;
            }
        }
        let mut x = Errors::zeros();
        for i in 0..2 {
            let r = 2.0 * v.speed * v.speed * v.speed_time / dt;
            self.measure(&mut x, SPEED + i, -self.velocity[i], r, false);
        }
        self.correct(&x);
    }

    /// The error `at` was measured as `value`, variance `r`; adds to the errors `x` found so far in this step. `heading`:
    /// of the attitude only the heading is moved, and the velocity stays.
    fn measure(&mut self, x: &mut Errors, at: usize, value: f64, r: f64, heading: bool) {
        let ph: Errors = self.covariance.column(at).into_owned();
        let (s, innovation) = (ph[at] + r, value - x[at]);
        if !(s > 0.0 && s.is_finite() && innovation.is_finite()) {
            return;
        }
        let mut gain = ph / s;
        if heading {
            for i in [0, 1, SPEED, SPEED + 1] {
                gain[i] = 0.0;
            }
        }
        for j in 0..STATES {
            let (g, c) = (gain[j], ph[j] - gain[j] * s);
            for i in 0..=j {
                self.covariance[(i, j)] -= ph[i] * g + gain[i] * c;
                self.covariance[(j, i)] = self.covariance[(i, j)];
            }
        }
        *x += gain * innovation;
    }

    /// Moves the errors found into the estimates.
    fn correct(&mut self, x: &Errors) {
        self.q = Quaternion::exp(&Vector3::new(x[0], x[1], x[2])) * self.q;
        self.bias += Vector3::new(x[3], x[4], x[5]);
        self.velocity[0] += x[SPEED];
        self.velocity[1] += x[SPEED + 1];
        for i in 0..3 {
            for j in 0..3 {
                self.scale[(i, j)] += x[SCALE + 3 * i + j];
            }
        }
    }

    /// At rest the rate is the bias and the velocity zero.
    fn stand(&mut self, reading: &Vector3<f64>, dt: f64) {
        let v = self.values;
        let mut x = Errors::zeros();
        for i in 0..3 {
            let value = reading[i] - self.bias[i];
            self.measure(&mut x, BIAS + i, value, v.rest_noise * v.rest_noise / dt, false);
        }
        for i in 0..2 {
            self.measure(&mut x, SPEED + i, -self.velocity[i], STANDING * STANDING / dt, false);
        }
        self.correct(&x);
    }

    /// The tilt from one specific force.
    fn level(&mut self, f: &Vector3<f64>) {
        let innovation = Quaternion::between(&self.q.rotate(f), &self.environment.up()).log();
        let mut x = Errors::zeros();
        for i in 0..2 {
            self.measure(&mut x, i, innovation[i], FIRST_TILT, false);
        }
        self.correct(&x);
    }

    /// The heading from the field.
    fn head(&mut self, m: &Vector3<f64>, dt: f64) -> Usage {
        let v = self.values;
        let up = self.environment.up();
        let seen = self.q.rotate(m);
        let Some(direction) = crate::sample::horizontal(&seen, &up, v.min_angle.min(1.5).sin()) else {
            return Usage::NoHeading;
        };
        if dt <= 0.0 {
            return Usage::Full;
        }
        let vertical = seen.dot(&up);
        let departure = self
            .field
            .update(seen.dot(&direction), vertical, dt, v.mag_memory, v.mag_noise);
        let north = self.environment.field_north();
        let innovation = up.dot(&direction.cross(&north)).atan2(direction.dot(&north));
        let variance = v.mag_noise * v.mag_noise + v.mag_departure * v.mag_departure * departure;
        let mut x = Errors::zeros();
        let r = variance * (2.0 * v.mag_time / dt).max(1.0);
        self.measure(&mut x, 2, up.z * innovation, r, true);
        self.correct(&x);
        Usage::Full
    }

    /// Nothing is known of a turn during a gap: the next specific force shows the vertical.
    fn after_gap(&mut self) {
        let v = self.values;
        if self.since_force >= 0.0 {
            for i in 0..3 {
                self.covariance[(i, i)] += GAP;
            }
            self.since_force = -1.0;
        }
        self.velocity = [0.0; 2];
        for i in SPEED..SPEED + 2 {
            self.covariance.fill_row(i, 0.0);
            self.covariance.fill_column(i, 0.0);
            self.covariance[(i, i)] = v.speed * v.speed;
        }
        self.rest = Rest::UNKNOWN;
    }
}

impl Filter for Mekf {
    fn step(&mut self, sample: &Sample) -> Usage {
        if let Some(omega) = sample.omega {
            self.turn(&omega.value.0, omega.dt);
            if self.since_force >= 0.0 {
                self.since_force += omega.dt;
            }
        }
        if let Some(f) = sample.f {
            if f.dt > 0.0 {
                self.accelerate(&f.value.0, f.dt);
            } else {
                self.after_gap();
            }
            if let Some(omega) = sample.omega {
                let v = self.values;
                let limits = Limits {
                    gyr: v.rest_gyr,
                    acc: v.rest_acc,
                    bias: 3.0 * v.bias_start,
                };
                if omega.dt > 0.0 && self.rest.update(&omega.value.0, &f.value.0, omega.dt, &limits) {
                    self.stand(&omega.value.0, omega.dt);
                }
            }
        }
        match sample.m {
            Some(m) => self.head(&m.value.0, m.dt),
            None => Usage::Full,
        }
    }

    fn attitude(&self) -> Quaternion {
        self.q
    }

    fn attitude_covariance(&self) -> Option<Matrix3<f64>> {
        Some(self.covariance.fixed_view::<3, 3>(0, 0).into_owned())
    }

    fn reset(&mut self, attitude: Quaternion) {
        let v = self.values;
        (self.q, self.bias, self.velocity, self.scale) = (attitude, Vector3::zeros(), [0.0; 2], Matrix3::zeros());
        (self.rest, self.field, self.since_force) = (Rest::UNKNOWN, Field::UNKNOWN, -1.0);
        self.covariance = Covariance::from_diagonal(&Errors::from_fn(|i, _| {
            let sd = match i {
                0..BIAS => v.angle_start,
                BIAS..SPEED => v.bias_start,
                SPEED..SCALE => v.speed,
                _ => v.scale_start,
            };
            sd * sd
        }));
    }

    fn rows(&mut self, intake: &mut Intake, columns: &Columns<'_>, attitude: &mut [f64], skipped: &mut Skipped) {
        all_rows(self, intake, columns, attitude, skipped);
    }

    fn state(&self) -> Vec<f64> {
        let mut state = self.q.to_array().to_vec();
        state.extend(self.bias.iter().chain(&self.velocity).chain(self.scale.iter()));
        for j in 0..STATES {
            state.extend((0..=j).map(|i| self.covariance[(i, j)]));
        }
        let (Rest { rate, force, calm }, field) = (self.rest, self.field);
        state.extend(rate.iter().chain(force.iter()));
        state.extend([
            calm,
            field.horizontal,
            field.vertical,
            field.time,
            field.departure,
            self.since_force,
        ]);
        state
    }

    fn set_state(&mut self, state: &[f64]) -> bool {
        let Some((q, rest)) = split_state::<f64, REST_OF_STATE>(state) else {
            return false;
        };
        let vector = |at: usize| Vector3::new(rest[at], rest[at + 1], rest[at + 2]);
        (self.q, self.bias, self.velocity) = (q, vector(0), [rest[3], rest[4]]);
        self.scale = Matrix3::from_column_slice(&rest[5..14]);
        let mut at = 14;
        for j in 0..STATES {
            for i in 0..=j {
                (self.covariance[(i, j)], self.covariance[(j, i)]) = (rest[at], rest[at]);
                at += 1;
            }
        }
        self.rest = Rest {
            rate: vector(at),
            force: vector(at + 3),
            calm: rest[at + 6],
        };
        self.field = Field {
            horizontal: rest[at + 7],
            vertical: rest[at + 8],
            time: rest[at + 9],
            departure: rest[at + 10],
        };
        self.since_force = rest[at + 11];
        true
    }
}
