//! Adequate, missing, ambiguous or unknown: the only place where this is decided.

use std::collections::BTreeMap;

use imufit_model::rest_channels;
use imufit_model::sensor::{CHANNELS, Sensor};
use imufit_model::sensor_model::Slot;
use rayon::prelude::*;

use crate::agreement::{self, Differing, Disagreement};
use crate::confounding;
use crate::dependence::{self, Dependence};
use crate::held_out::{self, HeldOut};
use crate::problem::Problem;
use crate::screening::{self, Plausible, Screened};
use crate::selection::{ALPHA, best_of, explains, indices, passes, screen_all, shares, significant};
use crate::{changes, together};

/// A named effect must explain this share of what depends on anything in its sensors, or the answer is "unknown".
const NAMED_SHARE: f64 = 0.8;
/// Share of the best one's gain that may be left of how a reading depends on the very quantity that it measures: more means that
/// its response is bent in a way that the catalogue lacks.
const BENT_OTHERWISE: f64 = 0.1;
/// The same if effects of one sensor have been taken to bend its response, as a series takes terms to follow any shape.
const BENT_IN_SERIES: f64 = 0.02;
/// Gains that seem too small by more than this part, because what they multiply is noisy, would show as dependences.
const ATTENUATED: f64 = 1e-4;
/// From how many effects on these are a series.
const SERIES: usize = 3;
/// A rival recovers at least this share of the best candidate's gain.
const RIVAL_SHARE: f64 = 0.5;
/// What logs disagree about spoils the answer if it explains this much more than the best candidate.
const CLEARLY_MORE: f64 = 1.1;
/// One dependence without a name is the cause if it alone explains this much more than all effects that would be named together.
const ALONE: f64 = 1.05;
/// Steps looked ahead to see whether named effects together explain the residual.
const LOOK_AHEAD: usize = 10;

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

impl Kind {
    /// The word used in results.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Adequate => "adequate",
            Self::Missing => "missing",
            Self::Ambiguous => "ambiguous",
            Self::Unknown => "unknown",
        }
    }
}

/// Answer to "which effect is missing?"
#[derive(Clone, Debug)]
pub struct Verdict {
    /// The answer.
    pub kind: Kind,
    /// Slot of the best candidate that passed.
    pub best: Option<usize>,
    /// Slots of candidates that explain the data as well.
    pub rivals: Vec<usize>,
    /// Every candidate, best held-out gain first, those that passed before those that did not.
    pub screened: Vec<Screened>,
    /// p-values adjusted for all candidates tried, in the order of `screened`.
    pub adjusted: Vec<f64>,
    /// Correlation of each passing candidate's signal with the others': (slot, slot, correlation).
    pub correlations: Vec<(usize, usize, f64)>,
    /// Dependences that no named effect explains.
    pub unexplained: Vec<Dependence>,
    /// Slots that forward selection would add, one after the other.
    pub path: Vec<usize>,
    /// Logs that disagree about the best candidate, about an effect of the model, or about one that only some of them show.
    pub disagreements: Vec<Disagreement>,
    /// True if they differ so much that there is no answer for all of them.
    pub spoilt: bool,
}

/// What logs disagree about, and whether that spoils the answer: a candidate that would bring more than the best one does, if
/// each log had a value of its own, or an effect of the model. If nothing of that kind, what logs disagree about besides all
/// that was found (`stack`).
fn disagreements(
    problem: &Problem,
    model: &[usize],
    stack: &[usize],
    candidates: &[usize],
    best: Option<&Screened>,
) -> (Vec<Disagreement>, bool) {
    if problem.parts.len() < 2 {
        return (Vec::new(), false);
    }
    let slots = problem.slots.as_slice();
    let without = |slot: usize| -> Vec<usize> { model.iter().copied().filter(|s| *s != slot).collect() };
    let of_model: Vec<Differing> = model
        .par_iter()
        .filter_map(|slot| agreement::differing(problem, &indices(slots, &without(*slot)), *slot, model.len()))
        .collect();
    let differing = |on: &[usize]| -> Vec<Differing> {
        let fitted = indices(slots, on);
        let asked: Vec<usize> = candidates.iter().copied().filter(|s| !on.contains(s)).collect();
        asked
            .par_iter()
            .filter_map(|slot| agreement::differing(problem, &fitted, *slot, asked.len()))
            .collect()
    };
    // Only the one that explains most: candidates that look like it would all be named.
    let most = |found: Vec<Differing>| {
        let wild = found.into_iter().filter(|d| d.wild() && d.gain > 0.0);
        wild.max_by(|a, b| a.gain.total_cmp(&b.gain))
    };
    let own = best.and_then(|best| best.differing.clone());
    let wanted = best.map_or(0.0, |best| CLEARLY_MORE * best.gain);
    // What logs disagree about in the model leaves traces that other effects could explain log by log.
    let offered = of_model.is_empty().then(|| most(differing(model))).flatten();
    let more = offered.filter(|d| d.gain > wanted);
    let spoilt = more.is_some() || of_model.iter().any(Differing::wild);
    let mut found: Vec<Disagreement> = of_model.into_iter().flat_map(|d| d.logs).collect();
    found.extend(more.or(own).map_or_else(Vec::new, |d| d.logs));
    if found.is_empty() && stack.len() > model.len() {
        found = most(differing(stack)).map_or_else(Vec::new, |d| d.logs);
    }
    (found, spoilt)
}

