//! Ideal readings of rows that have no reference: some are known, the others are not.

use imufit_model::effect::Rows;
use imufit_model::facts::LogFacts;
use imufit_model::ideal::Ideal;
use imufit_model::sensor::{CHANNELS, Sensor};
use imufit_model::sensor_model::{AxisColumns, Evaluation};
use imufit_model::triple::Triple;
use imufit_model::window::{Window, held};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Rows with what is known of their ideal readings.
pub struct Table<'a> {
    t: &'a [f64],
    /// Ideal readings; NaN where not known, as every derivative is.
    pub ideal: Ideal,
    temperature: Option<Vec<f64>>,
    covariates: Vec<Vec<f64>>,
    vibration: Vec<f64>,
}

/// An attitude that is not known.
pub fn no_attitude() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, f64::NAN, f64::NAN, f64::NAN))
}

/// Readings of one sensor, NaN without it.
pub fn readings(window: &Window, sensor: Sensor) -> Triple {
    let n = window.len();
    let axis = |a: usize| match window.reading(sensor) {
        Some(y) => (0..n).map(|i| y[3 * i + a]).collect(),
        None => vec![f64::NAN; n],
    };
    Triple([axis(0), axis(1), axis(2)])
}

impl<'a> Table<'a> {
    /// Rows whose ideal readings are the readings; derivatives and attitudes are not known.
    pub fn new(window: &Window<'a>, facts: &LogFacts) -> Self {
        let n = window.len();
        let unknown = || Triple([vec![f64::NAN; n], vec![f64::NAN; n], vec![f64::NAN; n]]);
        let nothing = || Triple::zeros(n);
        let ideal = Ideal {
            omega: readings(window, Sensor::Gyr),
            field: facts.field,
            alpha: unknown(),
            alpha_rate: unknown(),
            snap: unknown(),
            f: readings(window, Sensor::Acc),
            f_rate: unknown(),
            m: readings(window, Sensor::Mag),
            m_rate: unknown(),
            omega_detail: nothing(),
            f_detail: nothing(),
            attitude: vec![no_attitude(); n],
            command: Vec::new(),
            rig_axis: Vector3::zeros(),
            settling: Triple::default(),
        };
        let temperature = window.temperature;
        Self {
            t: window.t,
            ideal,
            temperature: temperature.map(|t| (0..n).map(|i| held(t, i) - facts.temperature_mean).collect()),
            covariates: window
                .covariates
                .iter()
                .map(|c| (0..n).map(|i| held(c, i)).collect())
                .collect(),
            vibration: vec![f64::NAN; n],
        }
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// Time of a row, s.
    pub fn time(&self, row: usize) -> f64 {
        self.t[row]
    }

    /// The rows as effects see them.
    pub fn rows<'b>(&'b self, facts: &'b LogFacts) -> Rows<'b> {
        Rows {
            facts,
            t: self.t,
            ideal: &self.ideal,
            force: &self.ideal.f,
            x: &self.ideal.f,
            temperature: self.temperature.as_deref(),
            vibration: Some(&self.vibration),
            covariates: &self.covariates,
            position: &[],
            history: 0,
        }
    }

    /// What bins are told by.
    pub fn evaluation(&self) -> Evaluation {
        self.evaluation_of(&(0..self.len()).collect::<Vec<_>>())
    }

    /// The same of some of the rows.
    pub fn evaluation_of(&self, rows: &[usize]) -> Evaluation {
        let column = |from: &[f64]| -> Vec<f64> { rows.iter().map(|i| from[*i]).collect() };
        let triple = |from: &Triple| Triple(std::array::from_fn(|axis| column(from.axis(axis))));
        Evaluation {
            ideal: Ideal {
                omega: triple(&self.ideal.omega),
                f: triple(&self.ideal.f),
                m: triple(&self.ideal.m),
                ..Ideal::default()
            },
            channels: vec![None; CHANNELS],
            covariates: self.covariates.iter().map(|c| column(c)).collect(),
            temperature: self.temperature.as_deref().map(column),
        }
    }
}

/// Columns of one sensor in one row over some of all parameters, `wanted`: three numbers each, zero where none of them acts.
pub fn vectors(columns: &AxisColumns, active: &[Vec<usize>], row: usize, wanted: &[usize]) -> Vec<Vector3<f64>> {
    let mut out = vec![Vector3::zeros(); wanted.len()];
    for axis in 0..3 {
        for (k, parameter) in active[axis].iter().enumerate() {
            if let Ok(place) = wanted.binary_search(parameter) {
                out[place][axis] = columns[axis][k][row];
            }
        }
    }
    out
}
