//! The motion behind a reference that was smoothed, averaged or interpolated.
//!
//! An average over times around t, symmetric and of variance 2 c, adds c times the second derivative: to first order
//! p_ref = p + c d2p/dt2 and R_ref = R exp(c [alpha]). Taken back from the reference, this is exact for the average whose weights fall off
//! exponentially to both sides, a low-pass of first order that ran over the recording forwards and backwards.

use nalgebra::UnitQuaternion;

use crate::reference::Kinematics;
use crate::rotation_rates::right_jacobian;

impl Kinematics {
    /// The true motion, where the reference has lost `c` (s^2) times the second derivative of it.
    ///
    /// Of angular acceleration and jerk, which enter columns only, the loss would need one derivative more of a noisy reference; both stay.
    #[must_use]
    pub fn sharpened(&self, c: f64) -> Self {
        if c == 0.0 {
            return *self;
        }
        let lost = self.alpha * -c;
        let turn = UnitQuaternion::from_scaled_axis(lost);
        Self {
            attitude: self.attitude * turn,
            omega: turn.inverse_transform_vector(&self.omega) + right_jacobian(&lost) * (self.alpha_rate * -c),
            acceleration: self.acceleration - self.snap * c,
            ..*self
        }
    }
}
