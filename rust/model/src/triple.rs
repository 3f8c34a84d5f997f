//! Three columns of equal length: one vector quantity over the rows of a window.

use nalgebra::Vector3;

/// x, y and z of a vector quantity, each contiguous over the rows.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triple(pub [Vec<f64>; 3]);

impl Triple {
    /// `n` rows of zeros.
    pub fn zeros(n: usize) -> Self {
        Self([vec![0.0; n], vec![0.0; n], vec![0.0; n]])
    }

    /// Adds a multiple of another quantity of as many rows.
    pub fn add(&mut self, other: &Self, factor: f64) {
        for (own, other) in self.0.iter_mut().zip(&other.0) {
            for (a, b) in own.iter_mut().zip(other) {
                *a += factor * b;
            }
        }
    }

    /// Adds another quantity of as many rows where it is known.
    pub fn add_known(&mut self, other: &Self) {
        for (own, other) in self.0.iter_mut().zip(&other.0) {
            for (a, b) in own.iter_mut().zip(other).filter(|(_, b)| b.is_finite()) {
                *a += b;
            }
        }
    }

    /// Multiplies all by a factor.
    pub fn scale(&mut self, factor: f64) {
        for v in self.0.iter_mut().flatten() {
            *v *= factor;
        }
    }

    /// The opposite.
    #[must_use]
    pub fn negative(&self) -> Self {
        Self(std::array::from_fn(|axis| self.0[axis].iter().map(|v| -v).collect()))
    }

    /// Appends a row.
    pub fn push(&mut self, v: &Vector3<f64>) {
        for axis in 0..3 {
            self.0[axis].push(v[axis]);
        }
    }

    /// The same with the flagged axes zero where they are known.
    #[must_use]
    pub fn without(&self, axes: [bool; 3]) -> Self {
        let mut out = self.clone();
        for axis in (0..3).filter(|a| axes[*a]) {
            for v in out.0[axis].iter_mut().filter(|v| v.is_finite()) {
                *v = 0.0;
            }
        }
        out
    }

    /// Vector of one row.
    pub fn row(&self, i: usize) -> Vector3<f64> {
        Vector3::new(self.0[0][i], self.0[1][i], self.0[2][i])
    }

    /// Some of the rows.
    #[must_use]
    pub fn part(&self, rows: &std::ops::Range<usize>) -> Self {
        Self(std::array::from_fn(|axis| self.0[axis][rows.clone()].to_vec()))
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.0[0].len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.0[0].is_empty()
    }

    /// One axis.
    pub fn axis(&self, axis: usize) -> &[f64] {
        &self.0[axis]
    }
}
