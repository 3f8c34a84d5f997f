//! Wandering zeros: a random walk of each channel's bias from block to block.
//!
//! A gyroscope's zero wanders more slowly than any whitening filter of affordable length can see. Whatever varies as slowly (a bias,
//! a temperature, an attitude that hardly changes) would then look significant. For each question the strength of the walk
//! is judged by the restricted likelihood of block means of the residual that the question's own parameters leave, and taken
//! into account by generalised least squares.

use std::sync::Arc;

use imufit_fit::evidence::Evidence;
use imufit_fit::normal_equations::NormalEquations;
use imufit_fit::whitening;
use imufit_model::sensor::{CHANNELS, Sensor};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};

use crate::orthonormal;

/// Walk variances per block tried, in units of a block mean's variance.
const GRID: [f64; 18] = [
    0.0, 3e-4, 1e-3, 2e-3, 4e-3, 8e-3, 0.016, 0.032, 0.064, 0.128, 0.256, 0.5, 1.0, 2.0, 4.0, 10.0, 40.0, 200.0,
];
/// The zero of a magnetometer wanders by no more than so many noise floors from block to block.
const FARTHEST: f64 = 1.0;
/// A zero has wandered before the log begins, for so many blocks: where it wanders visibly, an offset of the like is no bias.
const BEFORE: f64 = 3.0;
/// Fewer blocks than this cannot show a walk.
const MIN_BLOCKS: usize = 8;

/// One strength of the walk for blocks of given sample counts.
pub struct Strength {
    kappa: f64,
    /// Inverse of the covariance of block means in units of the noise of one sample.
    pub precision: DMatrix<f64>,
    /// ln det of that covariance.
    pub log_determinant: f64,
    /// (R^-1 / kappa + D)^-1 with R the covariance of a unit random walk and D the samples of each block.
    smoother: DMatrix<f64>,
}

/// What the sums of a channel stand for.
#[derive(Clone)]
enum Walk {
    /// The sum of a block, whose zero makes a step from block to block.
    Zero,
    /// Sums along directions within a block, whose rows are projections of a vector: its three zeros each make steps. Block
    /// and direction of each sum.
    Vector(Arc<Vec<(usize, Vector3<f64>)>>),
}

/// Covariance of the means of two blocks of a walk that makes a unit step in the time of a block.
fn walked(first: usize, second: usize) -> f64 {
    let within = if first == second { 1.0 / 3.0 } else { 0.5 };
    BEFORE + first.min(second) as f64 + within
}

