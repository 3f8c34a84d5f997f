//! Unnamed causes: what a residual may depend on that no effect of the catalogue describes.
//!
//! Columns of products and of the past (probes), bins of every covariate whatever the shape, and courses in time. Their parameters have no
//! typical size; each may be as large as the noise of a sample.

use std::collections::BTreeMap;
use std::sync::Arc;

use imufit_model::sensor::{AXES, CHANNELS};
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::asked::{Asked, Prior};
use crate::bins::{self, Covariate};
use crate::courses;
use crate::part::Part;
use crate::problem::Problem;
use crate::search::Search;
use crate::stack::{Criterion, Stack};

/// What the covariates are called that hold the quantities that sensors measure, up to the axis.
const OWN: [&str; 3] = ["f_", "omega_", "m_"];

/// Where an unnamed cause comes from.
#[derive(Clone, Debug)]
pub enum Origin {
    /// A probe, by its slot.
    Probe(usize),
    /// Bins of a covariate of each of some channels of a sensor.
    Bins(Vec<(usize, Arc<Covariate>)>),
    /// A course in time of some channels, by their places among the sums.
    Course(Vec<usize>, courses::Course),
}

/// An unnamed cause with its columns.
pub struct Unnamed {
    /// Where it comes from.
    pub origin: Origin,
    /// Its columns.
    pub asked: Asked,
}

/// Unnamed causes whose columns do not depend on the stack: probes and bins.
pub fn fixed(criterion: &Criterion, probes: &[usize]) -> Vec<Unnamed> {
    let of_probes = probes.iter().map(|slot| Unnamed {
        origin: Origin::Probe(*slot),
        asked: Asked::slot(criterion, *slot),
    });
    let covariates: Vec<Arc<Covariate>> = bins::covariates(criterion.problem).into_iter().map(Arc::new).collect();
    let questions: Vec<(usize, &Arc<Covariate>)> = (0..CHANNELS)
        .flat_map(|channel| covariates.iter().map(move |covariate| (channel, covariate)))
        .collect();
    let of_bins: Vec<Unnamed> = questions
        .into_par_iter()
        .filter_map(|(channel, covariate)| bins(criterion, channel, covariate))
        .collect();
    let of_sensors = of_sensors(&of_bins);
    of_probes.chain(of_bins).chain(of_sensors).collect()
}

/// What all axes of a sensor have, as effects of the catalogue do: each depends on the same covariate, or each on its own quantity.
fn of_sensors(of_bins: &[Unnamed]) -> Vec<Unnamed> {
    let mut groups: BTreeMap<(usize, String, Option<usize>), Vec<&Unnamed>> = BTreeMap::new();
    for unnamed in of_bins {
        let Origin::Bins(parts) = &unnamed.origin else { continue };
        for (channel, covariate) in parts {
            // The quantity that an axis measures is called by the axis.
            let quantity = OWN[channel / AXES.len()];
            let name = match covariate.name.split_once(quantity) {
                Some(("", axis)) if axis == AXES[channel % AXES.len()] => quantity,
                _ => &covariate.name,
            };
            let key = (channel / AXES.len(), name.to_string(), covariate.log);
            groups.entry(key).or_default().push(unnamed);
        }
    }
    let joined = |group: Vec<&Unnamed>| {
        let (first, others) = group.split_first()?;
        let mut out = Unnamed {
            origin: first.origin.clone(),
            asked: first.asked.clone(),
        };
        for other in others {
            out.asked = out.asked.apart(&other.asked);
            if let (Origin::Bins(parts), Origin::Bins(more)) = (&mut out.origin, &other.origin) {
                parts.extend(more.iter().cloned());
            }
        }
        (!others.is_empty()).then_some(out)
    };
    groups.into_values().filter_map(joined).collect()
}

/// Contrasts over so many bins; the constant is a bias, which has a name.
fn without_constant(bins: usize) -> DMatrix<f64> {
    let contrasts = bins::contrasts(bins);
    contrasts.columns(1, contrasts.ncols() - 1).into_owned()
}

/// Contrasts over the bins of a covariate, which are the same in every log that has it.
pub fn contrasts(problem: &Problem, covariate: &Covariate) -> Option<DMatrix<f64>> {
    (0..problem.parts.len()).find_map(|log| covariate.index[log].map(|k| contrasts_of(&problem.parts[log], k)))
}

/// Contrasts over the bins of one covariate of a log.
pub fn contrasts_of(part: &Part, covariate: usize) -> DMatrix<f64> {
    without_constant(part.white.layout.bins.edges[covariate].len() + 1)
}

