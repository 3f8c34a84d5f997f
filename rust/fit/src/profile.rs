//! Profile search: parameters inside an effect (a period, a width), which no linear step finds, are tried on a grid.
//!
//! For each trial the columns' own Gram matrix and their products with the fitted columns and the residual are summed;
//! from these follows by how much the sum of squares would drop, everything fitted moving along.

use imufit_model::effect::EffectError;
use imufit_model::facts::LogFacts;
use imufit_model::sensor::CHANNELS;
use imufit_model::sensor_model::{ChannelColumns, SensorModel, Slot};
use imufit_model::window::Window;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::normal_equations::NormalEquations;
use crate::rests::Rests;

/// Rows worked on at a time.
const PART: usize = 2048;
/// How often the weights of the channels are taken from what the best trial leaves.
const ROUNDS: usize = 3;
/// Rows that a search looks at, at most about: parts spread evenly over the log.
const ROWS: usize = 1 << 15;

/// Sums of one channel: `[fitted columns | residual]` with themselves and with the columns of each trial.
#[derive(Clone, Default)]
struct Sums {
    n: usize,
    base: DMatrix<f64>,
    cross: Vec<DMatrix<f64>>,
    own: Vec<DMatrix<f64>>,
}

impl Sums {
    fn add(&mut self, other: Self) {
        if self.n == 0 {
            *self = other;
        } else if other.n > 0 {
            self.n += other.n;
            self.base += other.base;
            for (a, b) in self.cross.iter_mut().zip(other.cross) {
                *a += b;
            }
            for (a, b) in self.own.iter_mut().zip(other.own) {
                *a += b;
            }
        }
    }
}

/// What a search found.
#[derive(Clone, Debug)]
pub struct Best {
    /// Number of the trial.
    pub trial: usize,
    /// The candidate's parameters as a step from zero along the trial's columns finds them; where a search asks how well just
    /// the tried size does, the size between the trials that does best, or of what jumps the mean of all trials, each by how likely it
    /// makes the readings.
    pub parameters: Vec<f64>,
    /// Standard deviation of that mean; zero elsewhere.
    pub spread: Vec<f64>,
    /// Drop of the sum of squares in units of the noise that the trial leaves.
    pub gain: f64,
    /// The same of the first trial of the other sign; zero where there is none.
    pub mirrored: f64,
    /// Samples of the channels that the candidate acts on.
    pub samples: f64,
}

/// A search for the best trial of one candidate on top of a model.
pub struct Profile {
    /// The model, then the candidate once for each trial.
    model: SensorModel,
    facts: LogFacts,
    /// Parameters of the model.
    fitted: usize,
    trials: usize,
    channels: Vec<Sums>,
}

/// Active parameters of a channel that belong to one trial (`None`: to the model), by their place among the active ones.
fn places(model: &SensorModel, channel: usize, range: &std::ops::Range<usize>) -> Vec<usize> {
    let active = &model.active()[channel];
    (0..active.len()).filter(|k| range.contains(&active[*k])).collect()
}

impl Profile {
    /// A search over the candidate slots of `model`, which are trials of one effect.
    pub fn new(model: SensorModel, facts: LogFacts) -> Self {
        let fitted = model
            .slots()
            .iter()
            .filter(|s| s.in_model)
            .map(|s| s.parameters.len())
            .sum();
        let trials = model.slots().iter().filter(|s| !s.in_model).count();
        Self {
            model,
            facts,
            fitted,
            trials,
            channels: vec![Sums::default(); CHANNELS],
        }
    }

    fn slot(&self, trial: usize) -> Option<&Slot> {
        self.model.slots().iter().filter(|s| !s.in_model).nth(trial)
    }

    fn range(&self, trial: usize) -> std::ops::Range<usize> {
        self.slot(trial).map_or(0..0, |s| s.first..s.first + s.parameters.len())
    }

    /// Values that the candidate's parameters have in a trial, if it is asked how well just these do.
    fn given(&self, trial: usize) -> Option<&[f64]> {
        let slot = self.slot(trial)?;
        slot.effect.tried_at_full_size().then_some(&slot.parameters)
    }

    /// Adds the core rows of a window.
    pub fn add(&mut self, window: &Window) -> Result<(), EffectError> {
        let every = self.facts.n.div_ceil(ROWS).max(1);
        let parts: Vec<Result<Vec<Sums>, EffectError>> = window
            .parts(PART, every, self.model.margin(window, &self.facts))
            .par_iter()
            .map(|part| self.sums(part))
            .collect();
        // Summed in the order of time, so that the result does not depend on the number of threads.
        for part in parts {
            for (sums, more) in self.channels.iter_mut().zip(part?) {
                sums.add(more);
            }
        }
        Ok(())
    }

