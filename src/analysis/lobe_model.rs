//! The calibrated robot as lobes need it: its tool point's FRF, the same before effects were added, and draws from the
//! parameters' uncertainty.

use super::StructureAnalysis;
use crate::campaign::Campaign;
use crate::identify::Options;
use crate::identify::calibrate::calibrate;
use crate::identify::case::structure_model;
use crate::identify::structure::StructureModel;
use crate::lobes::hole::{Deflection, HoleError, HoleLoad};
use crate::lobes::{DirectFrf, PoleFrf, RobotFrf, StateSpace, band};
use crate::robot::PostureReport;
use crate::{InputError, Result};

/// Draws of the parameters for the band.
const DRAWS: usize = 100;
const SEED: u64 = 5;

/// A structure that a method of lobes can work on.
pub(super) struct Dynamics {
    pub frf: Box<dyn DirectFrf>,
    /// The same as first-order equations; only where the method steps through time.
    pub states: Option<StateSpace>,
}

/// A model with values of its parameters.
pub(super) struct FittedModel {
    pub model: StructureModel,
    theta: Vec<f64>,
}

impl FittedModel {
    fn robot_frf(&self, theta: &[f64], joints_deg: &[f64]) -> Result<RobotFrf> {
        let kinematics = self.model.robot.kinematics(joints_deg)?;
        let chain = self.model.chain(theta, &kinematics, 0.0, false);
        RobotFrf::new(&self.model.robot, &kinematics, &chain)
    }

    fn deflection(&self, theta: &[f64], joints_deg: &[f64], load: &HoleLoad) -> Result<Deflection> {
        let robot = &self.model.robot;
        let kinematics = robot.kinematics(joints_deg)?;
        let chain = self.model.chain(theta, &kinematics, 0.0, false);
        let compliance = chain.tool_compliance(robot, &kinematics)?;
        Ok(Deflection::new(&compliance, kinematics.tool_axis(), load))
    }

    /// The tool point's FRF, as a modal sum where the modes are not coupled.
    fn frf(&self, theta: &[f64], joints_deg: &[f64]) -> Result<Box<dyn DirectFrf>> {
        let frf = self.robot_frf(theta, joints_deg)?;
        Ok(match frf.modal()? {
            Some(modal) => Box::new(modal),
            None => Box::new(frf),
        })
    }

    /// The same in the quickest form, coupled modes as a sum over their poles, with frequencies and static stiffness
    /// there: for maps of many places.
    fn frf_and_report(&self, joints_deg: &[f64]) -> Result<(Box<dyn DirectFrf>, PostureReport)> {
        let robot = &self.model.robot;
        let kinematics = robot.kinematics(joints_deg)?;
        let chain = self.model.chain(&self.theta, &kinematics, 0.0, false);
        let frf = RobotFrf::new(robot, &kinematics, &chain)?;
        let report = PostureReport::new(robot, &kinematics, &chain)?;
        let modal: Option<Box<dyn DirectFrf>> = match frf.modal()? {
            Some(modal) => Some(Box::new(modal)),
            None => match PoleFrf::of_robot(&frf)? {
                Some(poles) => Some(Box::new(poles)),
                None => None,
            },
        };
        Ok((modal.unwrap_or_else(|| Box::new(frf)), report))
    }

    pub fn dynamics(&self, joints_deg: &[f64], through_time: bool) -> Result<Dynamics> {
        let states = match through_time {
            true => Some(self.robot_frf(&self.theta, joints_deg)?.state_space()?),
            false => None,
        };
        Ok(Dynamics {
            frf: self.frf(&self.theta, joints_deg)?,
            states,
        })
    }
}

/// The robot model that lobes are computed from.
pub(super) struct ModelState {
    pub current: FittedModel,
    /// Without the effects that were added, fitted to the same data; `None` where there are none.
    pub before: Option<FittedModel>,
    /// `effect@site` of the effects that were added.
    pub effects: Vec<String>,
    /// `None` where nothing was ever added.
    pub revision: Option<usize>,
    /// Parameters drawn from their uncertainty; none without a calibration.
    draws: Vec<Vec<f64>>,
    /// For people.
    pub description: String,
}

impl ModelState {
    /// The robot model, calibrated where the campaign has FRFs.
    ///
    /// # Errors
    /// No posture, or what calibrating or reading the revisions refuses.
    pub fn of(campaign: &Campaign, warnings: &mut Vec<String>) -> Result<Self> {
        Self::fitted(campaign, warnings, true)
    }

    /// As [`of`](Self::of), but for `before`, which takes another calibration.
    pub fn without_history(campaign: &Campaign, warnings: &mut Vec<String>) -> Result<Self> {
        Self::fitted(campaign, warnings, false)
    }

    fn fitted(campaign: &Campaign, warnings: &mut Vec<String>, history: bool) -> Result<Self> {
        if campaign.postures.is_empty() {
            return Err(InputError::new("lobes from the model need at least one posture")
                .file(campaign.dir.join("campaign.toml"))
                .key("posture")
                .remedy("add a [[posture]] table with id and joints_deg")
                .into());
        }
        match campaign.frfs.is_empty() {
            true => Self::uncalibrated(campaign, warnings),
            false => Self::calibrated(campaign, warnings, history),
        }
    }

    fn uncalibrated(campaign: &Campaign, warnings: &mut Vec<String>) -> Result<Self> {
        warnings.push("the campaign has no FRFs: lobes are those of the uncalibrated robot file".into());
        let model = structure_model(campaign)?;
        Ok(ModelState {
            current: FittedModel {
                theta: model.nominal_theta(),
                model,
            },
            before: None,
            effects: Vec::new(),
            revision: None,
            draws: Vec::new(),
            description: "robot model, not calibrated".into(),
        })
    }

    fn calibrated(campaign: &Campaign, warnings: &mut Vec<String>, history: bool) -> Result<Self> {
        let StructureAnalysis {
            case, calibration, ..
        } = StructureAnalysis::run(campaign, Options::default())?;
        let options = case.options(Options::default());
        let effects = case.effects();
        let description = match effects.is_empty() {
            true => "calibrated robot model".to_string(),
            false => format!("calibrated robot model ({})", case.model_description()),
        };
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
        warnings.extend(case.warnings);
        Ok(ModelState {
            current: FittedModel {
                model: case.model,
                theta: calibration.theta,
            },
            before,
            effects,
            revision,
            draws,
            description,
        })
    }

    /// The tool point's FRF.
    pub fn frf(&self, joints_deg: &[f64]) -> Result<Box<dyn DirectFrf>> {
        self.current.frf(&self.current.theta, joints_deg)
    }

    /// The tool point's FRF, and frequencies and static stiffness there.
    pub fn frf_and_report(&self, joints_deg: &[f64]) -> Result<(Box<dyn DirectFrf>, PostureReport)> {
        self.current.frf_and_report(joints_deg)
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

    /// The tool point's FRF for each draw of the parameters.
    pub fn variants(&self, joints_deg: &[f64]) -> Result<Vec<Box<dyn DirectFrf>>> {
        self.draws
            .iter()
            .map(|theta| self.current.frf(theta, joints_deg))
            .collect()
    }
}
