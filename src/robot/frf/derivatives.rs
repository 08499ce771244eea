//! Derivatives of receptances: dH/dp = −u_outᵀ (dZ/dp) u_in in the modal basis, for [`LANES`] lines side by side.

use nalgebra::{DMatrix, DMatrixView, DVector};
use num_complex::Complex64;
use pulp::{Arch, Simd, WithSimd};

use super::side_by_side::{LANES, Lanes, dots, real_dots, three};
use super::symmetric::Symmetric;
use crate::robot::chain::System;

/// Derivatives of the basis' matrices.
#[derive(Debug, Clone)]
pub(super) struct Derivatives {
    n: usize,
    outputs: usize,
    parameters: Vec<MatrixSlopes>,
    massless: Option<MasslessDerivatives>,
    /// Of parameters that move the outputs themselves.
    moved_outputs: Vec<MovedOutputs>,
}

/// What one parameter changes in the matrices.
#[derive(Debug, Clone)]
struct MatrixSlopes {
    /// Anything at all.
    acts: bool,
    stiffness: Symmetric,
    damping: Symmetric,
    mass: Symmetric,
    hysteretic: Symmetric,
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
    /// Coupling of each output's massless part with the moving coordinates by the stiffness: entry i + n (out + outputs p).
    stiffness: Vec<f64>,
    /// Between the outputs' massless parts: entry out + outputs (input + outputs p).
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

/// A system and the basis that it is projected on.
pub(super) struct Projection<'a> {
    pub(super) system: &'a System,
    /// Of the chain's coordinates, the modes that move with mass.
    pub(super) moving_shapes: DMatrixView<'a, f64>,
    /// √μ of these, s.
    pub(super) root: &'a [f64],
    /// All coordinates × n.
    pub(super) basis: &'a DMatrix<f64>,
    /// All coordinates × massless combinations.
    pub(super) still: &'a DMatrix<f64>,
    /// The outputs on both, one column an output.
    pub(super) rows: &'a DMatrix<f64>,
    pub(super) still_rows: &'a DMatrix<f64>,
}

impl Projection<'_> {
    fn moved_outputs(&self, (parameter, slopes): &RowSlopes) -> MovedOutputs {
        let (basis, still) = (self.basis, self.still);
        let mut moving = DMatrix::zeros(basis.ncols(), slopes.len());
        let mut still_slopes = DMatrix::zeros(still.ncols(), slopes.len());
        for (j, slope) in slopes.iter().enumerate() {
            moving.set_column(j, &(basis.transpose() * slope));
            still_slopes.set_column(j, &(still.transpose() * slope));
        }
        let massless = (still.ncols() > 0).then(|| {
            let half: DMatrix<f64> = still_slopes.transpose() * self.still_rows;
            &half + half.transpose()
        });
        MovedOutputs {
            parameter: *parameter,
            moving,
            massless,
        }
    }

    pub(super) fn derivatives(&self, row_slopes: &[RowSlopes]) -> Derivatives {
        let Projection {
            system,
            moving_shapes,
            root,
            basis,
            still,
            rows,
            still_rows,
        } = self;
        let (n, moving, outputs) = (basis.ncols(), root.len(), rows.ncols());
        let all = &system.derivatives;
        let count = all.len();
        let zeta = system.modal_damping_ratio.value;
        let project = |matrix: &Option<DMatrix<f64>>| match matrix {
            Some(matrix) => basis.transpose() * matrix * *basis,
            None => DMatrix::zeros(n, n),
        };
        let changed = |matrix: &Option<DMatrix<f64>>| match matrix {
            Some(_) => Symmetric::of(&project(matrix)),
            None => Symmetric::Squares(Vec::new()),
        };
        let mut derivatives = Derivatives {
            n,
            outputs,
            parameters: Vec::with_capacity(count),
            massless: (still.ncols() > 0 && count > 0).then(|| MasslessDerivatives {
                stiffness: vec![0.0; n * count * outputs],
                own: vec![0.0; outputs * count * outputs],
                moved: None,
            }),
            moved_outputs: row_slopes.iter().map(|s| self.moved_outputs(s)).collect(),
        };
        for (p, derivative) in all.iter().enumerate() {
            let stiffness = project(&derivative.stiffness);
            let mut damping = project(&derivative.viscous);
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
            let anything = [
                &derivative.stiffness,
                &derivative.mass,
                &derivative.chain_mass,
                &derivative.viscous,
                &derivative.hysteretic,
            ];
            let modal = zeta_slope != 0.0
                || (zeta != 0.0 && (derivative.stiffness.is_some() || chain_mass.is_some()));
            derivatives.parameters.push(MatrixSlopes {
                acts: zeta_slope != 0.0 || anything.iter().any(|m| m.is_some()),
                stiffness: Symmetric::of(&stiffness),
                // Modal damping is no sum of few squares.
                damping: match modal {
                    true => Symmetric::full(&damping),
                    false => Symmetric::of(&damping),
                },
                mass: changed(&derivative.mass),
                hysteretic: changed(&derivative.hysteretic),
            });
            let at = n * outputs * p;
            if let (Some(massless), Some(dm)) = (&mut derivatives.massless, &derivative.mass) {
                let reach = dm * *still * *still_rows;
                let from_rounding = 1e-11 * dm.amax() * still.amax() * still_rows.amax();
                if reach.amax() > from_rounding {
                    let moved = massless.moved.get_or_insert_with(|| MasslessMoved {
                        mass: vec![0.0; n * count * outputs],
                        damping: vec![0.0; n * count * outputs],
                    });
                    let coupling = basis.transpose() * &reach;
                    moved.mass[at..at + n * outputs].copy_from_slice(coupling.as_slice());
                    if let Some(m) = &derivative.chain_mass {
                        let chain = moving_shapes.nrows();
                        let on_chain = moving_shapes.transpose() * m * still.rows(0, chain) * *still_rows;
                        for out in 0..outputs {
                            for i in 0..moving {
                                // As above with a root that is zero.
                                moved.damping[at + n * out + i] = 2.0 * zeta * on_chain[(i, out)] / root[i];
                            }
                        }
                    }
                }
            }
            if let (Some(massless), Some(dk)) = (&mut derivatives.massless, &derivative.stiffness) {
                let reach = dk * *still * *still_rows;
                let coupling = basis.transpose() * &reach;
                massless.stiffness[at..at + n * outputs].copy_from_slice(coupling.as_slice());
                let own = still_rows.transpose() * still.transpose() * &reach;
                let at = outputs * outputs * p;
                massless.own[at..at + outputs * outputs].copy_from_slice(own.as_slice());
            }
        }
        derivatives
    }
}

