//! What effects on one sensor add to a reading, against the physics worked out by hand for a motion that is known exactly.
#![allow(missing_docs)]

use imufit_model::catalogue;
use imufit_model::facts::{Frame, LogFacts};
use imufit_model::kinematics_memory::KinematicsMemory;
use imufit_model::sensor_model::SensorModel;
use imufit_model::smoothing::NARROWEST;
use imufit_model::window::Window;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

const N: usize = 400;
const ROW: usize = 200;

/// A body that swings about a fixed axis of its own: its angle, rate and attitude are known in closed form.
struct Swing {
    frame: Frame,
    axis: Vector3<f64>,
    start: UnitQuaternion<f64>,
}

impl Swing {
    fn angle(t: f64) -> f64 {
        0.8 * (2.0 * t).sin()
    }

    fn rate(t: f64) -> f64 {
        1.6 * (2.0 * t).cos()
    }

    fn attitude(&self, t: f64) -> UnitQuaternion<f64> {
        self.start * UnitQuaternion::from_scaled_axis(self.axis * Self::angle(t))
    }

    fn omega(&self, t: f64) -> Vector3<f64> {
        self.axis * Self::rate(t)
    }

    fn force(&self, t: f64) -> Vector3<f64> {
        self.attitude(t).inverse_transform_vector(&(self.frame.up() * 9.80665))
    }
}

fn swing(frame: Frame) -> Swing {
    Swing {
        frame,
        axis: Vector3::new(0.6, 0.0, 0.8),
        start: UnitQuaternion::from_euler_angles(0.4, -0.3, 1.1),
    }
}

fn time(row: usize) -> f64 {
    7.0 + row as f64 * 0.01
}

/// What an effect adds to the reading of channel after channel in one row.
fn added(swing: &Swing, id: &str, parameters: &[f64]) -> Vec<f64> {
    added_beside(swing, &[], id, parameters)
}

/// The same in a model that has other effects.
fn added_beside(swing: &Swing, others: &[(&str, &[f64])], id: &str, parameters: &[f64]) -> Vec<f64> {
    let t: Vec<f64> = (0..N).map(time).collect();
    let attitude: Vec<f64> = t
        .iter()
        .flat_map(|t| {
            let q = swing.attitude(*t);
            [q.w, q.i, q.j, q.k]
        })
        .collect();
    let reading = vec![0.0; 3 * N];
    let current: Vec<f64> = t.iter().map(|t| 2.0 + t.sin()).collect();
    let window = Window {
        t: &t,
        readings: [Some(&reading); 3],
        temperature: None,
        attitude: Some(&attitude),
        position: None,
        reference_exact: None,
        covariates: vec![&current],
        offset: 0,
        begin: ROW,
        end: ROW + 1,
    };
    let facts = LogFacts {
        n: N,
        t_start: t[0],
        t_end: t[N - 1],
        dt: 0.01,
        frame: swing.frame,
        gravity: -swing.frame.up() * 9.80665,
        field: Vector3::new(20.0, 3.0, 44.0),
        field_estimated: false,
        temperature_mean: f64::NAN,
        covariates: vec!["motor_current".into()],
        covariate_means: vec![2.0],
        sensors: [true; 3],
        sensor_dt: [0.01; 3],
        has_temperature: false,
        temperature_course: None,
        gravity_course: None,
        attitude_smoothing: NARROWEST,
        position_smoothing: None,
        column_noise: [0.0; 3],
        ideal_noise: [0.0; 3],
        position_origin: nalgebra::Vector3::zeros(),
        attitude_columns: NARROWEST,
        position_columns: None,
        attitude_bends: NARROWEST,
        position_bends: None,
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
        rig: None,
        rests: false,
        kinematics: KinematicsMemory::default(),
    };
    let of = |effects| -> Vec<f64> {
        let model = SensorModel::new(effects, vec![], &facts);
        let found = model.and_then(|model| model.evaluate(&window, &facts));
        // Readings are zero: the residual is the modelled reading, its sign changed.
        let channels = found.map_or_else(|_| vec![], |found| found.channels);
        channels
            .into_iter()
            .map(|c| c.map_or(f64::NAN, |c| -c.residual[0]))
            .collect()
    };
    let effects = |given: &[(&str, &[f64])]| {
        let known = |(id, values): &(&str, &[f64])| catalogue::find(id).map(|effect| (effect, values.to_vec()));
        given.iter().filter_map(known).collect()
    };
    of(effects(&[others, &[(id, parameters)]].concat()))
        .iter()
        .zip(of(effects(others)))
        .map(|(with, without)| with - without)
        .collect()
}

