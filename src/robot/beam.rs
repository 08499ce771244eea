//! A link half as a clamped Euler–Bernoulli beam.

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Rotation3, Vector3};

use crate::data::{BeamSection, SectionShape};

/// Ratio E/G where nobody has said another: Poisson's ratio 0.3.
pub const YOUNG_OVER_SHEAR: f64 = 2.6;

/// What a section does to a beam; axes as those of [`SectionShape`].
#[derive(Debug, Clone, Copy)]
pub struct SectionStiffness {
    /// Area, m².
    pub area_m2: f64,
    /// ∫z² dA, m⁴: bending towards z.
    pub about_y_m4: f64,
    /// ∫y² dA, m⁴: bending towards y.
    pub about_z_m4: f64,
    /// Torsion constant J, m⁴.
    pub torsion_m4: f64,
}

impl SectionShape {
    /// Area and moments. The torsion constant of a box is Bredt's with the wall's own share, 2 t (b−t)² (h−t)²/(b+h−2t) +
    /// 2 t³ (b+h−2t)/3: exact for thin walls, and within 4 % of Saint-Venant's for a solid bar.
    pub fn stiffness(&self) -> SectionStiffness {
        use std::f64::consts::PI;
        match *self {
            SectionShape::Tube {
                outer_diameter_m: outer,
                wall_m,
            } => {
                let inner = outer - 2.0 * wall_m;
                let about_diameter = PI / 64.0 * (outer.powi(4) - inner.powi(4));
                SectionStiffness {
                    area_m2: PI / 4.0 * (outer.powi(2) - inner.powi(2)),
                    about_y_m4: about_diameter,
                    about_z_m4: about_diameter,
                    torsion_m4: 2.0 * about_diameter,
                }
            }
            SectionShape::Box {
                width_m: b,
                height_m: h,
                wall_m: t,
                ..
            } => {
                let (inner_b, inner_h) = (b - 2.0 * t, h - 2.0 * t);
                let (middle_b, middle_h) = (b - t, h - t);
                let half_round = middle_b + middle_h;
                SectionStiffness {
                    area_m2: b * h - inner_b * inner_h,
                    about_y_m4: (b * h.powi(3) - inner_b * inner_h.powi(3)) / 12.0,
                    about_z_m4: (h * b.powi(3) - inner_h * inner_b.powi(3)) / 12.0,
                    torsion_m4: 2.0 * t * (middle_b * middle_h).powi(2) / half_round
                        + 2.0 * t.powi(3) * half_round / 3.0,
                }
            }
            SectionShape::General {
                area_m2,
                second_moment_y_m4,
                second_moment_z_m4,
                torsion_constant_m4,
                ..
            } => SectionStiffness {
                area_m2,
                about_y_m4: second_moment_y_m4,
                about_z_m4: second_moment_z_m4,
                torsion_m4: torsion_constant_m4,
            },
        }
    }
}

/// Tip stiffness per unit Young's modulus of a cantilever along its own x axis, coordinates (u, v, w, θx, θy, θz) of
/// the tip: EA/L, 12EI/L³, ∓6EI/L², 4EI/L, GJ/L (Przemieniecki 1968, eq. 5.116, lower right block K22).
pub fn tip_stiffness_per_pa(section: &BeamSection, length_m: f64) -> Matrix6<f64> {
    let l = length_m;
    let s = section.shape.stiffness();
    let shear_over_young = match (section.young_pa, section.shear_pa) {
        (Some(young), Some(shear)) => shear / young,
        _ => 1.0 / YOUNG_OVER_SHEAR,
    };
    let mut k = Matrix6::zeros();
    k[(0, 0)] = s.area_m2 / l;
    k[(1, 1)] = 12.0 * s.about_z_m4 / l.powi(3);
    k[(2, 2)] = 12.0 * s.about_y_m4 / l.powi(3);
    k[(3, 3)] = shear_over_young * s.torsion_m4 / l;
    k[(4, 4)] = 4.0 * s.about_y_m4 / l;
    k[(5, 5)] = 4.0 * s.about_z_m4 / l;
    k[(1, 5)] = -6.0 * s.about_z_m4 / l.powi(2);
    k[(5, 1)] = k[(1, 5)];
    k[(2, 4)] = 6.0 * s.about_y_m4 / l.powi(2);
    k[(4, 2)] = k[(2, 4)];
    k
}

/// How far across the beam a height axis of unit length must point to say how the section is turned: half a degree.
pub const ACROSS: f64 = 0.01;

