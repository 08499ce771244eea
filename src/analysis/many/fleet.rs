//! Many campaigns of many robots over time: whose parameters moved, whose verdict is new, who is worst.

use serde::Serialize;

use crate::analysis::many::control_chart::{ChartPoint, ControlChart};

/// One side of one campaign, as a batch left it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FleetRow {
    /// As the manifest names it.
    pub campaign: String,
    /// Whose campaign it is.
    pub robot: String,
    /// As the manifest or `campaign.toml` has it.
    pub date: Option<String>,
    /// Line of the manifest.
    pub line: usize,
    /// `structure` or `cutting`; empty where the campaign could not be read.
    pub domain: String,
    /// Why the work could not be done.
    pub error: Option<String>,
    /// `None` where none was asked for.
    pub verdict: Option<FleetVerdict>,
    /// Error of the fit, a ratio.
    pub nrms: Option<f64>,
    /// nrms that the noise alone makes.
    pub noise: Option<f64>,
    /// Likely mistakes of the files or the setup.
    pub setup: Option<String>,
    /// Name, value, standard error.
    pub quantities: Vec<(String, f64, Option<f64>)>,
}

/// What a diagnosis found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FleetVerdict {
    /// `effect`, `none`, `unknown`.
    pub verdict: String,
    /// The missing effect, where the verdict is `effect`.
    pub effect: Option<String>,
    /// Where it sits, for effects that have a place.
    pub site: Option<String>,
    /// Probability that the verdict is right, 0 to 1.
    pub confidence: Option<f64>,
}

impl FleetVerdict {
    /// `payload`, `local-resonator@link-3`, `nothing`, `unknown`.
    pub fn words(&self) -> String {
        match (self.verdict.as_str(), &self.effect, &self.site) {
            ("none", ..) => "nothing".into(),
            (_, Some(effect), Some(site)) => format!("{effect}@{site}"),
            (_, Some(effect), None) => effect.clone(),
            (other, None, _) => other.into(),
        }
    }
}

/// How much a robot asks to be looked at; later ones more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Attention {
    /// Nothing stands out.
    None,
    /// The last verdict is not `none`, as it was before.
    Known,
    /// The last campaign could not be worked on, or its setup is doubted.
    Files,
    /// A value left its limits.
    Moved,
    /// The last verdict is another than the one before.
    NewVerdict,
}

impl Attention {
    /// As tables name it.
    pub fn name(self) -> &'static str {
        match self {
            Attention::None => "none",
            Attention::Known => "known",
            Attention::Files => "files",
            Attention::Moved => "moved",
            Attention::NewVerdict => "new verdict",
        }
    }
}

/// A campaign of a robot in short.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Night {
    /// As the manifest names it.
    pub campaign: String,
    /// Of the measurements, as written.
    pub date: Option<String>,
    /// Why the work could not be done.
    pub error: Option<String>,
    /// `None` where none was asked for.
    pub verdict: Option<FleetVerdict>,
    /// Error of the fit, a ratio.
    pub nrms: Option<f64>,
    /// nrms that the noise alone makes.
    pub noise: Option<f64>,
}

/// One robot (one side of its campaigns) over time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RobotHistory {
    /// The robot's name.
    pub robot: String,
    /// `structure` or `cutting`.
    pub domain: String,
    /// How much it asks to be looked at.
    pub attention: Attention,
    /// Why, in sentences.
    pub reasons: Vec<String>,
    /// All campaigns, oldest first.
    #[serde(rename = "campaigns")]
    pub nights: Vec<Night>,
    /// The last verdict names something else than the one before, or is the first and names something.
    pub new_verdict: bool,
    /// Of the quantities that the last campaign has; the one that moved farthest first.
    #[serde(rename = "parameters")]
    pub charts: Vec<ControlChart>,
}

impl RobotHistory {
    /// The latest campaign.
    pub fn last(&self) -> Option<&Night> {
        self.nights.last()
    }

    /// The farthest that a quantity of the last campaign is from its centre; see [`ControlChart::last_sigmas`].
    pub fn farthest(&self) -> f64 {
        let all = self.charts.iter().filter_map(|c| c.last_sigmas);
        all.fold(0.0, |most, s| most.max(s.abs()))
    }

