//! Adequate, missing, ambiguous or unknown: decided here, once, from evidences alone.

use std::sync::Arc;

use imufit_model::sensor::Sensor;
use rayon::prelude::*;

use crate::agreement::{self, Disagreement};
use crate::criterion::Criterion;
use crate::decided::{self, Decided, Fitted};
use crate::dictionary::{self, Origin, Unnamed};
use crate::finding::{self, Finding};
use crate::held_out::{self, HeldOut};
use crate::problem::{Problem, indices};
use crate::search::{self, Plausible, Search, Weighed};
use crate::similarity;
use crate::stack::Stack;

/// The four answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Nothing that the data can show is missing.
    Adequate,
    /// One effect stands out.
    Missing,
    /// Two or more effects explain the data equally well here.
    Ambiguous,
    /// Something is missing that no effect of the catalogue explains.
    Unknown,
}

/// What became of a candidate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// It is there, or explains as much as one that is.
    Significant,
    /// The log shows that it is not there, or does not determine it.
    NotSignificant,
    /// The log cannot show it.
    NotTestable,
    /// It would have to be larger than sensors have it.
    TooLarge,
    /// It would have to have the other sign.
    OtherSign,
}

/// An effect that is not in the model.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Its slot.
    pub slot: usize,
    /// What became of it.
    pub status: Status,
    /// Log Bayes factor on top of the model alone.
    pub ln_bayes: f64,
    /// Probability that it is there, beside the others that are.
    pub probability: f64,
    /// Parameters and standard errors.
    pub parameters: Vec<(f64, f64)>,
    /// Size from which on each parameter would be seen in such a log as often as not.
    pub detectable: Vec<f64>,
    /// Held-out gain in units of the noise variance, and its standard error.
    pub gain: (f64, f64),
    /// Held-out residual over noise floor without and with it.
    pub held_out: (f64, f64),
}

/// What Gram matrices do not hold, and passes over the rows have found.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Log Bayes factors of candidates whose columns say little of their full size, from a fit with each of them and one without: those of
    /// one list decide which of them is there.
    pub fitted: Vec<Vec<Fitted>>,
    /// Candidates of which a fit keeps nothing that their columns promise: they are not there.
    pub refuted: Vec<usize>,
    /// Share of noise in the column of the log that a candidate reads.
    pub column_noise: Vec<(usize, f64)>,
    /// Lines of the spectrum and random telegraph noise of a residual.
    pub seen: Vec<Finding>,
    /// What an earlier answer to the same question, with the same candidates refuted, has named.
    pub named: Option<Named>,
}

/// Effects that are there beside one another, and what is left beside them: all of an answer that passes over the rows do not change.
#[derive(Clone, Debug)]
pub struct Named {
    /// Slots of the effects.
    members: Vec<usize>,
    /// Log Bayes factors of the unnamed causes beside the model alone.
    before: Vec<f64>,
    /// Unnamed causes beside these effects, be they the same all the time or not, the likeliest first.
    unexplained: Vec<Unexplained>,
    /// Effects of the model, of these or of the catalogue whose coefficient drifts or switches, by slot, and the log Bayes factors of that.
    varying: Vec<(usize, f64)>,
}

/// An unnamed cause beside the named effects.
#[derive(Clone, Debug)]
struct Unexplained {
    /// The cause.
    unnamed: Arc<Unnamed>,
    /// Log Bayes factor with one coefficient for all blocks: which cause describes the rest best.
    ln_bayes: f64,
    /// Log Bayes factor of what all blocks have in common, where the coefficient may vary from block to block: whether it is there.
    steady: f64,
}

impl Named {
    /// True if these can be an answer to an inquiry.
    fn is_of(&self, inquiry: &Inquiry) -> bool {
        let offered = |m: &usize| inquiry.search.candidates.contains(m);
        self.before.len() == inquiry.unnamed.len() && self.members.iter().all(offered)
    }
}

