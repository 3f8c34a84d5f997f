//! Columns asked about beside a stack: those of an effect, of bins of a covariate, or of a course in time.

use imufit_fit::normal_equations::NormalEquations;
use nalgebra::{DMatrix, DVector};

use crate::criterion::Criterion;
use crate::problem::indices;

/// What the parameters of a question may be.
#[derive(Clone, Debug)]
pub enum Prior {
    /// Normal about zero with these deviations.
    Normal(Vec<f64>),
    /// Known beforehand: readings themselves say how large they are.
    Known(Vec<f64>),
}

/// Columns asked about, over all blocks.
#[derive(Clone, Debug)]
pub struct Asked {
    /// Their Gram matrix with every parameter of the problem (parameters x asked).
    pub cross: DMatrix<f64>,
    /// Their Gram matrix.
    pub information: DMatrix<f64>,
    /// Their products with the residual.
    pub score: DVector<f64>,
    /// Their sums along the modes of the channels that they act on, by the channel's place among the modes.
    pub sums: Vec<(usize, DMatrix<f64>)>,
    /// What their parameters may be.
    pub prior: Prior,
    /// Log of the number of trials of a search that went before.
    pub trials: f64,
}

impl Asked {
    /// Nothing yet of so many columns.
    pub fn zeros(criterion: &Criterion, columns: usize) -> Self {
        Self {
            cross: DMatrix::zeros(criterion.problem.plausible.len(), columns),
            information: DMatrix::zeros(columns, columns),
            score: DVector::zeros(columns),
            sums: Vec::new(),
            prior: Prior::Normal(vec![0.0; columns]),
            trials: 0.0,
        }
    }

    /// The same columns where nobody can tell their size: as much as makes a signal as large as the noise of a sample (unit information).
    #[must_use]
    pub fn of_any_size(mut self, criterion: &Criterion) -> Self {
        let own = self.information.diagonal();
        // A column that hardly any row shows is not asked about.
        let seen = 1e-9 * own.max();
        let deviation = |own: &f64| {
            if *own > seen {
                (criterion.samples / own).sqrt()
            } else {
                0.0
            }
        };
        self.prior = Prior::Normal(own.iter().map(deviation).collect());
        self
    }

    /// Of an effect that has its columns in the evidence.
    pub fn slot(criterion: &Criterion, slot: usize) -> Self {
        Self::of_logs(criterion, slot, &criterion.total, |_| true)
    }

    /// The same in some of the logs alone, whose equations over all parameters are given.
    pub fn of_logs(
        criterion: &Criterion,
        slot: usize,
        equations: &NormalEquations,
        concerned: impl Fn(usize) -> bool,
    ) -> Self {
        let problem = criterion.problem;
        let parameters = indices(&problem.slots, &[slot]);
        let prior = problem.known_values(&parameters).map_or_else(
            || Prior::Normal(parameters.iter().map(|j| criterion.deviation(*j)).collect()),
            Prior::Known,
        );
        let cross = equations.gram.select_columns(&parameters);
        let modes = criterion.modes.iter().enumerate();
        let sums = modes
            .filter(|(_, modes)| concerned(modes.log))
            .map(|(c, modes)| (c, modes.sums.select_columns(&parameters)))
            .filter(|(_, sums)| sums.iter().any(|v| *v != 0.0))
            .collect();
        Self {
            information: cross.select_rows(&parameters),
            score: equations.right.select_rows(&parameters),
            cross,
            sums,
            prior,
            trials: f64::from(u32::try_from(problem.slots[slot].tried).unwrap_or(u32::MAX))
                .max(1.0)
                .ln(),
        }
    }

    /// These columns, then others of other channels: rows of different channels have no products.
    #[must_use]
    pub fn apart(&self, other: &Self) -> Self {
        self.beside(other, &DMatrix::zeros(self.score.len(), other.score.len()))
    }

    /// These columns, then others whose products with these are `products` (these x others).
    #[must_use]
    pub fn beside(&self, other: &Self, products: &DMatrix<f64>) -> Self {
        let (m, q) = (self.score.len(), other.score.len());
        let mut information = DMatrix::zeros(m + q, m + q);
        information.view_mut((0, 0), (m, m)).copy_from(&self.information);
        information.view_mut((m, m), (q, q)).copy_from(&other.information);
        information.view_mut((0, m), (m, q)).copy_from(products);
        information.view_mut((m, 0), (q, m)).copy_from(&products.transpose());
        let mut cross = self.cross.clone().resize_horizontally(m + q, 0.0);
        cross.columns_mut(m, q).copy_from(&other.cross);
        let mut sums: Vec<(usize, DMatrix<f64>)> = self
            .sums
            .iter()
            .map(|(c, own)| (*c, own.clone().resize_horizontally(m + q, 0.0)))
            .collect();
        for (c, of) in &other.sums {
            let place = sums.iter().position(|(known, _)| known == c).unwrap_or_else(|| {
                sums.push((*c, DMatrix::zeros(of.nrows(), m + q)));
                sums.len() - 1
            });
            sums[place].1.columns_mut(m, q).copy_from(of);
        }
        let prior = match (&self.prior, &other.prior) {
            (Prior::Normal(own), Prior::Normal(others)) => Prior::Normal(own.iter().chain(others).copied().collect()),
            (prior, _) => prior.clone(),
        };
        Self {
            cross,
            information,
            score: DVector::from_iterator(m + q, self.score.iter().chain(other.score.iter()).copied()),
            sums,
            prior,
            trials: self.trials + other.trials,
        }
    }
}
