//! What `lobestone lobes` says of the hole itself.

use serde::Serialize;

use crate::analysis::{LobeAnalysis, LobeCase, RedundancyAnalysis};
use crate::campaign::Process;
use crate::commands::text::{number, table};
use crate::lobes::drilling::contact::ContactForce;
use crate::lobes::drilling::hole::{HoleCheck, HoleError, Uncertain};
use crate::lobes::dynamics::feed_stiffness::FeedStiffness;
use crate::lobes::optimum::SurfacePoint;
use crate::robot::pose_compensation::CompensatedPose;

/// The hole at one posture.
#[derive(Serialize)]
pub(super) struct HoleTold<'a> {
    posture: Option<&'a str>,
    angle_deg: Option<f64>,
    displacement_mm: [f64; 3],
    axial_displacement_mm: f64,
    position_error_mm: f64,
    position_error_std_mm: Option<f64>,
    position_error_p95_mm: Option<f64>,
    tilt_deg: f64,
    tilt_std_deg: Option<f64>,
    tilt_p95_deg: Option<f64>,
    within_position_tolerance: bool,
    within_perpendicularity_tolerance: bool,
    diameter_oversize_mm: f64,
    diameter_oversize_std_mm: Option<f64>,
    diameter_oversize_p95_mm: Option<f64>,
    within_diameter_tolerance: Option<bool>,
    compensation: Option<Compensation<'a>>,
    contacts: &'a [ContactForce],
    skating_mm: Option<f64>,
    thrust_n: f64,
    torque_nm: f64,
    lateral_n: f64,
}

impl<'a> HoleTold<'a> {
    /// Of every posture (or angle); empty where the hole is not worked out.
    pub fn all(analysis: &'a LobeAnalysis) -> Vec<Self> {
        let Some(Ok(check)) = &analysis.hole else {
            return Vec::new();
        };
        let cases = analysis.cases.iter();
        cases
            .filter_map(|case| {
                Some(Self::of(
                    case.posture.as_deref(),
                    case.angle_deg,
                    case.hole.as_ref()?,
                    check,
                ))
            })
            .collect()
    }

    fn of(posture: Option<&'a str>, angle_deg: Option<f64>, hole: &'a HoleError, check: &HoleCheck) -> Self {
        let (load, tolerance) = (&check.load, &check.tolerance);
        HoleTold {
            posture,
            angle_deg,
            displacement_mm: hole.displacement_mm,
            axial_displacement_mm: hole.axial_mm,
            position_error_mm: hole.position_mm.value,
            position_error_std_mm: hole.position_mm.std,
            position_error_p95_mm: hole.position_mm.upper,
            tilt_deg: hole.tilt_deg.value,
            tilt_std_deg: hole.tilt_deg.std,
            tilt_p95_deg: hole.tilt_deg.upper,
            within_position_tolerance: tolerance.position_met(hole),
            within_perpendicularity_tolerance: tolerance.perpendicularity_met(hole),
            diameter_oversize_mm: hole.oversize_mm.value,
            diameter_oversize_std_mm: hole.oversize_mm.std,
            diameter_oversize_p95_mm: hole.oversize_mm.upper,
            within_diameter_tolerance: tolerance.diameter_met(hole),
            compensation: hole
                .compensation
                .as_ref()
                .and_then(|c| c.as_ref().ok())
                .map(Compensation::of),
            contacts: &hole.contacts,
            skating_mm: hole.skating_mm,
            thrust_n: load.thrust_n,
            torque_nm: load.torque_nm,
            lateral_n: load.lateral_n,
        }
    }
}

/// The pose to command instead.
#[derive(Serialize)]
struct Compensation<'a> {
    joints_deg: &'a [f64],
    position_m: [f64; 3],
    rpy_deg: [f64; 3],
    offset_mm: [f64; 3],
    turn_deg: [f64; 3],
    residual_um: f64,
    residual_deg: f64,
}