    fn sums(&self, window: &Window) -> Result<Vec<Sums>, EffectError> {
        let evaluation = self.model.evaluate(window, &self.facts)?;
        Ok(self.sums_of(&evaluation.channels))
    }

    /// Adds what the rests of a log tell, where they stand in for a reference.
    pub fn add_rests(&mut self, rests: &Rests) -> Result<(), EffectError> {
        let mut channels = vec![None; CHANNELS];
        for rows in rests.rows(&self.model, &self.facts)? {
            channels[rows.channel] = Some(rows.columns);
        }
        let more = self.sums_of(&channels);
        for (sums, more) in self.channels.iter_mut().zip(more) {
            sums.add(more);
        }
        Ok(())
    }

    fn sums_of(&self, channels: &[Option<ChannelColumns>]) -> Vec<Sums> {
        let of_channel = |channel: usize| {
            let Some(found) = &channels[channel] else {
                return Sums::default();
            };
            let rows: Vec<usize> = (0..found.residual.len())
                .filter(|i| found.residual[*i].is_finite() && found.columns.iter().all(|c| c[*i].is_finite()))
                .collect();
            let matrix =
                |columns: &[&Vec<f64>]| DMatrix::from_fn(rows.len(), columns.len(), |i, k| columns[k][rows[i]]);
            let fitted = places(&self.model, channel, &(0..self.fitted));
            let mut columns: Vec<&Vec<f64>> = fitted.iter().map(|k| &found.columns[*k]).collect();
            columns.push(&found.residual);
            let base = matrix(&columns);
            let mut sums = Sums {
                n: rows.len(),
                base: base.tr_mul(&base),
                ..Sums::default()
            };
            for trial in 0..self.trials {
                let own = places(&self.model, channel, &self.range(trial));
                let own = matrix(&own.iter().map(|k| &found.columns[*k]).collect::<Vec<_>>());
                sums.cross.push(base.tr_mul(&own));
                sums.own.push(own.tr_mul(&own));
            }
            sums
        };
        (0..CHANNELS).map(of_channel).collect()
    }

    /// Equations of one log's model and one trial over all channels.
    fn equations(&self, trial: usize, weights: &[f64; CHANNELS]) -> NormalEquations {
        let range = self.range(trial);
        let mut out = NormalEquations::zeros(self.fitted + range.len());
        for (channel, sums) in self.channels.iter().enumerate().filter(|(_, s)| s.n > 0) {
            let active = &self.model.active()[channel];
            let (w, fitted) = (weights[channel], places(&self.model, channel, &(0..self.fitted)));
            let own = places(&self.model, channel, &range);
            let last = fitted.len();
            let at = |k: usize| active[k];
            let of_trial = |k: usize| self.fitted + active[k] - range.start;
            for (i, a) in fitted.iter().enumerate() {
                for (j, b) in fitted.iter().enumerate() {
                    out.gram[(at(*a), at(*b))] += w * sums.base[(i, j)];
                }
                for (j, b) in own.iter().enumerate() {
                    out.gram[(at(*a), of_trial(*b))] += w * sums.cross[trial][(i, j)];
                    out.gram[(of_trial(*b), at(*a))] += w * sums.cross[trial][(i, j)];
                }
                out.right[at(*a)] += w * sums.base[(i, last)];
            }
            for (i, a) in own.iter().enumerate() {
                for (j, b) in own.iter().enumerate() {
                    out.gram[(of_trial(*a), of_trial(*b))] += w * sums.own[trial][(i, j)];
                }
                out.right[of_trial(*a)] += w * sums.cross[trial][(last, i)];
            }
            out.square += w * sums.base[(last, last)];
            out.n += sums.n as f64;
        }
        out
    }

    /// Samples of the channels that a trial acts on.
    fn samples(&self, trial: usize) -> f64 {
        let range = self.range(trial);
        let own = self.channels.iter().enumerate();
        let acts = own.filter(|(channel, _)| !places(&self.model, *channel, &range).is_empty());
        acts.map(|(_, sums)| sums.n as f64).sum()
    }

    /// Mean square of a channel's residual after a step of the model and one trial.
    fn mean_square(&self, trial: usize, step: &DVector<f64>, channel: usize) -> f64 {
        let sums = &self.channels[channel];
        let mut weights = [0.0; CHANNELS];
        weights[channel] = 1.0;
        let square = self.equations(trial, &weights).residual_square(step);
        square.max(0.0) / sums.n.max(1) as f64
    }

