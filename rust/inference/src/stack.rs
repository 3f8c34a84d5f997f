//! A stack of effects with the likelihood of the log under it, and the Bayes factor of columns beside it.

use imufit_fit::block_sums::ChannelSums;
use imufit_fit::whitening;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use crate::asked::{Asked, Prior};
use crate::criterion::Criterion;
use crate::problem::Problem;
use crate::zeros::{self, Modes, Strength};

/// Strengths of the noise whose log likelihood lies so far below the best one do not count, unless they are weaker than that:
/// columns can explain what a stack charges to the noise, never the reverse.
const NEGLIGIBLE: f64 = 30.0;
/// Sizes that an effect may have, in prior deviations: data sheets bound them, and better parts have a hundredth.
const SIZES: [f64; 4] = [1.0, 0.2, 0.04, 0.008];
/// Part of its own information that a column keeps beside others that make it up, so that equations can be solved.
const RIDGE: f64 = 1e-6;
/// Sensors of a log.
const SENSORS: usize = 3;
/// What the noise of the reference's heading is called among those of the sensors.
const HEADING: usize = SENSORS;
/// Sources of noise, the reference's heading first.
const SOURCES: [usize; SENSORS + 1] = [HEADING, 0, 1, 2];
/// Deviations by which the heading of a reference may wander over a log, rad: from none, by that of a good gyroscope, to that of a filter
/// that has not settled.
const WANDERS: [f64; 7] = [0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3];

/// The likelihood of a stack for one strength of the noise of one sensor, or of the heading, that of the others at their best.
struct Point {
    strength: usize,
    ln_z: f64,
    deviation: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
    right: DVector<f64>,
}

impl Point {
    /// Puts products with the stack's columns in units of their prior deviations.
    fn scaled(&self, cross: &mut DMatrix<f64>) {
        for mut column in cross.column_iter_mut() {
            column.component_mul_assign(&self.deviation);
        }
    }

    /// Takes out of equations what the stack explains; `cross` are their products with its columns.
    fn project(&self, cross: &mut DMatrix<f64>, equations: Beside) -> Beside {
        let Beside {
            mut information,
            mut score,
        } = equations;
        self.scaled(cross);
        self.factor.l_dirty().solve_lower_triangular_mut(cross);
        information -= cross.tr_mul(cross);
        score -= cross.tr_mul(&self.right);
        Beside { information, score }
    }
}

/// A stack of effects.
pub struct Stack<'a> {
    /// What it belongs to.
    pub criterion: &'a Criterion<'a>,
    columns: Vec<usize>,
    /// Prior deviations, those of the heading for a unit one.
    deviation: DVector<f64>,
    /// For every channel the columns that act on it.
    sums: Vec<Acting>,
    /// The likeliest strength for each sensor, and for the heading of the reference.
    best: [usize; SENSORS + 1],
    points: [Vec<Point>; SENSORS + 1],
    /// Log of the marginal likelihood.
    pub ln_z: f64,
}

/// Columns of a stack that act on one channel.
struct Acting {
    /// Their places in the stack.
    columns: Vec<usize>,
    /// Their sums along the channel's modes (modes x columns).
    sums: DMatrix<f64>,
    /// The same transposed: a product of plain matrices is worked out in blocks, a transposed one is not.
    across: DMatrix<f64>,
}

/// Takes what the noise of one channel's zero makes out of equations of a stack.
fn take(
    modes: &Modes,
    acting: &Acting,
    strength: Strength,
    gram: &mut DMatrix<f64>,
    right: &mut DVector<f64>,
    square: &mut f64,
) {
    let noise = modes.noise(strength);
    let mut weighted = acting.sums.clone();
    for mut column in weighted.column_iter_mut() {
        column.component_mul_assign(&noise);
    }
    let own = &acting.across * &weighted;
    let score = weighted.tr_mul(&modes.right);
    for (j, q) in acting.columns.iter().enumerate() {
        for (i, p) in acting.columns.iter().enumerate() {
            gram[(*p, *q)] -= own[(i, j)];
        }
        right[*q] -= score[j];
    }
    *square -= modes.right.component_mul(&noise).dot(&modes.right);
}

