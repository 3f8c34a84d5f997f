//! The least-squares problem of a log, or of several of one sensor, block by block, in units of its noise.

use std::ops::Range;
use std::sync::Arc;

use imufit_fit::block_equations::{BlockEquations, Form};
use imufit_fit::block_sums::{self, ChannelSums};
use imufit_fit::bounded::{Bounds, Within};
use imufit_fit::evidence::Layout;
use imufit_fit::normal_equations::NormalEquations;
use imufit_fit::part::{self, Part};
use imufit_fit::whitening;
use imufit_model::card::{Affine, Found, Parameter};
use imufit_model::effect::Sign;
use imufit_model::sensor::Sensor;
use imufit_model::sensor_model::Slot;
use nalgebra::DVector;

use crate::stack::ROUNDING;

/// Evidence in the form that every question is asked of: the blocks of all logs, one log after the other.
pub struct Problem {
    /// The logs.
    pub parts: Arc<[Part]>,
    /// Effects of all logs, each with its place among the parameters.
    pub slots: Vec<Slot>,
    /// For each of them whether every log has its own parameters of it.
    pub own: Vec<bool>,
    /// For each log the place of each of its parameters.
    pub places: Vec<Vec<usize>>,
    /// Blocks of each log.
    pub logs: Arc<[Range<usize>]>,
    /// Equations of each block over any of the parameters.
    pub equations: BlockEquations,
    /// Plausible size of each parameter: three times what is typical, or what would be seen with a hundredfold margin.
    pub plausible: DVector<f64>,
    /// True where that comes from a typical size.
    pub typical: Vec<bool>,
    /// Value that a parameter of a candidate has if it is there at all: one that only a search finds, and that the readings themselves tell.
    pub known: Vec<Option<f64>>,
    /// Block sums of every channel of every log, for zeros that wander.
    pub sums: Vec<ChannelSums>,
    /// Parameters of the model that no fit moves.
    pub fixed: Vec<bool>,
    /// Parameters of the model that stand still: those that no fit moves, and those that would leave their bounds.
    pub standing: Vec<bool>,
    /// Bounds of the step of every parameter.
    pub bounds: Bounds,
}

/// What the user allows one parameter of an effect of the model.
#[derive(Clone, Copy, Debug)]
pub enum Limit {
    /// It stays as it is.
    Fixed,
    /// Its value stays between these two.
    Between(f64, f64),
}

/// A parameter that is limited: its slot, its number among those of the effect, and its limit.
pub type Limited = (usize, usize, Limit);

/// What is known of parameters before a log is seen.
pub struct Prior {
    /// Precision of each.
    pub precision: DVector<f64>,
    /// What it adds to the right-hand side of a step from where the evidence was taken: its mean is none of the effect.
    right: DVector<f64>,
}

/// Parameters that a question is about: those of the model, then those of a candidate.
pub struct Question {
    /// Whitened equations per block.
    pub white: Vec<NormalEquations>,
    /// Unwhitened equations per block.
    pub raw: Vec<NormalEquations>,
    /// What is known of each parameter.
    pub prior: Prior,
    /// Bounds of the step of each parameter, if there are any.
    pub bounds: Option<Bounds>,
    /// How many parameters belong to the model.
    pub model: usize,
    /// Block sums of every channel over the same parameters, for zeros that wander.
    pub sums: Vec<ChannelSums>,
    /// Blocks of each log: those of different logs are no neighbours.
    pub logs: Arc<[Range<usize>]>,
}

/// Plausible sizes are this many times the typical ones.
const PLAUSIBLE: f64 = 3.0;
/// Part of the prior precision of other questions that an estimate has for a parameter without typical size.
const OPEN: f64 = 0.01;
/// A parameter without typical size is given one at which its effect would stand out by this factor.
const STANDING_OUT: f64 = 100.0;

/// Typical size of each of `p` parameters in the log that has it, the largest where several share it; `None` if nobody can tell.
fn typical_sizes(parts: &[Part], places: &[Vec<usize>], p: usize) -> Vec<Option<f64>> {
    let mut sizes = vec![None; p];
    for (part, places) in parts.iter().zip(places) {
        let layout = &part.white.layout;
        for slot in layout.model.slots() {
            for k in 0..slot.parameters.len() {
                let size: &mut Option<f64> = &mut sizes[places[slot.first + k]];
                let own = slot.effect.typical(k, &layout.facts);
                *size = own.map(|own| size.map_or(own, |other: f64| other.max(own)));
            }
        }
    }
    sizes
}

