//! The lobes of a campaign over the redundancy angle, and what they recommend.

use rayon::prelude::*;

use super::lobe_model::ModelState;
use super::lobes::{BEST, LobeCase};
use crate::campaign::{Campaign, LobeMethod, LobesSection, Redundancy};
use crate::lobes::band::{QUANTILES, quantile};
use crate::lobes::hole::{HoleCheck, HoleError};
use crate::lobes::redundancy::{
    AnglePosture, AngleStatus, LimitAtAngle, Recommendation, RedundancySweep, SPEED_MARGIN, SurfacePoint,
    agree, by_enumeration, by_swarm, margin_mm,
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
    /// How the hole's tolerances bore on the choice; `None` where the hole is not worked out.
    pub hole: Option<HoleWeighing>,
}

/// The tolerances of the hole weighed together with the depth limit.
#[derive(Debug, Clone)]
pub struct HoleWeighing {
    /// Usable angles of the sweep at which the hole's upper bound is out of tolerance: not recommended.
    pub out_of_tolerance_deg: Vec<f64>,
    /// Usable angles, in tolerance or not.
    pub usable: usize,
    /// At the recommended place.
    pub recommended: HoleError,
    /// What the depth limit alone would recommend (by enumeration), where angles were kept out for the hole's sake.
    pub by_depth_alone: Option<SurfacePoint>,
}

impl HoleWeighing {
    /// No angle keeps the tolerances: the recommendation is by the depth limit alone.
    pub fn no_angle_is_good_enough(&self) -> bool {
        self.out_of_tolerance_deg.len() == self.usable
    }

    /// For people: what the hole had to say in the choice of the angle.
    pub fn sentence(&self, found: &RedundancyAnalysis) -> String {
        if self.out_of_tolerance_deg.is_empty() {
            return format!(
                "Weighed together: the hole keeps its tolerances at all {} usable angles, so the depth limit decides",
                self.usable
            );
        }
        if self.no_angle_is_good_enough() {
            return "The hole is out of tolerance at every usable angle, so the depth limit alone decides: take less feed, a \
                    pilot hole or another posture before drilling here"
                .into();
        }
        let recommended_deg = found.recommendation.point.angle_deg;
        let alone = self.by_depth_alone.map_or(String::new(), |p| {
            if apart_deg(p.angle_deg, recommended_deg) < 0.1 {
                return ". The depth limit alone would recommend the same place".into();
            }
            format!(
                ". By the depth limit alone it would be {:.1} rpm at {:.1}°, {:.4} mm",
                p.spindle_rpm, p.angle_deg, p.depth_mm
            )
        });
        format!(
            "Weighed together: the hole is out of tolerance at {} of {} usable angles, which are not recommended ({}){alone}",
            self.out_of_tolerance_deg.len(),
            self.usable,
            stretches(&self.out_of_tolerance_deg, found.step_deg).join(", ")
        )
    }
}

/// `20° to 60°`, `90°`: neighbours in the sweep taken together.
fn stretches(angles_deg: &[f64], step_deg: f64) -> Vec<String> {
    let neighbours = |a: &f64, b: &f64| b - a < 1.5 * step_deg;
    angles_deg
        .chunk_by(neighbours)
        .filter_map(|s| match (s.first()?, s.last()?) {
            (from, to) if from < to => Some(format!("{from}° to {to}°")),
            (one, _) => Some(format!("{one}°")),
        })
        .collect()
}

/// Keeps angles out at which the hole is out of tolerance.
struct HoleGate<'a> {
    check: &'a HoleCheck,
    /// Angle and hole at the usable steps of the sweep.
    steps: Vec<(f64, &'a HoleError)>,
}

/// The way between two angles, degrees.
fn apart_deg(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(360.0);
    d.min(360.0 - d)
}

struct ModelSurface<'a> {
    sweep: &'a RedundancySweep<'a>,
    state: &'a ModelState,
    force: RegenerativeForce,
    gate: Option<HoleGate<'a>>,
}

impl ModelSurface<'_> {
    fn frf(&self, joints_deg: &[f64]) -> Result<Box<dyn DirectFrf>> {
        self.state.frf(joints_deg)
    }

    /// Whether the hole keeps its tolerances there, with the uncertainty of the nearest step in proportion (all draws at
    /// every angle that a search tries would take minutes).
    fn is_let_through(&self, angle_deg: f64, joints_deg: &[f64]) -> bool {
        let Some(gate) = &self.gate else { return true };
        let nearest = gate
            .steps
            .iter()
            .min_by(|a, b| apart_deg(a.0, angle_deg).total_cmp(&apart_deg(b.0, angle_deg)));
        match (nearest, self.state.deflection(joints_deg, &gate.check.load)) {
            (Some((_, step)), Ok(here)) => gate.check.tolerance.met_near(&here, step),
            _ => false,
        }
    }
}

/// The arcs about the steps in tolerance, laid side by side over the full turn: a search over all angles need not hit
/// upon narrow ones.
struct Arcs<'a> {
    surface: &'a ModelSurface<'a>,
    middles_deg: Vec<f64>,
    width_deg: f64,
}

