//! State and step: predictions and measurements in the order in which a row brings them.

use std::f64::consts::{PI, SQRT_2};

use imufit_attitude::matrix::matrix_from_quaternion;
use imufit_attitude::{Quaternion, Real};
use nalgebra::{Matrix3, SimdBool, Vector3};

use super::covariance::{BIAS, Covariance, Errors, Moves, SCALE, SPEED};
use super::settings::Values;
use crate::field::Field;
use crate::filter::{Filter, Usage};
use crate::lost::Follows;
use crate::rest::{Limits, Rest};
use crate::usual::{LONGEST, Usual};
use crate::{Environment, Sample};

/// Velocity noise density at rest, m/s*sqrt(s).
const STANDING: f64 = 0.01;
/// Variance of the tilt that the first specific force shows, which may be accelerated, rad^2.
const FIRST_TILT: f64 = 0.01;
/// Variance of the turn during a gap, rad^2.
const GAP: f64 = 1.0;
/// Largest velocity in parts of `speed`: 7.5 m/s by default. Fast hand motion (BROAD, trial 16) reaches 12; more comes of bad
/// readings, and nothing is learned from it.
const FASTEST: f64 = 15.0;
/// Mean square of the change of the specific force before any reading, (m/s^2)^2: a change of ten times gravity is doubted then.
const FORCE_BEFORE: f64 = 100.0;
/// Square of the least change of the specific force that is doubted, (m/s^2)^2.
const LEAST_FORCE: f64 = 1.0;
/// Standard deviations beyond which nothing happens: of the mean force's direction in three windows in a row, of speeds.
const SURE: f64 = 4.0;
/// Least angle that is lost, rad: what a wrong bias of the accelerometer (0.5 m/s^2) makes.
const LEAST_LOST: f64 = 0.05;
/// The same for the heading, rad: with 0.15 the field of one recording of BROAD (trial 21) is followed where the gyro is better.
const LEAST_LOST_HEADING: f64 = 0.25;

/// The filter.
#[derive(Debug, Clone)]
pub struct Mekf<T = f64> {
    environment: Environment,
    values: Values<T>,
    pub(super) q: Quaternion<T>,
    pub(super) bias: Vector3<T>,
    /// Horizontal, reference frame, m/s.
    pub(super) velocity: [T; 2],
    pub(super) scale: Matrix3<T>,
    pub(super) covariance: Covariance<T>,
    pub(super) rest: Rest<T>,
    pub(super) field: Field<T>,
    /// The last specific force that is not doubted, body frame, m/s^2, and what it changes by, (m/s^2)^2.
    pub(super) force: Vector3<f64>,
    pub(super) usual: Usual,
    /// Variance of the velocity by changes of the last seconds that those do not allow, (m/s)^2.
    pub(super) doubted: f64,
    /// Time turned since the last specific force, s; -1 where the next one shows the vertical.
    pub(super) since_force: f64,
}

/// Where there is nothing to tell apart.
fn always<T: Real>() -> T::SimdBool {
    T::splat(0.0).simd_le(T::splat(0.0))
}

