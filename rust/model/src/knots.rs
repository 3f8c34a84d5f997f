//! Rows that carry a reference, cut into segments without gaps.

use crate::interpolated::{self, Course};
use crate::packets;
use crate::sensor::Sensor;
use crate::usual_step::usual_step;
use crate::window::Window;

/// A gap in the reference is a step of more than this many usual steps.
const MAX_GAP: f64 = 4.5;

/// Times and row numbers of the rows that carry a reference, cut into segments without gaps.
pub(crate) struct Knots {
    pub(crate) t: Vec<f64>,
    pub(crate) row: Vec<usize>,
    /// Segment of each knot.
    segments: Vec<(usize, usize)>,
    /// Usual time between knots, s.
    spacing: f64,
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
        let spacing = spacing.unwrap_or_else(|| usual_step(&t));
        let widest = MAX_GAP * spacing;
        let mut segments = vec![(0, 0); t.len()];
        let mut first = 0;
        for k in 0..t.len() {
            if k + 1 == t.len() || t[k + 1] - t[k] > widest {
                segments[first..=k].fill((first, k + 1));
                first = k + 1;
            }
        }
        Self {
            t,
            row,
            segments,
            spacing,
            packet,
        }
    }

    /// The knot nearest to a time; `None` where the reference does not reach so far. The search begins at `hint`.
    pub(crate) fn nearest(&self, at: f64, hint: &mut usize) -> Option<usize> {
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
        let (first, last) = self.segments[k];
        // Between two segments the nearest knot may lie far away.
        let reach = 0.75 * (self.t[k + 1.min(last - 1 - k)] - self.t[k - 1.min(k - first)]);
        ((at - self.t[k]).abs() <= reach).then_some(k)
    }

    /// For each knot the one in the middle of its run: at most so many knots of a segment, in a cell of time so many usual steps wide. Cells
    /// begin at t = 0, so that a knot has the same neighbours in its run in every window that holds them.
    pub(crate) fn middles(&self, most: usize) -> Vec<usize> {
        let cell = |k: usize| (self.t[k] / (most as f64 * self.spacing)).floor();
        let mut middles = vec![0; self.t.len()];
        let mut first = 0;
        for k in 0..self.t.len() {
            let next = k + 1;
            let ends = next == self.segments[k].1 || next - first == most || cell(next).to_bits() != cell(k).to_bits();
            if ends {
                middles[first..next].fill(first + (k - first) / 2);
                first = next;
            }
        }
        middles
    }

    /// First knot of the segment that a knot lies in, and the first one after it.
    pub(crate) fn segment(&self, knot: usize) -> (usize, usize) {
        self.segments[knot]
    }
}
