//! A coefficient that is common to all blocks beside a part that varies from block to block: theta_b = theta + delta_b.
//!
//! Motion that the reference loses, noise that follows the rate and a few loud blocks give every block a coefficient of its own. Such a
//! part, normal with the deviation tau times what is typical, is integrated out with and without the common one (a random-effects
//! meta-analysis, DerSimonian and Laird 1986). A few informative blocks then count as few.

use std::ops::Range;

use imufit_fit::block_sums::ChannelSums;
use imufit_fit::normal_equations::NormalEquations;
use nalgebra::{Cholesky, DMatrix, DVector};

use crate::asked::Prior;
use crate::problem::Question;
use crate::stack::{Beside, log_sum_exp};
use crate::zeros::{Modes, Strength};

/// Deviations of the varying part, in units of a third of the prior deviation (what is typical).
const VARYING: [f64; 7] = [0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0];

/// Neighbouring blocks agree by so many standard deviations in what a cause that drifts or switches shows: chance makes as many in one of
/// 160. Noise that follows the motion differs from block to block, too, but of any two blocks independently: it makes
/// more in 1 of 400 logs of `imufit grade --set nothing`, drifts and switches of the second simulator make 3 to 5.
const AGREE: f64 = 2.5;

/// Part of the largest information that is added to each, so that what the log does not show has a solution: it moves none that is shown.
const RIDGE: f64 = 1e-12;

/// Equations of one block: parameters asked about (stack projected out), zeros of channels, residual.
struct Block {
    /// Number of the block in its log.
    row: usize,
    information: DMatrix<f64>,
    score: DVector<f64>,
    /// Sums of the columns by channel (channels x asked).
    sums: DMatrix<f64>,
    /// Sums of the residual by channel.
    right: DVector<f64>,
    count: DVector<f64>,
}

impl Block {
    /// Information and score within the block, beside a level of each channel.
    fn without_levels(&self) -> (DMatrix<f64>, DVector<f64>) {
        let (mut information, mut score) = (self.information.clone(), self.score.clone());
        for (k, count) in self.count.iter().enumerate().filter(|(_, count)| **count > 0.0) {
            let sums = self.sums.row(k).transpose();
            information.ger(-1.0 / count, &sums, &sums, 1.0);
            score.axpy(-self.right[k] / count, &sums, 1.0);
        }
        (information, score)
    }
}

/// Deviation factors of a channel's zeros: L with R = L L^T (blocks x modes), in units of the noise of a sample.
fn factor(modes: &Modes, strength: Strength, count: &DVector<f64>) -> DMatrix<f64> {
    // of_blocks = Q^T D^1/2, so that D^-1/2 Q = (of_blocks D^-1)^T.
    DMatrix::from_fn(count.len(), modes.walk.len(), |b, k| {
        let variance = strength.walk * modes.walk[k] + strength.scatter;
        if count[b] > 0.0 {
            modes.of_blocks[(k, b)] / count[b] * variance.sqrt()
        } else {
            0.0
        }
    })
}

/// Log Bayes factors of the two parts of a coefficient.
#[derive(Clone, Copy, Debug)]
pub struct Varying {
    /// Of the common part, where it may vary from block to block besides.
    pub common: f64,
    /// Of a part that varies slowly, beside the common one.
    pub varies: f64,
}

impl Varying {
    /// Of what cannot vary.
    pub const STEADY: Self = Self {
        common: f64::INFINITY,
        varies: f64::NEG_INFINITY,
    };
}

