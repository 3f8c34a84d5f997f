//! The least-squares problem of a log, or of several of one sensor, block by block, in units of its noise.

use std::ops::Range;
use std::sync::Arc;

use imufit_fit::evidence::Layout;
use imufit_fit::normal_equations::NormalEquations;
use imufit_fit::whitening;
use imufit_model::card::Found;
use imufit_model::sensor::Sensor;
use imufit_model::sensor_model::Slot;
use nalgebra::{Cholesky, DMatrix, DVector};

use crate::drift::{self, ChannelSums};
use crate::part::{self, Part};
use crate::saturated::{assemble, largest_square};

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
    /// Whitened equations of each block over all parameters; observations have unit variance.
    pub white: Vec<NormalEquations>,
    /// Unwhitened equations; residuals are in units of the noise floor.
    pub raw: Vec<NormalEquations>,
    /// Plausible size of each parameter: three times what is typical, or what would be seen with a hundredfold margin.
    pub plausible: DVector<f64>,
    /// True where that comes from a typical size.
    pub typical: Vec<bool>,
    /// Value that a parameter of a candidate has if it is there at all: one that only a search finds, and that the readings themselves tell.
    pub known: Vec<Option<f64>>,
    /// Block sums of every channel of every log, for zeros that wander.
    pub sums: Vec<ChannelSums>,
    /// Mean square of the whitened residual in each block, in the channel where it is largest.
    pub squares: Arc<[f64]>,
}

/// Parameters that a question is about: those of the model, then the reduced ones of a candidate.
pub struct Question {
    /// Whitened equations per block.
    pub white: Vec<NormalEquations>,
    /// Unwhitened equations per block.
    pub raw: Vec<NormalEquations>,
    /// Prior precision of each parameter.
    pub precision: DVector<f64>,
    /// How many parameters belong to the model.
    pub model: usize,
    /// By how much each direction asked about may come out wrong because the reference is noisy (directions x causes).
    pub unsure: DMatrix<f64>,
    /// Block sums of every channel over the same parameters, for zeros that wander.
    pub sums: Vec<ChannelSums>,
    /// Blocks of each log: those of different logs are no neighbours.
    pub logs: Arc<[Range<usize>]>,
    /// Mean square of the whitened residual in each block, in the channel where it is largest.
    pub squares: Arc<[f64]>,
    /// True where rests stand in for a reference: some blocks then tell far more of a parameter than others, and how estimates
    /// scatter if one of them is left out says too little.
    pub rests: bool,
}

/// Plausible sizes are this many times the typical ones.
const PLAUSIBLE: f64 = 3.0;
/// Gains that come out too small where the reference is noisy.
const GAINS: [&str; 2] = ["acc.scale", "gyr.scale"];
/// They may by this many times the noise's part of the mean square.
const ATTENUATION: f64 = 1.5;
/// Less than this part no log can show.
const ATTENUATION_SEEN: f64 = 1e-5;
/// A parameter without typical size is given one at which its effect would stand out by this factor.
const STANDING_OUT: f64 = 100.0;

