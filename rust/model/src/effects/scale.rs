//! Each axis reads too much or too little by a constant factor.

use super::{Linear, Needs, Words, affine};
use crate::card::{Affine, Stage, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill(rows: &Rows, out: &mut Columns) {
    for axis in 0..3 {
        out.set(axis, axis, rows.x.axis(axis).iter().copied());
    }
}

/// `acc.scale`, `gyr.scale`. MPU6050 product specification 3.1, 3.2: sensitivity tolerance +-3 % both.
pub fn scale(sensor: Sensor) -> Linear {
    let words = match sensor {
        Sensor::Acc => Words {
            name: "accelerometer scale error",
            physics: "spring stiffness and capacitor gaps differ from the design, so each axis has its own sensitivity",
            formula: "diag(s) f",
            signature: "the residual of an axis grows in proportion to the specific force on that axis and changes sign with it",
            mistaken_for: "acc.bias if one attitude dominates, a wrong value of local gravity (all axes alike)",
            confirm: "turn each axis up and down: half the difference of the two readings over g is 1 + s",
        },
        _ => Words {
            name: "gyroscope scale error",
            physics: "drive amplitude and sense gain differ from the design, so each axis has its own sensitivity",
            formula: "diag(s) omega",
            signature: "the residual of an axis grows in proportion to the rate about that axis and changes sign with it",
            mistaken_for: "ref.delay if every motion has the same shape, a lag, gyr.misalignment if axes always turn together",
            confirm: "turn by exactly 360 degrees about the axis and integrate: the excess over 360 degrees is s",
        },
    };
    Linear {
        card: words
            .card(
                format!("{}.scale", sensor.prefix()),
                Stage::Gain,
                parameters(&VECTOR, "1", 0.03),
            )
            .with(affine(Affine::Scale)),
        sensor: [sensor],
        needs: Needs::Sensor,
        fill,
    }
}
