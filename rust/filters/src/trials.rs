//! Many settings of a filter over one log in one pass, judged as they go: no attitude is kept.
//!
//! **By error**, where there is a reference: squares of the error and of its parts.
//!
//! **By prediction**, without one: from an attitude of the filter a copy of it goes on without accelerometer and
//! magnetometer, on its gyro and the bias it has learned, and in the second half of a `horizon` the directions that come
//! are held against those it foresees. The noise of these readings had no way into the copy, so it adds the same to all
//! settings, and what is left is the error of the attitude and of the bias. A copy that runs for a single row gives the
//! innovations: what the filter is surprised by at each row.

use imufit_attitude::Quaternion;
use nalgebra::{Vector2, Vector3};
use rayon::ThreadPool;
use rayon::prelude::*;

use crate::catalogue::Description;
use crate::columns::{Columns, Row};
use crate::sample::horizontal;
use crate::{Environment, FilterError, Replay, Rules, Start};

/// Rows that every filter takes before the next ones are fetched.
const WINDOW: usize = 4096;

/// What all trials share.
#[derive(Debug, Clone, Copy)]
pub struct Conditions {
    /// The surroundings.
    pub environment: Environment,
    /// The rules around the filter.
    pub rules: Rules,
    /// Where the attitude starts.
    pub start: Start,
}

/// What a trial is judged by.
#[derive(Debug, Clone, Copy)]
pub struct Judgement<'a> {
    /// Reference attitudes, four values `w x y z` a row; NaN where there is none.
    pub reference: Option<&'a [f64]>,
    /// The part that each row counts for; rows of a part that does not exist do not count.
    pub part: &'a [u8],
    /// How many parts there are.
    pub parts: usize,
    /// Time that a prediction runs, s; not positive: nothing is predicted.
    pub horizon: f64,
}

/// Total, heading and inclination error, rad: those of [`imufit_attitude::AttitudeError`] without its other parts.
fn errors(found: Quaternion, reference: Quaternion) -> [f64; 3] {
    let [w, x, y, z] = (found * reference.inverse()).canonical().to_array();
    let across = x.hypot(y);
    [
        2.0 * across.hypot(z).atan2(w),
        2.0 * z.atan2(w),
        2.0 * across.atan2(w.hypot(z)),
    ]
}

/// Sums over the surprises of one sensor, rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Surprise {
    /// How many.
    pub n: usize,
    /// Sum of their lengths.
    pub length: f64,
    /// Sum of their squares.
    pub square: f64,
    /// Sum of the products of each with the one before.
    pub product: f64,
}

impl Surprise {
    fn add(&mut self, angle: Vector2<f64>, before: Option<Vector2<f64>>) {
        let square = angle.norm_squared();
        self.n += 1;
        self.length += square.sqrt();
        self.square += square;
        self.product += before.map_or(0.0, |before| angle.dot(&before));
    }
}

/// Sums over the rows of one part.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Score {
    /// Rows with a reference.
    pub rows: usize,
    /// Sum of the squared errors, rad^2: total, heading, inclination.
    pub squares: [f64; 3],
    /// Of the specific force about the two horizontal axes.
    pub inclination: Surprise,
    /// Of the field about the vertical.
    pub heading: Surprise,
}

/// One trial: the filter, the copy that foresees, and the sums.
struct Trial {
    replay: Replay,
    copy: Option<Replay>,
    since: f64,
    last: [Option<Vector2<f64>>; 2],
    scores: Vec<Score>,
}

impl Trial {
    fn take(&mut self, k: usize, row: &Row, judgement: &Judgement<'_>, known: &Known) -> Result<(), FilterError> {
        let part = judgement.part.get(k).map_or(usize::MAX, |part| usize::from(*part));
        self.foresee(row, part, judgement.horizon, known)?;
        let (found, _) = self.replay.step(row)?;
        let Some(found) = Quaternion::from_unit(found) else {
            return Ok(());
        };
        if let Some(score) = self.scores.get_mut(part)
            && let Some(reference) = judgement.reference.and_then(|rows| rows.get(4 * k..4 * k + 4))
            && let Ok(reference) = <[f64; 4]>::try_from(reference)
            && let Some(reference) = Quaternion::from_row(&reference)
        {
            score.rows += 1;
            for (sum, value) in score.squares.iter_mut().zip(errors(found, reference)) {
                *sum += value * value;
            }
        }
        if let Some(copy) = &mut self.copy
            && (self.since.is_nan() || row.t - self.since >= judgement.horizon)
            && row.t.is_finite()
        {
            copy.set_state(&self.replay.state())?;
            self.since = row.t;
        }
        Ok(())
    }

