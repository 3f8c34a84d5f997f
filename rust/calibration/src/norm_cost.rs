//! Magnitude cost: only the length of the corrected reading is known, gravity's or the field's (paper A's second reading
//! of its cost), and for a magnetometer the angle to gravity (dip), which is the same everywhere.
//!
//! Lengths leave three rotations open: the symmetric form keeps the sensor's own axes. With the dip A is full.

use std::collections::BTreeSet;

use imufit_fit::normal_equations::NormalEquations;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, SymmetricEigen, Vector3};

use crate::CalibrationError;
use crate::affine::Affine;
use crate::solution::{Elements, Form, Solution, excess_variance};

/// One reading, or the mean of a pose.
#[derive(Clone, Debug)]
pub struct Item {
    /// Reading in its unit.
    pub reading: Vector3<f64>,
    /// Variance of the reading's length.
    pub variance: f64,
    /// Unit vector up in the body frame where it is known.
    pub up: Option<Vector3<f64>>,
    /// Temperature less the mean, K.
    pub temperature: f64,
    /// What is left out together: the pose, or the stretch of time.
    pub group: usize,
}

/// How the residual is weighed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weighing {
    /// Items are means with known variances; what the residual shows beyond them is added.
    Poses,
    /// Items are single readings in motion: their scatter tells the variance, those far out count less (Huber 1964),
    /// and errors come from leaving out groups.
    Readings,
}

/// Huber's limit: readings beyond this many standard deviations count less.
const FAR: f64 = 1.345;
/// Smallest share of the largest information per item that a parameter combination must have.
pub const SEEN: f64 = 5e-4;
const ITERATIONS: usize = 60;

struct Problem<'a> {
    items: &'a [Item],
    form: Form,
    dip: bool,
    length: f64,
    /// What the corrected reading of each item depends on, three rows each.
    columns: Vec<Matrix3xX<f64>>,
}

/// Weights of the lengths and of the dips.
#[derive(Clone)]
struct Weights {
    length: Vec<f64>,
    dip: Vec<f64>,
}

