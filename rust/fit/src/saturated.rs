//! The residual that no effect of the catalogue explains: where noise figures come from.
//!
//! Noise must not be read off a residual that still holds the missing effect, so all candidates are fitted at once first.

use imufit_model::sensor::CHANNELS;
use nalgebra::{DMatrix, DVector};

use crate::evidence::Evidence;
use crate::normal_equations::NormalEquations;

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

/// Rounds of fits, each with weights from the residual of the one before.
const ROUNDS: usize = 3;
/// Samples of a channel beyond its parameters below which they tell no variance.
const FEWEST: usize = 10;
/// Samples that the variance of a channel is worth beside a block's own: a block of a few rows is as loud as the others until it shows more.
const COMMON: f64 = 50.0;
/// Eigenvalue of a Gram matrix with ones on its diagonal from which on a direction is told.
const TOLD: f64 = 1e-9;

/// Variance of each channel's residual after a step.
fn variances(evidence: &Evidence, fitted: &[usize], step: &DVector<f64>) -> [f64; CHANNELS] {
    std::array::from_fn(|channel| {
        let (sum, n) = evidence.square(channel, step);
        let own = freedom(evidence, fitted, channel);
        if n > own + FEWEST {
            sum / (n - own) as f64
        } else {
            f64::NAN
        }
    })
}

/// Number of parameters that a channel can tell apart. The rests of a log are too few for most of what they are asked; rows that
/// are many count every parameter.
fn freedom(evidence: &Evidence, fitted: &[usize], channel: usize) -> usize {
    let active = &evidence.layout.model.active()[channel];
    let used: Vec<usize> = (0..active.len()).filter(|k| fitted.contains(&active[*k])).collect();
    let total = evidence.total(channel, |_| 1.0).filter(|_| evidence.layout.facts.rests);
    let Some((gram, _)) = total else { return used.len() };
    let gram = gram.matrix().select_rows(&used).select_columns(&used);
    let scaled = DMatrix::from_fn(used.len(), used.len(), |i, j| {
        let size = (gram[(i, i)] * gram[(j, j)]).sqrt();
        if size > 0.0 { gram[(i, j)] / size } else { 0.0 }
    });
    let told = |values: DVector<f64>| values.iter().filter(|v| **v > TOLD).count();
    if used.is_empty() {
        0
    } else {
        told(scaled.symmetric_eigenvalues())
    }
}

/// Variance of each block over that of its channel.
fn loudness(evidence: &Evidence, step: &DVector<f64>, variance: &[f64; CHANNELS]) -> Vec<Vec<f64>> {
    let of = |channel: usize, (square, n): (f64, usize)| {
        let own = square / variance[channel];
        if own.is_finite() {
            (COMMON + own) / (COMMON + n as f64)
        } else {
            1.0
        }
    };
    let of_channel = |channel: usize| {
        let squares = evidence.squares(channel, step).into_iter();
        squares.map(|block| of(channel, block)).collect()
    };
    (0..CHANNELS).map(of_channel).collect()
}

/// Fits everything, with weights from its own residual. Probes are left out: there are so many of them that they would explain the noise
/// of a few poses.
pub fn fit_all(evidence: &Evidence) -> Option<Saturated> {
    let model = &evidence.layout.model;
    let slots = model.slots().iter().filter(|s| !s.effect.is_probe());
    let fitted: Vec<usize> = slots.flat_map(|s| s.first..s.first + s.parameters.len()).collect();
    let sums: Vec<_> = (0..CHANNELS).map(|channel| evidence.total(channel, |_| 1.0)).collect();
    let place = |parameter: &usize| fitted.iter().position(|j| j == parameter);
    let of_channel = |active: &Vec<usize>| -> Vec<(usize, usize)> {
        let pairs = active.iter().enumerate();
        pairs.filter_map(|(k, j)| place(j).map(|place| (place, k))).collect()
    };
    let chosen: Vec<_> = model.active().iter().map(of_channel).collect();
    let mut step = DVector::zeros(model.parameters());
    for _ in 0..ROUNDS {
        let variance = variances(evidence, &fitted, &step);
        let largest = variance.iter().copied().filter(|v| v.is_finite()).fold(0.0, f64::max);
        let mut total = NormalEquations::zeros(fitted.len());
        for (channel, sum) in sums.iter().enumerate() {
            if let Some((gram, n)) = sum.as_ref().filter(|_| variance[channel].is_finite()) {
                // A noiseless channel must not outweigh the rest beyond what numbers can hold.
                let weight = 1.0 / variance[channel].max(1e-24 * largest).max(f64::MIN_POSITIVE);
                total.add_channel(gram, *n as f64, &chosen[channel], weight);
            }
        }
        let solved = total.solve(&DVector::zeros(fitted.len()))?.solution;
        for (j, value) in fitted.iter().zip(solved.iter()) {
            step[*j] = *value;
        }
    }
    let variance = variances(evidence, &fitted, &step);
    let loudness = loudness(evidence, &step, &variance);
    Some(Saturated {
        step,
        variance,
        loudness,
    })
}
