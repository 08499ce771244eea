//! The page about a fleet: who is to be looked at, and every quantity over time with its limits.

use super::figure::{ControlChartFigure, ControlPanel, ControlPoint, MOST_PANELS};
use super::number::{percent, significant, with_error};
use super::parts::{figure, paragraph};
use super::words::count;
use super::{Block, Page, ReportSection, ReportTable, TableColumn};
use crate::analysis::control_chart::{Basis, ControlChart};
use crate::analysis::fleet::{Attention, Fleet, Night, RobotHistory};
use crate::revision;

/// Robots whose charts are drawn; the table has all.
const DRAWN: usize = 40;
/// Campaigns of a robot that are listed.
const LISTED: usize = 12;

/// How the limits are made, for those who read the page.
pub const ABOUT_LIMITS: &str = "Limits: individuals chart (Shewhart 1931; NIST/SEMATECH e-Handbook 6.3.2.2). The last value is judged by \
     those before it: mean ± 3 σ with σ = mean moving range / 1.128, or the root mean square of the standard errors where that is \
     larger; with few values 3 is replaced by the Student quantile as rare, and the error of the mean is added. Fewer than four \
     earlier values have no limits.";

/// The page; `rows` campaigns were read, of which `failed` could not be worked on.
pub fn page(fleet: &Fleet, title: &str, [rows, failed]: [usize; 2], remarks: &[String]) -> Page {
    let made = revision::now().replace('T', " ").replace('Z', " UTC");
    let origin = [
        ("made", made),
        ("with Lobestone", env!("CARGO_PKG_VERSION").to_string()),
    ];
    let mut sections = vec![overview(fleet, remarks)];
    sections.extend(fleet.robots.iter().take(DRAWN).map(of_robot));
    let asking = fleet
        .robots
        .iter()
        .filter(|r| r.attention > Attention::Known)
        .count();
    Page {
        title: title.to_string(),
        subtitle: format!(
            "{} of {}, {} to look at; {failed} could not be worked on",
            count(rows, "row", "rows"),
            count(fleet.robots.len(), "robot", "robots"),
            asking
        ),
        origin: origin.map(|(name, value)| (name.to_string(), value)).to_vec(),
        open_sections: Some(1 + asking.min(DRAWN)),
        sections,
        without_scripts: true,
        ..Page::default()
    }
}

/// The worst first.
fn overview(fleet: &Fleet, remarks: &[String]) -> ReportSection {
    let columns = ["robot", "side", "look at it", "last campaign", "missing"].map(TableColumn::text);
    let numbers = ["confidence", "error", "noise", "farthest, σ", "campaigns"].map(TableColumn::number);
    let rows = fleet.robots.iter().map(|robot| {
        let last = robot.last();
        let verdict = last.and_then(|n| n.verdict.as_ref());
        let share = |pick: fn(&Night) -> Option<f64>| last.and_then(pick).map_or("–".into(), percent);
        vec![
            robot.robot.clone(),
            robot.domain.clone(),
            robot.attention.name().to_string(),
            last.map_or(String::new(), when),
            verdict.map_or("–".into(), |v| v.words()),
            verdict
                .and_then(|v| v.confidence)
                .map_or("–".into(), |c| format!("{:.0} %", 100.0 * c)),
            share(|n| n.nrms),
            share(|n| n.noise),
            farthest(robot),
            robot.nights.len().to_string(),
        ]
    });
    let mut blocks: Vec<Block> = remarks.iter().cloned().map(Block::Warning).collect();
    blocks.push(Block::Table(ReportTable {
        columns: columns.into_iter().chain(numbers).collect(),
        rows: rows.collect(),
        notes: vec![ABOUT_LIMITS.to_string()],
        ..ReportTable::default()
    }));
    ReportSection {
        id: "robots".into(),
        title: "Robots, worst first".into(),
        lead: "New verdicts first, then values that left their limits, files that could not be used, and verdicts that are known."
            .into(),
        blocks,
    }
}

/// The date, or the campaign where it has none.
fn when(night: &Night) -> String {
    night.date.clone().unwrap_or_else(|| night.campaign.clone())
}

fn farthest(robot: &RobotHistory) -> String {
    let known = robot.charts.iter().any(|c| c.last_sigmas.is_some());
    match known {
        true => significant(robot.farthest(), 2),
        false => "–".into(),
    }
}

