//! How strongly the accelerometer is shaken around each row.

use nalgebra::{Matrix3, Vector3};

use crate::sensor::Sensor;
use crate::window::Window;

/// Rows to each side of the quartic that motion is taken to be, and the width of its Gaussian weights in rows: what it leaves
/// lies above a tenth of the sampling rate, and above a fifth of it a hundredth of the power is missing.
const HALF_WIDTH: usize = 12;
const WEIGHT_WIDTH: f64 = 3.5;
/// Time to each side of a row over which the power is a mean, s, and how many rows that may be at most. Tones of a machine beat: over a
/// quarter of a second the power has an error of a fifth, which makes its coefficient 8 % too small and hides it among zeros that wander.
/// Of 0.25, 0.4, 0.5, 0.6, 0.75 and 1 s half a second leaves the smallest residual in 14 logs of `imufit grade --set two`.
const REACH: f64 = 0.5;
const MOST_ROWS: usize = 200;
/// Time to each side of a row that does not count, s: a reading that is wrong for a moment would make its own power.
const OWN: f64 = 0.05;
/// Rows further apart than this many usual steps have a gap between them, across which nothing is known.
const GAP: f64 = 5.0;

/// Weights with which the samples around a row make the value of the quartic through them there.
fn quartic() -> [f64; 2 * HALF_WIDTH + 1] {
    let shapes: [Vector3<f64>; 2 * HALF_WIDTH + 1] = std::array::from_fn(|j| {
        let square = ((j as f64 - HALF_WIDTH as f64) / WEIGHT_WIDTH).powi(2);
        Vector3::new(1.0, square, square * square)
    });
    let gauss = shapes.map(|shape| (-0.5 * shape.y).exp());
    let moments: Matrix3<f64> = shapes.iter().zip(gauss).map(|(s, g)| s * s.transpose() * g).sum();
    let solved = moments.cholesky().map_or(Vector3::x(), |c| c.solve(&Vector3::x()));
    std::array::from_fn(|j| gauss[j] * solved.dot(&shapes[j]))
}

/// What a sample differs from the quartic through it and the samples around it; `None` where one is missing.
fn beside_quartic(y: &[f64], n: usize, row: usize, axis: usize, weights: &[f64]) -> Option<f64> {
    if row < HALF_WIDTH || row + HALF_WIDTH >= n {
        return None;
    }
    let around = y[3 * (row - HALF_WIDTH) + axis..].iter().step_by(3);
    let smooth: f64 = weights.iter().zip(around).map(|(w, v)| w * v).sum();
    let left = y[3 * row + axis] - smooth;
    left.is_finite().then_some(left)
}

/// Mean square of the vibration around each core row, all axes together, (m/s^2)^2: readings less the motion that a quartic follows.
/// Where too little is known it is zero.
pub fn power(window: &Window, dt: f64) -> Vec<f64> {
    let Some(y) = window.reading(Sensor::Acc) else {
        return vec![0.0; window.end - window.begin];
    };
    let n = window.len();
    let reach = ((REACH / dt) as usize).clamp(1, MOST_ROWS);
    let (first, last) = (window.begin.saturating_sub(reach), (window.end + reach).min(n));
    let weights = quartic();
    let gap = |row: usize| window.t[row] - window.t[row - 1] > GAP * dt;
    let mut begins: Vec<usize> = (0..n).collect();
    let mut ends: Vec<usize> = (1..=n).collect();
    for row in 1..n {
        begins[row] = if gap(row) { row } else { begins[row - 1] };
    }
    for row in (0..n.saturating_sub(1)).rev() {
        ends[row] = if gap(row + 1) { row + 1 } else { ends[row + 1] };
    }
    // Sums of squares and counts up to each row.
    let mut sums = vec![(0.0, 0.0)];
    let (mut square, mut count) = (0.0, 0.0);
    for row in first..last {
        let whole = row >= begins[row] + HALF_WIDTH && row + HALF_WIDTH < ends[row];
        let axes = [0, 1, 2].map(|axis| beside_quartic(y, n, row, axis, &weights).filter(|_| whole));
        if let [Some(a), Some(b), Some(c)] = axes {
            square += a * a + b * b + c * c;
            count += 1.0;
        }
        sums.push((square, count));
    }
    let own = ((OWN / dt) as usize).min(reach - 1);
    (window.begin..window.end)
        .map(|row| {
            let (low, high) = (first.max(begins[row]), last.min(ends[row]));
            let between = |from: usize, to: usize| {
                let (before, after) = (sums[from.clamp(low, high) - first], sums[to.clamp(low, high) - first]);
                (after.0 - before.0, after.1 - before.1)
            };
            let before = between(row.saturating_sub(reach), row.saturating_sub(own));
            let after = between(row + own + 1, row + reach + 1);
            let samples: f64 = before.1 + after.1;
            if samples > 0.0 {
                (before.0 + after.0) / samples
            } else {
                0.0
            }
        })
        .collect()
}

