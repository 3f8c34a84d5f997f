//! One pose: the readings of a sensor that lies still.

use nalgebra::Vector3;

use crate::criteria::Criteria;
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
    /// Whether it crept away, or from the pose before it, without a disturbance between them.
    pub crept: bool,
    /// Why it is not used.
    pub flaw: Option<Flaw>,
}

/// Sums of a part of a pose.
#[derive(Clone, Debug)]
struct Block {
    rows: (usize, usize),
    time: (f64, f64),
    n: f64,
    mean: Vector3<f64>,
    /// Sum of squared deviations from the mean (Welford).
    square: Vector3<f64>,
}

impl Block {
    fn new(row: usize, t: f64, reading: Vector3<f64>) -> Self {
        Self {
            rows: (row, row),
            time: (t, t),
            n: 1.0,
            mean: reading,
            square: Vector3::zeros(),
        }
    }

    fn add(&mut self, row: usize, t: f64, reading: Vector3<f64>) {
        self.n += 1.0;
        let before = reading - self.mean;
        self.mean += before / self.n;
        self.square += before.component_mul(&(reading - self.mean));
        self.rows.1 = row;
        self.time.1 = t;
    }

    /// Both parts as one.
    fn joined(&self, other: &Self) -> Self {
        let n = self.n + other.n;
        let step = other.mean - self.mean;
        Self {
            rows: (self.rows.0, other.rows.1),
            time: (self.time.0, other.time.1),
            n,
            mean: self.mean + step * (other.n / n),
            square: self.square + other.square + step.component_mul(&step) * (self.n * other.n / n),
        }
    }
}

/// One sensor's readings in blocks.
#[derive(Clone, Debug, Default)]
struct Sums {
    blocks: Vec<Block>,
}

/// Blocks at either end of a pose that may be the tail of a movement.
const EDGE: usize = 2;
/// They are if they differ from the pose's middle by this many times its own scatter.
const STRANGE: f64 = 4.0;

impl Sums {
    fn add(&mut self, row: usize, t: f64, reading: Vector3<f64>) {
        match self.blocks.last_mut() {
            Some(block) if t - block.time.0 < BLOCK => block.add(row, t, reading),
            _ => self.blocks.push(Block::new(row, t, reading)),
        }
    }

    /// Time (s) of the first and last block that belong to the pose: a movement dies away slowly, and its tail would turn
    /// the mean and pass for a bias of the gyro.
    fn calm(&self) -> Option<(f64, f64)> {
        let count = self.blocks.len();
        if count < 3 * EDGE {
            return None;
        }
        let middle = &self.blocks[EDGE..count - EDGE];
        let median = |values: &mut Vec<f64>| {
            let half = values.len() / 2;
            *values.select_nth_unstable_by(half, f64::total_cmp).1
        };
        let centre =
            Vector3::from_fn(|axis, _| median(&mut middle.iter().map(|block| block.mean[axis]).collect::<Vec<f64>>()));
        let away = |block: &Block| (block.mean - centre).norm();
        let scatter = median(&mut middle.iter().map(away).collect::<Vec<f64>>());
        let strange = |block: &&Block| away(block) > STRANGE * scatter;
        let first = self.blocks[..EDGE]
            .iter()
            .rposition(|block| strange(&block))
            .map_or(0, |k| k + 1);
        let last = self.blocks[count - EDGE..].iter().position(|block| strange(&block));
        let last = last.map_or(count, |k| count - EDGE + k);
        Some((self.blocks[first].time.0, self.blocks[last - 1].time.1))
    }

    /// Only the blocks within a span of time.
    fn within(&mut self, (start, end): (f64, f64)) {
        self.blocks.retain(|block| block.time.1 > start && block.time.0 < end);
    }

    fn whole(&self) -> Option<Block> {
        let (first, rest) = self.blocks.split_first()?;
        Some(rest.iter().fold(first.clone(), |sum, block| sum.joined(block)))
    }

    /// Variance of the mean: what white noise gives, or what the means of blocks say if that is more.
    fn variance_of_mean(&self, whole: &Block) -> Vector3<f64> {
        let white = whole.square / (whole.n.max(2.0) - 1.0) / whole.n;
        let count = self.blocks.len() as f64;
        if count < 4.0 {
            return white;
        }
        let scatter = self.blocks.iter().fold(Vector3::zeros(), |sum: Vector3<f64>, block| {
            let d = block.mean - whole.mean;
            sum + d.component_mul(&d) * block.n
        });
        white.sup(&(scatter / (whole.n * (count - 1.0))))
    }

