//! What `lobestone lobes` says of the hole itself.

use serde_json::{Value, json};

use crate::analysis::{LobeAnalysis, LobeCase};
use crate::campaign::Process;
use crate::commands::text::{number, table};
use crate::lobes::drilling::hole::{HoleCheck, HoleError, Uncertain};

/// An entry of `hole[]`.
fn entry(posture: Option<&str>, angle_deg: Option<f64>, hole: &HoleError, check: &HoleCheck) -> Value {
    let (load, tolerance) = (&check.load, &check.tolerance);
    json!({
        "posture": posture,
        "angle_deg": angle_deg,
        "displacement_mm": hole.displacement_mm,
        "axial_displacement_mm": hole.axial_mm,
        "position_error_mm": hole.position_mm.value,
        "position_error_std_mm": hole.position_mm.std,
        "position_error_p95_mm": hole.position_mm.upper,
        "tilt_deg": hole.tilt_deg.value,
        "tilt_std_deg": hole.tilt_deg.std,
        "tilt_p95_deg": hole.tilt_deg.upper,
        "within_position_tolerance": tolerance.position_met(hole),
        "within_perpendicularity_tolerance": tolerance.perpendicularity_met(hole),
        "diameter_oversize_mm": hole.oversize_mm.value,
        "diameter_oversize_std_mm": hole.oversize_mm.std,
        "diameter_oversize_p95_mm": hole.oversize_mm.upper,
        "within_diameter_tolerance": tolerance.diameter_met(hole),
        "compensation": compensation(hole),
        "contacts": hole.contacts,
        "skating_mm": hole.skating_mm,
        "thrust_n": load.thrust_n,
        "torque_nm": load.torque_nm,
        "lateral_n": load.lateral_n,
    })
}

/// The pose to command instead; null where there is none.
fn compensation(hole: &HoleError) -> Value {
    let Some(Ok(pose)) = &hole.compensation else {
        return Value::Null;
    };
    json!({
        "joints_deg": pose.joints_deg,
        "position_m": pose.position_m,
        "rpy_deg": pose.rpy_rad.map(f64::to_degrees),
        "offset_mm": pose.offset_m.map(|m| 1e3 * m),
        "turn_deg": pose.turn_rad.map(f64::to_degrees),
        "residual_um": 1e6 * pose.residual_m,
        "residual_deg": pose.residual_rad.to_degrees(),
    })
}

/// `feed_stiffness[]`.
pub fn feed_stiffness(analysis: &LobeAnalysis) -> Value {
    let entries = analysis.cases.iter().filter_map(|case| {
        let found = case.feed_stiffness.as_ref()?;
        let mut entry = json!(found);
        entry["posture"] = json!(case.posture);
        entry["angle_deg"] = json!(case.angle_deg);
        Some(entry)
    });
    entries.collect()
}

/// `hole[]` and what it rests on.
pub fn documents(analysis: &LobeAnalysis) -> (Value, Value) {
    let basis = match &analysis.hole {
        None => return (json!([]), Value::Null),
        Some(Err(reason)) => return (json!([]), json!({ "not_worked_out": reason })),
        Some(Ok(check)) => check,
    };
    let entries = analysis.cases.iter().filter_map(|case| {
        let hole = case.hole.as_ref()?;
        Some(entry(case.posture.as_deref(), case.angle_deg, hole, basis))
    });
    let said = json!({
        "source": basis.load.source,
        "position_tolerance_mm": basis.tolerance.position_mm,
        "perpendicularity_tolerance_deg": basis.tolerance.perpendicularity_deg,
        "diameter_tolerance": basis.tolerance.diameter.map(|d| d.name()),
        "diameter_tolerance_mm": basis.tolerance.diameter.map(|d| d.width_mm),
        "not_worked_out": Value::Null,
    });
    (entries.collect(), said)
}

/// `redundancy.hole`.
pub fn weighing(analysis: &LobeAnalysis) -> Value {
    let (Some(Ok(check)), Some(found)) = (&analysis.hole, &analysis.redundancy) else {
        return Value::Null;
    };
    let Some(weighed) = &found.hole else {
        return Value::Null;
    };
    let angle_deg = found.recommendation.point.angle_deg;
    json!({
        "out_of_tolerance_deg": weighed.out_of_tolerance_deg,
        "no_angle_within_tolerance": weighed.no_angle_is_good_enough(),
        "by_depth_alone": weighed.by_depth_alone,
        "recommended": entry(Some(&found.posture), Some(angle_deg), &weighed.recommended, check),
    })
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
