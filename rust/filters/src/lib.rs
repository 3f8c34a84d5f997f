//! Attitude filters: one file each with settings (unit, default, source), state and step.
//!
//! | file | filter | source |
//! |---|---|---|
//! | [`accel`] | inclination from the specific force | paper B, eqs. (1) to (3) |
//! | [`gyro`] | integration of the angular rate | paper B, eq. (4) |
//! | [`complementary`] | gyro and accelerometer, weighted | paper B, eq. (5) |
//! | [`kalman`] | attitude and gyro bias | paper B, the filter it cites |
//! | [`triad`] | two vectors | paper C, Black 1964 |
//! | [`mahony`] | nonlinear complementary filter | paper C, eqs. (5) to (7) |
//! | [`madgwick`] | gradient descent | Madgwick, Harrison and Vaidyanathan 2011 |
//! | [`quest`] | two weighted vectors | paper C names it; Shuster and Oh 1981 |
//! | [`hybrid`] | TRIAD with Mahony's filter | paper C, figures 1 and 2 |
//! | [`mekf`] | multiplicative extended Kalman filter | Markley 2003; disturbances: its own page |
//!
//! A filter sees one [`Sample`] at a time and never a time stamp or a value that is not finite: gaps, NaN, free fall and
//! slow sensors are the business of [`intake`] alone.
#![cfg_attr(test, allow(clippy::float_cmp))]
#![allow(clippy::inline_always)] // a row of a replay is a hundred operations: a call between them is felt

pub mod accel;
mod bridge;
pub mod catalogue;
pub mod columns;
pub mod complementary;
mod field;
pub mod filter;
pub mod gyro;
pub mod hybrid;
pub mod intake;
pub mod kalman;
mod lever_arm;
mod lost;
pub mod madgwick;
pub mod mahony;
pub mod mekf;
mod memory;
mod met;
pub mod parameter;
pub mod quest;
pub mod replay;
mod rest;
pub mod rules;
pub mod sample;
pub mod skipped;
pub mod smoother;
pub mod start;
pub mod steady_state;
pub mod triad;
pub mod trials;
mod usual;
pub mod vibration;

pub use catalogue::{Description, FILTERS};
pub use columns::{Columns, Row};
pub use filter::Filter;
pub use kalman::steady_state_gain;
pub use parameter::Parameter;
pub use replay::Replay;
pub use rules::Rules;
pub use sample::{AngularRate, Environment, FluxDensity, Reading, Sample, Sensor, SpecificForce};
pub use skipped::Skipped;
pub use smoother::Smoother;
pub use start::Start;
pub use steady_state::SteadyState;

/// What stops a filter before its first row.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FilterError {
    /// No filter of that name.
    #[error("filter {name:?} is unknown: use one of {known}")]
    UnknownFilter {
        /// What was asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// The filter has no setting of that name.
    #[error("{filter} has no setting {name:?}: it has {known}")]
    UnknownSetting {
        /// The filter, or `replay` for the rules.
        filter: &'static str,
        /// What was asked for.
        name: String,
        /// The names there are.
        known: String,
    },
    /// A setting outside its range.
    #[error("{filter}: {name} = {value} is out of range: {range}")]
    Setting {
        /// The filter, or `replay` for the rules.
        filter: &'static str,
        /// The setting.
        name: &'static str,
        /// What came.
        value: f64,
        /// What is allowed.
        range: &'static str,
    },
    /// A value of the surroundings that cannot be.
    #[error("{0}")]
    Environment(String),
    /// The log lacks a sensor without which the filter says nothing.
    #[error("{filter} needs {sensor}, which is not there: record it or leave this filter out")]
    MissingSensor {
        /// The filter.
        filter: &'static str,
        /// `acc`, `gyr` or `mag`.
        sensor: &'static str,
    },
    /// Columns of one log with different numbers of rows.
    #[error("{name} has {came} rows but t has {expected}: pass one row per time")]
    Length {
        /// The column.
        name: &'static str,
        /// Its rows.
        came: usize,
        /// The rows of `t`.
        expected: usize,
    },
    /// A state that was not written by this filter.
    #[error(
        "the state does not belong to {filter}: it has {came} values instead of {expected}, or they are no attitude"
    )]
    State {
        /// The filter that should take it.
        filter: &'static str,
        /// Values that came.
        came: usize,
        /// Values it has.
        expected: usize,
    },
}
