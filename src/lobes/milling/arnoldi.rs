//! The greatest eigenvalues of an operator that is only known by what it does to a vector.

use faer::Mat;
use nalgebra::{ComplexField, DMatrix, DVector};
use num_complex::Complex64;

use crate::{Error, Result};

/// Accuracy of the eigenvalues wanted, relative to themselves.
const TOLERANCE: f64 = 1e-7;

/// Eigenvalues of a matrix, in no order.
///
/// # Errors
/// Where the iteration does not converge (a matrix that is not finite).
pub(crate) fn eigenvalues<T: ComplexField<RealField = f64> + Into<Complex64>>(
    matrix: &DMatrix<T>,
) -> Result<Vec<Complex64>> {
    let n = matrix.nrows();
    let dense = Mat::from_fn(n, n, |i, j| -> Complex64 { matrix[(i, j)].clone().into() });
    dense
        .eigenvalues()
        .map_err(|_| Error::computation("lobes: the eigenvalues of a stability matrix were not found"))
}

/// All eigenvalues of modulus above `share` times the greatest one's, in no order (smaller ones may come along).
///
/// Arnoldi's method with complete orthogonalisation, from a fixed start vector; the Krylov space grows until the
/// residual of every such eigenvalue is small against it. For compact operators (a delay over a period, a receptance
/// that falls off) that takes a few dozen products.
pub(crate) fn greatest<T: ComplexField<RealField = f64> + Into<Complex64> + Copy>(
    n: usize,
    share: f64,
    mut apply: impl FnMut(&DVector<T>) -> DVector<T>,
) -> Result<Vec<Complex64>> {
    if n == 0 {
        return Ok(Vec::new());
    }
    // No structured operator is likely to be blind to this direction (golden-ratio sequence).
    let start = DVector::from_fn(n, |i, _| {
        T::from_real(0.5 + ((i as f64 + 1.0) * 0.618_033_988_749_895).fract())
    });
    let mut basis: Vec<DVector<T>> = vec![start.unscale(start.norm())];
    let mut hessenberg: Vec<Vec<T>> = Vec::new();
    let mut next_check = 16.min(n);
    loop {
        let k = hessenberg.len();
        let mut v = apply(&basis[k]);
        let scale = v.norm();
        let mut column = vec![T::zero(); k + 1];
        for _ in 0..2 {
            for (c, b) in column.iter_mut().zip(&basis) {
                let share = b.dotc(&v);
                v.axpy(-share, b, T::one());
                *c += share;
            }
        }
        hessenberg.push(column);
        let rest = v.norm();
        let size = k + 1;
        let exhausted = size == n || !(rest > 1e-13 * scale);
        if size >= next_check || exhausted {
            let matrix = DMatrix::from_fn(size, size, |i, j| {
                hessenberg[j].get(i).copied().unwrap_or(T::zero())
            });
            let values = eigenvalues(&matrix)?;
            if exhausted {
                return Ok(values);
            }
            let largest = values.iter().map(|l| l.norm()).fold(0.0, f64::max);
            let wanted = values.iter().filter(|l| l.norm() >= share * largest);
            if wanted
                .clone()
                .all(|l| residual(&matrix, *l, rest) <= TOLERANCE * l.norm())
            {
                return Ok(values);
            }
            next_check = (size + size / 2).min(n);
        }
        // The subdiagonal entry belongs to this column.
        hessenberg[k].push(T::from_real(rest));
        basis.push(v.unscale(rest));
    }
}

/// ‖A x − λ x‖ of the Ritz vector of an eigenvalue of the Hessenberg matrix: |h_{k+1,k}| times its last component.
///
/// The eigenvector of an unreduced Hessenberg matrix follows from its last component by back substitution, row by row
/// from below.
fn residual<T: ComplexField<RealField = f64> + Into<Complex64> + Copy>(
    hessenberg: &DMatrix<T>,
    lambda: Complex64,
    rest: f64,
) -> f64 {
    let n = hessenberg.nrows();
    let mut x = vec![Complex64::ZERO; n];
    x[n - 1] = Complex64::ONE;
    let mut squares = 1.0;
    for row in (1..n).rev() {
        let mut sum = -lambda * x[row];
        for j in row..n {
            let h: Complex64 = hessenberg[(row, j)].into();
            sum += h * x[j];
        }
        let below: Complex64 = hessenberg[(row, row - 1)].into();
        x[row - 1] = -sum / below;
        squares += x[row - 1].norm_sqr();
        if !squares.is_finite() {
            // The last component is nothing compared with the rest.
            return 0.0;
        }
    }
    rest / squares.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full matrix with known eigenvalues: a similarity transform of a decaying diagonal.
    #[test]
    fn the_greatest_eigenvalues_of_a_large_matrix_are_found() {
        let n = 200;
        let value = |i: usize| 0.85f64.powi(i as i32) * if i % 3 == 1 { -1.0 } else { 1.0 };
        let transform = DMatrix::from_fn(n, n, |i, j| {
            if i == j {
                1.0
            } else if j > i {
                0.3 / (1.0 + (j - i) as f64)
            } else {
                0.0
            }
        });
        let inverse = transform.clone().try_inverse().unwrap();
        let matrix = &transform * DMatrix::from_diagonal(&DVector::from_fn(n, |i, _| value(i))) * inverse;
        let mut products = 0;
        let found = greatest::<f64>(n, 0.2, |v| {
            products += 1;
            &matrix * v
        })
        .unwrap();
        assert!(products < 120, "{products}");
        for i in 0..9 {
            let nearest = found
                .iter()
                .map(|l| (l - value(i)).norm())
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-6, "{i}: {nearest}");
        }
    }

    #[test]
    fn small_and_singular_operators_are_exact() {
        let matrix = DMatrix::from_row_slice(3, 3, &[0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let mut found = greatest::<f64>(3, 0.5, |v| &matrix * v).unwrap();
        found.sort_by(|a, b| a.im.total_cmp(&b.im));
        assert!((found[0] + Complex64::I).norm() < 1e-12);
        assert!((found[found.len() - 1] - Complex64::I).norm() < 1e-12);
        assert!(greatest::<f64>(0, 0.5, |v| v.clone()).unwrap().is_empty());
    }
}
