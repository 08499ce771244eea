//! Calibration where only a table of the strongest modes was measured: frequency, damping and peak real receptance of
//! the dominant mode in each axis, posture by posture.

use nalgebra::DVector;

use crate::Result;
use crate::data::Axis;
use crate::identify::frfs::posture_modes::{PostureMode, posture_modes};
use crate::identify::frfs::structure::StructureModel;
use crate::identify::levenberg_marquardt::{Fit, LeastSquares, Linearisation, Stopping, minimise};
use crate::robot::Kinematics;

/// One row of the table: the strongest mode of the direct receptance at the tool centre point along a base axis.
#[derive(Debug, Clone)]
pub struct StrongestMode {
    /// Where the robot's frames are at the row's posture.
    pub kinematics: Kinematics,
    /// Base axis of force and response.
    pub axis: Axis,
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Largest real part of the receptance next to the mode, m/N: 1/(4kζ(1−ζ)) of a single mode (Altintas 2012, §3).
    pub peak_real_m_per_n: f64,
}

/// The model's counterpart of a [`StrongestMode`].
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// Natural frequency, Hz.
    pub frequency_hz: f64,
    /// Largest real part of the receptance, m/N.
    pub peak_real_m_per_n: f64,
    /// Derivatives of the logarithms of the two with respect to the parameters on the solver's scale.
    ln_frequency_slope: Vec<f64>,
    ln_peak_slope: Vec<f64>,
}

/// Relative standard deviation of a tabulated frequency: posture angles in whole degrees and one table row for a mode
/// that two axes see 0.1–0.6 Hz apart.
pub const FREQUENCY_STD: f64 = 0.02;
/// Relative standard deviation of a tabulated peak: damping and noise both scale it.
pub const PEAK_STD: f64 = 0.3;
/// How far an uncalibrated model may be off, as standard deviations of the logarithm: frequencies half the stiffness
/// tolerance, peaks as much as damping and shape leave open. Decides which of the model's modes a row means.
const PAIRING_FREQUENCY_STD: f64 = 0.15;
const PAIRING_PEAK_STD: f64 = 0.7;

/// The model's counterpart of each row, with derivatives: the mode that comes nearest in frequency and strength.
pub fn predict(model: &StructureModel, theta: &[f64], rows: &[StrongestMode]) -> Result<Vec<Prediction>> {
    rows.iter().map(|row| predict_row(model, theta, row)).collect()
}

fn predict_row(model: &StructureModel, theta: &[f64], row: &StrongestMode) -> Result<Prediction> {
    let axis = row.axis.index();
    let distance = |mode: &PostureMode| {
        let f = (mode.frequency_hz / row.frequency_hz).ln() / PAIRING_FREQUENCY_STD;
        let p = (mode.peak_real_m_per_n(row.axis) / row.peak_real_m_per_n).ln() / PAIRING_PEAK_STD;
        f * f + p * p
    };
    let mode = posture_modes(model, theta, &row.kinematics, f64::INFINITY, true)?
        .into_iter()
        .filter(|mode| mode.compliance_m_per_n[axis] > 0.0)
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .ok_or_else(|| crate::Error::computation("the model has no mode at the tool point"))?;
    let zeta = mode.damping_ratio;
    let slopes = mode.ln_compliance_slope[axis].iter().zip(&mode.damping_slope);
    Ok(Prediction {
        frequency_hz: mode.frequency_hz,
        peak_real_m_per_n: mode.peak_real_m_per_n(row.axis),
        ln_peak_slope: slopes.map(|(c, dz)| c - dz / zeta + dz / (1.0 - zeta)).collect(),
        ln_frequency_slope: mode.ln_frequency_slope,
    })
}

struct Table<'a> {
    model: &'a StructureModel,
    rows: &'a [StrongestMode],
}

