//! A link half as a clamped Euler–Bernoulli beam with a hollow round section.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Rotation3, Vector3};

use crate::data::BeamSection;

/// Ratio E/G for the links' material: one Young's modulus a robot, Poisson's ratio 0.3.
pub const YOUNG_OVER_SHEAR: f64 = 2.6;

impl BeamSection {
    fn inner_diameter_m(&self) -> f64 {
        self.outer_diameter_m - 2.0 * self.wall_m
    }

    /// Cross-section area, m².
    pub fn area_m2(&self) -> f64 {
        std::f64::consts::FRAC_PI_4 * (self.outer_diameter_m.powi(2) - self.inner_diameter_m().powi(2))
    }

    /// Second moment of area about a diameter, m⁴; the polar one is twice this.
    pub fn second_moment_m4(&self) -> f64 {
        std::f64::consts::PI / 64.0 * (self.outer_diameter_m.powi(4) - self.inner_diameter_m().powi(4))
    }
}

/// Tip stiffness per unit Young's modulus of a cantilever along its own x axis, coordinates (u, v, w, θx, θy, θz) of
/// the tip: EA/L, 12EI/L³, ∓6EI/L², 4EI/L, GJ/L (Przemieniecki 1968, eq. 5.116, lower right block K22).
pub fn tip_stiffness_per_pa(section: &BeamSection, length_m: f64) -> Matrix6<f64> {
    let l = length_m;
    let i = section.second_moment_m4();
    let mut k = Matrix6::zeros();
    k[(0, 0)] = section.area_m2() / l;
    k[(1, 1)] = 12.0 * i / l.powi(3);
    k[(2, 2)] = 12.0 * i / l.powi(3);
    k[(3, 3)] = 2.0 * i / (YOUNG_OVER_SHEAR * l);
    k[(4, 4)] = 4.0 * i / l;
    k[(5, 5)] = 4.0 * i / l;
    k[(1, 5)] = -6.0 * i / l.powi(2);
    k[(5, 1)] = k[(1, 5)];
    k[(2, 4)] = 6.0 * i / l.powi(2);
    k[(4, 2)] = k[(2, 4)];
    k
}

/// Frame at `to` whose x axis points along the beam; the section is round, so the turn about x does not matter.
pub fn tip_frame(from: Point3<f64>, to: Point3<f64>) -> Isometry3<f64> {
    let x = (to - from).normalize();
    let seed = if x.z.abs() < 0.9 {
        Vector3::z()
    } else {
        Vector3::x()
    };
    let y = seed.cross(&x).normalize();
    let z = x.cross(&y);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
    Isometry3::from_parts(to.coords.into(), rotation.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tip_compliance_is_the_textbook_cantilever() {
        let section = BeamSection {
            outer_diameter_m: 0.3,
            wall_m: 0.02,
        };
        let (e, l) = (210e9, 0.7);
        let c = (tip_stiffness_per_pa(&section, l) * e).try_inverse().unwrap();
        let i = section.second_moment_m4();
        approx::assert_relative_eq!(c[(1, 1)], l.powi(3) / (3.0 * e * i), max_relative = 1e-12);
        approx::assert_relative_eq!(c[(1, 5)], l.powi(2) / (2.0 * e * i), max_relative = 1e-12);
        approx::assert_relative_eq!(c[(2, 4)], -l.powi(2) / (2.0 * e * i), max_relative = 1e-12);
        approx::assert_relative_eq!(c[(5, 5)], l / (e * i), max_relative = 1e-12);
    }
}
