//! Noise of a zero from block to block: a random walk and independent scatter, as in a covariance model of several components.
//!
//! With D the information about a constant in each block and W the covariance of the block means of a unit walk, block means have the
//! covariance R = w W / d + s D^-1, d the mean of D. In the eigenvectors of D^1/2 W D^1/2 / d both are diagonal, so that the equations
//! of any question are worked out for every strength (w, s) without a further factorisation:
//! T(w, s) = G - sum over modes k of m_k u_k u_k^T with m_k = (w l_k + s) / (1 + w l_k + s), l_k the eigenvalue.

use imufit_fit::block_sums::ChannelSums;
use imufit_model::sensor::Sensor;
use nalgebra::{DMatrix, DVector};

use crate::problem::Problem;

/// Variances of a walk's step over a block, in units of the variance that white noise gives to a block mean.
const WALK: [f64; 11] = [0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 60.0, 600.0, 1e4];
/// Variances of the scatter of block means besides, in the same unit.
const SCATTER: [f64; 8] = [0.0, 0.2, 1.0, 5.0, 25.0, 150.0, 1e3, 1e4];

/// How strong the noise of a sensor's zeros is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strength {
    /// Variance of the walk over a block.
    pub walk: f64,
    /// Variance of the scatter.
    pub scatter: f64,
    /// Log of its prior probability.
    pub ln_prior: f64,
}

/// Chance that a component is there at all, before the log is seen; every strength of it is then as likely as any.
const THERE: f64 = 0.5;

/// Log of the prior probability of one of so many strengths of a component; the first is none.
pub fn ln_prior(strengths: usize, k: usize) -> f64 {
    if k == 0 {
        (1.0 - THERE).ln()
    } else {
        (THERE / (strengths - 1) as f64).ln()
    }
}

/// Every strength that is integrated over; the first is none.
pub fn strengths() -> Vec<Strength> {
    let of = |i: usize, j: usize| Strength {
        walk: WALK[i],
        scatter: SCATTER[j],
        ln_prior: ln_prior(WALK.len(), i) + ln_prior(SCATTER.len(), j),
    };
    (0..WALK.len())
        .flat_map(|i| (0..SCATTER.len()).map(move |j| of(i, j)))
        .collect()
}

/// Block means of one channel of one log along the eigenvectors of its walk.
pub struct Modes {
    /// Number of the log.
    pub log: usize,
    /// Channel index.
    pub channel: usize,
    /// Sums of every parameter's column (modes x parameters).
    pub sums: DMatrix<f64>,
    /// Sums of the residual.
    pub right: DVector<f64>,
    /// Variance that a unit walk gives to each mode.
    pub walk: DVector<f64>,
    /// Sums of a column that is constant within each block, by its values (modes x blocks).
    pub of_blocks: DMatrix<f64>,
    /// From plain block sums to modes (modes x blocks).
    rotation: DMatrix<f64>,
    /// Largest variance of the walk that the sensor can have.
    most: f64,
}

impl Modes {
    /// Of the block sums of a channel.
    pub fn new(sums: &ChannelSums) -> Self {
        let blocks = sums.count.len();
        // Blocks without samples have no mean: the eigenvectors of a matrix with rows of zeros may not be found.
        let filled: Vec<usize> = (0..blocks).filter(|b| sums.count[*b] > 0.0).collect();
        let mean = sums.count.sum() / filled.len().max(1) as f64;
        let root = DVector::from_iterator(filled.len(), filled.iter().map(|b| sums.count[*b].sqrt()));
        let walk = sums.walk.covariance(blocks);
        let scaled = DMatrix::from_fn(filled.len(), filled.len(), |i, j| {
            root[i] * walk[(filled[i], filled[j])] * root[j] / mean
        });
        let eigen = scaled.symmetric_eigen();
        let turned = eigen.eigenvectors.transpose();
        let weight = sums.weight.sqrt();
        let mut rotation = DMatrix::zeros(filled.len(), blocks);
        let mut of_blocks = rotation.clone();
        for (place, block) in filled.iter().enumerate() {
            rotation.set_column(*block, &(turned.column(place) * (weight / root[place])));
            of_blocks.set_column(*block, &(turned.column(place) * root[place]));
        }
        Self {
            log: sums.log,
            channel: sums.channel,
            sums: &rotation * &sums.sums,
            right: &rotation * &sums.right,
            walk: eigen.eigenvalues.map(|l| l.max(0.0)),
            of_blocks,
            rotation,
            most: sums.most * mean,
        }
    }

