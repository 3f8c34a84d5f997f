//! Values known at knots, read at any time.

/// Values at some times: linear between knots, and constant beyond the first and the last of these. There are at least two knots.
pub(crate) fn between_knots(knots: &[f64], value: impl Fn(usize) -> f64, t: &[f64]) -> Vec<f64> {
    let before = |first: &f64| knots.partition_point(|knot| knot <= first).saturating_sub(1);
    let mut k = t.first().map_or(0, before).min(knots.len() - 2);
    t.iter()
        .map(|t| {
            while k > 0 && knots[k] > *t {
                k -= 1;
            }
            while k + 2 < knots.len() && knots[k + 1] <= *t {
                k += 1;
            }
            let share = ((t - knots[k]) / (knots[k + 1] - knots[k]).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
            value(k) + share * (value(k + 1) - value(k))
        })
        .collect()
}
