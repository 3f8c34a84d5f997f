//! Normal equations of blocks over any of the parameters, put together from the evidence when a question asks for them.
//!
//! A channel depends on a few of all parameters, and a question is about a few: matrices of all parameters, one for each block, would
//! be mostly zeros and take several times the memory of the evidence.

use std::ops::Range;
use std::sync::Arc;

use imufit_model::sensor::CHANNELS;

use crate::gram::Gram;
use crate::normal_equations::NormalEquations;
use crate::part::{Part, sample_shares};

/// In which form the evidence is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Whitened; observations have unit variance.
    White,
    /// As it stands; residuals are in units of the noise floor, and every channel counts equally.
    Raw,
}

/// Where the columns of parameters stand in the evidence of one log.
struct Columns {
    /// For each channel the place among the evidence's columns of every parameter of all logs that acts on it.
    places: Vec<Vec<Option<usize>>>,
    /// For each channel the whitened Gram matrix of all blocks together.
    total: Vec<Option<(Gram, usize)>>,
}

impl Columns {
    /// For each channel pairs of a place among the parameters asked about and one in the evidence.
    fn chosen<'a>(&'a self, asked: &'a [usize]) -> impl Iterator<Item = Vec<(usize, usize)>> + 'a {
        let of_channel = |places: &'a Vec<Option<usize>>| {
            let known = |(place, parameter): (usize, &usize)| Some((place, places[*parameter]?));
            asked.iter().enumerate().filter_map(known).collect()
        };
        self.places.iter().map(of_channel)
    }
}

/// Equations of every block of one log or of several.
#[derive(Clone)]
pub struct BlockEquations {
    parts: Arc<[Part]>,
    columns: Arc<[Columns]>,
    /// Share of one sample of each channel in the error.
    shares: [f64; CHANNELS],
    /// Parameters that have been given values, what these explain being taken off the observations.
    given: Vec<usize>,
    values: Vec<f64>,
}

impl BlockEquations {
    /// `places` has for each log the place of each of its parameters among all `known` ones.
    pub fn new(parts: Arc<[Part]>, places: &[Vec<usize>], known: usize) -> Self {
        let of = |(part, own): (&Part, &Vec<usize>)| {
            let of_channel = |active: &Vec<usize>| {
                let mut places = vec![None; known];
                for (k, parameter) in active.iter().enumerate() {
                    places[own[*parameter]] = Some(k);
                }
                places
            };
            Columns {
                places: part.white.layout.model.active().iter().map(of_channel).collect(),
                total: (0..CHANNELS)
                    .map(|channel| part.white.total(channel, |block| 1.0 / part.loudness[channel][block]))
                    .collect(),
            }
        };
        let columns: Vec<Columns> = parts.iter().zip(places).map(of).collect();
        Self {
            shares: sample_shares(&parts),
            parts,
            columns: columns.into(),
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
            let chosen: Vec<_> = columns.chosen(&asked).collect();
            let evidence = match form {
                Form::White => &part.white,
                Form::Raw => &part.raw,
            };
            for block in 0..evidence.layout.blocks {
                let (weights, shares) = match form {
                    Form::White => (part.block_weights(block), [1.0; CHANNELS]),
                    Form::Raw => (part.raw_weights(), self.shares),
                };
                let mut equations = NormalEquations::zeros(asked.len());
                for (channel, chosen) in chosen.iter().enumerate() {
                    if let Some(b) = evidence.get(block, channel) {
                        let share = shares[channel];
                        equations.add_channel(&b.gram, share * b.n as f64, chosen, share * weights[channel]);
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
            for (channel, chosen) in columns.chosen(&asked).enumerate() {
                if let Some((gram, n)) = &columns.total[channel] {
                    equations.add_channel(gram, *n as f64, &chosen, weights[channel]);
                }
            }
        }
        self.without_given(equations, parameters.len())
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

    fn without_given(&self, equations: NormalEquations, kept: usize) -> NormalEquations {
        if self.given.is_empty() {
            return equations;
        }
        let kept: Vec<usize> = (0..kept).collect();
        let others: Vec<usize> = (kept.len()..kept.len() + self.given.len()).collect();
        equations.given(&kept, &others, &self.values)
    }
}
