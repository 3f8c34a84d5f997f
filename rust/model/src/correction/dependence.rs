//! What the columns of an effect depend on, found by trying: nobody has to declare it, a user neither.

use nalgebra::{UnitQuaternion, Vector3};

use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::ideal::Ideal;
use crate::sensor::Sensor;
use crate::triple::Triple;

/// Quantities that an effect reads besides what its own sensor measures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dependence {
    /// The ideal reading of each sensor.
    pub value: [bool; 3],
    /// Its time derivative.
    pub rate: [bool; 3],
    /// The attitude.
    pub attitude: bool,
    /// The temperature.
    pub temperature: bool,
}

/// Rows tried: enough for every branch that a user's function may take.
const TRIED: usize = 64;

/// A number between -1 and 1 that follows no pattern an effect could share.
fn scattered(k: usize) -> f64 {
    let x = (k as f64 * 12.9898 + 4.1414).sin() * 43_758.545_3;
    2.0 * (x - x.floor()) - 1.0
}

fn made_up(size: f64, seed: usize) -> Triple {
    Triple(std::array::from_fn(|axis| {
        (0..TRIED).map(|i| size * scattered(seed + 3 * i + axis)).collect()
    }))
}

/// Value and time derivative of a sensor's quantity.
pub fn quantity(ideal: &mut Ideal, sensor: Sensor) -> (&mut Triple, &mut Triple) {
    match sensor {
        Sensor::Acc => (&mut ideal.f, &mut ideal.f_rate),
        Sensor::Gyr => (&mut ideal.omega, &mut ideal.alpha),
        Sensor::Mag => (&mut ideal.m, &mut ideal.m_rate),
    }
}

/// Usual size of a sensor's quantity and of its derivative.
const fn usual(sensor: Sensor) -> (f64, f64) {
    match sensor {
        Sensor::Acc => (10.0, 20.0),
        Sensor::Gyr => (2.0, 10.0),
        Sensor::Mag => (50.0, 50.0),
    }
}

/// Made-up circumstances of the rows tried.
#[derive(Clone)]
struct Trial {
    ideal: Ideal,
    temperature: Vec<f64>,
}

impl Trial {
    fn new() -> Self {
        let mut ideal = Ideal::default();
        for sensor in Sensor::ALL {
            let (size, rate) = usual(sensor);
            let (value, derivative) = quantity(&mut ideal, sensor);
            *value = made_up(size, 1000 * sensor.index());
            *derivative = made_up(rate, 1000 * sensor.index() + 500);
        }
        ideal.attitude = (0..TRIED).map(|i| attitude(3000 + i)).collect();
        let temperature = (0..TRIED).map(|i| 40.0 * scattered(4000 + i)).collect();
        Self { ideal, temperature }
    }
}

fn attitude(seed: usize) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::from_fn(|axis, _| 2.0 * scattered(7 * seed + axis)))
}

/// Finds what an effect on `sensor` depends on at these parameters. `t` (s) and `covariates` are the log's own: some of their rows are tried.
pub fn dependence(
    effect: &dyn Effect,
    sensor: Sensor,
    parameters: &[f64],
    facts: &LogFacts,
    t: &[f64],
    covariates: &[Vec<f64>],
) -> Result<Dependence, EffectError> {
    let t: Vec<f64> = (0..TRIED).map(|i| t[i * t.len() / TRIED]).collect();
    let covariates: Vec<Vec<f64>> = covariates
        .iter()
        .map(|c| (0..TRIED).map(|i| c[i * c.len() / TRIED]).collect())
        .collect();
    let x = made_up(usual(sensor).0, 6000);
    let columns = |trial: &Trial| -> Result<Vec<Option<Vec<f64>>>, EffectError> {
        let mut columns = Columns::default();
        columns.reset(TRIED, parameters.len());
        let rows = Rows {
            facts,
            t: &t,
            ideal: &trial.ideal,
            force: &trial.ideal.f,
            x: &x,
            temperature: Some(&trial.temperature),
            vibration: Some(&trial.temperature),
            covariates: &covariates,
            position: &[],
            history: 0,
        };
        effect.columns(&rows, sensor, parameters, &mut columns)?;
        let all = (0..parameters.len()).flat_map(|p| (0..3).map(move |axis| (p, axis)));
        Ok(all.map(|(p, axis)| columns.get(p, axis).map(<[f64]>::to_vec)).collect())
    };
    let usual_trial = Trial::new();
    let before = columns(&usual_trial)?;
    let changes = |change: &dyn Fn(&mut Trial)| -> Result<bool, EffectError> {
        let mut other = usual_trial.clone();
        change(&mut other);
        Ok(!equal(&before, &columns(&other)?))
    };
    let mut out = Dependence {
        attitude: changes(&|trial| trial.ideal.attitude = (0..TRIED).map(|i| attitude(8000 + i)).collect())?,
        temperature: changes(&|trial| trial.temperature.reverse())?,
        ..Dependence::default()
    };
    for other in Sensor::ALL {
        let (size, rate) = usual(other);
        out.value[other.index()] = changes(&|trial| *quantity(&mut trial.ideal, other).0 = made_up(size, 9000))?;
        out.rate[other.index()] = changes(&|trial| *quantity(&mut trial.ideal, other).1 = made_up(rate, 9500))?;
    }
    Ok(out)
}

/// The same columns; what cannot be compared (NaN) does not differ.
fn equal(a: &[Option<Vec<f64>>], b: &[Option<Vec<f64>>]) -> bool {
    let same = |a: &Vec<f64>, b: &Vec<f64>| {
        a.iter()
            .zip(b)
            .all(|(a, b)| a.partial_cmp(b).is_none_or(std::cmp::Ordering::is_eq))
    };
    a.iter().zip(b).all(|(a, b)| match (a, b) {
        (Some(a), Some(b)) => same(a, b),
        (None, None) => true,
        _ => false,
    })
}
