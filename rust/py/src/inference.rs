//! Questions asked of the evidence.

use imufit_fit::part::{Part, sample_shares};
use imufit_fit::{residual, saturated};
use imufit_inference::criterion::Criterion;
use imufit_inference::problem::{Limit, Problem, parameters_of};
use imufit_inference::search::{self, Search};
use imufit_inference::stack;
use imufit_inference::{estimate, held_out, revision, verdict};
use imufit_model::rest_channels;
use imufit_model::sensor::CHANNELS;
use nalgebra::DVector;
use numpy::{PyArray1, PyArray2, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::computing::compute;
use crate::errors::{input_error, value_error};
use crate::fit::PyEvidence;
use crate::verdict::PyVerdict;

/// Step of every parameter, variance of each channel, variance of each block over that of its channel.
type Saturated<'py> = (Bound<'py, PyArray1<f64>>, Vec<f64>, Vec<Vec<f64>>);

/// All effects fitted at once: (step (p,) of every parameter, residual variance of each of the nine channels, variance of each block
/// over that of its channel (channels, blocks)).
#[pyfunction]
fn saturate<'py>(py: Python<'py>, evidence: &PyEvidence) -> PyResult<Saturated<'py>> {
    let fitted = compute(py, || saturated::fit_all(&evidence.0))?.ok_or_else(|| {
        let problem = "the effects cannot be fitted together: no sensor has enough usable readings";
        input_error(py, problem)
    })?;
    Ok((
        PyArray1::from_slice(py, fitted.step.as_slice()),
        fitted.variance.to_vec(),
        fitted.loudness,
    ))
}

fn nine(name: &str, values: &[f64]) -> PyResult<[f64; CHANNELS]> {
    values
        .try_into()
        .map_err(|_| value_error(format!("{name} must have {CHANNELS} numbers")))
}

/// One log's share of a problem: whitened and plain evidence, variance of the whitened residual of each of the nine channels,
/// their noise floors in their units, and for each slot of the evidence its slot among those of all logs.
type LogEvidence<'py> = (
    PyRef<'py, PyEvidence>,
    PyRef<'py, PyEvidence>,
    Vec<f64>,
    Vec<Vec<f64>>,
    Vec<f64>,
    Vec<usize>,
);

/// Slot, number of a parameter, smallest and largest value; None: it is not fitted.
type PyLimit = (usize, usize, Option<(f64, f64)>);

/// Log, channel index, standard deviation of a walk's step over a block and of the scatter, time of a block, s.
type ZeroNoise = (usize, usize, f64, f64, f64);

/// What rows show besides the evidence: log or None, channel index, log Bayes factor, shape.
type Seen = (Option<usize>, usize, f64, String);

/// Evidence of one log or of several of one sensor, whitened and not, ready to be asked.
#[pyclass(name = "Problem", frozen, module = "imufit._imufit")]
pub struct PyProblem(Problem);

