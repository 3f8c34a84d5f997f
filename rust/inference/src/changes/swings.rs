//! A swing: a residual whose mean goes up and down at one frequency.

use std::f64::consts::TAU;

use nalgebra::DMatrix;

use super::block_means::{BlockMeans, Explained, standing_out};

/// Frequencies that are looked at of those that stand out: as the means are, and beside what a walk has at each.
const LOOKED_AT: usize = 4;
/// Whole swings in a log, from these on; fewer are a drift.
const FEWEST: f64 = 1.5;
/// Frequencies are tried in steps of this many swings in a log.
const FINENESS: f64 = 0.25;
/// Blocks that a swing needs.
const BLOCKS: f64 = 3.0;

/// How many swings there can be in a log.
fn frequencies(blocks: usize) -> impl Iterator<Item = f64> {
    let most = blocks as f64 / BLOCKS;
    let steps = ((most - FEWEST) / FINENESS).max(0.0) as u32;
    (0..=steps).map(|k| FEWEST + FINENESS * f64::from(k))
}

/// How many frequencies are possible.
pub fn possible(blocks: usize) -> usize {
    frequencies(blocks).count()
}

/// Cosine and sine with so many swings in a log (blocks x 2).
fn wave(swings: f64, blocks: usize) -> DMatrix<f64> {
    DMatrix::from_fn(blocks, 2, |b, k| {
        let phase = TAU * swings * (b as f64 + 0.5) / blocks as f64;
        [phase.cos(), phase.sin()][k]
    })
}

/// How often the mean swings during the log, if it swings at all.
pub fn swing(means: &BlockMeans) -> Option<(f64, Explained)> {
    let blocks = means.blocks();
    let power = |swings: f64| wave(swings, blocks).tr_mul(&means.without.residual).norm();
    let scored = |swings: f64| (swings, [power(swings), power(swings) * swings]);
    let asked = standing_out(frequencies(blocks).map(scored).collect(), LOOKED_AT);
    means.best(asked, |swings| wave(*swings, blocks))
}
