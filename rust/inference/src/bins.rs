//! What a residual depends on, whatever the shape: a few orthogonal contrasts over the bins of each covariate.

use imufit_fit::block_equations::Form;
use imufit_fit::evidence::ChannelBlock;
use imufit_model::probes;
use imufit_model::sensor_model::Slot;
use nalgebra::{DMatrix, DVector};

use crate::asked::Asked;
use crate::criterion::Criterion;
use crate::problem::{Problem, Question};

/// Contrasts over the bins: polynomials of the bin's rank up to this degree.
pub const CONTRASTS: usize = 5;

/// The covariate that every log has for itself.
const TIME: &str = "t";

/// Orthonormal polynomials over bin ranks, at most as many as bins; without the constant, which is a bias and has a name.
fn contrasts(bins: usize) -> DMatrix<f64> {
    let m = (CONTRASTS + 1).min(bins);
    let powers = DMatrix::from_fn(bins, m, |i, k| {
        (2.0 * i as f64 / (bins.max(2) - 1) as f64 - 1.0).powf(k as f64)
    });
    powers.qr().q().columns(1, m - 1).into_owned()
}

/// A covariate of any log.
#[derive(Debug)]
pub struct Covariate {
    /// Its name.
    pub name: String,
    /// The log concerned; `None` for all that have it.
    pub log: Option<usize>,
    /// Its index among the bins of each log; `None` where the log has it not or is not concerned.
    pub index: Vec<Option<usize>>,
}

impl Covariate {
    /// The covariate with this index in a log, that log alone concerned.
    pub fn of_log(problem: &Problem, log: usize, index: usize) -> Self {
        Self {
            name: problem.parts[log].white.layout.bins.names[index].clone(),
            log: None,
            index: (0..problem.parts.len())
                .map(|other| (other == log).then_some(index))
                .collect(),
        }
    }

    /// Its index among the bins of a log that has readings of a channel.
    fn in_log(&self, problem: &Problem, log: usize, channel: usize) -> Option<usize> {
        self.index[log].filter(|_| problem.parts[log].weights()[channel] > 0.0)
    }

    /// Contrasts over its bins, which are the same in every log that has it.
    pub fn contrasts(&self, problem: &Problem) -> Option<DMatrix<f64>> {
        let edges = |log: usize| Some(problem.parts[log].white.layout.bins.edges[self.index[log]?].len());
        (0..problem.parts.len())
            .find_map(edges)
            .map(|edges| contrasts(edges + 1))
    }
}

/// Every covariate of any log. What a residual depends on is the same in all logs, and so are the edges of their bins; time is
/// another one in each log.
pub(crate) fn covariates(problem: &Problem) -> Vec<Covariate> {
    let bins = |log: usize| &problem.parts[log].white.layout.bins;
    let mut names: Vec<&String> = Vec::new();
    for name in (0..problem.parts.len()).flat_map(|log| &bins(log).names) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let logs = 0..problem.parts.len();
    let of = |name: &String, only: Option<usize>| {
        let of_log = |log: usize| {
            let index = bins(log).names.iter().position(|n| n == name)?;
            (!bins(log).edges[index].is_empty() && only.is_none_or(|only| only == log)).then_some(index)
        };
        Covariate {
            name: name.clone(),
            log: only,
            index: logs.clone().map(of_log).collect(),
        }
    };
    let of_name = |name: &String| -> Vec<Covariate> {
        if name == TIME && logs.len() > 1 {
            logs.clone().map(|log| of(name, Some(log))).collect()
        } else {
            vec![of(name, None)]
        }
    };
    names.into_iter().flat_map(of_name).collect()
}

/// Products of contrasts over the bins of a covariate in one block: with `[columns | residual]` (width x m), and with one another (m x m).
fn products(block: &ChannelBlock, covariate: usize, contrasts: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let bins = &block.bins[covariate];
    let counts = DVector::from_column_slice(&bins.count);
    (
        bins.matrix() * contrasts,
        contrasts.tr_mul(&(DMatrix::from_diagonal(&counts) * contrasts)),
    )
}

/// Contrasts over the bins of a covariate on one channel, over all blocks; `None` where no row shows any.
pub(crate) fn asked(criterion: &Criterion, channel: usize, covariate: &Covariate) -> Option<Asked> {
    let problem = criterion.problem;
    let q = covariate.contrasts(problem)?;
    let mut asked = Asked::zeros(criterion, q.ncols());
    for (log, part) in problem.parts.iter().enumerate() {
        let Some(index) = covariate.in_log(problem, log, channel) else {
            continue;
        };
        let active = &part.white.layout.model.active()[channel];
        for (b, block) in part.white.of_channel(channel) {
            let weight = part.block_weights(b)[channel];
            let (cross, own) = products(block, index, &q);
            for (a, parameter) in active.iter().enumerate() {
                let mut row = asked.cross.row_mut(problem.places[log][*parameter]);
                row += weight * cross.row(a);
            }
            asked.score += weight * cross.row(active.len()).transpose();
            asked.information += weight * own;
        }
        let place = (problem.sums.iter()).position(|s| s.log == log && s.channel == channel);
        asked.sums.extend(place.map(|place| {
            let sums = problem.sums[place].binned(part, index, &q);
            (place, criterion.modes[place].along(&sums))
        }));
    }
    (asked.information.diagonal().max() > 0.0).then(|| asked.of_any_size(criterion))
}