#[pymethods]
impl PyProblem {
    /// `logs`: for each log its whitened and its plain evidence, the variance of the whitened residual of each of the nine
    /// channels, their noise floors in their units, and for each slot of the evidence its slot among those of all logs.
    /// `own`: for each of these whether every log has its own parameters of it. `limits`: slot, number of a parameter of its effect, and the
    /// smallest and the largest value that it may have, or None where it is not fitted.
    #[new]
    #[pyo3(signature = (logs, own, limits=Vec::new()))]
    fn new(py: Python<'_>, logs: Vec<LogEvidence<'_>>, own: Vec<bool>, limits: Vec<PyLimit>) -> PyResult<Self> {
        let mut parts = Vec::with_capacity(logs.len());
        for (white, raw, variance, loudness, floors, slots) in logs {
            let known = white.0.layout.model.slots().len();
            let blocks = white.0.layout.blocks;
            if loudness.len() != CHANNELS || loudness.iter().any(|of| of.len() != blocks) {
                return Err(value_error(
                    "loudness must have a number for every block of every channel",
                ));
            }
            if slots.len() != known || slots.iter().any(|s| *s >= own.len()) {
                return Err(value_error(
                    "every slot of the evidence needs one among those of all logs",
                ));
            }
            parts.push(Part {
                white: white.0.clone(),
                raw: raw.0.clone(),
                variance: nine("variance", &variance)?,
                loudness,
                floors: nine("floors", &floors)?,
                slots,
            });
        }
        for number in 0..own.len() {
            let mut having = parts.iter().filter_map(|part| {
                let k = part.slots.iter().position(|s| *s == number)?;
                let slot = &part.white.layout.model.slots()[k];
                Some((slot.effect.card().id.as_str(), slot.parameters.len()))
            });
            let Some(first) = having.next() else {
                return Err(value_error(format!("no log has the slot {number}")));
            };
            if having.any(|other| other != first) {
                return Err(value_error(format!("the logs have different effects in slot {number}")));
            }
        }
        let limit = |(slot, parameter, range): PyLimit| {
            let between = |(lower, upper)| Limit::Between(lower, upper);
            (slot, parameter, range.map_or(Limit::Fixed, between))
        };
        if limits.iter().any(|(slot, _, _)| *slot >= own.len()) {
            return Err(value_error("there is no such slot"));
        }
        let limits: Vec<_> = limits.into_iter().map(limit).collect();
        Ok(Self(compute(py, || Problem::new(parts, &own, &limits))?))
    }

    /// For each of a log's own parameters its place among those of all logs.
    fn places(&self, log: usize) -> PyResult<Vec<usize>> {
        Ok(self.part(log)?.1.to_vec())
    }

    /// Number of blocks of all logs.
    #[getter]
    fn blocks(&self) -> usize {
        self.0.blocks()
    }

