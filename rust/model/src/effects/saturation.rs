//! Readings cannot leave the range of the sensor.

use super::{OF_THE_ROW, Words};
use crate::card::{Card, Found, Parameter, Stage};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::sensor::Sensor;
use crate::triple::Triple;

/// `acc.saturation`, `gyr.saturation`.
pub struct Saturation {
    card: Card,
    sensor: [Sensor; 1],
}

/// `acc.saturation`, `gyr.saturation`: the end of the range is where readings stand, bit for bit the same.
pub fn saturation(sensor: Sensor) -> Saturation {
    let (words, unit) = match sensor {
        Sensor::Acc => (
            Words {
                name: "end of the accelerometer's range",
                physics: "the converter's range is limited: a stronger force reads as the end of the range",
                formula: "f held within +-range, less f",
                signature: "readings stay at one largest value while the force grows; smaller readings are correct",
                mistaken_for: "acc.cubic, which changes smaller readings too; acc.scale, if the end is often reached",
                confirm: "repeat with a larger range: the readings must go beyond the old end",
            },
            "m/s^2",
        ),
        _ => (
            Words {
                name: "end of the gyroscope's range",
                physics: "the converter's range is limited: a faster rotation reads as the end of the range",
                formula: "omega held within +-range, less omega",
                signature: "readings stay at one largest value while the rate grows; smaller readings are correct",
                mistaken_for: "gyr.cubic, which changes smaller readings too; gyr.scale, if the end is often reached",
                confirm: "repeat with a larger range: the readings must go beyond the old end",
            },
            "rad/s",
        ),
    };
    let range = Parameter {
        name: "range".to_string(),
        unit: unit.to_string(),
        typical: None,
        found: Found::Search,
    };
    Saturation {
        card: words
            .card(format!("{}.saturation", sensor.prefix()), Stage::Range, vec![range])
            .with(OF_THE_ROW),
        sensor: [sensor],
    }
}

/// What the end of the range takes away.
fn cut_off(rows: &Rows, range: f64) -> Triple {
    Triple(std::array::from_fn(|axis| {
        rows.x.axis(axis).iter().map(|x| x.clamp(-range, range) - x).collect()
    }))
}

impl Effect for Saturation {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &self.sensor
    }

    fn not_testable(&self, facts: &LogFacts) -> Option<String> {
        let sensor = self.sensor[0];
        if !facts.sensors[sensor.index()] {
            return Some(format!("the log has no {}", sensor.name()));
        }
        self.search(facts, None)
            .is_empty()
            .then(|| format!("no reading of the {} stands at the end of its range", sensor.name()))
    }

    fn columns(&self, _: &Rows, _: Sensor, _: &[f64], _: &mut Columns) -> Result<(), EffectError> {
        // The readings themselves tell where the range ends: nothing is left to be fitted.
        Ok(())
    }

    fn candidate_columns(&self, rows: &Rows, _: Sensor, trial: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        if trial[0] > 0.0 {
            let cut = cut_off(rows, trial[0]);
            for axis in 0..3 {
                out.set(0, axis, cut.axis(axis).iter().map(|v| v / trial[0]));
            }
        }
        Ok(())
    }

    fn added(&self, rows: &Rows, _: Sensor, parameters: &[f64]) -> Result<Option<Triple>, EffectError> {
        let range = parameters[0];
        Ok(Some(if range > 0.0 {
            cut_off(rows, range)
        } else {
            Triple::zeros(rows.len())
        }))
    }

    fn search(&self, facts: &LogFacts, found: Option<(&[f64], usize)>) -> Vec<Vec<f64>> {
        let range = facts.ranges[self.sensor[0].index()].filter(|r| *r > 0.0 && found.is_none());
        range.map(|r| vec![r]).into_iter().collect()
    }
}