    /// Lets the copy go on by the gyro alone, and holds the readings against what it foresees.
    fn foresee(&mut self, row: &Row, part: usize, horizon: f64, known: &Known) -> Result<(), FilterError> {
        let Some(copy) = &mut self.copy else {
            return Ok(());
        };
        if self.since.is_nan() {
            return Ok(());
        }
        let blind = Vector3::repeat(f64::NAN);
        let alone = Row {
            t: row.t,
            acc: row.acc.map(|_| blind),
            gyr: row.gyr,
            mag: row.mag.map(|_| blind),
        };
        let (foreseen, _) = copy.step(&alone)?;
        let age = row.t - self.since;
        if !(age >= 0.5 * horizon && age <= 2.0 * horizon.max(known.max_gap)) {
            return Ok(());
        }
        let (Some(q), Some(score)) = (Quaternion::from_unit(foreseen), self.scores.get_mut(part)) else {
            return Ok(());
        };
        if let Some(angle) = row.acc.and_then(|f| known.inclination(q, &f)) {
            score.inclination.add(angle, self.last[0]);
            self.last[0] = Some(angle);
        }
        if let Some(angle) = row.mag.and_then(|m| known.heading(q, &m)) {
            score.heading.add(angle, self.last[1]);
            self.last[1] = Some(angle);
        }
        Ok(())
    }
}

/// What the readings are held against.
struct Known {
    up: Vector3<f64>,
    north: Vector3<f64>,
    least: f64,
    max_gap: f64,
}

impl Known {
    /// The rotation about the two horizontal axes that takes the measured vertical into the foreseen one.
    fn inclination(&self, q: Quaternion, f: &Vector3<f64>) -> Option<Vector2<f64>> {
        let length = f.norm();
        if !(length.is_finite() && length > self.least) {
            return None;
        }
        let angle = Quaternion::between(&q.rotate(f), &self.up).log();
        Some(Vector2::new(angle.x, angle.y))
    }

    /// The rotation about the vertical that takes the measured field into the foreseen one.
    fn heading(&self, q: Quaternion, m: &Vector3<f64>) -> Option<Vector2<f64>> {
        if !m.norm_squared().is_finite() {
            return None;
        }
        let direction = horizontal(&q.rotate(m), &self.up, 0.035)?;
        let sine = direction.cross(&self.north).dot(&self.up);
        Some(Vector2::new(sine.atan2(direction.dot(&self.north)), 0.0))
    }
}

/// All settings over the log, on the threads of `pool`. `look` is called between two windows of rows and ends the pass with an error of its own.
pub fn run<E: From<FilterError> + Send>(
    description: &'static Description,
    settings: &[Vec<(String, f64)>],
    conditions: Conditions,
    columns: &Columns<'_>,
    judgement: &Judgement<'_>,
    pool: &ThreadPool,
    mut look: impl FnMut() -> Result<(), E>,
) -> Result<Vec<Vec<Score>>, E> {
    let Conditions {
        environment,
        rules,
        start,
    } = conditions;
    columns.check()?;
    let n = columns.t.len();
    let lengths = [
        ("part", judgement.part.len(), n),
        ("reference", judgement.reference.map_or(n, |rows| rows.len() / 4), n),
    ];
    if let Some((name, came, expected)) = lengths.into_iter().find(|(_, came, expected)| came != expected) {
        return Err(FilterError::Length { name, came, expected }.into());
    }
    let known = Known {
        up: environment.up(),
        north: environment.field_north(),
        least: rules.free_fall * environment.gravity(),
        max_gap: rules.max_gap,
    };
    let mut trials = Vec::with_capacity(settings.len());
    for chosen in settings {
        let make = || Replay::new(description, chosen, environment, rules, start);
        trials.push(Trial {
            replay: make()?,
            copy: if judgement.horizon > 0.0 { Some(make()?) } else { None },
            since: f64::NAN,
            last: [None; 2],
            scores: vec![Score::default(); judgement.parts],
        });
    }
    for first in (0..n).step_by(WINDOW) {
        pool.install(|| {
            trials.par_iter_mut().try_for_each(|trial| {
                (first..(first + WINDOW).min(n)).try_for_each(|k| trial.take(k, &columns.row(k), judgement, &known))
            })
        })?;
        look()?;
    }
    Ok(trials.into_iter().map(|trial| trial.scores).collect())
}

