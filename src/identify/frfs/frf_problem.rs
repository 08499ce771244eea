//! The misfit of a structural model to measured FRFs, and what it leaves of them.

use std::ops::Range;

use num_complex::Complex64;
use rayon::prelude::*;

use crate::identify::frfs::channels::Channels;
use crate::identify::frfs::frf_data::{FrfBlock, FrfData, FrfDatum};
use crate::identify::frfs::structure::StructureModel;
use crate::identify::levenberg_marquardt::{LeastSquares, Linearisation};
use crate::identify::rest::RestCurve;
use crate::robot::FrfBasis;
use crate::robot::frf::{Response, Slopes};
use crate::{Result, stop};

/// What is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Misfit {
    /// ln|H| with a broad tolerance: smooth far from the optimum, where a model's peak stands next to the measured one.
    LogMagnitude,
    /// H itself against the measured noise: the likelihood.
    Complex,
}

/// Tolerance on ln|H| where the model is still wrong: differences far below this do not matter yet.
const LOG_TOLERANCE: f64 = 0.5;

/// Misfit of a model to FRFs plus the priors on its parameters.
pub struct FrfProblem<'a> {
    /// The model.
    pub model: &'a StructureModel,
    /// The FRFs that it is fitted to.
    pub data: &'a FrfData,
    /// How far apart a prediction and a measurement are.
    pub misfit: Misfit,
    /// Every how many lines are used.
    pub stride: usize,
}

/// Lines one task works on: a fixed size, so that sums do not depend on the number of threads.
const CHUNK: usize = 64;

impl<'a> FrfProblem<'a> {
    /// All lines, by likelihood.
    pub fn likelihood(model: &'a StructureModel, data: &'a FrfData) -> Self {
        FrfProblem {
            model,
            data,
            misfit: Misfit::Complex,
            stride: 1,
        }
    }
}

