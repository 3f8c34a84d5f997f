//! Significance from whole blocks: delete-block jackknife, so that correlation inside a block cannot pass for evidence.

use imufit_fit::normal_equations::NormalEquations;
use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::problem::Question;

/// A candidate's parameters (reduced) with their jackknife covariance.
#[derive(Clone, Debug)]
pub struct Jackknife {
    /// Estimate from all blocks, model parameters first.
    pub estimate: DVector<f64>,
    /// Covariance of the candidate's parameters.
    pub covariance: DMatrix<f64>,
    /// Hotelling's p-value of "all zero", with (m, blocks - m) degrees of freedom.
    pub p_value: f64,
}

/// Smallest number of blocks beyond the number of parameters for which a p-value is given.
const SPARE_BLOCKS: usize = 4;

/// Estimates with one block left out each time, neighbouring blocks taken together `group` at a time; blocks without samples (a gap in the log) are
/// no evidence and are not counted.
fn left_out(question: &Question, group: usize) -> Option<Vec<DVector<f64>>> {
    let total = question.total();
    question
        .groups(group)
        .map(|blocks| {
            let mut sum = NormalEquations::zeros(question.precision.len());
            for b in &question.white[blocks] {
                sum.add(b, 1.0);
            }
            sum
        })
        .filter(|b| b.n > 0.0)
        .map(|block| {
            let mut without = total.clone();
            without.add(&block, -1.0);
            question.solve(&without)
        })
        .collect()
}

/// True if a question has something to ask and blocks enough for a p-value.
pub fn possible(question: &Question) -> bool {
    let m = question.precision.len() - question.model;
    let blocks = question.white.iter().filter(|b| b.n > 0.0).count();
    m > 0 && blocks >= m + SPARE_BLOCKS
}

/// Jackknife variance of every parameter of a question.
pub fn scatter(question: &Question) -> Option<DVector<f64>> {
    let estimates = left_out(question, 1)?;
    let b = estimates.len() as f64;
    let first = estimates.first()?;
    let mean: DVector<f64> = estimates.iter().fold(DVector::zeros(first.len()), |s, v| s + v) / b;
    let sum: DVector<f64> = estimates.iter().fold(DVector::zeros(first.len()), |s, v| {
        let d = v - &mean;
        s + d.component_mul(&d)
    });
    Some(sum * ((b - 1.0) / b))
}

/// Jackknife over blocks, neighbouring blocks taken together `group` at a time.
pub fn jackknife(question: &Question, group: usize) -> Option<Jackknife> {
    let estimate = question.solve(&question.total())?;
    let m = estimate.len() - question.model;
    let left_out: Vec<DVector<f64>> = left_out(question, group)?
        .iter()
        .map(|v| v.rows(question.model, m).into_owned())
        .collect();
    let count = left_out.len();
    if m == 0 || count < m + SPARE_BLOCKS {
        return None;
    }
    let b = count as f64;
    let mean: DVector<f64> = left_out.iter().fold(DVector::zeros(m), |s, v| s + v) / b;
    let mut covariance = DMatrix::zeros(m, m);
    for v in &left_out {
        let d = v - &mean;
        covariance.ger((b - 1.0) / b, &d, &d, 1.0);
    }
    let beta = estimate.rows(question.model, m).into_owned();
    let p_value = hotelling(&beta, &covariance, count);
    Some(Jackknife {
        estimate,
        covariance,
        p_value,
    })
}

/// p-value of a mean of zero from an estimate and its covariance over `blocks` blocks.
pub fn hotelling(beta: &DVector<f64>, covariance: &DMatrix<f64>, blocks: usize) -> f64 {
    let m = beta.len();
    let scale = DVector::from_fn(m, |j, _| covariance[(j, j)].max(f64::MIN_POSITIVE).sqrt());
    let mut correlation = DMatrix::from_fn(m, m, |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    for j in 0..m {
        correlation[(j, j)] += 1e-9;
    }
    let Some(factor) = Cholesky::new(correlation) else {
        return 1.0;
    };
    let z = beta.component_div(&scale);
    let square = z.dot(&factor.solve(&z));
    let (mf, b) = (m as f64, blocks as f64);
    let f = square * (b - mf) / (mf * (b - 1.0));
    FisherSnedecor::new(mf, b - mf).map_or(1.0, |d| if f.is_finite() { d.sf(f.max(0.0)) } else { 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_parameter_gives_the_two_sided_t_test() {
        // t = 2.5 with 20 degrees of freedom: p = 0.02123
        let p = hotelling(&DVector::from_vec(vec![2.5]), &DMatrix::from_element(1, 1, 1.0), 21);
        assert!((p - 0.021_23).abs() < 1e-4, "{p}");
    }
}
