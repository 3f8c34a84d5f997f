//! Coarse steps of a converter: what is left between them follows the reading, and is no noise.

use std::f64::consts::{PI, TAU};

use super::{OF_THE_ROW, Words};
use crate::card::{Card, Found, Parameter, Scope, Stage, Traits};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::sensor::Sensor;

/// Harmonics of the sawtooth; noise of a tenth of a step leaves no more of it.
const HARMONICS: usize = 3;
/// With it the weak prior of a parameter (a hundredth of the weight of three times its typical size) has a spread of one: the amplitude
/// that the sawtooth has without noise.
const TYPICAL: f64 = 1.0 / 30.0;

/// What rounding leaves of the readings of one sensor, fitted along without a name wherever its steps are coarse against the noise.
///
/// Less the reading itself, a rounded one is a sawtooth of it, whose harmonics noise weakens (Widrow and Kollar 2008, Quantization noise,
/// ch. 4 and 5): `sum_k a_k q / (pi k) sin(2 pi k x / q + phi_k)`, with the phases open, since zeros shift it against the steps.
pub struct Rounding {
    card: Card,
    sensor: [Sensor; 1],
}

/// `acc.rounding`, `gyr.rounding`, `mag.rounding`.
pub fn rounding(sensor: Sensor) -> Rounding {
    let words = Words {
        name: "coarse steps",
        physics: "the steps of the converter are larger than the noise, which then does not average them out",
        formula: "harmonics of a sawtooth over x with the step as its period",
        signature: "a residual that is periodic in the reading, with the step as its period",
        mistaken_for: "a bias or a scale that is smaller than a step, in a sensor that hardly moves",
        confirm: "let the sensor lie still: the readings stand on one or two values",
    };
    let names = (1..=HARMONICS).flat_map(|k| ["sin", "cos"].map(|f| (k, f)));
    let parameters = names
        .flat_map(|(k, f)| ["x", "y", "z"].map(|axis| format!("{f}{k}{axis}")))
        .map(|name| Parameter {
            name,
            unit: "1".to_string(),
            typical: Some(TYPICAL),
            found: Found::Steps,
        });
    Rounding {
        card: words
            .card(
                format!("{}.rounding", sensor.prefix()),
                Stage::Rounding,
                parameters.collect(),
            )
            .with(Traits {
                scope: Scope::Log,
                ..OF_THE_ROW
            }),
        sensor: [sensor],
    }
}

/// Step of each axis where it is coarse and the reading moves; a constant would be taken for the rounding of it, however large.
fn steps(facts: &LogFacts, sensor: Sensor) -> [Option<f64>; 3] {
    let s = sensor.index();
    std::array::from_fn(|axis| {
        let moves = facts.steps_crossed[s][axis] && !facts.silent_axes[s][axis];
        Some(facts.steps[s][axis]).filter(|step| *step > 0.0 && moves)
    })
}

impl Effect for Rounding {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &self.sensor
    }

    fn not_testable(&self, facts: &LogFacts) -> Option<String> {
        let sensor = self.sensor[0];
        let coarse = steps(facts, sensor).iter().any(Option::is_some);
        (!facts.sensors[sensor.index()] || !coarse)
            .then(|| format!("the steps of the {} are fine against its noise", sensor.name()))
    }

    fn fitted_along(&self, _: &LogFacts) -> bool {
        true
    }

    fn columns(&self, rows: &Rows, sensor: Sensor, _: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        for (axis, step) in steps(rows.facts, sensor).into_iter().enumerate() {
            let Some(step) = step else { continue };
            for k in 0..HARMONICS {
                let order = (k + 1) as f64;
                let size = step / (PI * order);
                let angle = |x: &f64| TAU * order * x / step;
                let x = rows.x.axis(axis).iter();
                out.set(6 * k + axis, axis, x.clone().map(|x| size * angle(x).sin()));
                out.set(6 * k + 3 + axis, axis, x.map(|x| size * angle(x).cos()));
            }
        }
        Ok(())
    }
}
