//! Ideal readings from a reference, and the catalogue of effects that make a real sensor read otherwise.
//!
//! A reading is modelled as `y = ideal + effects + noise`. Each effect hands out its columns of the design matrix; the crates above fit,
//! rank and decide. Units are SI (uT for the magnetometer), vectors are in the body frame unless said otherwise.

pub mod bandwidth;
mod between_knots;
pub mod card;
pub mod catalogue;
pub mod contract;
pub mod correction;
pub mod effect;
pub mod effects;
pub mod facts;
pub mod gravity_course;
pub mod ideal;
mod interpolated;
pub mod kinematics_memory;
pub mod knots;
mod packets;
pub mod polynomials;
pub mod probes;
pub mod reference;
pub mod reference_clock;
pub mod rest_channels;
pub mod rig;
pub mod rotation_rates;
pub mod seen_bends;
pub mod sensor;
pub mod sensor_model;
pub mod sharpened;
pub mod smoothing;
pub mod temperature_course;
pub mod triple;
pub mod usual_step;
pub mod vibration;
pub mod window;
