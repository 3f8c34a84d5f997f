//! Gyro against gravity: turned from one rest to the next, the integrated rate must carry "up" along
//! (the idea of Tedaldi, Pretto and Menegatti, ICRA 2014, with an exact derivative instead of finite differences).

use imufit_fit::normal_equations::NormalEquations;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, SMatrix, Vector3};

use crate::CalibrationError;
use crate::affine::Affine;
use crate::solution::{Form, Solution, excess_variance};

type Sensitivity = SMatrix<f64, 3, 9>;

/// A turn between two rests.
#[derive(Clone, Debug)]
pub struct Turn {
    /// Time (s) of the readings from the last one of the rest before to the first one of the rest after.
    pub t: Vec<f64>,
    /// Rates less the bias at rest, rad/s.
    pub rate: Vec<Vector3<f64>>,
    /// Up in the body frame before and after, unit vectors.
    pub up: [Vector3<f64>; 2],
    /// Variance of the directions and of the integrated noise together, rad^2.
    pub variance: f64,
}

/// Spread that is expected of the elements of A - I before the log is looked at: it carries the fit over turns that the
/// log does not have (about the vertical, say) and is far looser than what one turn tells.
const SPREAD: f64 = 0.1;
const ITERATIONS: usize = 30;

impl Turn {
    /// Rotation of the body from before to after, `x_before = R x_after`, and the derivative of its rotation vector
    /// (body axes after the turn) by the elements of A, row by row.
    pub fn integrate(&self, matrix: &Matrix3<f64>) -> (Rotation3<f64>, Sensitivity) {
        let mut rotation = Rotation3::identity();
        let mut sensitivity = Sensitivity::zeros();
        for k in 1..self.t.len() {
            let dt = self.t[k] - self.t[k - 1];
            // Mean rate of the step, and the cone that two different rates describe (second order).
            let mean = 0.5 * (self.rate[k] + self.rate[k - 1]);
            let corrected = matrix * mean;
            let cone = (matrix * self.rate[k - 1]).cross(&(matrix * self.rate[k])) * (dt * dt / 12.0);
            let step = Rotation3::new(corrected * dt + cone);
            rotation *= step;
            sensitivity = step.inverse().matrix() * sensitivity;
            // Right Jacobian of the exponential, first order.
            let jacobian = (Matrix3::identity() - 0.5 * dt * corrected.cross_matrix()) * dt;
            for row in 0..3 {
                for column in 0..3 {
                    let mut change = sensitivity.column_mut(3 * row + column);
                    change.axpy(mean[column], &jacobian.column(row), 1.0);
                }
            }
        }
        rotation.renormalize();
        (rotation, sensitivity)
    }

    /// Predicted less measured direction after the turn, and its derivative.
    fn error(&self, matrix: &Matrix3<f64>) -> (Vector3<f64>, Sensitivity) {
        let (rotation, sensitivity) = self.integrate(matrix);
        let predicted = rotation.inverse() * self.up[0];
        // A small further turn delta takes the predicted direction to predicted + predicted x delta.
        (predicted - self.up[1], predicted.cross_matrix() * sensitivity)
    }

    /// Angle (rad) between the predicted and the measured direction after the turn.
    pub fn angle(&self, matrix: &Matrix3<f64>) -> f64 {
        (self.integrate(matrix).0.inverse() * self.up[0]).angle(&self.up[1])
    }

    /// Angle (rad) turned through in all, whatever the axis.
    pub fn way(&self) -> f64 {
        (1..self.t.len())
            .map(|k| 0.5 * (self.rate[k] + self.rate[k - 1]).norm() * (self.t[k] - self.t[k - 1]))
            .sum()
    }
}

/// A turn's error and its derivative at some A.
type Linearised = (Vector3<f64>, Sensitivity);

struct Problem<'a> {
    turns: &'a [Turn],
    /// Where the prior holds A: the identity, with the signs of flipped axes.
    start: DVector<f64>,
}

fn matrix_of(theta: &DVector<f64>) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| theta[3 * i + j])
}

