//! `lobestone init DIR`: a campaign of a folder of files.

use std::collections::BTreeSet;
use std::io::{BufRead, IsTerminal, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::analysis::setup::setup_checks;
use crate::campaign::draft::{self, Answers, Draft, FoundFrf, Guess, Missing, Scan};
use crate::campaign::{Campaign, campaign_file};
use crate::commands::begin::init_robot::{MadeRobot, RobotArgs, RobotMade};
use crate::commands::text::{Emphasis, setup_lines, table, warnings};
use crate::commands::{Outcome, next_step};
use crate::data::{Posture, RobotSpec};
use crate::discrepancy::setup::{SetupCheck, SetupFinding};
use crate::ingest::SIGNALS;
use crate::{Error, InputError, Result};

#[derive(clap::Args)]
#[command(
    after_help = "What the files say is taken from them: quantity, nodes, posture (from p3, pos3, … in the name, or the \
                  folder), speed, feed and depth (from a name such as cut01_n1200_fz0.05_ap2, or the header). What is \
                  concluded from a name carries a comment. On a terminal the rest is asked for.\n\nExamples:\n  \
                  lobestone init cell7 --robot irb6640 --posture p1=135,-2,53,83,30,-117 \\\n    \
                  --posture p2=135,20,26,30,80,-150\n  \
                  lobestone init trial --process milling --diameter-mm 16 --teeth 6 \\\n    \
                  --helix-deg 42 --immersion slot --cut-list cuts.csv"
)]
pub struct InitArgs {
    /// The folder with the measurement files; campaign.toml is written there.
    dir: PathBuf,
    /// Replace a campaign.toml that is there.
    #[arg(long)]
    force: bool,
    /// Never ask, even on a terminal.
    #[arg(long)]
    no_questions: bool,
    /// Name of the campaign [default: the folder's].
    #[arg(long)]
    name: Option<String>,
    #[command(flatten)]
    robot: RobotArgs,
    /// Joint angles of a posture, base first; once for each.
    #[arg(long = "posture", value_name = "ID=DEG,DEG,…", value_parser = pair, allow_hyphen_values = true)]
    postures: Vec<(String, String)>,
    /// Where a node sits: its body (base, link1 …, tool), its place in that body's frame, and what X, Y, Z mean (base,
    /// body, tool); once for each.
    #[arg(long = "point", value_name = "NODE=BODY[:X,Y,Z[:AXES]]", value_parser = pair)]
    points: Vec<(String, String)>,
    /// What FRF files hold that do not say so: receptance, mobility or accelerance.
    #[arg(long)]
    quantity: Option<String>,
    /// Hammer level of all FRFs.
    #[arg(long, value_name = "N")]
    force_level_n: Option<String>,
    /// What was done in all cuts: milling, drilling or turning.
    #[arg(long)]
    process: Option<String>,
    /// Tool diameter; turning: diameter of the workpiece in all cuts.
    #[arg(long, value_name = "MM")]
    diameter_mm: Option<String>,
    /// Number of teeth.
    #[arg(long, value_name = "N")]
    teeth: Option<String>,
    /// What the tool is: endmill, ballend, drill or turning.
    #[arg(long, value_name = "KIND")]
    kind: Option<String>,
    /// Helix angle.
    #[arg(long, value_name = "DEG", allow_hyphen_values = true)]
    helix_deg: Option<String>,
    /// Drills: half of the point angle.
    #[arg(long, value_name = "DEG")]
    half_point_angle_deg: Option<String>,
    /// Drills: web thickness.
    #[arg(long, value_name = "MM")]
    web_thickness_mm: Option<String>,
    /// Rows of A in F_tool = A F_recorded.
    #[arg(long, value_name = "A,B,C;D,E,F;G,H,I", allow_hyphen_values = true)]
    tool_from_dyno: Option<String>,
    /// Spindle speed of all cuts.
    #[arg(long, value_name = "RPM")]
    spindle_rpm: Option<String>,
    /// Milling: feed per tooth of all cuts.
    #[arg(long, value_name = "MM")]
    feed_per_tooth_mm: Option<String>,
    /// Milling: axial depth of all cuts.
    #[arg(long, value_name = "MM")]
    axial_depth_mm: Option<String>,
    /// Milling: slot, or start and exit angle in degrees from +y, clockwise.
    #[arg(long, value_name = "slot|START,EXIT")]
    immersion: Option<String>,
    /// Drilling: feed per revolution of all cuts.
    #[arg(long, value_name = "MM")]
    feed_per_rev_mm: Option<String>,
    /// Drilling: pilot hole of all cuts.
    #[arg(long, value_name = "MM")]
    pilot_diameter_mm: Option<String>,
    /// Drilling: depth at full diameter of all cuts.
    #[arg(long, value_name = "MM")]
    hole_depth_mm: Option<String>,
    /// Turning: nose radius of the insert (0: sharp).
    #[arg(long, value_name = "MM")]
    nose_radius_mm: Option<String>,
    /// Turning: angle between the feed and the main cutting edge.
    #[arg(long, value_name = "DEG")]
    cutting_edge_angle_deg: Option<String>,
    /// Turning: depth of all cuts.
    #[arg(long, value_name = "MM")]
    depth_of_cut_mm: Option<String>,
    /// Turning: cutting speed of all cuts; with the diameter it gives the spindle speed.
    #[arg(long, value_name = "M/MIN")]
    cutting_speed_m_per_min: Option<String>,
    /// Force files without names: unit of the values (N, kN, V, mV, pC).
    #[arg(long, value_name = "UNIT")]
    channel_unit: Option<String>,
    /// Force files without names: what the amplifier makes of them, such as "500 N/V".
    #[arg(long, value_name = "GAIN", allow_hyphen_values = true)]
    channel_gain: Option<String>,
    /// Force files without names and time: samples a second.
    #[arg(long, value_name = "HZ")]
    rate_hz: Option<String>,
    /// CSV with a row a cut: column file, and any of the keys of [[cut]] (spindle_rpm, feed_per_tooth_mm, order, …).
    #[arg(long, value_name = "FILE")]
    cut_list: Option<PathBuf>,
}

