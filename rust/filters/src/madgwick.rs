//! Madgwick's filter: gradient descent to the attitude that fits the directions (Madgwick, Harrison and Vaidyanathan,
//! ICORR 2011; the equations' numbers are those of Madgwick's report of 2010).
//!
//! ```text
//! dq_w/dt = (1/2) q (0, w_c)                                                                     (11), (12)
//! f(q)    = R(q)^T d - s                  d: direction in the Earth's frame, s: measured, both of length 1  (25), (29)
//! b       = (|(h_x, h_y)|, 0, h_z),  h = R(q) m/|m|                                               (45), (46)
//! e       = J^T f / |J^T f|               of all directions measured together                      (34), (44)
//! w_b     = zeta sum 2 (q* e) dt,    w_c = w - w_b                                                (47) to (49)
//! q_k     = q_k-1 + (dq_w/dt - beta e) dt, brought back to length 1                          (13), (33), (42), (43)
//! ```
//!
//! R^T d is the paper's polynomial, `d + 2 w (d x v) + 2 (v (v.d) - d |v|^2)` for `q = (w, v)`: with diagonal elements
//! `1 - 2 (...)`. Another form is equal on the unit sphere, but has another gradient across that sphere, and the length
//! of the gradient decides the step.
//!
//! The Earth's frame of the paper has x along the field's horizontal part and z up; the filter keeps its attitude there and
//! turns the result into the reference frame. The equations are the paper's: a step adds and renormalises, so that a turn
//! by `a` in one step comes out as `2 atan(a / 2)`, which is less by `a^3 / 12` (1 rad/s at 100 Hz: 1.7 deg in an hour without directions). The
//! descent compares the readings with the attitude of the row before, as in (42): in motion the attitude lags by up to
//! one row. What the paper leaves open:
//!
//! - The rate is the mean of both rows, as for every filter here ([`crate::intake`]).
//! - A direction that is slower than the log counts for the time since its last reading: gradients are weighed by these times,
//!   and the step is `beta` times the longest of them. Where all have the same time, that is the paper's step.
//! - A field within `min_angle` of the vertical is not used.
//! - The descent has a speed, `2 beta` rad/s, and no time constant: an error of 90 degrees takes 5 s with the default. A lost
//!   attitude is found again before that ([`crate::lost`]).

use imufit_attitude::Quaternion;
use imufit_attitude::matrix::quaternion_of_rotation;
use nalgebra::{Matrix3, Vector3};

use crate::filter::{Filter, Usage, split_state};
use crate::lost::{Follows, LOST, LOST_HEADING};
use crate::mahony::square_of_sine;
use crate::parameter::Parameter;
use crate::{Environment, Sample};

/// The gains, named as printed, and the limit of the field.
pub const PARAMETERS: &[Parameter] = &[
    Parameter {
        name: "beta",
        default: 0.16,
        unit: "rad/s",
        meaning: "speed of the descent, the gyro's error that it makes good (paper: 0.033 without, 0.041 with a magnetometer; default: back 20 s after bad samples): larger follows the vectors faster, smaller the gyro",
    },
    Parameter {
        name: "zeta",
        default: 0.0,
        unit: "rad/s^2",
        meaning: "rate at which the gyro's bias changes, by which it is learned: larger learns a bias faster and takes more motion for bias; 0 switches it off",
    },
    Parameter {
        name: "min_angle",
        default: 0.035,
        unit: "rad",
        meaning: "where the field is closer to the vertical than this it is not used: smaller accepts noisier headings",
    },
];

/// Standard deviations beyond which a heading is not explained by the field.
const SURE: f64 = 4.0;

/// Largest component of a turn in one step, rad: beyond any, and its square is a number of the machine.
const LARGEST_TURN: f64 = 1e100;

/// The filter.
#[derive(Debug, Clone)]
pub struct Madgwick {
    /// From the reference frame to the paper's.
    to_earth: Quaternion,
    beta: f64,
    zeta: f64,
    /// Square of the sine of the least angle between field and vertical.
    least_square: f64,
    /// Body to the paper's frame of the Earth.
    q: Quaternion,
    bias: Vector3<f64>,
}

