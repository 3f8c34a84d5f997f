//! Local polynomial through reference samples: value and derivatives at any time.
//!
//! The readings of an ideal sensor are derivatives of the reference. A first difference of a noisy or coarsely sampled
//! reference fakes delays and low-pass effects, so each value is taken from a least-squares polynomial over the
//! knots around it (the local regression of Cleveland 1979, of high order as Savitzky and Golay 1964, but at real time stamps).
//! How wide and of which degree is chosen from the reference alone, see [`crate::bandwidth`].

/// Degree and half width of the local polynomial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Smoothing {
    /// Degree of the polynomial, at most [`MAX_DEGREE`].
    pub degree: usize,
    /// Knots taken on each side of the time asked for.
    pub half_width: usize,
}

/// Highest degree that [`LocalFit`] supports.
pub const MAX_DEGREE: usize = 8;
const TERMS: usize = MAX_DEGREE + 1;

/// The narrowest choice: nine knots, degree eight, exact to 1e-8 for motions up to 4 Hz at 100 Hz.
pub const NARROWEST: Smoothing = Smoothing {
    degree: 8,
    half_width: 4,
};

/// Normal equations of one local polynomial in Legendre polynomials of u = (t - t_at) / scale, which keeps them well conditioned.
pub struct LocalFit {
    terms: usize,
    scale: f64,
    factor: [[f64; TERMS]; TERMS],
    basis: Vec<[f64; TERMS]>,
}

/// Value and first three derivatives with respect to time.
pub type Derivatives = [[f64; 3]; 4];

fn legendre(u: f64, terms: usize) -> [f64; TERMS] {
    let mut p = [0.0; TERMS];
    p[0] = 1.0;
    if terms > 1 {
        p[1] = u;
    }
    for k in 2..terms {
        let kf = k as f64;
        p[k] = ((2.0 * kf - 1.0) * u * p[k - 1] - (kf - 1.0) * p[k - 2]) / kf;
    }
    p
}

/// Derivatives of order 0 to 3 of the Legendre polynomials at u = 0.
const AT_ZERO: [[f64; TERMS]; 4] = [
    [1.0, 0.0, -0.5, 0.0, 0.375, 0.0, -0.3125, 0.0, 0.273_437_5],
    [0.0, 1.0, 0.0, -1.5, 0.0, 1.875, 0.0, -2.1875, 0.0],
    [0.0, 0.0, 3.0, 0.0, -7.5, 0.0, 13.125, 0.0, -19.6875],
    [0.0, 0.0, 0.0, 15.0, 0.0, -52.5, 0.0, 118.125, 0.0],
];

impl LocalFit {
    /// Prepares the fit around `at` through knots at times `t`; `None` if the knots do not determine the polynomial.
    pub fn new(t: &[f64], at: f64, degree: usize) -> Option<Self> {
        let terms = degree.min(MAX_DEGREE) + 1;
        if t.len() < terms {
            return None;
        }
        let scale = t.iter().fold(0.0_f64, |m, v| m.max((v - at).abs()));
        if scale <= 0.0 || !scale.is_finite() {
            return None;
        }
        let basis: Vec<_> = t.iter().map(|v| legendre((v - at) / scale, terms)).collect();
        let mut factor = [[0.0; TERMS]; TERMS];
        for b in &basis {
            for i in 0..terms {
                for j in 0..=i {
                    factor[i][j] += b[i] * b[j];
                }
            }
        }
        // Cholesky factor in place.
        for i in 0..terms {
            for j in 0..=i {
                let mut s = factor[i][j];
                for k in 0..j {
                    s -= factor[i][k] * factor[j][k];
                }
                if i == j {
                    if s <= 1e-11 * t.len() as f64 {
                        return None;
                    }
                    factor[i][i] = s.sqrt();
                } else {
                    factor[i][j] = s / factor[j][j];
                }
            }
        }
        Some(Self {
            terms,
            scale,
            factor,
            basis,
        })
    }

    fn solve(&self, b: &mut [f64; TERMS]) {
        for i in 0..self.terms {
            for k in 0..i {
                b[i] -= self.factor[i][k] * b[k];
            }
            b[i] /= self.factor[i][i];
        }
        for i in (0..self.terms).rev() {
            for k in i + 1..self.terms {
                b[i] -= self.factor[k][i] * b[k];
            }
            b[i] /= self.factor[i][i];
        }
    }

    /// Weights `w[order][knot]` with which the knots' values enter the derivatives, so that knots of equal spacing share one solution.
    pub fn weights(&self) -> [Vec<f64>; 4] {
        let mut weights: [Vec<f64>; 4] = Default::default();
        let mut unit = 1.0;
        for (order, w) in weights.iter_mut().enumerate() {
            let mut c = AT_ZERO[order];
            self.solve(&mut c);
            *w = self
                .basis
                .iter()
                .map(|b| (0..self.terms).map(|k| c[k] * b[k]).sum::<f64>() / unit)
                .collect();
            unit *= self.scale;
        }
        weights
    }

    /// Sum of squared residuals of the fit to `values`, and its degrees of freedom.
    pub fn residual(&self, values: &[[f64; 3]]) -> (f64, usize) {
        let mut sum = 0.0;
        for axis in 0..3 {
            let mut c = [0.0; TERMS];
            for (b, v) in self.basis.iter().zip(values) {
                for k in 0..self.terms {
                    c[k] += b[k] * v[axis];
                }
            }
            self.solve(&mut c);
            for (b, v) in self.basis.iter().zip(values) {
                let fitted: f64 = (0..self.terms).map(|k| c[k] * b[k]).sum();
                sum += (v[axis] - fitted).powi(2);
            }
        }
        (sum, 3 * (values.len() - self.terms))
    }
}

/// Applies weights to values: value and derivatives, each with three components.
pub fn apply(weights: &[Vec<f64>; 4], values: &[[f64; 3]]) -> Derivatives {
    let mut out = [[0.0; 3]; 4];
    for (order, w) in weights.iter().enumerate() {
        for (a, v) in w.iter().zip(values) {
            for axis in 0..3 {
                out[order][axis] += a * v[axis];
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_comes_back_with_its_derivatives_at_uneven_times() {
        let t: Vec<f64> = (0..15)
            .map(|i| f64::from(i) * 0.01 + 0.002 * f64::from(i * 7 % 5))
            .collect();
        let at = 0.07;
        let values: Vec<[f64; 3]> = t
            .iter()
            .map(|v| {
                let u = v - at;
                [1.0 + 2.0 * u + 3.0 * u * u, u * u * u, 4.0 * u]
            })
            .collect();
        let fit = LocalFit::new(&t, at, 6).expect("determined");
        let d = apply(&fit.weights(), &values);
        for (got, want) in [
            (d[0][0], 1.0),
            (d[1][0], 2.0),
            (d[2][0], 6.0),
            (d[3][1], 6.0),
            (d[1][2], 4.0),
        ] {
            assert!((got - want).abs() < 1e-7, "{got} {want}");
        }
        assert!(fit.residual(&values).0 < 1e-24);
    }

    #[test]
    fn too_few_knots_are_refused() {
        assert!(LocalFit::new(&[0.0, 0.1, 0.2], 0.1, 6).is_none());
    }
}