/// Sum of exponentials, as a logarithm.
pub fn log_sum_exp(values: &[f64]) -> f64 {
    let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most.is_finite() {
        most + values.iter().map(|v| (v - most).exp()).sum::<f64>().ln()
    } else {
        most
    }
}

/// Equations of columns beside a stack: information and score, the stack projected out.
pub struct Beside {
    /// Information about the parameters asked about.
    pub information: DMatrix<f64>,
    /// Their score.
    pub score: DVector<f64>,
}

/// Part of the information about a parameter that rounding may leave when noise takes all of it, some fifty times the precision of a number.
/// Of rests that read the same value in every row a part below 1e-15 was left, and negative.
pub(crate) const ROUNDING: f64 = 1e-14;

impl<'a> Stack<'a> {
    /// Of the parameters given, each with its prior deviation.
    pub fn new(criterion: &'a Criterion<'a>, parameters: &[(usize, f64)]) -> Option<Self> {
        let known: Vec<usize> = parameters.iter().map(|(j, _)| *j).collect();
        let all: Vec<(usize, f64)> = parameters
            .iter()
            .copied()
            .chain(criterion.uncertain.iter().copied().filter(|(j, _)| !known.contains(j)))
            .chain(criterion.heading.iter().map(|j| (*j, 1.0)))
            .collect();
        let columns: Vec<usize> = all.iter().map(|(j, _)| *j).collect();
        let of_channel = |modes: &Modes| {
            let acts = |k: &usize| modes.sums.column(columns[*k]).iter().any(|v| *v != 0.0);
            let active: Vec<usize> = (0..columns.len()).filter(acts).collect();
            let places: Vec<usize> = active.iter().map(|k| columns[*k]).collect();
            let sums = modes.sums.select_columns(&places);
            let across = sums.transpose();
            Acting {
                columns: active,
                sums,
                across,
            }
        };
        let sums = criterion.modes.iter().map(of_channel).collect();
        let mut stack = Self {
            criterion,
            deviation: DVector::from_iterator(all.len(), all.iter().map(|(_, d)| *d)),
            columns,
            sums,
            best: [0; SENSORS + 1],
            points: Default::default(),
            ln_z: f64::NEG_INFINITY,
        };
        stack.fill()?;
        Some(stack)
    }

    /// Equations of the stack's own columns with the noise of these channels taken out.
    fn without_noise(&self, of: impl Fn(usize) -> Option<usize>) -> (DMatrix<f64>, DVector<f64>, f64, f64) {
        let total = &self.criterion.total;
        let mut gram = total.gram.select_rows(&self.columns).select_columns(&self.columns);
        let mut right = total.right.select_rows(&self.columns);
        let (mut square, mut determinant) = (total.square, 0.0);
        for (modes, sums) in self.criterion.modes.iter().zip(&self.sums) {
            let Some(strength) = of(modes.sensor()).map(|k| self.criterion.strengths[k]) else {
                continue;
            };
            take(modes, sums, strength, &mut gram, &mut right, &mut square);
            determinant += modes.log_determinant(strength);
        }
        (gram, right, square, determinant)
    }

    fn point(
        &self,
        strength: usize,
        ln_prior: f64,
        wanders: usize,
        equations: (DMatrix<f64>, DVector<f64>, f64, f64),
    ) -> Option<Point> {
        let (mut gram, mut right, square, determinant) = equations;
        let p = self.columns.len();
        let mut deviation = self.deviation.clone();
        let heading = p - self.criterion.heading.len();
        deviation.rows_mut(heading, p - heading).scale_mut(WANDERS[wanders]);
        for j in 0..p {
            for i in 0..p {
                gram[(i, j)] *= deviation[i] * deviation[j];
            }
            let total = self.criterion.total.gram[(self.columns[j], self.columns[j])];
            gram[(j, j)] += 1.0 + ROUNDING * total * deviation[j].powi(2);
        }
        right.component_mul_assign(&deviation);
        let factor = Cholesky::new(gram)?;
        factor.l_dirty().solve_lower_triangular_mut(&mut right);
        let half: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        Some(Point {
            strength,
            ln_z: ln_prior - determinant - 0.5 * (square - right.norm_squared()) - half,
            deviation,
            factor,
            right,
        })
    }

