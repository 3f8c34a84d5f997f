//! Vectors of a known length: their direction is found with the model undone, their length tells of the sensor.

use imufit_model::effect::EffectError;
use imufit_model::facts::LogFacts;
use imufit_model::rest_channels::FIELD_NORM;
use imufit_model::sensor::Sensor;
use imufit_model::sensor_model::{AxisColumns, ChannelColumns, SensorModel};
use imufit_model::triple::Triple;
use imufit_model::window::Window;
use nalgebra::{UnitQuaternion, Vector3};

use super::table::{Table, no_attitude, readings, vectors};

/// Steps by which a direction is found: each leaves a share of the error as large as the sensor's own.
const STEPS: usize = 30;
/// Change of the vector, as a share of its length, at which it is found.
const FOUND: f64 = 1e-13;

/// A vector of known length in every row.
pub struct Sized {
    /// Its length.
    pub length: f64,
    /// Its direction.
    pub direction: Triple,
    /// What the sensor reads beyond the model.
    pub residual: Triple,
    /// Columns of the sensor.
    pub columns: AxisColumns,
}

/// Finds the direction of a vector of known length from the readings of it, for a model; puts it into the ideal readings. `aligned` says
/// what else of these follows from it.
pub fn sized(
    table: &mut Table,
    model: &SensorModel,
    facts: &LogFacts,
    sensor: Sensor,
    measured: &Triple,
    length: f64,
    aligned: &dyn Fn(&mut Table),
) -> Result<Sized, EffectError> {
    let n = table.len();
    let mut vector = measured.clone();
    let mut direction = Triple::zeros(n);
    let (mut done, mut step) = (false, 0);
    loop {
        for i in 0..n {
            let unit = vector.row(i).normalize();
            for axis in 0..3 {
                direction.0[axis][i] = unit[axis];
            }
        }
        let mut ideal = Triple::zeros(n);
        ideal.add(&direction, length);
        match sensor {
            Sensor::Acc => table.ideal.f = ideal.clone(),
            Sensor::Gyr => table.ideal.omega = ideal.clone(),
            Sensor::Mag => table.ideal.m = ideal.clone(),
        }
        aligned(table);
        let (modelled, columns) = model.modelled(table.rows(facts), sensor)?;
        let mut residual = measured.clone();
        residual.add(&modelled, -1.0);
        if done || step == STEPS {
            return Ok(Sized {
                length,
                direction,
                residual,
                columns,
            });
        }
        let before = std::mem::replace(&mut vector, ideal);
        vector.add(&residual, 1.0);
        let moved = (0..n)
            .map(|i| (vector.row(i) - before.row(i)).norm())
            .filter(|d| d.is_finite());
        done = moved.fold(0.0, f64::max) <= FOUND * length;
        step += 1;
    }
}

impl Sized {
    /// Residual and columns along the vector: those of its length.
    pub fn norm(&self, model: &SensorModel, sensor: Sensor, wanted: &[usize]) -> ChannelColumns {
        let n = self.direction.len();
        let axes = &model.active_on_axes()[3 * sensor.index()..];
        let mut out = ChannelColumns {
            columns: vec![vec![0.0; n]; wanted.len()],
            residual: vec![0.0; n],
        };
        for row in 0..n {
            let along = self.direction.row(row);
            out.residual[row] = along.dot(&self.residual.row(row));
            for (column, vector) in out.columns.iter_mut().zip(vectors(&self.columns, axes, row, wanted)) {
                column[row] = along.dot(&vector);
            }
        }
        out
    }
}

/// Length of the field less the constant that `facts` hold. Its direction is that of the third axis of a frame made up for each
/// row, so that the constant is the third part of `mag.field_reference`, and the other two show nowhere.
pub fn norm<'a>(
    rows: &Window<'a>,
    model: &SensorModel,
    facts: &LogFacts,
) -> Result<(ChannelColumns, Table<'a>), EffectError> {
    let mut table = Table::new(rows, facts);
    let measured = readings(rows, Sensor::Mag);
    let aligned = |table: &mut Table| {
        for i in 0..table.len() {
            let field = table.ideal.m.row(i);
            table.ideal.attitude[i] = if field.iter().all(|v| v.is_finite()) {
                UnitQuaternion::rotation_between(&field, &Vector3::z())
                    .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI))
            } else {
                no_attitude()
            };
        }
    };
    let found = sized(
        &mut table,
        model,
        facts,
        Sensor::Mag,
        &measured,
        facts.field.norm(),
        &aligned,
    )?;
    Ok((found.norm(model, Sensor::Mag, &model.active()[FIELD_NORM]), table))
}
