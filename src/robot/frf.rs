//! Natural frequencies, mode shapes and frequency response of a chain, with exact derivatives.
//!
//! The eigenproblem is M x = μ K x with K positive definite, μ = ω⁻²: massless coordinates (beam halves without a body)
//! give μ = 0 and stay in the basis as pure static compliance. With xᵀ K x = 1 the dynamic stiffness of a chain with
//! modal damping is diagonal, 1 + 2iζω√μ − ω²μ, and H = Σ (r_out·x)(r_in·x)/(…): the modal sum including all residual
//! compliance. Branches and viscous dampers couple the modes; then the small complex system is solved as it stands.

use faer::prelude::*;
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use super::chain::System;
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
const MASSLESS: f64 = 1e-13;

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

/// A system in its modal basis, ready to give receptances between chosen outputs at any frequency.
#[derive(Debug, Clone)]
pub struct FrfBasis {
    /// Coordinates that move with mass: vibrating modes of the chain, then branches.
    n: usize,
    /// Outputs in the basis, one column an output: n × outputs.
    rows: DMatrix<f64>,
    /// Static compliance of the massless combinations of coordinates between the outputs, m/N. They have neither
    /// inertia nor modal damping, so that leaving them out of the dynamics is exact.
    massless: Option<DMatrix<f64>>,
    dynamics: Dynamics,
    derivatives: Vec<BasisDerivative>,
}

#[derive(Debug, Clone)]
enum Dynamics {
    /// Uncoupled modes: μ and damping coefficient 2ζ√μ.
    Diagonal { mu: Vec<f64>, damping: Vec<f64> },
    /// Coupled: mass and damping in the basis (stiffness is the identity).
    Full {
        mass: DMatrix<f64>,
        damping: DMatrix<f64>,
    },
}

/// Derivative of stiffness, mass and damping in the basis.
#[derive(Debug, Clone)]
struct BasisDerivative {
    stiffness: DMatrix<f64>,
    mass: DMatrix<f64>,
    damping: DMatrix<f64>,
    massless: Option<MasslessDerivative>,
}

/// What the massless part adds to a derivative.
#[derive(Debug, Clone)]
struct MasslessDerivative {
    /// Coupling of each output's massless part with the moving coordinates, n × outputs.
    coupling: DMatrix<f64>,
    /// Between the outputs' massless parts, outputs × outputs.
    own: DMatrix<f64>,
}

/// Responses of all outputs at one frequency: Z⁻¹ rᵀ in the basis, n × outputs.
#[derive(Debug, Clone, Default)]
pub struct Response {
    omega: f64,
    columns: Vec<Complex64>,
    product: Vec<Complex64>,
}

impl FrfBasis {
    /// `outputs`: rows of displacement per coordinate (from [`super::Chain::output_row`]).
    pub fn new(system: &System, outputs: &[DVector<f64>]) -> Result<Self> {
        let n = system.stiffness.nrows();
        let chain = system.chain_count;
        let modes = ModalBasis::new(
            &system.stiffness.view((0, 0), (chain, chain)).into_owned(),
            &system.chain_mass,
        )?;
        // Modes come with the lowest frequency first, so the massless ones stand last. Dampers in the elements damp
        // them and branches load them with mass: then they stay.
        let branches = n - chain;
        let moving = if branches > 0 || system.viscous.is_some() {
            chain
        } else {
            modes.inverse_omega2.iter().filter(|mu| **mu > 0.0).count()
        };
        let total = n;
        let n = moving + branches;
        let mut basis = DMatrix::zeros(total, n);
        basis
            .view_mut((0, 0), (chain, moving))
            .copy_from(&modes.shapes.columns(0, moving));
        for i in 0..branches {
            let k = system.stiffness[(chain + i, chain + i)];
            if !(k > 0.0) {
                return Err(Error::computation("a branch has no stiffness"));
            }
            basis[(chain + i, moving + i)] = 1.0 / k.sqrt();
        }
        let mut still = DMatrix::zeros(total, chain - moving);
        still
            .view_mut((0, 0), (chain, chain - moving))
            .copy_from(&modes.shapes.columns(moving, chain - moving));
        let mut rows = DMatrix::zeros(n, outputs.len());
        let mut still_rows = DMatrix::zeros(chain - moving, outputs.len());
        for (j, output) in outputs.iter().enumerate() {
            rows.set_column(j, &(basis.transpose() * output));
            still_rows.set_column(j, &(still.transpose() * output));
        }
        let massless = (moving < chain).then(|| still_rows.transpose() * &still_rows);

        let zeta = system.modal_damping_ratio.value;
        let root: Vec<f64> = modes.inverse_omega2[..moving]
            .iter()
            .map(|mu| mu.sqrt())
            .collect();
        let dynamics = if branches == 0 && system.viscous.is_none() {
            Dynamics::Diagonal {
                mu: modes.inverse_omega2[..moving].to_vec(),
                damping: root.iter().map(|s| 2.0 * zeta * s).collect(),
            }
        } else {
            let mass = basis.transpose() * &system.mass * &basis;
            let mut damping = match &system.viscous {
                Some(viscous) => basis.transpose() * viscous * &basis,
                None => DMatrix::zeros(n, n),
            };
            for (i, s) in root.iter().enumerate() {
                damping[(i, i)] += 2.0 * zeta * s;
            }
            Dynamics::Full { mass, damping }
        };

        let project = |matrix: &Option<DMatrix<f64>>| match matrix {
            Some(matrix) => basis.transpose() * matrix * &basis,
            None => DMatrix::zeros(n, n),
        };
        let derivatives = system
            .derivatives
            .iter()
            .enumerate()
            .map(|(p, derivative)| {
                let stiffness = project(&derivative.stiffness);
                let mass = project(&derivative.mass);
                let mut damping = project(&derivative.viscous);
                let zeta_slope = system.modal_damping_ratio.derivative(p);
                let moving_shapes = modes.shapes.columns(0, moving);
                let chain_mass = derivative
                    .chain_mass
                    .as_ref()
                    .map(|m| moving_shapes.transpose() * m * moving_shapes);
                for i in 0..moving {
                    damping[(i, i)] += 2.0 * root[i] * zeta_slope;
                    for j in 0..moving {
                        // Modal damping is C K⁻¹ C = 4ζ² M; its differential in the basis gives this closed form.
                        let sum = root[i] + root[j];
                        if sum > 0.0 {
                            let dm = chain_mass.as_ref().map_or(0.0, |m| m[(i, j)]);
                            damping[(i, j)] +=
                                2.0 * zeta * (dm + root[i] * root[j] * stiffness[(i, j)]) / sum;
                        }
                    }
                }
                let massless = derivative
                    .stiffness
                    .as_ref()
                    .filter(|_| moving < chain)
                    .map(|dk| {
                        let reach = dk * &still * &still_rows;
                        MasslessDerivative {
                            coupling: basis.transpose() * &reach,
                            own: still_rows.transpose() * still.transpose() * &reach,
                        }
                    });
                BasisDerivative {
                    stiffness,
                    mass,
                    damping,
                    massless,
                }
            })
            .collect();
        Ok(FrfBasis {
            n,
            rows,
            massless,
            dynamics,
            derivatives,
        })
    }

