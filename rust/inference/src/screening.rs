//! Every candidate asked the same question: how much would it lower the held-out error, and can that be chance?

use imufit_fit::normal_equations::NormalEquations;
use imufit_model::effect::Sign;
use imufit_model::sensor_model::Slot;
use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::agreement::{self, Differing};
use crate::held_out::{self, HeldOut};
use crate::jackknife::{self, Jackknife};
use crate::problem::{Problem, Question};

/// Whether sensors can have what a candidate's parameters say.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Plausible {
    /// They can.
    Yes,
    /// With the other sign: it can be a rival, but does not pass.
    OtherSign,
    /// A parameter lies far beyond what such sensors have.
    TooLarge,
    /// A parameter has a sign or a size that it cannot have.
    No,
}

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
    /// False if the two halves of the log disagree about it.
    pub stable: bool,
    /// Whether sensors can have such parameters.
    pub plausible: Plausible,
    /// What logs disagree about; `None` where they agree.
    pub differing: Option<Differing>,
}

impl Screened {
    /// False if logs differ so much about it that it is no property of the sensor.
    pub fn agreed(&self) -> bool {
        !self.differing.as_ref().is_some_and(Differing::wild)
    }
}

/// Parameter indices of slots.
pub fn parameters_of<'a>(slots: impl IntoIterator<Item = &'a Slot>) -> Vec<usize> {
    slots
        .into_iter()
        .flat_map(|s| s.first..s.first + s.parameters.len())
        .collect()
}

/// Above this p-value nothing more needs to be asked.
const CLEARLY_CHANCE: f64 = 0.01;

/// Where a few blocks say all there is of a parameter, the rows that say most may have noise of this many times the variance of the
/// others in their block.
const NOISIER: f64 = 3.0;

/// The p-value of a question: the largest of two block lengths, in case correlation reaches beyond the shorter, and of
/// a test that lets zeros wander; where rests stand in for a reference, of a test by the noise within them as well.
pub fn p_value(question: &Question) -> f64 {
    p_value_beside(question, jackknife::jackknife(question, 1).as_ref())
}

/// The same where the shorter blocks have been asked already.
fn p_value_beside(question: &Question, shorter: Option<&Jackknife>) -> f64 {
    let longer = jackknife::jackknife(question, 2);
    let lengths = [(1, shorter), (2, longer.as_ref())];
    let asked = || lengths.iter().filter_map(|(group, j)| j.map(|j| (*group, j)));
    let p = asked().map(|(_, j)| j.p_value).fold(0.0, f64::max);
    if p > CLEARLY_CHANCE {
        return p;
    }
    let beside = if question.rests {
        wald(question, &question.total(), 1.0)
    } else {
        asked()
            .map(|(group, j)| p_value_of_few(question, group, j))
            .fold(0.0, f64::max)
    };
    p.max(beside).max(p_value_with_drift(question))
}

/// p-value by no more blocks than tell of the candidate; or by the noise of the rows in these blocks, if that says more.
fn p_value_of_few(question: &Question, group: usize, found: &Jackknife) -> f64 {
    let Some(telling) = jackknife::telling(question, group) else {
        return 1.0;
    };
    let m = question.precision.len() - question.model;
    let by_blocks = jackknife::hotelling(found.square, m, telling.blocks.min(found.blocks as f64));
    by_blocks.min(wald(question, &question.total(), NOISIER * telling.square))
}

/// Wald test of the candidate's parameters with wandering zeros, the mean over how strongly they may wander; 0 where no zero
/// wanders, since the block tests then say it all.
pub fn p_value_with_drift(question: &Question) -> f64 {
    question
        .totals_without_drift()
        .iter()
        .map(|(weight, total)| weight * wald(question, total, 1.0))
        .sum()
}

/// p-value of the candidate's parameters from equations of observations with this variance.
pub(crate) fn wald(question: &Question, total: &NormalEquations, variance: f64) -> f64 {
    let Some(solved) = total.solve(&question.precision) else {
        return 1.0;
    };
    let m = solved.solution.len() - question.model;
    let beta = solved.solution.rows(question.model, m).into_owned();
    let covariance = solved
        .covariance()
        .view((question.model, question.model), (m, m))
        .into_owned();
    let unsure = &question.unsure * question.unsure.transpose();
    let Some(factor) = Cholesky::new(covariance * variance + unsure) else {
        return 1.0;
    };
    let square = beta.dot(&factor.solve(&beta));
    ChiSquared::new(m as f64).map_or(1.0, |d| if square.is_finite() { d.sf(square.max(0.0)) } else { 1.0 })
}

