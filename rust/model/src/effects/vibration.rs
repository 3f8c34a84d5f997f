//! Shaking shifts the zero of an accelerometer.

use super::{Linear, Needs, Words};
use crate::card::{Stage, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill(rows: &Rows, out: &mut Columns) {
    if let Some(power) = rows.vibration {
        for axis in 0..3 {
            out.set(axis, axis, power.iter().copied());
        }
    }
}

/// `acc.vibration_rectification`.
pub fn rectification() -> Linear {
    let words = Words {
        name: "vibration rectification",
        physics: "the springs, the air gap and the end of the range are not the same on both sides, so that fast shaking does not average out",
        formula: "c times the local mean square of the vibration, all axes together, above a tenth of the sampling rate",
        signature: "the mean of the residual shifts while a motor or a machine runs, whatever the attitude",
        mistaken_for: "acc.column:motor_current, when the motor shakes the sensor; acc.bias under steady vibration; acc.quadratic",
        confirm: "let the sensor lie still, then run the motor at two speeds: the mean must shift with the square of the shaking",
    };
    Linear {
        card: words.card(
            "acc.vibration_rectification".to_string(),
            Stage::Offset,
            // MPU6050 product specification 3.2: nonlinearity 0.5 %, of which shaking by 1 m/s^2 can leave that much.
            parameters(&VECTOR, "1/(m/s^2)", 0.005),
        ),
        sensor: [Sensor::Acc],
        needs: Needs::Shaking,
        fill,
    }
}