/// Of what a question asks about (prior deviations `deviation`); `strength` is the noise of each sensor's zeros.
pub fn ln_bayes(
    question: &Question,
    deviation: &[f64],
    modes: &[Modes],
    strength: impl Fn(usize) -> Strength,
) -> Option<Varying> {
    let (p, m) = (question.model, question.parameters() - question.model);
    let channels: Vec<usize> = (0..question.sums.len())
        .filter(|c| {
            let sums = &question.sums[*c];
            sums.of_blocks() && sums.sums.columns(p, m).iter().any(|v| *v != 0.0)
        })
        .collect();
    let factors: Vec<DMatrix<f64>> = channels
        .iter()
        .map(|c| factor(&modes[*c], strength(modes[*c].sensor()), &question.sums[*c].count))
        .collect();
    let mut total = question.total();
    for (c, factor) in channels.iter().zip(&factors) {
        take_out(&mut total, &question.sums[*c], factor)?;
    }
    let blocks = blocks(question, &total, &channels)?;
    let prior = Prior::Normal(deviation.to_vec());
    let (mut with, mut without) = (Vec::new(), Vec::new());
    for tau in VARYING {
        let varying: Vec<f64> = deviation.iter().map(|d| tau * d / 3.0).collect();
        let (beside, ln_z) = integrated(&blocks, &factors, &varying)?;
        without.push(ln_z);
        with.push(ln_z + prior.ln_bayes(&beside));
    }
    debug_assert_eq!(m, deviation.len());
    let varies = log_sum_exp(&with[1..]) - ((with.len() - 1) as f64).ln() - with[0];
    let slowly = varies > 0.0 && agreement(&blocks, &question.logs).is_some_and(|z| z >= AGREE);
    Some(Varying {
        common: log_sum_exp(&with) - log_sum_exp(&without),
        varies: if slowly { varies } else { f64::NEG_INFINITY },
    })
}

/// How far neighbouring blocks agree in what they show beside the common part, in standard deviations of the sum of their cosines. Levels
/// of channels are left out, since zeros wander.
fn agreement(blocks: &[Block], logs: &[Range<usize>]) -> Option<f64> {
    let m = blocks.first()?.score.len();
    let within: Vec<(DMatrix<f64>, DVector<f64>)> = blocks.iter().map(Block::without_levels).collect();
    let mut information = DMatrix::zeros(m, m);
    let mut score = DVector::zeros(m);
    for (own, right) in &within {
        information += own;
        score += right;
    }
    let ridge = RIDGE * information.diagonal().max();
    for k in 0..m {
        information[(k, k)] += ridge;
    }
    let common = Cholesky::new(information)?.solve(&score);
    let shown = |(own, right): &(DMatrix<f64>, DVector<f64>)| {
        let left = right - own * &common;
        left.zip_map(&own.diagonal(), |s, h| if h > 0.0 { s / h.sqrt() } else { 0.0 })
    };
    let shown: Vec<DVector<f64>> = within.iter().map(shown).collect();
    // A few loud blocks count as few: only the directions are compared. The cosine of two of m parameters scatters by 1 / sqrt(m).
    let (mut sum, mut pairs) = (0.0, 0_u32);
    for log in logs {
        for pair in shown[log.clone()].windows(2) {
            let size = pair[0].norm() * pair[1].norm();
            if size > 0.0 {
                sum += pair[0].dot(&pair[1]) / size;
                pairs += 1;
            }
        }
    }
    Some(sum * (m as f64 / f64::from(pairs.max(1))).sqrt())
}

/// Takes the noise of one channel's zeros out of equations.
fn take_out(total: &mut NormalEquations, sums: &ChannelSums, factor: &DMatrix<f64>) -> Option<()> {
    let weighted = DMatrix::from_diagonal(&sums.count) * factor;
    let inner = DMatrix::identity(factor.ncols(), factor.ncols()) + factor.tr_mul(&weighted);
    let cholesky = Cholesky::new(inner)?;
    let root = sums.weight.sqrt();
    let cross = factor.tr_mul(&sums.sums) * root;
    let right = factor.tr_mul(&sums.right) * root;
    let solved = cholesky.solve(&cross);
    total.gram.gemm_tr(-1.0, &cross, &solved, 1.0);
    total.right.gemv_tr(-1.0, &solved, &right, 1.0);
    Some(())
}

