//! The specific force at a joint that stands still, from that of an accelerometer at a distance from it.
//!
//! On a rigid arm that turns about the joint (paper C's robot arm; the dynamics it names as future work) the accelerometer at `r` feels
//!
//! ```text
//! f = R^T up g + dw/dt x r + w x (w x r)
//! ```
//!
//! so that taking the last two terms out leaves gravity alone, however the arm swings. The angular acceleration is the
//! difference of two rates over their time, followed by a low-pass of the time constant `lever_time`, so that a faster
//! log does not bring more noise: it is half a row and that time late. Over a whole recording a fitted `acc.lever_arm` is
//! taken out without a delay by applying the model.

use nalgebra::Vector3;

/// What is known of the motion, and the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LeverArm {
    /// From the joint to the accelerometer, body frame, m.
    pub arm: Vector3<f64>,
    /// Time constant of the angular acceleration, s.
    pub time: f64,
}

impl LeverArm {
    /// Whether there is one.
    #[inline(always)]
    pub fn is_some(&self) -> bool {
        self.arm != Vector3::zeros()
    }

    /// The angular acceleration after a step of `dt` (> 0) from rate `before` to `now`, rad/s^2.
    #[inline(always)]
    pub fn turn(&self, alpha: &mut Vector3<f64>, before: &Vector3<f64>, now: &Vector3<f64>, dt: f64) {
        let found = (now - before) / dt;
        *alpha += (found - *alpha) * -(-dt / self.time).exp_m1();
    }

    /// Specific force at the joint.
    #[inline(always)]
    pub fn at_joint(&self, f: &Vector3<f64>, omega: &Vector3<f64>, alpha: &Vector3<f64>) -> Vector3<f64> {
        f - alpha.cross(&self.arm) - omega.cross(&omega.cross(&self.arm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Specific force at the joint of an arm that swings about y, by differences of the position, after `rows` rows.
    fn error(lever: LeverArm, dt: f64, with: bool) -> f64 {
        let angle = |t: f64| 0.8 * (4.0 * t).sin();
        let rate = |t: f64| Vector3::y() * 3.2 * (4.0 * t).cos();
        let place = |t: f64| {
            let (s, c) = angle(t).sin_cos();
            let r = lever.arm;
            Vector3::new(c * r.x + s * r.z, r.y, c * r.z - s * r.x)
        };
        let (mut alpha, mut worst) = (Vector3::zeros(), 0.0_f64);
        for k in 1..2000 {
            let t = dt * f64::from(k);
            lever.turn(&mut alpha, &rate(t - dt), &rate(t), dt);
            let h = 1e-4;
            let acceleration = (place(t + h) + place(t - h) - place(t) * 2.0) / (h * h);
            let (s, c) = angle(t).sin_cos();
            let in_body = |v: &Vector3<f64>| Vector3::new(c * v.x - s * v.z, v.y, c * v.z + s * v.x);
            let f = in_body(&(acceleration + Vector3::z() * 9.81));
            let joint = if with { lever.at_joint(&f, &rate(t), &alpha) } else { f };
            worst = worst.max((joint - in_body(&(Vector3::z() * 9.81))).norm());
        }
        worst
    }

    #[test]
    fn gravity_alone_is_left_of_a_swinging_arm() {
        let lever = LeverArm {
            arm: Vector3::new(0.3, -0.1, 0.2),
            time: 0.0,
        };
        assert!(error(lever, 0.01, false) > 3.0);
        assert!(error(lever, 0.001, true) < 0.02);
        assert!(error(LeverArm { time: 0.005, ..lever }, 0.01, true) < 0.25);
    }
}