impl<T: Real> Mekf<T> {
    /// With the values of [`super::PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[T]) -> Self {
        let zero = T::splat(0.0);
        let mut filter = Self {
            environment: *environment,
            values: Values::new(values),
            q: Quaternion::default(),
            bias: Vector3::repeat(zero),
            velocity: [zero; 2],
            scale: Matrix3::repeat(zero),
            covariance: Covariance::independent(&Errors::repeat(zero)),
            rest: Rest::unknown(),
            field: Field::unknown(),
            force: Vector3::zeros(),
            usual: Usual(FORCE_BEFORE),
            doubted: 0.0,
            since_force: 0.0,
        };
        filter.reset(Quaternion::IDENTITY);
        filter
    }

    /// Turns by a reading and lets the uncertainty grow.
    fn turn(&mut self, reading: &Vector3<f64>, dt: f64) {
        let (v, dt, reading) = (self.values, T::splat(dt), reading.map(T::splat));
        self.covariance.turn(&matrix_from_quaternion(self.q), &reading, dt);
        let rate = reading - self.bias - self.scale * reading;
        self.q = self.q.turned(&rate, dt);
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
        let doubted = self.doubted_speed(f, dt);
        let f = f.map(T::splat);
        if lost {
            self.level(&f);
        }
        let (time, force) = (T::splat(dt), self.q.rotate(&f));
        let fast = [self.velocity[0] + force.x * time, self.velocity[1] + force.y * time];
        let longest = v.speed * T::splat(FASTEST);
        let believed = (fast[0] * fast[0] + fast[1] * fast[1]).simd_le(longest * longest);
        self.velocity = fast.map(|x| x.select(believed, T::splat(0.0)));
        self.covariance.accelerate(&force, time);
        if !believed.all() {
            let mut standing = self.covariance.clone();
            standing.forget_velocity(v.speed * v.speed);
            standing.take(&self.covariance, believed);
            self.covariance = standing;
        }
        for at in [SPEED, SPEED + 1] {
            self.covariance.add(at, v.acc_noise * v.acc_noise * time);
            self.covariance.add(at, doubted);
            if blind > 0.01 * dt {
                let sd = self.covariance.variance(at).simd_max(T::splat(0.0)).simd_sqrt();
                let more = sd + T::splat(self.environment.gravity() * blind);
                self.covariance.add(at, more * more - sd * sd);
            }
        }
        let r = T::splat(2.0) * v.speed * v.speed * v.speed_time / time;
        self.stop(Errors::repeat(T::splat(0.0)), r, always::<T>());
    }

    /// Variance, (m/s)^2, that a change of the specific force gives the velocity where those before do not allow it. Speeds up to
    /// [`SURE`] times those that occur hold a blow; what bad readings make is beyond.
    fn doubted_speed(&mut self, f: &Vector3<f64>, dt: f64) -> T {
        let square = (f - self.force).norm_squared().min(f64::MAX);
        if !self.usual.doubts(square, LEAST_FORCE) {
            self.force = *f;
            self.doubted *= (1.0 - dt * (1.0 / LONGEST)).max(0.0);
            return T::splat(0.0);
        }
        self.usual.get_used(dt);
        let (v, variance) = (self.values, square * (dt * dt));
        self.doubted = (self.doubted + variance).min(f64::MAX);
        let longest = v.speed * T::splat(FASTEST);
        let most = v.speed * T::splat(SURE);
        let beyond = T::splat(self.doubted) - most * most;
        beyond
            .simd_clamp(T::splat(0.0), T::splat(variance))
            .simd_min(longest * longest)
    }

    /// The velocity is zero, variance `r`; `x`: errors found before.
    fn stop(&mut self, mut x: Errors<T>, r: T, shown: T::SimdBool) {
        for i in 0..2 {
            let value = -self.velocity[i];
            self.covariance.measure(&mut x, SPEED + i, value, r, Moves::All, shown);
        }
        self.correct(&x, shown);
    }

    /// Moves the errors found into the estimates.
    fn correct(&mut self, x: &Errors<T>, shown: T::SimdBool) {
        let turned = Quaternion::exp(&Vector3::new(x[0], x[1], x[2])) * self.q;
        self.q = turned.select(shown, self.q);
        let moved = |old: T, step: T| (old + step).select(shown, old);
        for i in 0..3 {
            self.bias[i] = moved(self.bias[i], x[BIAS + i]);
            for j in 0..3 {
                self.scale[(i, j)] = moved(self.scale[(i, j)], x[SCALE + 3 * i + j]);
            }
        }
        for i in 0..2 {
            self.velocity[i] = moved(self.velocity[i], x[SPEED + i]);
        }
    }

    /// At rest the rate is the bias and the velocity zero.
    fn stand(&mut self, reading: &Vector3<f64>, dt: f64, rests: T::SimdBool) {
        let (v, dt) = (self.values, T::splat(dt));
        let mut x = Errors::repeat(T::splat(0.0));
        for i in 0..3 {
            let value = T::splat(reading[i]) - self.bias[i];
            let r = v.rest_noise * v.rest_noise / dt;
            self.covariance.measure(&mut x, BIAS + i, value, r, Moves::All, rests);
        }
        self.stop(x, T::splat(STANDING * STANDING) / dt, rests);
    }

    /// The tilt from one specific force.
    fn level(&mut self, f: &Vector3<T>) {
        let up = self.environment.up().map(T::splat);
        let innovation = Quaternion::between(&self.q.rotate(f), &up).log();
        // An acceleration across gravity that turns the force by an angle makes it longer by half of its square.
        let longer = f.norm() * T::splat(1.0 / self.environment.gravity()) - T::splat(1.0);
        let r = T::splat(FIRST_TILT) + T::splat(2.0) * longer.simd_abs();
        let mut x = Errors::repeat(T::splat(0.0));
        for i in 0..2 {
            self.covariance
                .measure(&mut x, i, innovation[i], r, Moves::All, always::<T>());
        }
        self.correct(&x, always::<T>());
    }

    /// The heading from the field.
    fn head(&mut self, m: &Vector3<f64>, dt: f64) -> Usage {
        let (v, zero) = (self.values, T::splat(0.0));
        let up = self.environment.up().map(T::splat);
        let seen = self.q.rotate(&m.map(T::splat));
        let vertical = seen.dot(&up);
        let across = seen - up * vertical;
        let length = across.norm();
        let sine = v.min_angle.simd_min(T::splat(1.5)).simd_sin();
        let shown = length.simd_gt(zero) & length.simd_ge(sine * T::splat(m.norm()));
        let usage = if shown.all() { Usage::Full } else { Usage::NoHeading };
        if dt <= 0.0 || shown.none() {
            return usage;
        }
        let mut field = self.field;
        let departure = field.update(length, vertical, dt, v.mag_memory, v.mag_noise);
        self.field = field.select(shown, self.field);
        let north = self.environment.field_north().map(T::splat);
        let innovation = up.dot(&across.cross(&north)).simd_atan2(across.dot(&north));
        let variance = v.mag_noise * v.mag_noise + v.mag_departure * v.mag_departure * departure;
        let r = variance * (T::splat(2.0) * v.mag_time / T::splat(dt)).simd_max(T::splat(1.0));
        let mut x = Errors::repeat(zero);
        self.covariance
            .measure(&mut x, 2, up.z * innovation, r, Moves::Heading, shown);
        self.correct(&x, shown);
        usage
    }

    /// A turn of that variance, rad^2, which no rate shows. Where one specific force shows the vertical better, the next one does;
    /// the velocity was then integrated in a wrong direction for as long as a speed lasts.
    fn turn_unseen(&mut self, variance: f64) {
        for i in 0..3 {
            self.covariance.add(i, T::splat(variance));
        }
        if variance > FIRST_TILT {
            let fallen = self.values.speed_time * T::splat(self.environment.gravity());
            for at in [SPEED, SPEED + 1] {
                self.covariance.add(at, fallen * fallen * T::splat(variance));
            }
            self.since_force = -1.0;
        }
    }

    /// Nothing is known of turn and velocity after a gap.
    fn after_gap(&mut self) {
        let v = self.values;
        if self.since_force >= 0.0 {
            self.turn_unseen(GAP);
        }
        self.velocity = [T::splat(0.0); 2];
        self.covariance.forget_velocity(v.speed * v.speed);
        (self.rest, self.usual) = (Rest::unknown(), Usual(FORCE_BEFORE));
    }
}

