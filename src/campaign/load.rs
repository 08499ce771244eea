//! `campaign.toml` to a validated [`Campaign`].

use std::path::{Path, PathBuf};

use super::guesses::Guesses;
use super::lobes_section;
use super::schema::*;
use super::shared_keys::posture_ref;
use super::tool_and_cut::{geometry, tool};
use crate::campaign::form::bounds::Bounds;
use crate::campaign::form::document::Document;
use crate::campaign::form::keys::ROBOT_KEY;
use crate::campaign::form::keys::{self, FORM, names};
use crate::campaign::form::paths::{self, campaign_file};
use crate::campaign::form::section::Section;
use crate::data::{
    AxesRef, BodyRef, ChipFormation, Cut, CutOutcome, Dof, LinkGroup, LinkTolerances, OrthogonalSection,
    Point, Posture, Quantity, RobotSection, RobotSpec, Tool,
};
use crate::text::shown_briefly as shown;
use crate::{Error, InputError, Result};

/// Keys of the top table.
const TOP: [&str; 17] = names(&keys::TOP);
/// Keys of `[[cut]]`.
pub(super) const CUT: [&str; 20] = names(&keys::CUT);

impl Campaign {
    /// Reads and validates the campaign in folder `dir`.
    ///
    /// Measurement files are looked for but not read.
    ///
    /// # Errors
    /// One [`InputError`] with file, key, line and remedy for the first thing that is wrong.
    pub fn load(dir: &Path) -> Result<Campaign> {
        let file = campaign_file(dir);
        if !file.is_file() {
            return Err(no_campaign(dir, &file).into());
        }
        of_document(dir, &Document::read(&file)?, paths::inside)
    }

    /// As [`load`](Self::load), of a campaign that is still to be measured: files that it names may be missing.
    ///
    /// # Errors
    /// As [`load`](Self::load), except for missing files.
    pub fn load_planned(dir: &Path) -> Result<Campaign> {
        let file = campaign_file(dir);
        if !file.is_file() {
            return Err(no_campaign(dir, &file).into());
        }
        of_document(dir, &Document::read(&file)?, paths::planned)
    }

    /// As [`load`](Self::load), of a text that is not written yet.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn from_text(dir: &Path, text: &str) -> Result<Campaign> {
        of_document(
            dir,
            &Document::from_text(&campaign_file(dir), text),
            paths::inside,
        )
    }
}

fn no_campaign(dir: &Path, file: &Path) -> InputError {
    let error = InputError::new("there is no such file").file(file);
    if dir.is_file() {
        return InputError::new("is a file, not a campaign folder")
            .file(dir)
            .remedy("give the folder that holds campaign.toml");
    }
    if !dir.is_dir() {
        return InputError::new("there is no such folder")
            .file(dir)
            .remedy("give the campaign's folder: the one that holds campaign.toml");
    }
    error.remedy(format!(
        "a campaign is a folder with a campaign.toml in it; start one with the line schema = {FORM:?}"
    ))
}

/// How the name of a file becomes a path: [`paths::inside`] or [`paths::planned`].
type Find = fn(&Path, &str) -> std::result::Result<PathBuf, Box<InputError>>;

fn of_document(dir: &Path, document: &Document, find: Find) -> Result<Campaign> {
    let campaign = document.parse(&TOP, |top| read(dir, top, find))?;
    Ok(Campaign {
        guesses: Guesses::of_text(document.text()),
        ..campaign
    })
}