/// Decides what is missing from the model made of the slots `model`, with the slots `candidates` to choose from. What
/// nothing of these explains is asked of the slots `probes`, which are never named.
pub fn decide(problem: &Problem, model: &[usize], candidates: &[usize], probes: &[usize]) -> Verdict {
    let slots = problem.slots.as_slice();
    let (mut screened, mut adjusted) = screen_all(problem, slots, model, candidates);
    let single = settle(problem, model, candidates, probes, &screened, &adjusted, &[]);
    let best_gain = single.best.map_or(0.0, |b| gain_of(&screened, b));
    let hidden = |(s, a): (&Screened, &f64)| {
        significant(s, *a) && s.plausible == Plausible::Yes && !s.stable && s.gain > best_gain
    };
    let doubtful = single.kind == Kind::Unknown || screened.iter().zip(&adjusted).any(hidden);
    let mut settled = single;
    if doubtful {
        let members = together::find(problem, slots, model, candidates);
        if !members.is_empty() {
            let several = settle(problem, model, candidates, probes, &screened, &adjusted, &members);
            if several.kind != Kind::Unknown {
                settled = several;
                put_first(slots, &mut screened, &mut adjusted, members);
            }
        }
    }
    Verdict {
        kind: settled.kind,
        best: settled.best,
        rivals: settled.rivals,
        screened,
        adjusted,
        correlations: settled.correlations,
        unexplained: settled.unexplained,
        path: settled.path,
        disagreements: settled.disagreements,
        spoilt: settled.spoilt,
    }
}

fn gain_of(screened: &[Screened], slot: usize) -> f64 {
    screened.iter().find(|s| s.slot == slot).map_or(0.0, |s| s.gain)
}

/// Puts effects first that pass beside one another: what each brings alone stays, how sure it is comes from beside the others.
fn put_first(slots: &[Slot], screened: &mut Vec<Screened>, adjusted: &mut Vec<f64>, members: Vec<Screened>) {
    let tried = shares(slots, screened.iter());
    for member in members.into_iter().rev() {
        if let Some(at) = screened.iter().position(|s| s.slot == member.slot) {
            let alone = screened.remove(at);
            adjusted.remove(at);
            adjusted.insert(0, (member.p_value * tried).min(1.0));
            let (gain, gain_error) = (alone.gain, alone.gain_error);
            let (held_out, expected_ratio) = (alone.held_out, alone.expected_ratio);
            screened.insert(
                0,
                Screened {
                    gain,
                    gain_error,
                    held_out,
                    expected_ratio,
                    ..member
                },
            );
        }
    }
}

/// An answer on the way to the verdict.
struct Settled {
    kind: Kind,
    best: Option<usize>,
    rivals: Vec<usize>,
    correlations: Vec<(usize, usize, f64)>,
    unexplained: Vec<Dependence>,
    path: Vec<usize>,
    disagreements: Vec<Disagreement>,
    spoilt: bool,
}

