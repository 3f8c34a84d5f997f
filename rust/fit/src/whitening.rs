//! Autoregressive whitening: what is left of a reading once its own past is taken off.

/// Autoregressive coefficients of one channel: e_k = y_k - sum a_j y_{k-j}. Empty = the noise is white.
pub type Filter = Vec<f64>;

/// Highest order tried.
pub const MAX_ORDER: usize = 12;

/// Fits an autoregressive filter to autocovariances (lag 0 first) of `n` samples by Levinson and Durbin's recursion; the order by Schwarz's criterion.
pub fn filter_from_autocovariance(covariance: &[f64], n: usize) -> Filter {
    if covariance.len() < 2 || n < 50 || covariance[0] <= 0.0 {
        return Vec::new();
    }
    let samples = n as f64;
    let highest = MAX_ORDER.min(covariance.len() - 1).min(n / 20);
    let mut variance = covariance[0];
    let mut a: Vec<f64> = Vec::new();
    let mut best = (samples * variance.ln(), Vec::new());
    for order in 1..=highest {
        let tail: f64 = a.iter().enumerate().map(|(j, c)| c * covariance[order - 1 - j]).sum();
        let reflection = (covariance[order] - tail) / variance;
        if !reflection.is_finite() || reflection.abs() >= 1.0 {
            break;
        }
        let mut next: Vec<f64> = (0..order - 1).map(|j| a[j] - reflection * a[order - 2 - j]).collect();
        next.push(reflection);
        a = next;
        variance *= 1.0 - reflection * reflection;
        let criterion = samples * variance.ln() + (order as f64) * samples.ln();
        if criterion < best.0 {
            best = (criterion, a.clone());
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

    #[test]
    fn white_noise_needs_no_filter_and_a_first_order_process_gets_its_own() {
        assert!(filter_from_autocovariance(&[1.0, 0.002, -0.001, 0.001], 10_000).is_empty());
        let covariance: Vec<f64> = (0..8).map(|k| 0.8_f64.powi(k)).collect();
        let filter = filter_from_autocovariance(&covariance, 10_000);
        assert_eq!(filter.len(), 1);
        assert!((filter[0] - 0.8).abs() < 1e-12);
        assert!((gain(&filter, 0.0) - 0.04).abs() < 1e-12);
    }
}
