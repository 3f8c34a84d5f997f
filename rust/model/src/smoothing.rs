//! Local polynomial through reference samples: value and derivatives at any time.
//!
//! The readings of an ideal sensor are derivatives of the reference. A first difference of a noisy or coarsely sampled
//! reference fakes delays and low-pass effects, so each value is taken from a least-squares polynomial over the
//! knots around it (the local regression of Cleveland 1979, of high order as Savitzky and Golay 1964, but at real time stamps).
//! How wide and of which degree is chosen from the reference alone, see [`crate::bandwidth`].

use std::array::from_fn;

/// How knots are weighted within the reach of a polynomial.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kernel {
    /// All alike: least noise within the band that the polynomial follows.
    #[default]
    Uniform,
    /// Less towards both ends, as (1 - u^2)^2: the side lobes pass 4 % of the amplitude beyond that band, those of equal weights 18 %, and a
    /// column has this noise in common with the residual.
    Tapered,
}

impl Kernel {
    /// Weight at a distance from the middle, in units of the reach.
    fn weight(self, u: f64) -> f64 {
        match self {
            Self::Uniform => 1.0,
            // The last knot counts a little, too.
            Self::Tapered => (1.0 - (EDGE * u).powi(2)).powi(2),
        }
    }
}

/// Part of the reach of the taper at which the last knot lies: with 16 knots to a side, half way to the next one.
const EDGE: f64 = 0.97;

/// Degree, half width and kernel of the local polynomial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Smoothing {
    /// Degree of the polynomial, at most [`MAX_DEGREE`].
    pub degree: usize,
    /// Knots taken on each side of the time asked for.
    pub half_width: usize,
    /// How these are weighted.
    pub kernel: Kernel,
}

impl Smoothing {
    /// A polynomial for which all knots count alike.
    pub const fn uniform(degree: usize, half_width: usize) -> Self {
        Self {
            degree,
            half_width,
            kernel: Kernel::Uniform,
        }
    }

    /// The same with knots that count less towards both ends.
    #[must_use]
    pub const fn tapered(self) -> Self {
        Self {
            kernel: Kernel::Tapered,
            ..self
        }
    }
}

/// Highest degree that [`LocalFit`] supports.
pub const MAX_DEGREE: usize = 8;
const TERMS: usize = MAX_DEGREE + 1;

/// The narrowest choice: nine knots, degree eight, exact to 1e-8 for motions up to 4 Hz at 100 Hz.
pub const NARROWEST: Smoothing = Smoothing::uniform(8, 4);

/// Normal equations of one local polynomial in Legendre polynomials of u = (t - t_at) / scale, which keeps them well conditioned.
#[derive(Default)]
pub struct LocalFit {
    terms: usize,
    scale: f64,
    lowest: usize,
    factor: [[f64; TERMS]; TERMS],
    basis: Vec<[f64; TERMS]>,
}

/// Four derivatives with respect to time, each of the next higher order; order 0 is the value.
pub type Derivatives = [[f64; 3]; 4];

/// What each knot's value counts for in the four derivatives.
pub type Weights = Vec<[f64; 4]>;

/// (2 k - 1) / k and (k - 1) / k of the recurrence of the Legendre polynomials.
const RECURRENCE: [(f64, f64); PRODUCTS] = {
    let mut out = [(0.0, 0.0); PRODUCTS];
    let mut k = 1;
    while k < PRODUCTS {
        let kf = k as f64;
        out[k] = ((2.0 * kf - 1.0) / kf, (kf - 1.0) / kf);
        k += 1;
    }
    out
};

/// Derivatives of order 0 to 4 of the Legendre polynomials at u = 0.
const AT_ZERO: [[f64; TERMS]; 5] = [
    [1.0, 0.0, -0.5, 0.0, 0.375, 0.0, -0.3125, 0.0, 0.273_437_5],
    [0.0, 1.0, 0.0, -1.5, 0.0, 1.875, 0.0, -2.1875, 0.0],
    [0.0, 0.0, 3.0, 0.0, -7.5, 0.0, 13.125, 0.0, -19.6875],
    [0.0, 0.0, 0.0, 15.0, 0.0, -52.5, 0.0, 118.125, 0.0],
    [0.0, 0.0, 0.0, 0.0, 105.0, 0.0, -472.5, 0.0, 1299.375],
];
/// Highest order of the lowest of four derivatives.
const HIGHEST_LOWEST: usize = AT_ZERO.len() - 4;