#[cfg(test)]
mod tests {
    use imufit_attitude::{Frame, Rmse};

    use super::*;
    use crate::catalogue::find;

    const N: usize = 6000;

    /// Swinging about x with noise that is none: a sine of the row's square.
    fn log() -> [Vec<f64>; 5] {
        let [mut t, mut acc, mut gyr, mut mag, mut reference] = [const { Vec::new() }; 5];
        for k in 0..N {
            let time = 0.01 * k as f64;
            let q = Quaternion::exp(&(Vector3::x() * (0.5 * time).sin()));
            let shaken = ((k * k) as f64 * 0.37).sin();
            let f = q.rotate_back(&(Vector3::z() * 9.81)) + Vector3::repeat(shaken);
            let m = q.rotate_back(&Frame::Enu.default_field());
            t.push(time);
            acc.extend(f.iter());
            mag.extend(m.iter());
            gyr.extend([0.5 * (0.5 * time).cos() + 0.001, 0.0, 0.0]);
            reference.extend(q.to_array());
        }
        [t, acc, gyr, mag, reference]
    }

    fn scores(horizon: f64, gains: &[f64]) -> Vec<Vec<Score>> {
        let [t, acc, gyr, mag, reference] = log();
        let columns = Columns {
            t: &t,
            acc: Some(&acc),
            gyr: Some(&gyr),
            mag: Some(&mag),
        };
        let part: Vec<u8> = (0..N).map(|k| u8::from(k >= N / 2)).collect();
        let judgement = Judgement {
            reference: Some(&reference),
            part: &part,
            parts: 2,
            horizon,
        };
        let settings: Vec<_> = gains.iter().map(|k_p| vec![("k_p".to_owned(), *k_p)]).collect();
        let environment = Environment::new(Frame::Enu, 9.81, None).unwrap();
        run::<FilterError>(
            find("mahony").unwrap(),
            &settings,
            Conditions {
                environment,
                rules: Rules::default(),
                start: Start::Vectors,
            },
            &columns,
            &judgement,
            &rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap(),
            || Ok(()),
        )
        .unwrap()
    }

    #[test]
    fn the_errors_are_those_of_a_replay() {
        let [t, acc, gyr, mag, reference] = log();
        let columns = Columns {
            t: &t,
            acc: Some(&acc),
            gyr: Some(&gyr),
            mag: Some(&mag),
        };
        let environment = Environment::new(Frame::Enu, 9.81, None).unwrap();
        for (found, k_p) in scores(0.5, &[0.1, 1.0, 10.0]).into_iter().zip([0.1, 1.0, 10.0]) {
            let settings = [("k_p".to_owned(), k_p)];
            let mut replay = Replay::new(
                find("mahony").unwrap(),
                &settings,
                environment,
                Rules::default(),
                Start::Vectors,
            )
            .unwrap();
            let mut out = vec![0.0; 4 * N];
            replay.run(&columns, &mut out).unwrap();
            for (part, score) in found.iter().enumerate() {
                let mask: Vec<bool> = (0..N).map(|k| (k >= N / 2) == (part == 1)).collect();
                let rmse = Rmse::over(&out, &reference, Some(&mask)).unwrap().unwrap();
                assert_eq!(score.rows, rmse.rows);
                let mean = score.squares.map(|sum| (sum / score.rows as f64).sqrt());
                for (one, other) in mean.iter().zip([rmse.total, rmse.heading, rmse.inclination]) {
                    assert!((one - other).abs() < 1e-12, "{one} {other}");
                }
            }
        }
    }

    #[test]
    fn prediction_prefers_what_the_reference_prefers() {
        let gains = [0.01, 0.3, 30.0];
        let found = scores(1.0, &gains);
        let best = |read: &dyn Fn(&Score) -> f64| {
            let of = |k: usize| read(&found[k][1]);
            (0..gains.len()).min_by(|a, b| of(*a).total_cmp(&of(*b))).unwrap()
        };
        assert_eq!(best(&|score| score.squares[0]), 1);
        assert_eq!(best(&|score| score.inclination.square / score.inclination.n as f64), 1);
        assert!(found.iter().flatten().all(|score| score.inclination.n > 1000));
    }

    #[test]
    fn a_horizon_of_one_row_gives_an_innovation_for_every_row() {
        let found = scores(1e-9, &[0.3]);
        let n: usize = found[0].iter().map(|score| score.inclination.n).sum();
        assert_eq!(n, N - 1);
        assert!(found[0][1].inclination.product.abs() < found[0][1].inclination.square);
    }
}
