//! What a probe is called, its parameters, and how the residual follows it.

use super::{AXES, Kind, OF, Quantity, SMALL, WIDTHS, pairs};
use crate::card::{Card, Found, Parameter, Stage, Traits};
use crate::facts::LogFacts;
use crate::gravity_course::MEMORIES;
use crate::sensor::Sensor;
use crate::temperature_course::PASTS;

use super::columns::DEGREES;

/// Card of a part of the noise that is fitted beside everything, with coefficients of this unit that are normal about zero.
pub(super) fn nuisance(
    id: &str,
    name: &str,
    signature: &str,
    stage: Stage,
    traits: Traits,
    (count, unit): (usize, &str),
) -> Card {
    let parameter = |k: usize| Parameter {
        name: format!("{k}"),
        unit: unit.to_string(),
        typical: Some(1.0),
        found: Found::Steps,
    };
    Card {
        id: id.to_string(),
        name: name.to_string(),
        stage,
        traits,
        parameters: (0..count).map(parameter).collect(),
        physics: String::new(),
        formula: String::new(),
        signature: signature.to_string(),
        mistaken_for: String::new(),
        confirm: String::new(),
        shares: 1.0,
    }
}

/// Card of a probe: its name is the covariate, its signature the shape.
pub(super) fn card(facts: &LogFacts, sensor: Sensor, kind: &Kind) -> Card {
    let name = |q: Quantity| match q {
        Quantity::Temperature => "temp".to_string(),
        Quantity::Column(c) => facts.covariates[c].clone(),
    };
    let xyz = || AXES.map(str::to_string).to_vec();
    let on_axes = |shapes: usize| (1..=shapes).flat_map(|k| AXES.map(|a| format!("{a}{k}"))).collect();
    let (stage, names, on, shape) = match kind {
        Kind::TemperaturePast => (
            Stage::Offset,
            on_axes(PASTS),
            name(Quantity::Temperature),
            "its past counts as well",
        ),
        Kind::Creep => (
            Stage::Offset,
            on_axes(MEMORIES),
            "f".to_string(),
            "its past counts as well: creep",
        ),
        Kind::GainInTime => (Stage::Gain, on_axes(DEGREES), "t".to_string(), "the gain drifts"),
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
        Kind::Rate => (Stage::Offset, on_axes(2), "omega_norm".to_string(), "growing with it"),
        Kind::Other(u) => (
            Stage::Offset,
            AXES.iter()
                .flat_map(|other| AXES.map(|a| format!("{}_{other}{OF}{a}", u.name())))
                .collect(),
            format!("{} of another sensor", u.name()),
            "growing with it",
        ),
        Kind::OwnLevers => (
            Stage::Input,
            on_axes(3),
            "omega_norm".to_string(),
            "each axis has its own lever arm",
        ),
        Kind::Squares => (
            Stage::Offset,
            (0..3)
                .flat_map(|j| AXES.map(|a| format!("m_{0}*m_{0}{OF}{a}", AXES[j])))
                .collect(),
            "m".to_string(),
            "parabolic",
        ),
        Kind::Plays => (
            Stage::Offset,
            on_axes(WIDTHS.len()),
            "m".to_string(),
            "its past counts as well: hysteresis",
        ),
        Kind::Heading => (Stage::Offset, on_axes(4), "heading".to_string(), "once or twice a turn"),
        Kind::Speed => (Stage::Offset, on_axes(2), "speed".to_string(), "growing with it"),
        Kind::Velocity => (Stage::Offset, xyz(), "velocity".to_string(), "growing with it"),
        Kind::Changes => (
            Stage::Gain,
            on_axes(3),
            match sensor {
                Sensor::Acc => "df/dt",
                Sensor::Gyr => "domega/dt",
                Sensor::Mag => "dm/dt",
            }
            .to_string(),
            "each axis follows changes of its own and of the others",
        ),
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
    Card {
        id: format!("{} {shape}: {on}", sensor.prefix()),
        name: on,
        stage,
        traits: Traits::default(),
        parameters: names.into_iter().map(parameter).collect(),
        physics,
        formula,
        signature: shape.to_string(),
        mistaken_for,
        confirm,
        shares: 1.0,
    }
}
