//! The lobes that a campaign's `[lobes]` table asks for.

use super::redundancy::{self, RedundancyAnalysis};
use crate::campaign::{Campaign, LobeMethod, LobeSource, LobesSection, Process};
use crate::identify::calibrate::calibrate;
use crate::identify::case::structure_model;
use crate::identify::structure::StructureModel;
use crate::identify::{Options, StructureCase};
use crate::lobes::band::{self, LobeBand};
use crate::lobes::measured::measured_structures;
use crate::lobes::setup::{Cut, LobeCoefficients, coefficients_from_cuts, cut_of, frf_of_modes};
use crate::lobes::{
    AbsoluteLimit, DirectFrf, LobeCurve, MultiFrequency, Peak, RobotFrf, SemiDiscretisation, SpeedLimit,
    StabilitySolver, StateSpace, speed_grid,
};
use crate::{InputError, Result};

/// Best speeds that are listed.
pub const BEST: usize = 10;
/// Draws of the parameters for the band.
const DRAWS: usize = 100;
const SEED: u64 = 5;

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
    /// From the uncertainty of the calibrated parameters; averaged forces only.
    pub band: Option<LobeBand>,
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
    /// Where the campaign asks for the surface over the redundancy angle: its angles are the cases.
    pub redundancy: Option<RedundancyAnalysis>,
    pub warnings: Vec<String>,
}

/// One structure that lobes are drawn for.
struct Structure {
    posture: Option<String>,
    frf: Box<dyn DirectFrf>,
    /// The same as first-order equations; only where the method steps through time.
    states: Option<StateSpace>,
    /// The same structure with parameters drawn from their uncertainty.
    variants: Vec<Box<dyn DirectFrf>>,
    description: String,
}

impl Structure {
    fn method(&self, cut: &Cut) -> Box<dyn SpeedLimit + '_> {
        let frf = self.frf.as_ref();
        match (cut, &self.states) {
            (Cut::Averaged(force), _) => Box::new(StabilitySolver::new(*force, frf)),
            (Cut::Periodic(force), Some(states)) => {
                Box::new(SemiDiscretisation::new(*force, states.clone(), frf))
            }
            (Cut::Periodic(force), None) => Box::new(MultiFrequency::new(*force, frf)),
        }
    }

    fn case(self, cut: &Cut, speeds: &[f64]) -> LobeCase {
        let method = self.method(cut);
        let curve = method.curve(speeds);
        let (absolute, mut best) = (
            method.absolute_limit().or(curve.least()),
            method.best(&curve, BEST),
        );
        drop(method);
        let band = match cut {
            Cut::Averaged(force) if !self.variants.is_empty() => {
                let tips: Vec<f64> = best.iter().map(|p| p.spindle_rpm).collect();
                let at_tips = band::band(*force, &self.variants, &tips);
                for (peak, lower) in best.iter_mut().zip(at_tips.lower_mm) {
                    peak.lower_quantile_mm = lower;
                }
                Some(band::band(*force, &self.variants, speeds))
            }
            _ => None,
        };
        LobeCase {
            posture: self.posture,
            angle_deg: None,
            description: self.description,
            band_hz: self.frf.band_hz(),
            absolute,
            best,
            band,
            curve,
        }
    }
}

/// The robot model that lobes are computed from.
pub(super) struct ModelState {
    pub model: StructureModel,
    pub theta: Vec<f64>,
    /// Parameters drawn from their uncertainty; none without a calibration.
    pub draws: Vec<Vec<f64>>,
    pub description: String,
}

impl ModelState {
    fn robot_frf(&self, theta: &[f64], joints_deg: &[f64]) -> Result<RobotFrf> {
        let kinematics = self.model.robot.kinematics(joints_deg)?;
        let chain = self.model.chain(theta, &kinematics, 0.0, false);
        RobotFrf::new(&self.model.robot, &kinematics, &chain)
    }

    /// The tool point's FRF, as a modal sum where the modes are not coupled.
    pub fn frf(&self, joints_deg: &[f64]) -> Result<Box<dyn DirectFrf>> {
        self.frf_with(&self.theta, joints_deg)
    }

    /// The same for each draw of the parameters.
    pub fn variants(&self, joints_deg: &[f64]) -> Result<Vec<Box<dyn DirectFrf>>> {
        self.draws
            .iter()
            .map(|theta| self.frf_with(theta, joints_deg))
            .collect()
    }

