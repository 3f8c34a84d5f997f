//! The reference itself is off: turned against the sensor, not level, late, or ever later, or its field is another.

use nalgebra::{UnitQuaternion, Vector3};

use super::Words;
use super::timing::{finer, trials};
use crate::card::{Card, Reach, ReferencePart, Scope, Stage, Traits, VECTOR, parameters};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::ideal::ReferenceChange;
use crate::rotation_rates::right_jacobian;
use crate::sensor::Sensor;
use crate::triple::Triple;

/// Which part of the reference is off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Alignment,
    Tilt,
    Delay,
    Skew,
    Field,
}

/// An effect of the reference on every sensor.
pub struct Reference {
    card: Card,
    kind: Kind,
}

/// Traits of an effect that says what is wrong with the reference.
pub(super) const fn wrong(part: ReferencePart, reach: Reach) -> Traits {
    Traits {
        scope: Scope::Sensor,
        reach,
        affine: None,
        reference: Some(part),
    }
}

/// `ref.alignment`: rotation vector phi with R_sensor = R_reference exp([phi]), hence x_sensor = exp(-[phi]) x.
pub fn alignment() -> Reference {
    let words = Words {
        name: "mount misalignment",
        physics: "the sensor is mounted at a small rotation against the body whose attitude the reference measures",
        formula: "exp(-[phi]) x - x, about x cross phi, on every sensor",
        signature: "every sensor shows the same small rotation between predicted and measured vectors",
        mistaken_for: "acc.misalignment, gyr.misalignment or mag.soft_iron, if only one sensor is used",
        confirm: "compare the rotation from gravity with the rotation from the rates: a mount gives the same for both",
    };
    Reference {
        card: words
            .card(
                "ref.alignment".to_string(),
                Stage::Reference,
                parameters(&VECTOR, "rad", 0.02),
            )
            .with(Traits {
                scope: Scope::Log,
                ..wrong(ReferencePart::Mount, Reach::Reference)
            }),
        kind: Kind::Alignment,
    }
}

/// `ref.tilt`: rotation vector (x, y, 0) in the reference frame with R = exp([tau]) R_reference.
pub fn tilt() -> Reference {
    let words = Words {
        name: "table out of level",
        physics: "the reference frame is not level: the table, the rig's base or the camera's axes are tilted against the vertical",
        formula: "R^T exp(-[tau]) (-g) + R^T g on acc, the same for the field on mag, tau horizontal",
        signature: "a residual that is constant in the reference frame and rotates with the attitude in the body frame, in acc and mag alike",
        mistaken_for: "acc.bias if the attitude hardly changes, mag.field_reference if only the magnetometer is used, ref.alignment on a rig with one axis",
        confirm: "turn the sensor by 180 deg about the vertical on the same table: a tilted table changes the sign in the body, a bias does not",
    };
    Reference {
        card: words
            .card(
                "ref.tilt".to_string(),
                Stage::Reference,
                parameters(&["x", "y"], "rad", 0.02),
            )
            .with(Traits {
                scope: Scope::Log,
                ..wrong(ReferencePart::Level, Reach::Reference)
            }),
        kind: Kind::Tilt,
    }
}

/// `mag.field_reference`. The value lies in the ideal readings, so that all that acts on these acts on the true field.
pub fn field() -> Reference {
    let words = Words {
        name: "wrong reference field",
        physics: "the field at the place of the recording differs from the assumed field: buildings, another location, an old field model",
        formula: "R^T dm",
        signature: "a field residual that is constant in the reference frame and rotates with the attitude in the body frame",
        mistaken_for: "mag.hard_iron if the attitude hardly changes, ref.alignment about the vertical",
        confirm: "measure the field with a second magnetometer at the same place",
    };
    Reference {
        card: words
            .card(
                "mag.field_reference".to_string(),
                Stage::Input,
                parameters(&VECTOR, "uT", 5.0),
            )
            .with(Traits {
                scope: Scope::Log,
                ..wrong(ReferencePart::Field, Reach::Reference)
            }),
        kind: Kind::Field,
    }
}

/// `ref.delay`: the reference recorded at t shows the truth of t - tau.
pub fn delay() -> Reference {
    let words = Words {
        name: "late reference",
        physics: "the reference reaches the log later than the sensors: transport, filtering or another clock",
        formula: "x(t + tau) - x(t) on every sensor, with x the ideal reading as recorded",
        signature: "the residual of every sensor is proportional to the time derivative of its reading",
        mistaken_for: "a delay or a lag of one sensor, if only that sensor sees motion; acc.lever_arm if rotations are harmonic",
        confirm: "knock the body: the step in the sensor and in the reference must come at the same time",
    };
    Reference {
        card: words
            .card(
                "ref.delay".to_string(),
                Stage::Reference,
                parameters(&["tau"], "s", 0.01),
            )
            .with(wrong(ReferencePart::Time, Reach::Neighbours)),
        kind: Kind::Delay,
    }
}

