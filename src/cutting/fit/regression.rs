//! Weighted least squares of averages on coefficients, with what the data cannot tell said instead of guessed.

use nalgebra::{DMatrix, DVector};

use crate::cutting::force_model::force_axis::ForceAxis;

/// One average of one cut on one axis: value = row · coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Which cut (any numbering).
    pub cut: usize,
    /// Which average.
    pub axis: ForceAxis,
    /// Row of the linear model: one number a coefficient.
    pub row: Vec<f64>,
    /// N or N·m.
    pub value: f64,
    /// Measurement error of `value`; 0 where it is not known.
    pub std_error: f64,
}

/// A fit of the coefficients.
#[derive(Debug, Clone, PartialEq)]
pub struct CoefficientFit {
    /// `None`: this data says nothing about it, or cannot tell it from another.
    pub value: Vec<Option<f64>>,
    /// Standard errors of `value`; `None` where that is.
    pub std_error: Vec<Option<f64>>,
    /// Sets of coefficients of which only a combination is determined.
    pub inseparable: Vec<Vec<usize>>,
    /// Minimum-norm solution, good for prediction even where single coefficients are not determined.
    pub solution: Vec<f64>,
    /// Measured less fitted, per observation.
    pub residual: Vec<f64>,
    /// Scatter beyond the measurement errors, per axis (standard deviation; N, N·m).
    pub extra_scatter: [f64; 4],
    /// Σ (residual/std error)² per degree of freedom, per axis, before extra scatter is allowed for; `None`
    /// without degrees of freedom.
    pub chi2_per_dof: [Option<f64>; 4],
    /// 1 − Σ residual²/Σ (value − mean)², per axis; `None` where the averages do not vary.
    pub r2: [Option<f64>; 4],
    /// Total weight of each observation, 1/variance.
    pub weight: Vec<f64>,
    /// Diagonal of the weighted hat matrix, 0…1 per observation: 1 means that nothing checks it.
    pub leverage: Vec<f64>,
    /// Σ (1 − leverage) over the observations of each axis.
    pub dof: [f64; 4],
    /// Of the solution, over what the data determines.
    pub covariance: DMatrix<f64>,
}

impl CoefficientFit {
    /// Row · solution.
    pub fn predict(&self, row: &[f64]) -> f64 {
        row.iter().zip(&self.solution).map(|(r, x)| r * x).sum()
    }

    /// By what the solution changes where each observation changes by so much. Of the fit as it was made, before
    /// [`Self::covering`].
    pub fn change_with(&self, observations: &[Observation], change: &[f64]) -> Vec<f64> {
        let mut sum = DVector::zeros(self.solution.len());
        for ((o, weight), change) in observations.iter().zip(&self.weight).zip(change) {
            sum += DVector::from_column_slice(&o.row) * (weight * change);
        }
        (&self.covariance * sum).iter().copied().collect()
    }

    /// With standard errors that also cover a scatter which is larger in some cuts than in others, as where it is a share of the force:
    /// widened to those of the sandwich estimator HC3 where these are larger (MacKinnon and White 1985, eq. 11; Long and Ervin
    /// 2000). HC3 alone is too small as often as too large with the few cuts that there are. Axes whose residuals are no larger
    /// than the measurement errors keep these: they are known.
    pub fn covering(mut self, observations: &[Observation]) -> CoefficientFit {
        let unknowns = self.solution.len();
        let mut meat = DMatrix::zeros(unknowns, unknowns);
        for (i, o) in observations.iter().enumerate() {
            let free = 1.0 - self.leverage[i];
            // Where nothing checks an observation its residual says nothing.
            let is_checked = self.extra_scatter[o.axis.index()] > 0.0 && free > 1e-6;
            let variance = if is_checked {
                (self.residual[i] / free).powi(2)
            } else {
                1.0 / self.weight[i]
            };
            let row = DVector::from_column_slice(&o.row);
            meat += &row * row.transpose() * (self.weight[i].powi(2) * variance);
        }
        let sandwich = &self.covariance * meat * &self.covariance;
        let wider: Vec<f64> = (0..unknowns)
            .map(|j| {
                (sandwich[(j, j)] / self.covariance[(j, j)].max(f64::MIN_POSITIVE))
                    .max(1.0)
                    .sqrt()
            })
            .collect();
        self.covariance = DMatrix::from_fn(unknowns, unknowns, |i, j| {
            self.covariance[(i, j)] * wider[i] * wider[j]
        });
        for (std_error, wider) in self.std_error.iter_mut().zip(wider) {
            *std_error = std_error.map(|e| e * wider);
        }
        self
    }

