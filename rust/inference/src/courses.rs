//! Courses in time of a channel's zero that no walk makes: a level shift, a pulse, a transient, an oscillation, and what lags behind
//! a covariate.

use std::f64::consts::TAU;

use imufit_fit::bins::Bins;
use imufit_model::sensor::Sensor;
use nalgebra::{DMatrix, DVector};

use crate::asked::Asked;
use crate::bins::{self, Covariate};
use crate::criterion::Criterion;
use crate::stack::{Beside, Stack};

/// Courses of each family that are integrated over the noise, of those that stand out at the likeliest noise and without any.
const LOOKED_AT: usize = 3;
/// Parts of a block after which a level shift may come.
const FILLED: [f64; 4] = [0.0, 0.25, 0.5, 0.75];
/// Blocks before and after a pulse that show the level from which it rises and to which it comes back.
const BACK: usize = 3;
/// Widths of a transient, blocks; each is half as wide again as the one before.
const WIDTHS: [f64; 7] = [0.75, 1.1, 1.7, 2.5, 3.8, 5.7, 8.5];
/// Time constants of a lag, blocks.
const FORGOTTEN: [f64; 4] = [0.7, 1.5, 3.0, 6.0];
/// Oscillations in a log: fewer are a drift, more than one in three blocks are not resolved.
const SLOWEST: f64 = 1.5;
/// Step between the numbers of oscillations tried.
const FINENESS: f64 = 0.25;
/// Blocks that an oscillation needs.
const RESOLVED: f64 = 3.0;

/// What a zero does.
#[derive(Clone, Debug, PartialEq)]
pub enum Course {
    /// Another level for a while, or from a time on; blocks from the start.
    Level {
        /// When it begins.
        begin: f64,
        /// When it ends; infinite for a level shift.
        end: f64,
    },
    /// A rise and fall, as of the field of a magnet that passes by.
    Transient {
        /// Its middle, blocks from the start.
        middle: f64,
        /// Where it has fallen to a third, blocks from the middle.
        width: f64,
    },
    /// An oscillation.
    Oscillation {
        /// Periods in the log.
        periods: f64,
    },
    /// What lags behind a covariate.
    Lag {
        /// Its name and its place among the bins: one for all axes, or one for each axis.
        behind: Vec<(String, usize)>,
        /// Time constant, blocks.
        blocks: f64,
    },
}

impl Course {
    /// Its values in each block (blocks x parameters), for each axis where it has some for each; those of a lag follow its covariate.
    fn columns(&self, blocks: usize, means: impl Fn(usize) -> Option<DVector<f64>>) -> Vec<DMatrix<f64>> {
        let of_time = |value: &dyn Fn(usize) -> f64| DMatrix::from_fn(blocks, 1, |b, _| value(b));
        vec![match *self {
            Self::Level { begin, end } => of_time(&|b| since(begin, b) - since(end, b)),
            Self::Transient { middle, width } => of_time(&|b| {
                let away = (b as f64 + 0.5 - middle) / width;
                // The field of a dipole falls with the cube of the distance.
                (1.0 + away * away).powf(-1.5)
            }),
            Self::Oscillation { periods } => DMatrix::from_fn(blocks, 2, |b, k| {
                let phase = TAU * periods * (b as f64 + 0.5) / blocks as f64;
                [phase.cos(), phase.sin()][k]
            }),
            Self::Lag {
                ref behind,
                blocks: forgotten,
            } => {
                let of = |(_, index): &(String, usize)| {
                    let past = past(&means(*index)?, forgotten);
                    // A constant is a bias, which has a name.
                    Some(of_time(&|b| past[b] - past.mean()))
                };
                return behind
                    .iter()
                    .map(|b| of(b).unwrap_or_else(|| DMatrix::zeros(blocks, 1)))
                    .collect();
            }
        }]
    }

    /// Place among the bins of the covariate that one of its axes lags behind.
    fn behind(&self, axis: usize) -> Option<usize> {
        match self {
            Self::Lag { behind, .. } => Some(of_axis(behind, axis).1),
            _ => None,
        }
    }

    /// True if each axis has a course of its own.
    fn is_of_each_axis(&self) -> bool {
        matches!(self, Self::Lag { behind, .. } if behind.len() > 1)
    }

    /// Number of its columns.
    pub const fn parameters(&self) -> usize {
        match self {
            Self::Oscillation { .. } => 2,
            _ => 1,
        }
    }

    /// The covariate that the course is of on one axis.
    pub fn covariate(&self, axis: usize) -> &str {
        match self {
            Self::Lag { behind, .. } => &of_axis(behind, axis).0,
            _ => "t",
        }
    }

