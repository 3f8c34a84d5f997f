//! How wide the local polynomial through the reference may be: chosen from the reference alone.
//!
//! Widening averages more reference noise away until the polynomial no longer follows the motion. Two neighbouring
//! widths must then differ by more than their noise explains (the rule of Lepski 1991). The noise
//! itself comes from residuals of the narrowest fits, which any motion below a few hertz leaves untouched.

use crate::reference::LocalReference;
use crate::seen_bends::{SeenBends, Turns};
use crate::smoothing::{Kernel, LocalFit, NARROWEST, Smoothing};
use crate::window::Window;

/// The widths tried, narrowest first. The last ones follow no motion that a sensor could: they are for references that shake near
/// half their own sampling rate, and only the sensor can ask for them.
pub const WIDTHS: [Smoothing; 15] = [
    NARROWEST,
    Smoothing::uniform(8, 6),
    Smoothing::uniform(6, 6),
    Smoothing::uniform(6, 8),
    Smoothing::uniform(6, 11),
    Smoothing::uniform(6, 15),
    Smoothing::uniform(6, 20),
    Smoothing::uniform(6, 27),
    Smoothing::uniform(6, 36),
    Smoothing::uniform(6, 48),
    Smoothing::uniform(6, 64),
    Smoothing::uniform(6, 86),
    Smoothing::uniform(2, 1),
    Smoothing::uniform(2, 2),
    Smoothing::uniform(2, 4),
];

/// Number of widths that the reference alone may choose from.
const ORDERED: usize = 12;

const NOISE_FIT: Smoothing = Smoothing::uniform(8, 5);

/// Rows are judged in groups of like motion, so that short turns are not outvoted by long rests: upper ends of the groups, as shares of
/// the rows ordered by how fast the first derivative changes.
const GROUPS: [f64; 5] = [0.3, 0.7, 0.9, 0.97, 1.0];

/// Two widths agree if the mean square of their difference is at most this much above what noise explains, plus three times its own scatter.
const TOLERANCE: f64 = 1.1;
const SCATTER: f64 = 3.0;
/// Mean square that the widest width that agrees misses of the motion, over all rows, beside the noise of the difference.
const MISSED: f64 = 0.01;
/// By how much that falls with each narrower one: the sixth power of their ratio, squared.
const NARROWER: f64 = 36.0;
/// So many widths must agree before the noise counts as white.
const AGREEING: usize = 2;
/// Share of the rows that a width must reach.
const REACH: f64 = 0.9;
/// The reference's noise buries the sensor if a wider polynomial lowers the unexplained mean square by this factor.
const BURIED: f64 = 2.0;
/// Part of the mean square of a derivative from which on it shrinks what is fitted to it.
const NOISY: f64 = 1e-3;
/// Part of the mean square of a second derivative that noise may make. It would lower the residual by smoothing noise: at 0.4 % what a
/// reference low-passed at 5 Hz has lost comes out a third too small in whitened rows, at 0.15 % within 5 %.
const NOISY_BEND: f64 = 0.003;
/// Part of the mean square of a derivative that noise makes along one axis, from which on the axis is silent.
const NOISY_AXIS: f64 = 0.1;
/// The width whose second derivative tells how lively a row is.
const LIVELY: usize = 4;

/// What one polynomial says in a row.
#[derive(Clone, Copy, Debug)]
struct Found {
    /// The derivative, the one above it and the one above that.
    value: [f64; 3],
    above: [f64; 3],
    bend: [f64; 3],
    /// Variance that white noise of unit variance gives to each.
    gain: f64,
    gain_above: f64,
    gain_bend: f64,
}

impl Found {
    const NOTHING: Self = Self {
        value: [f64::NAN; 3],
        above: [f64::NAN; 3],
        bend: [f64::NAN; 3],
        gain: 0.0,
        gain_above: 0.0,
        gain_bend: 0.0,
    };

