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
//!
//! Q and R follow from noise densities and the time that a step or a reading stands for, so that they are the sensor's and
//! not the log's. With `adaptive` R is the power of the vibration where that is more than the sensor's noise
//! ([`crate::vibration`]); with `steady` the gain is the one of the settled filter from the first reading on
//! ([`crate::steady_state`]).

use imufit_attitude::Quaternion;
use nalgebra::Vector3;

use crate::filter::{Filter, Usage, split_state};
use crate::lost::{Follows, LOST};
use crate::parameter::{Parameter, fill};
use crate::steady_state::{Noise, SteadyState, gains, slowest};
use crate::vibration::Vibration;
use crate::{Environment, FilterError, Sample};

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
    Parameter {
        name: "adaptive",
        default: 0.0,
        unit: "1",
        meaning: "weight of the measured vibration in the variance of the accelerometer's angle: 0 takes it at its noise, 1 for as bad as it shakes, larger for worse",
    },
    Parameter {
        name: "vibration_time",
        default: 0.5,
        unit: "s",
        meaning: "time over which vibration is measured, with `adaptive`: larger distrusts longer after a blow and takes slower accelerations for vibration",
    },
    Parameter {
        name: "steady",
        default: 0.0,
        unit: "1",
        meaning: "1: the gain of the settled filter from the first reading on, whatever the initial uncertainties; 0: the gain of the covariance",
    },
];

impl Noise {
    /// Out of the values of [`PARAMETERS`].
    pub fn from_values(values: &[f64]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(PARAMETERS[at].default);
        Self {
            gyr: value(0),
            walk: value(1),
            acc: value(2),
        }
    }
}

/// Where the filter settles, for its settings by name and readings `dt` seconds apart.
pub fn steady_state_gain(settings: &[(String, f64)], dt: f64) -> Result<SteadyState, FilterError> {
    let refuse = |name, value, range| {
        let filter = "kalman";
        Err(FilterError::Setting {
            filter,
            name,
            value,
            range,
        })
    };
    if !(dt.is_finite() && dt > 0.0) {
        return refuse("dt", dt, "a positive number of seconds");
    }
    let noise = Noise::from_values(&fill("kalman", PARAMETERS, settings)?);
    let Some((angle, bias)) = gains(&noise, dt, noise.angle_variance(dt)) else {
        return refuse("dt", dt, "beyond all measure with these noises");
    };
    let time_constant = -dt / slowest(angle, -bias * dt);
    Ok(SteadyState {
        angle,
        bias,
        time_constant,
    })
}

/// The filter.
#[derive(Debug, Clone)]
pub struct Kalman {
    environment: Environment,
    noise: Noise,
    angle_start: f64,
    bias_start: f64,
    adaptive: f64,
    vibration_time: f64,
    steady: bool,
    q: Quaternion,
    bias: Vector3<f64>,
    /// p_aa, p_ab, p_bb.
    covariance: [f64; 3],
    vibration: Vibration,
}

impl Kalman {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[f64]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(PARAMETERS[at].default);
        let mut filter = Self {
            environment: *environment,
            noise: Noise::from_values(values),
            angle_start: value(3),
            bias_start: value(4),
            adaptive: value(5),
            vibration_time: value(6),
            steady: value(7) > 0.0,
            q: Quaternion::IDENTITY,
            bias: Vector3::zeros(),
            covariance: [0.0; 3],
            vibration: Vibration::NONE,
        };
        filter.reset(Quaternion::IDENTITY);
        filter
    }

    fn predict(&mut self, dt: f64) {
        let Noise { gyr, walk, .. } = self.noise;
        let [p_aa, p_ab, p_bb] = self.covariance;
        self.covariance = [
            p_aa + dt * (dt * p_bb - 2.0 * p_ab) + gyr * gyr * dt,
            p_ab - dt * p_bb,
            p_bb + walk * walk * dt,
        ];
    }

    /// The variance of the angle that this reading shows, rad^2.
    fn angle_variance(&mut self, f: &Vector3<f64>, dt: f64) -> f64 {
        let r = self.noise.angle_variance(dt);
        if self.adaptive == 0.0 {
            return r;
        }
        let reading = f / self.environment.gravity();
        let shaken = self.vibration.variance(&reading, dt, self.vibration_time);
        r.max(self.adaptive * shaken)
    }

    /// The gains of angle and bias for a reading of variance `r`, and the covariance after it (Joseph form).
    fn gains(&self, dt: f64, r: f64) -> Option<([f64; 2], [f64; 3])> {
        if self.steady {
            let (k_a, k_b) = gains(&self.noise, dt, r)?;
            return Some(([k_a, k_b], self.covariance));
        }
        let [p_aa, p_ab, p_bb] = self.covariance;
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
            let rate = omega.value.0 - self.bias;
            self.q = self.q.turned(&rate, omega.dt);
            self.predict(omega.dt);
            self.covariance[0] += sample.unsure_turn * sample.unsure_turn;
            if self.adaptive > 0.0 {
                self.vibration.turn(&rate, omega.dt);
            }
        }
        let Some(f) = sample.f else {
            return Usage::Full;
        };
        let r = self.angle_variance(&f.value.0, f.dt) + sample.unsure_tilt * sample.unsure_tilt;
        if f.dt > 0.0
            && let Some(([k_a, k_b], after)) = self.gains(f.dt, r)
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
        (self.q, self.bias, self.vibration) = (attitude, Vector3::zeros(), Vibration::NONE);
        self.covariance = [
            self.angle_start * self.angle_start,
            0.0,
            self.bias_start * self.bias_start,
        ];
    }

    fn state(&self) -> Vec<f64> {
        let mut state = self.q.to_array().to_vec();
        let Vibration { mean, power } = self.vibration;
        state.extend(self.bias.iter().chain(&self.covariance).chain(mean.iter()));
        state.push(power);
        state
    }

    fn set_state(&mut self, state: &[f64]) -> bool {
        let found = split_state(state);
        if let Some((q, [x, y, z, p_aa, p_ab, p_bb, m_x, m_y, m_z, power])) = found {
            (self.q, self.bias, self.covariance) = (q, Vector3::new(x, y, z), [p_aa, p_ab, p_bb]);
            let mean = Vector3::new(m_x, m_y, m_z);
            self.vibration = Vibration { mean, power };
        }
        found.is_some()
    }
}

