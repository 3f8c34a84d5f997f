//! THE list of built-in effects, one line each. What it is made of, an effect says itself in its card.

use std::sync::Arc;

use crate::effect::Effect;
use crate::effects::{
    bias, covariate, current, drift, earth_rate, g_sensitivity, iron, lever_arm, misalignment, nonlinearity, reference,
    reference_lowpass, rig, rounding, saturation, scale, temperature, timing, vibration, warmup,
};
use crate::sensor::Sensor;

/// Every built-in effect that does not depend on the log's own columns.
pub fn built_in() -> Vec<Arc<dyn Effect>> {
    vec![
        Arc::new(bias::bias(Sensor::Acc)),
        Arc::new(scale::scale(Sensor::Acc)),
        Arc::new(misalignment::misalignment(Sensor::Acc)),
        Arc::new(lever_arm::lever_arm()),
        Arc::new(temperature::bias_temperature(Sensor::Acc)),
        Arc::new(temperature::scale_temperature(Sensor::Acc)),
        Arc::new(drift::bias_drift(Sensor::Acc)),
        Arc::new(nonlinearity::quadratic(Sensor::Acc)),
        Arc::new(nonlinearity::cubic(Sensor::Acc)),
        Arc::new(vibration::rectification(Sensor::Acc)),
        Arc::new(timing::delay(Sensor::Acc)),
        Arc::new(timing::lowpass(Sensor::Acc)),
        Arc::new(saturation::saturation(Sensor::Acc)),
        Arc::new(bias::bias(Sensor::Gyr)),
        Arc::new(scale::scale(Sensor::Gyr)),
        Arc::new(misalignment::misalignment(Sensor::Gyr)),
        Arc::new(g_sensitivity::g_sensitivity()),
        Arc::new(temperature::bias_temperature(Sensor::Gyr)),
        Arc::new(temperature::scale_temperature(Sensor::Gyr)),
        Arc::new(drift::bias_drift(Sensor::Gyr)),
        Arc::new(nonlinearity::quadratic(Sensor::Gyr)),
        Arc::new(nonlinearity::cubic(Sensor::Gyr)),
        Arc::new(nonlinearity::scale_asymmetry()),
        Arc::new(vibration::rectification(Sensor::Gyr)),
        Arc::new(earth_rate::earth_rate()),
        Arc::new(warmup::warmup()),
        Arc::new(timing::delay(Sensor::Gyr)),
        Arc::new(timing::lowpass(Sensor::Gyr)),
        Arc::new(saturation::saturation(Sensor::Gyr)),
        Arc::new(iron::hard_iron()),
        Arc::new(iron::soft_iron()),
        Arc::new(temperature::bias_temperature(Sensor::Mag)),
        Arc::new(temperature::scale_temperature(Sensor::Mag)),
        Arc::new(current::current()),
        Arc::new(timing::delay(Sensor::Mag)),
        Arc::new(reference::field()),
        Arc::new(reference::alignment()),
        Arc::new(reference::tilt()),
        Arc::new(reference::delay()),
        Arc::new(reference::skew()),
        Arc::new(reference_lowpass::lowpass()),
        Arc::new(rig::backlash()),
        Arc::new(rig::flexure()),
        Arc::new(rig::periodic()),
    ]
}

/// Effects that are fitted along and never named.
pub fn unnamed() -> Vec<Arc<dyn Effect>> {
    let rounding = |sensor| Arc::new(rounding::rounding(sensor)) as Arc<dyn Effect>;
    Sensor::ALL.into_iter().map(rounding).collect()
}

/// The effect of a log's own column from its id such as `mag.column:motor_current`.
pub fn column_effect(id: &str) -> Option<Arc<dyn Effect>> {
    let (sensor, column) = id.split_once(".column:")?;
    let sensor = Sensor::from_prefix(sensor)?;
    (!column.is_empty()).then(|| Arc::new(covariate::column(sensor, column)) as Arc<dyn Effect>)
}

/// The built-in effect with this id.
pub fn find(id: &str) -> Option<Arc<dyn Effect>> {
    built_in()
        .into_iter()
        .find(|e| e.card().id == id)
        .or_else(|| column_effect(id))
}
