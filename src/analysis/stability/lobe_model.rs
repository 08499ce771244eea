//! The calibrated robot as lobes need it: its tool point's FRF, the same before effects were added, and draws from the
//! parameters' uncertainty.

use std::sync::Arc;

use nalgebra::Matrix6;

use crate::analysis::StructureAnalysis;
use crate::analysis::structure_case::structure_model;
use crate::analysis::workbench::Workbench;
use crate::campaign::{Campaign, Contact, LobesSection, Process};
use crate::identify::frfs::calibrate::refine;
use crate::identify::frfs::structure::StructureModel;
use crate::lobes::drilling::contact::{HeldHolder, contact_forces, held_compliance, skating_m};
use crate::lobes::drilling::hole::{Deflection, HoleError, HoleLoad};
use crate::lobes::drilling::margin::{MarginContact, MarginFrf};
use crate::lobes::dynamics::feed_stiffness::FeedStiffness;
use crate::lobes::dynamics::tool_point::{Holder, RobotHolder};
use crate::lobes::setup::tool_beam;
use crate::lobes::{Blocks, PoleFrf, RobotFrf, StateSpace, ToolDynamics, ToolPoint, ToolPointFrf, band};
use crate::robot::pose_compensation::compensated_pose;
use crate::robot::{Chain, Kinematics, PostureReport};
use crate::{Error, InputError, Result};

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
        let chain = self.model.chain(theta, &kinematics, Default::default(), false);
        Ok((self.model.kinematics_at(theta, &kinematics).into_owned(), chain))
    }

    fn robot_frf(&self, theta: &[f64], joints_deg: &[f64]) -> Result<RobotFrf> {
        let (kinematics, chain) = self.chain(theta, joints_deg)?;
        RobotFrf::new(&self.model.robot, &kinematics, &chain)
    }

    /// Kinematics, and the tool point's compliance (base axes) free and held by the contacts.
    fn compliances(
        &self,
        theta: &[f64],
        joints_deg: &[f64],
        contacts: &[Contact],
    ) -> Result<(Kinematics, [Matrix6<f64>; 2])> {
        let (kinematics, chain) = self.chain(theta, joints_deg)?;
        let free = chain.tool_compliance(&self.model.robot, &kinematics)?;
        let held = held_compliance(&free, kinematics.tool_axis(), contacts)
            .ok_or_else(|| Error::computation("the contacts leave no finite compliance"))?;
        Ok((kinematics, [free, held]))
    }

    fn deflection(
        &self,
        theta: &[f64],
        joints_deg: &[f64],
        load: &HoleLoad,
        contacts: &[Contact],
    ) -> Result<Deflection> {
        let (kinematics, [_, held]) = self.compliances(theta, joints_deg, contacts)?;
        Ok(Deflection::new(&held, kinematics.tool_axis(), load))
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
        if asked.couples() {
            let behind_m = asked.tool.beam.length_m();
            let holder = RobotHolder::new(robot, kinematics, chain, behind_m)?;
            return Ok(asked.in_hole(asked.point(holder).blocks(asked.axial)));
        }
        let axial = match asked.axial {
            true => Some(form(RobotFrf::axial_torsional(robot, kinematics, chain)?)?),
            false => None,
        };
        Ok(asked.in_hole(Blocks {
            lateral: form(RobotFrf::new(robot, kinematics, chain)?)?,
            axial,
        }))
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
    /// What holds the tool point from outside.
    pub contacts: Vec<Contact>,
    /// The wall of the hole that holds the tip of a drill; `None`: it is free.
    pub margin: Option<MarginContact>,
}

/// What `[lobes]` says of the margins; `None` where they touch nothing.
fn margin_of(section: &LobesSection) -> Option<MarginContact> {
    let margin = MarginContact {
        stiffness_n_per_m: section.margin_stiffness_n_per_m.unwrap_or(0.0),
        damping_ns_per_m: section.margin_damping_ns_per_m.unwrap_or(0.0),
    };
    let touches = margin.stiffness_n_per_m > 0.0 || margin.damping_ns_per_m > 0.0;
    (section.process == Process::Drilling && touches).then_some(margin)
}

impl Asked {
    /// Without contacts.
    pub fn new(section: &LobesSection, axial: bool) -> Self {
        Asked {
            tool: Arc::new(ToolDynamics::new(tool_beam(section))),
            axial,
            contacts: Vec::new(),
            margin: margin_of(section),
        }
    }

    /// The FRFs with the margins of a drill held by the wall of its hole.
    pub fn in_hole(&self, blocks: Blocks) -> Blocks {
        match self.margin {
            Some(margin) => Blocks {
                lateral: Box::new(MarginFrf::new(blocks.lateral, margin)),
                axial: blocks.axial,
            },
            None => blocks,
        }
    }

