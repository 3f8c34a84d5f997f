//! The rules around a filter: nothing in a log breaks them, and a log may be cut anywhere.
#![allow(missing_docs, clippy::float_cmp, clippy::unwrap_used)]

use imufit_attitude::Frame;
use imufit_filters::catalogue::find;
use imufit_filters::{Columns, Environment, FILTERS, Parameter, Replay, Row, Rules, Skipped, Start, rules};
use nalgebra::Vector3;
use proptest::prelude::*;

/// Values that a replay puts before the state of its filter; times among them are NaN before the first row.
const OWN_STATE: usize = 12;

fn replay_of(name: &str, start: Start) -> Replay {
    replay_with(name, &[], Rules::default(), start)
}

fn replay_with(name: &str, settings: &[(String, f64)], rules: Rules, start: Start) -> Replay {
    let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
    Replay::new(find(name).unwrap(), settings, environment, rules, start).unwrap()
}

/// A setting: a usual one, one that switches something off, or one at the end of what can be written.
fn setting() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => (-6.0..3.0).prop_map(|power: f64| 10_f64.powf(power)),
        2 => prop::sample::select(vec![0.0, 1.0]),
        1 => prop::sample::select(vec![1e-310, 1e-160, 1e-50, 1e50]),
    ]
}

/// As many settings as the filter with the most of them and the rules have.
fn many_settings() -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(setting(), 16)
}

fn named(parameters: &[Parameter], values: &[f64]) -> Vec<(String, f64)> {
    parameters
        .iter()
        .map(|parameter| parameter.name.to_owned())
        .zip(values.iter().copied())
        .collect()
}

/// A number of a log, now and then an impossible one.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => -20.0..20.0,
        1 => prop::sample::select(vec![
            f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, 1e300, -1e300, 1e-320, f64::MAX
        ]),
    ]
}

fn rows(n: usize) -> impl Strategy<Value = (Vec<f64>, Vec<f64>, Vec<f64>, Vec<f64>)> {
    let step = prop_oneof![20 => 0.001..0.05, 1 => -0.1..0.0, 1 => 1.0..3.0, 1 => Just(f64::NAN)];
    let times = prop::collection::vec(step, n).prop_map(|steps| {
        let mut t = 0.0;
        steps
            .iter()
            .map(|step: &f64| {
                if step.is_nan() {
                    f64::NAN
                } else {
                    t += step;
                    t
                }
            })
            .collect()
    });
    let column = || prop::collection::vec(number(), 3 * n);
    (times, column(), column(), column())
}

proptest! {
    #[test]
    fn any_rows_give_unit_attitudes_and_any_cut_gives_the_same_bits((t, acc, gyr, mag) in rows(60), cut in 0usize..60) {
        for description in &FILTERS {
            let make = || replay_of(description.name, Start::Vectors);
            stays_an_attitude_however_it_is_cut(make, &Columns { t: &t, acc: Some(&acc), gyr: Some(&gyr), mag: Some(&mag) }, cut)?;
        }
    }

    #[test]
    fn any_settings_and_rules_do((t, acc, gyr, mag) in rows(60), cut in 0usize..60, of_filter in many_settings(), of_rules in many_settings()) {
        let rules = Rules::from_settings(&named(rules::PARAMETERS, &of_rules)).unwrap();
        for description in &FILTERS {
            let settings = named(description.parameters, &of_filter);
            let make = || replay_with(description.name, &settings, rules, Start::Vectors);
            stays_an_attitude_however_it_is_cut(make, &Columns { t: &t, acc: Some(&acc), gyr: Some(&gyr), mag: Some(&mag) }, cut)?;
        }
    }
}

/// Unit attitudes, a finite state, counts of no more rows than there are; the same bits in two parts and row by row.
fn stays_an_attitude_however_it_is_cut(
    make: impl Fn() -> Replay,
    columns: &Columns<'_>,
    cut: usize,
) -> Result<(), TestCaseError> {
    let n = columns.t.len();
    let mut whole = vec![0.0; 4 * n];
    let mut replay = make();
    let counted = replay.run(columns, &mut whole).unwrap();
    for q in whole.chunks(4).filter(|q| !q[0].is_nan()) {
        let norm: f64 = q.iter().map(|x| x * x).sum();
        prop_assert!((norm - 1.0).abs() < 1e-12);
    }
    prop_assert!(
        replay.state()[OWN_STATE..].iter().all(|value| value.is_finite()),
        "{:?}",
        replay.state()
    );
    // A gap in time and one between two rates may fall on the same row.
    let most = |reason: &str| n * if reason == "gap" { 2 } else { 1 };
    let possible = counted.by_reason().iter().all(|(reason, rows)| *rows <= most(reason));
    prop_assert!(possible, "{counted:?}");

    let mut pieces = vec![0.0; 4 * n];
    let (head, tail) = pieces.split_at_mut(4 * cut);
    let part = |from: usize, to: usize| {
        let of = |column: Option<_>| column.map(|values: &[f64]| &values[3 * from..3 * to]);
        Columns {
            t: &columns.t[from..to],
            acc: of(columns.acc),
            gyr: of(columns.gyr),
            mag: of(columns.mag),
        }
    };
    let mut first = make();
    let mut sum = first.run(&part(0, cut), head).unwrap();
    let mut second = make();
    second.set_state(&first.state()).unwrap();
    for (k, out) in (cut..n).zip(tail.chunks_exact_mut(4)) {
        let vector = |values: &[f64]| Vector3::from_column_slice(&values[3 * k..3 * k + 3]);
        let row = Row {
            t: columns.t[k],
            acc: columns.acc.map(vector),
            gyr: columns.gyr.map(vector),
            mag: columns.mag.map(vector),
        };
        let (attitude, skipped) = second.step(&row).unwrap();
        out.copy_from_slice(&attitude);
        sum += skipped;
    }
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    prop_assert_eq!(bits(&whole), bits(&pieces));
    prop_assert_eq!(sum, counted);
    Ok(())
}

