//! The zero of a sensor moves with its temperature.

use super::{Linear, Needs, Words};
use crate::card::{Stage, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill_bias(rows: &Rows, out: &mut Columns) {
    if let Some(temperature) = rows.temperature {
        for axis in 0..3 {
            out.set(axis, axis, temperature.iter().copied());
        }
    }
}

/// `acc.bias_temperature`, `gyr.bias_temperature`.
pub fn bias_temperature(sensor: Sensor) -> Linear {
    let (words, typical) = match sensor {
        // MPU6050 product specification 3.2: zero-g change over temperature +-35 mg (x, y), +-60 mg (z) over 70 K.
        Sensor::Acc => (
            Words {
                name: "temperature drift of the accelerometer bias",
                physics: "package and die expand differently: the stress on the proof mass changes with temperature",
                formula: "c (temp - mean temp)",
                signature: "the residual follows the temperature, whatever the attitude",
                mistaken_for: "a drift in time during warm-up, when temperature only rises",
                confirm: "repeat the same pose cold and warm, then let it cool down: the residual must come back with the temperature",
            },
            0.006,
        ),
        // MPU6050 product specification 3.1: zero-rate change over temperature +-20 deg/s over 125 K.
        _ => (
            Words {
                name: "temperature drift of the gyroscope bias",
                physics: "stiffness and damping of the vibrating structure change with temperature, and with them the rate read at standstill",
                formula: "c (temp - mean temp)",
                signature: "the residual follows the temperature, at rest as in motion",
                mistaken_for: "a drift in time during warm-up, when temperature only rises; gyr.bias when the temperature hardly changes",
                confirm: "let the sensor lie still while it warms up and cools down: the mean rate must follow the temperature both ways",
            },
            0.0028,
        ),
    };
    let unit = format!("{}/K", sensor.unit());
    Linear {
        card: words.card(
            format!("{}.bias_temperature", sensor.prefix()),
            Stage::Offset,
            parameters(&VECTOR, &unit, typical),
        ),
        sensor: [sensor],
        needs: Needs::Temperature,
        fill: fill_bias,
    }
}
