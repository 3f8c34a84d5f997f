//! Labelled poses: the body axis that points up is known, the direction of the specific force is found.
//!
//! How long the specific force is, the rests tell already, and no crooked side changes that. What a label adds are the two directions
//! across, which are known as well as the side was laid.

use imufit_model::rest_channels::POSE;
use imufit_model::sensor_model::{ChannelColumns, SensorModel};
use imufit_model::triple::Triple;
use nalgebra::Vector3;

use super::ChannelRows;
use super::still::Still;

/// A pose whose upward axis is known.
pub struct Labelled {
    /// Its number among the rests.
    pub rest: usize,
    /// Unit vector of the axis that points up.
    pub up: Vector3<f64>,
    /// Its block.
    pub block: usize,
}

/// Two rows of evidence for each labelled pose: the direction of the specific force less the axis that points up.
pub fn rows(labelled: &[Labelled], poses: &Still, model: &SensorModel) -> ChannelRows {
    let wanted = &model.active()[POSE];
    let mut columns = ChannelColumns {
        columns: vec![Vec::new(); wanted.len()],
        residual: Vec::new(),
    };
    // What a zero of the accelerometer does to a row.
    let mut zero = Triple::default();
    for pose in labelled {
        let (found, moved) = poses.up(model, pose.rest, wanted);
        let across = pose.up.cross(&Vector3::ith(pose.up.iamin(), 1.0)).normalize();
        for direction in [across, pose.up.cross(&across)] {
            zero.push(&((direction - found * found.dot(&direction)) / poses.force.length));
            columns.residual.push(direction.dot(&(found - pose.up)));
            for (column, moved) in columns.columns.iter_mut().zip(&moved) {
                column.push(direction.dot(moved));
            }
        }
    }
    let twice = |of: &dyn Fn(&Labelled) -> usize| -> Vec<usize> { labelled.iter().flat_map(|p| [of(p); 2]).collect() };
    let rests = twice(&|pose| pose.rest);
    ChannelRows {
        channel: POSE,
        columns,
        t: rests.iter().map(|rest| poses.table.time(*rest)).collect(),
        block: twice(&|pose| pose.block),
        direction: Some(zero),
        group: (0..rests.len()).collect(),
        around: poses.table.evaluation_of(&rests),
    }
}
