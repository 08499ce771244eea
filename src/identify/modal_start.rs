//! Where a calibration starts: the damping and the joint stiffnesses that the measured modes of the postures ask for.
//!
//! A model whose first modes lie a few half-widths from the measured ones sits between peaks, and a fit of the FRFs from
//! there may end in the wrong valley. Frequencies have no such valleys: they are matched in their order, posture by
//! posture, and the stiffnesses fitted to them under their priors.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::levenberg_marquardt::{LeastSquares, Linearisation, Stopping, minimise};
use super::posture_modes::posture_modes;
use super::structure::StructureModel;
use crate::Result;
use crate::robot::Kinematics;

/// How well a frequency of the right model is known beforehand to agree, natural logarithm: physics that the model lacks
/// moves modes by more than noise does.
const FREQUENCY_LOG_STD: f64 = 0.05;
/// A measured mode further than this from every mode of the model (natural logarithm) is not one of them.
const FURTHEST: f64 = 0.4;
/// Modes above this multiple of the first are left out: links bend there.
const HIGHEST: f64 = 4.0;
const MATCHINGS: usize = 4;

/// The modes measured at one posture.
#[derive(Debug, Clone)]
pub struct PostureMeasurement {
    pub kinematics: Kinematics,
    /// Frequency (Hz) and damping ratio, ascending in frequency.
    pub modes: Vec<[f64; 2]>,
}

/// A starting point from measured modes.
#[derive(Debug, Clone, Serialize)]
pub struct ModalStart {
    /// Median damping ratio of the measured modes.
    pub damping_ratio: f64,
    /// Measured modes that have a counterpart in the model …
    pub matched: usize,
    /// … of so many.
    pub measured: usize,
    /// rms of ln(measured/model) of their frequencies: with the robot file's values, and at the start.
    pub frequency_error_before: f64,
    pub frequency_error: f64,
    /// On the solver's scale.
    #[serde(skip)]
    pub theta: Vec<f64>,
}

/// The starting point that measured modes give; `None` where there are none.
///
/// # Errors
/// A chain whose stiffness is not positive definite.
pub fn modal_start(model: &StructureModel, postures: &[PostureMeasurement]) -> Result<Option<ModalStart>> {
    let mut damping: Vec<f64> = postures
        .iter()
        .flat_map(|p| p.modes.iter().map(|m| m[1]))
        .filter(|z| *z > 0.0)
        .collect();
    if damping.is_empty() {
        return Ok(None);
    }
    damping.sort_by(f64::total_cmp);
    let damping_ratio = damping[damping.len() / 2];
    let joints = model.robot.joint_count();
    let bounds = model.bounds();
    let mut theta = model.nominal_theta();
    theta[joints] = model.parameters[joints]
        .internal(damping_ratio)
        .clamp(bounds[joints][0], bounds[joints][1]);

    let mut matches = matched(model, &theta, postures)?;
    let mut before = 0.0;
    for round in 0..MATCHINGS {
        let problem = Frequencies {
            model,
            postures,
            matches: &matches,
        };
        if round == 0 {
            before = problem.error(&theta)?;
        }
        theta = minimise(&problem, &theta, &bounds, Stopping::default())?.theta;
        let next = matched(model, &theta, postures)?;
        if next == matches {
            break;
        }
        matches = next;
    }
    let problem = Frequencies {
        model,
        postures,
        matches: &matches,
    };
    Ok(Some(ModalStart {
        damping_ratio,
        matched: matches.len(),
        measured: postures.iter().map(|p| p.modes.len()).sum(),
        frequency_error_before: before,
        frequency_error: problem.error(&theta)?,
        theta,
    }))
}

/// A measured mode and its counterpart: posture, index among the measured, index among the model's.
type Match = [usize; 3];

/// Pairs in ascending order, the closest first; a pair never crosses another.
fn matched(model: &StructureModel, theta: &[f64], postures: &[PostureMeasurement]) -> Result<Vec<Match>> {
    let mut result = Vec::new();
    for (p, posture) in postures.iter().enumerate() {
        let Some(first) = posture.modes.first() else {
            continue;
        };
        let measured: Vec<f64> = posture
            .modes
            .iter()
            .map(|m| m[0])
            .filter(|f| *f <= HIGHEST * first[0])
            .collect();
        let highest = measured.last().map_or(0.0, |f| f * FURTHEST.exp());
        let modes = posture_modes(model, theta, &posture.kinematics, highest, false)?;
        let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
        for (i, f) in measured.iter().enumerate() {
            for (k, mode) in modes.iter().enumerate() {
                let apart = (f / mode.frequency_hz).ln().abs();
                if apart < FURTHEST {
                    pairs.push((apart, i, k));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut kept: Vec<Match> = Vec::new();
        for (_, i, k) in pairs {
            // Both later or both earlier than every pair that is there.
            let in_order = kept
                .iter()
                .all(|m| (m[1] < i && m[2] < k) || (m[1] > i && m[2] > k));
            if in_order {
                kept.push([p, i, k]);
            }
        }
        kept.sort_unstable();
        result.extend(kept);
    }
    Ok(result)
}

/// ln(measured/model) of the matched frequencies, with the priors of the parameters.
struct Frequencies<'a> {
    model: &'a StructureModel,
    postures: &'a [PostureMeasurement],
    matches: &'a [Match],
}

impl Frequencies<'_> {
    /// ln(measured/model) of every match, with −∂/∂theta where asked for.
    fn residuals(&self, theta: &[f64], with_derivatives: bool) -> Result<Vec<(f64, Vec<f64>)>> {
        let mut result = Vec::with_capacity(self.matches.len());
        for of_posture in self.matches.chunk_by(|a, b| a[0] == b[0]) {
            let posture = &self.postures[of_posture[0][0]];
            let modes = posture_modes(
                self.model,
                theta,
                &posture.kinematics,
                f64::INFINITY,
                with_derivatives,
            )?;
            for [_, i, k] in of_posture {
                // posture_modes is ascending, so that an index means the same mode with any upper end.
                let Some(mode) = modes.get(*k) else { continue };
                let apart = (posture.modes[*i][0] / mode.frequency_hz).ln();
                result.push((apart, mode.ln_frequency_slope.clone()));
            }
        }
        Ok(result)
    }

    /// rms of ln(measured/model).
    fn error(&self, theta: &[f64]) -> Result<f64> {
        let all = self.residuals(theta, false)?;
        Ok((all.iter().map(|(r, _)| r * r).sum::<f64>() / all.len().max(1) as f64).sqrt())
    }
}

impl LeastSquares for Frequencies<'_> {
    fn cost(&self, theta: &[f64]) -> Result<f64> {
        Ok(self.sum(theta, false)?.cost)
    }

    fn linearise(&self, theta: &[f64]) -> Result<Linearisation> {
        self.sum(theta, true)
    }
}

