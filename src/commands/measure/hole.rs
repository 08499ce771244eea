//! What `lobestone lobes` says of the hole itself.

use serde_json::{Value, json};

use crate::analysis::{LobeAnalysis, LobeCase};
use crate::commands::text::{number, table};
use crate::lobes::hole::{HoleCheck, HoleError, Uncertain};

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
        "thrust_n": load.thrust_n,
        "torque_nm": load.torque_nm,
        "lateral_n": load.lateral_n,
    })
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
    if let Some((found, weighed)) = weighed {
        out += &format!("{}\n", weighed.sentence(found));
    }
    out
}

fn figures(of: &Uncertain) -> [String; 3] {
    let optional = |v: Option<f64>| v.map_or("–".to_string(), |v| format!("{v:.4}"));
    [format!("{:.4}", of.value), optional(of.std), optional(of.upper)]
}
