//! Block sums of a channel over the parameters of a question, and what a walk of its zero makes of them.

use std::sync::Arc;

use imufit_model::sensor::{CHANNELS, Sensor};
use nalgebra::{DMatrix, DVector, Vector3};

use crate::evidence::Evidence;
use crate::part::Part;
use crate::whitening;

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
    Vector(Arc<[(usize, Vector3<f64>)]>),
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

/// Block sums of every channel of a log over all `parameters`, among which its own have their places.
pub fn channel_sums(
    log: usize,
    part: &Part,
    weights: &[f64; CHANNELS],
    places: &[usize],
    parameters: usize,
) -> Vec<ChannelSums> {
    let white = &part.white;
    let of = |channel: usize| {
        let active = &white.layout.model.active()[channel];
        let directions = directions(white, channel);
        // Number of samples, and sums of columns and residual.
        let rows: Vec<(f64, DVector<f64>)> = match &directions {
            Some(directions) => directions.iter().map(|told| (told.count, told.sums.clone())).collect(),
            None => (0..white.layout.blocks)
                .map(|b| {
                    // A loud block tells less of its mean.
                    let quiet = 1.0 / part.loudness[channel][b];
                    white.get(b, channel).map_or_else(
                        || (0.0, DVector::zeros(active.len() + 1)),
                        |block| (quiet * block.n as f64, quiet * &block.sum),
                    )
                })
                .collect(),
        };
        let mut sums = DMatrix::zeros(rows.len(), parameters);
        for (k, (_, own)) in rows.iter().enumerate() {
            for (p, value) in active.iter().zip(own.iter()) {
                sums[(k, places[*p])] = *value;
            }
        }
        ChannelSums {
            log,
            channel,
            weight: weights[channel],
            sums,
            right: DVector::from_iterator(rows.len(), rows.iter().map(|(_, own)| own[active.len()])),
            count: DVector::from_iterator(rows.len(), rows.iter().map(|(n, _)| *n)),
            walk: directions.map_or(Walk::Zero, |told| {
                Walk::Vector(told.iter().map(|told| (told.block, told.direction)).collect())
            }),
            most: most(part, weights, channel / 3),
        }
    };
    (0..CHANNELS).filter(|c| weights[*c] > 0.0).map(of).collect()
}

/// Largest variance of a step of a sensor's zero, in units of the noise of a sample. A magnetometer has no zero that wanders far, and what
/// does is a misfit, which the walk would hide.
fn most(part: &Part, weights: &[f64; CHANNELS], sensor: usize) -> f64 {
    let layout = &part.white.layout;
    if sensor != Sensor::Mag.index() || layout.facts.rests {
        return f64::INFINITY;
    }
    (3 * sensor..3 * sensor + 3)
        .map(|c| (FARTHEST * part.floors[c]).powi(2) * weights[c] * whitening::gain(&layout.filters[c], 0.0))
        .filter(|v| v.is_finite() && *v > 0.0)
        .fold(0.0, f64::max)
}

/// What a block tells of a zero that is a vector, along one direction.
struct Told {
    block: usize,
    direction: Vector3<f64>,
    count: f64,
    /// Sums of columns and residual.
    sums: DVector<f64>,
}

/// The directions that the blocks tell of where a channel's rows are projections of a vector; `None` where they are not.
fn directions(white: &Evidence, channel: usize) -> Option<Vec<Told>> {
    let mut found = None;
    for (block, axes) in white
        .of_channel(channel)
        .filter_map(|(b, own)| Some((b, own.axes.as_ref()?)))
    {
        let eigen = axes.square.symmetric_eigen();
        let least = SEEN * eigen.eigenvalues.max();
        let seen = eigen.eigenvalues.iter().enumerate().filter(|(_, v)| **v > least);
        let told = seen.map(|(k, value)| {
            let direction: Vector3<f64> = eigen.eigenvectors.column(k).into_owned();
            Told {
                block,
                direction,
                count: *value,
                sums: axes.sum.tr_mul(&direction),
            }
        });
        found.get_or_insert_with(Vec::new).extend(told);
    }
    found
}

impl ChannelSums {
    /// The same with other sums.
    #[must_use]
    pub fn with_sums(&self, sums: DMatrix<f64>) -> Self {
        Self { sums, ..self.clone() }
    }

    /// The same once some parameters have been given values: what these explain is taken off the residual.
    #[must_use]
    pub fn given(&self, parameters: &[usize], values: &[f64]) -> Self {
        let mut out = self.clone();
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
                    block.bins[covariate].count.iter().map(|n| quiet * n).collect()
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