impl Arcs<'_> {
    fn angle_deg(&self, laid_deg: f64) -> f64 {
        let place = laid_deg.rem_euclid(360.0) / 360.0 * self.middles_deg.len() as f64;
        let arc = (place as usize).min(self.middles_deg.len() - 1);
        let within = place - arc as f64 - 0.5;
        (self.middles_deg[arc] + within * self.width_deg).rem_euclid(360.0)
    }
}

impl LimitAtAngle for Arcs<'_> {
    fn margins_mm(&self, laid_deg: f64, spindle_rpm: &[f64]) -> Option<Vec<f64>> {
        self.surface.margins_mm(self.angle_deg(laid_deg), spindle_rpm)
    }
}

impl LimitAtAngle for ModelSurface<'_> {
    fn margins_mm(&self, angle_deg: f64, spindle_rpm: &[f64]) -> Option<Vec<f64>> {
        let posture = self.sweep.between(angle_deg);
        let joints = posture
            .joints_deg
            .filter(|_| posture.status == AngleStatus::Reachable)?;
        if !self.is_let_through(angle_deg, &joints) {
            return None;
        }
        let frf = self.frf(&joints).ok()?;
        let solver = StabilitySolver::new(self.force, frf.as_ref());
        Some(spindle_rpm.iter().map(|n| margin_mm(&solver, *n)).collect())
    }
}

/// One case for each angle that can be used, and the recommendation: the deepest limit among the angles at which the hole
/// keeps its tolerances, or among all where none does.
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
    check: Option<&HoleCheck>,
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
                hole: check.map(|c| state.hole(&joints, &c.load)).transpose()?,
                at_cuts: Vec::new(),
            })
        })
        .collect::<Result<Vec<LobeCase>>>()?;
    let holes: Vec<(f64, &HoleError)> = usable
        .iter()
        .zip(&cases)
        .filter_map(|(a, c)| Some((a.angle_deg, c.hole.as_ref()?)))
        .collect();
    let is_out = |angle_deg: f64| {
        let hole = holes.iter().find(|(angle, _)| *angle == angle_deg);
        check
            .zip(hole)
            .is_some_and(|(c, (_, hole))| !c.tolerance.met(hole))
    };
    let out_of_tolerance_deg: Vec<f64> = holes.iter().map(|(a, _)| *a).filter(|a| is_out(*a)).collect();
    let constrained = !out_of_tolerance_deg.is_empty() && out_of_tolerance_deg.len() < holes.len();
    let surface = |gated: bool| ModelSurface {
        sweep: &sweep,
        state,
        force,
        gate: check.filter(|_| gated).map(|check| HoleGate {
            check,
            steps: holes.clone(),
        }),
    };
    let deepest = |gated: bool| {
        let curves: Vec<(f64, &LobeCurve)> = usable
            .iter()
            .zip(&cases)
            .filter(|(a, _)| !gated || !is_out(a.angle_deg))
            .map(|(a, c)| (a.angle_deg, &c.curve))
            .collect();
        by_enumeration(&curves, redundancy.step_deg, &surface(gated))
    };
    let enumeration = deepest(constrained).ok_or_else(|| {
        Error::from(
            InputError::new("no redundancy angle can be used: all are forbidden or out of reach")
                .file(campaign.dir.join("campaign.toml"))
                .key("lobes.redundancy")
                .remedy("take out a forbidden band, or choose another posture"),
        )
    })?;
    let rpm_range = [speeds[0], speeds[speeds.len() - 1]];
    let whole = surface(constrained);
    let swarm = if constrained {
        let arcs = Arcs {
            surface: &whole,
            middles_deg: holes.iter().map(|(a, _)| *a).filter(|a| !is_out(*a)).collect(),
            width_deg: redundancy.step_deg,
        };
        let laid = by_swarm(rpm_range, &arcs)?;
        SurfacePoint {
            angle_deg: arcs.angle_deg(laid.angle_deg),
            ..laid
        }
    } else {
        by_swarm(rpm_range, &whole)?
    };
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
        lower_quantile_mm: quantile(uncertain, QUANTILES[0]),
        tip_depth_mm: solver.limit_at(point.spindle_rpm).map(|l| l.depth_mm),
        posture: there,
        absolute_limit: solver.absolute_limit(),
        enumeration,
        swarm,
        agree: agree(&enumeration, &swarm),
        speed_margin: SPEED_MARGIN,
    };
    let hole = match check {
        Some(check) => Some(HoleWeighing {
            usable: holes.len(),
            recommended: state.hole(
                &recommendation.posture.joints_deg.unwrap_or_default(),
                &check.load,
            )?,
            by_depth_alone: constrained.then(|| deepest(false)).flatten(),
            out_of_tolerance_deg,
        }),
        None => None,
    };
    let analysis = RedundancyAnalysis {
        posture: posture.id.clone(),
        step_deg: redundancy.step_deg,
        angles: sweep.angles,
        recommendation,
        hole,
    };
    Ok((analysis, cases))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbouring_angles_are_named_as_stretches() {
        assert_eq!(
            stretches(&[0.0, 20.0, 40.0, 100.0, 340.0], 20.0),
            ["0° to 40°", "100°", "340°"]
        );
        assert!(stretches(&[], 20.0).is_empty());
        assert_eq!(apart_deg(350.0, 20.0), 30.0);
    }
}
