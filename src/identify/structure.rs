//! The structural model as a function of its parameters, and its misfit to measured FRFs.

use nalgebra::{DMatrix, DVector};
use num_complex::Complex64;
use rayon::prelude::*;

use super::frf_data::{FrfBlock, FrfData};
use super::levenberg_marquardt::{LeastSquares, Linearisation};
use super::parameters::{Parameter, Prior, Scale};
use crate::Result;
use crate::campaign::{Point, RobotSection};
use crate::robot::frf::Response;
use crate::robot::model::NOMINAL_DAMPING_RATIO;
use crate::robot::{Baseline, Dual, FrfBasis, RobotModel};

/// Robot, measurement points and the list of what may be tuned.
#[derive(Debug, Clone)]
pub struct StructureModel {
    pub robot: RobotModel,
    pub points: Vec<Point>,
    pub parameters: Vec<Parameter>,
    /// Whether link masses are among the parameters (after the joints and the damping ratio).
    tunes_masses: bool,
}

/// Standard deviation of the logarithm of the damping ratio about its nominal 3 %: robots show 1–6 %.
const DAMPING_LOG_STD: f64 = 0.7;
/// A stiffness further than this factor from the robot file's value is no tolerance but a mistake in the file.
const STIFFNESS_FACTOR: f64 = 30.0;

impl StructureModel {
    pub fn new(robot: RobotModel, points: Vec<Point>, section: &RobotSection) -> Self {
        let mut parameters = Vec::new();
        for (i, joint) in robot.spec.joints.iter().enumerate() {
            let nominal = 1.0 / joint.compliance_rad_per_nm;
            parameters.push(Parameter {
                name: format!("joint-{}.stiffness", i + 1),
                unit: "N·m/rad",
                scale: Scale::Logarithmic,
                nominal,
                prior: Some(Prior {
                    mean: nominal.ln(),
                    std: section.stiffness_tolerance,
                }),
                bounds: [nominal / STIFFNESS_FACTOR, nominal * STIFFNESS_FACTOR],
            });
        }
        parameters.push(Parameter {
            name: "damping-ratio".into(),
            unit: "1",
            scale: Scale::Logarithmic,
            nominal: NOMINAL_DAMPING_RATIO,
            prior: Some(Prior {
                mean: NOMINAL_DAMPING_RATIO.ln(),
                std: DAMPING_LOG_STD,
            }),
            bounds: [5e-4, 0.3],
        });
        if let Some(tolerance) = section.mass_tolerance {
            for (i, link) in robot.spec.links.iter().enumerate() {
                parameters.push(Parameter {
                    name: format!("link-{}.mass", i + 1),
                    unit: "kg",
                    scale: Scale::Linear,
                    nominal: link.mass_kg,
                    prior: Some(Prior {
                        mean: link.mass_kg,
                        std: tolerance * link.mass_kg,
                    }),
                    bounds: [0.3 * link.mass_kg, 3.0 * link.mass_kg],
                });
            }
        }
        StructureModel {
            robot,
            points,
            parameters,
            tunes_masses: section.mass_tolerance.is_some(),
        }
    }

