//! Evidence: for each block of time and each channel the Gram matrix of `[columns of every effect | residual]`.
//!
//! Whitened where the noise is coloured, and additive: windows, chunks and logs of one layout sum up. From it alone
//! come fits, standard errors, held-out errors and the rank of every candidate, without another look at the log.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use imufit_model::effect::EffectError;
use imufit_model::facts::{LOOKBACK, LogFacts};
use imufit_model::sensor::Sensor;
use imufit_model::sensor_model::{Evaluation, SensorModel};
use imufit_model::window::Window;
use nalgebra::{DMatrix, DMatrixView, DVector, Matrix3, Vector3};
use rayon::prelude::*;

use crate::bin_sums::BinSums;
use crate::bins::Bins;
use crate::gram::Gram;
use crate::rests::{ChannelRows, Rests};
use crate::whitening::Filter;

/// Rows worked on at a time: their columns stay in the cache. The same in every pass, so that kinematics are worked out once.
pub(crate) const PART: usize = 2048;
/// Consecutive samples further apart than this many sample intervals are a gap, which no filter reaches across.
const GAP: f64 = 1.75;

/// What one evidence is taken for: the same layout must underlie all that is added up.
#[derive(Clone)]
pub struct Layout {
    /// Effects and candidates with the parameters around which columns are taken.
    pub model: SensorModel,
    /// Facts of the log.
    pub facts: LogFacts,
    /// Bins of the covariates, temperature less its mean.
    pub bins: Bins,
    /// Number of blocks of equal row count.
    pub blocks: usize,
    /// Whitening filter of each channel.
    pub filters: Vec<Filter>,
}

impl Layout {
    /// True if evidence of the two adds up: same effects around the same parameters, blocks, bins and filters.
    pub fn same(&self, other: &Self) -> bool {
        let (a, b) = (self.model.slots(), other.model.slots());
        let slots = a.len() == b.len()
            && a.iter().zip(b).all(|(a, b)| {
                a.effect.card().id == b.effect.card().id && a.in_model == b.in_model && a.parameters == b.parameters
            });
        slots
            && self.model.active() == other.model.active()
            && self.blocks == other.blocks
            && self.facts.n == other.facts.n
            && self.filters == other.filters
            && self.bins.names == other.bins.names
            && self.bins.edges == other.bins.edges
    }

    /// Block that a row of the log belongs to.
    pub fn block(&self, row: usize) -> usize {
        (row * self.blocks / self.facts.n.max(1)).min(self.blocks.saturating_sub(1))
    }

    /// Row at which a block starts.
    fn block_start(&self, block: usize) -> usize {
        (block * self.facts.n).div_ceil(self.blocks)
    }
}

/// Evidence of one channel in one block. Width w = number of active columns + 1; the residual is the last.
#[derive(Clone, Debug)]
pub struct ChannelBlock {
    /// Number of samples.
    pub n: usize,
    /// Gram matrix (w x w).
    pub gram: Gram,
    /// Sums of columns and residual.
    pub sum: DVector<f64>,
    /// What is summed in the bins of each covariate.
    pub bins: Vec<BinSums>,
    /// What a zero of the three axes does, where rows are projections of a vector.
    pub axes: Option<AxisSums>,
}

/// Sums of rows that are each the projection of a vector on a direction of its own.
#[derive(Clone, Debug)]
pub struct AxisSums {
    /// Sum of the directions' outer products.
    pub square: Matrix3<f64>,
    /// Sums of directions times columns and residual (3 x w).
    pub sum: DMatrix<f64>,
    /// Sums of the directions in each bin of each covariate.
    pub bin_sum: Vec<Vec<Vector3<f64>>>,
}

impl AxisSums {
    fn new(width: usize, bins: &Bins) -> Self {
        Self {
            square: Matrix3::zeros(),
            sum: DMatrix::zeros(3, width),
            bin_sum: bins.counts().map(|n| vec![Vector3::zeros(); n]).collect(),
        }
    }

    fn add(&mut self, other: &Self) {
        self.square += other.square;
        self.sum += &other.sum;
        for (a, b) in self.bin_sum.iter_mut().flatten().zip(other.bin_sum.iter().flatten()) {
            *a += b;
        }
    }
}

