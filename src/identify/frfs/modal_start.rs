//! Where a calibration starts: the damping and the joint stiffnesses that the measured modes of the postures ask for.
//!
//! A model whose first modes lie a few half-widths from the measured ones sits between peaks, and a fit of the FRFs from
//! there may end in the wrong valley. Frequencies have no such valleys: they are matched in their order, posture by
//! posture, and the stiffnesses fitted to them under their priors. Matched by frequency alone a mode may be taken for its
//! neighbour where stiffnesses are off by a third in opposite directions: a start is one of several, never the answer.

use nalgebra::DVector;
use serde::Serialize;

use crate::Result;
use crate::identify::frfs::posture_modes::posture_modes;
use crate::identify::frfs::structure::StructureModel;
use crate::identify::levenberg_marquardt::{LeastSquares, Linearisation, Stopping, minimise};
use crate::robot::Kinematics;

/// How well a frequency of the right model is known beforehand to agree, natural logarithm: physics that the model lacks
/// moves modes by more than noise does.
const FREQUENCY_LOG_STD: f64 = 0.05;
/// How far a mode of the right kind may lie from the model's, natural logarithm, when they are paired.
const PAIRING_LOG_STD: f64 = 0.08;
/// Cost of a mode without a counterpart: two of them, one on either side, are as dear as a pair three deviations off.
const ALONE: f64 = 4.5;
/// Common factors on the frequencies that are tried: so many to either side, to this natural logarithm …
const FACTORS: i32 = 20;
const LARGEST_LN_FACTOR: f64 = 0.3;
/// … and its usual size.
const LN_FACTOR_STD: f64 = 0.15;
/// Modes of the model are looked at up to this multiple of the last measured one.
const REACH: f64 = 1.5;
/// Modes above this multiple of the first are left out: links bend there.
const HIGHEST: f64 = 4.0;
const MATCHINGS: usize = 4;

/// The modes measured at one posture.
#[derive(Debug, Clone)]
pub struct PostureMeasurement {
    /// Where the robot's frames are there.
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
    /// The same at the start.
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

    let mut matches = Spectra::new(model, &theta, postures)?.matched_at_best_factor();
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
        let (_, next) = Spectra::new(model, &theta, postures)?.matched(1.0);
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

/// The modes of the model at `theta` and the measured ones, as frequencies (Hz) by posture.
struct Spectra {
    measured: Vec<Vec<f64>>,
    model: Vec<Vec<f64>>,
}

impl Spectra {
    fn new(model: &StructureModel, theta: &[f64], postures: &[PostureMeasurement]) -> Result<Self> {
        let mut spectra = Spectra {
            measured: Vec::with_capacity(postures.len()),
            model: Vec::with_capacity(postures.len()),
        };
        for posture in postures {
            let first = posture.modes.first().map_or(0.0, |m| m[0]);
            let measured = posture.modes.iter().map(|m| m[0]);
            let measured: Vec<f64> = measured.filter(|f| *f <= HIGHEST * first).collect();
            let highest = measured.last().map_or(0.0, |f| f * REACH);
            let modes = posture_modes(model, theta, &posture.kinematics, highest, false)?;
            spectra.model.push(modes.iter().map(|m| m.frequency_hz).collect());
            spectra.measured.push(measured);
        }
        Ok(spectra)
    }

    /// What belongs to what with the model's frequencies multiplied by `factor`, and its cost.
    fn matched(&self, factor: f64) -> (f64, Vec<Match>) {
        let mut total = 0.0;
        let mut result = Vec::new();
        for (p, (measured, model)) in self.measured.iter().zip(&self.model).enumerate() {
            let (cost, pairs) = align(measured, model, factor);
            total += cost;
            result.extend(pairs.into_iter().map(|[i, k]| [p, i, k]));
        }
        (total, result)
    }

