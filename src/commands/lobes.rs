//! `lobestone lobes`: stability lobes of a campaign.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};

use super::{CampaignArg, Outcome};
use crate::campaign::{Campaign, LobeSource, LobesSection, Process};
use crate::lobes::setup::{LobeCoefficients, force_of, frf_of_modes};
use crate::lobes::{AbsoluteLimit, DirectFrf, LobeCurve, Peak, StabilitySolver, speed_grid};
use crate::{Error, InputError, Result};

#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    campaign: CampaignArg,
}

/// Best speeds that are listed.
const BEST: usize = 10;

/// One structure that lobes are drawn for.
struct Structure {
    /// `None` where the FRF belongs to no posture (modes from the campaign file).
    posture: Option<String>,
    angle_deg: Option<f64>,
    frf: Box<dyn DirectFrf>,
    /// For people: where the FRF comes from.
    description: String,
}

struct Solved {
    structure: Structure,
    curve: LobeCurve,
    absolute: Option<AbsoluteLimit>,
    best: Vec<Peak>,
}

pub fn run(args: Args) -> Result<Outcome> {
    let campaign = load(&args.campaign.dir)?;
    outcome(&campaign)
}

/// Stand-in until the campaign reader is merged: to become `Campaign::load`.
fn load(dir: &Path) -> Result<Campaign> {
    Err(Error::computation(format!(
        "{}: campaigns cannot be read yet",
        dir.display()
    )))
}

fn outcome(campaign: &Campaign) -> Result<Outcome> {
    let section = campaign.lobes.as_ref().ok_or_else(|| {
        InputError::new("the campaign has no [lobes] table")
            .file(campaign.dir.join("campaign.toml"))
            .key("lobes")
            .remedy("add one with process, source and spindle_rpm = [from, to, step]")
    })?;
    let coefficients = match LobeCoefficients::given(section) {
        Some(given) => given,
        None => coefficients_from_cuts(campaign, section)?,
    };
    let force = force_of(campaign, section, coefficients)?;
    let structures = match section.source {
        LobeSource::Modes => frf_from_modes(campaign, section)?,
        LobeSource::Model => frf_from_model(campaign, section)?,
        LobeSource::Measured => frf_from_measured(campaign, section)?,
    };
    let speeds = speed_grid(section.spindle_rpm)?;
    let solved: Vec<Solved> = structures
        .into_iter()
        .map(|structure| {
            let solver = StabilitySolver::new(force, structure.frf.as_ref());
            let curve = solver.curve(&speeds);
            let (absolute, best) = (solver.absolute_limit(), solver.best(&curve, BEST));
            Solved {
                structure,
                curve,
                absolute,
                best,
            }
        })
        .collect();
    Ok(describe(section, &coefficients, force.teeth, &solved))
}

fn frf_from_modes(campaign: &Campaign, section: &LobesSection) -> Result<Vec<Structure>> {
    let frf = frf_of_modes(campaign, section)?;
    let count = frf.modes().len();
    let left_out = section.modes.len() - count;
    let mut description = format!("{count} modes in x and y from campaign.toml");
    if left_out > 0 {
        let _ = write!(
            description,
            "; {left_out} in z or theta not used (the lateral block only)"
        );
    }
    Ok(vec![Structure {
        posture: None,
        angle_deg: None,
        frf: Box::new(frf),
        description,
    }])
}

/// From the calibrated model at each posture. To be filled when the robot model is merged: a
/// `ModalFrf::from_mode_shapes` per posture, in the plane normal to the tool axis.
fn frf_from_model(campaign: &Campaign, _section: &LobesSection) -> Result<Vec<Structure>> {
    Err(not_here(campaign, "the robot model"))
}

/// From the FRF files of each posture. To be filled when the readers are merged: a `SampledFrf` per posture of
/// the tool point's 2×2 receptance.
fn frf_from_measured(campaign: &Campaign, _section: &LobesSection) -> Result<Vec<Structure>> {
    Err(not_here(campaign, "the FRF files"))
}

/// Ktc and Krc identified from the campaign's own cuts. To be filled when `cutting` is merged.
fn coefficients_from_cuts(campaign: &Campaign, _section: &LobesSection) -> Result<LobeCoefficients> {
    Err(
        InputError::new("cutting coefficients from the campaign's own cuts are not built yet")
            .file(campaign.dir.join("campaign.toml"))
            .key("lobes.ktc_n_per_mm2")
            .remedy("give ktc_n_per_mm2 and krc_n_per_mm2")
            .into(),
    )
}

