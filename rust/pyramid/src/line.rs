//! The points to draw: smallest and largest value of each stretch of time, interrupted over gaps.

/// What is drawn of one column; n points.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Line {
    /// Time, s, ascending.
    pub t: Vec<f64>,
    /// Smallest value; NaN where the line is interrupted.
    pub low: Vec<f64>,
    /// Largest value; NaN where the line is interrupted.
    pub high: Vec<f64>,
}

impl Line {
    /// Adds a point, and an interruption before it if a gap lies there.
    pub(crate) fn push(&mut self, t: f64, low: f64, high: f64, gap: bool) {
        if gap && let Some(&before) = self.t.last() {
            self.t.push(0.5 * (before + t));
            self.low.push(f64::NAN);
            self.high.push(f64::NAN);
        }
        self.t.push(t);
        self.low.push(low);
        self.high.push(high);
    }
}

/// A window of time, cut into pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Window {
    pub begin: f64,
    pub end: f64,
    pub pixels: usize,
}

impl Window {
    /// The pixel that a time lies in; times outside lie in the first or the last one.
    pub fn pixel(&self, t: f64) -> usize {
        let share = (t - self.begin) / (self.end - self.begin);
        // A window without length has one pixel: the conversion makes 0 of NaN.
        ((share * self.pixels as f64) as usize).min(self.pixels.saturating_sub(1))
    }

    /// A time within the window.
    pub fn within(&self, t: f64) -> f64 {
        t.max(self.begin).min(self.end)
    }
}
