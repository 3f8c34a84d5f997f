//! How far the magnetic field is from the one that was met so far: what a disturbance does to the heading.
//!
//! Of the field, seen in the estimated reference frame, the horizontal and the vertical part are followed. Neither
//! depends on the heading. A disturbance of unknown direction that changes them by some uT turns the horizontal part by
//! about as many uT over its length; that angle is the standard deviation of the heading which the field shows.

/// Time constant of the departure, s.
const DEPARTURE_TIME: f64 = 0.5;

/// Mean of the undisturbed field and the departure from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Field {
    /// Horizontal part, uT.
    pub horizontal: f64,
    /// Part along up, uT.
    pub vertical: f64,
    /// Time that the mean stands for, s; 0 before the first reading.
    pub time: f64,
    /// Mean square of the departure over the horizontal part, rad^2.
    pub departure: f64,
}

impl Field {
    pub const UNKNOWN: Self = Self {
        horizontal: 0.0,
        vertical: 0.0,
        time: 0.0,
        departure: 0.0,
    };

    /// Takes the two parts of a reading that stands for `dt` and returns the variance, rad^2, of the heading it shows as
    /// far as its departure from the mean tells. `memory`: time constant of the mean, s; `usual`: departure, rad, at
    /// which a reading is learned half as fast.
    pub fn update(&mut self, horizontal: f64, vertical: f64, dt: f64, memory: f64, usual: f64) -> f64 {
        if self.time <= 0.0 {
            (self.horizontal, self.vertical) = (horizontal, vertical);
        }
        let (h, v) = (horizontal - self.horizontal, vertical - self.vertical);
        let square = (h * h + v * v) / (self.horizontal * self.horizontal).max(f64::MIN_POSITIVE);
        self.departure += (square - self.departure) * -(-dt / DEPARTURE_TIME).exp_m1();
        let departure = self.departure.max(square);
        self.time = (self.time + dt).min(memory);
        if self.time > 0.0 {
            let trust = 1.0 / (1.0 + departure / (usual * usual).max(f64::MIN_POSITIVE));
            let weight = (dt / self.time).min(1.0) * if self.time < memory { 1.0 } else { trust };
            self.horizontal += h * weight;
            self.vertical += v * weight;
        }
        departure
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The variance after each second of a field that jumps after twenty seconds.
    fn variances(memory: f64) -> Vec<f64> {
        let mut field = Field::UNKNOWN;
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