    /// Fits the slots given: step (k,) and covariance (k, k) of their k parameters, SI units, zero for those that are not fitted, not a number
    /// for those at a bound; which of them are fitted, and which of these stand at a bound; full step (p,) of all; held-out and training residual RMS over noise floor; number of samples; whitened held-out sum of squares of each fold; whitened square per sample before the step, with what is known of the parameters.
    fn estimate<'py>(&self, py: Python<'py>, slots: Vec<usize>) -> PyResult<Bound<'py, PyDict>> {
        self.known(&slots)?;
        let all = &self.0.slots;
        let parameters = parameters_of(slots.iter().map(|s| &all[*s]));
        let moved = |k: &usize| !self.0.fixed[parameters[*k]];
        let chosen: Vec<usize> = (0..parameters.len()).filter(moved).collect();
        let free: Vec<usize> = chosen.iter().map(|k| parameters[*k]).collect();
        let (fitted, base, misfit) = compute(py, || {
            (
                estimate::estimate(&self.0, &free),
                held_out::held_out(&self.0.question(&free, &[])),
                self.0.misfit(&free),
            )
        })?;
        let fitted = fitted.ok_or_else(|| value_error("the normal equations cannot be solved"))?;
        let mut step = DVector::zeros(self.0.plausible.len());
        let p = parameters.len();
        let (mut own, mut at_bound) = (vec![0.0; p], vec![false; p]);
        let mut covariance = vec![vec![0.0; p]; p];
        for (k, place) in chosen.iter().enumerate() {
            step[free[k]] = fitted.step[k];
            (own[*place], at_bound[*place]) = (fitted.step[k], fitted.at_bound[k]);
            for (j, other) in chosen.iter().enumerate() {
                covariance[*place][*other] = fitted.covariance[(k, j)];
            }
        }
        let (training, n) = training(&self.0, &step);
        let out = PyDict::new(py);
        let mut fitted = vec![false; p];
        for k in &chosen {
            fitted[*k] = true;
        }
        out.set_item("parameters", parameters)?;
        out.set_item("step", PyArray1::from_vec(py, own))?;
        out.set_item("covariance", PyArray2::from_vec2(py, &covariance)?)?;
        out.set_item("fitted", fitted)?;
        out.set_item("at_bound", at_bound)?;
        out.set_item("full_step", PyArray1::from_slice(py, step.as_slice()))?;
        out.set_item("held_out", base.ratio)?;
        out.set_item("folds", PyArray1::from_vec(py, base.white))?;
        out.set_item("training", training)?;
        out.set_item("samples", n)?;
        out.set_item("misfit", misfit)?;
        Ok(out)
    }

    /// Step (p,) of all parameters that fits a slot beside those of a model, and the places of the slot's own parameters: [`PyProblem::estimate`]
    /// without its standard errors.
    fn step_beside<'py>(
        &self,
        py: Python<'py>,
        model: Vec<usize>,
        slot: usize,
    ) -> PyResult<(Vec<usize>, Bound<'py, PyArray1<f64>>)> {
        let slots: Vec<usize> = model.into_iter().chain([slot]).collect();
        self.known(&slots)?;
        let fitted = self.0.fitted(&slots);
        let within = compute(py, || self.0.step_within(&fitted))?;
        let within = within.ok_or_else(|| value_error("the normal equations cannot be solved"))?;
        let mut step = DVector::zeros(self.0.plausible.len());
        for (j, own) in fitted.iter().zip(&within.solution) {
            step[*j] = *own;
        }
        let own = parameters_of([&self.0.slots[slot]]);
        Ok((own, PyArray1::from_slice(py, step.as_slice())))
    }

    /// Which effect is missing from the model of slots `model`, among the slots `candidates`; what none of them explains is
    /// asked of the slots `probes`. `fitted` holds lists of log Bayes factors of candidates from fits in the place of one another, by slot; `refuted` those of which a fit keeps nothing; `column_noise` the share of
    /// noise in the column that a candidate reads; `seen` what rows show besides: (log or None, channel index, log Bayes factor, shape). `again` is an
    /// answer to the same question with the same candidates refuted: the effects that it names are taken over.
    #[pyo3(signature = (model, candidates, probes=Vec::new(), fitted=Vec::new(), refuted=Vec::new(), column_noise=Vec::new(), seen=Vec::new(), again=None))]
    #[allow(clippy::too_many_arguments)] // one name for each thing that is known
    fn diagnose(
        &self,
        py: Python<'_>,
        model: Vec<usize>,
        candidates: Vec<usize>,
        probes: Vec<usize>,
        fitted: Vec<Vec<(usize, f64)>>,
        refuted: Vec<usize>,
        column_noise: Vec<(usize, f64)>,
        seen: Vec<Seen>,
        again: Option<&PyVerdict>,
    ) -> PyResult<PyVerdict> {
        let pairs = fitted.iter().flatten().chain(&column_noise).map(|(slot, _)| slot);
        self.known(model.iter().chain(&candidates).chain(&probes).chain(pairs))?;
        if seen.iter().any(|(_, channel, _, _)| *channel >= CHANNELS) {
            return Err(value_error("there is no such channel"));
        }
        let seen = seen
            .into_iter()
            .map(|(log, channel, ln_bayes, shape)| imufit_inference::finding::Finding {
                channel,
                covariate: "t".to_string(),
                log,
                ln_bayes,
                drop: 2.0 * ln_bayes,
                channels: vec![channel],
                shape,
                probe: None,
            });
        let known = verdict::Known {
            fitted,
            refuted,
            column_noise,
            seen: seen.collect(),
            named: again.map(PyVerdict::named),
        };
        let found = compute(py, || verdict::decide(&self.0, &model, &candidates, &probes, &known))?;
        let found = found.ok_or_else(|| value_error("the normal equations cannot be solved"))?;
        Ok(PyVerdict::new(&self.0, found))
    }

    /// Log of the marginal likelihood of all logs under the `members`, their parameters near their present values, beside the slots `along`
    /// that are always fitted; each of the `possible` slots may be there or not. Minus infinity where the equations cannot be solved.
    fn ln_evidence(
        &self,
        py: Python<'_>,
        along: Vec<usize>,
        members: Vec<usize>,
        possible: Vec<usize>,
    ) -> PyResult<f64> {
        self.known(along.iter().chain(&members).chain(&possible))?;
        let found = compute(py, || {
            let criterion = Criterion::new(&self.0);
            Search::new(&criterion, &along, &possible).ln_evidence(&members)
        })?;
        Ok(found.unwrap_or(f64::NEG_INFINITY))
    }

    /// What zeros do beside the slots given at the likeliest strength: (log, channel index, standard deviation of a walk's step over a
    /// block, that of the scatter of block means besides, both in the channel's unit, time of a block, s).
    fn zero_noise(&self, py: Python<'_>, slots: Vec<usize>) -> PyResult<Vec<ZeroNoise>> {
        self.known(&slots)?;
        let parameters = self.0.free(&slots);
        let found = compute(py, || stack::zero_noise(&self.0, &parameters))?;
        let row = |z: &stack::ZeroNoise| (z.log, z.channel, z.walk, z.scatter, z.block);
        Ok(found.iter().map(row).collect())
    }

    /// Slots among `members` of the model that may be needless beside its others, or that one of the `candidates` may replace: pairs of a
    /// slot and what may do better in its place, or None.
    fn revisions(
        &self,
        py: Python<'_>,
        model: Vec<usize>,
        members: Vec<usize>,
        candidates: Vec<usize>,
    ) -> PyResult<Vec<(usize, Option<usize>)>> {
        self.known(model.iter().chain(&members).chain(&candidates))?;
        let found = compute(py, || revision::revisions(&self.0, &model, &members, &candidates))?;
        Ok(found.iter().map(|r| (r.slot, r.by)).collect())
    }

    /// Share of an effect's log Bayes factor from which on a fit may show that another candidate explains more.
    #[classattr]
    const NEAR: f64 = revision::NEAR;

    /// Log of the odds that a difference must have to count.
    #[classattr]
    const ODDS: f64 = search::ODDS;

    /// Log Bayes factor from which on one of so many candidates is there.
    #[staticmethod]
    fn threshold(candidates: usize) -> f64 {
        search::threshold(candidates)
    }

    /// The slot among `members` of the model that its others make needless most of all, to first order; None if none is.
    fn needless(&self, py: Python<'_>, model: Vec<usize>, members: Vec<usize>) -> PyResult<Option<usize>> {
        self.known(model.iter().chain(&members))?;
        compute(py, || revision::needless(&self.0, &model, &members))
    }

    /// Mean square of the residual of each channel of one log at a step (p,) of all parameters, in the channels' units squared.
    #[pyo3(signature = (step, log=0))]
    fn mean_squares<'py>(&self, py: Python<'py>, step: Vec<f64>, log: usize) -> PyResult<Bound<'py, PyDict>> {
        let (part, step) = self.stepped(step, log)?;
        let raw = &part.raw;
        let out = PyDict::new(py);
        for channel in 0..CHANNELS {
            let (square, n) = raw.square(channel, &step);
            if n > 0 {
                out.set_item(rest_channels::name(channel, raw.layout.facts.rests), square / n as f64)?;
            }
        }
        Ok(out)
    }

    /// Residual of one log at a step (p,) of all parameters: RMS and mean by channel and block, and binned panels, in the
    /// channels' units.
    #[pyo3(signature = (step, log=0))]
    fn residual<'py>(&self, py: Python<'py>, step: Vec<f64>, log: usize) -> PyResult<Bound<'py, PyDict>> {
        let (part, step) = self.stepped(step, log)?;
        let raw = &part.raw;
        let channels = residual::channels(raw, &step);
        let out = PyDict::new(py);
        let (list, panels) = (PyList::empty(py), PyList::empty(py));
        for c in &channels {
            let floor = part.floors[c.channel];
            let item = PyDict::new(py);
            item.set_item("channel", rest_channels::name(c.channel, raw.layout.facts.rests))?;
            item.set_item("index", c.channel)?;
            item.set_item("n", c.n)?;
            item.set_item("rms", c.rms)?;
            item.set_item("mean", c.mean)?;
            item.set_item("block_rms", PyArray1::from_slice(py, &c.block_rms))?;
            item.set_item("stretch", residual::stretch(&c.block_rms, floor))?;
            list.append(item)?;
            for p in residual::panels(raw, &step, c.channel, floor) {
                let item = PyDict::new(py);
                item.set_item("channel", rest_channels::name(p.channel, raw.layout.facts.rests))?;
                item.set_item("covariate", &raw.layout.bins.names[p.covariate])?;
                item.set_item(
                    "unit",
                    imufit_fit::bins::Bins::unit(&raw.layout.bins.names[p.covariate]),
                )?;
                let mut edges = raw.layout.bins.edges[p.covariate].clone();
                if p.covariate == 1 {
                    for edge in &mut edges {
                        *edge += raw.layout.facts.temperature_mean;
                    }
                }
                item.set_item("edges", PyArray1::from_vec(py, edges))?;
                item.set_item("mean", PyArray1::from_slice(py, &p.binned.mean))?;
                item.set_item("band", PyArray1::from_slice(py, &p.binned.band))?;
                item.set_item("share", p.binned.share)?;
                panels.append(item)?;
            }
        }
        out.set_item("channels", list)?;
        out.set_item("panels", panels)?;
        Ok(out)
    }
}

