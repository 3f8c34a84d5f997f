//! Columns of the probes.

use super::{CLEAR, Kind, Quantity, SMALL, WIDTHS, pairs};
use crate::effect::{Columns, Rows};
use crate::effects::lever_arm::accelerations_of_levers;
use crate::facts::LogFacts;
use crate::gravity_course::MEMORIES;
use crate::sensor::Sensor;
use crate::temperature_course::PASTS;
use crate::triple::Triple;
use nalgebra::Vector3;

/// Legendre polynomials in which a gain may go with time.
pub(super) const DEGREES: usize = 4;

/// Legendre polynomials of degree 1 to 4.
fn legendre(u: f64) -> [f64; DEGREES] {
    let square = u * u;
    [
        u,
        0.5 * (3.0 * square - 1.0),
        0.5 * u * (5.0 * square - 3.0),
        0.125 * ((35.0 * square - 30.0) * square + 3.0),
    ]
}

/// Rows on each side over which a velocity is taken.
const SPEED_ROWS: usize = 4;

/// Velocity of the reference position in every row, m/s; where it is not known, the last one.
fn velocities(rows: &Rows) -> Vec<Vector3<f64>> {
    let mut last = Vector3::zeros();
    (0..rows.len())
        .map(|i| {
            let (before, after) = (i.saturating_sub(SPEED_ROWS), (i + SPEED_ROWS).min(rows.len() - 1));
            if let (Some(p), Some(q)) = (rows.position.get(before), rows.position.get(after)) {
                let velocity = (q - p) / (rows.t[after] - rows.t[before]);
                if velocity.iter().all(|v| v.is_finite()) {
                    last = velocity;
                }
            }
            last
        })
        .collect()
}

/// Columns of a mounting that turns as much as `by` says: each axis sees the other two.
fn fill_turn(rows: &Rows, by: &[f64], out: &mut Columns) {
    for shift in 1..3 {
        for axis in 0..3 {
            let other = rows.x.axis((axis + shift) % 3).iter();
            out.set(3 * (shift - 1) + axis, axis, by.iter().zip(other).map(|(b, x)| b * x));
        }
    }
}

/// Part of the log that has passed, from -0.5 to 0.5.
fn part_of(facts: &LogFacts, t: f64) -> f64 {
    (t - 0.5 * (facts.t_start + facts.t_end)) / (facts.t_end - facts.t_start)
}

/// A quantity less its mean; `None` where the log has it not.
fn deviation(rows: &Rows, quantity: Quantity) -> Option<Vec<f64>> {
    match quantity {
        Quantity::Temperature => rows.temperature.map(<[f64]>::to_vec),
        Quantity::Column(c) => {
            let mean = rows.facts.covariate_means.get(c)?;
            Some(rows.covariates.get(c)?.iter().map(|v| v - mean).collect())
        }
    }
}

/// Columns of a vector of which every axis sees every component.
fn fill_all(vector: &Triple, out: &mut Columns) {
    for other in 0..3 {
        for axis in 0..3 {
            out.set(3 * other + axis, axis, vector.axis(other).iter().copied());
        }
    }
}

/// Columns of a delay of a sensor that is as long as `by` says.
fn fill_delay(rows: &Rows, sensor: Sensor, by: &[f64], out: &mut Columns) {
    let rate = rows.ideal.rate(sensor);
    for axis in 0..3 {
        out.set(0, axis, by.iter().zip(rate.axis(axis)).map(|(b, r)| b * r));
    }
}

/// Angular rate at each row, rad/s.
fn rates(rows: &Rows) -> Vec<f64> {
    (0..rows.len()).map(|i| rows.ideal.omega.row(i).norm()).collect()
}

