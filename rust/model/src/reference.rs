//! Kinematics of the body from the reference attitude and position, at any time.
//!
//! Around each time the attitude is written R(t) = R_c exp(phi(t)) with R_c the nearest knot; phi is a local polynomial
//! ([`crate::smoothing`]), so that omega = J_r(phi) dphi/dt with the right Jacobian J_r of SO(3).

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::interpolated::Course;
use crate::knots::Knots;
use crate::reference_clock::ReferenceClock;
use crate::rotation_rates::{RotationRates, rates};
use crate::smoothing::{self, Derivatives, LocalFit, Smoothing, Weights};
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

/// Weights of the last fit, kept while the knots have the same spacing. Where they never have, weights are not worth having.
#[derive(Default)]
struct WeightCache {
    offsets: Vec<f64>,
    fit: LocalFit,
    weights: Weights,
    /// Fits since the spacing was last the same.
    uneven: usize,
}

/// After so many fits with a spacing of their own the next ones are expected to have one too.
const UNEVEN: usize = 4;

impl WeightCache {
    /// Derivatives from the order `lowest` on around `at` of the polynomial through values at times `t`.
    fn derivatives(
        &mut self,
        t: &[f64],
        at: f64,
        smoothing: Smoothing,
        values: &[[f64; 3]],
        lowest: usize,
    ) -> Option<Derivatives> {
        let tolerance = 1e-9 * (t[t.len() - 1] - t[0]);
        let same =
            self.offsets.len() == t.len() && self.offsets.iter().zip(t).all(|(o, v)| (v - at - o).abs() <= tolerance);
        if same && !self.weights.is_empty() {
            self.uneven = 0;
            return Some(smoothing::apply(&self.weights, values));
        }
        self.uneven = if same { 0 } else { self.uneven + 1 };
        self.offsets.clear();
        self.offsets.extend(t.iter().map(|v| v - at));
        self.weights.clear();
        if self.uneven > UNEVEN {
            return smoothing::derivatives(t, at, smoothing, values, lowest);
        }
        if !self.fit.prepare(t, at, smoothing, lowest) {
            return None;
        }
        self.fit.weights_into(&mut self.weights);
        Some(smoothing::apply(&self.weights, values))
    }
}

/// One local fit of a whole window: knots, values around each, weights.
pub struct LocalReference<'a> {
    window: &'a Window<'a>,
    knots: Knots,
    hint: usize,
    cache: WeightCache,
    values: Vec<[f64; 3]>,
    /// Attitude at each knot; empty for positions.
    attitudes: Vec<UnitQuaternion<f64>>,
}

fn quaternion_at(column: &[f64], row: usize) -> UnitQuaternion<f64> {
    let q = &column[4 * row..4 * row + 4];
    UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]))
}

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

impl<'a> LocalReference<'a> {
    /// Attitude knots of a window; `None` without a reference attitude. `spacing` is the usual time between knots,
    /// taken from the window if not given.
    pub fn attitude(window: &'a Window<'a>, spacing: Option<f64>) -> Option<Self> {
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
        Some(Self::new(window, knots, attitudes))
    }

    /// Position knots of a window; `None` without a reference position.
    pub fn position(window: &'a Window<'a>, spacing: Option<f64>) -> Option<Self> {
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
        Some(Self::new(window, knots, Vec::new()))
    }

    /// Usual time between the knots.
    pub fn spacing(&self) -> f64 {
        usual_step(&self.knots.t)
    }

    /// Samples of a packet; 1 where every sample has a stamp of its own.
    pub fn packet(&self) -> usize {
        self.knots.packet
    }

    fn new(window: &'a Window<'a>, knots: Knots, attitudes: Vec<UnitQuaternion<f64>>) -> Self {
        Self {
            window,
            knots,
            hint: 0,
            cache: WeightCache::default(),
            values: Vec::new(),
            attitudes,
        }
    }

