//! Parameters of a model with their standard errors.

use nalgebra::{DMatrix, DVector};

use crate::criterion::Criterion;
use crate::problem::Problem;
use crate::scatter::scatter;
use crate::stack::Stack;

/// Fitted steps of a model's parameters.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Step of each parameter from where the evidence was taken.
    pub step: DVector<f64>,
    /// Whether each parameter stands at a bound that keeps it from a better value.
    pub at_bound: Vec<bool>,
    /// Covariance; of a parameter at its bound not a number.
    pub covariance: DMatrix<f64>,
}

/// Blocks of white noise give a jackknife variance this much above the expected one in one of a thousand cases.
const SCATTER: f64 = 1.7;

/// Fits the model's parameters to all whitened observations alike, as the held-out error is judged: a zero that wanders, and a
/// mean that is no drift but something missing, must not decide what a constant is. The covariance is that of such an
/// estimate from observations of unit variance whose zeros do wander.
pub fn estimate(problem: &Problem, model: &[usize]) -> Option<Estimate> {
    let within = problem.step_within(model)?;
    if !within.at_bound.contains(&true) {
        return Some(Estimate {
            step: within.solution,
            at_bound: within.at_bound,
            covariance: covariance(problem, model)?,
        });
    }
    // Of those at their bounds the data tell nothing more; the others are as sure as beside values that are given.
    let (held, free): (Vec<usize>, Vec<usize>) = (0..model.len()).partition(|k| within.at_bound[*k]);
    let places = |chosen: &[usize]| chosen.iter().map(|k| model[*k]).collect::<Vec<usize>>();
    let steps: Vec<f64> = held.iter().map(|k| within.solution[*k]).collect();
    let of_free = covariance(&problem.given(&places(&held), &steps), &places(&free))?;
    let mut all = DMatrix::from_element(model.len(), model.len(), f64::NAN);
    for (row, i) in free.iter().enumerate() {
        for (column, j) in free.iter().enumerate() {
            all[(*i, *j)] = of_free[(row, column)];
        }
    }
    Some(Estimate {
        step: within.solution,
        at_bound: within.at_bound,
        covariance: all,
    })
}

/// Covariance of parameters that are fitted to all whitened observations alike.
fn covariance(problem: &Problem, model: &[usize]) -> Option<DMatrix<f64>> {
    let total = problem.total(model);
    let inverse = total.solve(&problem.prior(model).precision)?.covariance();
    let mut covariance = &inverse + &inverse * spread(problem, model) * &inverse;
    // Where the blocks scatter more than whitened noise does, they are believed.
    let question = problem.question(model, &[]);
    if let Some(blocks) = scatter(&question) {
        for j in 0..model.len() {
            let ratio = blocks[j] / covariance[(j, j)];
            let factor = if ratio > SCATTER { ratio.sqrt() } else { 1.0 };
            for k in 0..model.len() {
                covariance[(j, k)] *= factor;
                covariance[(k, j)] *= factor;
            }
        }
    }
    Some(covariance)
}

/// What the noise of the zeros and of the reference's heading adds to the covariance of the right-hand side, at its likeliest strength.
fn spread(problem: &Problem, model: &[usize]) -> DMatrix<f64> {
    let criterion = Criterion::new(problem);
    let parameters: Vec<(usize, f64)> = model.iter().map(|j| (*j, 1.0 / problem.precision(*j).sqrt())).collect();
    let mut sum = DMatrix::zeros(model.len(), model.len());
    if let Some(stack) = Stack::new(&criterion, &parameters) {
        for modes in &criterion.modes {
            let own = modes.sums.select_columns(model);
            let variance = modes.variance(stack.strength(modes.sensor()));
            sum += own.tr_mul(&(DMatrix::from_diagonal(&variance) * &own));
        }
        let heading = criterion
            .total
            .gram
            .select_rows(&criterion.heading)
            .select_columns(model);
        sum.gemm_tr(stack.wanders().powi(2), &heading, &heading, 1.0);
    }
    sum
}
