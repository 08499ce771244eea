//! Where the tool point goes, and how it turns, under a static force and moment.

use nalgebra::{Matrix6, Matrix6xX, Vector3, Vector6};

use super::chain::Chain;
use super::model::RobotModel;
use crate::robot::kinematics::dh::Kinematics;
use crate::{Error, Result};

/// Force (N) and moment (N·m) on the tool at the tool centre point, base axes.
pub fn wrench(force_n: Vector3<f64>, moment_nm: Vector3<f64>) -> Vector6<f64> {
    Vector6::new(
        force_n.x,
        force_n.y,
        force_n.z,
        moment_nm.x,
        moment_nm.y,
        moment_nm.z,
    )
}

impl Chain {
    /// Static compliance of the tool centre point, base axes: displacement (m) and rotation (rad) per force (N) and
    /// moment (N·m), C = J K⁻¹ Jᵀ with J the twist of the tool point per coordinate (Salisbury 1980; Alici & Shirinzadeh
    /// 2005, eq. 4, without the term of the preload).
    ///
    /// The spring of a flexible tool counts for the displacement. It is a point mass on a spring: how far the tool tilts
    /// on it is not known, and is left out of the rotation.
    ///
    /// # Errors
    /// A chain whose stiffness is not positive definite.
    pub fn tool_compliance(&self, robot: &RobotModel, kinematics: &Kinematics) -> Result<Matrix6<f64>> {
        let mut jacobian: Matrix6xX<f64> = self.jacobian(kinematics.tcp(), robot.flange_place());
        let mut column = self.elements.iter().map(|e| e.directions.len()).sum();
        for branch in &self.branches {
            for direction in &branch.directions {
                if branch.carries_tool_point {
                    jacobian
                        .column_mut(column)
                        .fixed_rows_mut::<3>(0)
                        .copy_from(direction);
                }
                column += 1;
            }
        }
        let stiffness = self
            .system(0)
            .stiffness
            .cholesky()
            .ok_or_else(|| Error::computation("the stiffness matrix is not positive definite"))?;
        let compliance = &jacobian * stiffness.solve(&jacobian.transpose());
        Ok(Matrix6::from_iterator(compliance.iter().copied()))
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::DVector;

    use super::*;
    use crate::data::{JointSpec, RobotSpec, ToolFrame};
    use crate::robot::fixture::{TAP_POSTURES, flexible_tool, irb6640};
    use crate::robot::{Baseline, Dual, PostureReport};

    /// One joint of compliance c with a lever a: force across the lever moves c a² and turns c a, a moment moves c a and
    /// turns c.
    #[test]
    fn a_lever_on_one_spring() {
        let (c, a) = (2e-6, 0.8);
        let joint = JointSpec {
            d_m: 0.0,
            a_m: a,
            alpha_rad: 0.0,
            offset_rad: 0.0,
            compliance_rad_per_nm: c,
            ..JointSpec::default()
        };
        let link = irb6640().links.remove(0);
        let robot = RobotModel::new(RobotSpec {
            name: "lever".into(),
            joints: vec![joint],
            links: vec![link],
            tool: ToolFrame::default(),
            guesses: Vec::new(),
        });
        let kinematics = robot.kinematics(&[0.0]).unwrap();
        let chain = robot.chain(&kinematics, &Baseline::nominal(&robot.spec));
        let compliance = chain.tool_compliance(&robot, &kinematics).unwrap();
        let pushed = compliance * wrench(Vector3::new(50.0, 100.0, 70.0), Vector3::zeros());
        let expected = Vector6::new(0.0, c * a * a * 100.0, 0.0, 0.0, 0.0, c * a * 100.0);
        assert!((pushed - expected).norm() < 1e-15, "{pushed}");
        let twisted = compliance * wrench(Vector3::zeros(), Vector3::new(3.0, 4.0, 5.0));
        let expected = Vector6::new(0.0, c * a * 5.0, 0.0, 0.0, 0.0, c * 5.0);
        assert!((twisted - expected).norm() < 1e-15, "{twisted}");
    }

    /// The same by virtual work with nothing but the kinematics: the torque on each joint is the wrench's work for a
    /// small turn of it, the joint gives by its compliance, and the tool goes where the kinematics put it.
    #[test]
    fn agrees_with_finite_differences_of_the_kinematics() {
        let robot = RobotModel::new(irb6640());
        let force = Vector3::new(120.0, -80.0, 400.0);
        let moment = Vector3::new(5.0, -3.0, 8.0);
        for posture in &TAP_POSTURES {
            let here = robot.kinematics(posture).unwrap();
            let move_by = |turns_rad: &[f64; 6]| -> Vector6<f64> {
                let at = |sign: f64| {
                    let mut joints = *posture;
                    for (q, turn) in joints.iter_mut().zip(turns_rad) {
                        *q += sign * turn.to_degrees();
                    }
                    robot.kinematics(&joints).unwrap()
                };
                let (plus, minus) = (at(1.0), at(-1.0));
                // As a quaternion: the angle of a rotation matrix comes from its trace, 1e-6 off at such small turns.
                let turn = (plus.tool.rotation * minus.tool.rotation.inverse()).scaled_axis();
                wrench(0.5 * (plus.tcp() - minus.tcp()), 0.5 * turn)
            };
            let step = 1e-5;
            let mut turns = [0.0; 6];
            for joint in 0..6 {
                let mut one = [0.0; 6];
                one[joint] = step;
                let torque_nm = wrench(force, moment).dot(&move_by(&one)) / step;
                turns[joint] = torque_nm * robot.spec.joints[joint].compliance_rad_per_nm;
            }
            let scale = 1e-2;
            let expected = move_by(&turns.map(|t| t * scale)) / scale;
            let chain = robot.chain(&here, &Baseline::nominal(&robot.spec));
            let compliance = chain.tool_compliance(&robot, &here).unwrap();
            let found = compliance * wrench(force, moment);
            assert!(
                (found - expected).norm() < 1e-7 * expected.norm(),
                "{found} {expected}"
            );
            // Maxwell and Betti: what a force does to the rotation, a moment does to the displacement.
            assert!((compliance - compliance.transpose()).norm() < 1e-12 * compliance.norm());
        }
    }

    /// Links that bend and a flexible tool: the same stiffness at the tool point as `model` reports.
    #[test]
    fn agrees_with_the_stiffness_that_model_reports() {
        let robot = RobotModel::new(irb6640());
        let mut baseline = Baseline::nominal(&robot.spec);
        baseline.young_pa = Some(Dual::constant(200e9));
        for posture in &TAP_POSTURES {
            let kinematics = robot.kinematics(posture).unwrap();
            let mut chain = robot.chain(&kinematics, &baseline);
            let rigid_tool = chain.tool_compliance(&robot, &kinematics).unwrap();
            let without = chain.compliance(kinematics.tcp(), robot.flange_place()).unwrap();
            assert!((rigid_tool - without).norm() < 1e-12 * without.norm());
            chain.branches.push(flexible_tool(&robot, &kinematics));
            let compliance = chain.tool_compliance(&robot, &kinematics).unwrap();
            let report = PostureReport::new(&robot, &kinematics, &chain).unwrap();
            for i in 0..3 {
                assert_relative_eq!(
                    1.0 / compliance[(i, i)],
                    report.tcp_stiffness_n_per_m[i],
                    max_relative = 1e-9
                );
            }
            let spring = DVector::from_vec(vec![1.0 / 9e5, 1.0 / 9e5, 0.0, 0.0, 0.0, 0.0]);
            let added = (compliance - rigid_tool).diagonal();
            assert!((added - spring).norm() < 1e-15, "{added}");
        }
    }
}