    /// Nominal values on the solver's scale.
    pub fn nominal_theta(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.internal(p.nominal)).collect()
    }

    pub fn bounds(&self) -> Vec<[f64; 2]> {
        self.parameters.iter().map(Parameter::internal_bounds).collect()
    }

    /// The model's quantities at `theta` (solver's scale), with derivatives if asked for.
    pub fn baseline(&self, theta: &[f64], with_derivatives: bool) -> Baseline {
        let count = theta.len();
        let value = |i: usize| {
            let natural = self.parameters[i].natural(theta[i]);
            if !with_derivatives {
                return Dual::constant(natural);
            }
            let variable = Dual::variable(theta[i], i, count);
            match self.parameters[i].scale {
                Scale::Logarithmic => variable.chain(natural, natural),
                Scale::Linear => variable,
            }
        };
        let joints = self.robot.joint_count();
        let links = &self.robot.spec.links;
        let mass_scale = links.iter().enumerate().map(|(i, link)| {
            if self.tunes_masses && link.mass_kg > 0.0 {
                value(joints + 1 + i).scale(1.0 / link.mass_kg)
            } else {
                Dual::constant(1.0)
            }
        });
        Baseline {
            joint_stiffness_nm_per_rad: (0..joints).map(value).collect(),
            damping_ratio: value(joints),
            mass_scale: mass_scale.collect(),
            young_pa: None,
        }
    }

    fn basis(&self, theta: &[f64], block: &FrfBlock, with_derivatives: bool) -> Result<FrfBasis> {
        let baseline = self.baseline(theta, with_derivatives);
        let chain = self.robot.chain(&block.kinematics, &baseline);
        let rows: Vec<DVector<f64>> = block
            .outputs
            .iter()
            .map(|dof| {
                let point = &self.points[dof.point];
                self.robot
                    .output_row(&chain, &block.kinematics, point, dof.axis, dof.negative)
            })
            .collect();
        let count = if with_derivatives { theta.len() } else { 0 };
        FrfBasis::new(&chain.system(count), &rows)
    }

    /// Predicted receptances, m/N, in the order of `data.frfs()`.
    pub fn predict(&self, theta: &[f64], data: &FrfData) -> Result<Vec<Vec<Complex64>>> {
        let per_block: Vec<Vec<Vec<Complex64>>> = data
            .blocks
            .par_iter()
            .map(|block| {
                let basis = self.basis(theta, block, false)?;
                let mut response = Response::default();
                let mut columns = vec![Vec::with_capacity(block.frequency_hz.len()); block.frfs.len()];
                for f in &block.frequency_hz {
                    basis.solve(std::f64::consts::TAU * f, &mut response)?;
                    for (frf, column) in block.frfs.iter().zip(&mut columns) {
                        column.push(basis.receptance(&response, frf.out, frf.input));
                    }
                }
                Ok(columns)
            })
            .collect::<Result<_>>()?;
        Ok(per_block.into_iter().flatten().collect())
    }
}

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Misfit {
    /// ln|H| with a broad tolerance: smooth far from the optimum, where a model's peak stands beside the measured one.
    LogMagnitude,
    /// H itself against the measured noise: the likelihood.
    Complex,
}

/// Tolerance on ln|H| where the model is still wrong: differences far below this do not matter yet.
const LOG_TOLERANCE: f64 = 0.5;

/// Misfit of a model to FRFs plus the priors on its parameters.
pub struct FrfProblem<'a> {
    pub model: &'a StructureModel,
    pub data: &'a FrfData,
    pub misfit: Misfit,
    /// Every how many lines are used.
    pub stride: usize,
}

/// Lines one task works on: a fixed size, so that sums do not depend on the number of threads.
const CHUNK: usize = 64;

/// Sums over the residuals of a chunk of lines.
struct Partial {
    cost: f64,
    gradient: DVector<f64>,
    hessian: DMatrix<f64>,
}

impl Partial {
    fn zero(count: usize) -> Self {
        Partial {
            cost: 0.0,
            gradient: DVector::zeros(count),
            hessian: DMatrix::zeros(count, count),
        }
    }

    fn add(&mut self, other: &Partial) {
        self.cost += other.cost;
        self.gradient += &other.gradient;
        self.hessian += &other.hessian;
    }

    /// Adds a real residual with its derivatives.
    fn push(&mut self, residual: f64, slope: &[f64]) {
        self.cost += 0.5 * residual * residual;
        for (i, a) in slope.iter().enumerate() {
            self.gradient[i] += a * residual;
            // Lower triangle, column by column.
            for (j, b) in slope.iter().enumerate().skip(i) {
                self.hessian[(j, i)] += a * b;
            }
        }
    }
}

