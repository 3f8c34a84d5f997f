//! Kalman filter of angle and gyro bias with the accelerometer's angle as its measurement (paper B).
//!
//! The paper prints no matrices; the form it cites, for a self-balancing vehicle, has per axis
//!
//! ```text
//! state [theta, b],   theta_k = theta_{k-1} + (omega - b) dt,   measurement z = theta_acc = theta + noise
//! ```
//!
//! Here theta is the inclination on attitudes: the innovation is the shortest rotation, a vector in the horizontal
//! plane of the reference frame, that makes the specific force point up. Its two axes have the same noises, so one
//! 2 x 2 covariance `[[p_aa, p_ab], [p_ab, p_bb]]` serves both, and for rotations about one horizontal axis the filter is the
//! cited one. The heading is that of the integrated rate.

use imufit_attitude::Quaternion;
use nalgebra::Vector3;

use crate::filter::{Filter, Parameter, Usage, split_state};
use crate::{Environment, Sample};

/// Noise densities, so that the filter does not depend on the rate of the log, and the first uncertainties.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "gyr_noise",
        default: 1e-3,
        unit: "rad/s/sqrt(Hz)",
        meaning: "noise density of the angular rate: larger follows the accelerometer faster (time constant acc_noise / gyr_noise)",
    },
    Parameter {
        name: "bias_walk",
        default: 1e-5,
        unit: "rad/s/sqrt(s)",
        meaning: "random walk of the gyro bias: larger learns a changing bias faster and takes more motion for bias",
    },
    Parameter {
        name: "acc_noise",
        default: 5e-3,
        unit: "rad*sqrt(s)",
        meaning: "noise density of the accelerometer's angle, motion included: larger is smoother and settles later",
    },
    Parameter {
        name: "angle_start",
        default: 0.1,
        unit: "rad",
        meaning: "uncertainty of the initial inclination",
    },
    Parameter {
        name: "bias_start",
        default: 0.02,
        unit: "rad/s",
        meaning: "uncertainty of the initial bias of zero",
    },
];

/// The filter.
#[derive(Debug, Clone)]
pub struct Kalman {
    environment: Environment,
    values: [f64; 5],
    q: Quaternion,
    bias: Vector3<f64>,
    /// p_aa, p_ab, p_bb.
    covariance: [f64; 3],
}

impl Kalman {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[f64]) -> Self {
        let defaults = [0, 1, 2, 3, 4].map(|at| PARAMETERS[at].default);
        let values = <[f64; 5]>::try_from(values).unwrap_or(defaults);
        let mut filter = Self {
            environment: *environment,
            values,
            q: Quaternion::IDENTITY,
            bias: Vector3::zeros(),
            covariance: [0.0; 3],
        };
        filter.reset(Quaternion::IDENTITY);
        filter
    }

    fn predict(&mut self, dt: f64) {
        let [gyr_noise, bias_walk, ..] = self.values;
        let [p_aa, p_ab, p_bb] = self.covariance;
        self.covariance = [
            p_aa + dt * (dt * p_bb - 2.0 * p_ab) + gyr_noise * gyr_noise * dt,
            p_ab - dt * p_bb,
            p_bb + bias_walk * bias_walk * dt,
        ];
    }

    /// The gains of angle and bias for a reading that stands for `dt`, and the covariance after it (Joseph form).
    fn gains(&self, dt: f64) -> Option<([f64; 2], [f64; 3])> {
        let [p_aa, p_ab, p_bb] = self.covariance;
        let r = self.values[2] * self.values[2] / dt;
        let (k_a, k_b) = (p_aa / (p_aa + r), p_ab / (p_aa + r));
        let keep = 1.0 - k_a;
        let after = [
            keep * keep * p_aa + k_a * k_a * r,
            keep * (p_ab - k_b * p_aa) + k_a * k_b * r,
            p_bb - 2.0 * k_b * p_ab + k_b * k_b * (p_aa + r),
        ];
        let finite = k_a.is_finite() && k_b.is_finite() && after.iter().all(|value| value.is_finite());
        finite.then_some(([k_a, k_b], after))
    }
}

