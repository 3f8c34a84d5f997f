//! What a reading usually changes by from row to row, so that a change which its neighbours do not allow shows.

/// Square of a change over the mean square of changes that is doubted. White noise of three axes never reaches ten times its
/// root mean square.
const UNUSUAL: f64 = 100.0;
/// Changes that the mean stands for: half a second at 100 Hz, a few periods of fast motion.
const CHANGES: f64 = 64.0;
/// Time that bad readings may last, s: bad samples of a second, as in [`crate::lost`](crate).
pub(crate) const LONGEST: f64 = 1.5;
/// Largest mean square, which no reading has, so that its products are numbers of the machine.
const LARGEST: f64 = 1e200;

/// Mean square of the change from reading to reading, in the unit of the reading squared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Usual(pub f64);

impl Usual {
    /// Whether a change of that square is one to doubt; if not, it is learned. `least`: square of the least change that may be
    /// doubted.
    #[inline(always)]
    pub fn doubts(&mut self, square: f64, least: f64) -> bool {
        let doubted = square > UNUSUAL * self.0;
        if !doubted {
            self.0 = (self.0 + (square - self.0) * (1.0 / CHANGES)).max(least * (1.0 / UNUSUAL));
        }
        doubted
    }

    /// Takes time in which changes were doubted: what lasts longer than bad readings do is usual.
    pub fn get_used(&mut self, time: f64) {
        self.0 = (self.0 * UNUSUAL.powf(time.min(LONGEST) / LONGEST)).min(LARGEST);
    }
}
