//! A campaign's structural side, loaded and ready to be fitted.

use super::frf_data::FrfData;
use super::structure::StructureModel;
use crate::campaign::{Campaign, RobotSection};
use crate::robot::{RobotModel, RobotSpec};
use crate::{InputError, Result};

/// Model, data and what was noticed while reading them.
#[derive(Debug, Clone)]
pub struct StructureCase {
    pub model: StructureModel,
    pub data: FrfData,
    pub warnings: Vec<String>,
}

/// The robot section of a campaign, or an error that says what is missing.
pub fn robot_section(campaign: &Campaign) -> Result<&RobotSection> {
    campaign.robot.as_ref().ok_or_else(|| {
        InputError::new("the campaign has no [robot]")
            .file(campaign.dir.join("campaign.toml"))
            .key("robot")
            .remedy("add [robot] with model = \"irb6640\" or the path of a robot file")
            .into()
    })
}

/// The robot model of a campaign, uncalibrated.
pub fn structure_model(campaign: &Campaign) -> Result<StructureModel> {
    let section = robot_section(campaign)?;
    let spec = RobotSpec::load(&section.model, &campaign.dir)?;
    Ok(StructureModel::new(
        RobotModel::new(spec),
        campaign.points.clone(),
        section,
    ))
}

impl StructureCase {
    pub fn load(campaign: &Campaign) -> Result<Self> {
        let model = structure_model(campaign)?;
        let (set, warnings) = campaign.load_frfs()?;
        let data = FrfData::new(campaign, &model.robot, set)?;
        Ok(StructureCase {
            model,
            data,
            warnings,
        })
    }
}
