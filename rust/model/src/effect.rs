//! The trait behind every effect, built in or written by a user, and the contract that fitting relies on.

use nalgebra::{UnitQuaternion, Vector3};

use crate::card::{Card, ReferencePart};
use crate::facts::LogFacts;
use crate::ideal::{Ideal, ReferenceChange};
use crate::sensor::Sensor;
use crate::triple::Triple;

/// What an effect sees: the rows of a window with ideal readings and covariates.
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    /// Constants of the whole log.
    pub facts: &'a LogFacts,
    /// Time, s (n).
    pub t: &'a [f64],
    /// Ideal readings, reference effects applied.
    pub ideal: &'a Ideal,
    /// Specific force that reaches the sensing elements, m/s^2: the ideal one and what effects of stage Input add to it. The three sensors
    /// of one chip feel the same.
    pub force: &'a Triple,
    /// Quantity that the stage acts on: ideal reading plus the effects of the stages before.
    pub x: &'a Triple,
    /// Sensor temperature less its mean over the log, K (n); NaN where not known.
    pub temperature: Option<&'a [f64]>,
    /// Local power of the accelerometer's vibration, (m/s^2)^2 (n); `None` without accelerometer.
    pub vibration: Option<&'a [f64]>,
    /// Covariates in the order of `facts.covariates` (n each); NaN where not known.
    pub covariates: &'a [Vec<f64>],
    /// Reference position, m (n), NaN where not known; empty without one.
    pub position: &'a [Vector3<f64>],
    /// Rows at the beginning that are only the past of those asked about; an effect without [`Effect::memory`] gets none.
    pub history: usize,
}

impl Rows<'_> {
    /// Number of rows, those of the past among them.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// True without rows.
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Attitude of one row.
    pub fn attitude(&self, row: usize) -> &UnitQuaternion<f64> {
        &self.ideal.attitude[row]
    }
}

/// Columns of the design matrix that an effect fills: d reading / d parameter for one sensor, by parameter and axis.
#[derive(Default)]
pub struct Columns {
    n: usize,
    parameters: usize,
    data: Vec<Vec<f64>>,
    active: Vec<bool>,
}

impl Columns {
    /// Empties the columns for `parameters` parameters and `n` rows.
    pub fn reset(&mut self, n: usize, parameters: usize) {
        self.n = n;
        self.parameters = parameters;
        self.active.clear();
        self.active.resize(3 * parameters, false);
        if self.data.len() < 3 * parameters {
            self.data.resize_with(3 * parameters, Vec::new);
        }
    }

    /// The column of one parameter on one axis, zero when first asked for. A column that is never asked for is zero.
    pub fn column(&mut self, parameter: usize, axis: usize) -> &mut [f64] {
        let k = 3 * parameter + axis;
        if !self.active[k] {
            self.active[k] = true;
            self.data[k].clear();
            self.data[k].resize(self.n, 0.0);
        }
        &mut self.data[k]
    }

    /// Fills one column from a source column.
    pub fn set(&mut self, parameter: usize, axis: usize, values: impl Iterator<Item = f64>) {
        let k = 3 * parameter + axis;
        self.active[k] = true;
        self.data[k].clear();
        self.data[k].extend(values);
        self.data[k].resize(self.n, 0.0);
    }

    /// A column that was asked for; `None` = zero.
    pub fn get(&self, parameter: usize, axis: usize) -> Option<&[f64]> {
        let k = 3 * parameter + axis;
        self.active
            .get(k)
            .copied()
            .unwrap_or(false)
            .then(|| self.data[k].as_slice())
    }

    /// Adds every column, times the value of its parameter, to a quantity.
    pub fn add_to(&self, values: &[f64], sum: &mut Triple) {
        for (p, value) in values.iter().enumerate().filter(|(_, v)| **v != 0.0) {
            for (axis, target) in sum.0.iter_mut().enumerate() {
                for (y, c) in target.iter_mut().zip(self.get(p, axis).unwrap_or_default()) {
                    *y += value * c;
                }
            }
        }
    }

    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.parameters
    }
}

/// What goes wrong inside an effect.
#[derive(Debug, thiserror::Error)]
pub enum EffectError {
    /// The effect needs a column that the log does not have.
    #[error("effect {effect} needs the column {column}, which the log does not have")]
    MissingColumn {
        /// Id of the effect.
        effect: String,
        /// Name of the column.
        column: String,
    },
    /// A user's function failed; the original exception travels in the binding.
    #[error("effect {effect}: {message}")]
    User {
        /// Id of the effect.
        effect: String,
        /// What it said.
        message: String,
    },
    /// The effect broke its contract.
    #[error("effect {effect}: {message}")]
    Contract {
        /// Id of the effect.
        effect: String,
        /// What is wrong.
        message: String,
    },
}

/// What signs the parameters of an effect can have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Any.
    Any,
    /// A negative value is no property of the sensor, but what stands behind it (rows stamped late) is possible: never named first.
    RatherPositive,
    /// Not negative: no sensor is settled before its input changes.
    Positive,
}

