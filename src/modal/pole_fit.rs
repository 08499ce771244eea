//! What is linear in an FRF once its poles are known: modal constants and residual terms.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

/// Columns for what lies outside the lines: the mass of modes below them, the stiffness of modes above.
const RESIDUAL_TERMS: usize = 2;

/// Constants and curve of one FRF.
pub struct PoleFit {
    /// By pole: constant, 1/kg, and the standard deviation of its real and imaginary part, from what the fit leaves.
    pub constants: Vec<(Complex64, f64)>,
    /// On each line, m/N.
    pub fitted_m_per_n: Vec<Complex64>,
}

impl PoleFit {
    /// Least squares of an FRF's receptance in the modal constants of given poles and two residual terms (Ewins 2000, Modal Testing,
    /// eq. 4.52). `poles`: frequency, Hz, and damping ratio. `weights`: by line, 1/σ or what else the lines shall count by.
    ///
    /// # Errors
    /// Fewer lines than unknowns, or poles that cannot be told apart.
    pub fn of(
        frequency_hz: &[f64],
        receptance_m_per_n: &[Complex64],
        weights: &[f64],
        poles: &[(f64, f64)],
    ) -> Result<Self, String> {
        let (lines, unknowns) = (frequency_hz.len(), poles.len() + RESIDUAL_TERMS);
        if lines <= unknowns {
            return Err(format!("{lines} lines are too few for {} poles", poles.len()));
        }
        let term = |k: usize, column: usize| {
            let w = TAU * frequency_hz[k];
            match poles.get(column) {
                Some((f, zeta)) => {
                    let w0 = TAU * f;
                    1.0 / Complex64::new(w0 * w0 - w * w, 2.0 * zeta * w0 * w)
                }
                // A line at 0 Hz knows nothing of masses.
                None if column == poles.len() && w > 0.0 => Complex64::from(-1.0 / (w * w)),
                None if column == poles.len() => Complex64::ZERO,
                None => Complex64::ONE,
            }
        };
        let matrix = DMatrix::from_fn(lines, unknowns, |k, j| term(k, j) * weights[k]);
        let scale: Vec<f64> = matrix
            .column_iter()
            .map(|c| c.norm().max(f64::MIN_POSITIVE))
            .collect();
        let scaled = DMatrix::from_fn(lines, unknowns, |k, j| matrix[(k, j)] / scale[j]);
        let right = DVector::from_fn(lines, |k, _| receptance_m_per_n[k] * weights[k]);
        // A trace on the diagonal keeps two poles at one place from breaking it.
        let normal =
            scaled.adjoint() * &scaled + DMatrix::identity(unknowns, unknowns) * Complex64::from(1e-12);
        let inverse = normal
            .cholesky()
            .map(|c| c.inverse())
            .ok_or("the poles cannot be told apart")?;
        let solution = &inverse * scaled.adjoint() * &right;
        let model = &scaled * &solution;
        let variance = (&right - &model).norm_squared() / (lines - unknowns) as f64;
        let constants = (0..poles.len())
            .map(|j| {
                let std = (0.5 * variance * inverse[(j, j)].re.max(0.0)).sqrt() / scale[j];
                (solution[j] / scale[j], std)
            })
            .collect();
        let fitted_m_per_n = (0..lines).map(|k| model[k] / weights[k]).collect();
        Ok(PoleFit {
            constants,
            fitted_m_per_n,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_between_and_beyond_the_lines_are_found_again() {
        let frequency_hz: Vec<f64> = (0..300).map(|k| 10.0 + 0.1 * f64::from(k)).collect();
        let mode = |f0: f64, zeta: f64, constant: f64, f: f64| {
            let (w0, w) = (TAU * f0, TAU * f);
            constant / Complex64::new(w0 * w0 - w * w, 2.0 * zeta * w0 * w)
        };
        // Two within the lines, one far below and one far above them.
        let truth = |f: &f64| {
            mode(18.0, 0.02, 0.5, *f)
                + mode(27.0, 0.03, -0.2, *f)
                + mode(0.2, 0.05, 0.1, *f)
                + mode(900.0, 0.01, 40.0, *f)
        };
        let receptance: Vec<Complex64> = frequency_hz.iter().map(truth).collect();
        let weights: Vec<f64> = receptance.iter().map(|h| 1.0 / h.norm()).collect();
        let fit = PoleFit::of(
            &frequency_hz,
            &receptance,
            &weights,
            &[(18.0, 0.02), (27.0, 0.03)],
        )
        .unwrap();
        assert!((fit.constants[0].0 - 0.5).norm() < 1e-3);
        assert!((fit.constants[1].0 + 0.2).norm() < 1e-3);
        for (fitted, truth) in fit.fitted_m_per_n.iter().zip(&receptance) {
            assert!((fitted / truth - 1.0).norm() < 1e-2);
        }
    }

    #[test]
    fn too_few_lines_are_refused() {
        let lines = [1.0, 2.0, 3.0];
        let h = [Complex64::ONE; 3];
        assert!(PoleFit::of(&lines, &h, &[1.0; 3], &[(2.0, 0.01)]).is_err());
    }

    /// Constants under noise scatter by what is stated of their real and their imaginary part.
    #[test]
    fn stated_errors_are_the_scatter_under_noise() {
        use crate::modal::synthetic::{Synthetic, SyntheticMode};
        let modes = [
            SyntheticMode::new(18.0, 0.02, 0.5),
            SyntheticMode::new(19.5, 0.03, -0.2),
        ];
        let fits: Vec<(Complex64, f64)> = (0..200)
            .map(|seed| {
                let (f, h) = Synthetic::new(14.0, 24.0, 0.1, &modes)
                    .with_noise(0.05, 0.0, seed)
                    .frf();
                let weights = vec![1e3; f.len()];
                PoleFit::of(&f, &h, &weights, &[(18.0, 0.02), (19.5, 0.03)])
                    .unwrap()
                    .constants[1]
            })
            .collect();
        let square = fits.iter().map(|(c, _)| (c + 0.2).norm_sqr()).sum::<f64>() / 200.0;
        let stated = (fits.iter().map(|f| f.1 * f.1).sum::<f64>() / 200.0).sqrt();
        let ratio = stated / (0.5 * square).sqrt();
        assert!((0.85..1.18).contains(&ratio), "{ratio}");
    }
}
