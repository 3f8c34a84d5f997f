//! Steps of a converter that are coarse against the noise: found in the readings.

/// Parts of the log that are looked at on their own: a body that moves fast hides steps that count while it stands.
const PARTS: usize = 12;
/// Shares of the rows with a new reading on which an axis repeats its own, and on which it goes on as the two before did, above which
/// steps count: white noise of less than half a step makes as many.
const REPEATED: f64 = 0.43;
const EVEN: f64 = 0.28;
/// Rows with a new reading below which nothing is told of a part; a sensor with fewer in the whole log hardly ever changes.
const FEWEST: usize = 50;
/// An axis with fewer gaps between its values stands still, and what rounding does to it is a constant.
const SEVERAL: usize = 5;
/// Readings of one step lie together within this part of their size: figures of a table are rounded.
const SAME: f64 = 1e-7;
/// Gaps are whole steps within this part of one.
const WHOLE: f64 = 0.05;

/// What was seen of a part of the log.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    /// Rows with a new reading.
    rows: usize,
    /// For each axis on how many of them it repeats its reading, and on how many it goes on as the two before did.
    repeated: [usize; 3],
    even: [usize; 3],
}

impl Part {
    /// True if so many readings of an axis repeat, or go on evenly, that its steps count.
    fn is_coarse(&self, axis: usize) -> bool {
        let rows = self.rows as f64;
        self.repeated[axis] as f64 >= REPEATED * rows || self.even[axis] as f64 >= EVEN * rows
    }
}

/// Readings of one sensor, sampled.
#[derive(Clone, Debug, Default)]
pub struct SensorSteps {
    values: [Vec<f64>; 3],
    parts: [Part; PARTS],
}

impl SensorSteps {
    /// Adds a reading and the two before it; `part`: what part of the log has passed, 0 to 1.
    pub fn add(&mut self, part: f64, [first, second, third]: [[f64; 3]; 3]) {
        for (values, value) in self.values.iter_mut().zip(third) {
            values.push(value);
        }
        let same =
            |change: f64, k: usize| change.abs() <= SAME * first[k].abs().max(second[k].abs()).max(third[k].abs());
        let repeated: [bool; 3] = std::array::from_fn(|k| same(third[k] - second[k], k));
        // A sensor slower than the log that holds its readings is no coarse one.
        if repeated == [true; 3] {
            return;
        }
        let part = &mut self.parts[((part * PARTS as f64) as usize).min(PARTS - 1)];
        part.rows += 1;
        for k in 0..3 {
            part.repeated[k] += usize::from(repeated[k]);
            part.even[k] += usize::from(same(third[k] - 2.0 * second[k] + first[k], k));
        }
    }

    /// Step of each axis where it is coarse, 0 elsewhere; and whether its readings are spread over several.
    pub fn finish(mut self) -> ([f64; 3], [bool; 3]) {
        let gaps: [Vec<f64>; 3] = std::array::from_fn(|axis| gaps(&mut self.values[axis]));
        let rows: usize = self.parts.iter().map(|part| part.rows).sum();
        let hardly_changes = rows < FEWEST && self.values[0].len() >= FEWEST;
        let coarse: [bool; 3] = std::array::from_fn(|axis| {
            let mut told = self.parts.iter().filter(|part| part.rows >= FEWEST);
            hardly_changes || told.any(|part| part.is_coarse(axis))
        });
        let steps: [f64; 3] = std::array::from_fn(|axis| {
            let step = gaps[axis].iter().copied().min_by(f64::total_cmp).unwrap_or_default();
            let whole = |gap: &f64| (gap / step - (gap / step).round()).abs() <= WHOLE;
            if coarse[axis] && gaps[axis].iter().all(whole) {
                step
            } else {
                0.0
            }
        });
        // A reading that never changes says nothing of its step: that of the others.
        let largest = steps.into_iter().fold(0.0, f64::max);
        let steps = std::array::from_fn(|axis| if gaps[axis].is_empty() { largest } else { steps[axis] });
        (steps, std::array::from_fn(|axis| gaps[axis].len() >= SEVERAL))
    }
}

/// Differences between neighbouring values that are not the same.
fn gaps(values: &mut [f64]) -> Vec<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let largest = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let differences = values.windows(2).map(|pair| pair[1] - pair[0]);
    differences.filter(|gap| *gap > SAME * largest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps found in readings of three axes: the motion of each row, rounded.
    fn found(n: usize, reading: impl Fn(usize) -> [f64; 3]) -> [f64; 3] {
        let mut steps = SensorSteps::default();
        for i in 2..n {
            steps.add(i as f64 / n as f64, [reading(i - 2), reading(i - 1), reading(i)]);
        }
        steps.finish().0
    }

    fn near(found: [f64; 3], expected: [f64; 3]) -> bool {
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9)
    }

    /// Something like white noise of unit variance.
    fn noise(i: usize, axis: usize) -> f64 {
        let mut x = (3 * i + axis) as u64 ^ 0x9e37_79b9_7f4a_7c15;
        (0..12)
            .map(|_| {
                x ^= x << 13;
                x ^= x >> 7;
                x ^= x << 17;
                (x >> 11) as f64 / (1u64 << 53) as f64
            })
            .sum::<f64>()
            - 6.0
    }

    #[test]
    fn steps_of_a_few_standard_deviations_are_found_and_fine_ones_are_not() {
        let rounded = |step: f64| {
            move |i: usize| [0, 1, 2].map(|axis| ((0.01 * i as f64 + noise(i, axis)) / step).round() * step)
        };
        assert!(near(found(4000, rounded(0.5)), [0.0; 3]));
        assert!(near(found(4000, rounded(4.0)), [4.0; 3]));
    }

    #[test]
    fn held_readings_are_not_coarse_and_a_constant_axis_has_the_step_of_the_others() {
        let held = |i: usize| [0, 1, 2].map(|axis| noise(i / 4, axis));
        assert!(near(found(4000, held), [0.0; 3]));
        let one = |i: usize| {
            [
                (noise(i, 0) / 3.0).round() * 3.0,
                7.0,
                (noise(i, 2) / 3.0).round() * 3.0,
            ]
        };
        assert!(near(found(4000, one), [3.0; 3]));
        assert!(near(found(4000, |_| [7.0; 3]), [0.0; 3]));
    }
}