/// Answer to "which effect is missing?"
#[derive(Clone, Debug)]
pub struct Verdict {
    /// The answer.
    pub kind: Kind,
    /// What the evidence alone names, to be handed on when the same is asked with more knowledge.
    pub named: Named,
    /// Slot of the effect that stands out.
    pub best: Option<usize>,
    /// Slots of effects that explain the data as well.
    pub rivals: Vec<usize>,
    /// Every candidate: those that are there first, then by evidence.
    pub candidates: Vec<Candidate>,
    /// How much effects look like the best one: (slot, slot, correlation).
    pub correlations: Vec<(usize, usize, f64)>,
    /// Dependences that no named effect explains, most evidence first.
    pub findings: Vec<Finding>,
    /// Logs that disagree about an effect.
    pub disagreements: Vec<Disagreement>,
    /// True if they differ so much that there is no answer for all of them.
    pub spoilt: bool,
}

/// Share of all that is explained in the sensors of the best effect that named effects must have, or the answer is "unknown".
const NAMED_SHARE: f64 = 0.8;

/// Two columns may differ as by this many times their noise and still count as the same: noises of the shares v and w of their squares leave
/// the same columns a squared correlation of (1 - v) (1 - w).
const NOISE: f64 = 2.0;
/// Log odds by which a cause without a name is less likely than one of the catalogue, before the log is seen.
const UNNAMED: f64 = 5.0;

/// Everything that is asked of one problem.
struct Inquiry<'a> {
    search: Search<'a>,
    unnamed: Vec<Arc<Unnamed>>,
    threshold: f64,
}

impl Inquiry<'_> {
    /// True if an unnamed cause is there.
    fn holds(&self, left: &Unexplained) -> bool {
        left.steady >= self.threshold
    }

    /// Unnamed causes beside a stack: log Bayes factor of each of those with columns of their own.
    fn beside(&self, stack: &Stack) -> Vec<f64> {
        self.exceeding(stack, self.threshold, &Sensor::ALL)
    }

    /// The same, worked out in full only where they may exceed some value, and not at all where none of some sensors shows them.
    fn exceeding(&self, stack: &Stack, least: f64, sensors: &[Sensor]) -> Vec<f64> {
        let of = |unnamed: &Arc<Unnamed>| {
            let shown = sensors_of(self.search.criterion.problem, &unnamed.origin);
            if !shown.iter().any(|s| sensors.contains(s)) {
                return 0.0;
            }
            let most = stack.at_most(&unnamed.asked);
            if most < least {
                most
            } else {
                dictionary::ln_bayes(&self.search, stack, unnamed)
            }
        };
        self.unnamed.par_iter().map(of).collect()
    }

    /// Courses in time of some sensors beside a stack.
    fn courses(&self, stack: &Stack, least: f64, sensors: &[Sensor]) -> Vec<(Unnamed, f64)> {
        if self.unnamed.is_empty() {
            Vec::new()
        } else {
            dictionary::courses(stack, least, sensors)
        }
    }
}

