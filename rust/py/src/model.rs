//! Effects and facts of a log.

use std::sync::Arc;

use imufit_fit::bins::{Bins, CovariateSamples};
use imufit_model::card::{Affine, Found, Reach, ReferencePart, Scope, Stage};
use imufit_model::catalogue;
use imufit_model::contract;
use imufit_model::effect::{Effect, Sign};
use imufit_model::facts::LogFacts;
use imufit_model::probes::{acts_on, cause};
use imufit_model::sensor::{AXES, Sensor};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::computing::compute;
use crate::errors::from_effect;
use crate::window::ChunkArrays;

/// One effect of the catalogue, built in or a user's.
#[pyclass(name = "Effect", frozen, module = "imufit._imufit")]
pub struct PyEffect(pub Arc<dyn Effect>);

#[pymethods]
impl PyEffect {
    /// Its name in the catalogue, such as `gyr.bias`.
    #[getter]
    fn id(&self) -> String {
        self.0.card().id.clone()
    }

    /// Prefixes of the sensors it touches.
    #[getter]
    fn sensors(&self) -> Vec<&'static str> {
        self.0.sensors().iter().map(|s| s.prefix()).collect()
    }

    /// The column of a log that it reads besides sensors and reference: `temp`, a covariate, or None.
    #[getter]
    fn column(&self) -> Option<String> {
        self.0.column().map(str::to_string)
    }

    /// The columns of a log that it counts from the means of: `temp`, covariates. Those of a user's effect are known once
    /// its function has been called.
    #[getter]
    fn centred_columns(&self) -> Vec<String> {
        self.0.centred_columns()
    }

    /// Time before a row, s, within which rows decide what it adds there; infinite for all of them, 0 for no past.
    #[getter]
    fn memory(&self) -> f64 {
        self.0.memory()
    }

    /// Least and largest value of each parameter; empty where every value is possible.
    #[getter]
    fn limits(&self) -> Vec<(f64, f64)> {
        self.0.limits()
    }

    /// Whose property its parameters are: `sensor`, or `log` where each log has its own.
    #[getter]
    fn scope(&self) -> &'static str {
        match self.0.card().traits.scope {
            Scope::Sensor => "sensor",
            Scope::Log => "log",
        }
    }

    /// Whether its size depends on how the sensor is shaken, faster than the reference follows.
    #[getter]
    fn of_shaking(&self) -> bool {
        self.0.size_is_open()
    }

    /// Which rows decide what it adds to one: `row` (that one), `reference` (the reference there besides), `neighbours`
    /// or `history` (all from the start on).
    #[getter]
    fn reach(&self) -> &'static str {
        match self.0.card().traits.reach {
            Reach::Row => "row",
            Reach::Reference => "reference",
            Reach::Neighbours => "neighbours",
            Reach::History => "history",
        }
    }

    /// Part of `reading = (I + M) x + b` that it is: `offset` (b), `scale` (the diagonal of M), `matrix` (elements of M);
    /// None if it is none. Where it reads a `column`, for each unit of that.
    #[getter]
    fn affine(&self) -> Option<&'static str> {
        self.0.card().traits.affine.map(|part| match part {
            Affine::Offset => "offset",
            Affine::Scale => "scale",
            Affine::Matrix => "matrix",
        })
    }

    /// Part of the reference that it says is wrong: `mount`, `level`, `time`, `field` or `drive`; None if it acts on the
    /// readings.
    #[getter]
    fn reference_part(&self) -> Option<&'static str> {
        self.0.card().traits.reference.map(|part| match part {
            ReferencePart::Mount => "mount",
            ReferencePart::Level => "level",
            ReferencePart::Time => "time",
            ReferencePart::Bandwidth => "bandwidth",
            ReferencePart::Field => "field",
            ReferencePart::Drive => "drive",
            ReferencePart::Heading => "heading",
            ReferencePart::Noise => "noise",
        })
    }

    /// True where it is fitted along whatever is asked of a log, without being named.
    fn fitted_along(&self, facts: &PyFacts) -> bool {
        self.0.fitted_along(&facts.facts)
    }

    /// Its parameters: (name, unit, typical size or None).
    #[getter]
    fn parameters(&self) -> Vec<(String, String, Option<f64>)> {
        self.0
            .card()
            .parameters
            .iter()
            .map(|p| (p.name.clone(), p.unit.clone(), p.typical))
            .collect()
    }

    /// Names of parameters that a search finds and no step moves.
    #[getter]
    fn only_searched(&self) -> Vec<String> {
        self.found(|found| found == Found::Search)
    }

    /// Names of parameters that a search finds, those that steps refine after it among them.
    #[getter]
    fn searched(&self) -> Vec<String> {
        self.found(|found| found != Found::Steps)
    }

    /// Trial values of every parameter, where some can only be found by a search: at first a grid, then, around what
    /// the round before the given one found best, a finer one. Empty: nothing to search, or done.
    #[pyo3(signature = (facts, found=None, round=0))]
    fn search(&self, facts: &PyFacts, found: Option<Vec<f64>>, round: usize) -> Vec<Vec<f64>> {
        self.0.search(&facts.facts, found.as_deref().map(|f| (f, round)))
    }

    /// Different readings of one ideal axis that determine its parameters beside all effects of lower order.
    #[getter]
    fn least_levels(&self) -> usize {
        self.0.least_levels()
    }

    /// True if its columns around one value say little of larger ones: only a fit tells how much it explains.
    #[getter]
    fn strongly_curved(&self) -> bool {
        self.0.strongly_curved()
    }

    /// True if its columns as a candidate are those of the size that a search found, counted from nothing.
    #[getter]
    fn tried_at_full_size(&self) -> bool {
        self.0.tried_at_full_size()
    }

    /// True if readings jump as its parameters change, so that it stays at what a search finds.
    #[getter]
    fn jumps(&self) -> bool {
        self.0.jumps()
    }

    /// True if its reading is not proportional to its parameters, or these keep to a sign, so that the fit has to be
    /// repeated around the new values.
    #[getter]
    fn nonlinear(&self) -> bool {
        let card = self.0.card();
        let stepped = card.parameters.iter().any(|p| p.found == Found::SearchThenSteps);
        let bounded = self.0.sign() == Sign::Positive;
        stepped || bounded || matches!(card.stage, Stage::Reference | Stage::Time | Stage::Range)
    }

    /// Stage at which it acts: reference, time, input, gain, offset, rounding or range.
    #[getter]
    fn stage(&self) -> &'static str {
        match self.0.card().stage {
            Stage::Reference => "reference",
            Stage::Time => "time",
            Stage::Input => "input",
            Stage::Gain => "gain",
            Stage::Offset => "offset",
            Stage::Rounding => "rounding",
            Stage::Range => "range",
        }
    }

    /// Words of the card: name, physics, formula, signature, mistaken_for, confirm.
    #[getter]
    fn words<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let card = self.0.card();
        let out = PyDict::new(py);
        for (key, value) in [
            ("name", &card.name),
            ("physics", &card.physics),
            ("formula", &card.formula),
            ("signature", &card.signature),
            ("mistaken_for", &card.mistaken_for),
            ("confirm", &card.confirm),
        ] {
            out.set_item(key, value)?;
        }
        Ok(out)
    }

    /// What a parameter of a probe says that an axis depends on, as a finding calls it; None if it acts on another axis.
    fn cause(&self, parameter: usize, axis: usize) -> PyResult<Option<String>> {
        if axis >= AXES.len() {
            return Err(PyIndexError::new_err("an axis is 0, 1 or 2"));
        }
        let card = self.0.card();
        Ok(acts_on(card, parameter, axis).then(|| cause(card, parameter, axis)))
    }

    /// Why it cannot be offered for a log; None if it can.
    fn not_testable(&self, facts: &PyFacts) -> Option<String> {
        self.0.not_testable(&facts.facts)
    }

    /// Checks the contract on the core rows of a chunk: finite, agrees with a difference quotient, independent of how
    /// rows are cut. `at` holds a value for each parameter.
    fn check(&self, chunk: &Bound<'_, PyDict>, facts: &PyFacts, at: Vec<f64>) -> PyResult<()> {
        let arrays = ChunkArrays::new(chunk)?;
        let window = arrays.window()?;
        let py = chunk.py();
        compute(py, || contract::check(&self.0, &at, &window, &facts.facts))?.map_err(from_effect)
    }
}

