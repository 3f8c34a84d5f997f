//! Changes in time: a residual whose mean jumps at one instant, swings at one frequency, lies elsewhere for a while, or
//! rises and falls once, as no zero that wanders does; and a mean that follows where a covariate was before.
//!
//! A walk strong enough for one large step, or for one swing, would have many of all kinds. So the likelihood of the block means
//! with the step (or what it is), at the strength of the walk that suits it best, is compared with the likelihood without.

pub mod block_means;
pub mod humps;
pub mod memory;
pub mod stays;
pub mod steps;
pub mod swings;

use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use self::block_means::{BlockMeans, Explained};
use self::stays::Stay;
use crate::dependence::Dependence;
use crate::drift::ChannelSums;
use crate::problem::Problem;

/// Noise that is coloured more slowly than any filter sees jumps and swings now and then: the chance of a false alarm is kept to this part of the usual.
pub const CAUTION: f64 = 0.01;
/// Memories of many covariates are as many ways to follow a zero that wanders; those that are none are hardly ever as certain.
pub const CAUTION_WITH_MEMORIES: f64 = 0.1;
/// p-value from which on no further stay is asked for.
const SURE: f64 = 1e-7;
/// Steps, swings, stays and humps are four questions.
const QUESTIONS: usize = 4;

/// The largest step, swing, stay and hump of each channel beside the parameters of `model`, their p-values adjusted for all that were possible
/// of each; and how many questions were asked.
pub fn test(problem: &Problem, model: &[usize]) -> (Vec<Dependence>, usize) {
    let asked = asked(problem);
    let found: Vec<Dependence> = asked
        .par_iter()
        .flat_map_iter(|sums| of_channel(problem, model, sums))
        .collect();
    (found, (QUESTIONS * asked.len()).max(1))
}

/// The largest memory of each channel beside the parameters of `model`, its p-value adjusted for all that were possible; and how many
/// questions were asked.
pub fn test_memories(problem: &Problem, model: &[usize]) -> (Vec<Dependence>, usize) {
    let asked = asked(problem);
    let found: Vec<Dependence> = asked
        .par_iter()
        .filter_map(|sums| memory_of(problem, model, sums))
        .collect();
    (found, asked.len().max(1))
}

/// Channels whose block means tell of time: a few rests in a block tell no step from a zero that wanders.
fn asked(problem: &Problem) -> Vec<&ChannelSums> {
    let told = |s: &&ChannelSums| s.of_blocks() && !problem.parts[s.log].white.layout.facts.rests;
    problem.sums.iter().filter(told).collect()
}

/// The largest memory of one channel.
fn memory_of(problem: &Problem, model: &[usize], all: &ChannelSums) -> Option<Dependence> {
    let sums = all.with_sums(all.columns(model));
    let means = BlockMeans::new(&sums)?;
    let (memory, with) = memory::memory(problem, &sums, &means)?;
    let louder = louder(problem, &sums, |squares| memory.weighted(squares));
    let p = p_value(&memory.without, &with, means.blocks(), louder) * memory::possible(problem, sums.log) as f64;
    let facts = &problem.parts[sums.log].white.layout.facts;
    let block = (facts.t_end - facts.t_start) / means.blocks() as f64;
    Some(Dependence {
        channel: sums.channel,
        covariate: memory.covariate,
        log: (problem.parts.len() > 1).then_some(sums.log),
        p_value: p,
        gain: means.without.white - with.white,
        on_channel: means.without.white - with.white,
        shape: format!(
            "its past counts as well, forgotten in {:.1} s",
            block * memory.forgotten
        ),
        held_out: None,
        probe: None,
    })
}

/// The largest step, swing, stay and hump of one channel.
fn of_channel(problem: &Problem, model: &[usize], all: &ChannelSums) -> Vec<Dependence> {
    let sums = all.with_sums(all.columns(model));
    let Some(means) = BlockMeans::new(&sums) else {
        return Vec::new();
    };
    let without = &means.without;
    let blocks = means.blocks();
    let facts = &problem.parts[sums.log].white.layout.facts;
    let block = (facts.t_end - facts.t_start) / blocks as f64;
    let time = |at: f64| facts.t_start + block * at;
    let mut found = Vec::new();
    if let Some((step, with)) = steps::step(&means) {
        let p = p_value(without, &with, blocks, 1.0) * steps::possible(blocks) as f64;
        found.push((with, p, format!("a step at {:.1} s", time(step.at()))));
    }
    if let Some((swings, with)) = swings::swing(&means) {
        let p = p_value(without, &with, blocks, 1.0) * swings::possible(blocks) as f64;
        let period = block * blocks as f64 / swings;
        found.push((with, p, format!("a swing every {period:.1} s")));
    }
    let stays = stays::stays(&means).into_iter().map(|(stays, with)| {
        let loudest = |squares: &[f64]| stays.iter().map(|stay| stay.largest(squares)).fold(0.0, f64::max);
        let louder = louder(problem, &sums, loudest);
        let places: f64 = stays.iter().map(|_| stays::possible(blocks) as f64).product();
        (p_value(without, &with, blocks, louder) * places, stays, with)
    });
    let mut several: Vec<(f64, Vec<Stay>, Explained)> = stays.collect();
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
    if let Some((hump, with)) = humps::hump(&means) {
        let louder = louder(problem, &sums, |squares| hump.largest(squares));
        let p = p_value(without, &with, blocks, louder) * humps::possible(blocks) as f64;
        let (middle, width) = (time(hump.middle), 2.0 * block * hump.width);
        found.push((with, p, format!("a hump at {middle:.1} s, {width:.1} s wide")));
    }
    let dependence = |(with, p_value, shape): (Explained, f64, String)| Dependence {
        channel: sums.channel,
        covariate: "t".to_string(),
        log: (problem.parts.len() > 1).then_some(sums.log),
        p_value,
        gain: without.white - with.white,
        on_channel: without.white - with.white,
        shape,
        held_out: None,
        probe: None,
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
fn p_value(without: &Explained, with: &Explained, blocks: usize, louder: f64) -> f64 {
    let columns = with.fitted.saturating_sub(without.fitted);
    if columns == 0 {
        return 1.0;
    }
    let ratio = without.deviance - with.deviance;
    let freedom = blocks.saturating_sub(with.fitted + 1).max(1) as f64;
    let f = freedom / columns as f64 * (ratio.max(0.0) / blocks as f64).exp_m1() / louder;
    FisherSnedecor::new(columns as f64, freedom).map_or(1.0, |d| if f.is_finite() { d.sf(f) } else { 1.0 })
}
