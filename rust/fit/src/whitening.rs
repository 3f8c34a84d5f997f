//! Autoregressive whitening: what is left of a reading once its own past is taken off.

use nalgebra::{Cholesky, DMatrix, DVector};

/// Autoregressive coefficients of one channel: e_k = y_k - sum a_j y_{k-j}. Empty = the noise is white.
pub type Filter = Vec<f64>;

/// Highest order tried.
pub const MAX_ORDER: usize = 12;
/// Part of the mean square below which what is left is rounding: a thousand times the precision of a number, squares being differences.
const EXACT: f64 = 1e-13;

/// Fits an autoregressive filter by least squares to `n` samples with their past, from the products of the sample (first) and of those
/// before it, each with each (the covariance method of Makhoul 1975); the order by Schwarz's criterion.
///
/// Autocovariances at one lag after the other need not be those of any process where samples are few or very much alike, and their recursion
/// then ends at an order of one or two. Squares of what is left are never negative.
pub fn filter(products: &DMatrix<f64>, n: usize) -> Filter {
    let samples = n as f64;
    let highest = MAX_ORDER.min(products.nrows().saturating_sub(1)).min(n / 20);
    if n < 50 || highest == 0 || products[(0, 0)] <= 0.0 {
        return Vec::new();
    }
    let past = products.view((1, 1), (highest, highest)).into_owned();
    let right: DVector<f64> = products.view((1, 0), (highest, 1)).column(0).into_owned();
    let mut best = (samples * (products[(0, 0)] / samples).ln(), Vec::new());
    for order in 1..=highest {
        let leading = past.view((0, 0), (order, order)).into_owned();
        let Some(factor) = Cholesky::new(leading) else { break };
        let own = right.rows(0, order).into_owned();
        let a = factor.solve(&own);
        let variance = (products[(0, 0)] - a.dot(&own)) / samples;
        // Less is rounding.
        if variance <= EXACT * products[(0, 0)] / samples {
            break;
        }
        let criterion = samples * variance.ln() + (order as f64) * samples.ln();
        if criterion < best.0 {
            best = (criterion, a.as_slice().to_vec());
        }
    }
    best.1
}

/// Power gain of a whitening filter at a frequency (cycles per sample): |1 - sum a_j e^{-i w j}|^2.
pub fn gain(filter: &[f64], frequency: f64) -> f64 {
    let w = 2.0 * std::f64::consts::PI * frequency;
    let (mut re, mut im) = (1.0, 0.0);
    for (j, a) in filter.iter().enumerate() {
        let angle = w * (j + 1) as f64;
        re -= a * angle.cos();
        im += a * angle.sin();
    }
    re * re + im * im
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Products of samples that have so many before them.
    fn products(y: &[f64], order: usize) -> DMatrix<f64> {
        let rows = order..y.len();
        DMatrix::from_fn(order + 1, order + 1, |i, j| {
            rows.clone().map(|k| y[k - i] * y[k - j]).sum()
        })
    }

    /// Noise with a spectrum that a sum of taps over white noise has.
    fn noise(taps: &[f64], n: usize) -> Vec<f64> {
        let mut state = 1_u64;
        let mut white = || {
            // The sum of twelve uniform numbers is nearly normal.
            (0..12)
                .map(|_| {
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
                })
                .sum::<f64>()
        };
        let white: Vec<f64> = (0..n + taps.len()).map(|_| white()).collect();
        (0..n)
            .map(|k| taps.iter().enumerate().map(|(j, tap)| tap * white[k + j]).sum())
            .collect()
    }

    #[test]
    fn white_noise_needs_no_filter_and_a_first_order_process_gets_its_own() {
        let white = noise(&[1.0], 4000);
        assert!(filter(&products(&white, 5), white.len() - 5).is_empty());
        let mut process = white;
        for k in 1..process.len() {
            process[k] += 0.8 * process[k - 1];
        }
        let found = filter(&products(&process, 7), process.len() - 7);
        assert_eq!(found.len(), 1);
        assert!((found[0] - 0.8).abs() < 0.02, "{found:?}");
        assert!((gain(&[0.8], 0.0) - 0.04).abs() < 1e-12);
    }

    #[test]
    fn what_changes_little_from_sample_to_sample_is_foretold_to_its_white_part() {
        // A motion that a filter has left, beside noise of a hundred-thousandth of it.
        let fine = noise(&[1.0], 3000);
        let smooth: Vec<f64> = (0..3000)
            .map(|k| 1e5 * (0.01 * f64::from(k)).sin() * (0.0037 * f64::from(k)).cos())
            .collect();
        let y: Vec<f64> = smooth.iter().zip(&fine).map(|(a, b)| a + b).collect();
        let found = filter(&products(&y, MAX_ORDER), y.len() - MAX_ORDER);
        let left = |k: usize| y[k] - found.iter().enumerate().map(|(j, a)| a * y[k - 1 - j]).sum::<f64>();
        let square = (MAX_ORDER..y.len()).map(|k| left(k).powi(2)).sum::<f64>() / (y.len() - MAX_ORDER) as f64;
        assert!(square < 4.0, "{square} {found:?}");
    }
}