impl FrfProblem<'_> {
    /// Sums by block of the data and chunk of its lines, block by block; priors are left out. `size`: lines of a chunk, of a
    /// block of so many lines.
    fn partials(
        &self,
        theta: &[f64],
        with_derivatives: bool,
        size: impl Fn(usize) -> usize,
    ) -> Result<Vec<(usize, usize, Linearisation)>> {
        let count = if with_derivatives { theta.len() } else { 0 };
        let bases: Vec<FrfBasis> = self
            .data
            .blocks
            .par_iter()
            .map(|block| self.model.basis(theta, block, with_derivatives))
            .collect::<Result<_>>()?;
        let channels = Channels::new(&self.model.filter(theta, with_derivatives));
        let tasks: Vec<(usize, usize, Range<usize>)> = self
            .data
            .blocks
            .iter()
            .enumerate()
            .flat_map(|(b, block)| {
                let lines = block.frequency_hz.len().div_ceil(self.stride);
                let size = size(lines).max(1);
                (0..lines.div_ceil(size)).map(move |c| (b, c, c * size..(c + 1) * size))
            })
            .collect();
        tasks
            .into_par_iter()
            .map(|(b, chunk, lines)| {
                let partial = self.chunk(&bases[b], &channels, &self.data.blocks[b], lines, count)?;
                Ok((b, chunk, partial))
            })
            .collect()
    }

    /// The misfit by block of the data and by stretch of its lines, of which there are so many (fewer where there are fewer lines),
    /// block by block; priors are left out.
    ///
    /// # Errors
    /// A model that cannot be set up at `theta`.
    pub fn by_block_and_stretch(
        &self,
        theta: &[f64],
        stretches: usize,
    ) -> Result<Vec<(usize, usize, Linearisation)>> {
        let size = |lines: usize| lines.div_ceil(stretches.max(1));
        self.partials(theta, true, size)
    }

    /// Half the sum of squares at `theta` (solver's scale), with its derivatives if they are wanted; priors are left out.
    ///
    /// # Errors
    /// A model that cannot be set up at `theta`.
    pub fn of_data(&self, theta: &[f64], with_derivatives: bool) -> Result<Linearisation> {
        let mut total = Linearisation::zero(if with_derivatives { theta.len() } else { 0 });
        for (_, _, part) in &self.partials(theta, with_derivatives, |_| CHUNK)? {
            total.add(part);
        }
        Ok(total)
    }

    fn evaluate(&self, theta: &[f64], with_derivatives: bool) -> Result<Linearisation> {
        let mut total = self.of_data(theta, with_derivatives)?;
        for (i, (parameter, t)) in self.model.parameters.iter().zip(theta).enumerate() {
            if let Some(prior) = parameter.prior {
                total.add_half_square(i, prior.half_square(*t));
            }
        }
        Ok(total)
    }

    fn chunk(
        &self,
        basis: &FrfBasis,
        channels: &Channels,
        block: &FrfBlock,
        lines: Range<usize>,
        count: usize,
    ) -> Result<Linearisation> {
        stop::point();
        let mut sums = Linearisation::zero(count);
        let mut slope = vec![Complex64::ZERO; count];
        // Residuals of one line and their derivatives, column by column: real parts, then imaginary parts.
        let rows = match self.misfit {
            Misfit::Complex => 2 * block.frfs.len(),
            Misfit::LogMagnitude => block.frfs.len(),
        };
        let mut residual = vec![0.0; rows];
        let mut jacobian = vec![0.0; rows * count];
        let lines: Vec<usize> = lines
            .map(|k| k * self.stride)
            .take_while(|l| *l < block.frequency_hz.len())
            .collect();
        let rates: Vec<Complex64> = lines.iter().map(|l| block.rate(*l)).collect();
        let mut add = |k: usize, response: &Response, slopes: Option<&Slopes>| {
            let line = lines[k];
            for (k, frf) in block.frfs.iter().enumerate() {
                let model = channels.measured(frf, basis, response);
                let measured = frf.receptance[line];
                let std = frf.noise_std[line];
                if let Some(slopes) = slopes {
                    let true_slope = slopes.along(frf.input);
                    channels.slopes(frf, model, (basis, response), true_slope, &mut slope);
                }
                match self.misfit {
                    Misfit::Complex => {
                        // Each of the two parts has half the variance.
                        let weight = std::f64::consts::SQRT_2 / std;
                        let difference = (model - measured) * weight;
                        residual[2 * k] = difference.re;
                        residual[2 * k + 1] = difference.im;
                        for (p, s) in slope.iter().enumerate() {
                            jacobian[rows * p + 2 * k] = s.re * weight;
                            jacobian[rows * p + 2 * k + 1] = s.im * weight;
                        }
                    }
                    Misfit::LogMagnitude => {
                        let (m, h) = (measured.norm(), model.norm());
                        let weight = if m > 0.0 && h > 0.0 {
                            1.0 / LOG_TOLERANCE.hypot(std / m)
                        } else {
                            0.0
                        };
                        residual[k] = if weight > 0.0 { (h / m).ln() * weight } else { 0.0 };
                        for (p, s) in slope.iter().enumerate() {
                            jacobian[rows * p + k] = if weight > 0.0 {
                                (model.conj() * s).re / (h * h) * weight
                            } else {
                                0.0
                            };
                        }
                    }
                }
            }
            sums.push(&residual, &jacobian);
            Ok(())
        };
        let inputs = block.inputs();
        match count {
            0 => basis.solve_lines(&rates, &inputs, |k, response| add(k, response, None))?,
            _ => basis.solve_lines_with_slopes(&rates, &inputs, |k, response, slopes| {
                add(k, response, Some(slopes))
            })?,
        }
        Ok(sums)
    }
}

impl LeastSquares for FrfProblem<'_> {
    fn cost(&self, theta: &[f64]) -> Result<f64> {
        Ok(self.evaluate(theta, false)?.cost)
    }

    fn linearise(&self, theta: &[f64]) -> Result<Linearisation> {
        self.evaluate(theta, true)
    }
}