fn pair(text: &str) -> std::result::Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() && !value.trim().is_empty() => {
            Ok((name.trim().to_string(), value.trim().to_string()))
        }
        _ => Err("write it as NAME=VALUE".into()),
    }
}

impl InitArgs {
    fn answers(&self, made: Option<&MadeRobot>) -> Answers {
        let mut answers = Answers::default();
        let robot = made.map(|m| m.name.clone()).or(self.robot.robot.clone());
        for (table, key, value) in [
            ("robot", "model", &robot),
            ("frf", "quantity", &self.quantity),
            ("frf", "force_level_n", &self.force_level_n),
            ("tool", "diameter_mm", &self.diameter_mm),
            ("tool", "teeth", &self.teeth),
            ("tool", "kind", &self.kind),
            ("tool", "helix_deg", &self.helix_deg),
            ("tool", "half_point_angle_deg", &self.half_point_angle_deg),
            ("tool", "web_thickness_mm", &self.web_thickness_mm),
            ("dynamometer", "tool_from_dyno", &self.tool_from_dyno),
            ("channel", "gain", &self.channel_gain),
            ("channel", "rate_hz", &self.rate_hz),
            ("cut", "process", &self.process),
            ("cut", "spindle_rpm", &self.spindle_rpm),
            ("cut", "feed_per_tooth_mm", &self.feed_per_tooth_mm),
            ("cut", "axial_depth_mm", &self.axial_depth_mm),
            ("cut", "immersion", &self.immersion),
            ("cut", "feed_per_rev_mm", &self.feed_per_rev_mm),
            ("cut", "pilot_diameter_mm", &self.pilot_diameter_mm),
            ("cut", "hole_depth_mm", &self.hole_depth_mm),
            ("tool", "nose_radius_mm", &self.nose_radius_mm),
            ("tool", "cutting_edge_angle_deg", &self.cutting_edge_angle_deg),
            ("cut", "depth_of_cut_mm", &self.depth_of_cut_mm),
            ("cut", "cutting_speed_m_per_min", &self.cutting_speed_m_per_min),
        ] {
            if let Some(value) = value {
                answers.set(table, key, value);
            }
        }
        if let Some(unit) = &self.channel_unit {
            set_channel_unit(&mut answers, unit);
        }
        for (id, joints) in &self.postures {
            answers.set(format!("posture {id}"), "joints_deg", joints);
        }
        for (node, place) in &self.points {
            let table = format!("point {node}");
            let keys = ["body", "position_m", "axes"];
            for (key, value) in keys.into_iter().zip(place.splitn(3, ':')) {
                answers.set(&table, key, value);
            }
        }
        answers
    }
}