/// Still and level in NED, 100 Hz, with one reading of another kind.
fn still_with(sensor: &str, rows: std::ops::Range<usize>, value: [f64; 3]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let t: Vec<f64> = (0..200).map(|k| 0.01 * f64::from(k)).collect();
    let (mut acc, mut gyr) = ([0.0, 0.0, -9.81].repeat(200), [0.0; 3].repeat(200));
    let column = if sensor == "acc" { &mut acc } else { &mut gyr };
    for row in rows {
        column[3 * row..3 * row + 3].copy_from_slice(&value);
    }
    (t, acc, gyr)
}

#[test]
fn a_clipped_specific_force_is_not_used_and_a_clipped_rate_is_and_both_are_counted() {
    // The angle that readings of another kind turn a still filter by, and what was counted. One rate would be bridged.
    let run = |name: &str, sensor: &str, value: [f64; 3], range: f64| {
        let mut rules = Rules::default();
        *(if sensor == "acc" {
            &mut rules.acc_range
        } else {
            &mut rules.gyr_range
        }) = range;
        let rows = if sensor == "acc" { 150..151 } else { 150..160 };
        let last = rows.end - 1;
        let (t, acc, gyr) = still_with(sensor, rows, value);
        let columns = Columns {
            t: &t,
            acc: Some(&acc),
            gyr: Some(&gyr),
            mag: None,
        };
        let mut attitude = vec![0.0; 4 * t.len()];
        let counted = replay_with(name, &[], rules, Start::Vectors)
            .run(&columns, &mut attitude)
            .unwrap();
        (attitude[4 * last + 1].abs(), counted)
    };
    let (blow, fast) = ([0.0, -19.6, -9.81], [4.36, 0.0, 0.0]);
    for name in ["complementary", "kalman", "mahony"] {
        let (turned, counted) = run(name, "acc", blow, 19.6);
        assert_eq!(
            (turned, counted.acc_clipped, counted.gyr_clipped),
            (0.0, 1, 0),
            "{name}"
        );
        let (turned, counted) = run(name, "acc", blow, 0.0);
        assert!(turned > 1e-4 && counted == Skipped::default(), "{name}: {turned}");
        // The nominal range is a step above the largest number of a 16 bit sensor.
        let (_, counted) = run(name, "acc", blow, 19.6 * 32768.0 / 32767.0);
        assert_eq!(counted.acc_clipped, 1, "{name}");
        let (turned, counted) = run(name, "gyr", fast, 4.36);
        assert_eq!((counted.acc_clipped, counted.gyr_clipped), (0, 10), "{name}");
        assert_eq!(turned, run(name, "gyr", fast, 0.0).0, "{name}");
        assert!(turned > 0.01, "{name}: {turned}");
    }
}

#[test]
fn a_filter_without_its_sensor_and_columns_of_other_length_are_refused_by_name() {
    let t = [0.0, 0.1];
    let columns = Columns {
        t: &t,
        acc: None,
        gyr: Some(&[0.0; 6]),
        mag: None,
    };
    let error = replay_of("mahony", Start::Vectors)
        .run(&columns, &mut [0.0; 8])
        .unwrap_err();
    assert!(error.to_string().contains("mahony needs acc"));
    let columns = Columns {
        t: &t,
        acc: None,
        gyr: Some(&[0.0; 3]),
        mag: None,
    };
    let error = replay_of("gyro", Start::Vectors)
        .run(&columns, &mut [0.0; 8])
        .unwrap_err();
    assert!(error.to_string().contains("gyr has 1 rows but t has 2"));
}

#[test]
fn a_foreign_state_and_an_unknown_setting_are_refused() {
    let state = replay_of("gyro", Start::Vectors).state();
    assert!(replay_of("mahony", Start::Vectors).set_state(&state).is_err());
    assert!(replay_of("mahony", Start::Vectors).set_state(&[]).is_err());
    let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
    let error = find("mahony")
        .unwrap()
        .build(&environment, &[("kp".to_owned(), 1.0)])
        .err()
        .unwrap();
    assert!(error.to_string().contains("k_p"));
    assert!(find("mahoney").err().unwrap().to_string().contains("mahony"));
}