    /// Sums along the modes from plain sums over blocks (blocks x columns).
    pub fn along(&self, sums: &DMatrix<f64>) -> DMatrix<f64> {
        &self.rotation * sums
    }

    /// Variance that this noise gives to each mode, in units of the white noise's.
    pub fn variance(&self, strength: Strength) -> DVector<f64> {
        self.walk.map(|l| strength.walk * l + strength.scatter)
    }

    /// Part of each mode that this noise makes of it.
    pub fn noise(&self, strength: Strength) -> DVector<f64> {
        self.variance(strength).map(|v| v / (1.0 + v))
    }

    /// Half of the log determinant that this noise adds.
    pub fn log_determinant(&self, strength: Strength) -> f64 {
        self.walk
            .iter()
            .map(|l| 0.5 * (strength.walk * l + strength.scatter).ln_1p())
            .sum()
    }

    /// True if the sensor's zero can wander so far.
    pub fn possible(&self, strength: Strength) -> bool {
        strength.walk <= self.most
    }

    /// Sensor that the channel belongs to.
    pub const fn sensor(&self) -> usize {
        self.channel / Sensor::ALL.len()
    }
}

/// Modes of every channel of every log.
pub fn modes(problem: &Problem) -> Vec<Modes> {
    problem.sums.iter().map(Modes::new).collect()
}

#[cfg(test)]
mod tests {
    use imufit_fit::block_sums::Walk;
    use nalgebra::{Cholesky, DMatrix, DVector};

    use super::*;

    #[test]
    fn modes_take_out_what_the_dense_covariance_of_walk_and_scatter_does() {
        let blocks = 7;
        let count = DVector::from_fn(blocks, |b, _| 20.0 + 9.0 * b as f64);
        let weight = 4.0;
        let columns = DMatrix::from_fn(blocks, 2, |b, k| if k == 0 { 1.0 } else { (b as f64 - 2.0).powi(2) });
        let sums = ChannelSums {
            log: 0,
            channel: 3,
            weight,
            sums: DMatrix::from_diagonal(&count) * &columns,
            right: DVector::from_fn(blocks, |b, _| (3.0 * b as f64).sin() * count[b]),
            count: count.clone(),
            walk: Walk::Zero,
            most: f64::INFINITY,
        };
        let strength = Strength {
            walk: 0.7,
            scatter: 2.0,
            ln_prior: 0.0,
        };
        let modes = Modes::new(&sums);
        let noise = DMatrix::from_diagonal(&modes.noise(strength));
        let taken = modes.sums.tr_mul(&(&noise * &modes.sums));
        // Dense: C^T (R^-1 + D)^-1 C with R = w W / mean + s D^-1, in units of the noise of a sample.
        let inverse = DMatrix::from_diagonal(&count.map(|n| 1.0 / n));
        let covariance = sums.walk.covariance(blocks) * (strength.walk / count.mean()) + &inverse * strength.scatter;
        let inner = covariance
            .clone()
            .try_inverse()
            .map(|r| r + DMatrix::from_diagonal(&count));
        let root = &sums.sums * weight.sqrt();
        let dense = inner.and_then(Cholesky::new).map(|f| root.tr_mul(&f.solve(&root)));
        assert!(dense.is_some_and(|dense| (dense - taken).norm() < 1e-6 * root.norm_squared()));
        let whole = DMatrix::identity(blocks, blocks) + covariance * DMatrix::from_diagonal(&count);
        assert!((modes.log_determinant(strength) - 0.5 * whole.determinant().ln()).abs() < 1e-9);
    }

    #[test]
    fn blocks_without_samples_leave_the_others_as_they_are() {
        let (filled, blocks) = (5, 11);
        let count = |size: usize| DVector::from_fn(size, |b, _| if b < filled { 30.0 + b as f64 } else { 0.0 });
        let of = |size: usize| {
            Modes::new(&ChannelSums {
                log: 0,
                channel: 2,
                weight: 1.0,
                sums: DMatrix::from_fn(size, 1, |b, _| if b < filled { b as f64 } else { 0.0 }),
                right: count(size).map(f64::sqrt),
                count: count(size),
                walk: Walk::Zero,
                most: f64::INFINITY,
            })
        };
        let (whole, part) = (of(blocks), of(filled));
        assert_eq!(whole.walk, part.walk);
        assert_eq!(whole.right, part.right);
        assert_eq!(whole.sums, part.sums);
    }
}