/// The unit of the signals; the time has its own.
fn set_channel_unit(answers: &mut Answers, unit: &str) {
    for name in SIGNALS {
        answers.set(format!("channel {name}"), "unit", unit);
    }
}

pub fn run(args: InitArgs, as_json: bool) -> Result<Outcome> {
    let dir = &args.dir;
    let file = campaign_file(dir);
    if !dir.is_dir() {
        return Err(InputError::new("there is no such folder")
            .file(dir)
            .remedy("give the folder that the measurement files lie in")
            .into());
    }
    if !args.force && file.symlink_metadata().is_ok() {
        return Err(InputError::new("is there already; nothing was changed")
            .file(&file)
            .remedy("--force replaces it (its comments and values are lost)")
            .into());
    }
    let Some(made) = MadeRobot::of(&args.dir, &args.robot)? else {
        return begin(&args, None, as_json);
    };
    let was_there = made.write(args.force)?;
    let begun = begin(&args, Some(&made), as_json);
    if begun.is_err() && !was_there {
        // What was wrong is told; a file that nothing refers to is not left behind.
        let _ = std::fs::remove_file(&made.file);
    }
    begun
}

/// Which of the postures given the robot's joints cannot take. What cannot be read here, the draft tells.
fn beyond_limits(args: &InitArgs, made: Option<&MadeRobot>) -> Vec<String> {
    let named = args.robot.robot.as_deref();
    let robot = match made {
        Some(made) => Some(made.spec().clone()),
        None => named.and_then(|name| RobotSpec::load(name, &args.dir).ok()),
    };
    let Some(robot) = robot else { return Vec::new() };
    let given = args.postures.iter().filter_map(|(id, joints)| {
        let angles = joints.split(',').map(|angle| angle.trim().parse().ok());
        Some(Posture {
            id: id.clone(),
            joints_deg: angles.collect::<Option<_>>()?,
        })
    });
    given
        .filter_map(|posture| posture.beyond_limits(&robot))
        .collect()
}

