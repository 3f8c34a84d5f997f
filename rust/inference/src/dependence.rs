//! What a residual depends on, whatever the shape: a few orthogonal contrasts over the bins of each covariate.

use imufit_fit::normal_equations::NormalEquations;
use imufit_model::probes::OF;
use imufit_model::sensor::CHANNELS;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::held_out::{self, HeldOut};
use crate::problem::{Problem, Question};
use crate::{screening, selection};

/// Contrasts over the bins: polynomials of the bin's rank up to this degree.
pub const CONTRASTS: usize = 5;

const AXES: [&str; 3] = ["x", "y", "z"];

/// The covariate that every log has for itself.
const TIME: &str = "t";

/// How a channel's residual depends on a covariate.
#[derive(Clone, Debug)]
pub struct Dependence {
    /// Channel index.
    pub channel: usize,
    /// Name of the covariate.
    pub covariate: String,
    /// The log concerned; `None` for all that have the covariate.
    pub log: Option<usize>,
    /// p-value over blocks.
    pub p_value: f64,
    /// Held-out gain in units of the noise variance.
    pub gain: f64,
    /// What of it is on this channel.
    pub on_channel: f64,
    /// A word for how.
    pub shape: String,
    /// Held-out error without and with it, as the residual stands, over all channels; `None` where only means were looked at.
    pub held_out: Option<(f64, f64)>,
    /// The slot of a probe that shows it; `None` where bins or means of blocks do.
    pub probe: Option<usize>,
}

/// Orthonormal polynomials over bin ranks, constant included; at most as many as bins.
fn contrasts(bins: usize) -> DMatrix<f64> {
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
    name: String,
    /// The log concerned; `None` for all that have the covariate.
    log: Option<usize>,
    /// Its index among the bins of each log; `None` where the log has it not or is not concerned.
    index: Vec<Option<usize>>,
}

/// Every covariate of any log. What a residual depends on is the same in all logs, and so are the edges of their bins; time is
/// another one in each log.
fn covariates(problem: &Problem) -> Vec<(String, Option<usize>, Vec<Option<usize>>)> {
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
                (name.clone(), Some(log), index.collect())
            }));
        } else {
            out.push((name.clone(), None, logs.clone().map(|log| of_log(name, log)).collect()));
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
        let weight = part.weights()[channel];
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
                let sums = s.binned(&problem.parts[s.log].white, covariate, &q);
                own.columns_mut(p, m).copy_from(&sums);
            }
            s.with_sums(own).asked_of(channel)
        })
        .collect();
    Some(Question {
        unsure: DMatrix::zeros(m, 0),
        raw: white.clone(),
        white,
        precision,
        model: p,
        sums,
        logs: problem.logs.clone(),
        squares: problem.squares.clone(),
        rests: problem.rests(),
    })
}

/// Expected drop of the whitened sum of squares over all data: a quick look before the full test.
fn drop(question: &Question) -> f64 {
    let total = question.total();
    let without = question.without_candidate();
    let plain = without.total();
    match (question.solve(&total), without.solve(&plain)) {
        (Some(with), Some(alone)) => plain.residual_square(&alone) - total.residual_square(&with),
        _ => 0.0,
    }
}

/// Tests every channel against every covariate on top of the model; best held-out gain first. Only what could be significant at `alpha` is worked out.
pub fn test(problem: &Problem, model: &[usize], base: &HeldOut, channels: &[usize]) -> (Vec<Dependence>, usize) {
    let fitted: Vec<NormalEquations> = problem.white.iter().map(|b| b.selected(model)).collect();
    let covariates = covariates(problem);
    let mut asked: Vec<Asked> = Vec::new();
    for channel in channels.iter().copied().filter(|c| *c < CHANNELS) {
        let seen: Vec<bool> = problem.parts.iter().map(|p| p.weights()[channel] > 0.0).collect();
        for (name, log, index) in &covariates {
            let index = index.iter().zip(&seen).map(|(k, seen)| k.filter(|_| *seen));
            asked.push(Asked {
                channel,
                name: name.clone(),
                log: *log,
                index: index.collect(),
            });
        }
    }
    let answers: Vec<Option<Dependence>> = asked
        .par_iter()
        .filter_map(|asked| {
            let q = question(problem, model, &fitted, asked)?;
            Some(found(&q, base, asked))
        })
        .collect();
    let tried = answers.len();
    let mut found: Vec<Dependence> = answers.into_iter().flatten().collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    (found, tried)
}

/// What there is of one dependence, if it is worth a full test.
fn found(q: &Question, base: &HeldOut, asked: &Asked) -> Option<Dependence> {
    if drop(q) < 25.0 {
        return None;
    }
    let with = held_out::held_out(q);
    let (gain, _) = held_out::gain(base, &with);
    if gain <= 0.0 {
        return None;
    }
    let p_value = screening::p_value(q);
    let shape: Vec<f64> = q.solve(&q.total()).map_or_else(Vec::new, |b| {
        let first = q.model + 1;
        b.rows(first, b.len() - first).iter().copied().collect()
    });
    Some(Dependence {
        channel: asked.channel,
        covariate: asked.name.clone(),
        log: asked.log,
        p_value,
        gain,
        on_channel: gain,
        shape: shape_name(&shape).to_string(),
        held_out: None,
        probe: None,
    })
}

/// Dependences that only columns of their own show (`probes`), on top of the slots `stack`.
pub fn test_probes(problem: &Problem, stack: &[usize], probes: &[usize]) -> (Vec<Dependence>, usize) {
    let slots = problem.slots.as_slice();
    let (weighed, tried) = selection::weigh_all(problem, slots, stack, probes);
    let fitted = selection::indices(slots, stack);
    let found = weighed
        .into_par_iter()
        .filter(|w| selection::promising(w.so_far()))
        .filter_map(|w| {
            let judged = selection::judge(problem, slots, &fitted, w);
            let slot = &slots[judged.slot];
            let sensor = slot.effect.sensors().first()?;
            let certain = |(value, error): &(f64, f64)| (value / error.max(f64::MIN_POSITIVE)).powi(2);
            let certainties: Vec<f64> = judged.parameters.iter().map(certain).collect();
            let (largest, _) = certainties.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
            // Parameters of vectors belong to an axis each, those of a gradient to all.
            let (axis, share) = if slot.parameters.len().is_multiple_of(3) {
                let axis = largest % 3;
                let own: f64 = certainties.iter().skip(axis).step_by(3).sum();
                (axis, own / certainties.iter().sum::<f64>().max(f64::MIN_POSITIVE))
            } else {
                (0, 1.0 / 3.0)
            };
            let card = slot.effect.card();
            // What the axis itself causes is called as its own bins are.
            let own = matches!(card.name.as_str(), "f" | "omega");
            let covariate = match card.parameters.get(largest).and_then(|p| p.name.split_once(OF)) {
                Some((product, _)) => product.to_string(),
                None if own => format!("{}_{}", card.name, AXES[axis]),
                None => card.name.clone(),
            };
            Some(Dependence {
                channel: 3 * sensor.index() + axis,
                covariate,
                log: None,
                p_value: judged.p_value,
                gain: judged.gain,
                on_channel: share * judged.gain,
                shape: card.signature.clone(),
                held_out: Some(judged.held_out),
                probe: Some(judged.slot),
            })
        })
        .collect();
    (found, tried as usize)
}

/// A word for a shape from its contrasts (degree 1 first).
fn shape_name(shape: &[f64]) -> &'static str {
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
