//! THE list of filters.

use crate::intake::Rows;
use crate::lost::Watched;
use crate::parameter::{Parameter, fill};
use crate::{Environment, FilterError, Sensor};
use crate::{accel, complementary, gyro, hybrid, kalman, madgwick, mahony, mekf, quest, triad};

type Make = fn(&Environment, &[f64]) -> Box<dyn Rows>;

/// A filter by name.
#[derive(Debug, Clone, Copy)]
pub struct Description {
    /// Name in commands, JSON and columns.
    pub name: &'static str,
    /// One sentence.
    pub summary: &'static str,
    /// Sensors without which it says nothing.
    pub needs: &'static [Sensor],
    /// Its settings.
    pub parameters: &'static [Parameter],
    make: Make,
}

/// The filters there are.
pub const FILTERS: [Description; 10] = [
    Description {
        name: "accel",
        summary: "Inclination from the specific force alone, row by row; the heading stays where it started.",
        needs: &[Sensor::Acc],
        parameters: accel::PARAMETERS,
        make: |environment, _| Box::new(accel::Accel::new(environment)),
    },
    Description {
        name: "gyro",
        summary: "The angular rate integrated from the initial attitude; exact for a constant rate, and it drifts.",
        needs: &[Sensor::Gyr],
        parameters: gyro::PARAMETERS,
        make: |_, _| Box::new(gyro::Gyro::default()),
    },
    Description {
        name: "complementary",
        summary: "The integrated rate pulled a little towards the accelerometer's inclination at each step.",
        needs: &[Sensor::Gyr, Sensor::Acc],
        parameters: complementary::PARAMETERS,
        make: |environment, values| {
            Box::new(Watched::new(
                environment,
                complementary::Complementary::new(environment, values),
            ))
        },
    },
    Description {
        name: "kalman",
        summary: "A Kalman filter of attitude and gyro bias with the accelerometer's inclination as its measurement.",
        needs: &[Sensor::Gyr, Sensor::Acc],
        parameters: kalman::PARAMETERS,
        make: |environment, values| Box::new(Watched::new(environment, kalman::Kalman::new(environment, values))),
    },
    Description {
        name: "triad",
        summary: "Attitude from two vectors, specific force first and magnetic field second, row by row.",
        needs: &[Sensor::Acc, Sensor::Mag],
        parameters: triad::PARAMETERS,
        make: |environment, values| Box::new(triad::Triad::new(environment, values)),
    },
    Description {
        name: "mahony",
        summary: "Mahony's nonlinear complementary filter with gyro bias, with or without a magnetometer.",
        needs: &[Sensor::Gyr, Sensor::Acc],
        parameters: mahony::PARAMETERS,
        make: |environment, values| Box::new(Watched::new(environment, mahony::Mahony::new(environment, values))),
    },
    Description {
        name: "madgwick",
        summary: "Madgwick's gradient descent with the rate integrated, with or without a magnetometer.",
        needs: &[Sensor::Gyr, Sensor::Acc],
        parameters: madgwick::PARAMETERS,
        make: |environment, values| Box::new(Watched::new(environment, madgwick::Madgwick::new(environment, values))),
    },
    Description {
        name: "quest",
        summary: "Attitude from two weighted vectors, the most probable one, row by row.",
        needs: &[Sensor::Acc, Sensor::Mag],
        parameters: quest::PARAMETERS,
        make: |environment, values| Box::new(quest::Quest::new(environment, values)),
    },
    Description {
        name: "hybrid",
        summary: "Mahony's filter driven (or, with driven = 0, started) by the attitude that TRIAD finds.",
        needs: &[Sensor::Gyr, Sensor::Acc, Sensor::Mag],
        parameters: hybrid::PARAMETERS,
        make: |environment, values| Box::new(Watched::new(environment, hybrid::Hybrid::new(environment, values))),
    },
    Description {
        name: "mekf",
        summary: "A multiplicative extended Kalman filter that knows disturbances, with or without a magnetometer.",
        needs: &[Sensor::Gyr, Sensor::Acc],
        parameters: mekf::PARAMETERS,
        make: |environment, values| Box::new(Watched::new(environment, mekf::Mekf::new(environment, values))),
    },
];

/// The description of a filter.
pub fn find(name: &str) -> Result<&'static Description, FilterError> {
    FILTERS
        .iter()
        .find(|filter| filter.name == name)
        .ok_or_else(|| FilterError::UnknownFilter {
            name: name.to_owned(),
            known: FILTERS.map(|filter| filter.name).join(", "),
        })
}

impl Description {
    /// The filter with the settings given by name, the others at their defaults. Every setting is a number from 0 to
    /// 1e50.
    pub fn build(
        &'static self,
        environment: &Environment,
        settings: &[(String, f64)],
    ) -> Result<Box<dyn Rows>, FilterError> {
        let values = fill(self.name, self.parameters, settings)?;
        Ok((self.make)(environment, &values))
    }

    /// The first sensor that is needed and not there is an error.
    pub(crate) fn check_sensors(&self, present: impl Fn(Sensor) -> bool) -> Result<(), FilterError> {
        match self.needs.iter().find(|sensor| !present(**sensor)) {
            None => Ok(()),
            Some(sensor) => Err(FilterError::MissingSensor {
                filter: self.name,
                sensor: sensor.name(),
            }),
        }
    }
}
