//! Other stacks that a fit should try: without one effect of a model, or with another one in its place.
//!
//! Effects are added one at a time, each when the others were still missing. Each is taken out in turn, to first order, and asked to come
//! back in competition with all candidates. Where columns say little of their full size this is no more than a proposal.

use crate::criterion::Criterion;
use crate::problem::Problem;
use crate::search::{self, Search, Weighed};

/// Share of an effect's log Bayes factor from which on a fit may show that another candidate explains more (0.74 for a reference that is 85
/// ms late, on a robot's arm; columns say that the accelerometer is).
pub const NEAR: f64 = 0.7;

/// An effect of the model that perhaps need not be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Revision {
    /// Its slot.
    pub slot: usize,
    /// Slot of the candidate that may do better in its place; `None` where the others may suffice.
    pub by: Option<usize>,
}

/// Effects among `members` of the model that may be needless, or that one of the candidates may replace.
pub fn revisions(problem: &Problem, model: &[usize], members: &[usize], candidates: &[usize]) -> Vec<Revision> {
    let curved = |slot: usize| problem.slots[slot].effect.strongly_curved();
    let sensors = |slot: usize| problem.slots[slot].effect.sensors();
    let of = |slot: &usize| {
        competition(problem, model, *slot, candidates, |search, weighed, own| {
            let best = weighed.iter().find(|w| search.there(w));
            let better = best.filter(|w| w.slot != *slot && w.ln_bayes > own + search.threshold);
            let near = |w: &&Weighed| {
                let shared = sensors(w.slot).iter().any(|s| sensors(*slot).contains(s));
                w.slot != *slot && curved(w.slot) && curved(*slot) && shared && w.testable && w.ln_bayes >= NEAR * own
            };
            let mut swaps: Vec<usize> = better
                .into_iter()
                .chain(weighed.iter().filter(near))
                .map(|w| w.slot)
                .collect();
            swaps.dedup();
            let drop = (curved(*slot) || own < search.threshold).then_some(None);
            let all = drop.into_iter().chain(swaps.into_iter().map(Some));
            Some(all.map(|by| Revision { slot: *slot, by }).collect::<Vec<_>>())
        })
    };
    members.iter().filter_map(of).flatten().collect()
}

/// The effect among `members` of the model that the others make needless most of all, to first order.
pub fn needless(problem: &Problem, model: &[usize], members: &[usize]) -> Option<usize> {
    let own = |slot| {
        competition(problem, model, slot, &[], |search, _, own| {
            Some((slot, own - search.threshold))
        })
    };
    let least = members
        .iter()
        .filter_map(|slot| own(*slot))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    least.filter(|(_, more)| *more < 0.0).map(|(slot, _)| slot)
}

/// Takes an effect out of the model and weighs it with all candidates beside the others; `decide` gets its own log Bayes factor last.
fn competition<T>(
    problem: &Problem,
    model: &[usize],
    slot: usize,
    candidates: &[usize],
    decide: impl FnOnce(&Search, &[Weighed], f64) -> Option<T>,
) -> Option<T> {
    let without = problem.taken_out(slot);
    let criterion = Criterion::new(&without);
    let offered: Vec<usize> = candidates.iter().copied().chain([slot]).collect();
    let search = Search::new(&criterion, &search::without(model, slot), &offered);
    let alone = search.stack(&[])?;
    let weighed = search.weigh_all(&alone, &[]);
    let own = weighed.iter().find(|w| w.slot == slot)?.ln_bayes;
    decide(&search, &weighed, own)
}