/// `ref.skew`: the truth of t is recorded in the reference at t + k (t - t0).
pub fn skew() -> Reference {
    let words = Words {
        name: "reference on another clock",
        physics: "two clocks of different rates stamp reference and sensors, so that the reference falls behind or gains",
        formula: "x(t + k (t - t0)) - x(t) on every sensor, with x the ideal reading as recorded",
        signature: "the residual of every sensor is proportional to the time derivative of its reading and to the time since the log began",
        mistaken_for: "ref.delay in a short log or if only one part of it moves, drifting biases, a delay that changes during warm-up",
        confirm: "knock the body at the beginning and at the end: the time from knock to knock must differ between sensors and reference",
    };
    Reference {
        card: words
            .card(
                "ref.skew".to_string(),
                Stage::Reference,
                // Two quartz crystals, each within 20 to 100 ppm of its frequency.
                parameters(&["k"], "1", 1e-4),
            )
            .with(wrong(ReferencePart::Time, Reach::Neighbours)),
        kind: Kind::Skew,
    }
}

impl Effect for Reference {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        match self.kind {
            Kind::Tilt => &[Sensor::Acc, Sensor::Mag],
            Kind::Field => &[Sensor::Mag],
            Kind::Alignment | Kind::Delay | Kind::Skew => &Sensor::ALL,
        }
    }

    fn not_testable(&self, facts: &LogFacts) -> Option<String> {
        let lacking = self.kind == Kind::Field && !facts.sensors[Sensor::Mag.index()];
        lacking.then(|| format!("the log has no {}", Sensor::Mag.name()))
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
            Kind::Skew => {
                // Rates are those of the sensors' clock, which the reference passes through 1 + k times as fast.
                let pace = 1.0 / (1.0 + parameters[0]);
                for axis in 0..3 {
                    let late = rate.axis(axis).iter().zip(rows.t);
                    out.set(0, axis, late.map(|(rate, t)| rate * (t - rows.facts.t_start) * pace));
                }
                match sensor {
                    Sensor::Gyr => {
                        for axis in 0..3 {
                            for (column, rate) in out.column(0, axis).iter_mut().zip(x.axis(axis)) {
                                *column += rate * pace;
                            }
                        }
                    }
                    Sensor::Acc => {
                        for row in 0..rows.len() {
                            let held = rows.attitude(row).inverse_transform_vector(&rows.facts.gravity);
                            for axis in 0..3 {
                                out.column(0, axis)[row] += 2.0 * pace * (x.axis(axis)[row] + held[axis]);
                            }
                        }
                    }
                    Sensor::Mag => {}
                }
            }
            Kind::Tilt => {
                // f = R_r^T (a - T^T g), m = R_r^T T^T m_ref with R_r the recorded attitude; T exp([J_r d]) makes
                // (T^T v) x J_r d of T^T v.
                let tau = Vector3::new(parameters[0], parameters[1], 0.0);
                let tilt = UnitQuaternion::from_scaled_axis(tau);
                let jacobian = right_jacobian(&tau);
                let v = match sensor {
                    Sensor::Mag => ideal.field,
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
            Kind::Field => {
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

    fn strongly_curved(&self) -> bool {
        matches!(self.kind, Kind::Delay | Kind::Skew)
    }

    fn tried_at_full_size(&self) -> bool {
        self.kind == Kind::Delay
    }

    fn search(&self, facts: &LogFacts, found: Option<(&[f64], usize)>) -> Vec<Vec<f64>> {
        let early = |tau: &f64| *tau != 0.0;
        let sizes = match (self.kind, found) {
            (Kind::Delay, None) => {
                let late = trials(facts, 1.0);
                let early = late.iter().copied().filter(early).map(|tau| -tau);
                early.chain(late.iter().copied()).collect()
            }
            (Kind::Delay, Some((at, round))) => finer(at[0], round),
            _ => Vec::new(),
        };
        sizes.into_iter().map(|tau| vec![tau]).collect()
    }

    fn reference_change(&self, parameters: &[f64]) -> ReferenceChange {
        match self.kind {
            Kind::Delay => ReferenceChange {
                delay: parameters[0],
                ..ReferenceChange::default()
            },
            Kind::Skew => ReferenceChange {
                skew: parameters[0],
                ..ReferenceChange::default()
            },
            Kind::Field => ReferenceChange {
                field: Vector3::from_column_slice(parameters),
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