    /// As [`Spectra::matched`], with the common factor on all frequencies that lets most of them agree: springs that are
    /// all too soft must not shift every mode to its neighbour.
    fn matched_at_best_factor(&self) -> Vec<Match> {
        let tries = (-FACTORS..=FACTORS).map(|k| {
            let ln = LARGEST_LN_FACTOR * f64::from(k) / f64::from(FACTORS);
            let (cost, pairs) = self.matched(ln.exp());
            (cost + (ln / LN_FACTOR_STD).powi(2), pairs)
        });
        tries
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or_else(Vec::new, |(_, pairs)| pairs)
    }
}

/// Pairs in ascending order on both sides, the cheapest such (dynamic programming as in Needleman & Wunsch 1970): a pair
/// costs the squared distance, a mode without a counterpart [`ALONE`].
fn align(measured: &[f64], model: &[f64], factor: f64) -> (f64, Vec<[usize; 2]>) {
    let (rows, columns) = (measured.len(), model.len());
    // Modes of the model beyond the last measured one cost nothing: they were not looked for.
    let last = measured.last().copied().unwrap_or(0.0);
    let skip_model = |k: usize| if factor * model[k] > last { 0.0 } else { ALONE };
    let mut cost = vec![vec![0.0; columns + 1]; rows + 1];
    for i in 0..=rows {
        for k in 0..=columns {
            cost[i][k] = match (i, k) {
                (0, 0) => 0.0,
                (_, 0) => cost[i - 1][0] + ALONE,
                (0, _) => cost[0][k - 1] + skip_model(k - 1),
                _ => {
                    let pair = cost[i - 1][k - 1] + distance(measured[i - 1], factor * model[k - 1]);
                    let alone = (cost[i - 1][k] + ALONE).min(cost[i][k - 1] + skip_model(k - 1));
                    pair.min(alone)
                }
            };
        }
    }
    let mut pairs = Vec::new();
    let (mut i, mut k) = (rows, columns);
    while i > 0 && k > 0 {
        if cost[i][k] == cost[i - 1][k] + ALONE {
            i -= 1;
        } else if cost[i][k] == cost[i][k - 1] + skip_model(k - 1) {
            k -= 1;
        } else {
            (i, k) = (i - 1, k - 1);
            pairs.push([i, k]);
        }
    }
    pairs.reverse();
    (cost[rows][columns], pairs)
}

fn distance(measured_hz: f64, model_hz: f64) -> f64 {
    ((measured_hz / model_hz).ln() / PAIRING_LOG_STD).powi(2)
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
        let mut sum = Linearisation::zero(count);
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
                sum.add_half_square(i, prior.half_square(*t));
            }
        }
        sum.hessian[(damping, damping)] += 1.0;
        Ok(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::RobotSection;
    use crate::robot::RobotModel;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};

    fn model() -> StructureModel {
        let section = RobotSection {
            model: "irb6640".into(),
            mass_tolerance: None,
            stiffness_tolerance: 0.3,
            links: Default::default(),
        };
        StructureModel::new(RobotModel::new(irb6640()), Vec::new(), &section)
    }

    /// Modes of a robot with joints a tenth to a quarter stiffer than its file says, one of them not seen and one that is
    /// none of the robot's: the start has its frequencies, the nominal model has not.
    #[test]
    fn measured_modes_bring_the_model_to_their_frequencies() {
        let model = model();
        let mut truth = model.nominal_theta();
        for (t, off) in truth.iter_mut().zip([0.25, 0.2, 0.25, 0.1, 0.2, 0.15]) {
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
    fn pairs_keep_their_order_and_leave_strangers_alone() {
        let (_, pairs) = align(&[6.0, 9.0, 12.0], &[6.1, 7.0, 11.8, 30.0], 1.0);
        assert_eq!(pairs, [[0, 0], [2, 2]]);
        let (_, pairs) = align(&[6.0, 9.0, 12.0], &[5.0, 7.5, 10.0], 1.2);
        assert_eq!(pairs, [[0, 0], [1, 1], [2, 2]]);
        assert!(align(&[], &[5.0], 1.0).1.is_empty());
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
