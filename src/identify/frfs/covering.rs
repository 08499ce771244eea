//! Standard errors that cover the truth also where the model is a little wrong.
//!
//! What noise leaves is independent from value to value. What a model leaves that is a little wrong is not: it errs the same way over
//! neighbouring lines, in all FRFs of a posture, and its parameters are what the postures and the frequencies at hand make of it.
//! Errors that count every value as a new witness are then too small, by a factor of ten and more. The data themselves say how much:
//! by how much the estimates move where one posture, or one stretch of the frequency, is left out (the jackknife of Quenouille 1956
//! and Tukey 1958 over groups, with one Gauss–Newton step for each refit: Miller, *Biometrika* 61, 1974, eq. 4.1).
//!
//! A misfit that all postures and all frequencies share in the same way leaves no trace in this: what a missing effect does to the
//! parameters is beyond any standard error.

use nalgebra::{DMatrix, DVector};

use crate::Result;
use crate::identify::frfs::calibrate::Calibration;
use crate::identify::frfs::frf_data::FrfData;
use crate::identify::frfs::frf_problem::FrfProblem;
use crate::identify::frfs::rival_optima::{self, STRETCHES};
use crate::identify::frfs::structure::StructureModel;
use crate::identify::levenberg_marquardt::Linearisation;
use crate::parameter::{Parameter, Scale};

/// Standard deviations of χ² by chance within which a misfit is one that noise leaves.
const BY_CHANCE: f64 = 3.0;

impl Calibration {
    /// The calibration of `model` to `data` with standard errors that are no smaller than what leaving out
    /// postures and stretches of the frequency in turn moves the parameters by. Unchanged where the misfit is what noise
    /// leaves: there the errors are known better from the noise than from a few groups. The covariance stays that of the noise.
    ///
    /// # Errors
    /// A model that cannot be set up where the calibration has it.
    pub fn covering(self, model: &StructureModel, data: &FrfData) -> Result<Self> {
        let by_chance = BY_CHANCE * (1.0 / data.value_count() as f64).sqrt();
        if self.reduced_chi2 <= 1.0 + by_chance {
            let rivals = Vec::new();
            return Ok(Calibration { rivals, ..self });
        }
        let problem = FrfProblem::likelihood(model, data);
        let parts = problem.by_block_and_stretch(&self.theta, STRETCHES)?;
        let of_posture = parts.iter().map(|(b, _, part)| (data.blocks[*b].posture, part));
        let of_stretch = parts.iter().map(|(_, stretch, part)| (*stretch, part));
        let mut prior = DVector::zeros(self.theta.len());
        for (i, parameter) in model.parameters.iter().enumerate() {
            prior[i] = parameter.prior.map_or(0.0, |p| p.half_square(self.theta[i])[2]);
        }
        let held: Vec<bool> = self.parameters.iter().map(|p| p.at_bound).collect();
        let mut calibration = self;
        let variances = [groups(of_posture), groups(of_stretch)].map(|g| jackknife(&g, &prior, &held));
        for (i, parameter) in model.parameters.iter().enumerate() {
            let largest = variances.iter().flatten().map(|v| v[i]).fold(0.0, f64::max);
            let factor = (largest / calibration.covariance[(i, i)]).sqrt();
            let factor = if factor.is_finite() { factor.max(1.0) } else { 1.0 };
            calibration.widen(i, parameter, factor);
        }
        // Where the data do not tell which of two optima it is, the error of one holds the other with its own.
        calibration.rivals = rival_optima::undecided(&calibration.rivals, &problem, &parts)?;
        for (i, parameter) in model.parameters.iter().enumerate() {
            let (here, value) = (calibration.theta[i], parameter.natural(calibration.theta[i]));
            let (mut way, mut natural_way) = (0.0_f64, 0.0_f64);
            for rival in &calibration.rivals {
                way = way.max((rival[i] - here).abs());
                natural_way = natural_way.max((parameter.natural(rival[i]) - value).abs());
            }
            let std = calibration.covariance[(i, i)].sqrt();
            let factor = calibration.widened[i] + way / std;
            if way > 0.0 && factor.is_finite() {
                // Of a logarithm so far away the slope says nothing: the way itself counts.
                calibration.widened[i] = factor;
                calibration.parameters[i].std_error += natural_way;
            }
        }
        Ok(calibration)
    }
}

