//! How estimates scatter from block to block: delete-block jackknife, so that what noise components miss widens standard errors.

use nalgebra::DVector;

use crate::problem::Question;

/// Estimates with one block left out each time; blocks without samples (a gap in the log) are not counted.
fn left_out(question: &Question) -> Option<Vec<DVector<f64>>> {
    let total = question.total();
    question
        .white
        .iter()
        .filter(|b| b.n > 0.0)
        .map(|block| {
            let mut without = total.clone();
            without.add(block, -1.0);
            question.solve(&without)
        })
        .collect()
}

/// Jackknife variance of every parameter of a question.
pub fn scatter(question: &Question) -> Option<DVector<f64>> {
    let estimates = left_out(question)?;
    let b = estimates.len() as f64;
    let first = estimates.first()?;
    let mean: DVector<f64> = estimates.iter().fold(DVector::zeros(first.len()), |s, v| s + v) / b;
    let sum: DVector<f64> = estimates.iter().fold(DVector::zeros(first.len()), |s, v| {
        let d = v - &mean;
        s + d.component_mul(&d)
    });
    Some(sum * ((b - 1.0) / b))
}
