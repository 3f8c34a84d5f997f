//! How much white noise of the reference reaches the whitened residual through a stack of effects.
//!
//! A sensor that is called sluggish smooths the noise of the reference, too, and leaves less of it in the residual than one that is called
//! late, whichever it is: the likelihood of the residual rises for a reason that says nothing of the sensor. How the noise passes through a
//! stack follows from the response to one shifted sample of the reference.

use imufit_model::effect::EffectError;
use imufit_model::facts::LogFacts;
use imufit_model::kinematics_memory::KinematicsMemory;
use imufit_model::sensor::{CHANNELS, Sensor};
use imufit_model::window::Window;
use nalgebra::{UnitQuaternion, Vector3};

use crate::evidence::Layout;
use crate::whitening::MAX_ORDER;

/// Rows around one sample of the reference, with the body at rest.
struct Rest {
    facts: LogFacts,
    t: Vec<f64>,
    readings: [Vec<f64>; 3],
    temperature: Vec<f64>,
    covariates: Vec<Vec<f64>>,
    /// Rows from one sample of the reference to the next, and from one of each sensor to the next.
    every: usize,
    steps: [usize; 3],
    middle: usize,
}

impl Rest {
    fn of(facts: &LogFacts) -> Self {
        let times = |dt: f64| ((dt / facts.dt).round() as usize).max(1);
        let every = if facts.reference_dt.is_finite() {
            times(facts.reference_dt)
        } else {
            1
        };
        let steps = facts.sensor_dt.map(|dt| if dt.is_finite() { times(dt) } else { 1 });
        let reach = MAX_ORDER * steps.iter().max().copied().unwrap_or(1);
        let mut facts = LogFacts {
            n: 1,
            kinematics: KinematicsMemory::default(),
            position_origin: Vector3::zeros(),
            ..facts.clone()
        };
        let middle = (facts.margin() + reach).div_ceil(every) * every;
        let n = 2 * middle + 1;
        let t: Vec<f64> = (0..n).map(|i| i as f64 * facts.dt).collect();
        facts.n = n;
        (facts.t_start, facts.t_end) = (0.0, t[n - 1]);
        let seen = |step: usize, i: usize| {
            if i.abs_diff(middle).is_multiple_of(step) {
                0.0
            } else {
                f64::NAN
            }
        };
        let readings = steps.map(|step| (0..n).flat_map(|i| [seen(step, i); 3]).collect());
        let constant = |value: f64| vec![if value.is_finite() { value } else { 0.0 }; n];
        Self {
            temperature: constant(facts.temperature_mean),
            covariates: facts.covariate_means.iter().map(|mean| constant(*mean)).collect(),
            t,
            readings,
            every,
            steps,
            middle,
            facts,
        }
    }

    /// Residuals where the middle sample of the reference is turned and shifted.
    fn residuals(
        &self,
        layout: &Layout,
        turn: Vector3<f64>,
        shift: Vector3<f64>,
    ) -> Result<Vec<Option<Vec<f64>>>, EffectError> {
        let n = self.t.len();
        let measured = |i: usize| i.is_multiple_of(self.every);
        let (mut attitude, mut position) = (vec![f64::NAN; 4 * n], vec![f64::NAN; 3 * n]);
        for i in (0..n).filter(|i| measured(*i)) {
            let moved = i == self.middle;
            let q = UnitQuaternion::from_scaled_axis(if moved { turn } else { Vector3::zeros() });
            attitude[4 * i..4 * i + 4].copy_from_slice(&[q.w, q.i, q.j, q.k]);
            position[3 * i..3 * i + 3].copy_from_slice((if moved { shift } else { Vector3::zeros() }).as_slice());
        }
        let reading = |sensor: Sensor| {
            let k = sensor.index();
            self.facts.sensors[k].then_some(self.readings[k].as_slice())
        };
        let window = Window {
            readings: Sensor::ALL.map(reading),
            temperature: self.facts.has_temperature.then_some(self.temperature.as_slice()),
            attitude: Some(&attitude),
            position: self.facts.position_smoothing.is_some().then_some(position.as_slice()),
            covariates: self.covariates.iter().map(Vec::as_slice).collect(),
            ..Window::over(&self.t)
        };
        let evaluation = layout.model.evaluate(&window, &self.facts)?;
        Ok(evaluation.channels.into_iter().map(|c| c.map(|c| c.residual)).collect())
    }
}

/// Variance that white noise of the reference (attitude in rad, position in m) gives to the whitened residual of each channel.
///
/// # Errors
///
/// An effect cannot be evaluated.
pub fn variance(layout: &Layout, attitude: f64, position: f64) -> Result<[f64; CHANNELS], EffectError> {
    let rest = Rest::of(&layout.facts);
    let still = rest.residuals(layout, Vector3::zeros(), Vector3::zeros())?;
    let mut out = [0.0; CHANNELS];
    for axis in 0..3 {
        let along = |size: f64| Vector3::ith(axis, size);
        let moves = [
            (attitude > 0.0).then(|| (along(attitude), Vector3::zeros())),
            (position > 0.0 && layout.facts.position_smoothing.is_some()).then(|| (Vector3::zeros(), along(position))),
        ];
        for (turn, shift) in moves.into_iter().flatten() {
            let moved = rest.residuals(layout, turn, shift)?;
            for (channel, (moved, still)) in moved.iter().zip(&still).enumerate() {
                if let (Some(moved), Some(still)) = (moved, still) {
                    let step = rest.steps[channel / 3];
                    let change = moved
                        .iter()
                        .zip(still)
                        .map(|(a, b)| a - b)
                        .skip(rest.middle % step)
                        .step_by(step);
                    // Every sample of the reference adds as much.
                    out[channel] += step as f64 / rest.every as f64 * whitened(change, &layout.filters[channel]);
                }
            }
        }
    }
    Ok(out)
}

/// Sum of squares of samples after a whitening filter; what is not known adds nothing.
fn whitened(samples: impl Iterator<Item = f64>, filter: &[f64]) -> f64 {
    let samples: Vec<f64> = samples.map(|v| if v.is_finite() { v } else { 0.0 }).collect();
    let innovation = |k: usize| {
        let past = filter
            .iter()
            .enumerate()
            .filter_map(|(j, a)| k.checked_sub(j + 1).map(|i| a * samples[i]));
        samples[k] - past.sum::<f64>()
    };
    (0..samples.len()).map(|k| innovation(k).powi(2)).sum()
}
