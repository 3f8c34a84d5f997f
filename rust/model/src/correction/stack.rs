//! Effects on one sensor and the reading that they make of the true quantity.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::UnitQuaternion;

use crate::card::Stage;
use crate::correction::dependence::{Dependence, quantity};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::ideal::Ideal;
use crate::sensor::Sensor;
use crate::triple::Triple;

/// An effect with its parameters and what it depends on.
pub struct Part {
    /// The effect.
    pub effect: Arc<dyn Effect>,
    /// Its parameters.
    pub parameters: Vec<f64>,
    /// What else it reads.
    pub dependence: Dependence,
}

impl Part {
    /// True if rows before a row decide what it adds there.
    pub fn looks_back(&self) -> bool {
        self.effect.memory() > 0.0
    }
}

/// What the effects on one sensor see of the others: values and time derivatives in every row of the log, where they ask for them.
#[derive(Default)]
pub struct Seen {
    /// Values by sensor.
    pub value: [Option<Triple>; 3],
    /// Time derivatives by sensor.
    pub rate: [Option<Triple>; 3],
}

impl Seen {
    /// The same as ideal readings of some rows; NaN for what nobody asked for.
    pub fn ideal(&self, rows: &Range<usize>, attitude: Option<&[UnitQuaternion<f64>]>) -> Ideal {
        let mut ideal = Ideal::default();
        let cut = |x: &Option<Triple>| {
            let nothing = || Triple(std::array::from_fn(|_| vec![f64::NAN; rows.len()]));
            x.as_ref().map_or_else(nothing, |x| x.part(rows))
        };
        for sensor in Sensor::ALL {
            let (value, rate) = quantity(&mut ideal, sensor);
            *value = cut(&self.value[sensor.index()]);
            *rate = cut(&self.rate[sensor.index()]);
        }
        ideal.attitude = attitude.map_or_else(
            || vec![UnitQuaternion::identity(); rows.len()],
            |q| q[rows.clone()].to_vec(),
        );
        ideal
    }
}

/// Some rows of a log with everything that effects read there.
pub struct Block<'a> {
    /// Constants of the log.
    pub facts: &'a LogFacts,
    /// Time, s (n).
    pub t: &'a [f64],
    /// Quantities of all sensors, as far as they are known.
    pub ideal: Ideal,
    /// Temperature less its mean, K (n).
    pub temperature: Option<&'a [f64]>,
    /// Power of the vibration, (m/s^2)^2 (n).
    pub vibration: Option<&'a [f64]>,
    /// Covariates (n each).
    pub covariates: Vec<Vec<f64>>,
    /// Room for columns.
    pub columns: Columns,
}

impl Block<'_> {
    /// What `sensor` reads if its true quantity is `x`, everything else being as it is.
    pub fn reading(&mut self, parts: &[&Part], sensor: Sensor, x: &Triple) -> Result<Triple, EffectError> {
        quantity(&mut self.ideal, sensor).0.clone_from(x);
        let mut x = x.clone();
        let mut after = Triple::default();
        for stage in [Stage::Input, Stage::Gain, Stage::Offset, Stage::Range] {
            let mut changed = false;
            for part in parts.iter().filter(|p| p.effect.card().stage == stage) {
                if !changed {
                    after.clone_from(&x);
                    changed = true;
                }
                self.columns.reset(self.t.len(), part.parameters.len());
                let rows = Rows {
                    facts: self.facts,
                    t: self.t,
                    ideal: &self.ideal,
                    // What the accelerometer reads is the force at the sensor.
                    force: &self.ideal.f,
                    x: &x,
                    temperature: self.temperature,
                    vibration: self.vibration,
                    covariates: &self.covariates,
                    position: &[],
                    history: 0,
                };
                if let Some(added) = part.effect.added(&rows, sensor, &part.parameters)? {
                    after.add(&added, 1.0);
                    continue;
                }
                part.effect
                    .columns(&rows, sensor, &part.parameters, &mut self.columns)?;
                self.columns.add_to(&part.parameters, &mut after);
            }
            if changed {
                std::mem::swap(&mut x, &mut after);
            }
        }
        Ok(x)
    }
}
