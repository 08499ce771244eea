//! What loads the tool in the hole that a campaign's `[lobes]` table asks for, and what the hole may be off by.

use std::fmt::Display;

use crate::analysis::stability::lobe_setup::{group_of_cuts, half_point_angle_rad};
use crate::analysis::workbench::Workbench;
use crate::campaign::{Campaign, CutGeometry, HoleSection, LobesSection, Process, Tool};
use crate::cutting::{DrillPrediction, ForceAxis, ForceGroup, average_row, coefficients_of};
use crate::lobes::drilling::hole::{HoleCheck, HoleLoad, HoleTolerance, milling_torque_nm};
use crate::lobes::drilling::iso_tolerance::DiameterTolerance;

/// What loads the tool, from `[lobes.hole]`, and what is not given there from the cutting coefficients. `own`: the coefficients of the
/// campaign's cuts where somebody has already worked them out; `drill`: predicted from an orthogonal database.
///
/// # Errors
/// In words for people: why the thrust is not known, and what to give.
pub fn hole_check(
    campaign: &Workbench,
    section: &LobesSection,
    own: Option<&ForceGroup>,
    drill: Option<&DrillPrediction>,
) -> std::result::Result<HoleCheck, String> {
    let usual = HoleSection::default();
    let asked = section.hole.as_ref().unwrap_or(&usual);
    let tolerance = HoleTolerance {
        position_mm: asked.position_tolerance_mm,
        perpendicularity_deg: asked.perpendicularity_tolerance_deg,
        diameter: diameter_tolerance(campaign, section, asked)?,
    };
    let load = match (asked.thrust_n, asked.torque_nm, asked.lateral_n) {
        (Some(thrust_n), Some(torque_nm), Some(lateral_n)) => HoleLoad {
            thrust_n,
            torque_nm,
            lateral_n,
            source: "[lobes.hole]".into(),
        },
        (thrust_n, torque_nm, lateral_n) => match (predicted(campaign, section, asked, own, drill), thrust_n)
        {
            (Ok(p), _) => HoleLoad {
                thrust_n: thrust_n.unwrap_or(p.thrust_n),
                torque_nm: torque_nm.unwrap_or(p.torque_nm),
                lateral_n: lateral_n.unwrap_or(p.lateral_n),
                source: match thrust_n.or(torque_nm).or(lateral_n) {
                    Some(_) => format!("[lobes.hole], the rest from {}", p.source),
                    None => p.source,
                },
            },
            (Err(_), Some(thrust_n)) => HoleLoad {
                thrust_n,
                torque_nm: torque_nm.unwrap_or(0.0),
                lateral_n: lateral_n.unwrap_or(0.0),
                source: "[lobes.hole]; what is not given there is taken as 0".into(),
            },
            (Err(reason), None) => {
                return Err(format!(
                    "{reason}; or give thrust_n, torque_nm and lateral_n in [lobes.hole]"
                ));
            }
        },
    };
    let numbers = [load.thrust_n, load.torque_nm, load.lateral_n];
    if numbers.iter().all(|v| v.is_finite()) {
        Ok(HoleCheck { load, tolerance })
    } else {
        Err("the cutting coefficients give no finite force; give thrust_n, torque_nm and lateral_n in [lobes.hole]".into())
    }
}

/// The tolerance of the diameter that is asked for.
fn diameter_tolerance(
    campaign: &Campaign,
    section: &LobesSection,
    asked: &HoleSection,
) -> std::result::Result<Option<DiameterTolerance>, String> {
    let Some(grade) = asked.diameter_grade else {
        return Ok(None);
    };
    if section.process != Process::Drilling {
        return Err("diameter_tolerance of [lobes.hole] is that of a drilled hole; take it out".into());
    }
    let tool = campaign
        .tool
        .as_ref()
        .ok_or("the diameter that diameter_tolerance refers to is not known: add a [tool] table")?;
    let tolerance = DiameterTolerance::h(grade, tool.diameter_mm);
    tolerance.map(Some).ok_or(format!(
        "ISO 286 has no H{grade} for a diameter of {} mm; take diameter_tolerance out of [lobes.hole]",
        tool.diameter_mm
    ))
}

fn words(error: impl Display) -> String {
    error.to_string()
}

/// What the cutting coefficients predict.
fn predicted(
    campaign: &Workbench,
    section: &LobesSection,
    asked: &HoleSection,
    own: Option<&ForceGroup>,
    drill: Option<&DrillPrediction>,
) -> std::result::Result<HoleLoad, String> {
    if let Some(drill) = drill {
        let total = drill.total();
        let parts = match &drill.chisel {
            Some(Ok(_)) => "lips and chisel edge",
            Some(Err(_)) => "the lips alone: a lower bound",
            None => "the lips",
        };
        return Ok(HoleLoad {
            thrust_n: total.thrust_n,
            torque_nm: total.torque_nm,
            lateral_n: 0.0,
            source: format!("the orthogonal database and the drill's geometry, {parts}"),
        });
    }
    let tool = campaign
        .tool
        .as_ref()
        .ok_or("the tool's diameter is not known: add a [tool] table")?;
    let tool = Tool {
        teeth: section.teeth.unwrap_or(tool.teeth),
        half_point_angle_deg: section.half_point_angle_deg.or(tool.half_point_angle_deg),
        ..tool.clone()
    };
    let group = || match own {
        Some(group) => Ok(group.clone()),
        None => group_of_cuts(campaign, section, &mut Vec::new()).map_err(words),
    };
    match section.process {
        Process::Drilling => drilling(campaign, section, asked, &tool, group),
        Process::Milling => milling(campaign, &tool, group),
        Process::Turning => Err("turning makes no hole".into()),
    }
}

