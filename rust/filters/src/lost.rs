//! A filter whose attitude is lost finds it again.
//!
//! A second of bad rates leaves any attitude behind. What holds on to a vector by a small gain comes back slowly, and its bias
//! has learned from errors that no bias made. Whether an attitude is lost shows without any model of the filter: the mean
//! specific force in the reference frame points up, since the accelerations of a body that stays somewhere average out.
//!
//! 1. Over windows of [`WINDOW`] the specific force is averaged in the reference frame.
//! 2. A window speaks against the attitude if its mean is more than the filter's limit from up. The field speaks in the same
//!    way to filters that follow it, by its mean horizontal direction.
//! 3. [`WINDOWS`] in a row say that the attitude is lost: bad readings of a second reach into two of them at most. Their
//!    mean must say so, too: shaking leaves a part of a period in each window, in another direction each time. And that mean
//!    must be too short for an acceleration: one that turns it by an angle `a` makes it `g / cos a` long, a wrong attitude
//!    leaves it at `g`, and the middle decides.
//! 4. The attitude is turned by the least rotation that brings the mean force up, and its heading is that of the field where
//!    one is measured. A filter that follows the field slowly keeps a heading that the field does not surely deny
//!    ([`crate::met`](crate)). The filter goes back to what it had learned (bias, scale, their certainty) by the end of the last
//!    window but one that did not speak against it: the last one may hold the first bad readings.
//! 5. A turn that bad rates may have made, larger than the limit ([`crate::bridge`](crate)), leaves the attitude where it is and takes back what was learned.
//! 6. One window shows that attitude coarsely. The next [`WINDOWS`] together show it three times as well: the same turn is
//!    done by their mean, with what the filter had learned before it was lost.

use imufit_attitude::{Quaternion, Real};
use nalgebra::{Matrix3, SimdBool, Vector3};

use crate::filter::{Filter, Usage};
use crate::met::{self, Met};
use crate::{Environment, Sample};

/// Time over which readings are summed in the body frame, s: a turn of 2000 deg/s is 40 degrees.
const PART: f64 = 0.02;
/// Time of a window, s: walking and hand motion repeat themselves within it.
const WINDOW: f64 = 1.5;
/// Windows in a row.
const WINDOWS: f64 = 3.0;
/// Sine of the least angle between a field and the vertical that has a heading.
const LEAST_SINE: f64 = 0.035;

/// Limit of filters that state no covariance, rad: 6 degrees. Three windows in a row together are never off by more than
/// 0.08 with the true attitudes of BROAD, and what is left of less is small 20 s later.
pub(crate) const LOST: f64 = 0.1;
/// The same for the heading, rad: fields in buildings turn by less for so long, and a proportional gain follows them anyway.
pub(crate) const LOST_HEADING: f64 = 0.7;

/// What a filter is asked when it is watched.
pub(crate) trait Follows<T: Real>: Filter<T> + Clone {
    /// The angle between the mean specific force and up that its attitude does not allow, rad.
    fn limit(&self, time: f64, sound: &Self) -> T;
    /// The same for the heading of the field; `None` for a filter that does not follow the field.
    fn heading_limit(&self, sound: &Self) -> Option<T>;
    /// Least turn about up that the field shows and that is carried out, rad; `variance`: that of the heading by what is known of
    /// this field, rad^2. Nothing is too little for a filter that follows the field at once, or weighs it itself.
    fn least_heading(&self, variance: T) -> T {
        variance * T::splat(0.0)
    }
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
    /// The field times the time in that part, body frame, uT s, and that time, s.
    field: Vector3<f64>,
    field_time: f64,
    /// Specific force over gravity times time, reference frame, s.
    force: Vector3<T>,
    /// Direction of the field times time, reference frame, s.
    north: Vector3<T>,
    /// Time of the window, s.
    time: f64,
    /// Windows in a row that spoke against the attitude; negative: windows to come before a found one is refined.
    against: T,
    /// Mean forces of these over gravity, summed, reference frame.
    forces: Vector3<T>,
    /// Their directions of the field times time, summed, reference frame, s.
    norths: Vector3<T>,
}

/// Numbers of a window in a state.
const NUMBERS: usize = 22;

