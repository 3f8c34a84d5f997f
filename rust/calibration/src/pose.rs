//! One pose: the readings of a sensor that lies still.

use nalgebra::Vector3;

use crate::pose_judge::Criteria;
use crate::side::Side;

/// Length of the blocks whose means tell how far the mean of correlated readings can be trusted, s.
const BLOCK: f64 = 0.25;

/// Why a pose is not used.
#[derive(Clone, Debug, PartialEq)]
pub enum Flaw {
    /// Still for this many seconds only.
    Short(f64),
    /// The direction crept by this angle (rad) from the first half of the pose to the second.
    Crept(f64),
    /// The readings scatter by this much (standard deviation of one axis, m/s^2), more than at rest.
    Unsteady(f64),
}

/// The readings of a sensor that lies still, summed up.
#[derive(Clone, Debug)]
pub struct Pose {
    /// First and last row.
    pub rows: (usize, usize),
    /// Time of the first and last reading, s.
    pub time: (f64, f64),
    /// Rows within the pose that were left out because the sensor was knocked.
    pub knocks: Vec<(usize, usize)>,
    /// Readings summed.
    pub n: usize,
    /// Mean specific force, m/s^2.
    pub mean: Vector3<f64>,
    /// Standard deviation of single readings.
    pub deviation: Vector3<f64>,
    /// Variance of the mean, correlation of the readings included.
    pub variance: Vector3<f64>,
    /// Mean angular rate, rad/s, and its variance.
    pub rate: Option<(Vector3<f64>, Vector3<f64>)>,
    /// The side that points up by the readings.
    pub side: Side,
    /// The side that the log's label names.
    pub label: Option<Side>,
    /// Why it is not used.
    pub flaw: Option<Flaw>,
}

/// Running sums of one sensor.
#[derive(Clone, Debug, Default)]
struct Sums {
    n: usize,
    mean: Vector3<f64>,
    /// Sum of squared deviations from the mean (Welford).
    square: Vector3<f64>,
    blocks: Vec<(f64, Vector3<f64>)>,
    block_start: f64,
}

impl Sums {
    fn add(&mut self, t: f64, reading: Vector3<f64>) {
        self.n += 1;
        let before = reading - self.mean;
        self.mean += before / self.n as f64;
        self.square += before.component_mul(&(reading - self.mean));
        match self.blocks.last_mut() {
            Some((count, sum)) if t - self.block_start < BLOCK => {
                *count += 1.0;
                *sum += reading;
            }
            _ => {
                self.block_start = t;
                self.blocks.push((1.0, reading));
            }
        }
    }

    fn deviation(&self) -> Vector3<f64> {
        (self.square / (self.n.max(2) - 1) as f64).map(f64::sqrt)
    }

    /// Variance of the mean: what white noise gives, or what the means of blocks say if that is more.
    fn variance_of_mean(&self) -> Vector3<f64> {
        let n = self.n.max(1) as f64;
        let white = self.deviation().map(|d| d * d) / n;
        let count = self.blocks.len() as f64;
        if count < 4.0 {
            return white;
        }
        let scatter = self.blocks.iter().fold(Vector3::zeros(), |sum, (k, block)| {
            let d = block / *k - self.mean;
            sum + d.component_mul(&d) * *k
        });
        let blocks = scatter / (n * (count - 1.0));
        white.sup(&blocks)
    }

    /// Angle (rad) between the means of the first and of the second half, and its standard error.
    fn creep(&self) -> Option<(f64, f64)> {
        let half = self.blocks.len() / 2;
        if half == 0 {
            return None;
        }
        let mean = |blocks: &[(f64, Vector3<f64>)]| {
            let (n, sum) = blocks
                .iter()
                .fold((0.0, Vector3::zeros()), |(n, sum), (k, s)| (n + k, sum + s));
            sum / n
        };
        let (first, second) = (mean(&self.blocks[..half]), mean(&self.blocks[half..]));
        // From block to block a creep hardly shows, so that it does not hide behind its own scatter (von Neumann 1941).
        let steps = self
            .blocks
            .windows(2)
            .map(|w| (w[1].1 / w[1].0 - w[0].1 / w[0].0).norm_squared());
        let scatter = steps.sum::<f64>() / (2 * (self.blocks.len() - 1)) as f64;
        let error = 2.0 * (scatter / self.blocks.len() as f64).sqrt() / self.mean.norm().max(f64::MIN_POSITIVE);
        Some((first.angle(&second), error))
    }
}

/// A pose in the making.
#[derive(Clone, Debug)]
pub struct OpenPose {
    first: usize,
    start: f64,
    last: usize,
    end: f64,
    /// What was read before this time (s) is motion.
    from: f64,
    force: Sums,
    rate: Sums,
    knocks: Vec<(usize, usize)>,
    /// Time lost to knocks, s.
    pause: f64,
}