impl<'a> Compensation<'a> {
    fn of(pose: &'a CompensatedPose) -> Self {
        Compensation {
            joints_deg: &pose.joints_deg,
            position_m: pose.position_m,
            rpy_deg: pose.rpy_rad.map(f64::to_degrees),
            offset_mm: pose.offset_m.map(|m| 1e3 * m),
            turn_deg: pose.turn_rad.map(f64::to_degrees),
            residual_um: 1e6 * pose.residual_m,
            residual_deg: pose.residual_rad.to_degrees(),
        }
    }
}

/// What the entries rest on.
#[derive(Serialize)]
pub(super) struct HoleBasis<'a> {
    #[serde(flatten)]
    tolerances: Option<Tolerances<'a>>,
    not_worked_out: Option<&'a str>,
}

#[derive(Serialize)]
struct Tolerances<'a> {
    source: &'a str,
    position_tolerance_mm: f64,
    perpendicularity_tolerance_deg: f64,
    diameter_tolerance: Option<String>,
    diameter_tolerance_mm: Option<f64>,
}

impl<'a> HoleBasis<'a> {
    /// `None` where lobes do not come from the model.
    pub fn of(analysis: &'a LobeAnalysis) -> Option<Self> {
        let basis = analysis.hole.as_ref()?;
        let tolerances = basis
            .as_ref()
            .ok()
            .map(|HoleCheck { load, tolerance }| Tolerances {
                source: &load.source,
                position_tolerance_mm: tolerance.position_mm,
                perpendicularity_tolerance_deg: tolerance.perpendicularity_deg,
                diameter_tolerance: tolerance.diameter.map(|d| d.name()),
                diameter_tolerance_mm: tolerance.diameter.map(|d| d.width_mm),
            });
        Some(HoleBasis {
            tolerances,
            not_worked_out: basis.as_ref().err().map(String::as_str),
        })
    }
}

/// How the hole's tolerances bore on the choice of the angle.
#[derive(Serialize)]
pub(super) struct Weighing<'a> {
    out_of_tolerance_deg: &'a [f64],
    no_angle_within_tolerance: bool,
    by_depth_alone: Option<SurfacePoint>,
    recommended: HoleTold<'a>,
}

impl<'a> Weighing<'a> {
    /// `None` where the hole is not worked out.
    pub fn of(analysis: &'a LobeAnalysis, found: &'a RedundancyAnalysis) -> Option<Self> {
        let Some(Ok(check)) = &analysis.hole else {
            return None;
        };
        let weighed = found.hole.as_ref()?;
        let angle_deg = found.recommendation.point.angle_deg;
        Some(Weighing {
            out_of_tolerance_deg: &weighed.out_of_tolerance_deg,
            no_angle_within_tolerance: weighed.no_angle_is_good_enough(),
            by_depth_alone: weighed.by_depth_alone,
            recommended: HoleTold::of(Some(&found.posture), Some(angle_deg), &weighed.recommended, check),
        })
    }
}

/// Static stiffness of the tool point at one posture.
#[derive(Serialize)]
pub(super) struct StiffnessTold<'a> {
    posture: Option<&'a str>,
    angle_deg: Option<f64>,
    #[serde(flatten)]
    stiffness: FeedStiffness,
}

impl<'a> StiffnessTold<'a> {
    pub fn of(case: &'a LobeCase) -> Option<Self> {
        Some(StiffnessTold {
            posture: case.posture.as_deref(),
            angle_deg: case.angle_deg,
            stiffness: case.feed_stiffness?,
        })
    }
}

