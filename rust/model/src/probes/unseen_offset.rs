//! The noise of the reference hides which part of a magnetometer's offset is the field's.

use crate::card::{Affine, Card, Found, Parameter, Reach, ReferencePart, Scope, Stage, Traits};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::sensor::Sensor;

/// Offset along the directions of the body that hardly turn, where the field is unknown.
///
/// Fitted beside everything, with coefficients that are normal about zero. The reference shows such a direction turning by its noise. The
/// readings do not follow this turn, as if the field along the direction were an offset (attenuation by errors in the variables; Fuller 1987,
/// Measurement error models, sec. 2.2).
pub struct UnseenOffset {
    card: Card,
}

impl UnseenOffset {
    /// The effect.
    pub fn new() -> Self {
        let parameter = |k: usize| Parameter {
            name: format!("{k}"),
            unit: "1".to_string(),
            typical: Some(1.0),
            found: Found::Steps,
        };
        Self {
            card: Card {
                id: "the noise of the reference hides a part of the offset".to_string(),
                name: "offset along directions that hardly turn".to_string(),
                stage: Stage::Offset,
                traits: Traits {
                    scope: Scope::Log,
                    reach: Reach::Row,
                    affine: Some(Affine::Offset),
                    reference: Some(ReferencePart::Noise),
                },
                parameters: (0..3).map(parameter).collect(),
                physics: String::new(),
                formula: String::new(),
                signature: "constant".to_string(),
                mistaken_for: String::new(),
                confirm: String::new(),
                shares: 1.0,
            },
        }
    }
}

impl Effect for UnseenOffset {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &[Sensor::Mag]
    }

    fn not_testable(&self, _: &LogFacts) -> Option<String> {
        None
    }

    fn columns(&self, rows: &Rows, _: Sensor, _: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        for (k, direction) in rows.facts.offset_unseen.column_iter().enumerate() {
            for axis in 0..3 {
                out.set(k, axis, std::iter::repeat_n(direction[axis], rows.len()));
            }
        }
        Ok(())
    }
}
