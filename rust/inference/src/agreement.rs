//! Do the logs agree about an effect? Each log in turn is given a value of its own, and the same tests that ask whether an effect
//! is there ask whether that value differs from the one of the other logs.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::held_out;
use crate::jackknife;
use crate::problem::{Problem, Question};
use crate::screening;

/// Logs whose values of an effect differ by chance more often than this are taken to agree.
const ALPHA: f64 = 0.003;
/// Variance, in units of what is plausible, below which the difference of two logs counts as seen by both of them.
const SEEN: f64 = 0.25;
/// A difference of this much of the effect, squared, is no property of the sensor.
const WILD: f64 = 0.5;
/// Above this p-value nothing more needs to be asked.
const CLEARLY_CHANCE: f64 = 0.01;

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
    /// Chance of such a difference, adjusted for all that were asked.
    pub p_value: f64,
    /// True if the difference is so large that the effect can't be called one of the sensor.
    pub wild: bool,
}

/// One log against the others.
struct Compared {
    /// The question in which the log has a value of its own.
    question: Question,
    /// Directions (of those of the effect) in which both sides see the difference.
    seen: DMatrix<f64>,
    p_value: f64,
}

/// Compares a log with the others that share the `m` parameters before the last `own` ones of a question.
fn compared(question: &Question, first: usize, m: usize, log: usize) -> Option<Compared> {
    let free = question.with_own(log, first, &DMatrix::identity(m, m));
    let covariance = free.total().solve(&free.precision)?.covariance();
    let p = free.model;
    let eigen = covariance.view((p, p), (m, m)).into_owned().symmetric_eigen();
    let kept: Vec<usize> = (0..m).filter(|k| eigen.eigenvalues[*k] < SEEN).collect();
    if kept.is_empty() {
        return None;
    }
    let seen = eigen.eigenvectors.select_columns(&kept);
    let question_of_log = question.with_own(log, first, &seen);
    if !jackknife::possible(&question_of_log) {
        return None;
    }
    let mut p_value = screening::wald(&question_of_log, &question_of_log.total(), 1.0);
    if p_value <= CLEARLY_CHANCE {
        let base = held_out::held_out(question);
        let (gain, _) = held_out::gain(&base, &held_out::held_out(&question_of_log));
        p_value = if gain > 0.0 {
            screening::p_value(&question_of_log)
        } else {
            1.0
        };
    }
    Some(Compared {
        question: question_of_log,
        seen,
        p_value,
    })
}

impl Compared {
    /// Parameters of the effect by this log and by the others, and whether they differ wildly.
    fn told(&self, first: usize, directions: &DMatrix<f64>, whole: &DVector<f64>) -> Option<Told> {
        let (p, m, r) = (self.question.model, directions.ncols(), self.seen.ncols());
        let solved = self.question.total().solve(&self.question.precision)?;
        let covariance = solved.covariance();
        let own_covariance = covariance.view((p, p), (r, r)).into_owned();
        let inverse = Cholesky::new(own_covariance.clone())?;
        // How much more the blocks scatter than whitened noise does.
        let scatter = jackknife::jackknife(&self.question, 1)
            .map_or(1.0, |j| (inverse.solve(&j.covariance).trace() / r as f64).max(1.0));
        let difference = solved.solution.rows(p, r).into_owned();
        let size = |v: &DVector<f64>| v.dot(&inverse.solve(v));
        let wild = size(&difference) > WILD * size(&self.seen.tr_mul(whole));
        let shared = DMatrix::from_fn(m, p + r, |i, j| f64::from(u8::from(j == first + i)));
        let mut with_own = shared.clone();
        with_own.columns_mut(p, r).copy_from(&self.seen);
        let values = |pick: &DMatrix<f64>| -> Vec<(f64, f64)> {
            let to = directions * pick;
            let (value, spread) = (&to * &solved.solution, &to * &covariance * to.transpose());
            let error = |j: usize| (scatter * spread[(j, j)].max(0.0)).sqrt();
            (0..value.len()).map(|j| (value[j], error(j))).collect()
        };
        Some(Told {
            own: values(&with_own),
            others: values(&shared),
            wild,
        })
    }
}

struct Told {
    own: Vec<(f64, f64)>,
    others: Vec<(f64, f64)>,
    wild: bool,
}

/// An effect that logs disagree about.
#[derive(Clone, Debug)]
pub struct Differing {
    /// Its slot.
    pub slot: usize,
    /// Held-out gain where each log that disagrees has a value of its own, in units of the noise variance.
    pub gain: f64,
    /// The logs that disagree.
    pub logs: Vec<Disagreement>,
}

impl Differing {
    /// True if a log differs so much that the effect can't be called one of the sensor.
    pub fn wild(&self) -> bool {
        self.logs.iter().any(|d| d.wild)
    }
}

/// Logs that disagree about the effect of a slot on top of a model: the one that stands out most first, then whether the others
/// agree without it. Of two logs that differ both are named. `asked` is how many effects are asked about. `None` where all agree,
/// or nothing can be told.
pub fn differing(problem: &Problem, model: &[usize], slot: usize, asked: usize) -> Option<Differing> {
    if problem.parts.len() < 2 || problem.own[slot] {
        return None;
    }
    let candidate = screening::parameters_of(problem.slots.get(slot));
    if problem.known_values(&candidate).is_some() {
        return None;
    }
    let directions = problem.directions(model, &candidate);
    let (first, m) = (model.len(), directions.ncols());
    let mut question = problem.question(model, &candidate, &directions);
    let whole = question.solve(&question.total()).filter(|_| m > 0)?;
    let whole = whole.rows(first, m).into_owned();
    question.model = first + m;
    let mut left: Vec<usize> = (0..problem.parts.len())
        .filter(|log| problem.parts[*log].slots.contains(&slot))
        .collect();
    let mut logs = Vec::new();
    while left.len() > 1 {
        // Of two logs each differs as much from the other.
        let pair = left.len() == 2;
        let tested = if pair { &left[..1] } else { &left[..] };
        let answers: Vec<(usize, Compared)> = tested
            .iter()
            .filter_map(|log| Some((*log, compared(&question, first, m, *log)?)))
            .collect();
        let tried = (answers.len() * asked.max(1)) as f64;
        let Some((log, most)) = answers.into_iter().min_by(|a, b| a.1.p_value.total_cmp(&b.1.p_value)) else {
            break;
        };
        let p_value = (most.p_value * tried).min(1.0);
        let told = most.told(first, &directions, &whole).filter(|_| p_value <= ALPHA);
        let Some(Told { own, others, wild }) = told else {
            break;
        };
        let mut named = |log: usize, own: Vec<(f64, f64)>, others: Vec<(f64, f64)>| {
            logs.push(Disagreement {
                slot,
                log,
                own,
                others,
                p_value,
                wild,
            });
        };
        left.retain(|other| *other != log);
        named(log, own.clone(), others.clone());
        if pair {
            for other in &left {
                named(*other, others.clone(), own.clone());
            }
        }
        question = most.question;
        question.model = question.precision.len();
        if pair {
            break;
        }
    }
    (!logs.is_empty()).then(|| Differing {
        slot,
        gain: held_out::gain(&screening::base(problem, model), &held_out::held_out(&question)).0,
        logs,
    })
}