    /// Of the weights of each.
    fn of([weights, above, bend]: &[Vec<f64>; 3], values: &[[f64; 3]]) -> Self {
        let combine = |weights: &[f64]| {
            let mut value = [0.0; 3];
            for (w, v) in weights.iter().zip(values) {
                for axis in 0..3 {
                    value[axis] += w * v[axis];
                }
            }
            value
        };
        let gain = |weights: &[f64]| weights.iter().map(|w| w * w).sum();
        Self {
            value: combine(weights),
            above: combine(above),
            bend: combine(bend),
            gain: gain(weights),
            gain_above: gain(above),
            gain_bend: gain(bend),
        }
    }
}

/// Differences of neighbouring widths at one sampled row.
#[derive(Clone, Debug)]
struct Sample {
    lively: f64,
    difference: [f64; WIDTHS.len()],
    gain: [f64; WIDTHS.len()],
    /// By each width with knots that all count alike, and with tapered ones.
    found: [[Found; WIDTHS.len()]; 2],
    row: usize,
    reached: [bool; WIDTHS.len()],
}

/// Sampled rows and the noise of the reference.
#[derive(Clone, Debug)]
pub struct Bandwidth {
    of_attitude: bool,
    order: usize,
    noise_sum: f64,
    noise_freedom: usize,
    samples: Vec<Sample>,
    /// What the gyroscope sees of the attitude's third derivative by each width, tapered.
    seen: [SeenBends; ORDERED],
    spacing: Option<f64>,
    packet: usize,
}

impl Bandwidth {
    /// For the first derivative of the attitude.
    pub fn of_attitude() -> Self {
        Self::new(true, 1)
    }

    /// For the second derivative of the position.
    pub fn of_position() -> Self {
        Self::new(false, 2)
    }

    /// For the first derivative of a vector that stands in the window as its position.
    pub fn of_reading() -> Self {
        Self::new(false, 1)
    }

    fn new(of_attitude: bool, order: usize) -> Self {
        Self {
            of_attitude,
            order,
            noise_sum: 0.0,
            noise_freedom: 0,
            samples: Vec::new(),
            seen: Default::default(),
            spacing: None,
            packet: 1,
        }
    }

