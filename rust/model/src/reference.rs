//! Kinematics of the body from the reference attitude and position, at any time.
//!
//! Around each time the attitude is written R(t) = R_c exp(phi(t)) with R_c the nearest knot; phi is a local polynomial
//! ([`crate::smoothing`]), so that omega = J_r(phi) dphi/dt with the right Jacobian J_r of SO(3).

use std::array::from_fn;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::interpolated::Course;
use crate::knots::Knots;
use crate::polynomials::Polynomials;
use crate::reference_clock::ReferenceClock;
use crate::rotation_rates::rates;
use crate::smoothing::{Derivatives, Smoothing};
use crate::usual_step::usual_step;
use crate::window::Window;

/// State of the body at one time.
#[derive(Clone, Copy, Debug)]
pub struct Kinematics {
    /// Attitude, body to reference frame.
    pub attitude: UnitQuaternion<f64>,
    /// Angular rate in the body frame, rad/s.
    pub omega: Vector3<f64>,
    /// Angular acceleration in the body frame, rad/s^2.
    pub alpha: Vector3<f64>,
    /// Acceleration in the reference frame, m/s^2 (zero without a reference position).
    pub acceleration: Vector3<f64>,
    /// Jerk in the reference frame, m/s^3.
    pub jerk: Vector3<f64>,
    /// Derivative of `alpha` in the body frame, rad/s^3.
    pub alpha_rate: Vector3<f64>,
    /// Derivative of `jerk`, m/s^4.
    pub snap: Vector3<f64>,
    /// What the narrower polynomials, which follow every detail of the motion and of the reference's noise, add to `omega`.
    pub omega_detail: Vector3<f64>,
    /// The same for `acceleration`.
    pub acceleration_detail: Vector3<f64>,
}

/// What the reference says at each knot.
enum Samples {
    Attitudes(Vec<UnitQuaternion<f64>>),
    Positions(Vec<[f64; 3]>),
}

/// Attitude or position of the reference over a window: its knots, and what surrounds each.
pub struct LocalReference {
    knots: Knots,
    samples: Samples,
}

/// Values around a knot: rotation vectors from its attitude, rad, or positions relative to its own, m.
pub struct Neighbourhood {
    /// Number of the first knot that has a value.
    first: usize,
    values: Vec<[f64; 3]>,
}

impl Neighbourhood {
    /// Values of a knot and of so many on each side, where these are known.
    pub fn within(&self, knot: usize, half_width: usize) -> Option<&[[f64; 3]]> {
        let begin = knot.checked_sub(self.first + half_width)?;
        self.values.get(begin..=begin + 2 * half_width)
    }
}

fn quaternion_at(column: &[f64], row: usize) -> UnitQuaternion<f64> {
    let q = &column[4 * row..4 * row + 4];
    UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]))
}

/// Rotation vectors longer than this, rad, are about to wrap around.
const WRAPS: f64 = 2.8;
/// Up to this square of x the series of [`ARC_SINE`] is exact to rounding.
const SMALL: f64 = 0.04;
/// asin(x) / x in powers of x squared.
const ARC_SINE: [f64; 12] = {
    let mut out = [1.0; 12];
    // (2 k)! / (4^k k!^2), which the coefficients are over 2 k + 1.
    let mut ratio = 1.0;
    let mut k = 1;
    while k < 12 {
        let kf = k as f64;
        ratio *= (2.0 * kf - 1.0) / (2.0 * kf);
        out[k] = ratio / (2.0 * kf + 1.0);
        k += 1;
    }
    out
};

/// Rotation vector of a turn; neighbouring knots are a small one apart, and a series is quicker than an arc tangent.
fn rotation_vector(turn: &UnitQuaternion<f64>) -> Vector3<f64> {
    let series = |square: f64| ARC_SINE.iter().rev().fold(0.0, |sum, c| sum * square + c);
    let sine = turn.imag();
    let square = sine.norm_squared();
    if turn.w > 0.0 && square <= SMALL {
        return sine * (2.0 * series(square));
    }
    // The same of a quarter of the angle.
    let quarter = 0.5 * (1.0 - turn.w);
    if turn.w > 0.0 && quarter <= SMALL {
        return sine * (4.0 * (quarter / square).sqrt() * series(quarter));
    }
    turn.scaled_axis()
}