    /// A sentence part; `time` is the time at so many blocks from the start, s, `length` that of the log in blocks.
    pub fn words(&self, time: impl Fn(f64) -> f64, blocks: f64) -> String {
        match *self {
            Self::Level { begin, end } if end.is_infinite() => format!("a level shift at {:.1} s", time(begin)),
            Self::Level { begin, end } => format!("another level from {:.1} s to {:.1} s", time(begin), time(end)),
            Self::Transient { middle, width } => {
                let wide = 2.0 * (time(width) - time(0.0));
                format!("a transient at {:.1} s, {wide:.1} s wide", time(middle))
            }
            Self::Oscillation { periods } => {
                format!(
                    "an oscillation with a period of {:.1} s",
                    (time(blocks) - time(0.0)) / periods
                )
            }
            Self::Lag { blocks, .. } => format!("it lags behind by {:.1} s", time(blocks) - time(0.0)),
        }
    }
}

/// What there is for an axis: of its own, or the one for all.
fn of_axis<T>(all: &[T], axis: usize) -> &T {
    &all[if all.len() > 1 { axis } else { 0 }]
}

/// Part of a block that lies behind a time, blocks from the start.
fn since(at: f64, block: usize) -> f64 {
    (block as f64 + 1.0 - at).clamp(0.0, 1.0)
}

/// Every course of each family.
fn families(blocks: usize) -> [Vec<Course>; 4] {
    let shifts = (1..blocks).flat_map(|b| {
        FILLED.map(|part| Course::Level {
            begin: b as f64 + part,
            end: f64::INFINITY,
        })
    });
    let ends = |first: usize| (first + 1)..(blocks + 1 - BACK).min(first + blocks / 2 + 1);
    let pulses = (BACK..blocks.saturating_sub(BACK)).flat_map(|first| {
        ends(first).flat_map(move |last| {
            [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)].map(|(a, b)| Course::Level {
                begin: first as f64 - a,
                end: last as f64 + b,
            })
        })
    });
    let transients = (2..2 * blocks.saturating_sub(1)).flat_map(|k| {
        WIDTHS.map(|width| Course::Transient {
            middle: 0.5 * k as f64 + 0.25,
            width,
        })
    });
    let most = blocks as f64 / RESOLVED;
    let steps = ((most - SLOWEST) / FINENESS).max(0.0) as u32;
    let oscillations = (0..=steps).map(|k| Course::Oscillation {
        periods: SLOWEST + FINENESS * f64::from(k),
    });
    [
        shifts.collect(),
        pulses.collect(),
        transients.collect(),
        oscillations.collect(),
    ]
}

/// Columns that are constant within each block, a course on each of some channels with a size of its own.
fn asked(criterion: &Criterion, channels: &[usize], columns: &[DMatrix<f64>]) -> Asked {
    let m = columns[0].ncols();
    let mut out = Asked::zeros(criterion, channels.len() * m);
    for (k, channel) in channels.iter().enumerate() {
        let columns = of_axis(columns, criterion.problem.sums[*channel].channel % 3);
        let sums = &criterion.problem.sums[*channel];
        let root = sums.weight.sqrt();
        let weighted = DMatrix::from_diagonal(&sums.count) * columns;
        out.cross.columns_mut(k * m, m).gemm_tr(root, &sums.sums, columns, 0.0);
        out.information
            .view_mut((k * m, k * m), (m, m))
            .copy_from(&columns.tr_mul(&weighted));
        out.score
            .rows_mut(k * m, m)
            .copy_from(&(columns.tr_mul(&sums.right) * root));
        let modes = &criterion.modes[*channel].of_blocks;
        let mut own = DMatrix::zeros(modes.nrows(), channels.len() * m);
        own.columns_mut(k * m, m).copy_from(&(modes * columns));
        out.sums.push((*channel, own));
    }
    out.of_any_size(criterion)
}

/// A course that stands out, the channels (places among the sums) that show it, and its log Bayes factor.
pub struct Found {
    /// The course.
    pub course: Course,
    /// The channels.
    pub channels: Vec<usize>,
    /// Its columns.
    pub asked: Asked,
    /// Log Bayes factor, the number of courses tried taken off.
    pub ln_bayes: f64,
}