/// What the screening says if the candidates `chosen`, which pass beside one another, are taken together; if there are none, the best
/// one that passes alone is taken.
fn settle(
    problem: &Problem,
    model: &[usize],
    candidates: &[usize],
    probes: &[usize],
    screened: &[Screened],
    adjusted: &[f64],
    chosen: &[Screened],
) -> Settled {
    let slots = problem.slots.as_slice();
    let passing: Vec<&Screened> = screened
        .iter()
        .zip(adjusted)
        .filter(|(s, a)| passes(s, **a))
        .map(|(s, _)| s)
        .collect();
    let first = chosen.first().or_else(|| passing.first().copied());
    let best = first.map(|s| s.slot);
    let others: Vec<usize> = chosen.iter().skip(1).map(|s| s.slot).collect();

    let mut path = Vec::new();
    let mut stack = model.to_vec();
    let mut next = best;
    let mut ready = others.iter().copied();
    while let Some(slot) = next {
        path.push(slot);
        stack.push(slot);
        if path.len() >= LOOK_AHEAD {
            break;
        }
        next = ready.next().or_else(|| {
            let left: Vec<usize> = candidates.iter().copied().filter(|c| !stack.contains(c)).collect();
            best_of(problem, slots, &stack, &left)
        });
    }

    // Rates that are noisy leave a gain in the residual, which is no dependence. (A specific force is hardly ever as noisy.)
    let gyroscope = |slot: &usize| slots[*slot].effect.sensors() == [Sensor::Gyr];
    let attenuated = problem.attenuated(ATTENUATED).into_iter().map(|(slot, _)| slot);
    let attenuated = attenuated.filter(|slot| gyroscope(slot) && !stack.contains(slot));
    let beside_noise: Vec<usize> = stack.iter().copied().chain(attenuated).collect();
    let fitted = indices(slots, &beside_noise);
    let channels: Vec<usize> = (0..CHANNELS).collect();
    let base = screening::base(problem, &fitted);
    let asked = [
        (dependence::test(problem, &fitted, &base, &channels), ALPHA),
        (dependence::test_probes(problem, &beside_noise, probes), ALPHA),
        (changes::test(problem, &fitted), changes::CAUTION * ALPHA),
        (
            changes::test_memories(problem, &fitted),
            changes::CAUTION_WITH_MEMORIES * ALPHA,
        ),
    ];
    let mut unexplained: Vec<Dependence> = asked
        .into_iter()
        .flat_map(|((found, tried), alpha)| found.into_iter().filter(move |d| d.p_value * tried as f64 <= alpha))
        .collect();
    like_with_like(slots, &mut unexplained);
    unexplained.sort_by(|a, b| b.on_channel.total_cmp(&a.on_channel));

    let beside: Vec<usize> = model.iter().chain(&others).copied().collect();
    let (rivals, correlations) = best.map_or_else(Default::default, |best| {
        rivals_of(problem, slots, &beside, candidates, screened, adjusted, best)
    });

    let (disagreements, spoilt) = disagreements(problem, model, &stack, candidates, first);
    let kind = match best {
        _ if spoilt => Kind::Unknown,
        None if unexplained.is_empty() && !screened.iter().zip(adjusted).any(|(s, a)| significant(s, *a)) => {
            Kind::Adequate
        }
        None => Kind::Unknown,
        Some(first) => {
            let sensors = slots[first].effect.sensors();
            let concerned = unexplained
                .iter()
                .filter(|d| told_of(problem, d).iter().any(|s| sensors.contains(s)));
            let left = left_by(concerned);
            let gain = if chosen.is_empty() {
                gain_of(screened, first)
            } else {
                let alone = screening::base(problem, &indices(slots, model));
                held_out::gain(&alone, &base).0
            };
            let series = (path.iter()).filter(|s| slots[**s].effect.sensors().iter().any(|s| sensors.contains(s)));
            let mut before = beside_noise.clone();
            before.retain(|slot| !path.contains(slot));
            let alone = better_alone(problem, &before, &base, &unexplained);
            let bent = left_by(unexplained.iter().filter(|d| of_own_quantity(problem, d, sensors)));
            let allowed = if series.count() >= SERIES {
                BENT_IN_SERIES
            } else {
                BENT_OTHERWISE
            };
            if alone || bent > allowed * gain || gain < NAMED_SHARE * (gain + left) {
                Kind::Unknown
            } else if rivals.is_empty() {
                Kind::Missing
            } else {
                Kind::Ambiguous
            }
        }
    };
    Settled {
        kind,
        best,
        rivals,
        correlations,
        unexplained,
        path,
        disagreements,
        spoilt,
    }
}

/// Gives probes that bins show too the worth of these: bins lose some of what columns of their own have, and would come after them
/// where another covariate is the cause.
fn like_with_like(slots: &[Slot], found: &mut [Dependence]) {
    let binned: Vec<(usize, String, f64)> = (found.iter())
        .filter(|d| d.probe.is_none())
        .map(|d| (d.channel, d.covariate.clone(), d.on_channel))
        .collect();
    for each in found.iter_mut() {
        if each.probe.is_some_and(|probe| slots[probe].effect.shown_by_bins()) {
            let same = (binned.iter()).find(|(channel, name, _)| *channel == each.channel && *name == each.covariate);
            each.on_channel = same.map_or(each.on_channel, |(_, _, gain)| each.on_channel.min(*gain));
        }
    }
}

