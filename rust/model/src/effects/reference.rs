//! The reference itself is off: turned against the sensor, or late.

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
        &Sensor::ALL
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
            Kind::Alignment => ReferenceChange {
                alignment: UnitQuaternion::from_scaled_axis(Vector3::new(parameters[0], parameters[1], parameters[2])),
                ..ReferenceChange::default()
            },
        }
    }
}