    /// Whether something is coupled to the structure: a tool beam, a contact.
    pub fn couples(&self) -> bool {
        !(self.tool.beam.segments.is_empty() && self.contacts.is_empty())
    }

    /// The tool point with contacts and tool on this holder.
    pub fn point(&self, holder: impl Holder + 'static) -> ToolPoint {
        let lever_m = self.tool.beam.length_m();
        ToolPoint {
            holder: match self.contacts.is_empty() {
                true => Arc::new(holder),
                false => Arc::new(HeldHolder::new(holder, &self.contacts, lever_m)),
            },
            tool: self.tool.clone(),
        }
    }

    /// ` + tool of 2 segments, 120 mm, held by pressure foot`; empty where there is neither.
    pub fn with_tool(&self) -> String {
        let tool = match self.tool.beam.segments.len() {
            0 => String::new(),
            n => format!(
                " + tool of {n} {}, {:.1} mm (receptance coupling)",
                if n == 1 { "segment" } else { "segments" },
                1e3 * self.tool.beam.length_m()
            ),
        };
        let tool = match self.margin {
            Some(_) => format!("{tool}, margins held by the wall"),
            None => tool,
        };
        match &self.contacts[..] {
            [] => tool,
            contacts => {
                let names: Vec<String> = contacts.iter().map(Contact::title).collect();
                format!("{tool}, held by {} (receptance coupling)", names.join(", "))
            }
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
        warnings.extend(campaign.beyond_limits.iter().cloned());
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
        let effects = case.effects();
        let description = match effects.is_empty() {
            true => "calibrated robot model".to_string(),
            false => format!("calibrated robot model ({})", case.model_description()),
        } + &asked.with_tool();
        if !asked.contacts.is_empty() && effects.iter().any(|e| e.starts_with("tool-flexibility")) {
            warnings.push(
                "the model has tool-flexibility, and [[contact]] holds the tool point at the far end of that spring: a foot that \
                 stands on the spindle's housing holds less of the tool"
                    .into(),
            );
        }
        if !asked.tool.beam.segments.is_empty() && effects.iter().any(|e| e.starts_with("tool-flexibility")) {
            warnings.push(
                "the model has tool-flexibility and [lobes.tool] gives the tool as a beam: the tool's give may be counted twice. \
                 Keep one of them, unless the effect stands for the spindle and the beam for the tool"
                    .into(),
            );
        }
        let before = match case.before_effects(campaign)?.filter(|_| history) {
            Some(model) => {
                // Where it stood then; a search might find another place in a valley, and the limits would seem to have moved.
                let nominal = model.nominal_theta();
                let theta = refine(&model, &case.data, model.start().unwrap_or(&nominal))?.theta;
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
        self.current
            .deflection(&self.current.theta, joints_deg, load, &self.asked.contacts)
    }

    /// The same with its uncertainty, from the draws of the parameters, what the contacts take of the load, and the pose
    /// that makes up for it.
    pub fn hole(&self, joints_deg: &[f64], load: &HoleLoad) -> Result<HoleError> {
        let contacts = &self.asked.contacts;
        let drawn: Vec<Deflection> = self
            .draws
            .iter()
            .map(|theta| self.current.deflection(theta, joints_deg, load, contacts))
            .collect::<Result<_>>()?;
        let theta = &self.current.theta;
        let (kinematics, [free, held]) = self.current.compliances(theta, joints_deg, contacts)?;
        let axis = kinematics.tool_axis();
        let here = Deflection::new(&held, axis, load);
        let pushed = |joints: &[f64]| {
            let (kinematics, [_, held]) = self.current.compliances(theta, joints, contacts)?;
            let steady = Deflection::new(&held, kinematics.tool_axis(), &load.without_lateral()).steady;
            Ok((kinematics, steady))
        };
        Ok(HoleError {
            contacts: contact_forces(contacts, axis, &here.all),
            skating_mm: skating_m(&free, axis, contacts).map(|m| 1e3 * m),
            compensation: Some(compensated_pose(joints_deg, pushed).map_err(|e| e.to_string())),
            ..HoleError::new(&here, &drawn)
        })
    }

    /// How stiff the tool point is along the feed, held by the contacts.
    pub fn feed_stiffness(&self, joints_deg: &[f64], process: Process) -> Result<Option<FeedStiffness>> {
        let theta = &self.current.theta;
        let (kinematics, [_, held]) = self
            .current
            .compliances(theta, joints_deg, &self.asked.contacts)?;
        Ok(FeedStiffness::new(&held, kinematics.tool_axis(), process))
    }

    /// The tool point's FRFs for each draw of the parameters.
    pub fn variants(&self, joints_deg: &[f64]) -> Result<Vec<Blocks>> {
        self.draws
            .iter()
            .map(|theta| self.current.blocks(theta, joints_deg, &self.asked))
            .collect()
    }
}
