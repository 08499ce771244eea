//! The pose to command so that the tool stands where it should once the forces of the cut have pushed it.
//!
//! Model-based compensation of static deflection (Klimchik, Bondarenko, Pashkevich, Briot & Furet 2014, "Compliance error
//! compensation in robotic-based milling", eq. 6: the target is moved against the deflection that is found at the moved
//! target), solved by Newton's method on the joints.

use nalgebra::{Isometry3, Matrix6xX, Translation3, UnitQuaternion, Vector3, Vector6};

use crate::robot::kinematics::dh::{Kinematics, rpy_of_rotation};
use crate::{Error, Result};

/// What to command instead of a target.
#[derive(Debug, Clone, PartialEq)]
pub struct CompensatedPose {
    /// Joint angles to command.
    pub joints_deg: Vec<f64>,
    /// Tool centre point to command, base frame.
    pub position_m: [f64; 3],
    /// Tool frame to command: roll, pitch, yaw about the base's axes.
    pub rpy_rad: [f64; 3],
    /// Commanded minus target tool centre point, base axes.
    pub offset_m: [f64; 3],
    /// From the target's orientation to the commanded one: rotation vector, base axes.
    pub turn_rad: [f64; 3],
    /// How far the tool centre point is off when the deflection is applied at the commanded pose.
    pub residual_m: f64,
    /// Angle by which the tool is turned off then.
    pub residual_rad: f64,
}

/// Steps of Newton's method; two or three do.
const STEPS: usize = 12;
/// Converged, m and rad: a thousandth of what is promised (1 µm).
const CLOSE: f64 = 1e-9;
/// A joint is not to turn farther than this for a deflection of millimetres, rad.
const FARTHEST_TURN_RAD: f64 = 0.1;

/// The tool frame pushed by a twist (displacement, rotation; base axes) of the tool centre point.
fn pushed(tool: &Isometry3<f64>, twist: &Vector6<f64>) -> Isometry3<f64> {
    let shift: Vector3<f64> = twist.fixed_rows::<3>(0).into_owned();
    let turn: Vector3<f64> = twist.fixed_rows::<3>(3).into_owned();
    Isometry3::from_parts(
        Translation3::from(tool.translation.vector + shift),
        UnitQuaternion::from_scaled_axis(turn) * tool.rotation,
    )
}