impl LeastSquares for Table<'_> {
    fn cost(&self, theta: &[f64]) -> Result<f64> {
        Ok(self.linearise(theta)?.cost)
    }

    fn linearise(&self, theta: &[f64]) -> Result<Linearisation> {
        let count = theta.len();
        let mut sum = Linearisation::zero(count);
        let mut push = |residual: f64, slope: DVector<f64>| {
            sum.cost += 0.5 * residual * residual;
            sum.gradient += &slope * residual;
            sum.hessian += &slope * slope.transpose();
        };
        for (row, p) in self.rows.iter().zip(predict(self.model, theta, self.rows)?) {
            let slope = DVector::from_vec(p.ln_frequency_slope) / FREQUENCY_STD;
            push((p.frequency_hz / row.frequency_hz).ln() / FREQUENCY_STD, slope);
            let slope = DVector::from_vec(p.ln_peak_slope) / PEAK_STD;
            push(
                (p.peak_real_m_per_n / row.peak_real_m_per_n).ln() / PEAK_STD,
                slope,
            );
        }
        for (i, (parameter, t)) in self.model.parameters.iter().zip(theta).enumerate() {
            if let Some(prior) = parameter.prior {
                sum.add_half_square(i, prior.half_square(*t));
            }
        }
        Ok(sum)
    }
}

/// Fits the model's parameters to the table, priors included, from the nominal values.
pub fn fit(model: &StructureModel, rows: &[StrongestMode]) -> Result<Fit> {
    let problem = Table { model, rows };
    minimise(
        &problem,
        &model.nominal_theta(),
        &model.bounds(),
        Stopping::default(),
    )
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

    fn rows(model: &StructureModel, theta: &[f64]) -> Vec<StrongestMode> {
        let mut rows: Vec<StrongestMode> = Vec::new();
        for posture in &TAP_POSTURES {
            for axis in [Axis::X, Axis::Y] {
                rows.push(StrongestMode {
                    kinematics: model.robot.kinematics(posture).unwrap(),
                    axis,
                    frequency_hz: 13.0,
                    peak_real_m_per_n: 1e-5,
                });
            }
        }
        let truth = predict(model, theta, &rows).unwrap();
        for (row, t) in rows.iter_mut().zip(truth) {
            row.frequency_hz = t.frequency_hz;
            row.peak_real_m_per_n = t.peak_real_m_per_n;
        }
        rows
    }

    #[test]
    fn slopes_agree_with_differences() {
        let model = model();
        let theta = model.nominal_theta();
        let rows = rows(&model, &theta);
        let here = predict(&model, &theta, &rows).unwrap();
        for p in 0..theta.len() {
            let h = 1e-6;
            let at = |sign: f64| {
                let mut t = theta.clone();
                t[p] += sign * h;
                predict(&model, &t, &rows).unwrap()
            };
            let (up, down) = (at(1.0), at(-1.0));
            for ((u, d), x) in up.iter().zip(&down).zip(&here) {
                let f = (u.frequency_hz / d.frequency_hz).ln() / (2.0 * h);
                let r = (u.peak_real_m_per_n / d.peak_real_m_per_n).ln() / (2.0 * h);
                assert!((f - x.ln_frequency_slope[p]).abs() < 1e-6, "{p}");
                assert!(
                    (r - x.ln_peak_slope[p]).abs() < 1e-5 * (1.0 + r.abs()),
                    "{p}: {r} {}",
                    x.ln_peak_slope[p]
                );
            }
        }
    }

    /// A table made by a stiffer robot pulls the fit towards it.
    #[test]
    fn the_fit_explains_a_synthetic_table() {
        let model = model();
        let mut truth = model.nominal_theta();
        truth[1] += 0.2;
        truth[2] -= 0.15;
        truth[6] += 0.3;
        let rows = rows(&model, &truth);
        let fit = fit(&model, &rows).unwrap();
        assert!(fit.converged());
        for (row, p) in rows.iter().zip(predict(&model, &fit.theta, &rows).unwrap()) {
            assert!((p.frequency_hz / row.frequency_hz).ln().abs() < 0.01);
            assert!((p.peak_real_m_per_n / row.peak_real_m_per_n).ln().abs() < 0.1);
        }
    }
}
