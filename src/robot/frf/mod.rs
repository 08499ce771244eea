//! Natural frequencies, mode shapes and frequency response of a chain, with exact derivatives.
//!
//! The eigenproblem is M x = μ K x with K positive definite, μ = ω⁻²: massless coordinates (beam halves without a body)
//! give μ = 0 and stay in the basis as pure static compliance. With xᵀ K x = 1 the dynamic stiffness of a chain with
//! modal damping is diagonal, 1 + 2iζω√μ − ω²μ, and H = Σ (r_out·x)(r_in·x)/(…): the modal sum including all residual
//! compliance. Branches and dampers couple the modes; then a complex system is solved, as small as they are few.

mod derivatives;
mod dynamic_stiffness;
mod modal_basis;
mod side_by_side;
mod symmetric;

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

use super::chain::System;
use crate::{Error, Result};
use derivatives::Derivatives;
pub use derivatives::{RowSlopes, Slopes};
use dynamic_stiffness::{DynamicStiffness, Modes, Room};
pub use modal_basis::{ModalBasis, natural_frequencies_hz};
use side_by_side::{LANES, Lanes, real_dots, three};

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
    dynamics: DynamicStiffness,
    derivatives: Derivatives,
}

/// Receptances at one frequency for forces along some of the outputs.
#[derive(Debug, Clone, Default)]
pub struct Response {
    omega: f64,
    /// m/N; all outputs, force by force.
    receptances: Vec<Complex64>,
    /// Which of the forces acts along an output.
    place: Vec<Option<usize>>,
}

impl Response {
    /// Angular frequency that it was solved at, rad/s.
    pub fn omega(&self) -> f64 {
        self.omega
    }
}

/// Lines solved side by side, with the room to work them out again for the next.
#[derive(Default)]
struct SideBySide {
    /// Responses to the forces: Z⁻¹ rᵀ in the basis, n a force.
    columns: Vec<Lanes>,
    room: Room,
    /// The forces that are shown: where they stand among the columns, and the output they act along.
    shown: Vec<(usize, usize)>,
    /// As those of [`Response`].
    receptances: Vec<Lanes>,
    /// One of the lines.
    response: Response,
}

impl SideBySide {
    /// Of the forces along the outputs `solved` those along `shown` are shown.
    fn new(outputs: usize, solved: &[usize], shown: &[usize]) -> Self {
        let mut room = SideBySide::default();
        room.response.place.resize(outputs, None);
        for output in shown {
            room.response.place[*output] = Some(room.shown.len());
            let column = solved.iter().position(|s| s == output);
            room.shown.extend(column.map(|column| (column, *output)));
        }
        room
    }

    /// The line `lane`, which was solved at `rate`.
    fn line(&mut self, lane: usize, rate: &Complex64) -> &Response {
        self.response.omega = rate.im;
        self.response.receptances.clear();
        let all = self.receptances.iter().map(|h| h.get(lane));
        self.response.receptances.extend(all);
        &self.response
    }
}

/// The receptances of lines that were solved.
struct Receptances<'a> {
    basis: &'a FrfBasis,
    room: &'a mut SideBySide,
}

impl WithSimd for Receptances<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let (basis, n, outputs) = (self.basis, self.basis.n, self.basis.output_count());
        let SideBySide {
            columns,
            shown,
            receptances,
            ..
        } = self.room;
        receptances.clear();
        receptances.resize(outputs * shown.len(), Lanes::default());
        for first in (0..shown.len()).step_by(3) {
            let column = |c: usize| &columns[n * shown[c].0..n * (shown[c].0 + 1)];
            let three = three(column, first, shown.len());
            for out in (0..outputs).step_by(2) {
                let rows = [out, (out + 1).min(outputs - 1)].map(|out| basis.row(out));
                for (out, sums) in (out..outputs).zip(real_dots(simd, rows, three)) {
                    for ((c, sum), (_, input)) in (first..).zip(sums).zip(&shown[first..]) {
                        let massless = basis.massless.as_ref().map_or(0.0, |m| m[(out, *input)]);
                        receptances[out + outputs * c] = sum.plus(massless);
                    }
                }
            }
        }
    }
}

/// The last group may be smaller: its last line fills the rest.
fn filled(rates: &[Complex64]) -> [Complex64; LANES] {
    std::array::from_fn(|lane| rates[lane.min(rates.len() - 1)])
}