impl ChannelBlock {
    fn new(width: usize, bins: &Bins) -> Self {
        Self {
            n: 0,
            gram: Gram::zeros(width),
            sum: DVector::zeros(width),
            bins: bins.counts().map(|n| BinSums::zeros(n, width)).collect(),
            axes: None,
        }
    }

    fn add(&mut self, other: &Self) {
        self.n += other.n;
        self.gram.add(&other.gram, 1.0);
        self.sum += &other.sum;
        match (&mut self.axes, &other.axes) {
            (Some(own), Some(other)) => own.add(other),
            (own @ None, Some(other)) => *own = Some(other.clone()),
            (_, None) => {}
        }
        for (own, other) in self.bins.iter_mut().zip(&other.bins) {
            own.merge(other);
        }
    }
}

type Blocks = BTreeMap<(usize, usize), ChannelBlock>;

/// Evidence of a log, or of a part of it.
#[derive(Clone)]
pub struct Evidence {
    /// What it was taken for.
    pub layout: Arc<Layout>,
    /// Shared by copies, which questions of several models of one log keep.
    blocks: Arc<Blocks>,
}

/// Rows of a sensor that can be used, within an evaluated window.
pub struct Samples {
    /// Rows with a finite reading, reference and columns.
    pub rows: Vec<usize>,
    /// For each of them the number of gapless samples that lead up to it.
    pub run: Vec<usize>,
}

impl Samples {
    /// Usable samples of one sensor.
    pub fn new(sensor: Sensor, evaluation: &Evaluation, t: &[f64], dt: f64) -> Self {
        let channels: Vec<_> = (0..3)
            .filter_map(|axis| evaluation.channels[3 * sensor.index() + axis].as_ref())
            .collect();
        let mut usable = vec![channels.len() == 3; t.len()];
        for column in channels
            .iter()
            .flat_map(|c| c.columns.iter().chain(std::iter::once(&c.residual)))
        {
            for (u, v) in usable.iter_mut().zip(column) {
                *u &= v.is_finite();
            }
        }
        let rows: Vec<usize> = (0..t.len()).filter(|i| usable[*i]).collect();
        let mut run = vec![0; rows.len()];
        for k in 1..rows.len() {
            run[k] = if t[rows[k]] - t[rows[k - 1]] <= GAP * dt {
                run[k - 1] + 1
            } else {
                0
            };
        }
        Self { rows, run }
    }

    /// Samples whose row is at least `core` and that have `order` gapless samples before them, none of them too far back.
    pub fn with_past(&self, core: usize, order: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.rows.len()).filter(move |&k| {
            self.rows[k] >= core && self.run[k] >= order && self.rows[k] - self.rows[k - order] <= LOOKBACK
        })
    }
}

impl Evidence {
    /// Empty evidence.
    pub fn new(layout: Arc<Layout>) -> Self {
        Self {
            layout,
            blocks: Arc::new(Blocks::new()),
        }
    }

    /// Adds the core rows of a window. Rows before them are used as past of the whitening filter.
    pub fn add(&mut self, window: &Window) -> Result<(), EffectError> {
        let layout = &self.layout;
        let parts: Vec<Result<Blocks, EffectError>> = window
            .parts(PART, 1, layout.model.margin(window, &layout.facts))
            .par_iter()
            .map(|part| take(layout, part))
            .collect();
        // Summed in the order of time, so that the result does not depend on the number of threads.
        for part in parts {
            self.absorb(part?);
        }
        Ok(())
    }

    /// Adds what the rests of a log tell, where they stand in for a reference.
    pub fn add_rests(&mut self, rests: &Rests) -> Result<(), EffectError> {
        for rows in rests.rows(&self.layout.model, &self.layout.facts)? {
            self.add_rows(&rows);
        }
        Ok(())
    }