impl<T: Real> Follows<T> for Mekf<T> {
    fn limit(&self, time: f64, sound: &Self) -> T {
        let v = self.values;
        let tilt = sound.covariance.variance(0).simd_max(sound.covariance.variance(1));
        let moved = v.speed * T::splat(SQRT_2 / (self.environment.gravity() * time));
        (T::splat(SURE) * (tilt + moved * moved).simd_sqrt()).simd_clamp(T::splat(LEAST_LOST), T::splat(PI))
    }

    fn heading_limit(&self, sound: &Self) -> Option<T> {
        let v = self.values;
        let field = v.mag_noise * v.mag_noise + v.mag_departure * v.mag_departure * self.field.departure;
        let sd = (sound.covariance.variance(2) + field).simd_sqrt();
        Some((T::splat(SURE) * sd).simd_clamp(T::splat(LEAST_LOST_HEADING), T::splat(PI)))
    }

    fn find(&mut self, attitude: Quaternion<T>, sound: &Self, lost: T::SimdBool) {
        let (zero, v) = (T::splat(0.0), self.values);
        let pick = |found: T, own: T| found.select(lost, own);
        self.q = attitude.select(lost, self.q);
        self.bias = sound.bias.zip_map(&self.bias, pick);
        self.scale = sound.scale.zip_map(&self.scale, pick);
        self.velocity = self.velocity.map(|x| pick(zero, x));
        self.field = sound.field.select(lost, self.field);
        let mut covariance = sound.covariance.clone();
        for at in 0..BIAS {
            covariance.forget(at, v.angle_start * v.angle_start);
        }
        covariance.forget_velocity(v.speed * v.speed);
        self.covariance.take(&covariance, lost);
    }
}

impl<T: Real> Filter<T> for Mekf<T> {
    fn step(&mut self, sample: &Sample) -> Usage {
        if let Some(omega) = sample.omega {
            self.turn(&omega.value.0, omega.dt);
            if sample.unsure_turn > 0.0 {
                self.turn_unseen(sample.unsure_turn * sample.unsure_turn);
            }
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
            if let Some(omega) = sample.omega.filter(|omega| omega.dt > 0.0) {
                let v = self.values;
                let limits = Limits {
                    gyr: v.rest_gyr,
                    acc: v.rest_acc,
                    bias: T::splat(3.0) * v.bias_start,
                };
                let rests = self.rest.update(&omega.value.0, &f.value.0, omega.dt, &limits);
                if rests.any() {
                    self.stand(&omega.value.0, omega.dt, rests);
                }
            }
        }
        match sample.m {
            Some(m) => self.head(&m.value.0, m.dt),
            None => Usage::Full,
        }
    }

    fn attitude(&self) -> Quaternion<T> {
        self.q
    }

    fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        Some(self.covariance.attitude())
    }

    fn reset(&mut self, attitude: Quaternion) {
        let (v, zero) = (self.values, T::splat(0.0));
        (self.q, self.bias) = (attitude.splat(), Vector3::repeat(zero));
        (self.velocity, self.scale) = ([zero; 2], Matrix3::repeat(zero));
        (self.rest, self.field, self.since_force) = (Rest::unknown(), Field::unknown(), -1.0);
        (self.force, self.usual, self.doubted) = (Vector3::zeros(), Usual(FORCE_BEFORE), 0.0);
        self.covariance = Covariance::independent(&Errors::from_fn(|i, _| match i {
            0..BIAS => v.angle_start,
            BIAS..SPEED => v.bias_start,
            SPEED..SCALE => v.speed,
            _ => v.scale_start,
        }));
    }

    fn state(&self) -> Vec<T> {
        self.numbers()
    }

    fn set_state(&mut self, state: &[T]) -> bool {
        self.set_numbers(state)
    }
}
