//! Bins of every covariate, in which the residual is averaged: any dependence shows there, whatever its shape.

use std::ops::Range;

use imufit_model::sensor::Sensor;
use imufit_model::sensor_model::Evaluation;

/// Bins per covariate, at most.
pub const BINS: usize = 12;

/// Noise deviations around an edge within which rows that may fall on either side of it are counted.
const NEAR: f64 = 4.0;
/// Standard errors by which sorting rows into bins by noise, which is in their residuals too, may shift the mean of a bin at most. Of
/// twelve bins three such edges are as much as one standard error.
const SHIFT: f64 = 0.3;

/// Covariates that every log has, before the log's own columns.
const FIXED: [&str; 9] = [
    "t",
    "temp",
    "f_x",
    "f_y",
    "f_z",
    "omega_x",
    "omega_y",
    "omega_z",
    "omega_norm",
];

/// Places of the components of the specific force among the covariates, ...
pub const FORCES: Range<usize> = 2..5;
/// ... and of those of the angular rate with its size.
pub const RATES: Range<usize> = 5..9;

/// Edges of the bins of every covariate.
#[derive(Clone, Debug)]
pub struct Bins {
    /// Covariate names: `t`, `temp`, `f_x` ... `omega_norm`, then the log's own columns.
    pub names: Vec<String>,
    /// Inner edges, increasing; empty where a covariate does not vary.
    pub edges: Vec<Vec<f64>>,
}

/// Samples of every covariate of a log; of forces and rates those that the reference gives, as far as it does.
#[derive(Clone, Debug)]
pub struct CovariateSamples {
    /// Names of the covariates.
    pub names: Vec<String>,
    /// Samples of each.
    pub values: Vec<Vec<f64>>,
    /// Rows of the log.
    pub rows: usize,
    /// Noise of the reference's rates, rad/s.
    pub rate_noise: f64,
    /// Noise of the reference's specific forces, m/s^2.
    pub force_noise: f64,
}

impl Bins {
    /// Places of what a sensor measures among the covariates, axis by axis; `None` for the field.
    pub const fn measured(sensor: Sensor) -> Option<Range<usize>> {
        match sensor {
            Sensor::Acc => Some(FORCES),
            Sensor::Gyr => Some(RATES.start..RATES.end - 1),
            Sensor::Mag => None,
        }
    }

    /// Names of the covariates of a log with these columns of its own.
    pub fn covariate_names(own: &[String]) -> Vec<String> {
        FIXED
            .iter()
            .map(|s| (*s).to_string())
            .chain(own.iter().cloned())
            .collect()
    }

    /// Number of bins of each covariate; none of one that does not vary.
    pub fn counts(&self) -> impl Iterator<Item = usize> {
        self.edges.iter().map(|e| if e.is_empty() { 0 } else { e.len() + 1 })
    }

    /// Unit of a covariate; empty for the log's own columns.
    pub fn unit(name: &str) -> &'static str {
        match name {
            "t" => "s",
            "temp" => "degC",
            "f_x" | "f_y" | "f_z" => "m/s^2",
            "omega_x" | "omega_y" | "omega_z" | "omega_norm" => "rad/s",
            _ => "",
        }
    }

    /// Bins of equal count from samples of one log, or of several together: for the covariates of the first of them. Rows sorted
    /// into bins by their reference's noise would show a dependence that is none: no edge is put where so many lie within that noise that
    /// it shows, and counts are equal without those.
    ///
    /// With k rows within NEAR deviations s to either side, noise moves k / (2 NEAR) times s from one side of the edge to the other, in all; the
    /// sum of a bin of m rows scatters by s times the root of m.
    pub fn new(logs: &[&CovariateSamples]) -> Self {
        let Some(first) = logs.first() else {
            return Self {
                names: Vec::new(),
                edges: Vec::new(),
            };
        };
        let most = |noise: fn(&CovariateSamples) -> f64| logs.iter().map(|l| noise(l)).fold(0.0, f64::max);
        let (rate_noise, force_noise) = (most(|l| l.rate_noise), most(|l| l.force_noise));
        let rows = logs.iter().map(|l| l.rows as f64).sum::<f64>();
        let edges = first
            .names
            .iter()
            .enumerate()
            .map(|(covariate, name)| {
                // Each log has a time of its own.
                let concerned = if covariate == 0 { &logs[..1] } else { logs };
                let of_log = |log: &&CovariateSamples| {
                    let k = log.names.iter().position(|n| n == name);
                    k.map_or_else(Vec::new, |k| log.values[k].clone())
                };
                let mut sample: Vec<f64> = concerned.iter().flat_map(of_log).collect();
                let noise = match covariate {
                    2..=4 => force_noise,
                    5..=8 => rate_noise,
                    _ => 0.0,
                };
                sample.sort_unstable_by(f64::total_cmp);
                let near = |v: f64| {
                    let reach = NEAR * noise;
                    sample.partition_point(|o| *o <= v + reach) - sample.partition_point(|o| *o < v - reach)
                };
                let most = SHIFT * (rows / BINS as f64).sqrt() * 2.0 * NEAR * sample.len() as f64 / rows;
                let possible: Vec<f64> = (sample.iter().copied())
                    .filter(|v| noise == 0.0 || near(*v) as f64 <= most)
                    .collect();
                let mut edges: Vec<f64> = Vec::new();
                for k in 1..BINS {
                    if possible.len() < 4 * BINS {
                        break;
                    }
                    let edge = possible[k * possible.len() / BINS];
                    // A covariate that rests on one value gets no bin of width zero.
                    if edge > sample[0] && edges.last().is_none_or(|e| edge > *e) {
                        edges.push(edge);
                    }
                }
                edges
            })
            .collect();
        Self {
            names: first.names.clone(),
            edges,
        }
    }

    /// Bin of each row for one covariate; `usize::MAX` where the covariate is not known.
    pub fn assign(&self, covariate: usize, t: &[f64], evaluation: &Evaluation, out: &mut Vec<usize>) {
        out.clear();
        let ideal = &evaluation.ideal;
        let edges = &self.edges[covariate];
        let mut put = |v: f64| {
            out.push(if v.is_finite() {
                edges.partition_point(|e| *e <= v)
            } else {
                usize::MAX
            });
        };
        match covariate {
            0 => t.iter().for_each(|v| put(*v)),
            1 => match &evaluation.temperature {
                // Edges are in degC; the evaluation holds the difference to the mean.
                Some(temperature) => temperature.iter().for_each(|v| put(*v)),
                None => t.iter().for_each(|_| put(f64::NAN)),
            },
            2..=4 => ideal.f.axis(covariate - 2).iter().for_each(|v| put(*v)),
            5..=7 => ideal.omega.axis(covariate - 5).iter().for_each(|v| put(*v)),
            8 => (0..t.len()).for_each(|i| put(ideal.omega.row(i).norm())),
            _ => evaluation.covariates[covariate - FIXED.len()]
                .iter()
                .for_each(|v| put(*v)),
        }
    }

    /// Shifts the temperature bins so that they apply to the difference to the mean.
    pub fn centre_temperature(&mut self, mean: f64) {
        if mean.is_finite() {
            for e in &mut self.edges[1] {
                *e -= mean;
            }
        }
    }
}