fn near(found: &[f64], sensor: usize, expected: Vector3<f64>, tolerance: f64) {
    assert_eq!(found.len(), 9, "the model could not be evaluated");
    for channel in 0..9 {
        let wanted = if channel / 3 == sensor {
            expected[channel % 3]
        } else {
            0.0
        };
        assert!(
            (found[channel] - wanted).abs() <= tolerance,
            "channel {channel}: {} instead of {wanted}",
            found[channel]
        );
    }
}

#[test]
fn a_drift_counts_from_the_start_of_the_log() {
    let c = [1e-3, -2e-3, 5e-4];
    let expected = Vector3::from(c) * (time(ROW) - time(0));
    near(&added(&swing(Frame::Ned), "acc.bias_drift", &c), 0, expected, 1e-12);
    near(&added(&swing(Frame::Ned), "gyr.bias_drift", &c), 1, expected, 1e-12);
}

#[test]
fn nonlinear_readings_bend_over_the_quantity_of_their_own_axis() {
    let swing = swing(Frame::Enu);
    let k = Vector3::new(1e-3, -2e-3, 5e-4);
    let (f, omega) = (swing.force(time(ROW)), swing.omega(time(ROW)));
    let cases: [(&str, usize, Vector3<f64>); 5] = [
        ("acc.quadratic", 0, f.map(|x| x * x)),
        ("acc.cubic", 0, f.map(|x| x.powi(3))),
        ("gyr.quadratic", 1, omega.map(|x| x * x)),
        ("gyr.cubic", 1, omega.map(|x| x.powi(3))),
        ("gyr.scale_asymmetry", 1, omega.map(f64::abs)),
    ];
    for (id, sensor, shape) in cases {
        near(&added(&swing, id, k.as_slice()), sensor, shape.component_mul(&k), 1e-7);
    }
}

#[test]
fn the_earth_turns_about_its_axis_whatever_the_frame() {
    // At 49 degrees north; the body's attitude against north, east and down is the same in every frame.
    let (rate, latitude) = (7.292e-5, 49.0_f64.to_radians());
    let (north, up) = (rate * latitude.cos(), rate * latitude.sin());
    for frame in Frame::ALL {
        let swing = swing(frame);
        let axis = frame.north() * north + frame.up() * up;
        let expected = swing.attitude(time(ROW)).inverse_transform_vector(&axis);
        near(&added(&swing, "gyr.earth_rate", &[north, up]), 1, expected, 1e-12);
    }
}

#[test]
fn a_gyroscope_feels_the_force_at_the_sensor() {
    let (swing, t) = (swing(Frame::Ned), time(ROW));
    let g = [2e-4, -1e-4, 3e-4, 5e-5, -2e-4, 1e-4, 4e-5, -3e-4, 6e-5];
    let arm = [0.3, -0.2, 0.5];
    let matrix = Matrix3::from_row_slice(&g);
    let (omega, alpha, r) = (
        swing.omega(t),
        swing.axis * (-3.2 * (2.0 * t).sin()),
        Vector3::from(arm),
    );
    let moved = omega.cross(&omega.cross(&r)) + alpha.cross(&r);
    let alone = added(&swing, "gyr.g_sensitivity", &g);
    near(&alone, 1, matrix * swing.force(t), 1e-9);
    let beside = added_beside(&swing, &[("acc.lever_arm", &arm)], "gyr.g_sensitivity", &g);
    near(&beside, 1, matrix * (swing.force(t) + moved), 1e-8);
    assert!((matrix * moved).norm() > 2e-5);
}

#[test]
fn no_current_makes_no_field() {
    let c = [1.0, -0.5, 0.2];
    let expected = Vector3::from(c) * (2.0 + time(ROW).sin());
    near(&added(&swing(Frame::Ned), "mag.current", &c), 2, expected, 1e-12);
}

