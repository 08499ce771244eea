//! Up milling written down as down milling, in all cuts or in some: the mean forces fit coefficients either way, the waveforms do
//! not.

use rayon::prelude::*;

use super::plausible::{FittedReading, MUCH_BETTER, SUSPICIOUS, worst_cuts};
use crate::discrepancy::setup::SetupFinding;
use crate::identify::{Calibration, CuttingData};

/// One more cut is taken to be milled the other way where that leaves this part of the misfit.
const CUT_BY_CUT: f64 = 0.7;

/// Records read with some of their cuts milled the other way.
struct Mirrored {
    /// By index into the data's cuts.
    cuts: Vec<usize>,
    data: CuttingData,
    fitted: FittedReading,
}

impl Mirrored {
    fn new(data: &CuttingData, cuts: Vec<usize>) -> Option<Mirrored> {
        let data = data.milled_the_other_way(|i| cuts.contains(&i));
        let fitted = FittedReading::of(&data)?;
        Some(Mirrored { cuts, data, fitted })
    }
}

/// Cuts that were milled the other way, where the waveforms say so; with the misfit that is left then. `now`: the records as the
/// campaign has them, fitted.
pub(super) fn milling_direction(
    data: &CuttingData,
    now: Option<&Calibration>,
) -> Option<(SetupFinding, f64)> {
    let one_sided: Vec<usize> = (0..data.cuts.len())
        .filter(|i| data.cuts[*i].is_one_sided())
        .collect();
    if one_sided.is_empty() {
        return None;
    }
    let now = now.filter(|now| now.reduced_chi2 >= SUSPICIOUS)?;
    let is_much_better = |m: &Mirrored| m.fitted.chi2() < MUCH_BETTER * now.reduced_chi2;
    let all = Mirrored::new(data, one_sided.clone()).filter(is_much_better);
    let found = all.or_else(|| cut_by_cut(data, &one_sided, now).filter(is_much_better));
    let found = found.filter(|m| m.fitted.is_plausible())?;
    let of_cut = |i: &usize| {
        let cut = &found.data.cuts[*i];
        let [start, exit] = cut.immersion_deg().unwrap_or_default();
        format!("{}: start_deg = {start:.1}, exit_deg = {exit:.1}", cut.id)
    };
    let angles: Vec<String> = found.cuts.iter().take(3).map(of_cut).collect();
    let more = if found.cuts.len() > angles.len() {
        ", and so on"
    } else {
        ""
    };
    let ids: Vec<&str> = found.cuts.iter().map(|i| data.cuts[*i].id.as_str()).collect();
    let which = match found.cuts.len() == data.cuts.len() {
        true => "all cuts".to_string(),
        false => format!("cut {}", ids.join(", ")),
    };
    let finding = SetupFinding {
        kind: "milling-direction",
        place: which,
        value: None,
        std_error: None,
        unit: "",
        confidence: 0.97,
        remedy: format!(
            "Up and down milling look exchanged: write the immersion angles the other way round ({}{more}). Read so, {}. The \
             coefficients with the present angles are wrong.",
            angles.join("; "),
            found.fitted.in_words(now.reduced_chi2),
        ),
    };
    Some((finding, found.fitted.chi2()))
}

/// Cut after cut turned round as long as that helps, of the worst ones the best first; at most half of them.
fn cut_by_cut(data: &CuttingData, one_sided: &[usize], now: &Calibration) -> Option<Mirrored> {
    let mut best: Option<Mirrored> = None;
    for _ in 0..one_sided.len() / 2 {
        let (so_far, left, theta) = match &best {
            Some(m) => (m.cuts.clone(), m.fitted.chi2(), &m.fitted.calibration.theta),
            None => (Vec::new(), now.reduced_chi2, &now.theta),
        };
        let read = best.as_ref().map_or(data, |m| &m.data);
        let left_to_turn = one_sided.iter().copied().filter(|i| !so_far.contains(i));
        let next = worst_cuts(read, theta, left_to_turn.collect())
            .ok()?
            .into_par_iter()
            .filter_map(|i| Mirrored::new(data, [so_far.as_slice(), &[i]].concat()))
            .min_by(|a, b| a.fitted.chi2().total_cmp(&b.fitted.chi2()))?;
        if next.fitted.chi2() > CUT_BY_CUT * left {
            break;
        }
        best = Some(next);
    }
    if let Some(best) = &mut best {
        best.cuts.sort_unstable();
    }
    best
}