impl LocalReference {
    /// Attitude knots of a window; `None` without a reference attitude. `spacing` is the usual time between knots,
    /// taken from the window if not given.
    pub fn attitude(window: &Window, spacing: Option<f64>) -> Option<Self> {
        let q = window.attitude?;
        let known = |i: usize| q[4 * i..4 * i + 4].iter().all(|v| v.is_finite());
        let change = |i: usize, j: usize| {
            let cosine = quaternion_at(q, i).coords.dot(&quaternion_at(q, j).coords);
            1.0 - cosine.powi(2)
        };
        let course = |[i, j, k]: [usize; 3], part: f64| {
            let back = quaternion_at(q, i).inverse();
            let way = rotation_vector(&(back * quaternion_at(q, k)));
            Course {
                bend: rotation_vector(&(back * quaternion_at(q, j))) - way * part,
                way,
            }
        };
        let knots = Knots::new(window, known, change, course, spacing);
        let attitudes = knots.row.iter().map(|row| quaternion_at(q, *row)).collect();
        Some(Self {
            knots,
            samples: Samples::Attitudes(attitudes),
        })
    }

    /// Position knots of a window; `None` without a reference position.
    pub fn position(window: &Window, spacing: Option<f64>) -> Option<Self> {
        let p = window.position?;
        let known = |i: usize| p[3 * i..3 * i + 3].iter().all(|v| v.is_finite());
        let change = |i: usize, j: usize| {
            (0..3)
                .map(|axis| (p[3 * i + axis] - p[3 * j + axis]).powi(2))
                .sum::<f64>()
        };
        let course = |[i, j, k]: [usize; 3], part: f64| {
            let from_first = |row: usize| Vector3::from_fn(|axis, _| p[3 * row + axis] - p[3 * i + axis]);
            let way = from_first(k);
            Course {
                bend: from_first(j) - way * part,
                way,
            }
        };
        let knots = Knots::new(window, known, change, course, spacing);
        let at = |row: &usize| from_fn(|axis| p[3 * row + axis]);
        let positions = knots.row.iter().map(at).collect();
        Some(Self {
            knots,
            samples: Samples::Positions(positions),
        })
    }

    /// Usual time between the knots.
    pub fn spacing(&self) -> f64 {
        usual_step(&self.knots.t)
    }

    /// Samples of a packet; 1 where every sample has a stamp of its own.
    pub fn packet(&self) -> usize {
        self.knots.packet
    }

    /// Number of the knot nearest to a time; `None` where none is near. The search begins at `hint`.
    pub fn nearest(&self, at: f64, hint: &mut usize) -> Option<usize> {
        self.knots.nearest(at, hint)
    }

    /// What lies around a knot, at most so many knots to each side: nothing beyond a gap, nor where a rotation vector is about to wrap around.
    pub fn around(&self, knot: usize, most: usize) -> Neighbourhood {
        let (begin, end) = self.knots.segment(knot);
        let rows = knot.saturating_sub(most).max(begin)..(knot + most + 1).min(end);
        match &self.samples {
            Samples::Attitudes(attitudes) => {
                let back = attitudes[knot].inverse();
                let vector = |k: usize| rotation_vector(&(back * attitudes[k]));
                let tame = |phi: &Vector3<f64>| phi.norm_squared() <= WRAPS * WRAPS;
                let mut vectors: Vec<_> = (rows.start..knot).rev().map(vector).take_while(tame).collect();
                let first = knot - vectors.len();
                vectors.reverse();
                vectors.extend((knot..rows.end).map(vector).take_while(tame));
                Neighbourhood {
                    first,
                    values: vectors.iter().map(|phi| [phi.x, phi.y, phi.z]).collect(),
                }
            }
            Samples::Positions(positions) => {
                // What is taken off so that large coordinates keep their digits does not matter to derivatives.
                let origin = positions[knot];
                let relative = |p: &[f64; 3]| from_fn(|axis| p[axis] - origin[axis]);
                Neighbourhood {
                    first: rows.start,
                    values: positions[rows].iter().map(relative).collect(),
                }
            }
        }
    }

    /// For each knot the one whose neighbourhood serves it: the middle of a run of at most so many knots that no gap parts.
    pub fn middles(&self, most: usize) -> Vec<usize> {
        self.knots.middles(most)
    }

