//! A fit that a few wrong records do not lead astray.

use std::sync::Arc;

use super::plausible::fit;
use crate::identify::forces::cutting_data::CutData;
use crate::identify::{CuttingData, CuttingModel, CuttingProblem};
use crate::signal::median;

/// Fits in which cuts that stand far off come to count less and less.
const ROUNDS: usize = 8;

/// Parameters on which a few records that are quite otherwise have little influence: noise alike in all cuts first, so that records
/// which are small by mistake do not count most, then cuts weighted by how near they are (Cauchy's weights; Holland & Welsch 1977).
pub(super) fn robust(data: &CuttingData) -> Option<Vec<f64>> {
    let mut weighted = data.clone();
    for channel in 0..4 {
        let own = |cut: &CutData| {
            let found = cut.channels[channel].as_ref()?;
            Some(median(&found.level_std[cut.steady.clone()]))
        };
        let all: Vec<f64> = data.cuts.iter().filter_map(|c| own(c)).collect();
        let usual = median(&all);
        for cut in &mut weighted.cuts {
            let Some(std) = own(cut) else { continue };
            if let Some(found) = &mut Arc::make_mut(cut).channels[channel] {
                found.widen((usual / std).max(1.0));
            }
        }
    }
    let even = weighted.clone();
    let mut theta = fit(&even)?.theta;
    for _ in 0..ROUNDS {
        let model = CuttingModel::new(&even, true).ok()?;
        let fits = CuttingProblem {
            model: &model,
            data: &even,
        }
        .fits(&theta)
        .ok()?;
        let apart: Vec<f64> = fits
            .iter()
            .zip(&even.cuts)
            .map(|(f, cut)| (f.chi2 / cut.value_count().max(1) as f64).sqrt())
            .collect();
        let usual = 2.0 * median(&apart).max(1.0);
        weighted = even.clone();
        for (cut, apart) in weighted.cuts.iter_mut().zip(apart) {
            let wider = 1.0_f64.hypot(apart / usual);
            for found in Arc::make_mut(cut).channels.iter_mut().flatten() {
                found.widen(wider);
            }
        }
        theta = fit(&weighted)?.theta;
    }
    Some(theta)
}