    /// Adds finished rows of one channel. Rows with a column that is not known are no evidence.
    fn add_rows(&mut self, rows: &ChannelRows) {
        let bins = &self.layout.bins;
        let blocks = Arc::make_mut(&mut self.blocks);
        let width = rows.columns.columns.len() + 1;
        let mut assigned = vec![Vec::new(); bins.names.len()];
        for (covariate, assigned) in assigned.iter_mut().enumerate() {
            if !bins.edges[covariate].is_empty() {
                bins.assign(covariate, &rows.t, &rows.around, assigned);
            }
        }
        for i in 0..rows.t.len() {
            let columns = rows
                .columns
                .columns
                .iter()
                .chain(std::iter::once(&rows.columns.residual));
            let row = DVector::from_iterator(width, columns.map(|c| c[i]));
            if row.iter().any(|v| !v.is_finite()) {
                continue;
            }
            let key = (rows.block[i], rows.channel);
            let target = blocks.entry(key).or_insert_with(|| ChannelBlock::new(width, bins));
            target.n += 1;
            target.gram.add_row(&row);
            target.sum += &row;
            let direction = rows.direction.as_ref().map(|d| d.row(i));
            if let Some(direction) = direction {
                let axes = target.axes.get_or_insert_with(|| AxisSums::new(width, bins));
                axes.square += direction * direction.transpose();
                axes.sum.ger(1.0, &direction, &row, 1.0);
            }
            for (covariate, assigned) in assigned.iter().enumerate().filter(|(_, a)| !a.is_empty()) {
                let bin = assigned[i];
                if bin == usize::MAX {
                    continue;
                }
                target.bins[covariate].add(bin, 1.0, row.as_slice());
                if let (Some(direction), Some(axes)) = (direction, &mut target.axes) {
                    axes.bin_sum[covariate][bin] += direction;
                }
            }
        }
    }

    fn absorb(&mut self, part: Blocks) {
        let blocks = Arc::make_mut(&mut self.blocks);
        for (key, block) in part {
            match blocks.entry(key) {
                std::collections::btree_map::Entry::Occupied(mut e) => e.get_mut().add(&block),
                std::collections::btree_map::Entry::Vacant(e) => {
                    e.insert(block);
                }
            }
        }
    }

    /// Adds evidence of other rows taken for the same layout.
    pub fn merge(&mut self, other: Self) {
        self.absorb(Arc::unwrap_or_clone(other.blocks));
    }

    /// Evidence of a channel in a block; `None` where it has no sample.
    pub fn get(&self, block: usize, channel: usize) -> Option<&ChannelBlock> {
        self.blocks.get(&(block, channel))
    }

    /// Evidence of a channel in every block in which it has samples, with the block's number.
    pub fn of_channel(&self, channel: usize) -> impl Iterator<Item = (usize, &ChannelBlock)> {
        (0..self.layout.blocks).filter_map(move |b| Some((b, self.get(b, channel)?)))
    }

    /// Number of samples of a channel.
    pub fn count(&self, channel: usize) -> usize {
        self.of_channel(channel).map(|(_, block)| block.n).sum()
    }

    /// Gram matrix of a channel over all blocks with the number of samples, each block weighted by `weight`; `None` without any.
    pub fn total(&self, channel: usize, weight: impl Fn(usize) -> f64) -> Option<(Gram, usize)> {
        self.of_channel(channel).fold(None, |total, (b, block)| {
            let (mut gram, n) = total.unwrap_or_else(|| (Gram::zeros(block.gram.columns()), 0));
            gram.add(&block.gram, weight(b));
            Some((gram, n + block.n))
        })
    }

    /// The vector that turns `[columns | residual]` of a channel into the residual after a step of all parameters.
    pub fn contrast(&self, channel: usize, step: &DVector<f64>) -> DVector<f64> {
        let active = &self.layout.model.active()[channel];
        let values = active.iter().map(|p| -step[*p]).chain([1.0]);
        DVector::from_iterator(active.len() + 1, values)
    }

    /// Sum of squared residuals and number of samples of a channel after a step, block by block.
    pub fn squares(&self, channel: usize, step: &DVector<f64>) -> Vec<(f64, usize)> {
        let v = self.contrast(channel, step);
        let of = |b: usize| {
            self.get(b, channel)
                .map_or((0.0, 0), |block| (block.gram.square(&v).max(0.0), block.n))
        };
        (0..self.layout.blocks).map(of).collect()
    }

