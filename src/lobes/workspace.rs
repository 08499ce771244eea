//! How the robot stands at the places of a map of the workspace, and what keeps it from standing there.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use serde::Serialize;

use super::redundancy::in_forbidden_band;
use super::workspace_grid::GridPlace;
use crate::Result;
use crate::robot::{IkReference, IkSolution, InverseKinematics, RobotModel};

/// Whether a cut can be made at a place, and what stands against it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PlaceStatus {
    /// Within the joint limits and far enough from a singularity.
    Reachable,
    /// Within a forbidden band of the redundancy angle.
    Forbidden,
    /// No joint angles lead there.
    OutOfReach,
    /// Joint angles lead there, all beyond a limit.
    JointLimit,
    /// Within the limits only nearer to a singularity than asked for.
    Singular,
}

impl PlaceStatus {
    /// In the order in which tables list them.
    pub const ALL: [PlaceStatus; 5] = [
        PlaceStatus::Reachable,
        PlaceStatus::Forbidden,
        PlaceStatus::OutOfReach,
        PlaceStatus::JointLimit,
        PlaceStatus::Singular,
    ];

    /// As in JSON and tables.
    pub fn name(self) -> &'static str {
        match self {
            PlaceStatus::Reachable => "reachable",
            PlaceStatus::Forbidden => "forbidden",
            PlaceStatus::OutOfReach => "out-of-reach",
            PlaceStatus::JointLimit => "joint-limit",
            PlaceStatus::Singular => "singular",
        }
    }
}

/// How a robot gets to places; everything refers to one posture of it.
pub struct Workspace<'a> {
    ik: InverseKinematics<'a>,
    reference: IkReference,
    /// Tool frame of the posture: its x axis is where the redundancy angle counts from.
    tool: Isometry3<f64>,
    /// Bands of the redundancy angle that are not used, from and to in degrees.
    pub forbidden_deg: Vec<[f64; 2]>,
    /// Postures nearer to a singularity are not taken (see [`IkSolution::singularity_margin`]).
    pub least_singularity_margin: f64,
}

impl<'a> Workspace<'a> {
    /// `joints_deg`: the posture that angle 0, the branch and whole turns of the joints refer to.
    ///
    /// # Errors
    /// A robot of fewer than six joints or more than seven, or a posture at a singularity.
    pub fn new(
        robot: &'a RobotModel,
        joints_deg: &[f64],
        forbidden_deg: &[[f64; 2]],
        least_singularity_margin: f64,
    ) -> Result<Self> {
        let ik = InverseKinematics::new(&robot.spec)?;
        let reference = ik.reference(joints_deg, "the map of the workspace")?;
        let tool = robot.kinematics(joints_deg)?.tool;
        Ok(Workspace {
            ik,
            reference,
            tool,
            forbidden_deg: forbidden_deg.to_vec(),
            least_singularity_margin,
        })
    }

