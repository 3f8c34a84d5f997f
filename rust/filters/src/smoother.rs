//! Attitude from the rows before and after: the filter [`crate::mekf`] forwards and backwards, joined by their covariances.
//!
//! 1. Forwards, to learn gyro bias and scale from the whole log.
//! 2. Backwards from the last row: time and angular rate change their signs, and the bias with them. Bias and scale
//!    are those of pass 1, the attitude is found anew.
//! 3. Forwards again with what pass 2 left. With attitudes q_f and q_b and covariances P_f and P_b the result of a row
//!    is (Fraser and Potter 1969, on attitudes)
//!
//! ```text
//! q = exp( P_f (P_f + P_b)^-1 log(q_b q_f^-1) ) q_f
//! ```
//!
//! Without a magnetometer nothing shows the heading but its start, which pass 3 alone knows: it keeps that of q_f.
//! A row that no attitude reaches forwards has none here either. Memory: 18 numbers a row.

use imufit_attitude::Quaternion;
use nalgebra::{Matrix3, Vector3};

use crate::filter::{Description, find};
use crate::mekf;
use crate::{Columns, Environment, FilterError, Replay, Rules, Skipped, Start};

/// The filter that runs both ways.
const FILTER: &str = "mekf";

/// The columns from the last row to the first, time and rate with their signs changed.
struct Reversed {
    t: Vec<f64>,
    acc: Option<Vec<f64>>,
    gyr: Option<Vec<f64>>,
    mag: Option<Vec<f64>>,
}

impl Reversed {
    fn new(columns: &Columns<'_>) -> Self {
        let rows = |column: Option<&[f64]>, sign: f64| {
            column.map(|c| c.chunks_exact(3).rev().flatten().map(|x| sign * x).collect())
        };
        Self {
            t: columns.t.iter().rev().map(|t| -t).collect(),
            acc: rows(columns.acc, 1.0),
            gyr: rows(columns.gyr, -1.0),
            mag: rows(columns.mag, 1.0),
        }
    }

    fn columns(&self) -> Columns<'_> {
        Columns {
            t: &self.t,
            acc: self.acc.as_deref(),
            gyr: self.gyr.as_deref(),
            mag: self.mag.as_deref(),
        }
    }
}

/// What one pass says of a row.
#[derive(Clone, Copy)]
struct Passed {
    q: Quaternion,
    covariance: Matrix3<f64>,
}

/// Settings and surroundings of a smoothed log; see [`Smoother::run`].
#[derive(Debug, Clone)]
pub struct Smoother {
    description: &'static Description,
    settings: Vec<(String, f64)>,
    environment: Environment,
    rules: Rules,
    start: Start,
}

impl Smoother {
    /// With settings of [`crate::mekf`] by name.
    pub fn new(
        settings: &[(String, f64)],
        environment: Environment,
        rules: Rules,
        start: Start,
    ) -> Result<Self, FilterError> {
        let description = find(FILTER)?;
        description.build(&environment, settings)?;
        Ok(Self {
            description,
            settings: settings.to_vec(),
            environment,
            rules,
            start,
        })
    }

    /// Fills `attitude`, four values `w x y z` for each row of `columns`; NaN before the start. The rows of which
    /// something was not used are those of the first pass. `look` is asked between the passes whether to go on.
    pub fn run<E: From<FilterError>>(
        &self,
        columns: &Columns<'_>,
        attitude: &mut [f64],
        mut look: impl FnMut() -> Result<(), E>,
    ) -> Result<Skipped, E> {
        let mut first = self.replay()?;
        let skipped = first.run(columns, attitude)?;
        look()?;
        let Some((start, q)) = first_attitude(attitude) else {
            return Ok(skipped);
        };
        let mut backwards = self.replay()?;
        backwards.resume(&mekf::turned_back(&first.filter_state(), first.attitude()));
        let reversed = Reversed::new(columns);
        let mut after = pass(&mut backwards, &reversed.columns(), 0)?;
        after.reverse();
        look()?;
        let mut forwards = self.replay()?;
        forwards.resume(&mekf::turned_back(&backwards.filter_state(), q));
        let before = pass(&mut forwards, columns, start)?;
        let turned = columns.mag.is_some_and(|m| m.iter().any(|x| x.is_finite()));
        let rows = attitude.chunks_exact_mut(4).zip(&after).skip(start).zip(&before);
        for ((out, after), before) in rows {
            let q = between(before, after, &self.environment.up(), turned);
            out.copy_from_slice(&q.to_array());
        }
        Ok(skipped)
    }

    fn replay(&self) -> Result<Replay, FilterError> {
        Replay::new(
            self.description,
            &self.settings,
            self.environment,
            self.rules,
            self.start,
        )
    }
}

/// The first row with an attitude, and that.
fn first_attitude(attitude: &[f64]) -> Option<(usize, Quaternion)> {
    let rows = attitude.chunks_exact(4).enumerate();
    rows.into_iter()
        .find_map(|(k, row)| Quaternion::from_row(row).map(|q| (k, q)))
}

fn pass(replay: &mut Replay, columns: &Columns<'_>, start: usize) -> Result<Vec<Passed>, FilterError> {
    (start..columns.t.len())
        .map(|k| {
            replay.step(&columns.row(k))?;
            Ok(Passed {
                q: replay.attitude(),
                covariance: replay.attitude_covariance().unwrap_or_else(Matrix3::identity),
            })
        })
        .collect()
}

/// The attitude between two with covariances; with `heading` = false the heading of the first.
fn between(first: &Passed, second: &Passed, up: &Vector3<f64>, heading: bool) -> Quaternion {
    let difference = (second.q * first.q.inverse()).log();
    let share = (first.covariance + second.covariance)
        .try_inverse()
        .map_or_else(Vector3::zeros, |inverse| first.covariance * (inverse * difference));
    let share = if heading { share } else { share - up * share.dot(up) };
    if share.norm_squared().is_finite() {
        Quaternion::exp(&share) * first.q
    } else {
        first.q
    }
}
