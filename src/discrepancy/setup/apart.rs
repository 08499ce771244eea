//! One posture that contradicts all others, whatever is wrong with it.

use super::decide::Rival;
use super::finding::SetupFinding;
use crate::discrepancy::comparison::compare::FrfComparison;
use crate::identify::StructureModel;
use crate::identify::frfs::calibrate::{Options, calibrate};
use crate::identify::frfs::frf_data::FrfData;
use crate::identify::frfs::frf_problem::FrfProblem;
use crate::identify::frfs::structure_study::led_astray;
use crate::identify::levenberg_marquardt::{LeastSquares, Stopping, minimise};

/// The posture without which the model explains what it does not explain with it.
pub(super) struct PostureApart {
    /// Index into the campaign's postures.
    pub posture: usize,
    /// The model fitted to all others, solver's scale.
    pub theta: Vec<f64>,
    /// Its misfit per value there, and of the model as it stands at all postures; 1 is noise.
    pub left: [f64; 2],
}

/// Of fewer postures the others say too little.
const FEWEST: usize = 3;
/// Postures that are left out in turn, worst first: where the model was led astray the guilty one need not be the worst.
const LEFT_OUT: usize = 2;
/// Share of what stands above the noise that is left without the posture, at most.
const LEFT: f64 = 0.1;
/// Times the others' error over the signal that the posture's has at least: noise that is understated makes no contradiction.
const FURTHER_OFF: f64 = 2.0;
/// Probability that something was different at a posture that stands apart, and is no physics of all postures that shows at one alone.
const SURE: f64 = 0.8;
/// Share of what stands above the noise from which on an effect of the library explains it.
const EXPLAINED: f64 = 0.9;

/// What a mistake is told by has to be at its optimum.
const SETTLED: Stopping = Stopping {
    max_iterations: 60,
    relative_decrease: 1e-6,
};

/// The posture that contradicts all others, where one does: `model` stands far off at `theta`, its optimum on `data`, and is right
/// without it. `measured`: a starting point that the measured modes give, solver's scale.
pub(super) fn posture_apart(
    model: &StructureModel,
    data: &FrfData,
    theta: &[f64],
    measured: Option<&[f64]>,
) -> Option<PostureApart> {
    let misfit = |data: &FrfData, theta: &[f64]| {
        let cost = FrfProblem::likelihood(model, data).cost(theta).ok()?;
        Some((cost, cost / data.value_count() as f64))
    };
    let postures = data.measured_postures();
    if postures.len() < FEWEST {
        return None;
    }
    let (_, all) = misfit(data, theta)?;
    let mut worst: Vec<(f64, usize)> = postures
        .iter()
        .filter_map(|p| Some((misfit(&data.filtered(|other| other == *p), theta)?.1, *p)))
        .collect();
    worst.sort_by(|a, b| b.0.total_cmp(&a.0));
    let without = worst.into_iter().take(LEFT_OUT).filter_map(|(_, posture)| {
        let others = data.filtered(|other| other != posture);
        let near = minimise(
            &FrfProblem::likelihood(model, &others),
            theta,
            &model.bounds(),
            SETTLED,
        )
        .ok()?;
        let mut theta = near.theta;
        if led_astray(near.cost, 2.0 * others.value_count() as f64) {
            let options = Options {
                extra_starts: 0,
                ..Options::default()
            };
            let fresh = calibrate(model, &others, measured, options).ok()?;
            if misfit(&others, &fresh.theta)?.0 < near.cost {
                theta = fresh.theta;
            }
        }
        let left = [misfit(&others, &theta)?.1, all];
        Some(PostureApart { posture, theta, left })
    });
    let best = without.min_by(|a, b| a.left[0].total_cmp(&b.left[0]))?;
    let nrms = |own: bool| {
        let part = data.filtered(|p| (p == best.posture) == own);
        let predicted = model.predict(&best.theta, &part).ok()?;
        Some(FrfComparison::new(&part, &model.points, &predicted).totals.nrms)
    };
    let stands_apart = best.left[0] - 1.0 < LEFT * (all - 1.0) && nrms(true)? > FURTHER_OFF * nrms(false)?;
    stands_apart.then_some(best)
}

impl PostureApart {
    /// What is told where no mistake has a name; `None` where an effect of the library explains it as well.
    pub fn finding(&self, data: &FrfData, rival: Option<&Rival>) -> Option<SetupFinding> {
        let [others, all] = self.left;
        let above = 1.0 - 1.0 / all;
        if rival.is_some_and(|r| r.gain_share > EXPLAINED * above) {
            return None;
        }
        let id = data.posture_ids.get(self.posture).map_or("?", String::as_str);
        let remedy = format!(
            "Without it the model leaves {others:.2} times the noise variance, with it {all:.1}: check its joint angles, the points, \
             directions and gains of its channels, and what touched the robot there; without its entries in campaign.toml the others \
             can be used."
        );
        let place = format!("posture {id} contradicts all others");
        Some(SetupFinding::without_size("posture-apart", place, SURE, remedy))
    }
}
