//! The reference frame turns with the Earth.

use super::{Linear, Needs, Words};
use crate::card::{Reach, Stage, Traits, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill(rows: &Rows, out: &mut Columns) {
    let axes = [rows.facts.frame.north(), rows.facts.frame.up()];
    for (parameter, turning) in axes.iter().enumerate() {
        for axis in 0..3 {
            out.column(parameter, axis);
        }
        for row in 0..rows.len() {
            let v = rows.attitude(row).inverse_transform_vector(turning);
            for axis in 0..3 {
                out.column(parameter, axis)[row] = v[axis];
            }
        }
    }
}

/// `gyr.earth_rate`: 7.292e-5 rad/s about the Earth's axis (WGS 84), cos(latitude) of it north, sin(latitude) vertical, up positive.
pub fn earth_rate() -> Linear {
    let words = Words {
        name: "rotation of the Earth",
        physics: "the gyroscope rotates with the Earth, which a reference fixed to the ground does not show",
        formula: "R^T omega_earth, omega_earth = (north, vertical) with up positive",
        signature: "a rate residual of 15 deg/h that is constant in the reference frame and rotates with the attitude in the body frame",
        mistaken_for: "gyr.bias if the attitude never changes, gyr.g_sensitivity (which follows the vertical part), a reference whose heading drifts",
        confirm: "let the sensor lie still, then turn it by 180 deg about the vertical: the north part changes its sign in the body; north over vertical must be 1 / tan(latitude)",
    };
    Linear {
        card: words
            .card(
                "gyr.earth_rate".to_string(),
                Stage::Input,
                parameters(&["north", "vertical"], "rad/s", 7.3e-5),
            )
            .with(Traits {
                reach: Reach::Reference,
                ..Traits::default()
            }),
        sensor: [Sensor::Gyr],
        needs: Needs::Sensor,
        fill,
    }
}
