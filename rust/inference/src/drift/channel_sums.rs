//! Block sums of a channel over the parameters of a question, and what a walk of its zero makes of them.

use std::sync::Arc;

use imufit_fit::evidence::Evidence;
use imufit_fit::normal_equations::NormalEquations;
use imufit_fit::whitening;
use imufit_model::sensor::{CHANNELS, Sensor};
use nalgebra::{Cholesky, DMatrix, DVector, Vector3};

use super::walk::{Strength, Walk, log_determinant, strengths, vector_strengths};
use crate::orthonormal;

/// The zero of a magnetometer wanders by no more than so many noise floors from block to block.
const FARTHEST: f64 = 1.0;
/// Part of the best seen direction of a block from which on another one is seen.
const SEEN: f64 = 1e-4;

/// Block sums of one channel of one log over the parameters of a question.
#[derive(Clone)]
pub struct ChannelSums {
    /// Number of the log: each starts with a zero of its own.
    pub log: usize,
    /// Channel index.
    pub channel: usize,
    /// Weight of the channel.
    pub(super) weight: f64,
    /// Sums of each parameter's column (blocks x parameters).
    pub sums: DMatrix<f64>,
    /// Sums of the residual.
    pub(super) right: DVector<f64>,
    /// Number of samples in each block.
    pub(super) count: DVector<f64>,
    pub(super) walk: Walk,
    pub(super) strengths: Arc<Vec<Strength>>,
    /// False if what is left of it does not tell how strongly the zeros of its sensor wander: the cause asked about moves it as well.
    pub(super) telling: bool,
}

