//! How far the magnetic field is from the one that was met so far: what a disturbance does to the heading.
//!
//! Of the field, seen in the estimated reference frame, the horizontal and the vertical part are followed. Neither
//! depends on the heading. A disturbance of unknown direction that changes them by some uT turns the horizontal part by
//! about as many uT over its length; that angle is the standard deviation of the heading which the field shows.

use imufit_attitude::Real;

/// Time constant of the departure, s.
const DEPARTURE_TIME: f64 = 0.5;

/// Largest departure, rad^2: a heading that may be any has a variance of pi^2 / 3, and more would only last longer.
const LARGEST: f64 = 10.0;

/// Mean of the undisturbed field and the departure from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Field<T> {
    /// Horizontal part, uT.
    pub horizontal: T,
    /// Part along up, uT.
    pub vertical: T,
    /// Time that the mean stands for, s; 0 before the first reading.
    pub time: T,
    /// Mean square of the departure over the horizontal part, rad^2.
    pub departure: T,
}

impl<T: Real> Field<T> {
    pub fn unknown() -> Self {
        let zero = T::splat(0.0);
        Self {
            horizontal: zero,
            vertical: zero,
            time: zero,
            departure: zero,
        }
    }

    /// Lane by lane `self` where the condition holds, else `other`.
    pub fn select(self, condition: T::SimdBool, other: Self) -> Self {
        Self {
            horizontal: self.horizontal.select(condition, other.horizontal),
            vertical: self.vertical.select(condition, other.vertical),
            time: self.time.select(condition, other.time),
            departure: self.departure.select(condition, other.departure),
        }
    }

    /// Takes the two parts of a reading that stands for `dt` and returns the variance, rad^2, of the heading it shows as
    /// far as its departure from the mean tells. `memory`: time constant of the mean, s; `usual`: departure, rad, at
    /// which a reading is learned half as fast.
    pub fn update(&mut self, horizontal: T, vertical: T, dt: f64, memory: T, usual: T) -> T {
        let (zero, one, least) = (T::splat(0.0), T::splat(1.0), T::splat(f64::MIN_POSITIVE));
        let first = self.time.simd_le(zero);
        self.horizontal = horizontal.select(first, self.horizontal);
        self.vertical = vertical.select(first, self.vertical);
        let (h, v) = (horizontal - self.horizontal, vertical - self.vertical);
        let whole = (h * h + v * v) / (self.horizontal * self.horizontal).simd_max(least);
        let square = whole.simd_min(T::splat(LARGEST));
        // Nothing is learned from the part of a departure that no field has.
        let part = (square / whole.simd_max(T::splat(LARGEST))).simd_sqrt();
        let part = one.select(whole.simd_le(T::splat(LARGEST)), part);
        let (h, v) = (h * part, v * part);
        self.departure += (square - self.departure) * T::splat(-(-dt / DEPARTURE_TIME).exp_m1());
        let departure = self.departure.simd_max(square);
        self.time = (self.time + T::splat(dt)).simd_min(memory);
        let trust = one / (one + departure / (usual * usual).simd_max(least));
        let share = (T::splat(dt) / self.time).simd_min(one) * one.select(self.time.simd_lt(memory), trust);
        let weight = share.select(self.time.simd_gt(zero), zero);
        self.horizontal += h * weight;
        self.vertical += v * weight;
        departure
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The variance after each second of a field that jumps after twenty seconds.
    fn variances(memory: f64) -> Vec<f64> {
        let mut field = Field::unknown();
        let mut found = Vec::new();
        for k in 0..20_000 {
            let h = if k < 2000 { 18.0 } else { 24.0 };
            let variance = field.update(h, -44.0, 0.01, memory, 0.1);
            if k % 100 == 99 {
                found.push(variance);
            }
        }
        found
    }

    #[test]
    fn a_departure_is_seen_at_once_and_a_field_that_stays_is_accepted() {
        let found = variances(5.0);
        assert!(found[19] < 1e-12);
        assert!((found[20] - (6.0_f64 / 18.0).powi(2)).abs() < 0.02);
        assert!(found[199] < 1e-3);
        assert!(variances(50.0)[60] > variances(5.0)[60]);
    }
}
