//! How sure an overlapping Allan variance is: its equivalent degrees of freedom.
//!
//! `edf sigma_found^2 / sigma^2` is nearly chi-squared with that many degrees of freedom. The number depends on the kind of
//! noise (Howe, Allan and Barnes 1981, Table 2; also NIST Special Publication 1065, section 5.4.1).

/// What dominates at an averaging time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoiseKind {
    /// The integral is white: quantisation of an angle. Slope -1 of the deviation.
    Quantisation,
    /// White readings. Slope -1/2.
    White,
    /// Flicker: bias instability. Slope 0.
    Flicker,
    /// The readings walk. Slope 1/2 and more.
    Walk,
}

/// Equivalent degrees of freedom, at least 1, of the variance of `samples` readings at an averaging time of `m` of them; 0
/// where there is none.
pub fn degrees_of_freedom(kind: NoiseKind, samples: usize, m: usize) -> f64 {
    if m == 0 || 2 * m > samples {
        return 0.0;
    }
    // The formulae count phases, one more than readings.
    let (n, m) = (samples as f64 + 1.0, m as f64);
    let freedom = match kind {
        NoiseKind::Quantisation => (n + 1.0) * (n - 2.0 * m) / (2.0 * (n - m)),
        NoiseKind::White => (3.0 * (n - 1.0) / (2.0 * m) - 2.0 * (n - 2.0) / n) * (4.0 * m * m) / (4.0 * m * m + 5.0),
        NoiseKind::Flicker if m < 2.0 => 2.0 * (n - 2.0) / (2.3 * n - 4.9),
        NoiseKind::Flicker => 5.0 * n * n / (4.0 * m * (n + 3.0 * m)),
        NoiseKind::Walk => {
            let square = (n - 1.0).powi(2) - 3.0 * m * (n - 1.0) + 4.0 * m * m;
            (n - 2.0) / m * square / (n - 3.0).powi(2)
        }
    };
    if freedom.is_finite() { freedom.max(1.0) } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longer_averages_are_less_sure_and_none_is_without_any() {
        for kind in [NoiseKind::White, NoiseKind::Flicker, NoiseKind::Walk] {
            let at = |m| degrees_of_freedom(kind, 10_000, m);
            assert!(at(4) > at(40) && at(40) > at(400), "{kind:?}");
            assert!(at(5000) >= 1.0 && at(5001) == 0.0 && at(0) == 0.0);
        }
        for samples in 2..6 {
            assert!(degrees_of_freedom(NoiseKind::Walk, samples, 1) >= 1.0);
        }
    }
}
