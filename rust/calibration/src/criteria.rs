//! What counts as still, and as long enough for a pose.

/// What counts as still and as long enough.
#[derive(Clone, Debug)]
pub struct Criteria {
    /// Length of the window whose scatter is judged, s.
    pub window: f64,
    /// Shortest pose, s.
    pub hold: f64,
    /// Fewest readings of a window and of a pose.
    pub fewest: usize,
    /// After a disturbance no longer than this (s) the same pose goes on, if the sensor did not turn.
    pub bridge: f64,
    /// A pose may creep by this angle, rad.
    pub creep: f64,
    /// Noise of the accelerometer at rest, one axis, m/s^2; without it the quietest window so far counts.
    pub acc_noise: Option<f64>,
    /// Noise of the gyro at rest, one axis, rad/s; without it the quietest window so far counts.
    pub gyr_noise: Option<f64>,
    /// Scatter that is allowed whatever the noise, m/s^2 and rad/s: a steady hand's.
    pub floor: (f64, f64),
    /// Largest scatter that any sensor at rest can have, m/s^2 and rad/s.
    pub ceiling: (f64, f64),
}

impl Default for Criteria {
    fn default() -> Self {
        Self {
            window: 0.4,
            hold: 0.6,
            fewest: 5,
            bridge: 1.5,
            creep: 0.5_f64.to_radians(),
            acc_noise: None,
            gyr_noise: None,
            // Low-cost sensors have 0.02 to 0.1 m/s^2 and 0.0005 to 0.005 rad/s; a hand shakes more than this.
            floor: (0.03, 0.02),
            ceiling: (0.2, 0.04),
        }
    }
}