    /// Collects the attitudes around `at` as rotation vectors from the nearest knot; the nearest knot's attitude, the times.
    fn rotations(&mut self, at: f64, half_width: usize) -> Option<(UnitQuaternion<f64>, usize, usize)> {
        let (k, first, last) = self.knots.around(at, half_width, &mut self.hint)?;
        let centre = *self.attitudes.get(k)?;
        let back = centre.inverse();
        self.values.clear();
        for attitude in &self.attitudes[first..last] {
            let phi = rotation_vector(&(back * attitude));
            // Past this angle the rotation vector is about to wrap around.
            if phi.norm_squared() > 2.8 * 2.8 {
                return None;
            }
            self.values.push([phi.x, phi.y, phi.z]);
        }
        Some((centre, first, last))
    }

    fn positions(&mut self, at: f64, half_width: usize) -> Option<(usize, usize)> {
        let column = self.window.position?;
        let (_, first, last) = self.knots.around(at, half_width, &mut self.hint)?;
        self.values.clear();
        // The first value is taken off so that large coordinates keep their digits.
        let origin = 3 * self.knots.row[first];
        for j in first..last {
            let i = 3 * self.knots.row[j];
            self.values.push([
                column[i] - column[origin],
                column[i + 1] - column[origin + 1],
                column[i + 2] - column[origin + 2],
            ]);
        }
        Some((first, last))
    }

    /// Order of the first of the four derivatives: of a position the value is relative to an arbitrary origin.
    pub fn lowest(&self) -> usize {
        usize::from(self.attitudes.is_empty())
    }

    /// Value and first three derivatives of the rotation vector around `at`, and the attitude it starts from.
    pub fn rotation_derivatives(&mut self, at: f64, s: Smoothing) -> Option<(UnitQuaternion<f64>, Derivatives)> {
        let (centre, first, last) = self.rotations(at, s.half_width)?;
        let d = self
            .cache
            .derivatives(&self.knots.t[first..last], at, s, &self.values, 0)?;
        Some((centre, d))
    }

    /// First to fourth derivative of the position around `at`.
    pub fn position_derivatives(&mut self, at: f64, s: Smoothing) -> Option<Derivatives> {
        let (first, last) = self.positions(at, s.half_width)?;
        self.cache
            .derivatives(&self.knots.t[first..last], at, s, &self.values, 1)
    }

    /// Times of the knots, s.
    pub fn times(&self) -> &[f64] {
        &self.knots.t
    }

