//! Iron that moves with the magnetometer.

use super::{Linear, Needs, Words, affine, matrix};
use crate::card::{Affine, MATRIX, Stage, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill_hard(rows: &Rows, out: &mut Columns) {
    for axis in 0..3 {
        out.set(axis, axis, std::iter::repeat_n(1.0, rows.len()));
    }
}

fn fill_soft(rows: &Rows, out: &mut Columns) {
    matrix(rows.x, out);
}

/// `mag.hard_iron`. HMC5883L boards show some to some tens of uT.
pub fn hard_iron() -> Linear {
    let words = Words {
        name: "hard iron",
        physics: "magnetised parts fixed to the sensor (screws, batteries, speakers) add a constant field to the sensor's own offset",
        formula: "b",
        signature: "a constant field residual in the body frame, at any attitude",
        mistaken_for: "mag.field_reference if the attitude hardly changes, a magnet in the room (whose field changes with the place)",
        confirm: "turn the sensor through all attitudes far from iron: the readings lie on a sphere whose centre is b",
    };
    Linear {
        card: words
            .card(
                "mag.hard_iron".to_string(),
                Stage::Offset,
                parameters(&VECTOR, "uT", 20.0),
            )
            .with(affine(Affine::Offset)),
        sensor: [Sensor::Mag],
        needs: Needs::Sensor,
        fill: fill_hard,
    }
}

/// `mag.soft_iron`.
pub fn soft_iron() -> Linear {
    let words = Words {
        name: "soft iron",
        physics: "unmagnetised iron fixed to the sensor bends the field lines, and the three sensing bridges differ in gain and direction",
        formula: "S m, full 3x3",
        signature: "the residual is proportional to the field in body axes and changes sign with it",
        mistaken_for: "ref.alignment (its part of S is antisymmetric and shows in the other sensors too), mag.hard_iron if few attitudes are visited",
        confirm: "turn the sensor through all attitudes far from iron: the readings lie on an ellipsoid instead of a sphere",
    };
    Linear {
        card: words
            .card("mag.soft_iron".to_string(), Stage::Gain, parameters(&MATRIX, "1", 0.05))
            .with(affine(Affine::Matrix)),
        sensor: [Sensor::Mag],
        needs: Needs::Sensor,
        fill: fill_soft,
    }
}
