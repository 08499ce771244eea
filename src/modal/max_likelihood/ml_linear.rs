//! One FRF in the maximum-likelihood fit for given poles: the columns of its basis, and the linear parameters.

use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::solve_lower_triangular_in_place;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix2, Vector2};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

use crate::modal::single::curve::reach;
use crate::modal::single::local_fit::Pole;

/// Lower residual terms, then upper ones.
pub(crate) const RESIDUAL_TERMS: usize = 6;
/// Smallest eigenvalue of the residual terms' Gram matrix, with columns of unit length.
const ROUNDING: f64 = 1e-12;

/// One FRF within the window of the fit.
#[derive(Clone)]
pub(crate) struct NoisyFrf<'a> {
    pub frequency_hz: &'a [f64],
    pub receptance: &'a [Complex64],
    /// sqrt(E|e|²) of each line, > 0.
    pub sigma: &'a [f64],
    /// Standard deviation of the frequencies that a line is the mean of, Hz; zero for a single one.
    pub spread_hz: &'a [f64],
}

impl NoisyFrf<'_> {
    /// Has it enough lines for the residues of so many poles and the residual terms? One that has not, because its band ends
    /// before or within the window, takes no part in a fit.
    pub fn takes_part(&self, poles: usize) -> bool {
        2 * self.frequency_hz.len() > 2 * poles + RESIDUAL_TERMS
    }
}

/// What the fit found for one FRF.
pub(crate) struct FrfSolution {
    /// a₁, b₁, a₂, b₂, …, of the fixed poles too, then the residual terms.
    pub linear: DVector<f64>,
    /// Measured less fitted, m/N.
    pub residual: Vec<Complex64>,
    /// Covariance of each mode's a and b for given poles.
    pub pair_covariance: Vec<Matrix2<f64>>,
    /// −∂linear/∂(ln f₁, ln ζ₁, …).
    pub linear_by_poles: DMatrix<f64>,
    /// Part of the noise at each line that the fit follows, mean over the lines.
    pub leverage: f64,
    /// By moving pole: what this FRF alone says of (ln f, ln ζ): its part of the information and of the gradient.
    pub own: Vec<(Matrix2<f64>, Vector2<f64>)>,
}

impl FrfSolution {
    /// Of an FRF that takes no part in a fit of `moving` poles and others: no residues, and nothing known of any pole.
    pub fn nothing(poles: usize, moving: usize) -> FrfSolution {
        let linear = 2 * poles + RESIDUAL_TERMS;
        FrfSolution {
            linear: DVector::zeros(linear),
            residual: Vec::new(),
            pair_covariance: vec![Matrix2::zeros(); moving],
            linear_by_poles: DMatrix::zeros(linear, 2 * moving),
            leverage: 0.0,
            own: vec![(Matrix2::zeros(), Vector2::zeros()); moving],
        }
    }

    pub fn took_part(&self) -> bool {
        !self.residual.is_empty()
    }
}

/// √2/σ, twice for each line.
pub(crate) fn weights(sigma: &[f64]) -> Vec<f64> {
    let of_line = sigma.iter().map(|s| std::f64::consts::SQRT_2 / s);
    of_line.flat_map(|w| [w, w]).collect()
}

/// Columns that all FRFs on the same lines share, before weighting; each 2 × lines long.
pub(crate) struct PoleColumns {
    pub rows: usize,
    /// g = 1/(1 − r² + 2iζr) and irg by pole, moving ones first, r = f/f₀; then the residual terms.
    pub columns: Vec<f64>,
    /// By moving pole, for numerators a + ibr: ∂/∂ln f₀ = a p + b ir(p − g) and ∂/∂ln ζ = a q + b irq,
    /// with p = −g²(2r² − 2iζr), q = −2iζr g², in the order p, ir(p − g), q, irq.
    pub slopes: Vec<f64>,
    /// By column: of a pole that is not moved, of one that these lines do not reach, or a residual term.
    pub held: Vec<bool>,
}