/// Block sums of every channel of a log over all `parameters`, among which its own have their places. `floors` are the noise floors of
/// the channels: a magnetometer has no zero that wanders far, and what does is a misfit, which the walk would hide.
pub fn channel_sums(
    log: usize,
    white: &Evidence,
    floors: &[f64; CHANNELS],
    weights: &[f64; CHANNELS],
    places: &[usize],
    parameters: usize,
) -> Vec<ChannelSums> {
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
            count[b] = block.n as f64;
            for (k, p) in active.iter().enumerate() {
                sums[(b, places[*p])] = block.sum[k];
            }
            right[b] = block.sum[active.len()];
        }
        let sensor = channel / 3;
        // The axes of a sensor wander alike.
        let walk = Walk::of(Sensor::ALL[sensor]);
        let same = out.iter().find(|o| o.channel / 3 == sensor && o.count == count);
        let strengths = if let Some(other) = same {
            other.strengths.clone()
        } else if sensor != Sensor::Mag.index() || white.layout.facts.rests {
            Arc::new(strengths(&count, f64::INFINITY, &walk))
        } else {
            let most = (3 * sensor..3 * sensor + 3)
                .map(|c| (FARTHEST * floors[c]).powi(2) * weights[c] * whitening::gain(&white.layout.filters[c], 0.0))
                .filter(|v| v.is_finite() && *v > 0.0)
                .fold(0.0, f64::max);
            Arc::new(strengths(&count, most, &walk))
        };
        out.push(ChannelSums {
            log,
            channel,
            weight: weights[channel],
            sums,
            right,
            count,
            walk,
            strengths,
            telling: true,
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
        strengths: Arc::new(vector_strengths(&count, &directions, &walk)),
        count,
        walk,
        telling: true,
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
            strengths: self.strengths.clone(),
            telling: self.telling,
        }
    }

    /// The same where only the channel `asked` tells how strongly the zeros of its sensor wander.
    #[must_use]
    pub fn asked_of(mut self, asked: usize) -> Self {
        self.telling = self.channel == asked || self.channel / 3 != asked / 3;
        self
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
        matches!(self.walk, Walk::Zero { .. })
    }

    /// Sums of a column that is constant within each bin of a covariate, over the rows of this channel: `values` has a column
    /// for each of several such columns (bins x columns).
    pub fn binned(&self, evidence: &Evidence, covariate: usize, values: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.sums.nrows(), values.ncols());
        let of_block = |b: usize| evidence.get(b, self.channel);
        for k in 0..out.nrows() {
            let counts: Option<Vec<f64>> = match &self.walk {
                Walk::Zero { .. } => of_block(k).map(|block| block.bin_count[covariate].clone()),
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

    /// Block means of the residual in units of the noise of one sample, and an orthonormal basis of those of the columns, `extra` (blocks
    /// x columns) among them.
    pub fn means(&self, extra: Option<&DMatrix<f64>>) -> (DVector<f64>, DMatrix<f64>) {
        let blocks = self.count.len();
        let mean = |sum: f64, b: usize| if self.count[b] > 0.0 { sum / self.count[b] } else { 0.0 };
        let residual = DVector::from_fn(blocks, |b, _| mean(self.right[b], b) * self.weight.sqrt());
        let used: Vec<usize> = (0..self.sums.ncols())
            .filter(|k| self.sums.column(*k).iter().any(|v| *v != 0.0))
            .collect();
        let mut columns = DMatrix::from_fn(blocks, used.len(), |b, k| mean(self.sums[(b, used[k])], b));
        if let Some(extra) = extra {
            let at = columns.ncols();
            columns = columns.insert_columns(at, extra.ncols(), 0.0);
            columns.columns_mut(at, extra.ncols()).copy_from(extra);
        }
        for mut column in columns.column_iter_mut() {
            let norm = column.norm();
            column /= norm.max(f64::MIN_POSITIVE);
        }
        let basis = orthonormal::basis(columns, 1e-6, blocks / 2);
        (residual, basis)
    }

    /// Every strength of the walk; none where there are too few blocks for a walk.
    pub fn strengths(&self) -> &[Strength] {
        &self.strengths
    }

    /// Number of sums that have samples.
    pub fn filled(&self) -> f64 {
        self.count.iter().filter(|n| **n > 0.0).count().max(1) as f64
    }

    /// Sum of squares of the residual that the basis leaves, for one strength, and the determinant of the basis' information.
    fn left(strength: &Strength, residual: &DVector<f64>, basis: &DMatrix<f64>) -> Option<(f64, f64)> {
        let plain = residual.dot(&(&strength.precision * residual));
        if basis.ncols() == 0 {
            return Some((plain, 0.0));
        }
        let x = &strength.precision * basis;
        let inner = Cholesky::new(basis.tr_mul(&x))?;
        let right = x.tr_mul(residual);
        Some((plain - right.dot(&inner.solve(&right)), log_determinant(&inner)))
    }

    /// Restricted log likelihoods of every strength, whatever the question's parameters.
    pub(super) fn likelihoods(&self) -> Vec<f64> {
        let (residual, basis) = self.means(None);
        let of = |s: &Strength| {
            Self::left(s, &residual, &basis).map_or(f64::NEG_INFINITY, |(square, information)| {
                -0.5 * (s.log_determinant + square + information)
            })
        };
        self.strengths.iter().map(of).collect()
    }

    /// Covariance that a walk of one strength gives to the sums over the parameters' columns.
    pub(super) fn spread(&self, strength: usize) -> DMatrix<f64> {
        let kappa = self.weight * self.strengths[strength].kappa;
        let steps = self.walk.covariance(self.sums.nrows());
        self.sums.tr_mul(&(steps * &self.sums)) * kappa
    }

    /// Takes the wandering mean of one strength out of equations over the same parameters.
    pub(super) fn take_out(&self, strength: usize, equations: &mut NormalEquations) {
        let smoother = &self.strengths[strength].smoother;
        let smoothed = smoother * &self.sums;
        let right = smoother * &self.right;
        equations.gram.gemm_tr(-self.weight, &self.sums, &smoothed, 1.0);
        equations.right.gemv_tr(-self.weight, &self.sums, &right, 1.0);
        equations.square -= self.weight * self.right.dot(&right);
    }
}
