//! State and step: predictions and measurements in the order in which a row brings them.

use imufit_attitude::Quaternion;
use nalgebra::{Matrix3, Vector3};

use super::covariance::{BIAS, Covariance, Errors, Moves, SCALE, SPEED};
use super::settings::Values;
use crate::field::Field;
use crate::filter::{Filter, Usage};
use crate::intake::{Intake, all_rows};
use crate::rest::{Limits, Rest, matrix};
use crate::{Columns, Environment, Sample, Skipped};

/// Velocity noise density at rest, m/s*sqrt(s).
const STANDING: f64 = 0.01;
/// Variance of the tilt that the first specific force shows, which may be accelerated, rad^2.
const FIRST_TILT: f64 = 0.01;
/// Variance of the turn during a gap, rad^2.
const GAP: f64 = 1.0;

/// The filter.
#[derive(Debug, Clone)]
pub struct Mekf {
    environment: Environment,
    values: Values,
    pub(super) q: Quaternion,
    pub(super) bias: Vector3<f64>,
    /// Horizontal, reference frame, m/s.
    pub(super) velocity: [f64; 2],
    pub(super) scale: Matrix3<f64>,
    pub(super) covariance: Covariance,
    pub(super) rest: Rest,
    pub(super) field: Field,
    /// Time turned since the last specific force, s; -1 where the next one shows the vertical.
    pub(super) since_force: f64,
}

impl Mekf {
    /// With the values of [`super::PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[f64]) -> Self {
        let mut filter = Self {
            environment: *environment,
            values: Values::new(values),
            q: Quaternion::IDENTITY,
            bias: Vector3::zeros(),
            velocity: [0.0; 2],
            scale: Matrix3::zeros(),
            covariance: Covariance::independent(&Errors::zeros()),
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
        self.covariance.turn(&matrix(self.q), reading, dt);
        self.q = self.q.turned(&(reading - self.bias - self.scale * reading), dt);
        for i in 0..3 {
            self.covariance.add(i, v.gyr_noise * v.gyr_noise * dt);
            self.covariance.add(BIAS + i, v.bias_walk * v.bias_walk * dt);
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
        self.covariance.accelerate(&force, dt);
        for at in [SPEED, SPEED + 1] {
            self.covariance.add(at, v.acc_noise * v.acc_noise * dt);
            if blind > 0.01 * dt {
                let sd = self.covariance.variance(at).max(0.0).sqrt();
                self.covariance
                    .add(at, (sd + self.environment.gravity() * blind).powi(2) - sd * sd);
            }
        }
        let mut x = Errors::zeros();
        for i in 0..2 {
            let r = 2.0 * v.speed * v.speed * v.speed_time / dt;
            self.covariance
                .measure(&mut x, SPEED + i, -self.velocity[i], r, Moves::All);
        }
        self.correct(&x);
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
            self.covariance
                .measure(&mut x, BIAS + i, value, v.rest_noise * v.rest_noise / dt, Moves::All);
        }
        for i in 0..2 {
            self.covariance.measure(
                &mut x,
                SPEED + i,
                -self.velocity[i],
                STANDING * STANDING / dt,
                Moves::All,
            );
        }
        self.correct(&x);
    }

    /// The tilt from one specific force.
    fn level(&mut self, f: &Vector3<f64>) {
        let innovation = Quaternion::between(&self.q.rotate(f), &self.environment.up()).log();
        let mut x = Errors::zeros();
        for i in 0..2 {
            self.covariance
                .measure(&mut x, i, innovation[i], FIRST_TILT, Moves::All);
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
        self.covariance.measure(&mut x, 2, up.z * innovation, r, Moves::Heading);
        self.correct(&x);
        Usage::Full
    }

    /// Nothing is known of a turn during a gap: the next specific force shows the vertical.
    fn after_gap(&mut self) {
        let v = self.values;
        if self.since_force >= 0.0 {
            for i in 0..3 {
                self.covariance.add(i, GAP);
            }
            self.since_force = -1.0;
        }
        self.velocity = [0.0; 2];
        for at in [SPEED, SPEED + 1] {
            self.covariance.forget(at, v.speed * v.speed);
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
        Some(self.covariance.attitude())
    }

    fn reset(&mut self, attitude: Quaternion) {
        let v = self.values;
        (self.q, self.bias, self.velocity, self.scale) = (attitude, Vector3::zeros(), [0.0; 2], Matrix3::zeros());
        (self.rest, self.field, self.since_force) = (Rest::UNKNOWN, Field::UNKNOWN, -1.0);
        self.covariance = Covariance::independent(&Errors::from_fn(|i, _| match i {
            0..BIAS => v.angle_start,
            BIAS..SPEED => v.bias_start,
            SPEED..SCALE => v.speed,
            _ => v.scale_start,
        }));
    }

    fn rows(&mut self, intake: &mut Intake, columns: &Columns<'_>, attitude: &mut [f64], skipped: &mut Skipped) {
        all_rows(self, intake, columns, attitude, skipped);
    }

    fn state(&self) -> Vec<f64> {
        self.numbers()
    }

    fn set_state(&mut self, state: &[f64]) -> bool {
        self.set_numbers(state)
    }
}
