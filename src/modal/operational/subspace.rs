//! Poles of all orders from the singular vectors of the Hankel matrix, with their standard deviations.

use std::f64::consts::TAU;

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::matmul::matmul;
use faer::linalg::solvers::Solve;
use faer::linalg::svd::{self, ComputeSvdVectors};
use faer::{Accum, Mat, MatRef, Par, Side, c64};
use num_complex::Complex64;
use rayon::prelude::*;

use super::correlation::{Correlation, Plan};
use crate::{Error, Result};

/// Above this a pole is no vibration mode.
const MAX_DAMPING: f64 = 0.3;

/// One pole of one order.
#[derive(Debug, Clone)]
pub(super) struct SubspacePole {
    pub frequency_hz: f64,
    pub damping_ratio: f64,
    pub frequency_std_hz: f64,
    pub damping_std: f64,
    /// By channel, scaled as the channels are.
    pub shape: Vec<Complex64>,
}

impl SubspacePole {
    /// Makes the shape that of the channels differentiated in time so often: a mode is e^{st}, so each time is a factor s.
    pub fn differentiate(&mut self, times: &[u8]) {
        let natural = TAU * self.frequency_hz;
        let damped = (1.0 - self.damping_ratio.powi(2)).max(0.0).sqrt();
        let s = natural * Complex64::new(-self.damping_ratio, damped);
        for (z, times) in self.shape.iter_mut().zip(times) {
            *z *= s.powu(u32::from(*times));
        }
    }
}

/// Poles of one order, ascending in frequency.
#[derive(Debug, Clone)]
pub(super) struct OrderPoles {
    pub order: usize,
    pub poles: Vec<SubspacePole>,
}

struct Decomposition {
    /// rows × rows.
    u: Mat<f64>,
    /// min(rows, columns), descending.
    s: Vec<f64>,
    /// By segment: Uᵀ ΔH V with ΔH the segment's departure from the mean, scaled to the mean's standard deviation.
    scatter: Vec<Scatter>,
}

/// M = Uᵀ ΔH V as far as the highest order needs it.
struct Scatter {
    /// Its first columns.
    columns: Mat<f64>,
    /// Its first rows, turned.
    rows: Mat<f64>,
}

/// # Errors
/// The singular value decomposition fails.
pub(super) fn orders(
    segments: &[Correlation],
    plan: &Plan,
    rate_hz: f64,
    band_hz: [f64; 2],
) -> Result<Vec<OrderPoles>> {
    let decomposition = decompose(segments, plan)?;
    Ok(plan
        .orders()
        .into_par_iter()
        .map(|order| OrderPoles {
            order,
            poles: poles(&decomposition, plan, order, rate_hz, band_hz).unwrap_or_default(),
        })
        .collect())
}

fn decompose(segments: &[Correlation], plan: &Plan) -> Result<Decomposition> {
    let count = segments.len() as f64;
    let mean = Correlation::combined(segments, |_| 1.0 / count);
    let hankel = plan.hankel(&mean);
    let (rows, columns) = (plan.rows(), plan.columns());
    let small = rows.min(columns);
    let (mut u, mut v) = (Mat::<f64>::zeros(rows, rows), Mat::<f64>::zeros(columns, columns));
    let mut s = Diag::<f64>::zeros(small);
    let full = ComputeSvdVectors::Full;
    // One thread: the result must not depend on how many there are.
    let mut memory = MemBuffer::new(svd::svd_scratch::<f64>(
        rows,
        columns,
        full,
        full,
        Par::Seq,
        Default::default(),
    ));
    svd::svd(
        hankel.as_ref(),
        s.as_mut(),
        Some(u.as_mut()),
        Some(v.as_mut()),
        Par::Seq,
        MemStack::new(&mut memory),
        Default::default(),
    )
    .map_err(|_| Error::computation("the singular values of the correlations were not found"))?;
    let right = v.as_ref().subcols(0, small);
    let to_mean = 1.0 / (count * (count - 1.0)).sqrt();
    let scatter = segments
        .par_iter()
        .map(|segment| {
            let departure = Correlation::combined(&[segment.clone(), mean.clone()], |k| match k {
                0 => to_mean,
                _ => -to_mean,
            });
            let mut along = Mat::<f64>::zeros(rows, small);
            let mut both = Mat::<f64>::zeros(rows, small);
            let replace = Accum::Replace;
            matmul(
                &mut along,
                replace,
                plan.hankel(&departure).as_ref(),
                right,
                1.0,
                Par::Seq,
            );
            matmul(
                &mut both,
                replace,
                u.as_ref().transpose(),
                along.as_ref(),
                1.0,
                Par::Seq,
            );
            let highest = plan.max_order;
            Scatter {
                columns: both.as_ref().subcols(0, highest).to_owned(),
                rows: both.as_ref().subrows(0, highest).transpose().to_owned(),
            }
        })
        .collect();
    Ok(Decomposition {
        s: (0..small).map(|k| s.column_vector()[k]).collect(),
        u,
        scatter,
    })
}