    /// The same of all blocks.
    pub fn square(&self, channel: usize, step: &DVector<f64>) -> (f64, usize) {
        let add = |(sum, count): (f64, usize), (square, n): (f64, usize)| (sum + square, count + n);
        self.squares(channel, step).into_iter().fold((0.0, 0), add)
    }
}

/// Ranges of numbers that follow one another.
fn consecutive(numbers: &[usize]) -> Vec<Range<usize>> {
    let mut out: Vec<Range<usize>> = Vec::new();
    for k in numbers {
        match out.last_mut() {
            Some(run) if run.end == *k => run.end += 1,
            _ => out.push(*k..*k + 1),
        }
    }
    out
}

/// Evidence of one part of a window.
fn take(layout: &Layout, window: &Window) -> Result<Blocks, EffectError> {
    let core = window.begin;
    // As far back as a filter may look, whether there is one or not: kinematics of the same rows are kept from pass to pass.
    let window = window.with_core(core.saturating_sub(LOOKBACK), window.end);
    let evaluation = layout.model.evaluate(&window, &layout.facts)?;
    let t = &window.t[window.begin..window.end];
    let mut assigned = vec![Vec::new(); layout.bins.names.len()];
    for (covariate, rows) in assigned.iter_mut().enumerate() {
        if !layout.bins.edges[covariate].is_empty() {
            layout.bins.assign(covariate, t, &evaluation, rows);
        }
    }
    let mut out = Blocks::new();
    let (mut by_column, mut by_row, mut compact) = (Vec::new(), Vec::new(), Vec::new());
    for sensor in Sensor::ALL {
        let order = (0..3)
            .map(|a| layout.filters[3 * sensor.index() + a].len())
            .max()
            .unwrap_or(0);
        let samples = Samples::new(sensor, &evaluation, t, layout.facts.sensor_dt[sensor.index()]);
        let kept: Vec<usize> = samples.with_past(core - window.begin, order).collect();
        if kept.is_empty() {
            continue;
        }
        let runs = consecutive(&kept);
        let row_of = |k: usize| window.offset + window.begin + samples.rows[k];
        for channel in 3 * sensor.index()..3 * sensor.index() + 3 {
            let Some(columns) = &evaluation.channels[channel] else {
                continue;
            };
            let width = columns.columns.len() + 1;
            let n = kept.len();
            by_column.clear();
            let filter = &layout.filters[channel];
            for column in columns.columns.iter().chain(std::iter::once(&columns.residual)) {
                compact.clear();
                compact.extend(samples.rows.iter().map(|row| column[*row]));
                for run in &runs {
                    let first = by_column.len();
                    by_column.extend_from_slice(&compact[run.clone()]);
                    for (j, a) in filter.iter().enumerate() {
                        let past = &compact[run.start - 1 - j..run.end - 1 - j];
                        for (v, x) in by_column[first..].iter_mut().zip(past) {
                            *v -= a * x;
                        }
                    }
                }
            }
            by_row.clear();
            by_row.resize(n * width, 0.0);
            for (c, column) in by_column.chunks_exact(n).enumerate() {
                for (i, v) in column.iter().enumerate() {
                    by_row[i * width + c] = *v;
                }
            }
            let mut first = 0;
            while first < n {
                let block = layout.block(row_of(kept[first]));
                let next = layout.block_start(block + 1);
                let last = first + kept[first..].partition_point(|k| row_of(*k) < next || block + 1 == layout.blocks);
                let target = out
                    .entry((block, channel))
                    .or_insert_with(|| ChannelBlock::new(width, &layout.bins));
                target.n += last - first;
                let rows = DMatrixView::from_slice(&by_row[first * width..last * width], width, last - first);
                let columns = DMatrixView::from_slice_with_strides(&by_column[first..], last - first, width, 1, n);
                target.gram.add_matrix(&(rows * columns));
                target.sum += rows.column_sum();
                for (covariate, assigned) in assigned.iter().enumerate().filter(|(_, a)| !a.is_empty()) {
                    for i in first..last {
                        let bin = assigned[samples.rows[kept[i]]];
                        if bin == usize::MAX {
                            continue;
                        }
                        target.bins[covariate].add(bin, 1.0, &by_row[i * width..(i + 1) * width]);
                    }
                }
                first = last;
            }
        }
    }
    Ok(out)
}
