//! Judges sample after sample whether the sensor lies still, long enough, and which side is up.
//!
//! A running program, the calibration wizard and a whole log use the same step.

use nalgebra::Vector3;

use crate::criteria::Criteria;
use crate::moving_window::MovingWindow;
use crate::pose::{OpenPose, Pose};
use crate::side::Side;

/// What the sensor is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// It moves or shakes.
    Moving,
    /// It lies still, not yet long enough.
    Settling,
    /// It lies still and the pose can be used.
    Held,
}

/// What one sample showed.
#[derive(Clone, Debug)]
pub struct Judgement {
    /// Present state.
    pub state: State,
    /// Side that points up; `None` before the first reading.
    pub side: Option<Side>,
    /// How much of the shortest pose is done, 0 to 1.
    pub progress: f64,
    /// Scatter of the last readings over what is allowed at rest; above 1 the sensor is not still.
    pub unrest: f64,
    /// Whether a pose is open: a disturbance that is as short as one may be does not end it.
    pub open: bool,
    /// A pose that ended with this sample.
    pub closed: Option<Pose>,
}

/// A scatter that is still allowed: so many times the noise that its own chance hardly ever reaches it.
pub fn allowance(readings: usize) -> f64 {
    1.5 + 4.0 / (6.0 * readings.max(1) as f64).sqrt()
}

/// Smallest change of direction (m/s^2) that is not the same pose any more.
const SAME: f64 = 0.05;

/// Judges samples as they come.
#[derive(Clone, Debug)]
pub struct PoseJudge {
    criteria: Criteria,
    force: MovingWindow,
    rate: MovingWindow,
    quietest: (f64, f64),
    pose: Option<OpenPose>,
    /// Time at which a disturbance of the open pose began, s.
    disturbed: Option<f64>,
    row: usize,
    last: Option<f64>,
    /// Rows of the readings in the window, oldest first.
    rows: std::collections::VecDeque<usize>,
    label: Option<Side>,
    /// Whether the open pose took over from one that ended without a disturbance, or ends so itself.
    crept: bool,
}

impl PoseJudge {
    /// A judge that has seen nothing.
    pub fn new(criteria: Criteria) -> Self {
        Self {
            force: MovingWindow::new(criteria.window, criteria.fewest),
            rate: MovingWindow::new(criteria.window, criteria.fewest),
            quietest: (f64::INFINITY, f64::INFINITY),
            pose: None,
            disturbed: None,
            row: 0,
            last: None,
            rows: std::collections::VecDeque::new(),
            label: None,
            crept: false,
            criteria,
        }
    }

    /// The label that the next poses carry.
    pub fn set_label(&mut self, label: Option<Side>) {
        self.label = label;
    }

    /// Judges one sample: time (s), specific force (m/s^2) and angular rate (rad/s); NaN is a missing reading.
    pub fn step(&mut self, t: f64, force: Vector3<f64>, rate: Option<Vector3<f64>>) -> Judgement {
        let row = self.row;
        self.row += 1;
        let mut closed = None;
        if self.last.is_some_and(|last| t - last > self.gap()) {
            closed = self.finish();
        }
        let finite = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
        let rate = rate.filter(finite);
        if let Some(rate) = rate {
            let pose = if self.disturbed.is_none() {
                self.pose.as_mut()
            } else {
                None
            };
            let mut pose = pose;
            self.rate.push(t, rate, |s, old| {
                if let Some(pose) = pose.as_mut() {
                    pose.add_rate(s, old);
                }
            });
        }
        if finite(&force) {
            self.last = Some(t);
            self.rows.push_back(row);
            let rows = &mut self.rows;
            let mut pose = if self.disturbed.is_none() {
                self.pose.as_mut()
            } else {
                None
            };
            self.force.push(t, force, |s, old| {
                let oldest = rows.pop_front().unwrap_or(row);
                if let Some(pose) = pose.as_mut() {
                    pose.add(oldest, s, old);
                }
            });
        }
        let unrest = self.unrest();
        let now = self.judge(t, unrest);
        closed = closed.or(now);
        let open = self.pose.as_ref().filter(|_| self.disturbed.is_none());
        let held = open.map_or(0.0, |p| {
            let waiting = self.force.start().map_or(0.0, |s| t - s.max(p.end()));
            let n = (p.n() + self.force.len()) as f64 / self.criteria.fewest as f64;
            ((p.duration() + waiting) / self.criteria.hold).min(n)
        });
        Judgement {
            state: match open {
                None => State::Moving,
                Some(_) if held < 1.0 => State::Settling,
                Some(_) => State::Held,
            },
            side: (!self.force.is_empty()).then(|| Side::nearest(&self.force.mean())),
            progress: held.min(1.0),
            unrest,
            open: self.pose.is_some(),
            closed,
        }
    }