/// O = U_n is the observability matrix up to a basis; O_down = O_up A gives A, its eigenvalues the poles.
///
/// First order: with X = ΔU_n in the directions that O leaves out (within them only the basis turns),
/// Δλ = χ O_up⁺ (ΔO_down − λ ΔO_up) φ + χ (O_upᵀ O_up)⁻¹ ΔO_upᵀ (O_down − O_up A) φ for left and right eigenvectors with
/// χ φ = 1, and X_ab = (s_b M_ab + s_a M_ba) / (s_b² − s_a²) with M = Uᵀ ΔH V.
fn poles(
    of: &Decomposition,
    plan: &Plan,
    order: usize,
    rate_hz: f64,
    band_hz: [f64; 2],
) -> Option<Vec<SubspacePole>> {
    let (rows, channels) = (plan.rows(), plan.channels);
    let shifted = rows - channels;
    let signal = of.u.as_ref().subcols(0, order);
    let (up, down) = (signal.subrows(0, shifted), signal.subrows(channels, shifted));
    let normal = product(up.transpose(), up);
    let factor = normal.llt(Side::Lower).ok()?;
    let dynamics = factor.solve(product(up.transpose(), down));
    let left_over = down - product(up, dynamics.as_ref());
    let eigen = dynamics.eigen().ok()?;
    let (vectors, values) = (eigen.U(), eigen.S().column_vector());
    // Rows of the inverse are the left eigenvectors with χ φ = 1.
    let identity = Mat::<c64>::identity(order, order);
    let inverse = vectors.partial_piv_lu().solve(&identity);
    let noise = rows - order;
    let mut found: Vec<Found> = Vec::new();
    for k in 0..order {
        let lambda = values[k];
        let continuous = lambda.ln() * rate_hz;
        let size = continuous.norm();
        let (frequency_hz, damping_ratio) = (size / TAU, -continuous.re / size);
        let inside = frequency_hz >= band_hz[0] && frequency_hz <= band_hz[1];
        if !(continuous.im > 0.0 && damping_ratio > 0.0 && damping_ratio < MAX_DAMPING && inside) {
            continue;
        }
        let phi: Vec<Complex64> = (0..order).map(|i| vectors[(i, k)]).collect();
        // χ (OᵀO)⁻¹ by its real and imaginary part, then χ O_up⁺.
        let parts = Mat::from_fn(order, 2, |i, j| match j {
            0 => inverse[(k, i)].re,
            _ => inverse[(k, i)].im,
        });
        let solved = factor.solve(parts);
        let chi: Vec<Complex64> = (0..order)
            .map(|i| Complex64::new(solved[(i, 0)], solved[(i, 1)]))
            .collect();
        let row: Vec<Complex64> = (0..shifted).map(|i| dot_real(up, i, &chi)).collect();
        let rest: Vec<Complex64> = (0..shifted)
            .map(|i| dot_real(left_over.as_ref(), i, &phi))
            .collect();
        let pole = SubspacePole {
            frequency_hz,
            damping_ratio,
            frequency_std_hz: 0.0,
            damping_std: 0.0,
            shape: (0..channels).map(|i| dot_real(signal, i, &phi)).collect(),
        };
        // What a change of U along each direction left out does.
        let (along_down, along_rest) = (0..noise)
            .map(|a| {
                let column = of.u.as_ref().col(order + a);
                let mut sums = (Complex64::ZERO, Complex64::ZERO);
                for i in 0..shifted {
                    sums.0 += row[i] * (column[i + channels] - lambda * column[i]);
                    sums.1 += rest[i] * column[i];
                }
                sums
            })
            .unzip();
        found.push(Found {
            pole,
            continuous,
            // d(ln λ) rate = Δλ rate / λ.
            factor: rate_hz / lambda,
            phi,
            chi,
            along_down,
            along_rest,
        });
    }
    deviations(of, order, &mut found);
    let mut found: Vec<SubspacePole> = found.into_iter().map(|f| f.pole).collect();
    found.retain(|p| p.frequency_std_hz.is_finite() && p.damping_std.is_finite());
    found.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    Some(found)
}

