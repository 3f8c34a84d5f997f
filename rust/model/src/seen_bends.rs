//! How much of the second derivative of a reference's angular rate the gyroscope sees as well: what it does not see is noise.
//!
//! A filtered reference has little noise from one sample to the next. It may have much noise at the frequencies of the motion, which its own
//! scatter does not show. The gyroscope shows that noise. Its readings are integrated to angles, and the same polynomial is put through
//! the angles and through the reference. Then the reference's derivative is regressed on that of the gyroscope. A gain, a turned mount
//! and a delay of the gyroscope change nothing.

use nalgebra::{Cholesky, SMatrix, Vector3};

use crate::rotation_rates::rates;
use crate::sensor::Sensor;
use crate::usual_step::usual_step;
use crate::window::Window;

/// Readings further apart than so many usual steps have an unknown turn between them.
const GAP: f64 = 2.5;
/// Angles of the gyroscope that the reference is held against: three axes, each before, at and after the time asked for.
const ANGLES: usize = 9;
/// Part of their own squares added to the equations, so that an axis about which nothing turns can be solved for.
const RIDGE: f64 = 1e-9;
/// So many rows for each coefficient at least.
const ROWS: usize = 10;

/// Angles about the body's axes by the gyroscope, at times given.
pub struct Turns {
    /// About each axis, at all times: before, at and after each; rad.
    angles: [Vec<[f64; 3]>; 3],
    /// Number of the stretch without gaps; angles of two stretches have nothing in common. `None` where the gyroscope does not reach.
    stretch: Vec<Option<usize>>,
    /// Variance that noise of the gyroscope from one reading to the next gives to the turn in a second, rad^2/s, summed over the axes.
    noise: f64,
    /// Time between neighbouring times given, s.
    step: f64,
}

impl Turns {
    /// Of the gyroscope of a window at ascending times, and so much before and after them; `None` without a gyroscope.
    pub fn of(window: &Window, times: &[f64], apart: f64) -> Option<Self> {
        let y = window.reading(Sensor::Gyr)?;
        let rate = |i: usize| Vector3::new(y[3 * i], y[3 * i + 1], y[3 * i + 2]);
        let rows: Vec<usize> = (0..window.len())
            .filter(|i| rate(*i).iter().all(|v| v.is_finite()))
            .collect();
        let t: Vec<f64> = rows.iter().map(|i| window.t[*i]).collect();
        let widest = GAP * usual_step(&t);
        let (mut angle, mut stretch) = (vec![Vector3::zeros(); t.len()], vec![0; t.len()]);
        for k in 1..t.len() {
            let h = t[k] - t[k - 1];
            angle[k] = angle[k - 1] + (rate(rows[k - 1]) + rate(rows[k])) * (0.5 * h);
            stretch[k] = stretch[k - 1] + usize::from(h > widest);
        }
        // Between two readings the rate goes straight from one to the other.
        let at = |time: f64, k: usize| {
            let (h, passed) = (t[k + 1] - t[k], time - t[k]);
            angle[k] + rate(rows[k]) * passed + (rate(rows[k + 1]) - rate(rows[k])) * (0.5 * passed * passed / h)
        };
        let place = |time: f64| {
            let k = t.partition_point(|v| *v <= time).checked_sub(1)?;
            (k + 1 < t.len() && stretch[k] == stretch[k + 1]).then_some(k)
        };
        // Fourth differences of a motion are small, those of white noise have 70 times its variance.
        let fourth = |w: &[usize]| {
            let of = [1.0, -4.0, 6.0, -4.0, 1.0];
            w.iter()
                .zip(of)
                .map(|(i, c)| rate(*i) * c)
                .sum::<Vector3<f64>>()
                .norm_squared()
                / 70.0
        };
        let scatter = rows.windows(5).map(fourth).sum::<f64>() / rows.len().saturating_sub(4).max(1) as f64;
        let mut turns = Self {
            noise: scatter * usual_step(&t),
            step: apart,
            angles: Default::default(),
            stretch: Vec::with_capacity(times.len()),
        };
        for time in times {
            let places = [-apart, 0.0, apart].map(|shift| place(time + shift).map(|k| (time + shift, k)));
            let known = places
                .iter()
                .all(|p| p.is_some_and(|(_, k)| Some(stretch[k]) == places[0].map(|(_, k)| stretch[k])));
            turns.stretch.push(places[0].filter(|_| known).map(|(_, k)| stretch[k]));
            for (series, p) in turns.angles.iter_mut().zip(places) {
                series.push(p.map_or([f64::NAN; 3], |(time, k)| at(time, k).into()));
            }
        }
        Some(turns)
    }

    /// Variance that noise of the gyroscope gives to what weights make of the angles, summed over the axes.
    fn noise(&self, weights: &[f64]) -> f64 {
        let mut later = 0.0;
        let squares = weights.iter().skip(1).rev().map(|w| {
            later += w;
            later * later
        });
        squares.sum::<f64>() * self.noise * self.step
    }

    /// What weights of the knots from `first` on make of them: about three axes, before, at and after.
    fn combined(&self, weights: &[f64], first: usize) -> Option<SMatrix<f64, ANGLES, 1>> {
        let last = first + weights.len() - 1;
        self.stretch[first].filter(|s| Some(*s) == self.stretch[last])?;
        let mut out = SMatrix::<f64, ANGLES, 1>::zeros();
        for (place, series) in self.angles.iter().enumerate() {
            // Of angles that grow without bound only what passes within the polynomial counts.
            let origin = series[first];
            for (w, v) in weights.iter().zip(&series[first..=last]) {
                for axis in 0..3 {
                    out[3 * place + axis] += w * (v[axis] - origin[axis]);
                }
            }
        }
        Some(out)
    }
}