    /// Ends the stream, or a part of it: the open pose, if any.
    pub fn finish(&mut self) -> Option<Pose> {
        let undisturbed = self.disturbed.take().is_none();
        let pose = self.pose.take();
        let rows = std::mem::take(&mut self.rows);
        let readings: Vec<_> = self.force.drain().collect();
        let rates: Vec<_> = self.rate.drain().collect();
        self.last = None;
        let mut pose = pose?;
        if undisturbed {
            for ((t, force), row) in readings.into_iter().zip(rows) {
                pose.add(row, t, force);
            }
            for (t, rate) in rates {
                pose.add_rate(t, rate);
            }
        }
        self.close(pose)
    }

    fn close(&mut self, pose: OpenPose) -> Option<Pose> {
        let crept = std::mem::take(&mut self.crept);
        pose.close(&self.criteria, self.label, crept)
    }

    /// A pause in the samples that ends a pose.
    fn gap(&self) -> f64 {
        let step = if self.force.len() > 1 {
            let start = self.force.start().unwrap_or(0.0);
            (self.last.unwrap_or(start) - start) / (self.force.len() - 1) as f64
        } else {
            0.0
        };
        self.criteria
            .window
            .max(5.0 * step)
            .max(if self.force.len() > 1 { 0.0 } else { f64::INFINITY })
    }

    /// Scatter over what is allowed; infinite before the window is full.
    fn unrest(&mut self) -> f64 {
        if !self.force.is_full() {
            return f64::INFINITY;
        }
        let acc = self.force.deviation();
        self.quietest.0 = self.quietest.0.min(acc);
        let criteria = &self.criteria;
        let limit = |noise: f64, readings: usize, floor: f64, ceiling: f64| {
            (noise * allowance(readings)).max(floor).min(ceiling)
        };
        let noise = criteria.acc_noise.unwrap_or(self.quietest.0);
        let mut unrest = acc / limit(noise, self.force.len(), criteria.floor.0, criteria.ceiling.0);
        if self.rate.is_full() {
            let gyr = self.rate.deviation();
            self.quietest.1 = self.quietest.1.min(gyr);
            let noise = criteria.gyr_noise.unwrap_or(self.quietest.1);
            unrest = unrest.max(gyr / limit(noise, self.rate.len(), criteria.floor.1, criteria.ceiling.1));
        }
        unrest
    }

    /// Opens, goes on with, or closes the pose.
    fn judge(&mut self, t: f64, unrest: f64) -> Option<Pose> {
        let still = unrest <= 1.0;
        if !still {
            if self.pose.is_some() && self.disturbed.is_none() {
                self.disturbed = Some(t);
            }
            let over = self.disturbed.is_some_and(|since| t - since > self.criteria.bridge);
            return if over { self.close_disturbed() } else { None };
        }
        let mean = self.force.mean();
        let disturbed = self.disturbed.is_some();
        let same = |pose: &OpenPose| {
            if disturbed && pose.duration() < self.criteria.window {
                return false;
            }
            let spread = self.force.deviation() / (self.force.len() as f64).sqrt();
            pose.n() < self.criteria.fewest || (mean - pose.mean()).norm() <= SAME.max(8.0 * spread)
        };
        match (self.pose.as_ref().map(same), self.disturbed) {
            (None, _) => {
                self.crept = false;
                self.open();
                None
            }
            (Some(true), None) => None,
            (Some(true), Some(_)) => {
                self.disturbed = None;
                let settled = self.settled();
                if let (Some(pose), Some((first, start))) = (self.pose.as_mut(), settled) {
                    pose.leave_out_until(first, start);
                }
                None
            }
            (Some(false), _) => {
                self.crept |= !disturbed;
                let closed = self.close_disturbed();
                self.open();
                self.crept = !disturbed;
                closed
            }
        }
    }

    fn open(&mut self) {
        if let Some((first, start)) = self.settled() {
            self.pose = Some(OpenPose::new(first, start));
            self.disturbed = None;
        }
    }

    /// Row and time at which the stillness of the present window began: the last of a turn hardly adds to the window's
    /// scatter, but to its mean.
    fn settled(&self) -> Option<(usize, f64)> {
        let by_force = self.force.time(self.force.tail())?;
        let by_rate = self.rate.time(self.rate.tail()).unwrap_or(by_force);
        let place = (0..self.force.len()).find(|k| self.force.time(*k) >= Some(by_force.max(by_rate)))?;
        Some((*self.rows.get(place)?, self.force.time(place)?))
    }

