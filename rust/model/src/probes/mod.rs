//! Dependences without a name: columns that no effect of the catalogue has, and that tell that something unknown is at work.
//!
//! They are asked after everything else and never named, nor added to a model: a gain that follows a column of the log,
//! two columns that act together, a magnetic field that varies from place to place. What the mean of a residual depends
//! on needs none of them: bins of each covariate show that, whatever its shape.

mod columns;
mod heading;
mod unseen_offset;
mod words;

use std::sync::Arc;

use nalgebra::Matrix3;

use crate::card::Card;
use crate::effect::{Columns, Effect, EffectError, Rows};
use crate::facts::LogFacts;
use crate::sensor::{AXES, Sensor};
use crate::triple::Triple;

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
    /// k (y - x) with y what follows gravity along the axis within seconds, see [`crate::gravity_course`].
    Creep,
    /// k P(t) x with Legendre polynomials P of the part of the log that has passed.
    GainInTime,
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
    /// k |omega| and k |omega|^2.
    Rate,
    /// k u of a vector that the sensor does not measure, on every axis.
    Other(Motion),
    /// (omega x (omega x r) + domega/dt x r) of each axis with an r of its own.
    OwnLevers,
    /// k dx/dt of all axes, on every axis.
    Changes,
    /// k y^2 with y the readings of all axes.
    Squares,
    /// k y with y what follows the axis' own reading with play, of each of the widths of [`WIDTHS`].
    Plays,
    /// k cos h, k sin h and the same of 2 h, with h the heading of the body's x axis.
    Heading,
    /// k v and k v^2, with v the speed of the reference position, m/s.
    Speed,
    /// k v with v the velocity of the reference position along the axis, m/s.
    Velocity,
    /// k u v of two vectors of the body frame, on every axis; not the squares of the sensor's own.
    Cross(Motion, Motion),
    /// k x where |x| is below one of [`SMALL`] times the full scale of such a motion.
    NearZero,
    /// R^T G p with G symmetric and without trace, as the gradient of a field without sources is.
    Gradient,
}

/// Parts of gravity (m/s^2) and of one rad/s below which a reading may be something else than a smaller reading.
const SMALL: [f64; 5] = [0.005, 0.01, 0.02, 0.04, 0.08];
/// Half widths of play, in parts of the field: so many plays side by side make up any hysteresis (Prandtl and Ishlinskii's model; Visintin
/// 1994, Differential models of hysteresis, ch. III). A body that turns swings each axis by at most twice the field; a play of a tenth is
/// told from a delay (the four explain 0.97 of what one of 0.2 leaves, 0.8 to 0.9 of one of 0.55, in tests/independent).
const WIDTHS: [f64; 4] = [0.1, 0.2, 0.4, 0.8];
/// Ideal readings count from this many times their noise on.
const CLEAR: f64 = 5.0;
/// What is left of products of the motion counts if it is this many times what noise leaves of them.
const CANCELLED: f64 = 3.0;
/// Stands between a product of two quantities and the axis that it acts on, in the name of a parameter.
pub const OF: char = ':';

/// What a parameter of a probe says that an axis depends on, as a finding calls it.
pub fn cause(card: &Card, parameter: usize, axis: usize) -> String {
    // What the axis itself causes is called as its own bins are.
    let own = matches!(card.name.as_str(), "f" | "omega" | "m");
    match card.parameters.get(parameter).and_then(|p| p.name.split_once(OF)) {
        Some((product, _)) => product.to_string(),
        None if own => format!("{}_{}", card.name, AXES[axis]),
        None => card.name.clone(),
    }
}

/// True if a parameter of a probe acts on an axis: that of a product acts on one alone.
pub fn acts_on(card: &Card, parameter: usize, axis: usize) -> bool {
    let product = card.parameters.get(parameter).and_then(|p| p.name.split_once(OF));
    product.is_none_or(|(_, own)| own == AXES[axis])
}

/// A vector of the body frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    Force,
    Rate,
    Field,
}

impl Motion {
    const fn name(self) -> &'static str {
        match self {
            Self::Force => "f",
            Self::Rate => "omega",
            Self::Field => "m",
        }
    }

    fn of<'a>(self, rows: &Rows<'a>) -> &'a Triple {
        match self {
            Self::Force => &rows.ideal.f,
            Self::Rate => &rows.ideal.omega,
            Self::Field => &rows.ideal.m,
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
            let of_motion = [Kind::GainInTime, Kind::Heading, Kind::Rate, Kind::Changes];
            kinds.extend(of_motion.map(|kind| (sensor, kind)));
            // Specific force on a gyroscope is in the catalogue.
            let others: &[Motion] = match sensor {
                Sensor::Acc => &[Motion::Rate, Motion::Field],
                Sensor::Gyr => &[Motion::Field],
                Sensor::Mag => &[Motion::Force, Motion::Rate],
            };
            let known = |motion: &&Motion| **motion != Motion::Field || facts.sensors[Sensor::Mag.index()];
            kinds.extend(others.iter().filter(known).map(|motion| (sensor, Kind::Other(*motion))));
            if sensor == Sensor::Acc {
                kinds.push((sensor, Kind::OwnLevers));
                kinds.extend(facts.gravity_course.iter().map(|_| (sensor, Kind::Creep)));
            }
            let by = |q: &Quantity| [Kind::GainBent(*q), Kind::TurnBy(*q), Kind::DelayBy(*q)];
            kinds.extend(quantities.iter().flat_map(by).map(|kind| (sensor, kind)));
            if facts.position_smoothing.is_some() {
                kinds.extend([Kind::Speed, Kind::Velocity].map(|kind| (sensor, kind)));
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
                kinds.extend([Kind::Squares, Kind::Plays].map(|kind| (sensor, kind)));
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
    // A rig has its angle from an encoder, which does not drift.
    let wanders = (!facts.rests && facts.rig.is_none()).then(|| Arc::new(heading::Heading::new()) as Arc<dyn Effect>);
    let unseen = (facts.offset_unseen != Matrix3::zeros())
        .then(|| Arc::new(unseen_offset::UnseenOffset::new()) as Arc<dyn Effect>);
    kinds.into_iter().map(probe).chain(wanders).chain(unseen).collect()
}

impl Probe {
    fn new(facts: &LogFacts, sensor: Sensor, kind: Kind) -> Self {
        Self {
            card: words::card(facts, sensor, &kind),
            sensor: [sensor],
            kind,
        }
    }
}

/// Axes of two vectors whose products are asked about: all, of a vector with itself those of different axes.
fn pairs(u: Motion, v: Motion) -> impl Iterator<Item = (usize, usize)> {
    (0..9).map(|k| (k / 3, k % 3)).filter(move |(i, j)| u != v || i < j)
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

    fn shown_by_bins(&self) -> bool {
        matches!(self.kind, Kind::Rate | Kind::Other(Motion::Force | Motion::Rate))
    }

    fn not_testable(&self, _: &LogFacts) -> Option<String> {
        None
    }

    fn noise_share(&self, facts: &LogFacts) -> f64 {
        match self.kind {
            Kind::Cross(u, v) => {
                let share = |motion: Motion| {
                    let shares = facts.noise_shares.get(motion as usize).copied().unwrap_or_default();
                    3.0 / shares.iter().map(|share| 1.0 / share).sum::<f64>()
                };
                CANCELLED * (share(u) + share(v))
            }
            _ => 0.0,
        }
    }

    fn columns(&self, rows: &Rows, _: Sensor, _: &[f64], out: &mut Columns) -> Result<(), EffectError> {
        columns::fill(&self.kind, self.sensor[0], rows, out);
        Ok(())
    }
}
