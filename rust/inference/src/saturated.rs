//! The residual that no effect of the catalogue explains: where noise figures come from.
//!
//! Noise must not be read off a residual that still holds the missing effect, so all candidates are fitted at once first.

use imufit_fit::evidence::{Evidence, Layout};
use imufit_fit::normal_equations::NormalEquations;
use imufit_model::sensor::CHANNELS;
use nalgebra::{DMatrix, DVector};

use crate::block_equations::{add_channel, sum};
use crate::problem::parameters_of;

/// All effects fitted at once.
#[derive(Clone, Debug)]
pub struct Saturated {
    /// Step of every parameter from the values that the evidence was taken at.
    pub step: DVector<f64>,
    /// Residual variance per channel; NaN without samples.
    pub variance: [f64; CHANNELS],
    /// Variance of each block over that of its channel (channels x blocks): noise that grows with the motion or with time counts for less
    /// where it is loud.
    pub loudness: Vec<Vec<f64>>,
}

/// Samples that the variance of a channel is worth beside a block's own: a block of a few rows is as loud as the others until it shows more.
const COMMON: f64 = 50.0;

/// Variance of each block over that of its channel.
fn loudness(evidence: &Evidence, step: &DVector<f64>, variance: &[f64; CHANNELS]) -> Vec<Vec<f64>> {
    let of = |channel: usize, block: usize| {
        let (square, n) = block_square(evidence, block, channel, step);
        let own = square / variance[channel];
        if own.is_finite() {
            (COMMON + own) / (COMMON + n as f64)
        } else {
            1.0
        }
    };
    (0..CHANNELS)
        .map(|channel| (0..evidence.layout.blocks).map(|block| of(channel, block)).collect())
        .collect()
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
    let sums: Vec<_> = (0..CHANNELS).map(|channel| sum(evidence, channel, |_| 1.0)).collect();
    let place = |parameter: &usize| fitted.iter().position(|j| j == parameter);
    let of_channel = |active: &Vec<usize>| -> Vec<(usize, usize)> {
        let pairs = active.iter().enumerate();
        pairs.filter_map(|(k, j)| place(j).map(|place| (place, k))).collect()
    };
    let chosen: Vec<_> = evidence.layout.model.active().iter().map(of_channel).collect();
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
        let mut total = NormalEquations::zeros(fitted.len());
        for (channel, sum) in sums.iter().enumerate() {
            if let Some((gram, n)) = sum {
                add_channel(&mut total, gram, *n, &chosen[channel], weights[channel]);
            }
        }
        let solved = total.solve(&DVector::zeros(fitted.len()))?.solution;
        for (j, value) in fitted.iter().zip(solved.iter()) {
            step[*j] = *value;
        }
    }
    for (channel, v) in variance.iter_mut().enumerate() {
        let (sum, n) = channel_square(evidence, channel, &step);
        let own = freedom(evidence, channel);
        *v = if n > own + 10 { sum / (n - own) as f64 } else { f64::NAN };
    }
    let loudness = loudness(evidence, &step, &variance);
    Some(Saturated {
        step,
        variance,
        loudness,
    })
}