    /// Adds the rows given (indices into the window).
    pub fn add(&mut self, window: &Window, rows: impl Iterator<Item = usize>) {
        let reference = if self.of_attitude {
            LocalReference::attitude(window, None)
        } else {
            LocalReference::position(window, None)
        };
        let Some(reference) = reference else { return };
        let lowest = reference.lowest();
        let mut hint = 0;
        let mut local_fit = |at: f64, width: Smoothing| {
            let knot = reference.nearest(at, &mut hint)?;
            let near = reference.around(knot, width.half_width);
            let values = near.within(knot, width.half_width)?.to_vec();
            let fit = LocalFit::new(reference.times_around(knot, width.half_width), at, width, lowest)?;
            Some((fit, values, knot - width.half_width))
        };
        if self.spacing.is_none() {
            self.spacing = Some(reference.spacing()).filter(|s| *s > 0.0);
            self.packet = reference.packet();
        }
        let turns = Some(reference.spacing())
            .filter(|_| self.of_attitude)
            .and_then(|apart| Turns::of(window, reference.times(), apart));
        for row in rows {
            let at = window.t[row];
            if let Some((fit, values, _)) = local_fit(at, NOISE_FIT) {
                let (sum, freedom) = fit.residual(&values);
                self.noise_sum += sum;
                self.noise_freedom += freedom;
            }
            let zero = [0.0; WIDTHS.len()];
            let mut sample = Sample {
                lively: 0.0,
                difference: zero,
                gain: zero,
                found: [[Found::NOTHING; WIDTHS.len()]; 2],
                row: window.offset + row,
                reached: [false; WIDTHS.len()],
            };
            let mut last: Option<(usize, Vec<f64>, [f64; 3])> = None;
            let weights_of = |fit: &LocalFit| {
                let all = fit.weights();
                [0, 1, 2]
                    .map(|k| self.order + k)
                    .map(|order| all.iter().map(|w| w[order - lowest]).collect::<Vec<f64>>())
            };
            for (k, width) in WIDTHS.iter().enumerate() {
                let Some((fit, values, _)) = local_fit(at, *width) else {
                    continue;
                };
                let both = weights_of(&fit);
                sample.found[0][k] = Found::of(&both, &values);
                if k < ORDERED
                    && let Some((fit, values, first)) = local_fit(at, width.tapered())
                {
                    let weights = weights_of(&fit);
                    sample.found[1][k] = Found::of(&weights, &values);
                    if let Some(turns) = &turns {
                        let Found { value, above, bend, .. } = sample.found[1][k];
                        self.seen[k].add(turns, [value, above, bend], &weights[2], first);
                    }
                }
                let [weights, ..] = both;
                let value = sample.found[0][k].value;
                if k <= LIVELY {
                    sample.lively = sample.found[0][k].above.iter().map(|v| v * v).sum();
                }
                if let Some((half, narrow, before)) = last.as_ref().filter(|_| k < ORDERED) {
                    let margin = width.half_width - half;
                    let gain: f64 = weights
                        .iter()
                        .enumerate()
                        .map(|(j, w)| {
                            let inner = j.checked_sub(margin).and_then(|j| narrow.get(j)).unwrap_or(&0.0);
                            (w - inner).powi(2)
                        })
                        .sum();
                    sample.gain[k] = 3.0 * gain;
                    sample.difference[k] = (0..3).map(|a| (value[a] - before[a]).powi(2)).sum::<f64>();
                }
                sample.reached[k] = true;
                last = Some((width.half_width, weights, value));
            }
            self.samples.push(sample);
        }
    }

    /// Samples of the reference that come in one packet, where the log begins; 1 where every sample has a stamp of its own.
    pub fn packet(&self) -> usize {
        self.packet
    }

    /// Usual time between reference samples, s, where the log begins.
    pub fn spacing(&self) -> Option<f64> {
        self.spacing
    }

    /// White noise of the reference, per component: rad of attitude or m of position.
    pub fn noise(&self) -> f64 {
        (self.noise_sum / self.noise_freedom.max(1) as f64).sqrt()
    }

    /// What a polynomial says in each row that it reaches, with the row.
    fn rows(&self, width: Smoothing) -> impl Iterator<Item = (usize, &Found)> {
        let alike = |w: &Smoothing| (w.degree, w.half_width) == (width.degree, width.half_width);
        let place = WIDTHS.iter().position(alike);
        let kernel = usize::from(width.kernel == Kernel::Tapered);
        let reached = move |s: &&Sample| place.is_some_and(|k| s.reached[k] && s.found[kernel][k].gain > 0.0);
        (self.samples.iter().filter(reached)).map(move |s| (s.row, &s.found[kernel][place.unwrap_or_default()]))
    }

    /// The same without the row.
    fn found(&self, width: Smoothing) -> impl Iterator<Item = &Found> {
        self.rows(width).map(|(_, found)| found)
    }

    /// The derivative by one width in each row sampled, with the row.
    pub fn derivatives(&self, width: Smoothing) -> impl Iterator<Item = (usize, [f64; 3])> {
        self.rows(width).map(|(row, found)| (row, found.value))
    }

    /// Noise of the derivative at a width, per component: rad/s of the angular rate or m/s^2 of the acceleration.
    pub fn derivative_noise(&self, width: Smoothing) -> f64 {
        let (sum, n) = self
            .found(width)
            .fold((0.0, 0.0), |(sum, n), f| (sum + f.gain, n + 1.0));
        if n > 0.0 { self.noise() * (sum / n).sqrt() } else { 0.0 }
    }

