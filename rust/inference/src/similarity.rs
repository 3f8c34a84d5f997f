//! How much two effects look alike in a log.

use nalgebra::{DMatrix, DVector};

use crate::problem::Problem;

/// Share of a fitted signal that another candidate reproduces, as a correlation: the square root of R^2 of `columns * beta` on the rival, the
/// model projected out.
pub fn correlation(problem: &Problem, model: &[usize], candidate: &[usize], beta: &[f64], rival: &[usize]) -> f64 {
    let signal = |on: &[usize]| -> Option<f64> {
        // Sum of squares of the candidate's signal that is left once `on` is fitted to it.
        let all: Vec<usize> = on.iter().chain(candidate).copied().collect();
        let total = problem.total(&all);
        let p = on.len();
        let mut v = DMatrix::zeros(all.len(), 1);
        for (k, b) in beta.iter().enumerate() {
            v[p + k] = *b;
        }
        let gv = &total.gram * &v;
        let square = (v.transpose() * &gv)[(0, 0)];
        let mut inner = total.selected(&(0..p).collect::<Vec<_>>());
        inner.right = gv.rows(0, p).column(0).into_owned();
        let right = inner.right.clone();
        let precision = DVector::from_iterator(p, on.iter().map(|j| problem.precision(*j)));
        Some(square - right.dot(&inner.solve(&precision)?.solution))
    };
    let both: Vec<usize> = model.iter().chain(rival).copied().collect();
    match (signal(model), signal(&both)) {
        (Some(alone), Some(left)) if alone > 0.0 => (1.0 - left / alone).clamp(0.0, 1.0).sqrt(),
        _ => 0.0,
    }
}
