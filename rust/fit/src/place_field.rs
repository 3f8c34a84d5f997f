//! The magnetic field of the place, from readings alone. An offset of the sensor is estimated beside the field: else a magnet that moves with
//! the sensor is taken for a part of the field.

use nalgebra::{Cholesky, Matrix3, UnitQuaternion, Vector3};

/// Prior precision of the offset, over that of one reading: the field of a room varies by 2 uT (docs/recordings.md: 0.8 to 1.8 uT), which may
/// follow the attitude, and boards have three times 20 uT of hard iron.
const OFFSET: f64 = (2.0 / 60.0) * (2.0 / 60.0);

/// Share of the field that no log is asked about as an offset: 0.05 uT of 50 uT, which is less than the standard error of hard iron in
/// recordings (docs/recordings.md: 0.1 to 3 uT).
const SEEN: f64 = 1e-3;

/// Sums over the rows that have a reading b and an attitude R. The model of a reading is `b = R^T m + h`.
#[derive(Clone, Debug, Default)]
pub struct PlaceField {
    rows: usize,
    readings: Vector3<f64>,
    in_reference: Vector3<f64>,
    attitudes: Matrix3<f64>,
}

impl PlaceField {
    /// Adds a row: attitude (body to reference) and reading, uT.
    pub fn add(&mut self, attitude: UnitQuaternion<f64>, reading: Vector3<f64>) {
        self.rows += 1;
        self.readings += reading;
        self.in_reference += attitude * reading;
        self.attitudes += attitude.to_rotation_matrix().into_inner();
    }

    /// The field m in the reference frame, uT, by least squares beside h; `None` without rows.
    pub fn estimate(&self) -> Option<Vector3<f64>> {
        if self.rows == 0 {
            return None;
        }
        let n = self.rows as f64;
        let (b, in_reference, mean) = (self.readings / n, self.in_reference / n, self.attitudes / n);
        let information = Matrix3::identity() * (1.0 + OFFSET) - mean.tr_mul(&mean);
        // |mean| <= 1, so that the prior keeps the information positive.
        let offset = Cholesky::new(information)?.solve(&(b - mean.tr_mul(&in_reference)));
        Some(in_reference - mean * offset)
    }

    /// Directions of the body (columns). The length of each is the error that noise of the reference makes in the offset along it, as a part of
    /// the field's length. `noise`: rad about each axis. The matrix is zero where every direction turns far more than the noise.
    pub fn unseen(&self, noise: f64) -> Matrix3<f64> {
        let mean = self.attitudes / self.rows.max(1) as f64;
        let turned = (Matrix3::identity() - mean.tr_mul(&mean)).symmetric_eigen();
        // A unit vector that two angles of noise turn has this variance.
        let by_noise = 2.0 * noise * noise;
        let share = turned
            .eigenvalues
            .map(|v| if v > by_noise { by_noise / v } else { 1.0 });
        if share.max() < SEEN {
            return Matrix3::zeros();
        }
        turned.eigenvectors * Matrix3::from_diagonal(&share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FIELD: [f64; 3] = [0.0, 21.0, -43.0];

    fn field_of(turns: impl Fn(f64) -> UnitQuaternion<f64>, iron: Vector3<f64>) -> Vector3<f64> {
        let mut sums = PlaceField::default();
        for k in 0..1000 {
            let q = turns(f64::from(k) * 0.05);
            sums.add(q, q.inverse_transform_vector(&Vector3::from(FIELD)) + iron);
        }
        sums.estimate().expect("rows")
    }

    #[test]
    fn a_magnet_on_a_sensor_that_turns_is_not_a_part_of_the_field() {
        let carried = |t: f64| UnitQuaternion::from_euler_angles(0.35 * (1.3 * t).sin(), 0.35 * (1.9 * t).sin(), t);
        let found = field_of(carried, Vector3::new(60.0, -75.0, 410.0));
        assert!((found - Vector3::from(FIELD)).norm() < 10.0, "{found}");
    }

    #[test]
    fn the_offset_along_an_axis_that_only_noise_tilts_is_not_seen() {
        let mut sums = PlaceField::default();
        for k in 0..3000 {
            let t = f64::from(k) * 0.05;
            let noise = UnitQuaternion::from_scaled_axis(0.002 * Vector3::new((17.0 * t).sin(), (23.0 * t).cos(), 0.0));
            sums.add(UnitQuaternion::from_euler_angles(0.0, 0.0, t) * noise, Vector3::zeros());
        }
        let unseen = sums.unseen(0.002_f64 / 2.0_f64.sqrt());
        let size = |axis: usize| unseen.row(axis).norm();
        assert!(size(0) < 1e-3 && size(1) < 1e-3 && size(2) > 0.9, "{unseen}");
        assert!(sums.unseen(1e-6).norm() < f64::MIN_POSITIVE);
    }

    #[test]
    fn a_sensor_that_hardly_turns_shows_the_whole_field() {
        let still = |t: f64| UnitQuaternion::from_euler_angles(0.3, 0.001 * t.sin(), 1.0);
        let found = field_of(still, Vector3::zeros());
        assert!((found - Vector3::from(FIELD)).norm() < 1e-9, "{found}");
    }
}