impl StructureModel {
    /// What the model at `theta` leaves of each FRF, with the patterns that an error of it may have, in the order of
    /// `data.frfs()`.
    pub fn rest(&self, theta: &[f64], data: &FrfData) -> Result<Vec<RestCurve>> {
        let channels = Channels::new(&self.filter(theta, true));
        let postures = data.measured_postures();
        let mut hits: Vec<(usize, usize)> = Vec::new();
        for (b, block) in data.blocks.iter().enumerate() {
            hits.extend(block.frfs.iter().map(|frf| (b, frf.input)));
        }
        hits.sort_unstable();
        hits.dedup();
        let place = |sorted: Option<usize>| sorted.unwrap_or(0);
        let blocks: Vec<Vec<RestCurve>> = data
            .blocks
            .par_iter()
            .enumerate()
            .map(|(b, block)| {
                let empty = |frf: &FrfDatum| RestCurve {
                    fold: place(postures.binary_search(&block.posture).ok()),
                    source: place(hits.binary_search(&(b, frf.input)).ok()),
                    rest: Vec::with_capacity(block.frequency_hz.len()),
                    slopes: vec![Vec::with_capacity(block.frequency_hz.len()); theta.len()],
                    // A gain and a phase, and both growing with the frequency (a delay).
                    own: vec![Vec::new(); 2],
                };
                let mut curves: Vec<RestCurve> = block.frfs.iter().map(empty).collect();
                let basis = self.basis(theta, block, true)?;
                let mut slope = vec![Complex64::ZERO; theta.len()];
                basis.solve_lines_with_slopes(
                    &block.rates(),
                    &block.inputs(),
                    |line, response, slopes| {
                        let f = block.frequency_hz[line];
                        for (frf, curve) in block.frfs.iter().zip(&mut curves) {
                            let model = channels.measured(frf, &basis, response);
                            let true_slope = slopes.along(frf.input);
                            channels.slopes(frf, model, (&basis, response), true_slope, &mut slope);
                            let weight = 1.0 / frf.noise_std[line];
                            curve.rest.push((model - frf.receptance[line]) * weight);
                            for (column, s) in curve.slopes.iter_mut().zip(&slope) {
                                column.push(s * weight);
                            }
                            for (column, factor) in curve.own.iter_mut().zip([1.0, f]) {
                                column.push(model * (weight * factor));
                            }
                        }
                        Ok(())
                    },
                )?;
                Ok(curves)
            })
            .collect::<Result<_>>()?;
        Ok(blocks.into_iter().flatten().collect())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::data::{AxesRef, Axis, BodyRef, MeasuredDof, Point, RobotSection};
    use crate::effects::{self, Registry, Spot};
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::frf::natural_frequencies_hz;
    use crate::robot::{Baseline, RobotModel};

    fn section() -> RobotSection {
        RobotSection {
            model: "irb6640".into(),
            mass_tolerance: Some(0.05),
            stiffness_tolerance: 0.3,
            links: Default::default(),
        }
    }

    pub(in crate::identify::frfs) fn model() -> StructureModel {
        let point = |node, body| Point {
            node,
            body,
            position_m: [0.0; 3],
            axes: AxesRef::Base,
        };
        let points = vec![point(1, BodyRef::Tool), point(2, BodyRef::Link(3))];
        StructureModel::new(RobotModel::new(irb6640()), points, &section())
    }

    /// The same with all numbers of the links free.
    fn with_free_links(exact: &StructureModel) -> StructureModel {
        let section = section().freeing(&crate::data::LinkGroup::ALL);
        StructureModel::new(exact.robot.clone(), exact.points.clone(), &section)
    }

    /// Two postures at two levels; a few lines; noise of 1 % of the magnitude.
    pub(in crate::identify::frfs) fn data(model: &StructureModel) -> FrfData {
        let blocks = TAP_POSTURES[..2]
            .iter()
            .enumerate()
            .map(|(posture, q)| {
                let outputs: Vec<(usize, Axis)> = [0, 1]
                    .into_iter()
                    .flat_map(|p| Axis::ALL.map(|a| (p, a)))
                    .collect();
                let dof = |point, axis| MeasuredDof {
                    point,
                    axis,
                    negative: false,
                };
                let frfs = [(0, Axis::X, 0), (0, Axis::Y, 1), (1, Axis::Z, 1)]
                    .into_iter()
                    .map(|(point, axis, input)| FrfDatum {
                        name: String::new(),
                        posture,
                        response: dof(point, axis),
                        reference: dof(0, Axis::ALL[input]),
                        response_outputs: [3 * point, 3 * point + 1, 3 * point + 2],
                        input,
                        sign: if point == 1 { -1.0 } else { 1.0 },
                        receptance: vec![Complex64::new(1e-6, -2e-6); 5],
                        noise_std: vec![1e-8; 5],
                    })
                    .collect();
                FrfBlock {
                    posture,
                    force_level_n: None,
                    conditions: effects::Conditions {
                        level_fraction: posture as f64,
                        order_fraction: posture as f64,
                    },
                    kinematics: model.robot.kinematics(q).unwrap(),
                    frequency_hz: vec![6.0, 9.0, 14.0, 22.0, 47.0],
                    outputs,
                    frfs,
                }
            })
            .map(std::sync::Arc::new)
            .collect();
        FrfData {
            blocks,
            posture_ids: vec!["a".into(), "b".into()],
        }
    }

    /// The gradient of both misfits at `theta` against central differences of the cost.
    fn agrees_with_differences(model: &StructureModel, data: &FrfData, theta: &[f64], what: &str) {
        for misfit in [Misfit::Complex, Misfit::LogMagnitude] {
            let problem = FrfProblem {
                model,
                data,
                misfit,
                stride: 1,
            };
            let here = problem.linearise(theta).unwrap();
            for p in 0..theta.len() {
                let h = 1e-6 * theta[p].abs().max(1e-3);
                let at = |sign: f64| {
                    let mut t = theta.to_vec();
                    t[p] += sign * h;
                    problem.cost(&t).unwrap()
                };
                let difference = (at(1.0) - at(-1.0)) / (2.0 * h);
                let scale = (here.hessian[(p, p)] * here.cost).sqrt() + here.gradient[p].abs();
                let rounding = 1e-13 * here.cost / h;
                assert!(
                    (here.gradient[p] - difference).abs() < 2e-5 * scale + 10.0 * rounding,
                    "{what} {misfit:?} {}: {} {difference}",
                    model.parameters[p].name,
                    here.gradient[p]
                );
            }
        }
    }

    /// Every effect's derivatives, and those of the baseline with it, against central differences of the cost.
    #[test]
    fn gradients_of_all_effects_agree_with_differences() {
        let bare = model();
        let data = data(&bare);
        let summary = data.summary();
        let resonator = Registry::structure().find(&bare.robot.spec, "local-resonator@link-3");
        let drawn = [
            Spot::LinkAxis(5, 2),
            Spot::ToolGround(0),
            Spot::Joint(2),
            Spot::Base(3),
            Spot::Base(1),
            Spot::Bearing(3, 1),
            Spot::Drive(2),
        ];
        let drawn = drawn.into_iter().flat_map(|spot| {
            let forms = effects::drawn::forms(spot).into_iter();
            forms.map(move |form| effects::drawn::instance(spot, form))
        });
        for instance in Registry::structure()
            .instances(&bare.robot.spec)
            .into_iter()
            .chain(drawn)
        {
            for also in [None, resonator.first()] {
                let mut model = bare.with_effect(instance, &bare.known(&summary));
                if let Some(also) = also {
                    model = model.with_effect(*also, &model.known(&summary));
                }
                let mut theta = model.nominal_theta();
                for (i, t) in theta.iter_mut().enumerate() {
                    *t += 0.01 * (1.0 + i as f64).sin();
                }
                agrees_with_differences(&model, &data, &theta, &format!("{instance:?}"));
            }
        }
    }

    /// What the channels do to an FRF, a late and a turned sensor, in a second; the robot's own effects take longer, above.
    #[test]
    fn gradients_of_the_channels_agree_with_differences() {
        let bare = model();
        let data = data(&bare);
        let summary = data.summary();
        for labels in [
            &["time-delay"][..],
            &["sensor-misalignment"],
            &["time-delay", "sensor-misalignment"],
        ] {
            let mut model = bare.clone();
            for label in labels {
                let instance = Registry::structure().find(&bare.robot.spec, label)[0];
                model = model.with_effect(instance, &model.known(&summary));
            }
            let mut theta = model.nominal_theta();
            for (i, t) in theta.iter_mut().enumerate() {
                *t += 0.01 * (1.0 + i as f64).sin();
            }
            agrees_with_differences(&model, &data, &theta, &format!("{labels:?}"));
        }
    }

    /// Moments of inertia, centres of mass, lengths and walls: the same, alone and with effects that use what they change.
    #[test]
    fn gradients_of_link_parameters_agree_with_differences() {
        let exact = model();
        let data = data(&exact);
        let free = with_free_links(&exact);
        // Six stiffnesses, damping, six masses; 18 moments, 18 coordinates, 8 lengths, 5 walls.
        assert_eq!(free.parameters.len(), 13 + 18 + 18 + 8 + 5);
        let summary = data.summary();
        for label in [
            None,
            Some("link-flexibility"),
            Some("load-dependent-stiffness"),
            Some("payload"),
            Some("tool-flexibility"),
            Some("joint-damping"),
        ] {
            let effect = label.map(|label| Registry::structure().find(&free.robot.spec, label)[0]);
            let model = match effect {
                Some(instance) => free.with_effect(instance, &free.known(&summary)),
                None => free.clone(),
            };
            let mut theta = model.nominal_theta();
            for (i, t) in theta.iter_mut().enumerate() {
                *t += 0.01 * (1.0 + i as f64).sin();
            }
            agrees_with_differences(&model, &data, &theta, label.unwrap_or("alone"));
        }
    }

    /// Numbers that are free but stand where the file has them change no prediction.
    #[test]
    fn free_numbers_at_the_files_values_are_the_file() {
        let exact = model();
        let data = data(&exact);
        let free = with_free_links(&exact);
        let (a, b) = (
            exact.predict(&exact.nominal_theta(), &data).unwrap(),
            free.predict(&free.nominal_theta(), &data).unwrap(),
        );
        for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
            assert!((a - b).norm() < 1e-9 * a.norm(), "{a} {b}");
        }
    }

