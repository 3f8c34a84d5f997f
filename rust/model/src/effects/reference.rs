//! The reference itself is off: turned against the sensor, not level, or late.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::Words;
use crate::card::{Card, Stage, VECTOR, parameters};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::ideal::ReferenceChange;
use crate::sensor::Sensor;
use crate::triple::Triple;

/// Which part of the reference is off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Alignment,
    Tilt,
    Delay,
}

/// An effect of the reference on every sensor.
pub struct Reference {
    card: Card,
    kind: Kind,
}

/// `ref.alignment`: rotation vector phi with R_sensor = R_reference exp([phi]), hence x_sensor = exp(-[phi]) x.
pub fn alignment() -> Reference {
    let words = Words {
        name: "mount misalignment",
        physics: "the sensor is mounted slightly turned against the body whose attitude the reference gives",
        formula: "exp(-[phi]) x - x, about x cross phi, on every sensor",
        signature: "every sensor shows the same small rotation between predicted and measured vectors",
        mistaken_for: "acc.misalignment, gyr.misalignment or mag.soft_iron, if only one sensor is looked at",
        confirm: "compare the rotation found from gravity with the one found from turning: a mount gives the same for both",
    };
    Reference {
        card: words.card(
            "ref.alignment".to_string(),
            Stage::Reference,
            parameters(&VECTOR, "rad", 0.02),
        ),
        kind: Kind::Alignment,
    }
}

/// `ref.tilt`: rotation vector (x, y, 0) in the reference frame with R = exp([tau]) R_reference.
pub fn tilt() -> Reference {
    let words = Words {
        name: "table that is not level",
        physics: "the reference frame is not level: the table, the rig's base or the camera's axes lean against the vertical",
        formula: "R^T exp(-[tau]) (-g) + R^T g on acc, the same for the field on mag, tau horizontal",
        signature: "a residual that is constant in the reference frame and turns with the attitude in the body frame, in acc and mag alike",
        mistaken_for: "acc.bias when the attitude hardly changes, mag.field_reference if only the magnetometer is looked at, ref.alignment on a rig with one axis",
        confirm: "turn the sensor by 180 deg about the vertical on the same table: a leaning table changes the sign in the body, a bias does not",
    };
    Reference {
        card: words.card(
            "ref.tilt".to_string(),
            Stage::Reference,
            parameters(&["x", "y"], "rad", 0.02),
        ),
        kind: Kind::Tilt,
    }
}

/// `ref.delay`: the reference recorded at t shows the truth of t - tau.
pub fn delay() -> Reference {
    let words = Words {
        name: "late reference",
        physics: "the reference reaches the log later than the sensors: transport, filtering or another clock",
        formula: "x(t + tau) - x(t) on every sensor, with x the ideal reading as recorded",
        signature: "the residual of every sensor is proportional to the time derivative of its reading",
        mistaken_for: "a delay or a lag of one sensor, if only that one moves; acc.lever_arm when rotations are harmonic",
        confirm: "knock the body: the step in the sensor and in the reference must come at the same time",
    };
    Reference {
        card: words.card(
            "ref.delay".to_string(),
            Stage::Reference,
            parameters(&["tau"], "s", 0.01),
        ),
        kind: Kind::Delay,
    }
}

/// Right Jacobian of SO(3).
fn right_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    let cross = phi.cross_matrix();
    let (a, b) = if angle < 1e-4 {
        (0.5 - angle * angle / 24.0, 1.0 / 6.0 - angle * angle / 120.0)
    } else {
        (
            (1.0 - angle.cos()) / angle.powi(2),
            (angle - angle.sin()) / angle.powi(3),
        )
    };
    Matrix3::identity() - cross * a + cross * cross * b
}

impl Effect for Reference {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        match self.kind {
            Kind::Tilt => &[Sensor::Acc, Sensor::Mag],
            Kind::Alignment | Kind::Delay => &Sensor::ALL,
        }
    }

    fn not_testable(&self, _: &LogFacts) -> Option<String> {
        None
    }

    fn columns(&self, rows: &Rows, sensor: Sensor, parameters: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        let ideal = rows.ideal;
        let (x, rate): (&Triple, &Triple) = match sensor {
            Sensor::Acc => (&ideal.f, &ideal.f_rate),
            Sensor::Gyr => (&ideal.omega, &ideal.alpha),
            Sensor::Mag => (&ideal.m, &ideal.m_rate),
        };
        match self.kind {
            Kind::Delay => {
                for axis in 0..3 {
                    out.set(0, axis, rate.axis(axis).iter().copied());
                }
            }
            Kind::Tilt => {
                // f = R_r^T (a - T^T g), m = R_r^T T^T m_ref with R_r the recorded attitude; T exp([J_r d]) makes
                // (T^T v) x J_r d of T^T v.
                let tau = Vector3::new(parameters[0], parameters[1], 0.0);
                let tilt = UnitQuaternion::from_scaled_axis(tau);
                let jacobian = right_jacobian(&tau);
                let v = match sensor {
                    Sensor::Mag => rows.facts.field,
                    Sensor::Acc | Sensor::Gyr => -rows.facts.gravity,
                };
                let level = tilt.inverse_transform_vector(&v);
                for parameter in 0..2 {
                    let change = level.cross(&jacobian.column(parameter).into_owned());
                    for axis in 0..3 {
                        out.column(parameter, axis);
                    }
                    for row in 0..rows.len() {
                        let recorded = tilt.inverse() * rows.attitude(row);
                        // Where the reference is not known the ideal reading is NaN, and so is the column.
                        let known = x.axis(0)[row] * 0.0;
                        let column = recorded.inverse_transform_vector(&change);
                        for axis in 0..3 {
                            out.column(parameter, axis)[row] = column[axis] + known;
                        }
                    }
                }
            }
            Kind::Alignment => {
                // R exp([phi + d]) = R exp([phi]) exp([J_r d]), so that x changes by -(J_r d) x x = [x] J_r d.
                let jacobian = right_jacobian(&Vector3::new(parameters[0], parameters[1], parameters[2]));
                for parameter in 0..3 {
                    let turn: Vector3<f64> = jacobian.column(parameter).into();
                    for axis in 0..3 {
                        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
                        let (xj, xk) = (x.axis(j), x.axis(k));
                        out.set(
                            parameter,
                            axis,
                            xj.iter().zip(xk).map(|(a, b)| a * turn[k] - b * turn[j]),
                        );
                    }
                }
            }
        }
        Ok(())
    }

    fn reference_change(&self, parameters: &[f64]) -> ReferenceChange {
        match self.kind {
            Kind::Delay => ReferenceChange {
                delay: parameters[0],
                ..ReferenceChange::default()
            },
            Kind::Tilt => ReferenceChange {
                tilt: UnitQuaternion::from_scaled_axis(Vector3::new(parameters[0], parameters[1], 0.0)),
                ..ReferenceChange::default()
            },
            Kind::Alignment => ReferenceChange {
                alignment: UnitQuaternion::from_scaled_axis(Vector3::new(parameters[0], parameters[1], parameters[2])),
                ..ReferenceChange::default()
            },
        }
    }
}
