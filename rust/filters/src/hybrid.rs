//! TRIAD together with Mahony's filter (paper C, figures 1 and 2, which say it in words). Two readings:
//!
//! **Seeded** (`driven = 0`): TRIAD gives the attitude at which Mahony's filter starts. Whatever attitude the replay was given,
//! the first row with specific force and field is set to TRIAD's; after a gap this happens again, so that the error of a gap
//! is gone with the first pair of readings after it.
//!
//! **Driven** (`driven = 1`): each row's TRIAD attitude R_y takes the place of the two vectors as what is measured: the
//! passive filter of Mahony, Hamel and Pflimlin 2008 on the reconstructed R_y,
//!
//! ```text
//! w_n   = vex( (R~ - R~^T) / 2 ),   R~ = R_y R^^T         sine of the error times its axis, reference frame
//! w_mes = R^^T diag(k_1, k_1, k_2) / 2  w_n               takes the place of eq. (5)
//! ```
//!
//! with eqs. (6) and (7) as in [`mahony`](crate::mahony). The weights keep their meaning: k_1 for the horizontal axes, which the
//! specific force shows, k_2 for the vertical one, which the field shows; with k_1 = k_2 = 2 it is the passive filter as
//! printed there. For small errors both readings and Mahony's filter have the same linear equation, so that they differ where
//! errors are large: at the start, after a disturbance, and where a gain is high. TRIAD has no feedback, so the Lyapunov
//! function of the passive filter, `tr(I - R~)`, still falls with any positive k_1 and k_2.
//!
//! On rows without a usable field (a slow magnetometer, a field along the vertical) R_y has the heading of the estimate, on
//! rows without a usable specific force there is no R_y, and the gyro carries the attitude on. In one step no correction
//! exceeds the measured error, as in [`mahony`](crate::mahony).
//!
//! **Recovery.** One reading with NaN or infinity and free fall leave no error behind but that of the gyro. An error of up to
//! 90 degrees, left by a saturated gyro or (driven) by a gap, is below a tenth of itself `8 / (k_p min(k_1, k_2))` s
//! after good readings return; seeded, that of a gap is gone with the first pair of readings.

use imufit_attitude::{Quaternion, Real};
use nalgebra::{SimdBool, Vector3};

use crate::filter::{Filter, Parameter, Usage};
use crate::intake::{Intake, all_rows};
use crate::lost::{Follows, Watched};
use crate::mahony::{self, Mahony, square_of_sine};
use crate::{Columns, Environment, Sample, Skipped, triad};

/// Those of [`mahony`](crate::mahony) and the choice between the two readings.
pub const PARAMETERS: &[Parameter] = &[
    mahony::PARAMETERS[0],
    mahony::PARAMETERS[1],
    mahony::PARAMETERS[2],
    mahony::PARAMETERS[3],
    mahony::PARAMETERS[4],
    Parameter {
        name: "driven",
        default: 1.0,
        unit: "1",
        meaning: "1: each row's TRIAD attitude is the measured one; 0: TRIAD only gives the attitude at which Mahony's filter starts",
    },
];

/// The filter that these settings ask for.
pub fn make(environment: &Environment, values: &[f64]) -> Box<dyn Filter> {
    if values.get(5).is_none_or(|driven| *driven > 0.0) {
        Box::new(Watched::new(environment, Driven::new(environment, values)))
    } else {
        Box::new(Watched::new(environment, Seeded::new(environment, values)))
    }
}

/// Mahony's filter that starts at TRIAD's attitude.
#[derive(Debug, Clone)]
pub struct Seeded<T = f64> {
    environment: Environment,
    mahony: Mahony<T>,
    least_square: T,
    /// 1 until TRIAD's attitude has been taken over.
    waiting: T,
}

impl<T: Real> Seeded<T> {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[T]) -> Self {
        let min_angle = values.get(4).copied().unwrap_or(T::splat(PARAMETERS[4].default));
        Self {
            environment: *environment,
            mahony: Mahony::new(environment, values),
            least_square: square_of_sine(min_angle),
            waiting: T::splat(1.0),
        }
    }
}

