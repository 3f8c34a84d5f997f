//! Block sums of a channel over the parameters of a question, and what a walk of its zero makes of them.

use std::sync::Arc;

use imufit_fit::evidence::Evidence;
use imufit_fit::whitening;
use imufit_model::sensor::{CHANNELS, Sensor};
use nalgebra::{DMatrix, DVector, Vector3};

use crate::part::Part;

/// The zero of a magnetometer wanders by no more than so many noise floors from block to block.
const FARTHEST: f64 = 1.0;
/// Part of the best seen direction of a block from which on another one is seen.
const SEEN: f64 = 1e-4;

/// What the sums of a channel stand for.
#[derive(Clone)]
pub enum Walk {
    /// The sum of a block, whose zero makes a step from block to block; where it is when the log begins is a bias.
    Zero,
    /// Sums along directions within a block, whose rows are projections of a vector: its three zeros each make steps. Block
    /// and direction of each sum.
    Vector(Arc<Vec<(usize, Vector3<f64>)>>),
}

/// Covariance of the means of two blocks of a walk that makes a unit step in the time of a block, and starts with the log.
fn walked(first: usize, second: usize) -> f64 {
    let within = if first == second { 1.0 / 3.0 } else { 0.5 };
    first.min(second) as f64 + within
}

impl Walk {
    /// Covariance of the zeros behind the sums after unit steps.
    pub fn covariance(&self, sums: usize) -> DMatrix<f64> {
        match self {
            Self::Zero => DMatrix::from_fn(sums, sums, walked),
            Self::Vector(directions) => DMatrix::from_fn(sums, sums, |i, j| {
                let ((a, u), (b, v)) = (&directions[i], &directions[j]);
                walked(*a, *b) * u.dot(v)
            }),
        }
    }
}

/// Block sums of one channel of one log over the parameters of a question.
#[derive(Clone)]
pub struct ChannelSums {
    /// Number of the log: each starts with a zero of its own.
    pub log: usize,
    /// Channel index.
    pub channel: usize,
    /// Weight of the channel.
    pub weight: f64,
    /// Sums of each parameter's column (blocks x parameters).
    pub sums: DMatrix<f64>,
    /// Sums of the residual.
    pub right: DVector<f64>,
    /// Number of samples in each block.
    pub count: DVector<f64>,
    /// What its zero does from sum to sum.
    pub walk: Walk,
    /// Largest variance of a step that the zero can make from block to block, in units of the noise of a sample.
    pub most: f64,
}

/// Block sums of every channel of a log over all `parameters`, among which its own have their places. A magnetometer has no zero that wanders far, and what does is a misfit, which the walk would hide.
pub fn channel_sums(
    log: usize,
    part: &Part,
    weights: &[f64; CHANNELS],
    places: &[usize],
    parameters: usize,
) -> Vec<ChannelSums> {
    let (white, floors) = (&part.white, &part.floors);
    let blocks = white.layout.blocks;
    let mut out: Vec<ChannelSums> = Vec::new();
    for channel in (0..CHANNELS).filter(|c| weights[*c] > 0.0) {
        if (0..blocks).any(|b| white.get(b, channel).is_some_and(|block| block.axes.is_some())) {
            out.push(vector_sums(log, white, channel, weights[channel], places, parameters));
            continue;
        }
        let mut sums = DMatrix::zeros(blocks, parameters);
        let (mut right, mut count) = (DVector::zeros(blocks), DVector::zeros(blocks));
        let active = &white.layout.model.active()[channel];
        for b in 0..blocks {
            let Some(block) = white.get(b, channel) else { continue };
            // A loud block tells less of its mean.
            let quiet = 1.0 / part.loudness[channel][b];
            count[b] = quiet * block.n as f64;
            for (k, p) in active.iter().enumerate() {
                sums[(b, places[*p])] = quiet * block.sum[k];
            }
            right[b] = quiet * block.sum[active.len()];
        }
        let sensor = channel / 3;
        let most = if sensor != Sensor::Mag.index() || white.layout.facts.rests {
            f64::INFINITY
        } else {
            (3 * sensor..3 * sensor + 3)
                .map(|c| (FARTHEST * floors[c]).powi(2) * weights[c] * whitening::gain(&white.layout.filters[c], 0.0))
                .filter(|v| v.is_finite() && *v > 0.0)
                .fold(0.0, f64::max)
        };
        out.push(ChannelSums {
            log,
            channel,
            weight: weights[channel],
            sums,
            right,
            count,
            walk: Walk::Zero,
            most,
        });
    }
    out
}

