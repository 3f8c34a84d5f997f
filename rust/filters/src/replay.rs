//! Any filter over the rows of a log, with the rules of [`intake`](crate::intake) around it.
//!
//! The output is causal and depends only on the rows and the state: cut anywhere, hand the state over, and the result
//! is the same bit by bit.

use imufit_attitude::Quaternion;

use crate::catalogue::Description;
use crate::columns::{Columns, Row};
use crate::intake::{Intake, Rows};
use crate::memory::Memory;
use crate::{Environment, FilterError, Rules, Skipped, Start};

/// A filter with the rules around it: the same object serves a whole log, pieces of one, and a running device.
pub struct Replay {
    description: &'static Description,
    filter: Box<dyn Rows>,
    intake: Intake,
}

impl Replay {
    /// The filter of that description with settings by name.
    pub fn new(
        description: &'static Description,
        settings: &[(String, f64)],
        environment: Environment,
        rules: Rules,
        start: Start,
    ) -> Result<Self, FilterError> {
        let mut filter = description.build(&environment, settings)?;
        filter.find_itself(rules.recovery);
        Ok(Self {
            description,
            filter,
            intake: Intake::new(environment, rules, start),
        })
    }

    /// The filter's name.
    pub fn name(&self) -> &'static str {
        self.description.name
    }

    /// Back to before the first row.
    pub fn reset(&mut self) {
        self.filter.reset(Quaternion::IDENTITY);
        self.intake.memory = Memory::EMPTY;
    }

    /// All that the next row's attitude depends on, to be handed to another replay with the same settings.
    pub fn state(&self) -> Vec<f64> {
        let mut state = self.intake.memory.to_array().to_vec();
        state.extend(self.filter.state());
        state
    }

    /// Takes over what [`Replay::state`] gave.
    pub fn set_state(&mut self, state: &[f64]) -> Result<(), FilterError> {
        let expected = Memory::LENGTH + self.filter.state().len();
        let error = FilterError::State {
            filter: self.description.name,
            came: state.len(),
            expected,
        };
        let Some((own, of_filter)) = state.split_at_checked(Memory::LENGTH) else {
            return Err(error);
        };
        let Some(memory) = Memory::from_slice(own) else {
            return Err(error);
        };
        if !self.filter.set_state(of_filter) {
            return Err(error);
        }
        self.intake.memory = memory;
        Ok(())
    }

    /// Fills `attitude`, four values `w x y z` for each row of `columns`; NaN before the start.
    pub fn run(&mut self, columns: &Columns<'_>, attitude: &mut [f64]) -> Result<Skipped, FilterError> {
        columns.check()?;
        self.description.check_sensors(|sensor| columns.has(sensor))?;
        let (came, expected) = (attitude.len() / 4, columns.t.len());
        if attitude.len() != 4 * expected {
            return Err(FilterError::Length {
                name: "attitude",
                came,
                expected,
            });
        }
        let mut skipped = Skipped::default();
        self.filter.rows(&mut self.intake, columns, attitude, &mut skipped);
        Ok(skipped)
    }

    /// The attitude `w x y z` after one more row, NaN before the start: what [`Replay::run`] does row by row.
    pub fn step(&mut self, row: &Row) -> Result<([f64; 4], Skipped), FilterError> {
        self.description.check_sensors(|sensor| row.has(sensor))?;
        let (mut attitude, mut skipped) = ([f64::NAN; 4], Skipped::default());
        self.intake
            .advance(self.filter.as_mut(), row, &mut attitude, &mut skipped);
        Ok((attitude, skipped))
    }
}
