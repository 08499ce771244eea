use std::path::{Path, PathBuf};

use nalgebra::{DMatrix, Vector3};
use serde::Serialize;

use crate::analysis::StructureAnalysis;
use crate::analysis::structure_case::structure_model;
use crate::campaign::Campaign;
use crate::campaign::beside_urdf;
use crate::commands::next_step::Guide;
use crate::commands::text::{number, table, warnings};
use crate::commands::{CampaignArg, Outcome};
use crate::effects::LINK_FLEXIBILITY;
use crate::files::write_new;
use crate::identify::{Options, StructureModel};
use crate::lobes::drilling::contact::held_report;
use crate::robot::model::NOMINAL_DAMPING_RATIO;
use crate::robot::rigid::STANDARD_GRAVITY;
use crate::robot::urdf::{self, Sources};
use crate::robot::{Baseline, Dual, PostureReport, RobotModel, export};
use crate::{Error, InputError, Result};

#[derive(clap::Args)]
pub struct ModelArgs {
    #[command(flatten)]
    campaign: CampaignArg,
    /// Add the 6n×6n stiffness and mass matrices in centre-of-mass coordinates (k_c, m_c).
    #[arg(long)]
    matrices: bool,
    /// Let the links bend with this Young's modulus (rigid links if left out; --matrices takes 200e9 then).
    #[arg(long, value_name = "PA")]
    young_pa: Option<f64>,
    /// Write the robot (calibrated where there are FRFs) as a URDF, and its compliances and sections into a file next to it.
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
}

/// Young's modulus of the links where the matrices need one and nobody has said: steel.
const STEEL_PA: f64 = 200e9;

pub fn run(args: ModelArgs) -> Result<Outcome> {
    if let Some(young) = args.young_pa.filter(|y| !(*y > 0.0 && y.is_finite())) {
        return Err(InputError::new(format!("{young} is no Young's modulus"))
            .key("--young-pa")
            .remedy("give pascals, e.g. 200e9")
            .into());
    }
    let campaign = Campaign::load(&args.campaign.dir)?;
    let model = structure_model(&campaign)?;
    let mut left_out = Vec::new();
    let nominal = postures(&campaign, &model, &model.nominal_theta(), &args, &mut left_out)?;
    let mut text = format!(
        "{}, as the robot file has it\n{}",
        model.robot.spec.name,
        describe(&nominal)
    );
    let (mut robot, mut sources) = of_robot_file(&model);
    let mut calibrated = None;
    let notes: Vec<String>;
    if !campaign.frfs.is_empty() {
        let StructureAnalysis {
            case, calibration, ..
        } = StructureAnalysis::run(&campaign, Options::default())?;
        let after = postures(&campaign, &case.model, &calibration.theta, &args, &mut left_out)?;
        text += &format!(
            "\nafter calibration on the measured FRFs ({})\n",
            case.model_description()
        );
        text += &describe(&after);
        notes = case.warnings.iter().cloned().chain(left_out).collect();
        (robot, sources) = of_calibrated(&campaign, &case.model, &calibration.theta, case.effects());
        calibrated = Some(AfterCalibration {
            calibrated_postures: after,
            revision: case.revision(),
            effects: case.effects(),
        });
    } else {
        let told = campaign.beyond_limits.iter().cloned();
        let told = told.chain(model.robot.spec.guesses_told());
        notes = told.chain(left_out).collect();
    }
    text += &warnings(&notes);
    let mut written = None;
    if let Some(file) = &args.urdf {
        let files = write_urdf(file, &robot, &sources)?;
        text += &format!(
            "\nwritten: {} and {} ({})\n",
            files[0].display(),
            files[1].display(),
            sources.source
        );
        written = Some(files);
    }
    let next = Guide::structure(&campaign).modelled();
    let document = Document {
        robot: &model.robot.spec.name,
        moving_mass_kg: model.robot.moving_mass_kg(),
        postures: nominal,
        calibrated,
        written,
        warnings: notes,
    };
    Ok(Outcome::new(document, text, Some(next)))
}

/// What `model` says.
#[derive(Serialize)]
struct Document<'a> {
    robot: &'a str,
    moving_mass_kg: f64,
    postures: Vec<PostureTold>,
    /// Where there are FRFs.
    #[serde(flatten)]
    calibrated: Option<AfterCalibration>,
    /// The URDF and the file next to it.
    #[serde(skip_serializing_if = "Option::is_none")]
    written: Option<[PathBuf; 2]>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct AfterCalibration {
    calibrated_postures: Vec<PostureTold>,
    revision: Option<usize>,
    effects: Vec<String>,
}