impl Problem<'_> {
    fn linearised(&self, theta: &DVector<f64>) -> Vec<Linearised> {
        let matrix = matrix_of(theta);
        self.turns.iter().map(|turn| turn.error(&matrix)).collect()
    }

    fn weight(&self, turn: usize, excess: f64) -> f64 {
        1.0 / (self.turns[turn].variance + excess)
    }

    fn equations(&self, linearised: &[Linearised], excess: f64, left_out: Option<usize>) -> NormalEquations {
        let mut equations = NormalEquations::zeros(9);
        for (k, (error, derivative)) in linearised.iter().enumerate() {
            if Some(k) == left_out {
                continue;
            }
            let weight = self.weight(k, excess);
            let gram = derivative.transpose() * derivative * weight;
            let right = derivative.transpose() * error * -weight;
            for j in 0..9 {
                equations.right[j] += right[j];
                for i in 0..9 {
                    equations.gram[(i, j)] += gram[(i, j)];
                }
            }
            equations.square += weight * error.norm_squared();
            equations.n += 2.0;
        }
        equations
    }

    /// Weighted squares of the turns.
    fn misses(&self, linearised: &[Linearised], excess: f64) -> f64 {
        let turns = linearised.iter().enumerate();
        turns
            .map(|(k, (error, _))| error.norm_squared() * self.weight(k, excess))
            .sum()
    }

    /// Weighted squares of the turns, and of the prior.
    fn square(&self, linearised: &[Linearised], theta: &DVector<f64>, excess: f64) -> f64 {
        self.misses(linearised, excess) + (theta - &self.start).norm_squared() / (SPREAD * SPREAD)
    }

    /// The step from `theta`, damped by `damping` times the diagonal.
    fn step(&self, equations: &NormalEquations, theta: &DVector<f64>, damping: f64) -> Option<DVector<f64>> {
        let precision = 1.0 / (SPREAD * SPREAD);
        let mut pulled = equations.clone();
        pulled.right.axpy(-precision, &(theta - &self.start), 1.0);
        let damped = equations.gram.diagonal() * damping;
        Some(pulled.solve(&damped.add_scalar(precision))?.solution)
    }

    /// Levenberg-Marquardt; each trial integrates every turn once.
    fn minimise(&self, from: &DVector<f64>, excess: f64) -> Option<(DVector<f64>, Vec<Linearised>)> {
        let mut theta = from.clone();
        let mut linearised = self.linearised(&theta);
        let mut square = self.square(&linearised, &theta, excess);
        let mut damping = 1e-4;
        for _ in 0..ITERATIONS {
            let equations = self.equations(&linearised, excess, None);
            let mut step_length = 0.0;
            for _ in 0..8 {
                let step = self.step(&equations, &theta, damping)?;
                let trial = &theta + &step;
                let there = self.linearised(&trial);
                let then = self.square(&there, &trial, excess);
                if then <= square {
                    step_length = step.norm();
                    (theta, linearised, square) = (trial, there, then);
                    damping = (0.1 * damping).max(1e-15);
                    break;
                }
                damping *= 10.0;
            }
            if step_length < 1e-8 {
                break;
            }
        }
        Some((theta, linearised))
    }
}

/// Variance (rad^2) that is taken before the excess is known: half a degree keeps one bad turn from ruling.
const GUESS: f64 = 0.5 * 0.5 * (std::f64::consts::PI / 180.0) * (std::f64::consts::PI / 180.0);
/// Squared misfit per degree of freedom, in units of the guess, below which no other sign of an axis is looked for.
const RIGHT: f64 = 9.0;

/// The identity, or the signs of its axes that explain the turns far better.
fn signs(turns: &[Turn], freedom: f64) -> DVector<f64> {
    let mut problem = Problem {
        turns,
        start: DVector::zeros(9),
    };
    let (mut best, mut least) = (DVector::zeros(9), f64::INFINITY);
    for flips in 0..8_u32 {
        for axis in 0..3 {
            problem.start[4 * axis] = if flips >> axis & 1 == 1 { -1.0 } else { 1.0 };
        }
        let from = problem.start.clone();
        let Some((theta, linearised)) = problem.minimise(&from, GUESS) else {
            continue;
        };
        let square = problem.square(&linearised, &theta, GUESS);
        if square < 0.2 * least {
            (best, least) = (from, square);
        }
        // A flipped axis misses by tens of degrees: what fits the right way round is not flipped, whatever fits better.
        if least < RIGHT * freedom.max(1.0) {
            break;
        }
    }
    best
}

