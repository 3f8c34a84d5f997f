//! Normal equations: scaled Cholesky solution and covariance.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::gram::Gram;

/// Gram matrix, right-hand side and sum of squares of a weighted least-squares problem.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// X^T X (p x p).
    pub gram: DMatrix<f64>,
    /// X^T y.
    pub right: DVector<f64>,
    /// y^T y.
    pub square: f64,
    /// Number of observations.
    pub n: f64,
}

/// A factorised system.
pub struct Solved {
    factor: Cholesky<f64, Dyn>,
    scale: DVector<f64>,
    /// The solution.
    pub solution: DVector<f64>,
}

/// Prior precision added to a unit diagonal: enough to carry the solution over combinations that the data leave open.
const RIDGE: f64 = 1e-10;
/// Steps by which a solution is refined.
const REFINEMENTS: usize = 4;

/// Up to this condition number a solution has at least four digits.
pub const TRUSTED_CONDITION: f64 = 5e4;

impl NormalEquations {
    /// Zero equations of `p` parameters.
    pub fn zeros(p: usize) -> Self {
        Self {
            gram: DMatrix::zeros(p, p),
            right: DVector::zeros(p),
            square: 0.0,
            n: 0.0,
        }
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.right.len()
    }

    /// Adds `factor` times other equations.
    pub fn add(&mut self, other: &Self, factor: f64) {
        self.gram.zip_apply(&other.gram, |a, b| *a += factor * b);
        self.right.axpy(factor, &other.right, 1.0);
        self.square += factor * other.square;
        self.n += factor * other.n;
    }

    /// Adds one channel's Gram matrix of `[columns | residual]` that counts as `n` observations; `chosen` are pairs of a place here and one there.
    pub fn add_channel(&mut self, gram: &Gram, n: f64, chosen: &[(usize, usize)], weight: f64) {
        if !(weight > 0.0 && weight.is_finite()) {
            return;
        }
        let last = gram.columns() - 1;
        for (q, j) in chosen {
            for (p, i) in chosen {
                self.gram[(*p, *q)] += weight * gram.at(*i, *j);
            }
            self.right[*q] += weight * gram.at(*j, last);
        }
        self.square += weight * gram.at(last, last);
        self.n += n;
    }

    /// Equations of the parameters `kept` once others have been given values: what these explain is taken off the observations.
    #[must_use]
    pub fn given(&self, kept: &[usize], others: &[usize], values: &[f64]) -> Self {
        let mut out = self.selected(kept);
        for (j, value) in others.iter().zip(values) {
            for (k, i) in kept.iter().enumerate() {
                out.right[k] -= self.gram[(*i, *j)] * value;
            }
            out.square -= 2.0 * self.right[*j] * value;
            for (i, other) in others.iter().zip(values) {
                out.square += self.gram[(*i, *j)] * value * other;
            }
        }
        out
    }

    /// Equations of some of the parameters.
    #[must_use]
    pub fn selected(&self, parameters: &[usize]) -> Self {
        Self {
            gram: DMatrix::from_fn(parameters.len(), parameters.len(), |i, j| {
                self.gram[(parameters[i], parameters[j])]
            }),
            right: self.right.select_rows(parameters),
            square: self.square,
            n: self.n,
        }
    }

    /// The same equations among those of `parameters` parameters, where each of their own has its place.
    #[must_use]
    pub fn placed(&self, places: &[usize], parameters: usize) -> Self {
        let mut out = Self {
            square: self.square,
            n: self.n,
            ..Self::zeros(parameters)
        };
        for (j, q) in places.iter().enumerate() {
            for (i, p) in places.iter().enumerate() {
                out.gram[(*p, *q)] = self.gram[(i, j)];
            }
            out.right[*q] = self.right[j];
        }
        out
    }