/// A vector of four, as a quaternion is.
#[derive(Debug, Clone, Copy)]
struct Four {
    w: f64,
    v: Vector3<f64>,
}

/// `J^T f` of a direction `d` in the Earth's frame that is measured as `s`, both of length 1.
#[inline(always)]
fn gradient(q: Quaternion, d: &Vector3<f64>, s: &Vector3<f64>) -> Four {
    let (w, v) = (q.w(), q.vector());
    let across = d.cross(&v);
    let along = v.dot(d);
    let f = (d + across * (2.0 * w) + (v * along - d * v.norm_squared()) * 2.0) - s;
    Four {
        w: 2.0 * across.dot(&f),
        v: f.cross(d) * (2.0 * w) + (f * along + d * f.dot(&v)) * 2.0 - v * (4.0 * f.dot(d)),
    }
}

impl Madgwick {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[f64]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(PARAMETERS[at].default);
        let (up, north) = (environment.up(), environment.field_north());
        let axes = Matrix3::from_columns(&[north, up.cross(&north), up]);
        let to_earth = quaternion_of_rotation(&axes.transpose());
        Self {
            to_earth,
            beta: value(0),
            zeta: value(1),
            least_square: square_of_sine(value(2)),
            q: to_earth,
            bias: Vector3::zeros(),
        }
    }

    /// The estimated gyro bias, rad/s.
    pub fn bias(&self) -> Vector3<f64> {
        self.bias
    }

    fn put(&mut self, attitude: Quaternion) {
        self.q = self.to_earth * attitude;
    }

    /// `e` times the time of the step, s, and whether the field was of use. Nothing where there is no direction, no time or no slope.
    #[inline(always)]
    fn descent(&self, sample: &Sample) -> (Four, f64, Usage) {
        let (mut sum, mut time, mut usage) = (
            Four {
                w: 0.0,
                v: Vector3::zeros(),
            },
            0.0_f64,
            Usage::Full,
        );
        let mut add = |slope: Four, dt: f64| {
            sum.w += slope.w * dt;
            sum.v += slope.v * dt;
            time = time.max(dt);
        };
        if let Some(f) = sample.f {
            let length = f.value.0.norm();
            if length > 0.0 {
                add(gradient(self.q, &Vector3::z(), &(f.value.0 / length)), f.dt);
            }
        }
        if let Some(m) = sample.m {
            let length = m.value.0.norm();
            let measured = m.value.0 / length;
            let h = self.q.rotate(&measured);
            let across = h.x * h.x + h.y * h.y;
            // A field of zero is NaN here and fails the comparison.
            if across >= self.least_square && across > 0.0 {
                add(
                    gradient(self.q, &Vector3::new(across.sqrt(), 0.0, h.z), &measured),
                    m.dt,
                );
            } else {
                usage = Usage::NoHeading;
            }
        }
        let length = (sum.w * sum.w + sum.v.norm_squared()).sqrt();
        let scale = if length > 0.0 { 1.0 / length } else { 0.0 };
        let direction = Four {
            w: sum.w * scale,
            v: sum.v * scale,
        };
        (direction, time, usage)
    }
}

impl Filter for Madgwick {
    #[inline(always)]
    fn step(&mut self, sample: &Sample) -> Usage {
        let (e, time, usage) = self.descent(sample);
        let (w, v) = (self.q.w(), self.q.vector());
        // The vector part of 2 (q* e).
        let error = (e.v * w - v * e.w - v.cross(&e.v)) * 2.0;
        self.bias += error * (self.zeta * time);
        let mut turn = Vector3::zeros();
        if let Some(omega) = sample.omega {
            let half = (omega.value.0 - self.bias) * (0.5 * omega.dt);
            turn = half.map(|x| x.clamp(-LARGEST_TURN, LARGEST_TURN));
        }
        let step = self.beta * time;
        self.q = Quaternion::from_components(
            w - v.dot(&turn) - e.w * step,
            v + (turn * w + v.cross(&turn)) - e.v * step,
        );
        usage
    }

    #[inline(always)]
    fn attitude(&self) -> Quaternion {
        self.to_earth.inverse() * self.q
    }

