//! Which effects of the catalogue stand beside one another: added, dropped and exchanged by their evidence alone.

use std::collections::HashMap;
use std::f64::consts::LN_2;
use std::sync::Arc;

use imufit_fit::part::Part;
use imufit_model::card::Stage;
use imufit_model::effect::Sign;
use imufit_model::sensor::Sensor;
use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use crate::asked::{Asked, Prior};
use crate::criterion::Criterion;
use crate::problem::Question;
use crate::problem::indices;
use crate::recent::Recent;
use crate::stack::{Stack, ln_prior, log_sum_exp};
use crate::varying::{self, Varying};

/// Log odds that something is there before a name is given: one false name in a thousand logs, were all components of the noise right.
pub const ODDS: f64 = 2.0;
/// More effects at once are no explanation; whole sensors have seven.
const MOST: usize = 12;
/// Stacks that a search keeps: of 189 that a ladder asks for, 83 are different, and one takes some megabytes.
const KEPT: usize = 8;
/// Rounds of exchanges; each must raise the evidence.
const ROUNDS: usize = 3;
/// Log Bayes factors at the likeliest noise and integrated over it differ by less than this: the noise that a stack leaves out explains no more.
const DOUBT: f64 = 50.0;
/// Log odds against a sign that sensors hardly ever have: one in a hundred seems to be early, where stamps are late.
const OTHER_SIGN: f64 = 4.6;
/// Hardly any sensor has an effect this many times its prior deviation.
const BEYOND: f64 = 20.0;
/// Variance of the scatter of block means, over that of the noise of their samples, from which on a body that nobody watches translates: what
/// other missing effects leave of their second order scatters by 0.2.
const TRANSLATES: f64 = 1.0;
/// Variance that gains of a tenth, still missing, leave of what a candidate explains: the second order of the two.
const SECOND_ORDER: f64 = 0.01;
/// No axis reads so much of itself, or of another, too much.
const LARGEST_GAIN: f64 = 0.3;

/// A problem with what may be named and what the model holds.
pub struct Search<'a> {
    /// The criterion.
    pub criterion: &'a Criterion<'a>,
    /// Slots of the model.
    pub model: Vec<usize>,
    /// Slots of the candidates.
    pub candidates: Vec<usize>,
    /// Slots of candidates whose columns promise more than a fit keeps: they are not there.
    pub refuted: Vec<usize>,
    asked: HashMap<usize, Asked>,
    stacks: Recent<Option<Arc<Stack<'a>>>>,
    /// Log Bayes factor from which on a candidate is there: the odds against one of so many.
    pub threshold: f64,
}

/// Whether sensors can have what a candidate's parameters say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plausible {
    /// They can.
    Yes,
    /// With the other sign: it can be a rival, but is never named first.
    OtherSign,
    /// A parameter lies far beyond what such sensors have.
    TooLarge,
    /// A parameter has a sign that it cannot have.
    No,
}

/// One candidate beside a stack.
#[derive(Clone, Debug)]
pub struct Weighed {
    /// Its slot.
    pub slot: usize,
    /// Its log Bayes factor, trials of a search taken off.
    pub ln_bayes: f64,
    /// Parameters and standard errors.
    pub parameters: Vec<(f64, f64)>,
    /// Whether sensors can have such parameters.
    pub plausible: Plausible,
    /// True if the log determines any of its parameters better than one knows beforehand.
    pub testable: bool,
}

/// Members but one.
pub fn without(members: &[usize], slot: usize) -> Vec<usize> {
    members.iter().copied().filter(|m| *m != slot).collect()
}

/// Log Bayes factor from which on one of so many questions is answered with yes.
pub fn threshold(questions: usize) -> f64 {
    ODDS + (questions.max(1) as f64).ln()
}

impl<'a> Search<'a> {
    /// Over the candidates of a problem.
    pub fn new(criterion: &'a Criterion<'a>, model: &[usize], candidates: &[usize]) -> Self {
        let asked = candidates.iter().map(|s| (*s, Asked::slot(criterion, *s))).collect();
        Self {
            criterion,
            model: model.to_vec(),
            candidates: candidates.to_vec(),
            refuted: Vec::new(),
            asked,
            stacks: Recent::new(KEPT),
            threshold: threshold(candidates.len()),
        }
    }