impl Problem<'_> {
    fn parameters(&self) -> usize {
        self.form.parameters() + usize::from(self.dip)
    }

    /// Corrected reading, its length error and dip error.
    fn errors(&self, k: usize, theta: &DVector<f64>) -> (Vector3<f64>, f64, Option<f64>) {
        let corrected = &self.columns[k] * theta.rows(0, self.form.parameters());
        let up = self.items[k].up.filter(|_| self.dip);
        let dip = up.map(|up| corrected.dot(&up) - theta[self.form.parameters()]);
        (corrected, corrected.norm() - self.length, dip)
    }

    fn equations(&self, theta: &DVector<f64>, weights: &Weights, left_out: Option<usize>) -> NormalEquations {
        let p = self.form.parameters();
        let mut equations = NormalEquations::zeros(self.parameters());
        let mut row = DVector::zeros(self.parameters());
        let mut add = |row: &DVector<f64>, error: f64, weight: f64| {
            equations.gram.ger(weight, row, row, 1.0);
            equations.right.axpy(-weight * error, row, 1.0);
            equations.square += weight * error * error;
            equations.n += 1.0;
        };
        for (k, item) in self.items.iter().enumerate() {
            if Some(item.group) == left_out {
                continue;
            }
            let (corrected, error, dip) = self.errors(k, theta);
            let direction = corrected / corrected.norm().max(f64::MIN_POSITIVE);
            row.fill(0.0);
            row.rows_mut(0, p).gemv_tr(1.0, &self.columns[k], &direction, 0.0);
            add(&row, error, weights.length[k]);
            if let (Some(error), Some(up)) = (dip, item.up) {
                row.rows_mut(0, p).gemv_tr(1.0, &self.columns[k], &up, 0.0);
                row[p] = -1.0;
                add(&row, error, weights.dip[k]);
            }
        }
        equations
    }

    fn square(&self, theta: &DVector<f64>, weights: &Weights, left_out: Option<usize>) -> f64 {
        let of_item = |k: usize| {
            let (_, error, dip) = self.errors(k, theta);
            weights.length[k] * error * error + dip.map_or(0.0, |d| weights.dip[k] * d * d)
        };
        (0..self.items.len())
            .filter(|k| Some(self.items[*k].group) != left_out)
            .map(of_item)
            .sum()
    }

    /// Levenberg-Marquardt with Marquardt's scaling.
    fn minimise(&self, start: &DVector<f64>, weights: &Weights, left_out: Option<usize>) -> Option<DVector<f64>> {
        let mut theta = start.clone();
        let mut square = self.square(&theta, weights, left_out);
        let mut damping = 1e-6;
        for _ in 0..ITERATIONS {
            let equations = self.equations(&theta, weights, left_out);
            let mut small = true;
            for _ in 0..12 {
                let precision = equations.gram.diagonal() * damping;
                let step = equations.solve(&precision)?.solution;
                let trial = &theta + &step;
                let then = self.square(&trial, weights, left_out);
                if then <= square {
                    // Converges quadratically: the next step would be the square of this one.
                    small = step.norm() <= 1e-7 * theta.norm();
                    (theta, square) = (trial, then);
                    damping = (0.1 * damping).max(1e-15);
                    break;
                }
                damping = (10.0 * damping).max(1e-6);
            }
            if small {
                break;
            }
        }
        square.is_finite().then_some(theta)
    }

    /// The solution without a group, by two Gauss-Newton steps from the whole one; `None` if the group carried a
    /// parameter alone: its variance (`spread` in the whole fit) would become a hundredfold.
    fn without(
        &self,
        theta: &DVector<f64>,
        weights: &Weights,
        group: usize,
        spread: &DVector<f64>,
    ) -> Option<DVector<f64>> {
        let none = DVector::zeros(self.parameters());
        let first = self.equations(theta, weights, Some(group)).solve(&none)?;
        let variances = first.covariance().diagonal();
        if variances.iter().zip(spread).any(|(now, before)| *now > 100.0 * before) {
            return None;
        }
        let near = theta + first.solution;
        let second = self.equations(&near, weights, Some(group)).solve(&none)?;
        Some(near + second.solution)
    }

    fn weights_of_poses(&self, excess: f64) -> Weights {
        let weigh = |item: &Item| 1.0 / (item.variance + excess).max(f64::MIN_POSITIVE);
        let length: Vec<f64> = self.items.iter().map(weigh).collect();
        Weights {
            dip: length.clone(),
            length,
        }
    }

    /// Huber's weights over the present scatter (median absolute deviation).
    fn weights_of_readings(&self, theta: &DVector<f64>) -> Weights {
        let errors: Vec<_> = (0..self.items.len()).map(|k| self.errors(k, theta)).collect();
        let scale = |values: &mut Vec<f64>| {
            if values.is_empty() {
                return f64::INFINITY;
            }
            let middle = values.len() / 2;
            let (_, median, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
            (1.4826 * *median).max(1e-12 * self.length)
        };
        let of_length = scale(&mut errors.iter().map(|e| e.1.abs()).collect());
        let of_dip = scale(&mut errors.iter().filter_map(|e| e.2.map(f64::abs)).collect());
        let weigh =
            |error: f64, scale: f64| (FAR * scale / error.abs().max(f64::MIN_POSITIVE)).min(1.0) / (scale * scale);
        Weights {
            length: errors.iter().map(|e| weigh(e.1, of_length)).collect(),
            dip: errors.iter().map(|e| e.2.map_or(0.0, |d| weigh(d, of_dip))).collect(),
        }
    }

    /// Whether the items tell every parameter, judged in units of the length.
    fn seen(&self, theta: &DVector<f64>) -> (usize, bool) {
        let unit = Weights {
            length: vec![1.0; self.items.len()],
            dip: vec![1.0; self.items.len()],
        };
        let gram = self.equations(theta, &unit, None).gram;
        let p = self.parameters();
        let size = DVector::from_fn(p, |k, _| {
            let of_matrix = k < self.form.of_matrix();
            if of_matrix || k >= self.form.parameters() {
                1.0
            } else {
                self.length
            }
        });
        let used: Vec<usize> = (0..p).filter(|k| *k < self.form.of_matrix() + 3).collect();
        let scaled = DMatrix::from_fn(used.len(), used.len(), |i, j| {
            let (a, b) = (used[i], used[j]);
            gram[(a, b)] * size[a] * size[b] / (self.length * self.length)
        });
        let values = SymmetricEigen::new(scaled).eigenvalues;
        let limit = SEEN * self.items.len() as f64;
        let seen = values.iter().filter(|v| **v > limit).count();
        (seen, seen == used.len())
    }
}

/// A sphere through the readings (linear least squares): where the iteration starts.
pub fn sphere(readings: impl Iterator<Item = Vector3<f64>>) -> Option<(Vector3<f64>, f64)> {
    let mut equations = NormalEquations::zeros(4);
    for y in readings {
        let row = DVector::from_vec(vec![2.0 * y.x, 2.0 * y.y, 2.0 * y.z, 1.0]);
        equations.gram.ger(1.0, &row, &row, 1.0);
        equations.right.axpy(y.norm_squared(), &row, 1.0);
        equations.n += 1.0;
    }
    let solution = equations.solve(&DVector::zeros(4))?.solution;
    let centre = Vector3::new(solution[0], solution[1], solution[2]);
    let square = solution[3] + centre.norm_squared();
    (square > 0.0).then(|| (centre, square.sqrt()))
}

