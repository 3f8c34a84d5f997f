//! Rests: the specific force is as long as gravity, the rate is zero.

use imufit_model::effect::EffectError;
use imufit_model::facts::LogFacts;
use imufit_model::rest_channels::FORCE_NORM;
use imufit_model::sensor::Sensor;
use imufit_model::sensor_model::{AxisColumns, ChannelColumns, SensorModel};
use imufit_model::triple::Triple;
use imufit_model::window::Window;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::field::{Sized, sized};
use super::table::{Table, no_attitude, readings, vectors};

/// Means of rests with their ideal readings.
pub struct Still<'a> {
    /// The rows.
    pub table: Table<'a>,
    /// Direction, residual and columns of the specific force.
    pub force: Sized,
    rates: Triple,
}

/// Attitude of a resting sensor from specific force and field; NaN without a field, which alone tells the heading.
fn attitude(facts: &LogFacts, force: &Vector3<f64>, field: &Vector3<f64>) -> UnitQuaternion<f64> {
    let columns = |up: Vector3<f64>, north: Vector3<f64>| Matrix3::from_columns(&[north, up.cross(&north), up]);
    let up = force.normalize();
    let north = field - up * up.dot(field);
    if north.norm() <= 0.0 || north.iter().any(|v| v.is_nan()) {
        return no_attitude();
    }
    let body = columns(up, north.normalize());
    let reference = columns(facts.frame.up(), facts.frame.north());
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(reference * body.transpose()))
}

impl<'a> Still<'a> {
    /// Means of rests, the model undone.
    pub fn new(means: &Window<'a>, model: &SensorModel, facts: &LogFacts) -> Result<Self, EffectError> {
        let mut table = Table::new(means, facts);
        let measured = readings(means, Sensor::Acc);
        let rates = readings(means, Sensor::Gyr);
        table.ideal.omega = Triple::zeros(table.len());
        let aligned = |table: &mut Table| {
            for i in 0..table.len() {
                table.ideal.attitude[i] = attitude(facts, &table.ideal.f.row(i), &table.ideal.m.row(i));
            }
        };
        let force = sized(
            &mut table,
            model,
            facts,
            Sensor::Acc,
            &measured,
            facts.gravity.norm(),
            &aligned,
        )?;
        Ok(Self { table, force, rates })
    }

    /// Length of the specific force less gravity.
    pub fn force_norm(&self, model: &SensorModel) -> ChannelColumns {
        self.force.norm(model, Sensor::Acc, &model.active()[FORCE_NORM])
    }

    /// Columns of the gyroscope at rest, and what it reads beyond the model.
    pub fn rates(&self, model: &SensorModel, facts: &LogFacts) -> Result<(Triple, AxisColumns), EffectError> {
        let (modelled, columns) = model.modelled(self.table.rows(facts), Sensor::Gyr)?;
        let mut residual = self.rates.clone();
        residual.add(&modelled, -1.0);
        Ok((residual, columns))
    }

    /// The mean rate against zero, axis by axis.
    pub fn rate(&self, model: &SensorModel, facts: &LogFacts) -> Result<Vec<ChannelColumns>, EffectError> {
        let (residual, columns) = self.rates(model, facts)?;
        let axes = residual.0.into_iter().zip(columns);
        Ok(axes
            .map(|(residual, columns)| ChannelColumns { columns, residual })
            .collect())
    }

    /// Up in a row, and its derivative by some of all parameters.
    pub fn up(&self, model: &SensorModel, row: usize, wanted: &[usize]) -> (Vector3<f64>, Vec<Vector3<f64>>) {
        let up = self.force.direction.row(row);
        let axes = &model.active_on_axes()[3 * Sensor::Acc.index()..];
        let across = |v: Vector3<f64>| (v - up * up.dot(&v)) / self.force.length;
        let columns = vectors(&self.force.columns, axes, row, wanted);
        (up, columns.into_iter().map(across).collect())
    }
}