/// Scans the folder, asks, writes `campaign.toml`.
fn begin(args: &InitArgs, made: Option<&MadeRobot>, as_json: bool) -> Result<Outcome> {
    let dir = &args.dir;
    let scan = draft::scan(dir)?;
    if scan.frfs.is_empty() && scan.forces.is_empty() && made.is_none() {
        return Err(nothing_found(args, &scan));
    }
    let mut answers = args.answers(made);
    let list = args.cut_list.as_ref().or(scan.cut_list());
    let mut passed_over = match list {
        Some(list) => draft::read_cut_list(list, &scan, &mut answers)?,
        None => Vec::new(),
    };
    if list.is_none() {
        let lists = scan
            .cut_lists
            .iter()
            .map(|l| format!("{}: a list of cuts; name it with --cut-list", l.display()));
        passed_over.extend(lists);
    }
    let talking =
        !as_json && !args.no_questions && std::io::stdin().is_terminal() && std::io::stderr().is_terminal();
    let name = args.name.clone().unwrap_or_else(|| draft::folder_name(dir));
    let mut draft = Draft::new(&name, &scan, &answers)?;
    if talking {
        // Which keys a cut has depends on the process.
        if draft.missing().iter().any(|m| m.key == "process") {
            let process = ask(
                "what was done in the cuts: milling, drilling or turning",
                "milling",
            )?;
            if !process.trim().is_empty() {
                answers.set("cut", "process", process.trim());
                draft = Draft::new(&name, &scan, &answers)?;
            }
        }
        // Whether a channel needs a gain depends on its unit.
        if draft
            .missing()
            .iter()
            .any(|m| m.table == "channel" && m.key == "unit")
        {
            let question = "the force files name no columns; unit of the signals: N, kN, V, mV or pC (empty: one by one)";
            let unit = ask(question, "V")?;
            if !unit.trim().is_empty() {
                set_channel_unit(&mut answers, unit.trim());
            }
        }
        // Feeds and engagement in other units need the tool to be understood.
        for (key, question, example) in [
            ("teeth", "number of teeth", "4"),
            ("diameter_mm", "tool diameter, mm", "16.0"),
        ] {
            if draft.missing().iter().any(|m| m.table == "tool" && m.key == key) {
                let answer = ask(question, example)?;
                if answer.trim().parse::<f64>().is_ok() {
                    answers.set("tool", key, answer.trim());
                }
            }
        }
        draft = Draft::new(&name, &scan, &answers)?;
        draft.ask(&mut ask)?;
    }
    let missing = draft.missing();
    let file = draft.write(dir, args.force)?;
    let (mut setup, mut notes) = (Vec::new(), Vec::new());
    let checks = match missing.is_empty() {
        true => Campaign::load(dir).map_or_else(|e| vec![Err(e)], |c| setup_checks(&c)),
        false => Vec::new(),
    };
    notes.extend(beyond_limits(args, made));
    for check in checks {
        match check {
            Ok(check) => setup.extend(check.findings.into_iter().filter(SetupFinding::is_likely)),
            Err(e) => notes.push(SetupCheck::failed(&e)),
        }
    }
    notes.extend(passed_over);

    let guesses = draft.guesses();
    let document = Document {
        dir,
        file: &file,
        complete: missing.is_empty(),
        frfs: scan.frfs.iter().map(FrfTaken::of).collect(),
        cuts: scan.forces.iter().map(|f| CutTaken { file: &f.path }).collect(),
        cut_list: list.map(PathBuf::as_path),
        missing: &missing,
        guessed: &guesses,
        setup: &setup,
        warnings: &notes,
        robot: made.map(RobotMade::of),
        not_used: scan
            .not_used
            .iter()
            .map(|(file, why)| FileNotUsed { file, why })
            .collect(),
    };
    let measured = match (scan.frfs.is_empty(), scan.forces.is_empty()) {
        (false, _) => next_step::Measured::Frfs,
        (true, false) => next_step::Measured::Forces,
        (true, true) => next_step::Measured::Nothing,
    };
    let next = next_step::begun(dir, missing.len(), measured);
    let robot = made.map(MadeRobot::told).unwrap_or_default();
    Ok(Outcome::new(
        document,
        setup_lines(&setup) + &describe(&file, &scan, &draft, &missing, list, &notes) + &robot,
        Some(next),
    ))
}

/// What `init` wrote.
#[derive(Serialize)]
struct Document<'a> {
    dir: &'a Path,
    file: &'a Path,
    complete: bool,
    frfs: Vec<FrfTaken<'a>>,
    cuts: Vec<CutTaken<'a>>,
    cut_list: Option<&'a Path>,
    missing: &'a [Missing],
    guessed: &'a [Guess],
    setup: &'a [SetupFinding],
    warnings: &'a [String],
    robot: Option<RobotMade<'a>>,
    not_used: Vec<FileNotUsed<'a>>,
}

#[derive(Serialize)]
struct FrfTaken<'a> {
    file: &'a str,
    posture: &'a str,
    nodes: &'a BTreeSet<i64>,
}

impl<'a> FrfTaken<'a> {
    fn of(frf: &'a FoundFrf) -> Self {
        FrfTaken {
            file: &frf.path,
            posture: &frf.posture,
            nodes: &frf.nodes,
        }
    }
}

#[derive(Serialize)]
struct CutTaken<'a> {
    file: &'a str,
}

