//! Steps of a digitised reading, and how far they can shift a mean.

/// The step of a digitised reading; `None` if the values lie on no common grid.
///
/// The values may carry rounding of their own (single precision), so differences need to be whole multiples of the
/// smallest one only within 2 %.
pub fn step(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sorted: Vec<f64> = values.filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let largest = sorted.last()?.abs().max(sorted.first()?.abs());
    let differences: Vec<f64> = sorted
        .windows(2)
        .map(|w| w[1] - w[0])
        .filter(|d| *d > 1e-6 * largest)
        .collect();
    let smallest = differences.iter().copied().fold(f64::INFINITY, f64::min);
    if differences.is_empty() || differences.len() * 2 > sorted.len() {
        return None;
    }
    let whole = |d: f64| {
        let multiple = d / smallest;
        (multiple - multiple.round()).abs() < 0.02 * multiple.max(1.0)
    };
    let fitting = differences.iter().filter(|d| whole(**d)).count();
    (fitting as f64 >= 0.95 * differences.len() as f64).then_some(smallest)
}

/// Variance that rounding to `step` adds to the mean of readings with the standard deviation `noise`.
///
/// Noise dithers: the mean's error goes like sin(2 pi mean / step) with an amplitude of step / pi exp(-2 pi^2 noise^2 /
/// step^2) (first harmonic; Widrow and Kollar, Quantization Noise, ch. 9); without noise it is step^2 / 12.
pub fn variance_of_mean(step: f64, noise: f64) -> f64 {
    // Noise as measured contains the rounding's own.
    let own = (noise * noise - step * step / 12.0).max(0.0);
    let amplitude = step / std::f64::consts::PI * (-2.0 * std::f64::consts::PI.powi(2) * own / (step * step)).exp();
    (0.5 * amplitude * amplitude).min(step * step / 12.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_of_counts_is_found_and_of_real_numbers_it_is_not() {
        let lsb = 9.80665 / 16384.0;
        let counts = (0..500).map(|i| f64::from((f64::from((i * 37) % 91) * lsb) as f32));
        let found = step(counts).expect("a step");
        assert!((found / lsb - 1.0).abs() < 0.01);
        assert_eq!(step((0..500).map(|i| f64::from(i * i).sin())), None);
    }

    #[test]
    fn noise_of_half_a_step_dithers_nearly_all_of_it_away() {
        assert!((variance_of_mean(1.0, 0.0).sqrt() - 1.0 / 12.0_f64.sqrt()).abs() < 0.07);
        assert!(variance_of_mean(1.0, 0.6).sqrt() < 0.01);
    }
}