    /// Strengths of the noise of a sensor, or of the heading, that can be.
    fn possible(&self, sensor: usize) -> Vec<usize> {
        let criterion = self.criterion;
        if sensor == HEADING {
            return (0..if criterion.heading.is_empty() { 0 } else { WANDERS.len() }).collect();
        }
        let own: Vec<&Modes> = criterion
            .modes
            .iter()
            .filter(|modes| modes.sensor() == sensor)
            .collect();
        let known = if own.is_empty() { 0 } else { criterion.strengths.len() };
        let possible = |k: &usize| own.iter().all(|modes| modes.possible(criterion.strengths[*k]));
        (0..known).filter(possible).collect()
    }

    /// Points of some strengths of a sensor, or of the heading, the others at their best.
    fn points_of(&self, sensor: usize, strengths: &[usize]) -> Vec<Point> {
        let criterion = self.criterion;
        let others = self.without_noise(|s| (s != sensor).then_some(self.best[s]));
        let of = |k: &usize| {
            if sensor == HEADING {
                return self.point(*k, zeros::ln_prior(WANDERS.len(), *k), *k, others.clone());
            }
            let strength = criterion.strengths[*k];
            let (mut gram, mut right, mut square, mut determinant) = others.clone();
            for (modes, sums) in criterion.modes.iter().zip(&self.sums) {
                if modes.sensor() == sensor {
                    take(modes, sums, strength, &mut gram, &mut right, &mut square);
                    determinant += modes.log_determinant(strength);
                }
            }
            let equations = (gram, right, square, determinant);
            self.point(*k, strength.ln_prior, self.best[HEADING], equations)
        };
        strengths.par_iter().filter_map(of).collect()
    }

    /// Looks at strengths of a sensor, or of the heading, for the likeliest one; `None` where the equations cannot be solved.
    fn look(&mut self, sensor: usize, strengths: &[usize]) -> Option<()> {
        if strengths.is_empty() {
            return Some(());
        }
        let points = self.points_of(sensor, strengths);
        self.best[sensor] = points.iter().max_by(|a, b| a.ln_z.total_cmp(&b.ln_z))?.strength;
        self.points[sensor] = points;
        Some(())
    }

    fn fill(&mut self) -> Option<()> {
        for sensor in SOURCES {
            let possible = self.possible(sensor);
            self.look(sensor, &possible)?;
        }
        // The noise of one sensor hardly depends on that of the others: a second look only where there was some, at what counts.
        if self.best.iter().filter(|k| **k > 0).count() > 1 {
            for sensor in SOURCES {
                self.look(sensor, &self.counting(sensor))?;
            }
        }
        for sensor in 0..self.points.len() {
            let kept = self.counting(sensor);
            // The others have moved since.
            self.points[sensor] = self.points_of(sensor, &kept);
        }
        let mut total = None;
        for points in self.points.iter().filter(|p| !p.is_empty()) {
            let values: Vec<f64> = points.iter().map(|p| p.ln_z).collect();
            let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let beside = log_sum_exp(&values) - most;
            total = Some(total.map_or(most + beside, |t: f64| t + beside));
        }
        self.ln_z = total.unwrap_or_else(|| {
            let equations = self.without_noise(|_| None);
            let point = self.point(0, self.criterion.strengths[0].ln_prior, 0, equations);
            point.map_or(f64::NEG_INFINITY, |p| p.ln_z)
        });
        Some(())
    }

