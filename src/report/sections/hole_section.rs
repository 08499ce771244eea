//! The hole itself: where the static forces put the tool, against its tolerances.

use crate::analysis::LobeAnalysis;
use crate::cutting::{DrillCoefficients, DrillForces};
use crate::lobes::drilling::hole::{HoleCheck, HoleError, Uncertain};
use crate::report::figure::{HoleFigure, HolePanel};
use crate::report::number::{decimals, significant, with_error};
use crate::report::parts::{figure, paragraph};
use crate::report::{Block, ReportTable, TableColumn};

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
            blocks.push(errors([(place.clone(), &weighed.recommended)], check));
            blocks.extend(remedies(&[(place, &weighed.recommended)]));
        }
        None => {
            let cases = analysis.cases.iter();
            let holes: Vec<(String, &HoleError)> = cases
                .filter_map(|c| Some((c.posture.clone().unwrap_or_default(), c.hole.as_ref()?)))
                .collect();
            blocks.push(errors(holes.iter().cloned(), check));
            blocks.extend(remedies(&holes));
        }
    }
    blocks
}

/// What to command instead, and what the contacts take.
fn remedies(holes: &[(String, &HoleError)]) -> Vec<Block> {
    let poses = holes.iter().filter_map(|(place, hole)| match &hole.compensation {
        Some(Ok(pose)) => Some((place, pose)),
        _ => None,
    });
    let rows: Vec<Vec<String>> = poses
        .map(|(place, pose)| {
            let mut row = vec![place.clone()];
            row.extend(pose.offset_m.map(|m| decimals(1e3 * m, 3)));
            row.extend(pose.turn_rad.map(|a| decimals(a.to_degrees(), 4)));
            let joints: Vec<String> = pose.joints_deg.iter().map(|q| decimals(*q, 4)).collect();
            row.push(joints.join(" "));
            row
        })
        .collect();
    let mut blocks = Vec::new();
    if !rows.is_empty() {
        blocks.push(Block::Table(ReportTable {
            caption: "Pose to command instead".into(),
            columns: vec![
                TableColumn::text("place"),
                TableColumn::number("Δx (mm)"),
                TableColumn::number("Δy (mm)"),
                TableColumn::number("Δz (mm)"),
                TableColumn::number("turn about x (°)"),
                TableColumn::number("about y (°)"),
                TableColumn::number("about z (°)"),
                TableColumn::text("joints (°)"),
            ],
            rows,
            notes: vec![
                "Base axes, on top of the target: thrust and torque then push the tool to where it should be. The lateral force \
                 turns with the tool and stays."
                    .into(),
            ],
        }));
    }
    let contacts: Vec<Vec<String>> = holes
        .iter()
        .flat_map(|(place, hole)| hole.contacts.iter().map(move |contact| (place, contact)))
        .map(|(place, contact)| {
            vec![
                place.clone(),
                contact.name.clone(),
                significant(contact.force_n, 3),
                contact.preload_n.map_or("–".into(), |p| significant(p, 3)),
                if contact.gives_way { "GIVES WAY" } else { "holds" }.into(),
            ]
        })
        .collect();
    if !contacts.is_empty() {
        blocks.push(Block::Table(ReportTable {
            caption: "What the contacts take of the cutting forces".into(),
            columns: vec![
                TableColumn::text("place"),
                TableColumn::text("contact"),
                TableColumn::number("takes (N)"),
                TableColumn::number("holds up to (N)"),
                TableColumn::text(""),
            ],
            rows: contacts,
            notes: Vec::new(),
        }));
    }
    blocks
}

/// What the orthogonal database predicts of the drill; `None` where it is not asked.
pub fn drill(analysis: &LobeAnalysis) -> Option<Block> {
    let drill = analysis.drill.as_ref()?;
    let row = |name: &str, of: &DrillForces, k: &DrillCoefficients| {
        let mut row = vec![
            name.to_string(),
            significant(of.thrust_n, 4),
            significant(of.torque_nm, 3),
        ];
        row.extend([k.ktc_n_per_mm2, k.krc_n_per_mm2, k.kac_n_per_mm2].map(|v| significant(v, 4)));
        row
    };
    let mut rows = vec![row("lips", &drill.lips, &drill.lip_coefficients)];
    let mut notes = vec![format!(
        "{} mm per revolution; coefficients per chip area of the part's own radial width.",
        drill.feed_per_rev_mm
    )];
    match &drill.chisel {
        Some(Ok(chisel)) => rows.push(row("chisel edge", &chisel.forces, &chisel.coefficients)),
        Some(Err(reason)) => notes.push(format!("The chisel edge is left out: {reason}.")),
        None => {}
    }
    Some(Block::Table(ReportTable {
        caption: "The drill from the orthogonal database".into(),
        columns: vec![
            TableColumn::text("part"),
            TableColumn::number("thrust (N)"),
            TableColumn::number("torque (N·m)"),
            TableColumn::number("Ktc (N/mm²)"),
            TableColumn::number("Krc (N/mm²)"),
            TableColumn::number("Kac (N/mm²)"),
        ],
        rows,
        notes,
    }))
}

