//! What `lobestone lobes` says of a drill that is predicted from an orthogonal database.

use serde::Serialize;

use crate::analysis::LobeAnalysis;
use crate::commands::text::{number, table};
use crate::cutting::{ChiselShare, DrillCoefficients, DrillForces, DrillPrediction, LipElement};

/// Elements of the lip that are shown, of those that were summed.
const SHOWN: usize = 8;

/// The drill, predicted.
#[derive(Serialize)]
pub(super) struct DrillTold<'a> {
    feed_per_rev_mm: f64,
    inner_radius_mm: f64,
    thrust_n: f64,
    torque_nm: f64,
    lips: PartForces<'a>,
    chisel: Option<Chisel<'a>>,
    elements: Vec<Element>,
}

impl<'a> DrillTold<'a> {
    /// `None` where it is not predicted.
    pub fn of(analysis: &'a LobeAnalysis) -> Option<Self> {
        let drill = analysis.drill.as_ref()?;
        let total = drill.total();
        Some(DrillTold {
            feed_per_rev_mm: drill.feed_per_rev_mm,
            inner_radius_mm: drill.inner_radius_mm,
            thrust_n: total.thrust_n,
            torque_nm: total.torque_nm,
            lips: PartForces {
                forces: &drill.lips,
                coefficients: &drill.lip_coefficients,
            },
            chisel: drill.chisel.as_ref().map(|chisel| Chisel::of(chisel, drill)),
            elements: drill.elements.iter().map(Element::of).collect(),
        })
    }
}

/// What one part of the edge contributes.
#[derive(Serialize)]
struct PartForces<'a> {
    #[serde(flatten)]
    forces: &'a DrillForces,
    #[serde(flatten)]
    coefficients: &'a DrillCoefficients,
}

#[derive(Serialize)]
struct Chisel<'a> {
    #[serde(flatten)]
    predicted: Option<ChiselPredicted<'a>>,
    left_out_because: Option<&'a str>,
}

#[derive(Serialize)]
struct ChiselPredicted<'a> {
    #[serde(flatten)]
    part: PartForces<'a>,
    half_length_mm: f64,
    rake_deg: f64,
    indentation_radius_mm: f64,
    indentation_thrust_n: f64,
}

impl<'a> Chisel<'a> {
    fn of(chisel: &'a std::result::Result<ChiselShare, String>, drill: &DrillPrediction) -> Self {
        let predicted = chisel.as_ref().ok().map(|chisel| ChiselPredicted {
            part: PartForces {
                forces: &chisel.forces,
                coefficients: &chisel.coefficients,
            },
            half_length_mm: drill.drill.chisel_mm,
            rake_deg: chisel.rake_rad.to_degrees(),
            indentation_radius_mm: chisel.indentation_radius_mm,
            indentation_thrust_n: chisel.indentation_thrust_n,
        });
        Chisel {
            predicted,
            left_out_because: chisel.as_ref().err().map(String::as_str),
        }
    }
}

/// A stretch of the lip.
#[derive(Serialize)]
struct Element {
    radius_mm: f64,
    rake_deg: f64,
    inclination_deg: f64,
    chip_mm: f64,
    cutting_speed_m_per_min: f64,
    ktc_n_per_mm2: f64,
    krc_n_per_mm2: f64,
    kac_n_per_mm2: f64,
}

impl Element {
    fn of(e: &LipElement) -> Self {
        let [ktc_n_per_mm2, krc_n_per_mm2, kac_n_per_mm2] = e.coefficients_n_per_mm2;
        Element {
            radius_mm: e.place.radius_mm,
            rake_deg: e.place.rake_rad.to_degrees(),
            inclination_deg: e.place.inclination_rad.to_degrees(),
            chip_mm: e.chip_mm,
            cutting_speed_m_per_min: e.speed_m_per_min,
            ktc_n_per_mm2,
            krc_n_per_mm2,
            kac_n_per_mm2,
        }
    }
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
