//! From readings back to the quantities behind them: the sensor model the other way round.
//!
//! There is no reference here. What effects read of the true motion comes from the corrected readings themselves: specific force, rate
//! and field as they are, their derivatives from local polynomials. Where the effects on one sensor read another one, the
//! sensors are corrected in turn until nothing changes.

pub(crate) mod dependence;
mod newton;
mod stack;
mod surroundings;
mod timing;

use std::sync::Arc;

use crate::card::Stage;
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::ideal::SensorTime;
use crate::sensor::Sensor;
use crate::triple::Triple;
use crate::vibration;
use crate::window::{Window, held};
use dependence::{Dependence, dependence};
use newton::Failure;
use stack::{Block, Part, Seen};

/// Rows worked on at a time: few enough to stay in the processor's cache.
const BLOCK_ROWS: usize = 2048;
/// Turns through all sensors before it is clear that they will not come to rest.
const MAX_TURNS: usize = 40;

/// Why readings cannot be corrected. Rows are those of the window.
#[derive(Debug, thiserror::Error)]
pub enum CorrectionError {
    /// An effect failed.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// The log lacks what an effect reads.
    #[error("effect {effect} cannot be undone: {reason}")]
    Lacking {
        /// Id of the effect.
        effect: String,
        /// What is missing.
        reason: String,
    },
    /// Different quantities give the same reading.
    #[error("{effects} cannot be undone: with these parameters different inputs of the {sensor} give the same reading")]
    Singular {
        /// Ids of the effects.
        effects: String,
        /// Name of the sensor.
        sensor: &'static str,
        /// The first such row.
        row: usize,
    },
    /// No quantity was found that gives the reading.
    #[error("{effects} cannot be undone: no input of the {sensor} gives this reading with these parameters")]
    Unreached {
        /// Ids of the effects.
        effects: String,
        /// Name of the sensor.
        sensor: &'static str,
        /// The row.
        row: usize,
    },
    /// Sensors that read each other do not come to rest.
    #[error("{effects} cannot be undone together: the corrections do not come to rest after {MAX_TURNS} turns")]
    Restless {
        /// Ids of the effects.
        effects: String,
    },
}

/// Corrected readings of the sensors that effects act on.
pub struct Corrected {
    /// By sensor; `None` where nothing was corrected.
    pub readings: [Option<Triple>; 3],
    /// Samples of each sensor that became NaN because an effect could not be told there.
    pub lost: [usize; 3],
}

/// Everything that stays while sensors are corrected.
struct Log<'a> {
    window: &'a Window<'a>,
    facts: &'a LogFacts,
    temperature: Option<Vec<f64>>,
    vibration: Option<Vec<f64>>,
    covariates: Vec<Vec<f64>>,
    attitude: Option<Vec<nalgebra::UnitQuaternion<f64>>>,
}

/// Undoes the effects on all rows of a window, margins included.
pub fn correct(
    window: &Window,
    facts: &LogFacts,
    effects: &[(Arc<dyn Effect>, Vec<f64>)],
) -> Result<Corrected, CorrectionError> {
    let mut out = Corrected {
        readings: Default::default(),
        lost: [0; 3],
    };
    if window.is_empty() {
        return Ok(out);
    }
    let rows = 0..window.len();
    let mut log = Log {
        window,
        facts,
        temperature: window
            .temperature
            .filter(|_| facts.has_temperature)
            .map(|t| rows.clone().map(|i| held(t, i) - facts.temperature_mean).collect()),
        vibration: window.reading(Sensor::Acc).map(|_| vibration::power(window, facts.dt)),
        covariates: window
            .covariates
            .iter()
            .map(|c| rows.clone().map(|i| held(c, i)).collect())
            .collect(),
        attitude: None,
    };
    let times = timing::of(effects);
    let mut parts: [Vec<Part>; 3] = Default::default();
    for sensor in Sensor::ALL.into_iter().filter(|s| window.reading(*s).is_some()) {
        parts[sensor.index()] = parts_of(sensor, effects, &log)?;
    }
    if parts.iter().flatten().any(|p| p.dependence.attitude) {
        log.attitude = window.attitude.map(surroundings::held_attitude);
    }
    let raw: [Option<Triple>; 3] = window.readings.map(|r| {
        r.map(|values| {
            Triple(std::array::from_fn(|axis| {
                values.iter().skip(axis).step_by(3).copied().collect()
            }))
        })
    });
    // A gain and a constant offset leave time as it is, so that time can be set right first.
    let mut timely = raw.clone();
    for (reading, time) in timely.iter_mut().zip(&times) {
        if let (Some(y), true) = (reading.as_mut(), *time != SensorTime::default()) {
            *y = timing::set_right(y, window.t, *time);
        }
    }
    let mut now = timely.clone();
    in_turn(&log, &parts, &timely, &mut now)?;
    for sensor in Sensor::ALL {
        let k = sensor.index();
        if let (Some(raw), Some(now), false) = (
            &raw[k],
            now[k].take(),
            parts[k].is_empty() && times[k] == SensorTime::default(),
        ) {
            out.lost[k] = (0..raw.len())
                .filter(|i| (0..3).any(|a| raw.axis(a)[*i].is_finite() && !now.axis(a)[*i].is_finite()))
                .count();
            out.readings[k] = Some(now);
        }
    }
    Ok(out)
}