    /// Times of a knot and of so many on each side, s.
    pub fn times_around(&self, knot: usize, half_width: usize) -> &[f64] {
        &self.knots.t[knot - half_width..=knot + half_width]
    }

    /// Attitude at a knot; none for positions.
    pub fn attitude_at(&self, knot: usize) -> Option<UnitQuaternion<f64>> {
        match &self.samples {
            Samples::Attitudes(attitudes) => attitudes.get(knot).copied(),
            Samples::Positions(_) => None,
        }
    }

    /// Order of the first of the four derivatives: of a position the value is relative to an arbitrary origin.
    pub const fn lowest(&self) -> usize {
        match self.samples {
            Samples::Attitudes(_) => 0,
            Samples::Positions(_) => 1,
        }
    }

    /// Times of the knots, s.
    pub fn times(&self) -> &[f64] {
        &self.knots.t
    }
}

/// Polynomials for one reference quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Widths {
    /// For the ideal readings that measured ones are compared with: nothing of the motion may be lost.
    pub value: Smoothing,
    /// For what enters columns, where noise would shrink every parameter (errors in variables).
    pub columns: Smoothing,
    /// For second derivatives of what a sensor reads: what a smoothed reference has lost.
    pub bends: Smoothing,
}

impl Widths {
    /// One polynomial for all.
    pub const fn alike(smoothing: Smoothing) -> Self {
        Self {
            value: smoothing,
            columns: smoothing,
            bends: smoothing,
        }
    }

    /// Most knots that any of them takes on each side.
    pub fn widest(&self) -> usize {
        let Self { value, columns, bends } = self;
        value.half_width.max(columns.half_width).max(bends.half_width)
    }
}

/// Rates from a rotation vector and its first three derivatives: angular rate, its first and its second derivative.
fn rates_of(d: &Derivatives) -> [Vector3<f64>; 3] {
    let [phi, d, dd, ddd] = d.map(Vector3::from);
    let found = rates(phi, d, dd, ddd);
    [found.omega, found.alpha, found.alpha_rate]
}

/// What the position's polynomial gives: acceleration, jerk and snap.
fn above_velocity(d: &Derivatives) -> [Vector3<f64>; 3] {
    [d[1], d[2], d[3]].map(Vector3::from)
}

/// Attitude and position of a window's reference by their polynomials, whatever the clock.
pub struct WindowReference {
    rotation: Option<Polynomials>,
    translation: Option<Polynomials>,
}

impl WindowReference {
    /// Of a window; `spacing` is the usual time between reference samples.
    pub fn new(window: &Window, attitude: Widths, position: Option<Widths>, spacing: Option<f64>) -> Self {
        let polynomials = |reference: Option<LocalReference>, widths| Some(Polynomials::new(reference?, widths));
        Self {
            rotation: polynomials(LocalReference::attitude(window, spacing), attitude),
            translation: position.and_then(|w| polynomials(LocalReference::position(window, spacing), w)),
        }
    }

    /// Numbers that are kept at most.
    pub fn numbers(&self) -> usize {
        let both = [&self.rotation, &self.translation];
        both.into_iter().flatten().map(Polynomials::numbers).sum()
    }

