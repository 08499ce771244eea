//! The lobes that a campaign's `[lobes]` table asks for.

use crate::campaign::{Campaign, LobeMethod, LobeSource, LobesSection, Process};
use crate::identify::calibrate::calibrate;
use crate::identify::case::structure_model;
use crate::identify::{Options, StructureCase};
use crate::lobes::measured::measured_structures;
use crate::lobes::setup::{LobeCoefficients, coefficients_from_cuts, force_of, frf_of_modes};
use crate::lobes::{AbsoluteLimit, DirectFrf, LobeCurve, Peak, RobotFrf, SpeedLimit, StabilitySolver, speed_grid};
use crate::{InputError, Result};

/// Best speeds that are listed.
pub const BEST: usize = 10;

/// Lobes of one structure.
#[derive(Debug, Clone)]
pub struct LobeCase {
    /// `None` where the FRF belongs to no posture (modes from the campaign file).
    pub posture: Option<String>,
    pub angle_deg: Option<f64>,
    /// For people: where the FRF comes from.
    pub description: String,
    /// Where chatter was sought, Hz.
    pub band_hz: (f64, f64),
    pub curve: LobeCurve,
    pub absolute: Option<AbsoluteLimit>,
    pub best: Vec<Peak>,
}

/// All lobes of a campaign.
#[derive(Debug, Clone)]
pub struct LobeAnalysis {
    pub process: Process,
    pub source: LobeSource,
    pub method: LobeMethod,
    pub coefficients: LobeCoefficients,
    pub teeth: usize,
    pub spindle_rpm: [f64; 3],
    pub cases: Vec<LobeCase>,
    pub warnings: Vec<String>,
}

/// One structure that lobes are drawn for.
struct Structure {
    posture: Option<String>,
    frf: Box<dyn DirectFrf>,
    description: String,
}

impl LobeAnalysis {
    /// # Errors
    /// No `[lobes]` table, something that the process needs is missing, or the structure cannot be had.
    pub fn run(campaign: &Campaign) -> Result<Self> {
        let section = campaign.lobes.as_ref().ok_or_else(|| {
            InputError::new("the campaign has no [lobes] table")
                .file(campaign.dir.join("campaign.toml"))
                .key("lobes")
                .remedy("add one with process, source and spindle_rpm = [from, to, step]")
        })?;
        let mut warnings = Vec::new();
        if section.redundancy.is_some() {
            warnings
                .push("lobes.redundancy is not built yet: the measured postures are drawn instead".into());
        }
        let coefficients = match LobeCoefficients::given(section) {
            Some(given) => given,
            None => coefficients_from_cuts(campaign, section, &mut warnings)?,
        };
        let force = force_of(campaign, section, coefficients)?;
        let structures = match section.source {
            LobeSource::Modes => from_modes(campaign, section)?,
            LobeSource::Model => from_model(campaign, &mut warnings)?,
            LobeSource::Measured => from_measured(campaign, &mut warnings)?,
        };
        let speeds = speed_grid(section.spindle_rpm)?;
        let cases = structures
            .into_iter()
            .map(|structure| {
                let solver = StabilitySolver::new(force, structure.frf.as_ref());
                let curve = solver.curve(&speeds);
                LobeCase {
                    posture: structure.posture,
                    angle_deg: None,
                    description: structure.description,
                    band_hz: structure.frf.band_hz(),
                    absolute: solver.absolute_limit(),
                    best: solver.best(&curve, BEST),
                    curve,
                }
            })
            .collect();
        Ok(LobeAnalysis {
            process: section.process,
            source: section.source,
            method: section.method,
            coefficients,
            teeth: force.teeth,
            spindle_rpm: section.spindle_rpm,
            cases,
            warnings,
        })
    }

    /// The least limit of all cases.
    pub fn absolute(&self) -> Option<AbsoluteLimit> {
        self.cases
            .iter()
            .filter_map(|c| c.absolute)
            .min_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm))
    }

    /// The deepest tips of all cases, deepest first; equal depths keep the order of the postures.
    pub fn best(&self) -> Vec<(&LobeCase, Peak)> {
        let mut best: Vec<(&LobeCase, Peak)> = self
            .cases
            .iter()
            .flat_map(|case| case.best.iter().map(move |peak| (case, *peak)))
            .collect();
        let order = |peak: &Peak| peak.depth_mm.unwrap_or(f64::INFINITY);
        best.sort_by(|a, b| order(&b.1).total_cmp(&order(&a.1)));
        best.truncate(BEST);
        best
    }
}

fn from_modes(campaign: &Campaign, section: &LobesSection) -> Result<Vec<Structure>> {
    let frf = frf_of_modes(campaign, section)?;
    let count = frf.modes().len();
    let left_out = section.modes.len() - count;
    let mut description = format!("{count} modes in x and y from campaign.toml");
    if left_out > 0 {
        description += &format!("; {left_out} in z or theta not used (the lateral block only)");
    }
    Ok(vec![Structure {
        posture: None,
        frf: Box::new(frf),
        description,
    }])
}

/// The robot model at every posture, calibrated where the campaign has FRFs.
fn from_model(campaign: &Campaign, warnings: &mut Vec<String>) -> Result<Vec<Structure>> {
    let (model, theta, description) = if campaign.frfs.is_empty() {
        warnings.push("the campaign has no FRFs: lobes are those of the uncalibrated robot file".into());
        let model = structure_model(campaign)?;
        let theta = model.nominal_theta();
        (model, theta, "robot model, not calibrated".to_string())
    } else {
        let case = StructureCase::load(campaign)?;
        let calibration = calibrate(&case.model, &case.data, case.options(Options::default()))?;
        let description = match case.effects().is_empty() {
            true => "calibrated robot model".to_string(),
            false => format!("calibrated robot model ({})", case.model_description()),
        };
        warnings.extend(case.warnings);
        warnings.extend(calibration.warnings());
        (case.model, calibration.theta, description)
    };
    if campaign.postures.is_empty() {
        return Err(InputError::new("lobes from the model need at least one posture")
            .file(campaign.dir.join("campaign.toml"))
            .key("posture")
            .remedy("add a [[posture]] table with id and joints_deg")
            .into());
    }
    campaign
        .postures
        .iter()
        .map(|posture| {
            let kinematics = model.robot.kinematics(&posture.joints_deg)?;
            let chain = model.chain(&theta, &kinematics, 0.0, false);
            Ok(Structure {
                posture: Some(posture.id.clone()),
                frf: Box::new(RobotFrf::new(&model.robot, &kinematics, &chain)?),
                description: description.clone(),
            })
        })
        .collect()
}

fn from_measured(campaign: &Campaign, warnings: &mut Vec<String>) -> Result<Vec<Structure>> {
    let (set, read_warnings) = campaign.load_frfs()?;
    warnings.extend(read_warnings);
    let structures = measured_structures(campaign, &set)?;
    Ok(structures
        .into_iter()
        .map(|s| {
            let posture = campaign.postures[s.posture].id.clone();
            warnings.extend(s.notes.iter().map(|n| format!("{posture}: {n}")));
            Structure {
                posture: Some(posture),
                frf: Box::new(s.frf),
                description: "measured FRFs".to_string(),
            }
        })
        .collect())
}