    /// Strengths of a sensor, or of the heading, that count.
    fn counting(&self, sensor: usize) -> Vec<usize> {
        let strengths = &self.criterion.strengths;
        let (points, best) = (&self.points[sensor], self.best[sensor]);
        let most = points.iter().map(|p| p.ln_z).fold(f64::NEG_INFINITY, f64::max);
        let weaker = |k: usize| {
            let (s, top) = (strengths[k], strengths[best]);
            k <= best && (sensor == HEADING || (s.walk <= top.walk && s.scatter <= top.scatter))
        };
        let counts = |p: &&Point| p.ln_z > most - NEGLIGIBLE || weaker(p.strength);
        points.iter().filter(counts).map(|p| p.strength).collect()
    }

    /// The likeliest strength of the noise of a sensor's zeros, and whether it is the strongest that is known.
    pub fn strength(&self, sensor: usize) -> Strength {
        self.criterion.strengths[self.best[sensor]]
    }

    /// By how much the heading of the reference wanders, likeliest, rad.
    pub fn wanders(&self) -> f64 {
        WANDERS[self.best[HEADING]]
    }

    /// Equations of what is asked beside the stack, for one point.
    fn beside(&self, asked: &Asked, sensor: usize, point: &Point, others: &Beside, cross: &DMatrix<f64>) -> Beside {
        let (mut cross, mut information, mut score) = (cross.clone(), others.information.clone(), others.score.clone());
        let strength = self.criterion.strengths[point.strength];
        for (c, own) in asked
            .sums
            .iter()
            .filter(|(c, _)| self.criterion.modes[*c].sensor() == sensor)
        {
            self.take(*c, own, strength, &mut cross, &mut information, &mut score);
        }
        point.project(&mut cross, Beside { information, score })
    }

    /// The point of the likeliest noise, with its sensor; of sensors with points the first.
    fn likeliest(&self) -> Option<(usize, &Point)> {
        let sensor = self.points.iter().position(|p| !p.is_empty())?;
        let point = self.points[sensor].iter().find(|p| p.strength == self.best[sensor])?;
        Some((sensor, point))
    }

    /// Takes the noise of one channel out of the equations of columns with these sums along its modes.
    fn take(
        &self,
        c: usize,
        own: &DMatrix<f64>,
        strength: Strength,
        cross: &mut DMatrix<f64>,
        information: &mut DMatrix<f64>,
        score: &mut DVector<f64>,
    ) {
        let modes = &self.criterion.modes[c];
        let noise = modes.noise(strength);
        let mut weighted = own.clone();
        for mut column in weighted.column_iter_mut() {
            column.component_mul_assign(&noise);
        }
        let acting = &self.sums[c];
        let taken = &acting.across * &weighted;
        for (i, k) in acting.columns.iter().enumerate() {
            for j in 0..taken.ncols() {
                cross[(*k, j)] -= taken[(i, j)];
            }
        }
        information.gemm_tr(-1.0, own, &weighted, 1.0);
        score.gemv_tr(-1.0, &weighted, &modes.right, 1.0);
    }

    /// The equations of what is asked with the noise of all sensors but one taken out.
    fn others(&self, asked: &Asked, sensor: Option<usize>) -> (Beside, DMatrix<f64>) {
        let mut cross = asked.cross.select_rows(&self.columns);
        let (mut information, mut score) = (asked.information.clone(), asked.score.clone());
        for (c, own) in &asked.sums {
            let of = self.criterion.modes[*c].sensor();
            if Some(of) != sensor && !self.points[of].is_empty() {
                let strength = self.strength(of);
                self.take(*c, own, strength, &mut cross, &mut information, &mut score);
            }
        }
        (Beside { information, score }, cross)
    }

    /// Sensors whose noise matters to what is asked.
    fn sensors(&self, asked: &Asked) -> Vec<usize> {
        let of = |(c, _): &(usize, DMatrix<f64>)| self.criterion.modes[*c].sensor();
        let mut sensors: Vec<usize> = asked.sums.iter().map(of).chain([HEADING]).collect();
        sensors.sort_unstable();
        sensors.dedup();
        sensors.retain(|s| !self.points[*s].is_empty());
        sensors
    }

