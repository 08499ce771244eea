//! The sections of a first campaign file.

use std::collections::BTreeSet;

use super::answers::Answers;
use super::channels::{channels, channels_of_cuts, electric, timeless};
use super::entry::{DraftTable, Entry, Kind};
use super::found::{FoundFrf, Scan, cut_ids};
use super::list_columns::{CUTTING_SPEED, DIAMETER, DIRECTION, FEED_PER_TURN, FEED_RATE, RADIAL_DEPTH};
use super::making::Making;
use super::names::FROM_NAME;
use crate::Result;
use crate::data::Quantity;

const PROCESSES: &[&str] = &["milling", "drilling", "turning"];
const FROM_HEADER: &str = "from the file's header";

/// The sections in the order in which they stand in the file.
pub fn of(scan: &Scan, answers: &Answers) -> Result<Vec<DraftTable>> {
    let mut tables = Vec::new();
    if scan.frfs.is_empty() && answers.get("robot", "", "model").is_some() {
        // A robot before anything was measured.
        tables.push(robot(scan, answers)?);
        tables.extend(named_postures(&answers.names("posture"), answers)?);
    }
    if !scan.frfs.is_empty() {
        tables.push(robot(scan, answers)?);
        tables.extend(points(scan, answers)?);
        tables.extend(postures(scan, answers)?);
        tables.extend(frfs(scan, answers)?);
    }
    if !scan.forces.is_empty() {
        let cuts = cuts(scan, answers)?;
        tables.push(tool(&cuts, answers)?);
        tables.push(dynamometer(answers)?);
        tables.extend(channels(
            &scan.columns,
            scan.forces.iter().all(|f| f.says_times),
            answers,
        )?);
        tables.extend(timeless(&scan.timeless, answers)?);
        tables.extend(electric(&scan.electric, answers)?);
        tables.extend(channels_of_cuts(&scan.forces, answers)?);
        tables.extend(cuts.into_iter().map(|(_, table)| table));
    }
    Ok(tables)
}

/// The posture that an FRF file belongs to: as somebody said, else as its name or folder does.
fn posture_of<'a>(frf: &'a FoundFrf, answers: &'a Answers) -> &'a str {
    let said = answers.get("frf", &frf.path, "posture").map(str::trim);
    said.filter(|id| !id.is_empty()).unwrap_or(&frf.posture)
}

fn robot(scan: &Scan, answers: &Answers) -> Result<DraftTable> {
    let mut making = Making::single(answers, "robot");
    making.add(
        Entry::new(
            "model",
            Kind::Text,
            "robot model: irb6640, or the path of a robot file in the folder",
            "irb6640",
        ),
        &[(scan.robot(), "the only robot file in the folder")],
    )?;
    Ok(making.table)
}

fn points(scan: &Scan, answers: &Answers) -> Result<Vec<DraftTable>> {
    let nodes: BTreeSet<i64> = scan.frfs.iter().flat_map(|f| f.nodes.iter().copied()).collect();
    let only = nodes.len() == 1;
    let mut tables = Vec::new();
    for node in nodes {
        let name = node.to_string();
        let mut making = Making::new(answers, "point", &name, true);
        making.fact("node", Kind::Whole, &name);
        making.add(
            Entry::new(
                "body",
                Kind::Text,
                "where it sits: base, link1 to link6, or tool",
                "link2",
            ),
            &[(
                only.then_some("tool"),
                "the only node, taken for the tool centre point",
            )],
        )?;
        making.add(
            Entry::new(
                "position_m",
                Kind::Numbers,
                "its place in that body's frame, metres",
                "[0.0, 0.0, 0.0]",
            ),
            &[(Some("0 0 0"), "the origin of the body's frame")],
        )?;
        making.add(
            Entry::new(
                "axes",
                Kind::Choice(&["base", "body", "tool"]),
                "what X, Y, Z mean in the files: base, body or tool",
                "base",
            ),
            &[(Some("base"), "X, Y, Z taken along the robot's base")],
        )?;
        tables.push(making.table);
    }
    Ok(tables)
}

