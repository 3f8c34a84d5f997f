//! Covariance of the errors, and what predictions and measurements do to it.
//!
//! Every element is written together with its mirror image, so that the matrix is symmetric to the bit and its triangle
//! is all there is of it. Predictions touch only the rows that they change, and use how few errors those depend on.

use imufit_attitude::Real;
use nalgebra::{Matrix3, SMatrix, SVector, SimdBool, Vector3};

/// Errors: attitude 3 (reference frame), gyro bias 3, horizontal velocity 2, gyro scale and misalignment 9.
pub(super) const STATES: usize = 17;
/// The first error of the gyro bias.
pub(super) const BIAS: usize = 3;
/// The first error of the horizontal velocity.
pub(super) const SPEED: usize = 6;
/// The first error of gyro scale and misalignment, row by row.
pub(super) const SCALE: usize = 8;
/// Numbers of the lower triangle.
pub(super) const TRIANGLE: usize = STATES * (STATES + 1) / 2;

/// Roll, pitch and velocity, which the field does not move.
const NOT_HEADING: [usize; 4] = [0, 1, SPEED, SPEED + 1];

/// One number for each error.
pub(super) type Errors<T = f64> = SVector<T, STATES>;

/// What a measurement may move.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Moves {
    /// Every estimate.
    All,
    /// Of attitude and velocity only the heading.
    Heading,
}

/// The matrix.
#[derive(Debug, Clone)]
pub(super) struct Covariance<T = f64>(SMatrix<T, STATES, STATES>);

impl<T: Real> Covariance<T> {
    /// Independent errors with these standard deviations.
    pub fn independent(sd: &Errors<T>) -> Self {
        Self(SMatrix::from_diagonal(&sd.component_mul(sd)))
    }

    pub fn variance(&self, at: usize) -> T {
        self.0[(at, at)]
    }

    /// Adds to the variance of an error.
    pub fn add(&mut self, at: usize, variance: T) {
        self.0[(at, at)] += variance;
    }

    /// Makes an error independent of the others.
    pub fn forget(&mut self, at: usize, variance: T) {
        self.0.fill_row(at, T::splat(0.0));
        self.0.fill_column(at, T::splat(0.0));
        self.0[(at, at)] = variance;
    }

    /// Makes the velocity unknown but for its variance.
    pub fn forget_velocity(&mut self, variance: T) {
        for at in [SPEED, SPEED + 1] {
            self.forget(at, variance);
        }
    }

    /// That of the attitude.
    pub fn attitude(&self) -> Matrix3<T> {
        self.0.fixed_view::<3, 3>(0, 0).into_owned()
    }

    /// `a' = a - R (b + K w) dt`: attitude and what the rate `w` is wrong by.
    pub fn turn(&mut self, r: &Matrix3<T>, w: &Vector3<T>, dt: T) {
        let p = &self.0;
        let of_rate: [Errors<T>; 3] = std::array::from_fn(|j| {
            let at = SCALE + 3 * j;
            p.column(BIAS + j) + p.column(at) * w.x + p.column(at + 1) * w.y + p.column(at + 2) * w.z
        });
        let change: [Errors<T>; 3] = std::array::from_fn(|i| {
            let g = r.row(i) * -dt;
            of_rate[0] * g[0] + of_rate[1] * g[1] + of_rate[2] * g[2]
        });
        let square = |i: usize, j: usize| {
            let of_rate = |l: usize| {
                let (x, at) = (&change[i], SCALE + 3 * l);
                x[BIAS + l] + x[at] * w.x + x[at + 1] * w.y + x[at + 2] * w.z
            };
            -dt * (r[(j, 0)] * of_rate(0) + r[(j, 1)] * of_rate(1) + r[(j, 2)] * of_rate(2))
        };
        self.carry(0, &change, square);
    }

    /// `v' = v + (a x f) dt`, the horizontal part; `f` is the specific force in the reference frame.
    pub fn accelerate(&mut self, f: &Vector3<T>, dt: T) {
        let (x, y, z) = (f.x * dt, f.y * dt, f.z * dt);
        let p = &self.0;
        let change = [p.column(1) * z - p.column(2) * y, p.column(2) * x - p.column(0) * z];
        let square = |i: usize, j: usize| {
            let c = &change[i];
            if j == 0 {
                c[1] * z - c[2] * y
            } else {
                c[2] * x - c[0] * z
            }
        };
        self.carry(SPEED, &change, square);
    }

