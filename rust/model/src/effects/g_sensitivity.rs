//! Acceleration acts on a gyroscope.

use super::{Linear, Needs, OF_THE_ROW, Words, matrix};
use crate::card::{MATRIX, Stage, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill(rows: &Rows, out: &mut Columns) {
    matrix(rows.force, out);
}

/// `gyr.g_sensitivity`. MPU6050 product specification 3.1: linear acceleration sensitivity 0.1 deg/s per g.
pub fn g_sensitivity() -> Linear {
    let words = Words {
        name: "gyroscope g-sensitivity",
        physics: "specific force bends the vibrating structure of the gyroscope, which reads it as rotation",
        formula: "G f, full 3x3",
        signature: "at rest the rate residual changes with the attitude; in motion it follows the specific force",
        mistaken_for: "gyr.bias if the attitude never changes, gyr.bias_temperature if attitude and temperature change together",
        confirm: "let the sensor lie still on each of its six faces: without g-sensitivity the mean rate is the same on all",
    };
    Linear {
        card: words
            .card(
                "gyr.g_sensitivity".to_string(),
                Stage::Offset,
                // 0.1 deg/s per g is 1.8e-4 rad/s per m/s^2.
                parameters(&MATRIX, "rad/s/(m/s^2)", 2e-4),
            )
            .with(OF_THE_ROW),
        sensor: [Sensor::Gyr],
        needs: Needs::Sensor,
        fill,
    }
}
