//! The hole itself: where the static forces put the tool, against its tolerances.

use super::figure::{HoleFigure, HolePanel};
use super::number::{decimals, significant};
use super::parts::{figure, paragraph};
use super::{Block, ReportTable, TableColumn};
use crate::analysis::LobeAnalysis;
use crate::lobes::hole::{HoleCheck, HoleError, Uncertain};

pub fn blocks(analysis: &LobeAnalysis) -> Vec<Block> {
    let check = match &analysis.hole {
        None => return Vec::new(),
        Some(Err(reason)) => {
            return vec![paragraph(format!("The hole itself is not worked out: {reason}."))];
        }
        Some(Ok(check)) => check,
    };
    let (load, tolerance) = (&check.load, &check.tolerance);
    let mut blocks = vec![paragraph(format!(
        "The hole itself: the tool is pushed with {} N along its axis, {} N across it and {} N·m about it (from: {}). What \
         the robot gives under that is the hole's error; it may be {} mm in position and {}° in perpendicularity. The 95 % \
         bound over the uncertainty of the model's parameters is held against that. The robot's own positioning errors, \
         lost motion and vibration come on top.",
        significant(load.thrust_n, 3),
        significant(load.lateral_n, 3),
        significant(load.torque_nm, 3),
        load.source,
        tolerance.position_mm,
        tolerance.perpendicularity_deg,
    ))];
    match analysis
        .redundancy
        .as_ref()
        .and_then(|r| Some((r, r.hole.as_ref()?)))
    {
        Some((found, weighed)) => {
            blocks.push(paragraph(format!("{}.", weighed.sentence(found))));
            let drawing = over_the_angle(analysis, check);
            let caption = "Static error of the hole over the redundancy angle: signs are the model's, bars reach to the 95 % \
                           bound, dots are the tolerance. Angles without a sign are forbidden or out of reach.";
            blocks.push(figure(
                "lobes-hole",
                &drawing.title.clone(),
                caption,
                drawing.png(),
            ));
            let place = format!(
                "{}, {}°",
                found.posture,
                decimals(found.recommendation.point.angle_deg, 1)
            );
            blocks.push(errors([(place, &weighed.recommended)], check));
        }
        None => {
            let cases = analysis.cases.iter();
            let holes = cases.filter_map(|c| Some((c.posture.clone().unwrap_or_default(), c.hole.as_ref()?)));
            blocks.push(errors(holes, check));
        }
    }
    blocks
}

fn over_the_angle(analysis: &LobeAnalysis, check: &HoleCheck) -> HoleFigure {
    let cases = analysis.cases.iter();
    let holes: Vec<(f64, &HoleError)> = cases
        .filter_map(|c| Some((c.angle_deg?, c.hole.as_ref()?)))
        .collect();
    let panel = |label: &str, tolerance, of: fn(&HoleError) -> &Uncertain| HolePanel {
        label: label.into(),
        value: holes.iter().map(|(_, h)| of(h).value).collect(),
        bound: holes.iter().map(|(_, h)| of(h).bound()).collect(),
        tolerance,
    };
    HoleFigure {
        title: "Static error of the hole over the redundancy angle".into(),
        angle_deg: holes.iter().map(|(angle, _)| *angle).collect(),
        recommended_deg: analysis
            .redundancy
            .as_ref()
            .map(|r| r.recommendation.point.angle_deg),
        panels: vec![
            panel("Position error (mm)", check.tolerance.position_mm, |h| {
                &h.position_mm
            }),
            panel("Tilt (°)", check.tolerance.perpendicularity_deg, |h| &h.tilt_deg),
        ],
    }
}

fn errors<'a>(holes: impl IntoIterator<Item = (String, &'a HoleError)>, check: &HoleCheck) -> Block {
    let tolerance = &check.tolerance;
    let optional = |v: Option<f64>, digits| v.map_or("–".to_string(), |v| significant(v, digits));
    let met = |good| if good { "within" } else { "OUT" }.to_string();
    let rows = holes.into_iter().map(|(place, hole)| {
        let mut row = vec![place];
        for (of, good) in [
            (&hole.position_mm, tolerance.position_met(hole)),
            (&hole.tilt_deg, tolerance.perpendicularity_met(hole)),
        ] {
            row.extend([
                significant(of.value, 3),
                optional(of.std, 2),
                optional(of.upper, 3),
                met(good),
            ]);
        }
        row.push(significant(hole.axial_mm, 3));
        row
    });
    Block::Table(ReportTable {
        caption: "Static error of the hole".into(),
        columns: vec![
            TableColumn::text("place"),
            TableColumn::number("position error (mm)"),
            TableColumn::number("± (mm)"),
            TableColumn::number("95 % (mm)"),
            TableColumn::text("position"),
            TableColumn::number("tilt (°)"),
            TableColumn::number("± (°)"),
            TableColumn::number("95 % (°)"),
            TableColumn::text("perpendicularity"),
            TableColumn::number("along the axis (mm)"),
        ],
        rows: rows.collect(),
        notes: vec!["Along the axis: negative where the tool is pushed back from the workpiece.".into()],
    })
}
