//! Steps, swings, stays and humps: a residual whose mean jumps at one instant, swings at one frequency, lies elsewhere for a while, or
//! rises and falls once, as no zero that wanders does.
//!
//! A walk strong enough for one large step, or for one swing, would have many of all kinds. So the likelihood of the block means
//! with the step (or what it is), at the strength of the walk that suits it best, is compared with the likelihood without.

use std::cmp::Ordering;
use std::f64::consts::TAU;

use nalgebra::DMatrix;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::dependence::Dependence;
use crate::drift::{ChannelSums, Profiled};
use crate::humps;
use crate::problem::Problem;
use crate::stays::{self, Stay};

/// Noise that is coloured more slowly than any filter sees jumps and swings now and then: the chance of a false alarm is kept to this part of the usual.
pub const CAUTION: f64 = 0.01;
/// Boundaries between blocks that are looked at: those with the largest differences.
const LOOKED_AT: usize = 4;
/// Ways in which a step may lie: at a boundary, or within the block before or after it.
const LYING: usize = 3;
/// p-value from which on no further stay is asked for.
const SURE: f64 = 1e-7;
/// Whole swings in a log, from these on; fewer are a drift.
const FEWEST_SWINGS: f64 = 1.5;
/// Frequencies are tried in steps of this many swings in a log.
const FINENESS: f64 = 0.25;
/// Blocks that a swing needs.
const BLOCKS_PER_SWING: f64 = 3.0;

/// Steps, swings, stays and humps are four questions.
const QUESTIONS: usize = 4;

/// The largest step, swing, stay and hump of each channel beside the parameters of `model`, their p-values adjusted for all that were possible
/// of each; and how many questions were asked.
pub fn test(problem: &Problem, model: &[usize]) -> (Vec<Dependence>, usize) {
    // A few rests in a block tell no step from a zero that wanders.
    let told = |s: &&ChannelSums| s.of_blocks() && !problem.parts[s.log].white.layout.facts.rests;
    let asked: Vec<&ChannelSums> = problem.sums.iter().filter(told).collect();
    let found: Vec<Dependence> = asked
        .par_iter()
        .flat_map_iter(|sums| of_channel(problem, model, sums))
        .collect();
    (found, (QUESTIONS * asked.len()).max(1))
}

/// The largest step, swing, stay and hump of one channel.
fn of_channel(problem: &Problem, model: &[usize], all: &ChannelSums) -> Vec<Dependence> {
    let sums = all.with_sums(all.columns(model));
    let blocks = sums.sums.nrows();
    // Whatever level the mean has is no step.
    let level = DMatrix::from_element(blocks, 1, 1.0);
    let Some(without) = sums.profile(Some(&level)) else {
        return Vec::new();
    };
    let facts = &problem.parts[sums.log].white.layout.facts;
    let block = (facts.t_end - facts.t_start) / blocks as f64;
    let time = |at: f64| facts.t_start + block * at;
    let mut found = Vec::new();
    if let Some((at, with)) = step(&sums, &without) {
        let p = p_value(&without, &with, blocks, 1.0) * (LYING * blocks) as f64;
        found.push((with, p, format!("a step at {:.1} s", time(at))));
    }
    if let Some((swings, with)) = swing(&sums, &without) {
        let p = p_value(&without, &with, blocks, 1.0) * frequencies(blocks).count() as f64;
        found.push((
            with,
            p,
            format!("a swing every {:.1} s", block * blocks as f64 / swings),
        ));
    }
    let stays = stays::stays(&sums, &without).into_iter().map(|(stays, with)| {
        let loudest = |squares: &[f64]| stays.iter().map(|stay| stay.largest(squares)).fold(0.0, f64::max);
        let louder = louder(problem, &sums, loudest);
        let places = vec![stays::possible(blocks) as f64; stays.len()];
        let p = p_value(&without, &with, blocks, louder) * places.iter().product::<f64>();
        (p, stays, with)
    });
    let mut several: Vec<(f64, Vec<Stay>, Profiled)> = stays.collect();
    // As few as suffice: what comes and goes thrice mostly has a cause that another column tells.
    let fewest = several.iter().position(|(p, _, _)| *p <= SURE);
    let best = fewest.or_else(|| (0..several.len()).min_by(|a, b| several[*a].0.total_cmp(&several[*b].0)));
    if let Some((p, stays, with)) = best.map(|k| several.swap_remove(k)) {
        let times: Vec<String> = stays::spans(&stays)
            .into_iter()
            .map(|(begin, end)| format!("from {:.1} s to {:.1} s", time(begin), time(end)))
            .collect();
        found.push((with, p, format!("another level {}", times.join(" and "))));
    }
    if let Some((hump, with)) = humps::hump(&sums, &without) {
        let louder = louder(problem, &sums, |squares| hump.largest(squares));
        let p = p_value(&without, &with, blocks, louder) * humps::possible(blocks) as f64;
        let (middle, width) = (time(hump.middle), 2.0 * block * hump.width);
        found.push((with, p, format!("a hump at {middle:.1} s, {width:.1} s wide")));
    }
    let dependence = |(with, p_value, shape): (Profiled, f64, String)| Dependence {
        channel: sums.channel,
        covariate: "t".to_string(),
        log: (problem.parts.len() > 1).then_some(sums.log),
        p_value,
        gain: without.white - with.white,
        shape,
    };
    found.into_iter().map(dependence).collect()
}

/// How much louder a channel is in some blocks than in the middle one: noise that grows there shifts their means, too.
fn louder(problem: &Problem, sums: &ChannelSums, largest: impl Fn(&[f64]) -> f64) -> f64 {
    let evidence = &problem.parts[sums.log].white;
    let squares: Vec<f64> = (0..evidence.layout.blocks)
        .map(|b| evidence.mean_square(b, sums.channel).unwrap_or(0.0))
        .collect();
    let mut sorted: Vec<f64> = squares.iter().copied().filter(|s| *s > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
    (largest(&squares) / middle).max(1.0)
}

/// p-value of the columns that `with` has besides, where the noise has `louder` times the usual variance. The strength of the walk is
/// found from these few blocks as well: F, not chi squared.
fn p_value(without: &Profiled, with: &Profiled, blocks: usize, louder: f64) -> f64 {
    let columns = with.fitted.saturating_sub(without.fitted);
    if columns == 0 {
        return 1.0;
    }
    let ratio = without.deviance - with.deviance;
    let freedom = blocks.saturating_sub(with.fitted + 1).max(1) as f64;
    let f = freedom / columns as f64 * (ratio.max(0.0) / blocks as f64).exp_m1() / louder;
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

/// How many swings there can be in a log.
fn frequencies(blocks: usize) -> impl Iterator<Item = f64> {
    let most = blocks as f64 / BLOCKS_PER_SWING;
    let steps = ((most - FEWEST_SWINGS) / FINENESS).max(0.0) as u32;
    (0..=steps).map(|k| FEWEST_SWINGS + FINENESS * f64::from(k))
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
    let mut powers: Vec<(f64, f64)> = frequencies(blocks)
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