impl Frequencies<'_> {
    fn sum(&self, theta: &[f64], with_derivatives: bool) -> Result<Linearisation> {
        let count = theta.len();
        let mut sum = Linearisation {
            cost: 0.0,
            gradient: DVector::zeros(count),
            hessian: DMatrix::zeros(count, count),
        };
        for (apart, ln_frequency_slope) in self.residuals(theta, with_derivatives)? {
            let residual = apart / FREQUENCY_LOG_STD;
            sum.cost += 0.5 * residual * residual;
            if with_derivatives {
                let slope = DVector::from_vec(ln_frequency_slope) / -FREQUENCY_LOG_STD;
                sum.gradient += &slope * residual;
                sum.hessian += &slope * slope.transpose();
            }
        }
        let damping = self.model.robot.joint_count();
        for (i, (parameter, t)) in self.model.parameters.iter().zip(theta).enumerate() {
            // Frequencies say nothing of the damping: it stays at the median of the measured ones.
            if let Some(prior) = parameter.prior.filter(|_| i != damping) {
                let residual = (t - prior.mean) / prior.std;
                sum.cost += 0.5 * residual * residual;
                sum.gradient[i] += residual / prior.std;
                sum.hessian[(i, i)] += prior.std.powi(-2);
            }
        }
        sum.hessian[(damping, damping)] += 1.0;
        Ok(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::RobotSection;
    use crate::robot::RobotModel;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};

    fn model() -> StructureModel {
        let section = RobotSection {
            model: "irb6640".into(),
            mass_tolerance: None,
            stiffness_tolerance: 0.3,
        };
        StructureModel::new(RobotModel::new(irb6640()), Vec::new(), &section)
    }

    /// Modes of a robot a fifth to a third off, one of them not seen and one that is none of the robot's: the start has
    /// its frequencies, while the nominal model is off by a tenth.
    #[test]
    fn measured_modes_bring_the_model_to_their_frequencies() {
        let model = model();
        let mut truth = model.nominal_theta();
        for (t, off) in truth.iter_mut().zip([0.3, -0.35, 0.25, -0.2, 0.3, -0.25]) {
            *t += off;
        }
        let postures: Vec<PostureMeasurement> = TAP_POSTURES
            .iter()
            .map(|posture| {
                let kinematics = model.robot.kinematics(posture).unwrap();
                let modes = posture_modes(&model, &truth, &kinematics, 60.0, false).unwrap();
                let mut modes: Vec<[f64; 2]> = modes.iter().map(|m| [m.frequency_hz, 0.045]).collect();
                modes.remove(2);
                modes.push([modes[1][0] * 1.13, 0.045]);
                modes.sort_by(|a, b| a[0].total_cmp(&b[0]));
                PostureMeasurement { kinematics, modes }
            })
            .collect();
        let start = modal_start(&model, &postures).unwrap().unwrap();
        assert!((start.damping_ratio - 0.045).abs() < 1e-12);
        assert!(start.matched < start.measured);
        for posture in &postures {
            let at = |theta: &[f64]| {
                let modes = posture_modes(&model, theta, &posture.kinematics, 60.0, false).unwrap();
                (modes[0].frequency_hz, modes[1].frequency_hz)
            };
            let (wanted, found, nominal) = (at(&truth), at(&start.theta), at(&model.nominal_theta()));
            assert!((found.0 / wanted.0).ln().abs() < 0.03, "{found:?} for {wanted:?}");
            assert!((found.1 / wanted.1).ln().abs() < 0.03, "{found:?} for {wanted:?}");
            assert!(
                (nominal.0 / wanted.0).ln().abs() > 0.05,
                "{nominal:?} for {wanted:?}"
            );
        }
    }

    #[test]
    fn no_modes_no_start() {
        let model = model();
        let kinematics = model.robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let posture = PostureMeasurement {
            kinematics,
            modes: Vec::new(),
        };
        assert!(modal_start(&model, &[posture]).unwrap().is_none());
    }
}