impl FrfProblem<'_> {
    fn evaluate(&self, theta: &[f64], with_derivatives: bool) -> Result<Partial> {
        let count = if with_derivatives { theta.len() } else { 0 };
        let bases: Vec<FrfBasis> = self
            .data
            .blocks
            .par_iter()
            .map(|block| self.model.basis(theta, block, with_derivatives))
            .collect::<Result<_>>()?;
        let tasks: Vec<(usize, usize)> = self
            .data
            .blocks
            .iter()
            .enumerate()
            .flat_map(|(b, block)| {
                let lines = block.frequency_hz.len().div_ceil(self.stride);
                (0..lines.div_ceil(CHUNK)).map(move |c| (b, c))
            })
            .collect();
        let parts: Vec<Partial> = tasks
            .par_iter()
            .map(|&(b, chunk)| self.chunk(&bases[b], &self.data.blocks[b], chunk, count))
            .collect::<Result<_>>()?;
        let mut total = Partial::zero(count);
        for part in &parts {
            total.add(part);
        }
        total.hessian.fill_upper_triangle_with_lower_triangle();
        for (i, (parameter, t)) in self.model.parameters.iter().zip(theta).enumerate() {
            if let Some(prior) = parameter.prior {
                let residual = (t - prior.mean) / prior.std;
                total.cost += 0.5 * residual * residual;
                if with_derivatives {
                    total.gradient[i] += residual / prior.std;
                    total.hessian[(i, i)] += 1.0 / (prior.std * prior.std);
                }
            }
        }
        Ok(total)
    }

    fn chunk(&self, basis: &FrfBasis, block: &FrfBlock, chunk: usize, count: usize) -> Result<Partial> {
        let mut partial = Partial::zero(count);
        let mut response = Response::default();
        let outputs = basis.output_count();
        let mut inputs: Vec<usize> = block.frfs.iter().map(|f| f.input).collect();
        inputs.sort_unstable();
        inputs.dedup();
        // slopes[p][input][out], flat
        let mut slopes = vec![Complex64::ZERO; count * inputs.len() * outputs];
        let mut slope = vec![Complex64::ZERO; count];
        let mut real = vec![0.0; count];
        let lines = (chunk * CHUNK..(chunk + 1) * CHUNK).map(|k| k * self.stride);
        for line in lines.take_while(|l| *l < block.frequency_hz.len()) {
            basis.solve(std::f64::consts::TAU * block.frequency_hz[line], &mut response)?;
            for p in 0..count {
                for (i, input) in inputs.iter().enumerate() {
                    let start = (p * inputs.len() + i) * outputs;
                    basis.sensitivities(&mut response, p, *input, &mut slopes[start..start + outputs]);
                }
            }
            for frf in &block.frfs {
                let model = basis.receptance(&response, frf.out, frf.input);
                let measured = frf.receptance[line];
                let std = frf.noise_std[line];
                if count > 0 {
                    let i = inputs.iter().position(|x| *x == frf.input).unwrap_or(0);
                    for (p, s) in slope.iter_mut().enumerate() {
                        *s = slopes[(p * inputs.len() + i) * outputs + frf.out];
                    }
                }
                match self.misfit {
                    Misfit::Complex => {
                        // Each of the two parts has half the variance.
                        let weight = std::f64::consts::SQRT_2 / std;
                        let residual = (model - measured) * weight;
                        for (r, s) in real.iter_mut().zip(&slope) {
                            *r = s.re * weight;
                        }
                        partial.push(residual.re, &real);
                        for (r, s) in real.iter_mut().zip(&slope) {
                            *r = s.im * weight;
                        }
                        partial.push(residual.im, &real);
                    }
                    Misfit::LogMagnitude => {
                        let (m, h) = (measured.norm(), model.norm());
                        if m > 0.0 && h > 0.0 {
                            let weight = 1.0 / LOG_TOLERANCE.hypot(std / m);
                            for (r, s) in real.iter_mut().zip(&slope) {
                                *r = (model.conj() * s).re / (h * h) * weight;
                            }
                            partial.push((h / m).ln() * weight, &real);
                        }
                    }
                }
            }
        }
        Ok(partial)
    }
}

impl LeastSquares for FrfProblem<'_> {
    fn cost(&self, theta: &[f64]) -> Result<f64> {
        Ok(self.evaluate(theta, false)?.cost)
    }

    fn linearise(&self, theta: &[f64]) -> Result<Linearisation> {
        let Partial {
            cost,
            gradient,
            hessian,
        } = self.evaluate(theta, true)?;
        Ok(Linearisation {
            cost,
            gradient,
            hessian,
        })
    }
}
