//! What fitting relies on, checked for every effect, the user's too.

use std::sync::Arc;

use crate::card::{Affine, Found, Reach, Stage};
use crate::correction::dependence::dependence;
use crate::effect::{Effect, EffectError};
use crate::facts::LogFacts;
use crate::sensor::Sensor;
use crate::sensor_model::{Evaluation, SensorModel};
use crate::window::Window;

fn violated(effect: &Arc<dyn Effect>, message: String) -> EffectError {
    EffectError::Contract {
        effect: effect.card().id.clone(),
        message,
    }
}

fn evaluate(
    effect: &Arc<dyn Effect>,
    at: &[f64],
    window: &Window,
    facts: &LogFacts,
) -> Result<Evaluation, EffectError> {
    SensorModel::new(vec![(effect.clone(), at.to_vec())], vec![], facts)?.evaluate(window, facts)
}

/// Where the axis stands that the byte of a name means.
fn place(name: Option<&u8>) -> Option<usize> {
    b"xyz".iter().position(|axis| Some(axis) == name)
}

/// Checks that an effect which says that it is a constant offset or gain is one.
fn check_affine(effect: &Arc<dyn Effect>, here: &Evaluation, active: &[Vec<usize>]) -> Result<(), EffectError> {
    let (Some(part), None) = (effect.card().traits.affine, effect.column()) else {
        return Ok(());
    };
    let ideal = [&here.ideal.f, &here.ideal.omega, &here.ideal.m];
    for (c, channel) in here.channels.iter().enumerate() {
        let (x, axis) = (ideal[c / 3], c % 3);
        let Some(channel) = channel else { continue };
        for (parameter, card) in effect.card().parameters.iter().enumerate() {
            let name = card.name.as_bytes();
            let column = active[c]
                .iter()
                .position(|p| *p == parameter)
                .map(|k| &channel.columns[k]);
            let times = if part == Affine::Offset {
                None
            } else {
                place(name.last())
            };
            let acts = place(name.first()) == Some(axis);
            for row in 0..channel.residual.len() {
                let quantity = times.map_or(1.0, |k| x.axis(k)[row]);
                let (expected, value) = (if acts { quantity } else { 0.0 }, column.map_or(0.0, |v| v[row]));
                if effect.sensors().contains(&Sensor::ALL[c / 3])
                    && (value - expected).abs() > 1e-9 * (1.0 + expected.abs())
                {
                    let message = format!("column {} is not what its trait affine says (row {row})", card.name);
                    return Err(violated(effect, message));
                }
            }
        }
    }
    Ok(())
}

/// Checks that an effect which says that a row alone decides what it adds there reads no other.
fn check_reach(
    effect: &Arc<dyn Effect>,
    at: &[f64],
    here: &Evaluation,
    window: &Window,
    facts: &LogFacts,
) -> Result<(), EffectError> {
    let declared = effect.card().traits.reach == Reach::Row;
    if !declared || window.t.is_empty() {
        return Ok(());
    }
    let refused = |what: &str| Err(violated(effect, format!("reach is the row, but it reads {what}")));
    for sensor in effect.sensors() {
        let found = dependence(effect.as_ref(), *sensor, at, facts, window.t, &here.covariates)?;
        if found.rate.contains(&true) {
            return refused("a derivative, which the rows around a row tell");
        }
        if found.attitude {
            return refused("the attitude");
        }
    }
    let mut earlier = facts.clone();
    earlier.t_start -= 1.0;
    let moved = evaluate(effect, at, window, &earlier)?;
    let both = here.channels.iter().flatten().zip(moved.channels.iter().flatten());
    let mut values = both.flat_map(|(a, b)| a.columns.iter().flatten().zip(b.columns.iter().flatten()));
    if values.any(|(a, b)| (a - b).abs() > 1e-9 * a.abs()) {
        return refused("the time since the start");
    }
    Ok(())
}