impl Filter for Kalman {
    fn step(&mut self, sample: &Sample) -> Usage {
        if let Some(omega) = sample.omega {
            self.q = self.q.turned(&(omega.value.0 - self.bias), omega.dt);
            self.predict(omega.dt);
        }
        if let Some(f) = sample.f.filter(|f| f.dt > 0.0)
            && let Some(([k_a, k_b], after)) = self.gains(f.dt)
        {
            let innovation = Quaternion::between(&self.q.rotate(&f.value.0), &self.environment.up()).log();
            self.bias += self.q.rotate_back(&innovation) * k_b;
            self.q = Quaternion::exp(&(innovation * k_a)) * self.q;
            self.covariance = after;
        }
        Usage::Full
    }

    fn attitude(&self) -> Quaternion {
        self.q
    }

    fn reset(&mut self, attitude: Quaternion) {
        let [_, _, _, angle_start, bias_start] = self.values;
        (self.q, self.bias) = (attitude, Vector3::zeros());
        self.covariance = [angle_start * angle_start, 0.0, bias_start * bias_start];
    }

    fn state(&self) -> Vec<f64> {
        let mut state = self.q.to_array().to_vec();
        state.extend(self.bias.iter().chain(&self.covariance));
        state
    }

    fn set_state(&mut self, state: &[f64]) -> bool {
        let found = split_state(state);
        if let Some((q, [x, y, z, p_aa, p_ab, p_bb])) = found {
            (self.q, self.bias, self.covariance) = (q, Vector3::new(x, y, z), [p_aa, p_ab, p_bb]);
        }
        found.is_some()
    }
}

#[cfg(test)]
mod tests {
    use imufit_attitude::Frame;

    use super::*;
    use crate::{AngularRate, Reading, SpecificForce};

    #[test]
    fn about_one_axis_it_is_the_textbook_filter_of_angle_and_bias() {
        let environment = Environment::new(Frame::Enu, 9.81, None).unwrap();
        let mut filter = Kalman::new(&environment, &[1e-3, 1e-4, 5e-3, 0.1, 0.02]);
        let dt = 0.01;
        let (mut x, mut p) = (
            nalgebra::Vector2::zeros(),
            nalgebra::Matrix2::new(0.01, 0.0, 0.0, 0.0004),
        );
        let (a, h) = (
            nalgebra::Matrix2::new(1.0, -dt, 0.0, 1.0),
            nalgebra::RowVector2::new(1.0, 0.0),
        );
        for k in 0..500 {
            let (rate, z) = (0.02 + 0.3 * f64::from(k).sin(), 0.1 * (0.03 * f64::from(k)).cos());
            x = a * x + nalgebra::Vector2::new(rate * dt, 0.0);
            p = a * p * a.transpose() + nalgebra::Matrix2::new(1e-6 * dt, 0.0, 0.0, 1e-8 * dt);
            let gain = p * h.transpose() / (p[(0, 0)] + 25e-6 / dt);
            x += gain * (z - x[0]);
            p = (nalgebra::Matrix2::identity() - gain * h) * p;
            let f = Quaternion::exp(&(Vector3::y() * z)).rotate_back(&(Vector3::z() * 9.81));
            filter.step(&Sample {
                omega: Some(Reading {
                    value: AngularRate(Vector3::y() * rate),
                    dt,
                }),
                f: Some(Reading {
                    value: SpecificForce(f),
                    dt,
                }),
                m: None,
            });
            assert!((filter.attitude().log() - Vector3::y() * x[0]).norm() < 1e-12);
            assert!((filter.bias - Vector3::y() * x[1]).norm() < 1e-12);
        }
    }
}