    /// Variance of [`CoefficientFit::predict`], from the errors of the coefficients alone.
    pub fn prediction_variance(&self, row: &[f64]) -> f64 {
        let row = DVector::from_column_slice(row);
        (row.transpose() * &self.covariance * &row)[0].max(0.0)
    }
}

/// Singular values below this part of the largest (columns of unit length) mean: not determined.
const RANK_TOLERANCE: f64 = 1e-6;
/// Measurement errors are not believed below this part of the values' size.
const ERROR_FLOOR: f64 = 1e-9;

/// Least squares weighted by 1/(std_error² + τ²); τ, the scatter beyond the measurement errors, is estimated
/// per axis so that the weighted residuals have the size they should (Paule & Mandel 1982). With measurement
/// errors of zero this is ordinary least squares per axis. `None` without observations.
pub fn fit(observations: &[Observation]) -> Option<CoefficientFit> {
    let unknowns = observations.first()?.row.len();
    let size = size_of(observations);
    let variance = measurement_variance(observations);
    let mut extra = [0.0f64; 4];
    let mut first_chi2 = None;
    let mut solved = WeightedSolution::new(observations, unknowns, &variance, &extra);
    for _ in 0..200 {
        let mut change = 0.0f64;
        let mut chi2_per_dof = [None; 4];
        for axis in ForceAxis::ALL {
            let a = axis.index();
            let (mut chi2, mut slope, mut dof) = (0.0, 0.0, 0.0);
            for (i, _) in observations.iter().enumerate().filter(|(_, o)| o.axis == axis) {
                let (w, r2) = (solved.weight[i], solved.residual[i].powi(2));
                chi2 += w * r2;
                slope += w * w * r2;
                dof += 1.0 - solved.leverage[i];
            }
            // A fraction of a degree of freedom is rounding, not information.
            if dof < 0.5 {
                continue;
            }
            chi2_per_dof[a] = Some(chi2 / dof);
            let next = if slope > 0.0 {
                (extra[a] + (chi2 - dof) / slope).max(0.0)
            } else {
                extra[a]
            };
            change = change.max(
                (next - extra[a]).abs() / (next + extra[a]).max(ERROR_FLOOR * ERROR_FLOOR * size * size),
            );
            extra[a] = next;
        }
        first_chi2.get_or_insert(chi2_per_dof);
        solved = WeightedSolution::new(observations, unknowns, &variance, &extra);
        if change < 1e-9 {
            break;
        }
    }
    Some(solved.into_fit(observations, extra, first_chi2.unwrap_or([None; 4])))
}

fn size_of(observations: &[Observation]) -> f64 {
    let largest = observations.iter().map(|o| o.value.abs()).fold(0.0, f64::max);
    largest.max(1e-300)
}

/// Squared measurement errors, each at least a rounding error of the values' size.
pub(crate) fn measurement_variance(observations: &[Observation]) -> Vec<f64> {
    let floor = ERROR_FLOOR * size_of(observations);
    observations
        .iter()
        .map(|o| o.std_error.max(floor).powi(2))
        .collect()
}

/// Weighted least squares at given variances.
pub(crate) struct WeightedSolution {
    pub(crate) solution: Vec<f64>,
    residual: Vec<f64>,
    leverage: Vec<f64>,
    weight: Vec<f64>,
    /// Of the coefficients, on the determined space.
    pub(crate) covariance: DMatrix<f64>,
    /// Null vectors in scaled columns.
    pub(crate) null: Vec<Vec<f64>>,
}