/// The robot at one posture.
#[derive(Serialize)]
struct PostureTold {
    id: String,
    #[serde(flatten)]
    free: Dynamics,
    tcp_m: [f64; 3],
    tool_axis: [f64; 3],
    centre_of_mass_m: Option<[f64; 3]>,
    gravity_torques_nm: Vec<f64>,
    /// With the tool point held by the contacts, where the campaign has any.
    #[serde(skip_serializing_if = "Option::is_none")]
    held: Option<Dynamics>,
    #[serde(flatten)]
    matrices: Option<Matrices>,
}

/// How a posture vibrates and gives way.
#[derive(Serialize)]
struct Dynamics {
    natural_frequencies_hz: Vec<f64>,
    tcp_stiffness_n_per_m: Axes,
    flange_stiffness_n_per_m: Axes,
}

impl Dynamics {
    fn of(report: PostureReport) -> Self {
        Dynamics {
            natural_frequencies_hz: report.natural_frequencies_hz,
            tcp_stiffness_n_per_m: Axes::of(report.tcp_stiffness_n_per_m),
            flange_stiffness_n_per_m: Axes::of(report.flange_stiffness_n_per_m),
        }
    }
}

/// One value an axis of the base.
#[derive(Serialize)]
struct Axes {
    x: f64,
    y: f64,
    z: f64,
}

impl Axes {
    fn of([x, y, z]: [f64; 3]) -> Self {
        Axes { x, y, z }
    }
}

/// Stiffness and mass in centre-of-mass coordinates, row by row, SI.
#[derive(Serialize)]
struct Matrices {
    k_c: Vec<Vec<f64>>,
    m_c: Vec<Vec<f64>>,
}

/// The robot file's robot, and where its values are from.
fn of_robot_file(model: &StructureModel) -> (RobotModel, Sources) {
    let sources = Sources {
        source: "the robot file, not calibrated".into(),
        damping_ratio: NOMINAL_DAMPING_RATIO,
        young_pa: None,
        left_out: Vec::new(),
    };
    (model.robot.clone(), sources)
}

/// The robot as calibrated: all that was tuned of it, lengths and inertias as well as masses and compliances.
fn of_calibrated(
    campaign: &Campaign,
    model: &StructureModel,
    theta: &[f64],
    effects: Vec<String>,
) -> (RobotModel, Sources) {
    let mut robot = model.robot_as_fitted(theta);
    robot.spec.forget_guessed_compliances();
    let held = |effect: &String| effect == LINK_FLEXIBILITY;
    let sources = Sources {
        source: format!("calibrated on the FRFs of {}", campaign.name),
        damping_ratio: model.baseline(theta, false).damping_ratio.value,
        young_pa: model.young_pa(theta),
        left_out: effects.into_iter().filter(|effect| !held(effect)).collect(),
    };
    (robot, sources)
}

/// The URDF and what it cannot hold in a file next to it: `robot.urdf`, `robot.compliances.toml`.
fn write_urdf(file: &Path, robot: &RobotModel, sources: &Sources) -> Result<[PathBuf; 2]> {
    let beside = beside_urdf::beside(file);
    let texts = [
        (file, urdf::urdf(robot, sources)),
        (beside.as_path(), beside_urdf::compliances(&robot.spec, sources)),
    ];
    let taken = |there: &Path| -> Error {
        InputError::new("is there already; nothing was written")
            .file(there)
            .remedy("give another name to --urdf, or take the file away")
            .into()
    };
    if let Some((there, _)) = texts.iter().find(|(path, _)| path.symlink_metadata().is_ok()) {
        return Err(taken(there));
    }
    for (i, (path, text)) in texts.iter().enumerate() {
        let written = match write_new(path, text.as_bytes()) {
            Ok(true) => continue,
            Ok(false) => taken(path),
            Err(error) => error,
        };
        // Both or none: one alone is half a robot.
        for (path, _) in &texts[..i] {
            let _ = std::fs::remove_file(path);
        }
        return Err(written);
    }
    Ok([file.to_path_buf(), beside.clone()])
}