/// Runs a function with the number of terms as a constant: the loops over terms, where all the time goes at uneven time stamps, are
/// then unrolled.
macro_rules! with_terms {
    ($terms:expr, $function:ident($($argument:expr),*)) => {
        match $terms {
            1 => $function::<1>($($argument),*),
            2 => $function::<2>($($argument),*),
            3 => $function::<3>($($argument),*),
            4 => $function::<4>($($argument),*),
            5 => $function::<5>($($argument),*),
            6 => $function::<6>($($argument),*),
            7 => $function::<7>($($argument),*),
            8 => $function::<8>($($argument),*),
            _ => $function::<TERMS>($($argument),*),
        }
    };
}

/// Products reach twice the highest degree.
const PRODUCTS: usize = 2 * TERMS - 1;
/// Knots worked on side by side.
const LANES: usize = 4;

/// `LINEAR[i][j][r]`, the share of the polynomial of degree i + j - 2 r in the product of those of degrees i and j (Adams 1878).
const LINEAR: [[[f64; TERMS]; TERMS]; TERMS] = {
    let mut a = [1.0; PRODUCTS];
    let mut r = 1;
    while r < PRODUCTS {
        a[r] = a[r - 1] * (2.0 * r as f64 - 1.0) / r as f64;
        r += 1;
    }
    let mut out = [[[0.0; TERMS]; TERMS]; TERMS];
    let mut i = 0;
    while i < TERMS {
        let mut j = 0;
        while j <= i {
            let mut r = 0;
            while r <= j {
                let (sum, rf) = ((i + j) as f64, r as f64);
                out[i][j][r] = a[r] * a[i - r] * a[j - r] / a[i + j - r] * (2.0 * sum - 4.0 * rf + 1.0)
                    / (2.0 * sum - 2.0 * rf + 1.0);
                r += 1;
            }
            j += 1;
        }
        i += 1;
    }
    out
};

/// Numbers of some knots side by side.
type Lanes = [f64; LANES];

/// The Legendre polynomial of degree k at u from the two before, the earlier one first; all of them count `one` times.
#[inline]
fn next(k: usize, u: &Lanes, one: &Lanes, before: &[Lanes; 2]) -> Lanes {
    match k {
        0 => *one,
        1 => from_fn(|lane| u[lane] * one[lane]),
        _ => {
            let (a, b) = RECURRENCE[k];
            from_fn(|lane| a * u[lane] * before[1][lane] - b * before[0][lane])
        }
    }
}

#[inline]
fn add(sum: &mut Lanes, a: &Lanes, b: &Lanes) {
    *sum = from_fn(|lane| sum[lane] + a[lane] * b[lane]);
}

/// Times of some knots on the scale of the polynomials, and what each counts: a lane without a knot nothing.
#[inline]
fn scaled(knots: &[f64], at: f64, per_scale: f64, kernel: Kernel) -> (Lanes, Lanes) {
    if let Ok(knots) = <&Lanes>::try_from(knots) {
        let u = knots.map(|t| (t - at) * per_scale);
        return (u, u.map(|u| kernel.weight(u)));
    }
    let known = |lane: usize| knots.get(lane);
    let u: Lanes = from_fn(|lane| known(lane).map_or(0.0, |t| (t - at) * per_scale));
    let count = |lane: usize| known(lane).map_or(0.0, |_| kernel.weight(u[lane]));
    (u, from_fn(count))
}

/// Adds the Legendre polynomials at some knots to their sums, up to a product's degree, and hands out those of the fit.
#[inline]
fn along<const T: usize>(
    knots: &[f64],
    at: f64,
    per_scale: f64,
    kernel: Kernel,
    sums: &mut [Lanes; PRODUCTS],
    mut each: impl FnMut(usize, &Lanes),
) {
    let (u, one) = scaled(knots, at, per_scale, kernel);
    let mut before = [[0.0; LANES]; 2];
    for (k, sum) in sums.iter_mut().enumerate().take(2 * T - 1) {
        let p = next(k, &u, &one, &before);
        add(sum, &p, &[1.0; LANES]);
        if k < T {
            each(k, &p);
        }
        before = [before[1], p];
    }
}

