use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde_json::{Value, json};

use crate::analysis::StructureAnalysis;
use crate::analysis::structure_case::structure_model;
use crate::campaign::Campaign;
use crate::commands::next_step::Guide;
use crate::commands::text::{number, table, warnings};
use crate::commands::{CampaignArg, Outcome};
use crate::files::write_new;
use crate::identify::{Options, StructureModel};
use crate::lobes::drilling::contact::held_report;
use crate::robot::rigid::STANDARD_GRAVITY;
use crate::robot::urdf::{self, Sources};
use crate::robot::{Baseline, Dual, PostureReport, export};
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
    /// Write the robot with its masses (calibrated where there are FRFs) as a URDF, and the compliances into a file next to it.
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
    let mut json = json!({
        "robot": model.robot.spec.name,
        "moving_mass_kg": model.robot.moving_mass_kg(),
        "postures": nominal,
    });
    let mut text = format!(
        "{}, as the robot file has it\n{}",
        model.robot.spec.name,
        describe(&nominal)
    );
    let mut sources = of_robot_file(&model);
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
        let mut notes = case.warnings.clone();
        notes.extend(left_out);
        text += &warnings(&notes);
        sources = calibrated(&campaign, &case.model, &calibration.theta, case.effects());
        json["calibrated_postures"] = after.into();
        json["revision"] = case.revision().into();
        json["effects"] = case.effects().into();
        json["warnings"] = notes.into();
    } else {
        let notes: Vec<String> = model.robot.spec.guesses_told().chain(left_out).collect();
        text += &warnings(&notes);
        json["warnings"] = notes.into();
    }
    if let Some(file) = &args.urdf {
        let files = write_urdf(file, &model, &sources)?;
        text += &format!(
            "\nwritten: {} and {} ({})\n",
            files[0].display(),
            files[1].display(),
            sources.source
        );
        json["written"] = json!(files);
    }
    let next = Guide::structure(&campaign).modelled();
    Ok(Outcome::new(json, text, Some(next)))
}

fn of_robot_file(model: &StructureModel) -> Sources {
    let baseline = Baseline::nominal(&model.robot.spec);
    of_baseline(&baseline, "the robot file, not calibrated".into(), Vec::new())
}

fn of_baseline(baseline: &Baseline, source: String, left_out: Vec<String>) -> Sources {
    let stiffness = baseline.joint_stiffness_nm_per_rad.iter();
    Sources {
        source,
        mass_scale: baseline.mass_scale.iter().map(|scale| scale.value).collect(),
        compliance_rad_per_nm: stiffness.map(|k| 1.0 / k.value).collect(),
        damping_ratio: baseline.damping_ratio.value,
        young_pa: baseline.young_pa.as_ref().map(|young| young.value),
        left_out,
    }
}

fn calibrated(campaign: &Campaign, model: &StructureModel, theta: &[f64], effects: Vec<String>) -> Sources {
    let source = format!("calibrated on the FRFs of {}", campaign.name);
    let held = |effect: &String| effect.starts_with("link-flexibility");
    let beyond = effects.into_iter().filter(|effect| !held(effect));
    of_baseline(&model.baseline(theta, false), source, beyond.collect())
}

/// The URDF and what it cannot hold in a file next to it: `robot.urdf`, `robot.compliances.toml`.
fn write_urdf(file: &Path, model: &StructureModel, sources: &Sources) -> Result<[PathBuf; 2]> {
    let beside = file.with_extension("compliances.toml");
    let texts = [
        (file, urdf::urdf(&model.robot, sources)),
        (beside.as_path(), urdf::compliances(&model.robot.spec, sources)),
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
    if !model.has("link-flexibility") {
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
) -> Result<Vec<Value>> {
    let mut baseline = model.baseline(theta, false);
    baseline.young_pa = young_pa(model, args)?.map(Dual::constant);
    campaign
        .postures
        .iter()
        .map(|posture| {
            let kinematics = model.robot.kinematics(&posture.joints_deg)?;
            let chain =
                |baseline: &Baseline| model.chain_on(baseline, theta, &kinematics, Default::default(), false);
            let report = PostureReport::new(&model.robot, &kinematics, &chain(&baseline))?;
            let mut value = json!({
                "id": posture.id,
                "natural_frequencies_hz": report.natural_frequencies_hz,
                "tcp_m": report.tcp_m,
                "tool_axis": report.tool_axis,
                "tcp_stiffness_n_per_m": axes(report.tcp_stiffness_n_per_m),
                "flange_stiffness_n_per_m": axes(report.flange_stiffness_n_per_m),
                "centre_of_mass_m": model.robot.centre_of_mass(&kinematics).map(|c| [c.x, c.y, c.z]),
                "gravity_torques_nm": model
                    .robot
                    .gravity_torques_nm(&kinematics, Vector3::new(0.0, 0.0, -STANDARD_GRAVITY)),
            });
            if !campaign.contacts.is_empty() {
                let held = held_report(&model.robot, &kinematics, &chain(&baseline), &campaign.contacts)?;
                value["held"] = json!({
                    "natural_frequencies_hz": held.natural_frequencies_hz,
                    "tcp_stiffness_n_per_m": axes(held.tcp_stiffness_n_per_m),
                    "flange_stiffness_n_per_m": axes(held.flange_stiffness_n_per_m),
                });
            }
            if args.matrices {
                let mut bending = baseline.clone();
                if !model.has("link-flexibility") {
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
                value["k_c"] = rows(&form.stiffness);
                value["m_c"] = rows(&form.mass);
            }
            Ok(value)
        })
        .collect()
}

fn axes([x, y, z]: [f64; 3]) -> Value {
    json!({ "x": x, "y": y, "z": z })
}

fn rows(matrix: &nalgebra::DMatrix<f64>) -> Value {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect::<Vec<f64>>())
        .collect::<Vec<_>>()
        .into()
}

/// The postures free, and held by the contacts where the campaign has any.
fn describe(postures: &[Value]) -> String {
    let held: Vec<Value> = postures
        .iter()
        .filter(|p| p["held"].is_object())
        .map(|p| {
            let mut held = p["held"].clone();
            held["id"] = p["id"].clone();
            held
        })
        .collect();
    let free = stiffness_table(postures);
    match held.is_empty() {
        true => free,
        false => format!(
            "{free}\nwith the tool point held by [[contact]]\n{}",
            stiffness_table(&held)
        ),
    }
}

fn stiffness_table(postures: &[Value]) -> String {
    let stiffness = |p: &Value, key: &str, axis: &str| number(p[key][axis].as_f64().unwrap_or(0.0) / 1e6, 4);
    let rows: Vec<Vec<String>> = postures
        .iter()
        .map(|p| {
            let frequencies: Vec<String> = p["natural_frequencies_hz"]
                .as_array()
                .into_iter()
                .flatten()
                .take(6)
                .map(|f| format!("{:.2}", f.as_f64().unwrap_or(0.0)))
                .collect();
            let mut row = vec![p["id"].as_str().unwrap_or("").to_string()];
            for key in ["tcp_stiffness_n_per_m", "flange_stiffness_n_per_m"] {
                for axis in ["x", "y", "z"] {
                    row.push(stiffness(p, key, axis));
                }
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