fn read(dir: &Path, top: &Section<'_>, find: Find) -> Result<Campaign> {
    schema(top)?;
    let name = top.text("name")?.map_or_else(|| folder_name(dir), str::to_string);
    let robot = robot(dir, top)?;
    let joints = robot.as_ref().map(|(_, spec)| spec.joints.len());
    let postures = postures(top, joints)?;
    let spec = robot.as_ref().map(|(_, spec)| spec);
    let beyond_limits = spec.map_or(Vec::new(), |spec| {
        postures.iter().filter_map(|p| p.beyond_limits(spec)).collect()
    });
    let points = points(top, joints)?;
    let frfs = frfs(dir, top, &postures, find)?;
    let tool = tool(top)?;
    let dynamometer = dynamometer(top)?;
    let lobes = lobes_section::read(top, &postures, robot.is_some(), !frfs.is_empty())?;
    let material: Option<String> = match top.section("material", &names(&keys::MATERIAL))? {
        Some(material) => Some(
            material
                .required("name", material.text("name")?, "\"Ti-6Al-4V\"")?
                .to_string(),
        ),
        None => None,
    };
    let cuts = cuts((dir, find), top, &postures, tool.as_ref(), material.as_deref())?;
    Ok(Campaign {
        dir: dir.to_path_buf(),
        name,
        operator: top.text("operator")?.map(str::to_string),
        date: top.text("date")?.map(str::to_string),
        robot: robot.map(|(section, _)| section),
        postures,
        beyond_limits,
        points,
        frfs,
        tool,
        dynamometer,
        channels: super::channels::channels(top, &cuts)?,
        contacts: super::contacts::read(top)?,
        cuts,
        lobes,
        material,
        orthogonal: orthogonal(top)?,
        plan: plan(top)?,
        guesses: Guesses::default(),
    })
}

fn schema(top: &Section<'_>) -> Result<()> {
    let schema = top.required("schema", top.text("schema")?, &format!("{FORM:?}"))?;
    if schema == FORM {
        return Ok(());
    }
    Err(top
        .error(
            "schema",
            format!("{:?} is not a form this program reads", shown(schema)),
        )
        .remedy(format!("write schema = {FORM:?}"))
        .into())
}

fn folder_name(dir: &Path) -> String {
    let full = dir.canonicalize().unwrap_or_else(|_| dir.to_path_buf());
    full.file_name()
        .map_or_else(|| "campaign".to_string(), |n| n.to_string_lossy().into_owned())
}

/// The section and the robot itself: postures and points are checked against its joints.
fn robot(dir: &Path, top: &Section<'_>) -> Result<Option<(RobotSection, RobotSpec)>> {
    let Some(robot) = top.section("robot", &names(&keys::ROBOT))? else {
        return Ok(None);
    };
    let model = robot.required("model", robot.text("model")?, "\"your-robot.toml\"")?;
    let spec = RobotSpec::load(model, dir).map_err(|error| match error {
        // What is wrong with the reference (not with the robot file) stands in this file, on a line known here.
        Error::Input(e) if e.key.as_deref() == Some(ROBOT_KEY) => {
            let line = robot.error("model", "").line;
            Error::from(e.line(line))
        }
        other => other,
    })?;
    // No tolerance is what `0` says too.
    let tolerance = |key: &str, most: f64| -> Result<Option<f64>> {
        Ok(robot.number(key, Bounds::closed(0.0, most))?.filter(|t| *t > 0.0))
    };
    let mass_tolerance = tolerance(LinkGroup::Masses.key(), 1.0)?;
    let links = LinkTolerances {
        inertia: tolerance(LinkGroup::Inertias.key(), 2.0)?,
        centre_m: tolerance(LinkGroup::Centres.key(), 1000.0)?.map(|mm| mm * 1e-3),
        length_m: tolerance(LinkGroup::Lengths.key(), 500.0)?.map(|mm| mm * 1e-3),
        wall: tolerance(LinkGroup::Walls.key(), 2.0)?,
    };
    let stiffness_tolerance = robot
        .number("stiffness_tolerance", Bounds::above_up_to(0.0, 5.0))?
        .unwrap_or(0.3);
    let section = RobotSection {
        model: model.to_string(),
        mass_tolerance,
        stiffness_tolerance,
        links,
    };
    Ok(Some((section, spec)))
}

