//! Corrected readings are those that the effects were put on.
#![allow(missing_docs)]

use std::sync::Arc;

use imufit_model::catalogue;
use imufit_model::correction::{CorrectionError, correct};
use imufit_model::effect::Effect;
use imufit_model::facts::{Frame, LogFacts};
use imufit_model::window::Window;

const N: usize = 400;

fn stack(effects: &[(&str, &[f64])]) -> Vec<(Arc<dyn Effect>, Vec<f64>)> {
    let known = |(id, parameters): &(&str, &[f64])| Some((catalogue::find(id)?, parameters.to_vec()));
    effects.iter().filter_map(known).collect()
}

fn window<'a>(t: &'a [f64], acc: &'a [f64], gyr: Option<&'a [f64]>) -> Window<'a> {
    Window {
        readings: [Some(acc), gyr, None],
        ..Window::over(t)
    }
}

fn times() -> Vec<f64> {
    (0..N).map(|i| i as f64 * 0.01).collect()
}

fn waves(t: &[f64], size: f64, speed: f64) -> Vec<f64> {
    t.iter()
        .flat_map(|t| [1.0, 1.3, 0.7].map(|w| size * (speed * w * t + w).sin()))
        .collect()
}

#[test]
fn a_turned_axis_and_a_missing_row_are_no_obstacle() {
    let t = times();
    let mut truth = waves(&t, 9.0, 2.0);
    truth[30..33].fill(f64::NAN);
    let reading: Vec<f64> = truth
        .chunks(3)
        .flat_map(|x| [-x[0] + 0.5, 1.1 * x[1] + 0.1 * x[0], x[2]])
        .collect();
    let window = window(&t, &reading, None);
    let facts = LogFacts::without_reference(&window, Frame::Ned, vec![], &[], None);
    let effects = stack(&[
        ("acc.scale", &[-2.0, 0.1, 0.0]),
        ("acc.misalignment", &[0.0, 0.0, 0.1, 0.0, 0.0, 0.0]),
        ("acc.bias", &[0.5, 0.0, 0.0]),
    ]);
    let corrected = correct(&window, &facts, &effects).unwrap();
    assert_eq!(corrected.lost, [0; 3]);
    let found = corrected.readings[0].as_ref().unwrap();
    for i in 0..N {
        for axis in 0..3 {
            let (found, truth) = (found.axis(axis)[i], truth[3 * i + axis]);
            assert!(
                (found - truth).abs() < 1e-12 || (found.is_nan() && truth.is_nan()),
                "{i} {axis}"
            );
        }
    }
}

#[test]
fn a_lever_arm_reads_the_gyroscope_and_says_so_when_there_is_none() {
    let t = times();
    let (acc, gyr) = (waves(&t, 9.0, 2.0), waves(&t, 2.0, 3.0));
    let effects = stack(&[("acc.lever_arm", &[0.1, 0.0, 0.0])]);
    let with = window(&t, &acc, Some(&gyr));
    let facts = LogFacts::without_reference(&with, Frame::Ned, vec![], &[], None);
    let corrected = correct(&with, &facts, &effects).unwrap();
    assert!(corrected.readings[1].is_none());
    let found = corrected.readings[0].as_ref().unwrap();
    let i = N / 2;
    // An arm along x: f_x grows by -(omega_y^2 + omega_z^2) r.
    let expected = acc[3 * i] + 0.1 * (gyr[3 * i + 1].powi(2) + gyr[3 * i + 2].powi(2));
    assert!((found.axis(0)[i] - expected).abs() < 1e-12);
    let without = window(&t, &acc, None);
    let facts = LogFacts::without_reference(&without, Frame::Ned, vec![], &[], None);
    let error = correct(&without, &facts, &effects).err().unwrap().to_string();
    assert!(error.contains("acc.lever_arm") && error.contains("gyr_x"), "{error}");
}

#[test]
fn a_gain_without_inverse_is_named_alone() {
    let t = times();
    let acc = waves(&t, 9.0, 2.0);
    let window = window(&t, &acc, None);
    let facts = LogFacts::without_reference(&window, Frame::Ned, vec![], &[], None);
    let effects = stack(&[("acc.bias", &[1.0, 0.0, 0.0]), ("acc.scale", &[0.0, -1.0, 0.0])]);
    let error = correct(&window, &facts, &effects).err().unwrap();
    assert!(matches!(error, CorrectionError::Singular { effects, row: 0, .. } if effects == "acc.scale"));
}
