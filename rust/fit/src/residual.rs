//! Where a model fails: residual by channel, by block of time, and against every covariate.

use imufit_model::sensor::CHANNELS;
use nalgebra::DVector;

use crate::bins::BINS;
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
    /// Residual in its bins.
    pub binned: Binned,
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
    let of_covariate = |(covariate, edges): (usize, &Vec<f64>)| {
        let in_bin = |bin: usize| {
            let of_block = |(_, block): (usize, &ChannelBlock)| {
                let bins = &block.bins[covariate];
                let of_sums = |sums: &[f64]| sums.iter().zip(v.iter()).map(|(a, b)| a * b).sum();
                (bins.of(bin).map_or(0.0, of_sums), bins.count[bin])
            };
            raw.of_channel(channel).map(of_block).collect()
        };
        let cells: Vec<Vec<Cell>> = (0..=edges.len()).map(in_bin).collect();
        let binned = Binned::new(&cells, square, n, floor);
        Panel {
            channel,
            covariate,
            binned,
        }
    };
    let edges = raw.layout.bins.edges.iter().enumerate();
    let mut out: Vec<Panel> = edges.filter(|(_, edges)| !edges.is_empty()).map(of_covariate).collect();
    out.sort_by(|a, b| b.binned.share.total_cmp(&a.binned.share));
    out
}

/// Sum and number of the samples of one block of time in one bin.
type Cell = (f64, f64);

/// Residual in bins of a covariate.
#[derive(Clone, Debug)]
pub struct Binned {
    /// Mean residual in each bin; NaN where the bin is empty.
    pub mean: Vec<f64>,
    /// Half width of its 95 % band from the scatter between blocks; NaN with one block.
    pub band: Vec<f64>,
    /// Share of the residual's variance above its noise floor that the bins explain, 0 to 1.
    pub share: f64,
}

/// Part of a residual's mean square that may be above the noise floor even where the floor is stated too high.
const LEAST_EXCESS: f64 = 0.05;
/// Standard errors of a 95 % band.
const BAND: f64 = 1.96;

impl Binned {
    /// From the cells of each bin, block by block, and the sum of squares of n samples.
    fn new(cells: &[Vec<Cell>], square: f64, n: usize, floor: f64) -> Self {
        let excess = (square - n as f64 * floor * floor).max(LEAST_EXCESS * square);
        let (mut mean, mut band) = (vec![f64::NAN; cells.len()], vec![f64::NAN; cells.len()]);
        // Around the mean: a constant residual depends on nothing.
        let (mut between, mut expected, mut sum, mut all) = (0.0, -floor * floor, 0.0, 0.0);
        for (bin, blocks) in cells.iter().enumerate() {
            let parts = || blocks.iter().filter(|(_, count)| *count > 0.0);
            let count: f64 = parts().map(|p| p.1).sum();
            if count == 0.0 {
                continue;
            }
            let m = parts().map(|p| p.0).sum::<f64>() / count;
            let scatter: f64 = parts().map(|p| (p.0 - m * p.1).powi(2)).sum();
            let k = parts().count() as f64;
            mean[bin] = m;
            if k > 1.0 {
                band[bin] = BAND * (scatter * k / (k - 1.0)).sqrt() / count;
            }
            between += count * m * m;
            sum += count * m;
            all += count;
            expected += floor * floor;
        }
        between -= if all > 0.0 { sum * sum / all } else { 0.0 };
        Self {
            mean,
            band,
            share: if excess > 0.0 {
                ((between - expected) / excess).clamp(0.0, 1.0)
            } else {
                0.0
            },
        }
    }
}

/// Blocks of time whose scatter gives the band of a residual against rows of any value.
const BLOCKS: usize = 48;

/// Residual against some value in the same rows, in bins of equal count, and the mean value in each bin; rows with a NaN do not count. `None`
/// where the value does not vary.
pub fn against(value: &[f64], residual: &[f64], floor: f64) -> Option<(Vec<f64>, Binned)> {
    let known = |(x, y): (&f64, &f64)| (x.is_finite() && y.is_finite()).then_some((*x, *y));
    let rows: Vec<(f64, f64)> = value.iter().zip(residual).filter_map(known).collect();
    let mut sorted: Vec<f64> = rows.iter().map(|row| row.0).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let lowest = *sorted.first()?;
    let mut edges: Vec<f64> = (1..BINS).map(|k| sorted[k * sorted.len() / BINS]).collect();
    edges.retain(|edge| *edge > lowest);
    edges.dedup();
    if edges.is_empty() {
        return None;
    }
    let mut cells = vec![vec![(0.0, 0.0); BLOCKS]; edges.len() + 1];
    let mut centre = vec![0.0; cells.len()];
    for (row, (x, y)) in rows.iter().enumerate() {
        let bin = edges.partition_point(|edge| edge <= x);
        let cell = &mut cells[bin][row * BLOCKS / rows.len()];
        cell.0 += y;
        cell.1 += 1.0;
        centre[bin] += x;
    }
    for (sum, blocks) in centre.iter_mut().zip(&cells) {
        *sum /= blocks.iter().map(|cell| cell.1).sum::<f64>();
    }
    let square = rows.iter().map(|(_, y)| y * y).sum();
    Some((centre, Binned::new(&cells, square, rows.len(), floor)))
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

    #[test]
    fn a_residual_that_is_the_value_is_explained_by_it() {
        let value: Vec<f64> = (0..1200).map(|k| f64::from((k * 7919) % 1200)).collect();
        let residual: Vec<f64> = value.iter().map(|v| 0.1 * (v - 599.5)).collect();
        let (centre, binned) = against(&value, &residual, 1e-3).unwrap();
        assert_eq!(centre.len(), BINS);
        for (c, mean) in centre.iter().zip(&binned.mean) {
            assert!((0.1 * (c - 599.5) - mean).abs() < 1e-9);
        }
        // Within bins of a twelfth of the range lies 1/144 of the variance.
        assert!((binned.share - (1.0 - 1.0 / 144.0)).abs() < 1e-3, "{}", binned.share);
        assert!(against(&[1.0; 100], &residual[..100], 1e-3).is_none());
        assert!(against(&[f64::NAN; 4], &residual[..4], 1e-3).is_none());
    }
}