impl OpenPose {
    /// A pose that begins at row `first`, time `start` (s).
    pub fn new(first: usize, start: f64) -> Self {
        Self {
            first,
            start,
            last: first,
            end: start,
            from: start,
            force: Sums::default(),
            rate: Sums::default(),
            knocks: Vec::new(),
            pause: 0.0,
        }
    }

    /// Adds a reading of the accelerometer.
    pub fn add(&mut self, row: usize, t: f64, force: Vector3<f64>) {
        if t < self.from {
            return;
        }
        self.force.add(t, force);
        self.last = row;
        self.end = t;
    }

    /// Adds a reading of the gyro.
    pub fn add_rate(&mut self, t: f64, rate: Vector3<f64>) {
        if t >= self.from {
            self.rate.add(t, rate);
        }
    }

    /// Time of the last reading, s.
    pub fn end(&self) -> f64 {
        self.end
    }

    /// Leaves out what came since the last reading, a knock, and goes on at row `first`, time `start` (s).
    pub fn leave_out_until(&mut self, first: usize, start: f64) {
        if first <= self.last + 1 {
            return;
        }
        match self.knocks.last_mut() {
            // Nothing was read since the knock before: it is one.
            Some((begin, last)) if *begin == self.last + 1 => *last = first - 1,
            _ => self.knocks.push((self.last + 1, first - 1)),
        }
        self.pause += (start - self.end).max(0.0);
        self.end = start;
        self.from = start;
    }

    /// Mean specific force so far.
    pub fn mean(&self) -> Vector3<f64> {
        self.force.mean
    }

    /// Readings so far.
    pub fn n(&self) -> usize {
        self.force.n
    }

    /// Time from the first reading to the last one, knocks left out, s.
    pub fn duration(&self) -> f64 {
        self.end - self.start - self.pause
    }

    /// The pose, judged. One that `crept` away, or from another, without a disturbance may have crept by less itself.
    pub fn close(self, criteria: &Criteria, label: Option<Side>, crept: bool) -> Pose {
        let (creep, certain) = if crept {
            (0.25 * criteria.creep, 3.0)
        } else {
            (criteria.creep, 5.0)
        };
        let scatter = (self.force.deviation().norm_squared() / 3.0).sqrt();
        let allowed = criteria.acc_noise.map_or(criteria.ceiling.0, |noise| {
            (3.0 * noise).max(2.0 * criteria.floor.0).min(criteria.ceiling.0)
        });
        let flaw = if self.duration() < criteria.hold || self.n() < criteria.fewest {
            Some(Flaw::Short(self.duration()))
        } else if scatter > allowed {
            Some(Flaw::Unsteady(scatter))
        } else {
            self.force
                .creep()
                .filter(|(angle, error)| *angle > creep.max(certain * error))
                .map(|(angle, _)| Flaw::Crept(angle))
        };
        Pose {
            rows: (self.first, self.last),
            time: (self.start, self.end),
            knocks: self.knocks,
            n: self.force.n,
            mean: self.force.mean,
            deviation: self.force.deviation(),
            variance: self.force.variance_of_mean(),
            rate: (self.rate.n > 1).then(|| (self.rate.mean, self.rate.variance_of_mean())),
            side: Side::nearest(&self.force.mean),
            label,
            flaw,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlated_readings_count_for_less_than_white_ones() {
        let mut pose = OpenPose::new(0, 0.0);
        let mut x = 0.0_f64;
        let mut seed = 1_u64;
        for i in 0..2000 {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let noise = (seed >> 33) as f64 / f64::from(1_u32 << 31) - 0.5;
            x = 0.95 * x + noise;
            pose.add(i, i as f64 * 0.01, Vector3::new(x, noise, 9.8));
        }
        let closed = pose.close(
            &Criteria {
                ceiling: (9.0, 9.0),
                ..Criteria::default()
            },
            None,
            false,
        );
        let white = closed.deviation.map(|d| d * d) / closed.n as f64;
        assert!(closed.variance.x > 8.0 * white.x);
        assert!(closed.variance.y < 2.0 * white.y);
        assert_eq!(closed.flaw, None);
        assert_eq!(closed.side.number(), 4);
    }

    #[test]
    fn a_pose_that_creeps_is_told() {
        let mut pose = OpenPose::new(0, 0.0);
        for i in 0..300 {
            let angle: f64 = 1e-4 * f64::from(i);
            pose.add(
                i as usize,
                f64::from(i) * 0.01,
                Vector3::new(9.8 * angle.sin(), 0.0, 9.8 * angle.cos()),
            );
        }
        let criteria = Criteria {
            creep: 0.005,
            ..Criteria::default()
        };
        assert!(matches!(pose.close(&criteria, None, false).flaw, Some(Flaw::Crept(a)) if (a - 0.015).abs() < 1e-3));
    }
}