impl Calibration {
    fn widen(&mut self, i: usize, parameter: &Parameter, factor: f64) {
        self.widened[i] = factor;
        let std = factor * self.covariance[(i, i)].sqrt();
        self.parameters[i].std_error = match parameter.scale {
            // Of what may be off by a factor e and more the error upwards, which is the larger one.
            Scale::Logarithmic if std > 1.0 => {
                let range = parameter.bounds[1] - parameter.bounds[0];
                (parameter.natural(self.theta[i]) * std.exp_m1()).min(range)
            }
            _ => parameter.natural_std(self.theta[i], std),
        };
    }
}

/// Sums over the parts with the same key.
fn groups<'a>(parts: impl Iterator<Item = (usize, &'a Linearisation)>) -> Vec<Linearisation> {
    let mut groups: std::collections::BTreeMap<usize, Linearisation> = Default::default();
    for (key, part) in parts {
        groups
            .entry(key)
            .and_modify(|sum| {
                sum.cost += part.cost;
                sum.gradient += &part.gradient;
                sum.hessian += &part.hessian;
            })
            .or_insert_with(|| part.clone());
    }
    groups.into_values().collect()
}

/// Variance of each parameter, solver's scale, from leaving out one group at a time: (G−1)/G Σ Δ², Δ being the Gauss–Newton step
/// that the other groups then take. `prior`: curvature that belongs to no group. `held` parameters do not move. `None` with one group.
fn jackknife(groups: &[Linearisation], prior: &DVector<f64>, held: &[bool]) -> Option<DVector<f64>> {
    let count = groups.len() as f64;
    let first = groups.first().filter(|_| groups.len() > 1)?;
    let mut all = DMatrix::from_diagonal(prior);
    groups.iter().for_each(|g| all += &g.hessian);
    let mut sum = DVector::zeros(first.gradient.len());
    for group in groups {
        // Where the others alone do not determine the parameters: the step that all take, larger by what the group is of them.
        let step = step(&(&all - &group.hessian), &group.gradient, held)
            .or_else(|| Some(step(&all, &group.gradient, held)? * (count / (count - 1.0))));
        sum += step?.map(|d| d * d);
    }
    Some(sum * ((count - 1.0) / count))
}

/// H⁻¹g over the parameters that are not held.
fn step(hessian: &DMatrix<f64>, gradient: &DVector<f64>, held: &[bool]) -> Option<DVector<f64>> {
    let free: Vec<usize> = (0..gradient.len()).filter(|i| !held[*i]).collect();
    let diagonal = free.iter().map(|&i| hessian[(i, i)]);
    // Solved on unit diagonal: the parameters' information differs by many orders of magnitude.
    let scale: Vec<f64> = diagonal.map(f64::sqrt).collect();
    if !scale.iter().all(|s| *s > 0.0) {
        return None;
    }
    let n = free.len();
    let scaled = DMatrix::from_fn(n, n, |i, j| hessian[(free[i], free[j])] / (scale[i] * scale[j]));
    let right = DVector::from_fn(n, |i, _| gradient[free[i]] / scale[i]);
    let solved = scaled.cholesky()?.solve(&right);
    let mut step = DVector::zeros(gradient.len());
    for (k, &i) in free.iter().enumerate() {
        step[i] = solved[k] / scale[k];
    }
    Some(step)
}

#[cfg(test)]
mod tests {
    use num_complex::Complex64;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::data::{AxesRef, Axis, BodyRef, MeasuredDof, MeasuredFrf, Point, Posture, RobotSpec};
    use crate::identify::Options;
    use crate::identify::frfs::calibrate::calibrate;
    use crate::identify::frfs::structure_case::StructureCase;

    /// The mean of numbers: leaving one out has a closed form, and the jackknife gives exactly s²/n (Efron 1982, section 3.1).
    #[test]
    fn of_a_mean_it_is_the_textbook_variance() {
        let values = [3.0, 5.0, 4.0, 9.0, 1.0];
        let mean = values.iter().sum::<f64>() / 5.0;
        let group = |x: &f64| Linearisation {
            cost: 0.5 * (mean - x).powi(2),
            gradient: DVector::from_element(1, mean - x),
            hessian: DMatrix::from_element(1, 1, 1.0),
        };
        let groups: Vec<Linearisation> = values.iter().map(group).collect();
        let found = jackknife(&groups, &DVector::zeros(1), &[false]).unwrap()[0];
        let expected = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 4.0 / 5.0;
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
        assert!(jackknife(&groups[..1], &DVector::zeros(1), &[false]).is_none());
        assert_eq!(jackknife(&groups, &DVector::zeros(1), &[true]).unwrap()[0], 0.0);
    }

