//! From rest to rest: the direction of gravity before, carried along by the integrated rate, against the one found after
//! (the idea of Tedaldi, Pretto and Menegatti, ICRA 2014).
//!
//! The gyroscope counts from what it reads at the two rests, in a straight line between: its zero, and whatever moves it as slowly,
//! is told by the rests themselves and has no part in this.

use std::ops::Range;

use imufit_model::effect::EffectError;
use imufit_model::facts::LogFacts;
use imufit_model::rest_channels::TURN;
use imufit_model::sensor::Sensor;
use imufit_model::sensor_model::{AxisColumns, ChannelColumns, SensorModel};
use imufit_model::triple::Triple;
use imufit_model::window::Window;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::ChannelRows;
use super::still::Still;
use super::table::{Table, readings, vectors};

/// A turn from one rest to the next.
pub struct Turn {
    /// Its rows, among those of all turns.
    pub rows: Range<usize>,
    /// Number of the rest before; the one after is the next.
    pub before: usize,
    /// Number of the rest after.
    pub after: usize,
    /// Inverse of its noise, 1/rad.
    pub weight: f64,
    /// Its block.
    pub block: usize,
}

/// Steps by which a model is undone.
const STEPS: usize = 12;

/// Rates with the model undone, and the columns there.
fn undone(
    table: &mut Table,
    measured: &Triple,
    model: &SensorModel,
    facts: &LogFacts,
) -> Result<AxisColumns, EffectError> {
    for _ in 0..STEPS {
        let (modelled, columns) = model.modelled(table.rows(facts), Sensor::Gyr)?;
        let mut missing = measured.clone();
        missing.add(&modelled, -1.0);
        let largest = missing.0.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
        if largest < 1e-13 {
            return Ok(columns);
        }
        table.ideal.omega.add(&missing, 1.0);
    }
    Ok(model.modelled(table.rows(facts), Sensor::Gyr)?.1)
}

/// How the body turned along a turn.
struct Carried {
    /// Body axes at the end to body axes at the start.
    rotation: Rotation3<f64>,
    /// Further turn at the end (rotation vector in body axes there) by each parameter.
    further: Vec<Vector3<f64>>,
}

/// Two rows of evidence for each turn.
pub fn rows(
    turns: &[Turn],
    path: &Window,
    poses: &Still,
    model: &SensorModel,
    facts: &LogFacts,
) -> Result<ChannelRows, EffectError> {
    let wanted = &model.active()[TURN];
    let mut table = Table::new(path, facts);
    let measured = readings(path, Sensor::Gyr);
    follow(turns, &mut table, poses);
    let columns = undone(&mut table, &measured, model, facts)?;
    let (zeros, at_rest) = poses.rates(model, facts)?;
    let axes = &model.active_on_axes()[3 * Sensor::Gyr.index()..];
    let mut out = ChannelColumns {
        columns: vec![Vec::new(); wanted.len()],
        residual: Vec::new(),
    };
    let (mut after, mut block, mut group) = (Vec::new(), Vec::new(), Vec::new());
    // What a zero of the accelerometer does to a row.
    let mut zero = Triple::default();
    for turn in turns {
        let rest = |pose: usize| (zeros.row(pose), vectors(&at_rest, axes, pose, wanted));
        let (first, last) = (rest(turn.before), rest(turn.after));
        let (begin, end) = (path.t[turn.rows.start], path.t[turn.rows.end - 1]);
        let relative = |row: usize| {
            let share = (path.t[row] - begin) / (end - begin);
            let line = |a: &Vector3<f64>, b: &Vector3<f64>| a * (1.0 - share) + b * share;
            let at = vectors(&columns, axes, row, wanted);
            let ends = first.1.iter().zip(&last.1);
            let columns: Vec<Vector3<f64>> = at.iter().zip(ends).map(|(c, (a, b))| c - line(a, b)).collect();
            (table.ideal.omega.row(row) - line(&first.0, &last.0), columns)
        };
        let carried = carry(path.t, turn.rows.clone(), &relative, wanted.len());
        let (up, moved) = poses.up(model, turn.before, wanted);
        let (found, found_moved) = poses.up(model, turn.after, wanted);
        let back = carried.rotation.inverse();
        let predicted = back * up;
        let error = predicted - found;
        // Two directions across the one that was found.
        let least = Vector3::ith(found.iamin(), 1.0);
        let across = found.cross(&least).normalize();
        let turned_zero = back.matrix() * across_of(&up) - across_of(&found);
        for direction in [across, found.cross(&across)] {
            zero.push(&(turned_zero.tr_mul(&direction) * (turn.weight / poses.force.length)));
            out.residual.push(turn.weight * direction.dot(&error));
            for (k, column) in out.columns.iter_mut().enumerate() {
                let change = predicted.cross(&carried.further[k]) + back * moved[k] - found_moved[k];
                column.push(turn.weight * direction.dot(&change));
            }
            after.push(turn.after);
            block.push(turn.block);
            group.push(group.len());
        }
    }
    Ok(ChannelRows {
        channel: TURN,
        columns: out,
        t: turns.iter().flat_map(|turn| [path.t[turn.rows.end - 1]; 2]).collect(),
        block,
        direction: Some(zero),
        group,
        around: poses.table.evaluation_of(&after),
    })
}

/// Takes from a vector its part across a direction.
fn across_of(direction: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::identity() - direction * direction.transpose()
}

/// Attitudes along the turns, from those of the rests before.
fn follow(turns: &[Turn], table: &mut Table, poses: &Still) {
    for turn in turns {
        let mut attitude = poses.table.ideal.attitude[turn.before];
        let mut last: Option<(usize, Vector3<f64>)> = None;
        for row in turn.rows.clone() {
            let rate = table.ideal.omega.row(row);
            if let Some((before, earlier)) = last {
                let dt = table.time(row) - table.time(before);
                attitude *= UnitQuaternion::from_scaled_axis(0.5 * (rate + earlier) * dt);
            }
            table.ideal.attitude[row] = attitude;
            last = Some((row, rate));
        }
    }
}

/// Integrates the rate and its columns along a turn.
fn carry(
    t: &[f64],
    rows: Range<usize>,
    relative: &dyn Fn(usize) -> (Vector3<f64>, Vec<Vector3<f64>>),
    parameters: usize,
) -> Carried {
    let mut rotation = Rotation3::identity();
    let mut further = vec![Vector3::zeros(); parameters];
    let mut earlier = relative(rows.start);
    for row in rows.skip(1) {
        let now = relative(row);
        let dt = t[row] - t[row - 1];
        // Mean rate of the step, and the cone that two different rates describe (second order).
        let mean = 0.5 * (now.0 + earlier.0);
        let step = Rotation3::new(mean * dt + earlier.0.cross(&now.0) * (dt * dt / 12.0));
        rotation *= step;
        let back = step.inverse();
        // Right Jacobian of the exponential, first order.
        let jacobian = (Matrix3::identity() - 0.5 * dt * mean.cross_matrix()) * dt;
        for (sum, (a, b)) in further.iter_mut().zip(earlier.1.iter().zip(&now.1)) {
            *sum = back * *sum + jacobian * (0.5 * (a + b));
        }
        earlier = now;
    }
    Carried { rotation, further }
}
