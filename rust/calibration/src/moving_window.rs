//! Mean and deviation of the last readings of a three-axis sensor.

use std::collections::VecDeque;

use nalgebra::Vector3;

/// The readings of the last `length` s, at least `fewest` of them.
#[derive(Clone, Debug)]
pub struct MovingWindow {
    length: f64,
    fewest: usize,
    readings: VecDeque<(f64, Vector3<f64>)>,
    /// Sums of the readings less `anchor`, so that no digits are lost under a large mean.
    anchor: Vector3<f64>,
    sum: Vector3<f64>,
    square: Vector3<f64>,
    since_renewal: usize,
    /// Whether a reading has left: then the window is as long as it gets, also where readings are missing.
    covered: bool,
}

impl MovingWindow {
    /// An empty window.
    pub fn new(length: f64, fewest: usize) -> Self {
        Self {
            length,
            fewest,
            readings: VecDeque::new(),
            anchor: Vector3::zeros(),
            sum: Vector3::zeros(),
            square: Vector3::zeros(),
            since_renewal: 0,
            covered: false,
        }
    }

    /// Adds a reading and hands those that left to `left`.
    pub fn push(&mut self, t: f64, reading: Vector3<f64>, mut left: impl FnMut(f64, Vector3<f64>)) {
        if self.readings.is_empty() {
            self.anchor = reading;
        }
        self.readings.push_back((t, reading));
        let d = reading - self.anchor;
        self.sum += d;
        self.square += d.component_mul(&d);
        while self.readings.len() > self.fewest && self.readings.front().is_some_and(|(s, _)| t - s > self.length) {
            let Some((s, old)) = self.readings.pop_front() else {
                break;
            };
            let d = old - self.anchor;
            self.sum -= d;
            self.square -= d.component_mul(&d);
            self.covered = true;
            left(s, old);
        }
        self.since_renewal += 1;
        if self.since_renewal > 2 * self.readings.len() {
            self.renew();
        }
    }

    /// Sums anew, around the present mean: subtracting what left lets rounding pile up.
    fn renew(&mut self) {
        self.anchor = self.mean();
        self.sum = Vector3::zeros();
        self.square = Vector3::zeros();
        for (_, reading) in &self.readings {
            let d = reading - self.anchor;
            self.sum += d;
            self.square += d.component_mul(&d);
        }
        self.since_renewal = 0;
    }

    /// Number of readings.
    pub fn len(&self) -> usize {
        self.readings.len()
    }

    /// Whether there is no reading.
    pub fn is_empty(&self) -> bool {
        self.readings.is_empty()
    }

    /// Whether the readings cover the window's length.
    pub fn is_full(&self) -> bool {
        self.len() >= self.fewest
            && match (self.readings.front(), self.readings.back()) {
                // One sample step is missing when the oldest has just left.
                (Some((a, _)), Some((b, _))) => {
                    self.covered || (b - a) * (1.0 + 1.5 / (self.len() - 1) as f64) >= self.length
                }
                _ => false,
            }
    }

    /// Time of the oldest reading, s.
    pub fn start(&self) -> Option<f64> {
        self.time(0)
    }

    /// Time of reading `place`, counted from the oldest, s.
    pub fn time(&self, place: usize) -> Option<f64> {
        self.readings.get(place).map(|(t, _)| *t)
    }

    /// Mean reading.
    pub fn mean(&self) -> Vector3<f64> {
        self.anchor + self.sum / self.len().max(1) as f64
    }

    /// Root mean square over the three axes of the standard deviation.
    pub fn deviation(&self) -> f64 {
        let n = self.len();
        if n < 2 {
            return f64::INFINITY;
        }
        let variance = (self.square - self.sum.component_mul(&self.sum) / n as f64) / (n - 1) as f64;
        (variance.sum() / 3.0).max(0.0).sqrt()
    }

    /// Number of the oldest readings that belong to what came before: from the middle back, up to the first reading
    /// that stands off the newer half by more than chance.
    pub fn tail(&self) -> usize {
        const OFF: f64 = 3.5;
        let middle = self.len() / 2;
        let newer = || self.readings.iter().skip(middle).map(|(_, reading)| reading);
        let n = (self.len() - middle) as f64;
        if n < 3.0 {
            return 0;
        }
        let mean = newer().sum::<Vector3<f64>>() / n;
        let variance = newer().map(|v| (v - mean).norm_squared()).sum::<f64>() / (n - 1.0) / 3.0;
        // The mean's own scatter, and the digits' where the newer half shows a single value.
        let limit = OFF * OFF * variance * (1.0 + 1.0 / n) + 1e-6 * mean.norm_squared();
        let older = self.readings.iter().take(middle).rev();
        middle - older.take_while(|(_, v)| (*v - mean).norm_squared() <= limit).count()
    }

    /// Takes all readings out, oldest first.
    pub fn drain(&mut self) -> impl Iterator<Item = (f64, Vector3<f64>)> {
        self.sum = Vector3::zeros();
        self.square = Vector3::zeros();
        self.since_renewal = 0;
        self.covered = false;
        std::mem::take(&mut self.readings).into_iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_with_missing_readings_is_full_all_the_same() {
        let mut window = MovingWindow::new(0.4, 5);
        for i in (0..200).filter(|i| i % 7 != 0) {
            window.push(f64::from(i) * 0.01, Vector3::repeat(1.0), |_, _| ());
            assert!(window.is_full() || i < 42, "{i}");
            assert!(!window.is_full() || i > 38, "{i}");
        }
    }

    #[test]
    fn the_end_of_a_turn_is_told_from_the_rest_after_it() {
        let mut window = MovingWindow::new(0.4, 5);
        for i in 0..40 {
            let noise = f64::from(i * 7 % 5 - 2) * 0.01;
            let turning = if i < 6 { 0.02 * f64::from(6 - i).powi(2) } else { 0.0 };
            window.push(
                f64::from(i) * 0.01,
                Vector3::new(noise + turning, -noise, 9.8),
                |_, _| (),
            );
        }
        assert!((4..=6).contains(&window.tail()), "{}", window.tail());
    }

    #[test]
    fn mean_and_deviation_are_those_of_the_readings_that_are_left() {
        let mut window = MovingWindow::new(0.5, 5);
        let mut gone = 0;
        let reading = |i: i32| Vector3::new(1e4 + f64::from(i % 7), f64::from(i % 3), -f64::from(i % 5));
        for i in 0..1000 {
            window.push(f64::from(i) * 0.01, reading(i), |_, _| gone += 1);
        }
        assert!(window.is_full());
        let kept: Vec<_> = (gone..1000).map(reading).collect();
        assert_eq!(kept.len(), window.len());
        let n = kept.len() as f64;
        let mean = kept.iter().sum::<Vector3<f64>>() / n;
        let variance = kept.iter().map(|v| (v - mean).norm_squared()).sum::<f64>() / (n - 1.0) / 3.0;
        assert!((window.mean() - mean).norm() < 1e-9);
        assert!((window.deviation() - variance.sqrt()).abs() < 1e-9);
    }
}