    /// Weight of each channel: one over what a trial leaves of it (`None`: over what there is).
    fn weights(&self, left: Option<(usize, &DVector<f64>)>) -> [f64; CHANNELS] {
        let mut weights = [0.0; CHANNELS];
        for (channel, weight) in weights.iter_mut().enumerate() {
            let sums = &self.channels[channel];
            if sums.n == 0 {
                continue;
            }
            let last = sums.base.nrows() - 1;
            let present = sums.base[(last, last)] / sums.n as f64;
            let left = left.map_or(present, |(trial, step)| self.mean_square(trial, step, channel));
            // A noiseless channel must not outweigh the rest beyond what numbers can hold.
            *weight = 1.0 / left.max(1e-12 * present).max(f64::MIN_POSITIVE);
        }
        weights
    }
}

/// Sizes beyond this many times the residual over the candidate's column are not worth a trial: a motion goes nowhere faster than by its
/// rate, so that the change of a size is at most the column times it, and a change twice as large as the residual leaves more than there
/// is. A motion of one frequency has gone as far as it goes at 0.64 of that, and its next period explains as much, hence twice as far.
const FURTHEST: f64 = 4.0;

/// Largest size of a candidate with one parameter that is worth a trial, from searches whose first trial has its column at zero;
/// infinite where that column is not there.
pub fn furthest(logs: &[&Profile]) -> f64 {
    let (mut change, mut left) = (0.0, 0.0);
    for log in logs.iter().filter(|l| l.trials > 0) {
        for (channel, sums) in log.channels.iter().enumerate().filter(|(_, s)| s.n > 0) {
            let last = sums.base.nrows() - 1;
            let square = sums.base[(last, last)];
            if square > 0.0 && places(&log.model, channel, &log.range(0)).len() == 1 {
                change += sums.own[0][(0, 0)] / square * sums.n as f64;
                left += sums.n as f64;
            }
        }
    }
    FURTHEST * (left / change).sqrt()
}

/// Step of the first `fitted` parameters that goes best with given values of the others, and these.
fn with_given(equations: &NormalEquations, fitted: usize, values: &[f64]) -> Option<DVector<f64>> {
    let kept: Vec<usize> = (0..fitted).collect();
    let others: Vec<usize> = (fitted..fitted + values.len()).collect();
    let beside = equations.given(&kept, &others, values);
    let step = beside.solve(&DVector::zeros(fitted))?.solution;
    let all = step.iter().chain(values).copied();
    Some(DVector::from_iterator(fitted + values.len(), all))
}