/// Regression of the reference's derivative on that of the gyroscope.
#[derive(Clone, Debug, Default)]
pub struct SeenBends {
    gram: SMatrix<f64, ANGLES, ANGLES>,
    cross: SMatrix<f64, ANGLES, 3>,
    square: Vector3<f64>,
    /// Sum of the variances that noise of the gyroscope gives.
    noise: f64,
    rows: usize,
}

impl SeenBends {
    /// Adds a row: the first three derivatives of the reference's rotation vector, the weights of the third, and the first knot that they
    /// belong to.
    pub fn add(&mut self, turns: &Turns, derivatives: [[f64; 3]; 3], weights: &[f64], first: usize) {
        let Some(x) = turns
            .combined(weights, first)
            .filter(|x| x.iter().all(|v| v.is_finite()))
        else {
            return;
        };
        let [d, dd, ddd] = derivatives.map(Vector3::from);
        let y = rates(Vector3::zeros(), d, dd, ddd).alpha_rate;
        self.gram += x * x.transpose();
        self.cross += x * y.transpose();
        self.square += y.component_mul(&y);
        self.noise += turns.noise(weights);
        self.rows += 1;
    }

    /// Part of the mean square that the gyroscope does not see, less what its own noise leaves unseen; `None` where too little is known.
    pub fn unseen(&self) -> Option<f64> {
        let total = self.square.sum();
        if self.rows < ROWS * ANGLES || total <= 0.0 {
            return None;
        }
        let ridge = RIDGE * self.gram.trace() / ANGLES as f64;
        let factor = Cholesky::new(self.gram + SMatrix::identity() * ridge)?;
        let explained: f64 = self.cross.component_mul(&factor.solve(&self.cross)).sum();
        let freedom = (self.rows - ANGLES) as f64 / self.rows as f64;
        Some(((total - explained) / freedom - self.noise).max(0.0) / total)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::reference::LocalReference;
    use crate::smoothing::LocalFit;
    use crate::smoothing::Smoothing;

    const WIDTH: Smoothing = Smoothing::uniform(6, 15).tapered();

    /// Part of the third derivative that a gyroscope does not see and the part that white noise of the reference makes, of a body that
    /// swings about z twice a second. `late`: the gyroscope, s; `noise`: of the reference, rad.
    fn unseen(late: f64, noise: f64) -> (f64, f64) {
        let t: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.01).collect();
        // Park and Miller's generator, twelve uniform numbers to a normal one.
        let mut state = 1_u64;
        let mut uniform = || {
            state = state * 16807 % 2_147_483_647;
            state as f64 / 2_147_483_647.0
        };
        let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let mut q = Vec::new();
        let mut gyr = Vec::new();
        for t in &t {
            let error = Vector3::new(normal(), normal(), normal()) * noise;
            let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * (0.5 * (TAU * 2.0 * t).sin()));
            let turn = turn * UnitQuaternion::from_scaled_axis(error);
            q.extend([turn.w, turn.i, turn.j, turn.k]);
            gyr.extend([0.0, 0.0, 0.5 * TAU * 2.0 * (TAU * 2.0 * (t - late)).cos()]);
        }
        let window = Window {
            attitude: Some(&q),
            readings: [None, Some(&gyr), None],
            ..Window::over(&t)
        };
        let reference = LocalReference::attitude(&window, None).expect("an attitude");
        let turns = Turns::of(&window, reference.times(), reference.spacing()).expect("a gyroscope");
        let (mut seen, mut square, mut white, mut hint) = (SeenBends::default(), 0.0, 0.0, 0);
        for row in (100..3900).step_by(3) {
            let knot = reference.nearest(t[row], &mut hint).expect("within the log");
            let (half, near) = (WIDTH.half_width, reference.around(knot, WIDTH.half_width));
            let (values, first) = (near.within(knot, half).expect("within the log"), knot - half);
            let weights = LocalFit::new(reference.times_around(knot, half), t[row], WIDTH, 0)
                .expect("determined")
                .weights();
            let derivatives: [[f64; 3]; 3] = std::array::from_fn(|order| {
                std::array::from_fn(|axis| weights.iter().zip(values).map(|(w, v)| w[order + 1] * v[axis]).sum())
            });
            let third: Vec<f64> = weights.iter().map(|w| w[3]).collect();
            square += derivatives[2].iter().map(|v| v * v).sum::<f64>();
            white += 3.0 * noise * noise * third.iter().map(|w| w * w).sum::<f64>();
            seen.add(&turns, derivatives, &third, first);
        }
        (seen.unseen().expect("enough rows"), white / square)
    }

    #[test]
    fn a_gyroscope_sees_all_of_a_motion_without_noise_even_when_it_is_late() {
        assert!(unseen(0.0, 0.0).0 < 1e-5);
        assert!(unseen(0.004, 0.0).0 < 1e-3);
    }

    #[test]
    fn what_it_does_not_see_is_the_noise_of_the_reference() {
        let (unseen, white) = unseen(0.0, 5e-3);
        assert!(white > 0.02, "{white}");
        assert!((unseen / white - 1.0).abs() < 0.1, "{unseen} {white}");
    }
}
