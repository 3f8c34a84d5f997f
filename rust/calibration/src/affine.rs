//! Corrected = A reading + b: its split into misalignment and scale, and the sensor model that undoes it.

use nalgebra::{DMatrix, Matrix3, Vector3};

/// A correction of three-axis readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Affine {
    /// A, to be split into C K.
    pub matrix: Matrix3<f64>,
    /// b.
    pub offset: Vector3<f64>,
}

/// A correction in paper A's form: corrected = C K reading + b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// C: unit diagonal.
    pub misalignment: Matrix3<f64>,
    /// The diagonal of K.
    pub scale: Vector3<f64>,
}

/// The sensor model of a correction: reading = (I + gain) x + bias.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forward {
    /// Diagonal: scale errors; off it: misalignment (or soft iron, all nine).
    pub gain: Matrix3<f64>,
    /// Bias in the reading's unit.
    pub bias: Vector3<f64>,
}

impl Affine {
    /// Corrects a reading.
    pub fn apply(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        self.matrix * reading + self.offset
    }

    /// Paper A's split; `None` if an axis does not react at all.
    pub fn split(&self) -> Option<Split> {
        let scale = self.matrix.diagonal();
        if scale.iter().any(|k| *k == 0.0) {
            return None;
        }
        Some(Split {
            misalignment: Matrix3::from_fn(|i, j| self.matrix[(i, j)] / scale[j]),
            scale,
        })
    }

    /// The sensor model; `None` if A cannot be inverted.
    pub fn forward(&self) -> Option<Forward> {
        let inverse = self.matrix.try_inverse()?;
        Some(Forward {
            gain: inverse - Matrix3::identity(),
            bias: -inverse * self.offset,
        })
    }

    /// Standard errors of the split and of the sensor model from the covariance (12 x 12) of A (row by row) and b.
    pub fn errors(&self, covariance: &DMatrix<f64>) -> Option<(Split, Forward)> {
        let scale = self.split()?.scale;
        let inverse = self.matrix.try_inverse()?;
        let element = |k: usize| (k / 3, k % 3);
        // Rows: C (9), K (3), gain (9), bias (3); columns: A (9), b (3).
        let mut jacobian = DMatrix::zeros(24, 12);
        for k in 0..9 {
            let (i, j) = element(k);
            if i != j {
                jacobian[(k, k)] = 1.0 / scale[j];
                jacobian[(k, 4 * j)] = -self.matrix[(i, j)] / (scale[j] * scale[j]);
            }
            // d(A^-1) = -A^-1 dA A^-1.
            let change = -inverse.column(i) * inverse.row(j);
            for m in 0..9 {
                jacobian[(12 + m, k)] = change[element(m)];
            }
            let bias = -change * self.offset;
            for m in 0..3 {
                jacobian[(21 + m, k)] = bias[m];
            }
        }
        for j in 0..3 {
            jacobian[(9 + j, 4 * j)] = 1.0;
            for m in 0..3 {
                jacobian[(21 + m, 9 + j)] = -inverse[(m, j)];
            }
        }
        let spread = &jacobian * covariance * jacobian.transpose();
        let error = |k: usize| spread[(k, k)].max(0.0).sqrt();
        Some((
            Split {
                misalignment: Matrix3::from_fn(|i, j| error(3 * i + j)),
                scale: Vector3::from_fn(|j, _| error(9 + j)),
            },
            Forward {
                gain: Matrix3::from_fn(|i, j| error(12 + 3 * i + j)),
                bias: Vector3::from_fn(|j, _| error(21 + j)),
            },
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Affine {
        Affine {
            matrix: Matrix3::new(0.97, 0.01, -0.02, 0.004, 0.98, 0.03, -0.01, 0.002, 1.05),
            offset: Vector3::new(0.1, -0.2, 0.3),
        }
    }

    #[test]
    fn the_split_and_the_sensor_model_give_back_the_correction() {
        let affine = example();
        let split = affine.split().expect("split");
        let product = split.misalignment * Matrix3::from_diagonal(&split.scale);
        assert!((product - affine.matrix).norm() < 1e-15);
        assert_eq!(split.misalignment.diagonal(), Vector3::repeat(1.0));
        let forward = affine.forward().expect("invertible");
        let x = Vector3::new(1.0, -9.0, 3.0);
        let reading = (Matrix3::identity() + forward.gain) * x + forward.bias;
        assert!((affine.apply(&reading) - x).norm() < 1e-13);
    }

    #[test]
    fn errors_are_those_of_small_changes() {
        let affine = example();
        for k in 0..12 {
            let mut covariance = DMatrix::zeros(12, 12);
            let h = 1e-6;
            covariance[(k, k)] = h * h;
            let (split, forward) = affine.errors(&covariance).expect("errors");
            let mut moved = affine;
            if k < 9 {
                moved.matrix[(k / 3, k % 3)] += h;
            } else {
                moved.offset[k - 9] += h;
            }
            let change = moved.forward().expect("invertible").gain - affine.forward().expect("invertible").gain;
            let bias = moved.forward().expect("invertible").bias - affine.forward().expect("invertible").bias;
            assert!((change.abs() - forward.gain).norm() < 1e-10);
            assert!((bias.abs() - forward.bias).norm() < 1e-10);
            let c = moved.split().expect("split").misalignment - affine.split().expect("split").misalignment;
            assert!((c.abs() - split.misalignment).norm() < 1e-10);
        }
    }
}