/// Gives each channel at least so much noise that [`ROUNDING`] of what an effect of plausible size does to all of its rows is less than the
/// noise. Readings without any noise would make the former 1e7 times the prior's information.
fn keep_within_digits(part: &mut Part) {
    let layout = &part.white.layout;
    let sizes: Vec<f64> = (layout.model.slots().iter())
        .flat_map(|slot| (0..slot.parameters.len()).map(|k| slot.effect.typical(k, &layout.facts).unwrap_or(0.0)))
        .map(|typical| PLAUSIBLE * typical)
        .collect();
    for (channel, variance) in part.variance.iter_mut().enumerate() {
        if let Some((gram, _)) = part.white.total(channel, |_| 1.0) {
            let active = layout.model.active()[channel].iter().enumerate();
            let largest = active
                .map(|(k, j)| gram.at(k, k) * sizes[*j].powi(2))
                .fold(0.0, f64::max);
            *variance = variance.max(ROUNDING * largest);
        }
    }
}

/// Part of the mean square that noise of the reference makes of what gains of a sensor multiply. Noise of the attitude is white, and filters
/// that take slow noise out of the residual leave more of it than of the motion; rates are smoothed.
fn attenuation(layout: &Layout, sensor: usize) -> [f64; 3] {
    let shares = layout.facts.noise_shares.get(sensor).copied().unwrap_or_default();
    std::array::from_fn(|axis| {
        let filter = &layout.filters[3 * sensor + axis];
        let white = 1.0 + filter.iter().map(|tap| tap * tap).sum::<f64>();
        let raised = if sensor == Sensor::Acc.index() {
            (white / whitening::gain(filter, 0.0).max(f64::MIN_POSITIVE)).max(1.0)
        } else {
            1.0
        };
        (shares[axis] * raised).min(1.0)
    })
}

impl Problem {
    /// From the evidence of one log or of several; `own` tells which of all logs' slots each log has for itself, `limits` what the user
    /// allows parameters of the model.
    pub fn new(mut parts: Vec<Part>, own: &[bool], limits: &[Limited]) -> Self {
        parts.iter_mut().for_each(keep_within_digits);
        let (slots, places) = part::joined(&parts, own);
        let p = slots.last().map_or(0, |s| s.first + s.parameters.len());
        let parts: Arc<[Part]> = parts.into();
        let equations = BlockEquations::new(parts.clone(), &places, p);
        let mut sums = Vec::new();
        for (log, (part, places)) in parts.iter().zip(&places).enumerate() {
            let weights = part.weights();
            sums.extend(block_sums::channel_sums(log, part, &weights, places, p));
        }
        let mut plausible = DVector::zeros(p);
        let mut typical = vec![false; p];
        let mut known = vec![None; p];
        let information = equations.total(&(0..p).collect::<Vec<usize>>()).gram.diagonal();
        for slot in &slots {
            let parameters = &slot.effect.card().parameters;
            let searched = !slot.in_model && parameters.iter().all(|p| p.found == Found::Search);
            for (k, value) in slot.parameters.iter().enumerate() {
                known[slot.first + k] = searched.then_some(*value);
            }
        }
        let sizes = typical_sizes(&parts, &places, p);
        for (j, size) in sizes.into_iter().enumerate() {
            typical[j] = size.is_some();
            plausible[j] = match size {
                Some(typical) => PLAUSIBLE * typical,
                None if information[j] > 0.0 => STANDING_OUT / information[j].sqrt(),
                None => 0.0,
            };
        }
        let (fixed, bounds) = limited(&slots, limits, p);
        let mut problem = Self {
            parts,
            slots,
            own: own.to_vec(),
            places,
            logs: equations.logs().into(),
            equations,
            plausible,
            typical,
            known,
            sums,
            standing: fixed.clone(),
            fixed,
            bounds,
        };
        if problem.bounds.any() {
            let model: Vec<usize> = (0..problem.slots.len())
                .filter(|s| problem.slots[*s].in_model)
                .collect();
            let fitted = problem.fitted(&model);
            if let Some(within) = problem.step_within(&fitted) {
                for (j, at_bound) in fitted.iter().zip(within.at_bound) {
                    problem.standing[*j] |= at_bound;
                }
            }
        }
        problem
    }

