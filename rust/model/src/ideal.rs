//! Ideal readings: what a perfect sensor would have read, and how fast that changes.
//!
//! f = R^T (a - g), omega from the reference attitude, m = R^T m_ref with R body to reference.

use nalgebra::{UnitQuaternion, Vector3};

use crate::facts::LogFacts;
use crate::kinematics_memory::{Differentiation, KinematicsRows};
use crate::reference::{Kinematics, Widths};
use crate::reference_clock::ReferenceClock;
use crate::rig::{Play, RigError, Slack};
use crate::sensor::Sensor;
use crate::smoothing::Smoothing;
use crate::triple::Triple;
use crate::window::Window;

/// What effects of the reference change before the ideal readings are taken.
#[derive(Clone, Copy, Debug)]
pub struct ReferenceChange {
    /// The reference is late by this much where the log begins, s: it is read at t + delay.
    pub delay: f64,
    /// ... and by this much more per second.
    pub skew: f64,
    /// The reference was smoothed: it has lost this much, s^2, times the second derivative of the motion.
    pub smoothing: f64,
    /// Turns vectors of the reference's body frame into the sensor's: x_sensor = alignment^-1 x.
    pub alignment: UnitQuaternion<f64>,
    /// Turns vectors of the recorded reference frame into the true one (a table that is not level).
    pub tilt: UnitQuaternion<f64>,
    /// By how much the field differs from that of the facts, uT.
    pub field: Vector3<f64>,
    /// By how much a one-axis rig misses its commanded angle.
    pub rig: RigError,
    /// How late and how sluggish each sensor is.
    pub sensors: [SensorTime; 3],
}

/// What a sensor shows of the past: the quantity of `delay` ago, smoothed by a lag of first order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorTime {
    /// s.
    pub delay: f64,
    /// Time constant, s.
    pub lag: f64,
}

impl Default for ReferenceChange {
    fn default() -> Self {
        Self {
            delay: 0.0,
            skew: 0.0,
            smoothing: 0.0,
            alignment: UnitQuaternion::identity(),
            tilt: UnitQuaternion::identity(),
            field: Vector3::zeros(),
            rig: RigError::default(),
            sensors: Default::default(),
        }
    }
}

impl ReferenceChange {
    /// When the reference is read.
    pub fn clock(&self, facts: &LogFacts) -> ReferenceClock {
        ReferenceClock {
            delay: self.delay,
            skew: self.skew,
            start: facts.t_start,
        }
    }

    /// Both changes, one after the other.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            delay: self.delay + other.delay,
            skew: self.skew + other.skew,
            smoothing: self.smoothing + other.smoothing,
            alignment: self.alignment * other.alignment,
            tilt: self.tilt * other.tilt,
            field: self.field + other.field,
            rig: self.rig.and(other.rig),
            sensors: std::array::from_fn(|s| SensorTime {
                delay: self.sensors[s].delay + other.sensors[s].delay,
                lag: self.sensors[s].lag + other.sensors[s].lag,
            }),
        }
    }
}

/// Ideal readings of the core rows of a window, with their time derivatives. NaN where the reference does not tell.
#[derive(Clone, Debug, Default)]
pub struct Ideal {
    /// Angular rate, rad/s.
    pub omega: Triple,
    /// Angular acceleration, rad/s^2.
    pub alpha: Triple,
    /// Its time derivative in the body frame, rad/s^3.
    pub alpha_rate: Triple,
    /// Fourth derivative of the position in the body frame, m/s^4.
    pub snap: Triple,
    /// Specific force, m/s^2.
    pub f: Triple,
    /// Its time derivative in the body frame.
    pub f_rate: Triple,
    /// Magnetic field in the true reference frame, uT.
    pub field: Vector3<f64>,
    /// Magnetic flux density, uT.
    pub m: Triple,
    /// Its time derivative in the body frame.
    pub m_rate: Triple,
    /// What a reading follows beyond `omega`, see [`Kinematics::omega_detail`].
    pub omega_detail: Triple,
    /// What a reading follows beyond `f`.
    pub f_detail: Triple,
    /// Attitude of the sensor, body to reference frame.
    pub attitude: Vec<UnitQuaternion<f64>>,
    /// What the one-axis rig was told to do; empty without a rig.
    pub command: Vec<Command>,
    /// Axis of the rig in the sensor's frame; zero without a rig.
    pub rig_axis: Vector3<f64>,
    /// For a sluggish sensor how much further behind its reading would fall per second of its lag; empty otherwise.
    pub settling: Triple,
}

/// Nodes and weights of Gauss and Laguerre's quadrature: a lag shows the integral of exp(-u) x(t - lag u) over u > 0. Of a motion whose
/// phase turns by one radian in a lag six nodes miss 3e-4, four would miss 5e-3.
const PAST: [(f64, f64); 6] = [
    (0.222_846_604_179_260_7, 0.458_964_673_949_964_76),
    (1.188_932_101_672_622_6, 0.417_000_830_772_12),
    (2.992_736_326_059_314, 0.113_373_382_074_044_88),
    (5.775_143_569_104_51, 0.010_399_197_453_149_087),
    (9.837_467_418_382_59, 2.610_172_028_149_326_5e-4),
    (15.982_873_980_601_703, 8.985_479_064_296_213e-7),
];

