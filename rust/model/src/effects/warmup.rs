//! The zero of a gyroscope settles after switching on.

use super::Words;
use crate::card::{Card, Found, Parameter, Reach, Stage, Traits, VECTOR, parameters};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::sensor::Sensor;
use crate::triple::Triple;

/// `gyr.warmup`.
pub struct WarmUp {
    card: Card,
}

/// Shortest and longest time constant tried, as a share of the log's duration, and how many. What has not settled by the end
/// cannot be told from a zero that is off or drifts.
const SHORTEST: f64 = 0.02;
const LONGEST: f64 = 0.4;
const TRIALS: u32 = 9;

/// `gyr.warmup`: c exp(-(t - t0) / tau).
pub fn warmup() -> WarmUp {
    let words = Words {
        name: "warm-up of the gyroscope",
        physics: "drive and electronics warm up after power-on, faster than the thermometer beside them, and the bias settles with them",
        formula: "c exp(-(t - start of the log) / tau)",
        signature: "a rate residual that decays with one time constant on all axes, at any attitude and motion",
        mistaken_for: "gyr.bias_temperature while the temperature only rises, gyr.bias_drift over a short log, a bias random walk",
        confirm: "switch the sensor off, let it cool down and record again from power-on: the same decay must return",
    };
    // MPU6050 product specification 3.1: zero-rate change over temperature +-20 deg/s in 125 K, for a chip that warms by 4 K in some minutes.
    let mut list = parameters(&VECTOR, "rad/s", 0.01);
    list.push(Parameter {
        name: "tau".to_string(),
        unit: "s".to_string(),
        typical: Some(60.0),
        found: Found::SearchThenSteps,
    });
    WarmUp {
        card: words.card("gyr.warmup".to_string(), Stage::Offset, list).with(Traits {
            reach: Reach::History,
            ..Traits::default()
        }),
    }
}

/// What is left of the start in a row.
fn left(rows: &Rows, tau: f64) -> impl Iterator<Item = f64> {
    rows.t.iter().map(move |t| (-(t - rows.facts.t_start) / tau).exp())
}

impl Effect for WarmUp {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &[Sensor::Gyr]
    }

    fn not_testable(&self, facts: &LogFacts) -> Option<String> {
        (!facts.sensors[Sensor::Gyr.index()]).then(|| format!("the log has no {}", Sensor::Gyr.name()))
    }

    fn columns(&self, rows: &Rows, _: Sensor, parameters: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        let tau = parameters[3];
        if tau <= 0.0 {
            return Ok(());
        }
        for axis in 0..3 {
            out.set(axis, axis, left(rows, tau));
            let since = rows.t.iter().map(|t| (t - rows.facts.t_start) / (tau * tau));
            out.set(
                3,
                axis,
                left(rows, tau).zip(since).map(|(e, s)| parameters[axis] * s * e),
            );
        }
        Ok(())
    }

    fn candidate_columns(&self, rows: &Rows, _: Sensor, trial: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        if trial[3] > 0.0 {
            for axis in 0..3 {
                out.set(axis, axis, left(rows, trial[3]));
            }
        }
        Ok(())
    }

    fn added(&self, rows: &Rows, _: Sensor, parameters: &[f64]) -> Result<Option<Triple>, EffectError> {
        let tau = parameters[3];
        if tau <= 0.0 {
            return Ok(Some(Triple::zeros(rows.len())));
        }
        Ok(Some(Triple(std::array::from_fn(|axis| {
            left(rows, tau).map(|e| parameters[axis] * e).collect()
        }))))
    }

    fn search(&self, facts: &LogFacts, found: Option<(&[f64], usize)>) -> Vec<Vec<f64>> {
        if found.is_some() {
            return Vec::new();
        }
        let duration = facts.t_end - facts.t_start;
        let ratio = (LONGEST / SHORTEST).powf(1.0 / f64::from(TRIALS - 1));
        (0..TRIALS)
            .map(|k| vec![0.0, 0.0, 0.0, SHORTEST * duration * ratio.powf(f64::from(k))])
            .collect()
    }
}
