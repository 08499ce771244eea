//! Arithmetic on complex columns that hold their real parts first and their imaginary parts after them: loops over plain
//! numbers, which become the widest vectors of whoever they are inlined into.

use num_complex::Complex64;

/// Sums that the processor can add side by side.
const LANES: usize = 8;

/// Real and imaginary parts of `values`.
pub(crate) fn split(values: impl Iterator<Item = Complex64> + Clone) -> Vec<f64> {
    values.clone().map(|v| v.re).chain(values.map(|v| v.im)).collect()
}

/// The values of a column.
pub(crate) fn joined(column: &[f64]) -> impl Iterator<Item = Complex64> {
    let (re, im) = halves(column);
    re.iter().zip(im).map(|(re, im)| Complex64::new(*re, *im))
}

#[inline(always)]
pub(crate) fn halves(column: &[f64]) -> (&[f64], &[f64]) {
    column.split_at(column.len() / 2)
}

#[inline(always)]
pub(crate) fn halves_mut(column: &mut [f64]) -> (&mut [f64], &mut [f64]) {
    let lines = column.len() / 2;
    column.split_at_mut(lines)
}

/// xᵀ y; of two columns Re xᴴ y.
#[inline(always)]
pub(crate) fn real_dot(x: &[f64], y: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let ((x, x_rest), (y, y_rest)) = (x.as_chunks::<LANES>(), y.as_chunks::<LANES>());
    for (x, y) in x.iter().zip(y) {
        for lane in 0..LANES {
            sums[lane] += x[lane] * y[lane];
        }
    }
    let mut rest = 0.0;
    for (x, y) in x_rest.iter().zip(y_rest) {
        rest += x * y;
    }
    let pairs = [
        sums[0] + sums[4],
        sums[1] + sums[5],
        sums[2] + sums[6],
        sums[3] + sums[7],
    ];
    (pairs[0] + pairs[2]) + (pairs[1] + pairs[3]) + rest
}

#[inline(always)]
pub(crate) fn length(column: &[f64]) -> f64 {
    real_dot(column, column).sqrt()
}

/// xᴴ y.
#[inline(always)]
pub(crate) fn dot(x: &[f64], y: &[f64]) -> Complex64 {
    let ((x_re, x_im), (y_re, y_im)) = (halves(x), halves(y));
    Complex64::new(real_dot(x, y), real_dot(x_re, y_im) - real_dot(x_im, y_re))
}

/// Takes the part of `column` along the unit column `along` out, and says how much that was.
#[inline(always)]
pub(crate) fn take_out(column: &mut [f64], along: &[f64]) -> Complex64 {
    let part = dot(along, column);
    let ((re, im), (along_re, along_im)) = (halves_mut(column), halves(along));
    for ((re, im), (a, b)) in re.iter_mut().zip(im).zip(along_re.iter().zip(along_im)) {
        *re -= a * part.re - b * part.im;
        *im -= a * part.im + b * part.re;
    }
    part
}

/// Parts of a column along a real unit column.
#[inline(always)]
pub(crate) fn along_real(column: &[f64], along: &[f64]) -> [f64; 2] {
    let (re, im) = halves(column);
    [real_dot(re, along), real_dot(im, along)]
}

/// Takes the span of orthonormal real columns out of a column.
#[inline(always)]
pub(crate) fn take_out_real(column: &mut [f64], orthonormal: &[Vec<f64>]) {
    for along in orthonormal {
        let parts = along_real(column, along);
        for (half, part) in column.chunks_exact_mut(along.len()).zip(parts) {
            for (value, a) in half.iter_mut().zip(along) {
                *value -= part * a;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(count: usize, seed: f64) -> Vec<Complex64> {
        let value = |k: usize| (seed + 1.3 * k as f64).sin();
        (0..count)
            .map(|k| Complex64::new(value(k), value(k + 7)))
            .collect()
    }

    #[test]
    fn products_are_those_of_complex_numbers() {
        for lines in [1, 7, 8, 19] {
            let (x, y) = (column(lines, 0.2), column(lines, 1.1));
            let (a, b) = (split(x.iter().copied()), split(y.iter().copied()));
            let expected: Complex64 = x.iter().zip(&y).map(|(x, y)| x.conj() * y).sum();
            assert!((dot(&a, &b) - expected).norm() < 1e-12, "{lines}");
            assert!((real_dot(&a, &b) - expected.re).abs() < 1e-12);
            assert_eq!(joined(&a).collect::<Vec<_>>(), x);
        }
    }

    #[test]
    fn what_is_taken_out_is_gone() {
        let mut along = split(column(19, 0.4).into_iter());
        let size = length(&along);
        along.iter_mut().for_each(|v| *v /= size);
        let mut rest = split(column(19, 2.0).into_iter());
        let (before, part) = (length(&rest), take_out(&mut rest, &along));
        assert!(dot(&along, &rest).norm() < 1e-14);
        assert!((length(&rest).powi(2) + part.norm_sqr() - before * before).abs() < 1e-12);
        let mut real: Vec<f64> = (0..19).map(|k| 1.0 + k as f64).collect();
        let size = length(&real);
        real.iter_mut().for_each(|v| *v /= size);
        take_out_real(&mut rest, &[real.clone()]);
        assert!(along_real(&rest, &real).iter().all(|part| part.abs() < 1e-13));
    }
}
