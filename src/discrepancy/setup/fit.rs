//! A mistake's size and the model's parameters fitted together.

use nalgebra::DMatrix;

use super::group::FrfGroup;
use super::mistake::Mistake;
use super::scene::{Made, predict, weighted};
use super::score::{jacobian, size_slopes};
use crate::Result;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::FrfData;
use crate::identify::levenberg_marquardt::{Fit, LeastSquares, Linearisation, Stopping, minimise};

/// Parameters of the model first (solver's scale), then the sizes of the mistake in units of what is usual.
pub struct JointProblem<'a> {
    pub model: &'a StructureModel,
    pub data: &'a FrfData,
    pub mistake: &'a dyn Mistake,
    pub group: FrfGroup,
}

impl JointProblem<'_> {
    fn split<'t>(&self, all: &'t [f64]) -> (&'t [f64], Vec<f64>) {
        let (theta, scaled) = all.split_at(self.model.parameters.len());
        let sizes = self.mistake.sizes();
        let values = scaled.iter().zip(&sizes).map(|(s, size)| s * size.usual);
        (theta, values.collect())
    }

    /// Fits from `theta` and `values` (natural).
    ///
    /// # Errors
    /// A model without a response there.
    pub fn fit(&self, theta: &[f64], values: &[f64], stopping: Stopping) -> Result<Fit> {
        let sizes = self.mistake.sizes();
        let mut bounds = self.model.bounds();
        let mut start = theta.to_vec();
        for (size, value) in sizes.iter().zip(values) {
            bounds.push(size.bounds.map(|b| b / size.usual));
            start.push(value.clamp(size.bounds[0], size.bounds[1]) / size.usual);
        }
        minimise(self, &start, &bounds, stopping)
    }

    /// Sizes in natural units and their standard errors at a fit; errors are widened by sqrt(`scale`).
    pub fn values(&self, fit: &Fit, scale: f64) -> Option<(Vec<f64>, Vec<f64>)> {
        let first = self.model.parameters.len();
        let sizes = self.mistake.sizes();
        let n = fit.hessian.nrows();
        let diagonal: Vec<f64> = (0..n).map(|i| fit.hessian[(i, i)].sqrt()).collect();
        let scaled = DMatrix::from_fn(n, n, |i, j| fit.hessian[(i, j)] / (diagonal[i] * diagonal[j]));
        let inverse = scaled.cholesky()?.inverse();
        let (_, values) = self.split(&fit.theta);
        let error = |i: usize| (inverse[(i, i)] * scale).sqrt() / diagonal[i];
        let errors = sizes
            .iter()
            .enumerate()
            .map(|(i, size)| error(first + i) * size.usual);
        Some((values, errors.collect()))
    }

    fn priors(&self, all: &[f64], mut add: impl FnMut(usize, [f64; 3])) {
        for (i, parameter) in self.model.parameters.iter().enumerate() {
            if let Some(prior) = parameter.prior {
                add(i, prior.half_square(all[i]));
            }
        }
        for (i, t) in all.iter().enumerate().skip(self.model.parameters.len()) {
            add(i, [0.5 * t * t, *t, 1.0]);
        }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl LeastSquares for JointProblem<'_> {
    fn cost(&self, all: &[f64]) -> Result<f64> {
        let (theta, values) = self.split(all);
        let made = Made {
            mistake: self.mistake,
            group: self.group,
            values: &values,
        };
        let residual = weighted(&predict(self.model, theta, self.data, Some(made))?, self.data);
        let mut cost = 0.5 * dot(&residual, &residual);
        self.priors(all, |_, [value, _, _]| cost += value);
        Ok(cost)
    }

    fn linearise(&self, all: &[f64]) -> Result<Linearisation> {
        let (theta, values) = self.split(all);
        let made = Made {
            mistake: self.mistake,
            group: self.group,
            values: &values,
        };
        let here = predict(self.model, theta, self.data, Some(made))?;
        let residual = weighted(&here, self.data);
        let mut columns = jacobian(self.model, self.data, theta, Some(made), &here)?;
        let slopes = size_slopes(self.model, self.data, theta, made, &self.mistake.sizes())?;
        for (mut slope, size) in slopes.into_iter().zip(self.mistake.sizes()) {
            for s in &mut slope {
                *s *= size.usual;
            }
            columns.push(slope);
        }
        let mut sums = Linearisation::zero(columns.len());
        sums.push(&residual, &columns.concat());
        self.priors(all, |i, half_square| sums.add_half_square(i, half_square));
        Ok(sums)
    }
}
