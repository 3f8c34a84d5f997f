//! Attitude from the rows before and after: the filter [`crate::mekf`] forwards and backwards, joined by their covariances.
//!
//! 1. Forwards, to learn gyro bias and scale from the whole log.
//! 2. Backwards from the last row: time and angular rate change their signs, and the bias with them. Bias and scale
//!    are those of pass 1, the attitude is found anew.
//! 3. Forwards again with what pass 2 left. With attitudes q_f and q_b and covariances P_f and P_b the result of a row
//!    is (Fraser and Potter 1969, on attitudes)
//!
//! ```text
//! q = exp( P_f (P_f + P_b)^-1 log(q_b q_f^-1) ) q_f
//! ```
//!
//! Without a magnetometer nothing shows the heading but its start, which pass 3 alone knows: it keeps that of q_f.
//! A row that no attitude reaches forwards has none here either. Memory: 18 numbers a row.

use imufit_attitude::{Quaternion, Real};
use nalgebra::{Matrix3, Vector3};

use crate::catalogue::{Description, find};
use crate::filter::Filter;
use crate::intake::{Intake, Rows};
use crate::lost::Watched;
use crate::mekf::{Mekf, turned_back};
use crate::memory::Memory;
use crate::parameter::fill;
use crate::{Columns, Environment, FilterError, Rules, Skipped, Start};

/// The filter that runs both ways.
const FILTER: &str = "mekf";

/// The columns from the last row to the first, time and rate with their signs changed.
struct Reversed {
    t: Vec<f64>,
    acc: Option<Vec<f64>>,
    gyr: Option<Vec<f64>>,
    mag: Option<Vec<f64>>,
}

impl Reversed {
    fn new(columns: &Columns<'_>) -> Self {
        let rows = |column: Option<&[f64]>, sign: f64| {
            column.map(|c| c.chunks_exact(3).rev().flatten().map(|x| sign * x).collect())
        };
        Self {
            t: columns.t.iter().rev().map(|t| -t).collect(),
            acc: rows(columns.acc, 1.0),
            gyr: rows(columns.gyr, -1.0),
            mag: rows(columns.mag, 1.0),
        }
    }

    fn columns(&self) -> Columns<'_> {
        Columns {
            t: &self.t,
            acc: self.acc.as_deref(),
            gyr: self.gyr.as_deref(),
            mag: self.mag.as_deref(),
        }
    }
}

/// What one pass says of a row.
#[derive(Clone, Copy)]
struct Passed<T> {
    q: Quaternion<T>,
    covariance: Matrix3<T>,
}

/// Settings and surroundings of a smoothed log; see [`Smoother::run`].
#[derive(Debug, Clone)]
pub struct Smoother<T = f64> {
    description: &'static Description,
    filter: Watched<Mekf<T>, T>,
    intake: Intake,
    up: Vector3<f64>,
}

impl Smoother {
    /// With settings of [`crate::mekf`] by name.
    pub fn new(
        settings: &[(String, f64)],
        environment: Environment,
        rules: Rules,
        start: Start,
    ) -> Result<Self, FilterError> {
        let description = find(FILTER)?;
        let values = fill(description.name, description.parameters, settings)?;
        Ok(Self::with_values(description, &values, environment, rules, start))
    }
}

impl<T: Real> Smoother<T> {
    fn with_values(
        description: &'static Description,
        values: &[T],
        environment: Environment,
        rules: Rules,
        start: Start,
    ) -> Self {
        let mut filter = Watched::new(&environment, Mekf::new(&environment, values));
        filter.find_itself(rules.recovery);
        Self {
            description,
            filter,
            intake: Intake::new(environment, rules, start),
            up: environment.up(),
        }
    }

    /// Fills `attitude`, four values `w x y z` for each row of `columns`; NaN before the start. The rows of which
    /// something was not used are those of the first pass. `look` is asked between the passes whether to go on.
    pub fn run<E: From<FilterError>>(
        &self,
        columns: &Columns<'_>,
        attitude: &mut [T],
        mut look: impl FnMut() -> Result<(), E>,
    ) -> Result<Skipped, E> {
        columns.check()?;
        self.description.check_sensors(|sensor| columns.has(sensor))?;
        let (mut first, mut intake, mut skipped) = (self.filter.clone(), self.intake.clone(), Skipped::default());
        first.rows(&mut intake, columns, attitude, &mut skipped);
        look()?;
        let Some((start, q)) = first_attitude(attitude) else {
            return Ok(skipped);
        };
        let reversed = Reversed::new(columns);
        let (mut after, backwards) = self.pass(
            &turned_back(&first.filter().state(), first.attitude()),
            &reversed.columns(),
            0,
        );
        after.reverse();
        look()?;
        let (before, _) = self.pass(&turned_back(&backwards.state(), q), columns, start);
        let turned = columns.mag.is_some_and(|m| m.iter().any(|x| x.is_finite()));
        let up = self.up.map(T::splat);
        let rows = attitude.chunks_exact_mut(4).zip(&after).skip(start).zip(&before);
        for ((out, after), before) in rows {
            out.copy_from_slice(&between(before, after, &up, turned).to_array());
        }
        Ok(skipped)
    }

