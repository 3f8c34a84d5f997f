//! What is left beside the named effects, in words: channel, covariate, shape.

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::asked::Asked;
use crate::bins::{self, Covariate};
use crate::dictionary::{self, Origin, Unnamed};
use crate::problem::Problem;
use crate::stack::Stack;

/// A course is reported for each channel in which it explains at least this part of what it explains in the channel that shows it most.
const SHOWN: f64 = 0.1;

/// A dependence that no effect of the catalogue explains.
#[derive(Clone, Debug)]
pub struct Finding {
    /// Channel index.
    pub channel: usize,
    /// The covariate.
    pub covariate: String,
    /// The log concerned; `None` for all.
    pub log: Option<usize>,
    /// Log Bayes factor beside the named effects.
    pub ln_bayes: f64,
    /// Whitened square that it explains beside them, in units of the noise variance.
    pub drop: f64,
    /// Indices of the channels in which it explains that.
    pub channels: Vec<usize>,
    /// How the channel depends on the covariate.
    pub shape: String,
    /// Slot of the probe that shows it, if one does.
    pub probe: Option<usize>,
}

/// The first finding of each channel over each covariate of a log: the others say the same in other words.
pub fn strongest(findings: Vec<Finding>) -> Vec<Finding> {
    let mut kept: Vec<Finding> = Vec::new();
    for finding in findings {
        let same = |k: &Finding| (k.channel, &k.covariate, k.log) == (finding.channel, &finding.covariate, finding.log);
        if !kept.iter().any(same) {
            kept.push(finding);
        }
    }
    kept
}

/// An unnamed cause in words, channel by channel; `all` are all of them, the likeliest first.
pub fn told(problem: &Problem, stack: &Stack, unnamed: &Unnamed, ln_bayes: f64, all: &[&Unnamed]) -> Vec<Finding> {
    let several = problem.parts.len() > 1;
    let sums = &problem.sums;
    let mut channels: Vec<usize> = unnamed.asked.sums.iter().map(|(c, _)| sums[*c].channel).collect();
    channels.dedup();
    let common = |channel: usize, covariate: String, log: Option<usize>, shape: String| Finding {
        channel,
        covariate,
        log,
        ln_bayes,
        drop: stack.explained(&unnamed.asked),
        channels: channels.clone(),
        shape,
        probe: None,
    };
    vec![match &unnamed.origin {
        Origin::Bins(parts) => return by_shape(stack, &unnamed.asked, parts, &common),
        Origin::Course(places, course) => {
            let in_words = |place: usize| {
                let sums = &problem.sums[place];
                let facts = &problem.parts[sums.log].white.layout.facts;
                let blocks = sums.count.len() as f64;
                let block = (facts.t_end - facts.t_start) / blocks;
                let words = course.words(|at| facts.t_start + block * at, blocks);
                common(
                    sums.channel,
                    course.covariate(sums.channel % 3).to_string(),
                    several.then_some(sums.log),
                    words,
                )
            };
            return showing(stack, unnamed, places).into_iter().map(in_words).collect();
        }
        Origin::Outsize(slot) => {
            let effect = &problem.slots[*slot].effect;
            // The covariate that shows it best says where to look.
            let shown = |other: &&Unnamed| match &other.origin {
                Origin::Bins(parts) => parts.iter().find(|(channel, _)| channels.contains(channel)).cloned(),
                _ => None,
            };
            let (channel, covariate) = all.iter().find_map(shown).map_or_else(
                || (channels.first().copied().unwrap_or_default(), "t".to_string()),
                |(channel, covariate)| (channel, covariate.name.clone()),
            );
            let shape = format!("what looks like {} is larger than sensors have it", effect.card().id);
            common(channel, covariate, None, shape)
        }
        Origin::Probe(slot) => {
            let equations = stack.equations(&unnamed.asked);
            let certainties: Vec<f64> = equations.map_or_else(Vec::new, |e| {
                (0..e.score.len())
                    .map(|k| e.score[k].powi(2) / e.information[(k, k)].max(f64::MIN_POSITIVE))
                    .collect()
            });
            let of = bins::of_probe(&problem.slots[*slot], &certainties);
            Finding {
                probe: Some(*slot),
                ..common(of.channel, of.covariate, None, of.shape)
            }
        }
    }]
}

/// What looks like an effect and is not the same in all blocks, in words.
pub fn differs(problem: &Problem, slot: usize, ln_bayes: f64) -> Finding {
    let effect = &problem.slots[slot].effect;
    let channels: Vec<usize> = (effect.sensors().iter())
        .flat_map(|s| 3 * s.index()..3 * s.index() + 3)
        .filter(|channel| problem.sums.iter().any(|sums| sums.channel == *channel))
        .collect();
    Finding {
        channel: channels.first().copied().unwrap_or_default(),
        covariate: "t".to_string(),
        log: None,
        ln_bayes,
        drop: 2.0 * ln_bayes,
        channels,
        shape: format!("what looks like {} is not the same all the time", effect.card().id),
        probe: None,
    }
}

/// What the bins of some channels show, those first that show it most.
fn by_shape(
    stack: &Stack,
    asked: &Asked,
    parts: &[(usize, Arc<Covariate>)],
    common: &dyn Fn(usize, String, Option<usize>, String) -> Finding,
) -> Vec<Finding> {
    let Some(equations) = stack.equations(asked) else {
        return Vec::new();
    };
    let m = equations.score.len();
    let ridge = DMatrix::from_fn(m, m, |i, j| {
        equations.information[(i, j)] * if i == j { 1.0 + 1e-6 } else { 1.0 }
    });
    let Some(shape) = ridge.cholesky().map(|factor| factor.solve(&equations.score)) else {
        return Vec::new();
    };
    let mut first = 0;
    let told = |(channel, covariate): &(usize, Arc<Covariate>)| {
        // Axes may differ in their bins.
        let own = first..first + dictionary::contrasts(stack.criterion.problem, covariate).map_or(0, |q| q.ncols());
        first = own.end;
        let square: f64 = own.clone().map(|j| shape[j] * equations.score[j]).sum();
        let word = bins::shape_name(&shape.as_slice()[own]).to_string();
        (square, common(*channel, covariate.name.clone(), covariate.log, word))
    };
    shown_most(parts.iter().map(told).collect())
}

/// What shows a cause, by the square that each explains, without what shows hardly any of it; the one that shows most comes first.
fn shown_most<T>(mut all: Vec<(f64, T)>) -> Vec<T> {
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let most = all.first().map_or(0.0, |(square, _)| *square);
    let shown = all.into_iter().filter(|(square, _)| *square >= SHOWN * most);
    shown.map(|(_, what)| what).collect()
}

/// The channels (by their places among the sums) that show a course, the one that shows it most first.
fn showing(stack: &Stack, unnamed: &Unnamed, places: &[usize]) -> Vec<usize> {
    let Some(equations) = stack.equations(&unnamed.asked) else {
        return vec![places[0]];
    };
    let Origin::Course(_, course) = &unnamed.origin else {
        return vec![places[0]];
    };
    let width = course.parameters();
    let square = |k: usize| -> f64 {
        (k * width..(k + 1) * width)
            .map(|j| equations.score[j].powi(2) / equations.information[(j, j)].max(f64::MIN_POSITIVE))
            .sum()
    };
    shown_most((0..places.len()).map(|k| (square(k), places[k])).collect())
}
