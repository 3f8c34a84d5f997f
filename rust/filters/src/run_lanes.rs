//! Several settings of one filter over one log at once, four in the lanes of one pass.
//!
//! Rows, rules and start are the same for all of them; only the numbers of the filter differ. Each result has the bits of a
//! replay of its own.

use imufit_attitude::{Lanes, Quaternion};
use nalgebra::SimdValue;

use crate::columns::Columns;
use crate::filter::{Filter, fill, find};
use crate::hybrid::{Driven, Seeded};
use crate::intake::Intake;
use crate::mahony::Mahony;
use crate::mekf::Mekf;
use crate::quest::Quest;
use crate::triad::Triad;
use crate::{Environment, FilterError, Rules, Skipped, Start};

/// Values of one setting by name.
pub type Settings = Vec<(String, f64)>;

/// The filter in lanes; `None` where it has no such form, or where these settings do not go together.
fn in_lanes(name: &str, environment: &Environment, values: &[Lanes]) -> Option<Box<dyn Filter<Lanes>>> {
    let driven = values
        .get(5)
        .map_or(0, |driven| (0..4).filter(|lane| driven.extract(*lane) > 0.0).count());
    match (name, driven) {
        ("mahony", _) => Some(Box::new(Mahony::new(environment, values))),
        ("triad", _) => Some(Box::new(Triad::new(environment, values))),
        ("mekf", _) => Some(Box::new(Mekf::new(environment, values))),
        ("quest", _) => Some(Box::new(Quest::new(environment, values))),
        ("hybrid", 0) => Some(Box::new(Seeded::new(environment, values))),
        ("hybrid", 4) => Some(Box::new(Driven::new(environment, values))),
        _ => None,
    }
}

/// One pass with four settings, the first `attitudes.len()` of which are wanted.
fn pass(
    mut filter: Box<dyn Filter<Lanes>>,
    mut intake: Intake,
    columns: &Columns<'_>,
    attitudes: &mut [Vec<f64>],
) -> Skipped {
    const ROWS: usize = 1024;
    let (mut skipped, mut done) = (Skipped::default(), 0);
    let mut together = vec![Lanes::splat(0.0); 4 * ROWS];
    filter.reset(Quaternion::IDENTITY);
    for window in columns.windows(ROWS) {
        let n = 4 * window.t.len();
        filter.rows(&mut intake, &window, &mut together[..n], &mut skipped);
        for (lane, attitude) in attitudes.iter_mut().enumerate() {
            let of_lane = together[..n].iter().map(|value| value.extract(lane));
            attitude
                .iter_mut()
                .skip(done)
                .zip(of_lane)
                .for_each(|(out, value)| *out = value);
        }
        done += n;
    }
    skipped
}

/// Attitudes `w x y z` of every row, for each of the settings. Filters without a form in lanes are run one by one.
pub fn run_lanes(
    name: &str,
    settings: &[Settings],
    environment: Environment,
    rules: Rules,
    start: Start,
    columns: &Columns<'_>,
) -> Result<Vec<Vec<f64>>, FilterError> {
    let description = find(name)?;
    let values: Result<Vec<_>, _> = settings
        .iter()
        .map(|each| fill(description.name, description.parameters, each))
        .collect();
    let values = values?;
    let mut found = Vec::with_capacity(settings.len());
    for (four, named) in values.chunks(4).zip(settings.chunks(4)) {
        // Fewer than four: the first one fills the lanes that are left.
        let lanes: Vec<Lanes> = (0..description.parameters.len())
            .map(|at| Lanes::from([0, 1, 2, 3].map(|lane| four.get(lane).unwrap_or(&four[0])[at])))
            .collect();
        let mut attitudes = vec![vec![0.0; 4 * columns.t.len()]; four.len()];
        // Where a sensor is missing a replay of its own says so.
        let complete = description.needs.iter().all(|sensor| columns.has(*sensor));
        match in_lanes(description.name, &environment, &lanes).filter(|_| complete) {
            Some(filter) => {
                columns.check()?;
                pass(filter, Intake::new(environment, rules, start), columns, &mut attitudes);
            }
            None => {
                for (attitude, each) in attitudes.iter_mut().zip(named) {
                    crate::Replay::new(description, each, environment, rules, start)?.run(columns, attitude)?;
                }
            }
        }
        found.append(&mut attitudes);
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use imufit_attitude::Frame;
    use nalgebra::Vector3;

    use super::*;
    use crate::Replay;

    /// A shaken, turning sensor with a slow magnetometer, a gap, free fall and readings that are not finite.
    fn columns() -> (Vec<f64>, [Vec<f64>; 3]) {
        let (mut q, mut times, mut readings) = (Quaternion::IDENTITY, Vec::new(), [const { Vec::new() }; 3]);
        for k in 0..2500_i32 {
            let t = f64::from(k) * 0.01;
            let omega = Vector3::new(t.sin(), (1.3 * t).cos(), 0.4) * 3.0;
            q = q.turned(&omega, 0.01);
            let shaken = Vector3::new((91.0 * t).sin(), (77.0 * t).cos(), 0.3);
            let mut acc = q.rotate_back(&(Frame::Ned.up() * 9.81)) + shaken;
            let mut mag = q.rotate_back(&Frame::Ned.default_field()) + shaken * 3.0;
            if k % 7 != 0 && k > 1200 {
                mag = Vector3::repeat(f64::NAN);
            }
            if (400..450).contains(&k) {
                acc = shaken * 0.1;
            }
            if (600..650).contains(&k) {
                mag = acc * -5.0;
            }
            if k == 900 {
                acc.y = f64::INFINITY;
            }
            times.push(if k > 2000 { t + 10.0 } else { t });
            for (column, reading) in readings.iter_mut().zip([acc, omega, mag]) {
                column.extend(reading.iter());
            }
        }
        (times, readings)
    }

    #[test]
    fn every_filter_with_several_settings_has_the_bits_of_its_own_replay() {
        let (t, [acc, gyr, mag]) = columns();
        let columns = Columns {
            t: &t,
            acc: Some(&acc),
            gyr: Some(&gyr),
            mag: Some(&mag),
        };
        let environment = Environment::new(Frame::Ned, 9.81, Some(Frame::Ned.default_field())).unwrap();
        let (rules, start) = (Rules::default(), Start::Vectors);
        for description in &crate::FILTERS {
            let settings: Vec<Settings> = (0..6_i32)
                .map(|k| {
                    let value = |at: usize, default: f64| match (description.parameters[at].name, k) {
                        ("driven", _) => f64::from(k / 4),
                        (_, 5) => 0.0,
                        _ => default * (0.4 + 0.3 * f64::from(k)),
                    };
                    let parameters = description.parameters.iter().enumerate();
                    parameters
                        .map(|(at, p)| (p.name.to_owned(), value(at, p.default)))
                        .collect()
                })
                .collect();
            let found = run_lanes(description.name, &settings, environment, rules, start, &columns).unwrap();
            for (attitude, each) in found.iter().zip(&settings) {
                let mut alone = vec![0.0; 4 * t.len()];
                let mut replay = Replay::new(description, each, environment, rules, start).unwrap();
                replay.run(&columns, &mut alone).unwrap();
                let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
                assert!(bits(attitude) == bits(&alone), "{} {each:?}", description.name);
            }
        }
        let without = Columns { mag: None, ..columns };
        assert!(run_lanes("triad", &[Vec::new()], environment, rules, start, &without).is_err());
    }
}
