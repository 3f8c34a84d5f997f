//! Normal equations of blocks over any of the parameters, put together from the evidence when a question asks for them.
//!
//! A channel depends on a few of all parameters, and a question is about a few: matrices of all parameters, one for each block, would
//! be mostly zeros and take several times the memory of the evidence.

use std::ops::Range;
use std::sync::Arc;

use imufit_fit::evidence::Evidence;
use imufit_fit::normal_equations::NormalEquations;
use imufit_model::sensor::CHANNELS;
use nalgebra::DMatrix;

use crate::part::Part;

/// In which form the evidence is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Whitened; observations have unit variance.
    White,
    /// As it stands; residuals are in units of the noise floor.
    Raw,
}

/// Where the columns of some parameters stand: for each channel pairs of a place among these parameters and one in the evidence.
type Chosen = Vec<Vec<(usize, usize)>>;

/// Where the columns of parameters stand in the evidence of one log.
struct Columns {
    /// For each channel the parameters, by their place among those of all logs, in the order of the evidence's columns.
    parameters: Vec<Vec<usize>>,
    /// For each channel the whitened Gram matrix of all blocks together.
    total: Vec<Option<(DMatrix<f64>, usize)>>,
}

/// Equations of every block of one log or of several.
#[derive(Clone)]
pub struct BlockEquations {
    parts: Arc<[Part]>,
    columns: Arc<[Columns]>,
    /// Number of all parameters.
    known: usize,
    /// Parameters that have been given values, what these explain being taken off the observations.
    given: Vec<usize>,
    values: Vec<f64>,
}

impl BlockEquations {
    /// `places` has for each log the place of each of its parameters among all `known` ones.
    pub fn new(parts: Arc<[Part]>, places: &[Vec<usize>], known: usize) -> Self {
        let of = |(part, places): (&Part, &Vec<usize>)| {
            let active = part.white.layout.model.active();
            let of_channel = |channel: usize| active[channel].iter().map(|own| places[*own]).collect();
            Columns {
                parameters: (0..CHANNELS).map(of_channel).collect(),
                total: (0..CHANNELS)
                    .map(|channel| sum(&part.white, channel, |block| 1.0 / part.loudness[channel][block]))
                    .collect(),
            }
        };
        let columns: Vec<Columns> = parts.iter().zip(places).map(of).collect();
        Self {
            parts,
            columns: columns.into(),
            known,
            given: Vec::new(),
            values: Vec::new(),
        }
    }

    /// The same once further parameters have been given values.
    #[must_use]
    pub fn given(&self, parameters: &[usize], values: &[f64]) -> Self {
        let mut out = self.clone();
        out.given.extend(parameters);
        out.values.extend(values);
        out
    }

    /// Equations of each block of all logs, one log after the other, for some parameters.
    pub fn blocks(&self, form: Form, parameters: &[usize]) -> Vec<NormalEquations> {
        let asked: Vec<usize> = parameters.iter().chain(&self.given).copied().collect();
        let mut out = Vec::new();
        for (part, columns) in self.parts.iter().zip(self.columns.iter()) {
            let chosen = self.chosen(columns, &asked);
            let evidence = match form {
                Form::White => &part.white,
                Form::Raw => &part.raw,
            };
            for block in 0..evidence.layout.blocks {
                let weights = match form {
                    Form::White => part.block_weights(block),
                    Form::Raw => part.raw_weights(),
                };
                let mut equations = NormalEquations::zeros(asked.len());
                for (channel, chosen) in chosen.iter().enumerate() {
                    if let Some(b) = evidence.get(block, channel) {
                        add_channel(&mut equations, &b.gram, b.n, chosen, weights[channel]);
                    }
                }
                out.push(self.without_given(equations, parameters.len()));
            }
        }
        out
    }

    /// Whitened equations of all blocks together for some parameters.
    pub fn total(&self, parameters: &[usize]) -> NormalEquations {
        let mut equations = NormalEquations::zeros(parameters.len());
        for log in 0..self.parts.len() {
            equations.add(&self.of_log(log, parameters), 1.0);
        }
        equations
    }

