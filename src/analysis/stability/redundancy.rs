//! The lobes of a campaign over the redundancy angle, and what they recommend.

use rayon::prelude::*;
use serde::Serialize;

use crate::analysis::stability::lobe_case::{BEST, LobeCase};
use crate::analysis::stability::lobe_model::ModelState;
use crate::campaign::{Campaign, LobeMethod, LobesSection, Redundancy};
use crate::lobes::band::QUANTILES;
use crate::lobes::drilling::hole::{HoleCheck, HoleError};
use crate::lobes::optimum::{
    LimitAtAngle, SPEED_MARGIN, Search, SurfacePoint, agree, apart_deg, difference, margin_mm,
};
use crate::lobes::redundancy::{AnglePosture, AngleStatus, Recommendation, RedundancySweep};
use crate::lobes::setup::LobeCut;
use crate::lobes::{AveragedCut, SpeedLimit};
use crate::statistics::quantile;
use crate::{InputError, Result};

/// b(n, θ) at one place.
#[derive(Debug, Clone)]
pub struct RedundancyAnalysis {
    /// Whose tool point and axis are kept.
    pub posture: String,
    /// Step of the sweep over the angle, °.
    pub step_deg: f64,
    /// How the robot stands at each angle.
    pub angles: Vec<AnglePosture>,
    /// Where to cut.
    pub recommendation: Recommendation,
    /// How the hole's tolerances bore on the choice; `None` where the hole is not worked out.
    pub hole: Option<HoleWeighing>,
    /// What turning the elbow of an arm with seven joints leads to; empty where it is not asked for.
    pub elbows: Vec<ElbowChoice>,
}

/// The best place with the elbow turned by an angle; the recommended one is the deepest of those at which the hole keeps its
/// tolerances (of all where none does).
#[derive(Debug, Clone, Copy, Serialize)]
pub struct ElbowChoice {
    /// From the posture's own elbow, right-handed about the line from shoulder to wrist.
    pub turned_deg: f64,
    /// Redundancy angles that can be used.
    pub usable_angles: usize,
    /// `None` where no angle can be used.
    pub point: Option<SurfacePoint>,
    /// Whether the hole keeps its tolerances at an angle at least: that goes before the depth. `None` where the hole is not worked out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hole_in_tolerance: Option<bool>,
    pub chosen: bool,
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

struct ModelSurface<'a> {
    sweep: &'a RedundancySweep<'a>,
    state: &'a ModelState,
    cut: AveragedCut,
    gate: Option<HoleGate<'a>>,
}

impl ModelSurface<'_> {
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

impl LimitAtAngle for ModelSurface<'_> {
    fn visit(&self, angle_deg: f64, visit: &mut dyn FnMut(&dyn SpeedLimit)) -> bool {
        let posture = self.sweep.between(angle_deg);
        let usable = posture.status == AngleStatus::Reachable;
        let Some(joints) = posture.joints_deg.filter(|_| usable) else {
            return false;
        };
        if !self.is_let_through(angle_deg, &joints) {
            return false;
        }
        let Ok(blocks) = self.state.blocks(&joints) else {
            return false;
        };
        visit(&self.cut.on(&blocks));
        true
    }
}

type Found = (RedundancyAnalysis, Vec<LobeCase>);

/// One case for each angle that can be used, and the recommendation: the deepest limit among the angles at which the hole
/// keeps its tolerances, or among all where none does. With `elbow_step_deg` the same for each elbow angle, of which the
/// best is kept: one at which the hole keeps its tolerances before one at which it does not, then the deeper limit.
///
/// # Errors
/// A method that is too slow for a surface, a robot without inverse kinematics, or no angle that can be used.
pub(crate) fn sweep(
    campaign: &Campaign,
    section: &LobesSection,
    redundancy: &Redundancy,
    state: &ModelState,
    cut: AveragedCut,
    speeds: &[f64],
    check: Option<&HoleCheck>,
) -> Result<Found> {
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
    let mut elbows = Vec::new();
    let mut best: Option<(usize, Found)> = None;
    for turned_deg in elbow_angles(redundancy.elbow_step_deg) {
        let found = at_elbow(
            campaign,
            (section, redundancy),
            state,
            cut,
            speeds,
            check,
            turned_deg,
        )?;
        let keeps =
            |analysis: &RedundancyAnalysis| analysis.hole.as_ref().map(|h| !h.no_angle_is_good_enough());
        elbows.push(ElbowChoice {
            turned_deg,
            hole_in_tolerance: found.as_ref().and_then(|(analysis, _)| keeps(analysis)),
            usable_angles: found.as_ref().map_or(0, |(_, cases)| cases.len()),
            point: found.as_ref().map(|(analysis, _)| analysis.recommendation.point),
            chosen: false,
        });
        let Some(found) = found else { continue };
        let rank = |(analysis, _): &Found| {
            let depth_mm = analysis.recommendation.point.depth_mm;
            (keeps(analysis).unwrap_or(true), depth_mm)
        };
        let is_better = match &best {
            None => true,
            Some((_, other)) => {
                let ((keeps, depth), (other_keeps, other_depth)) = (rank(&found), rank(other));
                keeps
                    .cmp(&other_keeps)
                    .then(depth.total_cmp(&other_depth))
                    .is_gt()
            }
        };
        if is_better {
            best = Some((elbows.len() - 1, found));
        }
    }
    let (chosen, mut found) = best.ok_or_else(|| {
        InputError::new("no redundancy angle can be used: all are forbidden or out of reach")
            .file(campaign.dir.join("campaign.toml"))
            .key("lobes.redundancy")
            .remedy("take out a forbidden band, or choose another posture")
    })?;
    if redundancy.elbow_step_deg.is_some() {
        elbows[chosen].chosen = true;
        found.0.elbows = elbows;
    }
    Ok(found)
}

