//! Small complex systems, solved so often that a library's blocking and memory would take longer than the arithmetic; those of
//! a frequency alone, or of eight frequencies side by side.

use std::ops::{AddAssign, Mul, SubAssign};

use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

/// Solves A X = B by elimination with partial pivoting; A (n × n) is destroyed, B becomes X, both column by column. A
/// singular A leaves values that are not finite.
pub(super) fn solve_in_place(n: usize, a: &mut [Complex64], b: &mut [Complex64]) {
    // Six joints with a few branches or dampers: with the size known beforehand the compiler unrolls the loops.
    match n {
        6 => eliminate(6, a, b, partial_pivot, Complex64::inv),
        7 => eliminate(7, a, b, partial_pivot, Complex64::inv),
        8 => eliminate(8, a, b, partial_pivot, Complex64::inv),
        9 => eliminate(9, a, b, partial_pivot, Complex64::inv),
        12 => eliminate(12, a, b, partial_pivot, Complex64::inv),
        _ => eliminate(n, a, b, partial_pivot, Complex64::inv),
    };
}

/// The one with the largest number in its column.
#[inline(always)]
fn partial_pivot(column: &[Complex64]) -> Option<usize> {
    let size = |i: usize| column[i].l1_norm();
    Some((1..column.len()).fold(0, |best, i| if size(i) > size(best) { i } else { best }))
}

/// Elimination and substitution. `pivot` chooses among the entries of a column from the diagonal on; false where none would do.
#[inline(always)]
fn eliminate<T: Copy + Mul<Output = T> + SubAssign>(
    n: usize,
    a: &mut [T],
    b: &mut [T],
    pivot: impl Fn(&[T]) -> Option<usize>,
    inverse: impl Fn(&T) -> T,
) -> bool {
    for k in 0..n {
        let Some(below) = pivot(&a[n * k + k..n * (k + 1)]) else {
            return false;
        };
        if below > 0 {
            (k..n).for_each(|j| a.swap(k + n * j, k + below + n * j));
            b.chunks_exact_mut(n).for_each(|column| column.swap(k, k + below));
        }
        let inverse = inverse(&a[k + n * k]);
        let (left, right) = a.split_at_mut(n * (k + 1));
        let factors = &mut left[n * k + k + 1..];
        factors.iter_mut().for_each(|f| *f = *f * inverse);
        for column in right.chunks_exact_mut(n).chain(b.chunks_exact_mut(n)) {
            let top = column[k];
            for (x, f) in column[k + 1..].iter_mut().zip(factors.iter()) {
                *x -= *f * top;
            }
        }
        left[n * k + k] = inverse;
    }
    for column in b.chunks_exact_mut(n) {
        for k in (0..n).rev() {
            let value = column[k] * a[k + n * k];
            column[k] = value;
            for (x, f) in column[..k].iter_mut().zip(&a[n * k..]) {
                *x -= *f * value;
            }
        }
    }
    true
}

/// Systems solved side by side: as many numbers as a vector of AVX-512 holds. Narrower vectors take them part by part.
pub(super) const LANES: usize = 8;

/// A complex number of each of the systems. (Aligned so that no vector lies across two lines of the cache.)
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(super) struct Lanes {
    pub(super) re: [f64; LANES],
    pub(super) im: [f64; LANES],
}

impl Lanes {
    /// The same in all.
    pub(super) fn splat(value: f64) -> Self {
        Lanes {
            re: [value; LANES],
            im: [0.0; LANES],
        }
    }

    /// One each.
    pub(super) fn of(values: [Complex64; LANES]) -> Self {
        Lanes {
            re: values.map(|v| v.re),
            im: values.map(|v| v.im),
        }
    }

    /// Times a real number.
    #[inline(always)]
    pub(super) fn times(self, factor: f64) -> Self {
        Lanes {
            re: self.re.map(|v| v * factor),
            im: self.im.map(|v| v * factor),
        }
    }

    /// More by a real number.
    #[inline(always)]
    pub(super) fn plus(self, more: f64) -> Self {
        Lanes {
            re: self.re.map(|v| v + more),
            im: self.im,
        }
    }

    /// Takes the place of the system `lane`.
    pub(super) fn set(&mut self, lane: usize, value: Complex64) {
        self.re[lane] = value.re;
        self.im[lane] = value.im;
    }

    /// That of the system `lane`.
    pub(super) fn get(&self, lane: usize) -> Complex64 {
        Complex64::new(self.re[lane], self.im[lane])
    }

    #[inline(always)]
    pub(super) fn inverse(&self) -> Lanes {
        let square: [f64; LANES] = std::array::from_fn(|l| self.re[l] * self.re[l] + self.im[l] * self.im[l]);
        Lanes {
            re: std::array::from_fn(|l| self.re[l] / square[l]),
            im: std::array::from_fn(|l| -self.im[l] / square[l]),
        }
    }

