//! Steps: a residual whose mean jumps at one instant, as no zero that wanders does.
//!
//! A walk strong enough for one large step would have many. So the likelihood of the block means with a step, at the
//! strength of the walk that suits it best, is compared with the likelihood without.

use nalgebra::DVector;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::dependence::Dependence;
use crate::drift::ChannelSums;
use crate::problem::Problem;

/// Noise that is coloured more slowly than any filter sees jumps now and then: the chance of a false alarm is kept to this part of the usual.
pub const CAUTION: f64 = 0.01;
/// Boundaries between blocks that are looked at: those with the largest differences.
const LOOKED_AT: usize = 4;

/// The largest step of each channel beside the parameters of `model`, and how many steps were possible.
pub fn test(problem: &Problem, model: &[usize]) -> (Vec<Dependence>, usize) {
    let mut tried = 0;
    let mut found = Vec::new();
    // A few rests in a block tell no step from a zero that wanders.
    let told = |s: &ChannelSums| s.of_blocks() && !problem.parts[s.log].white.layout.facts.rests;
    for all in problem.sums.iter().filter(|s| told(s)) {
        let sums = all.with_sums(all.columns(model));
        let blocks = sums.sums.nrows();
        tried += blocks.saturating_sub(1);
        let Some(without) = sums.profile(None) else { continue };
        let residual = &without.residual;
        let mut places: Vec<usize> = (1..blocks).collect();
        let jump = |k: usize| (residual[k] - residual[k - 1]).abs();
        places.sort_by(|a, b| jump(*b).total_cmp(&jump(*a)));
        let best = places
            .into_iter()
            .take(LOOKED_AT)
            .filter_map(|k| {
                let step = DVector::from_fn(blocks, |b, _| if b < k { 0.0 } else { 1.0 });
                Some((k, sums.profile(Some(&step))?))
            })
            .max_by(|a, b| b.1.deviance.total_cmp(&a.1.deviance));
        let Some((k, with)) = best else { continue };
        let ratio = without.deviance - with.deviance;
        // The strength of the walk is found from these few blocks as well: F, not chi squared.
        let freedom = blocks.saturating_sub(with.fitted + 1).max(1) as f64;
        let f = freedom * (ratio.max(0.0) / blocks as f64).exp_m1();
        let p_value = FisherSnedecor::new(1.0, freedom).map_or(1.0, |d| if f.is_finite() { d.sf(f) } else { 1.0 });
        let facts = &problem.parts[sums.log].white.layout.facts;
        let t = facts.t_start + (facts.t_end - facts.t_start) * k as f64 / blocks as f64;
        found.push(Dependence {
            channel: sums.channel,
            covariate: "t".to_string(),
            log: (problem.parts.len() > 1).then_some(sums.log),
            p_value,
            gain: without.white - with.white,
            shape: format!("a step at {t:.1} s"),
        });
    }
    (found, tried.max(1))
}
