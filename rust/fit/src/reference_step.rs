//! Steps of the encoders that a reference comes from.

use nalgebra::UnitQuaternion;

/// Turns from one sample of the reference to the next.
#[derive(Clone, Debug)]
pub struct ReferenceStep {
    last: Option<UnitQuaternion<f64>>,
    /// The smallest that is one, rad.
    smallest: f64,
    /// How many are none.
    none: usize,
}

impl Default for ReferenceStep {
    fn default() -> Self {
        Self {
            last: None,
            smallest: f64::INFINITY,
            none: 0,
        }
    }
}

impl ReferenceStep {
    /// Adds the next sample.
    pub fn add(&mut self, attitude: UnitQuaternion<f64>) {
        if let Some(last) = self.last.replace(attitude) {
            // The sine of half the turn, which keeps its digits where the cosine is one.
            let turn = 2.0 * (last.inverse() * attitude).imag().norm().min(1.0).asin();
            if turn <= ROUNDING {
                self.none += 1;
            } else {
                self.smallest = self.smallest.min(turn);
            }
        }
    }

    /// The step, rad; 0 where the reference goes on smoothly. A body that begins to move slowly passes through ever smaller turns, so that
    /// one that really rests has no step.
    pub fn finish(&self) -> f64 {
        if self.none > 0 && self.smallest.is_finite() {
            self.smallest
        } else {
            0.0
        }
    }
}

/// Turns up to this, rad, are rounding of a quaternion in double precision.
const ROUNDING: f64 = 1e-14;

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// Step of a body that rests for a second, then turns to and fro slowly, as an encoder of this resolution shows.
    fn step(of: Option<f64>) -> f64 {
        let mut found = ReferenceStep::default();
        for i in 0..2000 {
            let t = f64::from(i) * 0.01;
            let angle = if t < 1.0 {
                0.3
            } else {
                0.3 + 0.2 * (1.0 - (t - 1.0).cos())
            };
            let shown = of.map_or(angle, |step| (angle / step).round() * step);
            found.add(UnitQuaternion::from_scaled_axis(Vector3::x() * shown));
        }
        found.finish()
    }

    #[test]
    fn an_encoder_shows_its_step_and_a_body_that_begins_to_move_has_none() {
        assert!((step(Some(2e-3)) - 2e-3).abs() < 1e-9);
        assert!(step(None) < 1e-4);
        assert!(ReferenceStep::default().finish() == 0.0);
    }
}
