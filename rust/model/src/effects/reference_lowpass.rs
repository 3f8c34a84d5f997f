//! The reference was smoothed or interpolated, and has lost fast motion.

use super::Words;
use super::reference::wrong;
use crate::card::{Card, Reach, ReferencePart, Stage, parameters};
use crate::effect::{Columns, Effect, EffectError, Rows, Sign};
use crate::facts::LogFacts;
use crate::ideal::ReferenceChange;
use crate::sensor::Sensor;

/// `ref.lowpass`: the reference is an average over times around its own, symmetric and of variance 2 c.
pub struct Lowpass {
    card: Card,
}

/// Least degree of a polynomial that has the third derivative of an attitude and the fourth of a position.
const LEAST_DEGREE: usize = 4;

/// `ref.lowpass`.
pub fn lowpass() -> Lowpass {
    let words = Words {
        name: "smoothed reference",
        physics: "the reference was low-passed, averaged over an exposure or interpolated between sparse poses: fast motion is lost, without a delay",
        formula: "-c d2x/dt2 to first order, one c for all: on gyr -c (dalpha/dt + omega x alpha), on mag c alpha x m, on acc c alpha x f - c R^T d4p/dt4",
        signature: "the residual of every sensor is opposite to the second derivative of its reading: the sensor shows more fast motion than the reference",
        mistaken_for: "gyr.scale and acc.scale if all motion has one frequency, gyr.cubic if only fast turns are large, acc.lever_arm",
        confirm: "repeat the motion at half the speed: the lost part of the rates must fall to a quarter, which a scale error does not",
    };
    Lowpass {
        card: words
            .card(
                "ref.lowpass".to_string(),
                Stage::Reference,
                // A low-pass of first order and 16 Hz, forwards and backwards: c = 1 / (2 pi f)^2; one of 6 Hz has 7e-4. Straight lines between
                // poses h apart average to c = h^2 / 12: 28 poses a second; ten a second have 8e-4.
                parameters(&["c"], "s^2", 1e-4),
            )
            .with(wrong(ReferencePart::Bandwidth, Reach::Neighbours)),
    }
}

impl Effect for Lowpass {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &Sensor::ALL
    }

    fn not_testable(&self, facts: &LogFacts) -> Option<String> {
        let coarse = [Some(facts.attitude_bends), facts.position_bends]
            .iter()
            .flatten()
            .any(|width| width.degree < LEAST_DEGREE);
        coarse.then(|| "the reference is too coarse to show changes of its accelerations".to_string())
    }

    fn columns(&self, rows: &Rows, sensor: Sensor, _: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        // With R = R_ref exp(-c [alpha]) the attitude turns by -alpha per unit of c, whatever c: d omega = -dalpha/dt - omega x alpha, and a
        // vector fixed in the reference frame changes by alpha x itself.
        let ideal = rows.ideal;
        for axis in 0..3 {
            out.column(0, axis);
        }
        for row in 0..rows.len() {
            let alpha = ideal.alpha.row(row);
            let change = match sensor {
                Sensor::Gyr => -ideal.alpha_rate.row(row) - ideal.omega.row(row).cross(&alpha),
                Sensor::Acc => alpha.cross(&ideal.f.row(row)) - ideal.snap.row(row),
                Sensor::Mag => alpha.cross(&ideal.m.row(row)),
            };
            for axis in 0..3 {
                out.column(0, axis)[row] = change[axis];
            }
        }
        Ok(())
    }

    fn sign(&self) -> Sign {
        Sign::Positive
    }

    fn reference_change(&self, parameters: &[f64]) -> ReferenceChange {
        ReferenceChange {
            smoothing: parameters[0],
            ..ReferenceChange::default()
        }
    }
}