    /// Whitened equations of all blocks of one log for some parameters.
    pub fn of_log(&self, log: usize, parameters: &[usize]) -> NormalEquations {
        let asked: Vec<usize> = parameters.iter().chain(&self.given).copied().collect();
        let mut equations = NormalEquations::zeros(asked.len());
        if let (Some(part), Some(columns)) = (self.parts.get(log), self.columns.get(log)) {
            let weights = part.weights();
            for (channel, chosen) in self.chosen(columns, &asked).iter().enumerate() {
                if let Some((gram, n)) = &columns.total[channel] {
                    add_channel(&mut equations, gram, *n, chosen, weights[channel]);
                }
            }
        }
        self.without_given(equations, parameters.len())
    }

    /// Information of all blocks about each parameter: the diagonal of the whitened Gram matrix.
    pub fn information(&self) -> Vec<f64> {
        let mut out = vec![0.0; self.known];
        for (part, columns) in self.parts.iter().zip(self.columns.iter()) {
            for (channel, weight) in part.weights().iter().enumerate() {
                if let Some((gram, _)) = &columns.total[channel] {
                    for (k, parameter) in columns.parameters[channel].iter().enumerate() {
                        out[*parameter] += weight * gram[(k, k)];
                    }
                }
            }
        }
        out
    }

    /// Blocks of each log.
    pub fn logs(&self) -> Vec<Range<usize>> {
        let ends = self.parts.iter().scan(0, |end, part| {
            let first = *end;
            *end += part.white.layout.blocks;
            Some(first..*end)
        });
        ends.collect()
    }

    fn chosen(&self, columns: &Columns, asked: &[usize]) -> Chosen {
        let mut places = vec![None; self.known];
        let of_channel = |parameters: &Vec<usize>| {
            for (k, parameter) in parameters.iter().enumerate() {
                places[*parameter] = Some(k);
            }
            let known = |(place, parameter): (usize, &usize)| places[*parameter].map(|k| (place, k));
            let chosen = asked.iter().enumerate().filter_map(known).collect();
            for parameter in parameters {
                places[*parameter] = None;
            }
            chosen
        };
        columns.parameters.iter().map(of_channel).collect()
    }

    fn without_given(&self, equations: NormalEquations, kept: usize) -> NormalEquations {
        if self.given.is_empty() {
            return equations;
        }
        let kept: Vec<usize> = (0..kept).collect();
        let others: Vec<usize> = (kept.len()..kept.len() + self.given.len()).collect();
        equations.given(&kept, &others, &self.values)
    }
}

/// Adds one channel's Gram matrix of `[columns | residual]` over `n` samples to equations of the chosen columns.
pub fn add_channel(
    equations: &mut NormalEquations,
    gram: &DMatrix<f64>,
    n: usize,
    chosen: &[(usize, usize)],
    weight: f64,
) {
    if !(weight > 0.0 && weight.is_finite()) {
        return;
    }
    let last = gram.ncols() - 1;
    for (q, j) in chosen {
        for (p, i) in chosen {
            equations.gram[(*p, *q)] += weight * gram[(*i, *j)];
        }
        equations.right[*q] += weight * gram[(*j, last)];
    }
    equations.square += weight * gram[(last, last)];
    equations.n += n as f64;
}

/// Gram matrix of a channel over all blocks with the number of samples, each block weighted by `weight`; `None` without any.
pub fn sum(evidence: &Evidence, channel: usize, weight: impl Fn(usize) -> f64) -> Option<(DMatrix<f64>, usize)> {
    let mut total: Option<(DMatrix<f64>, usize)> = None;
    for b in 0..evidence.layout.blocks {
        let Some(block) = evidence.get(b, channel) else {
            continue;
        };
        let (gram, n) = total.get_or_insert_with(|| (DMatrix::zeros(block.gram.nrows(), block.gram.ncols()), 0));
        gram.zip_apply(&block.gram, |sum, own| *sum += weight(b) * own);
        *n += block.n;
    }
    total
}
