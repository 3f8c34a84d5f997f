//! How much of a reference's derivative the sensor explains, for every width of the local polynomial.
//!
//! The sensor's own errors must not decide, so the derivative is regressed on the reading, its slope (a delay) and, for the specific
//! force, on what a lever arm would add. What is left is noise of the reference, noise of the sensor, and what too wide a polynomial loses.

use std::collections::HashMap;

use imufit_model::bandwidth::{Bandwidth, WIDTHS};
use imufit_model::smoothing::Smoothing;
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};

/// Sensor readings and attitude at a sampled row.
#[derive(Clone, Copy, Debug)]
pub struct SampledRow {
    /// Angular rate and its change over two rows to either side.
    pub rate: (Vector3<f64>, Vector3<f64>),
    /// Specific force and its change.
    pub force: (Vector3<f64>, Vector3<f64>),
    /// Attitude as recorded.
    pub attitude: UnitQuaternion<f64>,
}

/// Sampled rows by row number.
pub type SampledRows = HashMap<usize, SampledRow>;

/// Target, columns with a value per axis, and columns that all axes share.
type Regressed = (Vector3<f64>, Vec<Vector3<f64>>, Vec<f64>);

/// Fewer rows than this decide nothing.
const MIN_ROWS: usize = 200;

/// Mean square of targets that remains after a regression on columns, axis by axis.
fn unexplained(rows: &[Regressed]) -> f64 {
    if rows.len() < MIN_ROWS {
        return f64::NAN;
    }
    let mut sum = 0.0;
    for axis in 0..3 {
        // Shared columns (readings) and columns of this axis (lever arm).
        let row = |k: usize| -> Vec<f64> {
            let (_, vectors, shared) = &rows[k];
            std::iter::once(1.0)
                .chain(shared.iter().copied())
                .chain(vectors.iter().map(|v| v[axis]))
                .collect()
        };
        let width = row(0).len();
        let mut x = DMatrix::zeros(rows.len(), width);
        let mut y = DVector::zeros(rows.len());
        for k in 0..rows.len() {
            for (j, v) in row(k).into_iter().enumerate() {
                x[(k, j)] = v;
            }
            y[k] = rows[k].0[axis];
        }
        let mut gram = x.tr_mul(&x);
        for j in 0..width {
            gram[(j, j)] *= 1.0 + 1e-9;
            gram[(j, j)] += 1e-300;
        }
        let Some(factor) = gram.cholesky() else { return f64::NAN };
        let left = &y - &x * factor.solve(&x.tr_mul(&y));
        sum += left.norm_squared() / rows.len() as f64;
    }
    sum
}

/// What a derivative leaves of the readings may exceed the least by this factor before a wider polynomial has lost motion.
const LOST: f64 = 1.05;

/// What each width leaves unexplained of the reference's derivative; infinite for those that lose motion.
///
/// A derivative that is smoothed away leaves nothing unexplained, and a noisy sensor could not explain it all before. So the readings
/// are asked as well: of the widths beyond the one that explains them best those count that explain them as well.
fn errors(samples: &[Vec<Regressed>]) -> Vec<f64> {
    let of_readings = |rows: &Vec<Regressed>| {
        let turned = |(derivative, vectors, shared): &Regressed| {
            let (readings, rest) = shared.split_at(3);
            let columns: Vec<f64> = derivative.iter().chain(&rest[3..]).copied().collect();
            (Vector3::from_column_slice(readings), vectors.clone(), columns)
        };
        unexplained(&rows.iter().map(turned).collect::<Vec<_>>())
    };
    let readings: Vec<f64> = samples.iter().map(of_readings).collect();
    let known = (0..readings.len()).filter(|k| readings[*k].is_finite());
    let best = known.min_by(|a, b| readings[*a].total_cmp(&readings[*b]));
    let lost = |k: usize| best.is_some_and(|best| k > best && readings[k] > LOST * readings[best]);
    let error = |(k, rows): (usize, &Vec<Regressed>)| if lost(k) { f64::INFINITY } else { unexplained(rows) };
    samples.iter().enumerate().map(error).collect()
}

