//! The six sides of a sensor: which body axis points up.

use nalgebra::Vector3;

/// A body axis with its sign, in the order +x -x +y -y +z -z.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Side(usize);

/// Names of the sides in their order.
pub const NAMES: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];

impl Side {
    /// The side of that number in [`NAMES`].
    pub fn new(number: usize) -> Option<Self> {
        (number < 6).then_some(Self(number))
    }

    /// The axis nearest to a direction that points up; zero has none.
    pub fn nearest(up: &Vector3<f64>) -> Self {
        let axis = up.iamax();
        Self(2 * axis + usize::from(up[axis] < 0.0))
    }

    /// Number in [`NAMES`].
    pub fn number(self) -> usize {
        self.0
    }

    /// Unit vector of the axis, body frame.
    pub fn direction(self) -> Vector3<f64> {
        let mut direction = Vector3::zeros();
        direction[self.0 / 2] = if self.0.is_multiple_of(2) { 1.0 } else { -1.0 };
        direction
    }

    /// Angle (rad) between the axis and a direction.
    pub fn angle_to(self, up: &Vector3<f64>) -> f64 {
        self.direction().angle(up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_side_is_nearest_to_its_own_direction() {
        for number in 0..6 {
            let side = Side::new(number).expect("a side");
            let tilted = side.direction() * 9.8 + Vector3::new(1.0, -2.0, 1.5);
            assert_eq!(Side::nearest(&tilted), side);
            assert!(side.angle_to(&side.direction()) < 1e-7);
        }
        assert_eq!(Side::new(6), None);
    }
}
