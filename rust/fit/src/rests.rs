//! What a log without a reference attitude tells of its sensors.
//!
//! At rest the specific force is as long as gravity and the rate is zero; from one rest to the next the integrated rate carries the
//! direction of gravity along; of a labelled pose the direction is known; the magnetic field is as long everywhere. Each of these is a row of evidence: a residual, and
//! the columns of every effect projected as the residual is. The ideal readings that columns depend on are the readings
//! themselves with the model undone: a vector along a reading, of the length that is known.

mod field;
mod pose;
mod still;
mod table;
mod turn;

use imufit_model::effect::EffectError;
use imufit_model::facts::LogFacts;
use imufit_model::rest_channels::{FIELD_NORM, FORCE_NORM, RATE};
use imufit_model::sensor::{CHANNELS, Sensor};
use imufit_model::sensor_model::{ChannelColumns, Evaluation, SensorModel};
use imufit_model::triple::Triple;
use imufit_model::window::Window;

pub use self::pose::Labelled;
pub use self::turn::Turn;

/// Means over stretches of the rests of a log.
pub struct Stills<'a> {
    /// Mean time, readings, temperature and covariates.
    pub means: Window<'a>,
    /// Number of the rest that each belongs to.
    pub rest: Vec<usize>,
    /// Block of each.
    pub block: Vec<usize>,
}

/// What of a log is known without a reference.
pub struct Rests<'a> {
    /// Its rests, stretch by stretch.
    pub stills: Stills<'a>,
    /// Means over whole rests, where turns begin and end.
    pub poses: Window<'a>,
    /// Those of them whose upward axis is known.
    pub labelled: Vec<Labelled>,
    /// The rows of all turns, one turn after the other; every row has a rate.
    pub path: Window<'a>,
    /// Turns from one rest to the next.
    pub turns: Vec<Turn>,
    /// Rows with a magnetic field, at rest or not.
    pub field: Window<'a>,
    /// Block of each of them.
    pub field_block: Vec<usize>,
}

/// Rows of evidence of one channel.
pub struct ChannelRows {
    /// The channel, see [`imufit_model::rest_channels`].
    pub channel: usize,
    /// Columns and residual.
    pub columns: ChannelColumns,
    /// Time, s.
    pub t: Vec<f64>,
    /// Block of each row.
    pub block: Vec<usize>,
    /// Where the rows are projections of a vector (the accelerometer's zeros): the directions.
    pub direction: Option<Triple>,
    /// Rows that belong together have the same number.
    pub group: Vec<usize>,
    /// Ideal readings, temperature and covariates of each row.
    pub around: Evaluation,
}

impl Rests<'_> {
    /// Rows of evidence of every channel around a model.
    pub fn rows(&self, model: &SensorModel, facts: &LogFacts) -> Result<Vec<ChannelRows>, EffectError> {
        let mut out = Vec::new();
        if facts.sensors[Sensor::Acc.index()] {
            let stills = still::Still::new(&self.stills.means, model, facts)?;
            let mut rows = self.still_rows(FORCE_NORM, stills.force_norm(model), &stills);
            rows.direction = Some(stills.force.direction.clone());
            out.push(rows);
            if !self.labelled.is_empty() {
                let poses = still::Still::new(&self.poses, model, facts)?;
                out.push(pose::rows(&self.labelled, &poses, model));
            }
            if facts.sensors[Sensor::Gyr.index()] {
                for (axis, columns) in stills.rate(model, facts)?.into_iter().enumerate() {
                    out.push(self.still_rows(RATE + axis, columns, &stills));
                }
                let poses = still::Still::new(&self.poses, model, facts)?;
                out.push(turn::rows(&self.turns, &self.path, &poses, model, facts)?);
            }
        }
        if facts.sensors[Sensor::Mag.index()] {
            let (columns, table) = field::norm(&self.field, model, facts)?;
            let n = table.len();
            out.push(ChannelRows {
                channel: FIELD_NORM,
                columns,
                t: self.field.t.to_vec(),
                block: self.field_block.clone(),
                direction: None,
                group: (0..n).collect(),
                around: table.evaluation(),
            });
        }
        Ok(out)
    }

    fn still_rows(&self, channel: usize, columns: ChannelColumns, still: &still::Still) -> ChannelRows {
        let stills = &self.stills;
        ChannelRows {
            channel,
            columns,
            t: stills.means.t.to_vec(),
            block: stills.block.clone(),
            direction: None,
            group: stills.rest.clone(),
            around: still.table.evaluation(),
        }
    }

    /// Variance of a row of each channel from stretches of the same rest that follow each other; NaN where too few do.
    pub fn scatter(&self, model: &SensorModel, facts: &LogFacts) -> Result<[f64; CHANNELS], EffectError> {
        let mut out = [f64::NAN; CHANNELS];
        for rows in self.rows(model, facts)? {
            let residual = &rows.columns.residual;
            let differences: Vec<f64> = (1..residual.len())
                .filter(|i| rows.group[*i] == rows.group[*i - 1])
                .map(|i| residual[i] - residual[i - 1])
                .filter(|d| d.is_finite())
                .collect();
            if differences.len() >= FEWEST {
                let square: f64 = differences.iter().map(|d| d * d).sum();
                out[rows.channel] = 0.5 * square / differences.len() as f64;
            }
        }
        Ok(out)
    }

    /// True if an effect's columns can be told without a reference: known in every row in which its sensor has a reading.
    pub fn tell(&self, model: &SensorModel, facts: &LogFacts) -> Result<bool, EffectError> {
        let known = |rows: &ChannelRows| {
            let residual = rows.columns.residual.iter().enumerate();
            let measured: Vec<usize> = residual.filter(|(_, r)| r.is_finite()).map(|(i, _)| i).collect();
            let all = |column: &Vec<f64>| measured.iter().filter(|i| column[**i].is_finite()).count() as f64;
            let least = rows.columns.columns.iter().map(all).fold(f64::INFINITY, f64::min);
            least >= MOST * measured.len() as f64
        };
        Ok(self.rows(model, facts)?.iter().all(known))
    }
}

/// Differences that it takes to tell a scatter.
const FEWEST: usize = 6;
/// Part of the rows in which a column must be known.
const MOST: f64 = 0.9;
