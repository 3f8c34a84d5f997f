//! The true quantity of one sensor from its readings, row by row: Newton's iteration on three numbers.
//!
//! All effects on the sensor are undone together, whatever their stage: the reading is worked out at the quantity and a little beside
//! it along each axis, which gives the 3x3 gain of every row. Effects that are linear in the quantity need one step.

use nalgebra::{Matrix3, Vector3};

use crate::correction::stack::{Block, Part};
use crate::effect::EffectError;
use crate::sensor::Sensor;
use crate::triple::Triple;

/// Steps of at most this share of reading and quantity are none.
pub const NOTHING: f64 = 1e-12;
/// A reading met this well cannot be met better.
const ROUNDING: f64 = 2e-15;
/// Step of the difference quotient, as a share of the reading.
const BESIDE: f64 = 1e-3;
/// The gain of a row is kept as long as each step is at least this much smaller than the last.
const CONVERGING: f64 = 0.05;
const MAX_STEPS: usize = 40;
/// A gain with a smaller determinant, relative to its largest element, has no inverse.
const SINGULAR: f64 = 1e-9;

/// Why a row cannot be undone.
#[derive(Debug)]
pub enum Failure {
    /// An effect failed.
    Effect(EffectError),
    /// Different quantities give the same reading; row within the block.
    Singular(usize),
    /// No quantity gives this reading, or it is not found; row within the block.
    Unreached(usize),
}

impl From<EffectError> for Failure {
    fn from(error: EffectError) -> Self {
        Self::Effect(error)
    }
}

/// The gain of every row: d reading / d quantity, by differences.
fn gains(
    block: &mut Block,
    parts: &[&Part],
    sensor: Sensor,
    x: &Triple,
    reading: &Triple,
) -> Result<Vec<Matrix3<f64>>, EffectError> {
    let n = x.len();
    let size = (0..n)
        .map(|i| reading.row(i).amax())
        .filter(|v| v.is_finite())
        .fold(0.0, f64::max);
    let steps: Vec<f64> = (0..n)
        .map(|i| BESIDE * x.row(i).amax().max(0.1 * size).max(f64::MIN_POSITIVE.sqrt()))
        .collect();
    let mut gains = vec![Matrix3::zeros(); n];
    let mut beside = x.clone();
    for axis in 0..3 {
        for (value, step) in beside.0[axis].iter_mut().zip(&steps) {
            *value += step;
        }
        let other = block.reading(parts, sensor, &beside)?;
        for (i, gain) in gains.iter_mut().enumerate() {
            // The step that was really made, after rounding.
            let step = beside.axis(axis)[i] - x.axis(axis)[i];
            gain.set_column(axis, &((other.row(i) - reading.row(i)) / step));
        }
        beside.0[axis].copy_from_slice(x.axis(axis));
    }
    Ok(gains)
}

/// The inverse of a gain; `None` where it has none.
fn inverse(gain: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let (a, b, c) = (gain.column(0), gain.column(1), gain.column(2));
    let (bc, ca, ab) = (b.cross(&c), c.cross(&a), a.cross(&b));
    let determinant = a.dot(&bc);
    let inverse = Matrix3::from_columns(&[bc, ca, ab]).transpose() / determinant;
    (determinant.abs() > SINGULAR * gain.amax().powi(3)).then_some(inverse)
}

/// Axes that lack a sample themselves or read one that is lacking stand aside; the rest of the gain is inverted.
fn partial_inverse(gain: &Matrix3<f64>, lacking: &mut [bool; 3]) -> Option<Matrix3<f64>> {
    for _ in 0..2 {
        for axis in 0..3 {
            lacking[axis] |= (0..3).any(|other| other != axis && lacking[other] && gain[(axis, other)] != 0.0);
        }
    }
    let mut rest = *gain;
    for axis in (0..3).filter(|a| lacking[*a]) {
        for other in 0..3 {
            rest[(axis, other)] = 0.0;
            rest[(other, axis)] = 0.0;
        }
        rest[(axis, axis)] = 1.0;
    }
    inverse(&rest)
}

/// Solves reading(x) = y for the rows of a block, starting at `x`. NaN where y is, or where an effect cannot tell.
pub fn solve(block: &mut Block, parts: &[&Part], sensor: Sensor, y: &Triple, x: &mut Triple) -> Result<(), Failure> {
    let n = y.len();
    // A row with some of its axes is worked out with zero in the place of the others.
    let given: Vec<[bool; 3]> = (0..n)
        .map(|i| std::array::from_fn(|axis| y.axis(axis)[i].is_finite()))
        .collect();
    for axis in 0..3 {
        for i in 0..n {
            if !x.axis(axis)[i].is_finite() {
                let partly = given[i].contains(&true);
                let start = if given[i][axis] { y.axis(axis)[i] } else { 0.0 };
                x.0[axis][i] = if partly { start } else { f64::NAN };
            }
        }
    }
    let mut inverses: Vec<Matrix3<f64>> = Vec::new();
    let mut lacking: Vec<[bool; 3]> = given.iter().map(|g| g.map(|v| !v)).collect();
    let mut worst_before = f64::INFINITY;
    for _ in 0..MAX_STEPS {
        let reading = block.reading(parts, sensor, x)?;
        if inverses.is_empty() {
            let gains = gains(block, parts, sensor, x, &reading)?;
            for (i, gain) in gains.iter().enumerate() {
                lacking[i] = given[i].map(|v| !v);
                inverses.push(if gain.iter().any(|v| !v.is_finite()) {
                    lacking[i] = [true; 3];
                    Matrix3::zeros()
                } else if lacking[i] == [false; 3] {
                    inverse(gain).ok_or(Failure::Singular(i))?
                } else {
                    partial_inverse(gain, &mut lacking[i]).ok_or(Failure::Singular(i))?
                });
            }
        }
        let mut worst = (0.0_f64, 0);
        for i in 0..n {
            let mut left = y.row(i) - reading.row(i);
            for axis in (0..3).filter(|a| lacking[i][*a]) {
                left[axis] = 0.0;
            }
            if lacking[i] == [true; 3] || left == Vector3::zeros() {
                continue;
            }
            // `f64::max` passes over NaN.
            let size = [x.row(i), y.row(i), left]
                .iter()
                .flatten()
                .fold(0.0, |m: f64, v| m.max(v.abs()));
            let step = inverses[i] * left;
            for axis in 0..3 {
                x.0[axis][i] += step[axis];
            }
            let share = step.amax() / size;
            if share > worst.0 && left.amax() > ROUNDING * size {
                worst = (share, i);
            }
        }
        if worst.0 <= NOTHING {
            take_out(x, &lacking);
            return Ok(());
        }
        if !worst.0.is_finite() {
            return Err(Failure::Unreached(worst.1));
        }
        if worst.0 > CONVERGING * worst_before {
            inverses.clear();
        }
        worst_before = worst.0;
    }
    let reading = block.reading(parts, sensor, x)?;
    let off = |i: usize| (y.row(i) - reading.row(i)).amax() / y.row(i).amax();
    let row = (0..n)
        .filter(|i| off(*i).is_finite())
        .max_by(|a, b| off(*a).total_cmp(&off(*b)));
    Err(Failure::Unreached(row.unwrap_or(0)))
}

/// Takes out what stood in for missing samples, and rows that an effect could not tell.
fn take_out(x: &mut Triple, lacking: &[[bool; 3]]) {
    for axis in 0..3 {
        for (value, lacking) in x.0[axis].iter_mut().zip(lacking) {
            if lacking[axis] {
                *value = f64::NAN;
            }
        }
    }
}
