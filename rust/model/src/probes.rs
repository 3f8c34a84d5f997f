//! Dependences without a name: columns that no effect of the catalogue has, and that tell that something unknown is at work.
//!
//! They are asked after everything else and never named, nor added to a model: a gain that follows a column of the log,
//! two columns that act together, a magnetic field that varies from place to place. What the mean of a residual depends
//! on needs none of them: bins of each covariate show that, whatever its shape.

use std::sync::Arc;

use crate::card::{Card, Found, Parameter, Stage};
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::sensor::Sensor;
use crate::temperature_course::PASTS;
use crate::triple::Triple;

/// Columns of a log's own that are asked about; a log with more is asked about the first ones.
const MOST_COLUMNS: usize = 8;

/// What the residual may depend on.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Kind {
    /// k (c - mean) x.
    Gain(usize),
    /// k (c - mean) (d - mean).
    Product(Quantity, Quantity),
    /// k s with s what the past of the temperature amounts to, see [`crate::temperature_course`].
    TemperaturePast,
    /// k (t - middle) x / duration.
    GainInTime,
    /// k u v of two vectors of the body frame, on every axis; not the squares of the sensor's own.
    Cross(Motion, Motion),
    /// k x where |x| is below one of [`SMALL`] times the full scale of such a motion.
    NearZero,
    /// R^T G p with G symmetric and without trace, as the gradient of a field without sources is.
    Gradient,
}

/// Parts of gravity (m/s^2) and of one rad/s below which a reading may be something else than a smaller reading.
const SMALL: [f64; 5] = [0.005, 0.01, 0.02, 0.04, 0.08];
/// Ideal readings count from this many times their noise on.
const CLEAR: f64 = 5.0;
/// Names of the body axes.
const AXES: [&str; 3] = ["x", "y", "z"];
/// Stands between a product of two quantities and the axis that it acts on, in the name of a parameter.
pub const OF: char = ':';

/// A vector of the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    Force,
    Rate,
}

impl Motion {
    const fn name(self) -> &'static str {
        match self {
            Self::Force => "f",
            Self::Rate => "omega",
        }
    }

    fn of<'a>(self, rows: &Rows<'a>) -> &'a Triple {
        match self {
            Self::Force => &rows.ideal.f,
            Self::Rate => &rows.ideal.omega,
        }
    }
}

/// A quantity beside the sensors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Quantity {
    Temperature,
    Column(usize),
}

/// A dependence without a name.
pub struct Probe {
    card: Card,
    sensor: [Sensor; 1],
    kind: Kind,
}

/// Everything that can be asked of a log with these facts.
pub fn probes(facts: &LogFacts) -> Vec<Arc<dyn Effect>> {
    let columns = facts.covariates.len().min(MOST_COLUMNS);
    let mut quantities: Vec<Quantity> = (0..columns).map(Quantity::Column).collect();
    if facts.has_temperature {
        quantities.push(Quantity::Temperature);
    }
    let mut kinds = Vec::new();
    for sensor in Sensor::ALL.into_iter().filter(|s| facts.sensors[s.index()]) {
        if sensor != Sensor::Mag {
            kinds.push((sensor, Kind::NearZero));
            let pairs = [
                (Motion::Force, Motion::Force),
                (Motion::Rate, Motion::Rate),
                (Motion::Force, Motion::Rate),
            ]
            .into_iter();
            // A few poses show no products, nor how a gain went.
            kinds.extend(pairs.filter(|_| !facts.rests).map(|(u, v)| (sensor, Kind::Cross(u, v))));
        }
        if !facts.rests {
            kinds.push((sensor, Kind::GainInTime));
        }
        if facts.temperature_course.is_some() {
            kinds.push((sensor, Kind::TemperaturePast));
        }
        kinds.extend((0..columns).map(|c| (sensor, Kind::Gain(c))));
        for (k, first) in quantities.iter().enumerate() {
            let others = quantities[k + 1..].iter();
            kinds.extend(others.map(|second| (sensor, Kind::Product(*first, *second))));
        }
    }
    if facts.position_smoothing.is_some() && facts.sensors[Sensor::Mag.index()] {
        kinds.push((Sensor::Mag, Kind::Gradient));
    }
    let probe = |(sensor, kind)| Arc::new(Probe::new(facts, sensor, kind)) as Arc<dyn Effect>;
    kinds.into_iter().map(probe).collect()
}