    /// Places of the parameters of some slots that a fit moves, in order.
    pub fn fitted(&self, slots: &[usize]) -> Vec<usize> {
        let all = indices(&self.slots, slots);
        all.into_iter().filter(|j| !self.fixed[*j]).collect()
    }

    /// Those of them that stand at no bound.
    pub fn free(&self, slots: &[usize]) -> Vec<usize> {
        let all = indices(&self.slots, slots);
        all.into_iter().filter(|j| !self.standing[*j]).collect()
    }

    /// Step of some parameters within their bounds, by all whitened observations alike and by what is known of them.
    pub fn step_within(&self, parameters: &[usize]) -> Option<Within> {
        let prior = self.prior(parameters);
        let total = prior.beside(&self.total(parameters));
        match self.bounds_of(parameters, 0) {
            Some(bounds) => total.solve_within(&prior.precision, &bounds),
            None => total.solve(&prior.precision).map(|solved| Within {
                solution: solved.solution,
                at_bound: vec![false; parameters.len()],
            }),
        }
    }

    /// Values that the evidence was taken around.
    fn values(&self) -> Vec<f64> {
        self.slots.iter().flat_map(|s| s.parameters.iter().copied()).collect()
    }

    /// Prior of some parameters, that of the criterion: their deviation is three times the typical size. A parameter without a typical size has
    /// a weak prior, which decides only what the data leave open.
    pub fn prior(&self, parameters: &[usize]) -> Prior {
        let values = self.values();
        let of = |j: usize| {
            if self.typical[j] {
                self.plausible[j].powi(-2)
            } else {
                OPEN * self.precision(j)
            }
        };
        let pull = |j: usize| if self.typical[j] { -of(j) * values[j] } else { 0.0 };
        Prior {
            precision: DVector::from_iterator(parameters.len(), parameters.iter().map(|j| of(*j))),
            right: DVector::from_iterator(parameters.len(), parameters.iter().map(|j| pull(*j))),
        }
    }

    /// Whitened square of the residual per sample where the evidence was taken, with what is known of some parameters: what their estimate
    /// makes least.
    pub fn misfit(&self, parameters: &[usize]) -> f64 {
        let total = self.total(&[]);
        let prior = self.prior(parameters);
        let values = self.values();
        let known: f64 = (parameters.iter().zip(&prior.right))
            .map(|(j, pull)| -pull * values[*j])
            .sum();
        (total.square + known) / total.n.max(1.0)
    }

    /// Bounds of some parameters and of so many more without any; `None` where nothing is bounded.
    fn bounds_of(&self, parameters: &[usize], more: usize) -> Option<Bounds> {
        let of = |all: &DVector<f64>, open: f64| {
            all.select_rows(parameters)
                .resize_vertically(parameters.len() + more, open)
        };
        let bounds = Bounds {
            lower: of(&self.bounds.lower, f64::NEG_INFINITY),
            upper: of(&self.bounds.upper, f64::INFINITY),
        };
        bounds.any().then_some(bounds)
    }

    /// The same problem with an effect of the model taken out again, to first order: what its present values explain stands in the
    /// observations once more. The parts, which hold the evidence as it was taken, stay as they are.
    #[must_use]
    pub fn taken_out(&self, slot: usize) -> Self {
        let slot = &self.slots[slot];
        let cards = &slot.effect.card().parameters;
        // What a search started is how the others act, and nothing by itself; unless there is nothing else.
        let steps = cards.iter().any(|p| p.found == Found::Steps);
        let counts = |k: &usize| !steps || cards[k % cards.len()].found == Found::Steps;
        let kept: Vec<usize> = (0..slot.parameters.len()).filter(counts).collect();
        let places: Vec<usize> = kept.iter().map(|k| slot.first + k).collect();
        let without: Vec<f64> = kept.iter().map(|k| -slot.parameters[*k]).collect();
        self.given(&places, &without)
    }