    fn frf_with(&self, theta: &[f64], joints_deg: &[f64]) -> Result<Box<dyn DirectFrf>> {
        let frf = self.robot_frf(theta, joints_deg)?;
        Ok(match frf.modal()? {
            Some(modal) => Box::new(modal),
            None => Box::new(frf),
        })
    }
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
        let coefficients = match LobeCoefficients::given(section) {
            Some(given) => given,
            None => coefficients_from_cuts(campaign, section, &mut warnings)?,
        };
        let cut = cut_of(campaign, section, coefficients)?;
        let speeds = speed_grid(section.spindle_rpm)?;
        let mut surface = None;
        let structures = match section.source {
            LobeSource::Modes => from_modes(campaign, section)?,
            LobeSource::Model => {
                let state = model_state(campaign, &mut warnings)?;
                match &section.redundancy {
                    Some(wanted) => {
                        let force = cut.average();
                        let swept = redundancy::sweep(campaign, section, wanted, &state, force, &speeds)?;
                        surface = Some(swept);
                        Vec::new()
                    }
                    None => at_postures(campaign, section, &state)?,
                }
            }
            LobeSource::Measured => from_measured(campaign, section, &mut warnings)?,
        };
        if section.redundancy.is_some() && surface.is_none() {
            warnings
                .push("lobes.redundancy needs source = \"model\": there is no surface over the angle".into());
        }
        let (redundancy, swept) = surface.unzip();
        let cases = structures
            .into_iter()
            .map(|structure| structure.case(&cut, &speeds))
            .chain(swept.unwrap_or_default())
            .collect();
        Ok(LobeAnalysis {
            process: section.process,
            source: section.source,
            method: section.method,
            coefficients,
            teeth: cut.average().teeth,
            spindle_rpm: section.spindle_rpm,
            cases,
            redundancy,
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
        states: steps_through_time(section).then(|| StateSpace::from(&frf)),
        frf: Box::new(frf),
        variants: Vec::new(),
        description,
    }])
}

fn steps_through_time(section: &LobesSection) -> bool {
    section.method == LobeMethod::SemiDiscretisation
}

/// The robot model, calibrated where the campaign has FRFs.
fn model_state(campaign: &Campaign, warnings: &mut Vec<String>) -> Result<ModelState> {
    let (model, theta, draws, description) = if campaign.frfs.is_empty() {
        warnings.push("the campaign has no FRFs: lobes are those of the uncalibrated robot file".into());
        let model = structure_model(campaign)?;
        let theta = model.nominal_theta();
        (
            model,
            theta,
            Vec::new(),
            "robot model, not calibrated".to_string(),
        )
    } else {
        let case = StructureCase::load(campaign)?;
        let calibration = calibrate(&case.model, &case.data, None, case.options(Options::default()))?;
        let description = match case.effects().is_empty() {
            true => "calibrated robot model".to_string(),
            false => format!("calibrated robot model ({})", case.model_description()),
        };
        warnings.extend(case.warnings);
        warnings.extend(calibration.warnings());
        let drawn = band::draws(
            &calibration.theta,
            &calibration.covariance,
            &case.model.bounds(),
            DRAWS,
            SEED,
        )?;
        (case.model, calibration.theta, drawn, description)
    };
    if campaign.postures.is_empty() {
        return Err(InputError::new("lobes from the model need at least one posture")
            .file(campaign.dir.join("campaign.toml"))
            .key("posture")
            .remedy("add a [[posture]] table with id and joints_deg")
            .into());
    }
    Ok(ModelState {
        model,
        theta,
        draws,
        description,
    })
}

/// The robot model at every posture.
fn at_postures(campaign: &Campaign, section: &LobesSection, state: &ModelState) -> Result<Vec<Structure>> {
    campaign
        .postures
        .iter()
        .map(|posture| {
            let states = match steps_through_time(section) {
                true => Some(
                    state
                        .robot_frf(&state.theta, &posture.joints_deg)?
                        .state_space()?,
                ),
                false => None,
            };
            Ok(Structure {
                posture: Some(posture.id.clone()),
                frf: state.frf(&posture.joints_deg)?,
                states,
                variants: state.variants(&posture.joints_deg)?,
                description: state.description.clone(),
            })
        })
        .collect()
}

fn from_measured(
    campaign: &Campaign,
    section: &LobesSection,
    warnings: &mut Vec<String>,
) -> Result<Vec<Structure>> {
    if steps_through_time(section) {
        return Err(InputError::new("semi-discretisation needs modes, and measured FRFs are none")
            .file(campaign.dir.join("campaign.toml"))
            .key("lobes.method")
            .remedy("use method = \"multi-frequency\" on the measured FRFs, or source = \"model\" or \"modes\"")
            .into());
    }
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
                states: None,
                variants: Vec::new(),
                description: "measured FRFs".to_string(),
            }
        })
        .collect())
}