    /// The robot as fitted, written down, is the model where it stands: with its own values as the robot file's nothing moves.
    #[test]
    fn the_robot_as_fitted_is_the_model() {
        let exact = model();
        for section in [section().freeing(&crate::data::LinkGroup::ALL), {
            let masses = [crate::data::LinkGroup::Masses];
            section().freeing(&masses)
        }] {
            let free = StructureModel::new(exact.robot.clone(), exact.points.clone(), &section);
            let theta: Vec<f64> = free
                .parameters
                .iter()
                .enumerate()
                .map(|(i, p)| {
                    let off = 1.0 + 0.04 * ((i % 5) as f64 - 2.0);
                    match p.unit {
                        "m" => p.internal(p.nominal + 0.01 * ((i % 3) as f64 - 1.0)),
                        "1" => p.internal(p.nominal),
                        _ => p.internal(p.nominal * off),
                    }
                })
                .collect();
            let written = free.robot_as_fitted(&theta);
            for posture in &TAP_POSTURES {
                let kinematics = exact.robot.kinematics(posture).unwrap();
                let chain = free.chain(&theta, &kinematics, Default::default(), false);
                let expected = natural_frequencies_hz(&chain.system(0)).unwrap();
                let kinematics = written.kinematics(posture).unwrap();
                let chain = written.chain(&kinematics, &Baseline::nominal(&written.spec));
                let found = natural_frequencies_hz(&chain.system(0)).unwrap();
                for (e, f) in expected.iter().zip(&found) {
                    approx::assert_relative_eq!(e, f, max_relative = 1e-9);
                }
            }
        }
    }
}