    /// The same problem once some parameters have made these steps: what the steps explain is taken off the observations.
    #[must_use]
    pub fn given(&self, parameters: &[usize], steps: &[f64]) -> Self {
        Self {
            parts: self.parts.clone(),
            slots: self.slots.clone(),
            own: self.own.clone(),
            places: self.places.clone(),
            logs: self.logs.clone(),
            equations: self.equations.given(parameters, steps),
            plausible: self.plausible.clone(),
            typical: self.typical.clone(),
            known: self.known.clone(),
            sums: self.sums.iter().map(|s| s.given(parameters, steps)).collect(),
            fixed: self.fixed.clone(),
            standing: self.standing.clone(),
            bounds: self.bounds.clone(),
        }
    }

    /// What all parameters are for one log's own ones.
    pub fn of_log(&self, log: usize, all: &DVector<f64>) -> DVector<f64> {
        self.places
            .get(log)
            .map_or_else(|| DVector::zeros(0), |places| all.select_rows(places))
    }

    /// Number of blocks.
    pub fn blocks(&self) -> usize {
        self.logs.last().map_or(0, |log| log.end)
    }

    /// Prior precision of a parameter: weak, so that it only decides where the data do not.
    pub fn precision(&self, parameter: usize) -> f64 {
        let size = self.plausible[parameter];
        if size > 0.0 {
            0.01 / (size * size)
        } else {
            f64::MAX.sqrt()
        }
    }

    /// Whitened equations of the whole log for some parameters.
    pub fn total(&self, parameters: &[usize]) -> NormalEquations {
        self.equations.total(parameters)
    }

    /// Angles of the reference, and how far each may be off because its encoders have steps: an axis that stands still keeps one error of
    /// rounding, whose deviation is the step over the root of twelve.
    pub fn rounded(&self) -> Vec<(usize, f64)> {
        let steps = self.parts.iter().map(|part| part.white.layout.facts.reference_step);
        let deviation = steps.fold(0.0, f64::max) / 12.0_f64.sqrt();
        let of = |slot: &Slot| {
            let card = slot.effect.card();
            let angles = card.parameters.iter().enumerate();
            let stands = |p: &Parameter| p.unit == "rad" && p.found == Found::Steps;
            let (first, of_reference) = (slot.first, card.traits.reference.is_some());
            let places = angles
                .filter(|(_, p)| of_reference && stands(p))
                .map(|(k, _)| (first + k, deviation));
            places.collect::<Vec<_>>()
        };
        self.slots.iter().filter(|_| deviation > 0.0).flat_map(of).collect()
    }

    /// Slots of the gains of single axes, and how far each may seem off because what it is held against is noisy.
    ///
    /// Noise of the reference is in the quantity that a gain multiplies and, with the other sign, in the residual: a gain comes out too small
    /// by the noise's part of the mean square (attenuation by errors in the variables; Fuller 1987, Measurement error models, sec. 1.1).
    pub fn attenuated(&self) -> Vec<(usize, [f64; 3])> {
        let of = |(sensor, slot): (usize, usize)| {
            let shares = self.parts.iter().map(|part| attenuation(&part.white.layout, sensor));
            let most = shares.fold([0.0_f64; 3], |most, share| {
                std::array::from_fn(|k| most[k].max(share[k]))
            });
            (slot, most)
        };
        let gain = |s: &Slot| s.effect.column().is_none() && s.effect.card().traits.affine == Some(Affine::Scale);
        let of_sensor = |sensor: Sensor| {
            let slots = self.slots.iter().enumerate();
            let slots = slots.filter(move |(_, s)| gain(s) && s.effect.sensors().contains(&sensor));
            slots.map(move |(slot, _)| (sensor.index(), slot))
        };
        Sensor::ALL.into_iter().flat_map(of_sensor).map(of).collect()
    }

    /// Values of a candidate's parameters if all of them are known beforehand.
    pub fn known_values(&self, candidate: &[usize]) -> Option<Vec<f64>> {
        let values: Option<Vec<f64>> = candidate.iter().map(|j| self.known[*j]).collect();
        values.filter(|v| !v.is_empty())
    }

    /// The question of a model beside a candidate whose parameters are known, so that there is nothing of it to be fitted.
    pub fn question_given(&self, model: &[usize], candidate: &[usize], values: &[f64]) -> Question {
        let equations = self.equations.given(candidate, values);
        Question {
            white: equations.blocks(Form::White, model),
            raw: equations.blocks(Form::Raw, model),
            ..self.question(model, &[])
        }
    }

