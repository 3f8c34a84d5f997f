//! A single bad rate: what its neighbours do not allow is bridged.
//!
//! A rate that is far from the one before is either a motion that begins or a bad sample. The reading after it decides. Until
//! then the rate before holds. A reading that returns more than half of the way shows a bad sample, which is left out. Any
//! other reading confirms the rate, and the turn that was not carried out is carried out with the next step. No turn
//! of two rows or more is lost. Whether the change was a motion or several bad samples stays open, so that the attitude is
//! uncertain by its turn from then on: filters that keep a covariance add it. A change back within [`LONGEST`] makes
//! bad samples of all rates between: the attitude is uncertain by the whole turn that they made.

use std::f64::consts::PI;

use nalgebra::Vector3;

/// Square of a change over the mean square of changes that is doubted. White noise of three axes never reaches ten times its
/// root mean square.
const UNUSUAL: f64 = 100.0;
/// Least turn that is doubted, rad: half a degree, below what any filter here is asked to keep.
const LEAST_TURN: f64 = 0.01;
/// Changes that the mean stands for: half a second at 100 Hz, a few periods of fast motion.
const CHANGES: f64 = 64.0;
/// Mean square of changes before any reading, (rad/s)^2: a change of 10 rad/s is doubted then.
const BEFORE: f64 = 1.0;
/// Square of the largest change that enters the mean, (rad/s)^2: more than any gyro measures would only make it blind.
const LARGEST: f64 = 1e4;

/// Time within which doubted rates may return to the one before, s: bad samples of a second, as in [`crate::lost`].
const LONGEST: f64 = 1.5;

/// What the rates so far allow, and the ones that are doubted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bridge {
    /// Mean square of the change from reading to reading, (rad/s)^2.
    pub usual: f64,
    /// Time between the doubted rate and the one before, s; 0 where none is doubted.
    pub span: f64,
    /// The doubted rate, rad/s.
    pub doubted: Vector3<f64>,
    /// The rate before the last change that stayed open, rad/s.
    pub from: Vector3<f64>,
    /// The turn since, less that of `from`, rad.
    pub turned: Vector3<f64>,
    /// The time since, s; 0 where it is over.
    pub since: f64,
}

/// What the next rate says of one that is doubted.
pub(crate) enum Turned {
    /// The mean rate over the step, rad/s, and the turn in it that is as likely false as true, rad.
    Mean(Vector3<f64>, f64),
    /// The same, and the doubted rate was bad.
    Bridged(Vector3<f64>),
    /// The rate before holds until the next one.
    Held,
}

impl Bridge {
    pub const NONE: Self = Self {
        usual: BEFORE,
        span: 0.0,
        doubted: Vector3::new(0.0, 0.0, 0.0),
        from: Vector3::new(0.0, 0.0, 0.0),
        turned: Vector3::new(0.0, 0.0, 0.0),
        since: 0.0,
    };

    /// Whether a change of that square, (rad/s)^2, over `dt` is one to doubt.
    #[inline(always)]
    pub fn doubts(&self, square: f64, dt: f64) -> bool {
        square > UNUSUAL * self.usual && square * (dt * dt) > LEAST_TURN * LEAST_TURN
    }

    /// Takes a change that is believed.
    #[inline(always)]
    pub fn learn(&mut self, square: f64) {
        self.usual += (square.min(LARGEST) - self.usual) * (1.0 / CHANGES);
    }

    /// A rate that is not doubted, `dt` after the one before.
    #[inline(always)]
    pub fn follow(&mut self, rate: &Vector3<f64>, dt: f64) {
        if self.since > 0.0 {
            self.turned += (rate - self.from) * dt;
            self.since = if self.since + dt > LONGEST {
                0.0
            } else {
                self.since + dt
            };
        }
    }

    /// The turn of a change from `before` that a second rate confirmed, rad: as likely false as true.
    fn unsure(&mut self, before: &Vector3<f64>, rate: &Vector3<f64>, turn: Vector3<f64>, time: f64) -> f64 {
        let returned = 4.0 * (rate - self.from).norm_squared() < (before - self.from).norm_squared();
        if self.since > 0.0 && returned {
            self.since = 0.0;
            return (self.turned.norm() + turn.norm()).min(PI);
        }
        (self.from, self.turned, self.since) = (*before, turn, time);
        turn.norm().min(PI)
    }

