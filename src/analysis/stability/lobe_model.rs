//! The calibrated robot as lobes need it: its tool point's FRF, the same before effects were added, and draws from the
//! parameters' uncertainty.

use std::sync::Arc;

use crate::analysis::StructureAnalysis;
use crate::analysis::structure_case::structure_model;
use crate::analysis::workbench::Workbench;
use crate::campaign::{Campaign, LobesSection};
use crate::identify::Options;
use crate::identify::frfs::calibrate::calibrate;
use crate::identify::frfs::structure::StructureModel;
use crate::lobes::dynamics::tool_point::RobotHolder;
use crate::lobes::hole::{Deflection, HoleError, HoleLoad};
use crate::lobes::setup::tool_beam;
use crate::lobes::{Blocks, PoleFrf, RobotFrf, StateSpace, ToolDynamics, ToolPoint, ToolPointFrf, band};
use crate::robot::{Chain, Kinematics, PostureReport};
use crate::{InputError, Result};

/// Draws of the parameters for the band.
const DRAWS: usize = 100;
const SEED: u64 = 5;

/// A structure that a method of lobes can work on.
pub(crate) struct Dynamics {
    pub blocks: Blocks,
    /// The same as first-order equations; only where the method steps through time.
    pub states: Option<StateSpace>,
}

/// A model with values of its parameters.
pub(crate) struct FittedModel {
    pub model: StructureModel,
    theta: Vec<f64>,
}

impl FittedModel {
    fn chain(&self, theta: &[f64], joints_deg: &[f64]) -> Result<(Kinematics, Chain)> {
        let kinematics = self.model.robot.kinematics(joints_deg)?;
        let chain = self.model.chain(theta, &kinematics, 0.0, false);
        Ok((self.model.kinematics_at(theta, &kinematics).into_owned(), chain))
    }

    fn robot_frf(&self, theta: &[f64], joints_deg: &[f64]) -> Result<RobotFrf> {
        let (kinematics, chain) = self.chain(theta, joints_deg)?;
        RobotFrf::new(&self.model.robot, &kinematics, &chain)
    }

    fn deflection(&self, theta: &[f64], joints_deg: &[f64], load: &HoleLoad) -> Result<Deflection> {
        let (kinematics, chain) = self.chain(theta, joints_deg)?;
        let compliance = chain.tool_compliance(&self.model.robot, &kinematics)?;
        Ok(Deflection::new(&compliance, kinematics.tool_axis(), load))
    }

    /// The tool point's FRFs; of the robot alone as modal sums where the modes are not coupled.
    fn blocks(&self, theta: &[f64], joints_deg: &[f64], asked: &Asked) -> Result<Blocks> {
        let (kinematics, chain) = self.chain(theta, joints_deg)?;
        self.blocks_of(&kinematics, &chain, asked, quickest)
    }

    /// `form`: how an FRF of the robot alone is worked out.
    fn blocks_of(
        &self,
        kinematics: &Kinematics,
        chain: &Chain,
        asked: &Asked,
        form: impl Fn(RobotFrf) -> Result<Box<dyn ToolPointFrf>>,
    ) -> Result<Blocks> {
        let robot = &self.model.robot;
        if !asked.tool.beam.segments.is_empty() {
            let behind_m = asked.tool.beam.length_m();
            let point = ToolPoint {
                holder: Arc::new(RobotHolder::new(robot, kinematics, chain, behind_m)?),
                tool: asked.tool.clone(),
            };
            return Ok(point.blocks(asked.axial));
        }
        let axial = match asked.axial {
            true => Some(form(RobotFrf::axial_torsional(robot, kinematics, chain)?)?),
            false => None,
        };
        Ok(Blocks {
            lateral: form(RobotFrf::new(robot, kinematics, chain)?)?,
            axial,
        })
    }

    /// The tool point's FRFs with frequencies and static stiffness there, coupled modes as a sum over their poles: for
    /// maps of many places.
    fn blocks_and_report(&self, joints_deg: &[f64], asked: &Asked) -> Result<(Blocks, PostureReport)> {
        let (kinematics, chain) = self.chain(&self.theta, joints_deg)?;
        let report = PostureReport::new(&self.model.robot, &kinematics, &chain)?;
        let blocks = self.blocks_of(&kinematics, &chain, asked, quickest_of_many)?;
        Ok((blocks, report))
    }

