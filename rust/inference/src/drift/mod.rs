//! Wandering zeros: a random walk of each channel's bias from block to block.
//!
//! A gyroscope's zero wanders more slowly than any whitening filter of affordable length can see. Whatever varies as slowly (a bias,
//! a temperature, an attitude that hardly changes) would then look significant. For each question the strength of the walk
//! is judged by the restricted likelihood of block means of the residual that the question's own parameters leave, and taken
//! into account by generalised least squares.

pub mod channel_sums;
mod steady;
pub mod walk;

use imufit_fit::normal_equations::NormalEquations;
use imufit_model::sensor::Sensor;
use nalgebra::DMatrix;

pub use self::channel_sums::{ChannelSums, channel_sums};
use self::steady::without_steady;

/// How strongly a sensor's zeros wander: the channels concerned and how probable each strength is.
struct Wandering<'a> {
    channels: Vec<&'a ChannelSums>,
    probabilities: Vec<f64>,
}

impl Wandering<'_> {
    /// The most probable strength.
    fn likeliest(&self) -> usize {
        let p = &self.probabilities;
        (0..p.len()).max_by(|a, b| p[*a].total_cmp(&p[*b])).unwrap_or(0)
    }

    /// The least strength that is exceeded with at most this probability.
    fn exceeded(&self, probability: f64) -> usize {
        let mut above: f64 = self.probabilities.iter().sum();
        let position = self.probabilities.iter().position(|p| {
            above -= p;
            above <= probability
        });
        position.unwrap_or(self.probabilities.len().saturating_sub(1))
    }

    /// True if the zeros can wander at all.
    fn any(&self, strength: usize) -> bool {
        self.channels.first().is_some_and(|c| c.strengths[strength].kappa > 0.0)
    }
}

/// How strongly the zeros of each sensor wander in each log. Before the log is seen they are as likely not to wander as to do so, and every
/// strength of the grid is as good.
fn wandering(channels: &[ChannelSums]) -> Vec<Wandering<'_>> {
    let mut found = Vec::new();
    let logs = channels.iter().map(|c| c.log + 1).max().unwrap_or(0);
    for (log, sensor) in (0..logs).flat_map(|log| (0..3).map(move |sensor| (log, sensor))) {
        let own: Vec<&ChannelSums> = channels
            .iter()
            .filter(|c| c.log == log && c.channel / 3 == sensor && !c.strengths.is_empty())
            .collect();
        let Some(first) = own.first() else { continue };
        let strengths = first.strengths.len();
        let mut total = vec![0.0; strengths];
        for channel in own.iter().filter(|c| c.telling && c.strengths.len() == strengths) {
            for (t, l) in total.iter_mut().zip(channel.likelihoods()) {
                *t += l;
            }
        }
        if first.strengths[0].kappa == 0.0 {
            total[0] += (strengths.max(2) as f64 - 1.0).ln();
        }
        let most = total.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = total.iter().map(|l| (l - most).exp()).collect();
        let sum: f64 = weights.iter().sum();
        found.push(Wandering {
            channels: own,
            probabilities: weights.iter().map(|w| w / sum).collect(),
        });
    }
    found
}

/// The strengths that a log leaves possible are gone through in steps of the probability with which the walk is stronger: each step leaves
/// this part of it.
const STEP: f64 = 0.6;
/// Walks stronger than those of this probability are left out: no p-value that decides anything depends on them.
const IMPROBABLE: f64 = 1e-6;

/// Probabilities with which a strength of the walk is exceeded, and the weight of the strengths before each.
fn levels() -> impl Iterator<Item = (f64, f64)> {
    let above = std::iter::successors(Some(1.0), |p| Some(p * STEP));
    above.take_while(|p| *p > IMPROBABLE).map(|p| (p * STEP, p - p * STEP))
}

/// The equations of a question with wandering zeros taken out, for strengths from the middle of what the log leaves possible to
/// the far end, each with its weight. Empty if no zero wanders in a way that puts the answer in doubt.
///
/// A log that does not tell how strong the walk is may hide a strong one; what varies as slowly as the walk must not gain from that.
/// The offset of a magnetometer is iron, which does not wander; the field does, from place to place, and counts for less where it does.
pub fn without(channels: &[ChannelSums], equations: &NormalEquations) -> Vec<(f64, NormalEquations)> {
    let sensors = wandering(channels);
    let steady_taken = without_steady(channels, equations);
    let inertial = |w: &Wandering| w.channels.iter().any(|c| c.channel / 3 != Sensor::Mag.index());
    let mut out: Vec<(f64, NormalEquations)> = Vec::new();
    let mut before: Option<Vec<usize>> = None;
    for (probability, weight) in levels() {
        let strengths: Vec<usize> = sensors.iter().map(|w| w.exceeded(probability)).collect();
        if before.as_ref() == Some(&strengths) {
            if let Some(last) = out.last_mut() {
                last.0 += weight;
            }
            continue;
        }
        let mut reduced = steady_taken.clone();
        for (sensor, strength) in sensors.iter().zip(&strengths).filter(|(w, s)| w.any(**s)) {
            for channel in &sensor.channels {
                channel.take_out(*strength, &mut reduced);
            }
        }
        before = Some(strengths);
        out.push((weight, reduced));
    }
    let doubtful = sensors.iter().any(|w| inertial(w) && w.any(w.exceeded(IMPROBABLE)));
    if doubtful { out } else { Vec::new() }
}

/// What wandering zeros add to the covariance of `X^T y` of equations over the same parameters.
pub fn spread(channels: &[ChannelSums], parameters: usize) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(parameters, parameters);
    for sensor in wandering(channels) {
        let strength = sensor.likeliest();
        for channel in sensor.channels.iter().filter(|_| sensor.any(strength)) {
            sum += channel.spread(strength);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::DVector;

    use super::walk::{Walk, strengths};
    use super::*;

    #[test]
    fn a_walk_is_told_from_white_block_means() {
        let mut state = 12345_u64;
        let mut normal = || {
            // Sum of twelve uniforms: good enough here, and without a dependency.
            let mut uniform = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
                (state >> 33) as f64 / f64::from(1_u32 << 31)
            };
            (0..12).map(|_| uniform()).sum::<f64>() - 6.0
        };
        let count = DVector::from_element(48, 100.0);
        let strengths = Arc::new(strengths(&count, f64::INFINITY, &Walk::of(Sensor::Gyr)));
        let mut sums = |walk: f64| {
            let mut level = 0.0;
            let right = DVector::from_fn(48, |_, _| {
                level += walk * normal();
                100.0 * level + 10.0 * normal()
            });
            let (sums, strengths) = (DMatrix::from_element(48, 1, 100.0), strengths.clone());
            ChannelSums {
                log: 0,
                channel: 3,
                weight: 1.0,
                sums,
                right,
                count: count.clone(),
                walk: Walk::of(Sensor::Gyr),
                strengths,
                telling: true,
            }
        };
        let best = |s: &ChannelSums| {
            let l = s.likelihoods();
            (0..l.len())
                .max_by(|a, b| l[*a].total_cmp(&l[*b]))
                .map(|k| s.strengths[k].kappa)
        };
        let (white, walking) = (sums(0.0), sums(0.1));
        assert!(best(&white) < Some(1e-4));
        // The walk's variance is 0.01 a block.
        assert!(best(&walking) > Some(3e-3) && best(&walking) < Some(3e-2));
    }
}