    /// What the rows from `start` on say to a filter that begins in that state, and the filter after them.
    fn pass(&self, state: &[T], columns: &Columns<'_>, start: usize) -> (Vec<Passed<T>>, Mekf<T>) {
        let (mut filter, mut intake) = (self.filter.clone(), self.intake.clone());
        if filter.begin(state) {
            intake.memory = Memory {
                started: true,
                ..Memory::EMPTY
            };
        }
        let (mut out, mut skipped) = ([T::splat(0.0); 4], Skipped::default());
        let found = (start..columns.t.len()).map(|k| {
            intake.advance(&mut filter, &columns.row(k), &mut out, &mut skipped);
            Passed {
                q: filter.attitude(),
                covariance: filter.attitude_covariance().unwrap_or_else(Matrix3::identity),
            }
        });
        let found = found.collect();
        (found, filter.filter().clone())
    }
}

/// The first row with an attitude, and that.
fn first_attitude<T: Real>(attitude: &[T]) -> Option<(usize, Quaternion<T>)> {
    let mut rows = attitude.as_chunks().0.iter().enumerate();
    rows.find_map(|(k, row)| Quaternion::from_unit(*row).map(|q| (k, q)))
}

/// The attitude between two with covariances; with `heading` = false the heading of the first.
fn between<T: Real>(first: &Passed<T>, second: &Passed<T>, up: &Vector3<T>, heading: bool) -> Quaternion<T> {
    let difference = (second.q * first.q.inverse()).log();
    let share = first.covariance * solved(&(first.covariance + second.covariance), &difference);
    let share = if heading { share } else { share - up * share.dot(up) };
    let found = share.norm_squared().simd_le(T::splat(f64::MAX));
    (Quaternion::exp(&share) * first.q).select(found, first.q)
}

/// `m^-1 x` by the vector products of the columns; not finite where there is no inverse.
fn solved<T: Real>(m: &Matrix3<T>, x: &Vector3<T>) -> Vector3<T> {
    let [a, b, c] = [0, 1, 2].map(|k| m.column(k).into_owned());
    let across = [b.cross(&c), c.cross(&a), a.cross(&b)];
    Vector3::from(across.map(|row| row.dot(x))) / a.dot(&across[0])
}

#[cfg(test)]
mod tests {
    use imufit_attitude::{Frame, Lanes};
    use nalgebra::SimdValue;

    use super::*;

    /// A sensor that turns about two axes, moved to and fro, with a disturbed field in the middle.
    fn columns() -> (Vec<f64>, [Vec<f64>; 3]) {
        let (mut q, mut times, mut readings) = (Quaternion::IDENTITY, Vec::new(), [const { Vec::new() }; 3]);
        for k in 0..1500_i32 {
            let t = f64::from(k) * 0.01;
            let omega = Vector3::new(t.sin(), (1.3 * t).cos(), 0.4);
            q = q.turned(&omega, 0.01);
            let moved = Vector3::new((9.0 * t).sin(), (7.0 * t).cos(), 0.0);
            let magnet = if (600..800).contains(&k) { 15.0 } else { 0.0 };
            let acc = q.rotate_back(&(Frame::Ned.up() * 9.81 + moved));
            let mag = q.rotate_back(&(Frame::Ned.default_field() + Vector3::y() * magnet));
            times.push(if k > 1200 { t + 3.0 } else { t });
            for (column, reading) in readings.iter_mut().zip([acc, omega + Vector3::repeat(0.01), mag]) {
                column.extend(reading.iter());
            }
        }
        (times, readings)
    }

    #[test]
    fn several_settings_side_by_side_have_the_bits_of_each_alone() {
        let (t, [acc, gyr, mag]) = columns();
        let columns = Columns {
            t: &t,
            acc: Some(&acc),
            gyr: Some(&gyr),
            mag: Some(&mag),
        };
        let environment = Environment::new(Frame::Ned, 9.81, None).unwrap();
        let description = find(FILTER).unwrap();
        let alone: Vec<Vec<f64>> = (0..4_i32)
            .map(|k| {
                let factor = 0.5 + 0.5 * f64::from(k);
                description.parameters.iter().map(|p| p.default * factor).collect()
            })
            .collect();
        let lanes: Vec<Lanes> = (0..description.parameters.len())
            .map(|at| Lanes::from([0, 1, 2, 3].map(|lane| alone[lane][at])))
            .collect();
        let (rules, start, n) = (Rules::default(), Start::Vectors, 4 * t.len());
        let go_on = || Ok::<_, FilterError>(());
        let mut together = vec![Lanes::splat(0.0); n];
        Smoother::with_values(description, &lanes, environment, rules, start)
            .run(&columns, &mut together, go_on)
            .unwrap();
        for (lane, values) in alone.iter().enumerate() {
            let mut found = vec![0.0; n];
            Smoother::with_values(description, values, environment, rules, start)
                .run(&columns, &mut found, go_on)
                .unwrap();
            assert!(
                found
                    .iter()
                    .zip(&together)
                    .all(|(a, b)| a.to_bits() == b.extract(lane).to_bits())
            );
        }
    }

    #[test]
    fn the_result_of_one_row_agrees_with_matrices() {
        let p = Matrix3::new(2.0, 0.3, -0.2, 0.3, 1.0, 0.1, -0.2, 0.1, 3.0) * 1e-4;
        let x = Vector3::new(0.3, -0.2, 0.5);
        assert!((solved(&p, &x) - p.try_inverse().unwrap() * x).norm() < 1e-9);
        assert!(!solved(&Matrix3::<f64>::zeros(), &x).norm().is_finite());
    }
}