    fn dynamics(&self, joints_deg: &[f64], through_time: bool, asked: &Asked) -> Result<Dynamics> {
        let states = match through_time {
            true => Some(self.robot_frf(&self.theta, joints_deg)?.state_space()?),
            false => None,
        };
        Ok(Dynamics {
            blocks: self.blocks(&self.theta, joints_deg, asked)?,
            states,
        })
    }
}

fn quickest(frf: RobotFrf) -> Result<Box<dyn ToolPointFrf>> {
    Ok(match frf.modal()? {
        Some(modal) => Box::new(modal),
        None => Box::new(frf),
    })
}

/// Coupled modes as a sum over their poles, which pays where one FRF is asked for very often.
fn quickest_of_many(frf: RobotFrf) -> Result<Box<dyn ToolPointFrf>> {
    if let Some(modal) = frf.modal()? {
        return Ok(Box::new(modal));
    }
    Ok(match PoleFrf::of_robot(&frf)? {
        Some(poles) => Box::new(poles),
        None => Box::new(frf),
    })
}

/// What the lobes need of a structure.
#[derive(Clone)]
pub(crate) struct Asked {
    /// Without segments where the tool is rigid.
    pub tool: Arc<ToolDynamics>,
    /// Whether the axial–torsional block is wanted.
    pub axial: bool,
}

impl Asked {
    pub fn new(section: &LobesSection, axial: bool) -> Self {
        Asked {
            tool: Arc::new(ToolDynamics::new(tool_beam(section))),
            axial,
        }
    }

    /// ` + tool of 2 segments, 120 mm`; empty where there is none.
    pub fn with_tool(&self) -> String {
        match self.tool.beam.segments.len() {
            0 => String::new(),
            n => format!(
                " + tool of {n} {}, {:.1} mm (receptance coupling)",
                if n == 1 { "segment" } else { "segments" },
                1e3 * self.tool.beam.length_m()
            ),
        }
    }
}

/// The robot model that lobes are computed from.
pub(crate) struct ModelState {
    pub current: FittedModel,
    /// Without the effects that were added, fitted to the same data; `None` where there are none.
    pub before: Option<FittedModel>,
    /// `effect@site` of the effects that were added.
    pub effects: Vec<String>,
    /// `None` where nothing was ever added.
    pub revision: Option<usize>,
    /// Parameters drawn from their uncertainty; none without a calibration.
    draws: Vec<Vec<f64>>,
    pub asked: Asked,
    /// For people.
    pub description: String,
}

impl ModelState {
    /// The robot model, calibrated where the campaign has FRFs.
    ///
    /// # Errors
    /// No posture, or what calibrating or reading the revisions refuses.
    pub fn of(campaign: &Workbench, asked: Asked, warnings: &mut Vec<String>) -> Result<Self> {
        Self::fitted(campaign, asked, warnings, true)
    }

    /// As [`of`](Self::of), but for `before`, which takes another calibration.
    pub fn without_history(campaign: &Workbench, asked: Asked, warnings: &mut Vec<String>) -> Result<Self> {
        Self::fitted(campaign, asked, warnings, false)
    }

    fn fitted(campaign: &Workbench, asked: Asked, warnings: &mut Vec<String>, history: bool) -> Result<Self> {
        if campaign.postures.is_empty() {
            return Err(InputError::new("lobes from the model need at least one posture")
                .file(campaign.dir.join("campaign.toml"))
                .key("posture")
                .remedy("add a [[posture]] table with id and joints_deg")
                .into());
        }
        match campaign.frfs.is_empty() {
            true => Self::uncalibrated(campaign, asked, warnings),
            false => Self::calibrated(campaign, asked, warnings, history),
        }
    }