    /// The question of a candidate on top of a model.
    pub fn question(&self, model: &[usize], candidate: &[usize]) -> Question {
        let all: Vec<usize> = model.iter().chain(candidate).copied().collect();
        let sums = |s: &ChannelSums| s.with_sums(s.columns(&all));
        Question {
            white: self.equations.blocks(Form::White, &all),
            raw: self.equations.blocks(Form::Raw, &all),
            prior: self.prior(&all),
            bounds: self.bounds_of(model, candidate.len()),
            model: model.len(),
            sums: self.sums.iter().map(sums).collect(),
            logs: self.logs.clone(),
        }
    }
}

impl Prior {
    /// With so many parameters more of which nothing is known.
    #[must_use]
    pub fn with_unknown(self, more: usize) -> Self {
        let all = self.precision.len() + more;
        Self {
            precision: self.precision.resize_vertically(all, 0.0),
            right: self.right.resize_vertically(all, 0.0),
        }
    }

    /// Equations of a step with this knowledge.
    fn beside(&self, equations: &NormalEquations) -> NormalEquations {
        let mut out = equations.clone();
        out.right += &self.right;
        out
    }
}

impl Question {
    /// Blocks beside a block in the same log, with the block itself.
    pub fn beside(&self, block: usize) -> Range<usize> {
        let log = self.logs.iter().find(|log| log.contains(&block));
        log.map_or(block..block + 1, |log| {
            block.saturating_sub(1).max(log.start)..(block + 2).min(log.end)
        })
    }

    /// Sum over blocks.
    pub fn total(&self) -> NormalEquations {
        let mut total = NormalEquations::zeros(self.parameters());
        for block in &self.white {
            total.add(block, 1.0);
        }
        total
    }

    /// Solution from the whitened equations given.
    pub fn solve(&self, equations: &NormalEquations) -> Option<DVector<f64>> {
        let (equations, precision) = (self.prior.beside(equations), &self.prior.precision);
        match &self.bounds {
            Some(bounds) => equations.solve_within(precision, bounds).map(|w| w.solution),
            None => equations.solve(precision).map(|s| s.solution),
        }
    }

    /// Number of its parameters.
    pub fn parameters(&self) -> usize {
        self.prior.precision.len()
    }
}

/// Which of `p` parameters are fixed, and the bounds of the step of each; of an effect that each log has for itself those of all logs. An
/// effect of the model keeps to its sign, unless a limit says otherwise.
fn limited(slots: &[Slot], limits: &[Limited], p: usize) -> (Vec<bool>, Bounds) {
    let mut fixed = vec![false; p];
    let mut bounds = Bounds {
        lower: DVector::from_element(p, f64::NEG_INFINITY),
        upper: DVector::from_element(p, f64::INFINITY),
    };
    let of_one_sign = |slot: &&Slot| slot.in_model && slot.effect.sign() == Sign::Positive;
    for slot in slots.iter().filter(of_one_sign) {
        for (k, value) in slot.parameters.iter().enumerate() {
            bounds.lower[slot.first + k] = -value;
        }
    }
    for (number, parameter, limit) in limits {
        let slot = &slots[*number];
        let count = slot.effect.card().parameters.len();
        for k in (*parameter..slot.parameters.len()).step_by(count) {
            let place = slot.first + k;
            match limit {
                Limit::Fixed => fixed[place] = true,
                Limit::Between(lower, upper) => {
                    bounds.lower[place] = lower - slot.parameters[k];
                    bounds.upper[place] = upper - slot.parameters[k];
                }
            }
        }
    }
    (fixed, bounds)
}

/// Places of all parameters of some slots, in order.
pub fn indices(slots: &[Slot], chosen: &[usize]) -> Vec<usize> {
    let mut parameters = parameters_of(chosen.iter().map(|s| &slots[*s]));
    parameters.sort_unstable();
    parameters
}

/// Places of all parameters of some slots, slot after slot.
pub fn parameters_of<'a>(slots: impl IntoIterator<Item = &'a Slot>) -> Vec<usize> {
    slots
        .into_iter()
        .flat_map(|s| s.first..s.first + s.parameters.len())
        .collect()
}