    fn times_noise(&self) -> f64 {
        let last = self.last();
        let both = last.and_then(|l| Some((l.nrms?, l.noise.filter(|n| *n > 0.0)?)));
        both.map_or(0.0, |(nrms, noise)| nrms / noise)
    }
}

/// All robots, worst first.
#[derive(Debug, Clone, PartialEq)]
pub struct Fleet {
    /// One entry for each robot and side.
    pub robots: Vec<RobotHistory>,
    /// What was noticed while sorting the campaigns by date.
    pub warnings: Vec<String>,
}

impl Fleet {
    /// Puts the rows of all campaigns in order by robot and time, and judges each robot's latest values.
    pub fn new(mut rows: Vec<FleetRow>) -> Self {
        // A campaign that could not be read says nothing of its side: it belongs to every side of its robot.
        rows.sort_by(|a, b| (&a.robot, &a.domain).cmp(&(&b.robot, &b.domain)));
        let mut sides: Vec<(String, String)> = Vec::new();
        for row in &rows {
            let side = (row.robot.clone(), row.domain.clone());
            if !sides.contains(&side) {
                sides.push(side);
            }
        }
        let has_side = |robot: &str| sides.iter().any(|(r, d)| r == robot && !d.is_empty());
        let named: Vec<&(String, String)> = sides
            .iter()
            .filter(|(robot, domain)| !domain.is_empty() || !has_side(robot))
            .collect();
        let mut warnings = Vec::new();
        let mut robots: Vec<RobotHistory> = named
            .into_iter()
            .map(|(robot, domain)| {
                let own = rows
                    .iter()
                    .filter(|r| r.robot == *robot && (r.domain == *domain || r.domain.is_empty()));
                let mut own: Vec<&FleetRow> = own.collect();
                warnings.extend(in_order(robot, &mut own));
                history(robot, domain, &own)
            })
            .collect();
        robots.sort_by(|a, b| {
            let key = |r: &RobotHistory| (r.attention, r.farthest(), r.times_noise());
            let ((a1, a2, a3), (b1, b2, b3)) = (key(a), key(b));
            b1.cmp(&a1)
                .then(b2.total_cmp(&a2))
                .then(b3.total_cmp(&a3))
                .then((&a.robot, &a.domain).cmp(&(&b.robot, &b.domain)))
        });
        warnings.dedup();
        Fleet { robots, warnings }
    }
}

/// Puts the rows of a robot in the order of their dates, or of the manifest where a date is missing or of another form.
fn in_order(robot: &str, rows: &mut [&FleetRow]) -> Option<String> {
    let dated = rows.iter().all(|r| r.date.as_deref().is_some_and(is_iso));
    if dated {
        rows.sort_by(|a, b| (&a.date, a.line).cmp(&(&b.date, b.line)));
        return None;
    }
    rows.sort_by_key(|r| r.line);
    let odd = rows.iter().find(|r| !r.date.as_deref().is_some_and(is_iso))?;
    (rows.len() > 1).then(|| {
        let what = match &odd.date {
            Some(date) => format!("the date {date:?} is not of the form 2026-11-23"),
            None => "it has no date".to_string(),
        };
        format!(
            "{robot} is in the order of the manifest: of {} {what}",
            odd.campaign
        )
    })
}

/// `2026-11-23`, and anything behind it that sorts as text.
fn is_iso(date: &str) -> bool {
    let bytes = date.as_bytes();
    let digits =
        |range: std::ops::Range<usize>| bytes.get(range).is_some_and(|b| b.iter().all(u8::is_ascii_digit));
    digits(0..4)
        && digits(5..7)
        && digits(8..10)
        && bytes[4] == b'-'
        && bytes[7] == b'-'
        && !bytes.get(10).is_some_and(u8::is_ascii_digit)
}