    /// P <- (I + A) P (I + A)^T with A nonzero in N rows from `first`: those of A P, and the elements of A P A^T.
    fn carry<const N: usize>(&mut self, first: usize, change: &[Errors<T>; N], square: impl Fn(usize, usize) -> T) {
        let squares: [[T; N]; N] = std::array::from_fn(|i| std::array::from_fn(|j| square(i, j)));
        let sizes = change.iter().map(Errors::norm_squared);
        let size = sizes.chain(squares.iter().flatten().map(|x| *x * *x));
        let sound = finite(size.fold(T::splat(0.0), |sum, x| sum + x));
        let before = (!sound.all()).then_some(self.0);
        let within: [[T; N]; N] =
            std::array::from_fn(|i| std::array::from_fn(|j| self.0[(first + i, first + j)] + change[i][first + j]));
        for (i, change) in change.iter().enumerate() {
            let mut column = self.0.column_mut(first + i);
            column += change;
            let column = column.into_owned();
            self.0.row_mut(first + i).tr_copy_from(&column);
        }
        for i in 0..N {
            for j in 0..=i {
                let value = within[i][j] + change[j][first + i] + squares[i][j];
                self.0[(first + i, first + j)] = value;
                self.0[(first + j, first + i)] = value;
            }
        }
        self.keep(before, sound);
    }

    /// Takes back what was done to lanes that are not `sound`.
    fn keep(&mut self, before: Option<SMatrix<T, STATES, STATES>>, sound: T::SimdBool) {
        if let Some(before) = before {
            self.0.zip_apply(&before, |new, old| *new = new.select(sound, old));
        }
    }

    /// Another covariance in the lanes where the condition holds.
    pub fn take(&mut self, other: &Self, condition: T::SimdBool) {
        self.0
            .zip_apply(&other.0, |own, other| *own = other.select(condition, *own));
    }

    /// The error `at` was measured as `value`, variance `r`; adds to the errors `x` found so far in this step. Nothing is
    /// done where `shown` does not hold.
    ///
    /// Rows of the gain that are zero leave the block of their errors as it was, and change the rest of the matrix no
    /// less (Schmidt's consider filter, the Joseph form written out).
    pub fn measure(&mut self, x: &mut Errors<T>, at: usize, value: T, r: T, moves: Moves, shown: T::SimdBool) {
        let zero = T::splat(0.0);
        let column: Errors<T> = self.0.column(at).into_owned();
        let (s, innovation) = (column[at] + r, value - x[at]);
        // u_i u_j is the same number both ways round.
        let (u, mut step) = (column / s.simd_sqrt(), column * (innovation / s));
        let sound = shown & s.simd_gt(zero) & finite(s) & finite(u.norm_squared() + step.norm_squared());
        if sound.none() {
            return;
        }
        let before = (!sound.all()).then_some(self.0);
        let kept = NOT_HEADING.map(|i| NOT_HEADING.map(|j| self.0[(i, j)]));
        let u = u.data.0[0];
        for (of_j, u_j) in self.0.data.0.iter_mut().zip(u) {
            for (x, u_i) in of_j.iter_mut().zip(u) {
                *x -= u_i * u_j;
            }
        }
        // What was measured itself, without the cancellation of a large variance and a small one.
        let left = column * (r / s);
        self.0.set_column(at, &left);
        self.0.row_mut(at).tr_copy_from(&left);
        if moves == Moves::Heading {
            for (i, kept) in NOT_HEADING.into_iter().zip(kept) {
                step[i] = zero;
                for (j, kept) in NOT_HEADING.into_iter().zip(kept) {
                    self.0[(i, j)] = kept;
                }
            }
        }
        self.keep(before, sound);
        x.zip_apply(&step, |x, step| *x = (*x + step).select(sound, *x));
    }

