//! The noise of the reference hides which part of a magnetometer's offset is the field's.

use super::words::nuisance;
use crate::card::{Card, Reach, ReferencePart, Scope, Stage, Traits};
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
        Self {
            card: nuisance(
                "the noise of the reference hides a part of the offset",
                "offset along directions that hardly turn",
                "constant",
                Stage::Offset,
                Traits {
                    scope: Scope::Log,
                    reach: Reach::Row,
                    affine: None,
                    reference: Some(ReferencePart::Noise),
                },
                (3, "1"),
            ),
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