/// Young's modulus that the user asked for, where the model does not bring its own.
fn young_pa(model: &StructureModel, args: &ModelArgs) -> Result<Option<f64>> {
    if !model.has(LINK_FLEXIBILITY) {
        return Ok(args.young_pa);
    }
    match args.young_pa {
        Some(_) => Err(InputError::new(
            "link-flexibility is in this campaign's model, with a fitted modulus",
        )
        .key("--young-pa")
        .remedy("leave it out")
        .into()),
        None => Ok(None),
    }
}

/// `left_out`: what the matrices cannot hold is said there.
fn postures(
    campaign: &Campaign,
    model: &StructureModel,
    theta: &[f64],
    args: &ModelArgs,
    left_out: &mut Vec<String>,
) -> Result<Vec<PostureTold>> {
    let mut baseline = model.baseline(theta, false);
    baseline.young_pa = young_pa(model, args)?.map(Dual::constant);
    let robot = model.robot_as_fitted(theta);
    campaign
        .postures
        .iter()
        .map(|posture| {
            let kinematics = model.robot.kinematics(&posture.joints_deg)?;
            let chain =
                |baseline: &Baseline| model.chain_on(baseline, theta, &kinematics, Default::default(), false);
            let fitted = robot.kinematics(&posture.joints_deg)?;
            let report = PostureReport::new(&robot, &fitted, &chain(&baseline))?;
            let held = match campaign.contacts.as_slice() {
                [] => None,
                contacts => Some(held_report(&robot, &fitted, &chain(&baseline), contacts)?),
            };
            let mut matrices = None;
            if args.matrices {
                let mut bending = baseline.clone();
                if !model.has(LINK_FLEXIBILITY) {
                    bending.young_pa.get_or_insert_with(|| Dual::constant(STEEL_PA));
                }
                let mut chain = chain(&bending);
                // The form has six coordinates for each link and none for what is hung on one.
                let links = model.robot.chain(&kinematics, &baseline).bodies.len();
                if chain.bodies.len() > links || !chain.branches.is_empty() {
                    let note =
                        "k_c and m_c are those of the links: added masses and resonators are not in them";
                    if left_out.is_empty() {
                        left_out.push(note.into());
                    }
                    chain.bodies.truncate(links);
                }
                let form = export::centre_of_mass_form(&chain)?;
                matrices = Some(Matrices {
                    k_c: rows(&form.stiffness),
                    m_c: rows(&form.mass),
                });
            }
            let down = Vector3::new(0.0, 0.0, -STANDARD_GRAVITY);
            Ok(PostureTold {
                id: posture.id.clone(),
                tcp_m: report.tcp_m,
                tool_axis: report.tool_axis,
                free: Dynamics::of(report),
                centre_of_mass_m: robot.centre_of_mass(&fitted).map(|c| [c.x, c.y, c.z]),
                gravity_torques_nm: robot.gravity_torques_nm(&fitted, down),
                held: held.map(Dynamics::of),
                matrices,
            })
        })
        .collect()
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}

/// The postures free, and held by the contacts where the campaign has any.
fn describe(postures: &[PostureTold]) -> String {
    let held: Vec<(&str, &Dynamics)> = postures
        .iter()
        .filter_map(|p| Some((p.id.as_str(), p.held.as_ref()?)))
        .collect();
    let free: Vec<(&str, &Dynamics)> = postures.iter().map(|p| (p.id.as_str(), &p.free)).collect();
    let free = stiffness_table(&free);
    match held.is_empty() {
        true => free,
        false => format!(
            "{free}\nwith the tool point held by [[contact]]\n{}",
            stiffness_table(&held)
        ),
    }
}

fn stiffness_table(postures: &[(&str, &Dynamics)]) -> String {
    let rows: Vec<Vec<String>> = postures
        .iter()
        .map(|(id, p)| {
            let frequencies: Vec<String> = p
                .natural_frequencies_hz
                .iter()
                .take(6)
                .map(|f| format!("{f:.2}"))
                .collect();
            let mut row = vec![id.to_string()];
            for Axes { x, y, z } in [&p.tcp_stiffness_n_per_m, &p.flange_stiffness_n_per_m] {
                row.extend([x, y, z].map(|k| number(k / 1e6, 4)));
            }
            row.push(frequencies.join(" "));
            row
        })
        .collect();
    let header = [
        "posture",
        "tool Kx",
        "Ky",
        "Kz MN/m",
        "flange Kx",
        "Ky",
        "Kz MN/m",
        "natural frequencies Hz",
    ];
    table(&header, &rows)
}
