//! The classical 6n×6n form: stiffness and mass in centre-of-mass coordinates of the links, K_C = Bᵀ K B, M_C.
//!
//! People know this form from link–joint–link reductions. It needs an elastic path in all six directions between two
//! neighbouring bodies, so links bend here; the relative coordinates of the chain need no such thing.

use nalgebra::{DMatrix, Matrix6, Vector3, Vector6};

use super::chain::{Chain, Place, Slot};
use crate::{Error, Result};

/// K_C and M_C of a chain: coordinates are (x, y, z, θx, θy, θz) of each body's centre of mass in base axes, bodies in
/// the order of the chain; N/m, N, N·m/rad and kg, kg·m².
#[derive(Debug, Clone)]
pub struct CentreOfMassForm {
    /// K_C, six rows a body.
    pub stiffness: DMatrix<f64>,
    /// M_C, six rows a body.
    pub mass: DMatrix<f64>,
}

/// Φ: twist at a point → twist of the same rigid body at a point shifted by `r`.
fn shift(r: Vector3<f64>) -> Matrix6<f64> {
    let mut phi = Matrix6::identity();
    phi.fixed_view_mut::<3, 3>(0, 3).copy_from(&-r.cross_matrix());
    phi
}

/// What lies behind the last body (the outer half of the last link) carries no mass and is left out.
pub fn centre_of_mass_form(chain: &Chain) -> Result<CentreOfMassForm> {
    let count = chain.bodies.len();
    let mut difference = DMatrix::zeros(6 * count, 6 * count);
    let mut relative = DMatrix::zeros(6 * count, 6 * count);
    let mut mass = DMatrix::zeros(6 * count, 6 * count);
    let mut before = Place::new(0, Slot::Joint);
    for (b, body) in chain.bodies.iter().enumerate() {
        // Base rocking, where there is any, lies in front of the first body.
        let between = chain
            .elements
            .iter()
            .filter(|e| e.place <= body.place && (b == 0 || e.place > before));
        let mut compliance = Matrix6::zeros();
        for element in between {
            let phi = shift(body.com - element.at);
            let own = (&element.shape * element.stiffness.value)
                .try_inverse()
                .ok_or_else(|| Error::computation("an element of the chain has a singular stiffness"))?;
            for (i, a) in element.directions.iter().enumerate() {
                for (j, c) in element.directions.iter().enumerate() {
                    let (a, c): (Vector6<f64>, Vector6<f64>) = (phi * a, phi * c);
                    compliance += a * c.transpose() * own[(i, j)];
                }
            }
        }
        let stiffness = compliance.cholesky().map(|c| c.inverse()).ok_or_else(|| {
            Error::computation(format!(
                "body {} has no elastic path in all six directions to the body before it: give its link a section \
                 (section_outer_diameter_m and section_wall_m, or another one) in the robot file",
                b + 1
            ))
        })?;
        relative.view_mut((6 * b, 6 * b), (6, 6)).copy_from(&stiffness);
        difference
            .view_mut((6 * b, 6 * b), (6, 6))
            .copy_from(&Matrix6::identity());
        if b > 0 {
            let phi = shift(body.com - chain.bodies[b - 1].com);
            difference.view_mut((6 * b, 6 * (b - 1)), (6, 6)).copy_from(&-phi);
        }
        let scale = body.scale.value;
        for i in 0..3 {
            mass[(6 * b + i, 6 * b + i)] = scale * body.mass_kg;
        }
        let inertia = match body.inertia_follows_mass {
            true => body.inertia_kg_m2 * scale,
            false => body.inertia_kg_m2,
        };
        mass.view_mut((6 * b + 3, 6 * b + 3), (3, 3)).copy_from(&inertia);
        before = body.place;
    }
    let stiffness: DMatrix<f64> = difference.transpose() * relative * &difference;
    let stiffness = 0.5 * (&stiffness + stiffness.transpose());
    Ok(CentreOfMassForm { stiffness, mass })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::frf::natural_frequencies_hz;
    use crate::robot::{Baseline, Dual, ModalBasis, RobotModel};

    /// Same structure, other coordinates: the frequencies are the chain's.
    #[test]
    fn frequencies_do_not_depend_on_the_coordinates() {
        let model = RobotModel::new(irb6640());
        let mut baseline = Baseline::nominal(&model.spec);
        baseline.young_pa = Some(Dual::constant(200e9));
        for posture in &TAP_POSTURES {
            let kinematics = model.kinematics(posture).unwrap();
            let chain = model.chain(&kinematics, &baseline);
            let form = centre_of_mass_form(&chain).unwrap();
            assert_eq!(form.stiffness.shape(), (36, 36));
            let absolute = ModalBasis::new(&form.stiffness, &form.mass)
                .unwrap()
                .natural_frequencies_hz();
            let relative = natural_frequencies_hz(&chain.system(0)).unwrap();
            for (a, r) in absolute.iter().zip(&relative).take(12) {
                approx::assert_relative_eq!(a, r, max_relative = 1e-6);
            }
        }
    }

    #[test]
    fn rigid_links_have_no_such_form() {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(&TAP_POSTURES[0]).unwrap();
        let chain = model.chain(&kinematics, &Baseline::nominal(&model.spec));
        assert!(
            centre_of_mass_form(&chain)
                .unwrap_err()
                .to_string()
                .contains("section")
        );
    }
}