/// From one frame to another: shift and rotation vector, base axes.
fn apart(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Vector6<f64> {
    let shift = to.translation.vector - from.translation.vector;
    let turn = (to.rotation * from.rotation.inverse()).scaled_axis();
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

/// The pose to command so that the deflected tool stands where the undeflected one stands at `target_deg`.
///
/// `at`: kinematics and deflection (twist of the tool centre point, base axes) at joint angles in degrees.
///
/// # Errors
/// What `at` refuses, or a posture near a singularity, from which no small move of the joints makes up for the deflection.
pub fn compensated_pose(
    target_deg: &[f64],
    at: impl Fn(&[f64]) -> Result<(Kinematics, Vector6<f64>)>,
) -> Result<CompensatedPose> {
    let target = at(target_deg)?.0.tool;
    let mut joints_deg = target_deg.to_vec();
    let beyond_reach = || {
        Error::computation(
            "no small move of the joints makes up for the deflection: the posture is near a singularity",
        )
    };
    for _ in 0..STEPS {
        let (kinematics, twist) = at(&joints_deg)?;
        let missing = apart(&pushed(&kinematics.tool, &twist), &target);
        if missing.amax() < CLOSE {
            break;
        }
        // Seven joints: the smallest move. A direction that the arm cannot go is left out.
        let twists: Vec<Vector6<f64>> = kinematics.tool_twists().collect();
        let svd = Matrix6xX::from_columns(&twists).svd(true, true);
        let least = 1e-6 * svd.singular_values.max();
        let turn = svd.solve(&missing, least).map_err(|_| beyond_reach())?;
        if !(turn.amax() < FARTHEST_TURN_RAD) {
            return Err(beyond_reach());
        }
        for (joint, turn) in joints_deg.iter_mut().zip(turn.iter()) {
            *joint += turn.to_degrees();
        }
    }
    let (kinematics, twist) = at(&joints_deg)?;
    let left = apart(&pushed(&kinematics.tool, &twist), &target);
    let (residual_m, residual_rad) = (left.fixed_rows::<3>(0).norm(), left.fixed_rows::<3>(3).norm());
    // Beyond a tenth of a micrometre something stopped it short.
    if !(residual_m < 1e-7 && residual_rad < 1e-7) {
        return Err(beyond_reach());
    }
    let moved = apart(&target, &kinematics.tool);
    let three = |from: usize| [moved[from], moved[from + 1], moved[from + 2]];
    Ok(CompensatedPose {
        joints_deg,
        position_m: kinematics.tcp().coords.into(),
        rpy_rad: rpy_of_rotation(&kinematics.tool.rotation),
        offset_m: three(0),
        turn_rad: three(3),
        residual_m,
        residual_rad,
    })
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::static_deflection::wrench;
    use crate::robot::{Baseline, RobotModel};

    /// The built-in robot pushed by 3 kN: the residual is worked out again from the kinematics and the compliance of each
    /// joint, with no matrix of the chain, and stays below a micrometre where without compensation it is millimetres.
    #[test]
    fn the_deflected_tool_stands_where_it_should() {
        let robot = RobotModel::new(irb6640());
        let load = wrench(
            Vector3::new(900.0, -400.0, 3000.0),
            Vector3::new(20.0, 5.0, -30.0),
        );
        let by_chain = |joints: &[f64]| {
            let kinematics = robot.kinematics(joints)?;
            let chain = robot.chain(&kinematics, &Baseline::nominal(&robot.spec));
            let compliance = chain.tool_compliance(&robot, &kinematics)?;
            Ok((kinematics, compliance * load))
        };
        for posture in &TAP_POSTURES {
            let target = robot.kinematics(posture).unwrap();
            let found = compensated_pose(posture, by_chain).unwrap();
            // Each joint gives by compliance times the load's work for a unit turn of it.
            let commanded = robot.kinematics(&found.joints_deg).unwrap();
            let mut twist = Vector6::zeros();
            for joint in 1..=6 {
                let axis = commanded.joint_axis(joint);
                let shift = axis.cross(&(commanded.tcp() - commanded.joint_origin(joint)));
                let unit = wrench(shift, axis);
                twist += unit * unit.dot(&load) * robot.spec.joints[joint - 1].compliance_rad_per_nm;
            }
            let stands = commanded.tcp().coords + twist.fixed_rows::<3>(0);
            let off_m = (stands - target.tcp().coords).norm();
            let axis = UnitQuaternion::from_scaled_axis(twist.fixed_rows::<3>(3).into_owned())
                * commanded.tool_axis();
            assert!(off_m < 1e-6, "{off_m} m");
            assert!((axis - target.tool_axis()).norm() < 1e-7);
            assert!(found.residual_m < 1e-6 && found.residual_rad < 1e-6);
            let uncompensated_m = by_chain(posture).unwrap().1.fixed_rows::<3>(0).norm();
            assert!(uncompensated_m > 1e-3, "{uncompensated_m} m");
            let offset_m = Vector3::from(found.offset_m);
            assert_relative_eq!(offset_m.norm(), uncompensated_m, max_relative = 0.05);
            assert!((commanded.tcp() - target.tcp() - offset_m).norm() < 1e-12);
            let turned = crate::robot::kinematics::dh::rotation_of_rpy(found.rpy_rad);
            assert!(turned.angle_to(&commanded.tool.rotation) < 1e-9);
        }
    }

    /// Nothing pushes: the target itself. Straight wrist: the arm cannot turn the tool every way, and says so.
    #[test]
    fn no_load_and_a_singular_posture() {
        let robot = RobotModel::new(irb6640());
        let still = |joints: &[f64]| Ok((robot.kinematics(joints)?, Vector6::zeros()));
        let found = compensated_pose(&TAP_POSTURES[0], still).unwrap();
        assert_eq!(found.joints_deg, TAP_POSTURES[0]);
        assert_eq!((found.residual_m, found.offset_m), (0.0, [0.0; 3]));
        let singular = [135.0, -2.0, 53.0, 83.0, 0.0, -117.0];
        let turns = |joints: &[f64]| {
            Ok((
                robot.kinematics(joints)?,
                wrench(Vector3::zeros(), Vector3::new(1e-3, 2e-3, 3e-3)),
            ))
        };
        assert!(compensated_pose(&singular, turns).is_err());
    }
}