/// True if one dependence without a name explains more on top of the slots `model` than all that leads to the error `left`.
fn better_alone(problem: &Problem, model: &[usize], left: &HeldOut, unexplained: &[Dependence]) -> bool {
    let slots = problem.slots.as_slice();
    let fitted = indices(slots, model);
    let before = screening::base(problem, &fitted);
    let (together, _) = held_out::gain(&before, left);
    unexplained.iter().filter_map(|d| d.probe).any(|probe| {
        let weighed = screening::weigh(problem, &fitted, &before, probe, &indices(slots, &[probe]));
        weighed.so_far().gain > ALONE * together
    })
}

/// What dependences are worth together: on each channel the one that brings most, since others there may be the same thing again.
fn left_by<'a>(found: impl Iterator<Item = &'a Dependence>) -> f64 {
    let mut most: BTreeMap<(Option<usize>, usize), f64> = BTreeMap::new();
    for each in found {
        let gain = most.entry((each.log, each.channel)).or_insert(0.0);
        *gain = gain.max(each.gain);
    }
    most.values().sum()
}

/// True if a channel of one of the sensors depends on the very quantity that it measures: its response is bent.
fn of_own_quantity(problem: &Problem, found: &Dependence, sensors: &[Sensor]) -> bool {
    let axis = ["x", "y", "z"][found.channel % 3];
    let own = match told_of(problem, found)[..] {
        [Sensor::Acc] => format!("f_{axis}"),
        [Sensor::Gyr] => format!("omega_{axis}"),
        _ => return false,
    };
    found.covariate == own && told_of(problem, found).iter().any(|s| sensors.contains(s))
}

/// Sensors that the channel of a dependence tells of.
fn told_of(problem: &Problem, found: &Dependence) -> Vec<Sensor> {
    let part = problem.parts.get(found.log.unwrap_or(0));
    if part.is_some_and(|part| part.white.layout.facts.rests) {
        rest_channels::sensors(found.channel).to_vec()
    } else {
        vec![Sensor::ALL[found.channel / 3]]
    }
}

/// Candidates that explain as well as the best what is left beside a model, and how much passing ones look like it.
fn rivals_of(
    problem: &Problem,
    slots: &[Slot],
    beside: &[usize],
    candidates: &[usize],
    screened: &[Screened],
    adjusted: &[f64],
    best: usize,
) -> (Vec<usize>, Vec<(usize, usize, f64)>) {
    let fitted = indices(slots, beside);
    let own = indices(slots, &[best]);
    let tried = shares(slots, screened.iter());
    let passing = |(s, a): &(&Screened, &f64)| passes(s, **a);
    let alone = (screened.iter().zip(adjusted).find(passing)).is_some_and(|(s, _)| s.slot == best);
    let others: Vec<Screened>;
    let compared: Vec<&Screened> = if alone {
        let all = screened.iter().zip(adjusted);
        all.filter(|(s, a)| explains(s, **a)).map(|(s, _)| s).collect()
    } else {
        // Beside other effects a candidate is worth something else than alone.
        let left: Vec<usize> = candidates.iter().copied().filter(|c| !beside.contains(c)).collect();
        let (all, adjusted) = screen_all(problem, slots, beside, &left);
        let all = all.into_iter().zip(adjusted).filter(|(s, a)| explains(s, *a));
        others = all.map(|(s, _)| s).collect();
        others.iter().collect()
    };
    let Some(first) = compared.iter().find(|s| s.slot == best) else {
        return Default::default();
    };
    let beta: Vec<f64> = first.parameters.iter().map(|p| p.0).collect();
    let (mut rivals, mut correlations) = (Vec::new(), Vec::new());
    for other in compared.iter().filter(|s| s.slot != best) {
        let theirs = indices(slots, &[other.slot]);
        let c = confounding::correlation(problem, &fitted, &own, &beta, &theirs);
        correlations.push((best, other.slot, c));
        if other.gain >= RIVAL_SHARE * first.gain
            && confounding::p_value_given(problem, &fitted, &theirs, &own) * tried * slots[other.slot].chances() > ALPHA
        {
            rivals.push(other.slot);
        }
    }
    (rivals, correlations)
}
