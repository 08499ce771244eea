//! Natural frequencies, mode shapes and frequency response of a chain, with exact derivatives.
//!
//! The eigenproblem is M x = μ K x with K positive definite, μ = ω⁻²: massless coordinates (beam halves without a body)
//! give μ = 0 and stay in the basis as pure static compliance. With xᵀ K x = 1 the dynamic stiffness of a chain with
//! modal damping is diagonal, 1 + 2iζω√μ − ω²μ, and H = Σ (r_out·x)(r_in·x)/(…): the modal sum including all residual
//! compliance. Branches and viscous dampers couple the modes; then the small complex system is solved as it stands.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;

use super::chain::System;
pub use super::modal_basis::{ModalBasis, natural_frequencies_hz};
use super::small_systems::{LANES, Lanes, solve_in_place, solve_side_by_side};
use crate::{Error, Result};

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
    derivatives: Derivatives,
}

#[derive(Debug, Clone)]
enum Dynamics {
    /// Uncoupled modes: μ and damping coefficient 2ζ√μ.
    Diagonal { mu: Vec<f64>, damping: Vec<f64> },
    /// Coupled: mass and damping in the basis; the stiffness is the identity plus i times what is hysteretic.
    Full {
        mass: DMatrix<f64>,
        damping: DMatrix<f64>,
        hysteretic: DMatrix<f64>,
    },
}

/// Derivatives of the basis' matrices, stacked so that one product serves all parameters: entry (i, j) of parameter p's
/// matrix stands at i + n (p + parameters · j).
#[derive(Debug, Clone)]
struct Derivatives {
    count: usize,
    stiffness: Vec<f64>,
    /// Empty where no parameter changes the mass.
    mass: Vec<f64>,
    damping: Vec<f64>,
    /// Empty where no parameter changes what is hysteretic.
    hysteretic: Vec<f64>,
    massless: Option<MasslessDerivatives>,
    /// Of parameters that move the outputs themselves.
    moved_outputs: Vec<MovedOutputs>,
}

/// What one parameter changes in the outputs' rows.
#[derive(Debug, Clone)]
struct MovedOutputs {
    parameter: usize,
    /// In the basis, one column an output: n × outputs.
    moving: DMatrix<f64>,
    /// Change of the massless compliance between the outputs by the change of their rows, m/N per unit of the parameter.
    massless: Option<DMatrix<f64>>,
}

/// Derivatives of the outputs' rows with respect to one parameter: its index, and one row an output.
pub type RowSlopes = (usize, Vec<DVector<f64>>);

/// What the massless part adds to the derivatives.
#[derive(Debug, Clone)]
struct MasslessDerivatives {
    /// Coupling of each output's massless part with the moving coordinates: entry i + n (p + parameters · output).
    coupling: Vec<Complex64>,
    /// Between the outputs' massless parts: entry out + outputs (p + parameters · input).
    own: Vec<f64>,
    /// Mass and damping that a parameter gives to massless combinations, coupling as above; `None` where none does. (Masses
    /// and moments leave massless what is so; lengths of the kinematics turn other combinations massless.)
    moved: Option<MasslessMoved>,
}

#[derive(Debug, Clone)]
struct MasslessMoved {
    mass: Vec<f64>,
    damping: Vec<f64>,
}

/// Responses to forces along outputs at one frequency: Z⁻¹ rᵀ in the basis, n a force, column by column.
#[derive(Debug, Clone, Default)]
pub struct Response {
    omega: f64,
    columns: Vec<Complex64>,
    /// Which column belongs to the force along an output.
    place: Vec<Option<usize>>,
    dynamic: Vec<Complex64>,
}

impl Response {
    /// Angular frequency that it was solved at, rad/s.
    pub fn omega(&self) -> f64 {
        self.omega
    }

    /// Of the force along output `input`, which must have been solved for.
    fn column(&self, n: usize, input: usize) -> &[Complex64] {
        let place = self.place[input].expect("a force that was solved for");
        &self.columns[n * place..n * (place + 1)]
    }
}

/// Derivatives of receptances at one frequency, with the room to work them out again at the next.
#[derive(Debug, Clone, Default)]
pub struct Slopes {
    /// Which outputs are hit.
    pub inputs: Vec<usize>,
    /// [input + inputs · (parameter + parameters · output)]
    values: Vec<Complex64>,
    parameters: usize,
    forces: Vec<Complex64>,
    dynamic: Vec<Complex64>,
    product: Vec<Complex64>,
    coupling: Vec<Complex64>,
}