/// Legendre polynomials at each knot, times what the knot counts, and the sums of their products (lower triangle): since a product is a sum of such polynomials
/// again, the sums of each of them over the knots are enough.
fn gram<const T: usize>(
    t: &[f64],
    at: f64,
    scale: f64,
    kernel: Kernel,
    basis: &mut Vec<[f64; TERMS]>,
) -> [[f64; TERMS]; TERMS] {
    let mut sums = [[0.0; LANES]; PRODUCTS];
    basis.clear();
    for knots in t.chunks(LANES) {
        let mut terms = [[0.0; TERMS]; LANES];
        along::<T>(knots, at, scale.recip(), kernel, &mut sums, |k, p| {
            for lane in 0..LANES {
                terms[lane][k] = p[lane];
            }
        });
        basis.extend_from_slice(&terms[..knots.len()]);
    }
    products::<T>(&sums)
}

/// Sums of the products of two polynomials (lower triangle) from those of each polynomial.
fn products<const T: usize>(sums: &[[f64; LANES]; PRODUCTS]) -> [[f64; TERMS]; TERMS] {
    let total = sums.map(|lanes| lanes.iter().sum::<f64>());
    let mut out = [[0.0; TERMS]; TERMS];
    for i in 0..T {
        for j in 0..=i {
            out[i][j] = (0..=j).map(|r| LINEAR[i][j][r] * total[i + j - 2 * r]).sum();
        }
    }
    out
}

/// Four derivatives of the polynomial through values at knots, in one go: nothing is kept for other values.
fn fitted<const T: usize>(
    t: &[f64],
    at: f64,
    scale: f64,
    kernel: Kernel,
    values: &[[f64; 3]],
    lowest: usize,
) -> Option<Derivatives> {
    let mut sums = [[0.0; LANES]; PRODUCTS];
    let mut right = [[[0.0; LANES]; 3]; T];
    let per_scale = scale.recip();
    for (knots, values) in t.chunks(LANES).zip(values.chunks(LANES)) {
        let value = |axis: usize| from_fn(|lane| values.get(lane).map_or(0.0, |v| v[axis]));
        let values: [Lanes; 3] = from_fn(value);
        along::<T>(knots, at, per_scale, kernel, &mut sums, |k, p| {
            for (sum, value) in right[k].iter_mut().zip(&values) {
                add(sum, p, value);
            }
        });
    }
    let mut factor = products::<T>(&sums);
    if !factorise::<T>(&mut factor, DETERMINED * t.len() as f64) {
        return None;
    }
    let mut out = [[0.0; 3]; 4];
    for axis in 0..3 {
        let mut c = [0.0; TERMS];
        for k in 0..T {
            c[k] = right[k][axis].iter().sum();
        }
        solve::<T>(&factor, &mut c);
        let mut unit = if lowest == 0 { 1.0 } else { per_scale };
        for (out, at_zero) in out.iter_mut().zip(&AT_ZERO[lowest..]) {
            let value: f64 = (0..T).map(|k| at_zero[k] * c[k]).sum();
            out[axis] = value * unit;
            unit *= per_scale;
        }
    }
    Some(out)
}

/// Derivatives of order `lowest` (0 or 1) and the three next ones around `at` of the polynomial through values at times `t`; `None` if these
/// do not determine it.
pub fn derivatives(
    t: &[f64],
    at: f64,
    smoothing: Smoothing,
    values: &[[f64; 3]],
    lowest: usize,
) -> Option<Derivatives> {
    let (terms, scale) = terms_and_scale(t, at, smoothing.degree)?;
    let (lowest, kernel) = (lowest.min(HIGHEST_LOWEST), smoothing.kernel);
    with_terms!(terms, fitted(t, at, scale, kernel, values, lowest))
}

