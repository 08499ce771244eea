//! The IRB 6640 of the source thesis, for the tests of this module (the robot file itself is read by `campaign`).

use nalgebra::Vector3;

use super::{Branch, Dual, Kinematics, RobotModel};
use crate::data::*;

pub fn irb6640() -> RobotSpec {
    let joint = |d_m: f64, a_m: f64, alpha_deg: f64, offset_deg: f64, compliance: f64| JointSpec {
        d_m,
        a_m,
        alpha_rad: alpha_deg.to_radians(),
        offset_rad: offset_deg.to_radians(),
        compliance_rad_per_nm: compliance,
        ..JointSpec::default()
    };
    let link = |mass_kg: f64, inertia_kg_m2: [f64; 3], section: Option<(f64, f64)>| LinkSpec {
        mass_kg,
        inertia_kg_m2,
        section: section.map(|(outer_diameter_m, wall_m)| BeamSection::tube(outer_diameter_m, wall_m)),
        ..LinkSpec::default()
    };
    RobotSpec {
        name: "ABB IRB 6640-205/2.75".into(),
        joints: vec![
            joint(0.7682, 0.3242, -90.0, 0.0, 0.66e-6),
            joint(0.0, 1.2844, 0.0, -90.0, 0.51e-6),
            joint(0.0, 0.1784, -90.0, 0.0, 0.48e-6),
            joint(1.1454, 0.0, -90.0, 180.0, 0.18e-5),
            joint(0.0, 0.0, 90.0, 0.0, 0.42e-5),
            joint(0.1996, 0.0, 0.0, 0.0, 0.20e-5),
        ],
        links: vec![
            link(478.1478155, [37.86, 37.77, 3.67], Some((0.45, 0.03))),
            link(154.2855258, [47.06, 28.67, 51.04], Some((0.30, 0.02))),
            link(213.9519076, [6.74, 7.76, 6.61], Some((0.30, 0.02))),
            link(186.6735005, [31.28, 30.66, 1.89], Some((0.24, 0.018))),
            link(26.32104143, [0.107, 0.219, 0.209], None),
            link(60.0, [2.7375, 2.7375, 1.875], Some((0.16, 0.02))),
        ],
        tool: ToolFrame {
            tcp_in_flange_m: [0.1989, 0.0, 0.5599],
            tilt_about_flange_y_rad: 45f64.to_radians(),
            ..ToolFrame::default()
        },
        guesses: Vec::new(),
    }
}

/// The UR10e by its published Denavit–Hartenberg table, as far as inverse kinematics needs it: a wrist that is not spherical.
pub fn ur10e() -> RobotSpec {
    let rows = [
        (0.1807, 0.0, 90.0f64),
        (0.0, -0.6127, 0.0),
        (0.0, -0.57155, 0.0),
        (0.17415, 0.0, 90.0),
        (0.11985, 0.0, -90.0),
        (0.11655, 0.0, 0.0),
    ];
    let joint = |(d_m, a_m, alpha_deg): (f64, f64, f64)| JointSpec {
        d_m,
        a_m,
        alpha_rad: alpha_deg.to_radians(),
        compliance_rad_per_nm: 5e-5,
        ..JointSpec::default()
    };
    let link = LinkSpec {
        mass_kg: 5.0,
        inertia_kg_m2: [0.1; 3],
        ..LinkSpec::default()
    };
    RobotSpec {
        name: "UR10e".into(),
        joints: rows.into_iter().map(joint).collect(),
        links: vec![link; 6],
        tool: ToolFrame::default(),
        guesses: Vec::new(),
    }
}

/// An arm with nothing square about it: joints placed anywhere, axes and inertias askew.
pub fn awkward_arm(joints: usize) -> RobotSpec {
    let mut seed = 0.37f64;
    // Weyl's sequence: spread over −1 to 1 and the same on every machine.
    let mut next = || {
        seed = (seed + 0.618_033_988_749_894_9).fract();
        2.0 * seed - 1.0
    };
    let joint = |i: usize, next: &mut dyn FnMut() -> f64| {
        let axis = Vector3::new(next(), next(), 1.2 * next()).normalize();
        JointSpec {
            name: Some(format!("axis {i}")),
            compliance_rad_per_nm: 1e-5 * (1.0 + i as f64),
            limits_rad: Some([-2.9, 2.9]),
            placement: Some(JointPlacement {
                origin_m: [0.2 * next(), 0.1 * next(), 0.3],
                rpy_rad: [next(), 0.7 * next(), 2.0 * next()],
                axis: axis.into(),
            }),
            ..JointSpec::default()
        }
    };
    let link = |i: usize, next: &mut dyn FnMut() -> f64| LinkSpec {
        name: Some(format!("link {i}")),
        mass_kg: 12.0 - i as f64,
        inertia_kg_m2: [0.5, 0.6, 0.4],
        products_kg_m2: [0.1 * next(), 0.1 * next(), 0.1 * next()],
        com_m: Some([0.1 * next(), 0.1 * next(), 0.15]),
        section: None,
    };
    RobotSpec {
        name: "awkward arm".into(),
        joints: (1..=joints).map(|i| joint(i, &mut next)).collect(),
        links: (1..=joints).map(|i| link(i, &mut next)).collect(),
        tool: ToolFrame {
            tcp_in_flange_m: [0.03, -0.02, 0.21],
            rpy_in_flange_rad: [0.2, -0.5, 1.0],
            ..ToolFrame::default()
        },
        guesses: Vec::new(),
    }
}

/// The four tap-test postures, degrees.
pub const TAP_POSTURES: [[f64; 6]; 4] = [
    [135.0, -2.0, 53.0, 83.0, 30.0, -117.0],
    [135.0, 20.0, 26.0, 30.0, 80.0, -150.0],
    [153.0, 23.0, 20.0, -18.0, 87.0, 161.0],
    [161.0, 3.0, 47.0, -68.0, 46.0, 123.0],
];

/// A flexible tool with a damper: a mass of its own that carries the tool centre point.
pub fn flexible_tool(robot: &RobotModel, kinematics: &Kinematics) -> Branch {
    Branch {
        place: robot.flange_place(),
        at: kinematics.tcp(),
        directions: vec![Vector3::x(), Vector3::y()],
        mass_kg: Dual::constant(9.0),
        stiffness_n_per_m: Dual::constant(9e5),
        damping_ns_per_m: Dual::constant(120.0),
        carries_tool_point: true,
    }
}