/// A pole with what its sensitivity needs.
struct Found {
    pole: SubspacePole,
    /// ln λ times the sampling rate, 1/s.
    continuous: Complex64,
    factor: Complex64,
    phi: Vec<Complex64>,
    chi: Vec<Complex64>,
    along_down: Vec<Complex64>,
    along_rest: Vec<Complex64>,
}

/// Fills in the standard deviations.
fn deviations(of: &Decomposition, order: usize, found: &mut [Found]) {
    let noise = of.u.nrows() - order;
    // By pole: real and imaginary parts of both directions.
    let along = Mat::from_fn(noise, 4 * found.len(), |a, j| {
        let f = &found[j / 4];
        match j % 4 {
            0 => f.along_down[a].re,
            1 => f.along_down[a].im,
            2 => f.along_rest[a].re,
            _ => f.along_rest[a].im,
        }
    });
    let mut variance = vec![[0.0; 2]; found.len()];
    for scatter in &of.scatter {
        let turned = Mat::from_fn(noise, order, |a, b| {
            let (at, s_b) = (order + a, of.s[b]);
            match of.s.get(at) {
                Some(s_a) => {
                    (s_b * scatter.columns[(at, b)] + s_a * scatter.rows[(at, b)]) / (s_b * s_b - s_a * s_a)
                }
                None => scatter.columns[(at, b)] / s_b,
            }
        });
        let sums = product(turned.as_ref().transpose(), along.as_ref());
        for (k, (f, variance)) in found.iter().zip(&mut variance).enumerate() {
            let change: Complex64 = (0..order)
                .map(|b| {
                    let part = |j: usize| Complex64::new(sums[(b, 4 * k + j)], sums[(b, 4 * k + j + 1)]);
                    part(0) * f.phi[b] + part(2) * f.chi[b]
                })
                .sum();
            let change = change * f.factor;
            let size = f.continuous.norm();
            let size_change = (f.continuous.conj() * change).re / size;
            variance[0] += (size_change / TAU).powi(2);
            variance[1] += (-change.re / size + f.continuous.re * size_change / (size * size)).powi(2);
        }
    }
    for (f, [frequency, damping]) in found.iter_mut().zip(variance) {
        f.pole.frequency_std_hz = frequency.sqrt();
        f.pole.damping_std = damping.sqrt();
    }
}

fn product(a: MatRef<'_, f64>, b: MatRef<'_, f64>) -> Mat<f64> {
    let mut out = Mat::zeros(a.nrows(), b.ncols());
    matmul(&mut out, Accum::Replace, a, b, 1.0, Par::Seq);
    out
}

/// Row i of a real matrix times a complex vector.
fn dot_real(matrix: MatRef<'_, f64>, i: usize, vector: &[Complex64]) -> Complex64 {
    vector.iter().enumerate().map(|(j, v)| v * matrix[(i, j)]).sum()
}