impl PoleColumns {
    pub fn new(
        frequency_hz: &[f64],
        spread_hz: &[f64],
        moving: &[Pole],
        fixed: &[Pole],
        centre_hz: f64,
    ) -> PoleColumns {
        let rows = 2 * frequency_hz.len();
        let modes = moving.len() + fixed.len();
        let mut columns = vec![0.0; rows * (2 * modes + RESIDUAL_TERMS)];
        let mut slopes = vec![0.0; rows * 4 * moving.len()];
        let add = |all: &mut [f64], column: usize, line: usize, value: Complex64| {
            all[column * rows + 2 * line] += value.re;
            all[column * rows + 2 * line + 1] += value.im;
        };
        // The mean of a smooth function over frequencies that scatter by s is that of its values at ± s.
        let points = |k: usize| {
            let (f, s) = (frequency_hz[k], spread_hz[k]);
            let (points, share) = if s > 0.0 {
                ([f - s, f + s], 0.5)
            } else {
                ([f, f], 1.0)
            };
            let count = if s > 0.0 { 2 } else { 1 };
            points.into_iter().take(count).map(move |f| (f, share))
        };
        for (j, pole) in moving.iter().chain(fixed).enumerate() {
            for k in 0..frequency_hz.len() {
                for (f, share) in points(k) {
                    let r = f / pole.frequency_hz;
                    let (re, im) = (1.0 - r * r, 2.0 * pole.damping_ratio * r);
                    let g = Complex64::new(re, -im) / (re * re + im * im);
                    let turned = |z: Complex64| Complex64::new(-z.im * r, z.re * r);
                    add(&mut columns, 2 * j, k, g * share);
                    add(&mut columns, 2 * j + 1, k, turned(g) * share);
                    if j < moving.len() {
                        let p = -(g * g) * Complex64::new(2.0 * r * r, -im);
                        let q = -(g * g) * Complex64::new(0.0, im);
                        for (n, value) in [p, turned(p - g), q, turned(q)].into_iter().enumerate() {
                            add(&mut slopes, 4 * j + n, k, value * share);
                        }
                    }
                }
            }
        }
        for k in 0..frequency_hz.len() {
            for (f, share) in points(k) {
                for (n, term) in residual_terms(f, centre_hz).into_iter().enumerate() {
                    add(&mut columns, 2 * modes + n, k, term * share);
                }
            }
        }
        let mut held = vec![true; 2 * modes + RESIDUAL_TERMS];
        for (j, pole) in moving.iter().enumerate() {
            held[2 * j..2 * j + 2].fill(!reach(frequency_hz, pole.frequency_hz));
        }
        PoleColumns {
            rows,
            columns,
            slopes,
            held,
        }
    }
}

/// What modes outside the band leave inside it, to the second order in the ratio of the frequencies: 1/ω², i/ω³, 1/ω⁴
/// below, 1, iω, ω² above, each scaled to one at the centre. (With 1/ω² alone the damping of a mode whose flank reaches
/// the band's lower end comes out 0.5 % wrong.)
pub(crate) fn residual_terms(f: f64, centre_hz: f64) -> [Complex64; RESIDUAL_TERMS] {
    let x = f / centre_hz;
    [
        Complex64::new(-1.0 / (x * x), 0.0),
        Complex64::new(0.0, 1.0 / (x * x * x)),
        Complex64::new(1.0 / (x * x).powi(2), 0.0),
        Complex64::ONE,
        Complex64::new(0.0, x),
        Complex64::new(x * x, 0.0),
    ]
}

/// Frequency at which the residual terms have unit size.
pub(crate) fn centre_hz(frfs: &[NoisyFrf]) -> f64 {
    let first = frfs
        .iter()
        .filter_map(|c| c.frequency_hz.first())
        .fold(f64::INFINITY, |m, f| m.min(*f));
    let last = frfs
        .iter()
        .filter_map(|c| c.frequency_hz.last())
        .fold(0.0, |m: f64, f| m.max(*f));
    (first.max(1e-3 * last) * last).sqrt()
}

