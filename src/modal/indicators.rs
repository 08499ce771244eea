//! Mode indicator functions: where a set of FRFs has modes, and how many at once, without any fit.

use nalgebra::DMatrix;
use num_complex::Complex64;
use rayon::prelude::*;

/// FRFs on common lines as a matrix a line.
#[derive(Debug, Clone)]
pub struct FrfMatrix<'a> {
    /// Lines that all FRFs share, ascending, Hz.
    pub frequency_hz: &'a [f64],
    /// By response, then reference; every one on all lines (m/N).
    pub receptance_m_per_n: Vec<Vec<&'a [Complex64]>>,
}

impl FrfMatrix<'_> {
    fn size(&self) -> (usize, usize) {
        let references = self.receptance_m_per_n.first().map_or(0, Vec::len);
        (self.receptance_m_per_n.len(), references)
    }

    /// Singular values of the mobility at every line, largest first (complex mode indicator function, Shih et al. 1988):
    /// by reference, then line, m/(N·s). A peak of the second at a peak of the first is a second mode.
    pub fn cmif(&self) -> Vec<Vec<f64>> {
        let (responses, references) = self.size();
        let count = responses.min(references);
        let by_line: Vec<Vec<f64>> = (0..self.frequency_hz.len())
            .into_par_iter()
            .map(|k| {
                let omega = std::f64::consts::TAU * self.frequency_hz[k];
                let matrix = DMatrix::from_fn(responses, references, |i, j| {
                    self.receptance_m_per_n[i][j][k] * omega
                });
                if matrix.iter().any(|z| !(z.re.is_finite() && z.im.is_finite())) {
                    return vec![f64::NAN; count];
                }
                // The smaller of the two Gram matrices has the squares as eigenvalues.
                let gram = match references <= responses {
                    true => matrix.adjoint() * &matrix,
                    false => &matrix * matrix.adjoint(),
                };
                let mut squares: Vec<f64> = gram.symmetric_eigenvalues().iter().copied().collect();
                squares.sort_by(|a, b| b.total_cmp(a));
                squares.iter().map(|s| s.max(0.0).sqrt()).collect()
            })
            .collect();
        turned(&by_line, count)
    }

    /// Multivariate mode indicator function (Williams, Crowley & Vold 1985): smallest share of the response in phase with
    /// the forces, over all force patterns; by reference, then line, smallest first. Falls towards 0 at normal modes, and
    /// as many of the functions fall as there are modes at once.
    pub fn mmif(&self) -> Vec<Vec<f64>> {
        let (responses, references) = self.size();
        let by_line: Vec<Vec<f64>> = (0..self.frequency_hz.len())
            .into_par_iter()
            .map(|k| {
                let part = |of: fn(&Complex64) -> f64| {
                    DMatrix::from_fn(
                        responses,
                        references,
                        |i, j| of(&self.receptance_m_per_n[i][j][k]),
                    )
                };
                let (re, im) = (part(|z| z.re), part(|z| z.im));
                let in_phase = re.transpose() * &re;
                let whole = &in_phase + im.transpose() * &im;
                let nothing = || vec![f64::NAN; references];
                if whole.iter().any(|x| !x.is_finite()) || !(whole.trace() > 0.0) {
                    return nothing();
                }
                // A force that moves nothing says nothing: a trace of the whole keeps the matrix regular.
                let floor = 1e-12 * whole.trace();
                let regular = &whole + DMatrix::identity(references, references) * floor;
                let Some(cholesky) = regular.cholesky() else {
                    return nothing();
                };
                let lower = cholesky.l();
                let Some(half) = lower.solve_lower_triangular(&in_phase) else {
                    return nothing();
                };
                let Some(both) = lower.solve_lower_triangular(&half.transpose()) else {
                    return nothing();
                };
                let even = 0.5 * (&both + both.transpose());
                let mut values: Vec<f64> = even.symmetric_eigenvalues().iter().copied().collect();
                values.sort_by(f64::total_cmp);
                values.iter().map(|v| v.clamp(0.0, 1.0)).collect()
            })
            .collect();
        turned(&by_line, references)
    }
}

fn turned(by_line: &[Vec<f64>], count: usize) -> Vec<Vec<f64>> {
    (0..count)
        .map(|j| {
            by_line
                .iter()
                .map(|line| line.get(j).copied().unwrap_or(f64::NAN))
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// Three responses, two references, two modes at 10 and 10.05 Hz and one at 20 Hz.
    fn matrix() -> (Vec<f64>, Vec<Vec<Vec<Complex64>>>) {
        let modes = [
            (10.0, [1.0, 0.5, -0.3]),
            (10.05, [0.2, -1.0, 0.6]),
            (20.0, [0.5, 0.5, 1.0]),
        ];
        let lines: Vec<f64> = (0..1200).map(|k| 5.0 + 0.0175 * f64::from(k)).collect();
        let h = (0..3)
            .map(|i| {
                (0..2)
                    .map(|j| {
                        let at = |f: &f64| -> Complex64 {
                            let w = TAU * f;
                            let of = |(f0, shape): &(f64, [f64; 3])| {
                                let w0 = TAU * f0;
                                shape[i] * shape[j] / Complex64::new(w0 * w0 - w * w, 0.01 * w * w0)
                            };
                            modes.iter().map(of).sum()
                        };
                        lines.iter().map(at).collect()
                    })
                    .collect()
            })
            .collect();
        (lines, h)
    }

    #[test]
    fn two_modes_at_once_show_in_the_second_function_and_one_does_not() {
        let (lines, h) = matrix();
        let frfs = FrfMatrix {
            frequency_hz: &lines,
            receptance_m_per_n: h.iter().map(|r| r.iter().map(Vec::as_slice).collect()).collect(),
        };
        let near = |f: f64| lines.iter().position(|x| (x - f).abs() < 0.01).unwrap();
        let (cmif, mmif) = (frfs.cmif(), frfs.mmif());
        assert_eq!((cmif.len(), mmif.len()), (2, 2));
        let (pair, single) = (near(10.02), near(20.0));
        assert!(
            cmif[1][pair] > 0.2 * cmif[0][pair],
            "{} {}",
            cmif[0][pair],
            cmif[1][pair]
        );
        assert!(cmif[1][single] < 0.05 * cmif[0][single]);
        assert!(
            mmif[0][single] < 0.05 && mmif[1][single] > 0.5,
            "{} {}",
            mmif[0][single],
            mmif[1][single]
        );
        // Half a half-width off either mode: a fifth of each is in phase, a little more of both together.
        assert!(
            mmif[0][pair] < 0.2 && mmif[1][pair] < 0.5,
            "{} {}",
            mmif[0][pair],
            mmif[1][pair]
        );
        // The sum of squares is that of the whole matrix.
        let all: f64 = h
            .iter()
            .flatten()
            .map(|c| (TAU * lines[pair] * c[pair].norm()).powi(2))
            .sum();
        let squares = cmif[0][pair].powi(2) + cmif[1][pair].powi(2);
        approx::assert_relative_eq!(all, squares, max_relative = 1e-9);
    }
}