/// The same for a channel whose rows are projections of a vector: sums along the directions that each block tells of.
fn vector_sums(
    log: usize,
    white: &Evidence,
    channel: usize,
    weight: f64,
    places: &[usize],
    parameters: usize,
) -> ChannelSums {
    let active = &white.layout.model.active()[channel];
    let (mut directions, mut count, mut rows, mut right) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for b in 0..white.layout.blocks {
        let Some(axes) = white.get(b, channel).and_then(|block| block.axes.as_ref()) else {
            continue;
        };
        let eigen = axes.square.symmetric_eigen();
        let least = SEEN * eigen.eigenvalues.max();
        for (k, value) in eigen.eigenvalues.iter().enumerate().filter(|(_, v)| **v > least) {
            let direction: Vector3<f64> = eigen.eigenvectors.column(k).into_owned();
            let sums = axes.sum.tr_mul(&direction);
            let mut row = DVector::zeros(parameters);
            for (k, p) in active.iter().enumerate() {
                row[places[*p]] = sums[k];
            }
            rows.push(row.transpose());
            right.push(sums[active.len()]);
            count.push(*value);
            directions.push((b, direction));
        }
    }
    let sums = if rows.is_empty() {
        DMatrix::zeros(0, parameters)
    } else {
        DMatrix::from_rows(&rows)
    };
    let count = DVector::from_vec(count);
    let walk = Walk::Vector(Arc::new(directions.clone()));
    ChannelSums {
        log,
        channel,
        weight,
        sums,
        right: DVector::from_vec(right),
        count,
        walk,
        most: f64::INFINITY,
    }
}

impl ChannelSums {
    /// The same for the parameters `kept`, then for directions in the parameters `others`.
    #[must_use]
    pub fn reduced(&self, kept: &[usize], others: &[usize], directions: &DMatrix<f64>) -> Self {
        let mut sums = DMatrix::zeros(self.sums.nrows(), kept.len() + directions.ncols());
        sums.columns_mut(0, kept.len()).copy_from(&self.columns(kept));
        sums.columns_mut(kept.len(), directions.ncols())
            .copy_from(&(self.columns(others) * directions));
        self.with_sums(sums)
    }

    /// The same with other sums.
    #[must_use]
    pub fn with_sums(&self, sums: DMatrix<f64>) -> Self {
        Self {
            log: self.log,
            channel: self.channel,
            weight: self.weight,
            sums,
            right: self.right.clone(),
            count: self.count.clone(),
            walk: self.walk.clone(),
            most: self.most,
        }
    }

    /// The same once some parameters have been given values: what these explain is taken off the residual.
    #[must_use]
    pub fn given(&self, parameters: &[usize], values: &[f64]) -> Self {
        let mut out = self.with_sums(self.sums.clone());
        out.right -= self.columns(parameters) * DVector::from_column_slice(values);
        out
    }

    /// True if the sums are those of blocks.
    pub const fn of_blocks(&self) -> bool {
        matches!(self.walk, Walk::Zero)
    }

    /// Sums of a column that is constant within each bin of a covariate, over the rows of this channel: `values` has a column
    /// for each of several such columns (bins x columns).
    pub fn binned(&self, part: &Part, covariate: usize, values: &DMatrix<f64>) -> DMatrix<f64> {
        let evidence = &part.white;
        let mut out = DMatrix::zeros(self.sums.nrows(), values.ncols());
        let of_block = |b: usize| evidence.get(b, self.channel);
        for k in 0..out.nrows() {
            let counts: Option<Vec<f64>> = match &self.walk {
                Walk::Zero => of_block(k).map(|block| {
                    let quiet = 1.0 / part.loudness[self.channel][k];
                    block.bin_count[covariate].iter().map(|n| quiet * n).collect()
                }),
                Walk::Vector(directions) => {
                    let (b, direction) = &directions[k];
                    let axes = of_block(*b).and_then(|block| block.axes.as_ref());
                    axes.map(|axes| axes.bin_sum[covariate].iter().map(|v| v.dot(direction)).collect())
                }
            };
            if let Some(counts) = counts {
                let sums = values.tr_mul(&DVector::from_vec(counts));
                out.row_mut(k).copy_from(&sums.transpose());
            }
        }
        out
    }

    /// Sums of some of the parameters already in these sums.
    pub fn columns(&self, chosen: &[usize]) -> DMatrix<f64> {
        self.sums.select_columns(chosen)
    }
}
