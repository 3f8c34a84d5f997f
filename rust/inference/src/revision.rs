//! Drops and exchanges: whether each effect of a model is still needed beside the others, or another one does better in its place.
//!
//! Effects are added one at a time, each when the others were still missing. Each is taken out in turn, to first order, and asked to come
//! back in competition with all candidates.

use imufit_model::card::Found;

use crate::problem::Problem;
use crate::search::{self, Search, Weighed};
use crate::stack::Criterion;

/// An effect of the model that need not be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Revision {
    /// Its slot.
    pub slot: usize,
    /// Slot of the candidate that does better in its place; `None` where the others suffice.
    pub by: Option<usize>,
}

/// Effects among `members` of the model that are needless, or that one of the candidates had better replace.
pub fn revisions(problem: &Problem, model: &[usize], members: &[usize], candidates: &[usize]) -> Vec<Revision> {
    let linear = |slot: &usize| {
        let parameters = &problem.slots[*slot].effect.card().parameters;
        parameters.iter().all(|p| p.found != Found::Search)
    };
    let of = |slot| {
        competition(problem, model, slot, candidates, |search, weighed, own| {
            let best = weighed.iter().find(|w| search.there(w));
            match best {
                Some(best) if best.slot != slot && best.ln_bayes > own + search.threshold => Some(Revision {
                    slot,
                    by: Some(best.slot),
                }),
                _ if own < search.threshold => Some(Revision { slot, by: None }),
                _ => None,
            }
        })
    };
    members.iter().copied().filter(linear).filter_map(of).collect()
}

/// Candidates that explain at least a share of what an effect of the model explains in its place: where columns say little of their full
/// size, a fit may show that one of them explains more.
pub fn alike(problem: &Problem, model: &[usize], slot: usize, candidates: &[usize], share: f64) -> Vec<usize> {
    let near = competition(problem, model, slot, candidates, |_, weighed, own| {
        let near = |w: &&Weighed| w.slot != slot && w.testable && w.ln_bayes >= share * own;
        Some(weighed.iter().filter(near).map(|w| w.slot).collect())
    });
    near.unwrap_or_default()
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
    let weighed = search.weigh_all(&search.stack(&[])?, &[]);
    let own = weighed.iter().find(|w| w.slot == slot)?.ln_bayes;
    decide(&search, &weighed, own)
}
