//! The heading of the reference drifts.

use std::f64::consts::{PI, SQRT_2};

use super::words::nuisance;
use crate::card::{Card, Reach, ReferencePart, Scope, Stage, Traits};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::sensor::Sensor;

/// Parts: offset, drift, and cosines of one to eight half periods in a log.
const PARTS: usize = 10;

/// Noise of an attitude that was integrated from rates: its heading drifts and walks, and nothing but a field holds it.
///
/// Fitted beside everything, with coefficients that are normal about zero and as large as the log says. An offset and a drift over the
/// log, and the first parts of a random walk about its mean (Karhunen and Loeve's expansion: cosines of k half periods, sqrt(2) / (pi k)
/// large).
pub struct Heading {
    card: Card,
}

impl Heading {
    /// The effect.
    pub fn new() -> Self {
        Self {
            card: nuisance(
                "the heading of the reference drifts",
                "heading of the reference",
                "random walk",
                Stage::Input,
                Traits {
                    scope: Scope::Log,
                    reach: Reach::Reference,
                    affine: None,
                    reference: Some(ReferencePart::Heading),
                },
                (PARTS, "rad"),
            ),
        }
    }
}

/// Heading and its rate for a unit coefficient at this part of a log of so many seconds.
fn course(k: usize, part: f64, seconds: f64) -> (f64, f64) {
    match k {
        0 => return (1.0, 0.0),
        1 => return (part - 0.5, 1.0 / seconds),
        _ => (),
    }
    let turns = PI * (k - 1) as f64;
    let angle = turns * part;
    (SQRT_2 / turns * angle.cos(), -SQRT_2 / seconds * angle.sin())
}

impl Effect for Heading {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &Sensor::ALL
    }

    fn not_testable(&self, _: &LogFacts) -> Option<String> {
        None
    }

    fn columns(&self, rows: &Rows, sensor: Sensor, _: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        // Without translation nothing but gravity is measured, which does not depend on the heading.
        if sensor == Sensor::Acc && rows.facts.position_smoothing.is_none() {
            return Ok(());
        }
        let seconds = rows.facts.t_end - rows.facts.t_start;
        let up = rows.facts.frame.up();
        for k in 0..PARTS {
            for axis in 0..3 {
                out.column(k, axis);
            }
        }
        for row in 0..rows.len() {
            let up = rows.attitude(row).inverse_transform_vector(&up);
            let ideal = rows.ideal;
            // With R = exp([heading up]) R_ref a vector that is fixed in the reference frame changes by x cross up.
            let change = match sensor {
                Sensor::Gyr => up,
                Sensor::Acc => ideal.f.row(row).cross(&up),
                Sensor::Mag => ideal.m.row(row).cross(&up),
            };
            let part = (rows.t[row] - rows.facts.t_start) / seconds;
            for k in 0..PARTS {
                let (heading, rate) = course(k, part, seconds);
                let size = if sensor == Sensor::Gyr { rate } else { heading };
                for axis in 0..3 {
                    out.column(k, axis)[row] = size * change[axis];
                }
            }
        }
        Ok(())
    }
}