fn postures(top: &Section<'_>, joints: Option<usize>) -> Result<Vec<Posture>> {
    let mut out: Vec<Posture> = Vec::new();
    for section in top.sections("posture", &names(&keys::POSTURE))? {
        let id = section.required("id", section.text("id")?, "\"p1\"")?.to_string();
        if let Some(first) = out.iter().position(|p| p.id == id) {
            return Err(duplicate(&section, "id", &id, &format!("posture[{first}]")));
        }
        let joints_deg = section.required("joints_deg", section.numbers("joints_deg")?, "[0.0, 0.0, …]")?;
        // Without a robot at least all postures have to be of one and the same.
        let (wanted, whose) = match (joints, out.first()) {
            (Some(n), _) => (n, "the robot has"),
            (None, Some(first)) => (first.joints_deg.len(), "posture[0] has"),
            (None, None) => (joints_deg.len().max(1), "a posture has at least"),
        };
        if joints_deg.len() != wanted {
            return Err(section
                .error(
                    "joints_deg",
                    format!("has {} angles, but {whose} {wanted} joints", joints_deg.len()),
                )
                .remedy("give one angle in degrees for each joint, base first")
                .into());
        }
        out.push(Posture { id, joints_deg });
    }
    Ok(out)
}

fn points(top: &Section<'_>, joints: Option<usize>) -> Result<Vec<Point>> {
    let mut out: Vec<Point> = Vec::new();
    for section in top.sections("point", &names(&keys::POINT))? {
        let node = section.required("node", section.whole("node", i64::MIN, i64::MAX)?, "1")?;
        if let Some(first) = out.iter().position(|p| p.node == node) {
            return Err(duplicate(
                &section,
                "node",
                &node.to_string(),
                &format!("point[{first}]"),
            ));
        }
        let text = section.required("body", section.text("body")?, "\"tool\"")?;
        let body = body(text, joints).ok_or_else(|| {
            let links = joints.unwrap_or(6);
            section
                .error("body", format!("the robot has no body {:?}", shown(text)))
                .remedy(format!("\"base\", \"link1\" to \"link{links}\", or \"tool\""))
        })?;
        let axes = [
            ("base", AxesRef::Base),
            ("body", AxesRef::Body),
            ("tool", AxesRef::Tool),
        ];
        let position_m = section.array("position_m", "[0.0, 0.0, 0.0]")?;
        out.push(Point {
            node,
            body,
            position_m: section.required("position_m", position_m, "[0.0, 0.0, 0.0]")?,
            axes: section.required("axes", section.choice("axes", &axes)?, "\"base\"")?,
        });
    }
    Ok(out)
}

/// `base`, `link1` …, `tool`.
fn body(text: &str, joints: Option<usize>) -> Option<BodyRef> {
    match text {
        "base" => Some(BodyRef::Base),
        "tool" => Some(BodyRef::Tool),
        _ => {
            let digits = text.strip_prefix("link")?;
            let number: usize = digits.parse().ok()?;
            // `link+1` and `link01` parse as numbers, but are not how a link is called.
            let plain = number.to_string() == digits;
            let there = number >= 1 && joints.is_none_or(|n| number <= n);
            (plain && there).then_some(BodyRef::Link(number))
        }
    }
}

fn frfs(dir: &Path, top: &Section<'_>, postures: &[Posture], find: Find) -> Result<Vec<FrfFile>> {
    let quantities = [
        ("receptance", Quantity::Receptance),
        ("mobility", Quantity::Mobility),
        ("accelerance", Quantity::Accelerance),
        ("acceleration", Quantity::Accelerance),
    ];
    let mut out = Vec::new();
    for section in top.sections("frf", &names(&keys::FRF))? {
        out.push(FrfFile {
            file: file((dir, find), &section, "\"frf/p1.uff\"")?,
            posture: posture_ref(&section, postures)?,
            quantity: section.choice("quantity", &quantities)?,
            force_level_n: section.number("force_level_n", Bounds::POSITIVE)?,
            line: section.line(),
        });
    }
    Ok(out)
}