/// Decides what is missing from the model made of the slots `model`, with the slots `candidates` to choose from; `probes` are never named.
/// `known` is what rows say besides. `None` if the equations cannot be solved.
pub fn decide(
    problem: &Problem,
    model: &[usize],
    candidates: &[usize],
    probes: &[usize],
    known: &Known,
) -> Option<Verdict> {
    let criterion = Criterion::new(problem);
    let mut search = Search::new(&criterion, model, candidates);
    search.refuted.clone_from(&known.refuted);
    let unnamed = if probes.is_empty() {
        Vec::new()
    } else {
        dictionary::fixed(&criterion, probes)
            .into_iter()
            .chain(dictionary::outsize(&search))
            .map(Arc::new)
            .collect()
    };
    let threshold = search::threshold(unnamed.len()) + UNNAMED;
    let inquiry = Inquiry {
        search,
        unnamed,
        threshold,
    };
    let alone = inquiry.search.stack(&[])?;
    let weighed = inquiry.search.weigh_all(&alone, &[]);
    let earlier = known.named.as_ref().filter(|named| named.is_of(&inquiry));
    let named = match earlier {
        Some(named) => named.clone(),
        None => named(&inquiry, &alone)?,
    };
    let Named {
        mut members,
        before,
        unexplained,
        varying,
    } = named.clone();
    let search = &inquiry.search;
    let stack = search.stack(&members)?;
    let acts = |slot: usize, sensor: &Sensor| problem.slots[slot].effect.sensors().contains(sensor);
    let cause = |unnamed: &Unnamed, ln: f64| (sensors_of(problem, &unnamed.origin), ln);
    let instead: Vec<Shown> = (inquiry.unnamed.iter().zip(&before))
        .map(|(unnamed, ln)| cause(unnamed, *ln))
        .collect();
    let of_slot = |(slot, ln): &(usize, f64)| (problem.slots[*slot].effect.sensors().to_vec(), *ln);
    let there = unexplained.iter().filter(|left| inquiry.holds(left));
    let left: Vec<Shown> = (there.map(|left| cause(&left.unnamed, left.steady)))
        .chain(varying.iter().map(of_slot))
        .collect();
    // What people see is the error: the effect that lowers it most comes first. None does that foretells worse than nothing: then the noise
    // is not what the evidence takes it for.
    let base = held_out_of(search, None);
    let foremost = |members: &[usize], unclear: &[Sensor]| {
        let error = |slot: &usize| {
            let in_doubt = unclear.iter().any(|s| acts(*slot, s));
            let with = held_out_of(search, Some(*slot));
            (held_out::gain(&base, &with).0 > 0.0).then_some((*slot, in_doubt, with.ratio))
        };
        let first = |a: &(usize, bool, f64), b: &(usize, bool, f64)| a.1.cmp(&b.1).then(a.2.total_cmp(&b.2));
        members.iter().filter_map(error).min_by(first).map(|(slot, ..)| slot)
    };
    // Where more is left than effects explain, their names are those of the nearest shapes.
    let mut unclear = unclear(&inquiry, &members, &instead, &left, &[]);
    let mut best = foremost(&members, &unclear);
    let mut settled: Vec<Decided> = Vec::new();
    let mut open: Vec<&[Fitted]> = known.fitted.iter().map(Vec::as_slice).collect();
    while let Some((first, place)) = best.and_then(|first| Some((first, decided::place(&open, first)?))) {
        let can = |slot: usize| weighed.iter().any(|w| w.slot == slot && w.plausible == Plausible::Yes);
        let Some(found) = Decided::by(open.remove(place), |slot| can(slot) || slot == first, search.threshold) else {
            // Where a fit confirms none that sensors can have, what it confirms has another cause.
            best = None;
            break;
        };
        members
            .iter_mut()
            .filter(|m| **m == first)
            .for_each(|m| *m = found.slot);
        let confirmed: Vec<Fitted> = settled.iter().chain([&found]).map(|d| (d.slot, d.ln_bayes)).collect();
        unclear = self::unclear(&inquiry, &members, &instead, &left, &confirmed);
        // What a fit puts in the place of the first need not lower the error as much.
        best = foremost(&members, &unclear).or(Some(found.slot));
        settled.push(found);
    }
    let mut rivals = best.map_or_else(|| Some(Vec::new()), |best| rivals_of(search, &members, best, known))?;
    let fits = settled.iter().find(|found| Some(found.slot) == best);
    if let Some(found) = fits {
        rivals.retain(|r| found.ln_of(*r).is_none());
        rivals.extend(&found.rivals);
    }
    let disagreements = disagreements(search, &members, &weighed);
    // What one log has alone spoils the answer only if there is no other. Of two logs nobody can say which is wrong.
    let spoilt = (disagreements.first())
        .is_some_and(|d| d.wild && (problem.parts.len() == 2 || best.is_none_or(|b| b == d.slot)));
    let kind = match best {
        _ if spoilt => Kind::Unknown,
        None if members.is_empty() && left.is_empty() && known.seen.is_empty() => Kind::Adequate,
        None => Kind::Unknown,
        Some(first) if unclear.iter().any(|s| acts(first, s)) => Kind::Unknown,
        Some(_) if rivals.is_empty() => Kind::Missing,
        Some(_) => Kind::Ambiguous,
    };
    let candidates = shown(search, &weighed, &members, best, &rivals, fits);
    let correlations = correlations(problem, model, best, &candidates);
    // Where something is left, the cause that describes it best is stated first, whichever has shown that it is there.
    let stated = unexplained.iter().filter(|_| !left.is_empty());
    let all: Vec<&Unnamed> = unexplained.iter().map(|cause| cause.unnamed.as_ref()).collect();
    let found = stated.flat_map(|cause| finding::told(problem, &stack, &cause.unnamed, cause.ln_bayes, &all));
    let differing = varying.iter().map(|(slot, ln)| finding::differs(problem, *slot, *ln));
    let mut findings: Vec<Finding> = known.seen.iter().cloned().chain(found).chain(differing).collect();
    findings.sort_by(|a, b| b.ln_bayes.total_cmp(&a.ln_bayes));
    let findings = finding::strongest(findings);
    Some(Verdict {
        kind,
        named,
        best,
        rivals,
        candidates,
        correlations,
        findings,
        disagreements,
        spoilt,
    })
}

