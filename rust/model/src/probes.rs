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
use nalgebra::Vector3;

/// Columns of a log's own that are asked about; a log with more is asked about the first ones.
const MOST_COLUMNS: usize = 8;

/// What the residual may depend on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// k (c - mean) x.
    Gain(usize),
    /// k (c - mean) (d - mean).
    Product(Quantity, Quantity),
    /// k s with s what the past of the temperature amounts to, see [`crate::temperature_course`].
    TemperaturePast,
    /// k P(t) x with Legendre polynomials P of the part of the log that has passed.
    GainInTime,
    /// k (t - middle) / duration y, with y the readings of the other axes: the mounting turns.
    TurnInTime,
    /// k (t - middle) / duration dx/dt.
    DelayInTime,
    /// k (c - mean)^2 x.
    GainBent(Quantity),
    /// k (c - mean) y, with y the readings of the other axes.
    TurnBy(Quantity),
    /// k (c - mean) dx/dt.
    DelayBy(Quantity),
    /// k (c - mean) |omega|.
    RateBy(Quantity),
    /// k (c - mean) x^2.
    SquareBy(Quantity),
    /// k |omega|^2 x.
    GainByRate,
    /// k y^2 with y the readings of all axes.
    Squares,
    /// k cos h, k sin h and the same of 2 h, with h the heading of the body's x axis.
    Heading,
    /// k v and k v^2, with v the speed of the reference position, m/s.
    Speed,
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
/// What is left of products of the motion counts if it is this many times what noise leaves of them.
const CANCELLED: f64 = 3.0;
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
            let in_time = [Kind::GainInTime, Kind::TurnInTime, Kind::DelayInTime, Kind::Heading];
            kinds.extend(in_time.map(|kind| (sensor, kind)));
            let by = |q: &Quantity| [Kind::GainBent(*q), Kind::TurnBy(*q), Kind::DelayBy(*q)];
            kinds.extend(quantities.iter().flat_map(by).map(|kind| (sensor, kind)));
            if facts.position_smoothing.is_some() {
                kinds.push((sensor, Kind::Speed));
            }
            if sensor != Sensor::Mag {
                let by = |q: &Quantity| [Kind::RateBy(*q), Kind::SquareBy(*q)];
                kinds.extend(quantities.iter().flat_map(by).map(|kind| (sensor, kind)));
            }
            // A gyroscope's own cube is in the catalogue.
            if sensor != Sensor::Gyr {
                kinds.push((sensor, Kind::GainByRate));
            }
            if sensor == Sensor::Mag {
                kinds.push((sensor, Kind::Squares));
            }
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
        let on_axes = |shapes: usize| (1..=shapes).flat_map(|k| AXES.map(|a| format!("{a}{k}"))).collect();
        let (stage, names, on, shape) = match &kind {
            Kind::TemperaturePast => (
                Stage::Offset,
                on_axes(PASTS),
                name(Quantity::Temperature),
                "its past counts as well",
            ),
            Kind::GainInTime => (Stage::Gain, on_axes(DEGREES), "t".to_string(), "the gain drifts"),
            Kind::TurnInTime => (Stage::Gain, on_axes(2), "t".to_string(), "the mounting turns"),
            Kind::DelayInTime => (
                Stage::Gain,
                vec!["tau".to_string()],
                "t".to_string(),
                "the delay drifts",
            ),
            Kind::GainBent(q) => (Stage::Gain, xyz(), name(*q), "its gain follows it, bent"),
            Kind::TurnBy(q) => (Stage::Gain, on_axes(2), name(*q), "the mounting turns with it"),
            Kind::DelayBy(q) => (Stage::Gain, vec!["tau".to_string()], name(*q), "the delay follows it"),
            Kind::RateBy(q) => (
                Stage::Offset,
                xyz(),
                format!("{}*omega_norm", name(*q)),
                "both act together",
            ),
            Kind::SquareBy(q) => (Stage::Gain, xyz(), name(*q), "it bends the response"),
            Kind::GainByRate => (Stage::Gain, xyz(), "omega_norm".to_string(), "its gain follows it"),
            Kind::Squares => (
                Stage::Offset,
                (0..3)
                    .flat_map(|j| AXES.map(|a| format!("m_{0}*m_{0}{OF}{a}", AXES[j])))
                    .collect(),
                "m".to_string(),
                "parabolic",
            ),
            Kind::Heading => (Stage::Offset, on_axes(4), "heading".to_string(), "once or twice a turn"),
            Kind::Speed => (Stage::Offset, on_axes(2), "speed".to_string(), "growing with it"),
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
                on_axes(SMALL.len()),
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
                shares: 1.0,
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

/// Legendre polynomials in which a gain may go with time.
const DEGREES: usize = 4;

/// Legendre polynomials of degree 1 to 4.
fn legendre(u: f64) -> [f64; DEGREES] {
    let square = u * u;
    [
        u,
        0.5 * (3.0 * square - 1.0),
        0.5 * u * (5.0 * square - 3.0),
        0.125 * ((35.0 * square - 30.0) * square + 3.0),
    ]
}

/// Rows on each side over which a speed is taken.
const SPEED_ROWS: usize = 4;

/// Speed of the reference position in every row, m/s; where it is not known, the last one.
fn speeds(rows: &Rows) -> Vec<f64> {
    let mut last = 0.0;
    (0..rows.len())
        .map(|i| {
            let (before, after) = (i.saturating_sub(SPEED_ROWS), (i + SPEED_ROWS).min(rows.len() - 1));
            if let (Some(p), Some(q)) = (rows.position.get(before), rows.position.get(after)) {
                let speed = (q - p).norm() / (rows.t[after] - rows.t[before]);
                if speed.is_finite() {
                    last = speed;
                }
            }
            last
        })
        .collect()
}

/// Parts of the log that have passed at each row.
fn parts_of(rows: &Rows) -> Vec<f64> {
    rows.t.iter().map(|t| part_of(rows.facts, *t)).collect()
}

/// Columns of a mounting that turns as much as `by` says: each axis sees the other two.
fn fill_turn(rows: &Rows, by: &[f64], out: &mut Columns) {
    for shift in 1..3 {
        for axis in 0..3 {
            let other = rows.x.axis((axis + shift) % 3).iter();
            out.set(3 * (shift - 1) + axis, axis, by.iter().zip(other).map(|(b, x)| b * x));
        }
    }
}

/// Part of the log that has passed, from -0.5 to 0.5.
fn part_of(facts: &LogFacts, t: f64) -> f64 {
    (t - 0.5 * (facts.t_start + facts.t_end)) / (facts.t_end - facts.t_start)
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

impl Probe {
    /// Column of a delay that is as long as `by` says.
    fn fill_delay(&self, rows: &Rows, by: &[f64], out: &mut Columns) {
        let rate = rows.ideal.rate(self.sensor[0]);
        for axis in 0..3 {
            out.set(0, axis, by.iter().zip(rate.axis(axis)).map(|(b, r)| b * r));
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
        !matches!(
            self.kind,
            Kind::Gain(_)
                | Kind::Product(..)
                | Kind::TemperaturePast
                | Kind::GainInTime
                | Kind::NearZero
                | Kind::Gradient
        )
    }

    fn not_testable(&self, _: &LogFacts) -> Option<String> {
        None
    }

    fn noise_share(&self, facts: &LogFacts) -> f64 {
        match self.kind {
            Kind::Cross(u, v) => {
                let share = |motion: Motion| {
                    let shares = facts.noise_shares[motion as usize];
                    3.0 / shares.iter().map(|share| 1.0 / share).sum::<f64>()
                };
                CANCELLED * (share(u) + share(v))
            }
            _ => 0.0,
        }
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
                let parts: Vec<[f64; DEGREES]> =
                    rows.t.iter().map(|t| legendre(2.0 * part_of(rows.facts, *t))).collect();
                for degree in 0..DEGREES {
                    for axis in 0..3 {
                        let x = rows.x.axis(axis).iter();
                        out.set(3 * degree + axis, axis, parts.iter().zip(x).map(|(p, x)| p[degree] * x));
                    }
                }
            }
            Kind::TurnInTime => fill_turn(rows, &parts_of(rows), out),
            Kind::DelayInTime => self.fill_delay(rows, &parts_of(rows), out),
            Kind::GainBent(q) => {
                if let Some(by) = deviation(rows, *q) {
                    for axis in 0..3 {
                        out.set(axis, axis, by.iter().zip(rows.x.axis(axis)).map(|(c, x)| c * c * x));
                    }
                }
            }
            Kind::TurnBy(q) => {
                if let Some(by) = deviation(rows, *q) {
                    fill_turn(rows, &by, out);
                }
            }
            Kind::DelayBy(q) => {
                if let Some(by) = deviation(rows, *q) {
                    self.fill_delay(rows, &by, out);
                }
            }
            Kind::RateBy(q) => {
                if let Some(by) = deviation(rows, *q) {
                    let rates: Vec<f64> = (0..rows.len()).map(|i| rows.ideal.omega.row(i).norm()).collect();
                    for axis in 0..3 {
                        out.set(axis, axis, by.iter().zip(&rates).map(|(c, w)| c * w));
                    }
                }
            }
            Kind::SquareBy(q) => {
                if let Some(by) = deviation(rows, *q) {
                    for axis in 0..3 {
                        out.set(axis, axis, by.iter().zip(rows.x.axis(axis)).map(|(c, x)| c * x * x));
                    }
                }
            }
            Kind::GainByRate => {
                let square: Vec<f64> = (0..rows.len())
                    .map(|i| rows.ideal.omega.row(i).norm_squared())
                    .collect();
                for axis in 0..3 {
                    out.set(axis, axis, square.iter().zip(rows.x.axis(axis)).map(|(w, x)| w * x));
                }
            }
            Kind::Squares => {
                for other in 0..3 {
                    for axis in 0..3 {
                        out.set(3 * other + axis, axis, rows.x.axis(other).iter().map(|m| m * m));
                    }
                }
            }
            Kind::Heading => {
                let headings: Vec<(f64, f64)> = (0..rows.len())
                    .map(|i| {
                        let x = rows.attitude(i) * Vector3::x();
                        let level = x.x.hypot(x.y).max(f64::MIN_POSITIVE);
                        (x.x / level, x.y / level)
                    })
                    .collect();
                let shapes: [fn(f64, f64) -> f64; 4] = [|c, _| c, |_, s| s, |c, s| c * c - s * s, |c, s| 2.0 * c * s];
                for (k, shape) in shapes.iter().enumerate() {
                    for axis in 0..3 {
                        out.set(3 * k + axis, axis, headings.iter().map(|(c, s)| shape(*c, *s)));
                    }
                }
            }
            Kind::Speed => {
                let speeds = speeds(rows);
                for axis in 0..3 {
                    out.set(axis, axis, speeds.iter().copied());
                    out.set(3 + axis, axis, speeds.iter().map(|v| v * v));
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
