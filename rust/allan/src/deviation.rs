//! The overlapping Allan variance.
//!
//! ```text
//! sigma^2(m) = 1/2 mean_k ( y_{k+m}(m) - y_k(m) )^2,    y_k(m) = mean of the m samples from k on
//! ```
//!
//! over every k (IEEE Std 1139; for gyros and accelerometers IEEE Std 952). The means come from prefix sums: one pass for
//! each m, whatever m is. Lost samples (NaN) are left out of the means; a mean of which more than a tenth is lost does
//! not count. Pieces of a log are never joined.

use rayon::prelude::*;

/// Least part of a mean that must be there.
const PRESENT: f64 = 0.9;

/// The variance at one averaging time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Variance {
    /// Square of the Allan deviation; NaN where no two means follow each other.
    pub value: f64,
    /// Differences that were averaged.
    pub terms: usize,
}

/// Running sums of one piece: of the samples less their mean, and of how many there are.
struct Prefix {
    sum: Vec<f64>,
    /// Empty where no sample is lost.
    count: Vec<u32>,
}

impl Prefix {
    fn new(piece: &[f64]) -> Self {
        let there = || piece.iter().filter(|y| y.is_finite());
        let present = there().count();
        let lost = present < piece.len();
        // The sums stay small without the mean, which no difference contains.
        let first = there().next().copied().unwrap_or(0.0);
        let mean = first + there().map(|y| y - first).sum::<f64>() / present.max(1) as f64;
        let mut sum = Vec::with_capacity(piece.len() + 1);
        let mut count = Vec::with_capacity(if lost { piece.len() + 1 } else { 0 });
        let (mut total, mut carry, mut seen) = (0.0_f64, 0.0_f64, 0_u32);
        sum.push(0.0);
        if lost {
            count.push(0);
        }
        for y in piece {
            if y.is_finite() {
                // Compensated (Kahan): hours of samples leave no rounding in the differences.
                let term = (y - mean) - carry;
                let next = total + term;
                carry = (next - total) - term;
                total = next;
                seen = seen.saturating_add(1);
            }
            sum.push(total);
            if lost {
                count.push(seen);
            }
        }
        Self { sum, count }
    }

    /// Sum of the squared differences of neighbouring means over `m` samples, and their number.
    fn squares(&self, m: usize) -> (f64, usize) {
        let n = self.sum.len() - 1;
        if m == 0 || 2 * m > n {
            return (0.0, 0);
        }
        let (start, middle, end) = (&self.sum[..=n - 2 * m], &self.sum[m..=n - m], &self.sum[2 * m..]);
        let sums = start.iter().zip(middle).zip(end);
        let width = m as f64;
        if self.count.is_empty() {
            let total: f64 = sums.map(|((a, b), c)| ((c - b) - (b - a)).powi(2)).sum();
            return (total / (width * width), n + 1 - 2 * m);
        }
        let least = PRESENT * width;
        let counts = self.count[..=n - 2 * m]
            .iter()
            .zip(&self.count[m..=n - m])
            .zip(&self.count[2 * m..]);
        let (mut total, mut terms) = (0.0, 0);
        for (((a, b), c), ((i, j), k)) in sums.zip(counts) {
            let (first, second) = (f64::from(j - i), f64::from(k - j));
            if first >= least && second >= least {
                total += ((c - b) / second - (b - a) / first).powi(2);
                terms += 1;
            }
        }
        (total, terms)
    }
}

/// The overlapping Allan variance of evenly spaced samples at averaging times of `factors` samples each.
///
/// `pieces` are stretches without gap between their samples; NaN is a lost sample.
pub fn allan_variance(pieces: &[&[f64]], factors: &[usize]) -> Vec<Variance> {
    let prefixes: Vec<Prefix> = pieces.iter().map(|piece| Prefix::new(piece)).collect();
    factors
        .par_iter()
        .map(|&m| {
            let (total, terms) = prefixes.iter().fold((0.0, 0), |(total, terms), prefix| {
                let (more, n) = prefix.squares(m);
                (total + more, terms + n)
            });
            let value = if terms > 0 {
                0.5 * total / terms as f64
            } else {
                f64::NAN
            };
            Variance { value, terms }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    fn noise(n: u32) -> Vec<f64> {
        (0..n).map(|k| (f64::from(k) * f64::from(k) * 0.37).sin()).collect()
    }

    fn by_definition(y: &[f64], m: usize) -> f64 {
        let mean = |from: usize| y[from..from + m].iter().sum::<f64>() / m as f64;
        let terms: Vec<f64> = (0..=y.len() - 2 * m).map(|k| (mean(k + m) - mean(k)).powi(2)).collect();
        0.5 * terms.iter().sum::<f64>() / terms.len() as f64
    }

    #[test]
    fn it_is_the_mean_of_all_squared_differences() {
        let plain = noise(500);
        let y: Vec<f64> = plain.iter().map(|x| 1e3 + x).collect();
        for m in [1, 2, 7, 100, 250] {
            let found = allan_variance(&[&y], &[m])[0];
            assert_relative_eq!(found.value, by_definition(&plain, m), max_relative = 1e-9);
            assert_eq!(found.terms, 501 - 2 * m);
        }
        assert!(allan_variance(&[&y], &[251])[0].value.is_nan());
    }

    #[test]
    fn pieces_are_not_joined_and_lost_samples_are_left_out() {
        let y = noise(400);
        let shifted: Vec<f64> = y.iter().map(|x| x + 1e3).collect();
        let [whole, both] = [
            allan_variance(&[&y], &[10])[0],
            allan_variance(&[&y, &shifted], &[10])[0],
        ];
        assert_relative_eq!(whole.value, both.value, max_relative = 1e-9);
        assert_eq!(2 * whole.terms, both.terms);
        let mut holed = vec![0.25; 400];
        for k in (3..400).step_by(20) {
            holed[k] = f64::NAN;
        }
        let found = allan_variance(&[&holed], &[1, 20, 40]);
        assert_eq!(found[0].terms, 399 - 40);
        assert!(found.iter().all(|variance| variance.value == 0.0 && variance.terms > 0));
    }

    #[test]
    fn a_ramp_has_the_variance_of_a_ramp() {
        let ramp: Vec<f64> = (0..1000).map(|k| 0.01 * f64::from(k)).collect();
        for m in [1, 30, 400] {
            let found = allan_variance(&[&ramp], &[m])[0];
            assert_relative_eq!(found.value, 0.5 * (0.01 * m as f64).powi(2), max_relative = 1e-9);
        }
    }
}
