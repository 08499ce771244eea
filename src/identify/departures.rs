//! Which of many freed parameters must differ from what they are expected to be.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::identify::frfs::calibrate::Calibration;
use crate::parameter::Parameter;

/// Chance that any of the parameters is said to differ where none does.
const CHANCE: f64 = 1e-3;

/// Those of `freed` (indices of `parameters`) that cannot be set back to their prior's mean without a fit that is worse by
/// more than chance: backward elimination by Wald's test on the fit's quadratic form, the least missed first, the others
/// following along each time (Wald 1943; conditioning of a normal distribution).
pub fn departures(parameters: &[Parameter], calibration: &Calibration, freed: &[usize]) -> Vec<usize> {
    let mut left = freed.to_vec();
    let mut covariance = calibration.covariance.clone();
    let mut theta = calibration.theta.clone();
    let per_test = CHANCE / freed.len().max(1) as f64;
    let threshold = ChiSquared::new(1.0).map_or(f64::INFINITY, |d| d.inverse_cdf(1.0 - per_test));
    let mean = |i: usize| parameters[i].prior.map_or(calibration.theta[i], |p| p.mean);
    loop {
        let cost = |i: usize| (theta[i] - mean(i)).powi(2) / covariance[(i, i)].max(f64::MIN_POSITIVE);
        let least = left.iter().copied().min_by(|a, b| cost(*a).total_cmp(&cost(*b)));
        let Some(gone) = least.filter(|i| cost(*i) < threshold) else {
            return left;
        };
        let variance = covariance[(gone, gone)].max(f64::MIN_POSITIVE);
        let back = theta[gone] - mean(gone);
        let column = covariance.column(gone).into_owned();
        for (t, c) in theta.iter_mut().zip(&column) {
            *t -= c / variance * back;
        }
        covariance -= &column * column.transpose() / variance;
        left.retain(|i| *i != gone);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;
    use crate::identify::levenberg_marquardt::Ending;
    use crate::parameter::{Prior, Scale};

    /// Three walls of which only ratios to a fourth, free quantity are known well: the sum of all could be anything, so that
    /// each alone is hardly off, but one is 0.3 below the others.
    #[test]
    fn one_that_differs_is_told_from_a_common_factor() {
        let parameters: Vec<Parameter> = ["a", "b", "c", "common"]
            .map(|name| Parameter {
                name: name.into(),
                unit: "1",
                scale: Scale::Linear,
                nominal: 0.0,
                prior: (name != "common").then_some(Prior { mean: 0.0, std: 0.3 }),
                bounds: [-9.0, 9.0],
            })
            .into();
        // What is measured: common + each wall, to 0.01.
        let measured = [0.0, -0.3, 0.0];
        let mut information = DMatrix::<f64>::zeros(4, 4);
        let mut score = nalgebra::DVector::<f64>::zeros(4);
        for (i, m) in measured.iter().enumerate() {
            for (r, c) in [(i, i), (i, 3), (3, i), (3, 3)] {
                information[(r, c)] += 1e4;
            }
            score[i] += 1e4 * m;
            score[3] += 1e4 * m;
            information[(i, i)] += 0.3f64.powi(-2);
        }
        let covariance = information.try_inverse().unwrap();
        let found: nalgebra::DVector<f64> = &covariance * score;
        let theta: Vec<f64> = found.iter().copied().collect();
        let calibration = |theta: Vec<f64>| Calibration {
            parameters: Vec::new(),
            theta,
            covariance: covariance.clone(),
            widened: vec![1.0; 4],
            reduced_chi2: 1.0,
            iterations: 1,
            ending: Ending::Converged,
            starts: 1,
            starts_agreeing: 1,
            rivals: Vec::new(),
        };
        // Alone, b is hardly one and a half of its standard errors off.
        assert!(theta[1].abs() / covariance[(1, 1)].sqrt() < 2.0);
        assert_eq!(departures(&parameters, &calibration(theta), &[0, 1, 2]), [1]);
        assert!(departures(&parameters, &calibration(vec![0.0; 4]), &[0, 1, 2]).is_empty());
    }
}