/// Static stiffness along the feed, posture by posture; over the redundancy angle the stiffest.
pub fn feed_stiffness(analysis: &LobeAnalysis) -> Option<Block> {
    let mut cases: Vec<_> = analysis
        .cases
        .iter()
        .filter_map(|case| Some((case, case.feed_stiffness.as_ref()?)))
        .collect();
    if analysis.redundancy.is_some() {
        cases.sort_by(|a, b| b.1.along_feed_n_per_m.total_cmp(&a.1.along_feed_n_per_m));
        cases.truncate(5);
    }
    let rows: Vec<Vec<String>> = cases
        .into_iter()
        .map(|(case, found)| {
            let mega = |v: f64| significant(1e-6 * v, 4);
            let posture = case.posture.clone().unwrap_or_default();
            vec![
                case.angle_deg
                    .map_or(posture.clone(), |a| format!("{posture}, {}°", decimals(a, 1))),
                mega(found.along_feed_n_per_m),
                significant(found.index, 3),
                mega(found.along_axis_n_per_m),
                mega(found.across_least_n_per_m),
                mega(found.across_greatest_n_per_m),
            ]
        })
        .collect();
    (!rows.is_empty()).then(|| {
        Block::Table(ReportTable {
            caption: "Static stiffness along the feed".into(),
            columns: vec![
                TableColumn::text("place"),
                TableColumn::number("along the feed (MN/m)"),
                TableColumn::number("index"),
                TableColumn::number("along the tool (MN/m)"),
                TableColumn::number("across, least (MN/m)"),
                TableColumn::number("across, greatest (MN/m)"),
            ],
            rows,
            notes: vec![
                "At the tool point. Drilling feeds along the tool; otherwise the feed is taken across it in the stiffest direction. \
                 Index: over the stiffness in the stiffest direction there is."
                    .into(),
            ],
        })
    })
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
    let met = |good| if good { "within" } else { "OUT" }.to_string();
    let rows = holes.into_iter().map(|(place, hole)| {
        let mut row = vec![place];
        for (of, good) in [
            (&hole.position_mm, tolerance.position_met(hole)),
            (&hole.tilt_deg, tolerance.perpendicularity_met(hole)),
        ] {
            let value = match of.std {
                Some(std) => with_error(of.value, std),
                None => significant(of.value, 3),
            };
            let upper = of.upper.map_or("–".to_string(), |v| significant(v, 3));
            row.extend([value, upper, met(good)]);
        }
        row.push(significant(hole.axial_mm, 3));
        if let Some(good) = tolerance.diameter_met(hole) {
            row.push(significant(hole.oversize_mm.bound(), 3));
            row.push(met(good));
        }
        row
    });
    let mut columns = columns();
    let mut notes = vec!["Along the axis: negative where the tool is pushed back from the workpiece.".into()];
    if let Some(diameter) = &tolerance.diameter {
        columns.push(TableColumn::number("oversize, 95 % (mm)"));
        columns.push(TableColumn::text(diameter.name()));
        notes.push(format!(
            "Oversize: what the turning lateral force adds to the diameter that the drill itself cuts; {} allows {} mm.",
            diameter.name(),
            diameter.width_mm
        ));
    }
    Block::Table(ReportTable {
        caption: "Static error of the hole".into(),
        columns,
        rows: rows.collect(),
        notes,
    })
}

fn columns() -> Vec<TableColumn> {
    vec![
        TableColumn::text("place"),
        TableColumn::number("position error ± std. dev. (mm)"),
        TableColumn::number("95 % (mm)"),
        TableColumn::text("position"),
        TableColumn::number("tilt ± std. dev. (°)"),
        TableColumn::number("95 % (°)"),
        TableColumn::text("perpendicularity"),
        TableColumn::number("along the axis (mm)"),
    ]
}
