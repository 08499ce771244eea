//! FRFs on the same lines whose noise differs by a factor only: their weighted columns are the same, so the basis of a fit
//! is built, factored and differentiated once for all of them, and an FRF costs a few products with it.
//!
//! With columns `B` (C of them), slopes `S` (four a moving pole) and weighted FRFs `T`, all on the same rows: `X = G⁻¹BᵀT`
//! with `G = BᵀB`, `R = T − BX`, and the normal matrix is that of the slopes with `B` taken out, weighted with the sums
//! of products of the coefficients over the FRFs (Golub & LeVeque 1979: separable least squares with several right sides).

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix2};
use rayon::prelude::*;

use crate::modal::max_likelihood::ml_linear::{self, NoisyFrf, PoleColumns, SolvedFrf};

/// Relative difference of noises that is rounding.
const PROPORTIONAL: f64 = 1e-9;
/// FRFs taken together by one thread.
const BLOCK: usize = 12;

/// FRFs on the same lines whose noise differs by a factor only, weighted.
pub(crate) struct Alike {
    /// √2/σ of the first FRF, twice for each line.
    weight: Vec<f64>,
    /// By FRF: noise over that of the first.
    noise: Vec<f64>,
    /// Weighted FRFs, one after the other; each as if it had the noise of the first.
    targets: Vec<f64>,
}

/// Result of [`Alike::linearise`].
pub(crate) struct AlikeFit {
    pub misfit: f64,
    pub normal: DMatrix<f64>,
    /// Each FRF's part of the gradient.
    pub scores: Vec<DVector<f64>>,
    pub solved: AlikeLinear,
}

/// Linear parameters of all FRFs.
pub(crate) struct AlikeLinear {
    basis: Basis,
    /// L⁻¹ basisᵀ slopes.
    slopes: DMatrix<f64>,
    /// Products of the slopes, the basis taken out.
    of_slopes: DMatrix<f64>,
    scores: Vec<DVector<f64>>,
    /// By FRF, in units of the unit columns.
    x: DMatrix<f64>,
    noise: Vec<f64>,
}

/// Weighted columns and the factor of their Gram matrix (of columns of unit length).
struct Basis {
    columns: Vec<f64>,
    rows: usize,
    cholesky: Cholesky<f64, Dyn>,
    scale: DVector<f64>,
}

impl Alike {
    /// `None` where lines or noises are not alike, or for a single FRF.
    pub fn new(frfs: &[NoisyFrf]) -> Option<Alike> {
        let first = frfs.first().filter(|_| frfs.len() > 1)?;
        let mut noise = Vec::with_capacity(frfs.len());
        for frf in frfs {
            let factor = frf.sigma.first()? / first.sigma.first()?;
            let same = frf.sigma.len() == first.sigma.len()
                && frf
                    .sigma
                    .iter()
                    .zip(first.sigma)
                    .all(|(s, of_first)| (s - factor * of_first).abs() <= PROPORTIONAL * s);
            if !(same && frf.frequency_hz == first.frequency_hz && frf.spread_hz == first.spread_hz) {
                return None;
            }
            noise.push(factor);
        }
        let weight = ml_linear::weights(first.sigma);
        let mut targets = Vec::with_capacity(frfs.len() * weight.len());
        for (frf, noise) in frfs.iter().zip(&noise) {
            let parts = frf.receptance.iter().flat_map(|h| [h.re, h.im]);
            targets.extend(parts.zip(&weight).map(|(part, w)| part * w / noise));
        }
        Some(Alike {
            weight,
            noise,
            targets,
        })
    }