/// Derivatives of receptances at one frequency, with the room to work them out again at the next.
#[derive(Debug, Clone, Default)]
pub struct Slopes {
    /// Which outputs are hit.
    inputs: Vec<usize>,
    /// Of the lines side by side, the one that is shown.
    pub(super) lane: usize,
    /// [input + inputs · (out + outputs · parameter)]
    values: Vec<Lanes>,
    outputs: usize,
    /// n
    coupling: Vec<Lanes>,
    /// n × inputs
    product: Vec<Lanes>,
    /// One an output.
    along: Vec<Lanes>,
}

impl Slopes {
    /// For forces along the given outputs.
    pub(super) fn of_inputs(inputs: &[usize]) -> Self {
        Slopes {
            inputs: inputs.to_vec(),
            ..Slopes::default()
        }
    }

    /// dH/dp, m/N per unit of the parameter, by parameter and output, per force along output `input`, which must be one of those
    /// asked for.
    pub fn along(&self, input: usize) -> impl Fn(usize, usize) -> Complex64 + '_ {
        let place = self.inputs.iter().position(|i| *i == input);
        let place = place.expect("a force that slopes were asked for");
        move |parameter, out| {
            self.values[place + self.inputs.len() * (out + self.outputs * parameter)].get(self.lane)
        }
    }
}

impl Derivatives {
    /// Works out `slopes` at the `rates` (s of exp(st), rad/s), `columns` being the responses to forces along all outputs.
    pub(super) fn at(&self, rates: [Complex64; LANES], columns: &[Lanes], slopes: &mut Slopes) {
        slopes.outputs = self.outputs;
        let room = [
            (&mut slopes.coupling, self.n),
            (&mut slopes.product, self.n * slopes.inputs.len()),
            (&mut slopes.along, self.outputs),
            (
                &mut slopes.values,
                self.parameters.len() * self.outputs * slopes.inputs.len(),
            ),
        ];
        for (vector, size) in room {
            vector.clear();
            vector.resize(size, Lanes::default());
        }
        Arch::new().dispatch(AtRates {
            derivatives: self,
            rate: Lanes::of(rates),
            square: Lanes::of(rates.map(|s| s * s)),
            columns,
            slopes,
        });
    }
}

struct AtRates<'a> {
    derivatives: &'a Derivatives,
    rate: Lanes,
    square: Lanes,
    columns: &'a [Lanes],
    slopes: &'a mut Slopes,
}

