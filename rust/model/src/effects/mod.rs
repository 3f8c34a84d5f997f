//! One physical cause each. A new one is a file or function here and a line in [`crate::catalogue`].

pub mod bias;
pub mod covariate;
pub mod current;
pub mod drift;
pub mod earth_rate;
pub mod g_sensitivity;
pub mod iron;
pub mod lever_arm;
pub mod misalignment;
pub mod nonlinearity;
pub mod reference;
pub mod reference_lowpass;
pub mod rig;
pub mod rounding;
pub mod saturation;
pub mod scale;
pub mod temperature;
pub mod timing;
pub mod vibration;
pub mod warmup;

use crate::card::{Affine, Card, Parameter, Reach, Scope, Stage, Traits};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::sensor::Sensor;

/// Fills the columns of one sensor.
pub type Fill = fn(&Rows, &mut Columns);

/// What most effects need before they can be tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// Nothing but the sensor.
    Sensor,
    /// So many different readings of an ideal axis.
    Levels(usize),
    /// A thermometer.
    Temperature,
    /// A covariate of this name.
    Column(&'static str),
    /// Shaking that is not the same all the time; how large its effect may be depends on how the sensor is shaken.
    Shaking,
}

/// An effect on one sensor, linear in its parameters: a description and a function that fills its columns.
pub struct Linear {
    /// Description.
    pub card: Card,
    /// The sensor, as a slice of one.
    pub sensor: [Sensor; 1],
    /// What the log must have.
    pub needs: Needs,
    /// Fills the columns.
    pub fill: Fill,
}

impl Effect for Linear {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &self.sensor
    }

    fn size_is_open(&self) -> bool {
        self.needs == Needs::Shaking
    }

    fn least_levels(&self) -> usize {
        match self.needs {
            Needs::Levels(least) => least,
            _ => 0,
        }
    }

    fn not_testable(&self, facts: &LogFacts) -> Option<String> {
        if !facts.sensors[self.sensor[0].index()] {
            return Some(format!("the log has no {}", self.sensor[0].name()));
        }
        if self.needs == Needs::Shaking && !facts.sensors[Sensor::Acc.index()] {
            return Some("the log has no accelerometer, which would show the vibration".to_string());
        }
        if self.needs == Needs::Shaking && !facts.shaking_varies {
            return Some("the vibration is constant or absent".to_string());
        }
        let lacking = match self.needs {
            Needs::Sensor | Needs::Levels(_) | Needs::Shaking => None,
            Needs::Temperature => (!facts.has_temperature).then_some("temp"),
            Needs::Column(name) => facts.covariate(name).is_none().then_some(name),
        };
        lacking.map(|column| format!("the log has no column {column}"))
    }

    fn column(&self) -> Option<&str> {
        match self.needs {
            Needs::Sensor | Needs::Levels(_) | Needs::Shaking => None,
            Needs::Temperature => Some("temp"),
            Needs::Column(name) => Some(name),
        }
    }

    fn centred_columns(&self) -> Vec<String> {
        let temperature = self.needs == Needs::Temperature;
        temperature.then(|| "temp".to_string()).into_iter().collect()
    }

    fn columns(&self, rows: &Rows, _: Sensor, _: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        (self.fill)(rows, out);
        Ok(())
    }
}

/// Words of a card, in the order physics, formula, signature, mistaken for, confirm.
pub struct Words<'a> {
    /// What it is called.
    pub name: &'a str,
    /// Physical cause.
    pub physics: &'a str,
    /// What it adds.
    pub formula: &'a str,
    /// What it looks like.
    pub signature: &'a str,
    /// Rivals.
    pub mistaken_for: &'a str,
    /// Experiment.
    pub confirm: &'a str,
}

impl Words<'_> {
    /// The card with these words.
    pub fn card(&self, id: String, stage: Stage, parameters: Vec<Parameter>) -> Card {
        Card {
            id,
            stage,
            traits: Traits::default(),
            parameters,
            name: self.name.to_string(),
            physics: self.physics.to_string(),
            formula: self.formula.to_string(),
            signature: self.signature.to_string(),
            mistaken_for: self.mistaken_for.to_string(),
            confirm: self.confirm.to_string(),
            shares: 1.0,
        }
    }
}

/// Traits of an effect that depends on nothing but the row.
pub(crate) const OF_THE_ROW: Traits = Traits {
    scope: Scope::Sensor,
    reach: Reach::Row,
    affine: None,
    reference: None,
};

/// Traits of a part of a gain or an offset.
pub(crate) const fn affine(part: Affine) -> Traits {
    Traits {
        affine: Some(part),
        ..OF_THE_ROW
    }
}

/// Fills a full 3x3 matrix effect: parameter (row, column) multiplies `x[column]` on axis `row`.
pub(crate) fn matrix(x: &crate::triple::Triple, out: &mut Columns) {
    for row in 0..3 {
        for column in 0..3 {
            out.set(3 * row + column, row, x.axis(column).iter().copied());
        }
    }
}