    /// Log Bayes factor of columns beside the stack.
    pub fn ln_bayes(&self, asked: &Asked) -> f64 {
        self.integrated(asked, |equations| asked.prior.ln_bayes(equations))
    }

    /// How much likelier the best parameters make the log, less what their size costs, as a logarithm: what they cost by being free to be
    /// another size is left out.
    pub fn fit(&self, asked: &Asked) -> f64 {
        self.integrated(asked, |equations| asked.prior.fit(equations))
    }

    /// Logarithm of the mean of something that is known for each strength of the noise. It is worked out where the noise is likeliest and where
    /// it is weakest; between these it hardly exceeds both, so that a strength which would not count even then is left out.
    fn integrated(&self, asked: &Asked, of: impl Fn(&Beside) -> f64) -> f64 {
        let sensors = self.sensors(asked);
        let mut at_best = 0.0;
        let mut more = 0.0;
        for sensor in &sensors {
            let (others, cross) = self.others(asked, Some(*sensor));
            let points = &self.points[*sensor];
            let value = |point: &Point| of(&self.beside(asked, *sensor, point, &others, &cross));
            let ends = self.ends(*sensor);
            let known: Vec<(usize, f64)> = ends.iter().map(|k| (*k, value(&points[*k]))).collect();
            let most = known.iter().map(|(_, f)| *f).fold(f64::NEG_INFINITY, f64::max);
            let sum = |(k, f): &(usize, f64)| points[*k].ln_z + f;
            let counts = known.iter().map(sum).fold(f64::NEG_INFINITY, f64::max) - NEGLIGIBLE;
            let between = (0..points.len()).filter(|k| !ends.contains(k) && points[*k].ln_z + most >= counts);
            let with: Vec<f64> = (between.map(|k| points[k].ln_z + value(&points[k])))
                .chain(known.iter().map(sum))
                .collect();
            let without: Vec<f64> = points.iter().map(|point| point.ln_z).collect();
            let integrated = log_sum_exp(&with) - log_sum_exp(&without);
            at_best = (known.iter())
                .find(|(k, _)| points[*k].strength == self.best[*sensor])
                .map_or(integrated, |(_, f)| *f);
            more += integrated - at_best;
        }
        at_best + more
    }

    /// Places of the points of the likeliest and of the weakest noise of a sensor.
    fn ends(&self, sensor: usize) -> Vec<usize> {
        let points = &self.points[sensor];
        let best = points.iter().position(|p| p.strength == self.best[sensor]);
        let weakest = (0..points.len()).min_by_key(|k| points[*k].strength);
        best.into_iter().chain(weakest.filter(|k| best != Some(*k))).collect()
    }

    /// For each parameter of a question the size from which on its expected log Bayes factor, the noise being as it is here, reaches
    /// `least`; infinite where none does.
    pub fn detectable(&self, asked: &Asked, least: f64) -> Vec<f64> {
        let Prior::Normal(deviation) = &asked.prior else {
            return vec![f64::INFINITY; asked.score.len()];
        };
        let Some(sensor) = self.sensors(asked).first().copied() else {
            return vec![f64::INFINITY; asked.score.len()];
        };
        let (others, cross) = self.others(asked, Some(sensor));
        let points: Vec<(f64, Vec<f64>)> = (self.points[sensor].iter())
            .map(|point| {
                let beside = self.beside(asked, sensor, point, &others, &cross);
                (point.ln_z, beside.information.diagonal().iter().copied().collect())
            })
            .collect();
        let of = |k: usize| {
            let expected = |value: f64| {
                let mut with = Vec::with_capacity(points.len());
                let mut without = Vec::with_capacity(points.len());
                for (ln_z, information) in &points {
                    // What the effect leaves without a column of its own the noise would have to explain.
                    let left = ln_z - 0.5 * value * value * information[k];
                    without.push(left);
                    with.push(left + expected_ln_bayes(information, deviation, k, value));
                }
                log_sum_exp(&with) - log_sum_exp(&without)
            };
            smallest(expected, least, deviation[k])
        };
        (0..deviation.len()).map(of).collect()
    }