/// All coefficients of the campaign's cuts, in the order of [`coefficients_of`].
fn complete(group: &ForceGroup) -> std::result::Result<Vec<f64>, String> {
    coefficients_of(group.process)
        .iter()
        .map(|kind| {
            group
                .coefficient(kind.label)
                .and_then(|c| c.value)
                .ok_or(format!("the campaign's cuts do not determine {}", kind.label))
        })
        .collect()
}

/// Mean force of a cut along an axis, N, or torque, N·m.
fn along(
    tool: &Tool,
    geometry: &CutGeometry,
    axis: ForceAxis,
    coefficients: &[f64],
) -> std::result::Result<f64, String> {
    let row = average_row(tool, geometry, axis).map_err(words)?;
    Ok(row.iter().zip(coefficients).map(|(r, c)| r * c).sum())
}

/// Thrust and torque at full engagement (see [`crate::cutting::DrillGeometry`]); two sharp lips balance each other
/// laterally.
fn drilling(
    campaign: &Campaign,
    section: &LobesSection,
    asked: &HoleSection,
    tool: &Tool,
    group: impl Fn() -> std::result::Result<ForceGroup, String>,
) -> std::result::Result<HoleLoad, String> {
    let geometry = CutGeometry::Drilling {
        feed_per_rev_mm: section
            .feed_per_rev_mm
            .ok_or("the thrust needs the feed: give lobes.feed_per_rev_mm")?,
        pilot_diameter_mm: asked.pilot_diameter_mm.unwrap_or(0.0),
        hole_depth_mm: None,
    };
    let (coefficients, from) = match (section.ktc_n_per_mm2, section.kac_n_per_mm2) {
        // Ktc, Kte, Kfc, Kfe: Kac is the axial part of the force normal to the lip.
        (Some(ktc), Some(kac)) => {
            let half_point_rad = half_point_angle_rad(campaign, section).map_err(words)?;
            let coefficients = vec![ktc, 0.0, kac / half_point_rad.sin(), 0.0];
            (coefficients, "Ktc and Kac of [lobes], without edge forces")
        }
        _ => {
            let coefficients = complete(&group().map_err(|reason| {
                format!("the thrust is not known: give lobes.kac_n_per_mm2, or drilling cuts ({reason})")
            })?)?;
            (coefficients, "the coefficients of the campaign's cuts")
        }
    };
    let chisel = match asked.pilot_diameter_mm {
        Some(pilot) if pilot > 0.0 => "",
        _ => ", without the thrust of the chisel edge: a lower bound",
    };
    Ok(HoleLoad {
        thrust_n: along(tool, &geometry, ForceAxis::Z, &coefficients)?,
        torque_nm: along(tool, &geometry, ForceAxis::Mz, &coefficients)?,
        lateral_n: 0.0,
        source: format!("{from}{chisel}"),
    })
}

/// The mean forces of that milling cut of the campaign which pushes hardest sideways.
fn milling(
    campaign: &Campaign,
    tool: &Tool,
    group: impl Fn() -> std::result::Result<ForceGroup, String>,
) -> std::result::Result<HoleLoad, String> {
    let group = group().map_err(|reason| format!("the forces need milling cuts ({reason})"))?;
    let coefficients = complete(&group)?;
    let mut hardest: Option<HoleLoad> = None;
    for cut in campaign.cuts.iter().filter(|c| group.cuts.contains(&c.id)) {
        let mean = |axis| along(tool, &cut.geometry, axis, &coefficients);
        let lateral_n = mean(ForceAxis::X)?.hypot(mean(ForceAxis::Y)?);
        if hardest.as_ref().is_none_or(|h| lateral_n > h.lateral_n) {
            hardest = Some(HoleLoad {
                thrust_n: mean(ForceAxis::Z)?,
                torque_nm: milling_torque_nm(tool, &cut.geometry, coefficients[0], coefficients[3]),
                lateral_n,
                source: format!(
                    "the mean forces of cut {} by the coefficients of the campaign's cuts, the feed in any direction",
                    cut.id
                ),
            });
        }
    }
    hardest.ok_or_else(|| "the forces need milling cuts".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The defaults are those of the built-in data.
    #[test]
    fn usual_tolerances() {
        let text = include_str!("../../../datasets/irb6640/cutting_conditions.toml");
        let table: toml::Table = toml::from_str(text).unwrap();
        let given = |key: &str| table["hole_tolerances"][key].as_float().unwrap();
        let usual = HoleSection::default();
        assert_eq!(usual.position_tolerance_mm, given("position_mm"));
        assert_eq!(
            usual.perpendicularity_tolerance_deg,
            given("perpendicularity_deg")
        );
    }
}