impl WeightedSolution {
    pub(crate) fn new(
        observations: &[Observation],
        unknowns: usize,
        variance: &[f64],
        extra: &[f64; 4],
    ) -> WeightedSolution {
        let weight: Vec<f64> = observations
            .iter()
            .zip(variance)
            .map(|(o, v)| 1.0 / (v + extra[o.axis.index()]))
            .collect();
        let mut a = DMatrix::from_fn(observations.len(), unknowns, |i, j| {
            weight[i].sqrt() * observations[i].row[j]
        });
        let b = DVector::from_fn(observations.len(), |i, _| {
            weight[i].sqrt() * observations[i].value
        });
        let scale: Vec<f64> = a.column_iter().map(|c| c.norm()).collect();
        for (mut column, s) in a.column_iter_mut().zip(&scale) {
            if *s > 0.0 {
                column /= *s;
            }
        }
        // Eigenvectors of the (small) scaled normal matrix would square the condition; the SVD does not.
        // Padding with zero rows makes the right singular vectors complete when there are few observations.
        let rows = observations.len().max(unknowns);
        let padded = a.clone().resize_vertically(rows, 0.0);
        let svd = padded.svd(true, true);
        let (u, v_t) = (svd.u.unwrap_or_default(), svd.v_t.unwrap_or_default());
        let largest = svd.singular_values.iter().copied().fold(0.0, f64::max);
        let mut solution = vec![0.0; unknowns];
        let mut covariance = DMatrix::zeros(unknowns, unknowns);
        let mut leverage = vec![0.0; observations.len()];
        let mut null = Vec::new();
        for (k, &sigma) in svd.singular_values.iter().enumerate() {
            let v: Vec<f64> = v_t.row(k).iter().copied().collect();
            if sigma <= RANK_TOLERANCE * largest || sigma == 0.0 {
                null.push(v);
                continue;
            }
            let along: f64 = (0..observations.len()).map(|i| u[(i, k)] * b[i]).sum::<f64>() / sigma;
            let unscaled = DVector::from_fn(
                unknowns,
                |j, _| if scale[j] > 0.0 { v[j] / scale[j] } else { 0.0 },
            );
            for (x, d) in solution.iter_mut().zip(unscaled.iter()) {
                *x += d * along;
            }
            covariance += &unscaled * unscaled.transpose() / (sigma * sigma);
            for (i, h) in leverage.iter_mut().enumerate() {
                *h += u[(i, k)].powi(2);
            }
        }
        let residual = observations
            .iter()
            .map(|o| o.value - o.row.iter().zip(&solution).map(|(r, x)| r * x).sum::<f64>())
            .collect();
        WeightedSolution {
            solution,
            residual,
            leverage,
            weight,
            covariance,
            null,
        }
    }

    fn into_fit(
        self,
        observations: &[Observation],
        extra: [f64; 4],
        chi2_per_dof: [Option<f64>; 4],
    ) -> CoefficientFit {
        let unknowns = self.solution.len();
        let touched = |v: &[f64], j: usize| v[j].powi(2) > 1e-8;
        let determined = |j: usize| !self.null.iter().any(|v| touched(v, j));
        let mut dof = [0.0; 4];
        for (o, leverage) in observations.iter().zip(&self.leverage) {
            dof[o.axis.index()] += 1.0 - leverage;
        }
        CoefficientFit {
            value: (0..unknowns)
                .map(|j| determined(j).then_some(self.solution[j]))
                .collect(),
            std_error: (0..unknowns)
                .map(|j| determined(j).then(|| self.covariance[(j, j)].sqrt()))
                .collect(),
            inseparable: coupled_sets(&self.null, unknowns),
            r2: r2(observations, &self.solution),
            solution: self.solution,
            residual: self.residual,
            extra_scatter: extra.map(f64::sqrt),
            chi2_per_dof,
            weight: self.weight,
            leverage: self.leverage,
            dof,
            covariance: self.covariance,
        }
    }
}

/// 1 − Σ residual²/Σ (value − mean)² of a solution, per axis; `None` where the averages do not vary.
pub(crate) fn r2(observations: &[Observation], solution: &[f64]) -> [Option<f64>; 4] {
    ForceAxis::ALL.map(|axis| {
        let on_axis = || observations.iter().filter(|o| o.axis == axis);
        let n = on_axis().count();
        let mean = on_axis().map(|o| o.value).sum::<f64>() / n.max(1) as f64;
        let total: f64 = on_axis().map(|o| (o.value - mean).powi(2)).sum();
        let fitted = |o: &Observation| o.row.iter().zip(solution).map(|(r, x)| r * x).sum::<f64>();
        let left: f64 = on_axis().map(|o| (o.value - fitted(o)).powi(2)).sum();
        (n > 2 && total > 1e-12 * n as f64 * mean * mean).then(|| 1.0 - left / total)
    })
}

