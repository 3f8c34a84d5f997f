//! The poses of a whole log.

use nalgebra::Vector3;

use crate::criteria::Criteria;
use crate::pose::{Flaw, Pose};
use crate::pose_judge::PoseJudge;
use crate::quantisation;
use crate::side::Side;

/// Readings of a whole log; NaN is a missing reading.
pub struct Readings<'a> {
    /// Time, s.
    pub t: &'a [f64],
    /// Specific force, m/s^2, three numbers a row.
    pub acc: &'a [f64],
    /// Angular rate, rad/s, three numbers a row.
    pub gyr: Option<&'a [f64]>,
}

impl Readings<'_> {
    fn force(&self, row: usize) -> Vector3<f64> {
        Vector3::from_column_slice(&self.acc[3 * row..3 * row + 3])
    }

    fn rate(&self, row: usize) -> Option<Vector3<f64>> {
        self.gyr
            .map(|gyr| Vector3::from_column_slice(&gyr[3 * row..3 * row + 3]))
    }
}

/// What a log says of its poses.
#[derive(Clone, Debug)]
pub struct Rests {
    /// All poses in the order of time, the flawed ones too.
    pub poses: Vec<Pose>,
    /// Noise at rest that was taken, one axis: m/s^2 and rad/s.
    pub noise: (Option<f64>, Option<f64>),
    /// Steps of the accelerometer's three axes, m/s^2.
    pub step: [Option<f64>; 3],
}

/// Part of the quiet windows by which the noise at rest is told: hardly any log rests for less than this.
const QUIET: f64 = 0.04;
/// The same where labels say when the sensor rests.
const QUIET_LABELLED: f64 = 0.3;

/// Finds the poses of a log. `labels` (a side a row) limits them to labelled rows; without labels every rest counts.
pub fn find(readings: &Readings<'_>, labels: Option<&[Option<Side>]>, criteria: &Criteria) -> Rests {
    let n = readings.t.len();
    let labelled = |row: usize| labels.is_none_or(|labels| labels[row].is_some());
    let quiet = if labels.is_some() { QUIET_LABELLED } else { QUIET };
    let mut criteria = criteria.clone();
    criteria.acc_noise = criteria
        .acc_noise
        .or_else(|| noise(readings, &criteria, &labelled, |row| Some(readings.force(row)), quiet));
    criteria.gyr_noise = criteria
        .gyr_noise
        .or_else(|| noise(readings, &criteria, &labelled, |row| readings.rate(row), quiet));
    let step: [Option<f64>; 3] = std::array::from_fn(|axis| {
        let stride = n.div_ceil(20_000).max(1);
        quantisation::step((0..n).step_by(stride).map(|row| readings.acc[3 * row + axis]))
    });

    let mut judge = PoseJudge::new(criteria.clone());
    let mut poses = Vec::new();
    let mut segment: Option<(usize, Side)> = None;
    let mut found = 0;
    let end_segment =
        |judge: &mut PoseJudge, poses: &mut Vec<Pose>, found: usize, segment: Option<(usize, Side)>, end: usize| {
            poses.extend(judge.finish());
            let Some((first, label)) = segment else { return };
            if poses.len() == found {
                poses.extend(unsteady(readings, first, end, label, &criteria));
            }
            moved(&mut poses[found..], criteria.creep);
        };
    for row in 0..n {
        let label = labels.and_then(|labels| labels[row]);
        if labels.is_some() && label != segment.map(|s| s.1) {
            end_segment(&mut judge, &mut poses, found, segment, row);
            segment = label.map(|label| (row, label));
            found = poses.len();
            judge.set_label(label);
        }
        // Rows without a label are motion between the poses: the judge counts them but does not look at them.
        let force = if labelled(row) {
            readings.force(row)
        } else {
            Vector3::repeat(f64::NAN)
        };
        let rate = if labelled(row) { readings.rate(row) } else { None };
        poses.extend(judge.step(readings.t[row], force, rate).closed);
    }
    end_segment(&mut judge, &mut poses, found, segment, n);
    for axis in 0..3 {
        let Some(step) = step[axis] else { continue };
        // One pose's scatter depends on where its mean lies between two steps: all poses together tell the noise.
        let still = poses.iter().filter(|pose| pose.flaw.is_none());
        let (count, square) = still.fold((0.0, 0.0), |(n, sum), pose| {
            (n + 1.0, sum + pose.deviation[axis].powi(2))
        });
        let noise = (square / f64::max(count, 1.0)).sqrt();
        for pose in &mut poses {
            pose.variance[axis] += quantisation::variance_of_mean(step, noise);
        }
    }
    if labels.is_none() {
        for chain in poses.chunk_by_mut(|a, b| a.crept && b.crept && b.time.0 - a.time.1 < 2.0 * criteria.window) {
            crept(chain, &criteria);
        }
        // Where nothing is labelled a rest of a moment is no pose that anybody meant.
        poses.retain(|pose| !matches!(pose.flaw, Some(Flaw::Short(s)) if s < 0.5 * criteria.hold));
    }
    Rests {
        poses,
        noise: (criteria.acc_noise, criteria.gyr_noise),
        step,
    }
}