/// Sensors that show a cause without a name, and its log Bayes factor.
type Shown = (Vec<Sensor>, f64);

/// Sensors in which named effects explain less than [`NAMED_SHARE`] of all that is explained, or less than one unnamed cause would in their
/// place (`instead`). `left`: unnamed causes beside them. `fitted`: members whose columns say little, and what each explains by a fit.
fn unclear(inquiry: &Inquiry, members: &[usize], instead: &[Shown], left: &[Shown], fitted: &[Fitted]) -> Vec<Sensor> {
    let search = &inquiry.search;
    let problem = search.criterion.problem;
    let all = search.evidence(members);
    let stack = &search.stack(members);
    let of = |sensor: &&Sensor| {
        let acts = |slot: &usize| problem.slots[*slot].effect.sensors().contains(sensor);
        let (own, others): (Vec<usize>, Vec<usize>) = members.iter().partition(|slot| acts(slot));
        // Effects of several sensors may need one another: what is lost without those of this sensor.
        let rest = search.evidence(&others);
        let columns = all - rest;
        let curved = |slot: usize| problem.slots[slot].effect.strongly_curved();
        // A fit may show that columns taken at one point promise too little; what it explains is less where others have explained a part.
        let by_fit = fitted.iter().filter(|(slot, _)| own.contains(slot) && curved(*slot));
        let named = by_fit
            .map(|(slot, ln)| search.evidence(&search::without(members, *slot)) + ln - rest)
            .fold(columns, f64::max);
        let most = |causes: &[Shown]| {
            let of_sensor = causes.iter().filter(|(sensors, _)| sensors.contains(sensor));
            of_sensor.map(|(_, ln)| *ln).fold(0.0, f64::max)
        };
        // What is left is weighed at the noise that is left. The first effects were found in the noise that the others made: at one noise
        // all are shares of one square.
        let own = indices(&problem.slots, &own);
        let at_last = stack
            .as_ref()
            .and_then(|stack| stack.ratio_of(&own))
            .map_or(named, |ln| ln.max(named));
        at_last < NAMED_SHARE * (at_last + most(left)) || named < NAMED_SHARE * (most(instead) - inquiry.threshold)
    };
    Sensor::ALL.iter().filter(of).copied().collect()
}