impl Probe {
    fn new(facts: &LogFacts, sensor: Sensor, kind: Kind) -> Self {
        let name = |q: Quantity| match q {
            Quantity::Temperature => "temp".to_string(),
            Quantity::Column(c) => facts.covariates[c].clone(),
        };
        let xyz = || AXES.map(str::to_string).to_vec();
        let (stage, names, on, shape) = match &kind {
            Kind::TemperaturePast => (
                Stage::Offset,
                (0..PASTS).flat_map(|k| AXES.map(|a| format!("{a}{k}"))).collect(),
                name(Quantity::Temperature),
                "its past counts as well",
            ),
            Kind::GainInTime => (Stage::Gain, xyz(), "t".to_string(), "the gain drifts"),
            Kind::Cross(u, v) => (
                Stage::Offset,
                pairs(*u, *v)
                    .flat_map(|(i, j)| {
                        let product = format!("{}_{}*{}_{}", u.name(), AXES[i], v.name(), AXES[j]);
                        AXES.map(|a| format!("{product}{OF}{a}"))
                    })
                    .collect(),
                format!("{}*{}", u.name(), v.name()),
                "both act together",
            ),
            Kind::Gain(c) => (Stage::Gain, xyz(), name(Quantity::Column(*c)), "its gain follows it"),
            Kind::Product(a, b) => (
                Stage::Offset,
                xyz(),
                format!("{}*{}", name(*a), name(*b)),
                "both act together",
            ),
            Kind::NearZero => (
                Stage::Gain,
                (1..=SMALL.len())
                    .flat_map(|k| AXES.map(|a| format!("{a}{k}")))
                    .collect(),
                if sensor == Sensor::Acc { "f" } else { "omega" }.to_string(),
                "another gain about zero",
            ),
            Kind::Gradient => (
                Stage::Offset,
                ["x", "y", "xy", "xz", "yz"].map(str::to_string).to_vec(),
                "ref_px*ref_py*ref_pz".to_string(),
                "the field varies in space",
            ),
        };
        let parameter = |name: String| Parameter {
            name,
            unit: String::new(),
            typical: None,
            found: Found::Steps,
        };
        let words = [String::new(), String::new(), String::new(), String::new()];
        let [physics, formula, mistaken_for, confirm] = words;
        Self {
            card: Card {
                id: format!("{} {shape}: {on}", sensor.prefix()),
                name: on,
                stage,
                parameters: names.into_iter().map(parameter).collect(),
                physics,
                formula,
                signature: shape.to_string(),
                mistaken_for,
                confirm,
            },
            sensor: [sensor],
            kind,
        }
    }
}

/// Axes of two vectors whose products are asked about: all, of a vector with itself those of different axes.
fn pairs(u: Motion, v: Motion) -> impl Iterator<Item = (usize, usize)> {
    (0..9).map(|k| (k / 3, k % 3)).filter(move |(i, j)| u != v || i < j)
}

/// A quantity less its mean; `None` where the log has it not.
fn deviation(rows: &Rows, quantity: Quantity) -> Option<Vec<f64>> {
    match quantity {
        Quantity::Temperature => rows.temperature.map(<[f64]>::to_vec),
        Quantity::Column(c) => {
            let mean = rows.facts.covariate_means.get(c)?;
            Some(rows.covariates.get(c)?.iter().map(|v| v - mean).collect())
        }
    }
}

impl Effect for Probe {
    fn card(&self) -> &Card {
        &self.card
    }

    fn sensors(&self) -> &[Sensor] {
        &self.sensor
    }

    fn is_probe(&self) -> bool {
        matches!(self.kind, Kind::Cross(..))
    }

    fn not_testable(&self, _: &LogFacts) -> Option<String> {
        None
    }

    fn columns(&self, rows: &Rows, _: Sensor, _: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        match &self.kind {
            Kind::Gain(c) => {
                if let Some(by) = deviation(rows, Quantity::Column(*c)) {
                    for axis in 0..3 {
                        out.set(axis, axis, by.iter().zip(rows.x.axis(axis)).map(|(c, x)| c * x));
                    }
                }
            }
            Kind::Product(a, b) => {
                if let (Some(a), Some(b)) = (deviation(rows, *a), deviation(rows, *b)) {
                    for axis in 0..3 {
                        out.set(axis, axis, a.iter().zip(&b).map(|(a, b)| a * b));
                    }
                }
            }
            Kind::TemperaturePast => {
                if let Some(course) = &rows.facts.temperature_course {
                    for past in 0..PASTS {
                        let by = course.at(past, rows.t);
                        for axis in 0..3 {
                            out.set(3 * past + axis, axis, by.iter().copied());
                        }
                    }
                }
            }
            Kind::GainInTime => {
                let (start, end) = (rows.facts.t_start, rows.facts.t_end);
                let part = |t: &f64| (t - 0.5 * (start + end)) / (end - start);
                for axis in 0..3 {
                    out.set(
                        axis,
                        axis,
                        rows.t.iter().zip(rows.x.axis(axis)).map(|(t, x)| part(t) * x),
                    );
                }
            }
            Kind::Cross(u, v) => {
                let (first, second) = (u.of(rows), v.of(rows));
                for (k, (i, j)) in pairs(*u, *v).enumerate() {
                    for axis in 0..3 {
                        let product = first.axis(i).iter().zip(second.axis(j)).map(|(a, b)| a * b);
                        out.set(3 * k + axis, axis, product);
                    }
                }
            }
            Kind::NearZero => {
                let full = if self.sensor[0] == Sensor::Acc {
                    rows.facts.gravity.norm()
                } else {
                    1.0
                };
                // At rest an ideal reading is nothing but the noise of the reference.
                let least = CLEAR * rows.facts.column_noise[self.sensor[0].index()];
                for (k, part) in SMALL.iter().enumerate() {
                    for axis in 0..3 {
                        let inside = |x: &f64| x.abs() < part * full && x.abs() > least;
                        let small = |x: &f64| if inside(x) { *x } else { 0.0 * x };
                        out.set(3 * k + axis, axis, rows.x.axis(axis).iter().map(small));
                    }
                }
            }
            Kind::Gradient => {
                for row in 0..rows.len() {
                    let p = rows.position.get(row).copied().unwrap_or_default() - rows.facts.position_origin;
                    let gradients = [
                        [p.x, 0.0, -p.z],
                        [0.0, p.y, -p.z],
                        [p.y, p.x, 0.0],
                        [p.z, 0.0, p.x],
                        [0.0, p.z, p.y],
                    ];
                    for (k, field) in gradients.into_iter().enumerate() {
                        let body = rows.attitude(row).inverse_transform_vector(&field.into());
                        for axis in 0..3 {
                            out.column(k, axis)[row] = body[axis];
                        }
                    }
                }
            }
        }
        Ok(())
    }
}
