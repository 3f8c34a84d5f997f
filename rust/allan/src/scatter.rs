//! The standard deviation of one sample, without what wanders slowly.

/// Standard deviation about the means of blocks of `rows` samples, with the degrees of freedom that the means take; NaN
/// where no block has two samples. NaN is a lost sample.
pub fn scatter(pieces: &[&[f64]], rows: usize) -> f64 {
    let (mut squares, mut freedom) = (0.0, 0.0);
    for block in pieces.iter().flat_map(|piece| piece.chunks(rows.max(2))) {
        let (mut n, mut mean, mut spread) = (0.0, 0.0, 0.0);
        for y in block.iter().filter(|y| y.is_finite()) {
            n += 1.0;
            let before = y - mean;
            mean += before / n;
            spread += before * (y - mean);
        }
        squares += spread;
        freedom += f64::max(n - 1.0, 0.0);
    }
    (squares / freedom).sqrt()
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn a_slow_step_does_not_count() {
        let y: Vec<f64> = (0..200)
            .map(|k| if k % 2 == 0 { 1.0 } else { -1.0 } + f64::from(k / 100) * 50.0)
            .collect();
        assert_relative_eq!(scatter(&[&y], 100), (200.0_f64 / 198.0).sqrt(), max_relative = 1e-12);
        assert!(scatter(&[&[1.0]], 10).is_nan());
    }
}
