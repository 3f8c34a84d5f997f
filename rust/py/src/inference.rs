//! Questions asked of the evidence.

use imufit_inference::dependence::shape_name;
use imufit_inference::problem::Problem;
use imufit_inference::screening::parameters_of;
use imufit_inference::{estimate, residual, saturated, screening, verdict};
use imufit_model::sensor::{CHANNELS, channel_name};
use nalgebra::DVector;
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::errors::value_error;
use crate::fit::PyEvidence;

/// All effects fitted at once: (step (p,) of every parameter, residual variance of each of the nine channels).
#[pyfunction]
fn saturate<'py>(py: Python<'py>, evidence: &PyEvidence) -> PyResult<(Bound<'py, PyArray1<f64>>, Vec<f64>)> {
    let fitted = py
        .detach(|| saturated::fit_all(&evidence.0))
        .ok_or_else(|| value_error("the normal equations cannot be solved: the log holds no usable samples"))?;
    Ok((
        PyArray1::from_slice(py, fitted.step.as_slice()),
        fitted.variance.to_vec(),
    ))
}

fn nine(name: &str, values: &[f64]) -> PyResult<[f64; CHANNELS]> {
    values
        .try_into()
        .map_err(|_| value_error(format!("{name} must have {CHANNELS} numbers")))
}

/// Evidence of a log, whitened and not, ready to be asked.
#[pyclass(name = "Problem", frozen, module = "imufit._imufit")]
pub struct PyProblem {
    problem: Problem,
    white: imufit_fit::evidence::Evidence,
    raw: imufit_fit::evidence::Evidence,
    floors: [f64; CHANNELS],
}

#[pymethods]
impl PyProblem {
    /// `variance`: of the whitened residual of each of the nine channels; `floors`: their noise floors, in their units.
    #[new]
    fn new(
        py: Python<'_>,
        white: &PyEvidence,
        raw: &PyEvidence,
        variance: Vec<f64>,
        floors: Vec<f64>,
    ) -> PyResult<Self> {
        let (variance, floors) = (nine("variance", &variance)?, nine("floors", &floors)?);
        let (white, raw) = (white.0.clone(), raw.0.clone());
        let problem = py.detach(|| Problem::new(&white, &raw, &variance, &floors));
        Ok(Self {
            problem,
            white,
            raw,
            floors,
        })
    }

