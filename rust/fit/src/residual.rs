//! Where a model fails: residual by channel, by block of time, and against every covariate.

use imufit_model::sensor::CHANNELS;
use nalgebra::DVector;

use crate::evidence::{ChannelBlock, Evidence};

/// Residual of one channel.
#[derive(Clone, Debug)]
pub struct ChannelResidual {
    /// Channel index.
    pub channel: usize,
    /// Number of samples.
    pub n: usize,
    /// Root mean square.
    pub rms: f64,
    /// Mean.
    pub mean: f64,
    /// RMS in each block; NaN without samples.
    pub block_rms: Vec<f64>,
}

/// Binned residual of a channel against a covariate.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Channel index.
    pub channel: usize,
    /// Covariate index.
    pub covariate: usize,
    /// Mean residual in each bin; NaN where the bin is empty.
    pub mean: Vec<f64>,
    /// Half width of its 95 % band from the scatter between blocks.
    pub band: Vec<f64>,
    /// Share of the channel's variance above its noise floor that the bins explain, 0 to 1.
    pub share: f64,
}

/// Residual of every channel that has samples, at a step of the parameters.
pub fn channels(raw: &Evidence, step: &DVector<f64>) -> Vec<ChannelResidual> {
    let of = |channel: usize| {
        let (square, n) = raw.square(channel, step);
        let v = raw.contrast(channel, step);
        let sum: f64 = raw.of_channel(channel).map(|(_, block)| block.sum.dot(&v)).sum();
        let rms = |(square, n): (f64, usize)| (square / n as f64).sqrt();
        (n > 0).then(|| ChannelResidual {
            channel,
            n,
            rms: rms((square, n)),
            mean: sum / n as f64,
            block_rms: raw.squares(channel, step).into_iter().map(rms).collect(),
        })
    };
    (0..CHANNELS).filter_map(of).collect()
}

/// Binned residuals of one channel against every covariate that varies; the largest share first.
pub fn panels(raw: &Evidence, step: &DVector<f64>, channel: usize, floor: f64) -> Vec<Panel> {
    let v = raw.contrast(channel, step);
    let (square, n) = raw.square(channel, step);
    let excess = (square - n as f64 * floor * floor).max(0.05 * square);
    let mut out = Vec::new();
    for covariate in 0..raw.layout.bins.edges.len() {
        if raw.layout.bins.edges[covariate].is_empty() {
            continue;
        }
        let bins = raw.layout.bins.edges[covariate].len() + 1;
        let (mut mean, mut band) = (vec![f64::NAN; bins], vec![f64::NAN; bins]);
        // Around the mean: a constant residual depends on nothing.
        let (mut between, mut expected, mut sum, mut all) = (0.0, -floor * floor, 0.0, 0.0);
        for bin in 0..bins {
            let of_block = |(_, block): (usize, &ChannelBlock)| {
                let sums = &block.bin_sum[covariate][bin * v.len()..(bin + 1) * v.len()];
                let sum: f64 = sums.iter().zip(v.iter()).map(|(a, b)| a * b).sum();
                (sum, block.bin_count[covariate][bin])
            };
            let parts = raw.of_channel(channel).map(of_block).filter(|(_, count)| *count > 0.0);
            let parts: Vec<(f64, f64)> = parts.collect();
            let count: f64 = parts.iter().map(|p| p.1).sum();
            if count == 0.0 {
                continue;
            }
            let m = parts.iter().map(|p| p.0).sum::<f64>() / count;
            let scatter: f64 = parts.iter().map(|p| (p.0 - m * p.1).powi(2)).sum();
            let k = parts.len() as f64;
            mean[bin] = m;
            if parts.len() > 1 {
                band[bin] = 1.96 * (scatter * k / (k - 1.0)).sqrt() / count;
            }
            between += count * m * m;
            sum += count * m;
            all += count;
            expected += floor * floor;
        }
        between -= if all > 0.0 { sum * sum / all } else { 0.0 };
        out.push(Panel {
            channel,
            covariate,
            mean,
            band,
            share: ((between - expected) / excess).clamp(0.0, 1.0),
        });
    }
    out.sort_by(|a, b| b.share.total_cmp(&a.share));
    out
}

/// Shortest stretch of blocks that holds 80 % of the excess over the floor; (first, one past last).
pub fn stretch(block_rms: &[f64], floor: f64) -> (usize, usize) {
    let excess: Vec<f64> = block_rms
        .iter()
        .map(|r| {
            if r.is_finite() {
                (r * r - floor * floor).max(0.0)
            } else {
                0.0
            }
        })
        .collect();
    let wanted = 0.8 * excess.iter().sum::<f64>();
    let mut best = (0, block_rms.len());
    for first in 0..excess.len() {
        let mut sum = 0.0;
        for last in first..excess.len() {
            sum += excess[last];
            if sum >= wanted {
                if last + 1 - first < best.1 - best.0 {
                    best = (first, last + 1);
                }
                break;
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stretch_with_the_excess_is_found() {
        assert_eq!(stretch(&[1.0, 1.0, 3.0, 3.0, 1.0, f64::NAN], 1.0), (2, 4));
    }
}