/// What the evidence names; `alone` is the stack of the model.
fn named(inquiry: &Inquiry, alone: &Stack) -> Option<Named> {
    let before = inquiry.beside(alone);
    let (members, left) = beside_unnamed(inquiry)?;
    let stack = inquiry.search.stack(&members)?;
    let unexplained = unexplained(inquiry, &members, &stack, &left);
    let definite = unexplained.iter().any(|left| inquiry.holds(left));
    let varying = varying(inquiry, &members, &stack, !definite);
    Some(Named {
        members,
        before,
        unexplained,
        varying,
    })
}

/// Causes without a name beside members, by evidence; `left` are the log Bayes factors of those with columns of their own.
fn unexplained(inquiry: &Inquiry, members: &[usize], stack: &Stack, left: &[f64]) -> Vec<Unexplained> {
    let fixed = |(unnamed, ln_bayes): (&Arc<Unnamed>, &f64)| {
        let steady = || dictionary::varying(&inquiry.search, stack, members, unnamed);
        (*ln_bayes >= inquiry.threshold).then(|| Unexplained {
            unnamed: unnamed.clone(),
            ln_bayes: *ln_bayes,
            steady: ln_bayes.min(steady()),
        })
    };
    let fixed: Vec<Unexplained> = inquiry.unnamed.par_iter().zip(left).filter_map(fixed).collect();
    let courses = inquiry.courses(stack, inquiry.threshold, &Sensor::ALL);
    let courses = courses.into_iter().map(|(course, ln_bayes)| Unexplained {
        unnamed: Arc::new(course),
        ln_bayes,
        steady: ln_bayes,
    });
    let mut found: Vec<Unexplained> = fixed.into_iter().chain(courses).collect();
    found.sort_by(|a, b| b.ln_bayes.total_cmp(&a.ln_bayes));
    found
}

/// Effects whose coefficient drifts or switches, with the log Bayes factors of that: a cause without a name, be the effect there or not. All
/// effects are asked where nothing more definite is left (`all`); those of one sensor suffice, since each sensor shows on its own what drifts in
/// several.
fn varying(inquiry: &Inquiry, members: &[usize], stack: &Stack, all: bool) -> Vec<(usize, f64)> {
    let search = &inquiry.search;
    let slots = &search.criterion.problem.slots;
    let of_one = |slot: &&usize| members.contains(slot) || slots[**slot].effect.sensors().len() == 1;
    let asked: Vec<usize> = if all {
        search.model.iter().chain(&search.candidates).copied().collect()
    } else {
        members.to_vec()
    };
    (asked.par_iter().filter(of_one))
        .map(|slot| (*slot, search.varying(stack, members, *slot).varies))
        .filter(|(_, ln)| *ln >= inquiry.threshold)
        .collect()
}

/// Effects that are there beside one another and beside unnamed causes, and the log Bayes factors of these.
fn beside_unnamed(inquiry: &Inquiry) -> Option<(Vec<usize>, Vec<f64>)> {
    let search = &inquiry.search;
    let (mut members, mut stack) = search.find()?;
    let all = members.clone();
    members.retain(|m| !search.of_unseen_motion(&stack, &all, *m));
    if members.len() < all.len() {
        stack = search.stack(&members)?;
    }
    // What varies from block to block is no property of the sensor.
    loop {
        let least = members
            .par_iter()
            .map(|m| (*m, search.varying(&stack, &members, *m).common))
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match least {
            Some((member, ln)) if ln < search.threshold => members.retain(|m| *m != member),
            _ => break,
        }
        stack = search.stack(&members)?;
    }
    // A named effect must be there beside the likeliest unnamed cause too, not only in its place.
    loop {
        let left = inquiry.beside(&stack);
        match stands_in(inquiry, &members, &stack, &left) {
            Some(unneeded) => members.retain(|m| *m != unneeded),
            None => return Some((members, left)),
        }
        stack = search.stack(&members)?;
    }
}

