//! The travel of a one-axis rig, kept as its reversals.

use imufit_model::rig::{Knot, Rig, wrapped};

/// Movements below this are no reversals, rad.
const LEAST: f64 = 1e-6;
/// A reversal is a movement of this many standard deviations of the reference's noise.
const BEYOND_NOISE: f64 = 6.0;
/// A way in one direction is marked at least this often, rad, so that whole turns are not lost.
const MARK: f64 = 1.0;
/// More knots than this are thinned out: the smaller reversals are noise or do not matter.
const MOST: usize = 200_000;

/// Reversals of a course of angles larger than a threshold.
#[derive(Clone, Debug)]
struct Reversals {
    least: f64,
    knots: Vec<Knot>,
    /// 0 before the first movement.
    direction: f64,
    extreme: Option<Knot>,
}

impl Reversals {
    fn new(least: f64) -> Self {
        Self {
            least,
            knots: Vec::new(),
            direction: 0.0,
            extreme: None,
        }
    }

    fn add(&mut self, now: Knot) {
        let Some(extreme) = self.extreme else {
            self.knots.push(now);
            self.extreme = Some(now);
            return;
        };
        let way = now.angle - extreme.angle;
        if self.direction == 0.0 {
            if way.abs() > self.least {
                self.direction = way.signum();
                self.extreme = Some(now);
            }
        } else if way * self.direction > 0.0 {
            self.extreme = Some(now);
            if self
                .knots
                .last()
                .is_some_and(|last| (now.angle - last.angle).abs() > MARK)
            {
                self.knots.push(now);
            }
        } else if way.abs() > self.least {
            self.knots.push(extreme);
            self.direction = -self.direction;
            self.extreme = Some(now);
        }
    }

    /// The knots, the last extreme among them.
    fn finish(mut self) -> Vec<Knot> {
        self.knots.extend(self.extreme);
        self.knots.dedup();
        self.knots
    }

    /// The same course with only the larger reversals.
    fn coarser(self, least: f64) -> Self {
        let mut out = Self::new(least);
        for knot in self.finish() {
            out.add(knot);
        }
        out
    }
}

/// Follows the commanded angle through a log.
#[derive(Clone, Debug)]
pub struct Travel {
    rig: Rig,
    last: Option<f64>,
    reversals: Reversals,
}

impl Travel {
    /// The travel of a rig, whose knots are still to be found.
    pub fn new(rig: Rig) -> Self {
        Self {
            rig,
            last: None,
            reversals: Reversals::new(LEAST),
        }
    }

    /// Adds a reference attitude; times must increase.
    pub fn add(&mut self, t: f64, attitude: &nalgebra::UnitQuaternion<f64>) {
        let angle = self.rig.angle(attitude);
        let angle = self.last.map_or(angle, |last| last + wrapped(angle - last));
        self.last = Some(angle);
        self.reversals.add(Knot { t, angle });
        if self.reversals.knots.len() > MOST {
            let least = 4.0 * self.reversals.least;
            let finer = std::mem::replace(&mut self.reversals, Reversals::new(least));
            self.reversals = finer.coarser(least);
        }
    }

    /// The rig with its reversals, where the noise of the reference has this standard deviation, rad.
    pub fn finish(mut self, noise: f64) -> Rig {
        let least = if noise.is_finite() { BEYOND_NOISE * noise } else { 0.0 };
        self.rig.knots = if least > self.reversals.least {
            self.reversals.coarser(least).finish()
        } else {
            self.reversals.finish()
        };
        self.rig
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    #[test]
    fn reversals_beyond_the_noise_are_found_and_whole_turns_are_not_lost() {
        let rig = Rig {
            axis: Vector3::y(),
            zero: UnitQuaternion::from_euler_angles(0.3, 0.2, 0.1),
            knots: vec![],
        };
        let mut travel = Travel::new(rig.clone());
        // Up by three turns, back by half a turn, with a ripple far below the movement.
        let way = |i: i32| {
            let ideal = if i < 600 {
                f64::from(i) * 0.01 * std::f64::consts::PI
            } else {
                (6.0 - f64::from(i - 600) * 0.01) * std::f64::consts::PI
            };
            ideal + 1e-4 * f64::from(i % 3 - 1)
        };
        for i in 0..=700 {
            let attitude = rig.zero * UnitQuaternion::from_scaled_axis(Vector3::y() * way(i));
            travel.add(f64::from(i), &attitude);
        }
        let knots = travel.finish(1e-4).knots;
        let top = knots.iter().max_by(|a, b| a.angle.total_cmp(&b.angle)).unwrap();
        assert!((top.angle - way(600)).abs() < 1e-3 && (top.t - 600.0).abs() <= 1.0);
        assert!(knots.windows(2).all(|k| (k[1].angle - k[0].angle).abs() < 2.5));
        let turned = knots
            .windows(3)
            .filter(|k| (k[1].angle - k[0].angle) * (k[2].angle - k[1].angle) < 0.0)
            .count();
        assert_eq!(turned, 1);
        assert!((knots.last().unwrap().angle - way(700)).abs() < 1e-9);
    }
}
