//! Local polynomials of one reference quantity at any time: for its value, for columns, for second derivatives.
//!
//! What lies around a run of knots is worked out once, for every width and every clock.

use std::sync::OnceLock;

use nalgebra::{UnitQuaternion, Vector3};

use crate::reference::{LocalReference, Neighbourhood, Widths};
use crate::smoothing::{self, Derivatives, LocalFit, Smoothing, Weights};

/// One reference quantity and how it is differentiated.
pub struct Polynomials {
    reference: LocalReference,
    widths: Widths,
    /// The middle of the run of each knot.
    middles: Vec<usize>,
    runs: usize,
    /// Around the middle of each run, for the widest polynomial at any of its knots.
    around: Vec<OnceLock<Neighbourhood>>,
}

/// Part of the reach of the widest polynomial that a run of knots reaches to each side of its middle. Rotation vectors of a run start from
/// one attitude. An eighth keeps those of its knots below 0.35 rad of the 2.8 rad at which vectors wrap around, so that the series of
/// [`crate::rotation_rates`] stay exact to 1e-9; half a kilobyte at most is then kept for a knot.
const RUN: usize = 8;

/// Knots of a run at most.
fn run(widths: Widths) -> usize {
    2 * (widths.widest() / RUN) + 1
}

/// What the polynomials say of one time.
pub struct Local {
    /// Attitude that rotation vectors start from; none for positions.
    centre: Option<UnitQuaternion<f64>>,
    value: Derivatives,
    /// None where it is the same as by the polynomial for the value.
    columns: Option<Derivatives>,
    /// None where it is the same as by that for columns, or does not reach.
    bends: Option<Derivatives>,
}

impl Local {
    /// The attitude; none where positions were read.
    pub fn attitude(&self) -> Option<UnitQuaternion<f64>> {
        Some(self.centre? * UnitQuaternion::from_scaled_axis(self.value[0].into()))
    }

    /// Derivative of the lowest order by the polynomial for the value.
    pub const fn lowest(&self) -> [f64; 3] {
        self.value[0]
    }

    /// What follows from the derivatives by the polynomials for the value, for columns and for second derivatives.
    pub fn by_width(&self, of: impl Fn(&Derivatives) -> [Vector3<f64>; 3]) -> [[Vector3<f64>; 3]; 3] {
        let value = of(&self.value);
        let columns = self.columns.as_ref().map_or(value, &of);
        [value, columns, self.bends.as_ref().map_or(columns, &of)]
    }
}

impl Polynomials {
    /// Of a reference, to be worked out where they are asked for.
    pub fn new(reference: LocalReference, widths: Widths) -> Self {
        let mut around = Vec::new();
        around.resize_with(reference.times().len(), OnceLock::new);
        let middles = reference.middles(run(widths));
        Self {
            runs: middles.chunk_by(|a, b| a == b).count(),
            middles,
            reference,
            widths,
            around,
        }
    }

    /// Numbers that these keep at most.
    pub fn numbers(&self) -> usize {
        self.runs * 3 * (2 * self.widths.widest() + run(self.widths))
    }

    /// For times in rising order.
    pub fn reader(&self) -> Reader<'_> {
        Reader {
            of: self,
            hint: 0,
            caches: Default::default(),
        }
    }
}

/// Reads polynomials at one time after another.
pub struct Reader<'a> {
    of: &'a Polynomials,
    hint: usize,
    caches: [WeightCache; 3],
}

impl Reader<'_> {
    /// What the reference says of a time; `None` where it does not reach.
    pub fn at(&mut self, t: f64) -> Option<Local> {
        let Polynomials {
            reference,
            widths,
            middles,
            around,
            ..
        } = self.of;
        let knot = reference.nearest(t, &mut self.hint)?;
        let middle = middles[knot];
        let around = around[middle].get_or_init(|| reference.around(middle, widths.widest() + run(*widths) / 2));
        let [for_value, for_columns, for_bends] = &mut self.caches;
        let read = |smoothing: Smoothing, cache: &mut WeightCache| {
            let values = around.within(knot, smoothing.half_width)?;
            let times = reference.times_around(knot, smoothing.half_width);
            cache.derivatives(times, t, smoothing, values, reference.lowest())
        };
        let value = read(widths.value, for_value)?;
        let columns = match widths.columns {
            same if same == widths.value => None,
            wider => Some(read(wider, for_columns)?),
        };
        // Where the widest polynomial does not reach, the one of the columns has to do.
        let wider = Some(widths.bends).filter(|b| *b != widths.columns);
        Some(Local {
            centre: reference.attitude_at(middle),
            value,
            columns,
            bends: wider.and_then(|wider| read(wider, for_bends)),
        })
    }
}

/// Weights of the last fit, kept while the knots have the same spacing. Where they never have, weights are not worth having.
#[derive(Default)]
struct WeightCache {
    offsets: Vec<f64>,
    fit: LocalFit,
    weights: Weights,
    /// Fits since the spacing was last the same.
    uneven: usize,
}

/// After so many fits with a spacing of their own the next ones are expected to have one too.
const UNEVEN: usize = 4;

impl WeightCache {
    /// Derivatives from the order `lowest` on around `at` of the polynomial through values at times `t`.
    fn derivatives(
        &mut self,
        t: &[f64],
        at: f64,
        smoothing: Smoothing,
        values: &[[f64; 3]],
        lowest: usize,
    ) -> Option<Derivatives> {
        let tolerance = 1e-9 * (t[t.len() - 1] - t[0]);
        let same =
            self.offsets.len() == t.len() && self.offsets.iter().zip(t).all(|(o, v)| (v - at - o).abs() <= tolerance);
        if same && !self.weights.is_empty() {
            self.uneven = 0;
            return Some(smoothing::apply(&self.weights, values));
        }
        self.uneven = if same { 0 } else { self.uneven + 1 };
        self.offsets.clear();
        self.offsets.extend(t.iter().map(|v| v - at));
        self.weights.clear();
        if self.uneven > UNEVEN {
            return smoothing::derivatives(t, at, smoothing, values, lowest);
        }
        if !self.fit.prepare(t, at, smoothing, lowest) {
            return None;
        }
        self.fit.weights_into(&mut self.weights);
        Some(smoothing::apply(&self.weights, values))
    }
}