impl PyEffect {
    fn found(&self, by: impl Fn(Found) -> bool) -> Vec<String> {
        let parameters = &self.0.card().parameters;
        parameters
            .iter()
            .filter(|p| by(p.found))
            .map(|p| p.name.clone())
            .collect()
    }
}

/// What is known of a log as a whole.
#[pyclass(name = "Facts", frozen, module = "imufit._imufit")]
#[derive(Clone)]
pub struct PyFacts {
    pub facts: LogFacts,
    pub bins: Bins,
    pub samples: Arc<CovariateSamples>,
    pub attitude_noise: f64,
    pub position_noise: f64,
}

#[pymethods]
impl PyFacts {
    /// Rows of the log.
    #[getter]
    fn n(&self) -> usize {
        self.facts.n
    }

    /// Rows that a chunk should carry on each side of its core.
    #[getter]
    fn margin(&self) -> usize {
        self.facts.margin()
    }

    /// Time of the first row, s.
    #[getter]
    fn t_start(&self) -> f64 {
        self.facts.t_start
    }

    /// Time of the last row, s.
    #[getter]
    fn t_end(&self) -> f64 {
        self.facts.t_end
    }

    /// Median time between rows, s.
    #[getter]
    fn dt(&self) -> f64 {
        self.facts.dt
    }

