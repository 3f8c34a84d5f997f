//! How wide the local polynomial through the reference may be: chosen from the reference alone.
//!
//! Widening averages more reference noise away until the polynomial no longer follows the motion. Two neighbouring
//! widths must then differ by more than their noise explains (the rule of Lepski 1991). The noise
//! itself comes from residuals of the narrowest fits, which any motion below a few hertz leaves untouched.

use crate::reference::LocalReference;
use crate::smoothing::{NARROWEST, Smoothing};
use crate::window::Window;

/// The widths tried, narrowest first.
pub const WIDTHS: [Smoothing; 10] = [
    NARROWEST,
    Smoothing { degree: 8, half_width: 6 },
    Smoothing { degree: 6, half_width: 6 },
    Smoothing { degree: 6, half_width: 8 },
    Smoothing { degree: 6, half_width: 11 },
    Smoothing { degree: 6, half_width: 15 },
    Smoothing { degree: 6, half_width: 20 },
    Smoothing { degree: 6, half_width: 27 },
    Smoothing { degree: 6, half_width: 36 },
    Smoothing { degree: 6, half_width: 48 },
];

const NOISE_FIT: Smoothing = Smoothing { degree: 8, half_width: 5 };

/// Two widths agree if the mean square of their difference is at most this much above what noise explains.
const TOLERANCE: f64 = 1.1;

/// Sums over sampled rows; additive over windows.
#[derive(Clone, Debug)]
pub struct Bandwidth {
    of_attitude: bool,
    order: usize,
    noise_sum: f64,
    noise_freedom: usize,
    difference: [f64; WIDTHS.len()],
    gain: [f64; WIDTHS.len()],
    count: [usize; WIDTHS.len()],
    spacing: Option<f64>,
}

impl Bandwidth {
    /// For the first derivative of the attitude.
    pub fn of_attitude() -> Self {
        Self::new(true, 1)
    }

    /// For the second derivative of the position.
    pub fn of_position() -> Self {
        Self::new(false, 2)
    }

    fn new(of_attitude: bool, order: usize) -> Self {
        let zero = [0.0; WIDTHS.len()];
        Self { of_attitude, order, noise_sum: 0.0, noise_freedom: 0, difference: zero, gain: zero, count: [0; WIDTHS.len()], spacing: None }
    }

    /// Adds the rows given (indices into the window).
    pub fn add(&mut self, window: &Window, rows: impl Iterator<Item = usize>) {
        let reference =
            if self.of_attitude { LocalReference::attitude(window, None) } else { LocalReference::position(window, None) };
        let Some(mut reference) = reference else { return };
        if self.spacing.is_none() {
            self.spacing = Some(reference.spacing()).filter(|s| *s > 0.0);
        }
        for row in rows {
            let at = window.t[row];
            if let Some((fit, values)) = reference.local_fit(at, NOISE_FIT, self.of_attitude) {
                let (sum, freedom) = fit.residual(&values);
                self.noise_sum += sum;
                self.noise_freedom += freedom;
            }
            let mut last: Option<(usize, Vec<f64>, [f64; 3])> = None;
            for (k, width) in WIDTHS.iter().enumerate() {
                let Some((fit, values)) = reference.local_fit(at, *width, self.of_attitude) else { break };
                let weights = fit.weights()[self.order].clone();
                let mut value = [0.0; 3];
                for (w, v) in weights.iter().zip(&values) {
                    for axis in 0..3 {
                        value[axis] += w * v[axis];
                    }
                }
                if let Some((half, narrow, before)) = &last {
                    let margin = width.half_width - half;
                    let gain: f64 = weights
                        .iter()
                        .enumerate()
                        .map(|(j, w)| {
                            let inner = j.checked_sub(margin).and_then(|j| narrow.get(j)).unwrap_or(&0.0);
                            (w - inner).powi(2)
                        })
                        .sum();
                    self.gain[k] += 3.0 * gain;
                    self.difference[k] += (0..3).map(|a| (value[a] - before[a]).powi(2)).sum::<f64>();
                    self.count[k] += 1;
                }
                last = Some((width.half_width, weights, value));
            }
        }
    }

    /// Median time between reference samples, s, where the log begins.
    pub fn spacing(&self) -> Option<f64> {
        self.spacing
    }

    /// White noise of the reference, per component: rad of attitude or m of position.
    pub fn noise(&self) -> f64 {
        (self.noise_sum / self.noise_freedom.max(1) as f64).sqrt()
    }

    /// Mean square difference of each width to the next narrower one, over what noise explains.
    pub fn excess(&self) -> Vec<f64> {
        let variance = self.noise().powi(2);
        (1..WIDTHS.len()).map(|k| self.difference[k] / (variance * self.gain[k]).max(f64::MIN_POSITIVE)).collect()
    }

    /// The width to use: one narrower than the widest that still agrees with its neighbour.
    pub fn choose(&self) -> Smoothing {
        let rows = self.count[1];
        let agreeing = self
            .excess()
            .iter()
            .zip(&self.count[1..])
            .take_while(|(excess, count)| **excess <= TOLERANCE && 2 * **count > rows)
            .count();
        WIDTHS[if agreeing == WIDTHS.len() - 1 { agreeing } else { agreeing.saturating_sub(1) }]
    }
}