/// What a log disagrees with the others about, by most evidence, be the effect in the model, there, or there in one log alone. The others
/// are asked again without it.
fn disagreements(search: &Search, members: &[usize], weighed: &[Weighed]) -> Vec<Disagreement> {
    let equations = agreement::by_log(search);
    let there = |w: &&Weighed| search.explains(w) && !members.contains(&w.slot);
    let in_part = weighed.iter().filter(there).map(|w| w.slot);
    let asked = search.model.iter().chain(members).copied().chain(in_part);
    asked
        .map(|slot| agreement::disagreements(search, &equations, members, slot))
        .filter(|found| !found.is_empty())
        .max_by(|a, b| a[0].ln_bayes.total_cmp(&b[0].ln_bayes))
        .unwrap_or_default()
}

/// A member that is not there any more once the likeliest unnamed cause is: Bayes factors beside one another follow from those of
/// each with and without the other.
fn stands_in(inquiry: &Inquiry, members: &[usize], stack: &Stack, left: &[f64]) -> Option<usize> {
    let search = &inquiry.search;
    let problem = search.criterion.problem;
    members.iter().copied().find(|member| {
        let others = search::without(members, *member);
        let Some(without) = search.stack(&others) else {
            return false;
        };
        let own = search.weigh(&without, *member).map_or(0.0, |w| w.ln_bayes);
        let replaced = |instead: f64, beside: f64| {
            let likelier = instead - inquiry.threshold > own - search.threshold;
            instead >= inquiry.threshold && likelier && beside + own - instead < search.threshold
        };
        // What has less evidence than the member takes no place.
        let least = (own - search.threshold).max(0.0) + inquiry.threshold;
        let sensors = problem.slots[*member].effect.sensors();
        let instead = inquiry.exceeding(&without, least, sensors);
        // Bins of one log among several show no property of the sensor.
        let common = |k: usize| !matches!(inquiry.unnamed[k].origin, Origin::Bins(_)) || problem.parts.len() == 1;
        // A cause that only fluctuates from block to block takes no place.
        let fixed = (0..left.len()).filter(|k| replaced(instead[*k], left[*k])).any(|k| {
            let steady = dictionary::varying(search, &without, &others, &inquiry.unnamed[k]).min(instead[k]);
            if common(k) {
                steady >= inquiry.threshold
            } else {
                replaced(steady, left[k])
            }
        });
        fixed
            || inquiry
                .courses(&without, least, sensors)
                .iter()
                .any(|(course, instead)| replaced(*instead, stack.ln_bayes(&course.asked) - course.asked.trials))
    })
}

/// Candidates in whose presence the best one is no longer there, or whose columns differ from its by no more than their own noise.
fn rivals_of(search: &Search, members: &[usize], best: usize, known: &Known) -> Option<Vec<usize>> {
    let others = search::without(members, best);
    let rest = search.stack(&others)?;
    let weighed = search.weigh_all(&rest, members);
    let own = search.weigh(&rest, best)?;
    let possible = |w: &&Weighed| {
        let sign = matches!(w.plausible, Plausible::Yes | Plausible::OtherSign);
        sign && search.explains(w)
    };
    let rivals = weighed.iter().filter(possible).filter(|w| {
        let with: Vec<usize> = others.iter().copied().chain([w.slot]).collect();
        let beside = search.stack(&with).and_then(|stack| search.weigh(&stack, best));
        let alike = search.fit(&rest, best) - search.fit(&rest, w.slot) <= search.threshold;
        let replaced = alike && beside.is_some_and(|b| b.ln_bayes < search.threshold);
        replaced || same_but_noise(search, &others, &own, w.slot, known)
    });
    Some(rivals.map(|w| w.slot).collect())
}