impl Slopes {
    /// For forces along the given outputs.
    pub fn of_inputs(inputs: Vec<usize>) -> Self {
        Slopes {
            inputs,
            ..Slopes::default()
        }
    }

    /// dH/dp, m/N per unit of the parameter, of output `out` per force along the `input`-th of the inputs.
    pub fn at(&self, parameter: usize, input: usize, out: usize) -> Complex64 {
        self.values[input + self.inputs.len() * (parameter + self.parameters * out)]
    }
}

/// Lines solved side by side, with the room to work them out again for the next.
#[derive(Default)]
struct SideBySide {
    /// As those of [`Response`].
    columns: Vec<Lanes>,
    place: Vec<Option<usize>>,
    dynamic: Vec<Lanes>,
}

fn finite(columns: &[Complex64], rate: Complex64) -> Result<()> {
    if columns.iter().all(|v| v.is_finite()) {
        return Ok(());
    }
    Err(Error::computation(format!(
        "the model has no finite response at {:.3} Hz: it is undamped at a resonance",
        rate.im / std::f64::consts::TAU
    )))
}

impl FrfBasis {
    /// `outputs`: rows of displacement per coordinate (from [`super::Chain::output_row`]).
    ///
    /// # Errors
    /// A stiffness that is not positive definite.
    pub fn new(system: &System, outputs: &[DVector<f64>]) -> Result<Self> {
        Self::with_moved_outputs(system, outputs, &[])
    }

