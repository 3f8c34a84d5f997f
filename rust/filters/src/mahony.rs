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
//! **Recovery.** One reading with NaN or infinity, free fall and a field along the vertical leave no error behind but that of
//! the gyro. An error of up to 90 degrees, left by a saturated gyro or by a gap, is below a tenth of itself
//! `8 / (k_p min(k_1, k_2))` s after good readings return, and a larger one is found again at once ([`crate::lost`]).
//!
//! The paper's gains `[k_1 k_2 k_I k_P]`, [`AS_IN_FIGURE_3`] (the text prints `[1 - 0.2 20]`) and [`AS_IN_FIGURE_4`], suit
//! a slow robot arm. The defaults are softer: found on hand-moved recordings with optical reference (BROAD), where they
//! give 1.5 to 4 degrees on rotations and slow translations.

use imufit_attitude::{Quaternion, Real};
use nalgebra::{SimdBool, Vector3};

use crate::filter::{Filter, Usage, split_state};
use crate::lost::{Follows, LOST, LOST_HEADING};
use crate::parameter::Parameter;
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

/// Square of the least horizontal field, uT^2, whose reciprocal is a number of the machine.
const LEAST: f64 = 1e-290;

/// The filter.
#[derive(Debug, Clone)]
pub struct Mahony<T = f64> {
    /// +1 where z points up, -1 where it points down: up is along z in every frame.
    up_z: T,
    /// x and y of north x up, so that `v x north = up (v . across)` for a horizontal v.
    across: [T; 2],
    /// k_1 / 2 and k_2 / 2.
    half_weights: [T; 2],
    half_k_i: T,
    k_p: T,
    per_k_p: T,
    /// Square of the sine of the least angle between field and vertical.
    least_square: T,
    q: Quaternion<T>,
    bias: Vector3<T>,
}

/// What the vectors of one sample say of a filter's attitude.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Innovation<T> {
    /// Eq. (5) times the time that each vector stands for: body frame, s.
    pub w_mes: Vector3<T>,
    /// k_i / 2 times that time, summed, s.
    pub weight: T,
    /// Whether the field was of use.
    pub usage: Usage,
}

impl<T: Real> Mahony<T> {
    /// With the values of [`PARAMETERS`] in their order.
    pub fn new(environment: &Environment, values: &[T]) -> Self {
        let value = |at: usize| values.get(at).copied().unwrap_or(T::splat(PARAMETERS[at].default));
        let up = environment.up();
        let across = environment.field_north().cross(&up);
        let half = T::splat(0.5);
        Self {
            up_z: T::splat(up.z),
            across: [T::splat(across.x), T::splat(across.y)],
            half_weights: [value(0) * half, value(1) * half],
            half_k_i: value(2) * half,
            k_p: value(3),
            per_k_p: T::splat(1.0) / value(3),
            least_square: square_of_sine(value(4)),
            q: Quaternion::default(),
            bias: Vector3::repeat(T::splat(0.0)),
        }
    }

    /// The estimated gyro bias b^, rad/s.
    pub fn bias(&self) -> Vector3<T> {
        self.bias
    }

    /// Puts the attitude elsewhere; the bias stays.
    pub(crate) fn put(&mut self, attitude: Quaternion<T>) {
        self.q = attitude;
    }

    /// The attitude turned by the rate of the sample less the bias; still to be brought back onto the unit sphere.
    #[inline(always)]
    pub(crate) fn predicted(&self, sample: &Sample) -> Quaternion<T> {
        let Some(omega) = sample.omega else {
            return self.q;
        };
        let rate = omega.value.0.map(T::splat) - self.bias;
        self.q
            .times(Quaternion::exp_of_half(&(rate * T::splat(0.5 * omega.dt))))
    }

