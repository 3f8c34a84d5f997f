//! What a walk of a zero does to the means of blocks, for every strength that is tried.

use std::sync::Arc;

use imufit_model::sensor::Sensor;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector3};

/// Walk variances per block tried, in units of a block mean's variance.
const GRID: [f64; 18] = [
    0.0, 3e-4, 1e-3, 2e-3, 4e-3, 8e-3, 0.016, 0.032, 0.064, 0.128, 0.256, 0.5, 1.0, 2.0, 4.0, 10.0, 40.0, 200.0,
];
/// The zero of an inertial sensor has wandered before the log begins, for so many blocks: where it wanders visibly, an offset of the
/// like is no bias.
const BEFORE: f64 = 1.0;
/// Fewer blocks than this cannot show a walk.
const MIN_BLOCKS: usize = 8;

/// One strength of the walk for blocks of given sample counts.
pub struct Strength {
    /// Variance of a step.
    pub(super) kappa: f64,
    /// Inverse of the covariance of block means in units of the noise of one sample.
    pub precision: DMatrix<f64>,
    /// ln det of that covariance.
    pub log_determinant: f64,
    /// (R^-1 / kappa + D)^-1 with R the covariance of a unit random walk and D the samples of each block.
    pub(super) smoother: DMatrix<f64>,
}

/// What the sums of a channel stand for.
#[derive(Clone)]
pub(super) enum Walk {
    /// The sum of a block, whose zero makes a step from block to block, and has made some steps before the first.
    Zero {
        /// Variance of the zero where the log begins, in steps.
        before: f64,
    },
    /// Sums along directions within a block, whose rows are projections of a vector: its three zeros each make steps. Block
    /// and direction of each sum.
    Vector(Arc<Vec<(usize, Vector3<f64>)>>),
}

/// Covariance of the means of two blocks of a walk that makes a unit step in the time of a block.
fn walked(before: f64, first: usize, second: usize) -> f64 {
    let within = if first == second { 1.0 / 3.0 } else { 0.5 };
    before + first.min(second) as f64 + within
}

impl Walk {
    /// Of a zero whose sums are those of blocks. The offset of a magnetometer is iron: it has not wandered before.
    pub(super) fn of(sensor: Sensor) -> Self {
        Self::Zero {
            before: if sensor == Sensor::Mag { 0.0 } else { BEFORE },
        }
    }

    /// Covariance of the zeros behind the sums after unit steps.
    pub(super) fn covariance(&self, sums: usize) -> DMatrix<f64> {
        match self {
            Self::Zero { before } => DMatrix::from_fn(sums, sums, |i, j| walked(*before, i, j)),
            Self::Vector(directions) => DMatrix::from_fn(sums, sums, |i, j| {
                let ((a, u), (b, v)) = (&directions[i], &directions[j]);
                walked(BEFORE, *a, *b) * u.dot(v)
            }),
        }
    }
}

/// ln det of a factorised matrix.
pub(super) fn log_determinant(factor: &Cholesky<f64, Dyn>) -> f64 {
    factor.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum()
}

/// Every strength of the walk of a vector for sums with these counts.
pub(super) fn vector_strengths(
    count: &DVector<f64>,
    directions: &[(usize, Vector3<f64>)],
    walk: &Walk,
) -> Vec<Strength> {
    let mut blocks: Vec<usize> = directions.iter().map(|d| d.0).collect();
    blocks.dedup();
    if blocks.len() < MIN_BLOCKS {
        return Vec::new();
    }
    let unit = count.len() as f64 / count.sum();
    let steps = walk.covariance(count.len());
    let of = |step: &f64| {
        let kappa = step * unit;
        let prior = &steps * kappa;
        let covariance = Cholesky::new(&prior + DMatrix::from_diagonal(&count.map(|n| 1.0 / n)))?;
        Some(Strength {
            kappa,
            smoother: &prior - &prior * covariance.solve(&prior),
            log_determinant: log_determinant(&covariance),
            precision: covariance.inverse(),
        })
    };
    GRID.iter().filter_map(of).collect()
}

/// Every strength of the walk for blocks with these sample counts, up to the variance of a step `most`.
pub(super) fn strengths(count: &DVector<f64>, most: f64, walk: &Walk) -> Vec<Strength> {
    let blocks = count.len();
    let filled = count.iter().filter(|n| **n > 0.0).count();
    if filled < MIN_BLOCKS {
        return Vec::new();
    }
    let unit = filled as f64 / count.sum();
    let steps = walk.covariance(blocks);
    GRID.iter()
        .map(|step| step * unit)
        .filter(|kappa| *kappa <= most)
        .filter_map(|kappa| {
            // A block without samples has a mean of no weight.
            let noise = |b: usize| if count[b] > 0.0 { 1.0 / count[b] } else { 1e6 * unit };
            let prior = &steps * kappa;
            let covariance =
                Cholesky::new(&prior + DMatrix::from_diagonal(&DVector::from_fn(blocks, |b, _| noise(b))))?;
            // What the sums tell of each mean, and what the walk does.
            let told = DMatrix::identity(blocks, blocks) + DMatrix::from_diagonal(count) * &prior;
            let smoother = &prior * told.try_inverse()?;
            Some(Strength {
                kappa,
                log_determinant: log_determinant(&covariance),
                precision: covariance.inverse(),
                smoother,
            })
        })
        .collect()
}