fn history(robot: &str, domain: &str, rows: &[&FleetRow]) -> RobotHistory {
    let nights: Vec<Night> = rows
        .iter()
        .map(|r| Night {
            campaign: r.campaign.clone(),
            date: r.date.clone(),
            error: r.error.clone(),
            verdict: r.verdict.clone(),
            nrms: r.nrms,
            noise: r.noise,
        })
        .collect();
    let charts = charts(rows);
    let verdicts: Vec<&FleetVerdict> = nights.iter().filter_map(|n| n.verdict.as_ref()).collect();
    // Only a verdict of the last campaign is news.
    let last = nights.last().and_then(|n| n.verdict.as_ref());
    let before = verdicts.len().checked_sub(2).map(|i| verdicts[i]);
    let new_verdict = match (last, before) {
        (Some(last), Some(before)) => last.words() != before.words(),
        (Some(last), None) => last.verdict != "none",
        (None, _) => false,
    };
    let mut attention = Attention::None;
    let mut reasons = Vec::new();
    let mut note = |level: Attention, reason: String| {
        attention = attention.max(level);
        reasons.push(reason);
    };
    if let Some(last) = last.filter(|_| new_verdict) {
        let sure = last
            .confidence
            .map_or(String::new(), |c| format!(" ({:.0} %)", 100.0 * c));
        note(
            Attention::NewVerdict,
            match before {
                Some(before) => format!("missing: {}{sure}, before {}", last.words(), before.words()),
                None => format!("missing: {}{sure}, the first verdict", last.words()),
            },
        );
    } else if let Some(last) = last.filter(|v| v.verdict != "none") {
        note(Attention::Known, format!("missing as before: {}", last.words()));
    }
    for chart in charts.iter().filter(|c| c.is_out()) {
        let sigmas = chart.last_sigmas.unwrap_or_default();
        note(
            Attention::Moved,
            format!("{} is out of its limits ({sigmas:+.1} σ)", chart.name),
        );
    }
    if let Some(row) = rows.last() {
        if let Some(error) = &row.error {
            let first = error.lines().next().unwrap_or("");
            note(Attention::Files, format!("the last campaign failed: {first}"));
        }
        if let Some(setup) = &row.setup {
            let first = setup.lines().next().unwrap_or("");
            note(
                Attention::Files,
                format!("a mistake of the setup is likely: {first}"),
            );
        }
    }
    RobotHistory {
        robot: robot.to_string(),
        domain: domain.to_string(),
        attention,
        reasons,
        nights,
        new_verdict,
        charts,
    }
}

/// The charts of the quantities that the last campaign with any has, and of the error.
fn charts(rows: &[&FleetRow]) -> Vec<ControlChart> {
    let done: Vec<&&FleetRow> = rows.iter().filter(|r| r.error.is_none()).collect();
    let Some(last) = done.last() else {
        return Vec::new();
    };
    let mut names: Vec<&str> = last.quantities.iter().map(|(name, ..)| name.as_str()).collect();
    names.extend(last.nrms.map(|_| NRMS));
    let of = |row: &FleetRow, name: &str| match name {
        NRMS => row.nrms.map(|v| (v, None)),
        _ => {
            let found = row.quantities.iter().find(|(n, ..)| n == name);
            found.map(|(_, value, std_error)| (*value, *std_error))
        }
    };
    let mut charts: Vec<ControlChart> = names
        .into_iter()
        .map(|name| {
            let points = done.iter().filter_map(|row| {
                let (value, std_error) = of(row, name)?;
                Some(ChartPoint {
                    campaign: row.campaign.clone(),
                    date: row.date.clone(),
                    value,
                    std_error,
                    outside: false,
                })
            });
            ControlChart::new(name.to_string(), points.collect())
        })
        .collect();
    let distance = |c: &ControlChart| c.last_sigmas.map_or(-1.0, f64::abs);
    charts.sort_by(|a, b| distance(b).total_cmp(&distance(a)));
    charts
}

/// The error of the fit is a quantity, too.
const NRMS: &str = "nrms";

#[cfg(test)]
mod tests {
    use super::*;