/// The effects on one sensor that change its readings, each checked against what the log has.
fn parts_of(sensor: Sensor, effects: &[(Arc<dyn Effect>, Vec<f64>)], log: &Log) -> Result<Vec<Part>, CorrectionError> {
    let mut parts = Vec::new();
    for (effect, parameters) in effects {
        let acts = effect.sensors().contains(&sensor) && parameters.iter().any(|v| *v != 0.0);
        // What was cut off or rounded is lost, and time is set right by itself.
        let elsewhere = matches!(effect.card().stage, Stage::Time | Stage::Rounding | Stage::Range);
        // Correcting a reading does not concern the reference.
        if !acts || elsewhere || effect.card().traits.reference.is_some() {
            continue;
        }
        let lacking = |reason: String| CorrectionError::Lacking {
            effect: effect.card().id.clone(),
            reason,
        };
        if let Some(reason) = effect.not_testable(log.facts) {
            return Err(lacking(reason));
        }
        let dependence = dependence(
            effect.as_ref(),
            sensor,
            parameters,
            log.facts,
            log.window.t,
            &log.covariates,
        )?;
        for other in Sensor::ALL {
            let k = other.index();
            if (dependence.value[k] || dependence.rate[k]) && log.window.readings[k].is_none() {
                let p = other.prefix();
                return Err(lacking(format!("the log has no columns {p}_x {p}_y {p}_z")));
            }
        }
        if dependence.temperature && log.temperature.is_none() {
            return Err(lacking("the log has no column temp".to_string()));
        }
        if dependence.attitude && log.window.attitude.is_none() {
            return Err(lacking(
                "the log has no columns ref_qw ref_qx ref_qy ref_qz".to_string(),
            ));
        }
        parts.push(Part {
            effect: effect.clone(),
            parameters: parameters.clone(),
            dependence,
        });
    }
    Ok(parts)
}

/// What the effects on one sensor read of sensor `other`: its value, its derivative. Of its own value they read the row itself, which is
/// being solved for, unless they look back.
fn reads(parts: &[Part], sensor: Sensor, other: Sensor) -> (bool, bool) {
    let any = |of: fn(&Dependence) -> &[bool; 3], looking_back: bool| {
        let mut asked = parts.iter().filter(|p| !looking_back || p.looks_back());
        asked.any(|p| of(&p.dependence)[other.index()])
    };
    (any(|d| &d.value, sensor == other), any(|d| &d.rate, false))
}

/// What effects that look back add to one sensor in every row, everything being as it is `seen`.
fn added_by_the_past(log: &Log, parts: &[Part], sensor: Sensor, seen: &Seen, n: usize) -> Result<Triple, EffectError> {
    let mut sum = Triple::zeros(n);
    let ideal = seen.ideal(&(0..n), log.attitude.as_deref());
    let mut columns = Columns::default();
    for part in parts.iter().filter(|p| p.looks_back()) {
        let rows = Rows {
            facts: log.facts,
            t: log.window.t,
            ideal: &ideal,
            force: &ideal.f,
            x: ideal.quantity(sensor),
            temperature: log.temperature.as_deref(),
            vibration: log.vibration.as_deref(),
            covariates: &log.covariates,
            position: &[],
            history: 0,
        };
        if let Some(added) = part.effect.added(&rows, sensor, &part.parameters)? {
            sum.add(&added, 1.0);
            continue;
        }
        columns.reset(n, part.parameters.len());
        part.effect.columns(&rows, sensor, &part.parameters, &mut columns)?;
        for (p, value) in part.parameters.iter().enumerate() {
            for (axis, target) in sum.0.iter_mut().enumerate() {
                for (y, c) in target.iter_mut().zip(columns.get(p, axis).unwrap_or_default()) {
                    *y += value * c;
                }
            }
        }
    }
    Ok(sum)
}