/// Every column times the weights, for as many columns as both hold.
pub(crate) fn weigh(out: &mut [f64], columns: &[f64], weight: &[f64]) {
    Arch::new().dispatch(Weigh { out, columns, weight });
}

/// [`weigh`] in the widest vectors of the processor. (A closure is compiled for the plainest one where it is not inlined.)
struct Weigh<'a> {
    out: &'a mut [f64],
    columns: &'a [f64],
    weight: &'a [f64],
}

impl WithSimd for Weigh<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let rows = self.weight.len();
        for (out, column) in self
            .out
            .chunks_exact_mut(rows)
            .zip(self.columns.chunks_exact(rows))
        {
            for ((out, value), w) in out.iter_mut().zip(column).zip(self.weight) {
                *out = value * w;
            }
        }
    }
}

/// Weighted slopes by the poles from the columns of [`PoleColumns::slopes`], with the numerators a + ibr of each pole in pairs.
struct WeighSlopes<'a> {
    out: &'a mut [f64],
    slopes: &'a [f64],
    numerators: &'a [f64],
    weight: &'a [f64],
}

impl WithSimd for WeighSlopes<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let rows = self.weight.len();
        let pairs = self.slopes.chunks_exact(2 * rows);
        for (parameter, (out, pair)) in self.out.chunks_exact_mut(rows).zip(pairs).enumerate() {
            let j = 2 * (parameter / 2);
            let (a, b) = (self.numerators[j], self.numerators[j + 1]);
            let (with_a, with_b) = pair.split_at(rows);
            for (((out, p), q), w) in out.iter_mut().zip(with_a).zip(with_b).zip(self.weight) {
                *out = (a * p + b * q) * w;
            }
        }
    }
}

/// L⁻¹ `columns`, in place. (Much faster than nalgebra's for several columns.)
pub(crate) fn lower_solve(cholesky: &Cholesky<f64, Dyn>, columns: &mut DMatrix<f64>) {
    let (rows, count) = columns.shape();
    let lower = MatRef::from_column_major_slice(cholesky.l_dirty().as_slice(), rows, rows);
    let columns = MatMut::from_column_major_slice_mut(columns.as_mut_slice(), rows, count);
    solve_lower_triangular_in_place(lower, columns, Par::Seq);
}

/// `out` = leftᵀ right, both with columns of `rows` values.
pub(crate) fn product(out: &mut DMatrix<f64>, left: &[f64], right: &[f64], rows: usize) {
    let (m, n) = out.shape();
    let left = MatRef::from_column_major_slice(left, rows, m);
    let right = MatRef::from_column_major_slice(right, rows, n);
    let out = MatMut::from_column_major_slice_mut(out.as_mut_slice(), m, n);
    matmul(out, Accum::Replace, left.transpose(), right, 1.0, Par::Seq);
}

/// The lower triangle of `out` = columnsᵀ columns, which have `rows` values.
fn squared(out: &mut DMatrix<f64>, columns: &[f64], rows: usize) {
    let n = out.ncols();
    let columns = MatRef::from_column_major_slice(columns, rows, n);
    let out = MatMut::from_column_major_slice_mut(out.as_mut_slice(), n, n);
    let (lower, all) = (BlockStructure::TriangularLower, BlockStructure::Rectangular);
    triangular::matmul(
        out,
        lower,
        Accum::Replace,
        columns.transpose(),
        all,
        columns,
        all,
        1.0,
        Par::Seq,
    );
}

