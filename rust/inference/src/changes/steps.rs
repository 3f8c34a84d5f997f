//! A step: a residual whose mean jumps at one instant and stays there.

use std::cmp::Ordering;

use nalgebra::{DMatrix, DVector};

use super::block_means::{BlockMeans, Explained};

/// Boundaries between blocks that are looked at: those with the largest differences.
const LOOKED_AT: usize = 4;
/// Ways in which a step may lie: at a boundary, or within the block before or after it.
const LYING: usize = 3;

/// A step in a block.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    block: usize,
    /// Part of the block that comes after it.
    filled: f64,
}

impl Step {
    /// When it comes, in blocks from the start.
    pub fn at(&self) -> f64 {
        self.block as f64 + 1.0 - self.filled
    }

    fn column(&self, blocks: usize) -> DVector<f64> {
        DVector::from_fn(blocks, |b, _| match b.cmp(&self.block) {
            Ordering::Less => 0.0,
            Ordering::Equal => self.filled,
            Ordering::Greater => 1.0,
        })
    }
}

/// How many steps there can be.
pub const fn possible(blocks: usize) -> usize {
    LYING * blocks
}

/// The step that explains the means of a channel best.
pub fn step(means: &BlockMeans) -> Option<(Step, Explained)> {
    let residual = &means.without.residual;
    let blocks = means.blocks();
    let mut places: Vec<usize> = (1..blocks).collect();
    let jump = |k: usize| (residual[k] - residual[k - 1]).abs();
    places.sort_by(|a, b| jump(*b).total_cmp(&jump(*a)));
    // A step within a block makes two jumps, one at either end of it, which tell how much of the block it fills.
    let within = |block: usize| {
        let (before, after) = (
            residual[block] - residual[block - 1],
            residual[block + 1] - residual[block],
        );
        (before * after > 0.0).then(|| Step {
            block,
            filled: before / (before + after),
        })
    };
    let lying = |k: usize| {
        let inner = [k - 1, k].into_iter().filter(|b| (1..blocks - 1).contains(b));
        inner.filter_map(within).chain([Step { block: k, filled: 1.0 }])
    };
    let asked: Vec<Step> = places.into_iter().take(LOOKED_AT).flat_map(lying).collect();
    means.best(asked, |step| DMatrix::from_columns(&[step.column(blocks)]))
}
