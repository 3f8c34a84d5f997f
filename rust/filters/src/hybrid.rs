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

use imufit_attitude::Quaternion;
use nalgebra::Vector3;

use crate::filter::{Filter, Usage};
use crate::lost::Follows;
use crate::mahony::{self, Mahony, square_of_sine};
use crate::parameter::Parameter;
use crate::{Environment, Sample, triad};

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

/// Mahony's filter with TRIAD's attitude.
#[derive(Debug, Clone)]
pub struct Hybrid {
    environment: Environment,
    up: Vector3<f64>,
    mahony: Mahony,
    /// k_1 / 2 and k_2 / 2.
    half_weights: [f64; 2],
    k_p: f64,
    least_square: f64,
    /// Whether TRIAD's attitude is what is measured.
    driven: bool,
    /// Whether the next attitude of TRIAD is taken over as it is.
    waiting: bool,
}

impl Hybrid {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[f64]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(PARAMETERS[at].default);
        let driven = value(5) > 0.0;
        Self {
            environment: *environment,
            up: environment.up(),
            mahony: Mahony::new(environment, values),
            half_weights: [value(0) * 0.5, value(1) * 0.5],
            k_p: value(3),
            least_square: square_of_sine(value(4)),
            driven,
            waiting: !driven,
        }
    }

    /// TRIAD's attitude of a sample and whether its heading is that of the field.
    fn measured(&self, sample: &Sample, q: Quaternion) -> Option<(Quaternion, bool)> {
        triad::measured(sample, q, &self.environment, self.least_square)
    }

    /// Mahony's filter, put to TRIAD's attitude at the first pair of vectors and at the first one after a gap.
    fn seeded(&mut self, sample: &Sample) -> Usage {
        // No time since the last field: it is the first one, or the first one after a gap.
        self.waiting |= sample.m.is_some_and(|m| m.dt <= 0.0);
        let usage = self.mahony.step(sample);
        if self.waiting
            && sample.m.is_some()
            && let Some((q, true)) = self.measured(sample, self.mahony.attitude())
        {
            self.mahony.put(q);
            self.waiting = false;
        }
        usage
    }

    /// The passive filter on TRIAD's attitude.
    #[inline(always)]
    fn driven(&mut self, sample: &Sample) -> Usage {
        let predicted = self.mahony.predicted(sample).kept();
        let Some((q_y, apart)) = self.measured(sample, predicted) else {
            self.mahony.correct(predicted, &Vector3::zeros(), 0.0);
            return Usage::Full;
        };
        let off = q_y.times(predicted.inverse());
        // vex of the antisymmetric part: sin(angle) times the axis.
        let w_n = off.vector() * (2.0 * off.w());
        let gain = |weight: f64, dt: f64| {
            let gain = weight * dt;
            gain * f64::min(1.0, 1.0 / (self.k_p * gain))
        };
        let level = gain(self.half_weights[0], sample.f.map_or(0.0, |f| f.dt));
        let heading = gain(self.half_weights[1], sample.m.map_or(0.0, |m| m.dt));
        let heading = if apart { heading } else { 0.0 };
        let vertical = self.up * self.up.dot(&w_n);
        let w_mes = predicted.rotate_back(&((w_n - vertical) * level + vertical * heading));
        self.mahony.correct(predicted, &w_mes, 0.0);
        if sample.m.is_some() && !apart {
            Usage::NoHeading
        } else {
            Usage::Full
        }
    }
}

impl Filter for Hybrid {
    #[inline]
    fn step(&mut self, sample: &Sample) -> Usage {
        if self.driven {
            self.driven(sample)
        } else {
            self.seeded(sample)
        }
    }

    #[inline]
    fn attitude(&self) -> Quaternion {
        self.mahony.attitude()
    }

    fn reset(&mut self, attitude: Quaternion) {
        self.mahony.reset(attitude);
        self.waiting = !self.driven;
    }

    fn state(&self) -> Vec<f64> {
        let mut state = self.mahony.state();
        state.push(f64::from(self.waiting));
        state
    }

    fn set_state(&mut self, state: &[f64]) -> bool {
        let Some((waiting, of_mahony)) = state.split_last() else {
            return false;
        };
        let taken = self.mahony.set_state(of_mahony);
        if taken {
            self.waiting = *waiting > 0.0;
        }
        taken
    }
}

impl Follows<f64> for Hybrid {
    fn limit(&self, time: f64, sound: &Self) -> f64 {
        self.mahony.limit(time, &sound.mahony)
    }

    fn heading_limit(&self, sound: &Self) -> Option<f64> {
        self.mahony.heading_limit(&sound.mahony)
    }

    fn find(&mut self, attitude: Quaternion, sound: &Self, lost: bool) {
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
            let mut filter = Hybrid::new(&environment, &[1.0, 1.0, 0.2, 2.0, 0.035, driven]);
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
        let error = |filter: &Hybrid| (q.inverse() * filter.attitude()).angle();
        for driven in [0.0, 1.0] {
            let mut filter = Hybrid::new(&environment, &[1.0, 1.0, 0.2, 2.0, 0.035, driven]);
            filter.step(&standing(q, Frame::Ned, Vector3::zeros(), 0.0));
            assert_eq!(error(&filter) < 1e-12, driven < 0.5);
            // Turned unseen; then a gap.
            let away = Quaternion::exp(&(Vector3::z() * 0.5)) * q;
            filter.reset(away);
            let seen = standing(q, Frame::Ned, Vector3::zeros(), 0.01);
            filter.step(&Sample { m: None, ..seen });
            assert!(error(&filter) > 0.4);
            filter.step(&standing(q, Frame::Ned, Vector3::zeros(), 0.0));
            assert_eq!(error(&filter) < 1e-12, driven < 0.5);
        }
    }

    #[test]
    fn any_gain_and_step_stay_finite_and_settle() {
        let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
        let q = Quaternion::exp(&Vector3::new(0.1, 0.3, -0.2));
        for (k_p, dt) in [(20.0, 0.5), (1e6, 1.0), (1e200, 1e3), (0.0, 0.01)] {
            let mut filter = Hybrid::new(&environment, &[1.0, 1.0, 0.0, k_p, 0.035, 1.0]);
            for _ in 0..50 {
                filter.step(&standing(q, Frame::Ned, Vector3::zeros(), dt));
            }
            let angle = (q.inverse() * filter.attitude()).angle();
            assert!(angle < 1e-6 || k_p == 0.0, "k_p {k_p}: {angle}");
        }
    }
}
