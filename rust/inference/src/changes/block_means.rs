//! Block means of a channel, and how much better more columns explain them.
//!
//! Many steps, swings, stays and humps are asked for beside the same parameters: what these take out of the means is worked out once.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::drift::ChannelSums;
use crate::orthonormal;

/// Block means scatter by no less than this part of what their samples say (variance).
const LEAST_SCATTER: f64 = 1e-3;
/// Part of a column that must lie outside the others to count.
const INDEPENDENT: f64 = 1e-6;

/// Block means explained by columns.
pub struct Explained {
    /// Minus twice the log likelihood, less a constant, at the strength of the walk and of what the means scatter besides that suit them
    /// best.
    pub deviance: f64,
    /// Sum of squares that is left if the zero does not wander, in units of the noise.
    pub white: f64,
    /// Block means that the columns leave.
    pub residual: DVector<f64>,
    /// Number of independent columns.
    pub fitted: usize,
}

/// One strength of the walk.
struct Strength {
    log_determinant: f64,
    /// Precision of the means with the parameters' columns taken out: what these explain it takes for nothing.
    precision: DMatrix<f64>,
    /// The precision times the means.
    weighed: DVector<f64>,
    /// Sum of squares of the means, weighed.
    square: f64,
}

/// Block means of one channel beside the columns of a question's parameters and a constant.
pub struct BlockMeans {
    /// Orthonormal basis of those columns.
    basis: DMatrix<f64>,
    strengths: Vec<Strength>,
    /// Number of means that have samples.
    filled: f64,
    /// What the columns leave, with no others beside them.
    pub without: Explained,
}

impl BlockMeans {
    /// The means behind some sums; `None` where there are too few blocks for a walk.
    pub fn new(sums: &ChannelSums) -> Option<Self> {
        // Whatever level the means have is no change.
        let level = DMatrix::from_element(sums.sums.nrows(), 1, 1.0);
        let (means, basis) = sums.means(Some(&level));
        let mut strengths = Vec::new();
        for walk in sums.strengths() {
            let mut precision = walk.precision.clone();
            let weighed = &precision * &basis;
            let inner = Cholesky::new(basis.tr_mul(&weighed))?;
            precision -= &weighed * inner.solve(&weighed.transpose());
            let weighed = &precision * &means;
            strengths.push(Strength {
                log_determinant: walk.log_determinant,
                square: means.dot(&weighed),
                precision,
                weighed,
            });
        }
        let left = &means - &basis * basis.tr_mul(&means);
        let fitted = basis.ncols();
        let mut out = Self {
            basis,
            strengths,
            filled: sums.filled(),
            without: Explained {
                deviance: 0.0,
                white: 0.0,
                residual: left,
                fitted,
            },
        };
        out.without = out.beside(&DMatrix::zeros(means.len(), 0))?;
        Some(out)
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.without.residual.len()
    }

    /// How well more columns (blocks x columns) explain the means as well.
    pub fn beside(&self, columns: &DMatrix<f64>) -> Option<Explained> {
        let own = self.independent(columns);
        let mut deviance = f64::INFINITY;
        let mut white = None;
        for strength in &self.strengths {
            let inner = own.tr_mul(&(&strength.precision * &own));
            let right = own.tr_mul(&strength.weighed);
            let explained = if own.ncols() == 0 {
                0.0
            } else {
                right.dot(&Cholesky::new(inner)?.solve(&right))
            };
            let square = strength.square - explained;
            // Noise that is coloured more slowly than the filters see makes block means scatter more than their samples say; a
            // filter that has seen a jump makes them scatter less.
            let excess = (square / self.filled).max(LEAST_SCATTER);
            deviance = deviance.min(strength.log_determinant + self.filled * excess.ln() + square / excess);
            // The first strength is none.
            white.get_or_insert(square);
        }
        let residual = &self.without.residual;
        Some(Explained {
            deviance,
            white: white?,
            residual: residual - &own * own.tr_mul(residual),
            fitted: self.basis.ncols() + own.ncols(),
        })
    }

    /// Orthonormal basis of what some columns have that the parameters' have not.
    fn independent(&self, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let mut own = columns.clone();
        for mut column in own.column_iter_mut() {
            let norm = column.norm();
            column /= norm.max(f64::MIN_POSITIVE);
        }
        own -= &self.basis * self.basis.tr_mul(&own);
        if own.ncols() == 0 {
            return own;
        }
        let room = (self.blocks() / 2).saturating_sub(self.basis.ncols());
        orthonormal::basis(own, INDEPENDENT, room)
    }

    /// The change that explains the means best of those asked for, and what it leaves.
    pub fn best<T>(&self, asked: Vec<T>, columns: impl Fn(&T) -> DMatrix<f64>) -> Option<(T, Explained)> {
        asked
            .into_iter()
            .filter_map(|change| {
                let explained = self.beside(&columns(&change))?;
                Some((change, explained))
            })
            .min_by(|a, b| a.1.deviance.total_cmp(&b.1.deviance))
    }
}

/// The changes that stand out of many: the first `most` by either of two scores.
pub fn standing_out<T: Copy>(mut changes: Vec<(T, [f64; 2])>, most: usize) -> Vec<T> {
    let mut found = Vec::new();
    for kind in 0..2 {
        changes.sort_by(|a, b| b.1[kind].total_cmp(&a.1[kind]));
        found.extend(changes.iter().take(most).map(|(change, _)| *change));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_that_stand_out_are_first_by_either_score() {
        let changes = vec![('a', [1.0, 3.0]), ('b', [2.0, 1.0]), ('c', [0.0, 2.0])];
        assert_eq!(standing_out(changes, 1), ['b', 'a']);
    }
}
