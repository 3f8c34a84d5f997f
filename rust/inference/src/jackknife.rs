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
    /// Hotelling's square of the candidate's parameters.
    pub square: f64,
    /// Number of blocks.
    pub blocks: usize,
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
    let square = square(&beta, &(&covariance + &question.unsure * question.unsure.transpose()));
    Some(Jackknife {
        p_value: square.map_or(1.0, |square| hotelling(square, m, b)),
        square: square.unwrap_or(0.0),
        blocks: count,
        estimate,
        covariance,
    })
}

/// Hotelling's square of an estimate with its covariance over blocks; `None` if they tell nothing.
fn square(beta: &DVector<f64>, covariance: &DMatrix<f64>) -> Option<f64> {
    let m = beta.len();
    let scale = DVector::from_fn(m, |j, _| covariance[(j, j)].max(f64::MIN_POSITIVE).sqrt());
    let mut correlation = DMatrix::from_fn(m, m, |i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    for j in 0..m {
        correlation[(j, j)] += 1e-9;
    }
    let factor = Cholesky::new(correlation)?;
    let z = beta.component_div(&scale);
    Some(z.dot(&factor.solve(&z)))
}

/// p-value of Hotelling's square of `m` parameters over as many blocks as say something of them.
pub fn hotelling(square: f64, m: usize, blocks: f64) -> f64 {
    let mf = m as f64;
    if blocks <= mf {
        return 1.0;
    }
    let f = square * (blocks - mf) / (mf * (blocks - 1.0));
    FisherSnedecor::new(mf, blocks - mf).map_or(1.0, |d| if f.is_finite() { d.sf(f.max(0.0)) } else { 1.0 })
}

/// Which blocks tell of a candidate's parameters.
pub struct Telling {
    /// How many blocks, all of them saying as much, would tell as well how the parameters scatter.
    pub blocks: f64,
    /// Mean square of the residual where the parameters are told, at least that of the noise.
    pub square: f64,
}

/// Which blocks tell of a candidate: a few turns of a log may say all there is of a parameter, and how these few differ is then all that
/// the blocks know of its scatter. Matches the total variance of the covariance with that of a Wishart matrix (Pustejovsky and Tipton
/// 2018, Small-sample methods for cluster-robust variance estimation, sec. 3.2).
pub fn telling(question: &Question, group: usize) -> Option<Telling> {
    let p = question.model;
    let m = question.precision.len() - p;
    let total = question.total();
    // The candidate's columns less what the model explains of them.
    let mut map = DMatrix::zeros(p + m, m);
    map.view_mut((p, 0), (m, m)).fill_with_identity();
    if p > 0 {
        let mut inner = total.gram.view((0, 0), (p, p)).into_owned();
        for j in 0..p {
            inner[(j, j)] += question.precision[j] + 1e-10 * inner[(j, j)];
        }
        let explained = Cholesky::new(inner)?.solve(&total.gram.view((0, p), (p, m)));
        map.view_mut((0, 0), (p, m)).copy_from(&-explained);
    }
    let told = |gram: &DMatrix<f64>| map.tr_mul(&(gram * &map));
    let mut all = told(&total.gram);
    for j in 0..m {
        // What the model explains as well is told by nothing.
        all[(j, j)] += question.precision[p + j] + 1e-10 * total.gram[(p + j, p + j)];
    }
    let root = Cholesky::new(all)?.l();
    let (mut sum, mut variance, mut square) = (DMatrix::zeros(m, m), 0.0, 0.0);
    for blocks in question.groups(group) {
        let mut gram = DMatrix::zeros(p + m, p + m);
        for b in &question.white[blocks.clone()] {
            gram += &b.gram;
        }
        let half = root.solve_lower_triangular(&told(&gram))?;
        let share = root.solve_lower_triangular(&half.transpose())?;
        variance += share.trace().powi(2) + share.norm_squared();
        let largest = question.squares[blocks].iter().copied().fold(1.0, f64::max);
        square += share.trace() * largest;
        sum += share;
    }
    Some(Telling {
        blocks: (sum.trace().powi(2) + sum.norm_squared()) / variance,
        square: square / sum.trace(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use imufit_fit::normal_equations::NormalEquations;

    /// One parameter of the model and `m` of a candidate, told by blocks with these Gram matrices.
    fn question(blocks: Vec<DMatrix<f64>>) -> Question {
        let p = blocks[0].nrows();
        let of = |gram: DMatrix<f64>| NormalEquations {
            gram,
            n: 10.0,
            ..NormalEquations::zeros(p)
        };
        let squares = (1..=blocks.len()).map(|b| b as f64).collect();
        let white: Vec<NormalEquations> = blocks.into_iter().map(of).collect();
        Question {
            raw: white.clone(),
            precision: DVector::from_element(p, 1e-9),
            model: 1,
            sums: Vec::new(),
            logs: std::iter::once(0..white.len()).collect(),
            white,
            squares,
            rests: false,
            unsure: DMatrix::zeros(p - 1, 0),
        }
    }

    #[test]
    fn blocks_that_say_the_same_all_count() {
        let same = DMatrix::from_row_slice(3, 3, &[1.0, 0.5, 0.0, 0.5, 2.0, 0.3, 0.0, 0.3, 1.0]);
        let told = telling(&question(vec![same; 20]), 1).unwrap();
        assert!((told.blocks - 20.0).abs() < 1e-6, "{}", told.blocks);
        assert!((told.square - 10.5).abs() < 1e-6, "{}", told.square);
    }

    #[test]
    fn blocks_that_say_nothing_of_the_candidate_do_not_count() {
        let with = |told: f64| DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, told]);
        let blocks = (0..20).map(|b| with(if b < 4 { 1.0 } else { 0.0 })).collect();
        let told = telling(&question(blocks), 1).unwrap();
        assert!((told.blocks - 4.0).abs() < 1e-6, "{}", told.blocks);
        assert!((told.square - 2.5).abs() < 1e-6, "{}", told.square);
    }

    #[test]
    fn one_parameter_gives_the_two_sided_t_test() {
        // t = 2.5 with 20 degrees of freedom: p = 0.02123
        let square = square(&DVector::from_vec(vec![2.5]), &DMatrix::from_element(1, 1, 1.0));
        let p = hotelling(square.unwrap(), 1, 21.0);
        assert!((p - 0.021_23).abs() < 1e-4, "{p}");
    }
}
