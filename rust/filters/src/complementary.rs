//! Complementary filter (paper B, eq. (5): `theta = a (theta_{t-1} + G_y dt) + b theta_acc`, a = 0.97, b = 0.03).
//!
//! On attitudes: the integrated rate gives a prediction, and the shortest rotation that would bring its vertical onto
//! the measured one is carried out to the fraction b = 1 - a. For rotations about one horizontal axis this is eq. (5).
//! The paper's a belongs to one step of its own sampling, which it does not state; here a belongs to `step` seconds and
//! a step of dt uses `a^(dt / step)`, so that the time constant does not depend on the rate of the log.
//! The heading is that of the integrated rate.

use imufit_attitude::Quaternion;

use crate::filter::{Filter, Parameter, Usage, split_state};
use crate::{Environment, Sample};

/// Weight and the step it belongs to.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "a",
        default: 0.97,
        unit: "1",
        meaning: "weight of the integrated rate over `step` (paper B: 0.97): larger is smoother and drifts more, smaller follows the accelerometer",
    },
    Parameter {
        name: "step",
        default: 0.01,
        unit: "s",
        meaning: "time that `a` belongs to; the time constant is -step / ln(a), 0.33 s by default",
    },
];

/// The filter.
#[derive(Debug, Clone)]
pub struct Complementary {
    environment: Environment,
    /// Decay of an inclination error, 1/s; infinite where a = 0.
    decay: f64,
    q: Quaternion,
}

impl Complementary {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[f64]) -> Self {
        let (a, step) = match *values {
            [a, step] => (a.clamp(0.0, 1.0), step),
            _ => (PARAMETERS[0].default, PARAMETERS[1].default),
        };
        let decay = if a < 1.0 {
            -a.ln() / step.max(f64::MIN_POSITIVE)
        } else {
            0.0
        };
        Self {
            environment: *environment,
            decay,
            q: Quaternion::IDENTITY,
        }
    }
}

impl Filter for Complementary {
    fn step(&mut self, sample: &Sample) -> Usage {
        if let Some(omega) = sample.omega {
            self.q = self.q.turned(&omega.value.0, omega.dt);
        }
        if let Some(f) = sample.f.filter(|f| f.dt > 0.0) {
            let measured = self.q.rotate(&f.value.0);
            let correction = Quaternion::between(&measured, &self.environment.up()).log();
            let b = 1.0 - (-self.decay * f.dt).exp();
            self.q = Quaternion::exp(&(correction * b)) * self.q;
        }
        Usage::Full
    }

    fn attitude(&self) -> Quaternion {
        self.q
    }

    fn reset(&mut self, attitude: Quaternion) {
        self.q = attitude;
    }

    fn state(&self) -> Vec<f64> {
        self.q.to_array().to_vec()
    }

    fn set_state(&mut self, state: &[f64]) -> bool {
        let found = split_state::<0>(state);
        if let Some((q, [])) = found {
            self.q = q;
        }
        found.is_some()
    }
}

#[cfg(test)]
mod tests {
    use imufit_attitude::Frame;
    use nalgebra::Vector3;

    use super::*;
    use crate::{AngularRate, Reading, SpecificForce};

    #[test]
    fn about_one_axis_it_is_the_printed_equation() {
        let environment = Environment::new(Frame::Enu, 9.81, None).unwrap();
        let mut filter = Complementary::new(&environment, &[0.97, 0.01]);
        let (mut theta, dt) = (0.0, 0.01);
        for k in 0..200 {
            let (rate, theta_acc) = (0.3 * f64::from(k).sin(), 0.2 + 0.1 * (0.3 * f64::from(k)).cos());
            theta = 0.97 * (theta + rate * dt) + 0.03 * theta_acc;
            let f = Quaternion::exp(&(Vector3::y() * theta_acc)).rotate_back(&(Vector3::z() * 9.81));
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
            assert!((filter.attitude().log() - Vector3::y() * theta).norm() < 1e-12);
        }
    }
}