#[derive(Serialize)]
struct FileNotUsed<'a> {
    file: &'a str,
    why: &'a str,
}

fn nothing_found(args: &InitArgs, scan: &Scan) -> Error {
    let mut problem = "holds no FRFs and no force records".to_string();
    for (file, why) in scan.not_used.iter().take(5) {
        problem += &format!("\n  {file}: {why}");
    }
    InputError::new(problem)
        .file(&args.dir)
        .remedy("copy the exported measurement files into it (UFF 58, CSV, DynoWare text export, TDMS)")
        .into()
}

/// One question on the terminal; an empty answer leaves it open.
fn ask(question: &str, example: &str) -> Result<String> {
    let mut terminal = anstream::stderr();
    let _ = write!(
        terminal,
        "{} [such as {example}]: ",
        Emphasis::Strong.on(question)
    );
    let _ = terminal.flush();
    let mut answer = String::new();
    std::io::stdin()
        .lock()
        .read_line(&mut answer)
        .map_err(|e| Error::io("standard input", e))?;
    Ok(answer.trim().to_string())
}

/// Names in a list before it is cut short.
const SHOWN: usize = 6;

fn describe(
    file: &std::path::Path,
    scan: &Scan,
    draft: &Draft,
    missing: &[Missing],
    cut_list: Option<&PathBuf>,
    notes: &[String],
) -> String {
    let mut text = format!(
        "{}: {} FRF files, {} force records\n",
        Emphasis::Strong.on(file.display()),
        scan.frfs.len(),
        scan.forces.len()
    );
    if let Some(list) = cut_list {
        text += &format!("cut list: {}\n", list.display());
    }
    let of = |kind: &str, names: &[String]| -> String {
        match names {
            [one] if one.is_empty() => format!("[{kind}]"),
            some if some.len() <= SHOWN => format!("{kind} {}", some.join(", ")),
            some => format!("{kind} {}, … ({} in all)", some[..SHOWN].join(", "), some.len()),
        }
    };
    // What was concluded alike of many is said once.
    let mut guessed: Vec<(String, String, String, Vec<String>)> = Vec::new();
    for guess in draft.guesses() {
        let (kind, name) = guess.table.split_once(' ').unwrap_or((&guess.table, ""));
        let same = |g: &&mut (String, String, String, Vec<String>)| {
            g.0 == kind && g.1 == format!("{} = {}", guess.key, guess.value) && g.2 == guess.why
        };
        match guessed.iter_mut().find(same) {
            Some(g) => g.3.push(name.to_string()),
            None => guessed.push((
                kind.to_string(),
                format!("{} = {}", guess.key, guess.value),
                guess.why,
                vec![name.to_string()],
            )),
        }
    }
    if !guessed.is_empty() {
        let rows: Vec<Vec<String>> = guessed
            .into_iter()
            .map(|(kind, what, why, names)| vec![what, why, of(&kind, &names)])
            .collect();
        text += &format!(
            "\nguessed: check these\n{}",
            table(&["", "", ""], &rows).trim_start_matches('\n')
        );
    }
    if !missing.is_empty() {
        let rows: Vec<Vec<String>> = missing
            .iter()
            .map(|m| vec![m.key.to_string(), m.what.to_string(), of(m.table, &m.of)])
            .collect();
        let title = Emphasis::Doubtful.on("still to fill in (comments \"# fill in\" in the file)");
        text += &format!(
            "\n{title}\n{}",
            table(&["", "", ""], &rows).trim_start_matches('\n')
        );
        if missing.iter().any(|m| m.table == "cut" && m.of.len() > 1) {
            text += "  (a list of cuts, CSV with a column \"file\" and these keys, is read with --cut-list FILE)\n";
        }
    }
    if !scan.not_used.is_empty() || !notes.is_empty() {
        let notes: Vec<String> = scan
            .not_used
            .iter()
            .map(|(file, why)| format!("not used: {file}: {why}"))
            .chain(notes.iter().cloned())
            .collect();
        text += &format!("\n{}", warnings(&notes));
    }
    text
}
