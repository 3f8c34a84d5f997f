//! A single bad rate: what its neighbours do not allow is bridged. A stretch of bad rates: its turn is uncertain.
//!
//! A rate that is far from the one before is either a motion that begins or a bad sample. The reading after it decides. Until
//! then the rate before holds. A reading that returns more than half of the way shows a bad sample, which is left out. Any
//! other reading confirms the rate, and the turn that was not carried out is carried out with the next step. No turn
//! of two rows or more is lost. Whether the change was a motion or several bad samples stays open, so that the attitude is
//! uncertain by its turn from then on: filters that keep a covariance add it. A second such change within [`LONGEST`] may be
//! the end of bad samples: then the rates between say nothing, those at both ends are all that is known of the motion, and
//! the attitude is uncertain by what they and the rates between disagree about.

use std::f64::consts::PI;

use nalgebra::Vector3;

use crate::usual::{LONGEST, Usual};

/// Least turn that is doubted, rad: half a degree, below what any filter here is asked to keep.
const LEAST_TURN: f64 = 0.01;
/// Least uncertainty that is told, rad: the 2 degrees that bad samples may leave; a blow on the sensor makes less.
const LEAST_UNSURE: f64 = 0.035;
/// Mean square of changes before any reading, (rad/s)^2: a change of 10 rad/s is doubted then.
const BEFORE: f64 = 1.0;
/// Square of the least change that is doubted, (rad/s)^2: it turns by [`LEAST_TURN`] in the time that bad rates may last.
const LEAST: f64 = LEAST_TURN * LEAST_TURN / (LONGEST * LONGEST);