/// Part of the mean square that noise of the reference makes of what gains of a sensor multiply. Noise of the attitude is white, and filters
/// that take slow noise out of the residual leave more of it than of the motion; rates are smoothed.
fn attenuation(layout: &Layout, sensor: usize) -> [f64; 3] {
    let shares = layout.facts.noise_shares[sensor];
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
    /// From the evidence of one log or of several; `own` tells which of all logs' slots each log has for itself.
    pub fn new(parts: Vec<Part>, own: &[bool]) -> Self {
        let (slots, places) = part::joined(&parts, own);
        let p = slots.last().map_or(0, |s| s.first + s.parameters.len());
        let mut logs: Vec<Range<usize>> = Vec::with_capacity(parts.len());
        let (mut white_blocks, mut raw_blocks, mut sums) = (Vec::new(), Vec::new(), Vec::new());
        let mut squares = Vec::new();
        for (log, (part, places)) in parts.iter().zip(&places).enumerate() {
            let (weights, raw_weights) = (part.weights(), part.raw_weights());
            let blocks = part.white.layout.blocks;
            logs.push(white_blocks.len()..white_blocks.len() + blocks);
            white_blocks.extend((0..blocks).map(|b| assemble(&part.white, b, &weights).placed(places, p)));
            raw_blocks.extend((0..blocks).map(|b| assemble(&part.raw, b, &raw_weights).placed(places, p)));
            squares.extend((0..blocks).map(|b| largest_square(&part.white, b, &weights)));
            sums.extend(drift::channel_sums(log, &part.white, &part.floors, &weights, places, p));
        }
        let mut plausible = DVector::zeros(p);
        let mut typical = vec![false; p];
        let mut known = vec![None; p];
        for slot in &slots {
            let parameters = &slot.effect.card().parameters;
            let searched = !slot.in_model && parameters.iter().all(|p| p.found == Found::Search);
            for (k, card) in parameters.iter().cycle().take(slot.parameters.len()).enumerate() {
                known[slot.first + k] = searched.then_some(slot.parameters[k]);
                let j = slot.first + k;
                let information: f64 = white_blocks.iter().map(|b| b.gram[(j, j)]).sum();
                let size = card.typical.filter(|_| !slot.effect.size_is_open());
                typical[j] = size.is_some();
                plausible[j] = match size {
                    Some(typical) => PLAUSIBLE * typical,
                    None if information > 0.0 => STANDING_OUT / information.sqrt(),
                    None => 0.0,
                };
            }
        }
        Self {
            parts: parts.into(),
            slots,
            own: own.to_vec(),
            places,
            logs: logs.into(),
            white: white_blocks,
            raw: raw_blocks,
            plausible,
            typical,
            known,
            sums,
            squares: squares.into(),
        }
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
        let all: Vec<usize> = (0..self.plausible.len()).collect();
        let given = |blocks: &[NormalEquations]| blocks.iter().map(|b| b.given(&all, &places, &without)).collect();
        Self {
            parts: self.parts.clone(),
            slots: self.slots.clone(),
            own: self.own.clone(),
            places: self.places.clone(),
            logs: self.logs.clone(),
            white: given(&self.white),
            raw: given(&self.raw),
            plausible: self.plausible.clone(),
            typical: self.typical.clone(),
            known: self.known.clone(),
            sums: self.sums.iter().map(|s| s.given(&places, &without)).collect(),
            squares: self.squares.clone(),
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
        self.white.len()
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
        let mut total = NormalEquations::zeros(parameters.len());
        for block in &self.white {
            total.add(&block.selected(parameters), 1.0);
        }
        total
    }

    /// What wandering zeros add to the covariance of the right-hand side for some parameters.
    pub fn drift_spread(&self, parameters: &[usize]) -> DMatrix<f64> {
        let sums: Vec<ChannelSums> = self.sums.iter().map(|s| s.with_sums(s.columns(parameters))).collect();
        drift::spread(&sums, parameters.len())
    }

    /// Directions in which a candidate can be told from the model: columns of a matrix over the candidate's parameters, each
    /// scaled to a plausible size. None where it cannot be seen at all.
    pub fn directions(&self, model: &[usize], candidate: &[usize]) -> DMatrix<f64> {
        let all: Vec<usize> = model.iter().chain(candidate).copied().collect();
        let total = self.total(&all);
        let (p, m) = (model.len(), candidate.len());
        let own = total.gram.view((p, p), (m, m)).into_owned();
        let mut schur = own.clone();
        if p > 0 {
            let mut inner = total.selected(&(0..p).collect::<Vec<_>>());
            let cross = total.gram.view((0, p), (p, m)).into_owned();
            let precision = DVector::from_iterator(p, model.iter().map(|j| self.precision(*j)));
            for k in 0..m {
                inner.right = cross.column(k).into_owned();
                if let Some(solved) = inner.solve(&precision) {
                    let projected = cross.tr_mul(&solved.solution);
                    let column = schur.column(k) - projected;
                    schur.set_column(k, &column);
                }
            }
        }
        let scale = DVector::from_iterator(m, candidate.iter().map(|j| self.plausible[*j]));
        let scaled = DMatrix::from_fn(m, m, |i, j| 0.5 * (schur[(i, j)] + schur[(j, i)]) * scale[i] * scale[j]);
        let size: f64 = (0..m).map(|j| own[(j, j)] * scale[j] * scale[j]).sum();
        let least = self.noise_share(candidate).max(1e-8);
        let eigen = scaled.symmetric_eigen();
        let kept: Vec<usize> = (0..m)
            .filter(|k| eigen.eigenvalues[*k] > 1.0 && eigen.eigenvalues[*k] > least * size)
            .collect();
        DMatrix::from_fn(m, kept.len(), |i, k| scale[i] * eigen.eigenvectors[(i, kept[k])])
    }

    /// Slots of the gains of accelerometer and gyroscope, and how far each may seem off because what it is held against is noisy.
    ///
    /// Noise of the reference is in the quantity that a gain multiplies and, with the other sign, in the residual: a gain comes out too small
    /// by the noise's part of the mean square (attenuation by errors in the variables; Fuller 1987, Measurement error models, sec. 1.1).
    pub fn attenuated(&self, least: f64) -> Vec<(usize, [f64; 3])> {
        let of = |(sensor, name): (usize, &&str)| {
            let slot = self.slots.iter().position(|s| s.effect.card().id == **name)?;
            let shares = self.parts.iter().map(|part| attenuation(&part.white.layout, sensor));
            let most = shares.fold([0.0_f64; 3], |most, share| {
                std::array::from_fn(|k| most[k].max(share[k]))
            });
            most.iter().any(|share| *share > least).then_some((slot, most))
        };
        GAINS.iter().enumerate().filter_map(of).collect()
    }

    /// By how much each direction of a candidate may come out wrong for that reason (directions x axes).
    fn unsure(&self, model: &[usize], candidate: &[usize], directions: &DMatrix<f64>) -> DMatrix<f64> {
        let (p, c, m) = (model.len(), candidate.len(), directions.ncols());
        let mut gains: Vec<usize> = Vec::new();
        let mut shares: Vec<f64> = Vec::new();
        for (slot, most) in self.attenuated(ATTENUATION_SEEN) {
            let first = self.slots[slot].first;
            if !model.contains(&first) {
                gains.extend(first..first + 3);
                shares.extend(most);
            }
        }
        let none = DMatrix::zeros(m, 0);
        if gains.is_empty() {
            return none;
        }
        let all: Vec<usize> = model.iter().chain(candidate).chain(&gains).copied().collect();
        let gram = self.total(&all).gram;
        let mut map = DMatrix::zeros(p + c, p + m);
        map.view_mut((0, 0), (p, p)).fill_with_identity();
        map.view_mut((p, p), (c, m)).copy_from(directions);
        let mut inner = map.tr_mul(&(gram.view((0, 0), (p + c, p + c)) * &map));
        for k in 0..p + m {
            inner[(k, k)] += if k < p { self.precision(model[k]) } else { 1.0 };
        }
        let cross = map.tr_mul(&gram.view((0, p + c), (p + c, gains.len())));
        let Some(factor) = Cholesky::new(inner) else {
            return none;
        };
        let mut moved = factor.solve(&cross).rows(p, m).into_owned();
        for (k, share) in shares.iter().enumerate() {
            moved.column_mut(k).scale_mut(ATTENUATION * share);
        }
        moved
    }

    /// Part that noise of the reference makes of a candidate's columns: products of rates that cancel are nothing else.
    fn noise_share(&self, candidate: &[usize]) -> f64 {
        let slot = self.slots.iter().find(|s| candidate.first() == Some(&s.first));
        let of = |slot: &Slot| {
            let facts = self.parts.iter().map(|part| &part.white.layout.facts);
            facts.map(|facts| slot.effect.noise_share(facts)).fold(0.0, f64::max)
        };
        slot.map_or(0.0, of)
    }

    /// Values of a candidate's parameters if all of them are known beforehand.
    pub fn known_values(&self, candidate: &[usize]) -> Option<Vec<f64>> {
        let values: Option<Vec<f64>> = candidate.iter().map(|j| self.known[*j]).collect();
        values.filter(|v| !v.is_empty())
    }

    /// The question of a model beside a candidate whose parameters are known, so that there is nothing of it to be fitted.
    pub fn question_given(&self, model: &[usize], candidate: &[usize], values: &[f64]) -> Question {
        let given = |blocks: &[NormalEquations]| blocks.iter().map(|b| b.given(model, candidate, values)).collect();
        Question {
            white: given(&self.white),
            raw: given(&self.raw),
            ..self.question(model, &[], &DMatrix::zeros(0, 0))
        }
    }

    /// The question of a candidate (in the given directions) on top of a model.
    pub fn question(&self, model: &[usize], candidate: &[usize], directions: &DMatrix<f64>) -> Question {
        let (p, m) = (model.len(), directions.ncols());
        let unsure = self.unsure(model, candidate, directions);
        let reduce =
            |blocks: &[NormalEquations]| blocks.iter().map(|b| b.reduced(model, candidate, directions)).collect();
        let mut precision = DVector::from_element(p + m, 1.0);
        for (k, j) in model.iter().enumerate() {
            precision[k] = self.precision(*j);
        }
        let sums = self
            .sums
            .iter()
            .map(|s| s.reduced(model, candidate, directions))
            .collect();
        Question {
            white: reduce(&self.white),
            raw: reduce(&self.raw),
            precision,
            model: p,
            sums,
            unsure,
            logs: self.logs.clone(),
            squares: self.squares.clone(),
            rests: self.rests(),
        }
    }

    /// True if a log has rests instead of a reference.
    pub fn rests(&self) -> bool {
        self.parts.iter().any(|part| part.white.layout.facts.rests)
    }
}

impl Question {
    /// The question without the candidate.
    #[must_use]
    pub fn without_candidate(&self) -> Self {
        let kept: Vec<usize> = (0..self.model).collect();
        Self {
            white: self.white.iter().map(|b| b.selected(&kept)).collect(),
            raw: self.raw.iter().map(|b| b.selected(&kept)).collect(),
            precision: self.precision.rows(0, self.model).into_owned(),
            model: self.model,
            sums: self.sums.iter().map(|s| s.with_sums(s.columns(&kept))).collect(),
            unsure: DMatrix::zeros(0, 0),
            logs: self.logs.clone(),
            squares: self.squares.clone(),
            rests: self.rests,
        }
    }

    /// The same question where one log has a value of its own besides, in some directions, of what the parameters from `first` on
    /// are in all logs: what these directions add there is asked about.
    #[must_use]
    pub fn with_own(&self, log: usize, first: usize, directions: &DMatrix<f64>) -> Self {
        let p = self.precision.len();
        let all: Vec<usize> = (0..p).collect();
        let shared: Vec<usize> = (first..first + directions.nrows()).collect();
        let elsewhere = DMatrix::zeros(directions.nrows(), directions.ncols());
        let own = self.logs.get(log).cloned().unwrap_or_default();
        let widened = |blocks: &[NormalEquations]| {
            let with = |(b, block): (usize, &NormalEquations)| {
                let directions = if own.contains(&b) { directions } else { &elsewhere };
                block.reduced(&all, &shared, directions)
            };
            blocks.iter().enumerate().map(with).collect()
        };
        let sums = self.sums.iter().map(|s| {
            let directions = if s.log == log { directions } else { &elsewhere };
            s.reduced(&all, &shared, directions)
        });
        Self {
            white: widened(&self.white),
            raw: widened(&self.raw),
            precision: self.precision.clone().resize_vertically(p + directions.ncols(), 1.0),
            model: p,
            sums: sums.collect(),
            unsure: DMatrix::zeros(directions.ncols(), 0),
            logs: self.logs.clone(),
            squares: self.squares.clone(),
            rests: self.rests,
        }
    }

    /// Blocks taken together `group` at a time, never those of two logs.
    pub fn groups(&self, group: usize) -> impl Iterator<Item = Range<usize>> + '_ {
        self.logs.iter().flat_map(move |log| {
            log.clone()
                .step_by(group)
                .map(move |first| first..(first + group).min(log.end))
        })
    }

    /// Blocks beside a block in the same log, with the block itself.
    pub fn beside(&self, block: usize) -> Range<usize> {
        let log = self.logs.iter().find(|log| log.contains(&block));
        log.map_or(block..block + 1, |log| {
            block.saturating_sub(1).max(log.start)..(block + 2).min(log.end)
        })
    }

    /// Sum over blocks, the wandering of zeros taken into account, for several strengths of it, each with its weight; empty if no
    /// zero wanders.
    pub fn totals_without_drift(&self) -> Vec<(f64, NormalEquations)> {
        drift::without(&self.sums, &self.total())
    }

    /// Sum over blocks.
    pub fn total(&self) -> NormalEquations {
        let mut total = NormalEquations::zeros(self.precision.len());
        for block in &self.white {
            total.add(block, 1.0);
        }
        total
    }

    /// Solution from the whitened equations given.
    pub fn solve(&self, equations: &NormalEquations) -> Option<DVector<f64>> {
        equations.solve(&self.precision).map(|s| s.solution)
    }
}
