//! Vector cost: the direction of gravity in the body frame is known for every pose (paper A, eqs. 2, 6 and 7).

use imufit_fit::normal_equations::NormalEquations;
use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, SymmetricEigen, Vector3};

use crate::CalibrationError;
use crate::solution::{Form, Solution, excess_variance};

/// One pose with what it should read.
#[derive(Clone, Debug)]
pub struct Item {
    /// Mean reading, m/s^2.
    pub reading: Vector3<f64>,
    /// Variance of the mean, each axis.
    pub variance: Vector3<f64>,
    /// What the ideal sensor reads: gravity's reaction in the body frame, m/s^2.
    pub target: Vector3<f64>,
    /// Change of the target by a tilt (rad) of the table about its x and y axis.
    pub tilt: [Vector3<f64>; 2],
    /// Temperature less the poses' mean, K.
    pub temperature: f64,
}

/// Least share of gravity that has to have turned from one pose to another for an axis to count as turned.
const TURNED: f64 = 0.05;

/// Number of independent equations per axis that the poses give for A and b, of four.
pub fn independent(items: &[Item], gravity: f64) -> usize {
    let mut gram = DMatrix::zeros(4, 4);
    for item in items {
        let row = DVector::from_vec(vec![
            item.target.x / gravity,
            item.target.y / gravity,
            item.target.z / gravity,
            1.0,
        ]);
        gram += &row * row.transpose();
    }
    let values = SymmetricEigen::new(gram).eigenvalues;
    values.iter().filter(|v| **v > TURNED).count()
}

/// Placement (rad, one axis) that is taken where no equation is to spare to show it: what a careful hand reaches.
const UNSEEN_PLACEMENT: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// Equations to spare below which they may agree by chance: then half of that is taken at least.
const CHECKED: f64 = 4.0;

/// Share of the placement's variance that is allowed along gravity: a pose askew by an angle reads less by its square,
/// and whatever else the model does not know must have some room.
const ALONG: f64 = 1e-3;

struct Problem<'a> {
    items: &'a [Item],
    form: Form,
    tilted: bool,
    /// What the corrected reading of each item depends on, three rows each.
    columns: Vec<Matrix3xX<f64>>,
}

impl<'a> Problem<'a> {
    fn parameters(&self) -> usize {
        self.form.parameters() + if self.tilted { 2 } else { 0 }
    }

    fn new(items: &'a [Item], form: Form, tilted: bool) -> Self {
        let columns = |item: &Item| {
            let columns = form.columns(&item.reading, item.temperature);
            if !tilted {
                return columns;
            }
            let first = columns.ncols();
            let mut columns = columns.resize_horizontally(first + 2, 0.0);
            for (k, tilt) in item.tilt.iter().enumerate() {
                columns.set_column(first + k, &-tilt);
            }
            columns
        };
        Self {
            items,
            form,
            tilted,
            columns: items.iter().map(columns).collect(),
        }
    }

    /// Square root of an item's weight matrix: L^T with L L^T the inverse of its covariance.
    ///
    /// A pose that is placed askew by a small angle moves the target across gravity, not along it: what placement adds
    /// to the noise has next to no part along gravity, so that scale and bias rest on what each axis reads when it is vertical.
    fn root(item: &Item, excess: f64) -> Option<Matrix3<f64>> {
        let up = item.target.normalize();
        let across = Matrix3::identity() - up * up.transpose() * (1.0 - ALONG);
        let noise = item.variance.map(|v| v.max(f64::MIN_POSITIVE));
        let covariance = Matrix3::from_diagonal(&noise) + across * excess;
        Some(covariance.try_inverse()?.cholesky()?.l().transpose())
    }

    fn roots(&self, excess: f64) -> Option<Vec<Matrix3<f64>>> {
        self.items.iter().map(|item| Self::root(item, excess)).collect()
    }

    fn equations(&self, roots: &[Matrix3<f64>], left_out: Option<usize>) -> NormalEquations {
        let mut equations = NormalEquations::zeros(self.parameters());
        for (k, item) in self.items.iter().enumerate().filter(|(k, _)| Some(*k) != left_out) {
            let columns = roots[k] * &self.columns[k];
            let target = roots[k] * item.target;
            equations.gram.gemm_tr(1.0, &columns, &columns, 1.0);
            equations.right.gemv_tr(1.0, &columns, &target, 1.0);
            equations.square += target.norm_squared();
            equations.n += 3.0;
        }
        equations
    }

