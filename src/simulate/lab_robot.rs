//! The robot of a simulated campaign.

use std::path::Path;

use crate::data::RobotSpec;
use crate::{Error, InputError, Result};

/// The robot as its file has it.
#[derive(Debug, Clone, PartialEq)]
pub struct LabRobot {
    /// What its file says.
    pub spec: RobotSpec,
    /// What `[robot] model` says in the campaign.
    pub reference: String,
    /// The robot file as a file of the campaign; `None` for a built-in robot.
    pub file: Option<(String, Vec<u8>)>,
}

impl LabRobot {
    /// A built-in robot, or the robot file at this path (copied into the campaign).
    ///
    /// # Errors
    /// Neither a built-in robot nor a good robot file.
    pub fn load(model: &str) -> Result<Self> {
        let path = Path::new(model);
        if !path.is_file() {
            let spec = RobotSpec::load(model, Path::new(".")).map_err(|_| {
                InputError::new(format!("{model} is neither a built-in robot nor a file"))
                    .key("--robot")
                    .remedy("give irb6640 or the path of a robot file")
            })?;
            return Ok(LabRobot {
                spec,
                reference: model.to_string(),
                file: None,
            });
        }
        let folder = path
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let spec = RobotSpec::load(&name, folder)?;
        let bytes = std::fs::read(path).map_err(|e| Error::io(path, e))?;
        Ok(LabRobot {
            spec,
            reference: "robot.toml".into(),
            file: Some(("robot.toml".into(), bytes)),
        })
    }

    /// Whether it is one of the built-in robots.
    pub fn is_built_in(&self) -> bool {
        self.file.is_none()
    }
}
