//! Polynomials of one reference quantity, one of each width around each knot.
//!
//! A polynomial through the same knots is the same at whatever time it is read: it is worked out once, and every clock reads it.

use std::sync::OnceLock;

use nalgebra::UnitQuaternion;

use crate::reference::{LocalReference, Widths};
use crate::smoothing::{self, Derivatives, Expansion, LocalFit, PowerWeights, Smoothing};

/// Polynomials of one width; `None` around a knot whose surroundings do not determine one.
struct OfWidth {
    smoothing: Smoothing,
    around: Vec<OnceLock<Option<Expansion>>>,
}

/// Polynomials of one reference quantity.
pub struct Polynomials {
    reference: LocalReference,
    value: OfWidth,
    /// Where they are wider than those for the value.
    columns: Option<OfWidth>,
    /// Where they are wider than those for the columns.
    bends: Option<OfWidth>,
}

/// What the polynomials say of one time.
pub struct Local {
    /// Attitude that rotation vectors start from; none for positions.
    pub centre: Option<UnitQuaternion<f64>>,
    /// By the polynomial for the value.
    pub value: Derivatives,
    /// By that for columns; none where it is the same.
    pub columns: Option<Derivatives>,
    /// By that for second derivatives; none where it is the same or does not reach.
    pub bends: Option<Derivatives>,
}

impl OfWidth {
    fn new(smoothing: Smoothing, knots: usize) -> Self {
        let mut around = Vec::new();
        around.resize_with(knots, OnceLock::new);
        Self { smoothing, around }
    }
}

impl Polynomials {
    /// Of a reference, to be worked out where they are asked for.
    pub fn new(reference: LocalReference, widths: Widths) -> Self {
        let knots = reference.times().len();
        let other = |wider: Smoothing, than: Smoothing| (wider != than).then(|| OfWidth::new(wider, knots));
        Self {
            value: OfWidth::new(widths.value, knots),
            columns: other(widths.columns, widths.value),
            bends: other(widths.bends, widths.columns),
            reference,
        }
    }

    /// For times in rising order.
    pub fn reader(&self) -> Reader<'_> {
        Reader {
            of: self,
            hint: 0,
            spacings: Default::default(),
        }
    }
}

/// Reads polynomials at one time after another.
pub struct Reader<'a> {
    of: &'a Polynomials,
    hint: usize,
    spacings: [EvenSpacing; 3],
}

impl Reader<'_> {
    /// What the reference says of a time; `None` where it does not reach.
    pub fn at(&mut self, t: f64) -> Option<Local> {
        let of = self.of;
        let [for_value, for_columns, for_bends] = &mut self.spacings;
        let mut read = |width: &OfWidth, spacing: &mut EvenSpacing| {
            let knot = of.reference.nearest(t, width.smoothing.half_width, &mut self.hint)?;
            let centre = of.reference.times()[knot];
            let found = width.around[knot].get_or_init(|| {
                let near = of.reference.around(knot, width.smoothing.half_width)?;
                spacing.expansion(near.t, centre, width.smoothing, &near.values)
            });
            Some((knot, found.as_ref()?.derivatives(t - centre, of.reference.lowest())))
        };
        let (knot, value) = read(&of.value, for_value)?;
        let columns = match &of.columns {
            None => None,
            Some(width) => Some(read(width, for_columns)?.1),
        };
        // Where the widest polynomial does not reach, the one of the columns has to do.
        let bends = of.bends.as_ref().and_then(|width| Some(read(width, for_bends)?.1));
        Some(Local {
            centre: of.reference.attitude_at(knot),
            value,
            columns,
            bends,
        })
    }
}

/// Weights of the last fit, kept while the knots have the same spacing. Where they never have, weights are not worth having.
#[derive(Default)]
struct EvenSpacing {
    offsets: Vec<f64>,
    weights: Option<PowerWeights>,
    /// Fits since the spacing was last the same.
    uneven: usize,
}

/// After so many fits with a spacing of their own the next ones are expected to have one too.
const UNEVEN: usize = 4;

impl EvenSpacing {
    /// The polynomial through values at times `t`, around `at`; `None` if these do not determine it.
    fn expansion(&mut self, t: &[f64], at: f64, smoothing: Smoothing, values: &[[f64; 3]]) -> Option<Expansion> {
        let tolerance = 1e-9 * (t[t.len() - 1] - t[0]);
        let same =
            self.offsets.len() == t.len() && self.offsets.iter().zip(t).all(|(o, v)| (v - at - o).abs() <= tolerance);
        self.uneven = if same { 0 } else { self.uneven + 1 };
        if let Some(weights) = self.weights.as_ref().filter(|_| same) {
            return Some(weights.apply(values));
        }
        self.offsets.clear();
        self.offsets.extend(t.iter().map(|v| v - at));
        self.weights = None;
        if self.uneven > UNEVEN {
            return smoothing::expansion(t, at, smoothing, values);
        }
        let weights = LocalFit::new(t, at, smoothing)?.power_weights();
        Some(self.weights.insert(weights).apply(values))
    }
}
