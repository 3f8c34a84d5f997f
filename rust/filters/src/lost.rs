//! A filter whose attitude is lost finds it again.
//!
//! A second of bad rates leaves any attitude behind. What holds on to a vector by a small gain comes back slowly, and its bias
//! has learned from errors that no bias made. Whether an attitude is lost shows without any model of the filter: the mean
//! specific force in the reference frame points up, since the accelerations of a body that stays somewhere average out.
//!
//! 1. Over windows of [`WINDOW`] the specific force is averaged in the reference frame.
//! 2. A window speaks against the attitude if its mean is more than the filter's limit from up. The field speaks in the same
//!    way to filters that follow it, by its mean horizontal direction.
//! 3. [`WINDOWS`] in a row say that the attitude is lost: bad readings of a second reach into two of them at most. Together
//!    they must be too short for an acceleration: one that turns the mean by an angle `a` makes it `g / cos a` long, a wrong
//!    attitude leaves it at `g`, and the middle decides.
//! 4. The attitude is turned by the least rotation that brings the mean force up, and its heading is that of the field where
//!    one is measured. What the filter had learned (bias, scale, their certainty) is that of the end of the last window but
//!    one that did not speak against it: the last one may hold the first bad readings.

use imufit_attitude::{Quaternion, Real};
use nalgebra::{Matrix3, SimdBool, Vector3};

use crate::filter::{Filter, Usage};
use crate::intake::{Intake, all_rows};
use crate::{Columns, Environment, Sample, Skipped};

/// Time over which readings are summed in the body frame, s: a turn of 2000 deg/s is 40 degrees.
const PART: f64 = 0.02;
/// Time of a window, s: walking and hand motion repeat themselves within it.
const WINDOW: f64 = 1.5;
/// Windows in a row.
const WINDOWS: f64 = 3.0;
/// Sine of the least angle between a field and the vertical that has a heading.
const LEAST_SINE: f64 = 0.035;

/// Limit of filters that state no covariance, rad: 14 degrees. A mean force is 3 % longer than gravity where an acceleration
/// turns it as far, which a calibrated accelerometer shows, and what is left of less is small 20 s later.
pub(crate) const LOST: f64 = 0.15;
/// The same for the heading, rad: fields in buildings turn by half of it, and no proportional gain is slow before a right angle.
pub(crate) const LOST_HEADING: f64 = 1.0;

/// What a filter is asked when it is watched.
pub(crate) trait Follows<T: Real>: Filter<T> + Clone {
    /// The angle between the mean specific force and up that its attitude does not allow, rad.
    fn limit(&self, time: f64) -> T;
    /// The same for the heading of the field; `None` for a filter that does not follow the field.
    fn heading_limit(&self) -> Option<T>;
    /// Goes on at `attitude`, with what `sound` had learned, in the lanes where the condition holds.
    fn find(&mut self, attitude: Quaternion<T>, sound: &Self, lost: T::SimdBool);
}

/// Sums of the window, and what windows before it said.
#[derive(Debug, Clone, Copy)]
struct Window<T> {
    /// Specific force times time of the part that runs, body frame, m/s.
    part: Vector3<f64>,
    /// Time of that part, s.
    part_time: f64,
    /// Direction of the field times the time, body frame, and that time, s.
    field: Vector3<f64>,
    field_time: f64,
    /// Specific force over gravity times time, reference frame, s.
    force: Vector3<T>,
    /// Horizontal direction of the field times time, reference frame.
    north: Vector3<T>,
    /// Time of the window, s.
    time: f64,
    /// Windows in a row that spoke against the attitude.
    against: T,
    /// How much longer than the middle between gravity and an acceleration that would explain the angle, summed over these.
    longer: T,
}

/// Numbers of a window in a state.
const NUMBERS: usize = 17;

impl<T: Real> Window<T> {
    fn empty(against: T, longer: T) -> Self {
        let zero = T::splat(0.0);
        Self {
            part: Vector3::zeros(),
            part_time: 0.0,
            field: Vector3::zeros(),
            field_time: 0.0,
            force: Vector3::repeat(zero),
            north: Vector3::repeat(zero),
            time: 0.0,
            against,
            longer,
        }
    }

    fn numbers(&self) -> [T; NUMBERS] {
        let (f, m, times) = (self.part, self.field, [self.part_time, self.field_time, self.time]);
        let common = [f.x, f.y, f.z, m.x, m.y, m.z, times[0], times[1], times[2]].map(T::splat);
        let (a, b) = (self.force, self.north);
        let own = [a.x, a.y, a.z, b.x, b.y, b.z, self.against, self.longer];
        std::array::from_fn(|k| if k < 9 { common[k] } else { own[k - 9] })
    }

    fn from_numbers(x: &[T]) -> Self {
        let common = |at: usize| x[at].extract(0);
        let three = |at: usize| Vector3::new(common(at), common(at + 1), common(at + 2));
        Self {
            part: three(0),
            field: three(3),
            part_time: common(6),
            field_time: common(7),
            time: common(8),
            force: Vector3::new(x[9], x[10], x[11]),
            north: Vector3::new(x[12], x[13], x[14]),
            against: x[15],
            longer: x[16],
        }
    }
}

/// A filter that is watched.
#[derive(Debug, Clone)]
pub struct Watched<F, T = f64> {
    filter: F,
    environment: Environment,
    per_gravity: f64,
    window: Window<T>,
    /// The filter at the end of the last two windows that did not speak against it, the older one first.
    sound: [F; 2],
}

