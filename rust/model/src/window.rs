//! Borrowed columns of a stretch of rows: what one call works on.

use crate::sensor::Sensor;

/// Rows of a log with margins: rows `begin..end` are the ones to work on, those around them are context for derivatives and filters.
#[derive(Clone, Debug)]
pub struct Window<'a> {
    /// Time, s, strictly increasing (n).
    pub t: &'a [f64],
    /// Readings of each sensor, row by row (3 n); NaN = missing sample.
    pub readings: [Option<&'a [f64]>; 3],
    /// Sensor temperature, degC (n).
    pub temperature: Option<&'a [f64]>,
    /// Reference attitude, scalar first, body to reference frame (4 n); NaN = not known.
    pub attitude: Option<&'a [f64]>,
    /// Reference position, m, reference frame (3 n).
    pub position: Option<&'a [f64]>,
    /// Rows in which the reference was really measured (not interpolated by whoever made the log).
    pub reference_exact: Option<&'a [f64]>,
    /// Covariates in the order of [`crate::facts::LogFacts::covariates`] (n each).
    pub covariates: Vec<&'a [f64]>,
    /// Row of the log that is row 0 of this window.
    pub offset: usize,
    /// First row to work on, within this window.
    pub begin: usize,
    /// One past the last row to work on.
    pub end: usize,
}

impl<'a> Window<'a> {
    /// All rows at some times, of which nothing else is known.
    pub const fn over(t: &'a [f64]) -> Self {
        Self {
            t,
            readings: [None; 3],
            temperature: None,
            attitude: None,
            position: None,
            reference_exact: None,
            covariates: Vec::new(),
            offset: 0,
            begin: 0,
            end: t.len(),
        }
    }

    /// Number of rows, margins included.
    pub fn len(&self) -> usize {
        self.t.len()
    }

    /// True if the window has no rows.
    pub fn is_empty(&self) -> bool {
        self.t.is_empty()
    }

    /// Readings of one sensor.
    pub fn reading(&self, sensor: Sensor) -> Option<&'a [f64]> {
        self.readings[sensor.index()]
    }

    /// Parts of `rows` rows to work on each, one after the other, with at most `margin` rows around them; only every so many of a long
    /// log, evenly spread over it, whatever windows it comes in.
    #[must_use]
    pub fn parts(&self, rows: usize, every: usize, margin: usize) -> Vec<Self> {
        (self.begin..self.end)
            .step_by(rows)
            .filter(|begin| ((self.offset + begin) / rows).is_multiple_of(every))
            .map(|begin| self.part(begin, (begin + rows).min(self.end), margin))
            .collect()
    }

    /// A part of the window with its own rows to work on and at most `margin` rows around them.
    #[must_use]
    pub fn part(&self, begin: usize, end: usize, margin: usize) -> Self {
        let (first, last) = (begin.saturating_sub(margin), (end + margin).min(self.len()));
        let cut = |column: Option<&'a [f64]>, width: usize| column.map(|c| &c[width * first..width * last]);
        Self {
            t: &self.t[first..last],
            readings: self.readings.map(|r| cut(r, 3)),
            temperature: cut(self.temperature, 1),
            attitude: cut(self.attitude, 4),
            position: cut(self.position, 3),
            reference_exact: cut(self.reference_exact, 1),
            covariates: self.covariates.iter().map(|c| &c[first..last]).collect(),
            offset: self.offset + first,
            begin: begin - first,
            end: end - first,
        }
    }

    /// The same window with other rows to work on.
    #[must_use]
    pub fn with_core(&self, begin: usize, end: usize) -> Self {
        Self {
            begin,
            end,
            ..self.clone()
        }
    }
}

/// Slow columns (a thermometer read every tenth row) hold NaN between their samples: the last sample is carried over at most this many rows.
pub const HOLD_ROWS: usize = 256;

/// Value of a slow column at a row: its own, or the last finite one within [`HOLD_ROWS`] rows before, else the next one after.
pub fn held(column: &[f64], row: usize) -> f64 {
    if column[row].is_finite() {
        return column[row];
    }
    let first = row.saturating_sub(HOLD_ROWS);
    if let Some(v) = column[first..row].iter().rev().find(|v| v.is_finite()) {
        return *v;
    }
    let last = (row + HOLD_ROWS).min(column.len());
    column[row..last]
        .iter()
        .copied()
        .find(|v| v.is_finite())
        .unwrap_or(f64::NAN)
}