    /// Magnetic flux density in the reference frame, (3,), uT; zero without a magnetometer.
    #[getter]
    fn field(&self) -> [f64; 3] {
        self.facts.field.into()
    }

    /// Steps between readings of each sensor and axis where they are coarse against the noise, 0 elsewhere; (3, 3), m/s^2, rad/s, uT.
    #[getter]
    fn steps(&self) -> [[f64; 3]; 3] {
        self.facts.steps
    }

    /// True if `field` was estimated from this log, so that it has to be fitted along.
    #[getter]
    fn field_estimated(&self) -> bool {
        self.facts.field_estimated
    }

    /// Mean sensor temperature, degC.
    #[getter]
    fn temperature_mean(&self) -> f64 {
        self.facts.temperature_mean
    }

    /// True if the log has a thermometer.
    #[getter]
    fn has_temperature(&self) -> bool {
        self.facts.has_temperature
    }

    /// Prefixes of the sensors that the log has.
    #[getter]
    fn sensors(&self) -> Vec<&'static str> {
        Sensor::ALL
            .iter()
            .filter(|s| self.facts.sensors[s.index()])
            .map(|s| s.prefix())
            .collect()
    }

    /// Mean of each covariate by name, in its own unit.
    #[getter]
    fn covariate_means(&self) -> std::collections::BTreeMap<String, f64> {
        self.facts
            .covariates
            .iter()
            .cloned()
            .zip(self.facts.covariate_means.iter().copied())
            .collect()
    }

    /// Samples of the reference that come in one packet; 1 where every sample has a stamp of its own.
    #[getter]
    fn reference_packet(&self) -> usize {
        self.facts.reference_packet
    }

    /// Degree and half width of the polynomial through the reference attitude.
    #[getter]
    fn attitude_smoothing(&self) -> (usize, usize) {
        (
            self.facts.attitude_smoothing.degree,
            self.facts.attitude_smoothing.half_width,
        )
    }

    /// Degree and half width of the polynomial through the reference position; None without position.
    #[getter]
    fn position_smoothing(&self) -> Option<(usize, usize)> {
        self.facts.position_smoothing.map(|s| (s.degree, s.half_width))
    }

    /// White noise of the reference: attitude in rad, position in m.
    #[getter]
    fn reference_noise(&self) -> (f64, f64) {
        (self.attitude_noise, self.position_noise)
    }

    /// Noise that the reference gives to the ideal readings of accelerometer, gyroscope and magnetometer: m/s^2, rad/s, uT.
    #[getter]
    const fn ideal_noise(&self) -> [f64; 3] {
        self.facts.ideal_noise
    }

    /// Median time between samples of accelerometer, gyroscope and magnetometer, s.
    #[getter]
    const fn sensor_dt(&self) -> [f64; 3] {
        self.facts.sensor_dt
    }

    /// The same facts with what is known of the end of the sensors' ranges, m/s^2 and rad/s.
    #[pyo3(signature = (acc=None, gyr=None))]
    fn with_ranges(&self, acc: Option<f64>, gyr: Option<f64>) -> Self {
        let mut out = self.clone();
        out.facts.ranges = [acc, gyr, None];
        out
    }

    /// The same facts with bins of the covariates that are the same for all of several logs.
    fn with_bins_of(&self, others: Vec<PyRef<'_, Self>>) -> Self {
        let mut out = self.clone();
        let logs: Vec<&CovariateSamples> = std::iter::once(&self.samples)
            .chain(others.iter().map(|o| &o.samples))
            .map(Arc::as_ref)
            .collect();
        out.bins = Bins::new(&logs);
        out.bins.centre_temperature(out.facts.temperature_mean);
        out
    }

    /// The same facts with the temperature and covariate means of the log that a model was fitted on.
    #[pyo3(signature = (temperature_mean=None, covariate_means=None))]
    fn with_means(
        &self,
        temperature_mean: Option<f64>,
        covariate_means: Option<std::collections::BTreeMap<String, f64>>,
    ) -> Self {
        let mut out = self.clone();
        if let Some(mean) = temperature_mean {
            out.bins.centre_temperature(mean - out.facts.temperature_mean);
            out.facts.temperature_mean = mean;
        }
        for (name, mean) in covariate_means.unwrap_or_default() {
            if let Some(k) = out.facts.covariate(&name) {
                out.facts.covariate_means[k] = mean;
            }
        }
        out
    }
}