    fn row(robot: &str, day: usize, stiffness: f64, verdict: &str) -> FleetRow {
        FleetRow {
            campaign: format!("{robot}/{day}"),
            robot: robot.into(),
            date: Some(format!("2026-11-{day:02}")),
            line: 100 - day,
            domain: "structure".into(),
            verdict: Some(FleetVerdict {
                verdict: if verdict == "none" { "none" } else { "effect" }.into(),
                effect: (verdict != "none").then(|| verdict.to_string()),
                site: None,
                confidence: Some(0.9),
            }),
            quantities: vec![("k".into(), stiffness, Some(0.1))],
            ..FleetRow::default()
        }
    }

    fn nights(robot: &str, last: f64, verdicts: [&str; 2]) -> Vec<FleetRow> {
        let quiet = [100.0, 101.0, 99.5, 100.5, 99.0, 100.2, 100.9];
        let mut rows: Vec<FleetRow> = quiet
            .iter()
            .enumerate()
            .map(|(i, k)| row(robot, i + 1, *k, verdicts[0]))
            .collect();
        rows.push(row(robot, 8, last, verdicts[1]));
        rows
    }

    #[test]
    fn the_worst_robot_comes_first() {
        let mut rows = nights("quiet", 100.0, ["none", "none"]);
        rows.extend(nights("moved", 80.0, ["none", "none"]));
        rows.extend(nights("new", 100.0, ["none", "payload"]));
        rows.extend(nights("known", 100.0, ["payload", "payload"]));
        let mut broken = row("broken", 3, 0.0, "none");
        (broken.error, broken.verdict, broken.quantities) =
            (Some("no such file\nremedy".into()), None, vec![]);
        rows.extend([row("broken", 1, 1.0, "none"), broken]);
        rows.reverse();
        let fleet = Fleet::new(rows);
        let order: Vec<(&str, Attention)> = fleet
            .robots
            .iter()
            .map(|r| (r.robot.as_str(), r.attention))
            .collect();
        assert_eq!(
            order,
            [
                ("new", Attention::NewVerdict),
                ("moved", Attention::Moved),
                ("broken", Attention::Files),
                ("known", Attention::Known),
                ("quiet", Attention::None),
            ]
        );
        assert_eq!(
            fleet.robots[0].reasons,
            ["missing: payload (90 %), before nothing"]
        );
        assert!(fleet.robots[1].reasons[0].starts_with("k is out of its limits (-"));
        assert_eq!(
            fleet.robots[2].reasons,
            ["the last campaign failed: no such file"]
        );
        // The manifest named the newest first; dates count.
        assert_eq!(fleet.robots[1].last().unwrap().campaign, "moved/8");
        assert!(fleet.warnings.is_empty());
    }

    #[test]
    fn a_verdict_that_goes_away_is_news_and_an_old_one_is_not() {
        let gone = Fleet::new(nights("r", 100.0, ["payload", "none"]));
        assert!(gone.robots[0].new_verdict);
        let mut rows = nights("r", 100.0, ["none", "payload"]);
        rows.push(row("r", 9, 100.0, "payload"));
        assert_eq!(Fleet::new(rows).robots[0].attention, Attention::Known);
    }

    #[test]
    fn other_dates_leave_the_order_of_the_manifest() {
        let mut rows = nights("r", 100.0, ["none", "none"]);
        rows[0].date = Some("23.11.2026".into());
        let fleet = Fleet::new(rows);
        assert_eq!(fleet.robots[0].last().unwrap().campaign, "r/1");
        assert!(
            fleet.warnings[0].contains("not of the form"),
            "{:?}",
            fleet.warnings
        );
    }

    #[test]
    fn what_could_not_be_read_belongs_to_the_robots_side() {
        let mut rows = nights("r", 100.0, ["none", "none"]);
        let mut broken = row("r", 9, 0.0, "none");
        (broken.domain, broken.error, broken.verdict) = (String::new(), Some("x".into()), None);
        rows.push(broken);
        let fleet = Fleet::new(rows);
        let [robot] = &fleet.robots[..] else {
            panic!("{:?}", fleet.robots);
        };
        assert_eq!((robot.domain.as_str(), robot.nights.len()), ("structure", 9));
    }
}