pub fn text(analysis: &LobeAnalysis) -> String {
    let check = match &analysis.hole {
        None => return String::new(),
        Some(Err(reason)) => return format!("\nThe hole itself is not worked out: {reason}\n"),
        Some(Ok(check)) => check,
    };
    let (load, tolerance) = (&check.load, &check.tolerance);
    let mut out = format!(
        "\nThe hole: thrust {} N, torque {} N·m, lateral force {} N on the tool ({})\n\
         May be off by {} mm in position and {}° in perpendicularity; the 95 % bound is held against it\n",
        number(load.thrust_n, 4),
        number(load.torque_nm, 3),
        number(load.lateral_n, 4),
        load.source,
        tolerance.position_mm,
        tolerance.perpendicularity_deg,
    );
    let row = |posture: &str, angle_deg: Option<f64>, note: &str, hole: &HoleError| {
        let met = |good: bool| if good { "within" } else { "OUT" };
        let mut cells = vec![
            posture.to_string(),
            angle_deg.map_or("–".into(), |a| format!("{a:.1}{note}")),
        ];
        cells.extend(figures(&hole.position_mm));
        cells.push(met(tolerance.position_met(hole)).into());
        cells.extend(figures(&hole.tilt_deg));
        cells.push(met(tolerance.perpendicularity_met(hole)).into());
        cells
    };
    let of_case = |case: &LobeCase, note: &str| {
        let hole = case.hole.as_ref()?;
        let posture = case.posture.as_deref().unwrap_or("–");
        Some(row(posture, case.angle_deg, note, hole))
    };
    let weighed = analysis
        .redundancy
        .as_ref()
        .and_then(|r| Some((r, r.hole.as_ref()?)));
    let rows: Vec<Vec<String>> = match weighed {
        None => analysis.cases.iter().filter_map(|c| of_case(c, "")).collect(),
        // Over the angle: the best, the worst and the recommended one.
        Some((found, weighed)) => {
            let error = |case: &&LobeCase| case.hole.as_ref().map_or(0.0, |h| h.position_mm.value);
            let cases = || analysis.cases.iter().filter(|c| c.hole.is_some());
            let least = cases().min_by(|a, b| error(a).total_cmp(&error(b)));
            let most = cases().max_by(|a, b| error(a).total_cmp(&error(b)));
            let angle = Some(found.recommendation.point.angle_deg);
            let recommended = row(&found.posture, angle, " recommended", &weighed.recommended);
            [
                least.and_then(|c| of_case(c, " least")),
                most.and_then(|c| of_case(c, " most")),
                Some(recommended),
            ]
            .into_iter()
            .flatten()
            .collect()
        }
    };
    let header = [
        "posture",
        "angle °",
        "position error mm",
        "± mm",
        "95 % mm",
        "position",
        "tilt °",
        "± °",
        "95 % °",
        "perpendicularity",
    ];
    out += &table(&header, &rows);
    let holes: Vec<(String, &HoleError)> = match weighed {
        Some((found, weighed)) => {
            let angle = format!("{:.1}°, recommended", found.recommendation.point.angle_deg);
            vec![(format!("{} at {angle}", found.posture), &weighed.recommended)]
        }
        None => {
            let cases = analysis.cases.iter();
            cases
                .filter_map(|c| Some((c.posture.clone().unwrap_or_else(|| "–".into()), c.hole.as_ref()?)))
                .collect()
        }
    };
    out += &diameter_text(&holes, check);
    out += &compensation_text(&holes);
    out += &contacts_text(&holes);
    if let Some((found, weighed)) = weighed {
        out += &format!("{}\n", weighed.sentence(found));
    }
    out
}

/// The diameter against its tolerance; empty where that is not judged.
fn diameter_text(holes: &[(String, &HoleError)], check: &HoleCheck) -> String {
    let Some(diameter) = &check.tolerance.diameter else {
        return String::new();
    };
    let mut out = format!(
        "Diameter, {}: up to {} mm over nominal; what the turning lateral force of {} N adds to what the drill itself cuts\n",
        diameter.name(),
        diameter.width_mm,
        number(check.load.lateral_n, 4)
    );
    if check.load.lateral_n == 0.0 {
        return out + "  nothing: give lateral_n in [lobes.hole] to have it judged\n";
    }
    let rows: Vec<Vec<String>> = holes
        .iter()
        .map(|(place, hole)| {
            let mut row = vec![place.clone()];
            row.extend(figures(&hole.oversize_mm));
            let met = check.tolerance.diameter_met(hole) == Some(true);
            row.push(if met { "within" } else { "OUT" }.into());
            row
        })
        .collect();
    out += &table(&["posture", "oversize mm", "± mm", "95 % mm", "diameter"], &rows);
    out
}