/// Noise at rest of one axis, from the quietest windows.
fn noise(
    readings: &Readings<'_>,
    criteria: &Criteria,
    used: &dyn Fn(usize) -> bool,
    reading: impl Fn(usize) -> Option<Vector3<f64>>,
    quiet: f64,
) -> Option<f64> {
    let n = readings.t.len();
    let (mut deviations, mut fewest, mut row) = (Vec::new(), usize::MAX, 0);
    while row < n {
        let start = readings.t[row];
        let mut values = Vec::new();
        while row < n && (readings.t[row] - start < criteria.window || values.len() < criteria.fewest) {
            values.extend(reading(row).filter(|v| used(row) && v.iter().all(|x| x.is_finite())));
            row += 1;
        }
        if values.len() >= criteria.fewest {
            let count = values.len() as f64;
            let mean = values.iter().sum::<Vector3<f64>>() / count;
            let square: f64 = values.iter().map(|v| (v - mean).norm_squared()).sum();
            deviations.push((square / (count - 1.0) / 3.0).sqrt());
            fewest = fewest.min(values.len());
        }
    }
    if deviations.is_empty() {
        return None;
    }
    deviations.sort_by(f64::total_cmp);
    let place = ((deviations.len() as f64 * quiet) as usize).clamp(2.min(deviations.len() - 1), deviations.len() - 1);
    // A low quantile of the windows' scatter lies below the noise by chance alone.
    let low = 1.0 - 1.0 / (6.0 * fewest as f64).sqrt();
    Some(deviations[place] / low)
}

/// Poses that follow each other without a movement between them: if the direction changes along them, the short ones are
/// pieces of a slow turn. A long one is a rest that the turn began or ended with.
fn crept(chain: &mut [Pose], criteria: &Criteria) {
    let angles = chain.iter().flat_map(|a| chain.iter().map(|b| a.mean.angle(&b.mean)));
    let angle = angles.fold(0.0, f64::max);
    let short = |pose: &Pose| pose.flaw.is_none() && pose.time.1 - pose.time.0 < 3.0 * criteria.hold;
    if angle > criteria.creep {
        for pose in chain.iter_mut().filter(|pose| short(pose)) {
            pose.flaw = Some(Flaw::Crept(angle));
        }
    }
}

/// Poses of one labelled segment are one pose: where they point elsewhere the sensor moved, and none can be used.
fn moved(poses: &mut [Pose], creep: f64) {
    let still = poses.iter().any(|pose| pose.flaw.is_none());
    let counts = |pose: &Pose| match pose.flaw {
        None | Some(Flaw::Crept(_)) => true,
        Some(Flaw::Short(_)) => !still,
        Some(Flaw::Unsteady(_)) => false,
    };
    let means: Vec<_> = poses.iter().filter(|pose| counts(pose)).map(|pose| pose.mean).collect();
    let angles = means.iter().flat_map(|a| means.iter().map(|b| a.angle(b)));
    let angle = angles.fold(0.0, f64::max);
    if angle > creep {
        for pose in poses.iter_mut().filter(|pose| counts(pose)) {
            pose.flaw = Some(Flaw::Crept(angle));
        }
    }
}

/// A labelled segment in which no rest was found: what it looks like.
fn unsteady(readings: &Readings<'_>, first: usize, end: usize, label: Side, criteria: &Criteria) -> Option<Pose> {
    let mut pose = crate::pose::OpenPose::new(first, readings.t[first]);
    let finite = |row: &usize| readings.force(*row).iter().all(|x| x.is_finite());
    for row in (first..end).filter(finite) {
        pose.add(row, readings.t[row], readings.force(row));
    }
    let mut pose = pose.close(criteria, Some(label), false)?;
    if !matches!(pose.flaw, Some(Flaw::Short(_))) {
        let scatter = (pose.deviation.norm_squared() / 3.0).sqrt();
        pose.flaw = Some(Flaw::Unsteady(scatter));
    }
    Some(pose)
}
