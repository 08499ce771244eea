//! What a calibration's data do not determine: parameters that stayed what the prior says, and sets of which only a
//! combination is known.

use faer::Mat;
use nalgebra::DMatrix;
use serde::Serialize;

use crate::identify::frfs::calibrate::Calibration;
use crate::parameter::Parameter;
use crate::{Error, Result};

/// Names of parameters.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Undetermined {
    /// The data say next to nothing of these: their errors are those of the prior.
    pub by_itself: Vec<String>,
    /// Of each set the data determine combinations only; the strongest part first.
    pub together: Vec<Vec<String>>,
}

/// Share of its prior standard deviation that a parameter keeps of which the data say next to nothing.
const KEPT: f64 = 0.9;
/// Share of the prior variance that a combination keeps which the data do not determine.
const KEPT_TOGETHER: f64 = 0.5;
/// Part of such a combination (component of its unit vector) from which on a parameter is named.
const PART: f64 = 0.3;

impl Undetermined {
    /// Of a calibration of `parameters`; those without a prior are what only data can say, and are left out.
    ///
    /// # Errors
    /// An eigenvalue iteration that does not converge.
    pub fn new(parameters: &[Parameter], calibration: &Calibration) -> Result<Self> {
        let prior: Vec<(usize, f64)> = parameters
            .iter()
            .enumerate()
            .filter_map(|(i, p)| Some((i, p.prior?.std)))
            .collect();
        // Widened for a misfit above the noise; how much the data say does not depend on that.
        let misfit = calibration.reduced_chi2.max(1.0);
        let scaled = DMatrix::from_fn(prior.len(), prior.len(), |i, j| {
            let ((a, std_a), (b, std_b)) = (prior[i], prior[j]);
            calibration.covariance[(a, b)] / (misfit * std_a * std_b)
        });
        let name = |i: usize| parameters[prior[i].0].name.clone();
        let unsaid = |i: &usize| scaled[(*i, *i)].sqrt() > KEPT;
        let by_itself = (0..prior.len()).filter(unsaid).map(name).collect();
        let rest: Vec<usize> = (0..prior.len()).filter(|i| !unsaid(i)).collect();
        let n = rest.len();
        let symmetric = Mat::from_fn(n, n, |i, j| scaled[(rest[i], rest[j])]);
        let eigen = symmetric
            .self_adjoint_eigen(faer::Side::Lower)
            .map_err(|_| Error::computation("the eigenvalues of the covariance were not found"))?;
        let (vectors, values) = (eigen.U(), eigen.S().column_vector());
        let together = (0..n)
            .rev()
            .filter(|k| values[*k] > KEPT_TOGETHER)
            .map(|k| {
                let mut parts: Vec<usize> = (0..n).filter(|i| vectors[(*i, k)].abs() > PART).collect();
                parts.sort_by(|a, b| vectors[(*b, k)].abs().total_cmp(&vectors[(*a, k)].abs()));
                parts.into_iter().map(|i| name(rest[i])).collect::<Vec<_>>()
            })
            .filter(|names| names.len() > 1)
            .collect();
        Ok(Undetermined { by_itself, together })
    }

    /// In sentences; none where all is determined.
    pub fn in_words(&self) -> Vec<String> {
        let mut words = Vec::new();
        if !self.by_itself.is_empty() {
            words.push(format!(
                "the data say next to nothing of {}: they stay near the robot file, within its tolerance",
                self.by_itself.join(", ")
            ));
        }
        for set in &self.together {
            words.push(format!(
                "the data know {} only together: one may grow while another gives way",
                set.join(", ")
            ));
        }
        words
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::levenberg_marquardt::Ending;
    use crate::parameter::{Prior, Scale};

    fn parameter(name: &str, std: f64) -> Parameter {
        Parameter {
            name: name.into(),
            unit: "1",
            scale: Scale::Linear,
            nominal: 0.0,
            prior: Some(Prior { mean: 0.0, std }),
            bounds: [-10.0, 10.0],
        }
    }

    /// Information that the data give (the prior's is added): of the first parameter, of the sum of the next two, of none.
    #[test]
    fn what_is_not_measured_is_named() {
        let parameters: Vec<Parameter> = [("known", 2.0), ("a", 1.0), ("b", 1.0), ("unseen", 0.5)]
            .map(|(name, std)| parameter(name, std))
            .into();
        let mut information = DMatrix::zeros(4, 4);
        information[(0, 0)] = 100.0;
        for (i, j) in [(1, 1), (1, 2), (2, 1), (2, 2)] {
            information[(i, j)] = 1e4;
        }
        for (i, p) in parameters.iter().enumerate() {
            information[(i, i)] += p.prior.unwrap().std.powi(-2);
        }
        let calibration = |widened: f64| Calibration {
            parameters: Vec::new(),
            theta: vec![0.0; 4],
            covariance: information.clone().try_inverse().unwrap() * widened,
            widened: vec![1.0; 4],
            reduced_chi2: widened,
            iterations: 1,
            ending: Ending::Converged,
            starts: 1,
            starts_agreeing: 1,
            rivals: Vec::new(),
        };
        for widened in [1.0, 7.0] {
            let found = Undetermined::new(&parameters, &calibration(widened)).unwrap();
            assert_eq!(found.by_itself, ["unseen"]);
            assert_eq!(found.together.len(), 1);
            let mut set = found.together[0].clone();
            set.sort();
            assert_eq!(set, ["a", "b"]);
            assert_eq!(found.in_words().len(), 2);
        }
    }
}
