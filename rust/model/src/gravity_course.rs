//! How gravity went through the body's axes during a log, coarsely: what depends on seconds of its past is not known from a window alone.

use nalgebra::Vector3;

use crate::between_knots::between_knots;

/// Knots of a course; a log is cut into so many parts of as many rows. Of ten minutes a part is 0.15 s, a fraction of the shortest memory.
const KNOTS: usize = 4096;
/// Time constants of memories, s: so many first-order lags side by side, each four times as long as the one before, make up any creep of a
/// spring within some seconds (Prony series; Ferry 1980, Viscoelastic properties of polymers, ch. 3).
const TIMES: [f64; 3] = [1.0, 4.0, 16.0];
/// Memories that a course has.
pub const MEMORIES: usize = TIMES.len();
/// Least number of known knots of a course.
const LEAST: usize = 16;

/// Sums of specific force at rest in the body frame over parts of a log.
#[derive(Clone, Debug)]
pub struct GravityParts {
    rows: usize,
    sums: Vec<(f64, Vector3<f64>, f64)>,
}

impl GravityParts {
    /// Empty sums for a log of so many rows.
    pub fn new(rows: usize) -> Self {
        Self {
            rows: rows.max(1),
            sums: vec![(0.0, Vector3::zeros(), 0.0); KNOTS.min(rows.max(1))],
        }
    }

    /// Adds a row: its number, time (s) and gravity in the body frame (m/s^2).
    pub fn add(&mut self, row: usize, t: f64, gravity: Vector3<f64>) {
        let parts = self.sums.len();
        let sum = &mut self.sums[(row * parts / self.rows).min(parts - 1)];
        sum.0 += t;
        sum.1 += gravity;
        sum.2 += 1.0;
    }
}

/// What the past of gravity along each axis of the body amounts to, at knots: first-order lags.
#[derive(Clone, Debug)]
pub struct GravityCourse {
    t: Vec<f64>,
    memories: [Vec<Vector3<f64>>; MEMORIES],
}

impl GravityCourse {
    /// From the means of the parts that have any row; `None` where these are too few. Before the log gravity was as at its start.
    pub fn of(parts: &GravityParts) -> Option<Self> {
        let known = parts.sums.iter().filter(|s| s.2 > 0.0);
        let known: Vec<(f64, Vector3<f64>)> = known.map(|(t, g, n)| (t / n, g / *n)).collect();
        if known.len() < LEAST {
            return None;
        }
        let memories = TIMES.map(|time| {
            let (mut last, mut memory) = known[0];
            let follow = |(t, gravity): &(f64, Vector3<f64>)| {
                memory += (gravity - memory) * -(-(t - last).max(0.0) / time).exp_m1();
                last = *t;
                memory
            };
            known.iter().map(follow).collect()
        });
        Some(Self {
            t: known.iter().map(|k| k.0).collect(),
            memories,
        })
    }

    /// One of the memories along an axis at some times.
    pub fn at(&self, memory: usize, axis: usize, t: &[f64]) -> Vec<f64> {
        between_knots(&self.t, |k| self.memories[memory][k][axis], t)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gravity along z that jumps to x after 60 s of 120 s, at 100 Hz.
    fn course() -> GravityCourse {
        let mut parts = GravityParts::new(12000);
        for row in 0..12000 {
            let gravity = if row < 6000 { Vector3::z() } else { Vector3::x() };
            parts.add(row, row as f64 / 100.0, 9.8 * gravity);
        }
        GravityCourse::of(&parts).expect("every part is known")
    }

    #[test]
    fn a_step_is_followed_with_each_time_constant() {
        let course = course();
        for (memory, time) in TIMES.into_iter().enumerate() {
            let at = course.at(memory, 0, &[59.0, 60.0 + time, 119.99]);
            let end = 1.0 - (-60.0 / time).exp();
            assert!(at[0].abs() < 1e-12, "{at:?}");
            assert!((at[1] / 9.8 - (1.0 - (-1.0f64).exp())).abs() < 0.02, "{time}: {at:?}");
            assert!((at[2] / 9.8 - end).abs() < 1e-3, "{time}: {at:?}");
        }
    }

    #[test]
    fn times_in_windows_give_what_all_times_give() {
        let course = course();
        let all: Vec<f64> = (0..1200).map(|k| 0.1 * f64::from(k)).collect();
        let parts: Vec<f64> = all.chunks(70).flat_map(|part| course.at(1, 2, part)).collect();
        assert_eq!(parts, course.at(1, 2, &all));
    }

    #[test]
    fn a_log_with_hardly_any_attitude_has_no_course() {
        let mut parts = GravityParts::new(5120);
        parts.add(0, 0.0, Vector3::z());
        assert!(GravityCourse::of(&parts).is_none());
    }
}
