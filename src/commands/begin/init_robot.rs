//! The robot file that `lobestone init --robot FILE.urdf` makes.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::campaign::beside_urdf::{BesideUrdf, SaidBeside, beside};
use crate::campaign::robot_text::RobotComments;
use crate::commands::text::Emphasis;
use crate::data::RobotSpec;
use crate::files::{write_atomically, write_new};
use crate::robot::urdf::{Request, UrdfRobot, read};
use crate::text::listed;
use crate::{Error, InputError, Result};

/// Which robot `lobestone init` writes into the campaign file.
#[derive(clap::Args)]
pub(crate) struct RobotArgs {
    /// Robot: irb6640, the path of a robot file in the folder, or a URDF (.urdf) anywhere: a robot file is made of it.
    #[arg(long, value_name = "MODEL")]
    pub(crate) robot: Option<String>,
    /// URDF: the link that stands still [default: the root].
    #[arg(long, value_name = "LINK")]
    pub(crate) base_link: Option<String>,
    /// URDF: the link that is the tool, its z axis along the tool [default: tool0, else flange, else the farthest out].
    #[arg(long, value_name = "LINK")]
    pub(crate) tool_link: Option<String>,
    /// URDF: payload that the maker rates the arm for; chooses the class of the guessed compliances [default: by its mass].
    #[arg(long, value_name = "KG")]
    pub(crate) payload_kg: Option<f64>,
}

/// A robot from a URDF, and the file that it goes into.
pub struct MadeRobot {
    robot: UrdfRobot,
    /// What the file next to the URDF said, where there is one.
    beside: Option<SaidBeside>,
    urdf: PathBuf,
    /// In the campaign's folder.
    pub file: PathBuf,
    /// As `campaign.toml` refers to it.
    pub name: String,
}

/// No URDF of an arm is longer, bytes: the geometry lies in files of its own.
const LONGEST: u64 = 20_000_000;

impl MadeRobot {
    /// `None` where `--robot` names no URDF.
    ///
    /// # Errors
    /// Flags for a URDF without one, a URDF that cannot be read or is none, a payload without sense.
    pub fn of(folder: &Path, args: &RobotArgs) -> Result<Option<Self>> {
        let is_urdf = |name: &String| {
            let name = name.to_lowercase();
            [".urdf", ".xacro", ".urdf.xml"]
                .iter()
                .any(|end| name.ends_with(end))
        };
        let Some(named) = args.robot.as_ref().filter(|name| is_urdf(name)) else {
            let flags = [
                ("--base-link", args.base_link.is_some()),
                ("--tool-link", args.tool_link.is_some()),
                ("--payload-kg", args.payload_kg.is_some()),
            ];
            return match flags.into_iter().find(|(_, given)| *given) {
                Some((flag, _)) => Err(InputError::new("is about a URDF, and none is given")
                    .key(flag)
                    .remedy("give --robot FILE.urdf, or leave it out")
                    .into()),
                None => Ok(None),
            };
        };
        if let Some(payload) = args.payload_kg.filter(|kg| !(*kg > 0.0 && kg.is_finite())) {
            return Err(InputError::new(format!("{payload} is no payload"))
                .key("--payload-kg")
                .remedy("give kilograms, as the data sheet rates the arm")
                .into());
        }
        let urdf = [PathBuf::from(named), folder.join(named)]
            .into_iter()
            .find(|path| path.is_file())
            .ok_or_else(|| {
                InputError::new("there is no such file")
                    .file(named)
                    .key("--robot")
                    .remedy("give the path of the URDF")
            })?;
        let size = std::fs::metadata(&urdf).map_err(|e| Error::io(&urdf, e))?.len();
        if size > LONGEST {
            return Err(InputError::new(format!(
                "is {} MB long, as no robot description is",
                size / 1_000_000
            ))
            .file(&urdf)
            .remedy("give the URDF of a robot arm")
            .into());
        }
        let bytes = std::fs::read(&urdf).map_err(|e| Error::io(&urdf, e))?;
        let text = String::from_utf8(bytes).map_err(|_| {
            InputError::new("is no UTF-8 text")
                .file(&urdf)
                .remedy("give the URDF of a robot arm, an XML text")
        })?;
        let request = Request {
            base_link: args.base_link.clone(),
            tool_link: args.tool_link.clone(),
            payload_kg: args.payload_kg,
        };
        let mut robot = read(&urdf, &text, &request)?;
        let beside = BesideUrdf::find(&urdf)?;
        let beside = beside.map(|b| b.apply(&urdf, &mut robot.spec)).transpose()?;
        let stem = urdf
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default();
        let stem = stem
            .split('.')
            .next()
            .filter(|s| !s.is_empty() && *s != "campaign")
            .unwrap_or("robot");
        let name = format!("{stem}.toml");
        Ok(Some(MadeRobot {
            robot,
            beside,
            urdf,
            file: folder.join(&name),
            name,
        }))
    }

