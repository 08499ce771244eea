//! What a robot file says: geometry, masses, compliances. (The form of `datasets/irb6640/robot.toml`.)

/// A serial robot with revolute joints. A joint is given either in the standard (distal) Denavit–Hartenberg convention,
/// T_i = Rz(q_i + offset) Tz(d) Tx(a) Rx(alpha), and turns about z of frame i−1; or by its [`JointPlacement`], and turns
/// about any axis. Link i is fixed to frame i.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotSpec {
    /// Name of the robot; of a file without one, `robot`.
    pub name: String,
    /// Base first; at least one.
    pub joints: Vec<JointSpec>,
    /// As many as joints; link i is the body after joint i.
    pub links: Vec<LinkSpec>,
    /// Tool centre point and tool axis on the flange.
    pub tool: ToolFrame,
    /// What in the file is a guess and not of this robot (`guesses`): told wherever the file's values are used.
    pub guesses: Vec<String>,
}

impl RobotSpec {
    /// What is to be told wherever the file's values are used.
    pub fn guesses_told(&self) -> impl Iterator<Item = String> {
        self.guesses
            .iter()
            .map(|guess| format!("guessed in the robot file: {guess}"))
    }
}

/// A revolute joint: where it is, how compliant, how far it turns.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct JointSpec {
    /// What the joint is called elsewhere, such as in a URDF.
    pub name: Option<String>,
    /// Denavit–Hartenberg offset d along z of frame i−1.
    pub d_m: f64,
    /// Denavit–Hartenberg length a along x of frame i.
    pub a_m: f64,
    /// Denavit–Hartenberg twist α about x of frame i.
    pub alpha_rad: f64,
    /// Added to the joint's angle q.
    pub offset_rad: f64,
    /// rad/(N·m), greater than zero.
    pub compliance_rad_per_nm: f64,
    /// Lower and upper limit of the joint angle (before the offset), rad.
    pub limits_rad: Option<[f64; 2]>,
    /// In place of the four Denavit–Hartenberg numbers, which are zero then.
    pub placement: Option<JointPlacement>,
}

/// Where a joint's frame sits in the frame of the link before it, and about which axis it turns (as in a URDF):
/// T_i = T(origin) Rz(yaw) Ry(pitch) Rx(roll) R(axis, q_i).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointPlacement {
    /// Origin of the joint's frame in the frame of the link before it.
    pub origin_m: [f64; 3],
    /// Roll, pitch, yaw about the fixed axes x, y, z.
    pub rpy_rad: [f64; 3],
    /// Unit vector in the joint's frame.
    pub axis: [f64; 3],
}

/// The body that a joint carries.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LinkSpec {
    /// What the link is called elsewhere, such as in a URDF.
    pub name: Option<String>,
    /// Zero for a link without mass of its own.
    pub mass_kg: f64,
    /// Moments Ixx, Iyy, Izz about the centre of mass, axes along the link's frame.
    pub inertia_kg_m2: [f64; 3],
    /// Ixy, Ixz, Iyz of the same tensor (its elements: −∫xy dm, …); zero where the frame's axes are principal ones.
    pub products_kg_m2: [f64; 3],
    /// Centre of mass in the link's frame; `None`: midway between the link's two joint axes
    /// (last link: midway between flange and tool centre point).
    pub com_m: Option<[f64; 3]>,
    /// Hollow round section of the beam that stands for the link when it may bend; `None`: rigid.
    pub section: Option<BeamSection>,
}

/// Hollow round cross-section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeamSection {
    /// Outer diameter, greater than zero.
    pub outer_diameter_m: f64,
    /// Wall thickness, at most half the outer diameter (solid).
    pub wall_m: f64,
}

/// Where the tool sits on the flange, and where it points.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ToolFrame {
    /// Tool centre point in the flange frame (frame of the last joint).
    pub tcp_in_flange_m: [f64; 3],
    /// The tool axis in the flange frame is (sin, 0, cos) of this angle.
    pub tilt_about_flange_y_rad: f64,
    /// In place of the tilt: roll, pitch, yaw of the tool frame about the flange's fixed axes x, y, z. The tool axis is z
    /// of the tool frame.
    pub rpy_in_flange_rad: [f64; 3],
}