    /// A fit around `at` with its values and its first knot, for judging how wide the polynomial may be.
    pub fn local_fit(&mut self, at: f64, s: Smoothing, of_attitude: bool) -> Option<(LocalFit, Vec<[f64; 3]>, usize)> {
        let (first, last) = if of_attitude {
            let (_, first, last) = self.rotations(at, s.half_width)?;
            (first, last)
        } else {
            self.positions(at, s.half_width)?
        };
        Some((
            LocalFit::new(&self.knots.t[first..last], at, s, usize::from(!of_attitude))?,
            self.values.clone(),
            first,
        ))
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
}

/// Rates from a rotation vector and its first three derivatives.
fn rates_of(d: &Derivatives) -> RotationRates {
    let [phi, d, dd, ddd] = d.map(Vector3::from);
    rates(phi, d, dd, ddd)
}

/// What the position's polynomial gives: acceleration, jerk and snap.
fn above_velocity(d: &Derivatives) -> [Vector3<f64>; 3] {
    [d[1], d[2], d[3]].map(Vector3::from)
}

/// Kinematics of each core row of the window, by a clock; `None` in a row where the reference does not tell.
pub fn kinematics(
    window: &Window,
    attitude: Widths,
    position: Option<Widths>,
    spacing: Option<f64>,
    clock: ReferenceClock,
) -> Vec<Option<Kinematics>> {
    let mut rotation = LocalReference::attitude(window, spacing);
    let mut translation = position.and_then(|w| LocalReference::position(window, spacing).map(|r| (r, w.value)));
    // What enters columns comes from a wider polynomial; it needs a cache of its own.
    let wider = |w: Widths| Some(w.columns).filter(|c| *c != w.value);
    let mut smooth_rotation = wider(attitude).and_then(|w| LocalReference::attitude(window, spacing).map(|r| (r, w)));
    let mut smooth_translation = position
        .and_then(wider)
        .and_then(|w| LocalReference::position(window, spacing).map(|r| (r, w)));
    let still_wider = |w: Widths| Some(w.bends).filter(|b| *b != w.columns);
    let mut bent_rotation =
        still_wider(attitude).and_then(|w| LocalReference::attitude(window, spacing).map(|r| (r, w)));
    let mut bent_translation = position
        .and_then(still_wider)
        .and_then(|w| LocalReference::position(window, spacing).map(|r| (r, w)));
    (window.begin..window.end)
        .map(|i| {
            let at = clock.at(window.t[i]);
            let (centre, d) = rotation.as_mut()?.rotation_derivatives(at, attitude.value)?;
            let phi = Vector3::from(d[0]);
            let mut turning = rates_of(&d);
            let mut omega_detail = Vector3::zeros();
            if let Some((reference, width)) = smooth_rotation.as_mut() {
                let smooth = rates_of(&reference.rotation_derivatives(at, *width)?.1);
                omega_detail = turning.omega - smooth.omega;
                turning = smooth;
            }
            // Where the widest polynomial does not reach, the one of the columns has to do.
            let bent =
                |(reference, width): &mut (LocalReference, Smoothing)| reference.rotation_derivatives(at, *width);
            if let Some((_, d)) = bent_rotation.as_mut().and_then(bent) {
                turning.alpha_rate = rates_of(&d).alpha_rate;
            }
            let mut acceleration_detail = Vector3::zeros();
            let [acceleration, jerk, mut snap] = match translation.as_mut() {
                None => [Vector3::zeros(); 3],
                Some((reference, s)) => {
                    let all = above_velocity(&reference.position_derivatives(at, *s)?);
                    match smooth_translation.as_mut() {
                        None => all,
                        Some((reference, width)) => {
                            let smooth = above_velocity(&reference.position_derivatives(at, *width)?);
                            acceleration_detail = all[0] - smooth[0];
                            smooth
                        }
                    }
                }
            };
            let bent =
                |(reference, width): &mut (LocalReference, Smoothing)| reference.position_derivatives(at, *width);
            if let Some(d) = bent_translation.as_mut().and_then(bent) {
                [_, _, snap] = above_velocity(&d);
            }
            // On the clock of the sensors.
            let rate = clock.rate();
            Some(Kinematics {
                attitude: centre * UnitQuaternion::from_scaled_axis(phi),
                omega: turning.omega * rate,
                alpha: turning.alpha * rate.powi(2),
                alpha_rate: turning.alpha_rate * rate.powi(3),
                acceleration: acceleration * rate.powi(2),
                jerk: jerk * rate.powi(3),
                snap: snap * rate.powi(4),
                omega_detail: omega_detail * rate,
                acceleration_detail: acceleration_detail * rate.powi(2),
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::smoothing::NARROWEST;

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
            let k = kinematics(
                &window,
                Widths::alike(NARROWEST),
                None,
                None,
                ReferenceClock {
                    delay: shift,
                    ..ReferenceClock::default()
                },
            );
            for (i, k) in k.iter().enumerate().skip(5).take(n as usize - 10) {
                let k = k.expect("inside");
                let (_, omega, alpha) = truth(t[i] + shift);
                worst.0 = worst.0.max((k.omega - omega).norm());
                worst.1 = worst.1.max((k.alpha - alpha).norm());
            }
            assert!(worst.0 < 1e-6 * 5.0 && worst.1 < 1e-5 * 60.0, "{worst:?}");
        }
        assert!(kinematics(&window, Widths::alike(NARROWEST), None, None, ReferenceClock::default())[3].is_none());
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
        let k = kinematics(&window, Widths::alike(NARROWEST), None, None, ReferenceClock::default());
        assert!((97..123).all(|i| k[i].is_none()));
        assert!(k[90].is_some() && k[130].is_some());
    }
}
