//! A reference that was interpolated onto the rows of the sensor: which rows stand nearest to what the instrument sampled.
//!
//! Between two samples the rows lie on a straight line (of the position) or a turn at a steady rate (of the attitude), so that only those
//! at its ends bear what was measured. A polynomial through all rows would take the line for the motion.

use nalgebra::Vector3;

use crate::usual_step::usual_step;

/// How the reference goes on in three rows.
#[derive(Clone, Copy, Debug)]
pub struct Course {
    /// Distance of the middle row from the straight line between the others.
    pub bend: Vector3<f64>,
    /// Way from the first to the last.
    pub way: Vector3<f64>,
}

/// Part of the root mean square bend below which a row counts as on the line, as a square: ten times less than a sample's own bend varies.
const STRAIGHT: f64 = 0.05 * 0.05;
/// The same of the way, below which a body counts as at rest.
const MOVING: f64 = 0.05 * 0.05;
/// Part of the rows of a moving body that lie on lines from which on they were interpolated. Three rows to a sample leave a third.
const SHARE: f64 = 0.3;
/// Fewer rows of a moving body do not decide.
const LEAST: usize = 64;
/// Part of the samples whose distance must be the usual one: an instrument samples by a clock, a turn at a steady rate ends when it ends.
const REGULAR: f64 = 0.5;
/// Correlation of a bend with the next one below which bends are those of noise or of rounding, which go back at once (white noise has
/// -2/3); a sample between two rows bends the course twice to one side.
const BACK: f64 = -0.1;
/// Rows to a sample from which on a log is taken for interpolated that was found so before.
const ROWS: f64 = 2.5;

/// Places among the rows with a reference that stand nearest to its samples; `None` where every row is a sample.
///
/// `spacing` is the usual time between samples, where it is known already: too few rows decide by it.
pub fn samples(t: &[f64], course: impl Fn(usize) -> Course, spacing: Option<f64>) -> Option<Vec<usize>> {
    if t.len() < 3 {
        return None;
    }
    let inner = 1..t.len() - 1;
    let courses: Vec<Course> = inner.clone().map(course).collect();
    let mean = |of: fn(&Course) -> f64| courses.iter().map(of).sum::<f64>() / courses.len().max(1) as f64;
    let (bend, way) = (mean(|c| c.bend.norm_squared()), mean(|c| c.way.norm_squared()));
    let moving = || courses.iter().filter(|c| c.way.norm_squared() > MOVING * way);
    let bent = |c: &Course| c.bend.norm_squared() >= STRAIGHT * bend;
    let decided = moving().count() >= LEAST;
    let straight = moving().filter(|c| !bent(c)).count();
    let next: f64 = courses.windows(2).map(|w| w[0].bend.dot(&w[1].bend)).sum();
    let row = usual_step(t);
    if !decided {
        spacing.filter(|usual| *usual > ROWS * row)?;
    } else if (straight as f64) < SHARE * moving().count() as f64 || next < BACK * bend * courses.len() as f64 {
        return None;
    }
    // A sample between two rows bends the course at both: the nearer one bends it more.
    let mut ends: Vec<usize> = Vec::new();
    for (k, c) in inner.zip(&courses).filter(|(_, c)| bent(c)) {
        match ends.last_mut() {
            Some(last) if k - *last == 1 => {
                if c.bend.norm() > courses[*last - 1].bend.norm() {
                    *last = k;
                }
            }
            _ => ends.push(k),
        }
    }
    let times: Vec<f64> = ends.iter().map(|k| t[*k]).collect();
    let usual = spacing
        .filter(|usual| *usual > ROWS * row)
        .unwrap_or_else(|| usual_step(&times));
    if usual < ROWS * row {
        return None;
    }
    let steps: Vec<f64> = times.windows(2).map(|w| w[1] - w[0]).collect();
    let regular = steps.iter().filter(|s| (**s - usual).abs() < 1.5 * row).count();
    if decided && (regular as f64) < REGULAR * steps.len() as f64 {
        return None;
    }
    Some(filled(t, &ends, usual))
}