impl<T: Real> Filter<T> for Seeded<T> {
    #[inline]
    fn step(&mut self, sample: &Sample) -> Usage {
        let (zero, one) = (T::splat(0.0), T::splat(1.0));
        // No time since the last field: it is the first one, or the first one after a gap.
        if sample.m.is_some_and(|m| m.dt <= 0.0) {
            self.waiting = one;
        }
        let usage = self.mahony.step(sample);
        if sample.m.is_some()
            && self.waiting != zero
            && let Some((q, apart)) =
                triad::measured(sample, self.mahony.attitude(), &self.environment, self.least_square)
        {
            let now = apart & self.waiting.simd_gt(zero);
            self.mahony.put(q.select(now, self.mahony.attitude()));
            self.waiting = zero.select(now, self.waiting);
        }
        usage
    }

    #[inline]
    fn attitude(&self) -> Quaternion<T> {
        self.mahony.attitude()
    }

    fn reset(&mut self, attitude: Quaternion) {
        self.mahony.reset(attitude);
        self.waiting = T::splat(1.0);
    }

    fn rows(&mut self, intake: &mut Intake, columns: &Columns<'_>, attitude: &mut [T], skipped: &mut Skipped) {
        all_rows(self, intake, columns, attitude, skipped);
    }

    fn state(&self) -> Vec<T> {
        let mut state = self.mahony.state();
        state.push(self.waiting);
        state
    }

    fn set_state(&mut self, state: &[T]) -> bool {
        let Some((waiting, of_mahony)) = state.split_last() else {
            return false;
        };
        let taken = self.mahony.set_state(of_mahony);
        if taken {
            self.waiting = *waiting;
        }
        taken
    }
}

/// The passive filter on TRIAD's attitude.
#[derive(Debug, Clone)]
pub struct Driven<T = f64> {
    environment: Environment,
    up: Vector3<T>,
    mahony: Mahony<T>,
    /// k_1 / 2 and k_2 / 2.
    half_weights: [T; 2],
    k_p: T,
    least_square: T,
}

impl<T: Real> Driven<T> {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[T]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(T::splat(PARAMETERS[at].default));
        let half = T::splat(0.5);
        Self {
            environment: *environment,
            up: environment.up().map(T::splat),
            mahony: Mahony::new(environment, values),
            half_weights: [value(0) * half, value(1) * half],
            k_p: value(3),
            least_square: square_of_sine(value(4)),
        }
    }
}

impl<T: Real> Filter<T> for Driven<T> {
    #[inline]
    fn step(&mut self, sample: &Sample) -> Usage {
        let (zero, one, two) = (T::splat(0.0), T::splat(1.0), T::splat(2.0));
        let predicted = self.mahony.predicted(sample).kept();
        let Some((q_y, apart)) = triad::measured(sample, predicted, &self.environment, self.least_square) else {
            self.mahony.correct(predicted, &Vector3::repeat(zero), zero);
            return Usage::Full;
        };
        let off = q_y.times(predicted.inverse());
        // vex of the antisymmetric part: sin(angle) times the axis.
        let w_n = off.vector() * (two * off.w());
        let dt_f = sample.f.map_or(0.0, |f| f.dt);
        let dt_m = sample.m.map_or(0.0, |m| m.dt);
        let gain = |weight: T, dt: T| {
            let gain = weight * dt;
            gain * one.simd_min(one / (self.k_p * gain))
        };
        let level = gain(self.half_weights[0], T::splat(dt_f));
        let heading = gain(self.half_weights[1], T::splat(dt_m)).select(apart, zero);
        let vertical = self.up * self.up.dot(&w_n);
        let w_mes = predicted.rotate_back(&((w_n - vertical) * level + vertical * heading));
        self.mahony.correct(predicted, &w_mes, zero);
        if sample.m.is_some() && !apart.all() {
            Usage::NoHeading
        } else {
            Usage::Full
        }
    }

    #[inline]
    fn attitude(&self) -> Quaternion<T> {
        self.mahony.attitude()
    }

    fn reset(&mut self, attitude: Quaternion) {
        self.mahony.reset(attitude);
    }

    fn rows(&mut self, intake: &mut Intake, columns: &Columns<'_>, attitude: &mut [T], skipped: &mut Skipped) {
        all_rows(self, intake, columns, attitude, skipped);
    }

    fn state(&self) -> Vec<T> {
        self.mahony.state()
    }

    fn set_state(&mut self, state: &[T]) -> bool {
        self.mahony.set_state(state)
    }
}

impl<T: Real> Follows<T> for Seeded<T> {
    fn limit(&self, time: f64, sound: &Self) -> T {
        self.mahony.limit(time, &sound.mahony)
    }