/// Fits A of `corrected = A (reading - bias at rest)` to turns between rests; the offset is zero.
pub fn fit(turns: &[Turn]) -> Result<Solution, CalibrationError> {
    if turns.is_empty() {
        return Err(CalibrationError::Underdetermined {
            unknowns: 9,
            equations: 0,
        });
    }
    let finite = |turn: &Turn| {
        turn.variance.is_finite()
            && turn
                .rate
                .iter()
                .chain(&turn.up)
                .all(|v| v.iter().all(|x| x.is_finite()))
    };
    if !turns.iter().all(finite) {
        return Err(CalibrationError::NotFinite("a turn"));
    }
    let freedom = (2.0 * turns.len() as f64 - 9.0).max(0.0);
    let problem = Problem {
        turns,
        start: signs(turns, freedom),
    };
    let mut excess = 0.0;
    let (mut theta, mut linearised) = problem
        .minimise(&problem.start, excess)
        .ok_or(CalibrationError::Diverged)?;
    for _ in 0..5 {
        let squares = |excess| Some(problem.misses(&linearised, excess));
        let next = excess_variance(freedom, 1e-4, squares).ok_or(CalibrationError::Diverged)?;
        let settled = (next - excess).abs() <= 1e-2 * next;
        excess = next;
        if settled {
            break;
        }
        (theta, linearised) = problem.minimise(&theta, excess).ok_or(CalibrationError::Diverged)?;
    }
    let equations = problem.equations(&linearised, excess, None);
    let solved = equations
        .solve(&DVector::from_element(9, 1.0 / (SPREAD * SPREAD)))
        .ok_or(CalibrationError::Diverged)?;
    let mut covariance = DMatrix::zeros(12, 12);
    covariance.view_mut((0, 0), (9, 9)).copy_from(&solved.covariance());
    let matrix = matrix_of(&theta);
    let angle = |turn: &Turn, matrix: &Matrix3<f64>| Vector3::new(turn.angle(matrix), 0.0, 0.0);
    let nan = Vector3::repeat(f64::NAN);
    let held_out = turns.iter().enumerate().map(|(k, turn)| {
        if turns.len() < 6 {
            return nan;
        }
        // Without one turn A moves so little that the derivatives stay what they are.
        let without = problem.equations(&linearised, excess, Some(k));
        let step = problem.step(&without, &theta, 0.0);
        step.map_or(nan, |step| angle(turn, &matrix_of(&(&theta + step))))
    });
    let held_out = held_out.collect();
    let mut parameters = DVector::zeros(12);
    parameters.rows_mut(0, 9).copy_from(&theta);
    Ok(Solution {
        form: Form::FULL,
        parameters,
        covariance,
        condition: equations.condition(),
        freedom,
        excess,
        residuals: turns.iter().map(|turn| angle(turn, &matrix)).collect(),
        held_out,
        held_out_length: Vec::new(),
    })
}

/// Attitudes of poses on a table, `x_table = R x_body`, up along the table's z axis: the heading of each follows from
/// the turn before it. `None` for all poses of which a turn is missing or ends in another side than it should.
pub fn attitudes_on_table(sides: &[Vector3<f64>], turns: &[Option<Rotation3<f64>>]) -> Option<Vec<Rotation3<f64>>> {
    /// Gravity's direction after the turn may differ from the side by this much, rad.
    const ASTRAY: f64 = 0.25;
    let first = sides.first()?;
    let level = |rotation: Rotation3<f64>, up: &Vector3<f64>| -> Option<Rotation3<f64>> {
        let correction = Rotation3::rotation_between(&(rotation * up), &Vector3::z())?;
        (correction.angle() < ASTRAY).then(|| correction * rotation)
    };
    let upright = Rotation3::rotation_between(first, &Vector3::z())
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let mut attitudes = vec![upright];
    for (turn, side) in turns.iter().zip(&sides[1..]) {
        let before = *attitudes.last()?;
        attitudes.push(level(before * (*turn)?, side)?);
    }
    Some(attitudes)
}

