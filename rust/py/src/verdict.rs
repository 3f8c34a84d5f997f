//! The answer to "which effect is missing?" as Python sees it.

use imufit_inference::problem::Problem;
use imufit_inference::verdict::{Kind, Named, Status, Verdict};
use imufit_model::rest_channels;
use pyo3::prelude::*;

/// The four answers.
#[pyclass(name = "Kind", module = "imufit._imufit", frozen, eq, eq_int, hash)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PyKind {
    /// Nothing that the data can show is missing.
    #[pyo3(name = "ADEQUATE")]
    Adequate,
    /// One effect stands out.
    #[pyo3(name = "MISSING")]
    Missing,
    /// Two or more effects explain the data equally well here.
    #[pyo3(name = "AMBIGUOUS")]
    Ambiguous,
    /// Something is missing that no effect of the catalogue explains.
    #[pyo3(name = "UNKNOWN")]
    Unknown,
}

#[pymethods]
impl PyKind {
    /// The word used in results.
    #[getter]
    #[allow(clippy::trivially_copy_pass_by_ref)] // pyo3 hands objects over by reference
    const fn word(&self) -> &'static str {
        match self {
            Self::Adequate => "adequate",
            Self::Missing => "missing",
            Self::Ambiguous => "ambiguous",
            Self::Unknown => "unknown",
        }
    }
}

/// What became of a candidate.
#[pyclass(name = "Status", module = "imufit._imufit", frozen, eq, eq_int, hash)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PyStatus {
    /// It is there, or explains as much as one that is.
    #[pyo3(name = "SIGNIFICANT")]
    Significant,
    /// The log shows that it is not there, or does not determine it.
    #[pyo3(name = "NOT_SIGNIFICANT")]
    NotSignificant,
    /// The log cannot show it.
    #[pyo3(name = "NOT_TESTABLE")]
    NotTestable,
    /// It would have to be larger than sensors have it.
    #[pyo3(name = "TOO_LARGE")]
    TooLarge,
    /// It would have to have the other sign.
    #[pyo3(name = "OTHER_SIGN")]
    OtherSign,
}

#[pymethods]
impl PyStatus {
    /// The words used in results.
    #[getter]
    #[allow(clippy::trivially_copy_pass_by_ref)] // pyo3 hands objects over by reference
    const fn words(&self) -> &'static str {
        match self {
            Self::Significant => "significant",
            Self::NotSignificant => "not significant",
            Self::NotTestable => "not testable here",
            Self::TooLarge => "implausible size",
            Self::OtherSign => "negative delay",
        }
    }
}

/// An effect that is not in the model.
#[pyclass(name = "Candidate", module = "imufit._imufit", frozen, get_all)]
#[derive(Clone, Debug)]
pub struct PyCandidate {
    /// Its slot.
    slot: usize,
    /// What became of it.
    status: PyStatus,
    /// Log Bayes factor on top of the model alone.
    ln_bayes: f64,
    /// Probability that it is there, beside the others that are.
    probability: f64,
    /// Value and standard error of each parameter.
    parameters: Vec<(f64, f64)>,
    /// Size from which on each parameter would be seen in such a log as often as not.
    detectable: Vec<f64>,
    /// Held-out gain in units of the noise variance.
    gain: f64,
    /// Standard error of the gain.
    gain_error: f64,
    /// Held-out residual over noise floor without it.
    held_out_before: f64,
    /// Held-out residual over noise floor with it.
    held_out_after: f64,
}

/// A dependence that no effect of the catalogue explains.
#[pyclass(name = "Finding", module = "imufit._imufit", frozen, get_all)]
#[derive(Clone, Debug)]
pub struct PyFinding {
    /// Channel that shows it most.
    channel: String,
    /// The covariate.
    covariate: String,
    /// Number of the log concerned; None for all.
    log: Option<usize>,
    /// Log Bayes factor beside the named effects.
    ln_bayes: f64,
    /// Whitened square that it explains beside them, in units of the noise variance.
    drop: f64,
    /// Indices of the channels in which it explains that.
    channels: Vec<usize>,
    /// How the channel depends on the covariate.
    shape: String,
    /// Slot of the probe that shows it, if one does.
    probe: Option<usize>,
}

