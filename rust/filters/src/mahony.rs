//! Mahony's nonlinear complementary filter (paper C, eqs. (5) to (7); Mahony, Hamel and Pflimlin 2008).
//!
//! ```text
//! w_mes   = -vex( sum_i (k_i / 2) (v_i v^_i^T - v^_i v_i^T) ) = sum_i (k_i / 2) v_i x v^_i              (5)
//! db^/dt  = -(1/2) k_I w_mes                                                                          (6)
//! dq^/dt  = T_q(q^) [ w_imu - b^ + k_P w_mes ]                                                         (7)
//! ```
//!
//! i = 1 is the specific force, i = 2 the field. The paper prints eq. (6) with K_p and eq. (7) as
//! `w_mes - b + K_i w_mes`: the two gains are exchanged and the gyro is lost. The prose (k_P corrects the rate, k_I
//! integrates the bias) and the stability proof want the form above. Note both factors 1/2: the gain from a small
//! angle to the rate is `k_P k_i / 2`, where other texts write `k_P k_i`.
//!
//! Directions: `v_1 = f/|f|` is compared with up, `v^_1 = R^T up`; the paper's v_01 = `[0 0 1]` in NED wants the
//! reading's sign flipped. For v_02 the field's horizontal part is taken as north: the measured field is brought into the
//! estimated reference frame, its vertical part is dropped, and what is left is compared with north (v_02 = `[1 0 0]` in
//! NED) or with the horizontal direction of the field given in the surroundings. A wrong field then turns the heading
//! and leaves roll and pitch alone.
//!
//! One step from row k-1 to row k: the attitude is turned by the mean rate of both rows less the bias (exact
//! exponential), then w_mes is taken at row k, where its readings belong, and turns attitude and bias. A reading that
//! comes less often than the gyro stands for the time since the last one, so that its gain does not depend on its rate.
//! In one step a correction never exceeds the measured error (`k_P (k_1 dt_1 + k_2 dt_2) / 2` is limited to 1), which
//! keeps the filter stable for any gain and any step.
//!
//! The paper's gains `[k_1 k_2 k_I k_P]`, [`AS_IN_FIGURE_3`] (the text prints `[1 - 0.2 20]`) and [`AS_IN_FIGURE_4`], suit
//! a slow robot arm. The defaults are softer: found on hand-moved recordings with optical reference (BROAD), where they
//! give 1.5 to 4 degrees on rotations and slow translations.

use imufit_attitude::Quaternion;
use nalgebra::Vector3;

use crate::filter::{Filter, Parameter, Usage, split_state};
use crate::sample::horizontal;
use crate::{Environment, Sample};

/// The gains, named as printed, and the limit of the field.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "k_1",
        default: 1.0,
        unit: "1",
        meaning: "weight of the specific force: larger trusts it more against the field and the gyro",
    },
    Parameter {
        name: "k_2",
        default: 1.0,
        unit: "1",
        meaning: "weight of the magnetic field: larger pulls the heading faster, and disturbances with it",
    },
    Parameter {
        name: "k_i",
        default: 0.005,
        unit: "1/s",
        meaning: "gain of the gyro bias (paper: 0.2): larger learns a bias faster and takes more motion for bias; 0 switches it off",
    },
    Parameter {
        name: "k_p",
        default: 0.5,
        unit: "1/s",
        meaning: "gain of the attitude (paper: 20 and 10); the time constant is 2 / (k_p k_1): larger follows the vectors, smaller the gyro",
    },
    Parameter {
        name: "min_angle",
        default: 0.035,
        unit: "rad",
        meaning: "where the field is closer to the vertical than this it is not used: smaller accepts noisier headings",
    },
];

/// `k_1, k_2, k_i, k_p` of figure 3.
pub const AS_IN_FIGURE_3: [f64; 4] = [1.0, 1.0, 0.2, 20.0];
/// `k_1, k_2, k_i, k_p` of figure 4.
pub const AS_IN_FIGURE_4: [f64; 4] = [5.0, 0.1, 0.2, 10.0];

/// The filter.
#[derive(Debug, Clone)]
pub struct Mahony {
    environment: Environment,
    k_1: f64,
    k_2: f64,
    k_i: f64,
    k_p: f64,
    min_angle: f64,
    q: Quaternion,
    bias: Vector3<f64>,
}

