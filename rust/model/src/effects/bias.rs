//! A constant added to each axis.

use super::{Linear, Needs, Words, affine};
use crate::card::{Affine, Scope, Stage, Traits, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill(rows: &Rows, out: &mut Columns) {
    for axis in 0..3 {
        out.set(axis, axis, std::iter::repeat_n(1.0, rows.len()));
    }
}

/// `acc.bias`, `gyr.bias`.
pub fn bias(sensor: Sensor) -> Linear {
    let (words, typical) = match sensor {
        // MPU6050 product specification 3.4: zero-g output +-50 mg (x, y), +-80 mg (z).
        Sensor::Acc => (
            Words {
                name: "accelerometer bias",
                physics: "package stress, soldering and mounting shift the resting position of the proof mass, and with it the zero of each axis",
                formula: "b",
                signature: "a constant residual, the same in every attitude and at every temperature",
                mistaken_for: "a tilted levelling table or a mount misalignment (one attitude does not separate them), acc.scale if one attitude dominates",
                confirm: "lay the sensor on opposite faces: a bias keeps its sign, gravity changes it",
            },
            0.5,
        ),
        // MPU6050 product specification 3.4: initial zero-rate output +-20 deg/s; some deg/s after soldering is common.
        _ => (
            Words {
                name: "gyroscope bias",
                physics: "quadrature and offset of the vibrating structure and its amplifier leave a rate at standstill",
                formula: "b",
                signature: "a constant residual, the same at rest and in motion",
                mistaken_for: "gyr.bias_temperature over a short log, gyr.g_sensitivity if the attitude never changes, the earth's rotation",
                confirm: "let the sensor lie still for a minute and average: the mean is the bias",
            },
            0.05,
        ),
    };
    Linear {
        card: words
            .card(
                format!("{}.bias", sensor.prefix()),
                Stage::Offset,
                parameters(&VECTOR, sensor.unit(), typical),
            )
            .with(Traits {
                scope: Scope::Log,
                ..affine(Affine::Offset)
            }),
        sensor: [sensor],
        needs: Needs::Sensor,
        fill,
    }
}