/// The correction as an affine map.
pub fn affine(solution: &Solution, bias: &Vector3<f64>) -> Affine {
    let matrix = solution.affine().matrix;
    Affine {
        matrix,
        offset: -matrix * bias,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth() -> Matrix3<f64> {
        Matrix3::new(0.97, 0.01, -0.02, 0.015, 1.02, 0.012, -0.02, 0.008, 1.04)
    }

    /// Turns about changing axes; the reading is what the true rate looks like through the inverse of `matrix`.
    fn turns(count: usize, matrix: &Matrix3<f64>) -> Vec<Turn> {
        let inverse = matrix.try_inverse().expect("invertible");
        let mut up = Vector3::new(0.1, 0.2, 1.0).normalize();
        (0..count)
            .map(|k| {
                let axis =
                    Vector3::new((1.3 * k as f64).sin(), (2.1 * k as f64).cos(), (0.7 * k as f64).sin()).normalize();
                let t: Vec<f64> = (0..=200).map(|i| f64::from(i) * 0.01).collect();
                let rate: Vec<Vector3<f64>> = t
                    .iter()
                    .map(|t| axis * (1.6 * (std::f64::consts::PI * t / 2.0).sin()))
                    .collect();
                let mut turn = Turn {
                    t,
                    rate,
                    up: [up, up],
                    variance: 1e-8,
                };
                up = turn.integrate(&Matrix3::identity()).0.inverse() * up;
                turn.up[1] = up;
                turn.rate.iter_mut().for_each(|w| *w = inverse * *w);
                turn
            })
            .collect()
    }

    #[test]
    fn turns_between_rests_give_scale_and_misalignment() {
        let solution = fit(&turns(20, &truth())).expect("determined");
        assert!(
            (solution.affine().matrix - truth()).norm() < 1e-5,
            "{}",
            solution.affine().matrix
        );
        assert!(solution.held_out.iter().all(|a| a.x < 1e-4));
    }

    #[test]
    fn a_flipped_axis_is_found() {
        let mut flipped = truth();
        flipped.column_mut(1).neg_mut();
        let solution = fit(&turns(20, &flipped)).expect("determined");
        assert!((solution.affine().matrix - flipped).norm() < 1e-4);
    }

    #[test]
    fn the_sensitivity_is_the_derivative() {
        let turn = &turns(3, &truth())[2];
        let (rotation, sensitivity) = turn.integrate(&truth());
        for k in 0..9 {
            let h = 1e-6;
            let mut moved = truth();
            moved[(k / 3, k % 3)] += h;
            let change = (rotation.inverse() * turn.integrate(&moved).0).scaled_axis() / h;
            assert!((change - sensitivity.column(k)).norm() < 1e-3 * (1.0 + sensitivity.column(k).norm()));
        }
    }

    #[test]
    fn headings_on_the_table_follow_from_the_turns() {
        let sides = [Vector3::z(), Vector3::z(), Vector3::x()];
        let quarter = Rotation3::from_axis_angle(&Vector3::z_axis(), 1.0);
        // From z up to x up: body turned about its y axis by -90 degrees.
        let tip = Rotation3::from_axis_angle(&Vector3::y_axis(), -std::f64::consts::FRAC_PI_2);
        let tip = if ((tip.inverse() * Vector3::z()) - Vector3::x()).norm() < 1e-9 {
            tip
        } else {
            tip.inverse()
        };
        let attitudes = attitudes_on_table(&sides, &[Some(quarter), Some(tip)]).expect("attitudes");
        for (attitude, side) in attitudes.iter().zip(&sides) {
            assert!((attitude * side - Vector3::z()).norm() < 1e-9);
        }
        let heading = attitudes[1] * attitudes[0].inverse();
        assert!((heading.scaled_axis() - Vector3::z()).norm() < 1e-9);
        assert!(attitudes_on_table(&sides, &[None, Some(tip)]).is_none());
    }
}
