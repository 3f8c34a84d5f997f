//! Drops and exchanges: whether each effect of a model is still needed beside the others, or another one does better in its place.
//!
//! Effects are added one at a time, each when the others were still missing. Each is taken out in turn, to first order, and asked to come
//! back in competition with all candidates.

use imufit_model::card::Found;

use crate::problem::Problem;
use crate::search::Search;
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
    members
        .iter()
        .copied()
        .filter(linear)
        .filter_map(|slot| revision(problem, model, slot, candidates))
        .collect()
}

fn revision(problem: &Problem, model: &[usize], slot: usize, candidates: &[usize]) -> Option<Revision> {
    let without = problem.taken_out(slot);
    let criterion = Criterion::new(&without);
    let others: Vec<usize> = model.iter().copied().filter(|s| *s != slot).collect();
    let offered: Vec<usize> = candidates.iter().copied().chain([slot]).collect();
    let search = Search::new(&criterion, &others, &offered);
    let weighed = search.weigh_all(&search.stack(&[])?, &[]);
    let own = weighed.iter().find(|w| w.slot == slot)?;
    let best = weighed.iter().find(|w| search.there(w));
    match best {
        Some(best) if best.slot != slot && best.ln_bayes > own.ln_bayes + search.threshold => Some(Revision {
            slot,
            by: Some(best.slot),
        }),
        _ if own.ln_bayes < search.threshold => Some(Revision { slot, by: None }),
        _ => None,
    }
}
