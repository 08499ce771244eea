//! The lobes of a campaign over the redundancy angle, and what they recommend.

use rayon::prelude::*;

use super::lobe_model::ModelState;
use super::lobes::{BEST, LobeCase};
use crate::campaign::{Campaign, LobeMethod, LobesSection, Redundancy};
use crate::lobes::band::{QUANTILES, quantile_mm};
use crate::lobes::redundancy::{
    AnglePosture, AngleStatus, LimitAtAngle, Recommendation, RedundancySweep, SPEED_MARGIN, agree,
    by_enumeration, by_swarm, margin_mm,
};
use crate::lobes::setup::Cut;
use crate::lobes::{DirectFrf, LobeCurve, RegenerativeForce, SpeedLimit, StabilitySolver};
use crate::{Error, InputError, Result};

/// b(n, θ) at one place.
#[derive(Debug, Clone)]
pub struct RedundancyAnalysis {
    /// Whose tool point and axis are kept.
    pub posture: String,
    pub step_deg: f64,
    pub angles: Vec<AnglePosture>,
    pub recommendation: Recommendation,
}

struct ModelSurface<'a> {
    sweep: &'a RedundancySweep<'a>,
    state: &'a ModelState,
    force: RegenerativeForce,
}

impl ModelSurface<'_> {
    fn frf(&self, joints_deg: &[f64]) -> Result<Box<dyn DirectFrf>> {
        self.state.frf(joints_deg)
    }
}

impl LimitAtAngle for ModelSurface<'_> {
    fn margins_mm(&self, angle_deg: f64, spindle_rpm: &[f64]) -> Option<Vec<f64>> {
        let posture = self.sweep.between(angle_deg);
        let joints = posture
            .joints_deg
            .filter(|_| posture.status == AngleStatus::Reachable)?;
        let frf = self.frf(&joints).ok()?;
        let solver = StabilitySolver::new(self.force, frf.as_ref());
        Some(spindle_rpm.iter().map(|n| margin_mm(&solver, *n)).collect())
    }
}

/// One case for each angle that can be used, and the recommendation.
///
/// # Errors
/// A method that is too slow for a surface, a robot without closed inverse kinematics, or no angle that can be used.
pub(super) fn sweep(
    campaign: &Campaign,
    section: &LobesSection,
    redundancy: &Redundancy,
    state: &ModelState,
    force: RegenerativeForce,
    speeds: &[f64],
) -> Result<(RedundancyAnalysis, Vec<LobeCase>)> {
    if !matches!(
        section.method,
        LobeMethod::ZeroOrder | LobeMethod::FrequencyDomain
    ) {
        return Err(InputError::new(
            "the surface over the redundancy angle is built with the zero-order method only",
        )
        .file(campaign.dir.join("campaign.toml"))
        .key("lobes.method")
        .remedy(
            "use method = \"zero-order\" here, then check the recommended posture with the method of your choice \
             (take [lobes.redundancy] out)",
        )
        .into());
    }
    let posture = &campaign.postures[redundancy.posture];
    let sweep = RedundancySweep::new(
        &state.current.model.robot,
        &posture.joints_deg,
        redundancy.step_deg,
        &redundancy.forbidden_deg,
    )?;
    let usable: Vec<&AnglePosture> = sweep
        .angles
        .iter()
        .filter(|a| a.status == AngleStatus::Reachable)
        .collect();
    let cases = usable
        .par_iter()
        .map(|angle| {
            let joints = angle.joints_deg.unwrap_or_default();
            let frf = state.frf(&joints)?;
            let solver = StabilitySolver::new(force, frf.as_ref());
            let curve = solver.curve(speeds);
            let before = match &state.before {
                Some(model) => Some(
                    model
                        .dynamics(&joints, false)?
                        .lobes_before(&Cut::Averaged(force), speeds),
                ),
                None => None,
            };
            Ok(LobeCase {
                posture: Some(posture.id.clone()),
                angle_deg: Some(angle.angle_deg),
                description: state.description.clone(),
                band_hz: frf.band_hz(),
                absolute: solver.absolute_limit(),
                best: solver.best(&curve, BEST),
                curve,
                band: None,
                before,
                at_cuts: Vec::new(),
            })
        })
        .collect::<Result<Vec<LobeCase>>>()?;
    let surface = ModelSurface {
        sweep: &sweep,
        state,
        force,
    };
    let curves: Vec<(f64, &LobeCurve)> = usable
        .iter()
        .zip(&cases)
        .map(|(a, c)| (a.angle_deg, &c.curve))
        .collect();
    let enumeration = by_enumeration(&curves, redundancy.step_deg, &surface).ok_or_else(|| {
        Error::from(
            InputError::new("no redundancy angle can be used: all are forbidden or out of reach")
                .file(campaign.dir.join("campaign.toml"))
                .key("lobes.redundancy")
                .remedy("take out a forbidden band, or choose another posture"),
        )
    })?;
    let swarm = by_swarm([speeds[0], speeds[speeds.len() - 1]], &surface)?;
    let point = if swarm.depth_mm > enumeration.depth_mm {
        swarm
    } else {
        enumeration
    };
    let there = sweep.between(point.angle_deg);
    let frf = state.frf(&there.joints_deg.unwrap_or_default())?;
    let solver = StabilitySolver::new(force, frf.as_ref());
    let uncertain: Vec<f64> = state
        .variants(&there.joints_deg.unwrap_or_default())?
        .iter()
        .map(|frf| margin_mm(&StabilitySolver::new(force, frf.as_ref()), point.spindle_rpm))
        .collect();
    let recommendation = Recommendation {
        point,
        lower_quantile_mm: quantile_mm(uncertain, QUANTILES[0]),
        tip_depth_mm: solver.limit_at(point.spindle_rpm).map(|l| l.depth_mm),
        posture: there,
        absolute_limit: solver.absolute_limit(),
        enumeration,
        swarm,
        agree: agree(&enumeration, &swarm),
        speed_margin: SPEED_MARGIN,
    };
    let analysis = RedundancyAnalysis {
        posture: posture.id.clone(),
        step_deg: redundancy.step_deg,
        angles: sweep.angles,
        recommendation,
    };
    Ok((analysis, cases))
}
