//! Held-out error: fitted on some blocks, judged on others, with the blocks beside them left out.

use imufit_fit::normal_equations::NormalEquations;
use nalgebra::DVector;

use crate::problem::Question;

/// Folds, each of blocks spread over the log so that what happens once is seen in more than one fold.
pub const FOLDS: usize = 12;

/// Error on data not used for the fit.
#[derive(Clone, Debug)]
pub struct HeldOut {
    /// Whitened sum of squares of each fold.
    pub white: Vec<f64>,
    /// Residual RMS over the noise floor, unwhitened, over all folds: root of the mean square over the channels.
    pub ratio: f64,
}

/// Held-out error of a question's parameters.
pub fn held_out(question: &Question) -> HeldOut {
    let blocks = question.white.len();
    let folds = FOLDS.min(blocks);
    let total = question.total();
    let mut white = Vec::with_capacity(folds);
    let (mut square, mut n) = (0.0, 0.0);
    for fold in 0..folds {
        let in_fold = |b: usize| b % folds == fold;
        let mut training = total.clone();
        let mut judged = NormalEquations::zeros(question.parameters());
        let mut judged_raw = NormalEquations::zeros(question.parameters());
        for b in 0..blocks {
            if question.beside(b).any(in_fold) {
                training.add(&question.white[b], -1.0);
            }
            if in_fold(b) {
                judged.add(&question.white[b], 1.0);
                judged_raw.add(&question.raw[b], 1.0);
            }
        }
        let beta = question
            .solve(&training)
            .unwrap_or_else(|| DVector::zeros(question.parameters()));
        white.push(judged.residual_square(&beta).max(0.0));
        square += judged_raw.residual_square(&beta).max(0.0);
        n += judged_raw.n;
    }
    HeldOut {
        white,
        ratio: if n > 0.0 { (square / n).sqrt() } else { f64::NAN },
    }
}

/// Gain of one question over another, summed over folds, and its standard error.
pub fn gain(without: &HeldOut, with: &HeldOut) -> (f64, f64) {
    let differences: Vec<f64> = without.white.iter().zip(&with.white).map(|(a, b)| a - b).collect();
    let n = differences.len() as f64;
    let sum: f64 = differences.iter().sum();
    let mean = sum / n;
    let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (sum, (n * variance).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gain_is_the_sum_over_folds() {
        let a = HeldOut {
            white: vec![3.0, 4.0, 5.0],
            ratio: 1.0,
        };
        let b = HeldOut {
            white: vec![1.0, 1.0, 1.0],
            ratio: 1.0,
        };
        let (sum, error) = gain(&a, &b);
        assert!((sum - 9.0).abs() < 1e-12 && (error - 3.0_f64.sqrt()).abs() < 1e-12);
    }
}