/// Number of terms, and the scale of time; `None` where there are too few knots.
fn terms_and_scale(t: &[f64], at: f64, degree: usize) -> Option<(usize, f64)> {
    let terms = degree.min(MAX_DEGREE) + 1;
    let (first, last) = (t.first()?, t.last()?);
    let scale = (first - at).abs().max((last - at).abs());
    (t.len() >= terms && scale > 0.0 && scale.is_finite()).then_some((terms, scale))
}

/// Knots determine a polynomial if no pivot is smaller than this, by knot.
const DETERMINED: f64 = 1e-11;

/// Cholesky factor in place; false where the knots do not determine the polynomial.
fn factorise<const T: usize>(factor: &mut [[f64; TERMS]; TERMS], least: f64) -> bool {
    for i in 0..T {
        for j in 0..=i {
            let mut s = factor[i][j];
            for k in 0..j {
                s -= factor[i][k] * factor[j][k];
            }
            if i == j {
                if s <= least {
                    return false;
                }
                factor[i][i] = s.sqrt();
            } else {
                factor[i][j] = s / factor[j][j];
            }
        }
    }
    true
}

fn solve<const T: usize>(factor: &[[f64; TERMS]; TERMS], b: &mut [f64; TERMS]) {
    for i in 0..T {
        for k in 0..i {
            b[i] -= factor[i][k] * b[k];
        }
        b[i] /= factor[i][i];
    }
    for i in (0..T).rev() {
        for k in i + 1..T {
            b[i] -= factor[k][i] * b[k];
        }
        b[i] /= factor[i][i];
    }
}

/// Linear combinations of the polynomials at each knot, four at a time.
fn combined<const T: usize>(basis: &[[f64; TERMS]], coefficients: &[[f64; 4]; TERMS], out: &mut Weights) {
    out.clear();
    out.extend(basis.iter().map(|b| {
        let mut sum = [0.0; 4];
        for k in 0..T {
            for (s, c) in sum.iter_mut().zip(coefficients[k]) {
                *s += b[k] * c;
            }
        }
        sum
    }));
}

impl LocalFit {
    /// Prepares the fit around `at` through knots at times `t`, for derivatives of order `lowest` (0 or 1) and the three next ones; `None`
    /// if the knots do not determine the polynomial.
    pub fn new(t: &[f64], at: f64, smoothing: Smoothing, lowest: usize) -> Option<Self> {
        let mut fit = Self::default();
        fit.prepare(t, at, smoothing, lowest).then_some(fit)
    }

    /// The same in place; false if the knots do not determine the polynomial.
    pub fn prepare(&mut self, t: &[f64], at: f64, smoothing: Smoothing, lowest: usize) -> bool {
        let kernel = smoothing.kernel;
        let Some((terms, scale)) = terms_and_scale(t, at, smoothing.degree) else {
            return false;
        };
        (self.terms, self.scale, self.lowest) = (terms, scale, lowest.min(HIGHEST_LOWEST));
        self.factor = with_terms!(terms, gram(t, at, scale, kernel, &mut self.basis));
        let least = DETERMINED * t.len() as f64;
        with_terms!(terms, factorise(&mut self.factor, least))
    }

    fn solve(&self, b: &mut [f64; TERMS]) {
        with_terms!(self.terms, solve(&self.factor, b));
    }

    /// Weights of the knots' values, so that knots of equal spacing share one solution.
    pub fn weights(&self) -> Weights {
        let mut weights = Weights::new();
        self.weights_into(&mut weights);
        weights
    }

    /// The same in place.
    pub fn weights_into(&self, weights: &mut Weights) {
        let mut coefficients = [[0.0; 4]; TERMS];
        let mut unit = if self.lowest == 0 { 1.0 } else { self.scale };
        for order in 0..4 {
            let mut c = AT_ZERO[self.lowest + order];
            self.solve(&mut c);
            for (k, c) in c.iter().enumerate().take(self.terms) {
                coefficients[k][order] = c / unit;
            }
            unit *= self.scale;
        }
        with_terms!(self.terms, combined(&self.basis, &coefficients, weights));
    }

