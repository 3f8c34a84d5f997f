//! The residual that no effect of the catalogue explains: where noise figures come from.
//!
//! Noise must not be read off a residual that still holds the missing effect, so all candidates are fitted at once first.

use imufit_fit::evidence::{Evidence, Layout};
use imufit_fit::normal_equations::NormalEquations;
use imufit_model::sensor::CHANNELS;
use nalgebra::{DMatrix, DVector};

use crate::screening::parameters_of;

/// All effects fitted at once.
#[derive(Clone, Debug)]
pub struct Saturated {
    /// Step of every parameter from the values that the evidence was taken at.
    pub step: DVector<f64>,
    /// Residual variance per channel; NaN without samples.
    pub variance: [f64; CHANNELS],
}

/// Sum of squared residuals and number of samples of one channel at a parameter step.
pub fn channel_square(evidence: &Evidence, channel: usize, step: &DVector<f64>) -> (f64, usize) {
    let (mut sum, mut n) = (0.0, 0);
    for block in 0..evidence.layout.blocks {
        let (s, count) = block_square(evidence, block, channel, step);
        sum += s;
        n += count;
    }
    (sum, n)
}

/// The same for one block.
pub fn block_square(evidence: &Evidence, block: usize, channel: usize, step: &DVector<f64>) -> (f64, usize) {
    let Some(b) = evidence.get(block, channel) else {
        return (0.0, 0);
    };
    let v = contrast(&evidence.layout, channel, step);
    ((&b.gram * &v).dot(&v).max(0.0), b.n)
}

/// The vector that turns `[columns | residual]` into the residual after a step.
pub fn contrast(layout: &Layout, channel: usize, step: &DVector<f64>) -> DVector<f64> {
    let active = &layout.model.active()[channel];
    let mut v: Vec<f64> = active.iter().map(|p| -step[*p]).collect();
    v.push(1.0);
    DVector::from_vec(v)
}

/// Equations of one block over all parameters, each channel weighted.
pub fn assemble(evidence: &Evidence, block: usize, weights: &[f64; CHANNELS]) -> NormalEquations {
    let mut out = NormalEquations::zeros(evidence.layout.model.parameters());
    for channel in 0..CHANNELS {
        let weight = weights[channel];
        let Some(b) = evidence.get(block, channel) else {
            continue;
        };
        if !(weight > 0.0 && weight.is_finite()) {
            continue;
        }
        let active = &evidence.layout.model.active()[channel];
        let last = active.len();
        for (i, p) in active.iter().enumerate() {
            for (j, q) in active.iter().enumerate() {
                out.gram[(*p, *q)] += weight * b.gram[(i, j)];
            }
            out.right[*p] += weight * b.gram[(i, last)];
        }
        out.square += weight * b.gram[(last, last)];
        out.n += b.n as f64;
    }
    out
}

/// Mean square of the residual of a block in the channel where it is largest.
pub fn largest_square(evidence: &Evidence, block: usize, weights: &[f64; CHANNELS]) -> f64 {
    let of_channel = |channel: usize| {
        let square = evidence.mean_square(block, channel)?;
        (weights[channel] > 0.0).then(|| weights[channel] * square)
    };
    (0..CHANNELS).filter_map(of_channel).fold(0.0, f64::max)
}

/// Number of parameters that a channel can tell apart. The rests of a log are too few for most of what they are asked; rows that
/// are many count every parameter.
fn freedom(evidence: &Evidence, channel: usize) -> usize {
    let active = &evidence.layout.model.active()[channel];
    let fitted = fitted(evidence);
    let used: Vec<usize> = (0..active.len()).filter(|k| fitted.contains(&active[*k])).collect();
    let own = used.len();
    if own == 0 || !evidence.layout.facts.rests {
        return own;
    }
    let mut gram = DMatrix::zeros(own, own);
    for block in (0..evidence.layout.blocks).filter_map(|b| evidence.get(b, channel)) {
        gram += block.gram.select_rows(&used).select_columns(&used);
    }
    let size: Vec<f64> = (0..own).map(|j| gram[(j, j)].sqrt()).collect();
    let scaled = DMatrix::from_fn(own, own, |i, j| {
        let size = size[i] * size[j];
        if size > 0.0 { gram[(i, j)] / size } else { 0.0 }
    });
    let values = scaled.symmetric_eigenvalues();
    values.iter().filter(|v| **v > TOLD).count()
}

/// Eigenvalue of a Gram matrix with ones on its diagonal from which on a direction is told.
const TOLD: f64 = 1e-9;

/// Parameters of all effects. Probes are left out: there are so many of them that they would explain the noise of a few poses.
fn fitted(evidence: &Evidence) -> Vec<usize> {
    parameters_of(evidence.layout.model.slots().iter().filter(|s| !s.effect.is_probe()))
}

/// Fits everything, with weights from its own residual.
pub fn fit_all(evidence: &Evidence) -> Option<Saturated> {
    let p = evidence.layout.model.parameters();
    let fitted = fitted(evidence);
    let mut step = DVector::zeros(p);
    let mut variance = [f64::NAN; CHANNELS];
    for _ in 0..3 {
        for (channel, v) in variance.iter_mut().enumerate() {
            let (sum, n) = channel_square(evidence, channel, &step);
            let own = freedom(evidence, channel);
            *v = if n > own + 10 { sum / (n - own) as f64 } else { f64::NAN };
        }
        let largest = variance.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
        // A noiseless channel must not outweigh the rest beyond what numbers can hold.
        let weights = variance.map(|v| {
            if v.is_finite() {
                1.0 / v.max(1e-24 * largest).max(f64::MIN_POSITIVE)
            } else {
                0.0
            }
        });
        let mut total = NormalEquations::zeros(p);
        for block in 0..evidence.layout.blocks {
            total.add(&assemble(evidence, block, &weights), 1.0);
        }
        let solved = total.selected(&fitted).solve(&DVector::zeros(fitted.len()))?.solution;
        for (j, value) in fitted.iter().zip(solved.iter()) {
            step[*j] = *value;
        }
    }
    for (channel, v) in variance.iter_mut().enumerate() {
        let (sum, n) = channel_square(evidence, channel, &step);
        let own = freedom(evidence, channel);
        *v = if n > own + 10 { sum / (n - own) as f64 } else { f64::NAN };
    }
    Some(Saturated { step, variance })
}
