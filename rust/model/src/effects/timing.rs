//! One sensor shows what was: late, or smoothed.

use super::Words;
use crate::card::{Card, Stage, parameters};
use crate::effect::{Columns, Effect, EffectError, Rows, Sign};
use crate::facts::LogFacts;
use crate::ideal::{ReferenceChange, SensorTime};
use crate::sensor::Sensor;

/// Least delay or lag that is tried, s: columns at zero describe what is less, since no motion of a body turns faster.
const LEAST_TRIED: f64 = 0.005;
/// Ratio of one trial to the one before.
const RATIO: f64 = std::f64::consts::SQRT_2;
/// Trials of one sign: up to 0.16 s, beyond which a recording is joined wrongly.
const TRIALS: i32 = 11;

/// Delays or lags to try, s: none, and ever larger ones as far as the rows around a window reach if `past` times the value is looked back.
pub(super) fn trials(facts: &LogFacts, past: f64) -> Vec<f64> {
    let reach = facts.margin() as f64 * facts.dt;
    let sizes = (0..TRIALS).map(|k| LEAST_TRIED * RATIO.powi(k));
    [0.0]
        .into_iter()
        .chain(sizes.filter(|tau| past * tau < reach))
        .collect()
}

/// Finer steps from one trial to the next: 9 % each, so that a secant misses the square of a delay by a tenth at most.
const FINER: i32 = 4;

/// Trials around the best of a round, up to the next ones of the round before, and its mirror image: a sensor that knows what comes. None
/// after the last round.
pub(super) fn finer(best: f64, round: usize) -> Vec<f64> {
    if round > 0 || best == 0.0 {
        return Vec::new();
    }
    let near = (1 - FINER..FINER).map(|k| best * RATIO.powf(f64::from(k) / f64::from(FINER)));
    near.chain([-best]).collect()
}

/// Time constants of a lag that are looked back: the last node of its quadrature.
const LAGS_BACK: f64 = 16.0;

/// What happens to the quantity in time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Delay,
    Lag,
}

/// An effect on the time of one sensor.
pub struct Timing {
    card: Card,
    kind: Kind,
    sensor: [Sensor; 1],
}

fn one(sensor: Sensor, name: &str, kind: Kind, words: &Words, typical: f64) -> Timing {
    Timing {
        card: words.card(
            format!("{}.{name}", sensor.prefix()),
            Stage::Time,
            parameters(&["tau"], "s", typical),
        ),
        kind,
        sensor: [sensor],
    }
}

/// `acc.delay`, `gyr.delay`, `mag.delay`: the reading of t shows the quantity of t - tau.
pub fn delay(sensor: Sensor) -> Timing {
    let words = match sensor {
        Sensor::Acc => Words {
            name: "late accelerometer",
            physics: "the accelerometer's readings reach the log later than those of the other sensors: buffers, filters, another clock",
            formula: "f(t - tau) - f(t)",
            signature: "the residual of the accelerometer is proportional to the time derivative of its reading; the other sensors are on time",
            mistaken_for: "acc.lowpass, which also smooths; ref.delay, if only the accelerometer sees motion; acc.lever_arm if rotations are harmonic",
            confirm: "knock the body: the step in the accelerometer comes later than in the gyroscope, but is as sharp",
        },
        Sensor::Gyr => Words {
            name: "late gyroscope",
            physics: "the gyroscope's readings reach the log later than those of the other sensors: buffers, filters, another clock",
            formula: "omega(t - tau) - omega(t)",
            signature: "the residual of the gyroscope is proportional to the angular acceleration; the other sensors are on time",
            mistaken_for: "gyr.lowpass, which also smooths; ref.delay, if the other sensors hardly see the motion",
            confirm: "stop a rotation suddenly: the gyroscope stops later than the reference, but as sharply",
        },
        Sensor::Mag => Words {
            name: "late magnetometer",
            physics: "the magnetometer measures for some milliseconds, and the bus reads the result in its next cycle",
            formula: "m(t - tau) - m(t)",
            signature: "the residual of the magnetometer is proportional to omega x m; the other sensors are on time",
            mistaken_for: "mag.soft_iron or mag.hard_iron if the sensor always turns the same way, ref.delay if only the magnetometer is used",
            confirm: "turn at a constant rate one way and back: the heading lags both ways, by the rate times tau",
        },
    };
    // MPU6050 register map, DLPF_CFG: 4.9 ms at 44 Hz, 8.5 ms at 21 Hz. HMC5883L data sheet: 6 ms a measurement, read up to 13 ms later.
    one(sensor, "delay", Kind::Delay, &words, 0.01)
}