/// Contrasts over the bins of a covariate on one channel.
pub fn bins(criterion: &Criterion, channel: usize, covariate: &Arc<Covariate>) -> Option<Unnamed> {
    let problem = criterion.problem;
    let q = contrasts(problem, covariate)?;
    let (bins, m) = q.shape();
    let parameters = problem.plausible.len();
    let mut asked = Asked {
        cross: DMatrix::zeros(parameters, m),
        information: DMatrix::zeros(m, m),
        score: nalgebra::DVector::zeros(m),
        sums: Vec::new(),
        prior: Prior::Normal(Vec::new()),
        trials: 0.0,
    };
    for (log, part) in problem.parts.iter().enumerate() {
        let weight = part.weights()[channel];
        let Some(index) = covariate.index[log].filter(|_| weight > 0.0) else {
            continue;
        };
        let evidence = &part.white;
        let active = &evidence.layout.model.active()[channel];
        let width = active.len() + 1;
        let mut count = vec![0.0; bins];
        let mut sums = DMatrix::zeros(width, bins);
        for b in 0..evidence.layout.blocks {
            let Some(block) = evidence.get(b, channel) else {
                continue;
            };
            let quiet = 1.0 / part.loudness[channel][b];
            for bin in 0..bins {
                count[bin] += quiet * block.bin_count[index][bin];
                let own = &block.bin_sum[index][bin * width..(bin + 1) * width];
                for (total, v) in sums.column_mut(bin).iter_mut().zip(own) {
                    *total += quiet * v;
                }
            }
        }
        let products = &sums * &q * weight;
        for (a, own) in active.iter().enumerate() {
            let mut row = asked.cross.row_mut(problem.places[log][*own]);
            row += products.row(a);
        }
        asked.score += products.row(width - 1).transpose();
        let counts = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(count));
        asked.information += q.tr_mul(&(counts * &q)) * weight;
        let place = (problem.sums.iter()).position(|s| s.log == log && s.channel == channel);
        if let Some(place) = place {
            let sums = problem.sums[place].binned(part, index, &q);
            asked.sums.push((place, criterion.modes[place].along(&sums)));
        }
    }
    let largest = asked.information.diagonal().max();
    let deviation = |k: usize| {
        let own = asked.information[(k, k)];
        // A contrast that hardly any row shows is not asked about.
        if own > 1e-9 * largest {
            (criterion.samples / own).sqrt()
        } else {
            0.0
        }
    };
    asked.prior = Prior::Normal((0..m).map(deviation).collect());
    (largest > 0.0).then(|| Unnamed {
        origin: Origin::Bins(vec![(channel, covariate.clone())]),
        asked,
    })
}

/// Log Bayes factor of what an unnamed cause has in common in all blocks beside some members, where it may vary from block to block.
pub fn varying(search: &Search, stack: &Stack, members: &[usize], unnamed: &Unnamed) -> f64 {
    match &unnamed.origin {
        Origin::Probe(slot) => search.varying_beside(stack, members, *slot, &unnamed.asked),
        Origin::Bins(parts) => {
            let columns = search.columns(members);
            let Prior::Normal(deviation) = &unnamed.asked.prior else {
                return 0.0;
            };
            let mut first = 0;
            let mut of_part = |(channel, covariate): &(usize, Arc<Covariate>)| {
                let question = bins::of_bins(search.criterion.problem, &columns, *channel, covariate)?;
                // The constant among the contrasts is a bias, which is not asked about.
                let own = question.precision.len() - question.model - 1;
                let all: Vec<f64> = std::iter::once(0.0)
                    .chain(deviation[first..first + own].iter().copied())
                    .collect();
                first += own;
                Some(search.varying_of(stack, members, question, &all, 0.0))
            };
            parts.iter().filter_map(&mut of_part).sum()
        }
        // What comes once has no blocks to differ.
        Origin::Course(..) => f64::INFINITY,
    }
}

/// The likeliest courses of every sensor beside a stack, each with its log Bayes factor of at least `least`.
pub fn courses(stack: &Stack, least: f64) -> Vec<(Unnamed, f64)> {
    let problem = stack.criterion.problem;
    let mut sensors: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (c, sums) in problem.sums.iter().enumerate() {
        if sums.of_blocks() && !problem.parts[sums.log].white.layout.facts.rests {
            sensors.entry((sums.log, sums.channel / 3)).or_default().push(c);
        }
    }
    let found: Vec<Vec<courses::Found>> = sensors
        .into_par_iter()
        .map(|(_, channels)| courses::likeliest(stack, &channels, least))
        .collect();
    let unnamed = |found: courses::Found| {
        let origin = Origin::Course(found.channels, found.course);
        let asked = found.asked;
        (Unnamed { origin, asked }, found.ln_bayes)
    };
    found.into_iter().flatten().map(unnamed).collect()
}
