//! A current beside the magnetometer makes a field of its own.

use super::{Linear, Needs, Words, affine};
use crate::card::{Affine, Stage, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

/// The covariate that holds the current, A.
pub const MOTOR_CURRENT: &str = "motor_current";

fn fill(rows: &Rows, out: &mut Columns) {
    if let Some(k) = rows.facts.covariate(MOTOR_CURRENT) {
        for axis in 0..3 {
            out.set(axis, axis, rows.covariates[k].iter().copied());
        }
    }
}

/// `mag.current`: no current, no field, so that the column counts from zero and not from its mean.
pub fn current() -> Linear {
    let words = Words {
        name: "field of a current",
        physics: "the wires of motor or battery run past the magnetometer: their current adds a proportional field, fixed in the body",
        formula: "c motor_current",
        signature: "the field residual follows the current, at any attitude",
        mistaken_for: "mag.hard_iron while the current hardly changes, mag.bias_temperature if the current warms the board",
        confirm: "let the sensor lie still and switch the motor on and off: the field must jump with the current",
    };
    Linear {
        card: words
            .card(
                "mag.current".to_string(),
                Stage::Offset,
                // Biot and Savart: mu_0 / (2 pi r) is 1 uT a metre per 5 A: 2 uT/A at 10 cm from a single wire.
                parameters(&VECTOR, "uT/A", 2.0),
            )
            .with(affine(Affine::Offset)),
        sensor: [Sensor::Mag],
        needs: Needs::Column(MOTOR_CURRENT),
        fill,
    }
}