/// Equations of every block, what the model takes up projected out.
fn blocks(question: &Question, total: &NormalEquations, channels: &[usize]) -> Option<Vec<Block>> {
    let (p, all) = (question.model, question.parameters());
    let m = all - p;
    let mut inner = total.gram.view((0, 0), (p, p)).into_owned();
    for k in 0..p {
        inner[(k, k)] += question.prior.precision[k];
    }
    let mut map = DMatrix::zeros(all, m);
    map.view_mut((p, 0), (m, m)).fill_with_identity();
    let mut fitted = DVector::zeros(all);
    if p > 0 {
        let factor = Cholesky::new(inner)?;
        let projected = factor.solve(&total.gram.view((0, p), (p, m)).into_owned());
        map.view_mut((0, 0), (p, m)).copy_from(&(-projected));
        fitted
            .rows_mut(0, p)
            .copy_from(&factor.solve(&total.right.rows(0, p).into_owned()));
    }
    let of = |(number, block): (usize, &NormalEquations)| {
        let log = question.logs.iter().position(|log| log.contains(&number)).unwrap_or(0);
        let row = number - question.logs[log].start;
        let mut sums = DMatrix::zeros(channels.len(), m);
        let (mut right, mut count) = (DVector::zeros(channels.len()), DVector::zeros(channels.len()));
        for (k, c) in channels.iter().enumerate() {
            let own = &question.sums[*c];
            if own.log == log && row < own.count.len() {
                let columns = own.sums.row(row) * own.weight.sqrt();
                sums.row_mut(k).copy_from(&(&columns * &map));
                right[k] = own.right[row] * own.weight.sqrt() - (&columns * &fitted)[0];
                count[k] = own.count[row];
            }
        }
        let left = &block.right - &block.gram * &fitted;
        Block {
            row,
            information: map.tr_mul(&(&block.gram * &map)),
            score: map.tr_mul(&left),
            sums,
            right,
            count,
        }
    };
    Some(question.white.iter().enumerate().map(of).collect())
}

/// Equations of the common part, and the log likelihood without it, once the varying part and the zeros are integrated out.
fn integrated(blocks: &[Block], factors: &[DMatrix<f64>], varying: &[f64]) -> Option<(Beside, f64)> {
    let m = varying.len();
    let scale = DMatrix::from_diagonal(&DVector::from_column_slice(varying));
    let mut information = DMatrix::zeros(m, m);
    let mut score = DVector::zeros(m);
    let mut ln_z = 0.0;
    let mut first = vec![0];
    for factor in factors {
        first.push(first[first.len() - 1] + factor.ncols());
    }
    let width = first[factors.len()];
    let mut zeros = DMatrix::identity(width, width);
    let mut cross = DMatrix::zeros(width, m);
    let mut right = DVector::zeros(width);
    let any = factors.iter().any(|f| f.iter().any(|v| *v != 0.0));
    for block in blocks {
        let inner = DMatrix::identity(m, m) + &scale * &block.information * &scale;
        let factor = Cholesky::new(inner)?;
        ln_z -= factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        // (U^-1 + H)^-1 = S (I + S H S)^-1 S.
        let middle = &scale * factor.solve(&scale);
        let weighed = &middle * &block.information;
        let scored = &middle * &block.score;
        information += &block.information - &block.information * &weighed;
        score += &block.score - &block.information * &scored;
        ln_z += 0.5 * block.score.dot(&scored);
        if !any {
            continue;
        }
        let of_zeros = &block.sums - &block.sums * &weighed;
        let zero_right = &block.right - &block.sums * &scored;
        let coupled = &block.sums * &middle * block.sums.transpose();
        for (j, factor) in factors.iter().enumerate().filter(|(j, _)| block.count[*j] > 0.0) {
            let fj = factor.row(block.row).transpose();
            cross.rows_mut(first[j], fj.len()).gemm(1.0, &fj, &of_zeros.row(j), 1.0);
            right.rows_mut(first[j], fj.len()).axpy(zero_right[j], &fj, 1.0);
            for (k, other) in factors.iter().enumerate().filter(|(k, _)| block.count[*k] > 0.0) {
                let fk = other.row(block.row).transpose();
                let own = if j == k { block.count[j] } else { 0.0 };
                zeros
                    .view_mut((first[j], first[k]), (fj.len(), fk.len()))
                    .ger(own - coupled[(j, k)], &fj, &fk, 1.0);
            }
        }
    }
    if any {
        let factor = Cholesky::new(zeros)?;
        ln_z -= factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        let solved = factor.solve(&cross);
        information -= cross.tr_mul(&solved);
        score -= solved.tr_mul(&right);
        ln_z += 0.5 * right.dot(&factor.solve(&right));
    }
    Some((Beside { information, score }, ln_z))
}
