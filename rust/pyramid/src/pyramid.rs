//! The pyramid over the columns of a log.
//!
//! The rows themselves are not kept. A block is a run of rows, 128 unless asked otherwise: of each the times of its
//! first and last row and its first row's number are kept, and for each column the smallest and the largest sample.
//! A column takes 17 bytes a block and a sixteenth more for the levels above, so 20 million rows of ten columns take
//! 28 MB, and up to as much again as room to grow. Where a window is so narrow that a block is wider than a pixel, the rows are read again from the log:
//! [`Pyramid::rows_between`] says which.

use rayon::prelude::*;

use crate::column::Column;
use crate::line::{Line, Window};

/// Blocks that may end early at a gap, beyond as many as are full: a log with a gap after every row stays bounded.
const EARLY: usize = 1024;

/// Rows that cannot be taken.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PyramidError {
    /// A time that is not finite or does not follow the one before.
    #[error("the time {t} s of row {row} is not finite or goes back: times must ascend")]
    Time {
        /// Number of the row, from 0.
        row: usize,
        /// Its time, s.
        t: f64,
    },
    /// Another number of columns than the pyramid has.
    #[error("{came} columns came, but the pyramid has {wanted}: pass one array a column")]
    Columns {
        /// Columns that came.
        came: usize,
        /// Columns of the pyramid.
        wanted: usize,
    },
}

/// Where a block lies.
#[derive(Debug, Clone, Copy)]
struct Block {
    first: f64,
    last: f64,
    row: usize,
}

/// Smallest and largest values of the columns of a log, fed chunk by chunk.
#[derive(Debug, Clone)]
pub struct Pyramid {
    size: usize,
    /// Step of time at which a block ends early, s.
    shortest: f64,
    /// The last one is open.
    blocks: Vec<Block>,
    rows: usize,
    early: usize,
    columns: Vec<Column>,
}

impl Pyramid {
    /// A pyramid of one column for each of `gaps`, the longest times between two samples without a gap (s), over blocks
    /// of `size` rows.
    pub fn new(gaps: &[f64], size: usize) -> Self {
        Self {
            size: size.max(1),
            shortest: gaps.iter().copied().fold(f64::INFINITY, f64::min),
            blocks: Vec::new(),
            rows: 0,
            early: 0,
            columns: gaps.iter().map(|&gap| Column::new(gap)).collect(),
        }
    }

