//! A one-axis rig does not go where it is told to: play in its drive, bending under load, eccentric gears.
//!
//! Each is an error `delta` of the angle about the rig's axis u, seen by every sensor:
//! `R = R_reference exp(u delta)`, hence `f x u delta`, `m x u delta` and `omega x u delta + u d(delta)/dt`.

use super::Words;
use super::reference::wrong;
use crate::card::{Card, Found, Parameter, Reach, ReferencePart, Stage, parameters};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::ideal::ReferenceChange;
use crate::rig::{Play, Rig, RigError};
use crate::sensor::Sensor;

/// What is wrong with the rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Backlash,
    Flexure,
    Periodic,
}

/// An effect of the rig on every sensor.
pub struct RigEffect {
    card: Card,
    kind: Kind,
}

/// `rig.backlash`: half the width behind the drive, on the side it comes from.
pub fn backlash() -> RigEffect {
    let words = Words {
        name: "backlash of the drive",
        physics: "the drive has backlash: after a reversal the axis stands still until the drive has crossed the gap",
        formula: "angle error -(w/2) sign(direction of travel) about rig_axis, with memory",
        signature: "at the same commanded angle the residual has opposite signs on the way up and on the way down, and keeps its sign at rest",
        mistaken_for: "ref.delay, which vanishes at rest; a bias, if every position is approached from the same side",
        confirm: "approach the same angle from below and from above and rest there: the readings differ by the width",
    };
    RigEffect {
        card: words
            .card(
                "rig.backlash".to_string(),
                Stage::Reference,
                parameters(&["width"], "rad", 5e-3),
            )
            .with(wrong(ReferencePart::Drive, Reach::History)),
        kind: Kind::Backlash,
    }
}

/// `rig.flexure`.
pub fn flexure() -> RigEffect {
    let words = Words {
        name: "flexure of the axis",
        physics: "the axis or its table bends under its own weight, most at angles with a horizontal lever arm of the load",
        formula: "angle error k sin(angle) about rig_axis",
        signature: "a residual that grows with the sine of the commanded angle, as a rotation common to all sensors",
        mistaken_for: "rig.periodic with a long period, acc.scale or acc.misalignment if only the accelerometer is used",
        confirm: "repeat with the table unloaded, or with a counterweight: flexure follows the load",
    };
    RigEffect {
        card: words
            .card(
                "rig.flexure".to_string(),
                Stage::Reference,
                parameters(&["k"], "rad", 5e-3),
            )
            .with(wrong(ReferencePart::Drive, Reach::Reference)),
        kind: Kind::Flexure,
    }
}

/// `rig.periodic`.
pub fn periodic() -> RigEffect {
    let words = Words {
        name: "periodic error of the drive",
        physics: "the error of an eccentric gear or of a worm's pitch repeats with every turn of the wheel, N times in a turn of the axis",
        formula: "angle error a cos(N angle) + b sin(N angle) about rig_axis",
        signature: "a residual that is periodic in the commanded angle, the same at every speed and in both directions",
        mistaken_for: "a vibration, if the axis always moves at the same speed",
        confirm: "move at two speeds: the error keeps its period in angle, a vibration keeps its period in time",
    };
    let mut list = parameters(&["a", "b"], "rad", 2e-3);
    list.push(Parameter {
        name: "N".to_string(),
        unit: "1".to_string(),
        typical: None,
        found: Found::Search,
    });
    RigEffect {
        card: words
            .card("rig.periodic".to_string(), Stage::Reference, list)
            .with(wrong(ReferencePart::Drive, Reach::Reference)),
        kind: Kind::Periodic,
    }
}

/// Periods in a turn that are tried: below, a wave is a flexure or a tilt.
const ORDERS: std::ops::RangeInclusive<u32> = 2..=64;
/// The travel must hold this part of a period.
const LEAST_PERIODS: f64 = 1.5;
/// Widths tried at first, rad, in equal ratios.
const WIDTHS: (f64, f64, u32) = (5e-5, 0.1, 18);
/// Rounds in which the grid of widths is narrowed, and its number of steps to each side.
const ROUNDS: usize = 3;
const STEPS: i32 = 8;

/// Range of the commanded angle, rad.
fn travel(rig: &Rig) -> f64 {
    let angles = || rig.knots.iter().map(|k| k.angle);
    angles().fold(f64::NEG_INFINITY, f64::max) - angles().fold(f64::INFINITY, f64::min)
}