fn postures(scan: &Scan, answers: &Answers) -> Result<Vec<DraftTable>> {
    let mut ids: Vec<&str> = Vec::new();
    for frf in &scan.frfs {
        let id = posture_of(frf, answers);
        if !ids.contains(&id) {
            ids.push(id);
        }
    }
    named_postures(&ids, answers)
}

fn named_postures(ids: &[&str], answers: &Answers) -> Result<Vec<DraftTable>> {
    let mut tables = Vec::new();
    for id in ids {
        let mut making = Making::new(answers, "posture", id, true);
        making.fact("id", Kind::Text, id);
        making.add(
            Entry::new(
                "joints_deg",
                Kind::Numbers,
                "joint angles in degrees, base first",
                "[135.0, -2.0, 53.0, 83.0, 30.0, -117.0]",
            ),
            &[],
        )?;
        tables.push(making.table);
    }
    Ok(tables)
}

fn frfs(scan: &Scan, answers: &Answers) -> Result<Vec<DraftTable>> {
    let mut tables = Vec::new();
    for frf in &scan.frfs {
        let mut making = Making::new(answers, "frf", &frf.path, true);
        making.fact("file", Kind::Text, &frf.path);
        let posture = Entry::new("posture", Kind::Text, "posture it was measured in", "p1");
        match frf.posture_guess {
            Some(why) => making.add(posture, &[(Some(&frf.posture), why)])?,
            None => making.known(posture, posture_of(frf, answers)),
        }
        let quantity = Entry::new(
            "quantity",
            Kind::Choice(&["receptance", "mobility", "accelerance"]),
            "what the FRFs are: receptance, mobility or accelerance",
            "receptance",
        );
        let said = frf.quantity.map(|q| match q {
            Quantity::Receptance => "receptance",
            Quantity::Mobility => "mobility",
            Quantity::Accelerance => "accelerance",
        });
        match said {
            // What the file says is left to the file.
            Some(_) if answers.get("frf", &frf.path, "quantity").is_none() => (),
            _ => making.add(quantity, &[])?,
        }
        let level = frf.facts.get("force_level_n").map(String::as_str);
        let entry = Entry::new("force_level_n", Kind::Number, "hammer level, N", "200.0").unmentioned();
        making.add(entry, &[(level, FROM_NAME)])?;
        tables.push(making.table);
    }
    Ok(tables)
}

fn tool(cuts: &[(Option<String>, DraftTable)], answers: &Answers) -> Result<DraftTable> {
    let processes: BTreeSet<&str> = cuts.iter().filter_map(|(p, _)| p.as_deref()).collect();
    let drill = processes.contains("drilling") && processes.len() == 1;
    let turning = processes.contains("turning") && processes.len() == 1;
    let kind = processes.first().map(|_| match () {
        _ if drill => "drill",
        _ if turning => "turning",
        _ => "endmill",
    });
    let mut making = Making::single(answers, "tool");
    making.add(
        Entry::new(
            "kind",
            Kind::Choice(&["endmill", "ballend", "drill", "turning"]),
            "endmill, ballend, drill or turning",
            "endmill",
        ),
        &[(kind, "what the process needs")],
    )?;
    if turning {
        let nose = "nose radius of the insert, mm (0: sharp)";
        making.add(Entry::new("nose_radius_mm", Kind::Number, nose, "0.8"), &[])?;
        let angle = "cutting edge angle, degrees: between the feed and the main edge";
        making.add(
            Entry::new("cutting_edge_angle_deg", Kind::Number, angle, "95.0"),
            &[],
        )?;
        return Ok(making.table);
    }
    making.add(
        Entry::new("diameter_mm", Kind::Number, "tool diameter, mm", "16.0"),
        &[],
    )?;
    making.add(
        Entry::new("teeth", Kind::Whole, "number of teeth", "4"),
        &[(drill.then_some("2"), "a drill has two lips")],
    )?;
    if drill {
        let angle = "half of the drill's point angle, degrees";
        making.add(
            Entry::new("half_point_angle_deg", Kind::Number, angle, "59.0"),
            &[],
        )?;
        let web = "web thickness, mm: for the chisel edge";
        making.add(
            Entry::new("web_thickness_mm", Kind::Number, web, "1.4").optional(),
            &[],
        )?;
    } else {
        let helix = "helix angle, degrees (0: straight teeth)";
        making.add(Entry::new("helix_deg", Kind::Number, helix, "30.0"), &[])?;
    }
    Ok(making.table)
}

