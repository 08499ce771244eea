//! What `lobestone lobes` says of a drill that is predicted from an orthogonal database.

use serde_json::{Value, json};

use crate::analysis::LobeAnalysis;
use crate::commands::text::{number, table};
use crate::cutting::{DrillCoefficients, DrillForces, LipElement};

/// Elements of the lip that are shown, of those that were summed.
const SHOWN: usize = 8;

fn forces(of: &DrillForces, coefficients: &DrillCoefficients) -> Value {
    json!({
        "thrust_n": of.thrust_n,
        "torque_nm": of.torque_nm,
        "ktc_n_per_mm2": coefficients.ktc_n_per_mm2,
        "krc_n_per_mm2": coefficients.krc_n_per_mm2,
        "kac_n_per_mm2": coefficients.kac_n_per_mm2,
    })
}

fn element(e: &LipElement) -> Value {
    let [ktc, krc, kac] = e.coefficients_n_per_mm2;
    json!({
        "radius_mm": e.place.radius_mm,
        "rake_deg": e.place.rake_rad.to_degrees(),
        "inclination_deg": e.place.inclination_rad.to_degrees(),
        "chip_mm": e.chip_mm,
        "cutting_speed_m_per_min": e.speed_m_per_min,
        "ktc_n_per_mm2": ktc,
        "krc_n_per_mm2": krc,
        "kac_n_per_mm2": kac,
    })
}

/// `drill`; null where it is not predicted.
pub fn document(analysis: &LobeAnalysis) -> Value {
    let Some(drill) = &analysis.drill else {
        return Value::Null;
    };
    let chisel = drill.chisel.as_ref().map(|chisel| match chisel {
        Ok(chisel) => {
            let mut found = forces(&chisel.forces, &chisel.coefficients);
            found["half_length_mm"] = json!(drill.drill.chisel_mm);
            found["rake_deg"] = json!(chisel.rake_rad.to_degrees());
            found["indentation_radius_mm"] = json!(chisel.indentation_radius_mm);
            found["indentation_thrust_n"] = json!(chisel.indentation_thrust_n);
            found["left_out_because"] = Value::Null;
            found
        }
        Err(reason) => json!({ "left_out_because": reason }),
    });
    let total = drill.total();
    json!({
        "feed_per_rev_mm": drill.feed_per_rev_mm,
        "inner_radius_mm": drill.inner_radius_mm,
        "thrust_n": total.thrust_n,
        "torque_nm": total.torque_nm,
        "lips": forces(&drill.lips, &drill.lip_coefficients),
        "chisel": chisel,
        "elements": drill.elements.iter().map(element).collect::<Vec<_>>(),
    })
}

pub fn text(analysis: &LobeAnalysis) -> String {
    let Some(drill) = &analysis.drill else {
        return String::new();
    };
    let every = drill.elements.len().div_ceil(SHOWN).max(1);
    // From the inside out, the corner included.
    let shown = drill.elements.iter().rev().step_by(every).collect::<Vec<_>>();
    let rows: Vec<Vec<String>> = shown
        .into_iter()
        .rev()
        .map(|e| {
            let mut row = vec![
                format!("{:.2}", e.place.radius_mm),
                format!("{:.1}", e.place.rake_rad.to_degrees()),
                format!("{:.1}", e.place.inclination_rad.to_degrees()),
                format!("{:.1}", e.speed_m_per_min),
            ];
            row.extend(e.coefficients_n_per_mm2.map(|k| number(k, 4)));
            row
        })
        .collect();
    let header = [
        "lip at mm",
        "rake °",
        "inclination °",
        "m/min",
        "Ktc N/mm²",
        "Krc",
        "Kac",
    ];
    let mut out = format!(
        "\nThe drill from the orthogonal database, {} mm per revolution (helix {:.0}°, point {:.0}°, web {} mm)\n{}",
        drill.feed_per_rev_mm,
        drill.drill.helix_rad.to_degrees(),
        2.0 * drill.drill.half_point_rad.to_degrees(),
        number(drill.drill.web_mm, 4),
        table(&header, &rows)
    );
    let part = |name: &str, of: &DrillForces, k: &DrillCoefficients| {
        format!(
            "  {name}: thrust {} N, torque {} N·m; Ktc {}, Krc {}, Kac {} N/mm² of its own width\n",
            number(of.thrust_n, 4),
            number(of.torque_nm, 3),
            number(k.ktc_n_per_mm2, 4),
            number(k.krc_n_per_mm2, 4),
            number(k.kac_n_per_mm2, 4),
        )
    };
    out += &part("lips", &drill.lips, &drill.lip_coefficients);
    match &drill.chisel {
        Some(Ok(chisel)) => {
            out += &part("chisel edge", &chisel.forces, &chisel.coefficients);
            out += &format!(
                "  chisel edge {:.2} mm long, rake {:.1}°; within {:.3} mm of the axis it is pressed in ({} N)\n",
                2.0 * drill.drill.chisel_mm,
                chisel.rake_rad.to_degrees(),
                chisel.indentation_radius_mm,
                number(chisel.indentation_thrust_n, 3),
            );
        }
        Some(Err(reason)) => out += &format!("  chisel edge: left out: {reason}\n"),
        None => out += "  chisel edge: none, the pilot hole is wider\n",
    }
    out
}
