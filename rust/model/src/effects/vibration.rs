//! Shaking shifts the zero of an accelerometer and of a gyroscope.

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

/// `acc.vibration_rectification`, `gyr.vibration_rectification`: both by the vibration that the accelerometer shows.
pub fn rectification(sensor: Sensor) -> Linear {
    let (words, unit, typical) = match sensor {
        Sensor::Gyr => (
            Words {
                name: "vibration rectification of the gyroscope",
                physics: "vibration moves the masses against each other and bends their springs, and the sensor's response does not average out",
                formula: "c times the local mean square of the accelerometer's vibration, all axes together, above a tenth of the sampling rate",
                signature: "the bias shifts while a motor or a machine runs, at any attitude and rate",
                mistaken_for: "gyr.column:motor_current, if the motor shakes the sensor; gyr.bias under steady vibration; gyr.g_sensitivity",
                confirm: "let the sensor lie still, then run the motor at two speeds: the bias must shift with the square of the vibration",
            },
            "(rad/s)/(m/s^2)^2",
            // Weinberg, Analog Devices MS-2158, table of commercial gyroscopes: 0.005 deg/s/g^2 where the linear g-sensitivity is
            // 0.1 deg/s/g, the figure of the MPU6050 as well (product specification 3.1).
            1e-6,
        ),
        Sensor::Acc | Sensor::Mag => (
            Words {
                name: "vibration rectification",
                physics: "springs, air gap and end of the range differ between the two directions, so that fast vibration does not average out",
                formula: "c times the local mean square of the vibration, all axes together, above a tenth of the sampling rate",
                signature: "the mean of the residual shifts while a motor or a machine runs, at any attitude",
                mistaken_for: "acc.column:motor_current, if the motor shakes the sensor; acc.bias under steady vibration; acc.quadratic",
                confirm: "let the sensor lie still, then run the motor at two speeds: the mean must shift with the square of the vibration",
            },
            "1/(m/s^2)",
            // MPU6050 product specification 3.2: nonlinearity 0.5 %, of which shaking by 1 m/s^2 can leave that much.
            0.005,
        ),
    };
    Linear {
        card: words.card(
            format!("{}.vibration_rectification", sensor.prefix()),
            Stage::Offset,
            parameters(&VECTOR, unit, typical),
        ),
        sensor: [sensor],
        needs: Needs::Shaking,
        fill,
    }
}