/// The question whether a channel depends on a covariate beside the parameters of a model, block by block.
pub(crate) fn question(problem: &Problem, model: &[usize], channel: usize, covariate: &Covariate) -> Option<Question> {
    let q = covariate.contrasts(problem)?;
    let (p, m) = (model.len(), q.ncols());
    let index = |log: usize| covariate.in_log(problem, log, channel);
    let mut white = Vec::with_capacity(problem.blocks());
    let fitted = problem.equations.blocks(Form::White, model);
    for (log, part) in problem.parts.iter().enumerate() {
        let active = &part.white.layout.model.active()[channel];
        let place = |own: &usize| model.iter().position(|j| *j == problem.places[log][*own]);
        let places: Vec<Option<usize>> = active.iter().map(place).collect();
        for (b, inner) in fitted[problem.logs[log].clone()].iter().enumerate() {
            let mut out = inner.placed(&(0..p).collect::<Vec<usize>>(), p + m);
            if let (Some(index), Some(block)) = (index(log), part.white.get(b, channel)) {
                let weight = part.block_weights(b)[channel];
                let (cross, own) = products(block, index, &q);
                out.gram.view_mut((p, p), (m, m)).copy_from(&(weight * own));
                for (a, k) in places.iter().enumerate().filter_map(|(a, k)| Some((a, (*k)?))) {
                    let row = weight * cross.row(a);
                    out.gram.view_mut((k, p), (1, m)).copy_from(&row);
                    out.gram.view_mut((p, k), (m, 1)).copy_from(&row.transpose());
                }
                let right = weight * cross.row(active.len()).transpose();
                out.right.rows_mut(p, m).copy_from(&right);
            }
            white.push(out);
        }
    }
    let sums = problem.sums.iter().map(|s| {
        let mut own = s.columns(model).resize_horizontally(p + m, 0.0);
        if let Some(index) = index(s.log).filter(|_| s.channel == channel) {
            let binned = s.binned(&problem.parts[s.log], index, &q);
            own.columns_mut(p, m).copy_from(&binned);
        }
        s.with_sums(own)
    });
    Some(Question {
        raw: Vec::new(),
        white,
        prior: problem.prior(model).with_unknown(m),
        model: p,
        sums: sums.collect(),
        bounds: None,
        logs: problem.logs.clone(),
    })
}

/// The channel that shows a probe most, with the words for it.
pub(crate) struct OfProbe {
    /// Channel index.
    pub channel: usize,
    /// The covariate.
    pub covariate: String,
    /// How the channel depends on it.
    pub shape: String,
}

/// Where a probe shows, by how certain each of its parameters is.
pub(crate) fn of_probe(slot: &Slot, certainties: &[f64]) -> OfProbe {
    let sensor = slot.effect.sensors().first().map_or(0, |s| s.index());
    let largest = (certainties.iter().enumerate())
        .max_by(|a, b| a.1.total_cmp(b.1))
        .map_or(0, |(k, _)| k);
    // Parameters of vectors belong to an axis each, those of a gradient to all.
    let axis = if slot.parameters.len().is_multiple_of(3) {
        largest % 3
    } else {
        0
    };
    let card = slot.effect.card();
    OfProbe {
        channel: 3 * sensor + axis,
        covariate: probes::cause(card, largest, axis),
        shape: card.signature.clone(),
    }
}

/// A word for a shape from its contrasts (degree 1 first).
pub(crate) fn shape_name(shape: &[f64]) -> &'static str {
    let total: f64 = shape.iter().map(|c| c * c).sum();
    let share = |k: usize| shape.get(k).map_or(0.0, |c| c * c) / total.max(f64::MIN_POSITIVE);
    if share(0) > 0.9 {
        "rising or falling steadily"
    } else if share(1) + share(3) > 0.8 {
        if share(3) > 0.02 { "V-shaped" } else { "parabolic" }
    } else if share(0) + share(2) > 0.8 {
        "S-shaped"
    } else {
        "irregular"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contrasts_are_orthonormal_and_name_their_shape() {
        let q = contrasts(12);
        assert!((q.transpose() * &q - DMatrix::identity(5, 5)).norm() < 1e-10);
        assert!(q.row_sum().norm() < 1e-10);
        let project = |f: fn(f64) -> f64| -> Vec<f64> {
            let v = DVector::from_fn(12, |i, _| f(2.0 * i as f64 / 11.0 - 1.0));
            q.tr_mul(&v).iter().copied().collect()
        };
        assert_eq!(shape_name(&project(|x| 3.0 * x)), "rising or falling steadily");
        assert_eq!(shape_name(&project(f64::abs)), "V-shaped");
        assert_eq!(shape_name(&project(|x| x * x)), "parabolic");
        assert_eq!(shape_name(&project(|x| x * x * x)), "S-shaped");
    }
}
