//! Every candidate asked the same question: how much would it lower the held-out error, and can that be chance?

use imufit_model::sensor_model::Slot;
use nalgebra::{DMatrix, DVector};

use crate::held_out::{self, HeldOut};
use crate::jackknife;
use crate::problem::{Problem, Question};

/// Answer for one candidate.
#[derive(Clone, Debug)]
pub struct Screened {
    /// Index of its slot.
    pub slot: usize,
    /// Held-out gain in units of the noise variance.
    pub gain: f64,
    /// Its standard error over the folds.
    pub gain_error: f64,
    /// p-value over blocks; 1 where it cannot be tested.
    pub p_value: f64,
    /// Held-out residual over noise floor without and with it.
    pub held_out: (f64, f64),
    /// Residual over noise floor expected once it is added, over all data.
    pub expected_ratio: f64,
    /// Its parameters and their standard errors.
    pub parameters: Vec<(f64, f64)>,
    /// Directions it was tested in (parameters x directions); no column = not testable.
    pub directions: DMatrix<f64>,
    /// True if it has directions and blocks enough.
    pub testable: bool,
}

/// Parameter indices of slots.
pub fn parameters_of<'a>(slots: impl IntoIterator<Item = &'a Slot>) -> Vec<usize> {
    slots.into_iter().flat_map(|s| s.first..s.first + s.parameters.len()).collect()
}

/// The p-value of a question: the larger of two block lengths, in case correlation reaches beyond the shorter.
pub fn p_value(question: &Question) -> f64 {
    [1, 2].into_iter().filter_map(|group| jackknife::jackknife(question, group)).map(|j| j.p_value).fold(0.0, f64::max)
}

/// Screens one candidate on top of the model's parameters.
pub fn screen(problem: &Problem, model: &[usize], base: &HeldOut, slot: usize, candidate: &[usize]) -> Screened {
    let directions = problem.directions(model, candidate);
    let mut out = Screened {
        slot,
        gain: 0.0,
        gain_error: 0.0,
        p_value: 1.0,
        held_out: (base.ratio, base.ratio),
        expected_ratio: base.ratio,
        parameters: vec![(0.0, f64::NAN); candidate.len()],
        testable: directions.ncols() > 0,
        directions,
    };
    if !out.testable {
        return out;
    }
    let question = problem.question(model, candidate, &out.directions);
    let Some(fine) = jackknife::jackknife(&question, 1) else {
        out.testable = false;
        return out;
    };
    let coarse = jackknife::jackknife(&question, 2);
    out.p_value = coarse.as_ref().map_or(fine.p_value, |c| c.p_value.max(fine.p_value));
    let with = held_out::held_out(&question);
    (out.gain, out.gain_error) = held_out::gain(base, &with);
    out.held_out.1 = with.ratio;
    let m = out.directions.ncols();
    let beta = fine.estimate.rows(question.model, m).into_owned();
    let values: DVector<f64> = &out.directions * &beta;
    let covariance = &out.directions * &fine.covariance * out.directions.transpose();
    out.parameters = (0..candidate.len()).map(|j| (values[j], covariance[(j, j)].max(0.0).sqrt())).collect();
    let (mut square, mut n) = (0.0, 0.0);
    for block in &question.raw {
        square += block.residual_square(&fine.estimate).max(0.0);
        n += block.n;
    }
    out.expected_ratio = (square / (n - fine.estimate.len() as f64).max(1.0)).sqrt();
    out
}

/// Held-out error of the model alone.
pub fn base(problem: &Problem, model: &[usize]) -> HeldOut {
    let question = problem.question(model, &[], &DMatrix::zeros(0, 0));
    held_out::held_out(&question)
}
