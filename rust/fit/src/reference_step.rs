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