/// Checks an effect on a window: its columns are finite wherever the reference is known, agree with a difference quotient of the modelled
/// reading at the parameters `at`, do not depend on where the rows are cut, and are what its traits say.
pub fn check(effect: &Arc<dyn Effect>, at: &[f64], window: &Window, facts: &LogFacts) -> Result<(), EffectError> {
    let here = evaluate(effect, at, window, facts)?;
    let model = SensorModel::new(vec![(effect.clone(), at.to_vec())], vec![], facts)?;
    let known: Vec<bool> = here.ideal.omega.axis(0).iter().map(|v| v.is_finite()).collect();
    let late = effect.card().stage == Stage::Time;
    for (c, channel) in here.channels.iter().enumerate() {
        let Some(channel) = channel else { continue };
        // What a late sensor shows, the reference may not know yet, or not any more.
        let known = known.iter().zip(&channel.residual);
        let known: Vec<bool> = known.map(|(k, r)| *k && (!late || r.is_finite())).collect();
        for (column, parameter) in channel.columns.iter().zip(&model.active()[c]) {
            if let Some(row) = (0..column.len()).find(|i| known[*i] && !column[*i].is_finite()) {
                let name = &effect.card().parameters[*parameter].name;
                return Err(violated(
                    effect,
                    format!("column {name} is not finite in row {}", window.begin + row),
                ));
            }
        }
    }
    for (parameter, card) in effect
        .card()
        .parameters
        .iter()
        .enumerate()
        .filter(|(_, card)| card.found != Found::Search && !effect.columns_are_quotients())
    {
        let h = 1e-3 * card.typical.unwrap_or(1.0);
        let (mut above, mut below) = (at.to_vec(), at.to_vec());
        above[parameter] += h;
        below[parameter] -= h;
        let (above, below) = (
            evaluate(effect, &above, window, facts)?,
            evaluate(effect, &below, window, facts)?,
        );
        for c in 0..here.channels.len() {
            let (Some(channel), Some(above), Some(below)) = (&here.channels[c], &above.channels[c], &below.channels[c])
            else {
                continue;
            };
            let column = model.active()[c]
                .iter()
                .position(|p| *p == parameter)
                .map(|k| &channel.columns[k]);
            let size = column.map_or(0.0, |v| {
                v.iter().filter(|x| x.is_finite()).fold(0.0_f64, |m, x| m.max(x.abs()))
            });
            for row in 0..known.len() {
                // The residual is measured less modelled.
                let quotient = (below.residual[row] - above.residual[row]) / (2.0 * h);
                let value = column.map_or(0.0, |v| v[row]);
                let reading = channel.residual[row].abs().max(1.0);
                if quotient.is_finite() && (quotient - value).abs() > 1e-4 * size + 1e-12 * reading / h {
                    let message = format!(
                        "d reading / d {} is {value} in row {}, the difference quotient is {quotient}",
                        card.name,
                        window.begin + row
                    );
                    return Err(violated(effect, message));
                }
            }
        }
    }
    check_affine(effect, &here, model.active())?;
    check_reach(effect, at, &here, window, facts)?;
    let middle = usize::midpoint(window.begin, window.end);
    let parts = [
        evaluate(effect, at, &window.with_core(window.begin, middle), facts)?,
        evaluate(effect, at, &window.with_core(middle, window.end), facts)?,
    ];
    for c in 0..here.channels.len() {
        let Some(channel) = &here.channels[c] else { continue };
        for (k, column) in channel.columns.iter().enumerate() {
            let cut = parts
                .iter()
                .flat_map(|p| p.channels[c].iter().flat_map(|ch| ch.columns[k].iter()));
            let size = column
                .iter()
                .filter(|v| v.is_finite())
                .fold(0.0_f64, |m, v| m.max(v.abs()));
            for (row, (a, b)) in column.iter().zip(cut).enumerate() {
                if (a - b).abs() > 1e-9 * size {
                    let name = &effect.card().parameters[model.active()[c][k]].name;
                    let message = format!(
                        "column {name} depends on where the rows are cut (row {})",
                        window.begin + row
                    );
                    return Err(violated(effect, message));
                }
            }
        }
    }
    Ok(())
}
