//! Kinematics of a log, kept from one pass over it to the next.
//!
//! At uneven time stamps the local polynomials are most of the work of a pass, and every pass over a log, whatever effects it is taken
//! for, asks for the same ones again.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use crate::reference::{Kinematics, Widths};
use crate::reference_clock::ReferenceClock;
use crate::window::Window;

/// Kinematics of some rows; `None` where the reference does not tell.
pub type KinematicsRows = Arc<Vec<Option<Kinematics>>>;

/// Rows kept at most, about 260 bytes each; of a log with more nothing is kept.
const MOST_ROWS: usize = 1 << 20;

/// How the reference is differentiated, and by which clock it is read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Differentiation {
    /// Polynomials for the attitude.
    pub attitude: Widths,
    /// Polynomials for the position.
    pub position: Option<Widths>,
    /// When the reference is read.
    pub clock: ReferenceClock,
}

/// A stretch of rows.
#[derive(Debug)]
struct Stretch {
    /// Of the reference that they were worked out from.
    fingerprint: u64,
    rows: KinematicsRows,
}

/// By the rows they begin and end at.
type Stretches = HashMap<(usize, usize), Stretch>;

#[derive(Debug, Default)]
struct Kept {
    rows: usize,
    /// Those used last come last.
    kinds: Vec<(Differentiation, Stretches)>,
}

/// Kinematics of a log, shared by all copies of its facts.
#[derive(Clone, Debug, Default)]
pub struct KinematicsMemory(Arc<Mutex<Kept>>);

/// A number that changes with any value of a window's reference.
fn fingerprint(window: &Window) -> u64 {
    let columns = [Some(window.t), window.attitude, window.position, window.reference_exact];
    let values = columns.iter().flat_map(|c| c.unwrap_or_default());
    // Multiplication by an odd number near 2^64 over the golden ratio spreads the bits (Knuth 1973, 6.4).
    values.fold(0, |sum: u64, v| {
        (sum.rotate_left(23) ^ v.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15)
    })
}

impl KinematicsMemory {
    /// Kinematics of the core rows of a window, from memory where they are known; `n` is the number of rows of the log.
    pub fn of(
        &self,
        window: &Window,
        n: usize,
        how: Differentiation,
        work_out: impl FnOnce() -> Vec<Option<Kinematics>>,
    ) -> KinematicsRows {
        if n > MOST_ROWS {
            return Arc::new(work_out());
        }
        let place = (window.offset + window.begin, window.offset + window.end);
        let now = fingerprint(window);
        if let Some(known) = self.find(&how, place, now) {
            return known;
        }
        let found = Arc::new(work_out());
        let stretch = Stretch {
            fingerprint: now,
            rows: found.clone(),
        };
        self.keep(how, place, stretch);
        found
    }

    fn find(&self, how: &Differentiation, place: (usize, usize), now: u64) -> Option<KinematicsRows> {
        let mut kept = self.0.lock().ok()?;
        let at = kept.kinds.iter().position(|(kind, _)| kind == how)?;
        let kind = kept.kinds.remove(at);
        let known = kind
            .1
            .get(&place)
            .filter(|s| s.fingerprint == now)
            .map(|s| s.rows.clone());
        kept.kinds.push(kind);
        known
    }

    fn keep(&self, how: Differentiation, place: (usize, usize), stretch: Stretch) {
        let Ok(mut kept) = self.0.lock() else { return };
        let new = stretch.rows.len();
        // Other clocks are given up first, the one used longest ago before the others.
        while kept.rows + new > MOST_ROWS {
            let Some(at) = kept.kinds.iter().position(|(kind, _)| *kind != how) else {
                return;
            };
            let (_, gone) = kept.kinds.remove(at);
            kept.rows -= gone.values().map(|s| s.rows.len()).sum::<usize>();
        }
        let at = kept.kinds.iter().position(|(kind, _)| *kind == how).unwrap_or_else(|| {
            kept.kinds.push((how, Stretches::new()));
            kept.kinds.len() - 1
        });
        let old = kept.kinds[at].1.insert(place, stretch);
        kept.rows = kept.rows + new - old.map_or(0, |s| s.rows.len());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::smoothing::NARROWEST;

    fn window<'a>(t: &'a [f64], q: &'a [f64]) -> Window<'a> {
        Window {
            attitude: Some(q),
            ..Window::over(t)
        }
    }

    const HOW: Differentiation = Differentiation {
        attitude: Widths::alike(NARROWEST),
        position: None,
        clock: later(0.0),
    };

    const fn later(delay: f64) -> ReferenceClock {
        ReferenceClock {
            delay,
            skew: 0.0,
            start: 0.0,
        }
    }

    #[test]
    fn what_is_known_is_not_worked_out_again_unless_the_reference_is_another() {
        let t: Vec<f64> = (0..50).map(|i| 0.01 * f64::from(i)).collect();
        let q: Vec<f64> = t.iter().flat_map(|_| [1.0, 0.0, 0.0, 0.0]).collect();
        let other: Vec<f64> = t.iter().flat_map(|_| [0.0, 1.0, 0.0, 0.0]).collect();
        let memory = KinematicsMemory::default();
        let asked = |q: &[f64], how: Differentiation, copy: &KinematicsMemory| {
            let mut count = 0;
            copy.of(&window(&t, q), 50, how, || {
                count += 1;
                vec![None; 50]
            });
            count
        };
        assert_eq!(asked(&q, HOW, &memory), 1);
        assert_eq!(asked(&q, HOW, &memory.clone()), 0);
        assert_eq!(
            asked(
                &q,
                Differentiation {
                    clock: later(0.01),
                    ..HOW
                },
                &memory
            ),
            1
        );
        assert_eq!(asked(&q, HOW, &memory), 0);
        assert_eq!(asked(&other, HOW, &memory), 1);
    }

    #[test]
    fn no_more_is_kept_than_there_is_room_for() {
        let t: Vec<f64> = (0..50).map(|i| 0.01 * f64::from(i)).collect();
        let q: Vec<f64> = t.iter().flat_map(|_| [1.0, 0.0, 0.0, 0.0]).collect();
        let memory = KinematicsMemory::default();
        let n = MOST_ROWS / 3;
        for k in 0..6 {
            let how = Differentiation {
                clock: later(f64::from(k)),
                ..HOW
            };
            memory.of(&window(&t, &q), n, how, || vec![None; n]);
            assert!(memory.0.lock().expect("free").rows <= MOST_ROWS);
        }
    }
}