    /// Equations of columns beside the stack at the likeliest noise.
    pub fn equations(&self, asked: &Asked) -> Option<Beside> {
        let (sensor, point) = self.likeliest()?;
        let (others, cross) = self.others(asked, Some(sensor));
        Some(self.beside(asked, sensor, point, &others, &cross))
    }

    /// Whitened square that columns explain beside the stack where zeros make no noise.
    pub fn explained(&self, asked: &Asked) -> f64 {
        let Some(point) = self.point(0, 0.0, self.best[HEADING], self.without_noise(|_| None)) else {
            return 0.0;
        };
        let mut cross = asked.cross.select_rows(&self.columns);
        let equations = Beside {
            information: asked.information.clone(),
            score: asked.score.clone(),
        };
        let Beside { mut information, score } = point.project(&mut cross, equations);
        for k in 0..score.len() {
            information[(k, k)] += RIDGE * asked.information[(k, k)].max(f64::MIN_POSITIVE);
        }
        Cholesky::new(information).map_or(0.0, |factor| score.dot(&factor.solve(&score)))
    }

    /// Equations of columns beside the stack at the likeliest noise, and at the weakest of a sensor that counts.
    pub fn views(&self, asked: &Asked, sensor: usize) -> Vec<Beside> {
        let (others, cross) = self.others(asked, Some(sensor));
        let view = |k: usize| self.beside(asked, sensor, &self.points[sensor][k], &others, &cross);
        self.ends(sensor).into_iter().map(view).collect()
    }

    /// Log Bayes factor of some of the stack's own columns beside the others, at the likeliest noise (Savage-Dickey density ratio,
    /// Dickey 1971): without the rounds that an evidence of its own takes.
    pub fn ratio_of(&self, parameters: &[usize]) -> Option<f64> {
        let (_, point) = self.likeliest()?;
        let places: Vec<usize> = parameters
            .iter()
            .filter_map(|j| self.columns.iter().position(|c| c == j))
            .collect();
        let m = places.len();
        let mut unit = DMatrix::zeros(self.columns.len(), m);
        for (k, place) in places.iter().enumerate() {
            unit[(*place, k)] = 1.0;
        }
        let mut mean = point.right.clone();
        point.factor.l().tr_solve_lower_triangular_mut(&mut mean);
        let covariance = point.factor.solve(&unit).select_rows(&places);
        let mean = mean.select_rows(&places);
        let factor = Cholesky::new(covariance)?;
        let half: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        Some(0.5 * mean.dot(&factor.solve(&mean)) + half)
    }

    /// Log Bayes factor at the likeliest noise or at the weakest that counts, whichever is larger, for each sensor: integrated over the noise
    /// it is hardly more.
    pub fn at_most(&self, asked: &Asked) -> f64 {
        let of = |sensor: &usize| -> Vec<f64> {
            let views = self.views(asked, *sensor);
            views.iter().map(|view| asked.prior.ln_bayes(view)).collect()
        };
        let by_sensor: Vec<Vec<f64>> = self.sensors(asked).iter().map(of).collect();
        // Every sensor's share beyond the least of its two, on top of what they have in common.
        let common = by_sensor.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let beyond = |factors: &Vec<f64>| factors.iter().copied().fold(common, f64::max) - common;
        if by_sensor.is_empty() {
            0.0
        } else {
            common + by_sensor.iter().map(beyond).sum::<f64>()
        }
    }

    /// What the stack's own parameters are at the likeliest noise, and what they do to other columns: the coefficients by which
    /// each column asked about is projected on the stack (columns x asked).
    pub fn projection(&self, asked: &Asked) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let (_, point) = self.likeliest()?;
        let (_, mut cross) = self.others(asked, None);
        point.scaled(&mut cross);
        let l = point.factor.l();
        point.factor.l_dirty().solve_lower_triangular_mut(&mut cross);
        let (mut own, mut projected) = (point.right.clone(), cross);
        l.tr_solve_lower_triangular_mut(&mut own);
        l.tr_solve_lower_triangular_mut(&mut projected);
        own.component_mul_assign(&point.deviation);
        point.scaled(&mut projected);
        Some((own, projected))
    }

    /// Parameters of the stack, with those that the noise of the reference makes uncertain.
    pub fn columns(&self) -> &[usize] {
        &self.columns
    }
}