    /// Sum of squared residuals of the fit to `values`, and its degrees of freedom, where all knots count alike.
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

/// Applies weights to values: four derivatives, each with three components.
pub fn apply(weights: &[[f64; 4]], values: &[[f64; 3]]) -> Derivatives {
    let mut out = [[0.0; 4]; 3];
    for (w, v) in weights.iter().zip(values) {
        for (sums, v) in out.iter_mut().zip(v) {
            for (s, w) in sums.iter_mut().zip(w) {
                *s += w * v;
            }
        }
    }
    [0, 1, 2, 3].map(|order| out.map(|axis| axis[order]))
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
        let fit = LocalFit::new(&t, at, Smoothing::uniform(6, 7), 0).expect("determined");
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
        let at_once = derivatives(&t, at, Smoothing::uniform(6, 7), &values, 0).expect("determined");
        for (a, b) in d.as_flattened().iter().zip(at_once.as_flattened()) {
            assert!((a - b).abs() < 1e-9 * (1.0 + a.abs()), "{a} {b}");
        }
    }

    #[test]
    fn the_fourth_derivative_comes_with_the_first_three() {
        let t: Vec<f64> = (0..15).map(|i| f64::from(i) + 0.2 * f64::from(i * 7 % 5)).collect();
        let values: Vec<[f64; 3]> = t.iter().map(|v| [(v - 7.0).powi(4), (v - 7.0).powi(6), 1.0]).collect();
        let d = derivatives(&t, 7.5, Smoothing::uniform(8, 7), &values, 1).expect("determined");
        let weighted = apply(
            &LocalFit::new(&t, 7.5, Smoothing::uniform(8, 7), 1)
                .expect("determined")
                .weights(),
            &values,
        );
        let wanted = [
            [0.5, 3.0, 12.0, 24.0],
            [6.0 / 32.0, 30.0 / 16.0, 120.0 / 8.0, 360.0 / 4.0],
            [0.0; 4],
        ];
        for (axis, wanted) in wanted.iter().enumerate() {
            for (order, want) in wanted.iter().enumerate() {
                for got in [d[order][axis], weighted[order][axis]] {
                    assert!((got - want).abs() < 1e-7, "{got} {want}");
                }
            }
        }
    }

    #[test]
    fn sums_of_products_come_from_sums_of_polynomials() {
        let t: Vec<f64> = (0..22).map(|i| f64::from(i) + 0.3 * f64::from(i * 5 % 7)).collect();
        let mut basis = Vec::new();
        let sums = gram::<TERMS>(&t, 11.0, 13.0, Kernel::Uniform, &mut basis);
        for i in 0..TERMS {
            for j in 0..=i {
                let direct: f64 = basis.iter().map(|b| b[i] * b[j]).sum();
                assert!((sums[i][j] - direct).abs() < 1e-12, "{i} {j}: {} {direct}", sums[i][j]);
            }
        }
    }

    #[test]
    fn a_taper_keeps_polynomials_and_hardly_passes_what_is_fast() {
        let t: Vec<f64> = (0..41).map(f64::from).collect();
        let passed = |smoothing: Smoothing, frequency: f64| {
            let weights = LocalFit::new(&t, 20.0, smoothing, 0).expect("determined").weights();
            assert!((weights.iter().map(|w| w[0]).sum::<f64>() - 1.0).abs() < 1e-9);
            let wave = weights
                .iter()
                .zip(&t)
                .map(|(w, t)| w[0] * (frequency * (t - 20.0)).cos());
            wave.sum::<f64>().abs()
        };
        let most = |smoothing: Smoothing| {
            (0..60)
                .map(|k| passed(smoothing, 1.2 + 0.03 * f64::from(k)))
                .fold(0.0, f64::max)
        };
        let alike = Smoothing::uniform(6, 20);
        let (alike, tapered) = (most(alike), most(alike.tapered()));
        assert!(tapered < 0.3 * alike, "{tapered} {alike}");
    }

    #[test]
    fn too_few_knots_are_refused() {
        assert!(LocalFit::new(&[0.0, 0.1, 0.2], 0.1, Smoothing::uniform(6, 1), 0).is_none());
    }
}
