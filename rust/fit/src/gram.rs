//! Gram matrix of columns, each pair once: half of what a full matrix takes.

use nalgebra::{DMatrix, DVector};

/// Symmetric matrix of n rows: its upper triangle, column by column.
#[derive(Clone, Debug, PartialEq)]
pub struct Gram {
    n: usize,
    values: Vec<f64>,
}

impl Gram {
    /// A matrix of zeros.
    pub fn zeros(n: usize) -> Self {
        Self {
            n,
            values: vec![0.0; n * (n + 1) / 2],
        }
    }

    /// Number of columns.
    pub const fn columns(&self) -> usize {
        self.n
    }

    /// Product of two columns.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        let (first, last) = if i < j { (i, j) } else { (j, i) };
        self.values[last * (last + 1) / 2 + first]
    }

    /// Adds `factor` times another matrix.
    pub fn add(&mut self, other: &Self, factor: f64) {
        for (own, value) in self.values.iter_mut().zip(&other.values) {
            *own += factor * value;
        }
    }

    /// Adds a symmetric matrix; only its upper triangle is used.
    pub fn add_matrix(&mut self, matrix: &DMatrix<f64>) {
        let mut own = self.values.iter_mut();
        for (j, column) in matrix.column_iter().enumerate() {
            for (value, own) in column.iter().take(j + 1).zip(own.by_ref()) {
                *own += value;
            }
        }
    }

    /// Adds the products of one row.
    pub fn add_row(&mut self, row: &DVector<f64>) {
        let mut own = self.values.iter_mut();
        for j in 0..self.n {
            for (value, own) in row.iter().take(j + 1).zip(own.by_ref()) {
                *own += value * row[j];
            }
        }
    }

    /// The whole matrix.
    pub fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_fn(self.n, self.n, |i, j| self.at(i, j))
    }

    /// Square of the sum of all columns, each times its part of a vector.
    pub fn square(&self, v: &DVector<f64>) -> f64 {
        let mut values = self.values.iter();
        let mut sum = 0.0;
        for j in 0..self.n {
            let above: f64 = v.iter().take(j).zip(values.by_ref()).map(|(x, g)| x * g).sum();
            let own = values.next().map_or(0.0, |g| g * v[j]);
            sum += v[j] * (2.0 * above + own);
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_full_matrix() {
        let rows = DMatrix::from_fn(7, 4, |i, j| ((3 * i + 5 * j) % 11) as f64 - 4.0);
        let full = rows.transpose() * &rows;
        let mut by_row = Gram::zeros(4);
        for row in rows.row_iter() {
            by_row.add_row(&row.transpose());
        }
        let mut at_once = Gram::zeros(4);
        at_once.add_matrix(&full);
        assert_eq!((by_row.matrix(), by_row.columns()), (full.clone(), 4));
        assert_eq!(by_row, at_once);
        at_once.add(&by_row, -0.5);
        assert_eq!(at_once.matrix(), full.clone() * 0.5);
        let v = DVector::from_vec(vec![1.0, -2.0, 0.5, 3.0]);
        assert!((by_row.square(&v) - (&full * &v).dot(&v)).abs() < 1e-9);
        assert_eq!(by_row.at(3, 1).to_bits(), by_row.at(1, 3).to_bits());
    }
}