/// The likeliest course of each family beside a stack in the channels of one sensor, in each alone and in all at once, where its log Bayes
/// factor is at least `least`.
pub fn likeliest(stack: &Stack, channels: &[usize], least: f64) -> Vec<Found> {
    let criterion = stack.criterion;
    let Some(first) = channels.first().copied() else {
        return Vec::new();
    };
    let blocks = criterion.problem.sums[first].count.len();
    let unit = [DMatrix::identity(blocks, blocks)];
    let sensor = criterion.modes[first].sensor();
    let views = |channel: &usize| stack.views(&asked(criterion, &[*channel], &unit), sensor);
    let views: Vec<Vec<Beside>> = channels.iter().map(views).collect();
    let mut groups: Vec<Vec<usize>> = (0..channels.len()).map(|k| vec![k]).collect();
    if channels.len() > 1 {
        groups.push((0..channels.len()).collect());
    }
    let lags = [lags(criterion, first), lags_of_each_axis(criterion, first)];
    let axis = |k: usize| criterion.problem.sums[channels[k]].channel % 3;
    let families = families(blocks).into_iter().chain(lags);
    let mut found = Vec::new();
    for family in families.filter(|f| !f.is_empty()) {
        let tried = (family.len() as f64).ln();
        let of = |course: &Course| course.columns(blocks, |index| block_means(criterion, first, index));
        let columns: Vec<Vec<DMatrix<f64>>> = family.iter().map(of).collect();
        // Half the square that each course explains, by channel and view.
        let of_channel = |(k, own): (usize, &Vec<Beside>)| {
            let columns: Vec<&DMatrix<f64>> = columns.iter().map(|c| of_axis(c, axis(k))).collect();
            own.iter().map(|view| explained(view, &columns)).collect()
        };
        let scores: Vec<Vec<Vec<f64>>> = views.iter().enumerate().map(of_channel).collect();
        let together = family[0].is_of_each_axis();
        for group in groups.iter().filter(|group| group.len() > 1 || !together) {
            let of_group: Vec<usize> = group.iter().map(|k| channels[*k]).collect();
            let mut chosen: Vec<usize> = Vec::new();
            for view in 0..group.iter().map(|k| scores[*k].len()).min().unwrap_or(0) {
                let total: Vec<f64> = (0..family.len())
                    .map(|i| group.iter().map(|k| scores[*k][view][i]).sum())
                    .collect();
                let mut order: Vec<usize> = (0..family.len()).collect();
                order.sort_by(|a, b| total[*b].total_cmp(&total[*a]));
                // No evidence exceeds what the best parameters explain; beside bins a lag may explain more.
                let may = |i: &usize| total[*i] - tried >= least || matches!(family[*i], Course::Lag { .. });
                chosen.extend(order.into_iter().take(LOOKED_AT).filter(may));
            }
            chosen.sort_unstable();
            chosen.dedup();
            let weighed = chosen.into_iter().filter_map(|i| {
                let mut asked = asked(criterion, &of_group, &columns[i]);
                let mut bins = None;
                if matches!(family[i], Course::Lag { .. }) {
                    (asked, bins) = beside_bins(criterion, &of_group, &family[i], asked, &columns[i]);
                }
                asked.trials = tried;
                if stack.at_most(&asked) - tried < least {
                    return None;
                }
                let ln_bayes = stack.ln_bayes(&asked) - tried;
                // What the covariate as it is explains needs no past of it.
                let more = bins.is_none_or(|bins| ln_bayes - stack.ln_bayes(&bins) >= least);
                (ln_bayes >= least && more).then(|| Found {
                    course: family[i].clone(),
                    channels: of_group.clone(),
                    ln_bayes,
                    asked,
                })
            });
            found.extend(weighed.max_by(|a, b| a.ln_bayes.total_cmp(&b.ln_bayes)));
        }
    }
    found
}

/// Half of the square that the columns of each course explain, all courses of a family having as many.
fn explained(view: &Beside, courses: &[&DMatrix<f64>]) -> Vec<f64> {
    let columns: Vec<_> = courses.iter().flat_map(|course| course.column_iter()).collect();
    let all = DMatrix::from_columns(&columns);
    let products = &view.information * &all;
    let right = all.tr_mul(&view.score);
    let of = |(k, course): (usize, &&DMatrix<f64>)| {
        let m = course.ncols();
        let own = course.tr_mul(&products.columns(k * m, m));
        let right = right.rows(k * m, m);
        own.cholesky().map_or(0.0, |f| 0.5 * right.dot(&f.solve(&right)))
    };
    courses.iter().enumerate().map(of).collect()
}