    /// Turns attitude and bias by an innovation, by no more than the error it shows.
    #[inline(always)]
    pub(crate) fn correct(&mut self, predicted: Quaternion<T>, w_mes: &Vector3<T>, weight: T) {
        let (one, half) = (T::splat(1.0), T::splat(0.5));
        let longest = one / weight;
        // The renormalisation does not wait for the innovation.
        let half = w_mes * (self.k_p.simd_min(longest) * half);
        let limit = one.simd_min(longest * self.per_k_p);
        self.q = predicted.kept().times(Quaternion::exp_of_half(&half));
        let bias = self.bias - w_mes * (limit * self.half_k_i);
        let finite = (bias.x + bias.y + bias.z).simd_abs().simd_le(T::splat(f64::MAX));
        self.bias = if finite.all() {
            bias
        } else {
            bias.zip_map(&self.bias, |new, old| new.select(finite, old))
        };
    }

    /// Eq. (5).
    #[inline(always)]
    fn innovation(&self, q: Quaternion<T>, sample: &Sample) -> Innovation<T> {
        let zero = T::splat(0.0);
        let vertical = q.vertical();
        let (mut w_mes, mut weight, mut usage) = (Vector3::repeat(zero), zero, Usage::Full);
        if let Some(f) = sample.f {
            let length = f.value.0.norm();
            if length > 0.0 {
                let gain = self.half_weights[0] * T::splat(f.dt);
                let scale = self.up_z * (gain / T::splat(length));
                w_mes = f.value.0.map(T::splat).cross(&vertical) * scale;
                weight = gain;
            }
        }
        if let Some(m) = sample.m {
            let m_n = q.rotate(&m.value.0.map(T::splat));
            let (x, y) = (m_n.x, m_n.y);
            let square = x * x + y * y;
            let whole = T::splat(m.value.0.norm_squared());
            let shows = square.simd_ge(self.least_square * whole) & square.simd_ge(T::splat(LEAST));
            if !shows.all() {
                usage = Usage::NoHeading;
            }
            let gain = (self.half_weights[1] * T::splat(m.dt)).select(shows, zero);
            let signed = self.up_z * gain;
            // Root and reciprocal do not wait for each other.
            let per_length = square.simd_sqrt() * (T::splat(1.0) / square);
            let heading = ((self.across[0] * x + self.across[1] * y) * signed) * per_length;
            w_mes += vertical * heading.select(shows, zero);
            weight += gain;
        }
        Innovation { w_mes, weight, usage }
    }
}

/// Of the least angle between field and vertical, at most 1.5 rad.
pub(crate) fn square_of_sine<T: Real>(angle: T) -> T {
    let sine = angle.simd_min(T::splat(1.5)).simd_sin();
    sine * sine
}

impl<T: Real> Filter<T> for Mahony<T> {
    #[inline(always)]
    fn step(&mut self, sample: &Sample) -> Usage {
        let predicted = self.predicted(sample);
        let Innovation { w_mes, weight, usage } = self.innovation(predicted, sample);
        self.correct(predicted, &w_mes, weight);
        usage
    }

    #[inline(always)]
    fn attitude(&self) -> Quaternion<T> {
        self.q
    }

    fn reset(&mut self, attitude: Quaternion) {
        (self.q, self.bias) = (attitude.splat(), Vector3::repeat(T::splat(0.0)));
    }

    fn state(&self) -> Vec<T> {
        let [w, x, y, z] = self.q.to_array();
        vec![w, x, y, z, self.bias.x, self.bias.y, self.bias.z]
    }

    fn set_state(&mut self, state: &[T]) -> bool {
        let found = split_state(state);
        if let Some((q, bias)) = found {
            (self.q, self.bias) = (q, Vector3::from(bias));
        }
        found.is_some()
    }
}

impl<T: Real> Follows<T> for Mahony<T> {
    fn limit(&self, _time: f64, _sound: &Self) -> T {
        T::splat(LOST)
    }

    fn heading_limit(&self, _sound: &Self) -> Option<T> {
        Some(T::splat(LOST_HEADING))
    }

    fn find(&mut self, attitude: Quaternion<T>, sound: &Self, lost: T::SimdBool) {
        self.q = attitude.select(lost, self.q);
        self.bias = sound.bias.zip_map(&self.bias, |sound, own| sound.select(lost, own));
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
            ..Sample::default()
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
        let mut filter = Mahony::<f64>::new(&environment, &[]);
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