    fn weighted(&self, columns: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; columns.len()];
        ml_linear::weigh(&mut out, columns, &self.weight);
        out
    }

    fn basis(&self, axis: &PoleColumns) -> Option<Basis> {
        let columns = self.weighted(&axis.columns);
        let gram = transposed_product(&columns, &columns, axis.rows);
        let (cholesky, scale) = ml_linear::unit_cholesky(&gram, &axis.held)?;
        Some(Basis {
            columns,
            rows: axis.rows,
            cholesky,
            scale,
        })
    }

    /// Solution of all FRFs for the poles of an axis, with the normal equations of the poles.
    pub fn linearise(&self, axis: &PoleColumns) -> Option<AlikeFit> {
        let rows = axis.rows;
        let basis = self.basis(axis)?;
        let slopes = self.weighted(&axis.slopes);
        let count = slopes.len() / rows;
        let half = basis.half_solved(transposed_product(&basis.columns, &slopes, rows));
        let mut of_slopes = transposed_product(&slopes, &slopes, rows);
        of_slopes -= half.tr_mul(&half);
        let parameters = count / 2;
        // The first of the two coefficients that a parameter's slopes belong to.
        let of = |parameter: usize| 2 * (parameter / 2);
        let blocks: Vec<Block> = self
            .targets
            .par_chunks(BLOCK * rows)
            .map(|targets| {
                let Projected { x, residual, left } = basis.project(targets);
                let mut on_slopes = transposed_product(&slopes, &residual, rows);
                on_slopes -= half.tr_mul(&left);
                let mut misfit = 0.0;
                let scores = (0..x.ncols())
                    .map(|m| {
                        let r = &residual[m * rows..(m + 1) * rows];
                        misfit += r.iter().map(|r| r * r).sum::<f64>() - left.column(m).norm_squared();
                        DVector::from_fn(parameters, |p, _| {
                            (0..2)
                                .map(|u| {
                                    x[(of(p) + u, m)] * basis.scale[of(p) + u] * on_slopes[(2 * p + u, m)]
                                })
                                .sum()
                        })
                    })
                    .collect();
                let correction = basis.back_solved(left);
                Block {
                    misfit,
                    scores,
                    x: x + correction,
                }
            })
            .collect();
        let mut misfit = 0.0;
        let mut scores = Vec::with_capacity(self.noise.len());
        let mut x = DMatrix::zeros(basis.scale.len(), self.noise.len());
        for block in blocks {
            misfit += block.misfit;
            x.columns_mut(scores.len(), block.x.ncols()).copy_from(&block.x);
            scores.extend(block.scores);
        }
        let coefficients = DMatrix::from_fn(parameters, self.noise.len(), |j, m| x[(j, m)] * basis.scale[j]);
        let together = &coefficients * coefficients.transpose();
        let normal = DMatrix::from_fn(parameters, parameters, |p, q| {
            let mut sum = 0.0;
            for u in 0..2 {
                for v in 0..2 {
                    sum += together[(of(p) + u, of(q) + v)] * of_slopes[(2 * p + u, 2 * q + v)];
                }
            }
            sum
        });
        Some(AlikeFit {
            misfit,
            normal,
            scores: scores.clone(),
            solved: AlikeLinear {
                basis,
                slopes: half,
                of_slopes,
                scores,
                x,
                noise: self.noise.clone(),
            },
        })
    }

    /// Misfit that each of `trials` poles explains in addition to those of `held`, all of them where they are.
    pub fn explained_by(
        &self,
        held: &PoleColumns,
        trial_axis: &PoleColumns,
        trials: usize,
    ) -> Option<Vec<f64>> {
        let rows = held.rows;
        let basis = self.basis(held)?;
        let added = self.weighted(&trial_axis.columns[..2 * trials * rows]);
        let half = basis.half_solved(transposed_product(&basis.columns, &added, rows));
        let grams: Vec<[f64; 3]> = (0..trials)
            .map(|t| {
                let (a, b) = added[2 * t * rows..2 * (t + 1) * rows].split_at(rows);
                let (p, q) = (half.column(2 * t), half.column(2 * t + 1));
                let dot = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
                [
                    dot(a, a) - p.norm_squared(),
                    dot(a, b) - p.dot(&q),
                    dot(b, b) - q.norm_squared(),
                ]
            })
            .collect();
        let blocks: Vec<Vec<f64>> = self
            .targets
            .par_chunks(BLOCK * rows)
            .map(|targets| {
                let Projected { residual, left, .. } = basis.project(targets);
                let mut on_added = transposed_product(&added, &residual, rows);
                on_added -= half.tr_mul(&left);
                let gains = grams.iter().enumerate().map(|(t, [aa, ab, bb])| {
                    (0..on_added.ncols())
                        .map(|m| {
                            let (u, v) = (on_added[(2 * t, m)], on_added[(2 * t + 1, m)]);
                            let gain = (u * u * bb - 2.0 * u * v * ab + v * v * aa) / (aa * bb - ab * ab);
                            // A column that the others already hold explains nothing.
                            if gain.is_finite() && gain > 0.0 { gain } else { 0.0 }
                        })
                        .sum()
                });
                gains.collect()
            })
            .collect();
        let mut sum = vec![0.0; trials];
        for gains in blocks {
            for (sum, gain) in sum.iter_mut().zip(gains) {
                *sum += gain;
            }
        }
        Some(sum)
    }
}