impl WithSimd for AtRates<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let AtRates {
            derivatives,
            rate,
            square,
            columns,
            slopes,
        } = self;
        let Derivatives {
            n,
            outputs,
            parameters,
            massless,
            moved_outputs,
        } = derivatives;
        let (n, outputs, inputs) = (*n, *outputs, slopes.inputs.len());
        let Slopes {
            coupling: coupled,
            product,
            along,
            values,
            inputs: forces,
            ..
        } = slopes;
        let of_output = |out: usize| &columns[n * out..n * (out + 1)];
        let one = Lanes::splat(1.0);
        let i = Lanes::of([Complex64::I; LANES]);
        for (p, parameter) in parameters.iter().enumerate().filter(|(_, p)| p.acts) {
            let matrices = [
                (&parameter.stiffness, one),
                (&parameter.damping, rate),
                (&parameter.mass, square),
                (&parameter.hysteretic, i),
            ];
            let is_full = |(matrix, _): &(&Symmetric, Lanes)| matches!(matrix, Symmetric::Full { .. });
            let with_product = massless.is_some() || matrices.iter().any(is_full);
            if with_product {
                product.fill(Lanes::default());
            }
            for (matrix, factor) in matrices {
                match matrix {
                    Symmetric::Squares(squares) => {
                        for (sign, v) in squares {
                            for first in (0..outputs).step_by(3) {
                                let [sums] = real_dots(simd, [v], three(of_output, first, outputs));
                                along[first..].iter_mut().zip(sums).for_each(|(a, s)| *a = s);
                            }
                            let factor = factor.times(*sign);
                            for out in 0..outputs {
                                let own = &mut values[inputs * (out + outputs * p)..][..inputs];
                                let scaled = factor * along[out];
                                for (value, input) in own.iter_mut().zip(forces.iter()) {
                                    *value -= scaled * along[*input];
                                }
                            }
                        }
                    }
                    Symmetric::Full { size, entries } => {
                        for j in (0..*size).step_by(2) {
                            let columns = [j, (j + 1).min(size - 1)];
                            let of = columns.map(|j| &entries[size * j..size * (j + 1)]);
                            for first in (0..inputs).step_by(3) {
                                let sums =
                                    real_dots(simd, of, three(|c| of_output(forces[c]), first, inputs));
                                for (j, sums) in (j..*size).zip(sums) {
                                    for (c, sum) in (first..inputs).zip(sums) {
                                        product[n * c + j] += factor * sum;
                                    }
                                }
                            }
                        }
                    }
                }
            }
            if !with_product {
                continue;
            }
            // Coupling of an output's massless part with the moving coordinates.
            let coupling = |massless: &MasslessDerivatives, out: usize, z: &mut [Lanes]| {
                let at = n * (out + outputs * p)..n * (out + outputs * p + 1);
                for (z, k) in z.iter_mut().zip(&massless.stiffness[at.clone()]) {
                    *z = Lanes::splat(*k);
                }
                if let Some(moved) = &massless.moved {
                    let both = moved.mass[at.clone()].iter().zip(&moved.damping[at]);
                    for (z, (m, c)) in z.iter_mut().zip(both) {
                        *z += square.times(*m);
                        *z += rate.times(*c);
                    }
                }
            };
            if let Some(massless) = massless {
                for (c, input) in forces.iter().enumerate() {
                    coupling(massless, *input, coupled);
                    for (x, z) in product[n * c..n * (c + 1)].iter_mut().zip(coupled.iter()) {
                        *x += *z;
                    }
                }
            }
            for out in 0..outputs {
                let own = &mut values[inputs * (out + outputs * p)..inputs * (out + 1 + outputs * p)];
                for first in (0..inputs).step_by(3) {
                    let product = three(|c| &product[n * c..n * (c + 1)], first, inputs);
                    let sums = dots(simd, of_output(out), product);
                    for (value, sum) in own[first..].iter_mut().zip(sums) {
                        *value -= sum;
                    }
                }
                if let Some(massless) = massless {
                    coupling(massless, out, coupled);
                    for first in (0..inputs).step_by(3) {
                        let sums = dots(simd, coupled, three(|c| of_output(forces[c]), first, inputs));
                        for ((value, sum), input) in own[first..].iter_mut().zip(sums).zip(&forces[first..]) {
                            *value -= sum;
                            *value -= Lanes::splat(massless.own[out + outputs * (input + outputs * p)]);
                        }
                    }
                }
            }
        }
        // (dr_out)ᵀ u_in + (dr_in)ᵀ u_out for the parameters that move the outputs.
        for moved in moved_outputs {
            let along = |row: usize, force: usize| {
                let row = &moved.moving.as_slice()[n * row..n * (row + 1)];
                let mut sum = Lanes::default();
                for (r, u) in row.iter().zip(of_output(force)) {
                    sum += u.times(*r);
                }
                sum
            };
            for out in 0..outputs {
                for (c, input) in forces.iter().enumerate() {
                    let value = &mut values[c + inputs * (out + outputs * moved.parameter)];
                    *value += along(out, *input);
                    *value += along(*input, out);
                    if let Some(massless) = &moved.massless {
                        *value += Lanes::splat(massless[(out, *input)]);
                    }
                }
            }
        }
    }
}