    pub fn output_count(&self) -> usize {
        self.rows.ncols()
    }

    /// Solves for all outputs at `omega` (rad/s). Fails only where an undamped system is hit at resonance.
    pub fn solve(&self, omega: f64, response: &mut Response) -> Result<()> {
        let n = self.n;
        response.omega = omega;
        response.columns.clear();
        match &self.dynamics {
            Dynamics::Diagonal { mu, damping } => {
                for column in self.rows.column_iter() {
                    for i in 0..n {
                        let z = Complex64::new(1.0 - omega * omega * mu[i], omega * damping[i]);
                        response.columns.push(column[i] / z);
                    }
                }
            }
            Dynamics::Full { mass, damping } => {
                let z = Mat::from_fn(n, n, |i, j| {
                    let k = if i == j { 1.0 } else { 0.0 };
                    Complex64::new(k - omega * omega * mass[(i, j)], omega * damping[(i, j)])
                });
                let right = Mat::from_fn(n, self.rows.ncols(), |i, j| {
                    Complex64::new(self.rows[(i, j)], 0.0)
                });
                let solution = z.partial_piv_lu().solve(&right);
                for j in 0..self.rows.ncols() {
                    response.columns.extend((0..n).map(|i| solution[(i, j)]));
                }
            }
        }
        if response.columns.iter().any(|v| !v.is_finite()) {
            return Err(Error::computation(format!(
                "the model has no finite response at {:.3} Hz: it is undamped at a resonance",
                omega / std::f64::consts::TAU
            )));
        }
        Ok(())
    }

    /// Receptance of output `out` per force along output `input`, m/N, at the frequency last solved.
    pub fn receptance(&self, response: &Response, out: usize, input: usize) -> Complex64 {
        let column = &response.columns[input * self.n..(input + 1) * self.n];
        let moving: Complex64 = self
            .rows
            .column(out)
            .iter()
            .zip(column)
            .map(|(r, u)| u * *r)
            .sum();
        moving + self.massless.as_ref().map_or(0.0, |m| m[(out, input)])
    }

    /// dH/dp = −u_outᵀ (dZ/dp) u_in for parameter `parameter` and every output, into `slopes` (length: outputs),
    /// for a force along output `input`.
    pub fn sensitivities(
        &self,
        response: &mut Response,
        parameter: usize,
        input: usize,
        slopes: &mut [Complex64],
    ) {
        let n = self.n;
        let omega = response.omega;
        let derivative = &self.derivatives[parameter];
        response.product.clear();
        response.product.resize(n, Complex64::ZERO);
        let u_in = &response.columns[input * n..(input + 1) * n];
        for j in 0..n {
            let u = u_in[j];
            let (k, m, c) = (
                derivative.stiffness.column(j),
                derivative.mass.column(j),
                derivative.damping.column(j),
            );
            for i in 0..n {
                response.product[i] += Complex64::new(k[i] - omega * omega * m[i], omega * c[i]) * u;
            }
        }
        if let Some(massless) = &derivative.massless {
            for (p, c) in response
                .product
                .iter_mut()
                .zip(massless.coupling.column(input).iter())
            {
                *p += *c;
            }
        }
        for (out, slope) in slopes.iter_mut().enumerate() {
            let u_out = &response.columns[out * n..(out + 1) * n];
            let moving: Complex64 = u_out.iter().zip(&response.product).map(|(a, b)| a * b).sum();
            *slope = -moving;
            if let Some(massless) = &derivative.massless {
                let coupled: Complex64 = u_in
                    .iter()
                    .zip(massless.coupling.column(out).iter())
                    .map(|(u, c)| u * *c)
                    .sum();
                *slope -= coupled + massless.own[(out, input)];
            }
        }
    }

    /// Receptance at `omega` in one call, m/N.
    pub fn receptance_at(&self, omega: f64, out: usize, input: usize) -> Result<Complex64> {
        let mut response = Response::default();
        self.solve(omega, &mut response)?;
        Ok(self.receptance(&response, out, input))
    }
}
