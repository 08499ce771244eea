//! The surface of depth limits over spindle speed and redundancy angle.

use super::figure::{CellFormat, HeatMap};
use super::interactive::Surface;
use super::number::{decimals, significant};
use super::parts::{figure, paragraph};
use super::{Block, ReportTable, TableColumn, lobes_figure};
use crate::analysis::{LobeAnalysis, RedundancyAnalysis};
use crate::lobes::redundancy::AngleStatus;

/// Columns and rows of the map at most.
const SPEEDS: usize = 140;
const ANGLES: usize = 120;

pub fn blocks(analysis: &LobeAnalysis, found: &RedundancyAnalysis) -> Vec<Block> {
    let r = &found.recommendation;
    let count = |status| found.angles.iter().filter(|a| a.status == status).count();
    let mut blocks = vec![paragraph(format!(
        "The tool of posture {} turned about its own axis in steps of {}°: {} angles can be used, {} are forbidden, {} \
         are out of reach on the posture's branch. Recommended: {} rpm at {}°, where the cut is stable to {} mm with \
         the speed (or the robot's frequencies) off by up to {} %.",
        found.posture,
        significant(found.step_deg, 3),
        count(AngleStatus::Reachable),
        count(AngleStatus::Forbidden),
        count(AngleStatus::Unreachable),
        decimals(r.point.spindle_rpm, 1),
        decimals(r.point.angle_deg, 1),
        significant(r.point.depth_mm, 3),
        decimals(100.0 * r.speed_margin, 0),
    ))];
    if !r.agree {
        blocks.push(Block::Warning(
            "Enumeration and particle swarm disagree on the deepest place: use a finer step_deg.".into(),
        ));
    }
    let surface = surface(analysis, found);
    let map = heat_map(&surface);
    blocks.push(figure(
        "lobes-redundancy".to_string(),
        &map.title.clone(),
        "Depth limit over spindle speed and redundancy angle. Dashes (on a screen: grey): angle forbidden or out of reach. Deep places \
         beyond the end of the colour scale have its last colour."
            .to_string(),
        map.png(),
    )
    .with_plot(surface.plot()));
    blocks.extend(lobes_figure::as_it_stands_and_recommended(
        analysis,
        r.point.angle_deg,
    ));
    let joints: Vec<String> = r
        .posture
        .joints_deg
        .iter()
        .flatten()
        .map(|j| decimals(*j, 2))
        .collect();
    let optional = |v: Option<f64>, digits| v.map_or("–".to_string(), |v| decimals(v, digits));
    let mut rows = vec![
        ("joint angles (°)", joints.join(", ")),
        ("nearest joint limit (°)", optional(r.posture.limit_margin_deg, 1)),
        (
            "singularity margin (0 to 1)",
            optional(r.posture.singularity_margin, 2),
        ),
        ("limit with speed margin (mm)", significant(r.point.depth_mm, 3)),
        (
            "5 % quantile of it over the model's uncertainty (mm)",
            r.lower_quantile_mm.map_or("–".into(), |d| significant(d, 3)),
        ),
        (
            "limit at exactly that speed (mm)",
            r.tip_depth_mm.map_or("no limit".into(), |d| significant(d, 3)),
        ),
        (
            "absolute limit at that angle (mm)",
            r.absolute_limit
                .map_or("no limit".into(), |a| significant(a.depth_mm, 3)),
        ),
        ("by enumeration (mm)", significant(r.enumeration.depth_mm, 4)),
        ("by particle swarm (mm)", significant(r.swarm.depth_mm, 4)),
        ("difference of the two (%)", decimals(100.0 * r.difference, 2)),
    ];
    if let Some(elbow_deg) = r.posture.elbow_deg {
        rows.insert(1, ("elbow angle (°)", decimals(elbow_deg, 1)));
    }
    blocks.push(Block::Table(ReportTable {
        caption: "The recommended place".into(),
        columns: vec![TableColumn::text("quantity"), TableColumn::text("value")],
        rows: rows
            .into_iter()
            .map(|(name, value)| vec![name.to_string(), value])
            .collect(),
        notes: vec![],
    }));
    blocks
}

/// Rows are angles (all of them, empty where they cannot be used), columns the least limit over a stretch of speeds.
fn surface(analysis: &LobeAnalysis, found: &RedundancyAnalysis) -> Surface {
    let speeds = analysis.cases.first().map_or(&[][..], |c| &c.curve.spindle_rpm);
    let stretch = speeds.len().div_ceil(SPEEDS).max(1);
    let every = found.angles.len().div_ceil(ANGLES).max(1);
    let angles: Vec<f64> = found.angles.iter().step_by(every).map(|a| a.angle_deg).collect();
    let values: Vec<Vec<Option<f64>>> = angles
        .iter()
        .map(|angle| {
            let Some(case) = analysis.cases.iter().find(|c| c.angle_deg == Some(*angle)) else {
                return vec![None; speeds.len().div_ceil(stretch)];
            };
            let least = |depths: &[Option<f64>]| depths.iter().flatten().copied().reduce(f64::min);
            case.curve.depth_limit_mm.chunks(stretch).map(least).collect()
        })
        .collect();
    let mut finite: Vec<f64> = values.iter().flatten().flatten().copied().collect();
    finite.sort_by(f64::total_cmp);
    // Single deep tips must not wash out the rest.
    let top = finite.get(finite.len().saturating_sub(1) * 97 / 100).copied();
    let place = &found.recommendation.point;
    Surface {
        title: format!(
            "Depth limit over spindle speed and redundancy angle, posture {}",
            found.posture
        ),
        spindle_rpm: speeds.iter().step_by(stretch).copied().collect(),
        angle_deg: angles,
        depth_mm: values,
        top_mm: top,
        recommended: Some((place.spindle_rpm, place.angle_deg)),
    }
}

/// The surface as the static figure has it.
fn heat_map(surface: &Surface) -> HeatMap {
    HeatMap {
        title: surface.title.clone(),
        row_label: "Redundancy angle (°)".into(),
        column_label: "Spindle speed (rpm)".into(),
        rows: surface.angle_deg.iter().map(|a| decimals(*a, 0)).collect(),
        columns: surface.spindle_rpm.iter().map(|n| decimals(*n, 0)).collect(),
        values: surface.depth_mm.clone(),
        value_label: "Depth limit (mm)".into(),
        format: CellFormat::Significant(3),
        range: surface.top_mm.map(|t| (0.0, t)),
        ..Default::default()
    }
}