impl Prior {
    /// Log likelihood ratio of the best parameters, less what their size costs at the full prior deviation.
    pub fn fit(&self, equations: &Beside) -> f64 {
        let m = equations.score.len();
        match self {
            Self::Known(_) => self.ln_bayes(equations),
            Self::Normal(deviation) => {
                let scale = DVector::from_column_slice(deviation);
                let mut own = DMatrix::from_fn(m, m, |i, j| equations.information[(i, j)] * scale[i] * scale[j]);
                for k in 0..m {
                    own[(k, k)] += 1.0;
                }
                let right = equations.score.component_mul(&scale);
                Cholesky::new(own).map_or(0.0, |factor| 0.5 * right.dot(&factor.solve(&right)))
            }
        }
    }

    /// Log Bayes factor of parameters with this prior against none.
    pub fn ln_bayes(&self, equations: &Beside) -> f64 {
        let m = equations.score.len();
        match self {
            Self::Known(values) => {
                let v = DVector::from_column_slice(values);
                equations.score.dot(&v) - 0.5 * v.dot(&(&equations.information * &v))
            }
            Self::Normal(deviation) => {
                let own = DMatrix::from_fn(m, m, |i, j| {
                    0.5 * (equations.information[(i, j)] + equations.information[(j, i)]) * deviation[i] * deviation[j]
                });
                let right = equations.score.component_mul(&DVector::from_column_slice(deviation));
                let of_size = |size: f64| {
                    let Some(factor) = Cholesky::new(&own * (size * size) + DMatrix::identity(m, m)) else {
                        return 0.0;
                    };
                    let mut right = &right * size;
                    factor.l_dirty().solve_lower_triangular_mut(&mut right);
                    let half: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
                    0.5 * right.norm_squared() - half
                };
                log_sum_exp(&SIZES.map(of_size)) - (SIZES.len() as f64).ln()
            }
        }
    }
}

/// Log of the prior density of parameters at some values, over that of the widest of its normal parts at zero.
pub fn ln_prior(values: &[f64], deviation: &[f64]) -> f64 {
    let of_size = |size: f64| {
        let cost = |(value, deviation): (&f64, &f64)| 0.5 * (value / (size * deviation)).powi(2) + size.ln();
        let open = values.iter().zip(deviation).filter(|(_, deviation)| **deviation > 0.0);
        -open.map(cost).sum::<f64>()
    };
    log_sum_exp(&SIZES.map(of_size)) - (SIZES.len() as f64).ln()
}

/// Log Bayes factor that is expected of parameters of which one has a value, each seen by itself.
fn expected_ln_bayes(information: &[f64], deviation: &[f64], parameter: usize, value: f64) -> f64 {
    let of_size = |size: f64| {
        let known = |k: usize| information[k] * (size * deviation[k]).powi(2);
        let cost: f64 = (0..deviation.len()).map(|k| known(k).ln_1p()).sum();
        let own = known(parameter);
        0.5 * (value * value * information[parameter] * own / (1.0 + own) - cost)
    };
    log_sum_exp(&SIZES.map(of_size)) - (SIZES.len() as f64).ln()
}

