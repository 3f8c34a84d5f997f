//! The accelerometer does not sit where the reference position is taken.

use super::{Linear, Needs, Words};
use crate::card::{Stage, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;
use nalgebra::Vector3;

/// Accelerations of a row that a lever arm of one metre along each axis makes, m/s^2.
pub fn accelerations_of_levers(rows: &Rows, row: usize) -> [Vector3<f64>; 3] {
    let (omega, mut alpha) = (rows.ideal.omega.row(row), rows.ideal.alpha.row(row));
    // Noise of the reference's attitude is in what gravity reads, too: an acceleration made of it would agree with that.
    for axis in (0..3).filter(|k| rows.facts.silent_accelerations[*k]) {
        alpha[axis] = 0.0;
    }
    // omega x (omega x r) + alpha x r = ([omega]^2 + [alpha]) r
    [0, 1, 2].map(|parameter| {
        let unit = Vector3::ith(parameter, 1.0);
        omega.cross(&omega.cross(&unit)) + alpha.cross(&unit)
    })
}

fn fill(rows: &Rows, out: &mut Columns) {
    for row in 0..rows.len() {
        for (parameter, a) in accelerations_of_levers(rows, row).into_iter().enumerate() {
            for axis in 0..3 {
                out.column(parameter, axis)[row] = a[axis];
            }
        }
    }
}

/// `acc.lever_arm`.
pub fn lever_arm() -> Linear {
    let words = Words {
        name: "lever arm",
        physics: "the accelerometer sits away from the point whose position the reference measures, so rotation accelerates it",
        formula: "omega x (omega x r) + domega/dt x r",
        signature: "zero at rest; the residual grows with the square of the rate and with the angular acceleration",
        mistaken_for: "vibration rectification, ref.delay of the position, a gyroscope scale error behind a filter",
        confirm: "spin at a constant rate about each axis: the reading away from the axis is r omega^2",
    };
    Linear {
        card: words.card(
            "acc.lever_arm".to_string(),
            Stage::Input,
            parameters(&VECTOR, "m", 0.05),
        ),
        sensor: [Sensor::Acc],
        needs: Needs::Sensor,
        fill,
    }
}