    /// Fits the slots given: step and standard error (k,) of each of their k parameters, SI units; full step (p,) of
    /// all; held-out and training residual RMS over noise floor.
    fn estimate<'py>(&self, py: Python<'py>, slots: Vec<usize>) -> PyResult<Bound<'py, PyDict>> {
        let all = self.white.layout.model.slots();
        if slots.iter().any(|s| *s >= all.len()) {
            return Err(value_error("there is no such slot"));
        }
        let parameters = parameters_of(slots.iter().map(|s| &all[*s]));
        let (fitted, base) = py.detach(|| {
            (
                estimate::estimate(&self.problem, &parameters),
                screening::base(&self.problem, &parameters),
            )
        });
        let fitted = fitted.ok_or_else(|| value_error("the normal equations cannot be solved"))?;
        let mut step = DVector::zeros(self.white.layout.model.parameters());
        for (k, p) in parameters.iter().enumerate() {
            step[*p] = fitted.step[k];
        }
        let (square, n) = training(self, &step);
        let p = parameters.len();
        let out = PyDict::new(py);
        out.set_item("parameters", parameters)?;
        out.set_item("step", PyArray1::from_slice(py, fitted.step.as_slice()))?;
        let errors: Vec<f64> = (0..p).map(|j| fitted.covariance[(j, j)].max(0.0).sqrt()).collect();
        out.set_item("standard_error", PyArray1::from_vec(py, errors))?;
        out.set_item("full_step", PyArray1::from_slice(py, step.as_slice()))?;
        out.set_item("held_out", base.ratio)?;
        out.set_item("training", (square / n.max(1.0)).sqrt())?;
        Ok(out)
    }

    /// Which effect is missing from the model of slots `model`, among the slots `candidates`.
    fn diagnose<'py>(
        &self,
        py: Python<'py>,
        model: Vec<usize>,
        candidates: Vec<usize>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let v = py.detach(|| verdict::decide(&self.problem, &self.white, &model, &candidates));
        let out = PyDict::new(py);
        out.set_item("verdict", v.kind.word())?;
        out.set_item("best", v.best)?;
        out.set_item("rivals", &v.rivals)?;
        out.set_item("path", &v.path)?;
        out.set_item("correlations", &v.correlations)?;
        let list = PyList::empty(py);
        for (s, p) in v.screened.iter().zip(&v.adjusted) {
            let item = PyDict::new(py);
            item.set_item("slot", s.slot)?;
            item.set_item("p_value", *p)?;
            item.set_item("gain", s.gain)?;
            item.set_item("gain_error", s.gain_error)?;
            item.set_item("held_out_before", s.held_out.0)?;
            item.set_item("held_out_after", s.held_out.1)?;
            item.set_item("expected_ratio", s.expected_ratio)?;
            item.set_item("testable", s.testable)?;
            item.set_item("stable", s.stable)?;
            item.set_item("plausible", s.plausible)?;
            item.set_item("passed", verdict::passes(s, *p))?;
            item.set_item("parameters", s.parameters.clone())?;
            list.append(item)?;
        }
        out.set_item("screened", list)?;
        let unexplained = PyList::empty(py);
        for d in &v.unexplained {
            let item = PyDict::new(py);
            item.set_item("channel", channel_name(d.channel))?;
            item.set_item("covariate", &self.white.layout.bins.names[d.covariate])?;
            item.set_item("gain", d.gain)?;
            item.set_item("p_value", d.p_value)?;
            item.set_item("shape", shape_name(&d.shape))?;
            unexplained.append(item)?;
        }
        out.set_item("unexplained", unexplained)?;
        Ok(out)
    }

    /// Residual at a step (p,) of all parameters: RMS and mean by channel and block, and binned panels, in the
    /// channels' units.
    fn residual<'py>(&self, py: Python<'py>, step: Vec<f64>) -> PyResult<Bound<'py, PyDict>> {
        if step.len() != self.raw.layout.model.parameters() {
            return Err(value_error("step must have one number per parameter"));
        }
        let step = DVector::from_vec(step);
        let channels = residual::channels(&self.raw, &step);
        let out = PyDict::new(py);
        let (list, panels) = (PyList::empty(py), PyList::empty(py));
        for c in &channels {
            let floor = self.floors[c.channel];
            let item = PyDict::new(py);
            item.set_item("channel", channel_name(c.channel))?;
            item.set_item("index", c.channel)?;
            item.set_item("n", c.n)?;
            item.set_item("rms", c.rms)?;
            item.set_item("mean", c.mean)?;
            item.set_item("block_rms", PyArray1::from_slice(py, &c.block_rms))?;
            item.set_item("stretch", residual::stretch(&c.block_rms, floor))?;
            list.append(item)?;
            for p in residual::panels(&self.raw, &step, c.channel, floor) {
                let item = PyDict::new(py);
                item.set_item("channel", channel_name(p.channel))?;
                item.set_item("covariate", &self.raw.layout.bins.names[p.covariate])?;
                item.set_item(
                    "unit",
                    imufit_fit::bins::Bins::unit(&self.raw.layout.bins.names[p.covariate]),
                )?;
                let mut edges = self.raw.layout.bins.edges[p.covariate].clone();
                if p.covariate == 1 {
                    for edge in &mut edges {
                        *edge += self.raw.layout.facts.temperature_mean;
                    }
                }
                item.set_item("edges", PyArray1::from_vec(py, edges))?;
                item.set_item("mean", PyArray1::from_slice(py, &p.mean))?;
                item.set_item("band", PyArray1::from_slice(py, &p.band))?;
                item.set_item("share", p.share)?;
                panels.append(item)?;
            }
        }
        out.set_item("channels", list)?;
        out.set_item("panels", panels)?;
        Ok(out)
    }
}

/// Squared residual in units of the floors, and number of samples.
fn training(problem: &PyProblem, step: &DVector<f64>) -> (f64, f64) {
    let (mut square, mut count) = (0.0, 0.0);
    for channel in 0..CHANNELS {
        let floor = problem.floors[channel];
        let (s, n) = saturated::channel_square(&problem.raw, channel, step);
        if n > 0 && floor > 0.0 {
            square += s / (floor * floor);
            count += n as f64;
        }
    }
    (square, count)
}

/// Registers this file's part of the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<PyProblem>()?;
    m.add_function(wrap_pyfunction!(saturate, m)?)?;
    Ok(())
}
