//! Candidates on top of a model: all of them weighed, and what it takes to pass.

use imufit_model::sensor_model::Slot;
use rayon::prelude::*;

use crate::problem::Problem;
use crate::screening::{self, Plausible, Screened, Weighed, parameters_of};

/// Chance of any false alarm over all candidates tried.
pub const ALPHA: f64 = 0.003;
/// Places of all parameters of some slots, in order.
pub fn indices(slots: &[Slot], chosen: &[usize]) -> Vec<usize> {
    let mut parameters = parameters_of(chosen.iter().map(|s| &slots[*s]));
    parameters.sort_unstable();
    parameters
}

/// Weighs all candidates on top of a model, and says how many shares of a false alarm those that can be tested have.
pub fn weigh_all(problem: &Problem, slots: &[Slot], model: &[usize], candidates: &[usize]) -> (Vec<Weighed>, f64) {
    let fitted = indices(slots, model);
    let base = screening::base(problem, &fitted);
    let weighed: Vec<Weighed> = candidates
        .par_iter()
        .map(|s| screening::weigh(problem, &fitted, &base, *s, &indices(slots, &[*s])))
        .collect();
    let tried = shares(slots, weighed.iter().map(Weighed::so_far));
    (weighed, tried)
}

/// Shares that the candidates which can be tested have of the chance of a false alarm.
pub fn shares<'a>(slots: &[Slot], answers: impl Iterator<Item = &'a Screened>) -> f64 {
    let testable = answers.filter(|s| s.testable);
    testable
        .map(|s| slots[s.slot].effect.card().shares)
        .sum::<f64>()
        .max(1.0)
}

/// Judges a weighed candidate; where a search went before, each of its trials counts.
pub fn judge(problem: &Problem, slots: &[Slot], fitted: &[usize], weighed: Weighed) -> Screened {
    let slot = weighed.so_far().slot;
    let mut screened = weighed.judged(problem, fitted, &indices(slots, &[slot]));
    screened.p_value = (screened.p_value * slots[slot].chances()).min(1.0);
    screened
}

/// Screens all candidates on top of a model: those that passed first, each group by held-out gain.
pub fn screen_all(
    problem: &Problem,
    slots: &[Slot],
    model: &[usize],
    candidates: &[usize],
) -> (Vec<Screened>, Vec<f64>) {
    let (weighed, tried) = weigh_all(problem, slots, model, candidates);
    let fitted = indices(slots, model);
    let judge = |w| judge(problem, slots, &fitted, w);
    let mut screened: Vec<Screened> = weighed.into_par_iter().map(judge).collect();
    let passed = |s: &Screened| passes(s, s.p_value * tried);
    screened.sort_by(|a, b| {
        passed(b)
            .cmp(&passed(a))
            .then(b.testable.cmp(&a.testable))
            .then(b.gain.total_cmp(&a.gain))
    });
    let adjusted = screened.iter().map(|s| (s.p_value * tried).min(1.0)).collect();
    (screened, adjusted)
}

/// The best candidate that passes on top of a model; none below it is judged.
pub fn best_of(problem: &Problem, slots: &[Slot], model: &[usize], candidates: &[usize]) -> Option<usize> {
    let (mut weighed, tried) = weigh_all(problem, slots, model, candidates);
    let fitted = indices(slots, model);
    weighed.sort_by(|a, b| b.so_far().gain.total_cmp(&a.so_far().gain));
    weighed
        .into_iter()
        .filter(|w| promising(w.so_far()))
        .map(|w| judge(problem, slots, &fitted, w))
        .find(|s| passes(s, s.p_value * tried))
        .map(|s| s.slot)
}

/// True if a candidate lowers the held-out error and is no chance finding.
pub fn significant(s: &Screened, adjusted: f64) -> bool {
    adjusted <= ALPHA && promising(s)
}

/// True if a candidate can be tested and lowers the held-out error, whitened and as it stands.
pub fn promising(s: &Screened) -> bool {
    s.testable && s.gain > 0.0 && s.held_out.1 < s.held_out.0
}

/// True if a candidate is significant, of a size that sensors have, and both halves of the log and all logs agree about it, but its
/// sign may be that of something else.
pub fn explains(s: &Screened, adjusted: f64) -> bool {
    let possible = matches!(s.plausible, Plausible::Yes | Plausible::OtherSign);
    significant(s, adjusted) && s.stable && possible && s.agreed()
}

/// True if a candidate explains something, and has the sign that it should have.
pub fn passes(s: &Screened, adjusted: f64) -> bool {
    explains(s, adjusted) && s.plausible == Plausible::Yes
}
