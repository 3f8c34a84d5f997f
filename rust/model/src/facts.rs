//! What is known of a log as a whole before its evidence is taken.

use std::sync::Arc;

pub use imufit_attitude::Frame;
use nalgebra::{Matrix3, Vector3};

use crate::gravity_course::GravityCourse;
use crate::kinematics_memory::KinematicsMemory;
use crate::rig::Rig;
use crate::smoothing::{NARROWEST, Smoothing};
use crate::temperature_course::TemperatureCourse;
use crate::window::Window;

/// Rows before a window that a whitening filter may look back on.
pub const LOOKBACK: usize = 128;

/// Largest rate at which the clock of a reference may run away from that of the sensors: beyond it windows end before the reference is
/// reached. Quartz crystals are within 100 ppm of their frequency over all temperatures; ten times that is a ceramic resonator's.
const LARGEST_SKEW: f64 = 1e-3;

/// Largest magnetic field of the earth at its surface, uT (Alken et al. 2021, International Geomagnetic Reference Field: the thirteenth
/// generation).
const LARGEST_FIELD: f64 = 67.0;

/// Facts of a log that its effects and its reference kinematics need: constants over all windows.
#[derive(Clone, Debug)]
#[allow(clippy::struct_excessive_bools)] // facts, not the states of a machine
pub struct LogFacts {
    /// Number of rows.
    pub n: usize,
    /// Time of the first row, s.
    pub t_start: f64,
    /// Time of the last row, s.
    pub t_end: f64,
    /// Median time between rows, s.
    pub dt: f64,
    /// The reference frame.
    pub frame: Frame,
    /// Gravity in the reference frame, m/s^2 (points down).
    pub gravity: Vector3<f64>,
    /// Magnetic flux density in the reference frame, uT; zero without a magnetometer.
    pub field: Vector3<f64>,
    /// True if `field` was estimated from this log, so that it has to be fitted along.
    pub field_estimated: bool,
    /// Mean sensor temperature, degC.
    pub temperature_mean: f64,
    /// Names of the covariates.
    pub covariates: Vec<String>,
    /// Mean of each covariate.
    pub covariate_means: Vec<f64>,
    /// Sensors that the log has.
    pub sensors: [bool; 3],
    /// Median time between samples of each sensor, s (a slow magnetometer has more than `dt`).
    pub sensor_dt: [f64; 3],
    /// True if the log has a thermometer.
    pub has_temperature: bool,
    /// How its temperature went; `None` where too little of that is known.
    pub temperature_course: Option<Arc<TemperatureCourse>>,
    /// How gravity went through the body's axes; `None` where too little of that is known.
    pub gravity_course: Option<Arc<GravityCourse>>,
    /// How the reference attitude is differentiated.
    pub attitude_smoothing: Smoothing,
    /// How the reference position is differentiated; `None` without position.
    pub position_smoothing: Option<Smoothing>,
    /// Noise of the ideal readings that columns are made of, from the reference; m/s^2, rad/s, uT.
    pub column_noise: [f64; 3],
    /// Noise that the reference gives to the ideal readings which readings are compared with; m/s^2, rad/s, uT.
    pub ideal_noise: [f64; 3],
    /// First reference position, m, from which others are counted; zero without one.
    pub position_origin: Vector3<f64>,
    /// How the attitude is differentiated for what enters columns, rates included.
    pub attitude_columns: Smoothing,
    /// The same for the position, accelerations included.
    pub position_columns: Option<Smoothing>,
    /// How the attitude is differentiated where a second derivative of what a sensor reads counts: that of a lag against a delay.
    pub attitude_bends: Smoothing,
    /// The same for the position.
    pub position_bends: Option<Smoothing>,
    /// For each sensor the body axes along which its ideal reading never exceeds the noise of the reference (a rig that never turns
    /// about an axis, an axis that stays level): those readings are noise, and a column made of noise would give a scale of -1.
    pub silent_axes: [[bool; 3]; 3],
    /// Body axes about which the angular acceleration is little more than the noise of the reference.
    pub silent_accelerations: [bool; 3],
    /// Part that noise of the reference makes of the mean square of specific force and angular rate along each body axis, as they enter
    /// columns.
    pub noise_shares: [[f64; 3]; 2],
    /// Directions of the body (columns), each as long as the offset of the magnetometer along it may seem off, uT: the field is unknown, and
    /// they hardly turn beyond the noise of the reference. Zero without such a direction.
    pub offset_unseen: Matrix3<f64>,
    /// True if the sensor is shaken more at some times than at others.
    pub shaking_varies: bool,
    /// Usual time between reference samples, s.
    pub reference_dt: f64,
    /// Samples of the reference that come in one packet; 1 where every sample has a stamp of its own.
    pub reference_packet: usize,
    /// Smallest turn from one sample of the reference to the next where some do not turn at all, rad: the step of its encoders; 0 elsewhere.
    pub reference_step: f64,
    /// Where the range of each sensor ends, if readings are cut off there; m/s^2, rad/s, uT.
    pub ranges: [Option<f64>; 3],
    /// Step between readings of each sensor along each axis where it is coarse against the noise, 0 elsewhere; m/s^2, rad/s, uT.
    pub steps: [[f64; 3]; 3],
    /// True where the readings of an axis are spread over several such steps.
    pub steps_crossed: [[bool; 3]; 3],
    /// The one-axis rig that moves the sensor; `None` where the log names no rig axis.
    pub rig: Option<Rig>,
    /// True where rests stand in for a reference attitude that the log does not have.
    pub rests: bool,
    /// Kinematics worked out in earlier passes.
    pub kinematics: KinematicsMemory,
}