/// True if the columns of two effects differ by no more than their own noise: a thermometer that is noisier than an ammeter says nothing
/// of which of the two moves a zero.
fn same_but_noise(search: &Search, others: &[usize], best: &Weighed, slot: usize, known: &Known) -> bool {
    let noise = |slot: usize| {
        known
            .column_noise
            .iter()
            .find(|(s, _)| *s == slot)
            .map_or(0.0, |(_, v)| *v)
    };
    let same = (1.0 - noise(best.slot)) * (1.0 - noise(slot));
    if same >= 1.0 {
        return false;
    }
    let problem = search.criterion.problem;
    let slots = problem.slots.as_slice();
    let fitted = search.columns(others);
    let beta: Vec<f64> = best.parameters.iter().map(|p| p.0).collect();
    let (own, theirs) = (indices(slots, &[best.slot]), indices(slots, &[slot]));
    let correlation = similarity::correlation(problem, &fitted, &own, &beta, &theirs);
    correlation * correlation >= same.powf(NOISE)
}

/// Sensors whose readings show an unnamed cause.
fn sensors_of(problem: &Problem, origin: &Origin) -> Vec<Sensor> {
    match origin {
        Origin::Probe(slot) | Origin::Outsize(slot) => problem.slots[*slot].effect.sensors().to_vec(),
        Origin::Bins(parts) => vec![Sensor::ALL[parts[0].0 / 3]],
        Origin::Course(places, _) => vec![Sensor::ALL[problem.sums[places[0]].channel / 3]],
    }
}

/// Held-out error of the model, alone or with a candidate.
fn held_out_of(search: &Search, candidate: Option<usize>) -> HeldOut {
    let problem = search.criterion.problem;
    let model = problem.fitted(&search.model);
    let own = candidate.map_or_else(Vec::new, |slot| indices(&problem.slots, &[slot]));
    let question = match problem.known_values(&own) {
        Some(values) => problem.question_given(&model, &own, &values),
        None => problem.question(&model, &own),
    };
    held_out::held_out(&question)
}

/// What is shown of every candidate.
fn shown(
    search: &Search,
    weighed: &[Weighed],
    members: &[usize],
    best: Option<usize>,
    rivals: &[usize],
    fits: Option<&Decided>,
) -> Vec<Candidate> {
    let base = held_out_of(search, None);
    let stack = search.stack(members);
    let mut found: Vec<Candidate> = weighed
        .par_iter()
        .map(|w| {
            let with = held_out_of(search, Some(w.slot));
            let there = members.contains(&w.slot);
            // Where none stands out, none is named.
            let named = best.is_some() && (there || (rivals.contains(&w.slot) && w.plausible == Plausible::Yes));
            let status = if named {
                Status::Significant
            } else if !w.testable {
                Status::NotTestable
            } else if w.ln_bayes < search.threshold {
                Status::NotSignificant
            } else {
                match w.plausible {
                    Plausible::TooLarge => Status::TooLarge,
                    Plausible::OtherSign => Status::OtherSign,
                    Plausible::Yes | Plausible::No => Status::NotSignificant,
                }
            };
            let others = search::without(members, w.slot);
            let of_others = if there { search.stack(&others) } else { None };
            let beside = of_others.as_ref().or(stack.as_ref());
            // Odds against one of so many that nobody has heard of yet.
            let odds = beside
                .and_then(|stack| search.weigh(stack, w.slot))
                .map_or(0.0, |w| w.ln_bayes)
                - search.trials();
            Candidate {
                slot: w.slot,
                status,
                ln_bayes: w.ln_bayes,
                probability: if w.testable { 1.0 / (1.0 + (-odds).exp()) } else { 0.0 },
                parameters: w.parameters.clone(),
                detectable: beside.map_or_else(Vec::new, |stack| search.detectable(stack, w.slot)),
                gain: held_out::gain(&base, &with),
                held_out: (base.ratio, with.ratio),
            }
        })
        .collect();
    if let Some(rest) = best.and_then(|best| search.stack(&search::without(members, best))) {
        let of_fit = |slot: usize| fits.and_then(|found| found.ln_of(slot));
        let beside_rest = |slot: usize| search.weigh(&rest, slot).map_or(f64::NEG_INFINITY, |w| w.ln_bayes);
        let evidence = |slot: &usize| (*slot, of_fit(*slot).unwrap_or_else(|| beside_rest(*slot)));
        let alike: Vec<(usize, f64)> = best.iter().chain(rivals).map(evidence).collect();
        share(&mut found, &alike);
    }
    let rank = |c: &Candidate| {
        (
            Some(c.slot) != best,
            c.status != Status::Significant,
            c.status == Status::NotTestable,
        )
    };
    found.sort_by(|a, b| rank(a).cmp(&rank(b)).then(b.ln_bayes.total_cmp(&a.ln_bayes)));
    found
}

