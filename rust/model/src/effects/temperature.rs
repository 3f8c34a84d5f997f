//! The zero and the gain of a sensor move with its temperature.

use super::{Linear, Needs, Words, affine};
use crate::card::{Affine, Stage, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill_bias(rows: &Rows, out: &mut Columns) {
    if let Some(temperature) = rows.temperature {
        for axis in 0..3 {
            out.set(axis, axis, temperature.iter().copied());
        }
    }
}

fn fill_scale(rows: &Rows, out: &mut Columns) {
    if let Some(temperature) = rows.temperature {
        for axis in 0..3 {
            let values = rows.x.axis(axis).iter().zip(temperature);
            out.set(axis, axis, values.map(|(x, t)| t * x));
        }
    }
}

/// `acc.bias_temperature`, `gyr.bias_temperature`, `mag.bias_temperature`.
pub fn bias_temperature(sensor: Sensor) -> Linear {
    let (words, typical) = match sensor {
        // MPU6050 product specification 3.2: zero-g change over temperature +-35 mg (x, y), +-60 mg (z) over 70 K.
        Sensor::Acc => (
            Words {
                name: "temperature drift of the accelerometer bias",
                physics: "package and die expand differently: the stress on the proof mass changes with temperature",
                formula: "c (temp - mean temp)",
                signature: "the residual follows the temperature, at any attitude",
                mistaken_for: "a drift in time during warm-up, when temperature only rises",
                confirm: "repeat the same pose cold and warm, then let the sensor cool down: the residual must return with the temperature",
            },
            0.006,
        ),
        // MPU6050 product specification 3.1: zero-rate change over temperature +-20 deg/s over 125 K.
        Sensor::Gyr => (
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
        // The HMC5883L data sheet gives none for the offset; its -0.3 %/K on a bridge offset of some tens of uT make 0.1 uT/K.
        Sensor::Mag => (
            Words {
                name: "temperature drift of the magnetometer offset",
                physics: "the resistors of each sensing bridge differ slightly, and the difference changes with temperature",
                formula: "c (temp - mean temp)",
                signature: "the field residual follows the temperature, at any attitude",
                mistaken_for: "mag.hard_iron if the temperature hardly changes, mag.scale_temperature if the attitude hardly changes, a current that warms the board",
                confirm: "let the sensor lie still while it warms up and cools down: the field must follow the temperature both ways",
            },
            0.1,
        ),
    };
    let unit = format!("{}/K", sensor.unit());
    Linear {
        card: words
            .card(
                format!("{}.bias_temperature", sensor.prefix()),
                Stage::Offset,
                parameters(&VECTOR, &unit, typical),
            )
            .with(affine(Affine::Offset)),
        sensor: [sensor],
        needs: Needs::Temperature,
        fill: fill_bias,
    }
}

/// `acc.scale_temperature`, `gyr.scale_temperature`, `mag.scale_temperature`.
pub fn scale_temperature(sensor: Sensor) -> Linear {
    let (words, typical) = match sensor {
        // MPU6050 product specification 3.2: sensitivity change over temperature +-0.02 %/K.
        Sensor::Acc => (
            Words {
                name: "temperature drift of the accelerometer scale",
                physics: "spring stiffness and reference voltage change with temperature, and with them the sensitivity of each axis",
                formula: "diag(c) (temp - mean temp) f",
                signature: "a scale error that grows with the distance from the mean temperature: the residual follows the product of temperature and specific force",
                mistaken_for: "acc.bias_temperature when one attitude dominates, acc.scale when the temperature hardly changes",
                confirm: "turn each axis up and down, cold and warm: half the difference of the two readings must follow the temperature",
            },
            2e-4,
        ),
        // MPU6050 product specification 3.1: sensitivity variation +-2 % from -40 to 85 degC, up to 65 K from the 25 degC it is trimmed at.
        Sensor::Gyr => (
            Words {
                name: "temperature drift of the gyroscope scale",
                physics: "amplitude and frequency of the drive change with temperature, and with them the sensitivity of each axis",
                formula: "diag(c) (temp - mean temp) omega",
                signature: "zero at rest; in motion the residual follows the product of temperature and rate",
                mistaken_for: "gyr.scale when the temperature hardly changes, gyr.bias_temperature when the sensor always turns the same way",
                confirm: "turn by exactly 360 degrees about the axis, cold and warm: the excess over 360 degrees must follow the temperature",
            },
            3e-4,
        ),
        // HMC5883L data sheet: sensitivity tempco -0.3 %/K (not compensated).
        Sensor::Mag => (
            Words {
                name: "temperature drift of the magnetometer scale",
                physics: "the magnetoresistance of the sensing bridges falls as they warm up, all three alike",
                formula: "diag(c) (temp - mean temp) m",
                signature: "the magnitude of the measured field follows the temperature, at any attitude",
                mistaken_for: "mag.soft_iron if the temperature hardly changes, mag.bias_temperature if few attitudes are visited",
                confirm: "turn the sensor through all attitudes cold and warm: the radius of the sphere of readings must follow the temperature",
            },
            3e-3,
        ),
    };
    Linear {
        card: words
            .card(
                format!("{}.scale_temperature", sensor.prefix()),
                Stage::Gain,
                parameters(&VECTOR, "1/K", typical),
            )
            .with(affine(Affine::Scale)),
        sensor: [sensor],
        needs: Needs::Temperature,
        fill: fill_scale,
    }
}
