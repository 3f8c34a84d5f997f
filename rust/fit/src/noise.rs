//! Noise of the residual: autocovariance and spectrum, from which whitening filters come.

use imufit_model::effect::EffectError;
use imufit_model::facts::LOOKBACK;
use imufit_model::sensor::{CHANNELS, Sensor};
use imufit_model::window::Window;
use rayon::prelude::*;

use crate::evidence::{Evidence, PART, Samples};
use crate::whitening::MAX_ORDER;

/// Rows looked at, at most about: parts spread evenly over the log tell the noise as well as all of it.
const ROWS: usize = 1 << 17;

/// Fewer samples than this have no mean of their own: it would take the place of correlation (20 for each lag).
const OWN_MEAN: usize = 20 * MAX_ORDER;

/// Means of the residual of a channel after a step of all parameters, block by block; neighbouring blocks of few samples share one.
///
/// What changes more slowly than a block is noise of the zero, or an effect that is not in the model. Either would pass for correlation
/// between neighbouring samples, and the filter would take most of the effect away.
fn block_means(evidence: &Evidence, channel: usize, step: &[f64]) -> Vec<f64> {
    let active = &evidence.layout.model.active()[channel];
    let sums: Vec<(f64, usize)> = (0..evidence.layout.blocks)
        .map(|b| {
            evidence.get(b, channel).map_or((0.0, 0), |block| {
                let explained: f64 = active.iter().enumerate().map(|(k, p)| block.sum[k] * step[*p]).sum();
                (block.sum[active.len()] - explained, block.n)
            })
        })
        .collect();
    let blocks = sums.len();
    let total: usize = sums.iter().map(|s| s.1).sum();
    let group = (OWN_MEAN * blocks).div_ceil(total.max(1)).clamp(1, blocks.max(1));
    let mean = |b: usize| {
        let first = b / group * group;
        let own = &sums[first..(first + group).min(blocks)];
        let n: usize = own.iter().map(|s| s.1).sum();
        own.iter().map(|s| s.0).sum::<f64>() / n.max(1) as f64
    };
    (0..blocks).map(mean).collect()
}

/// Autocovariances of the residual left by given parameters (all of them, candidates too), summed over windows.
#[derive(Clone, Debug)]
pub struct Autocovariance {
    /// Sum of products at each lag, per channel.
    sums: Vec<[f64; MAX_ORDER + 1]>,
    /// Number of products at each lag, per channel.
    counts: Vec<[usize; MAX_ORDER + 1]>,
}

impl Default for Autocovariance {
    fn default() -> Self {
        Self {
            sums: vec![[0.0; MAX_ORDER + 1]; CHANNELS],
            counts: vec![[0; MAX_ORDER + 1]; CHANNELS],
        }
    }
}

impl Autocovariance {
    /// Adds core rows of a window, of a long log only some parts: the residual less the columns times `step` and less the mean of its block.
    pub fn add(&mut self, window: &Window, evidence: &Evidence, step: &[f64]) -> Result<(), EffectError> {
        let layout = &evidence.layout;
        let means: Vec<Vec<f64>> = (0..CHANNELS)
            .map(|channel| block_means(evidence, channel, step))
            .collect();
        let every = layout.facts.n.div_ceil(ROWS).max(1);
        let parts: Vec<Result<Self, EffectError>> = window
            .parts(PART, every, layout.model.margin(window, &layout.facts))
            .par_iter()
            .map(|part| Self::of(part, evidence, &means, step))
            .collect();
        // Summed in the order of time, so that the result does not depend on the number of threads.
        for part in parts {
            let part = part?;
            let pairs = self.sums.iter_mut().flatten().zip(part.sums.iter().flatten());
            pairs.for_each(|(a, b)| *a += b);
            let pairs = self.counts.iter_mut().flatten().zip(part.counts.iter().flatten());
            pairs.for_each(|(a, b)| *a += b);
        }
        Ok(())
    }

    /// That of the core rows of one window.
    fn of(window: &Window, evidence: &Evidence, means: &[Vec<f64>], step: &[f64]) -> Result<Self, EffectError> {
        let layout = &evidence.layout;
        let mut out = Self::default();
        let core = window.begin;
        let window = window.with_core(core.saturating_sub(LOOKBACK), window.end);
        let evaluation = layout.model.evaluate(&window, &layout.facts)?;
        let t = &window.t[window.begin..window.end];
        for sensor in Sensor::ALL {
            let samples = Samples::new(sensor, &evaluation, t, layout.facts.sensor_dt[sensor.index()]);
            for channel in 3 * sensor.index()..3 * sensor.index() + 3 {
                let Some(columns) = &evaluation.channels[channel] else {
                    continue;
                };
                let mut residual = columns.residual_after(&layout.model.active()[channel], step);
                for (k, value) in residual.iter_mut().enumerate() {
                    *value -= means[channel][layout.block(window.offset + window.begin + k)];
                }
                for k in samples.with_past(core - window.begin, 0) {
                    let now = residual[samples.rows[k]];
                    for lag in 0..=MAX_ORDER.min(samples.run[k]) {
                        if samples.rows[k] - samples.rows[k - lag] > LOOKBACK {
                            break;
                        }
                        out.sums[channel][lag] += now * residual[samples.rows[k - lag]];
                        out.counts[channel][lag] += 1;
                    }
                }
            }
        }
        Ok(out)
    }

    /// Autocovariance of a channel, lag 0 first, and its number of samples. It ends with the last lag that most samples
    /// look back on: a slow sensor has few samples within [`LOOKBACK`] rows.
    pub fn of_channel(&self, channel: usize) -> (Vec<f64>, usize) {
        let counts = &self.counts[channel];
        let seen = self.sums[channel]
            .iter()
            .zip(counts)
            .take_while(|(_, n)| 2 * **n >= counts[0].max(1));
        (seen.map(|(s, n)| s / *n as f64).collect(), counts[0])
    }
}
