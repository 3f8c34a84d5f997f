//! Unnamed causes: what a residual may depend on that no effect of the catalogue describes.
//!
//! Columns of products and of the past (probes), bins of every covariate whatever the shape, and courses in time. Their parameters have no
//! typical size; each may be as large as the noise of a sample.

use std::collections::BTreeMap;
use std::sync::Arc;

use imufit_model::sensor::{AXES, CHANNELS, Sensor};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::asked::{Asked, Prior};
use crate::bins::{self, Covariate};
use crate::courses;
use crate::criterion::Criterion;
use crate::problem::Problem;
use crate::search::{Plausible, Search, Weighed};
use crate::stack::Stack;

/// What the covariates are called that hold the quantities that sensors measure, up to the axis.
const OWN: [&str; 3] = ["f_", "omega_", "m_"];

/// A channel and a covariate that it may depend on.
type Bound = (usize, Arc<Covariate>);

/// Where an unnamed cause comes from.
#[derive(Clone, Debug)]
pub enum Origin {
    /// A probe, by its slot.
    Probe(usize),
    /// What an effect of the catalogue describes, by its slot, where it would have to be larger than sensors have it.
    Outsize(usize),
    /// Bins of a covariate of each of some channels of a sensor.
    Bins(Vec<Bound>),
    /// A course in time of some channels, by their places among the sums.
    Course(Vec<usize>, courses::Course),
}

/// An unnamed cause with its columns.
#[derive(Clone, Debug)]
pub struct Unnamed {
    /// Where it comes from.
    pub origin: Origin,
    /// Its columns.
    pub asked: Asked,
}

/// Unnamed causes whose columns do not depend on the stack: probes and bins.
pub fn fixed(criterion: &Criterion, probes: &[usize]) -> Vec<Unnamed> {
    // A heading that wanders is noise, which every stack has.
    let cause = |slot: &&usize| criterion.problem.slots[**slot].effect.card().traits.reference.is_none();
    let of_probes = probes.iter().filter(cause).map(|slot| Unnamed {
        origin: Origin::Probe(*slot),
        asked: Asked::slot(criterion, *slot),
    });
    let covariates: Vec<Arc<Covariate>> = bins::covariates(criterion.problem).into_iter().map(Arc::new).collect();
    let bounds: Vec<Bound> = (0..CHANNELS)
        .flat_map(|channel| covariates.iter().map(move |covariate| (channel, covariate.clone())))
        .collect();
    let of_bins: Vec<(Bound, Asked)> = bounds
        .into_par_iter()
        .filter_map(|(channel, covariate)| {
            let asked = bins::asked(criterion, channel, &covariate)?;
            Some(((channel, covariate), asked))
        })
        .collect();
    let of_sensors = of_sensors(&of_bins);
    let single = of_bins.into_iter().map(|(part, asked)| Unnamed {
        origin: Origin::Bins(vec![part]),
        asked,
    });
    of_probes.chain(single).chain(of_sensors).collect()
}

/// What the candidates of a search describe, for where they would have to be larger than sensors have them.
pub fn outsize(search: &Search) -> Vec<Unnamed> {
    let cause = |(slot, asked): (usize, &Asked)| Unnamed {
        origin: Origin::Outsize(slot),
        asked: asked.clone(),
    };
    search.asked().map(cause).collect()
}

/// Log Bayes factor of an unnamed cause beside a stack.
pub fn ln_bayes(search: &Search, stack: &Stack, unnamed: &Unnamed) -> f64 {
    let too_large = |w: &Weighed| w.plausible == Plausible::TooLarge;
    match unnamed.origin {
        Origin::Outsize(slot) => search.weigh(stack, slot).filter(too_large).map_or(0.0, |w| w.ln_bayes),
        _ => stack.ln_bayes(&unnamed.asked),
    }
}

/// What all axes of a sensor have, as effects of the catalogue do: each depends on the same covariate, or each on its own quantity.
fn of_sensors(of_bins: &[(Bound, Asked)]) -> Vec<Unnamed> {
    let mut groups: BTreeMap<_, Vec<&(Bound, Asked)>> = BTreeMap::new();
    for own in of_bins {
        let (channel, covariate) = &own.0;
        // The quantity that an axis measures is called by the axis.
        let quantity = OWN[channel / AXES.len()];
        let name = match covariate.name.split_once(quantity) {
            Some(("", axis)) if axis == AXES[channel % AXES.len()] => quantity,
            _ => covariate.name.as_str(),
        };
        let key = (channel / AXES.len(), name, covariate.log);
        groups.entry(key).or_default().push(own);
    }
    let joined = |group: Vec<&(Bound, Asked)>| {
        let parts = group.iter().map(|(part, _)| part.clone()).collect();
        let asked = group.iter().map(|(_, asked)| asked.clone());
        let asked = asked.reduce(|all, own| all.apart(&own))?;
        let origin = Origin::Bins(parts);
        (group.len() > 1).then_some(Unnamed { origin, asked })
    };
    groups.into_values().filter_map(joined).collect()
}

/// Contrasts over the bins of a covariate.
pub fn contrasts(problem: &Problem, covariate: &Covariate) -> Option<DMatrix<f64>> {
    covariate.contrasts(problem)
}

/// Log Bayes factor of what an unnamed cause has in common in all blocks beside some members, where it may vary from block to block.
pub fn varying(search: &Search, stack: &Stack, members: &[usize], unnamed: &Unnamed) -> f64 {
    match &unnamed.origin {
        Origin::Probe(slot) | Origin::Outsize(slot) => {
            search.varying_beside(stack, members, *slot, &unnamed.asked).common
        }
        Origin::Bins(parts) => {
            let columns = search.beside(stack, members);
            let columns: Vec<usize> = columns.iter().map(|(j, _)| *j).collect();
            let Prior::Normal(deviation) = &unnamed.asked.prior else {
                return 0.0;
            };
            let mut first = 0;
            let mut of_part = |(channel, covariate): &Bound| {
                let question = bins::question(search.criterion.problem, &columns, *channel, covariate)?;
                let own = first..first + question.parameters() - question.model;
                first = own.end;
                Some(search.varying_of(stack, members, question, &deviation[own], 0.0).common)
            };
            parts.iter().filter_map(&mut of_part).sum()
        }
        // What comes once has no blocks to differ.
        Origin::Course(..) => f64::INFINITY,
    }
}

/// The likeliest courses of some sensors beside a stack, each with its log Bayes factor of at least `least`.
pub fn courses(stack: &Stack, least: f64, sensors: &[Sensor]) -> Vec<(Unnamed, f64)> {
    let problem = stack.criterion.problem;
    let mut own: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (c, sums) in problem.sums.iter().enumerate() {
        let wanted = sensors.iter().any(|s| s.index() == sums.channel / 3);
        if wanted && sums.of_blocks() && !problem.parts[sums.log].white.layout.facts.rests {
            own.entry((sums.log, sums.channel / 3)).or_default().push(c);
        }
    }
    let found: Vec<Vec<courses::Found>> = own
        .into_par_iter()
        .map(|(_, channels)| courses::likeliest(stack, &channels, least))
        .collect();
    let unnamed = |found: courses::Found| {
        let origin = Origin::Course(found.channels, found.course);
        let asked = found.asked;
        (Unnamed { origin, asked }, found.ln_bayes)
    };
    found.into_iter().flatten().map(unnamed).collect()
}
