//! Columns asked about beside a stack: those of an effect, of bins of a covariate, or of a course in time.

use nalgebra::{DMatrix, DVector};

use crate::problem::indices;
use crate::stack::Criterion;

/// What the parameters of a question may be.
#[derive(Clone, Debug)]
pub enum Prior {
    /// Normal about zero with these deviations.
    Normal(Vec<f64>),
    /// Known beforehand: readings themselves say how large they are.
    Known(Vec<f64>),
}

/// Columns asked about, over all blocks.
#[derive(Clone)]
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
    /// Of an effect that has its columns in the evidence.
    pub fn slot(criterion: &Criterion, slot: usize) -> Self {
        let parameters = indices(&criterion.problem.slots, &[slot]);
        let prior = criterion.problem.known_values(&parameters).map_or_else(
            || Prior::Normal(parameters.iter().map(|j| criterion.deviation(*j)).collect()),
            Prior::Known,
        );
        let of = &criterion.problem.slots[slot];
        Self {
            prior,
            trials: f64::from(u32::try_from(of.tried).unwrap_or(u32::MAX)).max(1.0).ln(),
            ..Self::parameters(criterion, &parameters)
        }
    }

    /// Of some parameters of the problem, with no prior yet.
    fn parameters(criterion: &Criterion, parameters: &[usize]) -> Self {
        let cross = criterion.total.gram.select_columns(parameters);
        let sums = (criterion.modes.iter().enumerate())
            .filter(|(_, modes)| {
                parameters
                    .iter()
                    .any(|j| modes.sums.column(*j).iter().any(|v| *v != 0.0))
            })
            .map(|(c, modes)| (c, modes.sums.select_columns(parameters)))
            .collect();
        Self {
            information: cross.select_rows(parameters),
            score: criterion.total.right.select_rows(parameters),
            cross,
            sums,
            prior: Prior::Normal(vec![0.0; parameters.len()]),
            trials: 0.0,
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