    #[inline(always)]
    fn size(&self) -> [f64; LANES] {
        std::array::from_fn(|l| self.re[l].abs() + self.im[l].abs())
    }
}

impl Mul for Lanes {
    type Output = Lanes;

    #[inline(always)]
    fn mul(self, other: Lanes) -> Lanes {
        let (a, b) = (self, other);
        Lanes {
            re: std::array::from_fn(|l| a.re[l] * b.re[l] - a.im[l] * b.im[l]),
            im: std::array::from_fn(|l| a.re[l] * b.im[l] + a.im[l] * b.re[l]),
        }
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Lanes) {
        for l in 0..LANES {
            self.re[l] += other.re[l];
            self.im[l] += other.im[l];
        }
    }
}

/// Σ aᵢ bᵢ.
#[inline(always)]
pub(super) fn dot(a: &[Lanes], b: &[Lanes]) -> Lanes {
    let mut sum = Lanes::default();
    a.iter().zip(b).for_each(|(a, b)| sum += *a * *b);
    sum
}

/// The vectors from `first` on, three at a time: one hit along each axis. Behind the last of `count` it is shown again.
#[inline(always)]
pub(super) fn three<'a>(of: impl Fn(usize) -> &'a [Lanes], first: usize, count: usize) -> [&'a [Lanes]; 3] {
    std::array::from_fn(|k| of((first + k).min(count - 1)))
}

/// Σ aᵢ bᵢ with each of three vectors b.
#[inline(always)]
pub(super) fn dots<S: Simd>(simd: S, a: &[Lanes], b: [&[Lanes]; 3]) -> [Lanes; 3] {
    let b = b.map(|b| &b[..a.len()]);
    let mut sums = [Lanes::default(); 3];
    // By hand: the compiler keeps these sums in memory.
    for part in 0..LANES / S::F64_LANES {
        let vector = |values: &[f64; LANES]| S::as_simd_f64s(values).0[part];
        let (mut re, mut im) = ([simd.splat_f64s(0.0); 3], [simd.splat_f64s(0.0); 3]);
        for (i, a) in a.iter().enumerate() {
            let (a_re, a_im) = (vector(&a.re), vector(&a.im));
            let minus = simd.neg_f64s(a_im);
            for k in 0..3 {
                let (b_re, b_im) = (vector(&b[k][i].re), vector(&b[k][i].im));
                re[k] = simd.mul_add_e_f64s(a_re, b_re, re[k]);
                re[k] = simd.mul_add_e_f64s(minus, b_im, re[k]);
                im[k] = simd.mul_add_e_f64s(a_re, b_im, im[k]);
                im[k] = simd.mul_add_e_f64s(a_im, b_re, im[k]);
            }
        }
        for (k, sum) in sums.iter_mut().enumerate() {
            S::as_mut_simd_f64s(&mut sum.re).0[part] = re[k];
            S::as_mut_simd_f64s(&mut sum.im).0[part] = im[k];
        }
    }
    sums
}

/// Σ aᵢ bᵢ of each of the real vectors a with each of three vectors b.
#[inline(always)]
pub(super) fn real_dots<S: Simd, const R: usize>(
    simd: S,
    a: [&[f64]; R],
    b: [&[Lanes]; 3],
) -> [[Lanes; 3]; R] {
    let n = a.first().map_or(0, |a| a.len());
    let (a, b) = (a.map(|a| &a[..n]), b.map(|b| &b[..n]));
    let mut sums = [[Lanes::default(); 3]; R];
    // By hand: the compiler keeps these sums in memory.
    for part in 0..LANES / S::F64_LANES {
        let vector = |values: &[f64; LANES]| S::as_simd_f64s(values).0[part];
        let (mut re, mut im) = ([[simd.splat_f64s(0.0); 3]; R], [[simd.splat_f64s(0.0); 3]; R]);
        for i in 0..n {
            let factors = a.map(|a| simd.splat_f64s(a[i]));
            for k in 0..3 {
                let (b_re, b_im) = (vector(&b[k][i].re), vector(&b[k][i].im));
                for r in 0..R {
                    re[r][k] = simd.mul_add_e_f64s(factors[r], b_re, re[r][k]);
                    im[r][k] = simd.mul_add_e_f64s(factors[r], b_im, im[r][k]);
                }
            }
        }
        for r in 0..R {
            for k in 0..3 {
                S::as_mut_simd_f64s(&mut sums[r][k].re).0[part] = re[r][k];
                S::as_mut_simd_f64s(&mut sums[r][k].im).0[part] = im[r][k];
            }
        }
    }
    sums
}

impl SubAssign for Lanes {
    #[inline(always)]
    fn sub_assign(&mut self, other: Lanes) {
        for l in 0..LANES {
            self.re[l] -= other.re[l];
            self.im[l] -= other.im[l];
        }
    }
}

