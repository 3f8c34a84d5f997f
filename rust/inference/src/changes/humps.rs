//! A hump: a residual whose mean rises and falls again, as the field of a magnet that passes by.

use nalgebra::{DMatrix, DVector};

use super::block_means::{BlockMeans, Explained, standing_out};

/// Humps that are looked at of those that stand out: as the means are, and as they change from block to block.
const LOOKED_AT: usize = 6;
/// Widths tried, blocks.
const WIDTHS: [f64; 8] = [0.75, 1.0, 1.5, 2.0, 3.0, 4.5, 6.5, 9.0];
/// Middles tried in every block.
const PER_BLOCK: usize = 2;

/// A hump that falls with the cube of the distance from its middle.
#[derive(Clone, Copy, Debug)]
pub struct Hump {
    /// Its middle, blocks from the start.
    pub middle: f64,
    /// Where it has fallen to a third, blocks from the middle.
    pub width: f64,
}

impl Hump {
    fn column(&self, blocks: usize) -> DVector<f64> {
        DVector::from_fn(blocks, |b, _| {
            let away = (b as f64 + 0.5 - self.middle) / self.width;
            (1.0 + away * away).powf(-1.5)
        })
    }

    /// The largest of something that each block has, within the hump.
    pub fn largest(&self, of_blocks: &[f64]) -> f64 {
        let inside = |b: &usize| (*b as f64 + 0.5 - self.middle).abs() <= self.width + 0.5;
        (0..of_blocks.len())
            .filter(inside)
            .map(|b| of_blocks[b])
            .fold(0.0, f64::max)
    }
}

/// All humps tried in a log.
fn all(blocks: usize) -> impl Iterator<Item = Hump> {
    (PER_BLOCK..PER_BLOCK * blocks.saturating_sub(1)).flat_map(|k| {
        WIDTHS.map(|width| Hump {
            middle: (k as f64 + 0.5) / PER_BLOCK as f64,
            width,
        })
    })
}

/// How many humps there can be.
pub fn possible(blocks: usize) -> usize {
    all(blocks).count()
}

/// Part of a signal's square that a column explains.
fn explained(column: &DVector<f64>, signal: &DVector<f64>) -> f64 {
    column.dot(signal).powi(2) / column.norm_squared().max(f64::MIN_POSITIVE)
}

/// Changes from block to block.
fn changes(course: &DVector<f64>) -> DVector<f64> {
    DVector::from_fn(course.len().saturating_sub(1), |b, _| course[b + 1] - course[b])
}

/// The hump that explains the means of a channel best.
pub fn hump(means: &BlockMeans) -> Option<(Hump, Explained)> {
    let residual = &means.without.residual;
    let blocks = means.blocks();
    let jumps = changes(residual);
    let scored = |hump: Hump| {
        let column = hump.column(blocks);
        let level = column.add_scalar(-column.mean());
        let scores = [explained(&level, residual), explained(&changes(&column), &jumps)];
        (hump, scores)
    };
    let asked = standing_out(all(blocks).map(scored).collect(), LOOKED_AT);
    means.best(asked, |hump| DMatrix::from_columns(&[hump.column(blocks)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hump_falls_to_a_third_at_its_width() {
        let hump = Hump {
            middle: 10.5,
            width: 3.0,
        };
        let column = hump.column(20);
        assert!((column[10] - 1.0).abs() < 1e-12);
        assert!((column[13] - 0.353_553).abs() < 1e-5 && (column[7] - column[13]).abs() < 1e-12);
        assert!((hump.largest(&[1.0; 20]) - 1.0).abs() < 1e-12);
        assert_eq!(possible(48), 8 * 92);
    }
}
