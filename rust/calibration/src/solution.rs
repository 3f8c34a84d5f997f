//! The correction's parameters, their layout, and what a fit says of them.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};

use crate::affine::Affine;

/// Which elements of A are free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Elements {
    /// All nine.
    Full,
    /// A is symmetric (6): no rotation away from the sensor's own axes.
    Symmetric,
    /// The diagonal alone (3): scale without misalignment.
    Diagonal,
}

impl Elements {
    /// The places (row, column) that each parameter stands at.
    fn places(self) -> &'static [&'static [(usize, usize)]] {
        const FULL: [&[(usize, usize)]; 9] = [
            &[(0, 0)],
            &[(0, 1)],
            &[(0, 2)],
            &[(1, 0)],
            &[(1, 1)],
            &[(1, 2)],
            &[(2, 0)],
            &[(2, 1)],
            &[(2, 2)],
        ];
        const SYMMETRIC: [&[(usize, usize)]; 6] = [
            &[(0, 0)],
            &[(1, 1)],
            &[(2, 2)],
            &[(0, 1), (1, 0)],
            &[(0, 2), (2, 0)],
            &[(1, 2), (2, 1)],
        ];
        match self {
            Self::Full => &FULL,
            Self::Symmetric => &SYMMETRIC,
            Self::Diagonal => &SYMMETRIC[..3],
        }
    }
}

/// Which parameters a correction has: corrected = A y + b + c T + diag(d) T y, T the temperature less its mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Form {
    /// Free elements of A.
    pub matrix: Elements,
    /// c (3 parameters).
    pub bias_temperature: bool,
    /// d (3 parameters).
    pub scale_temperature: bool,
}

impl Form {
    /// A and b alone, all twelve.
    pub const FULL: Self = Self {
        matrix: Elements::Full,
        bias_temperature: false,
        scale_temperature: false,
    };
    /// The nine that lengths can tell.
    pub const SYMMETRIC: Self = Self {
        matrix: Elements::Symmetric,
        ..Self::FULL
    };

    /// Number of parameters of A.
    pub fn of_matrix(self) -> usize {
        self.matrix.places().len()
    }

    /// Number of parameters.
    pub fn parameters(self) -> usize {
        self.of_matrix() + 3 + 3 * usize::from(self.bias_temperature) + 3 * usize::from(self.scale_temperature)
    }

    /// The corrected reading's derivative by each parameter, in which it is linear.
    pub fn columns(self, y: &Vector3<f64>, temperature: f64) -> Matrix3xX<f64> {
        let mut columns = Matrix3xX::zeros(self.parameters());
        for (k, places) in self.matrix.places().iter().enumerate() {
            for (i, j) in *places {
                columns[(*i, k)] = y[*j];
            }
        }
        let mut first = self.of_matrix();
        for i in 0..3 {
            columns[(i, first + i)] = 1.0;
        }
        if self.bias_temperature {
            first += 3;
            for i in 0..3 {
                columns[(i, first + i)] = temperature;
            }
        }
        if self.scale_temperature {
            first += 3;
            for i in 0..3 {
                columns[(i, first + i)] = temperature * y[i];
            }
        }
        columns
    }

    /// Parameters of A = `matrix`, b = `offset`, no temperature.
    pub fn start(self, affine: &Affine) -> DVector<f64> {
        let mut theta = DVector::zeros(self.parameters());
        for (k, places) in self.matrix.places().iter().enumerate() {
            theta[k] = affine.matrix[places[0]];
        }
        theta.rows_mut(self.of_matrix(), 3).copy_from(&affine.offset);
        theta
    }

    /// A and b (12, A row by row) from the parameters.
    pub fn expansion(self) -> DMatrix<f64> {
        let mut expansion = DMatrix::zeros(12, self.parameters());
        for (k, places) in self.matrix.places().iter().enumerate() {
            for (i, j) in *places {
                expansion[(3 * i + j, k)] = 1.0;
            }
        }
        for i in 0..3 {
            expansion[(9 + i, self.of_matrix() + i)] = 1.0;
        }
        expansion
    }

