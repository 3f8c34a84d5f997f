//! Rows that carry a reference, cut into segments without gaps.

use crate::interpolated::{self, Course};
use crate::packets;
use crate::sensor::Sensor;
use crate::window::Window;

/// Times and row numbers of the rows that carry a reference, cut into segments without gaps.
pub(crate) struct Knots {
    pub(crate) t: Vec<f64>,
    pub(crate) row: Vec<usize>,
    segment: Vec<(usize, usize)>,
    /// Samples of a packet; 1 where every sample has a stamp of its own.
    pub(crate) packet: usize,
}

impl Knots {
    /// Of a window: rows in which the reference is known, the square by which it changes from one row to another, how it goes on in three
    /// rows (the time of the middle one as a part of that between the others), and the usual time between knots, taken from the window if
    /// not given.
    pub(crate) fn new(
        window: &Window,
        known: impl Fn(usize) -> bool,
        change: impl Fn(usize, usize) -> f64,
        course: impl Fn([usize; 3], f64) -> Course,
        spacing: Option<f64>,
    ) -> Self {
        let mut row: Vec<usize> = (0..window.len())
            .filter(|&i| known(i) && window.reference_exact.is_none_or(|e| e[i] > 0.5))
            .collect();
        let mut t: Vec<f64> = row.iter().map(|&i| window.t[i]).collect();
        let apart = |i: &usize| {
            Sensor::ALL
                .iter()
                .all(|s| window.reading(*s).is_none_or(|y| y[3 * i].is_nan()))
        };
        let packet = if row.iter().all(apart) {
            packets::resolve(&mut t, &mut row, change)
        } else {
            1
        };
        if window.reference_exact.is_none() && packet == 1 {
            let at = |k: usize| {
                course(
                    [row[k - 1], row[k], row[k + 1]],
                    (t[k] - t[k - 1]) / (t[k + 1] - t[k - 1]),
                )
            };
            if let Some(samples) = interpolated::samples(&t, at, spacing) {
                t = samples.iter().map(|k| t[*k]).collect();
                row = samples.iter().map(|k| row[*k]).collect();
            }
        }
        let widest = MAX_GAP * spacing.unwrap_or_else(|| usual_step(&t));
        let mut segment = vec![(0, 0); t.len()];
        let mut first = 0;
        for k in 0..t.len() {
            if k + 1 == t.len() || t[k + 1] - t[k] > widest {
                segment[first..=k].fill((first, k + 1));
                first = k + 1;
            }
        }
        Self {
            t,
            row,
            segment,
            packet,
        }
    }

    /// Range of knots for a fit around `at`; `None` where the reference does not reach far enough on both sides.
    pub(crate) fn around(&self, at: f64, half_width: usize, hint: &mut usize) -> Option<(usize, usize, usize)> {
        let n = self.t.len();
        if n == 0 {
            return None;
        }
        let mut k = (*hint).min(n - 1);
        while k + 1 < n && self.t[k + 1] <= at {
            k += 1;
        }
        while k > 0 && self.t[k] > at {
            k -= 1;
        }
        *hint = k;
        if k + 1 < n && self.t[k + 1] - at < at - self.t[k] {
            k += 1;
        }
        let (first, last) = self.segment[k];
        if k < first + half_width || k + half_width >= last {
            return None;
        }
        // Between two segments the nearest knot may lie far away.
        let reach = 0.75 * (self.t[k + 1.min(last - 1 - k)] - self.t[k - 1.min(k - first)]);
        ((at - self.t[k]).abs() <= reach).then_some((k, k - half_width, k + half_width + 1))
    }
}

/// Usual step between times; zero if there are none.
///
/// In each stretch it is the step in which half of the time has passed: stamps that come in packets lie close together,
/// and the time passes between the packets. Over the stretches it is the median: a gap makes one stretch long.
pub fn usual_step(t: &[f64]) -> f64 {
    let steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let mut usual: Vec<f64> = steps.chunks(STRETCH).map(half_of_the_time).collect();
    let middle = usual.len() / 2;
    if usual.is_empty() {
        0.0
    } else {
        *usual.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}

/// The step at which the steps up to this length fill half of the time.
fn half_of_the_time(steps: &[f64]) -> f64 {
    let mut sorted = steps.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let half = 0.5 * sorted.iter().sum::<f64>();
    let mut passed = 0.0;
    let found = sorted.iter().find(|step| {
        passed += **step;
        passed >= half
    });
    found.or(sorted.last()).copied().unwrap_or(0.0)
}

/// Steps of a stretch: at least three of the packets that a serial link or a radio makes, which hold up to some twenty samples.
const STRETCH: usize = 64;

/// A gap in the reference is a step of more than this many usual steps.
const MAX_GAP: f64 = 4.5;

#[cfg(test)]
mod tests {
    use super::usual_step;

    #[test]
    fn gap_leaves_the_usual_step_and_packets_do_not_make_it_short() {
        let mut t: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
        for late in &mut t[300..] {
            *late += 1e3;
        }
        assert!((usual_step(&t) - 0.01).abs() < 1e-9);
        let packets: Vec<f64> = (0..400)
            .map(|k| 0.05 * f64::from(k / 6) + 15e-6 * f64::from(k % 6))
            .collect();
        assert!((usual_step(&packets) - 0.05).abs() < 1e-3);
        assert!(usual_step(&[1.0]).abs() < 1e-12);
    }
}