fn of_robot(robot: &RobotHistory) -> ReportSection {
    let mut blocks: Vec<Block> = robot.reasons.iter().map(paragraph).collect();
    let nights: Vec<&Night> = robot.nights.iter().filter(|n| n.error.is_none()).collect();
    let names: Vec<String> = nights.iter().map(|n| when(n)).collect();
    let drawn = robot.charts.iter().filter(|c| c.points.len() > 1);
    let drawn: Vec<&ControlChart> = drawn.collect();
    for (i, charts) in drawn.chunks(MOST_PANELS).enumerate() {
        let panels = charts.iter().map(|chart| ControlPanel {
            label: chart.name.clone(),
            points: nights.iter().map(|n| point(chart, n)).collect(),
            limits: chart.limits.map(|l| [l.centre, l.lower, l.upper]),
        });
        let png = ControlChartFigure {
            title: format!("{}: what its campaigns say over time", robot.robot),
            names: names.clone(),
            panels: panels.collect(),
        }
        .png();
        blocks.push(figure(
            format!("{}-{}-{}", robot.robot, robot.domain, i + 1),
            "Quantities over time, each with its mean and limits",
            "The quantity that moved farthest comes first. Bars are standard errors.",
            png,
        ));
    }
    blocks.extend(quantities(robot));
    blocks.push(campaigns(robot));
    ReportSection {
        id: format!("{}-{}", robot.robot, robot.domain),
        title: format!("{} ({}): {}", robot.robot, robot.domain, robot.attention.name()),
        lead: String::new(),
        blocks,
    }
}

fn point(chart: &ControlChart, night: &Night) -> Option<ControlPoint> {
    let found = chart.points.iter().find(|p| p.campaign == night.campaign)?;
    Some(ControlPoint {
        value: found.value,
        std_error: found.std_error,
        outside: found.outside,
    })
}

/// The last values with their limits.
fn quantities(robot: &RobotHistory) -> Option<Block> {
    let rows: Vec<Vec<String>> = robot
        .charts
        .iter()
        .filter_map(|chart| {
            let last = chart.points.last()?;
            let limits = chart.limits;
            let sigmas = |s: Option<f64>| s.map_or("–".into(), |s| format!("{s:+.1}"));
            Some(vec![
                chart.name.clone(),
                last.std_error
                    .map_or_else(|| significant(last.value, 4), |e| with_error(last.value, e)),
                limits.map_or("–".into(), |l| significant(l.lower, 4)),
                limits.map_or("–".into(), |l| significant(l.upper, 4)),
                sigmas(chart.last_sigmas),
                sigmas(chart.change_sigmas),
                limits.map_or("too few values", |l| basis(l.basis)).to_string(),
            ])
        })
        .collect();
    let names = [
        "last value",
        "lower limit",
        "upper limit",
        "from the mean, σ",
        "since the one before, σ",
    ];
    let mut columns = vec![TableColumn::text("quantity")];
    columns.extend(names.map(TableColumn::number));
    columns.push(TableColumn::text("σ from"));
    (!rows.is_empty()).then(|| {
        Block::Table(ReportTable {
            columns,
            rows,
            ..ReportTable::default()
        })
    })
}

/// What σ is made of, in words.
pub fn basis(basis: Basis) -> &'static str {
    match basis {
        Basis::MovingRange => "moving range",
        Basis::StandardErrors => "standard errors",
    }
}

/// The last campaigns, newest first.
fn campaigns(robot: &RobotHistory) -> Block {
    let columns = ["campaign", "date", "missing", "could not be worked on"].map(TableColumn::text);
    let numbers = ["error", "noise"].map(TableColumn::number);
    let rows = robot.nights.iter().rev().take(LISTED).map(|night| {
        vec![
            night.campaign.clone(),
            night.date.clone().unwrap_or_default(),
            night.verdict.as_ref().map_or("–".into(), |v| v.words()),
            night.error.clone().unwrap_or_default(),
            night.nrms.map_or("–".into(), percent),
            night.noise.map_or("–".into(), percent),
        ]
    });
    let more = robot.nights.len().saturating_sub(LISTED);
    Block::Table(ReportTable {
        columns: columns.into_iter().chain(numbers).collect(),
        rows: rows.collect(),
        notes: (more > 0)
            .then(|| format!("and {more} earlier ones"))
            .into_iter()
            .collect(),
        ..ReportTable::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::fleet::FleetRow;

    #[test]
    fn names_out_of_a_manifest_are_shown_and_not_obeyed() {
        let rows = (1..=8).map(|day| FleetRow {
            campaign: format!("<b>{day}"),
            robot: "<script>alert(1)</script>".into(),
            date: Some(format!("2026-11-{day:02}")),
            domain: "structure".into(),
            nrms: Some(0.02 + 0.001 * f64::from(day % 3)),
            quantities: vec![("k\"><i>".into(), f64::from(100 + day % 2), Some(0.1))],
            ..FleetRow::default()
        });
        let fleet = Fleet::new(rows.collect());
        let page = page(&fleet, "nights", [8, 0], &["a <remark>".to_string()]);
        let html = page.html().unwrap();
        assert!(html.contains("&lt;script&gt;alert(1)") && !html.contains("<script>alert"));
        assert!(!html.contains("<b>1") && !html.contains("<i>") && html.contains("a &lt;remark&gt;"));
        assert_eq!(page.images().len(), 1);
        assert!(html.contains("6.3.2.2"), "where the limits come from");
    }
}