/// Rows at the usual distance where a course without bends is longer: a body at rest, or one that turns steadily.
fn filled(t: &[f64], ends: &[usize], usual: f64) -> Vec<usize> {
    let mut all = Vec::with_capacity(ends.len());
    let bounds = [0].into_iter().chain(ends.iter().copied()).chain([t.len() - 1]);
    let mut last: Option<usize> = None;
    for end in bounds {
        if let Some(first) = last {
            let parts = ((t[end] - t[first]) / usual).round() as usize;
            let at = |part: usize| t[first] + (t[end] - t[first]) * part as f64 / parts as f64;
            all.extend((1..parts).map(|part| first + t[first..end].partition_point(|v| *v < at(part))));
        }
        all.push(end);
        last = Some(end);
    }
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn course(t: &[f64], y: &[f64], k: usize) -> Course {
        let share = (t[k] - t[k - 1]) / (t[k + 1] - t[k - 1]);
        Course {
            bend: Vector3::x() * (y[k] - y[k - 1] - share * (y[k + 1] - y[k - 1])),
            way: Vector3::x() * (y[k + 1] - y[k - 1]),
        }
    }

    fn found(t: &[f64], y: &[f64]) -> Option<Vec<usize>> {
        samples(t, |k| course(t, y, k), None)
    }

    fn motion(t: f64) -> f64 {
        (7.0 * t).sin() + 0.3 * (19.0 * t).cos()
    }

    /// Samples at `rate`, interpolated onto rows at 1 kHz; the body stands still for a second.
    fn interpolated(rate: f64) -> (Vec<f64>, Vec<f64>) {
        let t: Vec<f64> = (0..4000).map(|k| 1e-3 * f64::from(k)).collect();
        let sample = |k: f64| {
            let at = (k + 0.37) / rate;
            if (2.0..3.0).contains(&at) {
                motion(2.0)
            } else {
                motion(at)
            }
        };
        let y = t.iter().map(|t| {
            let at = t * rate - 0.37;
            let part = at - at.floor();
            (1.0 - part) * sample(at.floor()) + part * sample(at.floor() + 1.0)
        });
        (t.clone(), y.collect())
    }

    #[test]
    fn rows_nearest_to_the_samples_are_found_and_a_rest_is_not_a_gap() {
        for rate in [25.0, 100.0, 190.0] {
            let (t, y) = interpolated(rate);
            let rows = found(&t, &y).expect("interpolated");
            for pair in rows.windows(2) {
                let step = t[pair[1]] - t[pair[0]];
                assert!(step < 2.6 / rate, "{rate} {step}");
            }
            let near = |k: &&usize| {
                let phase = t[**k] * rate - 0.37;
                (phase - phase.round()).abs() < 0.5e-3 * rate + 1e-6
            };
            let moving: Vec<&usize> = rows.iter().filter(|k| !(1.9..3.1).contains(&t[**k])).collect();
            assert!(
                moving.iter().copied().filter(near).count() * 10 > 9 * moving.len(),
                "{rate}"
            );
        }
    }

    #[test]
    fn every_row_is_a_sample_of_a_dense_reference_a_steady_turn_or_noise() {
        let t: Vec<f64> = (0..4000).map(|k| 1e-3 * f64::from(k)).collect();
        let dense: Vec<f64> = t.iter().map(|t| motion(*t)).collect();
        assert!(found(&t, &dense).is_none());
        let turning: Vec<f64> = t.iter().map(|t| if *t < 1.3 { *t } else { 2.6 - *t }).collect();
        assert!(found(&t, &turning).is_none());
        let noise: Vec<f64> = (0..4000_u32)
            .map(|k| f64::from(k.wrapping_mul(2_654_435_761) >> 8))
            .collect();
        assert!(found(&t, &noise).is_none());
        let steps: Vec<f64> = t.iter().map(|t| (2000.0 * motion(0.1 * t)).round()).collect();
        assert!(found(&t, &steps).is_none());
    }
}
