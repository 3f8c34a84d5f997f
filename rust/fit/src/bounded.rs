//! Least squares within bounds: which parameters stand at one, and what the others are beside them.

use nalgebra::DVector;

use crate::normal_equations::NormalEquations;

/// Smallest and largest value of each parameter; infinite where there is none.
#[derive(Clone, Debug)]
pub struct Bounds {
    /// Smallest value.
    pub lower: DVector<f64>,
    /// Largest value.
    pub upper: DVector<f64>,
}

/// A solution within bounds.
#[derive(Clone, Debug)]
pub struct Within {
    /// Value of every parameter.
    pub solution: DVector<f64>,
    /// Whether it stands at a bound that keeps it from a better value.
    pub at_bound: Vec<bool>,
}

/// Part of the largest score, in standard deviations, by which a parameter must gain before it leaves its bound: rounding alone makes less.
const ROUNDING: f64 = 1e-9;
/// Changes of the active set for each parameter; each lowers the sum of squares, and more than two are hardly ever needed.
const CHANGES: usize = 10;

impl Bounds {
    /// Whether any parameter has a bound.
    pub fn any(&self) -> bool {
        self.lower.iter().chain(self.upper.iter()).any(|v| v.is_finite())
    }

    fn clamped(&self, j: usize, value: f64) -> f64 {
        value.max(self.lower[j]).min(self.upper[j])
    }
}

impl NormalEquations {
    /// Solves the equations within bounds; `None` if that fails.
    ///
    /// The active-set method for least squares with simple bounds (Stark and Parker 1995, Bounded-variable least squares): parameters at a
    /// bound are given that value, the others are solved for; who leaves the bounds is stopped there, who is held back from the inside is let go.
    pub fn solve_within(&self, precision: &DVector<f64>, bounds: &Bounds) -> Option<Within> {
        let p = self.parameters();
        let mut solution = DVector::from_fn(p, |j, _| bounds.clamped(j, 0.0));
        let mut at_bound = vec![false; p];
        for _ in 0..=CHANGES * p {
            let (free, held): (Vec<usize>, Vec<usize>) = (0..p).partition(|j| !at_bound[*j]);
            let values: Vec<f64> = held.iter().map(|j| solution[*j]).collect();
            let solved = self.given(&free, &held, &values).solve(&precision.select_rows(&free))?;
            // How far the way to the solution is free of bounds, and who stops it.
            let mut way = 1.0;
            let mut stopped = None;
            for (j, goal) in free.iter().zip(solved.solution.iter()) {
                let limit = bounds.clamped(*j, *goal);
                #[allow(clippy::float_cmp)] // a number that was not changed is the same one
                if limit != *goal {
                    let part = ((limit - solution[*j]) / (goal - solution[*j])).clamp(0.0, 1.0);
                    if stopped.is_none() || part < way {
                        (way, stopped) = (part, Some((*j, limit)));
                    }
                }
            }
            for (j, goal) in free.iter().zip(solved.solution.iter()) {
                solution[*j] = match stopped {
                    Some(_) => bounds.clamped(*j, solution[*j] + way * (goal - solution[*j])),
                    None => *goal,
                };
            }
            if let Some((j, limit)) = stopped {
                solution[j] = limit;
                at_bound[j] = true;
                continue;
            }
            match self.held_back(precision, bounds, &solution, &at_bound) {
                Some(j) => at_bound[j] = false,
                None => break,
            }
        }
        Some(Within { solution, at_bound })
    }

    /// The parameter at a bound that would gain most from leaving it for the inside.
    fn held_back(
        &self,
        precision: &DVector<f64>,
        bounds: &Bounds,
        solution: &DVector<f64>,
        at_bound: &[bool],
    ) -> Option<usize> {
        let size = |j: usize| (self.gram[(j, j)] + precision[j]).sqrt().max(f64::MIN_POSITIVE);
        let score = &self.right - &self.gram * solution - precision.component_mul(solution);
        let largest = (0..solution.len()).fold(0.0_f64, |most, j| most.max((self.right[j] / size(j)).abs()));
        let inwards = |j: usize| {
            let gain = score[j] / size(j);
            if solution[j] <= bounds.lower[j] { gain } else { -gain }
        };
        let held = (0..solution.len()).filter(|j| at_bound[*j]).map(|j| (j, inwards(j)));
        let most = held.max_by(|a, b| a.1.total_cmp(&b.1));
        most.filter(|(_, gain)| *gain > ROUNDING * largest).map(|(j, _)| j)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    fn equations(truth: &[f64]) -> NormalEquations {
        let p = truth.len();
        let x = DMatrix::from_fn(60, p, |i, j| ((1.7 + j as f64) * i as f64 * 0.37).sin() + 0.4);
        let y = &x * DVector::from_row_slice(truth);
        NormalEquations {
            gram: x.tr_mul(&x),
            right: x.tr_mul(&y),
            square: y.dot(&y),
            n: 60.0,
        }
    }

    fn bounds(lower: &[f64], upper: &[f64]) -> Bounds {
        Bounds {
            lower: DVector::from_row_slice(lower),
            upper: DVector::from_row_slice(upper),
        }
    }

    #[test]
    fn wide_bounds_change_nothing() {
        let equations = equations(&[1.0, -2.0, 0.5]);
        let none = DVector::zeros(3);
        let within = equations
            .solve_within(&none, &bounds(&[-9.0; 3], &[9.0; 3]))
            .expect("solved");
        let plain = equations.solve(&none).expect("solved").solution;
        assert!((&within.solution - plain).amax() < 1e-12 && !within.at_bound.contains(&true));
    }

    #[test]
    fn no_point_of_the_box_is_better() {
        let equations = equations(&[1.0, -2.0, 0.5, 3.0]);
        let bounds = bounds(&[-0.3, -0.3, -0.3, f64::NEG_INFINITY], &[0.4, 0.4, 2.0, f64::INFINITY]);
        let found = equations.solve_within(&DVector::zeros(4), &bounds).expect("solved");
        let best = equations.residual_square(&found.solution);
        for j in 0..4 {
            for step in [-1e-3, 1e-3] {
                let mut other = found.solution.clone();
                other[j] = bounds.clamped(j, other[j] + step);
                assert!(equations.residual_square(&other) >= best - 1e-12);
            }
        }
        assert!(found.at_bound[0] || found.at_bound[1]);
        assert!(found.at_bound.iter().zip(0..4).all(|(at, j)| {
            !at || (found.solution[j] - bounds.lower[j])
                .abs()
                .min((found.solution[j] - bounds.upper[j]).abs())
                == 0.0
        }));
    }

    #[test]
    fn who_was_stopped_on_the_way_is_let_go_again() {
        // The first is stopped at its bound while the second is still away from its own; once that one stands, the first turns back.
        let equations = NormalEquations {
            gram: DMatrix::from_row_slice(2, 2, &[1.0, -0.9, -0.9, 1.0]),
            right: DVector::from_row_slice(&[0.5, 10.0]),
            square: 1e3,
            n: 9.0,
        };
        let bounds = bounds(&[-5.0, -5.0], &[2.0, 0.1]);
        let found = equations.solve_within(&DVector::zeros(2), &bounds).expect("solved");
        assert!((found.solution[0] - 0.59).abs() < 1e-9 && (found.solution[1] - 0.1).abs() < 1e-12);
        assert_eq!(found.at_bound, [false, true]);
    }
}
