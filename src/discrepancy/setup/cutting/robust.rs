//! A fit that a few wrong records do not lead astray.

use std::sync::Arc;

use rayon::prelude::*;

use super::plausible::fit;
use crate::identify::forces::cutting_data::CutData;
use crate::identify::{CutFit, CuttingData, CuttingModel, CuttingProblem};
use crate::signal::median;

/// Fits in which cuts that stand far off come to count less and less.
const ROUNDS: usize = 8;
/// Of so few cuts two wrong ones lead the first fit astray: it is made without each pair of them.
const FEW: usize = 8;

/// Parameters on which a few records that are quite otherwise have little influence.
pub(super) struct RobustFit {
    pub(super) theta: Vec<f64>,
    /// The records with noise alike in all cuts: what is small by mistake does not count most.
    pub(super) even: CuttingData,
}

impl RobustFit {
    /// From the fit that leaves the least median misfit of a cut (Rousseeuw 1984) on, cuts weighted by how near they are (Cauchy's
    /// weights; Holland & Welsch 1977). `None` where nothing can be fitted.
    pub(super) fn of(data: &CuttingData) -> Option<RobustFit> {
        let even = even(data);
        let count = even.cuts.len();
        let pairs = || (0..count).flat_map(|a| (0..a).map(move |b| [a, b]));
        let mut left_out: Vec<Option<[usize; 2]>> = vec![None];
        if count <= FEW {
            left_out.extend(pairs().map(Some));
        }
        let (mut theta, mut apart, _) = left_out
            .into_par_iter()
            .filter_map(|pair| {
                let kept = even.filtered(|i| pair.is_none_or(|pair| !pair.contains(&i)));
                let theta = fit(&kept)?.theta;
                let apart = apart(&even, &theta)?;
                let middle = median(&apart);
                Some((theta, apart, middle))
            })
            .min_by(|a, b| a.2.total_cmp(&b.2))?;
        for _ in 0..ROUNDS {
            let usual = 2.0 * median(&apart).max(1.0);
            let mut weighted = even.clone();
            for (cut, apart) in weighted.cuts.iter_mut().zip(&apart) {
                for found in Arc::make_mut(cut).channels.iter_mut().flatten() {
                    found.widen(1.0_f64.hypot(apart / usual));
                }
            }
            theta = fit(&weighted)?.theta;
            apart = self::apart(&even, &theta)?;
        }
        Some(RobustFit { theta, even })
    }
}

/// Noise at least as large as that of the middle one of the cuts, channel by channel.
fn even(data: &CuttingData) -> CuttingData {
    let mut even = data.clone();
    for channel in 0..4 {
        let own = |cut: &CutData| {
            let found = cut.channels[channel].as_ref()?;
            Some(median(&found.level_std[cut.steady.clone()]))
        };
        let all: Vec<f64> = data.cuts.iter().filter_map(|c| own(c)).collect();
        let usual = median(&all);
        for cut in &mut even.cuts {
            let Some(std) = own(cut) else { continue };
            if let Some(found) = &mut Arc::make_mut(cut).channels[channel] {
                found.widen((usual / std).max(1.0));
            }
        }
    }
    even
}

/// Of each cut the root mean square misfit, in standard deviations.
fn apart(data: &CuttingData, theta: &[f64]) -> Option<Vec<f64>> {
    let model = CuttingModel::new(data, true).ok()?;
    let fits = CuttingProblem { model: &model, data }.fits(theta).ok()?;
    let of_cut = |(fit, cut): (&CutFit, &Arc<CutData>)| (fit.chi2 / cut.value_count().max(1) as f64).sqrt();
    Some(fits.iter().zip(&data.cuts).map(of_cut).collect())
}