/// A log that has another value of an effect than the others.
#[pyclass(name = "Disagreement", module = "imufit._imufit", frozen, get_all)]
#[derive(Clone, Debug)]
pub struct PyDisagreement {
    /// Slot of the effect.
    slot: usize,
    /// Number of the log.
    log: usize,
    /// Value and standard error of each parameter in that log.
    own: Vec<(f64, f64)>,
    /// The same in the other logs.
    others: Vec<(f64, f64)>,
    /// Log Bayes factor of two values against one.
    ln_bayes: f64,
    /// True if no sensor changes so much.
    wild: bool,
}

/// Answer to "which effect is missing?"
#[pyclass(name = "Verdict", module = "imufit._imufit", frozen)]
#[derive(Clone, Debug)]
pub struct PyVerdict {
    /// The answer.
    #[pyo3(get)]
    kind: PyKind,
    /// Slot of the effect that stands out.
    #[pyo3(get)]
    best: Option<usize>,
    /// Slots of effects that explain the data as well.
    #[pyo3(get)]
    rivals: Vec<usize>,
    /// Every candidate: those that are there first, then by evidence.
    #[pyo3(get)]
    candidates: Vec<PyCandidate>,
    /// How much effects look like the best one: slot, slot, correlation.
    #[pyo3(get)]
    correlations: Vec<(usize, usize, f64)>,
    /// Dependences that no named effect explains, most evidence first.
    #[pyo3(get)]
    findings: Vec<PyFinding>,
    /// Logs that disagree about an effect.
    #[pyo3(get)]
    disagreements: Vec<PyDisagreement>,
    /// True if they differ so much that there is no answer for all of them.
    #[pyo3(get)]
    spoilt: bool,
    named: Named,
}

impl PyVerdict {
    /// Of an answer about the logs of a problem.
    pub fn new(problem: &Problem, found: Verdict) -> Self {
        let kind = match found.kind {
            Kind::Adequate => PyKind::Adequate,
            Kind::Missing => PyKind::Missing,
            Kind::Ambiguous => PyKind::Ambiguous,
            Kind::Unknown => PyKind::Unknown,
        };
        let candidates = found.candidates.into_iter().map(|c| PyCandidate {
            slot: c.slot,
            status: match c.status {
                Status::Significant => PyStatus::Significant,
                Status::NotSignificant => PyStatus::NotSignificant,
                Status::NotTestable => PyStatus::NotTestable,
                Status::TooLarge => PyStatus::TooLarge,
                Status::OtherSign => PyStatus::OtherSign,
            },
            ln_bayes: c.ln_bayes,
            probability: c.probability,
            parameters: c.parameters,
            detectable: c.detectable,
            gain: c.gain.0,
            gain_error: c.gain.1,
            held_out_before: c.held_out.0,
            held_out_after: c.held_out.1,
        });
        let rests = |log: Option<usize>| {
            let part = problem.parts.get(log.unwrap_or(0));
            part.is_some_and(|part| part.raw.layout.facts.rests)
        };
        let findings = found.findings.into_iter().map(|f| PyFinding {
            channel: rest_channels::name(f.channel, rests(f.log)).clone(),
            covariate: f.covariate,
            log: f.log,
            ln_bayes: f.ln_bayes,
            drop: f.drop,
            channels: f.channels,
            shape: f.shape,
            probe: f.probe,
        });
        let disagreements = found.disagreements.into_iter().map(|d| PyDisagreement {
            slot: d.slot,
            log: d.log,
            own: d.own,
            others: d.others,
            ln_bayes: d.ln_bayes,
            wild: d.wild,
        });
        Self {
            kind,
            best: found.best,
            rivals: found.rivals,
            candidates: candidates.collect(),
            correlations: found.correlations,
            findings: findings.collect(),
            disagreements: disagreements.collect(),
            spoilt: found.spoilt,
            named: found.named,
        }
    }

    /// What the evidence alone names.
    pub fn named(&self) -> Named {
        self.named.clone()
    }
}

/// Registers this file's part of the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<PyKind>()?;
    m.add_class::<PyStatus>()?;
    m.add_class::<PyCandidate>()?;
    m.add_class::<PyFinding>()?;
    m.add_class::<PyDisagreement>()?;
    m.add_class::<PyVerdict>()?;
    Ok(())
}