    /// The robot.
    pub fn spec(&self) -> &RobotSpec {
        &self.robot.spec
    }

    /// Writes the robot file; whether there was one before.
    ///
    /// # Errors
    /// There is one, and it is not to be replaced; what the file system refuses.
    pub fn write(&self, replace: bool) -> Result<bool> {
        let mut head = vec![format!(
            "Made by lobestone of {}.",
            self.urdf
                .file_name()
                .map(|n| n.to_string_lossy().into_owned())
                .unwrap_or_default()
        )];
        head.extend(self.robot.notes.iter().cloned());
        let mut compliance = None;
        head.push(match self.beside() {
            Some(told) => {
                compliance = self.beside.as_ref().map(|said| format!("from {}", said.file_name));
                format!("{told} Damping starts at 3 %, drives are not modelled.")
            }
            None => "Compliances, damping and the inertia of the drives are not in a URDF: compliances are guesses here, damping starts \
                     at 3 %, drives are not modelled. Links are rigid until they are given a section."
                .into(),
        });
        let comments = RobotComments {
            head,
            compliance,
            ..RobotComments::default()
        };
        let text = self.robot.spec.to_toml(&comments);
        let was_there = self.file.symlink_metadata().is_ok();
        if replace {
            write_atomically(&self.file, text.as_bytes())?;
        } else if !write_new(&self.file, text.as_bytes())? {
            return Err(InputError::new("is there already; nothing was changed")
                .file(&self.file)
                .remedy("name that file with --robot, or replace it with --force")
                .into());
        }
        Ok(was_there)
    }

    /// What the file next to the URDF gave, in sentences; `None` where there is none.
    fn beside(&self) -> Option<String> {
        let said = self.beside.as_ref()?;
        let source = said.source.as_ref().map_or(String::new(), |s| format!(" ({s})"));
        let mut told = format!(
            "Compliances and sections of links are from {}{source}.",
            said.file_name
        );
        if !said.notes.is_empty() {
            told += &format!(
                " It also says what a robot file has no place for: {}.",
                listed(&said.notes)
            );
        }
        Some(told)
    }

    /// For people.
    pub fn told(&self) -> String {
        let spec = &self.robot.spec;
        let mut text = format!(
            "\n{}: {} joints, {:.1} kg of moving links, from {}\n",
            Emphasis::Strong.on(self.file.display()),
            spec.joints.len(),
            spec.links.iter().map(|link| link.mass_kg).sum::<f64>(),
            self.urdf.display()
        );
        for note in &self.robot.notes {
            text += &format!("  {note}\n");
        }
        if let Some(told) = self.beside() {
            text += &format!("  {told}\n");
        }
        for guess in &spec.guesses {
            text += &format!("  {}: {guess}\n", Emphasis::Doubtful.on("guessed"));
        }
        text
    }
}

/// The same for the document.
#[derive(Serialize)]
pub(crate) struct RobotMade<'a> {
    file: &'a Path,
    urdf: &'a Path,
    base_link: &'a str,
    tool_link: &'a str,
    joints: Vec<Option<&'a str>>,
    notes: &'a [String],
    guesses: &'a [String],
    /// The file next to the URDF that compliances and sections are from.
    compliances_from: Option<PathBuf>,
}

impl<'a> RobotMade<'a> {
    pub fn of(made: &'a MadeRobot) -> Self {
        let spec = &made.robot.spec;
        RobotMade {
            file: &made.file,
            urdf: &made.urdf,
            base_link: &made.robot.base_link,
            tool_link: &made.robot.tool_link,
            joints: spec.joints.iter().map(|j| j.name.as_deref()).collect(),
            notes: &made.robot.notes,
            guesses: &spec.guesses,
            compliances_from: made.beside.as_ref().map(|_| beside(&made.urdf)),
        }
    }
}