struct Block {
    misfit: f64,
    scores: Vec<DVector<f64>>,
    x: DMatrix<f64>,
}

/// Some FRFs and the basis.
struct Projected {
    /// In units of the unit columns, before the correction by `left`.
    x: DMatrix<f64>,
    residual: Vec<f64>,
    /// L⁻¹ of what the normal equations leave along the basis.
    left: DMatrix<f64>,
}

impl Basis {
    /// L⁻¹ of products with the columns.
    fn half_solved(&self, mut products: DMatrix<f64>) -> DMatrix<f64> {
        for mut column in products.column_iter_mut() {
            column.component_mul_assign(&self.scale);
        }
        ml_linear::lower_solve(&self.cholesky, &mut products);
        products
    }

    /// L⁻ᵀ.
    fn back_solved(&self, mut half: DMatrix<f64>) -> DMatrix<f64> {
        self.cholesky.l_dirty().ad_solve_lower_triangular_mut(&mut half);
        half
    }

    fn project(&self, targets: &[f64]) -> Projected {
        let half = self.half_solved(transposed_product(&self.columns, targets, self.rows));
        let x = self.back_solved(half);
        let mut unscaled = x.clone();
        for mut column in unscaled.column_iter_mut() {
            column.component_mul_assign(&self.scale);
        }
        let mut residual = targets.to_vec();
        let (columns, frfs) = x.shape();
        matmul(
            MatMut::from_column_major_slice_mut(&mut residual, self.rows, frfs),
            Accum::Add,
            MatRef::from_column_major_slice(&self.columns, self.rows, columns),
            MatRef::from_column_major_slice(unscaled.as_slice(), columns, frfs),
            -1.0,
            Par::Seq,
        );
        let left = self.half_solved(transposed_product(&self.columns, &residual, self.rows));
        Projected { x, residual, left }
    }
}

impl AlikeLinear {
    /// As if FRF `m` had been solved with columns of its own.
    pub fn of_frf(&self, m: usize) -> SolvedFrf {
        let scale = &self.basis.scale;
        let parameters = self.slopes.ncols() / 2;
        let coefficient = |j: usize| self.x[(j, m)] * scale[j];
        let by_poles = DMatrix::from_fn(self.slopes.nrows(), parameters, |i, p| {
            let j = 2 * (p / 2);
            coefficient(j) * self.slopes[(i, 2 * p)] + coefficient(j + 1) * self.slopes[(i, 2 * p + 1)]
        });
        let own = (0..parameters / 2)
            .map(|mode| {
                let information = Matrix2::from_fn(|p, q| {
                    let (p, q) = (2 * (2 * mode + p), 2 * (2 * mode + q));
                    let mut sum = 0.0;
                    for u in 0..2 {
                        for v in 0..2 {
                            sum += coefficient(2 * mode + u)
                                * coefficient(2 * mode + v)
                                * self.of_slopes[(p + u, q + v)];
                        }
                    }
                    sum
                });
                let gradient = self.scores[m].fixed_rows::<2>(2 * mode).into_owned();
                (information, gradient)
            })
            .collect();
        SolvedFrf {
            own,
            linear: ml_linear::Solved {
                cholesky: self.basis.cholesky.clone(),
                scale: scale * self.noise[m],
                x: self.x.column(m).into_owned(),
            },
            by_poles,
        }
    }
}

/// leftᵀ right, both with columns of `rows` values.
fn transposed_product(left: &[f64], right: &[f64], rows: usize) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(left.len() / rows, right.len() / rows);
    ml_linear::product(&mut out, left, right, rows);
    out
}
