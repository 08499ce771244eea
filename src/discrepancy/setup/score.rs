//! How much each mistake would take away of the misfit, to first order, after the baseline was refitted.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::group::FrfGroup;
use super::mistake::{Mistake, MistakeSize, Score};
use super::scene::{Curves, Made, predict, weighted};
use crate::Result;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::FrfData;

/// A model at its optimum, linearised once.
pub struct Linearised<'a> {
    pub model: &'a StructureModel,
    pub data: &'a FrfData,
    pub theta: &'a [f64],
    residual: Vec<f64>,
    /// One column a parameter of the model.
    jacobian: Vec<Vec<f64>>,
    /// Cholesky factor of JᵀJ with the priors.
    information: nalgebra::Cholesky<f64, nalgebra::Dyn>,
    /// Jᵀr with the priors' slopes.
    gradient: DVector<f64>,
    /// Where the values of each FRF stand.
    ranges: Vec<std::ops::Range<usize>>,
}

/// Steps of differences, in units of a parameter's prior standard deviation or usual size.
const STEP: f64 = 1e-4;

/// Derivative steps of the model's parameters on the solver's scale.
pub(super) fn steps(model: &StructureModel) -> Vec<f64> {
    let scale = |p: &crate::parameter::Parameter| p.prior.map_or(0.1, |prior| prior.std);
    model
        .parameters
        .iter()
        .map(|p| STEP * scale(p).max(1e-6))
        .collect()
}

/// Derivatives of the weighted residual with respect to the model's parameters, a column each. `here`: what is predicted at
/// `theta`. Over so small steps differences to one side are right to a thousandth, and half the work of those to both.
pub(super) fn jacobian(
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
    made: Option<Made>,
    here: &Curves,
) -> Result<Vec<Vec<f64>>> {
    let steps = steps(model);
    (0..theta.len())
        .into_par_iter()
        .map(|i| {
            let mut moved = theta.to_vec();
            moved[i] += steps[i];
            let there = predict(model, &moved, data, made)?;
            Ok(difference(&there, here, data, steps[i]))
        })
        .collect()
}

fn difference(up: &Curves, down: &Curves, data: &FrfData, step: f64) -> Vec<f64> {
    let mut column = Vec::with_capacity(2 * data.value_count());
    for (((_, frf), up), down) in data.frfs().zip(up).zip(down) {
        for ((u, d), std) in up.iter().zip(down).zip(&frf.noise_std) {
            let slope = (u - d) * (std::f64::consts::SQRT_2 / (std * step));
            column.extend([slope.re, slope.im]);
        }
    }
    column
}

/// Derivatives with respect to the `sizes` of a mistake at its values.
pub(super) fn size_slopes(
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
    made: Made,
    sizes: &[MistakeSize],
) -> Result<Vec<Vec<f64>>> {
    (0..sizes.len())
        .map(|i| {
            let step = STEP * sizes[i].usual;
            // One-sided where the other side is impossible.
            let low = if made.values[i] - step < sizes[i].bounds[0] {
                0.0
            } else {
                1.0
            };
            let at = |shift: f64| {
                let mut moved = made.values.to_vec();
                moved[i] += shift;
                let moved = Made {
                    values: &moved,
                    ..made
                };
                predict(model, theta, data, Some(moved))
            };
            Ok(difference(
                &at(step)?,
                &at(-low * step)?,
                data,
                (1.0 + low) * step,
            ))
        })
        .collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

impl<'a> Linearised<'a> {
    pub fn new(model: &'a StructureModel, data: &'a FrfData, theta: &'a [f64]) -> Result<Self> {
        let predicted = predict(model, theta, data, None)?;
        let residual = weighted(&predicted, data);
        let jacobian = jacobian(model, data, theta, None, &predicted)?;
        let n = theta.len();
        let mut information = DMatrix::from_fn(n, n, |i, j| dot(&jacobian[i], &jacobian[j]));
        let mut gradient = DVector::from_fn(n, |i, _| dot(&jacobian[i], &residual));
        for (i, parameter) in model.parameters.iter().enumerate() {
            if let Some(prior) = parameter.prior {
                let [_, slope, curvature] = prior.half_square(theta[i]);
                information[(i, i)] += curvature;
                gradient[i] += slope;
            }
            // A parameter that this data does not see at all stays where it is.
            information[(i, i)] += 1e-12 * (1.0 + information[(i, i)]);
        }
        let information = information
            .cholesky()
            .ok_or_else(|| crate::Error::computation("the data do not determine the parameters"))?;
        let mut start = 0;
        let ranges = data.frfs().map(|(_, frf)| {
            let end = start + 2 * frf.receptance.len();
            let range = start..end;
            start = end;
            range
        });
        Ok(Linearised {
            ranges: ranges.collect(),
            model,
            data,
            theta,
            residual,
            jacobian,
            information,
            gradient,
        })
    }

    /// Scores of a mistake for each of its groups.
    pub fn scores(&self, mistake: &dyn Mistake) -> Result<Vec<Score>> {
        let sizes = mistake.sizes();
        let k = sizes.len();
        let nothing = vec![0.0; k];
        let made = Made {
            mistake,
            group: FrfGroup::ALL,
            values: &nothing,
        };
        let groups = mistake.groups(self.data);
        if groups.is_empty() {
            return Ok(Vec::new());
        }
        let slopes = size_slopes(self.model, self.data, self.theta, made, &sizes)?;
        // Sums for each FRF: those of a group are sums of these.
        struct Part {
            own: DMatrix<f64>,
            cross: DMatrix<f64>,
            gradient: DVector<f64>,
        }
        let n = self.theta.len();
        let parts: Vec<Part> = self
            .ranges
            .par_iter()
            .map(|range| Part {
                own: DMatrix::from_fn(k, k, |i, j| {
                    dot(&slopes[i][range.clone()], &slopes[j][range.clone()])
                }),
                cross: DMatrix::from_fn(n, k, |i, j| {
                    dot(&self.jacobian[i][range.clone()], &slopes[j][range.clone()])
                }),
                gradient: DVector::from_fn(k, |i, _| {
                    dot(&slopes[i][range.clone()], &self.residual[range.clone()])
                }),
            })
            .collect();
        let scores = groups.into_iter().filter_map(|group| {
            let mut own = DMatrix::from_diagonal(&DVector::from_fn(k, |i, _| sizes[i].usual.powi(-2)));
            let mut cross = DMatrix::zeros(n, k);
            let mut gradient = DVector::zeros(k);
            for ((_, frf), part) in self.data.frfs().zip(&parts).filter(|((_, f), _)| group.holds(f)) {
                debug_assert!(group.holds(frf));
                own += &part.own;
                cross += &part.cross;
                gradient += &part.gradient;
            }
            let absorbed = self.information.solve(&cross);
            let own = own - cross.transpose() * &absorbed;
            let gradient = gradient - absorbed.transpose() * &self.gradient;
            let mut values = -own.cholesky()?.solve(&gradient);
            // A size that would have to be negative where that cannot be promises nothing.
            if k == 1 && values[0] < sizes[0].bounds[0] {
                return None;
            }
            let gain = -values.dot(&gradient);
            mistake.beyond_the_first_order(values.as_mut_slice());
            Some(Score {
                group,
                gain,
                values: values.iter().copied().collect(),
            })
        });
        Ok(scores.filter(|s| s.gain.is_finite()).collect())
    }
}
