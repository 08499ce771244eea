//! Where the robot stood, and where on it was measured.

use crate::data::RobotSpec;

/// How the robot stood.
#[derive(Debug, Clone, PartialEq)]
pub struct Posture {
    /// Name of the posture, unlike any other's: `p1`.
    pub id: String,
    /// One angle for each joint, base first, before the joints' offsets.
    pub joints_deg: Vec<f64>,
}

impl Posture {
    /// That a joint of the robot cannot stand so, in a sentence; `None` where all can.
    pub fn beyond_limits(&self, robot: &RobotSpec) -> Option<String> {
        let beyond = robot.beyond_limits(&self.joints_deg)?;
        Some(format!(
            "posture {} is beyond the joint limits of the robot file: {beyond}. Check order, sign and zero of the angles, or correct \
             limits_deg in the robot file",
            self.id
        ))
    }
}

/// The body of the robot that a measurement point sits on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum BodyRef {
    /// What the robot stands on; its frame is the base frame.
    Base,
    /// 1-based link number; its frame is DH frame i.
    Link(usize),
    /// Origin at the tool centre point, axes of the tool.
    Tool,
}

/// In which frame X, Y, Z of the FRF files are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AxesRef {
    /// The robot's base frame.
    Base,
    /// The frame of the point's body.
    Body,
    /// The tool frame: z is the tool axis.
    Tool,
}

/// A place on the robot where motion is measured or force is applied.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Node number of the FRF files.
    pub node: i64,
    /// Body that it is fixed to.
    pub body: BodyRef,
    /// Position in that body's frame.
    pub position_m: [f64; 3],
    /// What X, Y and Z of its signals are along.
    pub axes: AxesRef,
}
