//! Noise of the residual: how it follows its own past, from which whitening filters come.

use imufit_model::effect::EffectError;
use imufit_model::facts::LOOKBACK;
use imufit_model::sensor::{CHANNELS, Sensor};
use imufit_model::window::Window;
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::evidence::{Evidence, PART, Samples};
use crate::whitening::{self, Filter, MAX_ORDER};

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

/// Products of a sample with itself and with those before it, the sample first, of each with each.
type Products = [[f64; MAX_ORDER + 1]; MAX_ORDER + 1];

/// Products of the residual left by given parameters (all of them, candidates too) with its own past, summed over windows.
#[derive(Clone, Debug)]
pub struct PastProducts {
    /// Per channel, by how many samples are before the one that the products belong to.
    sums: Vec<Vec<Products>>,
    /// Number of samples that have so many before them.
    counts: Vec<[usize; MAX_ORDER + 1]>,
}

impl Default for PastProducts {
    fn default() -> Self {
        Self {
            sums: vec![vec![[[0.0; MAX_ORDER + 1]; MAX_ORDER + 1]; MAX_ORDER + 1]; CHANNELS],
            counts: vec![[0; MAX_ORDER + 1]; CHANNELS],
        }
    }
}

impl PastProducts {
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
            let own = self.sums.iter_mut().flatten().flatten().flatten();
            own.zip(part.sums.iter().flatten().flatten().flatten())
                .for_each(|(a, b)| *a += b);
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
                    let near = |lag: &usize| samples.rows[k] - samples.rows[k - lag] <= LOOKBACK;
                    let past = (0..=MAX_ORDER.min(samples.run[k])).take_while(near).count() - 1;
                    out.counts[channel][past] += 1;
                    let sums = &mut out.sums[channel][past];
                    for i in 0..=past {
                        for j in 0..=i {
                            sums[i][j] += residual[samples.rows[k - i]] * residual[samples.rows[k - j]];
                        }
                    }
                }
            }
        }
        Ok(out)
    }

    /// Whitening filter of a channel; empty where its residual is white. It looks back as far as most samples do: a slow sensor has few
    /// samples within [`LOOKBACK`] rows.
    pub fn filter(&self, channel: usize) -> Filter {
        let counts = &self.counts[channel];
        let looking_back = |order: usize| counts[order..].iter().sum::<usize>();
        let order = (0..=MAX_ORDER).rfind(|p| 2 * looking_back(*p) >= looking_back(0).max(1));
        let order = order.unwrap_or(0);
        let mut products = DMatrix::zeros(order + 1, order + 1);
        for sums in &self.sums[channel][order..] {
            for i in 0..=order {
                for j in 0..=i {
                    products[(i, j)] += sums[i][j];
                }
            }
        }
        products.fill_upper_triangle_with_lower_triangle();
        whitening::filter(&products, looking_back(order))
    }
}