    /// A and b of the parameters.
    pub fn affine(self, theta: &DVector<f64>) -> Affine {
        let flat = self.expansion() * theta.rows(0, self.parameters());
        Affine {
            matrix: Matrix3::from_fn(|i, j| flat[3 * i + j]),
            offset: Vector3::new(flat[9], flat[10], flat[11]),
        }
    }

    /// c and d of some values (parameters or their errors), zero where the form has none.
    pub fn temperature(self, theta: &DVector<f64>) -> (Vector3<f64>, Vector3<f64>) {
        let mut first = self.of_matrix() + 3;
        let mut take = |present: bool| {
            if present {
                let v = Vector3::new(theta[first], theta[first + 1], theta[first + 2]);
                first += 3;
                v
            } else {
                Vector3::zeros()
            }
        };
        let c = take(self.bias_temperature);
        (c, take(self.scale_temperature))
    }
}

/// What a fit found.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Layout of the first parameters; those that follow belong to the cost (tilt, dip).
    pub form: Form,
    /// Values.
    pub parameters: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Condition number of the design matrix, its columns scaled to unit length.
    pub condition: f64,
    /// Degrees of freedom of the residual.
    pub freedom: f64,
    /// Variance beyond the noise that the residual shows (placement, table, field), same unit squared.
    pub excess: f64,
    /// Residual of each item, corrected less target: a vector, or for lengths a number in x.
    pub residuals: Vec<Vector3<f64>>,
    /// The same for each item when its group is left out of the fit; NaN where that cannot be fitted.
    pub held_out: Vec<Vector3<f64>>,
    /// Length of the corrected reading of each item when its group is left out; NaN where that cannot be fitted.
    pub held_out_length: Vec<f64>,
}

impl Solution {
    /// The correction.
    pub fn affine(&self) -> Affine {
        self.form.affine(&self.parameters)
    }

    /// Covariance of A (row by row) and b.
    pub fn affine_covariance(&self) -> DMatrix<f64> {
        let expansion = self.form.expansion();
        let p = self.form.parameters();
        &expansion * self.covariance.view((0, 0), (p, p)) * expansion.transpose()
    }

    /// Standard errors of the parameters.
    pub fn errors(&self) -> DVector<f64> {
        self.covariance.diagonal().map(|v| v.max(0.0).sqrt())
    }

    /// Correlation of the parameters.
    pub fn correlation(&self) -> DMatrix<f64> {
        let errors = self.errors();
        DMatrix::from_fn(errors.len(), errors.len(), |i, j| {
            if i == j {
                1.0
            } else if errors[i] > 0.0 && errors[j] > 0.0 {
                self.covariance[(i, j)] / (errors[i] * errors[j])
            } else {
                0.0
            }
        })
    }
}

/// Variance to be added to each item's own so that the weighted squares equal the degrees of freedom (Paule and Mandel
/// 1982); zero if the items' own explain the residual. `squares` gives the weighted sum for a trial value.
pub fn excess_variance(freedom: f64, largest: f64, mut squares: impl FnMut(f64) -> Option<f64>) -> Option<f64> {
    if freedom < 1.0 || squares(0.0)? <= freedom {
        return Some(0.0);
    }
    let (mut low, mut high) = (0.0, largest.max(f64::MIN_POSITIVE));
    let mut doublings = 0;
    while squares(high)? > freedom {
        low = high;
        high *= 4.0;
        doublings += 1;
        if doublings > 60 {
            return None;
        }
    }
    // A part in a thousand is far more than a variance from a few poses is worth.
    while high - low > 1e-3 * high {
        let middle = 0.5 * (low + high);
        if squares(middle)? > freedom {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(0.5 * (low + high))
}