    const POSTURES: [[f64; 6]; 6] = [
        [135.0, -2.0, 53.0, 83.0, 30.0, -117.0],
        [135.0, 20.0, 26.0, 30.0, 80.0, -150.0],
        [112.0, 5.0, 26.0, 56.0, 63.0, -84.0],
        [150.0, 20.0, 10.0, 40.0, 50.0, 0.0],
        [90.0, 10.0, 35.0, 20.0, 40.0, -60.0],
        [100.0, -10.0, 45.0, 70.0, 55.0, 30.0],
    ];

    /// FRFs of the built-in robot with 1 % noise, in which each joint is off by `scatter` (standard deviation, a share) from posture
    /// to posture; calibrated. How many standard errors each joint's stiffness is off, without and with the widening.
    fn off(scatter: f64, seed: u64) -> Vec<[f64; 2]> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        // Uniform between ±√3 has the standard deviation 1.
        let mut unit = || 3f64.sqrt() * random.random_range(-1.0..1.0);
        let robot = RobotSpec::load("irb6640", ".".as_ref()).unwrap();
        let postures: Vec<Posture> = POSTURES
            .iter()
            .enumerate()
            .map(|(i, q)| Posture {
                id: format!("p{i}"),
                joints_deg: q.to_vec(),
            })
            .collect();
        let points = vec![Point {
            node: 1,
            body: BodyRef::Tool,
            position_m: [0.0; 3],
            axes: AxesRef::Base,
        }];
        let frequency_hz: Vec<f64> = (0..320).map(|k| 4.0 + 0.25 * f64::from(k)).collect();
        let mut frfs = Vec::new();
        for posture in 0..postures.len() {
            for axis in [Axis::X, Axis::Y, Axis::Z] {
                let dof = MeasuredDof {
                    point: 0,
                    axis,
                    negative: false,
                };
                frfs.push(MeasuredFrf {
                    posture,
                    response: dof,
                    reference: dof,
                    name: format!("{posture} {axis:?}"),
                    frequency_hz: frequency_hz.clone(),
                    receptance_m_per_n: vec![Complex64::ONE; frequency_hz.len()],
                    coherence: None,
                    force_level_n: None,
                    file: Default::default(),
                });
            }
        }
        let made = StructureCase::new(robot.clone(), &postures, points.clone(), frfs.clone()).unwrap();
        let nominal = made.model.nominal_theta();
        for posture in 0..postures.len() {
            let mut theta = nominal.clone();
            // Logarithms of the joints' stiffnesses come first.
            theta[..6].iter_mut().for_each(|t| *t += scatter * unit());
            let exact = made.model.predict(&theta, &made.data).unwrap();
            for (frf, exact) in frfs.iter_mut().zip(exact).filter(|(f, _)| f.posture == posture) {
                let noisy = |h: &Complex64| h * (1.0 + 0.01 / 2f64.sqrt() * Complex64::new(unit(), unit()));
                frf.receptance_m_per_n = exact.iter().map(noisy).collect();
            }
        }
        let case = StructureCase::new(robot, &postures, points, frfs).unwrap();
        let before = calibrate(&case.model, &case.data, None, Options::default()).unwrap();
        let after = before.clone().covering(&case.model, &case.data).unwrap();
        (0..6)
            .map(|i| {
                let gone = before.theta[i] - nominal[i];
                [&before, &after].map(|c| gone / (c.widened[i] * c.covariance[(i, i)].sqrt()))
            })
            .collect()
    }

    fn rms(of: impl Iterator<Item = f64>) -> f64 {
        let (sum, count) = of.fold((0.0, 0.0), |(sum, n), z| (sum + z * z, n + 1.0));
        f64::sqrt(sum / count)
    }

    /// A model that holds one stiffness a joint where each posture has its own: the error of the mean is that of six postures, not
    /// that of some thousand lines.
    #[test]
    fn joints_that_differ_from_posture_to_posture_are_covered() {
        let all: Vec<[f64; 2]> = (1..=3).flat_map(|seed| off(0.01, seed)).collect();
        let (before, after) = (rms(all.iter().map(|z| z[0])), rms(all.iter().map(|z| z[1])));
        println!("{before:.1} standard errors of noise, {after:.2} of those stated");
        assert!(before > 4.0, "{before}: the case is too easy");
        assert!((0.3..2.0).contains(&after), "{before} {after} {all:?}");
        assert!(all.iter().all(|z| z[1].abs() < 5.0), "{all:?}");
    }

    /// Where noise alone is left nothing changes.
    #[test]
    fn noise_alone_widens_nothing() {
        let all = off(0.0, 1);
        assert!(all.iter().all(|z| z[0] == z[1]), "{all:?}");
        assert!(rms(all.iter().map(|z| z[0])) < 2.0, "{all:?}");
    }
}