fn finite(mut values: impl Iterator<Item = Complex64>, rate: Complex64) -> Result<()> {
    if values.all(|v| v.is_finite()) {
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
        let zeta = system.modal_damping_ratio.value;
        let root: Vec<f64> = modes.inverse_omega2[..moving]
            .iter()
            .map(|mu| mu.sqrt())
            .collect();
        let own = Modes {
            mu: modes.inverse_omega2[..moving].to_vec(),
            damping: root.iter().map(|s| 2.0 * zeta * s).collect(),
        };
        let dynamics = if !coupled {
            DynamicStiffness::Diagonal(own)
        } else {
            let mass = basis.transpose() * &system.mass * &basis;
            let mut damping = match &system.viscous {
                Some(viscous) => basis.transpose() * viscous * &basis,
                None => DMatrix::zeros(n, n),
            };
            for (i, c) in own.damping.iter().enumerate() {
                damping[(i, i)] += c;
            }
            let hysteretic = match &system.hysteretic {
                Some(hysteretic) => basis.transpose() * hysteretic * &basis,
                None => DMatrix::zeros(n, n),
            };
            DynamicStiffness::coupled(own, mass, damping, hysteretic)
        };

        let derivatives = derivatives::Projection {
            system,
            moving_shapes: modes.shapes.columns(0, moving),
            root: &root,
            basis: &basis,
            still: &still,
            rows: &rows,
            still_rows: &still_rows,
        }
        .derivatives(row_slopes);
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

    /// All outputs, as [`Self::solve_lines`] takes them.
    pub fn outputs(&self) -> Vec<usize> {
        (0..self.output_count()).collect()
    }

    /// Output `output` in the basis, n numbers.
    fn row(&self, output: usize) -> &[f64] {
        &self.rows.as_slice()[self.n * output..self.n * (output + 1)]
    }

    /// Responses to forces along the outputs `inputs` that grow like exp(st), `rate` s in rad/s, n a force.
    fn solved_at(&self, rate: Complex64, inputs: &[usize]) -> Vec<Complex64> {
        let rows = inputs.iter().flat_map(|input| self.row(*input));
        let mut columns: Vec<Complex64> = rows.map(|r| Complex64::new(*r, 0.0)).collect();
        self.dynamics.solve_one(rate, &mut columns);
        columns
    }

    /// Solves for forces along all outputs at `omega` (rad/s). Fails only where an undamped system is hit at resonance.
    pub fn solve(&self, omega: f64) -> Result<Response> {
        let rate = Complex64::new(0.0, omega);
        let outputs = self.outputs();
        let columns = self.solved_at(rate, &outputs);
        finite(columns.iter().copied(), rate)?;
        let mut receptances = Vec::with_capacity(outputs.len().pow(2));
        for input in &outputs {
            let column = &columns[self.n * input..self.n * (input + 1)];
            receptances.extend(outputs.iter().map(|out| self.of_column(*out, *input, column)));
        }
        Ok(Response {
            omega,
            receptances,
            place: outputs.into_iter().map(Some).collect(),
        })
    }

    /// Receptance of output `out`, `column` being the response to the force along output `input`.
    fn of_column(&self, out: usize, input: usize, column: &[Complex64]) -> Complex64 {
        let moving: Complex64 = self.row(out).iter().zip(column).map(|(r, u)| u * *r).sum();
        moving + self.massless.as_ref().map_or(0.0, |m| m[(out, input)])
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
        let mut room = SideBySide::new(self.output_count(), inputs, inputs);
        for (group, rates) in rates.chunks(LANES).enumerate() {
            self.solve_group(rates, inputs, &mut room)?;
            for (lane, rate) in rates.iter().enumerate() {
                visit(LANES * group + lane, room.line(lane, rate))?;
            }
        }
        Ok(())
    }

    /// As [`Self::solve_lines`] for forces along all outputs, with the derivatives of the receptances for those along `inputs`.
    ///
    /// # Errors
    /// As there.
    pub fn solve_lines_with_slopes(
        &self,
        rates: &[Complex64],
        inputs: &[usize],
        mut visit: impl FnMut(usize, &Response, &Slopes) -> Result<()>,
    ) -> Result<()> {
        let all = self.outputs();
        let mut room = SideBySide::new(all.len(), &all, inputs);
        let mut slopes = Slopes::of_inputs(inputs);
        for (group, rates) in rates.chunks(LANES).enumerate() {
            self.solve_group(rates, &all, &mut room)?;
            self.derivatives.at(filled(rates), &room.columns, &mut slopes);
            for (lane, rate) in rates.iter().enumerate() {
                slopes.lane = lane;
                visit(LANES * group + lane, room.line(lane, rate), &slopes)?;
            }
        }
        Ok(())
    }

    /// Up to [`LANES`] rates together.
    fn solve_group(&self, rates: &[Complex64], inputs: &[usize], room: &mut SideBySide) -> Result<()> {
        let all = filled(rates);
        room.columns.clear();
        for input in inputs {
            room.columns
                .extend(self.row(*input).iter().map(|r| Lanes::splat(*r)));
        }
        if !self.dynamics.solve(all, &mut room.columns, &mut room.room) {
            // No pivots do for all of them.
            for (lane, rate) in all.iter().enumerate() {
                let own = self.solved_at(*rate, inputs);
                let columns = room.columns.iter_mut().zip(own);
                columns.for_each(|(x, value)| x.set(lane, value));
            }
        }
        for (lane, rate) in rates.iter().enumerate() {
            finite(room.columns.iter().map(|x| x.get(lane)), *rate)?;
        }
        Arch::new().dispatch(Receptances { basis: self, room });
        Ok(())
    }

    /// Receptance of output `out` per force along output `input`, m/N, at the frequency last solved; for one of the two it must
    /// have been solved (Maxwell 1864: the matrices are symmetric).
    pub fn receptance(&self, response: &Response, out: usize, input: usize) -> Complex64 {
        let (force, seen) = match response.place[input] {
            Some(force) => (force, out),
            None => (response.place[out].expect("a force that was solved for"), input),
        };
        response.receptances[seen + self.output_count() * force]
    }

    /// Receptance at `omega` in one call, m/N.
    pub fn receptance_at(&self, omega: f64, out: usize, input: usize) -> Result<Complex64> {
        Ok(self.receptance(&self.solve(omega)?, out, input))
    }
}
