//! Kinematics of a log, kept from one pass over it to the next.
//!
//! The local polynomials would be most of the work of a pass, and every pass over a log, whatever effects it is taken for and whatever
//! clock it reads the reference by, asks for the same ones again.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex};

use crate::reference::{Kinematics, Widths, WindowReference};
use crate::reference_clock::ReferenceClock;
use crate::window::Window;

/// Kinematics of some rows; `None` where the reference does not tell.
pub type KinematicsRows = Arc<Vec<Option<Kinematics>>>;

/// Rows kept at most, about 260 bytes each and 70 MB together; of a log with more no rows are kept.
const MOST_ROWS: usize = 1 << 18;
/// Rows kept at most by more than one clock, 17 MB: five clocks of a log of 12,000 rows, 23 of one of 2833. A search for a delay comes back to
/// some 40 clocks; with as many as that these diagnoses took 60 and 50 MB more, and 0 and 12 % less time.
const MOST_OF_CLOCKS: usize = 1 << 16;
/// Numbers of what lies around the knots that are kept at most, 128 MB.
const MOST_NUMBERS: usize = 1 << 24;

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

/// The reference of a stretch of rows.
struct Read {
    place: (usize, usize),
    fingerprint: u64,
    widths: (Widths, Option<Widths>),
    reference: Arc<WindowReference>,
}

#[derive(Default)]
struct Kept {
    rows: usize,
    /// Those used last come last.
    kinds: Vec<(Differentiation, Stretches)>,
    /// In the order in which they were made.
    read: VecDeque<Read>,
}

impl Kept {
    /// Numbers that lie around the knots of what was read.
    fn numbers(&self) -> usize {
        self.read.iter().map(|r| r.reference.numbers()).sum()
    }
}

/// Kinematics of a log, shared by all copies of its facts.
#[derive(Clone, Default)]
pub struct KinematicsMemory(Arc<Mutex<Kept>>);

impl std::fmt::Debug for KinematicsMemory {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("KinematicsMemory").finish_non_exhaustive()
    }
}

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
    /// Kinematics of the core rows of a window, from memory where they are known; `n` is the number of rows of the log, `spacing` the usual
    /// time between reference samples.
    pub fn of(&self, window: &Window, n: usize, how: Differentiation, spacing: Option<f64>) -> KinematicsRows {
        let place = (window.offset + window.begin, window.offset + window.end);
        let now = fingerprint(window);
        let work_out = || {
            let reference = self.reference(window, place, now, how, spacing);
            Arc::new(reference.kinematics(window, how.clock))
        };
        if n > MOST_ROWS {
            return work_out();
        }
        if let Some(known) = self.find(&how, place, now) {
            return known;
        }
        let found = work_out();
        let stretch = Stretch {
            fingerprint: now,
            rows: found.clone(),
        };
        self.keep(how, place, stretch);
        found
    }

    /// What lies around the knots of a window's reference, from memory where they are known.
    fn reference(
        &self,
        window: &Window,
        place: (usize, usize),
        now: u64,
        how: Differentiation,
        spacing: Option<f64>,
    ) -> Arc<WindowReference> {
        let widths = (how.attitude, how.position);
        let same = |r: &&Read| r.place == place && r.fingerprint == now && r.widths == widths;
        if let Ok(kept) = self.0.lock()
            && let Some(known) = kept.read.iter().rfind(same)
        {
            return known.reference.clone();
        }
        let reference = Arc::new(WindowReference::new(window, how.attitude, how.position, spacing));
        let numbers = reference.numbers();
        if let Ok(mut kept) = self.0.lock()
            && numbers <= MOST_NUMBERS
        {
            while kept.numbers() + numbers > MOST_NUMBERS {
                kept.read.pop_front();
            }
            kept.read.push_back(Read {
                place,
                fingerprint: now,
                widths,
                reference: reference.clone(),
            });
        }
        reference
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
        let room = |kept: &Kept| {
            let alone = kept.kinds.iter().all(|(kind, _)| *kind == how);
            if alone { MOST_ROWS } else { MOST_OF_CLOCKS }
        };
        while kept.rows + new > room(&kept) {
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
    use crate::smoothing::{NARROWEST, Smoothing};

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
        let asked = |q: &[f64], how: Differentiation, copy: &KinematicsMemory| copy.of(&window(&t, q), 50, how, None);
        let first = asked(&q, HOW, &memory);
        assert!(Arc::ptr_eq(&first, &asked(&q, HOW, &memory.clone())));
        let clock = later(0.01);
        assert!(!Arc::ptr_eq(
            &first,
            &asked(&q, Differentiation { clock, ..HOW }, &memory)
        ));
        // Another clock reads the same reference.
        assert_eq!(memory.0.lock().expect("free").read.len(), 1);
        assert!(Arc::ptr_eq(&first, &asked(&q, HOW, &memory)));
        assert!(!Arc::ptr_eq(&first, &asked(&other, HOW, &memory)));
        assert_eq!(memory.0.lock().expect("free").read.len(), 2);
    }

    #[test]
    fn no_more_is_kept_than_there_is_room_for() {
        let n = MOST_ROWS / 3;
        let t: Vec<f64> = (0..n).map(|i| 0.01 * i as f64).collect();
        let q: Vec<f64> = t.iter().flat_map(|_| [1.0, 0.0, 0.0, 0.0]).collect();
        let memory = KinematicsMemory::default();
        for k in 0..5 {
            let clock = later(0.01 * f64::from(k));
            memory.of(&window(&t, &q), n, Differentiation { clock, ..HOW }, None);
            let attitude = Widths::alike(Smoothing::uniform(2, 1 + k as usize));
            memory.of(&window(&t, &q), n, Differentiation { attitude, ..HOW }, None);
            let kept = memory.0.lock().expect("free");
            assert!(kept.rows <= MOST_ROWS && kept.numbers() <= MOST_NUMBERS && !kept.read.is_empty());
        }
    }
}