/// Smallest value at which a rising function reaches something, to a thousandth; infinite if none up to a thousand times `scale` does.
fn smallest(rising: impl Fn(f64) -> f64, least: f64, scale: f64) -> f64 {
    let (mut low, mut high) = (1e-9 * scale, 1e3 * scale);
    if !(scale > 0.0 && rising(high) >= least) {
        return f64::INFINITY;
    }
    while high > 1.001 * low {
        let middle = (low * high).sqrt();
        if rising(middle) >= least {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// What the zero of a channel does beside a model, in the channel's unit.
#[derive(Clone, Copy, Debug)]
pub struct ZeroNoise {
    /// Number of the log.
    pub log: usize,
    /// Channel index.
    pub channel: usize,
    /// Standard deviation of the walk's step over a block.
    pub walk: f64,
    /// Standard deviation of the scatter of block means besides.
    pub scatter: f64,
    /// Time of a block, s.
    pub block: f64,
}

/// Noise of the zeros beside a model at its likeliest strength.
pub fn zero_noise(problem: &Problem, model: &[usize]) -> Vec<ZeroNoise> {
    let criterion = Criterion::new(problem);
    let parameters: Vec<(usize, f64)> = model.iter().map(|j| (*j, 1.0 / problem.precision(*j).sqrt())).collect();
    let Some(stack) = Stack::new(&criterion, &parameters) else {
        return Vec::new();
    };
    let of = |sums: &ChannelSums| {
        let layout = &problem.parts[sums.log].white.layout;
        let strength = stack.strength(sums.channel / SENSORS);
        let filled = sums.count.iter().filter(|n| **n > 0.0).count().max(1) as f64;
        // Variance of a block mean: that of whitened samples, over what the filter leaves of a constant.
        let passed = whitening::gain(&layout.filters[sums.channel], 0.0).max(f64::MIN_POSITIVE);
        let mean = filled / (sums.count.sum().max(1.0) * sums.weight * passed);
        ZeroNoise {
            log: sums.log,
            channel: sums.channel,
            walk: (strength.walk * mean).sqrt(),
            scatter: (strength.scatter * mean).sqrt(),
            block: (layout.facts.t_end - layout.facts.t_start) / layout.blocks.max(1) as f64,
        }
    };
    problem.sums.iter().filter(|s| s.of_blocks()).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Log of the ratio of two normal densities of a score: with and without parameters of this deviation.
    fn dense(information: &DMatrix<f64>, score: &DVector<f64>, deviation: f64) -> f64 {
        let m = score.len();
        let covariance = information + information * information * (deviation * deviation);
        let density = |covariance: &DMatrix<f64>| {
            let inverse = covariance.clone().try_inverse().unwrap_or_else(|| DMatrix::zeros(m, m));
            -0.5 * score.dot(&(inverse * score)) - 0.5 * covariance.determinant().ln()
        };
        density(&covariance) - density(information)
    }

    #[test]
    fn a_bayes_factor_is_the_ratio_of_the_densities_of_the_score_over_all_sizes() {
        let information = DMatrix::from_row_slice(2, 2, &[50.0, 12.0, 12.0, 30.0]);
        let score = DVector::from_vec(vec![40.0, -3.0]);
        let equations = Beside {
            information: information.clone(),
            score: score.clone(),
        };
        let found = Prior::Normal(vec![2.0, 2.0]).ln_bayes(&equations);
        let sizes = SIZES.map(|size| dense(&information, &score, 2.0 * size));
        let expected = log_sum_exp(&sizes) - (SIZES.len() as f64).ln();
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }

    #[test]
    fn the_prior_density_of_all_values_adds_up_to_one() {
        let (deviation, step) = (2.0, 1e-3);
        let density = |v: f64| ln_prior(&[v], &[deviation]).exp() / (deviation * (2.0 * std::f64::consts::PI).sqrt());
        let total: f64 = (-12_000..=12_000).map(|k| density(f64::from(k) * step) * step).sum();
        assert!((total - 1.0).abs() < 1e-4, "{total}");
    }

    #[test]
    fn a_wide_prior_costs_what_it_is_wider_and_nothing_is_no_evidence() {
        let none = Beside {
            information: DMatrix::from_element(1, 1, 1e4),
            score: DVector::zeros(1),
        };
        assert!(Prior::Normal(vec![1.0]).ln_bayes(&none) < 0.0);
        assert!(Prior::Normal(vec![100.0]).ln_bayes(&none) < Prior::Normal(vec![1.0]).ln_bayes(&none));
    }
}
