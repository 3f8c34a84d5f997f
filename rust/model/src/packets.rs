//! Samples of a reference that come in packets, nearly at one time.
//!
//! Either the packet bears the time of its arrival, and its samples were taken evenly before: the times are put right. Or the samples
//! were taken in bunches indeed: one of each is kept, since a polynomial finds no course within them.

use std::ops::Range;

use crate::usual_step::usual_step;

/// Part of the usual step below which samples stand in one packet: no instrument samples ten times faster now and then.
const PACKED: f64 = 0.1;
/// Packets on either side from which the times of a packet's samples are taken: a clock is steady over so many, and the time at which a
/// packet arrives varies by a part of a packet.
const REACH: usize = 32;
/// Samples taken evenly change as much from packet to packet as within one. In a bunch they change less than this part of that, as a square.
const EVEN: f64 = 0.25;

/// Puts the times of samples right that bear those of their packets, or keeps one sample of each bunch.
///
/// `change` is the square by which the reference differs between two rows. Returns the usual number of samples in a packet whose times
/// were put right; 1 where times stay as they are. That each packet arrives late is a delay of the reference, which is a parameter of its own.
pub fn resolve(t: &mut Vec<f64>, row: &mut Vec<usize>, change: impl Fn(usize, usize) -> f64) -> usize {
    let usual = usual_step(t);
    let packets: Vec<Range<usize>> = t
        .chunk_by(|a, b| b - a < PACKED * usual)
        .scan(0, |first, packet| {
            let range = *first..*first + packet.len();
            *first = range.end;
            Some(range)
        })
        .collect();
    if packets.is_empty() || 2 * packets.len() > t.len() {
        return 1;
    }
    let between: f64 = packets
        .windows(2)
        .map(|pair| change(row[pair[0].end - 1], row[pair[1].start]))
        .sum();
    let within: f64 = packets
        .iter()
        .flat_map(|packet| packet.clone().skip(1))
        .map(|k| change(row[k - 1], row[k]))
        .sum();
    let steps = (t.len() - packets.len()) as f64;
    if within / steps < EVEN * between / packets.len().saturating_sub(1).max(1) as f64 {
        let middle = |packet: &Range<usize>| packet.start + packet.len() / 2;
        *t = packets.iter().map(|packet| t[middle(packet)]).collect();
        *row = packets.iter().map(|packet| row[middle(packet)]).collect();
        return 1;
    }
    let spread = evenly(t, &packets);
    if !spread.is_sorted_by(|a, b| a < b) {
        return 1;
    }
    *t = spread;
    let mut sizes: Vec<usize> = packets.iter().map(ExactSizeIterator::len).collect();
    let middle = sizes.len() / 2;
    *sizes.select_nth_unstable(middle).1
}

/// Times of samples by their number, from straight lines through the packets around each.
fn evenly(t: &[f64], packets: &[Range<usize>]) -> Vec<f64> {
    let origin = t[0];
    let number = |packet: &Range<usize>| packet.start as f64 + 0.5 * (packet.len() - 1) as f64;
    let mean = |packet: &Range<usize>| t[packet.clone()].iter().map(|t| t - origin).sum::<f64>() / packet.len() as f64;
    let points: Vec<(f64, f64)> = packets.iter().map(|packet| (number(packet), mean(packet))).collect();
    let mut spread = Vec::with_capacity(t.len());
    for (k, packet) in packets.iter().enumerate() {
        let near = &points[k.saturating_sub(REACH)..(k + REACH + 1).min(points.len())];
        let n = near.len() as f64;
        let (x, y) = near.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
        let (xx, xy) = near.iter().fold((0.0, 0.0), |(xx, xy), p| {
            (xx + (p.0 - x).powi(2), xy + (p.0 - x) * (p.1 - y))
        });
        let slope = if xx > 0.0 { xy / xx } else { 0.0 };
        spread.extend(packet.clone().map(|j| origin + y + slope * (j as f64 - x)));
    }
    spread
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of the first samples of packets of three to eight.
    fn firsts(n: usize) -> Vec<usize> {
        let mut at = 0;
        let size = |k: usize| 3 + (7 * k + k * k) % 6;
        (0..n)
            .map(|k| {
                at += size(k);
                at - size(k)
            })
            .take_while(|first| *first < n)
            .collect()
    }

    #[test]
    fn samples_of_packets_get_the_times_at_which_they_were_taken() {
        let true_time = |k: usize| 0.1 + k as f64 / 170.0;
        let firsts = firsts(600);
        let mut t = Vec::new();
        for pair in firsts.windows(2) {
            t.extend((pair[0]..pair[1]).map(|k| true_time(pair[1]) + 15e-6 * (k - pair[0]) as f64));
        }
        let mut row: Vec<usize> = (0..t.len()).collect();
        let value = |k: usize| (3.0 * true_time(k)).sin();
        let n = t.len();
        let size = resolve(&mut t, &mut row, |a, b| (value(a) - value(b)).powi(2));
        assert!((3..=6).contains(&size), "{size}");
        assert_eq!(row.len(), n);
        let late: Vec<f64> = (0..n).map(|k| t[k] - true_time(k)).collect();
        let mean = late.iter().sum::<f64>() / n as f64;
        let inner = &late[n / 4..3 * n / 4];
        assert!(inner.iter().all(|l| (l - mean).abs() < 2e-3), "{inner:?}");
    }

    #[test]
    fn of_a_bunch_one_sample_is_kept() {
        let mut t: Vec<f64> = (0..600)
            .map(|k| 0.05 * f64::from(k / 6) + 15e-6 * f64::from(k % 6))
            .collect();
        let mut row: Vec<usize> = (0..600).collect();
        let times = t.clone();
        let value = |k: usize| (3.0 * times[k]).sin();
        assert_eq!(resolve(&mut t, &mut row, |a, b| (value(a) - value(b)).powi(2)), 1);
        assert_eq!(t.len(), 100);
        assert!(t.iter().zip(&row).all(|(t, k)| (t - times[*k]).abs() < 1e-12));
    }

    #[test]
    fn even_samples_stay_and_so_do_pairs_of_two_instruments() {
        for uneven in [0.0, 0.003] {
            let mut t: Vec<f64> = (0..600)
                .map(|k| 0.01 * f64::from(k) + uneven * f64::from(k % 2))
                .collect();
            let mut row: Vec<usize> = (0..600).collect();
            let before = t.clone();
            assert_eq!(resolve(&mut t, &mut row, |_, _| 1.0), 1);
            assert_eq!(t, before);
        }
    }
}
