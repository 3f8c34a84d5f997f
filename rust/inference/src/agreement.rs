//! Do the logs agree about an effect? A log that disagrees is better predicted with a value of its own.

use imufit_fit::normal_equations::NormalEquations;
use nalgebra::{Cholesky, DMatrix, DVector};

use crate::asked::{Asked, Prior};
use crate::problem::indices;
use crate::search::{self, Search};
use crate::stack::Stack;

/// A difference of this much of the effect, squared, is no property of the sensor.
const WILD: f64 = 0.5;

/// A log that has another value of an effect than the others.
#[derive(Clone, Debug)]
pub struct Disagreement {
    /// Slot of the effect.
    pub slot: usize,
    /// The log.
    pub log: usize,
    /// The effect's parameters by this log, and their standard errors.
    pub own: Vec<(f64, f64)>,
    /// The same by the other logs.
    pub others: Vec<(f64, f64)>,
    /// Log Bayes factor of a value of its own.
    pub ln_bayes: f64,
    /// True if the difference is so large that the effect can't be called one of the sensor.
    pub wild: bool,
}

/// Equations of each log over all parameters; empty for one log, which has nobody to disagree with.
pub fn by_log(search: &Search) -> Vec<NormalEquations> {
    let problem = search.criterion.problem;
    let all: Vec<usize> = (0..problem.plausible.len()).collect();
    let logs = problem.parts.len();
    (0..if logs > 1 { logs } else { 0 })
        .map(|log| problem.equations.of_log(log, &all))
        .collect()
}

/// Logs that disagree about an effect beside the `members`, the one with most evidence first; of two logs both are named.
pub fn disagreements(
    search: &Search,
    equations: &[NormalEquations],
    members: &[usize],
    slot: usize,
) -> Vec<Disagreement> {
    let criterion = search.criterion;
    let problem = criterion.problem;
    // A value that the user has given is nothing that the logs have to agree about.
    let given = indices(&problem.slots, &[slot]).iter().any(|j| problem.standing[*j]);
    if equations.len() < 2 || problem.own[slot] || given {
        return Vec::new();
    }
    let others = search::without(members, slot);
    let in_model = search.model.contains(&slot);
    let with: Vec<usize> = others.iter().copied().chain((!in_model).then_some(slot)).collect();
    let Some(stack) = search.stack(&with) else {
        return Vec::new();
    };
    let having: Vec<usize> = (0..problem.parts.len())
        .filter(|log| problem.parts[*log].slots.contains(&slot))
        .collect();
    if having.len() < 2 {
        return Vec::new();
    }
    let least = search::threshold(having.len() * search.candidates.len().max(1));
    let found = having.iter().filter_map(|log| {
        let asked = Asked::of_logs(criterion, slot, &equations[*log], |other| other == *log);
        // What readings themselves tell beforehand no log has for itself.
        let ln = matches!(asked.prior, Prior::Normal(_)).then(|| stack.ln_bayes(&asked))?;
        (ln >= least).then_some((*log, ln, asked))
    });
    let Some((log, ln_bayes, asked)) = found.max_by(|a, b| a.1.total_cmp(&b.1)) else {
        return Vec::new();
    };
    // Beside the model alone: what else is there may be there only because the logs differ.
    let Some((own, rest, wild)) = search
        .stack_without(&[], slot)
        .and_then(|stack| values(search, &stack, slot, &asked))
    else {
        return Vec::new();
    };
    let named = |log: usize, own: &[(f64, f64)], others: &[(f64, f64)]| Disagreement {
        slot,
        log,
        own: own.to_vec(),
        others: others.to_vec(),
        ln_bayes,
        wild,
    };
    let mut out = vec![named(log, &own, &rest)];
    // Of two logs each differs as much from the other.
    if let [first, second] = having[..] {
        let other = if first == log { second } else { first };
        out.push(named(other, &rest, &own));
    }
    out
}

/// Values of an effect with their standard errors: by the log itself, and by the others.
type Values = (Vec<(f64, f64)>, Vec<(f64, f64)>, bool);

/// Values of an effect by one log and by the others, and whether they differ wildly.
fn values(search: &Search, stack: &Stack, slot: usize, own: &Asked) -> Option<Values> {
    let problem = search.criterion.problem;
    let shared = Asked::slot(search.criterion, slot);
    let Prior::Normal(deviation) = &shared.prior else {
        return None;
    };
    let m = deviation.len();
    let parameters = indices(&problem.slots, &[slot]);
    let both = shared.beside(own, &own.cross.select_rows(&parameters));
    let equations = stack.equations(&both)?;
    let scale = |k: usize| deviation[k % m];
    let scaled = DMatrix::from_fn(2 * m, 2 * m, |i, j| {
        equations.information[(i, j)] * scale(i) * scale(j) + if i == j { 0.01 } else { 0.0 }
    });
    let factor = Cholesky::new(scaled)?;
    let solved = factor.solve(&DVector::from_fn(2 * m, |k, _| equations.score[k] * scale(k)));
    let covariance = factor.inverse();
    // What the equations were taken at counts as well: only the rest is in the residual.
    let present = &problem.slots[slot].parameters;
    let held = |k: usize| if search.model.contains(&slot) { present[k] } else { 0.0 };
    let told = |k: usize, step: f64, variance: f64| (held(k) + step * scale(k), variance.max(0.0).sqrt() * scale(k));
    let of_others = (0..m).map(|k| told(k, solved[k], covariance[(k, k)]));
    let of_log = (0..m).map(|k| {
        let variance = covariance[(k, k)] + covariance[(m + k, m + k)] + 2.0 * covariance[(k, m + k)];
        told(k, solved[k] + solved[m + k], variance)
    });
    let size = |value: &dyn Fn(usize) -> f64| -> f64 {
        (0..m)
            .map(|k| value(k).powi(2) / covariance[(m + k, m + k)].max(f64::MIN_POSITIVE))
            .sum()
    };
    let difference = size(&|k| solved[m + k]);
    let common = size(&|k| solved[k] + held(k) / scale(k));
    Some((of_log.collect(), of_others.collect(), difference > WILD * common))
}