/// Turns of the elbow to try, the posture's own first, then outwards on both sides.
fn elbow_angles(step_deg: Option<f64>) -> Vec<f64> {
    let Some(step_deg) = step_deg else {
        return vec![0.0];
    };
    let mut angles = vec![0.0];
    let sides = (1..)
        .map(|i| step_deg * f64::from(i))
        .take_while(|a| *a < 180.0 + 1e-9);
    for angle in sides {
        angles.push(angle);
        if angle < 180.0 - 1e-9 {
            angles.push(-angle);
        }
    }
    angles
}

/// [`sweep`] with the elbow turned by an angle; `None` where no redundancy angle can be used then.
fn at_elbow(
    campaign: &Campaign,
    (section, redundancy): (&LobesSection, &Redundancy),
    state: &ModelState,
    cut: AveragedCut,
    speeds: &[f64],
    check: Option<&HoleCheck>,
    elbow_deg: f64,
) -> Result<Option<Found>> {
    let posture = &campaign.postures[redundancy.posture];
    let sweep = RedundancySweep::new(
        &state.current.model.robot,
        &posture.joints_deg,
        redundancy.step_deg,
        &redundancy.forbidden_deg,
        elbow_deg,
    )?;
    let usable: Vec<&AnglePosture> = sweep
        .angles
        .iter()
        .filter(|a| a.status == AngleStatus::Reachable)
        .collect();
    let cases = usable
        .par_iter()
        .map(|angle| {
            let joints = angle.joints_deg.clone().unwrap_or_default();
            let frf = state.blocks(&joints)?;
            let solver = cut.on(&frf);
            let curve = solver.curve(speeds);
            let before = match &state.before {
                Some(model) => Some(
                    state
                        .dynamics(model, &joints, false)?
                        .lobes_before(&LobeCut::Averaged(cut), speeds),
                ),
                None => None,
            };
            Ok(LobeCase {
                posture: Some(posture.id.clone()),
                angle_deg: Some(angle.angle_deg),
                description: state.description.clone(),
                band_hz: frf.band_hz(),
                by_block: solver.by_block(speeds),
                absolute: solver.absolute_limit(),
                best: solver.best(&curve, BEST),
                curve,
                band: None,
                before,
                hole: check.map(|c| state.hole(&joints, &c.load)).transpose()?,
                feed_stiffness: state.feed_stiffness(&joints, section.process)?,
                whirling: Vec::new(),
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
        cut,
        gate: check.filter(|_| gated).map(|check| HoleGate {
            check,
            steps: holes.clone(),
        }),
    };
    let rpm_range = [speeds[0], speeds[speeds.len() - 1]];
    let let_through = |gated: bool| -> Vec<f64> {
        let angles = usable.iter().map(|a| a.angle_deg);
        angles.filter(|a| !gated || !is_out(*a)).collect()
    };
    let search = Search {
        surface: &surface(constrained),
        usable_deg: &let_through(constrained),
        step_deg: redundancy.step_deg,
        rpm_range,
    };
    let Some(enumeration) = search.by_enumeration() else {
        return Ok(None);
    };
    let swarm = search.by_swarm()?;
    let by_depth_alone = || {
        let search = Search {
            surface: &surface(false),
            usable_deg: &let_through(false),
            ..search
        };
        search.by_enumeration()
    };
    let point = if swarm.depth_mm > enumeration.depth_mm {
        swarm
    } else {
        enumeration
    };
    let there = sweep.between(point.angle_deg);
    let joints_there = there.joints_deg.clone().unwrap_or_default();
    let frf = state.blocks(&joints_there)?;
    let solver = cut.on(&frf);
    let uncertain: Vec<f64> = state
        .variants(&joints_there)?
        .iter()
        .map(|frf| margin_mm(&cut.on(frf), point.spindle_rpm))
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
        difference: difference(&enumeration, &swarm),
        speed_margin: SPEED_MARGIN,
    };
    let hole = match check {
        Some(check) => Some(HoleWeighing {
            usable: holes.len(),
            recommended: state.hole(&joints_there, &check.load)?,
            by_depth_alone: constrained.then(by_depth_alone).flatten(),
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
        elbows: Vec::new(),
    };
    Ok(Some((analysis, cases)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elbows_are_tried_outwards() {
        assert_eq!(elbow_angles(None), [0.0]);
        assert_eq!(elbow_angles(Some(60.0)), [0.0, 60.0, -60.0, 120.0, -120.0, 180.0]);
        assert_eq!(elbow_angles(Some(100.0)), [0.0, 100.0, -100.0]);
    }

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