fn not_here(campaign: &Campaign, what: &str) -> Error {
    InputError::new(format!("lobes from {what} are not built yet"))
        .file(campaign.dir.join("campaign.toml"))
        .key("lobes.source")
        .remedy("use source = \"modes\" with [[lobes.mode]] tables")
        .into()
}

fn describe(
    section: &LobesSection,
    coefficients: &LobeCoefficients,
    teeth: usize,
    solved: &[Solved],
) -> Outcome {
    let absolute = solved
        .iter()
        .filter_map(|s| s.absolute)
        .min_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm));
    let mut best: Vec<(&Structure, Peak)> = solved
        .iter()
        .flat_map(|s| s.best.iter().map(|peak| (&s.structure, *peak)))
        .collect();
    // Stable: equal depths keep the order of the postures.
    let order = |peak: &Peak| peak.depth_mm.unwrap_or(f64::INFINITY);
    best.sort_by(|a, b| order(&b.1).total_cmp(&order(&a.1)));
    best.truncate(BEST);
    Outcome {
        json: document(section, coefficients, teeth, solved, absolute, &best),
        text: text(section, coefficients, teeth, solved, absolute, &best),
    }
}

fn document(
    section: &LobesSection,
    coefficients: &LobeCoefficients,
    teeth: usize,
    solved: &[Solved],
    absolute: Option<AbsoluteLimit>,
    best: &[(&Structure, Peak)],
) -> Value {
    let curves: Vec<Value> = solved
        .iter()
        .map(|s| {
            json!({
                "posture": s.structure.posture,
                "angle_deg": s.structure.angle_deg,
                "spindle_rpm": s.curve.spindle_rpm,
                "depth_limit_mm": s.curve.depth_limit_mm,
                "chatter_hz": s.curve.chatter_hz,
                "absolute_limit_mm": s.absolute.map(|a| a.depth_mm),
                "absolute_limit_hz": s.absolute.map(|a| a.chatter_hz),
                "frf": s.structure.description,
                "band_hz": [s.structure.frf.band_hz().0, s.structure.frf.band_hz().1],
            })
        })
        .collect();
    let best: Vec<Value> = best
        .iter()
        .map(|(structure, peak)| {
            json!({
                "posture": structure.posture,
                "angle_deg": structure.angle_deg,
                "spindle_rpm": peak.spindle_rpm,
                "depth_mm": peak.depth_mm,
            })
        })
        .collect();
    json!({
        "process": section.process,
        "method": section.method,
        "source": section.source,
        "teeth": teeth,
        "ktc_n_per_mm2": coefficients.ktc_n_per_mm2,
        "krc_n_per_mm2": coefficients.krc_n_per_mm2,
        "curves": curves,
        "absolute_limit_mm": absolute.map(|a| a.depth_mm),
        "absolute_limit_hz": absolute.map(|a| a.chatter_hz),
        "best": best,
    })
}