/// Fits the correction that gives every reading the length `length`; the form's A is symmetric or diagonal, with the dip
/// full. `leave_out` asks for the held-out errors; single readings need it for their standard errors too.
pub fn fit(
    items: &[Item],
    form: Form,
    dip: bool,
    length: f64,
    weighing: Weighing,
    leave_out: bool,
) -> Result<Solution, CalibrationError> {
    let form = Form {
        matrix: if dip { Elements::Full } else { form.matrix },
        ..form
    };
    let problem = Problem {
        items,
        form,
        dip,
        length,
        columns: items
            .iter()
            .map(|item| form.columns(&item.reading, item.temperature))
            .collect(),
    };
    let p = problem.parameters();
    let finite = |item: &Item| item.reading.iter().all(|x| x.is_finite()) && item.variance.is_finite();
    if !items.iter().all(finite) {
        return Err(CalibrationError::NotFinite("a reading"));
    }
    if items.len() < p {
        return Err(CalibrationError::Underdetermined {
            unknowns: p,
            equations: items.len(),
        });
    }
    let (centre, radius) = sphere(items.iter().map(|item| item.reading)).ok_or(CalibrationError::Diverged)?;
    let gain = length / radius;
    let mut theta = DVector::zeros(p);
    let start = form.start(&Affine {
        matrix: Matrix3::identity() * gain,
        offset: -centre * gain,
    });
    theta.rows_mut(0, form.parameters()).copy_from(&start);
    if dip {
        let dips: Vec<f64> = items
            .iter()
            .filter_map(|item| item.up.map(|up| ((item.reading - centre) * gain).dot(&up)))
            .collect();
        theta[form.parameters()] = dips.iter().sum::<f64>() / dips.len().max(1) as f64;
    }
    let freedom = (items.len() - p) as f64;
    let mut weights = problem.weights_of_poses(0.0);
    let mut excess = 0.0;
    match weighing {
        Weighing::Poses => {
            for _ in 0..20 {
                theta = problem
                    .minimise(&theta, &weights, None)
                    .ok_or(CalibrationError::Diverged)?;
                let squares = |excess| Some(problem.square(&theta, &problem.weights_of_poses(excess), None));
                let next =
                    excess_variance(freedom, 1e-6 * length * length, squares).ok_or(CalibrationError::Diverged)?;
                let settled = (next - excess).abs() <= 1e-2 * next;
                excess = next;
                weights = problem.weights_of_poses(excess);
                if settled {
                    break;
                }
            }
        }
        Weighing::Readings => {
            for _ in 0..8 {
                weights = problem.weights_of_readings(&theta);
                let before = theta.clone();
                theta = problem
                    .minimise(&theta, &weights, None)
                    .ok_or(CalibrationError::Diverged)?;
                if (&theta - &before).norm() < 1e-9 * theta.norm() {
                    break;
                }
            }
        }
    }
    let (seen, all) = problem.seen(&theta);
    if !all {
        return Err(CalibrationError::Underdetermined {
            unknowns: p,
            equations: seen,
        });
    }
    let equations = problem.equations(&theta, &weights, None);
    let condition = equations.condition();
    let solved = equations.solve(&DVector::zeros(p)).ok_or(CalibrationError::Diverged)?;
    let spread = solved.covariance().diagonal();
    let residual = |k: usize, theta: &DVector<f64>| {
        let (corrected, error, dip) = problem.errors(k, theta);
        (Vector3::new(error, dip.unwrap_or(0.0), 0.0), corrected.norm())
    };
    let residuals = (0..items.len()).map(|k| residual(k, &theta).0).collect();
    let groups: BTreeSet<usize> = items.iter().map(|item| item.group).collect();
    let mut held_out = vec![Vector3::repeat(f64::NAN); items.len()];
    let mut held_out_length = vec![f64::NAN; items.len()];
    let mut without = Vec::new();
    for group in groups.into_iter().filter(|_| leave_out) {
        let left = items.iter().filter(|item| item.group != group).count();
        if left < p || left == items.len() {
            continue;
        }
        let Some(fitted) = problem.without(&theta, &weights, group, &spread) else {
            continue;
        };
        for k in (0..items.len()).filter(|k| items[*k].group == group) {
            (held_out[k], held_out_length[k]) = residual(k, &fitted);
        }
        without.push(fitted);
    }
    let covariance = match weighing {
        Weighing::Poses => solved.covariance(),
        Weighing::Readings => jackknife(&without).unwrap_or_else(|| solved.covariance()),
    };
    Ok(Solution {
        form,
        parameters: theta,
        covariance,
        condition,
        freedom,
        excess,
        residuals,
        held_out,
        held_out_length,
    })
}

