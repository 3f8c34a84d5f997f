//! The trait of all filters and THE list of them.

use imufit_attitude::{Quaternion, Real};
use nalgebra::{Matrix3, SimdBool};

use crate::intake::Intake;
use crate::lost::Watched;
use crate::{Columns, Environment, FilterError, Sample, Sensor, Skipped};
use crate::{accel, complementary, gyro, hybrid, kalman, mahony, mekf, quest, triad};

/// What a step could not use of the sample it was given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Usage {
    /// All that the filter looks at.
    Full,
    /// The field was too close to the vertical to show a heading.
    NoHeading,
}

/// An attitude filter: sample in, attitude out. It may rely on each reading being finite and each `dt` not negative.
///
/// With [`Lanes`](imufit_attitude::Lanes) for `T` several settings of one filter go through the same samples side by side.
pub trait Filter<T: Real = f64>: Send + Sync {
    /// Advances to the time of `sample`.
    fn step(&mut self, sample: &Sample) -> Usage;

    /// The attitude `q_nb` after the last step, unit within 1e-12.
    fn attitude(&self) -> Quaternion<T>;

    /// Covariance of the error of the attitude, reference frame, rad^2; `None` for a filter that keeps none.
    fn attitude_covariance(&self) -> Option<Matrix3<T>> {
        None
    }

    /// Whether it finds a lost attitude again, see [`crate::lost`](crate); a filter that holds on to nothing has none to lose.
    fn find_itself(&mut self, _on: bool) {}

    /// Starts over at `attitude`, everything learned forgotten.
    fn reset(&mut self, attitude: Quaternion);

    /// All that the next step depends on.
    fn state(&self) -> Vec<T>;

    /// Takes over what [`Filter::state`] gave; `false`, and nothing changed, where it does not fit.
    fn set_state(&mut self, state: &[T]) -> bool;

    /// All rows of `columns` one after the other, and the attitude after each of them, `w x y z`.
    ///
    /// A filter that can be cloned has a loop of its own with its step inside: [`all_rows`](crate::intake::all_rows).
    #[doc(hidden)]
    fn rows(&mut self, intake: &mut Intake, columns: &Columns<'_>, attitude: &mut [T], skipped: &mut Skipped) {
        for (k, out) in attitude.chunks_exact_mut(4).enumerate() {
            intake.advance(self, &columns.row(k), out, skipped);
        }
    }
}

/// One setting of a filter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Its name, as printed in the paper where there is one.
    pub name: &'static str,
    /// Value without a choice.
    pub default: f64,
    /// Unit; `1` for a number.
    pub unit: &'static str,
    /// What it is, and what a smaller and a larger value do.
    pub meaning: &'static str,
}

impl Parameter {
    /// Whether it is a coordinate of a place, which may be negative.
    pub fn is_coordinate(&self) -> bool {
        self.unit == "m"
    }
}

type Make = fn(&Environment, &[f64]) -> Box<dyn Filter>;

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
pub const FILTERS: [Description; 9] = [
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
        make: hybrid::make,
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
    ) -> Result<Box<dyn Filter>, FilterError> {
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

/// Beyond any use, and its square times that of a reading is still a number of the machine.
const LARGEST: f64 = 1e50;

/// The values of `parameters` in their order, from settings by name.
pub(crate) fn fill(
    filter: &'static str,
    parameters: &'static [Parameter],
    settings: &[(String, f64)],
) -> Result<Vec<f64>, FilterError> {
    let mut values: Vec<f64> = parameters.iter().map(|parameter| parameter.default).collect();
    for (name, value) in settings {
        let Some(at) = parameters.iter().position(|parameter| parameter.name == name) else {
            let names: Vec<&str> = parameters.iter().map(|parameter| parameter.name).collect();
            let known = if names.is_empty() {
                "none".to_owned()
            } else {
                names.join(", ")
            };
            return Err(FilterError::UnknownSetting {
                filter,
                name: name.clone(),
                known,
            });
        };
        let (name, signed) = (parameters[at].name, parameters[at].is_coordinate());
        let (size, range) = if signed {
            (value.abs(), "a number from -1e50 to 1e50")
        } else {
            (*value, "a number from 0 to 1e50")
        };
        if !(0.0..=LARGEST).contains(&size) {
            return Err(FilterError::Setting {
                filter,
                name,
                value: *value,
                range,
            });
        }
        values[at] = *value;
    }
    Ok(values)
}

/// The four components of an attitude at the head of a state, and the rest.
pub(crate) fn split_state<T: Real, const REST: usize>(state: &[T]) -> Option<(Quaternion<T>, [T; REST])> {
    let (head, rest) = state.split_at_checked(4)?;
    let q = Quaternion::from_unit(head.try_into().ok()?)?;
    let rest: [T; REST] = rest.try_into().ok()?;
    let finite = |value: &T| value.simd_abs().simd_le(T::splat(f64::MAX)).all();
    rest.iter().all(finite).then_some((q, rest))
}
