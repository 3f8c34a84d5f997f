//! Swaps and drops: whether each effect of a model is still needed beside the others, or another one does better in its place.
//!
//! Effects are added one at a time, each when the others were still missing: what stood in for one of these is needless later, or less
//! apt than another. Each is taken out in turn, to first order, and asked to come back in competition with all candidates.

use imufit_model::card::Found;

use crate::held_out;
use crate::problem::Problem;
use crate::screening::Weighed;
use crate::selection::{indices, judge, passes, promising, significant, weigh_all};

/// Another effect does better if it gains so many standard errors more.
const BETTER: f64 = 2.0;

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
    let slots = problem.slots.as_slice();
    let without = problem.taken_out(slot);
    let others: Vec<usize> = model.iter().copied().filter(|s| *s != slot).collect();
    let offered: Vec<usize> = candidates.iter().copied().chain([slot]).collect();
    let (mut weighed, tried) = weigh_all(&without, slots, &others, &offered);
    let fitted = indices(slots, &others);
    let at = weighed.iter().position(|w| w.so_far().slot == slot)?;
    let own = weighed.swap_remove(at);
    let ahead = |w: &Weighed| {
        let (gain, error) = held_out::gain(own.held_out(), w.held_out());
        promising(w.so_far()) && gain > BETTER * error
    };
    let mut better: Vec<Weighed> = weighed.into_iter().filter(ahead).collect();
    better.sort_by(|a, b| b.so_far().gain.total_cmp(&a.so_far().gain));
    let by = better
        .into_iter()
        .map(|w| judge(&without, slots, &fitted, w))
        .find(|s| passes(s, s.p_value * tried))
        .map(|s| s.slot);
    if by.is_some() {
        return Some(Revision { slot, by });
    }
    let needed = promising(own.so_far()) && {
        let judged = judge(&without, slots, &fitted, own);
        significant(&judged, judged.p_value * tried)
    };
    (!needed).then_some(Revision { slot, by: None })
}