    /// Number of rows so far.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns.len()
    }

    /// Times of the first and the last row, s.
    pub fn span(&self) -> Option<(f64, f64)> {
        Some((self.blocks.first()?.first, self.blocks.last()?.last))
    }

    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        self.blocks.capacity() * size_of::<Block>() + self.columns.iter().map(Column::bytes).sum::<usize>()
    }

    /// Takes the next rows: their times, s, ascending, and as many values of each column, not finite where missing.
    ///
    /// # Errors
    /// Times that do not ascend, or another number of columns; then nothing is taken.
    pub fn feed(&mut self, t: &[f64], columns: &[&[f64]]) -> Result<(), PyramidError> {
        if columns.len() != self.columns.len() {
            return Err(PyramidError::Columns {
                came: columns.len(),
                wanted: self.columns.len(),
            });
        }
        let mut last = self.blocks.last().map_or(f64::NEG_INFINITY, |block| block.last);
        for (k, &t) in t.iter().enumerate() {
            if !t.is_finite() || t < last {
                return Err(PyramidError::Time { row: self.rows + k, t });
            }
            last = t;
        }
        let begins = self.place(t);
        self.columns.par_iter_mut().zip(columns).for_each(|(column, values)| {
            let mut at = 0;
            for &begin in &begins {
                column.take(&t[at..begin], &values[at..begin]);
                column.close();
                at = begin;
            }
            column.take(&t[at..], &values[at..t.len()]);
        });
        Ok(())
    }

    /// Lays rows into blocks; returns which of them begin a block that ends an earlier one.
    fn place(&mut self, t: &[f64]) -> Vec<usize> {
        let mut begins = Vec::with_capacity(t.len() / self.size + 1);
        for (k, &t) in t.iter().enumerate() {
            let row = self.rows + k;
            if let Some(open) = self.blocks.last_mut() {
                let full = row - open.row >= self.size;
                let gap = t - open.last > self.shortest && self.early < row / self.size + EARLY;
                if !(full || gap) {
                    open.last = t;
                    continue;
                }
                self.early += usize::from(!full);
                begins.push(k);
            }
            self.blocks.push(Block { first: t, last: t, row });
        }
        self.rows += t.len();
        begins
    }

    /// Blocks that lie in a window or reach into it.
    fn within(&self, begin: f64, end: f64) -> (usize, usize) {
        let from = self.blocks.partition_point(|block| block.last < begin);
        let to = self.blocks.partition_point(|block| block.first <= end);
        (from, to.max(from))
    }

    /// Rows that a window is drawn from: those of the blocks that reach into it, and of one more on either side.
    pub fn rows_between(&self, begin: f64, end: f64) -> (usize, usize) {
        let (from, to) = self.within(begin, end);
        let row = |block: usize| self.blocks.get(block).map_or(self.rows, |block| block.row);
        (row(from.saturating_sub(1)), row(to + 1))
    }

    /// Points of a window of one column, at most `2 * pixels`: the smallest and the largest sample of each pixel, and
    /// interruptions over gaps.
    ///
    /// Extremes are never lost: a block that reaches into the window counts with all of its rows, in the pixel in which
    /// it begins.
    pub fn line(&self, column: usize, begin: f64, end: f64, pixels: usize) -> Line {
        let window = Window { begin, end, pixels };
        let (mut from, to) = self.within(begin, end);
        let mut line = Line::default();
        while from < to {
            let pixel = window.pixel(self.blocks[from].first);
            let next = from + self.blocks[from..to].partition_point(|block| window.pixel(block.first) <= pixel);
            let node = self.columns[column].range(from, next);
            if !node.is_empty() {
                let first = window.within(self.blocks[from].first);
                let last = window.within(self.blocks[next - 1].last);
                line.push(0.5 * (first + last), node.low, node.high, node.gap);
            }
            from = next;
        }
        line
    }

    /// [`Pyramid::line`] of several columns at once.
    pub fn lines(&self, columns: &[usize], begin: f64, end: f64, pixels: usize) -> Vec<Line> {
        columns
            .par_iter()
            .map(|&column| self.line(column, begin, end, pixels))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn fed(t: &[f64], values: &[f64], gap: f64, size: usize, chunk: usize) -> Pyramid {
        let mut pyramid = Pyramid::new(&[gap], size);
        for (t, values) in t.chunks(chunk).zip(values.chunks(chunk)) {
            pyramid.feed(t, &[values]).unwrap();
        }
        pyramid
    }

    fn ramp(n: usize) -> Vec<f64> {
        (0..n).map(|k| k as f64).collect()
    }

    #[test]
    fn one_spike_in_a_million_rows_is_drawn_in_its_pixel() {
        let t = ramp(1_000_000);
        let mut values = vec![0.0; t.len()];
        values[654_321] = 7.0;
        let line = fed(&t, &values, 3.5, 64, 65_536).line(0, 0.0, 999_999.0, 1000);
        assert!(line.t.len() <= 2000);
        let at = line.high.iter().position(|&x| x == 7.0).unwrap();
        assert!((line.t[at] - 654_321.0).abs() <= 1000.0 + 64.0);
        assert_eq!(line.low[at], 0.0);
    }

    #[test]
    fn a_gap_in_time_and_a_run_of_missing_samples_interrupt_the_line() {
        let t: Vec<f64> = (0..1000)
            .map(|k| f64::from(k) + if k < 500 { 0.0 } else { 500.0 })
            .collect();
        let mut values = vec![1.0; 1000];
        values[200..300].fill(f64::NAN);
        let line = fed(&t, &values, 3.5, 16, 77).line(0, 0.0, 1500.0, 60);
        let breaks: Vec<f64> = line
            .t
            .iter()
            .zip(&line.low)
            .filter(|(_, x)| x.is_nan())
            .map(|(&t, _)| t)
            .collect();
        assert_eq!(breaks.len(), 2, "{breaks:?}");
        assert!(
            (breaks[0] - 250.0).abs() < 50.0 && (breaks[1] - 750.0).abs() < 50.0,
            "{breaks:?}"
        );
    }

    #[test]
    fn a_gap_after_every_row_does_not_grow_the_memory() {
        let t = ramp(200_000);
        let pyramid = fed(&t, &t, 0.5, 64, 10_000);
        assert!(pyramid.blocks.len() <= 2 * (t.len() / 64 + EARLY));
    }

    #[test]
    fn wrong_rows_are_refused_and_change_nothing() {
        let mut pyramid = fed(&ramp(100), &ramp(100), 3.5, 16, 100);
        let before = pyramid.line(0, 0.0, 99.0, 10);
        assert_eq!(
            pyramid.feed(&[100.0, 50.0], &[&[0.0, 0.0]]),
            Err(PyramidError::Time { row: 101, t: 50.0 })
        );
        assert!(pyramid.feed(&[f64::NAN], &[&[0.0]]).is_err());
        assert_eq!(
            pyramid.feed(&[200.0], &[]),
            Err(PyramidError::Columns { came: 0, wanted: 1 })
        );
        assert_eq!((pyramid.rows(), pyramid.span()), (100, Some((0.0, 99.0))));
        assert_eq!(pyramid.line(0, 0.0, 99.0, 10), before);
    }

    #[test]
    fn an_empty_pyramid_and_an_empty_window_have_no_points() {
        assert_eq!(Pyramid::new(&[1.0], 16).line(0, 0.0, 1.0, 10), Line::default());
        let pyramid = fed(&ramp(100), &ramp(100), 3.5, 16, 100);
        assert_eq!(pyramid.line(0, 200.0, 300.0, 10), Line::default());
        assert_eq!(pyramid.rows_between(200.0, 300.0), (96, 100));
        assert_eq!(pyramid.rows_between(40.0, 41.0), (16, 64));
    }

    proptest! {
        #[test]
        fn extremes_of_every_pixel_survive_whatever_the_chunks(
            values in prop::collection::vec(prop_oneof![8 => -1e3..1e3, 1 => Just(f64::NAN), 1 => Just(f64::INFINITY)], 1..3000),
            ends in (0.0..3000.0, 0.0..3000.0),
            pixels in 1_usize..80,
            size in 1_usize..40,
            chunk in 1_usize..700,
        ) {
            let t = ramp(values.len());
            let (begin, end) = (f64::min(ends.0, ends.1), f64::max(ends.0, ends.1));
            let pyramid = fed(&t, &values, 3.5, size, chunk);
            let line = pyramid.line(0, begin, end, pixels);
            let at_once = fed(&t, &values, 3.5, size, values.len()).line(0, begin, end, pixels);
            prop_assert_eq!(format!("{line:?}"), format!("{at_once:?}")); // NaN is not equal to itself
            prop_assert!(line.t.len() <= 2 * pixels);
            prop_assert!(line.t.windows(2).all(|pair| pair[0] <= pair[1]));
            let (first, stop) = pyramid.rows_between(begin, end);
            let width = (end - begin) / pixels as f64 + size as f64;
            for (k, &value) in values.iter().enumerate().filter(|(_, value)| value.is_finite()) {
                if t[k] < begin || t[k] > end {
                    continue;
                }
                prop_assert!((first..stop).contains(&k));
                let near = |at: &usize| (line.t[*at] - t[k]).abs() <= width;
                prop_assert!((0..line.t.len()).filter(near).any(|at| line.high[at] >= value));
                prop_assert!((0..line.t.len()).filter(near).any(|at| line.low[at] <= value));
            }
            // Nothing is drawn that is not there.
            prop_assert!(line.low.iter().chain(&line.high).filter(|x| !x.is_nan()).all(|x| values.contains(x)));
        }
    }
}