fn file((dir, find): (&Path, Find), section: &Section<'_>, example: &str) -> Result<PathBuf> {
    let text = section.required("file", section.text("file")?, example)?;
    find(dir, text).map_err(|found| {
        let mut error = section.error("file", found.problem);
        error.remedy = found.remedy;
        error.into()
    })
}

/// What is to be measured, where the files do not say.
fn plan(top: &Section<'_>) -> Result<PlanSection> {
    let Some(section) = top.section("plan", &names(&keys::PLAN))? else {
        return Ok(PlanSection::default());
    };
    let band_hz = section.array("band_hz", "[3.0, 90.0]")?;
    if let Some([from, to]) = band_hz.filter(|[from, to]| !(*from > 0.0 && from < to)) {
        return Err(section
            .error("band_hz", format!("from {from} to {to} Hz is no band"))
            .remedy("first and last line in Hz, such as [3.0, 90.0]")
            .into());
    }
    Ok(PlanSection {
        responses: dofs(&section, "responses")?,
        hits: dofs(&section, "hits")?,
        band_hz,
        lines_hz: section.number("lines_hz", Bounds::POSITIVE)?,
        noise_relative: section.number("noise_relative", Bounds::closed(0.0, 1.0))?,
        noise_floor_m_per_n: section.number("noise_floor_m_per_n", Bounds::NOT_NEGATIVE)?,
    })
}

/// Degrees of freedom in one text: `1X, 1Y, 2Z`.
fn dofs(section: &Section<'_>, key: &str) -> Result<Vec<Dof>> {
    let text = section.text(key)?.unwrap_or("");
    text.split(',')
        .map(str::trim)
        .filter(|d| !d.is_empty())
        .map(|d| {
            d.parse().map_err(|_| {
                section
                    .error(key, format!("{} is no node and direction", shown(d)))
                    .remedy("write node and axis, with commas between: \"1X, 1Y, 2Z\"")
                    .into()
            })
        })
        .collect()
}

fn orthogonal(top: &Section<'_>) -> Result<Option<OrthogonalSection>> {
    let Some(section) = top.section("orthogonal", &names(&keys::ORTHOGONAL))? else {
        return Ok(None);
    };
    let ratio = section.number("chip_ratio", Bounds::POSITIVE)?;
    let angle = section.number("shear_angle_deg", Bounds::open(0.0, 90.0))?;
    let chip = match (ratio, angle) {
        (Some(ratio), None) => ChipFormation::ChipRatio(ratio),
        (None, Some(angle)) => ChipFormation::ShearAngleRad(angle.to_radians()),
        (Some(_), Some(_)) => {
            return Err(section
                .error(
                    "shear_angle_deg",
                    "given together with chip_ratio, which says the same",
                )
                .remedy("keep one of the two")
                .into());
        }
        (None, None) => section.required("chip_ratio", None, "0.7")?,
    };
    let number = |key: &str, bounds: Bounds, example: &str| -> Result<f64> {
        section.required(key, section.number(key, bounds)?, example)
    };
    Ok(Some(OrthogonalSection {
        shear_stress_mpa: number("shear_stress_mpa", Bounds::POSITIVE, "613.0")?,
        friction_angle_deg: number("friction_angle_deg", Bounds::open(0.0, 90.0), "22.6")?,
        chip,
        rake_deg: number("rake_deg", Bounds::open(-90.0, 90.0), "12.0")?,
        inclination_deg: section.number("inclination_deg", Bounds::open(-90.0, 90.0))?,
        shear_stress_law: section.array("shear_stress_law", "[613.0, 0.0, 0.0, 0.0]")?,
        friction_angle_law: section.array("friction_angle_law", "[19.1, 0.29, 0.0, 0.0]")?,
        chip_ratio_law: section.array("chip_ratio_law", "[1.755, -0.028, 0.331, -0.0082]")?,
        edge_force_tangential_n_per_mm: section
            .number("edge_force_tangential_n_per_mm", Bounds::NOT_NEGATIVE)?
            .unwrap_or(0.0),
        edge_force_normal_n_per_mm: section
            .number("edge_force_normal_n_per_mm", Bounds::NOT_NEGATIVE)?
            .unwrap_or(0.0),
    }))
}