/// Mean and standard deviation of the values tried, each by how likely it makes the readings, from their sums of squares. Where
/// readings do not change between two trials, both are as good.
fn likely(tried: &[(&[f64], f64)]) -> (Vec<f64>, Vec<f64>) {
    let least = tried.iter().map(|t| t.1).fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> = tried.iter().map(|t| (0.5 * (least - t.1)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    let count = tried.first().map_or(0, |t| t.0.len());
    let mean = |k: usize, of: &dyn Fn(f64) -> f64| {
        let weighted = tried.iter().zip(&weights).map(|(t, w)| w * of(t.0[k]));
        weighted.sum::<f64>() / sum
    };
    let means: Vec<f64> = (0..count).map(|k| mean(k, &|v| v)).collect();
    let spread = (0..count).map(|k| mean(k, &|v| (v - means[k]).powi(2)).sqrt());
    let spread = spread.collect();
    (means, spread)
}

/// Where a parabola through the best value tried and those next to it is least; the best value itself where it is zero or the last.
fn vertex(tried: &[(&[f64], f64)]) -> Option<f64> {
    let (most, _) = tried.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let same = tried.iter().filter(|(values, _)| values[0] * most[0] >= 0.0);
    let mut points: Vec<(f64, f64)> = same.map(|(values, square)| (values[0], *square)).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let best = (0..points.len()).min_by(|a, b| points[*a].1.total_cmp(&points[*b].1))?;
    let (at, square) = points[best];
    if at == 0.0 || best == 0 || best + 1 == points.len() {
        return Some(at);
    }
    let [(before, left), (after, right)] = [points[best - 1], points[best + 1]];
    let (rise_left, rise_right) = ((left - square) * (after - at), (right - square) * (at - before));
    let least = at + 0.5 * (rise_left * (after - at) - rise_right * (at - before)) / (rise_left + rise_right);
    Some(if least.is_finite() { least } else { at })
}

/// The trial that lowers the sum of squares of all logs most; `None` without trials or samples. The searches are for the same
/// trials; the candidate's parameters are the same in all logs, the model's move along in each log by themselves.
pub fn best(logs: &[&Profile]) -> Option<Best> {
    let trials = logs.iter().map(|l| l.trials).min()?;
    let starts: Vec<usize> = logs
        .iter()
        .scan(0, |next, l| {
            let start = *next;
            *next += l.fitted;
            Some(start)
        })
        .collect();
    let fitted: usize = logs.iter().map(|l| l.fitted).sum();
    // Places of one log's parameters among those of all logs, the candidate's last.
    let places = |log: usize, trial: usize| -> Vec<usize> {
        let own = logs[log].range(trial).len();
        (starts[log]..starts[log] + logs[log].fitted)
            .chain(fitted..fitted + own)
            .collect()
    };
    let equations = |trial: usize, weights: &[[f64; CHANNELS]]| {
        let own = logs.iter().map(|l| l.range(trial).len()).max().unwrap_or(0);
        let mut sum = NormalEquations::zeros(fitted + own);
        for (log, profile) in logs.iter().enumerate() {
            let part = profile.equations(trial, &weights[log]);
            sum.add(&part.placed(&places(log, trial), fitted + own), 1.0);
        }
        sum
    };
    let mut found: Option<(usize, DVector<f64>)> = None;
    let (mut gain, mut mirrored, mut of_given) = (0.0, 0.0, None);
    for _ in 0..ROUNDS {
        let weights: Vec<[f64; CHANNELS]> = (0..logs.len())
            .map(|log| {
                let step = found
                    .as_ref()
                    .map(|(trial, step)| (*trial, step.select_rows(&places(log, *trial))));
                logs[log].weights(step.as_ref().map(|(trial, step)| (*trial, step)))
            })
            .collect();
        let solved: Vec<(usize, f64, DVector<f64>)> = (0..trials)
            .into_par_iter()
            .filter_map(|trial| {
                let equations = equations(trial, &weights);
                let step = match logs[0].given(trial) {
                    Some(values) => with_given(&equations, fitted, values)?,
                    None => equations.solve(&DVector::zeros(equations.parameters()))?.solution,
                };
                let square = equations.residual_square(&step);
                square.is_finite().then_some((trial, square, step))
            })
            .collect();
        let tried: Option<Vec<(&[f64], f64)>> = solved.iter().map(|s| Some((logs[0].given(s.0)?, s.1))).collect();
        of_given = tried.and_then(|tried| {
            let moves = logs[0].slot(0).is_some_and(|slot| !slot.effect.jumps());
            if moves {
                vertex(&tried).map(|at| (vec![at], vec![0.0]))
            } else {
                Some(likely(&tried))
            }
        });
        let size = |trial: usize| logs[0].slot(trial).map_or(0.0, |slot| slot.parameters[0]);
        let (trial, square, step) = solved.iter().min_by(|a, b| a.1.total_cmp(&b.1))?.clone();
        let other = solved.iter().find(|s| size(s.0) * size(trial) < 0.0).map(|s| s.1);
        let alone = equations(trial, &weights).selected(&(0..fitted).collect::<Vec<_>>());
        let without = alone.solve(&DVector::zeros(fitted))?.solution;
        let before = alone.residual_square(&without);
        gain = before - square;
        mirrored = other.map_or(0.0, |square| before - square);
        found = Some((trial, step));
    }
    found.map(|(trial, step)| {
        let own: Vec<f64> = step.iter().skip(fitted).copied().collect();
        let (parameters, spread) = of_given.unwrap_or_else(|| (own.clone(), vec![0.0; own.len()]));
        Best {
            trial,
            parameters,
            spread,
            gain,
            mirrored,
            samples: logs.iter().map(|log| log.samples(trial)).sum(),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::vertex;

    #[test]
    fn the_best_size_lies_between_trials_and_never_beyond_their_ends() {
        let sizes = [0.0, 0.01, 0.014, 0.02];
        let of = |square: fn(f64) -> f64| -> Option<f64> {
            let tried: Vec<([f64; 1], f64)> = sizes.iter().map(|size| ([*size], square(*size))).collect();
            vertex(
                &tried
                    .iter()
                    .map(|(values, square)| (&values[..], *square))
                    .collect::<Vec<_>>(),
            )
        };
        assert!((of(|tau| 3.0 + (tau - 0.0127).powi(2)).expect("a size") - 0.0127).abs() < 1e-12);
        assert_eq!(of(|tau| tau), Some(0.0));
        assert_eq!(of(|tau| -tau), Some(0.02));
    }
}