impl<T: Real> Window<T> {
    /// With `against` windows in a row before it, and what they say together.
    fn after(against: T, forces: Vector3<T>, norths: Vector3<T>) -> Self {
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
            forces,
            norths,
        }
    }

    fn first() -> Self {
        let zero = T::splat(0.0);
        Self::after(zero, Vector3::repeat(zero), Vector3::repeat(zero))
    }

    fn numbers(&self) -> [T; NUMBERS] {
        let (f, m, times) = (self.part, self.field, [self.part_time, self.field_time, self.time]);
        let common = [f.x, f.y, f.z, m.x, m.y, m.z, times[0], times[1], times[2]].map(T::splat);
        let mut own = [self.force, self.north, self.forces, self.norths]
            .into_iter()
            .flat_map(<[T; 3]>::from);
        std::array::from_fn(|k| match k {
            0..9 => common[k],
            9 => self.against,
            _ => own.next().unwrap_or(self.against),
        })
    }

    fn from_numbers(x: &[T]) -> Self {
        let common = |at: usize| x[at].extract(0);
        let three = |at: usize| Vector3::new(common(at), common(at + 1), common(at + 2));
        let own = |at: usize| Vector3::new(x[at], x[at + 1], x[at + 2]);
        Self {
            part: three(0),
            field: three(3),
            part_time: common(6),
            field_time: common(7),
            time: common(8),
            against: x[9],
            force: own(10),
            north: own(13),
            forces: own(16),
            norths: own(19),
        }
    }
}

/// What the mean force of a window, or of several, says of the attitude.
struct Tilt<T: Real> {
    /// The least rotation that brings it up.
    level: Quaternion<T>,
    /// Whether that is beyond the limit.
    beyond: T::SimdBool,
    /// Whether it is closer to the length of gravity than to that of an acceleration that would explain the tilt.
    as_long_as_gravity: T::SimdBool,
}

/// A filter that is watched.
#[derive(Debug, Clone)]
pub struct Watched<F, T = f64> {
    filter: F,
    environment: Environment,
    per_gravity: f64,
    window: Window<T>,
    /// Whether it is watched at all.
    on: bool,
    /// The filter at the end of the last two windows that did not speak against it, the older one first.
    sound: [F; 2],
    /// The field in windows that did not speak against it.
    met: Met<T>,
}

