//! Any other column of the log acts on a sensor.

use super::{Words, affine};
use crate::card::{Affine, Card, Found, Parameter, Stage, VECTOR};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::sensor::Sensor;

/// Relative rounding error of a mean over a long log.
const ROUNDING: f64 = 1e-10;

/// `acc.column:NAME`, `gyr.column:NAME`, `mag.column:NAME`.
pub struct Covariate {
    card: Card,
    sensor: [Sensor; 1],
    column: String,
}

/// The effect of column `name` on a sensor.
pub fn column(sensor: Sensor, name: &str) -> Covariate {
    let words = Words {
        name: &format!("influence of {name} on the {}", sensor.name()),
        physics: &format!(
            "the cause that {name} measures (a supply, a current, a load) shifts the reading of the {}",
            sensor.name()
        ),
        formula: &format!("c ({name} - mean of {name})"),
        signature: &format!("the residual follows {name}"),
        mistaken_for: "any other quantity that changes together with that column",
        confirm: &format!("change {name} on purpose while the sensor lies still"),
    };
    let parameters = VECTOR
        .iter()
        .map(|v| Parameter {
            name: (*v).to_string(),
            unit: format!("{} per {name}", sensor.unit()),
            typical: None,
            found: Found::Steps,
        })
        .collect();
    Covariate {
        card: words
            .card(format!("{}.column:{name}", sensor.prefix()), Stage::Offset, parameters)
            .with(affine(Affine::Offset)),
        sensor: [sensor],
        column: name.to_string(),
    }
}

impl Effect for Covariate {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &self.sensor
    }

    fn not_testable(&self, facts: &LogFacts) -> Option<String> {
        if !facts.sensors[self.sensor[0].index()] {
            return Some(format!("the log has no {}", self.sensor[0].name()));
        }
        facts
            .covariate(&self.column)
            .is_none()
            .then(|| format!("the log has no column {}", self.column))
    }

    fn column(&self) -> Option<&str> {
        Some(&self.column)
    }

    fn centred_columns(&self) -> Vec<String> {
        vec![self.column.clone()]
    }

    fn columns(&self, rows: &Rows, _: Sensor, _: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        let k = rows
            .facts
            .covariate(&self.column)
            .ok_or_else(|| EffectError::MissingColumn {
                effect: self.card.id.clone(),
                column: self.column.clone(),
            })?;
        let mean = rows.facts.covariate_means[k];
        let deviation = |v: &f64| {
            let d = v - mean;
            // A constant column differs from its mean by rounding only.
            if d.abs() <= ROUNDING * mean.abs() { 0.0 } else { d }
        };
        for axis in 0..3 {
            out.set(axis, axis, rows.covariates[k].iter().map(deviation));
        }
        Ok(())
    }
}