fn dynamometer(top: &Section<'_>) -> Result<Dynamometer> {
    let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let key = "tool_from_dyno";
    let Some(section) = top.section("dynamometer", &names(&keys::DYNAMOMETER))? else {
        return Ok(Dynamometer {
            tool_from_dyno: identity,
        });
    };
    let example = "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]";
    let rows = section.required(key, section.rows::<3>(key, example)?, example)?;
    let count = rows.len();
    let tool_from_dyno: [[f64; 3]; 3] = rows.try_into().map_err(|_| {
        section
            .error(key, format!("has {count} rows, must have 3"))
            .remedy(format!("write it as {key} = {example}"))
    })?;
    let a = nalgebra::Matrix3::from_row_iterator(tool_from_dyno.iter().flatten().copied());
    // A turn or a turn with a reflection (reaction forces, left-handed channels): A Aᵀ = 1.
    let off = (a * a.transpose() - nalgebra::Matrix3::identity()).amax();
    if off.is_nan() || off > 1e-3 {
        return Err(section
            .error(key, "its rows are not at right angles and of length 1, so it would stretch the forces")
            .remedy("row 1 holds tool x in dynamometer axes, row 2 tool y, row 3 tool z; gain factors belong into the force files")
            .into());
    }
    Ok(Dynamometer { tool_from_dyno })
}

fn cuts(
    folder: (&Path, Find),
    top: &Section<'_>,
    postures: &[Posture],
    tool: Option<&Tool>,
    campaign_material: Option<&str>,
) -> Result<Vec<Cut>> {
    let mut out: Vec<Cut> = Vec::new();
    for section in top.sections("cut", &CUT)? {
        let Some(tool) = tool else {
            return Err(top
                .error("tool", "missing: there are cuts, but no tool")
                .remedy("add a [tool] section with kind, diameter_mm and teeth (turning: kind = \"turning\")")
                .into());
        };
        let id = section.required("id", section.text("id")?, "\"01\"")?.to_string();
        if let Some(first) = out.iter().position(|c| c.id == id) {
            return Err(duplicate(&section, "id", &id, &format!("cut[{first}]")));
        }
        let outcomes = [("stable", CutOutcome::Stable), ("chatter", CutOutcome::Chatter)];
        let (geometry, spindle_rpm) = geometry(&section, tool)?;
        out.push(Cut {
            file: file(folder, &section, "\"force/cut01.txt\"")?,
            geometry,
            spindle_rpm,
            order: section.whole("order", i64::MIN, i64::MAX)?,
            steady_s: steady(&section)?,
            material: section
                .text("material")?
                .or(campaign_material)
                .map(str::to_string),
            outcome: section.choice("outcome", &outcomes)?,
            posture: match section.has("posture") {
                true => Some(posture_ref(&section, postures)?),
                false => None,
            },
            line: section.line(),
            id,
        });
    }
    Ok(out)
}

fn steady(cut: &Section<'_>) -> Result<Option<[f64; 2]>> {
    let steady = cut.array("steady_s", "[1.2, 2.6]")?;
    if let Some([from, to]) = steady.filter(|[from, to]| from >= to) {
        return Err(cut
            .error("steady_s", format!("starts at {from} s and ends at {to} s"))
            .remedy("first the start, then the end of the steady window, in seconds of the record")
            .into());
    }
    Ok(steady)
}

fn duplicate(section: &Section<'_>, key: &str, value: &str, first: &str) -> Error {
    section
        .error(key, format!("{} is taken by {first}", shown(value)))
        .remedy(format!("give each its own {key}"))
        .into()
}