/// The poses to command so that thrust and torque push the tool to where it should be.
fn compensation_text(holes: &[(String, &HoleError)]) -> String {
    let mut reasons = String::new();
    let mut rows = Vec::new();
    for (place, hole) in holes {
        match &hole.compensation {
            Some(Ok(pose)) => {
                let mut row = vec![place.clone()];
                row.extend(pose.offset_m.map(|m| format!("{:+.3}", 1e3 * m)));
                row.extend(pose.turn_rad.map(|a| format!("{:+.4}", a.to_degrees())));
                let joints: Vec<String> = pose.joints_deg.iter().map(|q| format!("{q:.4}")).collect();
                row.push(joints.join(" "));
                row.push(format!("{:.1e}", 1e6 * pose.residual_m));
                rows.push(row);
            }
            Some(Err(reason)) => reasons += &format!("  {place}: not compensated: {reason}\n"),
            None => {}
        }
    }
    if rows.is_empty() {
        return reasons;
    }
    let header = [
        "posture",
        "dx mm",
        "dy mm",
        "dz mm",
        "turn x °",
        "y °",
        "z °",
        "joints °",
        "left µm",
    ];
    format!(
        "To command instead, so that thrust and torque push the tool to where it should be (base axes)\n{}{reasons}",
        table(&header, &rows)
    )
}

/// What the contacts take; empty without any.
fn contacts_text(holes: &[(String, &HoleError)]) -> String {
    let mut out = String::new();
    for (place, hole) in holes {
        for contact in &hole.contacts {
            let held = contact
                .preload_n
                .map_or("no preload given".into(), |p| format!("holds {} N", number(p, 4)));
            let verdict = if contact.gives_way { ": GIVES WAY" } else { "" };
            out += &format!(
                "  {place}: {} takes {} N ({held}){verdict}\n",
                contact.name,
                number(contact.force_n, 4)
            );
        }
        if let Some(skating_mm) = hole.skating_mm {
            out += &format!(
                "  {place}: pressing the foot on moves the tool point by {skating_mm:.4} mm across its axis, if nothing but the free \
                 robot holds it (not in the position error)\n"
            );
        }
    }
    match out.is_empty() {
        true => out,
        false => format!("Contacts\n{out}"),
    }
}

/// How stiff the tool point is along the feed at each posture.
pub fn feed_stiffness_text(analysis: &LobeAnalysis) -> String {
    let cases = analysis.cases.iter();
    let mut rows: Vec<Vec<String>> = cases
        .filter_map(|case| {
            let found = case.feed_stiffness.as_ref()?;
            let mega = |v: f64| format!("{:.4}", 1e-6 * v);
            Some(vec![
                case.posture.clone().unwrap_or_else(|| "–".into()),
                case.angle_deg.map_or("–".into(), |a| format!("{a:.1}")),
                mega(found.along_feed_n_per_m),
                format!("{:.3}", found.index),
                mega(found.along_axis_n_per_m),
                mega(found.across_least_n_per_m),
                mega(found.across_greatest_n_per_m),
                format!("{:.1}", found.stiffest_across_deg),
            ])
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    if analysis.redundancy.is_some() {
        // Over the angle: the five stiffest along the feed.
        rows.sort_by(|a, b| {
            b[2].parse::<f64>()
                .unwrap_or(0.0)
                .total_cmp(&a[2].parse().unwrap_or(0.0))
        });
        rows.truncate(5);
    }
    let feed = match analysis.process {
        Process::Drilling => "the feed runs along the tool",
        _ => "feed across the tool in the stiffest direction",
    };
    let header = [
        "posture",
        "angle °",
        "along feed MN/m",
        "index",
        "along tool",
        "across, least",
        "greatest",
        "at °",
    ];
    format!(
        "\nStatic stiffness of the tool point ({feed}; index: over the stiffest direction there is)\n{}",
        table(&header, &rows)
    )
}

fn figures(of: &Uncertain) -> [String; 3] {
    let optional = |v: Option<f64>| v.map_or("–".to_string(), |v| format!("{v:.4}"));
    [format!("{:.4}", of.value), optional(of.std), optional(of.upper)]
}