    /// The upper triangle, column by column.
    pub fn triangle(&self) -> impl Iterator<Item = T> + '_ {
        places().map(|(i, j)| self.0[(i, j)])
    }

    /// Takes over what [`Covariance::triangle`] gave.
    pub fn set_triangle(&mut self, triangle: &[T]) {
        for (&value, (i, j)) in triangle.iter().zip(places()) {
            self.0[(i, j)] = value;
            self.0[(j, i)] = value;
        }
    }
}

/// Where a number is one that the machine can hold.
fn finite<T: Real>(x: T) -> T::SimdBool {
    x.simd_abs().simd_le(T::splat(f64::MAX))
}

/// Row and column of each number of a triangle.
pub(super) fn places() -> impl Iterator<Item = (usize, usize)> {
    (0..STATES).flat_map(|j| (0..=j).map(move |i| (i, j)))
}

#[cfg(test)]
mod tests {
    use super::*;

    type Full = SMatrix<f64, STATES, STATES>;

    /// Any matrix that is positive definite and symmetric.
    fn some() -> Covariance {
        let a = Full::from_fn(|i, j| ((i * 7 + j * 13) % 11) as f64 / 11.0 - 0.4);
        let square = a * a.transpose() + Full::identity() * 0.1;
        let mut covariance = Covariance::<f64>::independent(&Errors::zeros());
        let triangle: Vec<f64> = places().map(|(i, j)| square[(i, j)]).collect();
        covariance.set_triangle(&triangle);
        covariance
    }

    fn predicted(a: &Full, p: &Full) -> Full {
        let a = Full::identity() + a;
        a * p * a.transpose()
    }

    fn close(found: &Covariance, expected: &Full) {
        assert!((found.0 - expected).amax() < 1e-13, "{}", (found.0 - expected).amax());
        assert_eq!(found.0, found.0.transpose());
    }

    #[test]
    fn predictions_agree_with_full_matrices() {
        let (r, w, dt) = (
            Matrix3::new(0.36, 0.48, -0.8, -0.8, 0.6, 0.0, 0.48, 0.64, 0.6),
            Vector3::new(0.4, -1.2, 0.7),
            0.05,
        );
        let mut a = Full::zeros();
        for i in 0..3 {
            for j in 0..3 {
                a[(i, BIAS + j)] = -r[(i, j)] * dt;
                for k in 0..3 {
                    a[(i, SCALE + 3 * j + k)] = -r[(i, j)] * w[k] * dt;
                }
            }
        }
        let mut found = some();
        found.turn(&r, &w, dt);
        close(&found, &predicted(&a, &some().0));

        let f = Vector3::new(1.5, -2.0, 9.0);
        let mut a = Full::zeros();
        a.fixed_view_mut::<2, 3>(SPEED, 0)
            .copy_from(&(f.cross_matrix() * -dt).fixed_rows::<2>(0));
        let mut found = some();
        found.accelerate(&f, dt);
        close(&found, &predicted(&a, &some().0));
    }

    #[test]
    fn measurements_agree_with_the_joseph_form() {
        for (at, moves) in [(SPEED, Moves::All), (BIAS + 1, Moves::All), (2, Moves::Heading)] {
            let (p, r, value) = (some().0, 0.3, 0.7);
            let mut gain = p.column(at) / (p[(at, at)] + r);
            if moves == Moves::Heading {
                for i in NOT_HEADING {
                    gain[i] = 0.0;
                }
            }
            let mut left = Full::identity();
            for i in 0..STATES {
                left[(i, at)] -= gain[i];
            }
            let mut x: Errors = Errors::repeat(0.1);
            let expected_x = x + gain * (value - x[at]);
            let mut found = some();
            found.measure(&mut x, at, value, r, moves, true);
            close(&found, &(left * p * left.transpose() + gain * gain.transpose() * r));
            assert!((x - expected_x).amax() < 1e-14);
        }
    }

    #[test]
    fn what_would_overflow_changes_nothing() {
        let mut found = some();
        found.turn(&Matrix3::identity(), &Vector3::repeat(1e200), 1.0);
        found.accelerate(&Vector3::repeat(1e200), 1.0);
        found.measure(&mut Errors::zeros(), 0, f64::NAN, 0.1, Moves::All, true);
        found.measure(&mut Errors::zeros(), 0, 1.0, f64::INFINITY, Moves::All, true);
        assert_eq!(found.0, some().0);
    }
}
