//! Poles by polyreference least squares in the frequency domain (pLSCF): Peeters, Van der Auweraer, Guillaume &
//! Leuridan 2004, "The PolyMAX frequency-domain method".
//!
//! Every row of FRFs (one response, all references) is a right matrix fraction `H_o(f) = B_o(z) A(z)⁻¹` with
//! `z = exp(iϑ(f))`; the denominator A is shared by all rows, the numerators are eliminated row by row, so the
//! normal equations stay as small as the denominator. With one reference this is the common-denominator LSCF.
//!
//! The lowest coefficient is fixed, `A₀ = I`: poles that only follow noise then come out unstable and are told
//! from physical ones by their sign (Cauberghe et al. 2005). Coefficients are complex and ϑ runs over most of the
//! circle, so a band that does not begin at 0 Hz is as well conditioned as one that does.

use std::f64::consts::TAU;

use nalgebra::DMatrix;
use num_complex::Complex64;
use rayon::prelude::*;

use crate::modal::single::local_fit::Pole;

/// Part of the unit circle that the band covers; the gap keeps the two ends of the band apart.
const ARC: f64 = 0.9;

/// FRFs of one response at all references.
pub(crate) struct Row<'a> {
    /// Ascending, Hz.
    pub frequency_hz: &'a [f64],
    /// By reference.
    pub receptance: Vec<&'a [Complex64]>,
    /// 1/σ of each line, common to the references.
    pub weight: Vec<f64>,
}

/// Poles found with one order of the denominator.
pub(crate) struct Order {
    pub order: usize,
    /// Stable, inside the band, ascending in frequency.
    pub poles: Vec<Pole>,
}

/// Poles for every order of the denominator from 1 to `max_order`. `band_hz`: lowest and highest line of all rows.
/// Empty where the rows do not determine a denominator (all zero, too few lines).
pub(crate) fn poles(rows: &[Row], band_hz: [f64; 2], max_order: usize) -> Vec<Order> {
    let references = rows.first().map_or(0, |r| r.receptance.len());
    let span = band_hz[1] - band_hz[0];
    if references == 0 || !(span > 0.0) {
        return Vec::new();
    }
    let size = (max_order + 1) * references;
    let of_rows: Vec<Option<DMatrix<Complex64>>> = rows
        .par_iter()
        .map(|row| normal_of_row(row, band_hz, max_order))
        .collect();
    // In order, so that rounding does not depend on the threads.
    let mut normal = DMatrix::<Complex64>::zeros(size, size);
    for of_row in of_rows.into_iter().flatten() {
        normal += of_row;
    }
    (1..=max_order)
        .into_par_iter()
        .filter_map(|order| {
            let poles = poles_of_order(&normal, references, order, band_hz)?;
            Some(Order { order, poles })
        })
        .collect()
}

/// T − Sᴴ R⁻¹ S of one row. All three matrices are (block) Toeplitz: their entries depend on b − a only. `None` where
/// the row holds nothing.
fn normal_of_row(row: &Row, band_hz: [f64; 2], order: usize) -> Option<DMatrix<Complex64>> {
    let references = row.receptance.len();
    let terms = order + 1;
    let lags = 2 * order + 1;
    let zero = Complex64::ZERO;
    let mut r = vec![zero; terms];
    let mut s = vec![vec![zero; lags]; references];
    let mut t = vec![vec![zero; lags]; references * references];
    let mut powers = vec![zero; lags];
    let add = |sums: &mut [Complex64], powers: &[Complex64], factor: Complex64| {
        sums.iter_mut()
            .zip(powers)
            .for_each(|(sum, power)| *sum += power * factor);
    };
    for (k, &f) in row.frequency_hz.iter().enumerate() {
        let z = Complex64::from_polar(1.0, angle(f, band_hz));
        let mut power = z.powi(-(order as i32)) * row.weight[k].powi(2);
        for out in &mut powers {
            *out = power;
            power *= z;
        }
        add(&mut r, &powers[order..], Complex64::ONE);
        for i in 0..references {
            let h = row.receptance[i][k];
            add(&mut s[i], &powers, h);
            for j in i..references {
                add(
                    &mut t[i * references + j],
                    &powers,
                    h.conj() * row.receptance[j][k],
                );
            }
        }
    }
    for i in 0..references {
        for j in 0..i {
            t[i * references + j] = t[j * references + i].iter().rev().map(|v| v.conj()).collect();
        }
    }
    let trace = r[0].re;
    if !(trace > 0.0 && trace.is_finite()) {
        return None;
    }
    let gram = DMatrix::from_fn(terms, terms, |a, b| {
        let value = if b >= a { r[b - a] } else { r[a - b].conj() };
        // A trace of a ridge: rounding must not make it indefinite.
        if a == b { value + 1e-13 * trace } else { value }
    });
    let cross = DMatrix::from_fn(terms, terms * references, |a, column| {
        let (b, i) = (column / references, column % references);
        -s[i][b + order - a]
    });
    let half = gram.cholesky()?.l().solve_lower_triangular(&cross)?;
    // By power: a row of large weights must not silence the others.
    let power: f64 = (0..references).map(|i| t[i * references + i][order].re).sum();
    if !(power > 0.0 && power.is_finite()) {
        return None;
    }
    let scale = Complex64::new((row.frequency_hz.len() * references) as f64 / power, 0.0);
    let eliminated = half.ad_mul(&half);
    Some(DMatrix::from_fn(
        terms * references,
        terms * references,
        |row, column| {
            let (a, i) = (row / references, row % references);
            let (b, j) = (column / references, column % references);
            (t[i * references + j][b + order - a] - eliminated[(row, column)]) * scale
        },
    ))
}

