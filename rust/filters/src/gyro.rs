//! Integration of the angular rate (paper B, eq. (4): `theta = theta_{t-1} + integral omega dt`).
//!
//! On attitudes instead of one angle: `q_k = q_{k-1} exp(omega dt)` with the mean of the rates at both ends of the
//! step, so that a constant rate is integrated exactly and a varying one to second order.

use imufit_attitude::Quaternion;

use crate::Sample;
use crate::filter::{Filter, Usage, split_state};
use crate::parameter::Parameter;

/// None.
pub const PARAMETERS: &[Parameter] = &[];

/// The filter: an attitude and no correction.
#[derive(Debug, Clone, Default)]
pub struct Gyro {
    q: Quaternion,
}

impl Filter for Gyro {
    fn step(&mut self, sample: &Sample) -> Usage {
        if let Some(omega) = sample.omega {
            self.q = self.q.turned(&omega.value.0, omega.dt);
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

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::{AngularRate, Reading};

    #[test]
    fn a_constant_rate_is_integrated_exactly() {
        let omega = Vector3::new(0.3, -1.1, 0.7);
        let mut filter = Gyro::default();
        for k in 0..1000 {
            let dt = if k % 3 == 0 { 0.02 } else { 0.005 };
            filter.step(&Sample {
                omega: Some(Reading {
                    value: AngularRate(omega),
                    dt,
                }),
                ..Sample::default()
            });
        }
        let total = (0..1000).map(|k| if k % 3 == 0 { 0.02 } else { 0.005 }).sum::<f64>();
        let expected = Quaternion::exp(&(omega * total));
        assert!((expected.inverse() * filter.attitude()).angle() < 1e-12);
    }
}