    /// Solves the equations with a prior of zero mean and the given precisions; `None` if that fails.
    pub fn solve(&self, precision: &DVector<f64>) -> Option<Solved> {
        let p = self.parameters();
        let mut scaled = self.gram.clone();
        for j in 0..p {
            scaled[(j, j)] += precision[j];
        }
        let scale = DVector::from_fn(p, |j, _| {
            let d = scaled[(j, j)];
            if d > 0.0 { 1.0 / d.sqrt() } else { 1.0 }
        });
        for j in 0..p {
            for i in 0..p {
                scaled[(i, j)] *= scale[i] * scale[j];
            }
        }
        for j in 0..p {
            scaled[(j, j)] = scaled[(j, j)].max(1.0);
        }
        let mut ridged = scaled.clone();
        for j in 0..p {
            ridged[(j, j)] += RIDGE;
        }
        let factor = Cholesky::new(ridged)?;
        let right = self.right.component_mul(&scale);
        let mut solution = factor.solve(&right);
        // Takes the ridge's bias out of what the data determine.
        for _ in 0..REFINEMENTS {
            let mut left = right.clone();
            left.gemv(-1.0, &scaled, &solution, 1.0);
            factor.solve_mut(&mut left);
            solution += left;
        }
        solution.component_mul_assign(&scale);
        solution.iter().all(|v| v.is_finite()).then_some(Solved {
            factor,
            scale,
            solution,
        })
    }

    /// Condition number of the design matrix, its columns scaled to unit length; infinite if they are dependent, 1 without any.
    ///
    /// Squaring the matrix squares this number, so that about `2 log10(condition)` of 16 digits are lost, and past
    /// [`TRUSTED_CONDITION`] the prior of [`NormalEquations::solve`] decides along with the data.
    pub fn condition(&self) -> f64 {
        let used: Vec<usize> = (0..self.parameters()).filter(|j| self.gram[(*j, *j)] > 0.0).collect();
        if used.is_empty() {
            return 1.0;
        }
        let size = |j: usize| self.gram[(used[j], used[j])].sqrt();
        let scaled = DMatrix::from_fn(used.len(), used.len(), |i, j| {
            self.gram[(used[i], used[j])] / (size(i) * size(j))
        });
        let eigenvalues = scaled.symmetric_eigenvalues();
        let (smallest, largest) = eigenvalues
            .iter()
            .fold((f64::INFINITY, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)));
        // Below rounding an eigenvalue says nothing but that the columns are dependent.
        let rounding = f64::EPSILON * largest * used.len() as f64;
        if smallest > rounding {
            (largest / smallest).sqrt()
        } else {
            f64::INFINITY
        }
    }

    /// Sum of squared residuals at given parameters.
    pub fn residual_square(&self, beta: &DVector<f64>) -> f64 {
        self.square - 2.0 * self.right.dot(beta) + beta.dot(&(&self.gram * beta))
    }
}

impl Solved {
    /// Covariance of the solution for observations of unit variance.
    pub fn covariance(&self) -> DMatrix<f64> {
        let mut c = self.factor.inverse();
        let p = self.scale.len();
        for j in 0..p {
            for i in 0..p {
                c[(i, j)] *= self.scale[i] * self.scale[j];
            }
        }
        c
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_very_different_size_are_solved_to_full_precision() {
        let x = DMatrix::from_fn(50, 3, |i, j| {
            [1.0, 1e-6 * (i as f64).sin(), 1e5 * (0.3 * i as f64).cos()][j]
        });
        let truth = DVector::from_vec(vec![2.0, -3e6, 4e-5]);
        let y = &x * &truth;
        let equations = NormalEquations {
            gram: x.tr_mul(&x),
            right: x.tr_mul(&y),
            square: y.dot(&y),
            n: 50.0,
        };
        let solved = equations.solve(&DVector::zeros(3)).expect("determined");
        for j in 0..3 {
            assert!((solved.solution[j] / truth[j] - 1.0).abs() < 1e-8);
        }
        assert!(equations.residual_square(&solved.solution).abs() < 1e-6 * equations.square);
    }
}
