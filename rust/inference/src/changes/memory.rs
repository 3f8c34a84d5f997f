//! A memory: a residual whose mean follows where a covariate was before, more than where it is.

use nalgebra::{DMatrix, DVector};

use super::block_means::{BlockMeans, Explained};
use crate::drift::ChannelSums;
use crate::problem::Problem;

/// Times in which the past is forgotten, blocks.
const FORGOTTEN: [f64; 4] = [0.7, 1.5, 3.0, 6.0];

/// What is remembered of a covariate, and how long.
pub struct Memory {
    /// Name of the covariate.
    pub covariate: String,
    /// Time in which the past is forgotten, blocks.
    pub forgotten: f64,
    /// Block means of the covariate, and of what is remembered of it.
    pub columns: DMatrix<f64>,
    /// What the means leave if they follow the covariate as it is.
    pub without: Explained,
}

/// Means over blocks of the exponentially weighted past of a quantity with these means, of which nothing but the first was there before.
fn past(means: &DVector<f64>, forgotten: f64) -> DVector<f64> {
    let kept = (-1.0 / forgotten).exp();
    let mut level = means[0];
    DVector::from_fn(means.len(), |b, _| {
        let mean = means[b] + (level - means[b]) * forgotten * (1.0 - kept);
        level = level * kept + means[b] * (1.0 - kept);
        mean
    })
}

/// Block means of the rank of a covariate; `None` where it is the same in all of them.
fn means_of(problem: &Problem, sums: &ChannelSums, covariate: usize) -> Option<DVector<f64>> {
    let evidence = &problem.parts[sums.log].white;
    let bins = evidence.layout.bins.edges[covariate].len() + 1;
    if bins < 2 {
        return None;
    }
    let of_bins = DMatrix::from_fn(bins, 2, |bin, k| {
        if k == 0 {
            1.0
        } else {
            2.0 * bin as f64 / (bins - 1) as f64 - 1.0
        }
    });
    let binned = sums.binned(evidence, covariate, &of_bins);
    let mut last = 0.0;
    let means = DVector::from_fn(binned.nrows(), |b, _| {
        // A block without samples says nothing: what was before goes on.
        if binned[(b, 0)] > 0.0 {
            last = binned[(b, 1)] / binned[(b, 0)];
        }
        last
    });
    let spread = means.max() - means.min();
    (spread > 0.0).then_some(means)
}

/// How many memories a log can have, `time` among its covariates not counted.
pub fn possible(problem: &Problem, log: usize) -> usize {
    let edges = &problem.parts[log].white.layout.bins.edges;
    FORGOTTEN.len() * edges.iter().skip(1).filter(|e| !e.is_empty()).count().max(1)
}

/// The memory that explains the means of a channel best, beside what they have of the covariate as it is.
pub fn memory(problem: &Problem, sums: &ChannelSums, means: &BlockMeans) -> Option<(Memory, Explained)> {
    let bins = &problem.parts[sums.log].white.layout.bins;
    let mut best: Option<(Memory, Explained)> = None;
    // The first covariate is time, which has no past of its own.
    for covariate in 1..bins.names.len() {
        let Some(now) = means_of(problem, sums, covariate) else {
            continue;
        };
        let remembered = |forgotten: f64| DMatrix::from_columns(&[now.clone(), past(&now, forgotten)]);
        let Some((forgotten, with)) = means.best(FORGOTTEN.to_vec(), |forgotten| remembered(*forgotten)) else {
            continue;
        };
        let Some(without) = means.beside(&DMatrix::from_columns(std::slice::from_ref(&now))) else {
            continue;
        };
        let gain = |without: &Explained, with: &Explained| without.deviance - with.deviance;
        if best
            .as_ref()
            .is_none_or(|(b, w)| gain(&without, &with) > gain(&b.without, w))
        {
            let memory = Memory {
                covariate: bins.names[covariate].clone(),
                forgotten,
                columns: remembered(forgotten),
                without,
            };
            best = Some((memory, with));
        }
    }
    best
}

impl Memory {
    /// Mean of something that each block has, weighted by how much the block tells of the memory.
    pub fn weighted(&self, of_blocks: &[f64]) -> f64 {
        let difference = self.columns.column(1) - self.columns.column(0);
        let middle = difference.mean();
        let weights: Vec<f64> = difference.iter().map(|d| (d - middle).powi(2)).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter().zip(of_blocks).map(|(w, v)| w * v).sum::<f64>() / sum.max(f64::MIN_POSITIVE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_past_of_a_step_creeps_to_its_level() {
        let step = DVector::from_fn(20, |b, _| if b < 5 { 0.0 } else { 1.0 });
        let past = past(&step, 2.0);
        assert!(past.rows(0, 5).norm() < 1e-12);
        // Mean of 1 - exp(-t/2) over the first block after the step, and over the third.
        let mean = |from: f64| 1.0 - 2.0 * ((-from / 2.0).exp() - (-(from + 1.0) / 2.0).exp());
        assert!((past[5] - mean(0.0)).abs() < 1e-12);
        assert!((past[7] - mean(2.0)).abs() < 1e-12);
    }
}
