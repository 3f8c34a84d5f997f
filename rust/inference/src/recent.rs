//! Results that a search comes back to, as many as are worth their memory.

use std::sync::{Mutex, PoisonError};

/// Results by the places that they are of, the one used last at the end.
pub struct Recent<T> {
    kept: Mutex<Vec<(Vec<usize>, T)>>,
    most: usize,
}

impl<T: Clone> Recent<T> {
    /// Of so many results.
    pub const fn new(most: usize) -> Self {
        Self {
            kept: Mutex::new(Vec::new()),
            most,
        }
    }

    /// The result of some places, in this order: the one that is kept, or a new one, which takes the place of the one unused for longest.
    pub fn of(&self, places: &[usize], make: impl FnOnce() -> T) -> T {
        if let Some(known) = self.find(places) {
            return known;
        }
        // The lock is free while it is made.
        let made = make();
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() >= self.most {
            kept.remove(0);
        }
        kept.push((places.to_vec(), made.clone()));
        made
    }

    fn find(&self, places: &[usize]) -> Option<T> {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let place = kept.iter().position(|(of, _)| of == places)?;
        let known = kept.remove(place);
        let result = known.1.clone();
        kept.push(known);
        Some(result)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_used_last_is_not_made_again() {
        let recent = Recent::new(2);
        let made = std::cell::RefCell::new(Vec::new());
        let ask = |place: usize| {
            recent.of(&[place], || {
                made.borrow_mut().push(place);
                10 * place
            })
        };
        for (place, result) in [(1, 10), (2, 20), (1, 10), (3, 30), (1, 10), (2, 20)] {
            assert_eq!(ask(place), result);
        }
        assert_eq!(*made.borrow(), [1, 2, 3, 2]);
    }
}