    /// Mean square difference of each width to the next narrower one, over what noise explains: the worst group of rows,
    /// less what scatter allows that group. Infinite for a width that loses too many rows.
    pub fn excess(&self) -> Vec<f64> {
        let variance = self.noise().powi(2);
        let mut order: Vec<&Sample> = self.samples.iter().collect();
        order.sort_by(|a, b| a.lively.total_cmp(&b.lively));
        (1..ORDERED)
            .map(|k| {
                if order.is_empty() || !self.reaches(k) {
                    return f64::INFINITY;
                }
                let mut first = 0;
                let mut worst = 0.0_f64;
                for share in GROUPS {
                    let last = (share * order.len() as f64).round() as usize;
                    let group: Vec<&&Sample> = order[first..last].iter().filter(|s| s.reached[k]).collect();
                    first = last;
                    if group.is_empty() {
                        continue;
                    }
                    let difference: f64 = group.iter().map(|s| s.difference[k]).sum();
                    let gain: f64 = group.iter().map(|s| s.gain[k]).sum();
                    let scatter = SCATTER * (2.0 / (3.0 * group.len() as f64)).sqrt();
                    worst = worst.max(difference / (variance * gain).max(f64::MIN_POSITIVE) - scatter);
                }
                worst
            })
            .collect()
    }

    /// Index of the width that the reference alone allows for a log of so many rows, of which the first `agreeing` agree.
    ///
    /// What the widest that agrees with its neighbour misses of the motion is small beside the noise of one row, but it has the
    /// shape of the motion, so that over many rows it would show as a wrong scale. Each narrower width misses some [`NARROWER`] times less.
    fn allowed(agreeing: usize, rows: usize) -> usize {
        let missed = MISSED * rows as f64;
        let back = (missed.max(1.0).ln() / NARROWER.ln()).ceil().clamp(1.0, 2.0);
        agreeing.saturating_sub(back as usize)
    }

    /// Number of widths that agree with the next narrower one, from the narrowest on.
    fn agreeing(&self) -> usize {
        self.excess().iter().take_while(|excess| **excess <= TOLERANCE).count()
    }

    /// The width to use. Where the noise of the reference is not white (interpolated, quantised, filtered), its neighbours
    /// never agree and the reference alone would ask for the narrowest width, whose noise buries the sensor. So the sensor is asked too:
    /// `error[k]` is the mean square of what it leaves unexplained of the derivative at width `k`, summed over the axes.
    /// Only where that, less what white noise of the reference makes of it, falls by more than [`BURIED`] is a wider one taken, one
    /// narrower than the best. `rows` is the length of the log.
    pub fn choose(&self, error: &[f64], rows: usize) -> Smoothing {
        let agreeing = self.agreeing();
        let allowed = Self::allowed(agreeing, rows);
        // What the narrowest fits leave is white noise only if averaging more of it agrees.
        let white = if agreeing >= AGREEING {
            3.0 * self.derivative_noise(WIDTHS[allowed]).powi(2)
        } else {
            0.0
        };
        let best = (0..error.len())
            .filter(|k| error[*k].is_finite() && self.reaches(*k))
            .min_by(|a, b| error[*a].total_cmp(&error[*b]));
        match best {
            Some(best) if best > allowed && error.get(allowed).is_none_or(|e| e - white > BURIED * error[best]) => {
                WIDTHS[if best < ORDERED { (best - 1).max(allowed) } else { best }]
            }
            _ => WIDTHS[allowed],
        }
    }

    /// Width for what enters columns: rates and accelerations, and the derivatives above them (a delay, a lever arm). Noise in a
    /// column, be it only the steps of an encoder, shrinks its parameter, so up to two steps more of smoothing are taken wherever the
    /// reference is noisy at all.
    pub fn for_columns(&self, width: Smoothing) -> Smoothing {
        let Some(k) = WIDTHS[..ORDERED].iter().position(|w| *w == width) else {
            return width;
        };
        if k == 0 && !self.noisy(k) {
            return width;
        }
        let last = (k + 2).min(ORDERED - 1);
        (k + 1..=last)
            .rev()
            .find(|j| self.reaches(*j))
            .map_or(width, |j| WIDTHS[j].tapered())
    }