/// Corrects the sensors in turn until nothing changes.
fn in_turn(
    log: &Log,
    parts: &[Vec<Part>; 3],
    raw: &[Option<Triple>; 3],
    now: &mut [Option<Triple>; 3],
) -> Result<(), CorrectionError> {
    let read = |sensor: Sensor, other: Sensor| reads(&parts[sensor.index()], sensor, other) != (false, false);
    let mut order: Vec<Sensor> = Sensor::ALL
        .into_iter()
        .filter(|s| !parts[s.index()].is_empty())
        .collect();
    order.sort_by_key(|s| Sensor::ALL.iter().filter(|o| read(*s, **o)).count());
    let widths: Vec<_> = Sensor::ALL
        .iter()
        .map(|other| {
            let asked = Sensor::ALL.iter().any(|s| reads(&parts[s.index()], *s, *other).1);
            raw[other.index()]
                .as_ref()
                .filter(|_| asked)
                .map(|x| surroundings::width(x, log.window.t))
        })
        .collect();
    // A sensor is due until it was corrected with everything it reads as it is now.
    let mut due: Vec<Sensor> = order.clone();
    for _ in 0..MAX_TURNS {
        for sensor in order.clone() {
            if !due.contains(&sensor) {
                continue;
            }
            due.retain(|s| *s != sensor);
            let mut seen = Seen::default();
            for other in Sensor::ALL {
                let (value, rate) = reads(&parts[sensor.index()], sensor, other);
                let Some(x) = now[other.index()].as_ref() else { continue };
                if value {
                    seen.value[other.index()] = Some(surroundings::bridged(x, log.window.t));
                }
                if let Some(width) = widths[other.index()].filter(|_| rate) {
                    seen.rate[other.index()] = Some(surroundings::derivative(x, log.window.t, width));
                }
            }
            let k = sensor.index();
            let (Some(y), Some(x)) = (raw[k].as_ref(), now[k].as_mut()) else {
                continue;
            };
            let readers: Vec<Sensor> = order.iter().copied().filter(|s| read(*s, sensor)).collect();
            let before = (!readers.is_empty()).then(|| x.clone());
            correct_sensor(log, &parts[k], sensor, &seen, y, x)?;
            if before.is_some_and(|before| changed(&before, x, y)) {
                due.extend(readers);
            }
        }
        if due.is_empty() {
            return Ok(());
        }
    }
    let parts = due.iter().flat_map(|s| &parts[s.index()]);
    let coupled = parts.filter(|p| p.dependence.value.contains(&true) || p.dependence.rate.contains(&true));
    Err(CorrectionError::Restless {
        effects: names(coupled),
    })
}

/// True if a sample changed by more than rounding.
fn changed(before: &Triple, after: &Triple, reading: &Triple) -> bool {
    (0..after.len()).any(|i| {
        let size = after.row(i).amax().max(reading.row(i).amax());
        (0..3).any(|axis| (after.axis(axis)[i] - before.axis(axis)[i]).abs() > newton::NOTHING * size)
    })
}

/// Corrects one sensor, block by block, the others being as `seen`.
fn correct_sensor(
    log: &Log,
    parts: &[Part],
    sensor: Sensor,
    seen: &Seen,
    y: &Triple,
    x: &mut Triple,
) -> Result<(), CorrectionError> {
    let n = y.len();
    let stack: Vec<&Part> = parts.iter().filter(|p| !p.looks_back()).collect();
    let mut y = y.clone();
    if stack.len() < parts.len() {
        y.add(&added_by_the_past(log, parts, sensor, seen, n)?, -1.0);
    }
    let mut columns = Columns::default();
    for begin in (0..n).step_by(BLOCK_ROWS) {
        let rows = begin..(begin + BLOCK_ROWS).min(n);
        let mut block = Block {
            facts: log.facts,
            t: &log.window.t[rows.clone()],
            ideal: seen.ideal(&rows, log.attitude.as_deref()),
            temperature: log.temperature.as_ref().map(|t| &t[rows.clone()]),
            vibration: log.vibration.as_ref().map(|v| &v[rows.clone()]),
            covariates: log.covariates.iter().map(|c| c[rows.clone()].to_vec()).collect(),
            columns,
        };
        let measured = y.part(&rows);
        let mut quantity = x.part(&rows);
        if let Err(failure) = newton::solve(&mut block, &stack, sensor, &measured, &mut quantity) {
            return Err(told(failure, &mut block, parts, sensor, &measured, begin));
        }
        for axis in 0..3 {
            x.0[axis][rows.clone()].copy_from_slice(quantity.axis(axis));
        }
        columns = block.columns;
    }
    Ok(())
}

/// The failure with the effects behind it: those that cannot be undone even alone, else all of the sensor together.
fn told(
    failure: Failure,
    block: &mut Block,
    parts: &[Part],
    sensor: Sensor,
    measured: &Triple,
    begin: usize,
) -> CorrectionError {
    let (row, singular) = match failure {
        Failure::Effect(error) => return error.into(),
        Failure::Singular(row) => (row, true),
        Failure::Unreached(row) => (row, false),
    };
    let alone = parts.iter().filter(|part| {
        let failed = newton::solve(block, &[*part], sensor, measured, &mut measured.clone());
        matches!(failed, Err(Failure::Singular(_) | Failure::Unreached(_)))
    });
    let alone = names(alone);
    let effects = if alone.is_empty() { names(parts.iter()) } else { alone };
    let (row, sensor) = (begin + row, sensor.name());
    if singular {
        CorrectionError::Singular { effects, sensor, row }
    } else {
        CorrectionError::Unreached { effects, sensor, row }
    }
}

fn names<'a>(parts: impl Iterator<Item = &'a Part>) -> String {
    let ids: Vec<&str> = parts.map(|p| p.effect.card().id.as_str()).collect();
    ids.join(" and ")
}