    fn heading_limit(&self, sound: &Self) -> Option<T> {
        self.mahony.heading_limit(&sound.mahony)
    }

    fn find(&mut self, attitude: Quaternion<T>, sound: &Self, lost: T::SimdBool) {
        self.mahony.find(attitude, &sound.mahony, lost);
    }
}

impl<T: Real> Follows<T> for Driven<T> {
    fn limit(&self, time: f64, sound: &Self) -> T {
        self.mahony.limit(time, &sound.mahony)
    }

    fn heading_limit(&self, sound: &Self) -> Option<T> {
        self.mahony.heading_limit(&sound.mahony)
    }

    fn find(&mut self, attitude: Quaternion<T>, sound: &Self, lost: T::SimdBool) {
        self.mahony.find(attitude, &sound.mahony, lost);
    }
}

#[cfg(test)]
mod tests {
    use imufit_attitude::Frame;

    use super::*;
    use crate::{AngularRate, FluxDensity, Reading, SpecificForce};

    fn standing(q: Quaternion, frame: Frame, rate: Vector3<f64>, dt: f64) -> Sample {
        Sample {
            omega: Some(Reading {
                value: AngularRate(rate),
                dt,
            }),
            f: Some(Reading {
                value: SpecificForce(q.rotate_back(&(frame.up() * 9.81))),
                dt,
            }),
            m: Some(Reading {
                value: FluxDensity(q.rotate_back(&frame.default_field())),
                dt,
            }),
            ..Sample::default()
        }
    }

    #[test]
    fn a_wrong_start_and_a_bias_are_removed_in_both_readings_and_every_frame() {
        for (frame, driven) in Frame::ALL.into_iter().flat_map(|frame| [(frame, 0.0), (frame, 1.0)]) {
            let environment = Environment::new(frame, 9.81, None).unwrap();
            let q = Quaternion::exp(&Vector3::new(0.4, -0.7, 1.9));
            let bias = Vector3::new(0.01, -0.02, 0.015);
            let mut filter = make(&environment, &[1.0, 1.0, 0.2, 2.0, 0.035, driven]);
            filter.reset(Quaternion::exp(&Vector3::new(0.9, 0.2, 0.5)));
            for _ in 0..60_000 {
                filter.step(&standing(q, frame, bias, 0.01));
            }
            assert!((q.inverse() * filter.attitude()).angle() < 1e-6);
            assert!((Vector3::from_column_slice(&filter.state()[4..7]) - bias).norm() < 1e-6);
        }
    }

    #[test]
    fn seeded_takes_triads_attitude_at_the_first_pair_and_after_a_gap_and_driven_does_not() {
        let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
        let q = Quaternion::exp(&Vector3::new(0.4, -0.7, 1.9));
        let error = |filter: &dyn Filter| (q.inverse() * filter.attitude()).angle();
        for driven in [0.0, 1.0] {
            let mut filter = make(&environment, &[1.0, 1.0, 0.2, 2.0, 0.035, driven]);
            filter.step(&standing(q, Frame::Ned, Vector3::zeros(), 0.0));
            assert_eq!(error(filter.as_ref()) < 1e-12, driven < 0.5);
            // Turned unseen; then a gap.
            let away = Quaternion::exp(&(Vector3::z() * 0.5)) * q;
            filter.reset(away);
            let seen = standing(q, Frame::Ned, Vector3::zeros(), 0.01);
            filter.step(&Sample { m: None, ..seen });
            assert!(error(filter.as_ref()) > 0.4);
            filter.step(&standing(q, Frame::Ned, Vector3::zeros(), 0.0));
            assert_eq!(error(filter.as_ref()) < 1e-12, driven < 0.5);
        }
    }

    #[test]
    fn any_gain_and_step_stay_finite_and_settle() {
        let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
        let q = Quaternion::exp(&Vector3::new(0.1, 0.3, -0.2));
        for (k_p, dt) in [(20.0, 0.5), (1e6, 1.0), (1e200, 1e3), (0.0, 0.01)] {
            let mut filter = make(&environment, &[1.0, 1.0, 0.0, k_p, 0.035, 1.0]);
            for _ in 0..50 {
                filter.step(&standing(q, Frame::Ned, Vector3::zeros(), dt));
            }
            let angle = (q.inverse() * filter.attitude()).angle();
            assert!(angle < 1e-6 || k_p == 0.0, "k_p {k_p}: {angle}");
        }
    }
}
