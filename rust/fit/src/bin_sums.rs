//! Sums of columns and residual over the rows of a block in each bin of one covariate.
//!
//! A block of time holds few of the values that time, temperature or a slow turn take in a log, so that only the bins it visits are kept.

use nalgebra::DMatrix;

/// Number of samples and sums of `[columns | residual]` in each bin; no bins where the covariate does not vary.
#[derive(Clone, Debug)]
pub struct BinSums {
    /// Number of samples in each bin.
    pub count: Vec<f64>,
    width: usize,
    /// Where the sums of each bin begin; `None` for one without samples.
    begin: Vec<Option<usize>>,
    sums: Vec<f64>,
}

impl BinSums {
    /// Empty sums of so many bins of so many columns and a residual.
    pub fn zeros(bins: usize, width: usize) -> Self {
        Self {
            count: vec![0.0; bins],
            width,
            begin: vec![None; bins],
            sums: Vec::new(),
        }
    }

    /// Adds samples to a bin.
    pub fn add(&mut self, bin: usize, count: f64, values: &[f64]) {
        self.count[bin] += count;
        let begin = *self.begin[bin].get_or_insert_with(|| {
            self.sums.resize(self.sums.len() + self.width, 0.0);
            self.sums.len() - self.width
        });
        for (sum, value) in self.sums[begin..].iter_mut().zip(values) {
            *sum += value;
        }
    }

    /// Adds the sums of other rows.
    pub fn merge(&mut self, other: &Self) {
        for (bin, count) in other.count.iter().enumerate() {
            if let Some(sums) = other.of(bin) {
                self.add(bin, *count, sums);
            }
        }
    }

    /// Sums of columns and residual of a bin; `None` without samples.
    pub fn of(&self, bin: usize) -> Option<&[f64]> {
        self.begin[bin].map(|begin| &self.sums[begin..begin + self.width])
    }

    /// The sums with a column for each bin (width x bins).
    pub fn matrix(&self) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.width, self.count.len());
        for (bin, mut column) in out.column_iter_mut().enumerate() {
            if let Some(sums) = self.of(bin) {
                column.copy_from_slice(sums);
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_bins_with_samples_are_kept() {
        let mut sums = BinSums::zeros(3, 2);
        sums.add(2, 1.0, &[1.0, 2.0]);
        let mut other = BinSums::zeros(3, 2);
        other.add(0, 2.0, &[5.0, 6.0]);
        other.add(2, 1.0, &[10.0, 20.0]);
        sums.merge(&other);
        assert_eq!(sums.count, [2.0, 0.0, 2.0]);
        assert_eq!(
            sums.matrix(),
            DMatrix::from_row_slice(2, 3, &[5.0, 0.0, 11.0, 6.0, 0.0, 22.0])
        );
        assert_eq!((sums.of(1), sums.sums.len()), (None, 4));
    }
}