    /// Width for second derivatives of what a sensor reads: the narrowest, from that of columns on, of whose noise they hold little. A
    /// parabola, as columns are made of where a reference is interpolated, has none, and then it is the narrowest of all.
    pub fn for_bends(&self, columns: Smoothing) -> Smoothing {
        let known = |w: &Smoothing| (w.degree, w.half_width) == (columns.degree, columns.half_width);
        let first = WIDTHS[..ORDERED].iter().position(known);
        let wider = (first.map_or(0, |k| k + 1)..ORDERED).filter(|k| self.reaches(*k));
        let shares: Vec<(f64, Smoothing)> = (first.map(|k| (k, columns)).into_iter())
            .chain(wider.map(|k| (k, WIDTHS[k].tapered())))
            .map(|(k, width)| (self.bend_noise(k, width), width))
            .collect();
        let least = shares.iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let quiet = shares.iter().find(|(share, _)| *share <= NOISY_BEND);
        quiet.or(least).map_or(columns, |(_, width)| *width)
    }

    /// Part that noise of the reference makes of the mean square of the second derivative of the rate, or of the acceleration: as much as
    /// white noise would, and whatever the gyroscope does not see.
    fn bend_noise(&self, k: usize, width: Smoothing) -> f64 {
        let noise: f64 = self.found(width).map(|f| 3.0 * f.gain_bend).sum::<f64>() * self.noise().powi(2);
        let all: f64 = self.found(width).flat_map(|f| f.bend).map(|v| v * v).sum();
        let white = if noise > 0.0 { noise / all } else { 0.0 };
        white.max(self.seen[k].unseen().unwrap_or(0.0))
    }

    /// True if noise of the reference makes more than [`NOISY`] of the highest derivative that enters columns.
    fn noisy(&self, k: usize) -> bool {
        let noise: f64 = self.found(WIDTHS[k]).map(|f| 3.0 * f.gain_above).sum::<f64>() * self.noise().powi(2);
        let all: f64 = self.found(WIDTHS[k]).flat_map(|f| f.above).map(|v| v * v).sum();
        noise > NOISY * all
    }

    /// Axes along which noise of the reference makes more than [`NOISY_AXIS`] of the highest derivative that enters columns.
    pub fn noisy_axes(&self, width: Smoothing) -> [bool; 3] {
        let noise: f64 = self.found(width).map(|f| f.gain_above).sum::<f64>() * self.noise().powi(2);
        std::array::from_fn(|axis| noise > NOISY_AXIS * self.found(width).map(|f| f.above[axis].powi(2)).sum::<f64>())
    }

    /// Part that noise of the reference makes of the mean square of the derivative, axis by axis.
    pub fn noise_shares(&self, width: Smoothing) -> [f64; 3] {
        let noise: f64 = self.found(width).map(|f| f.gain).sum::<f64>() * self.noise().powi(2);
        std::array::from_fn(|axis| {
            let square: f64 = self.found(width).map(|f| f.value[axis].powi(2)).sum();
            if noise > 0.0 { (noise / square).min(1.0) } else { 0.0 }
        })
    }

    /// True if a width leaves nearly all rows with a reference: in a short log a wide polynomial would lose its ends.
    fn reaches(&self, width: usize) -> bool {
        let reached = |k: usize| self.samples.iter().filter(|s| s.reached[k]).count() as f64;
        reached(width) >= REACH * reached(0)
    }

    /// For every width the rows sampled with the derivative and the one above it.
    pub fn sampled(&self, width: usize) -> impl Iterator<Item = (usize, [f64; 3], [f64; 3])> + '_ {
        self.samples
            .iter()
            .filter(move |s| s.reached[width])
            .map(move |s| (s.row, s.found[0][width].value, s.found[0][width].above))
    }
}
