//! Fits of candidates in the place of one another decide which of them is there.

/// A candidate, and its log Bayes factor by a fit with it and one without.
pub type Fitted = (usize, f64);

/// What fits of candidates in the place of one another say.
pub struct Decided<'a> {
    /// The likeliest one.
    pub slot: usize,
    /// Its log Bayes factor.
    pub ln_bayes: f64,
    /// Those as likely.
    pub rivals: Vec<usize>,
    /// All of them.
    fits: &'a [Fitted],
}

/// Place of the list of fits that has a candidate.
pub fn place(lists: &[&[Fitted]], slot: usize) -> Option<usize> {
    lists.iter().position(|fits| fits.iter().any(|(of, _)| *of == slot))
}

impl<'a> Decided<'a> {
    /// By the fits: of those that can be named first; `None` if none of them can.
    pub fn by(fits: &'a [Fitted], can: impl Fn(usize) -> bool, threshold: f64) -> Option<Self> {
        let possible = fits.iter().filter(|(slot, ln)| ln.is_finite() && can(*slot));
        let (slot, ln_bayes) = *possible.max_by(|a, b| a.1.total_cmp(&b.1))?;
        let as_likely = fits.iter().filter(|f| f.0 != slot && f.1 >= ln_bayes - threshold);
        Some(Self {
            slot,
            ln_bayes,
            rivals: as_likely.map(|f| f.0).collect(),
            fits,
        })
    }

    /// Log Bayes factor of one of them.
    pub fn ln_of(&self, slot: usize) -> Option<f64> {
        self.fits.iter().find(|(of, _)| *of == slot).map(|(_, ln)| *ln)
    }
}