/// A lag beside what follows the covariate as it is, whatever the shape, and that alone: bins of each channel, then the columns that are
/// constant within blocks.
fn beside_bins(
    criterion: &Criterion,
    channels: &[usize],
    course: &Course,
    asked: Asked,
    columns: &[DMatrix<f64>],
) -> (Asked, Option<Asked>) {
    let problem = criterion.problem;
    let m = course.parameters();
    let (mut out, mut alone) = (asked, None);
    for (k, place) in channels.iter().enumerate() {
        let sums = &problem.sums[*place];
        let axis = sums.channel % 3;
        let Some(index) = course.behind(axis) else { continue };
        let columns = of_axis(columns, axis);
        let covariate = Covariate::of_log(problem, sums.log, index);
        let contrasts = covariate.contrasts(problem);
        let Some((q, bins)) = contrasts.zip(bins::asked(criterion, sums.channel, &covariate)) else {
            continue;
        };
        // Products of contrasts with what is constant within a block: sums of the contrasts, block by block.
        let of_bins = sums.binned(&problem.parts[sums.log], index, &q);
        let mut products = DMatrix::zeros(out.score.len(), bins.score.len());
        products
            .rows_mut(k * m, m)
            .copy_from(&(columns.tr_mul(&of_bins) * sums.weight.sqrt()));
        out = out.beside(&bins, &products);
        alone = Some(alone.map_or_else(|| bins.clone(), |others: Asked| others.apart(&bins)));
    }
    (out, alone)
}

/// Lags behind every covariate that has a past of its own.
fn lags(criterion: &Criterion, channel: usize) -> Vec<Course> {
    let sums = &criterion.problem.sums[channel];
    let bins = &criterion.problem.parts[sums.log].white.layout.bins;
    // The first covariate is time, which has none.
    let names = bins.names.iter().enumerate().skip(1);
    let varying = names.filter(|(index, _)| block_means(criterion, channel, *index).is_some());
    let of = |(index, name): (usize, &String)| {
        FORGOTTEN.map(|blocks| Course::Lag {
            behind: vec![(name.clone(), index)],
            blocks,
        })
    };
    varying.flat_map(of).collect()
}

/// Lags of every axis behind what it measures itself, as of a spring that creeps: one noise of the zeros counts for all axes of a sensor,
/// so that what acts on each of them shows in all at once.
fn lags_of_each_axis(criterion: &Criterion, channel: usize) -> Vec<Course> {
    let sums = &criterion.problem.sums[channel];
    let bins = &criterion.problem.parts[sums.log].white.layout.bins;
    let Some(own) = Bins::measured(Sensor::ALL[sums.channel / 3]) else {
        return Vec::new();
    };
    let behind: Vec<(String, usize)> = own.map(|index| (bins.names[index].clone(), index)).collect();
    if behind
        .iter()
        .any(|(_, index)| block_means(criterion, channel, *index).is_none())
    {
        return Vec::new();
    }
    FORGOTTEN
        .map(|blocks| Course::Lag {
            behind: behind.clone(),
            blocks,
        })
        .into()
}

/// Block means of the rank of a covariate; `None` where they do not vary.
fn block_means(criterion: &Criterion, channel: usize, covariate: usize) -> Option<DVector<f64>> {
    let problem = criterion.problem;
    let sums = &problem.sums[channel];
    let part = &problem.parts[sums.log];
    let bins = part.white.layout.bins.edges[covariate].len() + 1;
    if bins < 2 {
        return None;
    }
    let ranks = DMatrix::from_fn(bins, 2, |bin, k| {
        if k == 0 {
            1.0
        } else {
            2.0 * bin as f64 / (bins - 1) as f64 - 1.0
        }
    });
    let binned = sums.binned(part, covariate, &ranks);
    let mut last = 0.0;
    let means = DVector::from_fn(binned.nrows(), |b, _| {
        // A block without samples says nothing: what was before goes on.
        if binned[(b, 0)] > 0.0 {
            last = binned[(b, 1)] / binned[(b, 0)];
        }
        last
    });
    (means.max() > means.min()).then_some(means)
}

/// Means over blocks of the exponentially weighted past of a quantity with these means, of which nothing but the first was there before.
fn past(means: &DVector<f64>, forgotten: f64) -> DVector<f64> {
    let kept = (-1.0 / forgotten).exp();
    let mut level = means[0];
    DVector::from_fn(means.len(), |b, _| {
        let mean = means[b] + (level - means[b]) * forgotten * (1.0 - kept);
        level = level * kept + means[b] * (1.0 - kept);
        mean
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_past_of_a_step_creeps_to_its_level() {
        let step = DVector::from_fn(20, |b, _| if b < 5 { 0.0 } else { 1.0 });
        let past = past(&step, 2.0);
        assert!(past.rows(0, 5).norm() < 1e-12);
        // Mean of 1 - exp(-t/2) over the first block after the step, and over the third.
        let mean = |from: f64| 1.0 - 2.0 * ((-from / 2.0).exp() - (-(from + 1.0) / 2.0).exp());
        assert!((past[5] - mean(0.0)).abs() < 1e-12);
        assert!((past[7] - mean(2.0)).abs() < 1e-12);
    }
}
