//! The rules around a filter: nothing in a log breaks them, and a log may be cut anywhere.
#![allow(missing_docs, clippy::unwrap_used)]

use imufit_attitude::Frame;
use imufit_filters::filter::find;
use imufit_filters::{Columns, Environment, FILTERS, Replay, Rules, Start};
use proptest::prelude::*;

/// Values that a replay puts before the state of its filter; times among them are NaN before the first row.
const OWN_STATE: usize = 10;

fn replay_of(name: &str, start: Start) -> Replay {
    let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
    Replay::new(find(name).unwrap(), &[], environment, Rules::default(), start).unwrap()
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
            let columns = Columns { t: &t, acc: Some(&acc), gyr: Some(&gyr), mag: Some(&mag) };
            let mut whole = vec![0.0; 4 * t.len()];
            let mut replay = replay_of(description.name, Start::Vectors);
            replay.run(&columns, &mut whole).unwrap();
            for q in whole.chunks(4).filter(|q| !q[0].is_nan()) {
                let norm: f64 = q.iter().map(|x| x * x).sum();
                prop_assert!((norm - 1.0).abs() < 1e-12);
            }
            prop_assert!(replay.state()[OWN_STATE..].iter().all(|value| value.is_finite()));

            let mut pieces = vec![0.0; 4 * t.len()];
            let (head, tail) = pieces.split_at_mut(4 * cut);
            let mut first = replay_of(description.name, Start::Vectors);
            let part = |from: usize, to: usize| Columns {
                t: &t[from..to], acc: Some(&acc[3 * from..3 * to]),
                gyr: Some(&gyr[3 * from..3 * to]), mag: Some(&mag[3 * from..3 * to]),
            };
            first.run(&part(0, cut), head).unwrap();
            let mut second = replay_of(description.name, Start::Vectors);
            second.set_state(&first.state()).unwrap();
            second.run(&part(cut, t.len()), tail).unwrap();
            let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
            prop_assert_eq!(bits(&whole), bits(&pieces));
        }
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