fn angle(frequency_hz: f64, band_hz: [f64; 2]) -> f64 {
    TAU * ARC * (frequency_hz - band_hz[0]) / (band_hz[1] - band_hz[0])
}

fn poles_of_order(
    normal: &DMatrix<Complex64>,
    references: usize,
    order: usize,
    band_hz: [f64; 2],
) -> Option<Vec<Pole>> {
    let size = order * references;
    let inner = normal.view((references, references), (size, size)).into_owned();
    let right = -normal.view((references, 0), (size, references)).into_owned();
    let coefficients = inner.lu().solve(&right)?;
    if coefficients
        .iter()
        .any(|c| !c.re.is_finite() || !c.im.is_finite())
    {
        return None;
    }
    // With w = 1/z the polynomial is monic: wⁿ + A₁ wⁿ⁻¹ + … + Aₙ.
    let mut companion = faer::Mat::<faer::c64>::zeros(size, size);
    for block in 0..order {
        for i in 0..references {
            for j in 0..references {
                companion[(i, block * references + j)] = -coefficients[(block * references + i, j)];
            }
        }
    }
    for k in references..size {
        companion[(k, k - references)] = Complex64::ONE;
    }
    let eigenvalues = companion.eigenvalues().ok()?;
    let span = band_hz[1] - band_hz[0];
    let mut poles: Vec<Pole> = eigenvalues
        .into_iter()
        .filter_map(|w| {
            let z = w.inv();
            // |z| < 1 decays.
            if !(z.norm() < 1.0 && z.norm() > 0.0) {
                return None;
            }
            let turn = z.arg().rem_euclid(TAU);
            // The gap of the circle is split between the two ends of the band.
            let turn = if turn > TAU * 0.5 * (1.0 + ARC) {
                turn - TAU
            } else {
                turn
            };
            let per_radian = span / (TAU * ARC);
            let damped_hz = band_hz[0] + turn * per_radian;
            let decay_hz = -z.norm().ln() * per_radian;
            let frequency_hz = damped_hz.hypot(decay_hz);
            let inside = damped_hz > 0.0 && frequency_hz >= band_hz[0] && frequency_hz <= band_hz[1];
            inside.then_some(Pole {
                frequency_hz,
                damping_ratio: decay_hz / frequency_hz,
            })
        })
        .collect();
    poles.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    Some(poles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::synthetic::{Synthetic, SyntheticMode};

    #[test]
    fn exact_data_give_the_poles_at_a_sufficient_order() {
        let modes = [
            SyntheticMode::new(8.0, 0.03, 0.01),
            SyntheticMode::new(8.3, 0.03, -0.02),
            SyntheticMode::new(30.0, 0.02, 0.03),
        ];
        let (f, h) = Synthetic::new(3.0, 60.0, 0.25, &modes).frf();
        let row = Row {
            frequency_hz: &f,
            receptance: vec![&h],
            weight: h.iter().map(|h| 1.0 / h.norm()).collect(),
        };
        let orders = poles(&[row], [3.0, 60.0], 14);
        let last = &orders.last().unwrap().poles;
        for mode in &modes {
            let found = last.iter().any(|p| {
                (p.frequency_hz / mode.frequency_hz - 1.0).abs() < 1e-3
                    && (p.damping_ratio / mode.damping_ratio - 1.0).abs() < 0.05
            });
            assert!(found, "{} Hz in {last:?}", mode.frequency_hz);
        }
    }

    #[test]
    fn zeros_and_single_lines_give_nothing() {
        let zeros = [Complex64::ZERO; 50];
        let f: Vec<f64> = (0..50).map(f64::from).collect();
        let row = |n: usize| Row {
            frequency_hz: &f[..n],
            receptance: vec![&zeros[..n]],
            weight: vec![1.0; n],
        };
        for n in [1, 50] {
            let orders = poles(&[row(n)], [f[0], f[n - 1]], 6);
            assert!(orders.iter().all(|o| o.poles.is_empty()));
        }
    }

    /// Two responses to hits at two points, one of them hit harder: the poles of three modes, of which two nearly coincide, with one
    /// denominator for both references.
    #[test]
    fn two_references_share_their_poles() {
        let shared = [(8.0, 0.03), (8.3, 0.03), (30.0, 0.02)];
        let shapes = [[1.0, 0.5], [0.6, -1.0], [0.8, 0.9]];
        let frf = |response: usize, reference: usize| {
            let gain = [1.0, 3.0][reference];
            let constants = shapes.map(|s| 0.01 * gain * s[response] * s[reference]);
            Synthetic::new(3.0, 60.0, 0.25, &SyntheticMode::row(&shared, &constants)).frf()
        };
        let curves = [0, 1].map(|response| [0, 1].map(|reference| frf(response, reference)));
        let rows: Vec<Row> = curves
            .iter()
            .map(|[one, two]| Row {
                frequency_hz: &one.0,
                receptance: vec![&one.1, &two.1],
                weight: one
                    .1
                    .iter()
                    .zip(&two.1)
                    .map(|(a, b)| 1.0 / a.norm().hypot(b.norm()))
                    .collect(),
            })
            .collect();
        let orders = poles(&rows, [3.0, 60.0], 8);
        let last = &orders.last().unwrap().poles;
        for (frequency_hz, damping_ratio) in shared {
            let found = last.iter().any(|p| {
                (p.frequency_hz / frequency_hz - 1.0).abs() < 1e-3
                    && (p.damping_ratio / damping_ratio - 1.0).abs() < 0.05
            });
            assert!(found, "{frequency_hz} Hz in {last:?}");
        }
    }
}
