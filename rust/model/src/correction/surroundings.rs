//! What an effect on one sensor sees of the other columns of a log: their values in every row, and their derivatives.

use nalgebra::{Quaternion, UnitQuaternion};

use crate::bandwidth::Bandwidth;
use crate::polynomials::Polynomials;
use crate::reference::{LocalReference, Widths};
use crate::smoothing::{Smoothing, derivatives};
use crate::triple::Triple;
use crate::window::{HOLD_ROWS, Window};

/// Rows from which the width of the derivative's polynomial is chosen.
const SAMPLES: usize = 400;

/// Samples and degree of the one-sided polynomial at the ends of a recording.
const END: Smoothing = Smoothing::uniform(4, 4);

/// Rows in which all three axes have a sample.
fn sampled(x: &Triple) -> Vec<usize> {
    (0..x.len())
        .filter(|i| x.row(*i).iter().all(|v| v.is_finite()))
        .collect()
}

/// Values in every row: those of a slow sensor are drawn straight between samples at most [`HOLD_ROWS`] rows apart, and held at the ends.
pub fn bridged(x: &Triple, t: &[f64]) -> Triple {
    let rows = sampled(x);
    let mut out = x.clone();
    if rows.len() == x.len() {
        return out;
    }
    let mut next = 0;
    for i in 0..t.len() {
        while next < rows.len() && rows[next] < i {
            next += 1;
        }
        if rows.get(next) == Some(&i) {
            continue;
        }
        let near = |k: Option<&usize>| k.copied().filter(|k| k.abs_diff(i) <= HOLD_ROWS);
        let before = near(next.checked_sub(1).and_then(|k| rows.get(k)));
        let after = near(rows.get(next));
        for axis in 0..3 {
            let column = x.axis(axis);
            out.0[axis][i] = match (before, after) {
                (Some(a), Some(b)) => {
                    let share = (t[i] - t[a]) / (t[b] - t[a]);
                    column[a] + share * (column[b] - column[a])
                }
                (Some(k), None) | (None, Some(k)) => column[k],
                (None, None) => f64::NAN,
            };
        }
    }
    out
}

/// Row by row, as a window keeps them.
pub fn interleaved(x: &Triple) -> Vec<f64> {
    let mut out = Vec::with_capacity(3 * x.len());
    for i in 0..x.len() {
        out.extend((0..3).map(|axis| x.axis(axis)[i]));
    }
    out
}

/// A window whose position is a sensor's readings, so that the reference's polynomials can be laid through them.
fn as_position<'a>(t: &'a [f64], readings: &'a [f64]) -> Window<'a> {
    Window {
        position: Some(readings),
        ..Window::over(t)
    }
}

/// How wide the polynomial through a sensor's samples may be: as wide as its own noise allows.
pub fn width(x: &Triple, t: &[f64]) -> Smoothing {
    let readings = interleaved(x);
    let window = as_position(t, &readings);
    let mut widths = Bandwidth::of_reading();
    widths.add(&window, (0..t.len()).step_by(t.len().div_ceil(SAMPLES).max(1)));
    widths.choose(&[], 0)
}

/// Time derivative in every row, from a local polynomial through the samples around it; NaN where there are too few.
pub fn derivative(x: &Triple, t: &[f64], width: Smoothing) -> Triple {
    let readings = interleaved(x);
    let window = as_position(t, &readings);
    let mut out = Triple::default();
    let Some(samples) = LocalReference::position(&window, None) else {
        return out;
    };
    let samples = Polynomials::new(samples, Widths::alike(width));
    let mut samples = samples.reader();
    let rows = sampled(x);
    let gap = HOLD_ROWS;
    let mut next = 0;
    for i in 0..t.len() {
        let rate = samples.at(t[i]).map(|local| local.lowest());
        while next < rows.len() && rows[next] < i {
            next += 1;
        }
        let rate = rate.or_else(|| at_the_end(x, t, &rows, i, next, gap));
        out.push(&rate.unwrap_or([f64::NAN; 3]).into());
    }
    out
}

/// Derivative where samples are missing on one side: from those nearest to the row.
fn at_the_end(x: &Triple, t: &[f64], rows: &[usize], i: usize, next: usize, gap: usize) -> Option<[f64; 3]> {
    let count = 2 * END.half_width + 1;
    let first = next
        .saturating_sub(END.half_width + 1)
        .min(rows.len().saturating_sub(count));
    let near = &rows[first..(first + count).min(rows.len())];
    let near: Vec<usize> = near.iter().copied().filter(|k| k.abs_diff(i) <= gap).collect();
    if near.len() < 2 {
        return None;
    }
    let times: Vec<f64> = near.iter().map(|k| t[*k]).collect();
    let values: Vec<[f64; 3]> = near.iter().map(|k| x.row(*k).into()).collect();
    derivatives(
        &times,
        t[i],
        Smoothing::uniform(END.degree.min(near.len() - 1), END.half_width),
        &values,
        1,
    )
    .map(|d| d[0])
}

/// The attitude of every row, the last known one held; NaN where none is near.
pub fn held_attitude(q: &[f64]) -> Vec<UnitQuaternion<f64>> {
    let known = |i: usize| q[4 * i..4 * i + 4].iter().all(|v| v.is_finite());
    let mut last: Option<usize> = None;
    (0..q.len() / 4)
        .map(|i| {
            if known(i) {
                last = Some(i);
            }
            last.filter(|k| i - k <= HOLD_ROWS).map_or_else(
                || UnitQuaternion::new_unchecked(Quaternion::from_parts(f64::NAN, nalgebra::Vector3::repeat(f64::NAN))),
                |k| UnitQuaternion::new_normalize(Quaternion::new(q[4 * k], q[4 * k + 1], q[4 * k + 2], q[4 * k + 3])),
            )
        })
        .collect()
}
