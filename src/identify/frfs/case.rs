//! A robot model with its measured FRFs, ready to be fitted.

use crate::Result;
use crate::data::{LinkTolerances, MeasuredFrf, Point, Posture, RobotSection};
use crate::identify::frfs::calibrate::Options;
use crate::identify::frfs::frf_data::FrfData;
use crate::identify::frfs::structure::StructureModel;
use crate::identify::frfs::structure_study::StructureStudy;
use crate::identify::model_history::Revision;
use crate::robot::{RobotModel, RobotSpec};

/// Model, data and what was noticed while reading them.
#[derive(Debug, Clone)]
pub struct StructureCase {
    /// The campaign's current model: the baseline with the effects that were added, starting from where the last
    /// revision stood.
    pub model: StructureModel,
    /// The model as the robot file has it, without effects.
    pub baseline: StructureModel,
    /// FRFs with their noise.
    pub data: FrfData,
    /// What was added so far, oldest first; the first is the baseline. Empty where nothing was.
    pub revisions: Vec<Revision>,
    /// Whether the model starts from a solution that was found on these very data.
    pub(crate) settled: bool,
    /// What was noticed while reading and arranging, for people.
    pub warnings: Vec<String>,
}

/// Standard deviation of the logarithm of a joint stiffness about the robot file's value where nobody says another.
pub const STIFFNESS_TOLERANCE: f64 = 0.3;

impl StructureCase {
    /// A robot and its FRFs. Joint stiffnesses and damping are free, all else of `robot` is exact; for other tolerances see
    /// [`of`](Self::of). The FRFs name postures and points by their index.
    ///
    /// # Errors
    /// No FRFs, or a posture that does not fit the robot.
    pub fn new(
        robot: RobotSpec,
        postures: &[Posture],
        points: Vec<Point>,
        frfs: Vec<MeasuredFrf>,
    ) -> Result<Self> {
        let section = RobotSection {
            model: robot.name.clone(),
            mass_tolerance: None,
            stiffness_tolerance: STIFFNESS_TOLERANCE,
            links: LinkTolerances::default(),
        };
        let baseline = StructureModel::new(RobotModel::new(robot), points, &section);
        let data = FrfData::new(postures, &baseline.robot, frfs)?;
        Ok(Self::of(baseline, data))
    }

    /// A model without effects and the FRFs that it is to be fitted to.
    pub fn of(baseline: StructureModel, data: FrfData) -> Self {
        StructureCase {
            model: baseline.clone(),
            warnings: baseline.robot.spec.guesses_told().collect(),
            baseline,
            data,
            revisions: Vec::new(),
            settled: false,
        }
    }

    /// Whether the links of the model bend.
    pub fn bends(&self) -> bool {
        self.model.has("link-flexibility")
    }

    /// How to calibrate this case where `wanted` was asked for. Further starting points were tried when the revision was
    /// made; the same ones again would lead to the same answer, so that only others are.
    pub fn options(&self, wanted: Options) -> Options {
        match self.settled && wanted == Options::default() {
            true => Options {
                extra_starts: 0,
                ..wanted
            },
            false => wanted,
        }
    }

    /// The same case, whose fits start from `theta` (solver's scale), found by calibrating it: nothing is searched again.
    pub fn settled_at(self, theta: &[f64]) -> Self {
        StructureCase {
            model: self.model.with_start(theta.to_vec()),
            settled: true,
            ..self
        }
    }

    /// The same case, whose fits start from `theta` (solver's scale) and search from there.
    pub fn starting_from(self, theta: Vec<f64>) -> Self {
        StructureCase {
            model: self.model.with_start(theta),
            settled: false,
            ..self
        }
    }

    /// Makes fits start from the nominal values, not from where the last revision stood.
    pub fn forget_start(&mut self) {
        self.model = self.model.without_start();
        self.settled = false;
    }

    /// The case as the loop works on it.
    pub fn study(&self, wanted: Options) -> StructureStudy {
        StructureStudy::new(&self.model.robot.spec, self.data.clone(), self.options(wanted))
    }

    /// Number of the current revision; `None` where nothing was ever added.
    pub fn revision(&self) -> Option<usize> {
        self.revisions.last().map(|r| r.revision)
    }

    /// `effect@site` of what is in the model beside the baseline.
    pub fn effects(&self) -> Vec<String> {
        let effects = self.model.effects().iter();
        effects.map(|added| added.instance.label()).collect()
    }

    /// What the model is, for people: `baseline + payload + local-resonator@link-3 (direction y), revision 2`.
    pub fn model_description(&self) -> String {
        let mut text = "baseline".to_string();
        for added in self.model.effects() {
            text += &format!(" + {}", added.instance.title());
        }
        match self.revision().filter(|r| *r > 0) {
            Some(revision) => format!("{text}, revision {revision}"),
            None => format!("{text}, no effect added"),
        }
    }
}