/// Lets the best effect and its rivals share the probability, each by its log evidence in the place of the others.
fn share(found: &mut [Candidate], alike: &[(usize, f64)]) {
    let most = alike.iter().map(|(_, ln)| *ln).fold(f64::NEG_INFINITY, f64::max);
    let of = |slot: usize| {
        alike
            .iter()
            .find(|(of, _)| *of == slot)
            .map(|(_, ln)| (ln - most).exp())
    };
    let total: f64 = alike.iter().filter_map(|(slot, _)| of(*slot)).sum();
    let all = (found.iter().filter(|c| of(c.slot).is_some()))
        .map(|c| c.probability)
        .fold(0.0, f64::max);
    for candidate in found {
        if let Some(part) = of(candidate.slot) {
            candidate.probability = all * part / total.max(f64::MIN_POSITIVE);
        }
    }
}

/// How much candidates with evidence look like the best one.
fn correlations(
    problem: &Problem,
    model: &[usize],
    best: Option<usize>,
    candidates: &[Candidate],
) -> Vec<(usize, usize, f64)> {
    let Some(first) = best.and_then(|b| candidates.iter().find(|c| c.slot == b)) else {
        return Vec::new();
    };
    let slots = problem.slots.as_slice();
    let beta: Vec<f64> = first.parameters.iter().map(|p| p.0).collect();
    let (fitted, own) = (problem.free(model), indices(slots, &[first.slot]));
    let asked = candidates.iter().filter(|c| c.slot != first.slot && c.ln_bayes > 0.0);
    asked
        .map(|c| {
            let theirs = indices(slots, &[c.slot]);
            let correlation = similarity::correlation(problem, &fitted, &own, &beta, &theirs);
            (first.slot, c.slot, correlation)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(slot: usize, ln_bayes: f64, probability: f64) -> Candidate {
        Candidate {
            slot,
            status: Status::Significant,
            ln_bayes,
            probability,
            parameters: Vec::new(),
            detectable: Vec::new(),
            gain: (1.0, 0.1),
            held_out: (2.0, 1.0),
        }
    }

    #[test]
    fn rivals_share_by_their_evidence_in_each_others_place_and_not_alone() {
        // Alone the second explains far more: what else is missing is charged to it.
        let mut found = [
            candidate(0, 20.0, 0.99),
            candidate(1, 200.0, 1.0),
            candidate(2, 50.0, 0.9),
        ];
        share(&mut found, &[(0, 31.0), (1, 30.0)]);
        let odds = found[0].probability / found[1].probability;
        assert!((odds - 1.0_f64.exp()).abs() < 1e-9);
        assert!((found[0].probability + found[1].probability - 1.0).abs() < 1e-12);
        assert!((found[2].probability - 0.9).abs() < 1e-12);
    }

    #[test]
    fn a_fit_that_refutes_a_rival_leaves_it_nothing() {
        let mut found = [candidate(0, 20.0, 0.99), candidate(1, 200.0, 1.0)];
        share(&mut found, &[(0, 31.0), (1, f64::NEG_INFINITY)]);
        assert!((found[0].probability - 1.0).abs() < 1e-12);
        assert!(found[1].probability.abs() < 1e-12);
    }
}