impl Mahony {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[f64]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(PARAMETERS[at].default);
        Self {
            environment: *environment,
            k_1: value(0),
            k_2: value(1),
            k_i: value(2),
            k_p: value(3),
            min_angle: value(4),
            q: Quaternion::IDENTITY,
            bias: Vector3::zeros(),
        }
    }

    /// The estimated gyro bias b^, rad/s.
    pub fn bias(&self) -> Vector3<f64> {
        self.bias
    }

    /// Eq. (5) times the time each vector stands for: body frame, s.
    fn innovation(&self, sample: &Sample) -> (Vector3<f64>, f64, Usage) {
        let (mut w_mes, mut weight, mut usage) = (Vector3::zeros(), 0.0, Usage::Full);
        let up = self.environment.up();
        if let Some(f) = sample.f
            && let Some(v) = f.value.0.try_normalize(0.0)
        {
            let gain = 0.5 * self.k_1 * f.dt;
            w_mes += v.cross(&self.q.rotate_back(&up)) * gain;
            weight += gain;
        }
        if let Some(m) = sample.m {
            if let Some(v) = horizontal(&self.q.rotate(&m.value.0), &up, self.min_angle.min(1.5).sin()) {
                let gain = 0.5 * self.k_2 * m.dt;
                w_mes += self.q.rotate_back(&v.cross(&self.environment.field_north())) * gain;
                weight += gain;
            } else {
                usage = Usage::NoHeading;
            }
        }
        (w_mes, weight, usage)
    }
}

impl Filter for Mahony {
    fn step(&mut self, sample: &Sample) -> Usage {
        if let Some(omega) = sample.omega {
            self.q = self.q.turned(&(omega.value.0 - self.bias), omega.dt);
        }
        let (w_mes, weight, usage) = self.innovation(sample);
        let limit = 1.0_f64.min(1.0 / (self.k_p * weight));
        self.q = self.q.turned(&(w_mes * limit), self.k_p);
        let bias = self.bias - w_mes * (0.5 * self.k_i * limit);
        if bias.norm_squared().is_finite() {
            self.bias = bias;
        }
        usage
    }

    fn attitude(&self) -> Quaternion {
        self.q
    }

    fn reset(&mut self, attitude: Quaternion) {
        (self.q, self.bias) = (attitude, Vector3::zeros());
    }

    fn state(&self) -> Vec<f64> {
        let [w, x, y, z] = self.q.to_array();
        vec![w, x, y, z, self.bias.x, self.bias.y, self.bias.z]
    }

    fn set_state(&mut self, state: &[f64]) -> bool {
        let found = split_state(state);
        if let Some((q, bias)) = found {
            (self.q, self.bias) = (q, Vector3::from(bias));
        }
        found.is_some()
    }
}

#[cfg(test)]
mod tests {
    use imufit_attitude::Frame;

    use super::*;
    use crate::{AngularRate, FluxDensity, Reading, SpecificForce};

    fn standing(q: Quaternion, frame: Frame, bias: Vector3<f64>, dt: f64) -> Sample {
        Sample {
            omega: Some(Reading {
                value: AngularRate(bias),
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
        }
    }

    #[test]
    fn a_wrong_start_and_a_bias_are_removed_in_every_frame() {
        for frame in Frame::ALL {
            let environment = Environment::new(frame, 9.81, None).unwrap();
            let q = Quaternion::exp(&Vector3::new(0.4, -0.7, 1.9));
            let bias = Vector3::new(0.01, -0.02, 0.015);
            let mut filter = Mahony::new(&environment, &[1.0, 1.0, 0.2, 2.0, 0.035]);
            filter.reset(Quaternion::exp(&Vector3::new(0.9, 0.2, 0.5)));
            for _ in 0..60_000 {
                filter.step(&standing(q, frame, bias, 0.01));
            }
            assert!((q.inverse() * filter.attitude()).angle() < 1e-6);
            assert!((filter.bias() - bias).norm() < 1e-6);
        }
    }

    #[test]
    fn a_disturbed_field_does_not_tilt_the_attitude() {
        let frame = Frame::Enu;
        let environment = Environment::new(frame, 9.81, None).unwrap();
        let q = Quaternion::exp(&Vector3::new(0.4, -0.7, 1.9));
        let mut filter = Mahony::new(&environment, &[]);
        filter.reset(q);
        let mut sample = standing(q, frame, Vector3::zeros(), 0.01);
        let disturbed = frame.default_field() + Vector3::new(30.0, 10.0, 25.0);
        sample.m = Some(Reading {
            value: FluxDensity(q.rotate_back(&disturbed)),
            dt: 0.01,
        });
        for _ in 0..2000 {
            filter.step(&sample);
        }
        let error = imufit_attitude::AttitudeError::between(filter.attitude(), q);
        assert!(error.inclination < 1e-6 && error.heading.abs() > 0.3);
    }

    #[test]
    fn any_gain_and_step_stay_finite_and_settle() {
        let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
        let q = Quaternion::exp(&Vector3::new(0.1, 0.3, -0.2));
        for (k_p, dt) in [(20.0, 0.5), (1e6, 1.0), (1e200, 1e3), (0.0, 0.01)] {
            let mut filter = Mahony::new(&environment, &[1.0, 1.0, 0.0, k_p, 0.035]);
            for _ in 0..50 {
                filter.step(&standing(q, Frame::Ned, Vector3::zeros(), dt));
            }
            let angle = (q.inverse() * filter.attitude()).angle();
            assert!(angle < 1e-6 || k_p == 0.0, "k_p {k_p}: {angle}");
        }
    }
}
