//! Steps and swings: a residual whose mean jumps at one instant, or swings at one frequency, as no zero that wanders does.
//!
//! A walk strong enough for one large step, or for one swing, would have many of all kinds. So the likelihood of the block means
//! with the step or the swing, at the strength of the walk that suits it best, is compared with the likelihood without.

use std::cmp::Ordering;
use std::f64::consts::TAU;

use nalgebra::DMatrix;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::dependence::Dependence;
use crate::drift::{ChannelSums, Profiled};
use crate::problem::Problem;

/// Noise that is coloured more slowly than any filter sees jumps and swings now and then: the chance of a false alarm is kept to this part of the usual.
pub const CAUTION: f64 = 0.01;
/// Boundaries between blocks that are looked at: those with the largest differences.
const LOOKED_AT: usize = 4;
/// Ways in which a step may lie: at a boundary, or within the block before or after it.
const LYING: usize = 3;
/// Whole swings in a log, from these on; fewer are a drift.
const FEWEST_SWINGS: f64 = 1.5;
/// Frequencies are tried in steps of this many swings in a log.
const FINENESS: f64 = 0.25;
/// Blocks that a swing needs.
const BLOCKS_PER_SWING: f64 = 3.0;

/// The largest step and the largest swing of each channel beside the parameters of `model`, and how many were possible.
pub fn test(problem: &Problem, model: &[usize]) -> (Vec<Dependence>, usize) {
    let mut tried = 0;
    let mut found = Vec::new();
    // A few rests in a block tell no step from a zero that wanders.
    let told = |s: &ChannelSums| s.of_blocks() && !problem.parts[s.log].white.layout.facts.rests;
    for all in problem.sums.iter().filter(|s| told(s)) {
        let sums = all.with_sums(all.columns(model));
        let blocks = sums.sums.nrows();
        tried += (1 + LYING) * blocks.saturating_sub(1);
        // Whatever level the mean has is no step.
        let level = DMatrix::from_element(blocks, 1, 1.0);
        let Some(without) = sums.profile(Some(&level)) else {
            continue;
        };
        let facts = &problem.parts[sums.log].white.layout.facts;
        let duration = facts.t_end - facts.t_start;
        let step = step(&sums, &without).map(|(at, with)| {
            let t = facts.t_start + duration * at / blocks as f64;
            (with, format!("a step at {t:.1} s"))
        });
        let swing =
            swing(&sums, &without).map(|(swings, with)| (with, format!("a swing every {:.1} s", duration / swings)));
        for (with, shape) in [step, swing].into_iter().flatten() {
            found.push(Dependence {
                channel: sums.channel,
                covariate: "t".to_string(),
                log: (problem.parts.len() > 1).then_some(sums.log),
                p_value: p_value(&without, &with, blocks),
                gain: without.white - with.white,
                shape,
            });
        }
    }
    (found, tried.max(1))
}

/// p-value of the columns that `with` has besides. The strength of the walk is found from these few blocks as well: F, not chi squared.
fn p_value(without: &Profiled, with: &Profiled, blocks: usize) -> f64 {
    let columns = with.fitted.saturating_sub(without.fitted);
    if columns == 0 {
        return 1.0;
    }
    let ratio = without.deviance - with.deviance;
    let freedom = blocks.saturating_sub(with.fitted + 1).max(1) as f64;
    let f = freedom / columns as f64 * (ratio.max(0.0) / blocks as f64).exp_m1();
    FisherSnedecor::new(columns as f64, freedom).map_or(1.0, |d| if f.is_finite() { d.sf(f) } else { 1.0 })
}

/// Where the mean jumps most, in blocks from the start.
fn step(sums: &ChannelSums, without: &Profiled) -> Option<(f64, Profiled)> {
    let residual = &without.residual;
    let blocks = residual.len();
    let mut places: Vec<usize> = (1..blocks).collect();
    let jump = |k: usize| (residual[k] - residual[k - 1]).abs();
    places.sort_by(|a, b| jump(*b).total_cmp(&jump(*a)));
    // A step within a block makes two jumps, one at either end of it, which tell how much of the block it fills.
    let within = |k: usize| {
        let (before, after) = (residual[k] - residual[k - 1], residual[k + 1] - residual[k]);
        (before * after > 0.0).then(|| (k, before / (before + after)))
    };
    let inner = |k: &usize| (1..blocks - 1).contains(k);
    places
        .into_iter()
        .take(LOOKED_AT)
        .flat_map(|k| {
            [k - 1, k]
                .into_iter()
                .filter(inner)
                .filter_map(within)
                .chain([(k, 1.0)])
        })
        .filter_map(|(k, filled)| {
            let step = DMatrix::from_fn(blocks, 2, |b, level| match b.cmp(&k) {
                _ if level == 1 => 1.0,
                Ordering::Less => 0.0,
                Ordering::Equal => filled,
                Ordering::Greater => 1.0,
            });
            Some((k as f64 + 1.0 - filled, sums.profile(Some(&step))?))
        })
        .min_by(|a, b| a.1.deviance.total_cmp(&b.1.deviance))
}

/// How often the mean swings during the log, if it swings at all: the frequencies that stand out are looked at, as the residual is and
/// beside what a walk has at each.
fn swing(sums: &ChannelSums, without: &Profiled) -> Option<(f64, Profiled)> {
    let blocks = without.residual.len();
    let wave = |swings: f64| {
        DMatrix::from_fn(blocks, 3, |b, k| {
            let phase = TAU * swings * (b as f64 + 0.5) / blocks as f64;
            [phase.cos(), phase.sin(), 1.0][k]
        })
    };
    let most = blocks as f64 / BLOCKS_PER_SWING;
    let frequencies = ((most - FEWEST_SWINGS) / FINENESS).max(0.0) as u32;
    let mut powers: Vec<(f64, f64)> = (0..=frequencies)
        .map(|k| FEWEST_SWINGS + FINENESS * f64::from(k))
        .map(|f| (f, wave(f).tr_mul(&without.residual).rows(0, 2).norm()))
        .collect();
    let mut asked: Vec<f64> = Vec::new();
    for steepness in [0.0, 1.0] {
        let weighed = |p: &(f64, f64)| p.1 * p.0.powf(steepness);
        powers.sort_by(|a, b| weighed(b).total_cmp(&weighed(a)));
        asked.extend(powers.iter().take(LOOKED_AT).map(|p| p.0));
    }
    asked
        .into_iter()
        .filter_map(|swings| Some((swings, sums.profile(Some(&wave(swings)))?)))
        .min_by(|a, b| a.1.deviance.total_cmp(&b.1.deviance))
}