/// `acc.lowpass`, `gyr.lowpass`: tau dy/dt = x - y.
pub fn lowpass(sensor: Sensor) -> Timing {
    let words = match sensor {
        Sensor::Acc => Words {
            name: "low-pass of the accelerometer",
            physics: "a low-pass in the sensor or its supply averages over the past: the reading follows the specific force with a first-order lag",
            formula: "y - f with tau dy/dt = f - y",
            signature: "the residual of the accelerometer is proportional to the time derivative of its reading, and fast motion is damped; the other sensors are on time",
            mistaken_for: "acc.delay, which is as late but does not damp; ref.delay, if only the accelerometer moves",
            confirm: "knock the body: the accelerometer approaches its new value exponentially instead of stepping later",
        },
        _ => Words {
            name: "low-pass of the gyroscope",
            physics: "a low-pass in the sensor or its supply averages over the past: the reading follows the rate with a first-order lag",
            formula: "y - omega with tau dy/dt = omega - y",
            signature: "the residual of the gyroscope is proportional to the angular acceleration, and fast motion is damped; the other sensors are on time",
            mistaken_for: "gyr.delay, which is as late but does not damp; gyr.scale if all motion has one frequency",
            confirm: "stop a rotation suddenly: the rate decays to zero; oscillate faster and faster: the amplitude falls",
        },
    };
    // MPU6050 register map, DLPF_CFG: 10 Hz and 21 Hz as bandwidths, 1 / (2 pi f) = 16 ms and 8 ms.
    one(sensor, "lowpass", Kind::Lag, &words, 0.01)
}

impl Effect for Timing {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &self.sensor
    }

    fn not_testable(&self, facts: &LogFacts) -> Option<String> {
        (!facts.sensors[self.sensor[0].index()]).then(|| format!("the log has no {}", self.sensor[0].name()))
    }

    fn columns(&self, rows: &Rows, sensor: Sensor, _: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        let rate = match self.kind {
            Kind::Delay => rows.ideal.rate(sensor),
            Kind::Lag => rows.ideal.settling(sensor),
        };
        for axis in 0..3 {
            out.set(0, axis, rate.axis(axis).iter().map(|v| -v));
        }
        Ok(())
    }

    fn strongly_curved(&self) -> bool {
        true
    }

    fn tried_at_full_size(&self) -> bool {
        true
    }

    fn search(&self, facts: &LogFacts, found: Option<(&[f64], usize)>) -> Vec<Vec<f64>> {
        let past = match self.kind {
            Kind::Delay => 1.0,
            Kind::Lag => LAGS_BACK,
        };
        let sizes = found.map_or_else(|| trials(facts, past), |(at, round)| finer(at[0], round));
        sizes.into_iter().map(|tau| vec![tau]).collect()
    }

    fn sign(&self) -> Sign {
        match self.kind {
            Kind::Delay => Sign::RatherPositive,
            Kind::Lag => Sign::Positive,
        }
    }

    fn reference_change(&self, parameters: &[f64]) -> ReferenceChange {
        let time = match self.kind {
            Kind::Delay => SensorTime {
                delay: parameters[0],
                lag: 0.0,
            },
            Kind::Lag => SensorTime {
                delay: 0.0,
                lag: parameters[0],
            },
        };
        let mut change = ReferenceChange::default();
        change.sensors[self.sensor[0].index()] = time;
        change
    }
}