    /// Tool frame at a place. Angle 0 is the tool frame of the posture, turned by the smallest rotation that takes its
    /// tool axis to the place's; for the posture's own direction the angle is that of
    /// [`RedundancySweep`](super::redundancy::RedundancySweep).
    pub fn pose(&self, place: &GridPlace) -> Isometry3<f64> {
        let axis = Vector3::from(place.tool_axis);
        let own = self.tool.rotation * Vector3::z();
        let tilt = UnitQuaternion::rotation_between(&own, &axis).unwrap_or_else(|| {
            // Straight back: any axis across would do; the tool's x is one.
            let across = Unit::new_normalize(self.tool.rotation * Vector3::x());
            UnitQuaternion::from_axis_angle(&across, std::f64::consts::PI)
        });
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), place.angle_deg.to_radians());
        Isometry3::from_parts(
            Translation3::from(Vector3::from(place.tcp_m)),
            tilt * self.tool.rotation * turn,
        )
    }

    /// The joint angles at a place: on the posture's branch where that can be used (with solutions that are searched for:
    /// those nearest to the posture), else on the one farthest from a singularity.
    ///
    /// # Errors
    /// Why there are none.
    pub fn stand(&self, place: &GridPlace) -> std::result::Result<IkSolution, PlaceStatus> {
        if in_forbidden_band(&self.forbidden_deg, place.angle_deg) {
            return Err(PlaceStatus::Forbidden);
        }
        let all = self.ik.tool_pose(&self.pose(place), &self.reference);
        if all.is_empty() {
            return Err(PlaceStatus::OutOfReach);
        }
        let within: Vec<IkSolution> = all.into_iter().filter(IkSolution::is_within_limits).collect();
        if within.is_empty() {
            return Err(PlaceStatus::JointLimit);
        }
        let usable: Vec<IkSolution> = within
            .into_iter()
            .filter(|s| s.singularity_margin >= self.least_singularity_margin)
            .collect();
        let own = usable
            .iter()
            .position(|s| s.branch == self.reference.own_branch());
        let farthest = || {
            let margins = usable.iter().enumerate().map(|(i, s)| (i, s.singularity_margin));
            // The first of equal ones.
            margins.fold(None, |best: Option<(usize, f64)>, (i, m)| match best {
                Some((_, b)) if b >= m => best,
                _ => Some((i, m)),
            })
        };
        own.or_else(|| farthest().map(|(i, _)| i))
            .map(|i| usable[i].clone())
            .ok_or(PlaceStatus::Singular)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lobes::redundancy::RedundancySweep;
    use crate::lobes::workspace_grid::{Span, WorkspaceGrid};
    use crate::robot::fixture::{TAP_POSTURES, irb6640};

    fn span(text: &str) -> Span {
        text.parse().unwrap()
    }

    /// Wherever the map says the robot can stand, forward kinematics leads back to the tool point and direction; the
    /// posture itself is angle 0 of its own place, and the angles are those of the redundancy sweep.
    #[test]
    fn forward_kinematics_leads_back() {
        let robot = RobotModel::new(irb6640());
        let posture = &TAP_POSTURES[1];
        let workspace = Workspace::new(&robot, posture, &[], 0.0).unwrap();
        let here = robot.kinematics(posture).unwrap();
        let own = GridPlace {
            index: 0,
            tcp_m: here.tcp().coords.into(),
            tool_axis: here.tool_axis().into(),
            angle_deg: 0.0,
        };
        let sweep = RedundancySweep::new(&robot, posture, 45.0, &[], 0.0).unwrap();
        for angle in &sweep.angles {
            let place = GridPlace {
                angle_deg: angle.angle_deg,
                ..own
            };
            let (Some(swept), Ok(stand)) = (&angle.joints_deg, workspace.stand(&place)) else {
                continue;
            };
            let turned = robot.kinematics(&stand.joints_deg()).unwrap().tool.rotation;
            let expected = robot.kinematics(swept).unwrap().tool.rotation;
            assert!(turned.angle_to(&expected) < 1e-6, "{angle:?}");
        }
        let back = workspace.stand(&own).unwrap();
        for (a, b) in back.joints_deg().iter().zip(posture) {
            assert!((a - b).abs() < 1e-6, "{:?}", back.joints_deg());
        }
        let grid = WorkspaceGrid::new(
            [span("0.5:3.5:0.5"), span("-1.0:1.0:1.0"), span("0.2:1.4:0.6")],
            &[[0.0, 0.0, -1.0], [1.0, 0.2, -0.3], (-here.tool_axis()).into()],
            60.0,
        )
        .unwrap();
        let mut seen = std::collections::BTreeMap::new();
        for place in (0..grid.place_count()).map(|i| grid.place(i)) {
            let stand = workspace.stand(&place);
            *seen.entry(stand.as_ref().err().copied()).or_insert(0) += 1;
            let Ok(stand) = stand else { continue };
            let there = robot.kinematics(&stand.joints_deg()).unwrap();
            assert!(
                (there.tcp().coords - Vector3::from(place.tcp_m)).norm() < 1e-8,
                "{place:?}"
            );
            assert!(
                (there.tool_axis() - Vector3::from(place.tool_axis)).norm() < 1e-7,
                "{place:?}"
            );
        }
        assert!(
            seen[&None] > 50 && seen[&Some(PlaceStatus::OutOfReach)] > 10,
            "{seen:?}"
        );
    }

    /// Each reason is told apart.
    #[test]
    fn the_reason_is_named() {
        let mut spec = irb6640();
        for joint in &mut spec.joints {
            joint.limits_rad = Some([-6.0, 6.0]);
        }
        let posture = &TAP_POSTURES[0];
        let free = RobotModel::new(spec.clone());
        let here = free.kinematics(posture).unwrap();
        let own = GridPlace {
            index: 0,
            tcp_m: here.tcp().coords.into(),
            tool_axis: here.tool_axis().into(),
            angle_deg: 10.0,
        };
        let status = |robot: &RobotModel, forbidden: &[[f64; 2]], margin: f64, place: GridPlace| {
            let workspace = Workspace::new(robot, posture, forbidden, margin).unwrap();
            workspace.stand(&place).err()
        };
        assert_eq!(status(&free, &[], 0.0, own), None);
        assert_eq!(
            status(&free, &[[350.0, 375.0]], 0.0, own),
            Some(PlaceStatus::Forbidden)
        );
        assert_eq!(status(&free, &[], 1.1, own), Some(PlaceStatus::Singular));
        let far = GridPlace {
            tcp_m: [9.0, 0.0, 1.0],
            ..own
        };
        assert_eq!(status(&free, &[], 0.0, far), Some(PlaceStatus::OutOfReach));
        spec.joints[1].limits_rad = Some([3.05, 3.1]);
        let barred = RobotModel::new(spec);
        assert_eq!(status(&barred, &[], 0.0, own), Some(PlaceStatus::JointLimit));
    }
}
