//! Rows that carry a reference, cut into segments without gaps.

use crate::window::Window;

/// Times and row numbers of the rows that carry a reference, cut into segments without gaps.
pub(crate) struct Knots {
    pub(crate) t: Vec<f64>,
    pub(crate) row: Vec<usize>,
    segment: Vec<(usize, usize)>,
}

impl Knots {
    pub(crate) fn new(window: &Window, known: impl Fn(usize) -> bool, spacing: Option<f64>) -> Self {
        let row: Vec<usize> = (0..window.len())
            .filter(|&i| known(i) && window.reference_exact.is_none_or(|e| e[i] > 0.5))
            .collect();
        let t: Vec<f64> = row.iter().map(|&i| window.t[i]).collect();
        let widest = MAX_GAP * spacing.unwrap_or_else(|| median_step(&t));
        let mut segment = vec![(0, 0); t.len()];
        let mut first = 0;
        for k in 0..t.len() {
            if k + 1 == t.len() || t[k + 1] - t[k] > widest {
                segment[first..=k].fill((first, k + 1));
                first = k + 1;
            }
        }
        Self { t, row, segment }
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

/// Median step between times; zero if there are none.
pub(crate) fn median_step(t: &[f64]) -> f64 {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let middle = steps.len() / 2;
    if steps.is_empty() {
        0.0
    } else {
        *steps.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}

/// A gap in the reference is a step of more than this many median steps.
const MAX_GAP: f64 = 4.5;