/// Spread of the power between its first and last tenth, in what its own scatter in steady noise makes, and as a factor, above which
/// the sensor is shaken more at some times than at others.
const SPREAD: f64 = 4.0;
const LEAST_FACTOR: f64 = 1.5;
/// Part of the samples that count for themselves: the quartic leaves neighbours alike.
const INDEPENDENT: f64 = 0.5;

/// True if the power of the vibration at some rows is larger at some times than at others. `steps`: coarse steps of the axes, m/s^2; readings
/// that go to and fro between two of them are not shaken.
pub fn varies(power: &mut [f64], dt: f64, steps: [f64; 3]) -> bool {
    if power.len() < 10 {
        return false;
    }
    power.sort_unstable_by(f64::total_cmp);
    let tenth = power.len() / 10;
    let (low, high) = (power[tenth], power[power.len() - 1 - tenth]);
    let samples = 3.0 * (2.0 * (REACH / dt).clamp(1.0, MOST_ROWS as f64) + 1.0);
    let scatter = (2.0 / (INDEPENDENT * samples)).sqrt();
    let rounding: f64 = steps.iter().map(|step| step * step).sum();
    high > rounding && (high / low).ln() > LEAST_FACTOR.ln().max(SPREAD * scatter)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[test]
    fn fast_shaking_counts_and_motion_does_not() {
        let n = 600;
        let t: Vec<f64> = (0..n).map(|i| f64::from(i) * 0.01).collect();
        // Motion at 1.5 Hz all the time. In the second half two axes shake at 31 Hz: 13 rows hold four periods.
        let acc: Vec<f64> = t
            .iter()
            .flat_map(|t| {
                let motion = 6.0 * (9.4 * t).sin();
                let shaking = if *t >= 3.0 { (TAU * 4.0 / 0.13 * t).sin() } else { 0.0 };
                [motion + shaking, 9.81, motion - 0.5 * shaking]
            })
            .collect();
        let window = Window {
            readings: [Some(&acc), None, None],
            ..Window::over(&t)
        };
        let power = power(&window, 0.01);
        assert!(power[100] < 2e-3, "{}", power[100]);
        assert!((power[450] - 0.625).abs() < 0.015, "{}", power[450]);
        let part = super::power(&window.with_core(430, 460), 0.01);
        assert!((part[20] - power[450]).abs() < 1e-12);
    }

    #[test]
    fn shaking_varies_if_its_power_does_beyond_the_scatter_of_a_mean() {
        // Rank k of a thousand: a spread of a factor of 1.3 is chance where 21 rows count, one of 4 is not.
        let power = |factor: f64| -> Vec<f64> { (0..1000).map(|k| factor.powf(f64::from(k) / 800.0)).collect() };
        assert!(!varies(&mut power(1.3), 0.02, [0.0; 3]));
        assert!(varies(&mut power(4.0), 0.02, [0.0; 3]));
        assert!(!varies(&mut power(4.0), 0.02, [2.0; 3]));
        assert!(!varies(&mut [1.0, 100.0], 0.02, [0.0; 3]));
        assert!(!varies(&mut [], 0.02, [0.0; 3]));
    }
}
