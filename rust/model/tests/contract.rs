//! Every built-in effect keeps the contract that fitting relies on.
#![allow(missing_docs)]

use imufit_attitude::Frame;
use imufit_model::card::Found;
use imufit_model::catalogue;
use imufit_model::contract::check;
use imufit_model::facts::LogFacts;
use imufit_model::kinematics_memory::KinematicsMemory;
use imufit_model::rig::{Knot, Rig, wrapped};
use imufit_model::smoothing::{NARROWEST, Smoothing};
use imufit_model::window::Window;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// A width that averages, and loses nothing of a motion this slow.
const WIDER: Smoothing = Smoothing::uniform(8, 11);

/// A rig about an axis of its own, with the reversals that the motion makes about it.
fn rig(t: &[f64], attitude: &[f64]) -> Rig {
    let mut rig = Rig {
        axis: Vector3::new(0.6, 0.0, 0.8),
        zero: UnitQuaternion::from_euler_angles(0.1, -0.2, 0.3),
        knots: vec![],
    };
    let mut last = 0.0;
    let angles: Vec<f64> = attitude
        .chunks(4)
        .map(|q| {
            let angle = rig.angle(&UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3])));
            last += wrapped(angle - last);
            last
        })
        .collect();
    for i in 0..t.len() {
        let turns = i == 0 || i + 1 == t.len() || (angles[i] - angles[i - 1]) * (angles[i + 1] - angles[i]) < 0.0;
        if turns || i % 20 == 0 {
            rig.knots.push(Knot {
                t: t[i],
                angle: angles[i],
            });
        }
    }
    rig
}

#[test]
fn every_built_in_effect_keeps_the_contract() {
    let n = 300_usize;
    let t: Vec<f64> = (0..n).map(|i| 5.0 + i as f64 * 0.01).collect();
    let attitude: Vec<f64> = t
        .iter()
        .flat_map(|t| {
            let q = UnitQuaternion::from_euler_angles((1.3 * t).sin(), 0.7 * (2.1 * t).cos(), 0.9 * t);
            [q.w, q.i, q.j, q.k]
        })
        .collect();
    let position: Vec<f64> = t
        .iter()
        .flat_map(|t| [(2.0 * t).sin(), (3.0 * t).cos() * 0.3, 0.1 * t])
        .collect();
    let reading = vec![0.1; 3 * n];
    let temperature: Vec<f64> = t.iter().map(|t| 30.0 + t.sin()).collect();
    let current: Vec<f64> = t.iter().map(|t| (5.0 * t).sin() + 2.0).collect();
    let window = Window {
        t: &t,
        readings: [Some(&reading); 3],
        temperature: Some(&temperature),
        attitude: Some(&attitude),
        position: Some(&position),
        reference_exact: None,
        covariates: vec![&current],
        offset: 0,
        begin: 0,
        end: n,
    };
    let facts = LogFacts {
        n,
        t_start: t[0],
        t_end: t[n - 1],
        dt: 0.01,
        frame: Frame::Ned,
        gravity: Vector3::new(0.0, 0.0, 9.80665),
        field: Vector3::new(20.0, 0.0, 44.0),
        field_estimated: false,
        temperature_mean: 30.0,
        covariates: vec!["motor_current".into()],
        covariate_means: vec![2.0],
        sensors: [true; 3],
        sensor_dt: [0.01; 3],
        has_temperature: true,
        temperature_course: None,
        gravity_course: None,
        attitude_smoothing: NARROWEST,
        position_smoothing: Some(NARROWEST),
        column_noise: [0.0; 3],
        ideal_noise: [0.0; 3],
        position_origin: nalgebra::Vector3::zeros(),
        attitude_columns: NARROWEST,
        // A fourth derivative by the narrowest polynomial has the rounding of the times in it.
        position_columns: Some(WIDER),
        attitude_bends: NARROWEST,
        position_bends: Some(WIDER),
        silent_axes: [[false; 3]; 3],
        silent_accelerations: [false; 3],
        noise_shares: [[0.0; 3]; 2],
        offset_unseen: nalgebra::Matrix3::zeros(),
        shaking_varies: true,
        reference_dt: 0.01,
        reference_packet: 1,
        reference_step: 0.0,
        ranges: [None; 3],
        steps: [[0.0; 3]; 3],
        steps_crossed: [[false; 3]; 3],
        rig: Some(rig(&t, &attitude)),
        rests: false,
        kinematics: KinematicsMemory::default(),
    };
    let mut effects = catalogue::built_in();
    for sensor in ["acc", "gyr", "mag"] {
        effects.push(catalogue::find(&format!("{sensor}.column:motor_current")).unwrap());
    }
    for effect in &effects {
        let zero = vec![0.0; effect.card().parameters.len()];
        let typical: Vec<f64> = effect
            .card()
            .parameters
            .iter()
            .enumerate()
            .map(|(k, p)| {
                let size = p.typical.unwrap_or(0.3) * (1.0 - 0.3 * k as f64);
                if p.found == Found::Search { 7.0 } else { size }
            })
            .collect();
        for at in [zero, typical] {
            if let Err(e) = check(effect, &at, &window, &facts) {
                panic!("{e}");
            }
        }
    }
}
