//! Columns of a log as the rows that a replay goes through.

use nalgebra::Vector3;

use crate::{FilterError, Sensor};

/// Columns of a log, row by row: n times, 3 n readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Columns<'a> {
    /// Time, s.
    pub t: &'a [f64],
    /// Specific force, m/s^2.
    pub acc: Option<&'a [f64]>,
    /// Angular rate, rad/s.
    pub gyr: Option<&'a [f64]>,
    /// Magnetic flux density, uT.
    pub mag: Option<&'a [f64]>,
}

impl<'a> Columns<'a> {
    /// Whether there is a column of that sensor.
    pub(crate) fn has(&self, wanted: Sensor) -> bool {
        let mut sensors = self.sensors().into_iter();
        sensors.any(|(sensor, column)| sensor == wanted && column.is_some())
    }

    /// The columns by sensor.
    pub(crate) fn sensors(&self) -> [(Sensor, Option<&'a [f64]>); 3] {
        [
            (Sensor::Acc, self.acc),
            (Sensor::Gyr, self.gyr),
            (Sensor::Mag, self.mag),
        ]
    }

    /// The same columns in pieces of at most `rows` rows.
    pub fn windows(self, rows: usize) -> impl Iterator<Item = Self> {
        let piece =
            move |column: Option<&'a [f64]>, from: usize, to: usize| column.and_then(|c| c.get(3 * from..3 * to));
        (0..self.t.len()).step_by(rows.max(1)).map(move |from| {
            let to = (from + rows.max(1)).min(self.t.len());
            let [acc, gyr, mag] = [self.acc, self.gyr, self.mag].map(|column| piece(column, from, to));
            Self {
                t: &self.t[from..to],
                acc,
                gyr,
                mag,
            }
        })
    }

    pub(crate) fn check(&self) -> Result<(), FilterError> {
        for (sensor, column) in self.sensors() {
            if let Some(column) = column.filter(|column| column.len() != 3 * self.t.len()) {
                let (name, came, expected) = (sensor.name(), column.len() / 3, self.t.len());
                return Err(FilterError::Length { name, came, expected });
            }
        }
        Ok(())
    }

    /// The row of that number; NaN beyond the end.
    #[inline(always)]
    pub(crate) fn row(&self, k: usize) -> Row {
        let reading = |column: Option<&[f64]>| {
            let xyz = column?.get(3 * k..3 * k + 3)?;
            Some(Vector3::new(xyz[0], xyz[1], xyz[2]))
        };
        Row {
            t: self.t.get(k).copied().unwrap_or(f64::NAN),
            acc: reading(self.acc),
            gyr: reading(self.gyr),
            mag: reading(self.mag),
        }
    }
}

/// One row of a log or of a running device. `None`: there is no such sensor; NaN: it has no reading in this row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Time, s.
    pub t: f64,
    /// Specific force, m/s^2.
    pub acc: Option<Vector3<f64>>,
    /// Angular rate, rad/s.
    pub gyr: Option<Vector3<f64>>,
    /// Magnetic flux density, uT.
    pub mag: Option<Vector3<f64>>,
}

impl Row {
    /// Whether the sensor is there.
    pub fn has(&self, sensor: Sensor) -> bool {
        match sensor {
            Sensor::Acc => self.acc.is_some(),
            Sensor::Gyr => self.gyr.is_some(),
            Sensor::Mag => self.mag.is_some(),
        }
    }
}
