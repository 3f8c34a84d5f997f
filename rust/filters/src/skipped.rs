//! How many rows could not be used in full, and why.

use std::ops::AddAssign;

/// Rows of which something was not used, by reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Skipped {
    /// Time NaN or infinite: the row was passed over.
    pub time_not_finite: usize,
    /// Time not later than the row before: the row was passed over.
    pub time_not_increasing: usize,
    /// A step too long to be integrated.
    pub gap: usize,
    /// No specific force (NaN).
    pub acc_missing: usize,
    /// A specific force with an infinite or absurd value.
    pub acc_not_finite: usize,
    /// No angular rate (NaN).
    pub gyr_missing: usize,
    /// An angular rate with an infinite or absurd value.
    pub gyr_not_finite: usize,
    /// No field (NaN).
    pub mag_missing: usize,
    /// A field with an infinite or absurd value.
    pub mag_not_finite: usize,
    /// A specific force at the end of the accelerometer's range: not used.
    pub acc_clipped: usize,
    /// An angular rate at the end of the gyro's range: used as it is.
    pub gyr_clipped: usize,
    /// A single angular rate that its neighbours do not allow: bridged.
    pub gyr_bridged: usize,
    /// Specific force too short to show the vertical.
    pub free_fall: usize,
    /// Field too close to the vertical to show a heading.
    pub no_heading: usize,
    /// Rows before the start.
    pub not_started: usize,
}

impl Skipped {
    /// Reason and rows, in a fixed order.
    pub fn by_reason(&self) -> [(&'static str, usize); 15] {
        [
            ("time_not_finite", self.time_not_finite),
            ("time_not_increasing", self.time_not_increasing),
            ("gap", self.gap),
            ("acc_missing", self.acc_missing),
            ("acc_not_finite", self.acc_not_finite),
            ("gyr_missing", self.gyr_missing),
            ("gyr_not_finite", self.gyr_not_finite),
            ("mag_missing", self.mag_missing),
            ("mag_not_finite", self.mag_not_finite),
            ("acc_clipped", self.acc_clipped),
            ("gyr_clipped", self.gyr_clipped),
            ("gyr_bridged", self.gyr_bridged),
            ("free_fall", self.free_fall),
            ("no_heading", self.no_heading),
            ("not_started", self.not_started),
        ]
    }
}

impl AddAssign for Skipped {
    fn add_assign(&mut self, other: Self) {
        self.time_not_finite += other.time_not_finite;
        self.time_not_increasing += other.time_not_increasing;
        self.gap += other.gap;
        self.acc_missing += other.acc_missing;
        self.acc_not_finite += other.acc_not_finite;
        self.gyr_missing += other.gyr_missing;
        self.gyr_not_finite += other.gyr_not_finite;
        self.mag_missing += other.mag_missing;
        self.mag_not_finite += other.mag_not_finite;
        self.acc_clipped += other.acc_clipped;
        self.gyr_clipped += other.gyr_clipped;
        self.gyr_bridged += other.gyr_bridged;
        self.free_fall += other.free_fall;
        self.no_heading += other.no_heading;
        self.not_started += other.not_started;
    }
}
