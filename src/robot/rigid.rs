//! The robot as rigid bodies at one posture: mass, centre of mass, what gravity asks of the joints.

use nalgebra::{Point3, Vector3};

use super::model::RobotModel;
use crate::robot::kinematics::dh::Kinematics;

/// m/s².
pub const STANDARD_GRAVITY: f64 = 9.80665;

impl RobotModel {
    /// Mass of all links that move, kg.
    pub fn moving_mass_kg(&self) -> f64 {
        self.spec.links.iter().map(|link| link.mass_kg).sum()
    }

    /// Common centre of mass of the links, base frame, m; `None` where they have no mass.
    pub fn centre_of_mass(&self, kinematics: &Kinematics) -> Option<Point3<f64>> {
        let total = self.moving_mass_kg();
        let links = (1..).zip(&self.spec.links);
        let moment: Vector3<f64> = links
            .map(|(i, link)| self.link_com(kinematics, i).coords * link.mass_kg)
            .sum();
        (total > 0.0).then(|| (moment / total).into())
    }

    /// Slope of the potential energy over each joint angle, N·m: what the drives hold at rest (Craig 2005, §6.5). `gravity`
    /// points down, base frame, m/s².
    pub fn gravity_torques_nm(&self, kinematics: &Kinematics, gravity: Vector3<f64>) -> Vec<f64> {
        let weights: Vec<(Point3<f64>, Vector3<f64>)> = (1..)
            .zip(&self.spec.links)
            .map(|(i, link)| (self.link_com(kinematics, i), gravity * link.mass_kg))
            .collect();
        (1..=self.joint_count())
            .map(|i| {
                let origin = kinematics.joint_origin(i);
                let behind = weights.iter().skip(i - 1);
                let moment: Vector3<f64> = behind.map(|(at, weight)| (at - origin).cross(weight)).sum();
                -kinematics.joint_axis(i).dot(&moment)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::awkward_arm;

    /// Torques are the slopes of −Σ m g·r.
    #[test]
    fn gravity_torques_are_slopes_of_the_potential_energy() {
        let robot = RobotModel::new(awkward_arm(7));
        let gravity = Vector3::new(1.0, -2.0, -STANDARD_GRAVITY);
        let energy = |q: &[f64]| {
            let kinematics = Kinematics::new(&robot.spec, q);
            let centre = robot.centre_of_mass(&kinematics).unwrap();
            -robot.moving_mass_kg() * gravity.dot(&centre.coords)
        };
        let q = [0.3, -1.0, 0.7, 1.9, -0.4, 0.8, 2.2];
        let torques = robot.gravity_torques_nm(&Kinematics::new(&robot.spec, &q), gravity);
        for (i, torque) in torques.iter().enumerate() {
            let mut shifted = q;
            shifted[i] += 1e-5;
            let above = energy(&shifted);
            shifted[i] -= 2e-5;
            let slope = (above - energy(&shifted)) / 2e-5;
            assert!(
                (torque - slope).abs() < 1e-7 * (1.0 + slope.abs()),
                "{torque} {slope}"
            );
        }
    }
}