/// The built-in effects that need no column of a log's own, in the order of the catalogue.
#[pyfunction]
fn built_in_effects() -> Vec<PyEffect> {
    catalogue::built_in().into_iter().map(PyEffect).collect()
}

/// Effects that are fitted along and never named, in the order of the sensors.
#[pyfunction]
fn unnamed_effects() -> Vec<PyEffect> {
    catalogue::unnamed().into_iter().map(PyEffect).collect()
}

/// Dependences without a name that a log with these facts can be asked about.
#[pyfunction]
fn probes(facts: &PyFacts) -> Vec<PyEffect> {
    imufit_model::probes::probes(&facts.facts)
        .into_iter()
        .map(PyEffect)
        .collect()
}

/// The built-in effect with this id, `SENSOR.column:NAME` among them; None if there is none.
#[pyfunction]
fn find_effect(id: &str) -> Option<PyEffect> {
    catalogue::find(id).map(PyEffect)
}

/// Registers this file's part of the module.
pub fn register(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add_class::<PyEffect>()?;
    m.add_class::<PyFacts>()?;
    m.add_function(wrap_pyfunction!(built_in_effects, m)?)?;
    m.add_function(wrap_pyfunction!(unnamed_effects, m)?)?;
    m.add_function(wrap_pyfunction!(probes, m)?)?;
    m.add_function(wrap_pyfunction!(find_effect, m)?)?;
    Ok(())
}
