//! The reading of an axis is no straight line over the quantity on that axis.

use super::{Linear, Needs, OF_THE_ROW, Words};
use crate::card::{Stage, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill(rows: &Rows, out: &mut Columns, shape: fn(f64) -> f64) {
    for axis in 0..3 {
        out.set(axis, axis, rows.x.axis(axis).iter().map(|x| shape(*x)));
    }
}

fn fill_square(rows: &Rows, out: &mut Columns) {
    fill(rows, out, |x| x * x);
}

fn fill_cube(rows: &Rows, out: &mut Columns) {
    fill(rows, out, |x| x * x * x);
}

fn fill_magnitude(rows: &Rows, out: &mut Columns) {
    fill(rows, out, f64::abs);
}

/// Largest nonlinearity (share of the reading) and the reading at which it is taken.
///
/// MPU6050 product specification 3.2: 0.5 % for the accelerometer, taken at 1 g. IDG-300 data sheet: below 1 % of full scale for
/// the gyroscope, taken at 250 deg/s.
const fn nonlinearity(sensor: Sensor) -> (f64, f64) {
    match sensor {
        Sensor::Acc => (0.005, 9.81),
        _ => (0.01, 4.36),
    }
}

/// Rounded to two digits, as a card states it.
fn rounded(value: f64) -> f64 {
    let unit = 10.0_f64.powf(value.log10().floor() - 1.0);
    (value / unit).round() * unit
}

fn one(
    sensor: Sensor,
    (name, levels): (&str, usize),
    words: &Words,
    unit: &str,
    typical: f64,
    fill: crate::effects::Fill,
) -> Linear {
    Linear {
        card: words
            .card(
                format!("{}.{name}", sensor.prefix()),
                Stage::Gain,
                parameters(&VECTOR, unit, typical),
            )
            .with(OF_THE_ROW),
        sensor: [sensor],
        needs: Needs::Levels(levels),
        fill,
    }
}

/// `acc.quadratic`, `gyr.quadratic`.
pub fn quadratic(sensor: Sensor) -> Linear {
    let (share, at) = nonlinearity(sensor);
    let (words, unit) = match sensor {
        Sensor::Acc => (
            Words {
                name: "quadratic nonlinearity of the accelerometer",
                physics: "the capacitor gaps on the two sides of the proof mass differ, so that a push reads more than a pull of the same size",
                formula: "diag(k) f^2",
                signature: "the residual of an axis follows the square of the specific force on it: the same with gravity along and against the axis, none across",
                mistaken_for: "acc.bias if an axis only measures plus and minus g, acc.vibration_rectification under vibration",
                confirm: "point each axis up, down and across: the mean of up and down differs from the reading across by k g^2",
            },
            "1/(m/s^2)",
        ),
        _ => (
            Words {
                name: "quadratic nonlinearity of the gyroscope",
                physics: "drive and sense motion couple differently in the two directions, which adds a part with the square of the rate",
                formula: "diag(k) omega^2",
                signature: "the residual of an axis has one sign for both directions of rotation and grows with the square of the rate",
                mistaken_for: "gyr.scale_asymmetry (|omega| instead of its square), gyr.scale if the sensor always turns the same way, gyr.g_sensitivity to the centripetal force",
                confirm: "turn both ways at two rates, one twice the other: the mean of both ways must grow fourfold",
            },
            "s/rad",
        ),
    };
    one(sensor, ("quadratic", 3), &words, unit, rounded(share / at), fill_square)
}

/// `acc.cubic`, `gyr.cubic`.
pub fn cubic(sensor: Sensor) -> Linear {
    let (share, at) = nonlinearity(sensor);
    let (words, unit) = match sensor {
        Sensor::Acc => (
            Words {
                name: "cubic nonlinearity of the accelerometer",
                physics: "the springs stiffen and the electric force grows with the displacement of the proof mass, alike in both directions",
                formula: "diag(k) f^3",
                signature: "a scale error that grows with the square of the specific force, the same for both signs",
                mistaken_for: "acc.scale if only gravity acts, readings that are cut off at the end of the range",
                confirm: "tilt each axis in steps from up to down: the residual of a straight line is S-shaped",
            },
            "1/(m/s^2)^2",
        ),
        _ => (
            Words {
                name: "cubic nonlinearity of the gyroscope",
                physics: "the springs of the sense mass stiffen with its displacement, alike in both directions",
                formula: "diag(k) omega^3",
                signature: "a scale error that grows with the square of the rate, the same in both directions of rotation",
                mistaken_for: "gyr.scale if the sensor always turns at one speed, readings that are cut off at the end of the range",
                confirm: "turn by exactly 360 degrees slowly and fast: the excess over 360 degrees must grow with the square of the rate",
            },
            "(s/rad)^2",
        ),
    };
    one(
        sensor,
        ("cubic", 4),
        &words,
        unit,
        rounded(share / (at * at)),
        fill_cube,
    )
}

/// `gyr.scale_asymmetry`.
pub fn scale_asymmetry() -> Linear {
    let words = Words {
        name: "gyroscope scale asymmetry",
        physics: "the electronics amplify positive and negative rates differently, or the zero of an analogue gyroscope differs from its converter's",
        formula: "diag(k) |omega|",
        signature: "the residual of an axis has one sign for both directions of rotation and is V-shaped over the rate",
        mistaken_for: "gyr.quadratic (a square instead of a V), gyr.scale if the sensor always turns the same way",
        confirm: "turn by exactly 360 degrees one way and back: the two angles differ by 2 k of the turn, at any speed",
    };
    // Half of the IDG-300 data sheet's nonlinearity of 1 %, on either side of a straight line.
    one(Sensor::Gyr, ("scale_asymmetry", 3), &words, "1", 0.005, fill_magnitude)
}