#[test]
fn a_late_sensor_shows_what_was() {
    let (swing, t, tau) = (swing(Frame::Nwu), time(ROW), 0.023);
    let field = |t: f64| {
        swing
            .attitude(t)
            .inverse_transform_vector(&Vector3::new(20.0, 3.0, 44.0))
    };
    near(
        &added(&swing, "acc.delay", &[tau]),
        0,
        swing.force(t - tau) - swing.force(t),
        1e-6,
    );
    near(
        &added(&swing, "gyr.delay", &[tau]),
        1,
        swing.omega(t - tau) - swing.omega(t),
        1e-6,
    );
    near(&added(&swing, "mag.delay", &[tau]), 2, field(t - tau) - field(t), 1e-6);
}

#[test]
fn a_sluggish_gyroscope_follows_its_differential_equation() {
    let (swing, t, tau) = (swing(Frame::Ned), time(ROW), 0.05_f64);
    // tau dy/dt = x - y with x = 1.6 cos(2 t), long after the start.
    let y = 1.6 / (1.0 + (2.0 * tau).powi(2)) * ((2.0 * t).cos() + 2.0 * tau * (2.0 * t).sin());
    let expected = swing.axis * y - swing.omega(t);
    assert!(expected.norm() > 0.05);
    near(&added(&swing, "gyr.lowpass", &[tau]), 1, expected, 1e-6);
}

#[test]
fn a_warm_up_fades_and_a_range_ends() {
    let swing = swing(Frame::Ned);
    let c = Vector3::new(0.01, -0.02, 0.005);
    let left = (-(time(ROW) - time(0)) / 1.5).exp();
    near(&added(&swing, "gyr.warmup", &[c.x, c.y, c.z, 1.5]), 1, c * left, 1e-12);
    let f = swing.force(time(ROW));
    let range = 0.7 * f.amax();
    let cut = f.map(|x| x.clamp(-range, range) - x);
    assert!(cut.norm() > 1.0);
    near(&added(&swing, "acc.saturation", &[range]), 0, cut, 1e-7);
}

/// What all sensors would read of the swing with other courses of its angle and rate, less what they read of it as recorded.
fn other_motion(swing: &Swing, angle: f64, rate: f64) -> [Vector3<f64>; 3] {
    let field = Vector3::new(20.0, 3.0, 44.0);
    let read = |angle: f64, rate: f64| {
        let attitude = swing.start * UnitQuaternion::from_scaled_axis(swing.axis * angle);
        let up = swing.frame.up() * 9.80665;
        [
            attitude.inverse_transform_vector(&up),
            swing.axis * rate,
            attitude.inverse_transform_vector(&field),
        ]
    };
    let (now, t) = (read(angle, rate), time(ROW));
    let recorded = read(Swing::angle(t), Swing::rate(t));
    std::array::from_fn(|sensor| now[sensor] - recorded[sensor])
}

fn near_on_all(found: &[f64], expected: [Vector3<f64>; 3], tolerance: f64) {
    let own = |sensor: usize| {
        let mut out = vec![0.0; 9];
        out[3 * sensor..3 * sensor + 3].copy_from_slice(&found[3 * sensor..3 * sensor + 3]);
        out
    };
    assert_eq!(found.len(), 9, "the model could not be evaluated");
    for (sensor, expected) in expected.into_iter().enumerate() {
        assert!(
            expected.norm() > 100.0 * tolerance,
            "nothing to be seen on sensor {sensor}"
        );
        near(&own(sensor), sensor, expected, tolerance);
    }
}

#[test]
fn a_reference_on_another_clock_is_ever_later_and_turns_at_another_rate() {
    let (swing, k) = (swing(Frame::Ned), 0.02);
    let stamp = time(ROW) + k * (time(ROW) - time(0));
    let expected = other_motion(&swing, Swing::angle(stamp), (1.0 + k) * Swing::rate(stamp));
    near_on_all(&added(&swing, "ref.skew", &[k]), expected, 1e-6);
}

#[test]
fn a_smoothed_reference_has_lost_its_second_derivative() {
    let (swing, c) = (swing(Frame::Enu), 0.01);
    // The angle is a sine of 2 rad/s: its second derivative is -4 times itself.
    let (angle, rate) = (Swing::angle(time(ROW)), Swing::rate(time(ROW)));
    let expected = other_motion(&swing, (1.0 + 4.0 * c) * angle, (1.0 + 4.0 * c) * rate);
    near_on_all(&added(&swing, "ref.lowpass", &[c]), expected, 1e-5);
}
