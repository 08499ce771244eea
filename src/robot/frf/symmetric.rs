//! Symmetric matrices as what they mostly are: the sum of a few squares.

use nalgebra::DMatrix;

/// A real symmetric matrix, n × n. A joint's stiffness, a damper, a mass at a point change few directions each: then the form
/// uᵀAw takes a few products of vectors, and not one with the matrix.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Symmetric {
    /// Σ ± v vᵀ, the sign first. Empty for zero.
    Squares(Vec<(f64, Vec<f64>)>),
    /// What is not zero stands in the first `size` rows and columns: these, column by column.
    Full { size: usize, entries: Vec<f64> },
}

/// More squares than this are no less work than the matrix.
const MOST_SQUARES: usize = 3;
/// What may be left of the matrix, by its largest entry: a few roundings.
const LEFT: f64 = 1e-14;

impl Symmetric {
    /// Squares are taken out by the largest entry of the diagonal (Cholesky with diagonal pivots; Higham 2002, Accuracy and
    /// Stability of Numerical Algorithms, §10.3), which finds those of matrices that are definite; others stay full.
    pub(super) fn of(matrix: &DMatrix<f64>) -> Self {
        if !matrix.iter().all(|v| v.is_finite()) {
            return Symmetric::full(matrix);
        }
        let limit = LEFT * matrix.amax();
        let mut left = matrix.clone();
        let mut squares = Vec::new();
        while left.amax() > limit {
            let pivot = left.diagonal().iamax();
            let size = left[(pivot, pivot)].abs();
            if squares.len() == MOST_SQUARES || size < left.amax() {
                return Symmetric::full(matrix);
            }
            let sign = left[(pivot, pivot)].signum();
            let along = left.column(pivot) / (sign * size.sqrt());
            left.ger(-sign, &along, &along, 1.0);
            squares.push((sign, along.as_slice().to_vec()));
        }
        Symmetric::Squares(squares)
    }

    /// Without a look for squares.
    pub(super) fn full(matrix: &DMatrix<f64>) -> Self {
        let columns = (0..matrix.ncols()).rev();
        let size = columns
            .map(|j| j + 1)
            .find(|size| matrix.column(size - 1).iter().any(|v| *v != 0.0));
        let size = size.unwrap_or(0);
        let entries = matrix.view((0, 0), (size, size)).iter().copied().collect();
        Symmetric::Full { size, entries }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    fn vector(n: usize, k: usize) -> DVector<f64> {
        DVector::from_fn(n, |i, _| {
            (((3 + 2 * k) * i + 7 * k + 1) as f64).sin() * 10f64.powi(i as i32 % 4)
        })
    }

    fn again(symmetric: &Symmetric, n: usize) -> DMatrix<f64> {
        match symmetric {
            Symmetric::Full { size, entries } => {
                DMatrix::from_column_slice(*size, *size, entries).resize(n, n, 0.0)
            }
            Symmetric::Squares(squares) => squares.iter().fold(DMatrix::zeros(n, n), |sum, (sign, along)| {
                let along = DVector::from_column_slice(along);
                sum + *sign * &along * along.transpose()
            }),
        }
    }

    #[test]
    fn sums_of_few_squares_are_found() {
        let n = 9;
        for count in 0..=MOST_SQUARES + 1 {
            for sign in [1.0, -1.0] {
                let matrix = (0..count).fold(DMatrix::zeros(n, n), |sum, k| {
                    sum + sign * vector(n, k) * vector(n, k).transpose()
                });
                let found = Symmetric::of(&matrix);
                match &found {
                    Symmetric::Squares(squares) => assert_eq!(squares.len(), count),
                    Symmetric::Full { .. } => assert!(count > MOST_SQUARES),
                }
                assert!((again(&found, n) - &matrix).amax() <= 4e-14 * matrix.amax());
            }
        }
    }

    #[test]
    fn what_is_not_definite_stays_as_it_is() {
        let n = 5;
        let (a, b) = (vector(n, 0), vector(n, 1));
        let matrix = &a * b.transpose() + &b * a.transpose();
        let found = Symmetric::of(&matrix);
        assert!((again(&found, n) - &matrix).amax() <= 4e-14 * matrix.amax());
        let hollow = DMatrix::from_fn(n, n, |i, j| f64::from(u8::from(i != j && i.max(j) < 3)));
        let found = Symmetric::of(&hollow);
        assert!(matches!(found, Symmetric::Full { size: 3, .. }), "{found:?}");
        assert_eq!(again(&found, n), hollow);
        let not_a_number = DMatrix::from_diagonal_element(n, n, f64::NAN);
        assert!(again(&Symmetric::of(&not_a_number), n).iter().any(|v| v.is_nan()));
    }
}