/// The linear parameters of one FRF for given poles. The normal equations square the condition number: what they leave
/// along the basis is taken out of everything that follows ([`Solved::half_solved`], [`Solved::correct`]).
pub(crate) struct Solved {
    /// Of the Gram matrix with columns of unit length.
    pub cholesky: Cholesky<f64, Dyn>,
    /// 1/length of each column.
    pub scale: DVector<f64>,
    /// In units of the unit columns.
    pub x: DVector<f64>,
}

/// That, with how it moves with the poles.
pub(crate) struct SolvedFrf {
    pub linear: Solved,
    /// L⁻¹ basisᵀ slopes with the Gram matrix L Lᵀ, in units of the unit columns.
    pub by_poles: DMatrix<f64>,
    /// See [`FrfSolution::own`].
    pub own: Vec<(Matrix2<f64>, Vector2<f64>)>,
}

/// Factor of the first columns of a Gram matrix (its lower triangle), of columns of unit length, and 1/length of each. `held`: see
/// [`PoleColumns::held`], one for each of these columns.
pub(crate) fn unit_cholesky(
    gram: &DMatrix<f64>,
    held: &[bool],
) -> Option<(Cholesky<f64, Dyn>, DVector<f64>)> {
    let columns = held.len();
    // Unit columns: the Gram matrix is then as well scaled as it can be.
    let scale = DVector::from_fn(columns, |j, _| gram[(j, j)].sqrt().recip());
    if scale.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        return None;
    }
    let mut unit = DMatrix::zeros(columns, columns);
    for j in 0..columns {
        for i in j..columns {
            unit[(i, j)] = gram[(i, j)] * scale[i] * scale[j];
        }
    }
    // Lines near 0 Hz make the lower residual terms all alike, and poles close together look the same from afar: hold back the
    // part of them that rounding would decide.
    for (column, _) in held.iter().enumerate().filter(|(_, held)| **held) {
        unit[(column, column)] += ROUNDING;
    }
    Some((unit.cholesky()?, scale))
}

impl Solved {
    /// Fills `buffer` with the weighted basis of an FRF, then its residual, then room for `more` columns; says how many
    /// columns the basis has.
    pub fn new(
        weight: &[f64],
        target: &[f64],
        axis: &PoleColumns,
        more: usize,
        buffer: &mut Vec<f64>,
    ) -> Option<(Solved, usize)> {
        let rows = axis.rows;
        let columns = axis.columns.len() / rows;
        buffer.resize(rows * (columns + 1 + more), 0.0);
        let filled = &mut buffer[..rows * (columns + 1)];
        weigh(filled, &axis.columns, weight);
        filled[rows * columns..].copy_from_slice(target);
        let mut gram = DMatrix::zeros(columns + 1, columns + 1);
        squared(&mut gram, filled, rows);
        let (cholesky, scale) = unit_cholesky(&gram, &axis.held)?;
        let projected = gram
            .view((columns, 0), (1, columns))
            .transpose()
            .component_mul(&scale);
        let x = cholesky.solve(&projected);
        let unscaled = x.component_mul(&scale);
        let (basis, residual) = filled.split_at_mut(rows * columns);
        let basis = MatRef::from_column_major_slice(&*basis, rows, columns);
        let change = MatRef::from_column_major_slice(unscaled.as_slice(), columns, 1);
        let residual = MatMut::from_column_major_slice_mut(residual, rows, 1);
        matmul(residual, Accum::Add, basis, change, -1.0, Par::Seq);
        Some((Solved { cholesky, scale, x }, columns))
    }

    /// One step of iterative refinement; `left`: [`Solved::half_solved`] of the residual.
    fn correct(&mut self, left: DVector<f64>) {
        let mut step = left;
        self.cholesky.l_dirty().ad_solve_lower_triangular_mut(&mut step);
        self.x += step;
    }

    /// L⁻¹ of products with the basis, L Lᵀ the Gram matrix of unit columns.
    pub fn half_solved(&self, mut products: DMatrix<f64>) -> DMatrix<f64> {
        for mut column in products.column_iter_mut() {
            column.component_mul_assign(&self.scale);
        }
        lower_solve(&self.cholesky, &mut products);
        products
    }
}