impl<T: Real, F: Follows<T>> Watched<F, T> {
    pub(crate) fn new(environment: &Environment, filter: F) -> Self {
        Self {
            sound: [filter.clone(), filter.clone()],
            filter,
            environment: *environment,
            per_gravity: 1.0 / environment.gravity(),
            window: Window::empty(T::splat(0.0), T::splat(0.0)),
        }
    }

    /// The filter itself.
    pub(crate) fn filter(&self) -> &F {
        &self.filter
    }

    /// Takes over a state of the filter itself, and watches from there on.
    pub(crate) fn begin(&mut self, state: &[T]) -> bool {
        let taken = self.filter.set_state(state);
        self.watch();
        taken
    }

    /// Watches from here on.
    fn watch(&mut self) {
        self.window = Window::empty(T::splat(0.0), T::splat(0.0));
        self.sound = [self.filter.clone(), self.filter.clone()];
    }

    /// Ends a part: its mean force and field go into the window.
    #[inline(never)]
    fn end_part(&mut self) {
        let (window, q) = (&mut self.window, self.filter.attitude());
        let force = window.part * self.per_gravity;
        if force.norm_squared().is_finite() {
            window.force += q.rotate(&force.map(T::splat));
            window.time += window.part_time;
        }
        if window.field_time > 0.0 && window.field.norm_squared().is_finite() {
            let up = self.environment.up().map(T::splat);
            let seen = q.rotate(&window.field.map(T::splat));
            let across = seen - up * seen.dot(&up);
            let length = across.norm();
            let shown = length.simd_gt(T::splat(LEAST_SINE * window.field.norm()));
            let direction = across * (T::splat(window.field_time) / length);
            window.north += direction.map(|x| x.select(shown, T::splat(0.0)));
        }
        (window.part, window.part_time) = (Vector3::zeros(), 0.0);
        (window.field, window.field_time) = (Vector3::zeros(), 0.0);
        if window.time >= WINDOW {
            self.end_window();
        }
    }

    fn end_window(&mut self) {
        let (zero, one, two) = (T::splat(0.0), T::splat(1.0), T::splat(2.0));
        let window = self.window;
        let up = self.environment.up().map(T::splat);
        let mean = window.force / T::splat(window.time);
        let (length, vertical) = (mean.norm(), mean.dot(&up));
        let cosine = vertical / length.simd_max(T::splat(f64::MIN_POSITIVE));
        let beyond = cosine.simd_lt(self.filter.limit(window.time).simd_cos());
        let longer = two * vertical - cosine - one;
        let mut against = beyond;
        let level = Quaternion::between(&mean, &up);
        let north = self.environment.field_north().map(T::splat);
        let field = level.rotate(&window.north);
        let heading = up.dot(&field.cross(&north)).simd_atan2(field.dot(&north));
        let measured = field.norm_squared().simd_gt(zero);
        if let Some(limit) = self.filter.heading_limit() {
            against = against | (heading.simd_abs().simd_gt(limit) & measured);
        }
        let count = (window.against + one).select(against, zero);
        // A wrong heading leaves the force as long as it is.
        let longer = (window.longer + longer.select(beyond, zero)).select(against, zero);
        let lost = count.simd_ge(T::splat(WINDOWS)) & longer.simd_le(zero);
        if lost.any() {
            let turned = Quaternion::exp(&(up * heading.select(measured, zero)));
            let found = (turned * level * self.filter.attitude()).renormalised();
            self.filter.find(found, &self.sound[0], lost);
        }
        if !against.any() {
            self.sound.swap(0, 1);
            self.sound[1] = self.filter.clone();
        }
        self.window = Window::empty(zero.select(lost, count), zero.select(lost, longer));
    }
}

impl<T: Real, F: Follows<T>> Filter<T> for Watched<F, T> {
    #[inline(always)]
    fn step(&mut self, sample: &Sample) -> Usage {
        let usage = self.filter.step(sample);
        if let Some(m) = sample.m
            && m.dt > 0.0
        {
            let length = m.value.0.norm();
            if length > 0.0 {
                self.window.field += m.value.0 * (m.dt / length);
                self.window.field_time += m.dt;
            }
        }
        if let Some(f) = sample.f
            && f.dt > 0.0
        {
            self.window.part += f.value.0 * f.dt;
            self.window.part_time += f.dt;
            if self.window.part_time >= PART {
                self.end_part();
            }
        }
        usage
    }

    #[inline(always)]
    fn attitude(&self) -> Quaternion<T> {
        self.filter.attitude()
    }

    fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        self.filter.attitude_covariance()
    }

    fn reset(&mut self, attitude: Quaternion) {
        self.filter.reset(attitude);
        self.watch();
    }

    fn rows(&mut self, intake: &mut Intake, columns: &Columns<'_>, attitude: &mut [T], skipped: &mut Skipped) {
        all_rows(self, intake, columns, attitude, skipped);
    }

    fn state(&self) -> Vec<T> {
        let mut state = self.filter.state();
        state.extend(self.sound.iter().flat_map(F::state));
        state.extend(self.window.numbers());
        state
    }

    fn set_state(&mut self, state: &[T]) -> bool {
        let each = state.len().saturating_sub(NUMBERS) / 3;
        if state.len() != 3 * each + NUMBERS || each == 0 {
            return false;
        }
        let (filters, own) = state.split_at(3 * each);
        let finite = |x: &T| x.simd_abs().simd_le(T::splat(f64::MAX)).all();
        let mut found = self.clone();
        let taken = own.iter().all(finite)
            && [&mut found.filter]
                .into_iter()
                .chain(&mut found.sound)
                .zip(filters.chunks(each))
                .all(|(filter, state)| filter.set_state(state));
        if taken {
            found.window = Window::from_numbers(own);
            *self = found;
        }
        taken
    }
}
