//! The reference field vector is off.

use nalgebra::Vector3;

use super::{Linear, Needs, Words};
use crate::card::{Reach, ReferencePart, Scope, Stage, Traits, VECTOR, parameters};
use crate::effect::{Columns, Rows};
use crate::sensor::Sensor;

fn fill(rows: &Rows, out: &mut Columns) {
    for parameter in 0..3 {
        for axis in 0..3 {
            out.column(parameter, axis);
        }
        for row in 0..rows.len() {
            let v = rows
                .attitude(row)
                .inverse_transform_vector(&Vector3::ith(parameter, 1.0));
            for axis in 0..3 {
                out.column(parameter, axis)[row] = v[axis];
            }
        }
    }
}

/// `mag.field_reference`.
pub fn field_reference() -> Linear {
    let words = Words {
        name: "wrong reference field",
        physics: "the field at the place of the recording differs from the assumed field: buildings, another location, an old field model",
        formula: "R^T dm",
        signature: "a field residual that is constant in the reference frame and rotates with the attitude in the body frame",
        mistaken_for: "mag.hard_iron if the attitude hardly changes, ref.alignment about the vertical",
        confirm: "measure the field with a second magnetometer at the same place",
    };
    Linear {
        card: words
            .card(
                "mag.field_reference".to_string(),
                Stage::Input,
                parameters(&VECTOR, "uT", 5.0),
            )
            .with(Traits {
                scope: Scope::Log,
                reach: Reach::Reference,
                affine: None,
                reference: Some(ReferencePart::Field),
            }),
        sensor: [Sensor::Mag],
        needs: Needs::Sensor,
        fill,
    }
}
