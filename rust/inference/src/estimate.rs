//! Parameters of a model with their standard errors.

use nalgebra::{DMatrix, DVector};

use crate::problem::Problem;

/// Fitted steps of a model's parameters.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Step of each parameter from where the evidence was taken.
    pub step: DVector<f64>,
    /// Covariance.
    pub covariance: DMatrix<f64>,
}

/// Fits the model's parameters. The covariance is that of whitened observations of unit variance, inflated where the blocks scatter more than that.
pub fn estimate(problem: &Problem, model: &[usize]) -> Option<Estimate> {
    let total = problem.total(model);
    let precision = DVector::from_iterator(model.len(), model.iter().map(|j| 0.01 * problem.precision(*j)));
    let solved = total.solve(&precision)?;
    let covariance = solved.covariance();
    Some(Estimate { step: solved.solution, covariance })
}