impl Walk {
    /// Covariance of the zeros behind the sums after unit steps.
    fn covariance(&self, sums: usize) -> DMatrix<f64> {
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
    weight: f64,
    /// Sums of each parameter's column (blocks x parameters).
    pub sums: DMatrix<f64>,
    /// Sums of the residual.
    right: DVector<f64>,
    /// Number of samples in each block.
    count: DVector<f64>,
    walk: Walk,
    strengths: Arc<Vec<Strength>>,
    /// False if what is left of it does not tell how strongly the zeros of its sensor wander: the cause asked about moves it as well.
    telling: bool,
}

/// ln det of a factorised matrix.
fn log_determinant(factor: &Cholesky<f64, Dyn>) -> f64 {
    factor.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum()
}

/// Every strength of the walk of a vector for sums with these counts.
fn vector_strengths(count: &DVector<f64>, directions: &[(usize, Vector3<f64>)], walk: &Walk) -> Vec<Strength> {
    let mut blocks: Vec<usize> = directions.iter().map(|d| d.0).collect();
    blocks.dedup();
    if blocks.len() < MIN_BLOCKS {
        return Vec::new();
    }
    let unit = count.len() as f64 / count.sum();
    let steps = walk.covariance(count.len());
    let of = |step: &f64| {
        let kappa = step * unit;
        let prior = &steps * kappa;
        let covariance = Cholesky::new(&prior + DMatrix::from_diagonal(&count.map(|n| 1.0 / n)))?;
        Some(Strength {
            kappa,
            smoother: &prior - &prior * covariance.solve(&prior),
            log_determinant: log_determinant(&covariance),
            precision: covariance.inverse(),
        })
    };
    GRID.iter().filter_map(of).collect()
}

/// Every strength of the walk for blocks with these sample counts, up to the variance of a step `most`.
fn strengths(count: &DVector<f64>, most: f64) -> Vec<Strength> {
    let blocks = count.len();
    let filled = count.iter().filter(|n| **n > 0.0).count();
    if filled < MIN_BLOCKS {
        return Vec::new();
    }
    let unit = filled as f64 / count.sum();
    let steps = Walk::Zero.covariance(blocks);
    GRID.iter()
        .map(|step| step * unit)
        .filter(|kappa| *kappa <= most)
        .filter_map(|kappa| {
            // A block without samples has a mean of no weight.
            let noise = |b: usize| if count[b] > 0.0 { 1.0 / count[b] } else { 1e6 * unit };
            let prior = &steps * kappa;
            let covariance =
                Cholesky::new(&prior + DMatrix::from_diagonal(&DVector::from_fn(blocks, |b, _| noise(b))))?;
            // What the sums tell of each mean, and what the walk does.
            let told = DMatrix::identity(blocks, blocks) + DMatrix::from_diagonal(count) * &prior;
            let smoother = &prior * told.try_inverse()?;
            Some(Strength {
                kappa,
                log_determinant: log_determinant(&covariance),
                precision: covariance.inverse(),
                smoother,
            })
        })
        .collect()
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
        let same = out.iter().find(|o| o.channel / 3 == sensor && o.count == count);
        let strengths = if let Some(other) = same {
            other.strengths.clone()
        } else if sensor != Sensor::Mag.index() || white.layout.facts.rests {
            Arc::new(strengths(&count, f64::INFINITY))
        } else {
            let most = (3 * sensor..3 * sensor + 3)
                .map(|c| (FARTHEST * floors[c]).powi(2) * weights[c] * whitening::gain(&white.layout.filters[c], 0.0))
                .filter(|v| v.is_finite() && *v > 0.0)
                .fold(0.0, f64::max);
            Arc::new(strengths(&count, most))
        };
        out.push(ChannelSums {
            log,
            channel,
            weight: weights[channel],
            sums,
            right,
            count,
            walk: Walk::Zero,
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

/// Part of the best seen direction of a block from which on another one is seen.
const SEEN: f64 = 1e-4;

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
        matches!(self.walk, Walk::Zero)
    }

    /// Sums of a column that is constant within each bin of a covariate, over the rows of this channel: `values` has a column
    /// for each of several such columns (bins x columns).
    pub fn binned(&self, evidence: &Evidence, covariate: usize, values: &DMatrix<f64>) -> DMatrix<f64> {
        let mut out = DMatrix::zeros(self.sums.nrows(), values.ncols());
        let of_block = |b: usize| evidence.get(b, self.channel);
        for k in 0..out.nrows() {
            let counts: Option<Vec<f64>> = match &self.walk {
                Walk::Zero => of_block(k).map(|block| block.bin_count[covariate].clone()),
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
    fn likelihoods(&self) -> Vec<f64> {
        let (residual, basis) = self.means(None);
        let of = |s: &Strength| {
            Self::left(s, &residual, &basis).map_or(f64::NEG_INFINITY, |(square, information)| {
                -0.5 * (s.log_determinant + square + information)
            })
        };
        self.strengths.iter().map(of).collect()
    }

    /// Covariance that a walk of one strength, from zero at the start, gives to the sums over the parameters' columns.
    fn spread(&self, strength: usize) -> DMatrix<f64> {
        let kappa = self.weight * self.strengths[strength].kappa;
        if let Walk::Vector(_) = self.walk {
            let steps = self.walk.covariance(self.sums.nrows());
            return self.sums.tr_mul(&(steps * &self.sums)) * kappa;
        }
        // A walk is the sum of its steps, and a step is seen by all blocks from its own on.
        let mut later = self.sums.clone();
        for b in (0..later.nrows().saturating_sub(1)).rev() {
            let next = later.row(b + 1).into_owned();
            let mut row = later.row_mut(b);
            row += next;
        }
        if let Some(first) = later
            .nrows()
            .checked_sub(1)
            .map(|_| later.row(0) * (1.0 + BEFORE).sqrt())
        {
            later.row_mut(0).copy_from(&first);
        }
        later.tr_mul(&later) * kappa
    }

    /// Takes the wandering mean of one strength out of equations over the same parameters.
    fn take_out(&self, strength: usize, equations: &mut NormalEquations) {
        let smoother = &self.strengths[strength].smoother;
        let smoothed = smoother * &self.sums;
        let right = smoother * &self.right;
        equations.gram.gemm_tr(-self.weight, &self.sums, &smoothed, 1.0);
        equations.right.gemv_tr(-self.weight, &self.sums, &right, 1.0);
        equations.square -= self.weight * self.right.dot(&right);
    }

    /// What steady changes within the blocks say of the parameters, judged by how block means change from block to block: a walk goes on
    /// within the blocks, so that these say nothing that the means have not said. `None` where sums are along directions.
    fn steady(&self) -> Option<NormalEquations> {
        if !self.of_blocks() {
            return None;
        }
        let filled: Vec<usize> = (0..self.count.len()).filter(|b| self.count[*b] > 0.0).collect();
        let mut out = NormalEquations::zeros(self.sums.ncols());
        for (k, b) in filled.iter().enumerate() {
            let (before, after) = (filled[k.saturating_sub(1)], filled[(k + 1).min(filled.len() - 1)]);
            let apart = after.saturating_sub(before).max(1) as f64;
            let change =
                (self.sums.row(after) / self.count[after] - self.sums.row(before) / self.count[before]) / apart;
            let right = (self.right[after] / self.count[after] - self.right[before] / self.count[before]) / apart;
            // Sum of squares of n values that rise evenly by one.
            let squares = self.weight * self.count[*b] / 12.0;
            out.gram.gemm_tr(squares, &change, &change, 1.0);
            out.right.axpy(squares * right, &change.transpose(), 1.0);
            out.square += squares * right * right;
        }
        Some(out)
    }

    /// What the means of the blocks say of the parameters.
    fn of_means(&self) -> NormalEquations {
        let mut out = NormalEquations::zeros(self.sums.ncols());
        let weights = self.count.map(|n| if n > 0.0 { self.weight / n } else { 0.0 });
        let weighted = DMatrix::from_diagonal(&weights) * &self.sums;
        out.gram.gemm_tr(1.0, &weighted, &self.sums, 1.0);
        out.right.gemv_tr(1.0, &weighted, &self.right, 1.0);
        out
    }
}

/// Equations without what steady changes within the blocks say of the parameters.
fn without_steady(channels: &[ChannelSums], equations: &NormalEquations) -> NormalEquations {
    let mut means = NormalEquations::zeros(equations.right.len());
    let mut within = equations.clone();
    for channel in channels {
        if let Some(steady) = channel.steady() {
            let of_means = channel.of_means();
            within.add(&of_means, -1.0);
            within.add(&steady, -1.0);
            means.add(&of_means, 1.0);
        }
    }
    // Means tell of changes within blocks only about as much: what seems less than nothing is nothing.
    let scale = equations
        .gram
        .diagonal()
        .map(|g| if g > 0.0 { 1.0 / g.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
        within.gram[(i, j)] * scale[i] * scale[j]
    });
    let eigen = scaled.symmetric_eigen();
    let kept: Vec<usize> = (0..scale.len()).filter(|k| eigen.eigenvalues[*k] > 0.0).collect();
    let vectors = eigen.eigenvectors.select_columns(&kept);
    let values = eigen.eigenvalues.select_rows(&kept);
    let back = scale.map(|s| if s > 0.0 { 1.0 / s } else { 0.0 });
    let half = DMatrix::from_diagonal(&back) * &vectors;
    let mut out = equations.clone();
    out.gram = &half * DMatrix::from_diagonal(&values) * half.transpose() + means.gram;
    out.right = &half * vectors.tr_mul(&scale.component_mul(&within.right)) + means.right;
    out
}

/// How strongly a sensor's zeros wander: the channels concerned and how probable each strength is.
struct Wandering<'a> {
    channels: Vec<&'a ChannelSums>,
    probabilities: Vec<f64>,
}

impl Wandering<'_> {
    /// The most probable strength.
    fn likeliest(&self) -> usize {
        let p = &self.probabilities;
        (0..p.len()).max_by(|a, b| p[*a].total_cmp(&p[*b])).unwrap_or(0)
    }

    /// The least strength that is exceeded with at most this probability.
    fn exceeded(&self, probability: f64) -> usize {
        let mut above: f64 = self.probabilities.iter().sum();
        let position = self.probabilities.iter().position(|p| {
            above -= p;
            above <= probability
        });
        position.unwrap_or(self.probabilities.len().saturating_sub(1))
    }

    /// True if the zeros can wander at all.
    fn any(&self, strength: usize) -> bool {
        self.channels.first().is_some_and(|c| c.strengths[strength].kappa > 0.0)
    }
}

/// How strongly the zeros of each sensor wander in each log. Before the log is seen they are as likely not to wander as to do so, and every
/// strength of the grid is as good.
fn wandering(channels: &[ChannelSums]) -> Vec<Wandering<'_>> {
    let mut found = Vec::new();
    let logs = channels.iter().map(|c| c.log + 1).max().unwrap_or(0);
    for (log, sensor) in (0..logs).flat_map(|log| (0..3).map(move |sensor| (log, sensor))) {
        let own: Vec<&ChannelSums> = channels
            .iter()
            .filter(|c| c.log == log && c.channel / 3 == sensor && !c.strengths.is_empty())
            .collect();
        let Some(first) = own.first() else { continue };
        let strengths = first.strengths.len();
        let mut total = vec![0.0; strengths];
        for channel in own.iter().filter(|c| c.telling && c.strengths.len() == strengths) {
            for (t, l) in total.iter_mut().zip(channel.likelihoods()) {
                *t += l;
            }
        }
        if first.strengths[0].kappa == 0.0 {
            total[0] += (strengths.max(2) as f64 - 1.0).ln();
        }
        let most = total.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = total.iter().map(|l| (l - most).exp()).collect();
        let sum: f64 = weights.iter().sum();
        found.push(Wandering {
            channels: own,
            probabilities: weights.iter().map(|w| w / sum).collect(),
        });
    }
    found
}

/// The strengths that a log leaves possible are gone through in steps of the probability with which the walk is stronger: each step leaves
/// this part of it.
const STEP: f64 = 0.6;
/// Walks stronger than those of this probability are left out: no p-value that decides anything depends on them.
const IMPROBABLE: f64 = 1e-6;

/// Probabilities with which a strength of the walk is exceeded, and the weight of the strengths before each.
fn levels() -> impl Iterator<Item = (f64, f64)> {
    let above = std::iter::successors(Some(1.0), |p| Some(p * STEP));
    above.take_while(|p| *p > IMPROBABLE).map(|p| (p * STEP, p - p * STEP))
}

/// The equations of a question with wandering zeros taken out, for strengths from the middle of what the log leaves possible to
/// the far end, each with its weight. Empty if no zero wanders in a way that puts the answer in doubt.
///
/// A log that does not tell how strong the walk is may hide a strong one; what varies as slowly as the walk must not gain from that.
/// The offset of a magnetometer is iron, which does not wander; the field does, from place to place, and counts for less where it does.
pub fn without(channels: &[ChannelSums], equations: &NormalEquations) -> Vec<(f64, NormalEquations)> {
    let sensors = wandering(channels);
    let steady_taken = without_steady(channels, equations);
    let inertial = |w: &Wandering| w.channels.iter().any(|c| c.channel / 3 != Sensor::Mag.index());
    let mut out: Vec<(f64, NormalEquations)> = Vec::new();
    let mut before: Option<Vec<usize>> = None;
    for (probability, weight) in levels() {
        let strengths: Vec<usize> = sensors.iter().map(|w| w.exceeded(probability)).collect();
        if before.as_ref() == Some(&strengths) {
            if let Some(last) = out.last_mut() {
                last.0 += weight;
            }
            continue;
        }
        let mut reduced = steady_taken.clone();
        for (sensor, strength) in sensors.iter().zip(&strengths).filter(|(w, s)| w.any(**s)) {
            for channel in &sensor.channels {
                channel.take_out(*strength, &mut reduced);
            }
        }
        before = Some(strengths);
        out.push((weight, reduced));
    }
    let doubtful = sensors.iter().any(|w| inertial(w) && w.any(w.exceeded(IMPROBABLE)));
    if doubtful { out } else { Vec::new() }
}

/// What wandering zeros add to the covariance of `X^T y` of equations over the same parameters.
pub fn spread(channels: &[ChannelSums], parameters: usize) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(parameters, parameters);
    for sensor in wandering(channels) {
        let strength = sensor.likeliest();
        for channel in sensor.channels.iter().filter(|_| sensor.any(strength)) {
            sum += channel.spread(strength);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_walk_is_told_from_white_block_means() {
        let mut state = 12345_u64;
        let mut normal = || {
            // Sum of twelve uniforms: good enough here, and without a dependency.
            let mut uniform = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 33) as f64 / f64::from(1_u32 << 31)
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        };
        let count = DVector::from_element(48, 100.0);
        let strengths = Arc::new(strengths(&count, f64::INFINITY));
        let mut sums = |walk: f64| {
            let mut level = 0.0;
            let right = DVector::from_fn(48, |_, _| {
                level += walk * normal();
                100.0 * level + 10.0 * normal()
            });
            let (sums, strengths) = (DMatrix::from_element(48, 1, 100.0), strengths.clone());
            ChannelSums {
                log: 0,
                channel: 3,
                weight: 1.0,
                sums,
                right,
                count: count.clone(),
                walk: Walk::Zero,
                strengths,
                telling: true,
            }
        };
        let best = |s: &ChannelSums| {
            let l = s.likelihoods();
            (0..l.len())
                .max_by(|a, b| l[*a].total_cmp(&l[*b]))
                .map(|k| s.strengths[k].kappa)
        };
        let (white, walking) = (sums(0.0), sums(0.1));
        assert!(best(&white) < Some(1e-4));
        // The walk's variance is 0.01 a block.
        assert!(best(&walking) > Some(3e-3) && best(&walking) < Some(3e-2));
    }
}