/// Hardly any sensor has an effect this many times larger than what is plausible: something else looks like it.
const BEYOND: f64 = 7.0;
/// ... and none has one this many times larger.
const FAR_BEYOND: f64 = 30.0;
/// No axis reads so much of itself, or of another, too much.
const LARGEST_GAIN: f64 = 0.3;
/// Halves may differ by this much of the effect, squared.
const HALVES: f64 = 0.5;
/// ... or by this many standard deviations of what chance gives.
const HALVES_CHANCE: f64 = 5.0;

/// True if the two halves of the log give the same parameters of the candidate: within chance, or by less than 0.7 of the effect
/// in the directions that both halves can see. An effect is a property of the sensor; what differs from one half to the other is something else.
fn halves_agree(question: &Question, whole: &Jackknife) -> bool {
    let p = question.model;
    let m = whole.estimate.len() - p;
    // Of several logs the first halves against the second ones: whether logs agree is asked elsewhere.
    let solve = |later: bool| {
        let mut sum = NormalEquations::zeros(question.precision.len());
        for log in question.logs.iter() {
            let middle = log.start + log.len() / 2;
            let half = if later { middle..log.end } else { log.start..middle };
            for b in &question.white[half] {
                sum.add(b, 1.0);
            }
        }
        let solved = sum.solve(&question.precision)?;
        let covariance = solved.covariance().view((p, p), (m, m)).into_owned();
        Some((solved.solution.rows(p, m).into_owned(), covariance))
    };
    let (Some((first, c1)), Some((second, c2))) = (solve(false), solve(true)) else {
        return true;
    };
    let Some(information) = Cholesky::new(&c1 + &c2) else {
        return true;
    };
    let size = |v: &DVector<f64>| v.dot(&information.solve(v));
    // How much more the blocks scatter than whitened noise would, and how much less certain zeros that wander leave it.
    let told = |total: &NormalEquations| -> Option<DMatrix<f64>> {
        Some(
            total
                .solve(&question.precision)?
                .covariance()
                .view((p, p), (m, m))
                .into_owned(),
        )
    };
    let white = told(&question.total()).and_then(Cholesky::new);
    let times = |covariance: &DMatrix<f64>| white.as_ref().map_or(1.0, |c| c.solve(covariance).trace() / m as f64);
    let mut passed = 0.0;
    let levels = question.totals_without_drift();
    let middle = levels.iter().find(|(weight, _)| {
        passed += weight;
        passed >= 0.5
    });
    let wandering = middle.and_then(|(_, total)| told(total)).map_or(1.0, |c| times(&c));
    let scatter = times(&whole.covariance).max(wandering).max(1.0);
    let difference = size(&(&first - &second));
    let mf = m as f64;
    let beta = whole.estimate.rows(p, m).into_owned();
    difference <= scatter * (mf + HALVES_CHANCE * (2.0 * mf).sqrt()) || difference <= HALVES * size(&beta)
}

/// A candidate whose held-out gain is known, before it is asked whether that can be chance.
pub struct Weighed {
    question: Question,
    answer: Screened,
    /// Held-out error with it.
    with: HeldOut,
    known: bool,
}

/// Weighs one candidate on top of the model's parameters.
pub fn weigh(problem: &Problem, model: &[usize], base: &HeldOut, slot: usize, candidate: &[usize]) -> Weighed {
    if let Some(values) = problem.known_values(candidate) {
        return weigh_known(problem, model, base, slot, candidate, &values);
    }
    let directions = problem.directions(model, candidate);
    let question = problem.question(model, candidate, &directions);
    let mut answer = Screened {
        slot,
        gain: 0.0,
        gain_error: 0.0,
        p_value: 1.0,
        held_out: (base.ratio, base.ratio),
        expected_ratio: base.ratio,
        parameters: vec![(0.0, f64::NAN); candidate.len()],
        testable: jackknife::possible(&question),
        stable: true,
        plausible: Plausible::Yes,
        differing: None,
        directions,
    };
    let mut with = base.clone();
    if answer.testable {
        with = held_out::held_out(&question);
        (answer.gain, answer.gain_error) = held_out::gain(base, &with);
        answer.held_out.1 = with.ratio;
    }
    Weighed {
        question,
        answer,
        with,
        known: false,
    }
}

