//! The clock of the reference: when the reference is read for a time of the sensors.

/// A reference that is late, and ever more so.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReferenceClock {
    /// The reference is late by this much at `start`, s.
    pub delay: f64,
    /// ... and by this much more per second.
    pub skew: f64,
    /// Where the lateness begins to grow, s.
    pub start: f64,
}

impl ReferenceClock {
    /// Stamp in the reference of what happened at `t`, s.
    pub fn at(&self, t: f64) -> f64 {
        t + self.delay + self.skew * (t - self.start)
    }

    /// Seconds of the reference in one of the sensors.
    pub fn rate(&self) -> f64 {
        1.0 + self.skew
    }

    /// The clock by which the reference is read for what happened `past` seconds before.
    #[must_use]
    pub fn before(self, past: f64) -> Self {
        Self {
            delay: self.delay - past * self.rate(),
            ..self
        }
    }
}
