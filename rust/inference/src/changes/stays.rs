//! A stay: a residual whose mean lies elsewhere for a while and comes back, as beside a magnet or with a connector pressed.

use nalgebra::{DMatrix, DVector};

use super::block_means::{BlockMeans, Explained, standing_out};

/// Stays that are looked at of those that stand out: as the means are, and by the jumps at their ends.
const LOOKED_AT: usize = 6;
/// Stays that are told apart in one channel.
const MOST: usize = 3;
/// Part of a block that a stay must fill to count there.
const LEAST: f64 = 0.05;

/// Blocks that a stay fills: from its first to its last one, and how much of those beside them.
#[derive(Clone, Copy, Debug)]
pub struct Stay {
    first: usize,
    last: usize,
    before: f64,
    after: f64,
}

impl Stay {
    /// Where it begins and ends, in blocks from the start.
    fn ends(&self) -> (f64, f64) {
        (self.first as f64 - self.before, self.last as f64 + 1.0 + self.after)
    }

    /// The largest of something that each block has, over the blocks that it fills.
    pub fn largest(&self, of_blocks: &[f64]) -> f64 {
        of_blocks[self.first..=self.last].iter().copied().fold(0.0, f64::max)
    }

    fn column(&self, blocks: usize) -> DVector<f64> {
        DVector::from_fn(blocks, |b, _| match b {
            b if (self.first..=self.last).contains(&b) => 1.0,
            b if b + 1 == self.first => self.before,
            b if b == self.last + 1 => self.after,
            _ => 0.0,
        })
    }
}

/// From when to when some stays last, in blocks from the start; those that overlap are one.
pub fn spans(stays: &[Stay]) -> Vec<(f64, f64)> {
    let mut ends: Vec<(f64, f64)> = stays.iter().map(Stay::ends).collect();
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut spans: Vec<(f64, f64)> = Vec::new();
    for (begin, end) in ends {
        match spans.last_mut() {
            Some(last) if begin <= last.1 => last.1 = last.1.max(end),
            _ => spans.push((begin, end)),
        }
    }
    spans
}

/// How many stays there can be: none at either end of the log, where it would be a step, and none longer than half of it.
pub fn possible(blocks: usize) -> usize {
    let lengths = 1..=blocks / 2;
    lengths.map(|n| blocks.saturating_sub(n + 1)).sum()
}

/// Stays at other levels that explain the means of a channel, each the best one beside those before it: from one to `MOST` of them.
pub fn stays(means: &BlockMeans) -> Vec<(Vec<Stay>, Explained)> {
    let blocks = means.blocks();
    let mut found: Vec<(Vec<Stay>, Explained)> = Vec::new();
    while found.len() < MOST {
        let (chosen, residual) = found.last().map_or_else(
            || (Vec::new(), &means.without.residual),
            |(stays, with)| (stays.clone(), &with.residual),
        );
        let beside = |stay: &Stay| [chosen.as_slice(), &[*stay]].concat();
        let columns = |stay: &Stay| {
            let all: Vec<DVector<f64>> = beside(stay).iter().map(|s| s.column(blocks)).collect();
            DMatrix::from_columns(&all)
        };
        let Some((stay, with)) = means.best(likely(residual), columns) else {
            break;
        };
        found.push((beside(&stay), with));
    }
    found
}

/// Stays that stand out of what is left of the means.
fn likely(residual: &DVector<f64>) -> Vec<Stay> {
    let blocks = residual.len();
    let mut found: Vec<((usize, usize), [f64; 2])> = Vec::new();
    for first in 1..blocks.saturating_sub(1) {
        let mut sum = 0.0;
        for last in first..(first + blocks / 2).min(blocks - 1) {
            sum += residual[last];
            let n = (last + 1 - first) as f64;
            // The residual has no mean of its own: what the stay has more, the rest has less.
            let level = sum * sum / (n * (1.0 - n / blocks as f64));
            let jumps = (residual[first] - residual[first - 1]) - (residual[last + 1] - residual[last]);
            found.push(((first, last), [level, jumps.abs()]));
        }
    }
    standing_out(found, LOOKED_AT)
        .into_iter()
        .map(|(first, last)| filled(residual, first, last))
        .collect()
}

/// A stay that fills some blocks, and of those beside them as much as their means say.
fn filled(residual: &DVector<f64>, first: usize, last: usize) -> Stay {
    let inside = residual.rows(first, last + 1 - first).mean();
    let outside: Vec<f64> = (0..residual.len())
        .filter(|b| b + 1 < first || *b > last + 1)
        .map(|b| residual[b])
        .collect();
    let rest = outside.iter().sum::<f64>() / outside.len().max(1) as f64;
    let part = |b: usize| {
        let share = (residual[b] - rest) / (inside - rest);
        if share > LEAST { share.min(1.0) } else { 0.0 }
    };
    Stay {
        first,
        last,
        before: part(first - 1),
        after: part(last + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_of_a_stay_lie_within_the_blocks_it_fills_in_part() {
        let mut residual = DVector::from_element(20, -0.1);
        residual.rows_mut(8, 3).fill(0.9);
        (residual[7], residual[11]) = (0.4, 0.15);
        let (begin, end) = filled(&residual, 8, 10).ends();
        assert!(
            (begin - 7.5).abs() < 1e-9 && (end - 11.25).abs() < 1e-9,
            "{begin} {end}"
        );
    }

    #[test]
    fn stays_that_overlap_are_one() {
        let stay = |first, last| Stay {
            first,
            last,
            before: 0.0,
            after: 0.5,
        };
        let spans = spans(&[stay(20, 22), stay(3, 8), stay(5, 9)]);
        assert_eq!(spans, [(3.0, 10.5), (20.0, 23.5)]);
    }

    #[test]
    fn a_stay_touches_neither_end_and_is_no_longer_than_half_the_log() {
        assert_eq!(possible(4), 2 + 1);
        assert_eq!(possible(48), (1..=24).map(|n| 47 - n).sum());
    }
}