/// An axis turns if its rate stands out of the reference's noise by this factor.
const TURNING: f64 = 2.5;

/// Body axes along which a vector fixed in the reference frame never stands out of the noise of the attitude, rad.
pub fn silent_axes(rows: &SampledRows, v: &Vector3<f64>, noise: f64) -> [bool; 3] {
    let mut square = Vector3::<f64>::zeros();
    for row in rows.values() {
        let x = row.attitude.inverse_transform_vector(v);
        square += x.component_mul(&x);
    }
    let limit = TURNING * noise * v.norm();
    std::array::from_fn(|axis| (square[axis] / rows.len().max(1) as f64).sqrt() < limit)
}

/// Axes whose rates are nothing but noise of the reference at the width chosen.
pub fn still_axes(widths: &Bandwidth, chosen: Smoothing) -> [bool; 3] {
    let noise = widths.derivative_noise(chosen);
    let k = WIDTHS.iter().position(|w| *w == chosen).unwrap_or(0);
    let (mut sum, mut n) = ([0.0; 3], 0.0_f64);
    for (_, rate, _) in widths.sampled(k) {
        for axis in 0..3 {
            sum[axis] += rate[axis] * rate[axis];
        }
        n += 1.0;
    }
    sum.map(|s| (s / n.max(1.0)).sqrt() < TURNING * noise)
}

/// Width for the attitude of a log of `n` rows.
pub fn of_attitude(widths: &Bandwidth, rows: &SampledRows, n: usize) -> Smoothing {
    let samples: Vec<Vec<Regressed>> = (0..WIDTHS.len())
        .map(|k| {
            widths
                .sampled(k)
                .filter_map(|(row, rate, _)| {
                    let (y, slope) = rows.get(&row)?.rate;
                    let shared: Vec<f64> = y.iter().chain(slope.iter()).copied().collect();
                    shared
                        .iter()
                        .all(|v| v.is_finite())
                        .then(|| (Vector3::from(rate), vec![], shared))
                })
                .collect()
        })
        .collect();
    widths.choose(&errors(&samples), n)
}

/// Width for the position, with the rates of the attitude at the width chosen for it.
pub fn of_position(
    widths: &Bandwidth,
    attitude: &Bandwidth,
    chosen: Smoothing,
    rows: &SampledRows,
    n: usize,
) -> Smoothing {
    let k = WIDTHS.iter().position(|w| *w == chosen).unwrap_or(0);
    let rates: HashMap<usize, (Vector3<f64>, Vector3<f64>)> = attitude
        .sampled(k)
        .map(|(row, rate, above)| (row, (Vector3::from(rate), Vector3::from(above))))
        .collect();
    let samples: Vec<Vec<Regressed>> = (0..WIDTHS.len())
        .map(|k| {
            widths
                .sampled(k)
                .filter_map(|(row, acceleration, _)| {
                    let (at, (omega, alpha)) = (rows.get(&row)?, rates.get(&row)?);
                    let target = at.attitude.inverse_transform_vector(&Vector3::from(acceleration));
                    // Gravity turns with the attitude: its direction is a column, so that nothing depends on its size.
                    let up = at.attitude.inverse_transform_vector(&Vector3::z());
                    let lever = (0..3).map(|j| {
                        let unit = Vector3::ith(j, 1.0);
                        omega.cross(&omega.cross(&unit)) + alpha.cross(&unit)
                    });
                    let vectors: Vec<Vector3<f64>> = lever.collect();
                    let shared: Vec<f64> = at
                        .force
                        .0
                        .iter()
                        .chain(at.force.1.iter())
                        .chain(up.iter())
                        .copied()
                        .collect();
                    shared
                        .iter()
                        .all(|v| v.is_finite())
                        .then_some((target, vectors, shared))
                })
                .collect()
        })
        .collect();
    widths.choose(&errors(&samples), n)
}