/// Fills the columns of a probe of a sensor.
pub(super) fn fill(kind: &Kind, sensor: Sensor, rows: &Rows, out: &mut Columns) {
    match kind {
        Kind::Gain(c) => {
            if let Some(by) = deviation(rows, Quantity::Column(*c)) {
                for axis in 0..3 {
                    out.set(axis, axis, by.iter().zip(rows.x.axis(axis)).map(|(c, x)| c * x));
                }
            }
        }
        Kind::Product(a, b) => {
            if let (Some(a), Some(b)) = (deviation(rows, *a), deviation(rows, *b)) {
                for axis in 0..3 {
                    out.set(axis, axis, a.iter().zip(&b).map(|(a, b)| a * b));
                }
            }
        }
        Kind::TemperaturePast => {
            if let Some(course) = &rows.facts.temperature_course {
                for past in 0..PASTS {
                    let by = course.at(past, rows.t);
                    for axis in 0..3 {
                        out.set(3 * past + axis, axis, by.iter().copied());
                    }
                }
            }
        }
        Kind::Creep => {
            if let Some(course) = &rows.facts.gravity_course {
                for memory in 0..MEMORIES {
                    for axis in 0..3 {
                        let followed = course.at(memory, axis, rows.t);
                        let x = rows.x.axis(axis).iter();
                        out.set(3 * memory + axis, axis, followed.iter().zip(x).map(|(y, x)| y - x));
                    }
                }
            }
        }
        Kind::GainInTime => {
            let parts: Vec<[f64; DEGREES]> = rows.t.iter().map(|t| legendre(2.0 * part_of(rows.facts, *t))).collect();
            for degree in 0..DEGREES {
                for axis in 0..3 {
                    let x = rows.x.axis(axis).iter();
                    out.set(3 * degree + axis, axis, parts.iter().zip(x).map(|(p, x)| p[degree] * x));
                }
            }
        }
        Kind::GainBent(q) => {
            if let Some(by) = deviation(rows, *q) {
                for axis in 0..3 {
                    out.set(axis, axis, by.iter().zip(rows.x.axis(axis)).map(|(c, x)| c * c * x));
                }
            }
        }
        Kind::TurnBy(q) => {
            if let Some(by) = deviation(rows, *q) {
                fill_turn(rows, &by, out);
            }
        }
        Kind::DelayBy(q) => {
            if let Some(by) = deviation(rows, *q) {
                fill_delay(rows, sensor, &by, out);
            }
        }
        Kind::RateBy(q) => {
            if let Some(by) = deviation(rows, *q) {
                let rates = rates(rows);
                for axis in 0..3 {
                    out.set(axis, axis, by.iter().zip(&rates).map(|(c, w)| c * w));
                }
            }
        }
        Kind::SquareBy(q) => {
            if let Some(by) = deviation(rows, *q) {
                for axis in 0..3 {
                    out.set(axis, axis, by.iter().zip(rows.x.axis(axis)).map(|(c, x)| c * x * x));
                }
            }
        }
        Kind::GainByRate => {
            let rates = rates(rows);
            for axis in 0..3 {
                out.set(axis, axis, rates.iter().zip(rows.x.axis(axis)).map(|(w, x)| w * w * x));
            }
        }
        Kind::Rate => {
            let rates = rates(rows);
            for axis in 0..3 {
                out.set(axis, axis, rates.iter().copied());
                out.set(3 + axis, axis, rates.iter().map(|w| w * w));
            }
        }
        Kind::Other(u) => fill_all(u.of(rows), out),
        Kind::OwnLevers => {
            for row in 0..rows.len() {
                for (k, a) in accelerations_of_levers(rows, row).into_iter().enumerate() {
                    for axis in 0..3 {
                        out.column(3 * k + axis, axis)[row] = a[axis];
                    }
                }
            }
        }
        Kind::Squares => {
            for other in 0..3 {
                for axis in 0..3 {
                    out.set(3 * other + axis, axis, rows.x.axis(other).iter().map(|m| m * m));
                }
            }
        }
        Kind::Plays => {
            for (k, part) in WIDTHS.iter().enumerate() {
                let width = part * rows.facts.field.norm();
                for axis in 0..3 {
                    let x = rows.x.axis(axis);
                    // What was before these rows is not known: it starts where they do.
                    let mut held = x.iter().copied().find(|x| x.is_finite()).unwrap_or(0.0);
                    let follow = |x: &f64| {
                        held = if x.is_finite() {
                            held.clamp(x - width, x + width)
                        } else {
                            held
                        };
                        held + x * 0.0
                    };
                    out.set(3 * k + axis, axis, x.iter().map(follow));
                }
            }
        }
        Kind::Heading => {
            let headings: Vec<(f64, f64)> = (0..rows.len())
                .map(|i| {
                    let x = rows.attitude(i) * Vector3::x();
                    let level = x.x.hypot(x.y).max(f64::MIN_POSITIVE);
                    (x.x / level, x.y / level)
                })
                .collect();
            let shapes: [fn(f64, f64) -> f64; 4] = [|c, _| c, |_, s| s, |c, s| c * c - s * s, |c, s| 2.0 * c * s];
            for (k, shape) in shapes.iter().enumerate() {
                for axis in 0..3 {
                    out.set(3 * k + axis, axis, headings.iter().map(|(c, s)| shape(*c, *s)));
                }
            }
        }
        Kind::Speed => {
            let speeds: Vec<f64> = velocities(rows).iter().map(Vector3::norm).collect();
            for axis in 0..3 {
                out.set(axis, axis, speeds.iter().copied());
                out.set(3 + axis, axis, speeds.iter().map(|v| v * v));
            }
        }
        Kind::Velocity => {
            for (row, velocity) in velocities(rows).iter().enumerate() {
                let body = rows.attitude(row).inverse_transform_vector(velocity);
                for axis in 0..3 {
                    out.column(axis, axis)[row] = body[axis];
                }
            }
        }
        Kind::Changes => fill_all(rows.ideal.rate(sensor), out),
        Kind::Cross(u, v) => {
            let (first, second) = (u.of(rows), v.of(rows));
            for (k, (i, j)) in pairs(*u, *v).enumerate() {
                for axis in 0..3 {
                    let product = first.axis(i).iter().zip(second.axis(j)).map(|(a, b)| a * b);
                    out.set(3 * k + axis, axis, product);
                }
            }
        }
        Kind::NearZero => {
            let full = if sensor == Sensor::Acc {
                rows.facts.gravity.norm()
            } else {
                1.0
            };
            // At rest an ideal reading is nothing but the noise of the reference.
            let least = CLEAR * rows.facts.column_noise[sensor.index()];
            for (k, part) in SMALL.iter().enumerate() {
                for axis in 0..3 {
                    let inside = |x: &f64| x.abs() < part * full && x.abs() > least;
                    let small = |x: &f64| if inside(x) { *x } else { 0.0 * x };
                    out.set(3 * k + axis, axis, rows.x.axis(axis).iter().map(small));
                }
            }
        }
        Kind::Gradient => {
            for row in 0..rows.len() {
                let p = rows.position.get(row).copied().unwrap_or_default() - rows.facts.position_origin;
                let gradients = [
                    [p.x, 0.0, -p.z],
                    [0.0, p.y, -p.z],
                    [p.y, p.x, 0.0],
                    [p.z, 0.0, p.x],
                    [0.0, p.z, p.y],
                ];
                for (k, field) in gradients.into_iter().enumerate() {
                    let body = rows.attitude(row).inverse_transform_vector(&field.into());
                    for axis in 0..3 {
                        out.column(k, axis)[row] = body[axis];
                    }
                }
            }
        }
    }
}