impl SolvedFrf {
    pub fn finish(&self, frf: &NoisyFrf, axis: &PoleColumns) -> FrfSolution {
        let Solved { cholesky, scale, x } = &self.linear;
        let scaled = |mut matrix: DMatrix<f64>| {
            for mut column in matrix.column_iter_mut() {
                column.component_mul_assign(scale);
            }
            matrix
        };
        let mut by_poles = self.by_poles.clone();
        // G⁻¹ = L⁻ᵀ L⁻¹: columns of L⁻¹ are enough for the blocks on its diagonal.
        let mut inverse = DMatrix::identity(x.len(), by_poles.ncols());
        lower_solve(cholesky, &mut inverse);
        let pair_covariance = (0..by_poles.ncols() / 2)
            .map(|mode| {
                Matrix2::from_fn(|a, b| {
                    let (a, b) = (2 * mode + a, 2 * mode + b);
                    inverse.column(a).dot(&inverse.column(b)) * scale[a] * scale[b]
                })
            })
            .collect();
        cholesky.l_dirty().ad_solve_lower_triangular_mut(&mut by_poles);
        let linear = x.component_mul(scale);
        let mut residual = frf.receptance.to_vec();
        for (x, column) in linear.iter().zip(axis.columns.chunks_exact(axis.rows)) {
            for (r, c) in residual.iter_mut().zip(column.as_chunks::<2>().0) {
                *r -= Complex64::new(c[0], c[1]) * x;
            }
        }
        FrfSolution {
            leverage: x.len() as f64 / axis.rows as f64,
            own: self.own.clone(),
            linear,
            residual,
            pair_covariance,
            linear_by_poles: scaled(by_poles),
        }
    }
}

/// Solution of one FRF, and the products of its residual and slopes with each other, what the basis can follow taken out:
/// misfit, gradient and information matrix.
pub(crate) fn linearise_one(
    weight: &[f64],
    target: &[f64],
    axis: &PoleColumns,
    buffer: &mut Vec<f64>,
) -> Option<(DMatrix<f64>, SolvedFrf)> {
    let rows = axis.rows;
    let parameters = axis.slopes.len() / (2 * rows);
    let (mut linear, columns) = Solved::new(weight, target, axis, parameters, buffer)?;
    let slopes = &mut buffer[rows * (columns + 1)..];
    Arch::new().dispatch(WeighSlopes {
        out: slopes,
        slopes: &axis.slopes,
        numerators: linear.x.component_mul(&linear.scale).as_slice(),
        weight,
    });
    // Basis, residual and slopes, each with residual and slopes.
    let mut all = DMatrix::zeros(columns + 1 + parameters, 1 + parameters);
    product(&mut all, buffer, &buffer[rows * columns..], rows);
    let half = linear.half_solved(all.rows(0, columns).into_owned());
    let mut products = all.rows(columns, 1 + parameters).into_owned();
    let size = 1 + parameters;
    let out = MatMut::from_column_major_slice_mut(products.as_mut_slice(), size, size);
    let half_solved = MatRef::from_column_major_slice(half.as_slice(), columns, size);
    matmul(
        out,
        Accum::Add,
        half_solved.transpose(),
        half_solved,
        -1.0,
        Par::Seq,
    );
    linear.correct(half.column(0).into_owned());
    let by_poles = half.columns(1, parameters).into_owned();
    let own = (0..parameters / 2)
        .map(|j| {
            let at = 1 + 2 * j;
            let gradient = products.fixed_view::<2, 1>(at, 0).into_owned();
            (products.fixed_view::<2, 2>(at, at).into_owned(), gradient)
        })
        .collect();
    Some((
        products,
        SolvedFrf {
            linear,
            by_poles,
            own,
        },
    ))
}
