//! Complementary filter (paper B, eq. (5): `theta = a (theta_{t-1} + G_y dt) + b theta_acc`, a = 0.97, b = 0.03).
//!
//! On attitudes: the integrated rate gives a prediction, and the shortest rotation that would bring its vertical onto
//! the measured one is carried out to the fraction b = 1 - a. For rotations about one horizontal axis this is eq. (5).
//! The paper's a belongs to one step of its own sampling, which it does not state. Three ways to say it:
//!
//! | settings | weight of a reading that stands for dt |
//! |---|---|
//! | `a`, `step` | `a^(dt / step)`: a belongs to `step` seconds, and the time constant does not depend on the rate of the log |
//! | `a`, `step = 0` | `a`: for every row, as printed |
//! | `time_constant` | `exp(-dt / time_constant)`, whatever `a` and `step` |
//!
//! The heading is that of the integrated rate.

use imufit_attitude::Quaternion;

use crate::filter::{Filter, Usage, split_state};
use crate::lost::{Follows, LOST};
use crate::parameter::Parameter;
use crate::{Environment, Sample};

/// Weight and the step it belongs to, or a time constant.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "a",
        default: 0.97,
        unit: "1",
        meaning: "weight of the integrated rate over `step`, b = 1 - a that of the accelerometer (paper B: 0.97 and 0.03): larger is smoother and drifts more, smaller follows the accelerometer",
    },
    Parameter {
        name: "step",
        default: 0.01,
        unit: "s",
        meaning: "time that `a` belongs to; the time constant is -step / ln(a), 0.33 s by default. 0: `a` belongs to every row, as printed",
    },
    Parameter {
        name: "time_constant",
        default: 0.0,
        unit: "s",
        meaning: "instead of `a` and `step`: a = exp(-dt / time_constant) with the real interval dt of the readings; larger is smoother. 0: not used",
    },
];

/// How b follows from the time that a reading stands for.
#[derive(Debug, Clone, Copy)]
enum Weight {
    /// The same for every reading.
    PerReading(f64),
    /// Decay of an inclination error, 1/s; infinite where only the accelerometer counts.
    PerTime(f64),
}

impl Weight {
    /// b = 1 - a for a reading that stands for `dt` seconds.
    fn of_accelerometer(self, dt: f64) -> f64 {
        match self {
            Self::PerReading(b) => b,
            Self::PerTime(decay) => -(-decay * dt).exp_m1(),
        }
    }
}

/// The filter.
#[derive(Debug, Clone)]
pub struct Complementary {
    environment: Environment,
    weight: Weight,
    q: Quaternion,
}

impl Complementary {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[f64]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(PARAMETERS[at].default);
        let (a, step, time_constant) = (value(0).min(1.0), value(1), value(2));
        let weight = if time_constant > 0.0 {
            Weight::PerTime(1.0 / time_constant)
        } else if step > 0.0 {
            Weight::PerTime(if a < 1.0 { -a.ln() / step } else { 0.0 })
        } else {
            Weight::PerReading(1.0 - a)
        };
        Self {
            environment: *environment,
            weight,
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
            let b = self.weight.of_accelerometer(f.dt);
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
        let found = split_state::<f64, 0>(state);
        if let Some((q, [])) = found {
            self.q = q;
        }
        found.is_some()
    }
}

impl Follows<f64> for Complementary {
    fn limit(&self, _time: f64, _sound: &Self) -> f64 {
        LOST
    }

    fn heading_limit(&self, _sound: &Self) -> Option<f64> {
        None
    }

    fn find(&mut self, attitude: Quaternion, _sound: &Self, lost: bool) {
        self.q = attitude.select(lost, self.q);
    }
}

#[cfg(test)]
mod tests {
    use imufit_attitude::Frame;
    use nalgebra::Vector3;

    use super::*;
    use crate::{AngularRate, Reading, SpecificForce};

    /// Follows eq. (5) about y with the weight that `a_of` gives for each step.
    fn follows_the_printed_equation(values: [f64; 3], a_of: impl Fn(f64) -> f64) {
        let environment = Environment::new(Frame::Enu, 9.81, None).unwrap();
        let mut filter = Complementary::new(&environment, &values);
        let mut theta = 0.0;
        for k in 0..200 {
            let dt = if k % 3 == 0 { 0.02 } else { 0.01 };
            let (rate, theta_acc) = (0.3 * f64::from(k).sin(), 0.2 + 0.1 * (0.3 * f64::from(k)).cos());
            let a = a_of(dt);
            theta = a * (theta + rate * dt) + (1.0 - a) * theta_acc;
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
                ..Sample::default()
            });
            assert!((filter.attitude().log() - Vector3::y() * theta).norm() < 1e-12);
        }
    }

    #[test]
    fn about_one_axis_it_is_the_printed_equation() {
        follows_the_printed_equation([0.97, 0.01, 0.0], |dt| 0.97_f64.powf(dt / 0.01));
        follows_the_printed_equation([0.97, 0.0, 0.0], |_| 0.97);
        follows_the_printed_equation([0.97, 0.01, 0.4], |dt| (-dt / 0.4).exp());
        follows_the_printed_equation([1.0, 0.01, 0.0], |_| 1.0);
        follows_the_printed_equation([0.0, 0.01, 0.0], |_| 0.0);
        follows_the_printed_equation([0.0, 0.0, 0.0], |_| 0.0);
    }
}
