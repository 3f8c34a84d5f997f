//! An orthonormal basis of columns some of which may depend on others.

use nalgebra::DMatrix;

/// Orthonormal basis of the span of `columns`, each of about unit length: the one that stands out most of those before it first, until
/// no more than `least` of any is left or there are `most`.
///
/// By repeated projection: nalgebra's singular vectors of matrices without full rank need not span their columns.
pub fn basis(mut columns: DMatrix<f64>, least: f64, most: usize) -> DMatrix<f64> {
    let mut found = 0;
    while found < most.min(columns.ncols()) {
        let norm = |k: usize| columns.column(k).norm();
        let Some(next) = (found..columns.ncols()).max_by(|a, b| norm(*a).total_cmp(&norm(*b))) else {
            break;
        };
        if norm(next) <= least || norm(next).is_nan() {
            break;
        }
        columns.swap_columns(found, next);
        // Twice: what is left of a column that nearly depends on others has their rounding errors in it.
        let (done, mut rest) = columns.columns_range_pair_mut(..found, found..);
        let mut own = rest.column_mut(0);
        let again = done.tr_mul(&own);
        own -= &done * again;
        let norm = own.norm();
        own /= norm;
        let own = own.into_owned();
        for mut other in rest.column_iter_mut().skip(1) {
            let along = own.dot(&other);
            other.axpy(-along, &own, 1.0);
        }
        found += 1;
    }
    columns.columns(0, found).into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    #[test]
    fn columns_that_depend_on_others_add_nothing_and_all_are_spanned() {
        let n = 48;
        let level = DVector::from_element(n, 1.0 / (n as f64).sqrt());
        let ramp = DVector::from_fn(n, |i, _| i as f64 / 100.0);
        let mixed = &level * 0.3 + &ramp * 0.7;
        let nearly = DVector::from_fn(n, |i, _| level[i] * (1.0 + 1e-15 * i as f64));
        let columns = DMatrix::from_columns(&[level.clone(), nearly, ramp.clone(), mixed, DVector::zeros(n)]);
        let q = basis(columns.clone(), 1e-6, 20);
        assert_eq!(q.ncols(), 2);
        assert!((q.tr_mul(&q) - DMatrix::identity(2, 2)).norm() < 1e-12);
        assert!((&columns - &q * q.tr_mul(&columns)).norm() < 1e-12);
        assert_eq!(basis(columns, 1e-6, 1).ncols(), 1);
    }
}