fn text(
    section: &LobesSection,
    coefficients: &LobeCoefficients,
    teeth: usize,
    solved: &[Solved],
    absolute: Option<AbsoluteLimit>,
    best: &[(&Structure, Peak)],
) -> String {
    let (process, depth) = match section.process {
        Process::Milling => ("milling, zero-order", "axial depth of cut"),
        Process::Drilling => (
            "drilling, lateral",
            "radial width of cut, (diameter − pilot diameter)/2",
        ),
    };
    let mut out = format!(
        "Stability lobes: {process}, {teeth} teeth, Ktc {} and Krc {} N/mm²\n",
        coefficients.ktc_n_per_mm2, coefficients.krc_n_per_mm2
    );
    for s in solved {
        let (low, high) = s.structure.frf.band_hz();
        let _ = writeln!(
            out,
            "FRF{}: {}; chatter sought from {low:.3} to {high:.1} Hz",
            s.structure
                .posture
                .as_ref()
                .map(|p| format!(" at {p}"))
                .unwrap_or_default(),
            s.structure.description
        );
    }
    let _ = writeln!(out, "Depth: {depth}\n");
    let _ = match absolute {
        Some(limit) => writeln!(
            out,
            "Stable at every speed below {:.4} mm (chatter there at {:.2} Hz)",
            limit.depth_mm, limit.chatter_hz
        ),
        None => writeln!(out, "Stable at every speed and depth"),
    };
    let [from, to, step] = section.spindle_rpm;
    let _ = writeln!(out, "\nBest speeds between {from} and {to} rpm (steps of {step})");
    let _ = writeln!(
        out,
        "{:<12} {:>9} {:>11} {:>11} {:>14}",
        "posture", "angle °", "speed rpm", "limit mm", "× always safe"
    );
    for (structure, peak) in best {
        let gain = peak.depth_mm.zip(absolute).map(|(d, a)| d / a.depth_mm);
        let number = |v: Option<f64>, decimals: usize, none: &str| {
            v.map_or(none.to_string(), |v| format!("{v:.decimals$}"))
        };
        let _ = writeln!(
            out,
            "{:<12} {:>9} {:>11.1} {:>11} {:>14}",
            structure.posture.as_deref().unwrap_or("–"),
            number(structure.angle_deg, 1, "–"),
            peak.spindle_rpm,
            number(peak.depth_mm, 4, "no limit"),
            number(gain, 1, "–")
        );
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::{Dynamometer, LobeAxis, LobeMethod, LobeMode};
    use approx::assert_relative_eq;

    fn campaign(source: LobeSource) -> Campaign {
        let mode = |axis, frequency_hz, damping_ratio, stiffness_n_per_m| LobeMode {
            axis,
            frequency_hz,
            damping_ratio,
            stiffness_n_per_m,
        };
        Campaign {
            dir: "cell".into(),
            name: "lobes".into(),
            robot: None,
            postures: vec![],
            points: vec![],
            frfs: vec![],
            tool: None,
            dynamometer: Dynamometer {
                tool_from_dyno: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            },
            cuts: vec![],
            lobes: Some(LobesSection {
                process: Process::Drilling,
                source,
                method: LobeMethod::FrequencyDomain,
                ktc_n_per_mm2: Some(1014.2),
                krc_n_per_mm2: Some(619.9),
                kac_n_per_mm2: None,
                teeth: Some(2),
                immersion: None,
                half_point_angle_deg: Some(67.5),
                feed_per_rev_mm: None,
                spindle_rpm: [100.0, 900.0, 1.0],
                modes: vec![
                    mode(LobeAxis::X, 12.3, 0.028, 5e5),
                    mode(LobeAxis::Y, 12.2, 0.025, 3e5),
                    mode(LobeAxis::Theta, 3000.0, 0.02, 1e4),
                ],
                redundancy: None,
            }),
            material: None,
        }
    }

    #[test]
    fn modes_give_the_document_of_the_contract() {
        let Outcome { json, text } = outcome(&campaign(LobeSource::Modes)).unwrap();
        let curve = &json["curves"][0];
        for key in [
            "posture",
            "angle_deg",
            "spindle_rpm",
            "depth_limit_mm",
            "chatter_hz",
        ] {
            assert!(curve.get(key).is_some(), "{key}");
        }
        assert_eq!(curve["spindle_rpm"].as_array().unwrap().len(), 801);
        assert_eq!(curve["depth_limit_mm"].as_array().unwrap().len(), 801);
        let absolute = json["absolute_limit_mm"].as_f64().unwrap();
        let least = curve["depth_limit_mm"]
            .as_array()
            .unwrap()
            .iter()
            .filter_map(Value::as_f64)
            .fold(f64::INFINITY, f64::min);
        assert_relative_eq!(absolute, least, max_relative = 1e-3);
        // Peaks of the lowest modes near 60 f/(N k).
        let speeds: Vec<f64> = json["best"]
            .as_array()
            .unwrap()
            .iter()
            .map(|b| b["spindle_rpm"].as_f64().unwrap())
            .collect();
        assert!(speeds.iter().any(|n| (n - 366.0).abs() < 6.0), "{speeds:?}");
        assert!(text.contains("Stable at every speed below"), "{text}");
        assert!(text.contains("1 in z or theta not used"), "{text}");
    }

    #[test]
    fn what_is_missing_is_named() {
        let mut lacking = campaign(LobeSource::Modes);
        lacking.lobes.as_mut().unwrap().half_point_angle_deg = None;
        let message = outcome(&lacking).err().unwrap().to_string();
        assert!(message.contains("lobes.half_point_angle_deg"), "{message}");
        lacking.lobes = None;
        let message = outcome(&lacking).err().unwrap().to_string();
        assert!(message.contains("no [lobes] table"), "{message}");
    }
}