    /// The turn up to a reading, `dt` after the last one; `before` is the last rate that is believed. With `on` = false none is
    /// doubted.
    pub fn turn(&mut self, before: &Vector3<f64>, rate: &Vector3<f64>, dt: f64, on: bool) -> Turned {
        let (square, span, doubted) = ((rate - before).norm_squared(), self.span, self.doubted);
        if span > 0.0 {
            (self.span, self.doubted) = (0.0, Vector3::zeros());
            let jump = doubted - before;
            if 4.0 * square < jump.norm_squared() {
                self.learn(square);
                return Turned::Bridged((before + rate) * 0.5);
            }
            self.learn(jump.norm_squared());
            self.learn((rate - doubted).norm_squared());
            let mean = (doubted + rate) * 0.5 + jump * (0.5 * span / dt);
            return Turned::Mean(mean, self.unsure(before, rate, jump * (span + dt), span + dt));
        }
        if on && self.doubts(square, dt) {
            (self.span, self.doubted) = (dt, *rate);
            return Turned::Held;
        }
        self.learn(square);
        self.follow(rate, dt);
        Turned::Mean((before + rate) * 0.5, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 0.01;

    /// The turn about x that the rates at every hundredth of a second give.
    fn turned(rates: &[f64]) -> f64 {
        let mut bridge = Bridge::NONE;
        let mut before = Vector3::x() * rates[0];
        let mut sum = 0.0;
        for rate in &rates[1..] {
            let rate = Vector3::x() * *rate;
            sum += DT
                * match bridge.turn(&before, &rate, DT, true) {
                    Turned::Mean(mean, _) | Turned::Bridged(mean) => mean.x,
                    Turned::Held => before.x,
                };
            if bridge.span == 0.0 {
                before = rate;
            }
        }
        sum
    }

    fn trapezoids(rates: &[f64]) -> f64 {
        rates.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]) * DT).sum()
    }

    fn swing() -> Vec<f64> {
        (0..600).map(|k| (0.03 * f64::from(k)).sin()).collect()
    }

    #[test]
    fn a_single_bad_rate_of_any_size_is_bridged() {
        let clean = turned(&swing());
        for size in [5.0, -35.0, 1e3, 1e100] {
            let mut rates = swing();
            rates[400] = size;
            assert!((turned(&rates) - clean).abs() < 1e-3, "{size}");
        }
    }

    #[test]
    fn no_turn_of_two_rows_is_lost() {
        let mut rates = swing();
        (rates[400], rates[401]) = (20.0, 20.0);
        assert!((turned(&rates) - trapezoids(&rates)).abs() < 1e-12);
        let mut starts = vec![0.0; 300];
        starts.extend(vec![8.0; 50]);
        assert!((turned(&starts) - trapezoids(&starts)).abs() < 1e-12);
    }

    /// The turn that stays unsure at each row.
    fn unsure(rates: &[f64]) -> Vec<f64> {
        let (mut bridge, mut before) = (Bridge::NONE, Vector3::x() * rates[0]);
        let mut found = vec![0.0];
        for rate in &rates[1..] {
            let rate = Vector3::x() * *rate;
            found.push(match bridge.turn(&before, &rate, DT, true) {
                Turned::Mean(_, unsure) => unsure,
                Turned::Bridged(_) | Turned::Held => 0.0,
            });
            if bridge.span == 0.0 {
                before = rate;
            }
        }
        found
    }

    #[test]
    fn a_turn_that_bad_rates_may_have_made_is_unsure() {
        let mut rates = swing();
        (rates[400], rates[401]) = (20.0, 20.0);
        let two = unsure(&rates);
        assert!(two[401] > 0.3 && two[..400].iter().all(|x| *x == 0.0));
        // A rate that is stuck for a second turns by 2 rad; one that stays is a motion.
        let mut rates = vec![0.0; 600];
        rates[400..500].fill(2.0);
        assert!((unsure(&rates)[501] - 2.0).abs() < 0.1, "{}", unsure(&rates)[501]);
        rates[400..].fill(2.0);
        assert!(unsure(&rates)[402..].iter().all(|x| *x == 0.0));
    }

    #[test]
    fn what_is_usual_is_not_doubted() {
        let rates = swing();
        assert!((turned(&rates) - trapezoids(&rates)).abs() < 1e-12);
    }
}
