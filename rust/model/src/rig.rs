//! A one-axis rig that turns the sensor by a commanded angle: its geometry, its travel, and play in its drive.

use nalgebra::{UnitQuaternion, Vector3};

/// A point of the travel: a reversal, or one passed on a long way in one direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Knot {
    /// Time, s.
    pub t: f64,
    /// Commanded angle without wraps, rad.
    pub angle: f64,
}

/// What is known of the rig of a log.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Axis of rotation in the body frame of the reference, unit.
    pub axis: Vector3<f64>,
    /// Reference attitude at the angle zero.
    pub zero: UnitQuaternion<f64>,
    /// Reversals of the travel and points between, in the order of time: from one to the next the drive goes one way.
    pub knots: Vec<Knot>,
}

/// Rotation about an axis that an attitude holds, rad, in (-pi, pi].
pub fn twist(attitude: &UnitQuaternion<f64>, axis: &Vector3<f64>) -> f64 {
    wrapped(2.0 * attitude.imag().dot(axis).atan2(attitude.w))
}

/// An angle in (-pi, pi].
pub fn wrapped(angle: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let rest = angle.rem_euclid(turn);
    if rest > std::f64::consts::PI { rest - turn } else { rest }
}

impl Rig {
    /// Commanded angle of a reference attitude, rad, in (-pi, pi].
    pub fn angle(&self, attitude: &UnitQuaternion<f64>) -> f64 {
        twist(&(self.zero.inverse() * attitude), &self.axis)
    }
}

/// What the rig does to the commanded angle: the axis stands at the commanded angle plus an error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RigError {
    /// Play of the drive, rad: the axis is half of it behind the drive. Negative where it is the reference that lags.
    pub width: f64,
    /// Flexure: `k sin(angle)`, rad.
    pub flexure: f64,
    /// Periodic error: `a cos(N angle) + b sin(N angle)`, rad, with N.
    pub periodic: [f64; 3],
}

impl RigError {
    /// True if the axis stands where it is told to.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Both errors; of two periodic ones the one that has a period.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            width: self.width + other.width,
            flexure: self.flexure + other.flexure,
            periodic: if other.periodic[2] == 0.0 {
                self.periodic
            } else {
                other.periodic
            },
        }
    }

    /// Error of the angle and its first two derivatives at a commanded angle with rate and acceleration, and play as
    /// [`Play`] gives it.
    pub fn at(&self, angle: f64, rate: f64, acceleration: f64, play: Slack) -> [f64; 3] {
        let (sin, cos) = angle.sin_cos();
        let k = self.flexure;
        let mut error = [k * sin, k * cos * rate, k * (cos * acceleration - sin * rate * rate)];
        let [a, b, n] = self.periodic;
        if n != 0.0 {
            let (sin, cos) = (n * angle).sin_cos();
            let (value, slope) = (a * cos + b * sin, n * (b * cos - a * sin));
            error[0] += value;
            error[1] += slope * rate;
            error[2] += slope * acceleration - n * n * value * rate * rate;
        }
        error[0] += play.error;
        error[1] += play.follow * rate;
        error[2] += play.follow * acceleration;
        error
    }
}

/// Where the axis stands within the play of its drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slack {
    /// Angle of the axis less the commanded one, rad: minus half the width on the way up.
    pub error: f64,
    /// Change of `error` per change of the width.
    pub slope: f64,
    /// Change of `error` per change of the commanded angle: 0 while the drive carries the axis, -1 while it crosses
    /// the play (and the axis stands still).
    pub follow: f64,
}

impl Slack {
    /// A drive without play.
    pub const NONE: Self = Self {
        error: 0.0,
        slope: 0.0,
        follow: 0.0,
    };
}

/// The axis as it stood at a knot: angle, and its change per change of the width.
#[derive(Clone, Copy, Debug)]
struct Stand {
    axis: f64,
    slope: f64,
}

impl Stand {
    /// The axis once the drive has gone one way to `angle`.
    fn carried_to(self, angle: f64, width: f64) -> (Self, bool) {
        let half = 0.5 * width;
        // Without play the direction of travel decides which side touches.
        if self.axis < angle - half || (width == 0.0 && self.axis < angle) {
            (
                Self {
                    axis: angle - half,
                    slope: -0.5,
                },
                true,
            )
        } else if self.axis > angle + half {
            (
                Self {
                    axis: angle + half,
                    slope: 0.5,
                },
                true,
            )
        } else {
            (self, false)
        }
    }
}

/// Play of the drive followed through the travel, row after row in the order of time.
///
/// Between two knots the drive goes one way, so that the axis at a time follows from where it stood at the knot before.
pub struct Play<'a> {
    rig: &'a Rig,
    width: f64,
    sign: f64,
    next: usize,
    stand: Stand,
}

