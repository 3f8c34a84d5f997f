//! How the temperature went during a log, coarsely: what depends on its past cannot be told from a window alone.

use crate::between_knots::between_knots;

/// Knots of a course; a log is cut into so many parts of as many rows.
pub const KNOTS: usize = 256;
/// Knots to either side that a rate is taken over.
const REACH: usize = 4;
/// Parts of the temperature's range within which a branch of a hysteresis turns over.
const WIDTHS: [f64; 2] = [0.15, 0.3];
/// What of the past may count: its rate, and a hysteresis of each width.
pub const PASTS: usize = 1 + WIDTHS.len();

/// Sums of the temperature over parts of a log.
#[derive(Clone, Debug)]
pub struct Parts {
    rows: usize,
    sums: Vec<(f64, f64, usize)>,
}

impl Parts {
    /// Empty sums for a log of so many rows.
    pub fn new(rows: usize) -> Self {
        Self {
            rows: rows.max(1),
            sums: vec![(0.0, 0.0, 0); KNOTS],
        }
    }

    /// Adds a row: its number, time and temperature.
    pub fn add(&mut self, row: usize, t: f64, temperature: f64) {
        let part = (row * KNOTS / self.rows).min(KNOTS - 1);
        let sum = &mut self.sums[part];
        sum.0 += t;
        sum.1 += temperature;
        sum.2 += 1;
    }
}

/// What the past of the temperature amounts to, at knots.
#[derive(Clone, Debug, Default)]
pub struct TemperatureCourse {
    t: Vec<f64>,
    pasts: [Vec<f64>; PASTS],
}

impl TemperatureCourse {
    /// From the means of the parts that have any row; `None` where these are too few.
    pub fn of(parts: &Parts) -> Option<Self> {
        let known: Vec<(f64, f64)> = parts
            .sums
            .iter()
            .filter(|s| s.2 > 0)
            .map(|s| (s.0 / s.2 as f64, s.1 / s.2 as f64))
            .collect();
        if known.len() < KNOTS / 4 {
            return None;
        }
        let last = known.len() - 1;
        let rate = (0..known.len()).map(|k| {
            let (before, after) = (known[k.saturating_sub(REACH)], known[(k + REACH).min(last)]);
            (after.1 - before.1) / (after.0 - before.0).max(f64::MIN_POSITIVE)
        });
        let mut pasts: [Vec<f64>; PASTS] = Default::default();
        pasts[0] = rate.collect();
        let (low, high) = known
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), k| (a.min(k.1), b.max(k.1)));
        for (past, part) in pasts[1..].iter_mut().zip(WIDTHS) {
            let half = 0.5 * part * (high - low);
            let mut follower = known[0].1;
            *past = known
                .iter()
                .map(|(_, temperature)| {
                    follower = follower.clamp(temperature - half, temperature + half);
                    follower - temperature
                })
                .collect();
        }
        for past in &mut pasts {
            let mean = past.iter().sum::<f64>() / past.len() as f64;
            for value in past.iter_mut() {
                *value -= mean;
            }
        }
        Some(Self {
            t: known.iter().map(|k| k.0).collect(),
            pasts,
        })
    }

    /// One of the pasts at some times.
    pub fn at(&self, past: usize, t: &[f64]) -> Vec<f64> {
        between_knots(&self.t, |k| self.pasts[past][k], t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up and down again within a log of 5120 rows.
    fn course() -> TemperatureCourse {
        let mut parts = Parts::new(5120);
        for row in 0..5120 {
            let t = row as f64;
            parts.add(row, t, 30.0 - (t - 2560.0).abs() / 256.0);
        }
        TemperatureCourse::of(&parts).expect("every part is known")
    }

    #[test]
    fn the_rate_changes_its_sign_where_it_cools() {
        let rate = course().at(0, &[1000.0, 4000.0]);
        assert!((rate[0] - rate[1] - 2.0 / 256.0).abs() < 1e-9, "{rate:?}");
    }

    #[test]
    fn the_branches_of_a_hysteresis_are_as_far_apart_as_it_is_wide() {
        // The same temperature, once on the way up and once on the way down.
        let branch = course().at(2, &[1000.0, 4120.0]);
        assert!((branch[1] - branch[0] - 0.3 * 10.0).abs() < 0.1, "{branch:?}");
    }

    #[test]
    fn a_log_with_hardly_any_temperature_has_no_course() {
        let mut parts = Parts::new(5120);
        parts.add(0, 0.0, 20.0);
        assert!(TemperatureCourse::of(&parts).is_none());
    }
}