fn dynamometer(answers: &Answers) -> Result<DraftTable> {
    let mut making = Making::single(answers, "dynamometer");
    making.add(
        Entry::new(
            "tool_from_dyno",
            Kind::Matrix,
            "F_tool = A F_recorded: row 1 tool x in dynamometer axes, …",
            "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
        )
        .optional(),
        &[(
            Some("1 0 0 0 1 0 0 0 1"),
            "tool and dynamometer axes taken for the same",
        )],
    )?;
    Ok(making.table)
}

/// Keys of which one, where it is answered, leaves nothing for a file's name or header to say of the others.
const SAYING_THE_SAME: [&[&str]; 4] = [
    &[FEED_RATE, FEED_PER_TURN, "feed_per_tooth_mm", "feed_per_rev_mm"],
    &["spindle_rpm", CUTTING_SPEED],
    &["axial_depth_mm", "depth_of_cut_mm"],
    &["immersion", RADIAL_DEPTH],
];

/// Each cut's process, where it is known, and its section.
fn cuts(scan: &Scan, answers: &Answers) -> Result<Vec<(Option<String>, DraftTable)>> {
    let mut out = Vec::new();
    for (force, id) in scan.forces.iter().zip(cut_ids(&scan.forces)) {
        let mut making = Making::new(answers, "cut", &id, true);
        making.fact("id", Kind::Text, answers.get("cut", &id, "id").unwrap_or(&id));
        making.fact("file", Kind::Text, &force.path);
        // A list's feed per turn says that `f416` in a file's name is no feed rate.
        let is_answered = |key: &str| {
            let mut alike = SAYING_THE_SAME.iter().filter(|keys| keys.contains(&key));
            alike.any(|keys| keys.iter().any(|k| answers.get("cut", &id, k).is_some()))
        };
        let said = |key: &str| {
            let says = match is_answered(key) {
                true => [None, None],
                false => [&force.from_header, &force.from_name].map(|facts| facts.get(key)),
            };
            let [header, name] = says.map(|text| text.map(String::as_str));
            [(header, FROM_HEADER), (name, FROM_NAME)]
        };
        let known = |key: &str| -> Option<&str> {
            let found = said(key).into_iter().find_map(|(value, _)| value);
            answers.get("cut", &id, key).or(found)
        };
        let diameter = known(DIAMETER)
            .or_else(|| answers.get("tool", "", DIAMETER))
            .map(str::to_string);
        let from_speed = rpm_of_speed(&known, diameter.as_deref());
        let rpm = known("spindle_rpm").or(from_speed.as_ref().map(|(rpm, _)| rpm.as_str()));
        let feeds = Feeds::of(&known, rpm.and_then(positive), answers);
        let engaged = engagement(&known, answers);
        // A key that only one process has tells the process.
        let drilled = [
            "feed_per_rev_mm",
            "pilot_diameter_mm",
            "hole_depth_mm",
            FEED_PER_TURN,
        ];
        let milled = [
            "feed_per_tooth_mm",
            "axial_depth_mm",
            "immersion",
            RADIAL_DEPTH,
            DIRECTION,
        ];
        let turned = ["depth_of_cut_mm"];
        let given = |keys: &[&'static str]| keys.iter().any(|k| known(k).is_some());
        let kind_of_tool = answers.get("tool", "", "kind");
        // A feed per turn and a depth, and neither teeth nor how far they are in the work: a lathe's list.
        let sideways = ["feed_per_tooth_mm", "immersion", RADIAL_DEPTH, DIRECTION];
        let of_a_lathe = given(&[FEED_PER_TURN]) && given(&["axial_depth_mm"]) && !given(&sideways);
        let of_a_lathe = of_a_lathe && kind_of_tool.or(answers.get("tool", "", "teeth")).is_none();
        let concluded = match () {
            _ if given(&turned) || of_a_lathe || kind_of_tool == Some("turning") => Some("turning"),
            _ if given(&milled) || matches!(kind_of_tool, Some("endmill" | "ballend")) => Some("milling"),
            _ if given(&drilled) || kind_of_tool == Some("drill") => Some("drilling"),
            _ => None,
        };
        let [header, name] = said("process");
        making.add(
            Entry::new(
                "process",
                Kind::Choice(PROCESSES),
                "process: milling, drilling or turning",
                "milling",
            ),
            &[header, name, (concluded, "from what else was given")],
        )?;
        let process = making.table.entries.last().and_then(Entry::value_text);
        let process = process.map(|p| p.trim_matches('"').to_string());
        let [header, name] = said("spindle_rpm");
        let derived = from_speed
            .as_ref()
            .map_or((None, ""), |(rpm, why)| (Some(rpm.as_str()), why.as_str()));
        making.add(
            Entry::new("spindle_rpm", Kind::Number, "spindle speed, rpm", "1200.0"),
            &[header, name, derived],
        )?;
        let entries = match process.as_deref() {
            Some("drilling") => vec![
                Entry::new("feed_per_rev_mm", Kind::Number, "feed per revolution, mm", "0.1"),
                Entry::new(
                    "pilot_diameter_mm",
                    Kind::Number,
                    "pilot hole's diameter, mm (0: none)",
                    "0.0",
                )
                .optional(),
                Entry::new("hole_depth_mm", Kind::Number, "depth at full diameter, mm", "8.0").optional(),
            ],
            Some("turning") => vec![
                Entry::new("feed_per_rev_mm", Kind::Number, "feed per revolution, mm", "0.2"),
                Entry::new("depth_of_cut_mm", Kind::Number, "depth of cut, mm", "2.0"),
                Entry::new(DIAMETER, Kind::Number, "diameter of the workpiece, mm", "60.0"),
            ],
            _ => vec![
                Entry::new("feed_per_tooth_mm", Kind::Number, "feed per tooth, mm", "0.05"),
                Entry::new("axial_depth_mm", Kind::Number, "axial depth of cut, mm", "2.0"),
                Entry::new(
                    "immersion",
                    Kind::Immersion,
                    "immersion: slot, or start and exit angle in degrees (from +y, clockwise)",
                    "slot",
                ),
            ],
        };
        // In lists ap is the depth of cut of either process; a diameter said of all cuts is that of the workpiece.
        let depth = known("axial_depth_mm").map(|ap| (ap.to_string(), format!("ap {ap} mm")));
        let work = diameter.map(|d| (d.clone(), format!("D {d} mm")));
        for entry in entries {
            // What was given for the tool is the user's word, and of a lathe's tool it can be the workpiece's only.
            let given = answers.get("tool", "", DIAMETER).filter(|_| {
                entry.key == DIAMETER && known(DIAMETER).is_none() && process.as_deref() == Some("turning")
            });
            // What is no number is refused where it is read.
            let given = given.filter(|text| text.parse::<f64>().is_ok());
            if let Some(given) = given {
                making.known(entry, given);
                continue;
            }
            let [header, name] = said(entry.key);
            let derived = match entry.key {
                "feed_per_tooth_mm" => feeds.per_tooth.as_ref(),
                "feed_per_rev_mm" => feeds.per_turn.as_ref(),
                "immersion" => engaged.as_ref(),
                "depth_of_cut_mm" => depth.as_ref(),
                DIAMETER => work.as_ref(),
                _ => None,
            };
            let derived = derived.map_or((None, ""), |(value, why)| (Some(value.as_str()), why.as_str()));
            making.add(entry, &[header, name, derived])?;
        }
        for entry in [
            Entry::new(
                "steady_s",
                Kind::Numbers,
                "steady cut, from and to, s",
                "[1.2, 2.4]",
            ),
            Entry::new("order", Kind::Whole, "when this cut was made: 1, 2, …", "1"),
            Entry::new("material", Kind::Text, "workpiece", "C45"),
            Entry::new(
                "outcome",
                Kind::Choice(&["stable", "chatter"]),
                "how it went",
                "stable",
            ),
        ] {
            making.add(entry.unmentioned(), &[])?;
        }
        out.push((process, making.table));
    }
    Ok(out)
}

/// Feeds that follow from others, each with why.
struct Feeds {
    per_tooth: Option<(String, String)>,
    per_turn: Option<(String, String)>,
}

impl Feeds {
    /// From a feed rate or a feed per turn, the spindle speed, rpm, and the number of teeth.
    fn of<'a>(known: &impl Fn(&str) -> Option<&'a str>, rpm: Option<f64>, answers: &Answers) -> Feeds {
        let number = |key: &str| positive(known(key)?);
        let teeth = answers.get("tool", "", "teeth").and_then(positive);
        let (per_turn, why) = match (number(FEED_RATE), rpm, number(FEED_PER_TURN)) {
            (Some(rate), Some(rpm), _) => (Some(rate / rpm), format!("{rate} mm/min at {rpm} rpm")),
            (_, _, Some(feed)) => (Some(feed), format!("{feed} mm per turn")),
            // In milling, `f0.2` in a name is per turn too.
            _ => match number("feed_per_rev_mm") {
                Some(feed) => (Some(feed), format!("{feed} mm per turn, {FROM_NAME}")),
                None => (None, String::new()),
            },
        };
        let shown = |feed: f64| {
            format!("{:.6}", feed)
                .trim_end_matches('0')
                .trim_end_matches('.')
                .to_string()
        };
        Feeds {
            per_tooth: per_turn
                .zip(teeth)
                .map(|(feed, teeth)| (shown(feed / teeth), format!("{why}, {teeth} teeth"))),
            per_turn: per_turn.map(|feed| (shown(feed), why)),
        }
    }
}