/// As [`solve_in_place`], of [`LANES`] systems with pivots in common. False where no row would do as pivot in all of them; what is
/// in `a` and `b` then is of no use.
pub(super) fn solve_side_by_side(n: usize, a: &mut [Lanes], b: &mut [Lanes]) -> bool {
    Arch::new().dispatch(SideBySide { n, a, b })
}

/// As [`solve_side_by_side`], for code that is compiled for the processor already.
#[inline(always)]
pub(super) fn eliminate_side_by_side(n: usize, a: &mut [Lanes], b: &mut [Lanes]) -> bool {
    eliminate(n, a, b, pivot_in_common, Lanes::inverse)
}

/// A pivot is at least this part of the largest number in its column: what rounding adds stays small.
const LEAST_PIVOT: f64 = 0.25;

/// The first that will do in all systems; `None` where none will, or where something is no number.
#[inline(always)]
fn pivot_in_common(column: &[Lanes]) -> Option<usize> {
    let mut largest = [0.0f64; LANES];
    for entry in column {
        let size = entry.size();
        for l in 0..LANES {
            largest[l] = largest[l].max(size[l]);
        }
    }
    column.iter().position(|entry| {
        let size = entry.size();
        (0..LANES).all(|l| size[l] >= LEAST_PIVOT * largest[l] && size[l] > 0.0)
    })
}

/// (A type of its own: a closure is compiled for the plainest processor where it is not inlined.)
struct SideBySide<'a> {
    n: usize,
    a: &'a mut [Lanes],
    b: &'a mut [Lanes],
}

impl WithSimd for SideBySide<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        eliminate_side_by_side(self.n, self.a, self.b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of system `lane`. The first pivot of the first one is zero: rows must be exchanged.
    fn entry(lane: usize, i: usize, j: usize) -> Complex64 {
        if (i, j) == (0, 0) {
            Complex64::ZERO
        } else {
            Complex64::new(
                1.0 / (1.0 + (i * i + 2 * j) as f64),
                (i as f64 - 0.3 * j as f64 + 0.01 * lane as f64).sin(),
            )
        }
    }

    fn x(j: usize, c: usize) -> Complex64 {
        Complex64::new(j as f64 - 1.5, c as f64 + 0.5)
    }

    fn system(lane: usize, n: usize, m: usize) -> (Vec<Complex64>, Vec<Complex64>) {
        let a = (0..n * n).map(|k| entry(lane, k % n, k / n)).collect();
        let row = |i: usize, c: usize| (0..n).map(|j| entry(lane, i, j) * x(j, c)).sum();
        (a, (0..n * m).map(|k| row(k % n, k / n)).collect())
    }

    #[test]
    fn small_systems_are_solved() {
        let (n, m) = (5, 2);
        let (mut a, mut b) = system(0, n, m);
        solve_in_place(n, &mut a, &mut b);
        for (k, value) in b.iter().enumerate() {
            assert!((value - x(k % n, k / n)).norm() < 1e-11, "{value}");
        }
        let mut singular = vec![Complex64::ZERO; 4];
        let mut right = vec![Complex64::new(1.0, 0.0); 2];
        solve_in_place(2, &mut singular, &mut right);
        assert!(right.iter().any(|v| !v.is_finite()));
    }

    fn beside(systems: [&[Complex64]; LANES]) -> Vec<Lanes> {
        let of = |k: usize| Lanes {
            re: std::array::from_fn(|l| systems[l][k].re),
            im: std::array::from_fn(|l| systems[l][k].im),
        };
        (0..systems[0].len()).map(of).collect()
    }

    #[test]
    fn systems_side_by_side_are_solved() {
        let (n, m) = (5, 2);
        let systems: [_; LANES] = std::array::from_fn(|lane| system(lane, n, m));
        let mut a = beside(systems.each_ref().map(|s| s.0.as_slice()));
        let mut b = beside(systems.each_ref().map(|s| s.1.as_slice()));
        assert!(solve_side_by_side(n, &mut a, &mut b));
        for (k, value) in b.iter().enumerate() {
            for lane in 0..LANES {
                assert!((value.get(lane) - x(k % n, k / n)).norm() < 1e-11, "{value:?}");
            }
        }
    }

    #[test]
    fn what_has_no_pivot_in_common_is_said() {
        // Two systems whose rows stand the other way round.
        let (one, zero) = (Complex64::ONE, Complex64::ZERO);
        let (straight, crossed) = ([one, zero, zero, one], [zero, one, one, zero]);
        let in_turn = [&straight[..], &crossed];
        let mut a = beside(std::array::from_fn(|lane| in_turn[lane % 2]));
        let mut b = beside([&[one, one]; LANES]);
        assert!(!solve_side_by_side(2, &mut a, &mut b));
        let not_a_number = [Complex64::new(f64::NAN, 0.0); 4];
        let mut systems = [&straight[..]; LANES];
        systems[3] = &not_a_number;
        let mut a = beside(systems);
        assert!(!solve_side_by_side(2, &mut a, &mut b));
    }
}