    /// Solution, covariance and condition number.
    fn solve(&self, roots: &[Matrix3<f64>], left_out: Option<usize>) -> Option<(DVector<f64>, DMatrix<f64>, f64)> {
        let equations = self.equations(roots, left_out);
        let solved = equations.solve(&DVector::zeros(self.parameters()))?;
        let covariance = solved.covariance();
        Some((solved.solution, covariance, equations.condition()))
    }

    fn residual(&self, k: usize, theta: &DVector<f64>) -> Vector3<f64> {
        &self.columns[k] * theta - self.items[k].target
    }

    fn squares(&self, roots: &[Matrix3<f64>], theta: &DVector<f64>) -> f64 {
        (0..self.items.len())
            .map(|k| (roots[k] * self.residual(k, theta)).norm_squared())
            .sum()
    }
}

/// Fits the correction by weighted linear least squares; `tilted` fits the table's tilt along with it,
/// `leave_out` asks for the held-out errors.
pub fn fit(
    items: &[Item],
    form: Form,
    tilted: bool,
    gravity: f64,
    leave_out: bool,
) -> Result<Solution, CalibrationError> {
    let problem = Problem::new(items, form, tilted);
    let p = problem.parameters();
    let independent = independent(items, gravity);
    let finite = |item: &Item| {
        item.reading
            .iter()
            .chain(&item.target)
            .chain(&item.variance)
            .all(|x| x.is_finite())
            && item.temperature.is_finite()
    };
    if !items.iter().all(finite) {
        return Err(CalibrationError::NotFinite("a pose"));
    }
    if independent < 4 || 3 * items.len() < p {
        return Err(CalibrationError::Underdetermined {
            unknowns: p,
            equations: (3 * independent).min(3 * items.len()),
        });
    }
    let freedom = (3 * items.len() - p) as f64;
    let mut excess = 0.0;
    let mut roots = problem.roots(excess).ok_or(CalibrationError::Diverged)?;
    if freedom < 1.0 {
        excess = (UNSEEN_PLACEMENT * gravity).powi(2);
        roots = problem.roots(excess).ok_or(CalibrationError::Diverged)?;
    }
    for _ in 0..if freedom < 1.0 { 0 } else { 20 } {
        let (theta, ..) = problem.solve(&roots, None).ok_or(CalibrationError::Diverged)?;
        let squares = |excess| Some(problem.squares(&problem.roots(excess)?, &theta));
        let next = excess_variance(freedom, 1e-6 * gravity * gravity, squares).ok_or(CalibrationError::Diverged)?;
        let settled = (next - excess).abs() <= 1e-2 * next;
        excess = next;
        roots = problem.roots(excess).ok_or(CalibrationError::Diverged)?;
        if settled {
            break;
        }
    }
    if freedom < CHECKED && excess < (0.5 * UNSEEN_PLACEMENT * gravity).powi(2) {
        excess = (0.5 * UNSEEN_PLACEMENT * gravity).powi(2);
        roots = problem.roots(excess).ok_or(CalibrationError::Diverged)?;
    }
    let (theta, covariance, condition) = problem.solve(&roots, None).ok_or(CalibrationError::Diverged)?;
    let residuals = (0..items.len()).map(|k| problem.residual(k, &theta)).collect();
    let nan = Vector3::repeat(f64::NAN);
    let (mut held_out, mut held_out_length) = (Vec::new(), Vec::new());
    for (k, item) in items.iter().enumerate() {
        if !leave_out {
            held_out.push(nan);
            held_out_length.push(f64::NAN);
            continue;
        }
        let others: Vec<Item> = items
            .iter()
            .enumerate()
            .filter(|(j, _)| *j != k)
            .map(|(_, item)| item.clone())
            .collect();
        let enough = self::independent(&others, gravity) == 4 && 3 * others.len() >= p;
        let left_out = if enough { problem.solve(&roots, Some(k)) } else { None };
        // Past a tenfold condition the pose carried a parameter alone.
        if let Some((theta, ..)) = left_out.filter(|(.., c)| *c < 10.0 * condition) {
            held_out.push(problem.residual(k, &theta));
            let corrected = form.columns(&item.reading, item.temperature) * theta.rows(0, form.parameters());
            held_out_length.push(corrected.norm());
        } else {
            held_out.push(nan);
            held_out_length.push(f64::NAN);
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::affine::Affine;
    use crate::side::Side;

    const G: f64 = 9.80665;

    fn truth() -> Affine {
        // Paper A's published parameters, one choice of the signs.
        let c = Matrix3::new(1.0, 0.0003, 0.0025, -0.0070, 1.0, 0.0081, 0.0258, -0.0069, 1.0);
        Affine {
            matrix: c * Matrix3::from_diagonal(&Vector3::new(0.9662, 0.9784, 0.9832)),
            offset: Vector3::new(0.0146, 0.0402, 0.0193) * G,
        }
    }

    fn item(target: Vector3<f64>) -> Item {
        let truth = truth();
        Item {
            reading: truth.matrix.try_inverse().expect("invertible") * (target - truth.offset),
            variance: Vector3::repeat(1e-8),
            target,
            tilt: [Vector3::zeros(); 2],
            temperature: 0.0,
        }
    }

    fn six() -> Vec<Item> {
        (0..6)
            .map(|k| item(Side::new(k).expect("a side").direction() * G))
            .collect()
    }

    #[test]
    fn six_exact_poses_give_the_twelve_parameters() {
        let solution = fit(&six(), Form::FULL, false, G, true).expect("determined");
        assert!((solution.affine().matrix - truth().matrix).norm() < 1e-10);
        assert!((solution.affine().offset - truth().offset).norm() < 1e-10);
        assert!(solution.excess.abs() < 1e-12);
        assert!(solution.held_out_length.iter().all(|n| (n - G).abs() < 1e-9));
    }

    #[test]
    fn four_poses_do_not_pretend_to_know_how_well_they_were_laid() {
        let mut items = six();
        items.remove(3);
        items.remove(1);
        let solution = fit(&items, Form::FULL, false, G, true).expect("determined");
        assert!((solution.affine().matrix - truth().matrix).norm() < 1e-10);
        let placement = UNSEEN_PLACEMENT * G;
        assert!(solution.errors().rows(0, 9).iter().any(|e| *e * G > 0.5 * placement));
    }

    #[test]
    fn poses_that_repeat_each_other_are_refused() {
        let mut items = six();
        items.truncate(2);
        items.push(items[0].clone());
        items.push(items[1].clone());
        let error = fit(&items, Form::FULL, false, G, true).expect_err("underdetermined");
        assert!(matches!(
            error,
            CalibrationError::Underdetermined {
                equations: 6,
                unknowns: 12
            }
        ));
    }

    #[test]
    fn the_tilt_of_the_table_is_told_from_misalignment_when_the_sensor_is_turned_on_it() {
        // Up in the table's frame, tilted by (x, y): u = R^T (z + theta x z).
        let tilt = [0.01, -0.004];
        let mut items = Vec::new();
        for k in 0..6 {
            let up = Side::new(k).expect("a side").direction();
            for turn in 0..3 {
                // Rotation that takes body `up` to table z, turned by `turn` thirds about it.
                let level = nalgebra::Rotation3::rotation_between(&up, &Vector3::z())
                    .unwrap_or_else(|| nalgebra::Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
                let yaw = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), 2.0 * f64::from(turn));
                let to_body = (yaw * level).inverse();
                let change = [
                    to_body * (Vector3::x().cross(&Vector3::z()) * G),
                    to_body * (Vector3::y().cross(&Vector3::z()) * G),
                ];
                let true_target = to_body * (Vector3::z() * G) + change[0] * tilt[0] + change[1] * tilt[1];
                items.push(Item {
                    target: to_body * (Vector3::z() * G),
                    tilt: change,
                    ..item(true_target)
                });
            }
        }
        let solution = fit(&items, Form::FULL, true, G, true).expect("determined");
        assert!((solution.parameters[12] - tilt[0]).abs() < 1e-9);
        assert!((solution.parameters[13] - tilt[1]).abs() < 1e-9);
        assert!((solution.affine().matrix - truth().matrix).norm() < 1e-9);
    }
}
