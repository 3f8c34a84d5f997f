//! Multiplicative extended Kalman filter (Markley 2003) that tells disturbances by how long they last.
//!
//! Errors that it estimates, with one covariance: attitude (3, reference frame: `q = exp(a) q^`), gyro bias `b` (3),
//! horizontal velocity `v` (2), gyro scale and misalignment `K` (9, row by row), so that a reading is
//! `w_m = w + b + K w_m + noise`.
//!
//! ```text
//! prediction    q' = q exp((w_m - b - K w_m) dt),   da = -R (db + dK w_m) dt,   dv = (a x R f) dt
//! velocity      0 = v + noise        what is carried about by hand or by a machine does not run away
//! heading       angle from the horizontal part of R m to that of the known field
//! rest          w_m = b + noise,  0 = v + less noise
//! ```
//!
//! **Accelerations.** The specific force is no measurement of the vertical here: it is integrated to a velocity, and a
//! tilt shows as a velocity that grows. A short acceleration is answered by the opposite one soon after and
//! leaves nothing, whatever its size, so that none has to be detected and nothing is thrown away. The speeds that occur
//! (`speed`, correlated over `speed_time`) decide how fast the tilt follows.
//!
//! Changes of the specific force that those before do not allow ([`crate::usual`](crate)) may be bad readings: the velocity is
//! uncertain by what they make beyond the speeds that occur.
//!
//! **Field.** It turns the heading and never roll or pitch: those rows of the gain are zero (the covariance takes
//! account of that, Joseph form). Disturbances last, so that their variance counts over `mag_time`; it grows
//! with the departure of the field's horizontal and vertical part from what they were so far ([`crate::field`]): a magnet
//! is weighted out at once, and a field that stays is learned with the time constant `mag_memory`.
//!
//! **Bias.** At rest ([`crate::rest`]) the rate is the bias, heading included. In motion velocity and heading show it.
//!
//! **Gaps and missing readings.** After a gap the tilt is set from the first specific force within its spread and found
//! again within 10 s in motion and 5 s at rest; the heading within 30 s. While the specific force is
//! missing (free fall, clipping) the velocity becomes uncertain by gravity times that time. Without a magnetometer the
//! heading is that of the integrated rate. An attitude that bad readings have left behind is found again ([`crate::lost`]).

mod covariance;
mod filter;
mod settings;
mod state;

pub use filter::Mekf;
pub use settings::PARAMETERS;
pub(crate) use state::turned_back;
