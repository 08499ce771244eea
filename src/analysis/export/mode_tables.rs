//! Modes and shapes of every posture, and where on the robot the shapes were measured.

use crate::Result;
use crate::analysis::modes::modal::{ModalAnalysis, SetModes};
use crate::analysis::modes::modal_export::{modes_columns, shape_arrays, shapes_columns, uff55};
use crate::analysis::workbench::Workbench;
use crate::campaign::{BodyRef, Campaign};
use crate::ingest::{Cells, ColumnTable, Geometry, NamedColumn, nodes_text, variable_name};
use crate::robot::{RobotModel, RobotSpec};

type Universals = Vec<(String, Vec<u8>)>;

/// Tables of modes and shapes; universal files of shapes (15, 82, 55) and of places (2411, 82) for each posture.
///
/// # Errors
/// FRFs that cannot be read or analysed; a robot file that cannot be read.
pub(super) fn mode_files(campaign: &Workbench) -> Result<(Vec<ColumnTable>, Universals)> {
    let analysis = ModalAnalysis::usual(campaign)?;
    let modes = stacked(&analysis.sets, modes_columns);
    let shapes = stacked(&analysis.sets, shapes_columns);
    let mut shape_table = ColumnTable::new("shapes", shapes);
    for set in &analysis.sets {
        let prefix = variable_name(&set.set);
        shape_table.arrays.extend(shape_arrays(set, &prefix));
    }
    let mut universal = Vec::new();
    for set in &analysis.sets {
        let geometry = places(campaign, set)?;
        let name = |what: &str| format!("{what}-{}", variable_name(&set.set));
        universal.push((name("modes"), uff55(set, Some(&geometry)).into_bytes()));
        if !geometry.nodes.is_empty() {
            universal.push((name("geometry"), nodes_text(&geometry).into_bytes()));
        }
    }
    Ok((vec![ColumnTable::new("modes", modes), shape_table], universal))
}

/// The columns of all sets below each other, with the posture before them.
fn stacked(sets: &[SetModes], of: fn(&SetModes) -> Vec<NamedColumn>) -> Vec<NamedColumn> {
    let mut all: Vec<NamedColumn> = Vec::new();
    for set in sets {
        let mut columns = of(set);
        let rows = columns.first().map_or(0, |c| c.cells.len());
        columns.insert(0, NamedColumn::text("posture", vec![set.set.clone(); rows]));
        if all.is_empty() {
            all = columns;
            continue;
        }
        for (column, more) in all.iter_mut().zip(columns) {
            match (&mut column.cells, more.cells) {
                (Cells::Text(v), Cells::Text(more)) => v.extend(more),
                (Cells::Number(v), Cells::Number(more)) => v.extend(more),
                (Cells::Complex(v), Cells::Complex(more)) => v.extend(more),
                _ => {}
            }
        }
    }
    all
}

/// Where the campaign's points stand at the set's posture, joined along the arm. Without a robot nobody knows.
fn places(campaign: &Campaign, set: &SetModes) -> Result<Geometry> {
    let posture = campaign.postures.iter().find(|p| p.id == set.set);
    let (Some(section), Some(posture)) = (&campaign.robot, posture) else {
        return Ok(Geometry::default());
    };
    let robot = RobotModel::new(RobotSpec::load(&section.model, &campaign.dir)?);
    let kinematics = robot.kinematics(&posture.joints_deg)?;
    let nodes = campaign
        .points
        .iter()
        .map(|point| (point.node, robot.locate(&kinematics, point).0.coords.into()));
    let mut along: Vec<(usize, i64)> = campaign
        .points
        .iter()
        .map(|point| match point.body {
            BodyRef::Base => (0, point.node),
            BodyRef::Link(i) => (i, point.node),
            BodyRef::Tool => (usize::MAX, point.node),
        })
        .collect();
    along.sort_unstable();
    Ok(Geometry {
        nodes: nodes.collect(),
        lines: along.windows(2).map(|pair| [pair[0].1, pair[1].1]).collect(),
    })
}
