//! Natural frequencies and mode shapes of a chain, static compliance of massless coordinates included.

use faer::Mat;
use nalgebra::DMatrix;

use crate::robot::chain::System;
use crate::{Error, Result};

/// Modes of the chain without its branches: K-normalised shapes.
#[derive(Debug, Clone)]
pub struct ModalBasis {
    /// Columns are modes in element coordinates, xᵀ K x = 1, lowest frequency first.
    pub shapes: DMatrix<f64>,
    /// μ = ω⁻², s²; zero for massless combinations of coordinates. Descending.
    pub inverse_omega2: Vec<f64>,
}

/// Below this share of the largest μ a mode is a massless combination of coordinates, not a vibration.
const MASSLESS: f64 = 1.0e-13;

impl ModalBasis {
    /// `stiffness` must be positive definite, `mass` positive semidefinite, both symmetric and of one size.
    pub fn new(stiffness: &DMatrix<f64>, mass: &DMatrix<f64>) -> Result<Self> {
        let n = stiffness.nrows();
        let cholesky = stiffness.clone().cholesky().ok_or_else(|| {
            Error::computation(
                "the stiffness matrix is not positive definite: a stiffness is zero, negative or not finite",
            )
        })?;
        let lower = cholesky.l();
        // L⁻¹ M L⁻ᵀ
        let half = lower
            .solve_lower_triangular(mass)
            .and_then(|h| lower.solve_lower_triangular(&h.transpose()))
            .ok_or_else(|| Error::computation("the stiffness matrix is singular"))?;
        if half.iter().any(|v| !v.is_finite()) {
            return Err(Error::computation("the mass matrix is not finite"));
        }
        let reduced = Mat::from_fn(n, n, |i, j| 0.5 * (half[(i, j)] + half[(j, i)]));
        crate::sums_in_order();
        let eigen = reduced.self_adjoint_eigen(faer::Side::Lower).map_err(|_| {
            Error::computation("the eigenvalue iteration of the structural model did not converge")
        })?;
        let (u, s) = (eigen.U(), eigen.S().column_vector());
        // faer sorts ascending in μ; the lowest frequency is the largest μ.
        let vectors = DMatrix::from_fn(n, n, |i, j| u[(i, n - 1 - j)]);
        let largest = if n > 0 { s[n - 1].max(0.0) } else { 0.0 };
        let inverse_omega2 = (0..n)
            .map(|j| {
                let mu = s[n - 1 - j];
                if mu > MASSLESS * largest { mu } else { 0.0 }
            })
            .collect();
        let shapes = lower
            .transpose()
            .solve_upper_triangular(&vectors)
            .ok_or_else(|| Error::computation("the stiffness matrix is singular"))?;
        Ok(ModalBasis {
            shapes,
            inverse_omega2,
        })
    }

    /// Undamped natural frequencies, Hz, ascending; massless coordinates left out.
    pub fn natural_frequencies_hz(&self) -> Vec<f64> {
        self.inverse_omega2
            .iter()
            .filter(|mu| **mu > 0.0)
            .map(|mu| 1.0 / (std::f64::consts::TAU * mu.sqrt()))
            .collect()
    }
}

/// Undamped natural frequencies of the whole system, branches included, Hz, ascending.
pub fn natural_frequencies_hz(system: &System) -> Result<Vec<f64>> {
    Ok(ModalBasis::new(&system.stiffness, &system.mass)?.natural_frequencies_hz())
}