    /// Log of the number of candidates.
    pub fn trials(&self) -> f64 {
        self.threshold - ODDS
    }

    /// Prior deviations of the parameters of the model and of some members beside it.
    fn parameters(&self, members: &[usize]) -> Vec<(usize, f64)> {
        let problem = self.criterion.problem;
        let of_model = problem
            .free(&self.model)
            .into_iter()
            .map(|j| (j, 1.0 / problem.precision(j).sqrt()));
        let of_members = problem
            .free(members)
            .into_iter()
            .map(|j| (j, self.criterion.deviation(j)));
        of_model.chain(of_members).collect()
    }

    /// The stack of the model and some members.
    pub fn stack(&self, members: &[usize]) -> Option<Arc<Stack<'a>>> {
        self.stacks.of(members, || {
            Stack::new(self.criterion, &self.parameters(members)).map(Arc::new)
        })
    }

    /// The stack of the model and some members without one slot, be it in the model or a member.
    pub fn stack_without(&self, members: &[usize], slot: usize) -> Option<Stack<'a>> {
        let own = indices(&self.criterion.problem.slots, &[slot]);
        let others: Vec<(usize, f64)> = self
            .parameters(members)
            .into_iter()
            .filter(|(j, _)| !own.contains(j))
            .collect();
        Stack::new(self.criterion, &others)
    }

    /// The candidates with their columns.
    pub fn asked(&self) -> impl Iterator<Item = (usize, &Asked)> {
        self.candidates
            .iter()
            .filter_map(|slot| Some((*slot, self.asked.get(slot)?)))
    }

    /// One candidate beside a stack.
    pub fn weigh(&self, stack: &Stack, slot: usize) -> Option<Weighed> {
        let asked = self.asked.get(&slot)?;
        let ln_bayes = stack.ln_bayes(asked) - asked.trials;
        let equations = stack.equations(asked)?;
        let (parameters, testable) = match &asked.prior {
            Prior::Known(values) => {
                let v = DVector::from_column_slice(values);
                let seen = v.dot(&(&equations.information * &v)) > 1.0;
                (values.iter().map(|v| (*v, 0.0)).collect(), seen)
            }
            Prior::Normal(deviation) => estimated(&equations.information, &equations.score, deviation)?,
        };
        let plausible = self.plausible(slot, &parameters);
        Some(Weighed {
            slot,
            ln_bayes: if testable && plausible != Plausible::No {
                ln_bayes
            } else {
                0.0
            },
            parameters,
            plausible,
            testable,
        })
    }

    /// How much likelier a candidate at its best makes the log, see [`Stack::fit`].
    pub fn fit(&self, stack: &Stack, slot: usize) -> f64 {
        self.asked
            .get(&slot)
            .map_or(0.0, |asked| stack.fit(asked) - asked.trials)
    }

    /// For each parameter of a candidate the size from which on the candidate would be there as often as not.
    pub fn detectable(&self, stack: &Stack, slot: usize) -> Vec<f64> {
        self.asked
            .get(&slot)
            .map_or_else(Vec::new, |asked| stack.detectable(asked, self.threshold + asked.trials))
    }

    /// All candidates beside a stack, likeliest first.
    pub fn weigh_all(&self, stack: &Stack, without: &[usize]) -> Vec<Weighed> {
        let mut found: Vec<Weighed> = self
            .candidates
            .par_iter()
            .filter(|s| !without.contains(s))
            .filter_map(|s| self.weigh(stack, *s))
            .collect();
        found.sort_by(|a, b| b.ln_bayes.total_cmp(&a.ln_bayes));
        found
    }

    /// The candidate that is there with most evidence beside a stack. Those come first that may have most: what can have less than one that
    /// has been worked out need not be.
    pub fn likeliest(&self, stack: &Stack, without: &[usize]) -> Option<Weighed> {
        let offered = self.candidates.par_iter().filter(|s| !without.contains(s));
        let mut order: Vec<(usize, f64)> = offered
            .filter_map(|s| {
                let asked = self.asked.get(s)?;
                Some((*s, stack.at_most(asked) - asked.trials))
            })
            .filter(|(_, most)| *most >= self.threshold)
            .collect();
        order.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut best: Option<Weighed> = None;
        for (slot, most) in order {
            if best.as_ref().is_some_and(|b| b.ln_bayes >= most) {
                break;
            }
            let weighed = self.weigh(stack, slot).filter(|w| self.there(w));
            if let Some(weighed) = weighed
                && best.as_ref().is_none_or(|b| weighed.ln_bayes > b.ln_bayes)
            {
                best = Some(weighed);
            }
        }
        best
    }

    /// Whether sensors can have such parameters: signs and ranges that the effect declares.
    fn plausible(&self, slot: usize, parameters: &[(f64, f64)]) -> Plausible {
        let problem = self.criterion.problem;
        let of = &problem.slots[slot];
        let cards = &of.effect.card().parameters;
        let within = parameters.iter().enumerate().all(|(k, (value, error))| {
            let gain = cards[k % cards.len()].unit == "1";
            let most = BEYOND * problem.plausible[of.first + k];
            let limit = if gain { most.min(LARGEST_GAIN) } else { most };
            !problem.typical[of.first + k] || value.abs() - 3.0 * error <= limit
        });
        let negative = parameters.iter().any(|(value, error)| *value < -3.0 * error);
        match of.effect.sign() {
            Sign::Positive if negative => Plausible::No,
            _ if !within => Plausible::TooLarge,
            Sign::RatherPositive if negative => Plausible::OtherSign,
            _ => Plausible::Yes,
        }
    }

    /// True if a candidate says how the motion of the body acts on the accelerometer where this motion is not known: without a reference
    /// position a body that is on no rig may translate, which makes block means of the force scatter beside the candidate. `stack` is that of
    /// all members, the candidate among them.
    pub fn of_unseen_motion(&self, stack: &Stack, members: &[usize], slot: usize) -> bool {
        let problem = self.criterion.problem;
        let effect = &problem.slots[slot].effect;
        let by_motion = matches!(effect.card().stage, Stage::Time | Stage::Input) && effect.sensors() == [Sensor::Acc];
        let unknown = |part: &Part| {
            let facts = &part.white.layout.facts;
            facts.position_smoothing.is_none() && !facts.rests && facts.rig.is_none()
        };
        let scatter = |stack: &Stack| stack.strength(Sensor::Acc.index()).scatter;
        let alone = || {
            self.stack(&without(members, slot))
                .map_or(0.0, |others| scatter(&others))
        };
        by_motion && problem.parts.iter().any(unknown) && scatter(stack) >= TRANSLATES.max(SECOND_ORDER * alone())
    }

    /// True if a candidate is there.
    pub fn there(&self, weighed: &Weighed) -> bool {
        weighed.plausible == Plausible::Yes && self.explains(weighed)
    }

    /// True if a candidate explains as much as one that is there, whether sensors can have its parameters or not.
    pub fn explains(&self, weighed: &Weighed) -> bool {
        weighed.testable && weighed.ln_bayes >= self.threshold && !self.refuted.contains(&weighed.slot)
    }

    /// Log Bayes factors of an effect beside the members where it may vary from block to block as well; `stack` is that of all members.
    pub fn varying(&self, stack: &Stack, members: &[usize], slot: usize) -> Varying {
        let others = without(members, slot);
        match self.asked.get(&slot) {
            Some(asked) => self.varying_beside(stack, &others, slot, asked),
            // Beside the common part that the model fits.
            None => self.varying_beside(stack, &others, slot, &Asked::slot(self.criterion, slot)),
        }
    }

    /// The same of any slot beside some members; `stack` has the noise.
    pub fn varying_beside(&self, stack: &Stack, members: &[usize], slot: usize, asked: &Asked) -> Varying {
        let Prior::Normal(deviation) = &asked.prior else {
            return Varying::STEADY;
        };
        let problem = self.criterion.problem;
        let own = indices(&problem.slots, &[slot]);
        let columns: Vec<usize> = self.beside(stack, members).iter().map(|(j, _)| *j).collect();
        let question = problem.question(&columns, &own);
        self.varying_of(stack, members, question, deviation, asked.trials)
    }

    /// Parameters of the model and of some members.
    pub fn columns(&self, members: &[usize]) -> Vec<usize> {
        self.parameters(members).iter().map(|(j, _)| *j).collect()
    }

    /// Parameters of the model, of some members and of a heading that wanders as beside a stack, each with its prior deviation.
    pub fn beside(&self, stack: &Stack, members: &[usize]) -> Vec<(usize, f64)> {
        let heading = self.criterion.heading.iter().map(|j| (*j, stack.wanders()));
        let wandering = heading.filter(|(_, deviation)| *deviation > 0.0);
        self.parameters(members).into_iter().chain(wandering).collect()
    }

    /// The same of any question beside some members.
    pub fn varying_of(
        &self,
        stack: &Stack,
        members: &[usize],
        mut question: Question,
        deviation: &[f64],
        trials: f64,
    ) -> Varying {
        for (k, (_, deviation)) in self.beside(stack, members).iter().enumerate() {
            question.prior.precision[k] = deviation.powi(-2);
        }
        let strength = |sensor| stack.strength(sensor);
        varying::ln_bayes(&question, deviation, &self.criterion.modes, strength).map_or(Varying::STEADY, |found| {
            Varying {
                common: found.common - trials,
                ..found
            }
        })
    }

    /// The effects that are there beside one another, in the order in which they were found, and their stack.
    pub fn find(&self) -> Option<(Vec<usize>, Arc<Stack<'a>>)> {
        let mut members: Vec<usize> = Vec::new();
        let mut dropped: Vec<usize> = Vec::new();
        let mut stack = self.stack(&members)?;
        while members.len() < MOST {
            let without: Vec<usize> = members.iter().chain(&dropped).copied().collect();
            let weighed = self.weigh_all(&stack, &without);
            let Some(next) = weighed.iter().find(|w| self.there(w)) else {
                break;
            };
            members.push(next.slot);
            stack = self.stack(&members)?;
            let needless = self.needless(&stack, &members)?;
            if !needless.is_empty() {
                members.retain(|m| !needless.contains(m));
                stack = self.stack(&members)?;
                dropped.extend(needless);
            }
        }
        for _ in 0..ROUNDS {
            if !self.exchange(&mut members)? {
                break;
            }
            stack = self.stack(&members)?;
        }
        Some((members, stack))
    }

    /// Log of the marginal likelihood of the model and some members, with the prior density of these at their present values (Laplace's
    /// approximation); each of the candidates may be there or not, one as likely as the other.
    pub fn ln_evidence(&self, members: &[usize]) -> Option<f64> {
        let stack = self.stack(members)?;
        let weighed = self.weigh_all(&stack, members);
        let possible = weighed.iter().filter(|w| w.plausible == Plausible::Yes);
        let of = |w: &Weighed| log_sum_exp(&[0.0, w.ln_bayes]) - LN_2;
        let prior = |slot: &usize| {
            let asked = Asked::slot(self.criterion, *slot);
            let of = &self.criterion.problem.slots[*slot];
            let (values, first) = (&of.parameters, of.first);
            let density = match &asked.prior {
                Prior::Normal(deviation) => {
                    // What no fit moves is known, and costs nothing.
                    let open = |k: &usize| !self.criterion.problem.fixed[first + k];
                    let open: Vec<usize> = (0..values.len()).filter(open).collect();
                    let of = |all: &[f64]| open.iter().map(|k| all[*k]).collect::<Vec<f64>>();
                    ln_prior(&of(values), &of(deviation))
                }
                Prior::Known(_) => 0.0,
            };
            density + self.ln_possible(members, *slot, &asked) - asked.trials
        };
        Some(stack.ln_z + members.iter().map(prior).sum::<f64>() + possible.map(of).sum::<f64>())
    }

    /// Log of the probability that sensors have an effect of the sign and the size that it has at present.
    fn ln_possible(&self, members: &[usize], slot: usize, asked: &Asked) -> f64 {
        let of = &self.criterion.problem.slots[slot];
        if of.effect.sign() == Sign::Any || of.parameters.iter().all(|v| *v >= 0.0) {
            return 0.0;
        }
        let others = self.stack_without(members, slot);
        let error = |k: usize, information: &DMatrix<f64>| 1.0 / information[(k, k)].max(f64::MIN_POSITIVE).sqrt();
        let Some(equations) = others.and_then(|stack| stack.equations(asked)) else {
            return 0.0;
        };
        let parameters: Vec<(f64, f64)> = (of.parameters.iter().enumerate())
            .map(|(k, v)| (*v, error(k, &equations.information)))
            .collect();
        match self.plausible(slot, &parameters) {
            Plausible::No => f64::NEG_INFINITY,
            Plausible::OtherSign => -OTHER_SIGN,
            Plausible::Yes | Plausible::TooLarge => 0.0,
        }
    }

    /// Log evidence of some members over the model alone: each beside those before it.
    pub fn evidence(&self, members: &[usize]) -> f64 {
        let beside = |k: usize| {
            let stack = self.stack(&members[..k])?;
            self.weigh(&stack, members[k])
        };
        (0..members.len()).filter_map(beside).map(|w| w.ln_bayes).sum()
    }

    /// Members that the others make needless, but not the last one; `stack` is that of all members.
    fn needless(&self, stack: &Stack, members: &[usize]) -> Option<Vec<usize>> {
        let mut found = Vec::new();
        for member in &members[..members.len().saturating_sub(1)] {
            let parameters = indices(&self.criterion.problem.slots, &[*member]);
            let known = self.criterion.problem.known_values(&parameters).is_some();
            // What is far beyond doubt at the likeliest noise is so at any.
            if !known
                && stack
                    .ratio_of(&parameters)
                    .is_some_and(|ln| ln > self.threshold + DOUBT)
            {
                continue;
            }
            let others: Vec<usize> = members
                .iter()
                .copied()
                .filter(|m| m != member && !found.contains(m))
                .collect();
            let beside = self.stack(&others)?;
            let weighed = self.weigh(&beside, *member)?;
            if !self.there(&weighed) {
                found.push(*member);
            }
        }
        Some(found)
    }

    /// Puts a candidate in the place of a member where that raises the evidence; whether any was.
    fn exchange(&self, members: &mut [usize]) -> Option<bool> {
        let mut any = false;
        for place in 0..members.len() {
            let others = without(members, members[place]);
            let beside = self.stack(&others)?;
            let best = self.likeliest(&beside, &others);
            if let Some(best) = best.filter(|w| w.slot != members[place]) {
                members[place] = best.slot;
                any = true;
            }
        }
        Some(any)
    }
}

/// Estimates and standard errors from equations, and whether any direction of them is determined by the log.
fn estimated(information: &DMatrix<f64>, score: &DVector<f64>, deviation: &[f64]) -> Option<(Vec<(f64, f64)>, bool)> {
    let m = score.len();
    // A hundredth of the prior's information decides only where the log does not.
    let scaled = DMatrix::from_fn(m, m, |i, j| information[(i, j)] * deviation[i] * deviation[j]);
    let eigen = scaled.clone().symmetric_eigen();
    let testable = eigen.eigenvalues.iter().any(|l| *l > 1.0);
    let factor = Cholesky::new(scaled + DMatrix::identity(m, m) * 0.01)?;
    let right = DVector::from_fn(m, |j, _| score[j] * deviation[j]);
    let solved = factor.solve(&right);
    let covariance = factor.inverse();
    let parameters = (0..m).map(|j| {
        (
            solved[j] * deviation[j],
            covariance[(j, j)].max(0.0).sqrt() * deviation[j],
        )
    });
    Some((parameters.collect(), testable))
}
