//! Readings of a late or sluggish sensor set right in time.

use std::sync::Arc;

use crate::card::Stage;
use crate::correction::surroundings::{derivative, width};
use crate::effect::Effect;
use crate::ideal::{ReferenceChange, SensorTime};
use crate::triple::Triple;

/// Samples further apart than this many times the median tell nothing of the time between.
const GAP: f64 = 3.5;

/// How late and sluggish each sensor is.
pub fn of(effects: &[(Arc<dyn Effect>, Vec<f64>)]) -> [SensorTime; 3] {
    let timing = effects.iter().filter(|(e, _)| e.card().stage == Stage::Time);
    timing
        .fold(ReferenceChange::default(), |change, (e, parameters)| {
            change.and(e.reference_change(parameters))
        })
        .sensors
}

/// The quantity of each row: `x = y + lag dy/dt`, read `delay` later. NaN where the readings end before.
pub fn set_right(y: &Triple, t: &[f64], time: SensorTime) -> Triple {
    let mut x = y.clone();
    if time.lag != 0.0 {
        x.add(&derivative(y, t, width(y, t)), time.lag);
    }
    if time.delay != 0.0 {
        x = read_later(&x, t, time.delay);
    }
    x
}

/// What the rows of a sensor read `delay` later: a cubic through four samples around that time.
fn read_later(x: &Triple, t: &[f64], delay: f64) -> Triple {
    let rows: Vec<usize> = (0..x.len())
        .filter(|i| x.row(*i).iter().all(|v| v.is_finite()))
        .collect();
    let mut steps: Vec<f64> = rows.windows(2).map(|w| t[w[1]] - t[w[0]]).collect();
    let mut out = Triple(std::array::from_fn(|_| vec![f64::NAN; x.len()]));
    if rows.len() < 4 {
        return out;
    }
    let middle = steps.len() / 2;
    let widest = GAP * *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let mut next = 0;
    for &row in &rows {
        let at = t[row] + delay;
        while next > 0 && t[rows[next - 1]] > at {
            next -= 1;
        }
        while next < rows.len() && t[rows[next]] <= at {
            next += 1;
        }
        // The samples before and after, and one more on either side.
        if next == 0 || next == rows.len() || t[rows[next]] - t[rows[next - 1]] > widest {
            continue;
        }
        let first = next.saturating_sub(2).min(rows.len() - 4);
        let near = &rows[first..first + 4];
        for axis in 0..3 {
            out.0[axis][row] = near
                .iter()
                .map(|k| {
                    let others = near.iter().filter(|j| *j != k);
                    others.fold(x.axis(axis)[*k], |v, j| v * (at - t[*j]) / (t[*k] - t[*j]))
                })
                .sum();
        }
    }
    out
}