    /// Angle (rad) between the means of the first and of the second half, and its standard error.
    fn creep(&self, whole: &Block) -> Option<(f64, f64)> {
        let half = self.blocks.len() / 2;
        if half == 0 {
            return None;
        }
        let mean = |blocks: &[Block]| {
            let (n, sum) = blocks
                .iter()
                .fold((0.0, Vector3::zeros()), |(n, sum), b| (n + b.n, sum + b.mean * b.n));
            sum / n
        };
        let (first, second) = (mean(&self.blocks[..half]), mean(&self.blocks[half..]));
        // From block to block a creep hardly shows, so that it does not hide behind its own scatter (von Neumann 1941).
        let steps = self.blocks.windows(2).map(|w| (w[1].mean - w[0].mean).norm_squared());
        let scatter = steps.sum::<f64>() / (2 * (self.blocks.len() - 1)) as f64;
        let error = 2.0 * (scatter / self.blocks.len() as f64).sqrt() / whole.mean.norm().max(f64::MIN_POSITIVE);
        Some((first.angle(&second), error))
    }
}

/// Share of the creep that is forgiven to a pose that ended by creeping away: a slow turn is no row of short poses.
const CREPT: f64 = 0.25;

/// A pose in the making.
#[derive(Clone, Debug)]
pub struct OpenPose {
    start: f64,
    last: usize,
    end: f64,
    /// What was read before this time (s) is motion.
    from: f64,
    n: usize,
    mean: Vector3<f64>,
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
            start,
            last: first,
            end: start,
            from: start,
            n: 0,
            mean: Vector3::zeros(),
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
        self.force.add(row, t, force);
        let step = (force - self.mean) / (self.n + 1) as f64;
        self.n += 1;
        self.mean += step;
        self.last = row;
        self.end = t;
    }

    /// Adds a reading of the gyro.
    pub fn add_rate(&mut self, t: f64, rate: Vector3<f64>) {
        if t >= self.from {
            self.rate.add(0, t, rate);
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
        self.mean
    }

    /// Readings so far.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Time from the first reading to the last one, knocks left out, s.
    pub fn duration(&self) -> f64 {
        self.end - self.start - self.pause
    }

    /// The pose, judged, without the tails of movements at its ends; `None` if nothing was read.
    /// One that `crept` away, or from another, without a disturbance may have crept by less itself.
    pub fn close(mut self, criteria: &Criteria, label: Option<Side>, crept: bool) -> Option<Pose> {
        let (creep, certain) = if crept {
            (CREPT * criteria.creep, 3.0)
        } else {
            (criteria.creep, 5.0)
        };
        for span in [self.rate.calm(), self.force.calm()].into_iter().flatten() {
            self.force.within(span);
            self.rate.within(span);
        }
        let whole = self.force.whole()?;
        let deviation = (whole.square / (whole.n.max(2.0) - 1.0)).map(f64::sqrt);
        let scatter = (deviation.norm_squared() / 3.0).sqrt();
        let allowed = criteria.acc_noise.map_or(criteria.ceiling.0, |noise| {
            (3.0 * noise).max(2.0 * criteria.floor.0).min(criteria.ceiling.0)
        });
        let still = whole.time.1 - whole.time.0 - self.pause;
        let flaw = if still < criteria.hold || (whole.n as usize) < criteria.fewest {
            Some(Flaw::Short(still.max(0.0)))
        } else if scatter > allowed {
            Some(Flaw::Unsteady(scatter))
        } else {
            self.force
                .creep(&whole)
                .filter(|(angle, error)| *angle > creep.max(certain * error))
                .map(|(angle, _)| Flaw::Crept(angle))
        };
        self.knocks
            .retain(|(first, last)| *first > whole.rows.0 && *last < whole.rows.1);
        Some(Pose {
            rows: whole.rows,
            time: whole.time,
            knocks: self.knocks,
            n: whole.n as usize,
            mean: whole.mean,
            deviation,
            variance: self.force.variance_of_mean(&whole),
            rate: self
                .rate
                .whole()
                .filter(|rate| rate.n > 1.0)
                .map(|rate| (rate.mean, self.rate.variance_of_mean(&rate))),
            side: Side::nearest(&whole.mean),
            label,
            crept,
            flaw,
        })
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
        let closed = pose
            .close(
                &Criteria {
                    ceiling: (9.0, 9.0),
                    ..Criteria::default()
                },
                None,
                false,
            )
            .expect("readings");
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
        assert!(
            matches!(pose.close(&criteria, None, false).expect("readings").flaw, Some(Flaw::Crept(a)) if (a - 0.015).abs() < 1e-3)
        );
    }
}
