//! One log's share in a question: its evidence, and where its parameters stand among those of all logs.

use imufit_model::sensor::CHANNELS;
use imufit_model::sensor_model::Slot;

use crate::evidence::Evidence;

/// Evidence of one log with its noise.
#[derive(Clone)]
pub struct Part {
    /// Whitened evidence.
    pub white: Evidence,
    /// Evidence as it stands.
    pub raw: Evidence,
    /// Variance of the whitened residual of each channel.
    pub variance: [f64; CHANNELS],
    /// Variance of each block over that of its channel (channels x blocks).
    pub loudness: Vec<Vec<f64>>,
    /// Noise floor of each channel.
    pub floors: [f64; CHANNELS],
    /// For each slot of the evidence its slot among those of all logs.
    pub slots: Vec<usize>,
}

impl Part {
    /// Weight of each channel in whitened equations: observations then have unit variance.
    pub fn weights(&self) -> [f64; CHANNELS] {
        self.variance
            .map(|v| if v > 0.0 && v.is_finite() { 1.0 / v } else { 0.0 })
    }

    /// Weight of each channel in whitened equations of one block.
    pub fn block_weights(&self, block: usize) -> [f64; CHANNELS] {
        let weights = self.weights();
        std::array::from_fn(|channel| weights[channel] / self.loudness[channel][block])
    }

    /// Weight of each channel in equations as they stand: residuals are then in units of the noise floor.
    pub fn raw_weights(&self) -> [f64; CHANNELS] {
        self.floors
            .map(|f| if f > 0.0 && f.is_finite() { 1.0 / (f * f) } else { 0.0 })
    }
}

/// Share of one sample of each channel in an error that all channels share equally, however many samples each has in all logs.
///
/// Pooled by samples, three thousand rows of a healthy magnetometer would hide what twenty rests show.
pub fn sample_shares(parts: &[Part]) -> [f64; CHANNELS] {
    let weighed = |part: &Part, channel: usize| part.raw_weights()[channel] > 0.0;
    let of = |channel: usize| {
        let judged = parts.iter().filter(|part| weighed(part, channel));
        judged.map(|part| part.raw.count(channel)).sum::<usize>()
    };
    std::array::from_fn(|channel| match of(channel) {
        0 => 0.0,
        samples => 1.0 / samples as f64,
    })
}

/// Slots of several logs: an effect that all logs share has one set of parameters, one that each log has for itself (`own`)
/// a set for each log that can tell of it, in the order of the logs. With them for each log the place of each of its parameters.
pub fn joined(parts: &[Part], own: &[bool]) -> (Vec<Slot>, Vec<Vec<usize>>) {
    let mut slots: Vec<Slot> = Vec::new();
    let mut places: Vec<Vec<usize>> = parts
        .iter()
        .map(|p| vec![0; p.white.layout.model.parameters()])
        .collect();
    let mut first = 0;
    for (number, own) in own.iter().enumerate() {
        let mut joint: Option<Slot> = None;
        for (part, places) in parts.iter().zip(&mut places) {
            let theirs = part.slots.iter().position(|s| *s == number);
            let Some(slot) = theirs.and_then(|k| part.white.layout.model.slots().get(k)) else {
                continue;
            };
            let before = match &mut joint {
                None => {
                    joint = Some(Slot { first, ..slot.clone() });
                    0
                }
                Some(joint) => {
                    joint.tried = joint.tried.max(slot.tried);
                    let before = joint.parameters.len();
                    if *own {
                        joint.parameters.extend(&slot.parameters);
                        before
                    } else {
                        0
                    }
                }
            };
            for k in 0..slot.parameters.len() {
                places[slot.first + k] = first + before + k;
            }
        }
        if let Some(joint) = joint {
            first += joint.parameters.len();
            slots.push(joint);
        }
    }
    (slots, places)
}