/// Covariance from the solutions that each leave out a group (delete-a-group jackknife).
fn jackknife(without: &[DVector<f64>]) -> Option<DMatrix<f64>> {
    let b = without.len();
    if b < 4 {
        return None;
    }
    let mean = without.iter().sum::<DVector<f64>>() / b as f64;
    let mut covariance = DMatrix::zeros(mean.len(), mean.len());
    for theta in without {
        let d = theta - &mean;
        covariance.ger((b - 1) as f64 / b as f64, &d, &d, 1.0);
    }
    Some(covariance)
}

#[cfg(test)]
mod tests {
    use super::*;

    const G: f64 = 9.80665;

    fn directions(n: usize) -> Vec<Vector3<f64>> {
        // A spiral over the sphere.
        (0..n)
            .map(|k| {
                let z = 1.0 - 2.0 * (k as f64 + 0.5) / n as f64;
                let angle = 2.399_963 * k as f64;
                let r = (1.0 - z * z).sqrt();
                Vector3::new(r * angle.cos(), r * angle.sin(), z)
            })
            .collect()
    }

    fn truth() -> Affine {
        Affine {
            matrix: Matrix3::new(0.97, 0.01, -0.02, 0.01, 1.02, 0.015, -0.02, 0.015, 1.05),
            offset: Vector3::new(0.3, -0.2, 0.5),
        }
    }

    fn items(n: usize) -> Vec<Item> {
        let inverse = truth().matrix.try_inverse().expect("invertible");
        directions(n)
            .into_iter()
            .enumerate()
            .map(|(k, d)| Item {
                reading: inverse * (d * G - truth().offset),
                variance: 1e-8,
                up: None,
                temperature: 0.0,
                group: k,
            })
            .collect()
    }

    #[test]
    fn twelve_exact_poses_give_the_nine_parameters() {
        let solution = fit(&items(12), Form::SYMMETRIC, false, G, Weighing::Poses, true).expect("determined");
        assert!((solution.affine().matrix - truth().matrix).norm() < 1e-9);
        assert!((solution.affine().offset - truth().offset).norm() < 1e-8);
        assert!(solution.held_out_length.iter().all(|n| (n - G).abs() < 1e-6));
    }

    #[test]
    fn eight_poses_and_poses_of_one_circle_are_refused() {
        assert!(matches!(
            fit(&items(8), Form::SYMMETRIC, false, G, Weighing::Poses, true),
            Err(CalibrationError::Underdetermined {
                unknowns: 9,
                equations: 8
            })
        ));
        let flat: Vec<Item> = (0..20)
            .map(|k| {
                let (sin, cos) = (f64::from(k) * 0.3).sin_cos();
                Item {
                    reading: Vector3::new(G * sin, G * cos, 0.01 * f64::from(k % 3)),
                    ..items(9)[0].clone()
                }
            })
            .collect();
        assert!(matches!(
            fit(&flat, Form::SYMMETRIC, false, G, Weighing::Poses, true),
            Err(CalibrationError::Underdetermined { .. })
        ));
    }

    #[test]
    fn the_dip_tells_the_rotation_that_lengths_leave_open() {
        let field = 48.0;
        let matrix = Matrix3::new(1.05, 0.03, -0.02, -0.04, 0.97, 0.05, 0.02, 0.01, 1.02);
        let offset = Vector3::new(10.0, -25.0, 40.0);
        let inverse = matrix.try_inverse().expect("invertible");
        let north = Vector3::new(0.5, 0.0, -0.9).normalize() * field;
        let items: Vec<Item> = directions(200)
            .into_iter()
            .enumerate()
            .map(|(k, axis)| {
                let turn = nalgebra::Rotation3::new(axis * (0.1 + 0.05 * k as f64));
                Item {
                    reading: inverse * (turn * north - offset),
                    variance: 1e-4,
                    up: Some(turn * Vector3::z()),
                    temperature: 0.0,
                    group: k / 10,
                }
            })
            .collect();
        let solution = fit(&items, Form::FULL, true, field, Weighing::Readings, true).expect("determined");
        assert!((solution.affine().matrix - matrix).norm() < 1e-7);
        assert!((solution.affine().offset - offset).norm() < 1e-5);
    }
}
