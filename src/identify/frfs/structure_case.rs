//! A robot model with its measured FRFs, ready to be fitted.

use crate::Result;
use crate::data::{LinkTolerances, MeasuredFrf, Point, Posture, RobotSection};
use crate::effects::{LINK_FLEXIBILITY, Structure};
use crate::identify::case::Case;
use crate::identify::frfs::calibrate::Options;
use crate::identify::frfs::frf_data::FrfData;
use crate::identify::frfs::structure::StructureModel;
use crate::identify::frfs::structure_study::StructureStudy;
use crate::robot::{RobotModel, RobotSpec};

/// The campaign's robot model with its FRFs.
pub type StructureCase = Case<Structure>;

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
        let warnings = baseline.robot.spec.guesses_told().collect();
        Case::without_history(baseline, data, warnings)
    }

    /// Whether the links of the model bend.
    pub fn bends(&self) -> bool {
        self.model.has(LINK_FLEXIBILITY)
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

    /// The case as the loop works on it.
    pub fn study(&self, wanted: Options) -> StructureStudy {
        StructureStudy::new(self.data.clone(), self.options(wanted))
    }
}
