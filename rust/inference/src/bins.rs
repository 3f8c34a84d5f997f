//! What a residual depends on, whatever the shape: a few orthogonal contrasts over the bins of each covariate.

use imufit_fit::normal_equations::NormalEquations;
use imufit_model::probes::OF;
use imufit_model::sensor::AXES;
use imufit_model::sensor_model::Slot;
use nalgebra::{DMatrix, DVector};

use crate::block_equations::Form;
use crate::problem::{Problem, Question};

/// Contrasts over the bins: polynomials of the bin's rank up to this degree.
pub const CONTRASTS: usize = 5;

/// The covariate that every log has for itself.
const TIME: &str = "t";

/// Orthonormal polynomials over bin ranks, constant included; at most as many as bins.
pub(crate) fn contrasts(bins: usize) -> DMatrix<f64> {
    let m = (CONTRASTS + 1).min(bins);
    let mut q = DMatrix::zeros(bins, m);
    for k in 0..m {
        let mut v = DVector::from_fn(bins, |i, _| {
            (2.0 * i as f64 / (bins.max(2) - 1) as f64 - 1.0).powf(k as f64)
        });
        for j in 0..k {
            let c = q.column(j).dot(&v);
            v -= q.column(j) * c;
        }
        let norm = v.norm();
        q.set_column(k, &(v / norm));
    }
    q
}

/// A covariate that a channel is tested against.
struct Asked {
    channel: usize,
    /// Its index among the bins of each log; `None` where the log has it not or is not concerned.
    index: Vec<Option<usize>>,
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
    let of_log = |name: &str, log: usize| {
        let index = bins(log).names.iter().position(|n| n == name)?;
        (!bins(log).edges[index].is_empty()).then_some(index)
    };
    let logs = 0..problem.parts.len();
    let mut out = Vec::new();
    for name in names {
        if name == TIME && logs.len() > 1 {
            out.extend(logs.clone().map(|log| {
                let index = logs.clone().map(|other| of_log(name, log).filter(|_| other == log));
                Covariate {
                    name: name.clone(),
                    log: Some(log),
                    index: index.collect(),
                }
            }));
        } else {
            out.push(Covariate {
                name: name.clone(),
                log: None,
                index: logs.clone().map(|log| of_log(name, log)).collect(),
            });
        }
    }
    out
}

/// Equations of the model's parameters (`fitted`, block by block) and the contrasts of one covariate in one channel.
fn question(problem: &Problem, model: &[usize], fitted: &[NormalEquations], asked: &Asked) -> Option<Question> {
    let channel = asked.channel;
    let edges = |log: usize| asked.index[log].map(|k| problem.parts[log].white.layout.bins.edges[k].len());
    let bins = (0..problem.parts.len()).find_map(edges)? + 1;
    let q = contrasts(bins);
    let (p, m) = (model.len(), q.ncols());
    let mut white = Vec::with_capacity(problem.blocks());
    for (log, part) in problem.parts.iter().enumerate() {
        let evidence = &part.white;
        let active = &evidence.layout.model.active()[channel];
        let width = active.len() + 1;
        let columns: Vec<(usize, usize)> = active
            .iter()
            .enumerate()
            .filter_map(|(a, own)| {
                let parameter = problem.places[log][*own];
                model.iter().position(|j| *j == parameter).map(|k| (k, a))
            })
            .collect();
        for (b, inner) in fitted[problem.logs[log].clone()].iter().enumerate() {
            let weight = part.block_weights(b)[channel];
            let mut out = NormalEquations::zeros(p + m);
            out.gram.view_mut((0, 0), (p, p)).copy_from(&inner.gram);
            out.right.rows_mut(0, p).copy_from(&inner.right);
            (out.square, out.n) = (inner.square, inner.n);
            if let (Some(covariate), Some(block)) = (asked.index[log], evidence.get(b, channel)) {
                let (counts, sums) = (&block.bin_count[covariate], &block.bin_sum[covariate]);
                for bin in 0..bins {
                    for i in 0..m {
                        let qi = weight * q[(bin, i)];
                        for j in 0..m {
                            out.gram[(p + i, p + j)] += qi * counts[bin] * q[(bin, j)];
                        }
                        for (k, a) in &columns {
                            let v = qi * sums[bin * width + a];
                            out.gram[(p + i, *k)] += v;
                            out.gram[(*k, p + i)] += v;
                        }
                        out.right[p + i] += qi * sums[bin * width + width - 1];
                    }
                }
            }
            white.push(out);
        }
    }
    let mut total = NormalEquations::zeros(p + m);
    for b in &white {
        total.add(b, 1.0);
    }
    let mut precision = DVector::zeros(p + m);
    for (k, j) in model.iter().enumerate() {
        precision[k] = problem.precision(*j);
    }
    for i in 0..m {
        // Weak: a contrast that stands out a hundredfold is as good as free.
        precision[p + i] = 1e-4 * total.gram[(p + i, p + i)].max(1e-300);
    }
    let sums = problem
        .sums
        .iter()
        .map(|s| {
            let mut own = DMatrix::zeros(s.sums.nrows(), p + m);
            own.columns_mut(0, p).copy_from(&s.columns(model));
            if let (true, Some(covariate)) = (s.channel == channel, asked.index[s.log]) {
                let sums = s.binned(&problem.parts[s.log], covariate, &q);
                own.columns_mut(p, m).copy_from(&sums);
            }
            s.with_sums(own)
        })
        .collect();
    Some(Question {
        raw: white.clone(),
        white,
        precision,
        model: p,
        sums,
        logs: problem.logs.clone(),
    })
}

/// The question whether a channel depends on a covariate beside the parameters of a model, the constant among its contrasts.
pub(crate) fn of_bins(problem: &Problem, model: &[usize], channel: usize, covariate: &Covariate) -> Option<Question> {
    let fitted: Vec<NormalEquations> = problem.equations.blocks(Form::White, model);
    let seen = |log: usize| problem.parts[log].weights()[channel] > 0.0;
    let index = covariate
        .index
        .iter()
        .enumerate()
        .map(|(log, k)| k.filter(|_| seen(log)));
    let asked = Asked {
        channel,
        index: index.collect(),
    };
    question(problem, model, &fitted, &asked)
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
    // What the axis itself causes is called as its own bins are.
    let own = matches!(card.name.as_str(), "f" | "omega");
    let covariate = match card.parameters.get(largest).and_then(|p| p.name.split_once(OF)) {
        Some((product, _)) => product.to_string(),
        None if own => format!("{}_{}", card.name, AXES[axis]),
        None => card.name.clone(),
    };
    OfProbe {
        channel: 3 * sensor + axis,
        covariate,
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
        assert!((q.transpose() * &q - DMatrix::identity(6, 6)).norm() < 1e-10);
        let project = |f: fn(f64) -> f64| -> Vec<f64> {
            let v = DVector::from_fn(12, |i, _| f(2.0 * i as f64 / 11.0 - 1.0));
            q.tr_mul(&v).iter().skip(1).copied().collect()
        };
        assert_eq!(shape_name(&project(|x| 3.0 * x)), "rising or falling steadily");
        assert_eq!(shape_name(&project(f64::abs)), "V-shaped");
        assert_eq!(shape_name(&project(|x| x * x)), "parabolic");
        assert_eq!(shape_name(&project(|x| x * x * x)), "S-shaped");
    }
}