/// Groups of unknowns that the null space ties together: connected through the projector onto it.
fn coupled_sets(null: &[Vec<f64>], unknowns: usize) -> Vec<Vec<usize>> {
    let projector = |i: usize, j: usize| -> f64 { null.iter().map(|v| v[i] * v[j]).sum() };
    let mut seen = vec![false; unknowns];
    let mut sets = Vec::new();
    for first in 0..unknowns {
        if seen[first] || projector(first, first) <= 1e-8 {
            continue;
        }
        let mut set = vec![first];
        seen[first] = true;
        let mut next = 0;
        while let Some(&i) = set.get(next) {
            for (j, seen) in seen.iter_mut().enumerate() {
                if !*seen && projector(i, j).abs() > 1e-6 {
                    *seen = true;
                    set.push(j);
                }
            }
            next += 1;
        }
        set.sort_unstable();
        sets.push(set);
    }
    sets
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cutting::average_row;
    use crate::data::{CutGeometry, Immersion, Tool, ToolKind};
    use approx::assert_relative_eq;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use statrs::distribution::{ContinuousCDF, Normal};

    /// Whole-revolution means of a real slot series on aluminium (docs/physics.md, "Reference cases"):
    /// 2 teeth, 3 mm deep, feeds 0.025…0.125 mm/tooth; |Fx|, |Fy|, |Fz| in file axes, x carrying Ktc, y Krc.
    const PUBLISHED: [[f64; 3]; 5] = [
        [63.02, 39.78, 55.72],
        [107.12, 60.06, 70.91],
        [137.65, 71.60, 82.57],
        [171.25, 76.77, 85.22],
        [210.73, 78.50, 83.51],
    ];

    fn observations(means: &[[f64; 3]], feeds: &[f64], std_error: f64) -> Vec<Observation> {
        let tool = Tool {
            kind: ToolKind::Endmill,
            diameter_mm: 10.0,
            teeth: 2,
            helix_deg: 30.0,
            corner_radius_mm: 0.0,
            lead_angle_deg: 90.0,
            half_point_angle_deg: None,
            web_thickness_mm: None,
            chisel_edge_angle_deg: 125.0,
            each_tooth: Vec::new(),
        };
        let mut all = Vec::new();
        for (cut, (mean, feed)) in means.iter().zip(feeds).enumerate() {
            let geometry = CutGeometry::Milling {
                feed_per_tooth_mm: *feed,
                axial_depth_mm: 3.0,
                immersion: Immersion::SLOT,
            };
            // File axes to tool axes, and magnitudes to signs: Fx(tool) = −|Fy|, Fy = |Fx|, Fz = |Fz|.
            let tool_axes = [-mean[1], mean[0], mean[2]];
            for (axis, value) in ForceAxis::ALL.into_iter().zip(tool_axes) {
                let row = average_row(&tool, &geometry, axis).unwrap();
                all.push(Observation {
                    cut,
                    axis,
                    row,
                    value,
                    std_error,
                });
            }
        }
        all
    }

    #[test]
    fn the_published_slot_series_gives_its_authors_coefficients() {
        let fit = fit(&observations(&PUBLISHED, &[0.025, 0.05, 0.075, 0.1, 0.125], 0.0)).unwrap();
        let published = [958.86, 250.86, 146.36, 15.758, 19.434, 18.208];
        for (got, want) in fit.value.iter().zip(published) {
            assert_relative_eq!(got.unwrap(), want, max_relative = 1e-3);
        }
        // Its R² 0.997/0.865/0.787 are for file x, y, z: tool y, x, z.
        for (got, want) in fit.r2.iter().zip([0.865, 0.997, 0.787]) {
            assert_relative_eq!(got.unwrap(), want, epsilon = 5e-4);
        }
        // Ordinary least squares errors, axis by axis: s²/Sxx of the slope on Fz.
        let s2: f64 = fit.residual.iter().skip(2).step_by(3).map(|r| r * r).sum::<f64>() / 3.0;
        let slope_unit = 2.0 * 3.0 / std::f64::consts::PI;
        assert_relative_eq!(
            fit.std_error[2].unwrap(),
            (s2 / 0.00625).sqrt() / slope_unit,
            max_relative = 1e-6
        );
    }

    #[test]
    fn one_feed_leaves_cutting_and_edge_parts_inseparable() {
        let fit = fit(&observations(&PUBLISHED[..2], &[0.05, 0.05], 0.5)).unwrap();
        assert!(fit.value.iter().all(Option::is_none));
        assert_eq!(fit.inseparable, vec![vec![0, 3], vec![1, 4], vec![2, 5]]);
        // Still a prediction: the mean of the two.
        assert_relative_eq!(fit.residual[1], 0.5 * (63.02 - 107.12), max_relative = 1e-9);
    }

    #[test]
    fn a_missing_axis_takes_only_its_own_coefficients_away() {
        let mut all = observations(&PUBLISHED, &[0.025, 0.05, 0.075, 0.1, 0.125], 0.1);
        all.retain(|o| o.axis != ForceAxis::Z);
        let fit = fit(&all).unwrap();
        assert!(fit.value[2].is_none() && fit.value[5].is_none() && fit.r2[2].is_none());
        assert_relative_eq!(fit.value[0].unwrap(), 958.86, max_relative = 1e-3);
    }

    #[test]
    fn measurement_errors_weigh_and_carry_over() {
        // Exact data but for one point that says itself that it is poor: it must hardly move the fit.
        let feeds = [0.05, 0.1, 0.15, 0.2];
        let exact: Vec<[f64; 3]> = feeds
            .iter()
            .map(|c| [1500.0 * c + 30.0, 600.0 * c + 20.0, 1.0])
            .collect();
        let mut all = observations(&exact, &feeds, 0.2);
        let clean = fit(&all).unwrap();
        all[1].value += 30.0;
        all[1].std_error = 60.0;
        let spoilt = fit(&all).unwrap();
        let change = spoilt.value[0].unwrap() / clean.value[0].unwrap() - 1.0;
        assert!(change.abs() < 1e-3, "{change}");
        // Slope error σ/√Sxx over N a/4.
        assert_relative_eq!(
            clean.std_error[0].unwrap(),
            0.2 / 0.0125f64.sqrt() / 1.5,
            max_relative = 1e-9
        );
        assert!(fit(&[]).is_none());
    }

    #[test]
    fn errors_cover_scatter_that_is_a_share_of_the_force() {
        // Twelve cuts, three widths and four thicknesses; each force is off by 0.3 % of itself, or all by as many newtons.
        let cuts: Vec<[f64; 2]> = [0.5, 1.0, 3.0]
            .iter()
            .flat_map(|b| [0.05, 0.1, 0.2, 0.4].map(|h| [b * h, *b]))
            .collect();
        let truth = [1800.0, 40.0];
        let force = |row: &[f64; 2]| row[0] * truth[0] + row[1] * truth[1];
        let mean = cuts.iter().map(force).sum::<f64>() / cuts.len() as f64;
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let mut covered = |is_share: bool| {
            let mut within = [0.0; 2];
            for _ in 0..400 {
                let observed: Vec<Observation> = cuts
                    .iter()
                    .enumerate()
                    .map(|(cut, row)| {
                        let size = 0.003 * if is_share { force(row) } else { mean };
                        let error = Normal::standard().inverse_cdf(random.random_range(f64::EPSILON..1.0));
                        Observation {
                            cut,
                            axis: ForceAxis::X,
                            row: row.to_vec(),
                            value: force(row) + size * error,
                            std_error: 0.001,
                        }
                    })
                    .collect();
                let fit = fit(&observed).unwrap().covering(&observed);
                for j in 0..2 {
                    let off = (fit.value[j].unwrap() - truth[j]).abs() / fit.std_error[j].unwrap();
                    within[j] += f64::from(u8::from(off < 2.0)) / 400.0;
                }
            }
            within
        };
        // One scatter for all alone would cover 0.44 and 0.77 of the first.
        let share = covered(true);
        assert!(share[0] > 0.82 && share[1] > 0.92, "{share:?}");
        let alike = covered(false);
        assert!(alike.iter().all(|c| *c > 0.93 && *c < 0.99), "{alike:?}");
    }
}