/// One physical cause of readings that differ from the ideal ones.
pub trait Effect: Send + Sync {
    /// Its description.
    fn card(&self) -> &Card;

    /// Sensors whose readings it touches.
    fn sensors(&self) -> &[Sensor];

    /// Why it cannot be offered for this log; `None` if it can.
    fn not_testable(&self, facts: &LogFacts) -> Option<String>;

    /// The column of the log that it reads besides sensors and reference: `temp` or the name of a covariate.
    fn column(&self) -> Option<&str> {
        None
    }

    /// The columns of the log that it counts from the means of, `temp` or names of covariates: whoever takes the effect out of
    /// another log has to know these means.
    fn centred_columns(&self) -> Vec<String> {
        Vec::new()
    }

    /// True where it is fitted along whatever is asked, without being named: the field, if this log is all that is known of it.
    fn fitted_along(&self, facts: &LogFacts) -> bool {
        self.card().traits.reference == Some(ReferencePart::Field) && facts.field_estimated
    }

    /// Columns d reading / d parameter of `sensor`, at the given parameter values.
    fn columns(&self, rows: &Rows, sensor: Sensor, parameters: &[f64], out: &mut Columns) -> Result<(), EffectError>;

    /// Columns for a candidate that is not in the model, at trial values of the parameters inside it: what each
    /// parameter's column would have to be for the effect of that size. The same as [`Effect::columns`] where the
    /// reading is proportional to the parameters.
    fn candidate_columns(
        &self,
        rows: &Rows,
        sensor: Sensor,
        trial: &[f64],
        out: &mut Columns,
    ) -> Result<(), EffectError> {
        self.columns(rows, sensor, trial, out)
    }

    /// True if a candidate's columns at a trial, times the trial's own values, are what the effect of that size does, so that a search
    /// asks how well just that size does. Of an effect whose value lies in the ideal readings they are taken from these, whatever
    /// [`Effect::candidate_columns`] are.
    fn tried_at_full_size(&self) -> bool {
        false
    }

    /// True if readings jump as its parameters change: no slope leads anywhere, and it stays at what a search finds.
    fn jumps(&self) -> bool {
        false
    }

    /// What it adds to the reading where that is not the sum of its parameters times their columns; `None` where it is.
    fn added(&self, _rows: &Rows, _sensor: Sensor, _parameters: &[f64]) -> Result<Option<Triple>, EffectError> {
        Ok(None)
    }

    /// Time before a row, s, within which rows decide what it adds there; infinite for all rows of the log, zero where no past is asked
    /// for. The past that it gets begins at whole multiples of this time since the log's start, so that nothing depends on how rows are cut.
    fn memory(&self) -> f64 {
        0.0
    }

    /// True if its columns are difference quotients of what it adds: another difference quotient says nothing of them.
    fn columns_are_quotients(&self) -> bool {
        false
    }

    /// Least and largest value of each parameter; empty where every value is possible.
    fn limits(&self) -> Vec<(f64, f64)> {
        Vec::new()
    }

    /// Different readings of one ideal axis that determine its parameters beside all effects of lower order (a cubic goes through any
    /// three); zero where that is no question.
    fn least_levels(&self) -> usize {
        0
    }

    /// True if its columns around one value say little of larger ones, so that only a fit tells how much it explains.
    fn strongly_curved(&self) -> bool {
        false
    }

    /// What signs its parameters can have.
    fn sign(&self) -> Sign {
        Sign::Any
    }

    /// True if the typical size says nothing of how large it may be.
    fn size_is_open(&self) -> bool {
        false
    }

    /// Size that one of its parameters typically has in such a log, in the parameter's unit; `None` if nobody can tell.
    fn typical(&self, parameter: usize, facts: &LogFacts) -> Option<f64> {
        if self.card().traits.reference == Some(ReferencePart::Field)
            && let Some(off) = facts.field_off()
        {
            return Some(off);
        }
        self.card().parameters[parameter]
            .typical
            .filter(|_| !self.size_is_open())
    }

    /// Part that noise of the reference makes of its columns, where these may cancel.
    fn noise_share(&self, _facts: &LogFacts) -> f64 {
        0.0
    }

    /// True if it stands for no physical cause and has so many columns that the noise is not found beside it.
    fn is_probe(&self) -> bool {
        false
    }

    /// True for a probe if bins of the covariate that it is called after show the same.
    fn shown_by_bins(&self) -> bool {
        false
    }

    /// Trial values for parameters that no linear step finds (a period, a width): at first a grid over all that can be,
    /// then, around what the round before `round` found best, a finer one. Empty: nothing to search, or done.
    fn search(&self, _facts: &LogFacts, _found: Option<(&[f64], usize)>) -> Vec<Vec<f64>> {
        Vec::new()
    }

    /// What the effect does to the reference; only for [`crate::card::Stage::Reference`], whose value lies there.
    fn reference_change(&self, _parameters: &[f64]) -> ReferenceChange {
        ReferenceChange::default()
    }
}