/// What the rates so far allow, and the ones that are doubted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bridge {
    /// What the rate changes by from reading to reading, (rad/s)^2.
    pub usual: Usual,
    /// Time between the doubted rate and the one before, s; 0 where none is doubted.
    pub span: f64,
    /// The doubted rate, rad/s.
    pub doubted: Vector3<f64>,
    /// The rate before the change that stayed open, rad/s.
    pub from: Vector3<f64>,
    /// Square of the largest distance from it since, (rad/s)^2.
    pub farthest: f64,
    /// The turn since the last change that was doubted, less that of `from`, rad.
    pub turned: Vector3<f64>,
    /// The time since, s; 0 where none is open.
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
        usual: Usual(BEFORE),
        span: 0.0,
        doubted: Vector3::new(0.0, 0.0, 0.0),
        from: Vector3::new(0.0, 0.0, 0.0),
        farthest: 0.0,
        turned: Vector3::new(0.0, 0.0, 0.0),
        since: 0.0,
    };

    /// Whether a rate is doubted or a change stayed open.
    #[inline(always)]
    pub fn is_open(&self) -> bool {
        self.span > 0.0 || self.since > 0.0
    }

    /// Whether a change of that square, (rad/s)^2, is one to doubt; if not, it is learned.
    #[inline(always)]
    pub fn doubts(&mut self, square: f64) -> bool {
        self.usual.doubts(square, LEAST)
    }

    /// A rate that is not doubted while a change stays open. One that comes back without another such change is a motion.
    fn follow(&mut self, rate: &Vector3<f64>, dt: f64) {
        let away = rate - self.from;
        self.turned += away * dt;
        self.since += dt;
        if self.is_back(&away) || self.since > LONGEST {
            self.since = 0.0;
        }
    }

    /// Whether a rate that is `away` from the one before the change has made more than half of the way back.
    fn is_back(&mut self, away: &Vector3<f64>) -> bool {
        let square = away.norm_squared();
        self.farthest = self.farthest.max(square.min(f64::MAX));
        4.0 * square < self.farthest
    }

    /// The turn that is uncertain after a change from `before` that was not a single bad rate, rad. `turn`: what it turned
    /// by so far, more than `before` would have, in that time.
    fn unsure(&mut self, before: &Vector3<f64>, rate: &Vector3<f64>, turn: Vector3<f64>, time: f64) -> f64 {
        let mut square = turn.norm_squared();
        if self.since > 0.0 {
            // What both ends say of the motion between them: their mean, and as much uncertain as they are large.
            let more = (rate - self.from) * (0.5 * self.since);
            let sizes = 0.5 * (self.from.norm_squared() + rate.norm_squared());
            square += (self.turned - more).norm_squared() + sizes * self.since * self.since;
        } else {
            (self.from, self.farthest) = (*before, 0.0);
        }
        self.is_back(&(before - self.from));
        let back = self.is_back(&(rate - self.from));
        self.turned = Vector3::zeros();
        self.since = if back { 0.0 } else { time };
        if square > LEAST_UNSURE * LEAST_UNSURE {
            square.sqrt().min(PI)
        } else {
            0.0
        }
    }

    /// The turn up to a reading, `dt` after the last one; `before` is the last rate that is believed. With `on` = false none is
    /// doubted.
    pub fn turn(&mut self, before: &Vector3<f64>, rate: &Vector3<f64>, dt: f64, on: bool) -> Turned {
        let mean = (before + rate) * 0.5;
        if !on {
            return Turned::Mean(mean, 0.0);
        }
        let (change, span, doubted) = (rate - before, self.span, self.doubted);
        let square = change.norm_squared();
        if span > 0.0 {
            (self.span, self.doubted) = (0.0, Vector3::zeros());
            let jump = doubted - before;
            if 4.0 * square < jump.norm_squared() {
                return Turned::Bridged(mean);
            }
            self.usual.get_used(span + dt);
            let made_up = (doubted + rate) * 0.5 + jump * (0.5 * span / dt);
            return Turned::Mean(made_up, self.unsure(before, rate, jump * (span + dt), span + dt));
        }
        if !self.doubts(square) {
            if self.since > 0.0 {
                self.follow(rate, dt);
            }
            return Turned::Mean(mean, 0.0);
        }
        if square * (dt * dt) > LEAST_TURN * LEAST_TURN {
            (self.span, self.doubted) = (dt, *rate);
            return Turned::Held;
        }
        self.usual.get_used(dt);
        Turned::Mean(mean, self.unsure(before, rate, change * dt, dt))
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

    /// The root of the sum of squares: what a covariance makes of it.
    fn whole(unsure: &[f64]) -> f64 {
        unsure.iter().map(|x| x * x).sum::<f64>().sqrt()
    }

    #[test]
    fn zeros_between_rates_that_differ_leave_the_motion_between_open() {
        let mut rates = swing();
        rates[450..540].fill(0.0);
        let found = whole(&unsure(&rates));
        assert!(found > 0.5 && found < 1.0, "{found}");
    }

    #[test]
    fn a_second_of_noise_leaves_open_what_it_turned() {
        let mut rates = swing();
        let mut seed = 1_u32;
        for rate in &mut rates[400..500] {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *rate = 17.0 * (f64::from(seed) / f64::from(u32::MAX) - 0.5);
        }
        // Independent errors of 5 rad/s: half a radian is the standard deviation of the turn.
        assert!(whole(&unsure(&rates)) > 0.4, "{}", whole(&unsure(&rates)));
    }

    #[test]
    fn a_blow_that_rings_down_leaves_nothing_open() {
        let mut rates = swing();
        for (k, rate) in rates.iter_mut().enumerate().skip(400) {
            let time = f64::from(u32::try_from((k - 400) % 70).unwrap());
            *rate += 0.8 * (-time / 3.0).exp() * (2.0 * time).cos();
        }
        assert!(whole(&unsure(&rates)) < 0.1, "{}", whole(&unsure(&rates)));
    }

    #[test]
    fn what_is_usual_is_not_doubted() {
        let rates = swing();
        assert!((turned(&rates) - trapezoids(&rates)).abs() < 1e-12);
    }
}