    fn uncalibrated(campaign: &Campaign, asked: Asked, warnings: &mut Vec<String>) -> Result<Self> {
        warnings.push("the campaign has no FRFs: lobes are those of the uncalibrated robot file".into());
        let model = structure_model(campaign)?;
        warnings.extend(model.robot.spec.guesses_told());
        Ok(ModelState {
            current: FittedModel {
                theta: model.nominal_theta(),
                model,
            },
            before: None,
            effects: Vec::new(),
            revision: None,
            draws: Vec::new(),
            description: format!("robot model, not calibrated{}", asked.with_tool()),
            asked,
        })
    }

    fn calibrated(
        campaign: &Workbench,
        asked: Asked,
        warnings: &mut Vec<String>,
        history: bool,
    ) -> Result<Self> {
        let analysis = StructureAnalysis::on(campaign)?;
        let (case, calibration) = (&analysis.case, &analysis.calibration);
        let options = case.options(Options::default());
        let effects = case.effects();
        let description = match effects.is_empty() {
            true => "calibrated robot model".to_string(),
            false => format!("calibrated robot model ({})", case.model_description()),
        } + &asked.with_tool();
        if !asked.tool.beam.segments.is_empty() && effects.iter().any(|e| e.starts_with("tool-flexibility")) {
            warnings.push(
                "the model has tool-flexibility and [lobes.tool] gives the tool as a beam: the tool's give may be counted twice. \
                 Keep one of them, unless the effect stands for the spindle and the beam for the tool"
                    .into(),
            );
        }
        let before = match case.before_effects(campaign)?.filter(|_| history) {
            Some(model) => {
                let theta = calibrate(&model, &case.data, None, options)?.theta;
                Some(FittedModel { model, theta })
            }
            None => None,
        };
        let draws = band::draws(
            &calibration.theta,
            &calibration.covariance,
            &case.model.bounds(),
            DRAWS,
            SEED,
        )?;
        warnings.extend(calibration.warnings());
        let revision = case.revision();
        warnings.extend(case.warnings.iter().cloned());
        Ok(ModelState {
            current: FittedModel {
                model: case.model.clone(),
                theta: calibration.theta.clone(),
            },
            before,
            effects,
            revision,
            draws,
            asked,
            description,
        })
    }

    /// The tool point's FRFs.
    pub fn blocks(&self, joints_deg: &[f64]) -> Result<Blocks> {
        self.current.blocks(&self.current.theta, joints_deg, &self.asked)
    }

    pub fn dynamics(&self, model: &FittedModel, joints_deg: &[f64], through_time: bool) -> Result<Dynamics> {
        model.dynamics(joints_deg, through_time, &self.asked)
    }

    /// The model at the holder face, the tool's length behind the tool centre point.
    pub fn holder(&self, joints_deg: &[f64]) -> Result<RobotHolder> {
        let (kinematics, chain) = self.current.chain(&self.current.theta, joints_deg)?;
        let behind_m = self.asked.tool.beam.length_m();
        RobotHolder::new(&self.current.model.robot, &kinematics, &chain, behind_m)
    }

    /// The tool point's FRFs, and frequencies and static stiffness there.
    pub fn blocks_and_report(&self, joints_deg: &[f64]) -> Result<(Blocks, PostureReport)> {
        self.current.blocks_and_report(joints_deg, &self.asked)
    }

    /// What a load does to the tool, with nothing said of its uncertainty.
    pub fn deflection(&self, joints_deg: &[f64], load: &HoleLoad) -> Result<Deflection> {
        self.current.deflection(&self.current.theta, joints_deg, load)
    }

    /// The same with its uncertainty, from the draws of the parameters.
    pub fn hole(&self, joints_deg: &[f64], load: &HoleLoad) -> Result<HoleError> {
        let drawn: Vec<Deflection> = self
            .draws
            .iter()
            .map(|theta| self.current.deflection(theta, joints_deg, load))
            .collect::<Result<_>>()?;
        Ok(HoleError::new(&self.deflection(joints_deg, load)?, &drawn))
    }

    /// The tool point's FRFs for each draw of the parameters.
    pub fn variants(&self, joints_deg: &[f64]) -> Result<Vec<Blocks>> {
        self.draws
            .iter()
            .map(|theta| self.current.blocks(theta, joints_deg, &self.asked))
            .collect()
    }
}