/// What a one-axis rig was told to do in a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Command {
    /// Time on the clock of the reference, s.
    pub t: f64,
    /// Commanded angle, rad, in (-pi, pi].
    pub angle: f64,
    /// Its rate, rad/s.
    pub rate: f64,
}

/// What motion is asked about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    /// All that readings are compared with.
    Whole,
    /// As much of it as has second derivatives with little noise.
    Smooth,
}

/// Kinematics of the core rows of a window, worked out once for all passes over a log.
fn kinematics(window: &Window, facts: &LogFacts, clock: ReferenceClock, motion: Motion) -> KinematicsRows {
    let widths = |value: Smoothing, columns: Smoothing, bends: Smoothing| match motion {
        Motion::Whole => Widths { value, columns, bends },
        Motion::Smooth => Widths::alike(bends),
    };
    let of_position = |value: Smoothing| {
        let columns = facts.position_columns.unwrap_or(value);
        widths(value, columns, facts.position_bends.unwrap_or(columns))
    };
    let how = Differentiation {
        attitude: widths(facts.attitude_smoothing, facts.attitude_columns, facts.attitude_bends),
        position: facts.position_smoothing.map(of_position),
        clock,
    };
    facts.kinematics.of(window, facts.n, how, Some(facts.reference_dt))
}

impl Ideal {
    /// Ideal readings of the window's core rows.
    pub fn new(window: &Window, facts: &LogFacts, change: &ReferenceChange) -> Self {
        Self::by_clock(window, facts, change, change.clock(facts), Motion::Whole)
    }

    /// The same with the reference read by another clock.
    fn by_clock(
        window: &Window,
        facts: &LogFacts,
        change: &ReferenceChange,
        clock: ReferenceClock,
        motion: Motion,
    ) -> Self {
        let rows = kinematics(window, facts, clock, motion);
        let mut ideal = Self {
            field: facts.field + change.field,
            ..Self::default()
        };
        let mut rig = facts.rig.as_ref().map(|rig| {
            ideal.rig_axis = change.alignment.inverse_transform_vector(&rig.axis);
            let first = clock.at(window.t.get(window.begin).copied().unwrap_or_default());
            (rig, Play::new(rig, change.rig.width, first))
        });
        for (k, t) in rows.iter().copied().zip(&window.t[window.begin..window.end]) {
            let moved = k.map(|k| k.sharpened(change.smoothing)).map(|k| match rig.as_mut() {
                None => k,
                Some((rig, play)) => ideal.moved_by_rig(k, clock.at(*t), rig, play, change),
            });
            if moved.is_none() && rig.is_some() {
                ideal.command.push(Command {
                    t: clock.at(*t),
                    angle: f64::NAN,
                    rate: f64::NAN,
                });
            }
            ideal.push(moved.as_ref(), facts, change);
        }
        ideal
    }

    /// Where the rig really stands; what it was told to do is kept.
    fn moved_by_rig(
        &mut self,
        k: Kinematics,
        t: f64,
        rig: &crate::rig::Rig,
        play: &mut Play,
        change: &ReferenceChange,
    ) -> Kinematics {
        let (angle, rate, acceleration) = (rig.angle(&k.attitude), k.omega.dot(&rig.axis), k.alpha.dot(&rig.axis));
        self.command.push(Command { t, angle, rate });
        if change.rig.is_none() {
            return k;
        }
        let slack = if change.rig.width == 0.0 {
            Slack::NONE
        } else {
            play.at(t, angle)
        };
        let [error, error_rate, error_acceleration] = change.rig.at(angle, rate, acceleration, slack);
        let turn = UnitQuaternion::from_scaled_axis(rig.axis * error);
        let omega = turn.inverse_transform_vector(&k.omega);
        Kinematics {
            attitude: k.attitude * turn,
            omega: omega + rig.axis * error_rate,
            omega_detail: turn.inverse_transform_vector(&k.omega_detail),
            alpha: turn.inverse_transform_vector(&k.alpha)
                + omega.cross(&rig.axis) * error_rate
                + rig.axis * error_acceleration,
            alpha_rate: turn.inverse_transform_vector(&k.alpha_rate),
            ..k
        }
    }

