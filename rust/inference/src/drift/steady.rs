//! Steady changes within the blocks, which a walk makes as well as a cause that changes slowly.

use imufit_fit::normal_equations::NormalEquations;
use nalgebra::DMatrix;

use super::channel_sums::ChannelSums;

impl ChannelSums {
    /// What steady changes within the blocks say of the parameters, judged by how block means change from block to block: a walk goes on
    /// within the blocks, so that these say nothing that the means have not said. `None` where sums are along directions.
    fn steady(&self) -> Option<NormalEquations> {
        if !self.of_blocks() {
            return None;
        }
        let filled: Vec<usize> = (0..self.count.len()).filter(|b| self.count[*b] > 0.0).collect();
        let mut out = NormalEquations::zeros(self.sums.ncols());
        for (k, b) in filled.iter().enumerate() {
            let (before, after) = (filled[k.saturating_sub(1)], filled[(k + 1).min(filled.len() - 1)]);
            let apart = after.saturating_sub(before).max(1) as f64;
            let change =
                (self.sums.row(after) / self.count[after] - self.sums.row(before) / self.count[before]) / apart;
            let right = (self.right[after] / self.count[after] - self.right[before] / self.count[before]) / apart;
            // Sum of squares of n values that rise evenly by one.
            let squares = self.weight * self.count[*b] / 12.0;
            out.gram.gemm_tr(squares, &change, &change, 1.0);
            out.right.axpy(squares * right, &change.transpose(), 1.0);
            out.square += squares * right * right;
        }
        Some(out)
    }

    /// What the means of the blocks say of the parameters.
    fn of_means(&self) -> NormalEquations {
        let mut out = NormalEquations::zeros(self.sums.ncols());
        let weights = self.count.map(|n| if n > 0.0 { self.weight / n } else { 0.0 });
        let weighted = DMatrix::from_diagonal(&weights) * &self.sums;
        out.gram.gemm_tr(1.0, &weighted, &self.sums, 1.0);
        out.right.gemv_tr(1.0, &weighted, &self.right, 1.0);
        out
    }
}

/// Equations without what steady changes within the blocks say of the parameters.
pub(super) fn without_steady(channels: &[ChannelSums], equations: &NormalEquations) -> NormalEquations {
    let mut means = NormalEquations::zeros(equations.right.len());
    let mut within = equations.clone();
    for channel in channels {
        if let Some(steady) = channel.steady() {
            let of_means = channel.of_means();
            within.add(&of_means, -1.0);
            within.add(&steady, -1.0);
            means.add(&of_means, 1.0);
        }
    }
    // Means tell of changes within blocks only about as much: what seems less than nothing is nothing.
    let scale = equations
        .gram
        .diagonal()
        .map(|g| if g > 0.0 { 1.0 / g.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(scale.len(), scale.len(), |i, j| {
        within.gram[(i, j)] * scale[i] * scale[j]
    });
    let eigen = scaled.symmetric_eigen();
    let kept: Vec<usize> = (0..scale.len()).filter(|k| eigen.eigenvalues[*k] > 0.0).collect();
    let vectors = eigen.eigenvectors.select_columns(&kept);
    let values = eigen.eigenvalues.select_rows(&kept);
    let back = scale.map(|s| if s > 0.0 { 1.0 / s } else { 0.0 });
    let half = DMatrix::from_diagonal(&back) * &vectors;
    let mut out = equations.clone();
    out.gram = &half * DMatrix::from_diagonal(&values) * half.transpose() + means.gram;
    out.right = &half * vectors.tr_mul(&scale.component_mul(&within.right)) + means.right;
    out
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use imufit_model::sensor::Sensor;
    use nalgebra::{DMatrix, DVector};

    use super::super::walk::Walk;
    use super::*;

    #[test]
    fn a_steady_drift_is_told_by_means_alone_and_what_shakes_within_blocks_is_kept() {
        // Two columns over 12 blocks of 50 samples: the time in blocks, and one that changes its sign from sample to sample.
        let (blocks, n) = (12_usize, 50_usize);
        let mut equations = NormalEquations::zeros(2);
        let mut sums = DMatrix::zeros(blocks, 2);
        for b in 0..blocks {
            for k in 0..n {
                let t = b as f64 + (k as f64 + 0.5) / n as f64;
                let x = DVector::from_vec(vec![t, if k % 2 == 0 { 1.0 } else { -1.0 }]);
                equations.gram += &x * x.transpose();
                let mut row = sums.row_mut(b);
                row += x.transpose();
            }
        }
        let channel = ChannelSums {
            log: 0,
            channel: 3,
            weight: 1.0,
            right: DVector::zeros(blocks),
            count: DVector::from_element(blocks, n as f64),
            sums: sums.clone(),
            walk: Walk::of(Sensor::Gyr),
            strengths: Arc::new(Vec::new()),
            telling: true,
        };
        let left = without_steady(&[channel], &equations).gram;
        let means: f64 = sums.column(0).iter().map(|s| s * s / n as f64).sum();
        assert!((left[(0, 0)] - means).abs() < 1e-3 * means);
        assert!((left[(1, 1)] - equations.gram[(1, 1)]).abs() < 1e-6 * equations.gram[(1, 1)]);
    }
}