/// Weighs a candidate whose size is known beforehand.
fn weigh_known(
    problem: &Problem,
    model: &[usize],
    base: &HeldOut,
    slot: usize,
    candidate: &[usize],
    values: &[f64],
) -> Weighed {
    let question = problem.question_given(model, candidate, values);
    let seen: f64 = problem
        .white
        .iter()
        .flat_map(|b| candidate.iter().zip(values).map(|(j, v)| b.gram[(*j, *j)] * v * v))
        .sum();
    let with = held_out::held_out(&question);
    let (gain, gain_error) = held_out::gain(base, &with);
    let answer = Screened {
        slot,
        gain,
        gain_error,
        p_value: p_value_known(gain),
        held_out: (base.ratio, with.ratio),
        expected_ratio: base.ratio,
        parameters: values.iter().map(|v| (*v, 0.0)).collect(),
        testable: seen > 1.0,
        stable: true,
        plausible: Plausible::Yes,
        differing: None,
        directions: DMatrix::from_iterator(values.len(), 1, values.iter().copied()),
    };
    Weighed {
        question,
        answer,
        with,
        known: true,
    }
}

/// Where nothing is fitted, the likelihood is `exp(gain / 2)` times that of the model alone, and chance makes a ratio of k with
/// a probability of at most 1 / k. It may lie in a single block, which no comparison of blocks could judge.
fn p_value_known(gain: f64) -> f64 {
    (-0.5 * gain.max(0.0)).exp()
}

/// p-value of a candidate on top of a model; 1 where nothing of it can be seen.
pub fn p_value_on(problem: &Problem, model: &[usize], candidate: &[usize]) -> f64 {
    if let Some(values) = problem.known_values(candidate) {
        let with = held_out::held_out(&problem.question_given(model, candidate, &values));
        return p_value_known(held_out::gain(&base(problem, model), &with).0);
    }
    let directions = problem.directions(model, candidate);
    if directions.ncols() == 0 {
        return 1.0;
    }
    p_value(&problem.question(model, candidate, &directions))
}

impl Weighed {
    /// What is known so far.
    pub const fn so_far(&self) -> &Screened {
        &self.answer
    }

    /// Held-out error with it.
    pub const fn held_out(&self) -> &HeldOut {
        &self.with
    }

    /// Asks whether it can be chance, whether both halves agree, and what its parameters are.
    pub fn judged(self, problem: &Problem, model: &[usize], candidate: &[usize]) -> Screened {
        let Self {
            question,
            answer: mut out,
            known,
            ..
        } = self;
        if !out.testable {
            return out;
        }
        if known {
            if let Some(fitted) = question.solve(&question.total()) {
                out.expected_ratio = ratio(&question, &fitted);
            }
            return out;
        }
        let Some(fine) = jackknife::jackknife(&question, 1) else {
            out.testable = false;
            return out;
        };
        out.p_value = p_value_beside(&question, Some(&fine));
        let m = out.directions.ncols();
        if out.p_value < CLEARLY_CHANCE {
            out.stable = halves_agree(&question, &fine);
            out.differing = agreement::differing(problem, model, out.slot, 1);
        }
        let beta = fine.estimate.rows(question.model, m).into_owned();
        let values: DVector<f64> = &out.directions * &beta;
        let covariance = &out.directions * &fine.covariance * out.directions.transpose();
        out.parameters = (0..candidate.len())
            .map(|j| (values[j], covariance[(j, j)].max(0.0).sqrt()))
            .collect();
        let (card, first) = (problem.slots[out.slot].effect.card(), problem.slots[out.slot].first);
        let within = |beyond: f64| {
            candidate.iter().zip(&out.parameters).all(|(j, (value, error))| {
                let own = card.parameters.get((*j - first) % card.parameters.len());
                let gain = own.is_some_and(|p| p.unit == "1");
                let limit = (beyond * problem.plausible[*j]).min(if gain { LARGEST_GAIN } else { f64::INFINITY });
                !problem.typical[*j] || value.abs() - 3.0 * error <= limit
            })
        };
        let negative = out.parameters.iter().any(|(value, error)| *value < -3.0 * error);
        let sign = problem.slots[out.slot].effect.sign();
        out.plausible = match sign {
            Sign::Positive if negative => Plausible::No,
            _ if !within(FAR_BEYOND) => Plausible::No,
            _ if !within(BEYOND) => Plausible::TooLarge,
            Sign::RatherPositive if negative => Plausible::OtherSign,
            _ => Plausible::Yes,
        };
        out.expected_ratio = ratio(&question, &fine.estimate);
        out
    }
}

/// Residual over noise floor at a solution, over all data.
fn ratio(question: &Question, solution: &DVector<f64>) -> f64 {
    let (mut square, mut n) = (0.0, 0.0);
    for block in &question.raw {
        square += block.residual_square(solution).max(0.0);
        n += block.n;
    }
    (square / (n - solution.len() as f64).max(1.0)).sqrt()
}

/// Held-out error of the model alone.
pub fn base(problem: &Problem, model: &[usize]) -> HeldOut {
    let question = problem.question(model, &[], &DMatrix::zeros(0, 0));
    held_out::held_out(&question)
}