/// Mean of the finite values; NaN without any.
fn mean(values: &[f64]) -> f64 {
    let known = || values.iter().filter(|v| v.is_finite());
    known().sum::<f64>() / known().count() as f64
}

impl LogFacts {
    /// Facts of a log of which only the readings count: nothing is known of its reference but the frame it would be in. `window` is the
    /// whole log; means that are not given are taken from it.
    pub fn without_reference(
        window: &Window,
        frame: Frame,
        covariates: Vec<String>,
        covariate_means: &[Option<f64>],
        temperature_mean: Option<f64>,
    ) -> Self {
        let (t_start, t_end) = (
            window.t.first().copied().unwrap_or_default(),
            window.t.last().copied().unwrap_or_default(),
        );
        let has_temperature = window.temperature.is_some_and(|t| t.iter().any(|v| v.is_finite()));
        let steps = window.len().saturating_sub(1).max(1) as f64;
        let dt = (t_end - t_start) / steps;
        let given = |k: usize| covariate_means.get(k).copied().flatten();
        Self {
            n: window.len(),
            t_start,
            t_end,
            dt,
            frame,
            gravity: Vector3::zeros(),
            field: Vector3::zeros(),
            field_estimated: false,
            temperature_mean: temperature_mean.unwrap_or_else(|| window.temperature.map_or(f64::NAN, mean)),
            covariate_means: window
                .covariates
                .iter()
                .enumerate()
                .map(|(k, c)| given(k).unwrap_or_else(|| mean(c)))
                .collect(),
            covariates,
            sensors: window.readings.map(|r| r.is_some()),
            sensor_dt: [dt; 3],
            has_temperature,
            temperature_course: None,
            gravity_course: None,
            attitude_smoothing: NARROWEST,
            position_smoothing: None,
            ideal_noise: [0.0; 3],
            column_noise: [0.0; 3],
            position_origin: Vector3::zeros(),
            attitude_columns: NARROWEST,
            position_columns: None,
            attitude_bends: NARROWEST,
            position_bends: None,
            silent_axes: [[false; 3]; 3],
            silent_accelerations: [false; 3],
            noise_shares: [[0.0; 3]; 2],
            offset_unseen: Matrix3::zeros(),
            shaking_varies: true,
            reference_dt: dt,
            reference_packet: 1,
            reference_step: 0.0,
            ranges: [None; 3],
            steps: [[0.0; 3]; 3],
            steps_crossed: [[false; 3]; 3],
            rig: None,
            rests: false,
            kinematics: KinematicsMemory::default(),
        }
    }

    /// How far the field may be off where it is an estimate from this log's readings, uT: in a log without turns a magnet beside the sensor makes all of these.
    /// `None` where the field is known.
    pub fn field_off(&self) -> Option<f64> {
        self.field_estimated.then(|| self.field.norm().max(LARGEST_FIELD))
    }

    /// Facts of a log whose rests stand in for a reference: gravity (m/s^2) and the field (uT) are known by their length, and nothing of
    /// its reference by its noise. `rows`: number, first and last time, time between them, s.
    #[allow(clippy::too_many_arguments)]
    pub fn at_rest(
        rows: (usize, f64, f64, f64),
        frame: Frame,
        gravity: f64,
        field: Option<f64>,
        sensors: [bool; 3],
        temperature_mean: Option<f64>,
        covariates: Vec<String>,
        covariate_means: Vec<f64>,
    ) -> Self {
        let (n, t_start, t_end, dt) = rows;
        Self {
            n,
            t_start,
            t_end,
            dt,
            frame,
            gravity: -frame.up() * gravity,
            field: Vector3::z() * field.unwrap_or_default(),
            field_estimated: field.is_some(),
            temperature_mean: temperature_mean.unwrap_or(f64::NAN),
            covariates,
            covariate_means,
            sensors,
            sensor_dt: [dt; 3],
            has_temperature: temperature_mean.is_some(),
            temperature_course: None,
            gravity_course: None,
            attitude_smoothing: NARROWEST,
            position_smoothing: None,
            column_noise: [f64::INFINITY; 3],
            ideal_noise: [0.0; 3],
            position_origin: Vector3::zeros(),
            attitude_columns: NARROWEST,
            position_columns: None,
            attitude_bends: NARROWEST,
            position_bends: None,
            silent_axes: [[false; 3]; 3],
            silent_accelerations: [false; 3],
            noise_shares: [[0.0; 3]; 2],
            offset_unseen: Matrix3::zeros(),
            shaking_varies: true,
            reference_dt: dt,
            reference_packet: 1,
            reference_step: 0.0,
            ranges: [None; 3],
            steps: [[0.0; 3]; 3],
            steps_crossed: [[false; 3]; 3],
            rig: None,
            rests: true,
            kinematics: KinematicsMemory::default(),
        }
    }

    /// Rows around a window that its derivatives, held columns and whitening filters may need.
    pub fn margin(&self) -> usize {
        let widths = [
            Some(self.attitude_smoothing),
            Some(self.attitude_columns),
            self.position_smoothing,
            self.position_columns,
            Some(self.attitude_bends),
            self.position_bends,
        ];
        let widest = widths.iter().flatten().map(|s| s.half_width).max().unwrap_or(0);
        let reach = 2.0 * (widest as f64 + 4.0) * (self.reference_dt / self.dt).max(1.0);
        let reach = if reach.is_finite() { reach as usize } else { 0 };
        let skew = (LARGEST_SKEW * self.n as f64) as usize;
        reach + skew + crate::window::HOLD_ROWS + LOOKBACK
    }

    /// Index of a covariate by its name.
    pub fn covariate(&self, name: &str) -> Option<usize> {
        self.covariates.iter().position(|c| c == name)
    }
}
