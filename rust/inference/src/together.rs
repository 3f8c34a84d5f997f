//! Several missing effects at once: what only a set of them explains.
//!
//! With two effects missing, the best single one may be neither, and a true one may look different in the two halves of the log
//! because the other is not in the model. So effects are added whatever their halves say, those that the others make needless
//! are dropped, each is tried against all others in its place, and only then every one has to pass beside the rest.

use imufit_model::sensor_model::Slot;

use crate::problem::Problem;
use crate::screening::{self, Plausible, Screened};
use crate::selection::{indices, judge, passes, promising, significant, weigh_all};

/// More effects than this are no explanation.
const MOST: usize = 4;

/// Candidates that pass beside one another, the one that counts most first, each judged with the others in the model; empty
/// unless there are at least two.
pub fn find(problem: &Problem, slots: &[Slot], model: &[usize], candidates: &[usize]) -> Vec<Screened> {
    let search = Search {
        problem,
        slots,
        model,
        candidates,
        shares: candidates.iter().map(|s| slots[*s].effect.card().shares).sum(),
    };
    let mut members: Vec<usize> = Vec::new();
    let mut dropped: Vec<usize> = Vec::new();
    while let Some(next) = search.best_beside(&members, &dropped) {
        members.push(next);
        if members.len() > MOST {
            return Vec::new();
        }
        let needless: Vec<usize> = members[..members.len() - 1]
            .iter()
            .copied()
            .filter(|m| !search.needed(&members, *m))
            .collect();
        members.retain(|m| !needless.contains(m));
        dropped.extend(needless);
    }
    for place in 0..members.len() {
        let others: Vec<usize> = members.iter().copied().filter(|m| *m != members[place]).collect();
        if let Some(better) = search.best_beside(&others, &[]) {
            members[place] = better;
        }
    }
    if members.len() < 2 {
        return Vec::new();
    }
    let mut judged = Vec::new();
    for member in &members {
        match search.judged(&members, *member) {
            Some((screened, adjusted)) if passes(&screened, adjusted) => judged.push(screened),
            _ => return Vec::new(),
        }
    }
    judged.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    judged
}

/// What is searched.
struct Search<'a> {
    problem: &'a Problem,
    slots: &'a [Slot],
    model: &'a [usize],
    candidates: &'a [usize],
    /// Of the chance of a false alarm, of all candidates.
    shares: f64,
}

impl Search<'_> {
    fn stack(&self, members: &[usize], without: Option<usize>) -> Vec<usize> {
        let kept = members.iter().filter(|m| Some(**m) != without);
        self.model.iter().chain(kept).copied().collect()
    }

    /// The candidate that stands out most beside some others.
    fn best_beside(&self, members: &[usize], dropped: &[usize]) -> Option<usize> {
        let stack = self.stack(members, None);
        let taken = |c: &usize| stack.contains(c) || dropped.contains(c);
        let left: Vec<usize> = self.candidates.iter().copied().filter(|c| !taken(c)).collect();
        let (mut weighed, tried) = weigh_all(self.problem, self.slots, &stack, &left);
        let fitted = indices(self.slots, &stack);
        weighed.sort_by(|a, b| b.so_far().gain.total_cmp(&a.so_far().gain));
        weighed
            .into_iter()
            .filter(|w| promising(w.so_far()))
            .map(|w| judge(self.problem, self.slots, &fitted, w))
            .find(|s| s.plausible == Plausible::Yes && significant(s, s.p_value * tried))
            .map(|s| s.slot)
    }

    /// One of the members with the others in the model, and its p-value adjusted for all candidates.
    fn judged(&self, members: &[usize], member: usize) -> Option<(Screened, f64)> {
        let stack = self.stack(members, Some(member));
        let fitted = indices(self.slots, &stack);
        let base = screening::base(self.problem, &fitted);
        let own = indices(self.slots, &[member]);
        let weighed = screening::weigh(self.problem, &fitted, &base, member, &own);
        if !promising(weighed.so_far()) {
            return None;
        }
        let judged = judge(self.problem, self.slots, &fitted, weighed);
        let adjusted = (judged.p_value * self.shares).min(1.0);
        Some((judged, adjusted))
    }

    fn needed(&self, members: &[usize], member: usize) -> bool {
        self.judged(members, member)
            .is_some_and(|(judged, adjusted)| significant(&judged, adjusted))
    }
}