impl<'a> Play<'a> {
    /// Play of `width` rad, to be asked from the time `t` on. Before the first knot the axis stands amid the play.
    pub fn new(rig: &'a Rig, width: f64, t: f64) -> Self {
        let (width, sign) = (width.abs(), if width < 0.0 { -1.0 } else { 1.0 });
        let next = rig.knots.partition_point(|k| k.t <= t);
        // Once the drive has crossed the play in one go, what was before no longer matters.
        let first = (1..next)
            .rev()
            .find(|&k| (rig.knots[k].angle - rig.knots[k - 1].angle).abs() > width.max(f64::MIN_POSITIVE))
            .map_or(0, |k| k - 1);
        let start = rig.knots.get(first).map_or(0.0, |k| k.angle);
        let mut play = Self {
            rig,
            width,
            sign,
            next: (first + 1).min(next),
            stand: Stand {
                axis: start,
                slope: 0.0,
            },
        };
        play.advance(next);
        play
    }

    fn advance(&mut self, next: usize) {
        while self.next < next {
            self.stand = self.stand.carried_to(self.rig.knots[self.next].angle, self.width).0;
            self.next += 1;
        }
    }

    /// The slack at a time not before the last one asked, at a commanded angle up to whole turns.
    pub fn at(&mut self, t: f64, angle: f64) -> Slack {
        let knots = &self.rig.knots;
        let mut next = self.next;
        while next < knots.len() && knots[next].t <= t {
            next += 1;
        }
        self.advance(next);
        let Some(last) = knots.get(self.next.max(1) - 1) else {
            return Slack::NONE;
        };
        let angle = last.angle + wrapped(angle - last.angle);
        // On its way from one knot to the next the drive is never behind the first, however noisy the reference is.
        let angle = match knots.get(self.next) {
            Some(to) if to.angle > last.angle => angle.max(last.angle),
            Some(to) if to.angle < last.angle => angle.min(last.angle),
            _ => angle,
        };
        let (stand, carried) = self.stand.carried_to(angle, self.width);
        // A drive that rests against the axis carries it as much as one that moves.
        let carried = carried
            || self.width == 0.0
            || stand.slope != 0.0 && (stand.axis - angle - self.width * stand.slope).abs() < 1e-12;
        Slack {
            error: self.sign * (stand.axis - angle),
            slope: stand.slope,
            follow: if carried { 0.0 } else { -self.sign },
        }
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // exact by construction
mod tests {
    use super::*;

    fn rig(angles: &[f64]) -> Rig {
        Rig {
            axis: Vector3::x(),
            zero: UnitQuaternion::identity(),
            knots: angles
                .iter()
                .enumerate()
                .map(|(k, angle)| Knot {
                    t: 10.0 * k as f64,
                    angle: *angle,
                })
                .collect(),
        }
    }

    #[test]
    fn the_axis_lags_on_the_way_and_stands_while_the_drive_crosses_the_play() {
        let rig = rig(&[0.0, 1.0, -1.0]);
        let mut play = Play::new(&rig, 0.2, 0.0);
        assert_eq!(play.at(0.0, 0.0).error, 0.0);
        assert_eq!(play.at(0.5, 0.05).follow, -1.0);
        let up = play.at(5.0, 0.5);
        assert!((up.error + 0.1).abs() < 1e-12 && up.follow == 0.0 && up.slope == -0.5);
        let crossing = play.at(11.0, 0.9);
        assert!((crossing.error).abs() < 1e-12 && crossing.follow == -1.0 && crossing.slope == -0.5);
        let down = play.at(15.0, 0.0);
        assert!((down.error - 0.1).abs() < 1e-12 && down.follow == 0.0 && down.slope == 0.5);
    }

    #[test]
    fn the_play_does_not_depend_on_where_it_is_first_asked() {
        // Small reversals within the play keep the memory of the last contact.
        let rig = rig(&[0.0, 1.0, 0.97, 0.99, 0.95, 2.0, 1.96, -1.0]);
        for width in [0.0, 0.05, 0.3] {
            for k in 0..70 {
                let t = f64::from(k) * 1.0;
                let at = |play: &mut Play, t: f64| {
                    let i = (t / 10.0) as usize;
                    let (a, b) = (rig.knots[i], rig.knots[(i + 1).min(7)]);
                    play.at(t, a.angle + (b.angle - a.angle) * (t - a.t) / 10.0)
                };
                let mut whole = Play::new(&rig, width, 0.0);
                for j in 0..k {
                    at(&mut whole, f64::from(j));
                }
                assert_eq!(at(&mut whole, t), at(&mut Play::new(&rig, width, t), t));
            }
        }
    }

    #[test]
    fn noise_of_the_angle_is_no_crossing_on_the_way() {
        let rig = rig(&[0.0, 1.0, 2.0, -1.0]);
        let mut play = Play::new(&rig, 0.2, 0.0);
        for (t, angle) in [(9.9, 0.99), (10.0, 0.9997), (10.1, 1.01)] {
            let slack = play.at(t, angle);
            assert!(slack.follow == 0.0 && (slack.error + 0.1).abs() < 1e-12);
        }
    }

    #[test]
    fn a_twist_is_the_rotation_about_the_axis() {
        for angle in [-3.1, -0.4, 0.0, 2.0, 3.1] {
            let attitude = UnitQuaternion::from_scaled_axis(Vector3::y() * angle);
            assert!((twist(&attitude, &Vector3::y()) - angle).abs() < 1e-12);
            assert!(
                (twist(&UnitQuaternion::new_unchecked(-attitude.into_inner()), &Vector3::y()) - angle).abs() < 1e-12
            );
        }
    }
}