impl PyProblem {
    fn known<'a>(&self, slots: impl IntoIterator<Item = &'a usize>) -> PyResult<()> {
        if slots.into_iter().any(|s| *s >= self.0.slots.len()) {
            return Err(value_error("there is no such slot"));
        }
        Ok(())
    }

    /// A log and the places of its parameters.
    fn part(&self, log: usize) -> PyResult<(&Part, &[usize])> {
        let found = self.0.parts.get(log).zip(self.0.places.get(log));
        let (part, places) = found.ok_or_else(|| value_error("there is no such log"))?;
        Ok((part, places))
    }

    /// A log and the step of its own parameters, of a step (p,) of all.
    fn stepped(&self, step: Vec<f64>, log: usize) -> PyResult<(&Part, DVector<f64>)> {
        if step.len() != self.0.plausible.len() {
            return Err(value_error("step must have one number per parameter"));
        }
        let (part, _) = self.part(log)?;
        Ok((part, self.0.of_log(log, &DVector::from_vec(step))))
    }
}

/// Residual RMS over the noise floor of the data that was fitted, every channel counting equally; and the number of samples.
fn training(problem: &Problem, step: &DVector<f64>) -> (f64, f64) {
    let shares = sample_shares(&problem.parts);
    let (mut square, mut channels, mut count) = (0.0, 0.0, 0.0);
    for (log, part) in problem.parts.iter().enumerate() {
        let step = problem.of_log(log, step);
        for (channel, weight) in part.raw_weights().into_iter().enumerate() {
            if weight > 0.0 {
                let (s, n) = part.raw.square(channel, &step);
                square += shares[channel] * weight * s;
                channels += shares[channel] * n as f64;
                count += n as f64;
            }
        }
    }
    ((square / channels).sqrt(), count)
}