    /// Ideal readings as one sensor shows them if it is late or sluggish; `None` if it is neither.
    pub fn of_sensor(window: &Window, facts: &LogFacts, change: &ReferenceChange, sensor: Sensor) -> Option<Self> {
        let time = change.sensors[sensor.index()];
        if time == SensorTime::default() {
            return None;
        }
        let clock = change.clock(facts);
        let before = |past: f64, motion| Self::by_clock(window, facts, change, clock.before(past), motion);
        let mut now = before(time.delay + time.lag, Motion::Whole);
        if time.lag == 0.0 {
            return Some(now);
        }
        // A lag is a delay and a mean besides. That of noise of the reference would lower the residual of any sensor that is called
        // sluggish, so only what is smooth is averaged; the remainder is only late, as is all where that does not reach.
        let mut late = before(time.delay + time.lag, Motion::Smooth);
        let mut settling = late.rate(sensor).negative();
        let mut means = late.smooth().map(|triple| triple.negative());
        for (node, weight) in PAST {
            let mut then = before(time.delay + time.lag * node, Motion::Smooth);
            settling.add(then.rate(sensor), weight * node);
            for (mean, triple) in means.iter_mut().zip(then.smooth()) {
                mean.add(triple, weight);
            }
        }
        now.settling = now.rate(sensor).clone();
        now.settling.add_known(&settling);
        for (triple, mean) in now.smooth().into_iter().zip(&means) {
            triple.add_known(mean);
        }
        Some(now)
    }

    /// What a sensor reads of the smooth motion, late or sluggish as `change` has it. Of the noise of the reference, which the residual has
    /// in common with any difference of readings, little is left.
    pub fn smooth_reading(window: &Window, facts: &LogFacts, change: &ReferenceChange, sensor: Sensor) -> Triple {
        let SensorTime { delay, lag } = change.sensors[sensor.index()];
        let before = |past: f64| {
            let clock = change.clock(facts).before(past);
            let ideal = Self::by_clock(window, facts, change, clock, Motion::Smooth);
            ideal.quantity(sensor).clone()
        };
        if lag == 0.0 {
            return before(delay);
        }
        let mut mean = Triple::zeros(window.end - window.begin);
        for (node, weight) in PAST {
            mean.add(&before(delay + lag * node), weight);
        }
        mean
    }

    const fn smooth(&mut self) -> [&mut Triple; 8] {
        [
            &mut self.omega,
            &mut self.alpha,
            &mut self.alpha_rate,
            &mut self.snap,
            &mut self.f,
            &mut self.f_rate,
            &mut self.m,
            &mut self.m_rate,
        ]
    }

    /// What a sensor reads beyond the smooth quantity that columns are made of; `None` for a magnetometer, which needs no derivative.
    pub const fn detail(&self, sensor: Sensor) -> Option<&Triple> {
        match sensor {
            Sensor::Acc => Some(&self.f_detail),
            Sensor::Gyr => Some(&self.omega_detail),
            Sensor::Mag => None,
        }
    }

    /// What a sensor reads.
    pub const fn quantity(&self, sensor: Sensor) -> &Triple {
        match sensor {
            Sensor::Acc => &self.f,
            Sensor::Gyr => &self.omega,
            Sensor::Mag => &self.m,
        }
    }

    /// Time derivative of what a sensor reads.
    pub const fn rate(&self, sensor: Sensor) -> &Triple {
        match sensor {
            Sensor::Acc => &self.f_rate,
            Sensor::Gyr => &self.alpha,
            Sensor::Mag => &self.m_rate,
        }
    }

    /// How much further behind a sensor's reading would fall per second of its lag.
    pub fn settling(&self, sensor: Sensor) -> &Triple {
        if self.settling.is_empty() {
            self.rate(sensor)
        } else {
            &self.settling
        }
    }

    fn push(&mut self, k: Option<&Kinematics>, facts: &LogFacts, change: &ReferenceChange) {
        let Some(k) = k else {
            let nan = Vector3::repeat(f64::NAN);
            for triple in [&mut self.omega_detail, &mut self.f_detail] {
                triple.push(&nan);
            }
            for triple in self.smooth() {
                triple.push(&nan);
            }
            self.attitude.push(UnitQuaternion::identity());
            return;
        };
        let attitude = change.tilt * k.attitude * change.alignment;
        let omega = change.alignment.inverse_transform_vector(&k.omega);
        let alpha = change.alignment.inverse_transform_vector(&k.alpha);
        // Position and its derivatives are recorded in the frame that is not level.
        let f = attitude.inverse_transform_vector(&(change.tilt * k.acceleration - facts.gravity));
        let f_rate = attitude.inverse_transform_vector(&(change.tilt * k.jerk)) - omega.cross(&f);
        let m = attitude.inverse_transform_vector(&self.field);
        self.omega.push(&omega);
        self.alpha.push(&alpha);
        self.alpha_rate
            .push(&change.alignment.inverse_transform_vector(&k.alpha_rate));
        self.snap
            .push(&attitude.inverse_transform_vector(&(change.tilt * k.snap)));
        self.f.push(&f);
        self.f_rate.push(&f_rate);
        self.m.push(&m);
        self.m_rate.push(&-omega.cross(&m));
        self.omega_detail
            .push(&change.alignment.inverse_transform_vector(&k.omega_detail));
        self.f_detail
            .push(&attitude.inverse_transform_vector(&(change.tilt * k.acceleration_detail)));
        self.attitude.push(attitude);
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.attitude.len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.attitude.is_empty()
    }
}