    /// Kinematics of each core row of the window, by a clock; `None` in a row where the reference does not tell.
    pub fn kinematics(&self, window: &Window, clock: ReferenceClock) -> Vec<Option<Kinematics>> {
        let mut rotation = self.rotation.as_ref().map(Polynomials::reader);
        let mut translation = self.translation.as_ref().map(Polynomials::reader);
        let mut at = |t: f64| {
            let turning = rotation.as_mut()?.at(t)?;
            let [[of_value, ..], [omega, alpha, _], [.., alpha_rate]] = turning.by_width(rates_of);
            let [[of_position, ..], [acceleration, jerk, _], [.., snap]] = match translation.as_mut() {
                None => [[Vector3::zeros(); 3]; 3],
                Some(reader) => reader.at(t)?.by_width(above_velocity),
            };
            // On the clock of the sensors.
            let rate = clock.rate();
            Some(Kinematics {
                attitude: turning.attitude()?,
                omega: omega * rate,
                alpha: alpha * rate.powi(2),
                alpha_rate: alpha_rate * rate.powi(3),
                acceleration: acceleration * rate.powi(2),
                jerk: jerk * rate.powi(3),
                snap: snap * rate.powi(4),
                omega_detail: (of_value - omega) * rate,
                acceleration_detail: (of_position - acceleration) * rate.powi(2),
            })
        };
        let times = &window.t[window.begin..window.end];
        times.iter().map(|t| at(clock.at(*t))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::smoothing::NARROWEST;

    fn read(window: &Window, clock: ReferenceClock) -> Vec<Option<Kinematics>> {
        WindowReference::new(window, Widths::alike(NARROWEST), None, None).kinematics(window, clock)
    }

    /// Two sines about fixed axes one after the other: omega and alpha are known in closed form.
    fn truth(t: f64) -> (UnitQuaternion<f64>, Vector3<f64>, Vector3<f64>) {
        let (w1, w2) = (2.0 * std::f64::consts::PI * 2.0, 2.0 * std::f64::consts::PI * 1.3);
        let (a, da, dda) = (
            0.3 * (w1 * t).sin(),
            0.3 * w1 * (w1 * t).cos(),
            -0.3 * w1 * w1 * (w1 * t).sin(),
        );
        let (b, db, ddb) = (
            0.5 * (w2 * t).cos(),
            -0.5 * w2 * (w2 * t).sin(),
            -0.5 * w2 * w2 * (w2 * t).cos(),
        );
        let q = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), a)
            * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), b);
        // omega = x db + Rx(b)^T z da
        let z = Vector3::new(0.0, b.sin(), b.cos());
        let dz = Vector3::new(0.0, b.cos(), -b.sin()) * db;
        (q, Vector3::x() * db + z * da, Vector3::x() * ddb + z * dda + dz * da)
    }

    #[test]
    fn rate_and_angular_acceleration_of_a_two_hertz_motion_are_exact_to_a_millionth() {
        let n = 400;
        let t: Vec<f64> = (0..n).map(|i| f64::from(i) * 0.01).collect();
        let q: Vec<f64> = t
            .iter()
            .flat_map(|v| {
                let q = truth(*v).0;
                [q.w, q.i, q.j, q.k]
            })
            .collect();
        let window = Window {
            attitude: Some(&q),
            ..Window::over(&t)
        };
        for shift in [0.0, 0.0037] {
            let mut worst = (0.0_f64, 0.0_f64);
            let clock = ReferenceClock {
                delay: shift,
                ..ReferenceClock::default()
            };
            let k = read(&window, clock);
            for (i, k) in k.iter().enumerate().skip(5).take(n as usize - 10) {
                let k = k.expect("inside");
                let (_, omega, alpha) = truth(t[i] + shift);
                worst.0 = worst.0.max((k.omega - omega).norm());
                worst.1 = worst.1.max((k.alpha - alpha).norm());
            }
            assert!(worst.0 < 1e-6 * 5.0 && worst.1 < 1e-5 * 60.0, "{worst:?}");
        }
        assert!(read(&window, ReferenceClock::default())[3].is_none());
    }

    #[test]
    fn rotation_vectors_are_those_of_the_arc_tangent() {
        let axis = Vector3::new(0.3, -0.8, 0.5).normalize();
        for k in 0..200 {
            let vector = axis * (1e-9 + 0.0157 * f64::from(k));
            let turn = UnitQuaternion::from_scaled_axis(vector);
            for turn in [turn, UnitQuaternion::new_unchecked(-turn.into_inner())] {
                let error = (rotation_vector(&turn) - vector).norm();
                assert!(error < 1e-14 * (1.0 + f64::from(k)), "{k} {error}");
            }
        }
    }

    #[test]
    fn nothing_is_invented_across_a_gap_in_the_reference() {
        let t: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.01).collect();
        let mut q: Vec<f64> = t
            .iter()
            .flat_map(|v| {
                let q = truth(*v).0;
                [q.w, q.i, q.j, q.k]
            })
            .collect();
        q[4 * 100..4 * 120].fill(f64::NAN);
        let window = Window {
            attitude: Some(&q),
            ..Window::over(&t)
        };
        let k = read(&window, ReferenceClock::default());
        assert!((97..123).all(|i| k[i].is_none()));
        assert!(k[90].is_some() && k[130].is_some());
    }
}