/// Spindle speed from the cutting speed and the diameter, with why.
fn rpm_of_speed<'a>(
    known: &impl Fn(&str) -> Option<&'a str>,
    diameter: Option<&str>,
) -> Option<(String, String)> {
    let speed = positive(known(CUTTING_SPEED)?)?;
    let diameter = positive(diameter?)?;
    let rpm = 1000.0 * speed / (std::f64::consts::PI * diameter);
    Some((
        format!("{rpm:.3}"),
        format!("vc {speed} m/min at D {diameter} mm"),
    ))
}

/// Start and exit angle from the radial depth and the tool's diameter, with why. An edge of the workpiece is taken to be milled,
/// down where nobody says which way. A tool with a rounded edge is narrower than its diameter where the cut is shallow.
fn engagement<'a>(known: &impl Fn(&str) -> Option<&'a str>, answers: &Answers) -> Option<(String, String)> {
    let depth = positive(known(RADIAL_DEPTH)?)?;
    let diameter = positive(answers.get("tool", "", "diameter_mm")?)?;
    let corner = match answers.get("tool", "", "kind") {
        Some("ballend") => 0.5 * diameter,
        _ => answers
            .get("tool", "", "corner_radius_mm")
            .and_then(positive)
            .unwrap_or(0.0),
    };
    let up = known("axial_depth_mm")
        .and_then(positive)
        .filter(|up| *up < corner);
    let width = match up {
        Some(up) => diameter - 2.0 * corner + 2.0 * (up * (2.0 * corner - up)).sqrt(),
        None => diameter,
    };
    let why = match up {
        Some(up) => format!(
            "ae {depth} of D {diameter} mm, {width:.2} mm wide {up} mm above the tip; the wall is taken to be flat: the groove that the \
             pass before left is none"
        ),
        None => format!("ae {depth} of D {diameter} mm"),
    };
    if depth >= 0.999 * width {
        return Some(("slot".into(), why));
    }
    let arc = ((width - 2.0 * depth) / diameter).acos().to_degrees();
    Some(match known(DIRECTION) {
        Some("up") => (format!("0 {arc:.3}"), format!("{why}, up milling")),
        Some(_) => (format!("{:.3} 180", 180.0 - arc), format!("{why}, down milling")),
        None => (
            format!("{:.3} 180", 180.0 - arc),
            format!("{why}; down milling taken, up milling is 0 to {arc:.1} deg"),
        ),
    })
}

fn positive(text: &str) -> Option<f64> {
    let number: f64 = text.trim().replace(',', ".").parse().ok()?;
    (number > 0.0 && number.is_finite()).then_some(number)
}