impl Follows<f64> for Kalman {
    fn limit(&self, _time: f64, _sound: &Self) -> f64 {
        LOST
    }

    fn heading_limit(&self, _sound: &Self) -> Option<f64> {
        None
    }

    fn find(&mut self, attitude: Quaternion, sound: &Self, lost: bool) {
        if lost {
            (self.q, self.bias, self.covariance) = (attitude, sound.bias, sound.covariance);
        }
    }
}

#[cfg(test)]
mod tests {
    use imufit_attitude::Frame;

    use nalgebra::{Matrix2, RowVector2};
    use proptest::prelude::*;

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
                ..Sample::default()
            });
            assert!((filter.attitude().log() - Vector3::y() * x[0]).norm() < 1e-12);
            assert!((filter.bias - Vector3::y() * x[1]).norm() < 1e-12);
        }
    }

    proptest! {
        #[test]
        fn one_more_reading_changes_nothing(gyr in -4.0..-2.0, walk in -5.0..-2.0, acc in -4.0..-1.0, dt in -3.0..0.0) {
            let [gyr, walk, acc, dt] = [gyr, walk, acc, dt].map(|power: f64| 10_f64.powf(power));
            let settings = [("gyr_noise", gyr), ("bias_walk", walk), ("acc_noise", acc)].map(|(name, value)| (name.to_owned(), value));
            let found = steady_state_gain(&settings, dt).unwrap();
            let (f, h) = (Matrix2::new(1.0, -dt, 0.0, 1.0), RowVector2::new(1.0, 0.0));
            let (q, r) = (Matrix2::new(gyr * gyr * dt, 0.0, 0.0, walk * walk * dt), acc * acc / dt);
            // The covariance before a reading that has these gains, and before the next one.
            let s = r / (1.0 - found.angle);
            let (p_aa, p_ab) = (found.angle * s, found.bias * s);
            let p_bb = q[(1, 1)] - found.angle * found.bias * s / dt;
            let before = Matrix2::new(p_aa, p_ab, p_ab, p_bb);
            let gain = before * h.transpose() / (p_aa + r);
            let after = f * (before - gain * (h * before)) * f.transpose() + q;
            for (now, next) in before.iter().zip(&after) {
                prop_assert!((now - next).abs() < 1e-9 * now.abs(), "{before} {after}");
            }
            let closed = (Matrix2::identity() - gain * h) * f;
            let largest = closed.complex_eigenvalues().iter().map(|z| z.norm()).fold(0.0, f64::max);
            let rate = dt / found.time_constant;
            prop_assert!((rate + largest.ln()).abs() < 1e-6 * rate + 1e-9, "{found:?} {largest}");
        }
    }

    #[test]
    fn the_ends_of_the_range_have_their_limits() {
        let of = |values: [f64; 3], dt: f64| {
            let names = ["gyr_noise", "bias_walk", "acc_noise"];
            let settings: Vec<_> = names.iter().map(|name| (*name).to_owned()).zip(values).collect();
            steady_state_gain(&settings, dt)
        };
        let held = of([0.0, 0.0, 1e-2], 0.01).unwrap();
        assert_eq!((held.angle, held.bias, held.time_constant), (0.0, 0.0, f64::INFINITY));
        let followed = of([1e-3, 0.0, 0.0], 0.01).unwrap();
        assert_eq!((followed.angle, followed.time_constant), (1.0, 0.0));
        // Without a bias the gain is that of a random walk seen through white noise.
        let (q, r): (f64, f64) = (1e-6 * 0.01, 1e-4 / 0.01);
        let p = 0.5 * (q + (q * q + 4.0 * q * r).sqrt());
        assert!((of([1e-3, 0.0, 1e-2], 0.01).unwrap().angle - p / (p + r)).abs() < 1e-12);
        let refused = |dt: f64, why: &str| of([1e-3, 0.0, 1e-2], dt).unwrap_err().to_string().contains(why);
        assert!(refused(0.0, "dt = 0 is out of range") && refused(1e-315, "beyond all measure"));
    }
}
