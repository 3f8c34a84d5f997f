//! Rows in memory thinned to pixels.

use crate::column::Node;
use crate::line::{Line, Window};

/// Points of a window of one column: the samples themselves if they are at most `2 * pixels` with their gaps, else
/// the smallest and the largest sample of each pixel. At most `2 * pixels` points in either case.
///
/// `t` ascends; a value that is not finite is a missing sample. Samples that are further apart than `gap` (s) are not
/// joined. Of samples as they are, the neighbours on both sides of the window are drawn too, so that lines reach its
/// edges.
pub fn thinned(t: &[f64], values: &[f64], gap: f64, begin: f64, end: f64, pixels: usize) -> Line {
    let first = t.partition_point(|&t| t < begin);
    let stop = t.partition_point(|&t| t <= end).max(first);
    let sampled = |k: &usize| values[*k].is_finite();
    let before = (0..first).rev().find(sampled);
    let after = (stop..t.len()).find(sampled);
    let drawn = || before.into_iter().chain((first..stop).filter(sampled)).chain(after);
    let mut points = 0;
    let mut last = f64::NAN;
    for k in drawn() {
        points += 1 + usize::from(t[k] - last > gap);
        last = t[k];
        if points > 2 * pixels {
            return by_pixel(
                &t[first..stop],
                &values[first..stop],
                gap,
                Window { begin, end, pixels },
            );
        }
    }
    let mut line = Line::default();
    let mut last = f64::NAN;
    for k in drawn() {
        line.push(t[k], values[k], values[k], t[k] - last > gap);
        last = t[k];
    }
    line
}

fn by_pixel(t: &[f64], values: &[f64], gap: f64, window: Window) -> Line {
    let mut line = Line::default();
    let mut node = Node::EMPTY;
    let (mut first, mut last, mut pixel) = (f64::NAN, f64::NAN, 0);
    for (&t, &value) in t.iter().zip(values).filter(|(_, value)| value.is_finite()) {
        let of = window.pixel(t);
        let apart = t - last > gap;
        if !node.is_empty() && of != pixel {
            line.push(0.5 * (first + last), node.low, node.high, node.gap);
            node = Node::EMPTY;
        }
        if node.is_empty() {
            (first, pixel) = (t, of);
        }
        node.extend(Node {
            low: value,
            high: value,
            gap: apart,
        });
        last = t;
    }
    if !node.is_empty() {
        line.push(0.5 * (first + last), node.low, node.high, node.gap);
    }
    line
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn few_samples_are_drawn_as_they_are_with_their_neighbours() {
        let t = [0.0, 1.0, 2.0, 3.0, 4.0];
        let line = thinned(&t, &[5.0, 6.0, 7.0, 8.0, 9.0], 1.5, 0.9, 2.1, 10);
        assert_eq!(line.t, t[..4]);
        assert_eq!(line.low, [5.0, 6.0, 7.0, 8.0]);
        assert_eq!(line.high, line.low);
    }

    #[test]
    fn a_missing_sample_is_bridged_and_a_gap_is_not() {
        let t = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        let values = [1.0, f64::NAN, 1.0, f64::NAN, f64::NAN, f64::NAN, 1.0];
        let line = thinned(&t, &values, 3.5, 0.0, 6.0, 10);
        assert_eq!(line.t, [0.0, 2.0, 4.0, 6.0]);
        assert!(line.low[2].is_nan() && line.high[2].is_nan());
        assert_eq!(line.low.iter().filter(|x| x.is_nan()).count(), 1);
    }

    #[test]
    fn nothing_and_no_length_are_borne() {
        assert_eq!(thinned(&[], &[], 1.0, 0.0, 1.0, 10), Line::default());
        let t: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(thinned(&t, &t, 2.0, 5.0, 5.0, 1).high, [5.0]);
        assert_eq!(thinned(&t, &[f64::NAN; 100], 2.0, 0.0, 99.0, 10), Line::default());
    }

    proptest! {
        #[test]
        fn extremes_of_any_window_survive(
            values in prop::collection::vec(prop_oneof![9 => -1e3..1e3, 1 => Just(f64::NAN)], 1..400),
            ends in (0.0..400.0, 0.0..400.0),
            pixels in 1_usize..50,
        ) {
            let t: Vec<f64> = (0..values.len()).map(|k| k as f64).collect();
            let (begin, end) = (f64::min(ends.0, ends.1), f64::max(ends.0, ends.1));
            let line = thinned(&t, &values, 3.5, begin, end, pixels);
            prop_assert!(line.t.len() <= 2 * pixels);
            prop_assert!(line.t.windows(2).all(|pair| pair[0] < pair[1]));
            let inside = t.iter().zip(&values).filter(|(t, v)| **t >= begin && **t <= end && v.is_finite());
            for (_, &value) in inside {
                prop_assert!(line.high.iter().copied().fold(f64::MIN, f64::max) >= value);
                prop_assert!(line.low.iter().copied().fold(f64::MAX, f64::min) <= value);
            }
            prop_assert!(line.low.iter().filter(|x| x.is_finite()).all(|x| values.contains(x)));
        }
    }
}