    fn close_disturbed(&mut self) -> Option<Pose> {
        self.disturbed = None;
        let pose = self.pose.take()?;
        // A pose shorter than the window is the end of a movement that passed for stillness.
        if pose.duration() < self.criteria.window {
            return None;
        }
        self.close(pose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Flaw;

    struct Noise(u64);

    impl Noise {
        fn next(&mut self) -> f64 {
            let mut sum = -6.0;
            for _ in 0..12 {
                self.0 = self
                    .0
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1_442_695_040_888_963_407);
                sum += (self.0 >> 11) as f64 / (1_u64 << 53) as f64;
            }
            sum
        }

        fn vector(&mut self, size: f64) -> Vector3<f64> {
            Vector3::new(self.next(), self.next(), self.next()) * size
        }
    }

    fn run(course: impl Fn(f64) -> Vector3<f64>, duration: f64) -> Vec<Pose> {
        let mut noise = Noise(7);
        let mut judge = PoseJudge::new(Criteria {
            acc_noise: Some(0.03),
            ..Criteria::default()
        });
        let mut poses = Vec::new();
        for i in 0..(duration * 100.0) as usize {
            let t = i as f64 * 0.01;
            poses.extend(judge.step(t, course(t) + noise.vector(0.03), None).closed);
        }
        poses.extend(judge.finish());
        poses
    }

    const UP: Vector3<f64> = Vector3::new(0.0, 0.0, 9.8);
    const SIDE: Vector3<f64> = Vector3::new(9.8, 0.0, 0.0);

    #[test]
    fn two_rests_with_a_turn_between_are_two_poses() {
        let poses = run(
            |t| {
                let s = ((t - 4.0) / 2.0).clamp(0.0, 1.0) * std::f64::consts::FRAC_PI_2;
                UP * s.cos() + SIDE * s.sin()
            },
            10.0,
        );
        assert_eq!(poses.len(), 2, "{poses:#?}");
        assert!(poses.iter().all(|p| p.flaw.is_none()), "{poses:#?}");
        assert!((poses[0].mean - UP).norm() < 0.02);
        assert!((poses[1].mean - SIDE).norm() < 0.02);
        assert!(poses[0].time.1 <= 4.1 && poses[1].time.0 >= 5.9);
    }

    #[test]
    fn a_knock_that_moves_nothing_leaves_one_pose_without_the_knock() {
        let poses = run(|t| if (5.0..5.1).contains(&t) { UP * 1.5 } else { UP }, 10.0);
        assert_eq!(poses.len(), 1);
        assert_eq!(poses[0].knocks.len(), 1);
        let (first, last) = poses[0].knocks[0];
        assert!(first <= 500 && last >= 509 && last - first < 110);
        assert!((poses[0].mean - UP).norm() < 0.01);
    }

    #[test]
    fn a_knock_that_shifts_the_sensor_begins_another_pose() {
        let tilted = UP + SIDE * 0.02;
        let poses = run(
            |t| match t {
                t if t < 5.0 => UP,
                t if t < 5.1 => UP * 1.5,
                _ => tilted,
            },
            10.0,
        );
        assert_eq!(poses.len(), 2);
        assert!((poses[1].mean - tilted).norm() < 0.02);
    }

    #[test]
    fn a_sensor_that_creeps_all_the_time_has_no_pose() {
        let poses = run(
            |t| {
                let s = (0.2 * t).to_radians();
                UP * s.cos() + SIDE * s.sin()
            },
            16.0,
        );
        assert!(poses.len() > 1, "{poses:#?}");
        assert!(
            poses
                .iter()
                .rev()
                .skip(1)
                .all(|p| matches!(p.flaw, Some(Flaw::Crept(_)))),
            "{poses:#?}"
        );
    }

    #[test]
    fn a_rest_that_is_left_slowly_stays_a_pose() {
        let poses = run(
            |t| {
                let s = 2.0 * (t - 6.0).clamp(0.0, 2.0).to_radians();
                UP * s.cos() + SIDE * s.sin()
            },
            14.0,
        );
        assert_eq!(poses.first().map(|p| p.flaw.clone()), Some(None), "{poses:#?}");
        assert!((poses[0].mean - UP).norm() < 0.01);
        assert_eq!(poses.last().map(|p| p.flaw.clone()), Some(None), "{poses:#?}");
    }

    #[test]
    fn a_shaking_hand_is_no_pose() {
        let poses = run(|t| UP + SIDE * 0.05 * (20.0 * t).sin(), 10.0);
        assert!(poses.iter().all(|p| p.flaw.is_some()));
    }

    #[test]
    fn missing_readings_and_gaps_are_borne() {
        let mut judge = PoseJudge::new(Criteria::default());
        let mut noise = Noise(3);
        let mut poses = Vec::new();
        for i in 0..1000 {
            let t = f64::from(i) * 0.01 + if i >= 500 { 30.0 } else { 0.0 };
            let force = if i % 10 == 3 {
                Vector3::repeat(f64::NAN)
            } else {
                UP + noise.vector(0.03)
            };
            poses.extend(judge.step(t, force, Some(noise.vector(0.001))).closed);
        }
        poses.extend(judge.finish());
        assert_eq!(poses.len(), 2);
        assert!(
            poses
                .iter()
                .all(|p| p.flaw.is_none() && p.mean.iter().all(|x| x.is_finite()))
        );
        assert!(poses[0].rate.is_some());
    }
}