    /// As [`new`](Self::new), where parameters move the outputs as well: `row_slopes` says how.
    ///
    /// # Errors
    /// As there.
    pub fn with_moved_outputs(
        system: &System,
        outputs: &[DVector<f64>],
        row_slopes: &[RowSlopes],
    ) -> Result<Self> {
        let n = system.stiffness.nrows();
        let chain = system.chain_count;
        let modes = ModalBasis::new(
            &system.stiffness.view((0, 0), (chain, chain)).into_owned(),
            &system.chain_mass,
        )?;
        // Modes come with the lowest frequency first, so the massless ones stand last. Dampers in the elements damp them:
        // then they stay. Branches do not touch them: their masses are held fast to the chain where its modes are worked
        // out, so that a massless mode does not move them.
        let branches = n - chain;
        let coupled = branches > 0 || system.viscous.is_some() || system.hysteretic.is_some();
        let damped = |viscous: &DMatrix<f64>| viscous.view((0, 0), (chain, chain)).iter().any(|c| *c != 0.0);
        let moving = if system.viscous.as_ref().is_some_and(damped) || system.hysteretic.is_some() {
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
        let moved_outputs = row_slopes
            .iter()
            .map(|(parameter, slopes)| {
                let mut moving = DMatrix::zeros(n, outputs.len());
                let mut still_slopes = DMatrix::zeros(still.ncols(), outputs.len());
                for (j, slope) in slopes.iter().enumerate() {
                    moving.set_column(j, &(basis.transpose() * slope));
                    still_slopes.set_column(j, &(still.transpose() * slope));
                }
                let massless = massless.is_some().then(|| {
                    let half: DMatrix<f64> = still_slopes.transpose() * &still_rows;
                    &half + half.transpose()
                });
                MovedOutputs {
                    parameter: *parameter,
                    moving,
                    massless,
                }
            })
            .collect();

        let zeta = system.modal_damping_ratio.value;
        let root: Vec<f64> = modes.inverse_omega2[..moving]
            .iter()
            .map(|mu| mu.sqrt())
            .collect();
        let dynamics = if !coupled {
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
            let hysteretic = match &system.hysteretic {
                Some(hysteretic) => basis.transpose() * hysteretic * &basis,
                None => DMatrix::zeros(n, n),
            };
            Dynamics::Full {
                mass,
                damping,
                hysteretic,
            }
        };

        let project = |matrix: &Option<DMatrix<f64>>| match matrix {
            Some(matrix) => basis.transpose() * matrix * &basis,
            None => DMatrix::zeros(n, n),
        };
        let count = system.derivatives.len();
        let outputs = outputs.len();
        let changes_mass = system.derivatives.iter().any(|d| d.mass.is_some());
        let changes_hysteresis = system.derivatives.iter().any(|d| d.hysteretic.is_some());
        let mut derivatives = Derivatives {
            count,
            hysteretic: vec![0.0; if changes_hysteresis { n * n * count } else { 0 }],
            stiffness: vec![0.0; n * n * count],
            mass: vec![0.0; if changes_mass { n * n * count } else { 0 }],
            damping: vec![0.0; n * n * count],
            massless: (moving < chain && count > 0).then(|| MasslessDerivatives {
                coupling: vec![Complex64::ZERO; n * count * outputs],
                own: vec![0.0; outputs * count * outputs],
                moved: None,
            }),
            moved_outputs,
        };
        let moving_shapes = modes.shapes.columns(0, moving);
        for (p, derivative) in system.derivatives.iter().enumerate() {
            let stiffness = project(&derivative.stiffness);
            let mass = project(&derivative.mass);
            let mut damping = project(&derivative.viscous);
            let hysteretic = changes_hysteresis.then(|| project(&derivative.hysteretic));
            let zeta_slope = system.modal_damping_ratio.derivative(p);
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
                        damping[(i, j)] += 2.0 * zeta * (dm + root[i] * root[j] * stiffness[(i, j)]) / sum;
                    }
                }
            }
            for j in 0..n {
                let at = n * (p + count * j)..n * (p + count * j) + n;
                derivatives.stiffness[at.clone()].copy_from_slice(stiffness.column(j).as_slice());
                derivatives.damping[at.clone()].copy_from_slice(damping.column(j).as_slice());
                if let Some(hysteretic) = &hysteretic {
                    derivatives.hysteretic[at.clone()].copy_from_slice(hysteretic.column(j).as_slice());
                }
                if changes_mass {
                    derivatives.mass[at].copy_from_slice(mass.column(j).as_slice());
                }
            }
            if let (Some(massless), Some(dm)) = (&mut derivatives.massless, &derivative.mass) {
                let reach = dm * &still * &still_rows;
                let from_rounding = 1e-11 * dm.amax() * still.amax() * still_rows.amax();
                if reach.amax() > from_rounding {
                    let moved = massless.moved.get_or_insert_with(|| MasslessMoved {
                        mass: vec![0.0; n * count * outputs],
                        damping: vec![0.0; n * count * outputs],
                    });
                    let coupling = basis.transpose() * &reach;
                    let on_chain = derivative
                        .chain_mass
                        .as_ref()
                        .map(|m| moving_shapes.transpose() * m * still.rows(0, chain) * &still_rows);
                    for out in 0..outputs {
                        for i in 0..n {
                            let at = i + n * (p + count * out);
                            moved.mass[at] = coupling[(i, out)];
                            // As above with a root that is zero.
                            if let Some(on_chain) = on_chain.as_ref().filter(|_| i < moving) {
                                moved.damping[at] = 2.0 * zeta * on_chain[(i, out)] / root[i];
                            }
                        }
                    }
                }
            }
            if let (Some(massless), Some(dk)) = (&mut derivatives.massless, &derivative.stiffness) {
                let reach = dk * &still * &still_rows;
                let coupling = basis.transpose() * &reach;
                let own = still_rows.transpose() * still.transpose() * &reach;
                for out in 0..outputs {
                    for i in 0..n {
                        massless.coupling[i + n * (p + count * out)] = coupling[(i, out)].into();
                    }
                    for other in 0..outputs {
                        massless.own[other + outputs * (p + count * out)] = own[(other, out)];
                    }
                }
            }
        }
        Ok(FrfBasis {
            n,
            rows,
            massless,
            dynamics,
            derivatives,
        })
    }

    /// Number of outputs, which are the inputs, too.
    pub fn output_count(&self) -> usize {
        self.rows.ncols()
    }

    /// All outputs, as [`Self::solve_lines`] takes them; [`Self::slopes`] needs the response to a force along each.
    pub fn outputs(&self) -> Vec<usize> {
        (0..self.output_count()).collect()
    }

    /// Solves for forces along all outputs at `omega` (rad/s). Fails only where an undamped system is hit at resonance.
    pub fn solve(&self, omega: f64, response: &mut Response) -> Result<()> {
        self.solve_at_rate(Complex64::new(0.0, omega), 0..self.output_count(), response)
    }

    /// Solves for forces along the outputs `inputs` that grow like exp(st), `rate` s in rad/s.
    fn solve_at_rate(
        &self,
        rate: Complex64,
        inputs: impl IntoIterator<Item = usize>,
        response: &mut Response,
    ) -> Result<()> {
        let n = self.n;
        let square = rate * rate;
        response.omega = rate.im;
        response.columns.clear();
        response.place.clear();
        response.place.resize(self.output_count(), None);
        let rows = |input: usize| &self.rows.as_slice()[n * input..n * (input + 1)];
        for (place, input) in inputs.into_iter().enumerate() {
            response.place[input] = Some(place);
            let forces = rows(input).iter().map(|r| Complex64::new(*r, 0.0));
            response.columns.extend(forces);
        }
        match &self.dynamics {
            Dynamics::Diagonal { mu, damping } => {
                for column in response.columns.chunks_exact_mut(n.max(1)) {
                    for (x, (mu, damping)) in column.iter_mut().zip(mu.iter().zip(damping)) {
                        *x /= 1.0 + square * mu + rate * damping;
                    }
                }
            }
            Dynamics::Full {
                mass,
                damping,
                hysteretic,
            } => {
                response.dynamic.clear();
                let entries = mass.iter().zip(damping).zip(hysteretic);
                response
                    .dynamic
                    .extend(entries.map(|((m, c), h)| square * m + rate * c + Complex64::new(0.0, *h)));
                // The stiffness is the identity.
                for diagonal in response.dynamic.iter_mut().step_by(n + 1) {
                    diagonal.re += 1.0;
                }
                solve_in_place(n, &mut response.dynamic, &mut response.columns);
            }
        }
        finite(&response.columns, rate)
    }

    /// Solves line after line for forces along the outputs `inputs` that grow like exp(st), s being `rates` (rad/s), and shows
    /// each to `visit` with its number. Faster than line by line: some are solved side by side.
    ///
    /// # Errors
    /// As [`Self::solve`]; those of `visit`.
    pub fn solve_lines(
        &self,
        rates: &[Complex64],
        inputs: &[usize],
        mut visit: impl FnMut(usize, &Response) -> Result<()>,
    ) -> Result<()> {
        let mut response = Response::default();
        let mut room = SideBySide::default();
        for (group, rates) in rates.chunks(LANES).enumerate() {
            let together = self.solve_group(rates, inputs, &mut room);
            for (lane, rate) in rates.iter().enumerate() {
                if together {
                    response.omega = rate.im;
                    response.place.clone_from(&room.place);
                    response.columns.clear();
                    response.columns.extend(room.columns.iter().map(|x| x.get(lane)));
                    finite(&response.columns, *rate)?;
                } else {
                    self.solve_at_rate(*rate, inputs.iter().copied(), &mut response)?;
                }
                visit(LANES * group + lane, &response)?;
            }
        }
        Ok(())
    }

    /// Up to [`LANES`] rates together. False where they are to be solved each by itself.
    fn solve_group(&self, rates: &[Complex64], inputs: &[usize], room: &mut SideBySide) -> bool {
        let Dynamics::Full {
            mass,
            damping,
            hysteretic,
        } = &self.dynamics
        else {
            return false;
        };
        let n = self.n;
        // The last group may be smaller: its last line fills the rest.
        let rate: [Complex64; LANES] = std::array::from_fn(|l| rates[l.min(rates.len() - 1)]);
        let square = rate.map(|s| s * s);
        room.dynamic.clear();
        let entries = mass.iter().zip(damping).zip(hysteretic);
        room.dynamic.extend(entries.map(|((m, c), h)| Lanes {
            re: std::array::from_fn(|l| square[l].re * m + rate[l].re * c),
            im: std::array::from_fn(|l| square[l].im * m + rate[l].im * c + h),
        }));
        // The stiffness is the identity.
        for diagonal in room.dynamic.iter_mut().step_by(n + 1) {
            diagonal.re.iter_mut().for_each(|re| *re += 1.0);
        }
        room.place.clear();
        room.place.resize(self.output_count(), None);
        room.columns.clear();
        for (place, &input) in inputs.iter().enumerate() {
            room.place[input] = Some(place);
            let rows = &self.rows.as_slice()[n * input..n * (input + 1)];
            room.columns.extend(rows.iter().map(|r| Lanes::splat(*r)));
        }
        solve_side_by_side(n, &mut room.dynamic, &mut room.columns)
    }

    /// Receptance of output `out` per force along output `input`, m/N, at the frequency last solved; for one of the two it must
    /// have been solved (Maxwell 1864: the matrices are symmetric).
    pub fn receptance(&self, response: &Response, out: usize, input: usize) -> Complex64 {
        let (force, seen) = if response.place[input].is_some() {
            (input, out)
        } else {
            (out, input)
        };
        let column = response.column(self.n, force);
        let row = &self.rows.as_slice()[seen * self.n..(seen + 1) * self.n];
        let moving: Complex64 = row.iter().zip(column).map(|(r, u)| u * *r).sum();
        moving + self.massless.as_ref().map_or(0.0, |m| m[(out, input)])
    }

    /// dH/dp = −u_outᵀ (dZ/dp) u_in for every parameter, every output and the inputs of `slopes`, at the frequency last
    /// solved with [`Self::solve`].
    pub fn slopes(&self, response: &Response, slopes: &mut Slopes) {
        let (n, count, outputs) = (self.n, self.derivatives.count, self.rows.ncols());
        let inputs = slopes.inputs.len();
        let omega = response.omega;
        let Derivatives {
            stiffness,
            mass,
            damping,
            hysteretic,
            massless,
            ..
        } = &self.derivatives;
        slopes.parameters = count;
        slopes.forces.clear();
        for input in &slopes.inputs {
            slopes.forces.extend_from_slice(response.column(n, *input));
        }
        slopes.dynamic.clear();
        let stiff_and_damped = stiffness.iter().zip(damping);
        slopes
            .dynamic
            .extend(stiff_and_damped.map(|(k, c)| Complex64::new(*k, omega * c)));
        for (z, m) in slopes.dynamic.iter_mut().zip(mass) {
            z.re -= omega * omega * m;
        }
        for (z, h) in slopes.dynamic.iter_mut().zip(hysteretic) {
            z.im += h;
        }
        let forces = MatRef::from_column_major_slice(&slopes.forces, n, inputs);
        let one = Complex64::new(1.0, 0.0);
        // u_inᵀ dZ for all parameters: inputs × (parameters · n), which read the other way is (inputs · parameters) × n.
        slopes.product.resize(inputs * count * n, Complex64::ZERO);
        matmul(
            MatMut::from_column_major_slice_mut(&mut slopes.product, inputs, count * n),
            Accum::Replace,
            forces.transpose(),
            MatRef::from_column_major_slice(&slopes.dynamic, n, count * n),
            one,
            Par::Seq,
        );
        let mut coupling = std::mem::take(&mut slopes.coupling);
        if let Some(massless) = massless {
            coupling.clear();
            coupling.extend_from_slice(&massless.coupling);
            if let Some(moved) = &massless.moved {
                let both = moved.mass.iter().zip(&moved.damping);
                for (z, (m, c)) in coupling.iter_mut().zip(both) {
                    *z += Complex64::new(-omega * omega * m, omega * c);
                }
            }
            for j in 0..n {
                for p in 0..count {
                    for (i, input) in slopes.inputs.iter().enumerate() {
                        slopes.product[i + inputs * (p + count * j)] += coupling[j + n * (p + count * input)];
                    }
                }
            }
        }
        slopes.values.resize(inputs * count * outputs, Complex64::ZERO);
        matmul(
            MatMut::from_column_major_slice_mut(&mut slopes.values, inputs * count, outputs),
            Accum::Replace,
            MatRef::from_column_major_slice(&slopes.product, inputs * count, n),
            MatRef::from_column_major_slice(&response.columns, n, outputs),
            -one,
            Par::Seq,
        );
        if let Some(massless) = massless {
            matmul(
                MatMut::from_column_major_slice_mut(&mut slopes.values, inputs, count * outputs),
                Accum::Add,
                forces.transpose(),
                MatRef::from_column_major_slice(&coupling, n, count * outputs),
                -one,
                Par::Seq,
            );
            for out in 0..outputs {
                for p in 0..count {
                    for (i, input) in slopes.inputs.iter().enumerate() {
                        slopes.values[i + inputs * (p + count * out)] -=
                            massless.own[out + outputs * (p + count * input)];
                    }
                }
            }
        }
        slopes.coupling = coupling;
        self.add_moved_outputs(response, slopes);
    }

    /// Adds (dr_out)ᵀ u_in + (dr_in)ᵀ u_out for the parameters that move the outputs.
    fn add_moved_outputs(&self, response: &Response, slopes: &mut Slopes) {
        let (n, count, outputs) = (self.n, self.derivatives.count, self.rows.ncols());
        let inputs = slopes.inputs.len();
        for moved in &self.derivatives.moved_outputs {
            let along = |row: usize, force: usize| -> Complex64 {
                let row = &moved.moving.as_slice()[n * row..n * (row + 1)];
                let column = response.column(n, force);
                row.iter().zip(column).map(|(r, u)| u * *r).sum()
            };
            for out in 0..outputs {
                for i in 0..inputs {
                    let input = slopes.inputs[i];
                    let still = moved.massless.as_ref().map_or(0.0, |m| m[(out, input)]);
                    slopes.values[i + inputs * (moved.parameter + count * out)] +=
                        along(out, input) + along(input, out) + still;
                }
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
