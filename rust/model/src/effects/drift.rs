//! The zero of a sensor moves steadily with time.

use super::{Linear, Needs, Words};
use crate::card::{Card, Reach, Stage, Traits, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill(rows: &Rows, out: &mut Columns) {
    for axis in 0..3 {
        out.set(axis, axis, rows.t.iter().map(|t| t - rows.facts.t_start));
    }
}

/// A zero that wanders may drift for as long as a log lasts.
const SHARES: f64 = 5.0;

/// `acc.bias_drift`, `gyr.bias_drift`.
pub fn bias_drift(sensor: Sensor) -> Linear {
    let (words, typical) = match sensor {
        // MPU6050 product specification 3.2: zero-g change over temperature +-35 mg in 70 K, for a board that warms by 1 K a minute.
        Sensor::Acc => (
            Words {
                name: "drift of the accelerometer bias in time",
                physics: "stress in package and solder relaxes, and parts away from the thermometer warm up: the bias of each axis changes steadily",
                formula: "c (t - start of the log)",
                signature: "a residual that grows in proportion to time, in every attitude and at every temperature",
                mistaken_for: "acc.bias_temperature while the temperature only rises, acc.bias over a short log, a bias random walk",
                confirm: "record for twice as long while the temperature rises and falls: the residual must keep its slope in time",
            },
            1e-4,
        ),
        // MPU6050 product specification 3.1: zero-rate change over temperature +-20 deg/s in 125 K, for a board that warms by 1 K a minute.
        _ => (
            Words {
                name: "drift of the gyroscope bias in time",
                physics: "quadrature and stress of the vibrating structure change slowly after power-on, and with them the rate read at standstill",
                formula: "c (t - start of the log)",
                signature: "a rate residual that grows in proportion to time, at rest as in motion",
                mistaken_for: "gyr.bias_temperature while the temperature only rises, gyr.warmup over a short log, a bias random walk",
                confirm: "let the sensor lie still for twice as long while the temperature rises and falls: the mean rate must keep its slope in time",
            },
            5e-5,
        ),
    };
    let unit = format!("{}/s", sensor.unit());
    let card = words.card(
        format!("{}.bias_drift", sensor.prefix()),
        Stage::Offset,
        parameters(&VECTOR, &unit, typical),
    );
    Linear {
        card: Card { shares: SHARES, ..card }.with(Traits {
            reach: Reach::History,
            ..Traits::default()
        }),
        sensor: [sensor],
        needs: Needs::Sensor,
        fill,
    }
}