impl<T: Real, F: Follows<T>> Watched<F, T> {
    pub(crate) fn new(environment: &Environment, filter: F) -> Self {
        Self {
            on: true,
            sound: [filter.clone(), filter.clone()],
            filter,
            environment: *environment,
            per_gravity: 1.0 / environment.gravity(),
            window: Window::first(),
            met: Met::nothing(),
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
        self.window = Window::first();
        self.sound = [self.filter.clone(), self.filter.clone()];
        self.met = Met::nothing();
    }

    /// Goes on with what was learned before rates that may be bad: what they taught is none of the sensor's.
    #[cold]
    fn unlearn(&mut self) {
        let zero = T::splat(0.0);
        self.filter
            .find(self.filter.attitude(), &self.sound[0], zero.simd_le(zero));
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
        let length = window.field.norm();
        if length > 0.0 && length.is_finite() {
            let field = window.field * (window.field_time / length);
            window.north += q.rotate(&field.map(T::splat));
        }
        (window.part, window.part_time) = (Vector3::zeros(), 0.0);
        (window.field, window.field_time) = (Vector3::zeros(), 0.0);
        if window.time >= WINDOW {
            self.end_window();
        }
    }

    /// What a mean force over gravity says of the attitude.
    fn tilt(&self, force: &Vector3<T>, time: f64) -> Tilt<T> {
        let (one, two) = (T::splat(1.0), T::splat(2.0));
        let up = self.environment.up().map(T::splat);
        let vertical = force.dot(&up);
        let cosine = vertical / force.norm().simd_max(T::splat(f64::MIN_POSITIVE));
        Tilt {
            level: Quaternion::between(force, &up),
            beyond: cosine.simd_lt(self.filter.limit(time, &self.sound[0]).simd_cos()),
            as_long_as_gravity: (two * vertical).simd_le(cosine + one),
        }
    }

    /// The turn about up, rad, that brings the field seen by a level attitude to its place; whether it is beyond the limit.
    fn heading(&self, field: &Vector3<T>) -> (T, T::SimdBool) {
        let zero = T::splat(0.0);
        let up = self.environment.up().map(T::splat);
        let known = self.environment.field_north().map(T::splat);
        let across = field - up * field.dot(&up);
        let shown = across.norm().simd_gt(field.norm() * T::splat(LEAST_SINE));
        let angle = up.dot(&across.cross(&known)).simd_atan2(across.dot(&known));
        let sure = angle
            .simd_abs()
            .simd_gt(self.filter.least_heading(self.met.with(field, &up, WINDOW).1));
        let angle = angle.select(shown & sure, zero);
        let limit = self.filter.heading_limit(&self.sound[0]);
        (angle, angle.simd_abs().simd_gt(limit.unwrap_or(T::splat(f64::MAX))))
    }

    fn end_window(&mut self) {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        let window = self.window;
        let mean = window.force / T::splat(window.time);
        let tilt = self.tilt(&mean, window.time);
        let levelled = self.heading(&tilt.level.rotate(&window.north));
        let own = self.heading(&window.north);
        let refining = window.against.simd_lt(zero);
        let against = !refining & (tilt.beyond | (own.1 & levelled.1));
        let count = window.against + one;
        let (forces, norths) = (window.forces + mean, window.norths + window.north);
        let windows = count + T::splat(WINDOWS).select(refining, zero);
        let together = self.tilt(&(forces / windows), window.time);
        let tilted = together.beyond & together.as_long_as_gravity;
        // An acceleration tilts the mean force, and a steep field turns with it: a heading is off where it is so both ways.
        let turned = self.heading(&norths).1 & self.heading(&together.level.rotate(&norths)).1;
        let lost = against & count.simd_ge(T::splat(WINDOWS)) & (tilted | turned);
        let refined = refining & count.simd_ge(zero) & together.as_long_as_gravity;
        if (lost | refined).any() {
            let up = self.environment.up().map(T::splat);
            let level = tilt.level.select(tilted, Quaternion::default());
            let level = together.level.select(refined, level);
            let heading = levelled.0.select(tilted, own.0);
            let heading = self.heading(&together.level.rotate(&norths)).0.select(refined, heading);
            let found = (Quaternion::exp(&(up * heading)) * level * self.filter.attitude()).renormalised();
            self.filter.find(found, &self.sound[0], lost | refined);
        }
        let up = self.environment.up().map(T::splat);
        let shown = window.north.norm_squared().simd_gt(zero) & !(against | refining);
        self.met = self.met.with(&window.north, &up, WINDOW).0.select(shown, self.met);
        if !(against | refining).any() {
            self.sound.swap(0, 1);
            self.sound[1] = self.filter.clone();
        }
        let goes_on = (against & !lost) | (refining & count.simd_lt(zero));
        let kept = |x: T| x.select(goes_on, zero);
        let count = T::splat(-WINDOWS).select(lost, kept(count));
        self.window = Window::after(count, forces.map(kept), norths.map(kept));
    }
}

impl<T: Real, F: Follows<T>> Filter<T> for Watched<F, T> {
    #[inline(always)]
    fn step(&mut self, sample: &Sample) -> Usage {
        if sample.unsure_turn > LOST && self.on {
            self.unlearn();
        }
        let usage = self.filter.step(sample);
        if !self.on {
            return usage;
        }
        if let Some(m) = sample.m
            && m.dt > 0.0
        {
            self.window.field += m.value.0 * m.dt;
            self.window.field_time += m.dt;
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

    fn find_itself(&mut self, on: bool) {
        self.on = on;
    }

    fn reset(&mut self, attitude: Quaternion) {
        self.filter.reset(attitude);
        self.watch();
    }

    fn state(&self) -> Vec<T> {
        let mut state = self.filter.state();
        state.extend(self.sound.iter().flat_map(F::state));
        state.extend(self.window.numbers());
        state.extend(self.met.numbers());
        state
    }

    fn set_state(&mut self, state: &[T]) -> bool {
        let all = NUMBERS + met::NUMBERS;
        let each = state.len().saturating_sub(all) / 3;
        if state.len() != 3 * each + all || each == 0 {
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
            let (window, met) = own.split_at(NUMBERS);
            found.window = Window::from_numbers(window);
            found.met = Met::from_numbers(std::array::from_fn(|k| met[k]));
            *self = found;
        }
        taken
    }
}

#[cfg(test)]
mod tests {
    use imufit_attitude::{Frame, Lanes};

    use super::*;
    use crate::catalogue::find;
    use crate::mahony::Mahony;
    use crate::mekf::Mekf;
    use crate::{AngularRate, FluxDensity, Reading, SpecificForce};

    const DT: f64 = 0.01;

    fn surroundings() -> Environment {
        Environment::new(Frame::Enu, 9.81, None).unwrap()
    }

    /// What a body that sways about `q` reads at row `k`, accelerated by `push` (reference frame, m/s^2).
    fn reading(q: Quaternion, k: i32, push: Vector3<f64>) -> Sample {
        let t = DT * f64::from(k);
        let sway = Vector3::new((7.0 * t).sin(), (5.0 * t).cos(), (6.0 * t).sin());
        let (frame, dt) = (Frame::Enu, DT);
        Sample {
            omega: Some(Reading {
                value: AngularRate(Vector3::zeros()),
                dt,
            }),
            f: Some(Reading {
                value: SpecificForce(q.rotate_back(&(frame.up() * 9.81 + push + sway))),
                dt,
            }),
            m: Some(Reading {
                value: FluxDensity(q.rotate_back(&frame.default_field())),
                dt,
            }),
            ..Sample::default()
        }
    }

    fn settled<F: Follows<f64>>(filter: F) -> Watched<F> {
        let mut watched = Watched::new(&surroundings(), filter);
        watched.reset(Quaternion::IDENTITY);
        for k in 0..1000 {
            watched.step(&reading(Quaternion::IDENTITY, k, Vector3::zeros()));
        }
        watched
    }

    fn mekf_with(settings: &[(&str, f64)]) -> Mekf {
        let description = find("mekf").unwrap();
        let value = |p: &crate::parameter::Parameter| settings.iter().find(|(name, _)| *name == p.name).map(|x| x.1);
        let values: Vec<f64> = description
            .parameters
            .iter()
            .map(|p| value(p).unwrap_or(p.default))
            .collect();
        Mekf::new(&surroundings(), &values)
    }

    /// Seconds until the attitude of a body that was turned unseen is right within 2 degrees, for good.
    fn seconds_after<F: Follows<f64>>(turn: Vector3<f64>, filter: F) -> f64 {
        let (mut watched, q) = (settled(filter), Quaternion::exp(&turn));
        let mut last = 0;
        for k in 0..3000 {
            watched.step(&reading(q, k, Vector3::zeros()));
            if (q * watched.attitude().inverse()).log().norm() > 0.035 {
                last = k;
            }
        }
        DT * f64::from(last)
    }

    #[test]
    fn an_attitude_that_was_turned_by_two_radians_is_found_again() {
        for turn in [Vector3::x() * 2.0, Vector3::new(1.0, -1.0, 1.4), Vector3::z() * 2.0] {
            let mahony = seconds_after(turn, Mahony::new(&surroundings(), &[]));
            let mekf = seconds_after(turn, mekf_with(&[]));
            assert!(mahony < 18.0 && mekf < 18.0, "{turn:?}: {mahony} s, {mekf} s");
        }
    }

    /// Whether the attitude ever jumps while the body is accelerated by 3 m/s^2 for ten seconds.
    fn jumps<F: Follows<f64>>(filter: F) -> bool {
        let mut watched = settled(filter);
        let mut before = watched.attitude();
        (0..2000).any(|k| {
            let push = if k < 1000 { Vector3::x() * 3.0 } else { Vector3::zeros() };
            watched.step(&reading(Quaternion::IDENTITY, k, push));
            let step = (watched.attitude() * before.inverse()).log().norm();
            before = watched.attitude();
            step > 0.05
        })
    }

    #[test]
    fn an_acceleration_that_lasts_is_no_lost_attitude() {
        assert!(!jumps(mekf_with(&[("speed", 30.0)])));
        // A filter that holds on to the gyro: the mean force is longer than gravity all the time.
        assert!(!jumps(Mahony::new(&surroundings(), &[1.0, 1.0, 0.0, 0.01])));
    }

    #[test]
    fn settings_side_by_side_have_the_bits_of_each_alone_where_an_attitude_is_lost() {
        let gains = [0.05, 0.3, 0.5, 2.0];
        let values = |k_p: f64| [1.0, 1.0, 0.005, k_p, 0.035];
        let lanes: Vec<Lanes> = (0..5).map(|at| Lanes::from(gains.map(|k_p| values(k_p)[at]))).collect();
        let mut together = Watched::new(&surroundings(), Mahony::new(&surroundings(), &lanes));
        let mut alone = gains.map(|k_p| Watched::new(&surroundings(), Mahony::new(&surroundings(), &values(k_p))));
        let q = Quaternion::exp(&(Vector3::x() * 2.0));
        for k in 0..2000 {
            let sample = reading(if k < 500 { Quaternion::IDENTITY } else { q }, k, Vector3::zeros());
            together.step(&sample);
            for (lane, alone) in alone.iter_mut().enumerate() {
                alone.step(&sample);
                let pairs = alone
                    .attitude()
                    .to_array()
                    .into_iter()
                    .zip(together.attitude().to_array());
                for (one, lanes) in pairs {
                    assert_eq!(
                        one.to_bits(),
                        nalgebra::SimdValue::extract(&lanes, lane).to_bits(),
                        "row {k}"
                    );
                }
            }
        }
    }

    #[test]
    fn a_state_goes_on_where_it_was_written_down() {
        let (mut whole, q) = (settled(mekf_with(&[])), Quaternion::exp(&(Vector3::x() * 2.0)));
        for k in 0..400 {
            whole.step(&reading(q, k, Vector3::zeros()));
        }
        let mut other = Watched::new(&surroundings(), mekf_with(&[]));
        assert!(other.set_state(&whole.state()));
        for k in 400..1200 {
            whole.step(&reading(q, k, Vector3::zeros()));
            other.step(&reading(q, k, Vector3::zeros()));
        }
        assert_eq!(whole.state(), other.state());
        assert!(!other.set_state(&whole.state()[1..]) && !other.set_state(&[f64::NAN; 17]));
        assert_eq!(whole.state(), other.state());
    }
}