/// Frame at `to` whose x axis points along the beam, and whose z axis is `height_axis` as far as that is across it. Without one (round
/// sections) the turn about x does not matter.
pub fn tip_frame(from: Point3<f64>, to: Point3<f64>, height_axis: Option<Vector3<f64>>) -> Isometry3<f64> {
    let x = (to - from).normalize();
    let across = |axis: Vector3<f64>| axis - x * axis.dot(&x);
    let seed = if x.z.abs() < 0.9 {
        Vector3::z()
    } else {
        Vector3::x()
    };
    let z = height_axis
        .map(|axis| across(axis.normalize()))
        .filter(|z| z.norm() > ACROSS)
        .unwrap_or_else(|| across(seed))
        .normalize();
    let y = z.cross(&x);
    let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
    Isometry3::from_parts(to.coords.into(), rotation.into())
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    const SIDEWAYS: [f64; 3] = [0.0, 0.0, 1.0];

    #[test]
    fn tip_compliance_is_the_textbook_cantilever() {
        let (e, g, l) = (70e9, 30e9, 0.7);
        let section = BeamSection {
            shape: SectionShape::General {
                area_m2: 4e-3,
                second_moment_y_m4: 3e-5,
                second_moment_z_m4: 1e-5,
                torsion_constant_m4: 2e-5,
                height_axis: SIDEWAYS,
            },
            young_pa: Some(e),
            shear_pa: Some(g),
        };
        let c = (tip_stiffness_per_pa(&section, l) * e).try_inverse().unwrap();
        let (iy, iz) = (3e-5, 1e-5);
        assert_relative_eq!(c[(0, 0)], l / (e * 4e-3), max_relative = 1e-12);
        assert_relative_eq!(c[(1, 1)], l.powi(3) / (3.0 * e * iz), max_relative = 1e-12);
        assert_relative_eq!(c[(1, 5)], l.powi(2) / (2.0 * e * iz), max_relative = 1e-12);
        assert_relative_eq!(c[(2, 2)], l.powi(3) / (3.0 * e * iy), max_relative = 1e-12);
        assert_relative_eq!(c[(2, 4)], -l.powi(2) / (2.0 * e * iy), max_relative = 1e-12);
        assert_relative_eq!(c[(3, 3)], l / (g * 2e-5), max_relative = 1e-12);
        assert_relative_eq!(c[(5, 5)], l / (e * iz), max_relative = 1e-12);
    }

    #[test]
    fn sections_have_the_moments_of_the_textbooks() {
        let solid = |width_m: f64, height_m: f64| {
            let wall_m = 0.5 * width_m.min(height_m);
            let height_axis = SIDEWAYS;
            SectionShape::Box {
                width_m,
                height_m,
                wall_m,
                height_axis,
            }
            .stiffness()
        };
        let bar = solid(0.1, 0.2);
        assert_relative_eq!(bar.area_m2, 0.02, max_relative = 1e-12);
        assert_relative_eq!(bar.about_y_m4, 0.1 * 0.2f64.powi(3) / 12.0, max_relative = 1e-12);
        assert_relative_eq!(bar.about_z_m4, 0.2 * 0.1f64.powi(3) / 12.0, max_relative = 1e-12);
        // Saint-Venant: 0.2287 h b³ for sides as 2 : 1, 0.1406 b⁴ for a square.
        assert_relative_eq!(bar.torsion_m4, 0.2287 * 0.2 * 1e-3, max_relative = 0.04);
        assert_relative_eq!(solid(0.1, 0.1).torsion_m4, 0.1406e-4, max_relative = 0.04);
        // Bredt: 4 A² t/U of the middle line.
        let thin = SectionShape::Box {
            width_m: 0.2,
            height_m: 0.3,
            wall_m: 1e-3,
            height_axis: SIDEWAYS,
        }
        .stiffness();
        let (area, round) = (0.199 * 0.299, 2.0 * (0.199 + 0.299));
        assert_relative_eq!(
            thin.torsion_m4,
            4.0 * area * area * 1e-3 / round,
            max_relative = 1e-4
        );
        // A round bar is as stiff every way: π d⁴/64, and twice that in torsion.
        let round = BeamSection::tube(0.1, 0.05).shape.stiffness();
        assert_relative_eq!(
            round.about_y_m4,
            std::f64::consts::PI * 1e-4 / 64.0,
            max_relative = 1e-12
        );
        assert_eq!(
            (round.about_y_m4, 2.0 * round.about_y_m4),
            (round.about_z_m4, round.torsion_m4)
        );
    }

    #[test]
    fn the_height_axis_turns_the_section() {
        let to = Point3::new(1.0, 2.0, 0.0);
        let frame = tip_frame(Point3::origin(), to, Some(Vector3::new(1.0, 0.0, 2.0)));
        let [x, y, z] = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| frame.rotation * axis);
        assert_relative_eq!(x, to.coords.normalize(), epsilon = 1e-12);
        assert_relative_eq!(
            z,
            (Vector3::new(1.0, 0.0, 2.0) - x * x.x).normalize(),
            epsilon = 1e-12
        );
        assert_relative_eq!(y, z.cross(&x), epsilon = 1e-12);
    }
}
