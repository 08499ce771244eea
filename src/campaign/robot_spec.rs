//! What a robot file says: geometry, masses, compliances. (The form of `datasets/irb6640/robot.toml`.)

/// A serial robot with revolute joints, standard (distal) Denavit–Hartenberg convention:
/// T_i = Rz(q_i + offset) Tz(d) Tx(a) Rx(alpha); joint i turns about z of frame i−1, link i is fixed to frame i.
#[derive(Debug, Clone, PartialEq)]
pub struct RobotSpec {
    pub name: String,
    pub joints: Vec<JointSpec>,
    /// As many as joints; link i is the body after joint i.
    pub links: Vec<LinkSpec>,
    pub tool: ToolFrame,
}

#[derive(Debug, Clone, PartialEq)]
pub struct JointSpec {
    pub d_m: f64,
    pub a_m: f64,
    pub alpha_rad: f64,
    pub offset_rad: f64,
    /// rad/(N·m), greater than zero.
    pub compliance_rad_per_nm: f64,
    /// Lower and upper limit of the joint angle (before the offset), rad.
    pub limits_rad: Option<[f64; 2]>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct LinkSpec {
    pub mass_kg: f64,
    /// Principal moments about the centre of mass, axes along the link's DH frame.
    pub inertia_kg_m2: [f64; 3],
    /// Centre of mass in the link's DH frame; `None`: midway between the link's two joint axes
    /// (last link: midway between flange and tool centre point).
    pub com_m: Option<[f64; 3]>,
    /// Hollow round section of the beam that stands for the link when it may bend; `None`: rigid.
    pub section: Option<BeamSection>,
}

/// Hollow round cross-section.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeamSection {
    pub outer_diameter_m: f64,
    pub wall_m: f64,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub struct ToolFrame {
    /// Tool centre point in the flange frame (frame of the last joint).
    pub tcp_in_flange_m: [f64; 3],
    /// The tool axis in the flange frame is (sin, 0, cos) of this angle.
    pub tilt_about_flange_y_rad: f64,
}
