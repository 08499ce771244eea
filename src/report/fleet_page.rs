//! The page about a fleet: who is to be looked at, and every quantity over time with its limits.

use super::figure::{ControlChartFigure, ControlPanel, ControlPoint, MOST_PANELS};
use super::number::{decimals, percent, significant, with_error};
use super::parts::{figure, made, paragraph};
use super::words::{at_place, count, quantity};
use super::{Block, Page, ReportSection, ReportTable, TableColumn};
use crate::analysis::many::control_chart::{Basis, ControlChart};
use crate::analysis::many::fleet::{Attention, Fleet, Night, RobotHistory};

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
        origin: made(),
        open_sections: Some(1 + asking.min(DRAWN)),
        sections,
        without_scripts: true,
        ..Page::default()
    }
}

/// The worst first.
fn overview(fleet: &Fleet, remarks: &[String]) -> ReportSection {
    let columns = ["robot", "side", "news", "last campaign", "missing"].map(TableColumn::text);
    let numbers = ["confidence", "error", "noise", "farthest, σ", "campaigns"].map(TableColumn::number);
    let rows = fleet.robots.iter().map(|robot| {
        let last = robot.last();
        let verdict = last.and_then(|n| n.verdict.as_ref());
        let share = |pick: fn(&Night) -> Option<f64>| last.and_then(pick).map_or("–".into(), percent);
        vec![
            robot.robot.clone(),
            robot.domain.clone(),
            attention(robot.attention).to_string(),
            last.map_or(String::new(), when),
            verdict.map_or("–".into(), |v| at_place(&v.words())),
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
    let mut blocks: Vec<Block> = robot
        .reasons
        .iter()
        .map(|r| paragraph(reason(robot, r)))
        .collect();
    let nights: Vec<&Night> = robot.nights.iter().filter(|n| n.error.is_none()).collect();
    let names: Vec<String> = nights.iter().map(|n| when(n)).collect();
    let drawn = robot.charts.iter().filter(|c| c.points.len() > 1);
    let drawn: Vec<&ControlChart> = drawn.collect();
    for (i, charts) in drawn.chunks(MOST_PANELS).enumerate() {
        let panels = charts.iter().map(|chart| ControlPanel {
            label: quantity(&chart.name),
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
        title: match robot.domain.as_str() {
            "" => format!("{}: {}", robot.robot, attention(robot.attention)),
            domain => format!("{} ({domain}): {}", robot.robot, attention(robot.attention)),
        },
        lead: String::new(),
        blocks,
    }
}

/// Why to look at a robot, in words.
fn attention(attention: Attention) -> &'static str {
    match attention {
        Attention::None => "nothing new",
        Attention::Known => "known verdict",
        Attention::Files => "files or setup",
        Attention::Moved => "a value moved",
        Attention::NewVerdict => "new verdict",
    }
}

/// A reason without the keys in it.
fn reason(robot: &RobotHistory, text: &str) -> String {
    if let Some(chart) = robot
        .charts
        .iter()
        .find(|c| text.starts_with(&format!("{} is ", c.name)))
    {
        return text.replacen(&chart.name, &quantity(&chart.name), 1);
    }
    let verdicts = robot.nights.iter().filter_map(|n| n.verdict.as_ref());
    verdicts.fold(text.to_string(), |text, v| {
        text.replace(&v.words(), &at_place(&v.words()))
    })
}

/// One decimal and its sign; zero has none.
fn signed(value: f64) -> String {
    let text = decimals(value, 1);
    match value > 0.0 && text != "0.0" {
        true => format!("+{text}"),
        false => text,
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
            let sigmas = |s: Option<f64>| s.map_or("–".into(), signed);
            Some(vec![
                quantity(&chart.name),
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
            night
                .verdict
                .as_ref()
                .map_or("–".into(), |v| at_place(&v.words())),
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
    use crate::analysis::many::fleet::FleetRow;

    #[test]
    fn what_people_read_has_no_keys_and_true_signs() {
        assert_eq!(
            [0.04, -0.04, 1.26, -1.26].map(signed),
            ["0.0", "0.0", "+1.3", "−1.3"]
        );
        let rows = (1..=8).map(|day| FleetRow {
            campaign: format!("nights/{day}"),
            robot: "cell7".into(),
            date: Some(format!("2026-11-{day:02}")),
            domain: "structure".into(),
            quantities: vec![(
                "joint-2.stiffness_nm_per_rad".into(),
                if day == 8 { 50.0 } else { f64::from(100 + day % 2) },
                Some(0.1),
            )],
            ..FleetRow::default()
        });
        let page = page(&Fleet::new(rows.collect()), "nights", [8, 0], &[]);
        let html = page.html().unwrap();
        assert!(html.contains("joint 2: stiffness (N·m&#x2f;rad) is out of its limits (−"));
        assert!(!html.contains("nm_per_rad") && html.contains("cell7 (structure): a value moved"));
    }

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