    fn reset(&mut self, attitude: Quaternion) {
        self.put(attitude);
        self.bias = Vector3::zeros();
    }

    /// The attitude is that in the paper's frame.
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

impl Follows<f64> for Madgwick {
    fn limit(&self, _time: f64, _sound: &Self) -> f64 {
        LOST
    }

    fn heading_limit(&self, _sound: &Self) -> Option<f64> {
        Some(LOST_HEADING)
    }

    /// The gyro holds the heading better than a disturbed field: once found there it would be left at `2 beta` rad/s.
    fn least_heading(&self, variance: f64) -> f64 {
        SURE * variance.sqrt()
    }

    fn find(&mut self, attitude: Quaternion, sound: &Self, lost: bool) {
        if lost {
            self.put(attitude);
            self.bias = sound.bias;
        }
    }
}

#[cfg(test)]
mod tests {
    use imufit_attitude::Frame;

    use super::*;
    use crate::{AngularRate, FluxDensity, Reading, SpecificForce};

    const DT: f64 = 0.01;

    fn standing(q: Quaternion, environment: &Environment, field: Vector3<f64>, rate: Vector3<f64>) -> Sample {
        Sample {
            omega: Some(Reading {
                value: AngularRate(rate),
                dt: DT,
            }),
            f: Some(Reading {
                value: SpecificForce(q.rotate_back(&(environment.up() * 9.81))),
                dt: DT,
            }),
            m: Some(Reading {
                value: FluxDensity(q.rotate_back(&field)),
                dt: DT,
            }),
            ..Sample::default()
        }
    }

    #[test]
    fn a_wrong_start_and_a_bias_are_removed_in_every_frame_and_for_every_declination() {
        for frame in Frame::ALL {
            for declination in [0.0, 0.3, -2.0] {
                let field = Quaternion::exp(&(frame.up() * declination)).rotate(&frame.default_field());
                let environment = Environment::new(frame, 9.81, Some(field)).unwrap();
                let q = Quaternion::exp(&Vector3::new(0.4, -0.7, 1.9));
                let bias = Vector3::new(0.01, -0.02, 0.015);
                let mut filter = Madgwick::new(&environment, &[0.1, 0.002, 0.035]);
                filter.reset(Quaternion::exp(&Vector3::new(0.9, 0.2, 0.5)));
                for _ in 0..60_000 {
                    filter.step(&standing(q, &environment, field, bias));
                }
                // A descent at constant speed stays within a few steps of its end.
                let left = (q.inverse() * filter.attitude()).angle();
                assert!(left < 4.0 * 2.0 * 0.1 * DT, "{frame:?} {declination}: {left}");
                assert!((filter.bias() - bias).norm() < 2e-3, "{}", filter.bias() - bias);
            }
        }
    }

    #[test]
    fn any_setting_and_rate_stay_finite() {
        let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
        let q = Quaternion::exp(&Vector3::new(0.1, 0.3, -0.2));
        for (beta, zeta, rate) in [(1e50, 1e50, 1e150), (0.0, 0.0, 1e154), (1e-310, 1e-310, 0.0)] {
            let mut filter = Madgwick::new(&environment, &[beta, zeta, 0.035]);
            for _ in 0..50 {
                let sample = standing(q, &environment, Frame::Ned.default_field(), Vector3::repeat(rate));
                filter.step(&sample);
            }
            let square: f64 = filter.attitude().to_array().iter().map(|x| x * x).sum();
            assert!((square - 1.0).abs() < 1e-12 && filter.bias().norm().is_finite());
        }
    }

    #[test]
    fn a_field_along_the_vertical_and_one_of_zero_show_no_heading() {
        let environment = Environment::new(Frame::Enu, 9.81, None).unwrap();
        let mut filter = Madgwick::new(&environment, &[]);
        for field in [Vector3::z() * -50.0, Vector3::zeros()] {
            let sample = standing(Quaternion::IDENTITY, &environment, field, Vector3::zeros());
            assert_eq!(filter.step(&sample), Usage::NoHeading);
            // Rounding has a direction, too: the descent goes on by a step of its speed.
            assert!(filter.attitude().angle() <= 2.0 * PARAMETERS[0].default * DT + 1e-12);
        }
    }
}