/// Mean value, mean residual and half width of its 95 % band in each bin, and the share of variance.
type Binned<'py> = (Values<'py>, Values<'py>, Values<'py>, f64);
type Values<'py> = Bound<'py, PyArray1<f64>>;

/// Residual (n,) against a value (n,) of the same rows, in bins of equal count: mean value, mean residual and half width of its 95 % band in
/// each bin, and the share of the residual's variance above the noise `floor` that the bins explain. None where the value does not vary.
#[pyfunction]
#[pyo3(signature = (value, residual, floor))]
fn residual_against<'py>(
    py: Python<'py>,
    value: PyReadonlyArray1<'py, f64>,
    residual: PyReadonlyArray1<'py, f64>,
    floor: f64,
) -> PyResult<Option<Binned<'py>>> {
    let (value, residual) = (value.as_slice()?, residual.as_slice()?);
    if value.len() != residual.len() {
        return Err(value_error("value and residual must have the same length"));
    }
    let found = compute(py, || residual::against(value, residual, floor))?;
    let arrays = |(centre, binned): (Vec<f64>, residual::Binned)| {
        let array = |values| PyArray1::from_vec(py, values);
        (array(centre), array(binned.mean), array(binned.band), binned.share)
    };
    Ok(found.map(arrays))
}

/// Registers this file's part of the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<PyProblem>()?;
    m.add_function(wrap_pyfunction!(saturate, m)?)?;
    m.add_function(wrap_pyfunction!(residual_against, m)?)?;
    Ok(())
}
