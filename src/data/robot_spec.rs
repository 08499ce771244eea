//! What a robot file says: geometry, masses, compliances. (The form of `datasets/irb6640/robot.toml`.)

use crate::text::{listed, to_degrees};

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
    /// Which joints stand beyond their limits at a posture, as a sentence's end: `joint 2 at 500° (limits -115 to 143°)`; `None`: no joint.
    pub fn beyond_limits(&self, joints_deg: &[f64]) -> Option<String> {
        /// Rounding, degrees.
        const ROUNDING: f64 = 1e-6;
        let joints = self.joints.iter().zip(joints_deg).enumerate();
        let beyond = joints.filter_map(|(i, (joint, at))| {
            let [low, high] = joint.limits_rad?.map(to_degrees);
            let inside = (low - ROUNDING..=high + ROUNDING).contains(at);
            (!inside).then(|| format!("joint {} at {at}° (limits {low} to {high}°)", i + 1))
        });
        let beyond: Vec<String> = beyond.collect();
        (!beyond.is_empty()).then(|| listed(&beyond))
    }

    /// Whether one of the guesses is about the joints' compliances.
    pub fn compliances_are_guessed(&self) -> bool {
        self.guesses.iter().any(|guess| is_of_compliances(guess))
    }

    /// Takes the guesses about the joints' compliances out: they are known now.
    pub fn forget_guessed_compliances(&mut self) {
        self.guesses.retain(|guess| !is_of_compliances(guess));
    }

    /// What is to be told wherever the file's values are used.
    pub fn guesses_told(&self) -> impl Iterator<Item = String> {
        self.guesses
            .iter()
            .map(|guess| format!("guessed in the robot file: {guess}"))
    }
}

fn is_of_compliances(guess: &str) -> bool {
    guess.contains("compliance")
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
    /// Section of the beam that stands for the link when it may bend; `None`: rigid.
    pub section: Option<BeamSection>,
}

/// The beam that stands for a link when it may bend: straight from one end of the link to the other, the same section all along.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BeamSection {
    /// Its cross-section.
    pub shape: SectionShape,
    /// Young's modulus of this link; `None`: the one that all links without their own have in common.
    pub young_pa: Option<f64>,
    /// Shear modulus of a link that has its own Young's modulus; `None`: that modulus / 2.6 (Poisson's ratio 0.3).
    pub shear_pa: Option<f64>,
}

/// A cross-section. Its x axis runs along the beam, its z axis is `height_axis` (in the link's frame) as far as that is across the beam,
/// and y makes both right-handed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SectionShape {
    /// Hollow round.
    Tube {
        /// Outer diameter, greater than zero.
        outer_diameter_m: f64,
        /// Wall thickness, at most half the outer diameter (solid).
        wall_m: f64,
    },
    /// Hollow rectangular.
    Box {
        /// Outer width, along y.
        width_m: f64,
        /// Outer height, along z.
        height_m: f64,
        /// Wall thickness, at most half of the shorter side (solid).
        wall_m: f64,
        /// Direction of the height in the link's frame.
        height_axis: [f64; 3],
    },
    /// Any section whose principal axes are y and z.
    General {
        /// Area.
        area_m2: f64,
        /// ∫z² dA: how stiff the beam is against bending towards z.
        second_moment_y_m4: f64,
        /// ∫y² dA: against bending towards y.
        second_moment_z_m4: f64,
        /// Saint-Venant's torsion constant J.
        torsion_constant_m4: f64,
        /// Direction of z in the link's frame.
        height_axis: [f64; 3],
    },
}

impl BeamSection {
    /// A hollow round section of the common material.
    pub fn tube(outer_diameter_m: f64, wall_m: f64) -> Self {
        BeamSection {
            shape: SectionShape::Tube {
                outer_diameter_m,
                wall_m,
            },
            young_pa: None,
            shear_pa: None,
        }
    }
}

impl SectionShape {
    /// Wall thickness; `None` where the section is not given by one.
    pub fn wall_m(&self) -> Option<f64> {
        match self {
            SectionShape::Tube { wall_m, .. } | SectionShape::Box { wall_m, .. } => Some(*wall_m),
            SectionShape::General { .. } => None,
        }
    }

    /// Wall thickness of the solid section; `None` as for [`wall_m`](Self::wall_m).
    pub fn thickest_wall_m(&self) -> Option<f64> {
        match self {
            SectionShape::Tube { outer_diameter_m, .. } => Some(0.5 * outer_diameter_m),
            SectionShape::Box {
                width_m, height_m, ..
            } => Some(0.5 * width_m.min(*height_m)),
            SectionShape::General { .. } => None,
        }
    }

    /// Changes the wall thickness, where there is one.
    pub fn set_wall_m(&mut self, to: f64) {
        match self {
            SectionShape::Tube { wall_m, .. } | SectionShape::Box { wall_m, .. } => *wall_m = to,
            SectionShape::General { .. } => {}
        }
    }

    /// Direction of z in the link's frame; `None` for a round section, which has none.
    pub fn height_axis(&self) -> Option<[f64; 3]> {
        match self {
            SectionShape::Tube { .. } => None,
            SectionShape::Box { height_axis, .. } | SectionShape::General { height_axis, .. } => {
                Some(*height_axis)
            }
        }
    }

    /// The same section with z along another direction.
    pub fn with_height_axis(mut self, axis: [f64; 3]) -> Self {
        if let SectionShape::Box { height_axis, .. } | SectionShape::General { height_axis, .. } = &mut self {
            *height_axis = axis;
        }
        self
    }
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