/// Fills the columns of `P` parameters from d delta / dp and d (d delta / dt) / dp of each row.
fn turned<const P: usize>(rows: &Rows, sensor: Sensor, out: &mut Columns, slopes: impl Iterator<Item = [[f64; 2]; P]>) {
    let ideal = rows.ideal;
    let (u, x) = (ideal.rig_axis, ideal.quantity(sensor));
    let slopes: Vec<_> = slopes.collect();
    for axis in 0..3 {
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        let along = if sensor == Sensor::Gyr { u[axis] } else { 0.0 };
        let (xj, xk) = (x.axis(j), x.axis(k));
        for parameter in 0..P {
            let values = slopes.iter().zip(xj.iter().zip(xk)).map(|(slope, (a, b))| {
                let [angle, rate] = slope[parameter];
                (a * u[k] - b * u[j]) * angle + along * rate
            });
            out.set(parameter, axis, values);
        }
    }
}

/// Change of the error per rad of the play's width over the rows. The end of a crossing shifts with the width, which no slope can tell: the
/// rate has none.
fn play_slopes<'a>(rows: &'a Rows, width: f64) -> impl Iterator<Item = [[f64; 2]; 1]> + 'a {
    let command = &rows.ideal.command;
    let first = command.first().map_or(0.0, |c| c.t);
    let mut play = rows.facts.rig.as_ref().map(|rig| Play::new(rig, width, first));
    command.iter().map(move |c| match play.as_mut() {
        Some(play) if c.angle.is_finite() => [[play.at(c.t, c.angle).slope, 0.0]],
        _ => [[f64::NAN; 2]],
    })
}

impl Effect for RigEffect {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &Sensor::ALL
    }

    fn not_testable(&self, facts: &LogFacts) -> Option<String> {
        let Some(rig) = &facts.rig else {
            return Some("the log names no rig_axis".to_string());
        };
        match self.kind {
            Kind::Backlash if rig.knots.len() < 3 => Some("the rig never reverses".to_string()),
            Kind::Periodic if self.search(facts, None).is_empty() => Some("the rig hardly travels".to_string()),
            _ => None,
        }
    }

    fn columns(&self, rows: &Rows, sensor: Sensor, parameters: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        let command = &rows.ideal.command;
        match self.kind {
            Kind::Backlash => turned(rows, sensor, out, play_slopes(rows, parameters[0])),
            Kind::Flexure => {
                let slopes = command.iter().map(|c| {
                    let (sin, cos) = c.angle.sin_cos();
                    [[sin, cos * c.rate]]
                });
                turned(rows, sensor, out, slopes);
            }
            Kind::Periodic => {
                let n = parameters[2];
                if n == 0.0 {
                    return Ok(());
                }
                let slopes = command.iter().map(|c| {
                    let (sin, cos) = (n * c.angle).sin_cos();
                    [[cos, -n * sin * c.rate], [sin, n * cos * c.rate]]
                });
                turned(rows, sensor, out, slopes);
            }
        }
        Ok(())
    }

    fn tried_at_full_size(&self) -> bool {
        self.kind == Kind::Backlash
    }

    fn jumps(&self) -> bool {
        self.kind == Kind::Backlash
    }

    fn strongly_curved(&self) -> bool {
        self.kind == Kind::Backlash
    }

    fn search(&self, facts: &LogFacts, found: Option<(&[f64], usize)>) -> Vec<Vec<f64>> {
        let Some(rig) = &facts.rig else { return Vec::new() };
        let reach = travel(rig);
        match (self.kind, found) {
            (Kind::Backlash, None) => {
                let (low, high, count) = WIDTHS;
                let ratio = (high / low).powf(1.0 / f64::from(count));
                let widths = (0..=count).map(|k| low * ratio.powf(f64::from(k)));
                widths
                    .filter(|w| *w < reach)
                    .flat_map(|w| [vec![w], vec![-w]])
                    .collect()
            }
            (Kind::Backlash, Some((&[at], round))) if round < ROUNDS => {
                let (low, high, count) = WIDTHS;
                let ratio = (high / low).powf(1.0 / f64::from(count));
                let step = at.abs() * (ratio - 1.0) / f64::from(STEPS).powi(i32::try_from(round + 1).unwrap_or(1));
                (-STEPS..=STEPS).map(|k| vec![at + f64::from(k) * step]).collect()
            }
            (Kind::Periodic, None) => ORDERS
                .map(f64::from)
                .filter(|n| n * reach >= LEAST_PERIODS * std::f64::consts::TAU)
                .map(|n| vec![0.0, 0.0, n])
                .collect(),
            _ => Vec::new(),
        }
    }

    fn reference_change(&self, parameters: &[f64]) -> ReferenceChange {
        let rig = match self.kind {
            Kind::Backlash => RigError {
                width: parameters[0],
                ..RigError::default()
            },
            Kind::Flexure => RigError {
                flexure: parameters[0],
                ..RigError::default()
            },
            Kind::Periodic => RigError {
                periodic: [parameters[0], parameters[1], parameters[2]],
                ..RigError::default()
            },
        };
        ReferenceChange {
            rig,
            ..ReferenceChange::default()
        }
    }
}
