//! The usual step between times, whether they are even, come in packets or have gaps.

/// Usual step between times; zero if there are none.
///
/// In each stretch it is the step in which half of the time has passed: stamps that come in packets lie close together,
/// and the time passes between the packets. Over the stretches it is the median: a gap makes one stretch long.
pub fn usual_step(t: &[f64]) -> f64 {
    let steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    let mut usual: Vec<f64> = steps.chunks(STRETCH).map(half_of_the_time).collect();
    let middle = usual.len() / 2;
    if usual.is_empty() {
        0.0
    } else {
        *usual.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}

/// The step at which the steps up to this length fill half of the time.
fn half_of_the_time(steps: &[f64]) -> f64 {
    let mut sorted = steps.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let half = 0.5 * sorted.iter().sum::<f64>();
    let mut passed = 0.0;
    let found = sorted.iter().find(|step| {
        passed += **step;
        passed >= half
    });
    found.or(sorted.last()).copied().unwrap_or(0.0)
}

/// Steps of a stretch: at least three of the packets that a serial link or a radio makes, which hold up to some twenty samples.
const STRETCH: usize = 64;

#[cfg(test)]
mod tests {
    use super::usual_step;

    #[test]
    fn gap_leaves_the_usual_step_and_packets_do_not_make_it_short() {
        let mut t: Vec<f64> = (0..400).map(|k| 0.01 * f64::from(k)).collect();
        for late in &mut t[300..] {
            *late += 1e3;
        }
        assert!((usual_step(&t) - 0.01).abs() < 1e-9);
        let packets: Vec<f64> = (0..400)
            .map(|k| 0.05 * f64::from(k / 6) + 15e-6 * f64::from(k % 6))
            .collect();
        assert!((usual_step(&packets) - 0.05).abs() < 1e-3);
        assert!(usual_step(&[1.0]).abs() < 1e-12);
    }
}
