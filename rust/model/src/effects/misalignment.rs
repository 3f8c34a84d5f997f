//! Each axis picks up a little of the other two.

use super::{Linear, Needs, Words, affine};
use crate::card::{Affine, OFF_DIAGONAL, Stage, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

/// (row, column) of the six off-diagonal elements in the order of their names.
const ELEMENTS: [(usize, usize); 6] = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)];

fn fill(rows: &Rows, out: &mut Columns) {
    for (parameter, (row, column)) in ELEMENTS.into_iter().enumerate() {
        out.set(parameter, row, rows.x.axis(column).iter().copied());
    }
}

/// `acc.misalignment`, `gyr.misalignment`. MPU6050 product specification 3.1, 3.2: cross-axis sensitivity +-2 %.
pub fn misalignment(sensor: Sensor) -> Linear {
    let words = match sensor {
        Sensor::Acc => Words {
            name: "accelerometer axis misalignment",
            physics: "the sensing axes are not at right angles or not parallel to the package: each axis measures a part of the others",
            formula: "M f, zero diagonal",
            signature: "the residual of an axis grows in proportion to the specific force on another axis",
            mistaken_for: "ref.alignment (a rotated mount shows in every sensor, and antisymmetrically), ref.tilt",
            confirm: "lay the sensor on each of its six faces on a level table: the two axes that should read zero show M g",
        },
        _ => Words {
            name: "gyroscope axis misalignment",
            physics: "the sensing axes are not at right angles or not parallel to the package: each axis measures a part of the rotation about the others",
            formula: "M omega, zero diagonal",
            signature: "the residual of an axis grows in proportion to the rate about another axis",
            mistaken_for: "ref.alignment (a rotated mount shows in every sensor, and antisymmetrically)",
            confirm: "turn about one package axis at a time: without misalignment the other two axes read zero",
        },
    };
    Linear {
        card: words
            .card(
                format!("{}.misalignment", sensor.prefix()),
                Stage::Gain,
                parameters(&OFF_DIAGONAL, "1", 0.02),
            )
            .with(affine(Affine::Matrix)),
        sensor: [sensor],
        needs: Needs::Sensor,
        fill,
    }
}
