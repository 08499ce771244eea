//! A drill's thrust, torque and cutting coefficients from an orthogonal database (Roukema & Altintas 2007, "Generalized
//! modeling of drilling vibrations, Part I", Int. J. Machine Tools & Manufacture 47(9); Altintas, Manufacturing Automation,
//! 2nd ed., ch. 2): lips and chisel edge in small elements, each an oblique edge, summed.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, TAU};

use crate::cutting::force_model::drill_geometry::feed_and_pilot_mm;
use crate::cutting::force_model::orthogonal::ObliqueEdge;
use crate::cutting::force_model::twist_drill::{LipPlace, TwistDrill};
use crate::data::{ChipFormation, CutGeometry, LinearLaw, OrthogonalSection, Tool};
use crate::{Error, Result};

/// Elements of a lip, and of half the chisel edge.
const ELEMENTS: usize = 200;

/// One element of a lip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LipElement {
    /// Where, and the edge's angles there.
    pub place: LipPlace,
    /// Cutting speed there.
    pub speed_m_per_min: f64,
    /// Chip thickness, normal to the surface that is cut.
    pub chip_mm: f64,
    /// Along the speed, normal to the cut surface, and across both, N/mm².
    pub coefficients_n_per_mm2: [f64; 3],
}

/// What one part of the edge contributes, all lips together.
#[derive(Debug, Clone, Copy, PartialEq, Default, serde::Serialize)]
pub struct DrillForces {
    /// Pushes the drill out of the hole.
    pub thrust_n: f64,
    /// Opposes the rotation.
    pub torque_nm: f64,
    /// Sum over the lips of the force towards the axis; their resultant is zero while the lips are alike.
    #[serde(skip)]
    pub inward_n: f64,
}

/// The same as coefficients of the chip's area f/N × width, the width counted along the radius: as `[lobes]` has them, N/mm².
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct DrillCoefficients {
    /// Torque over f (R² − r₀²)/2: tangential.
    pub ktc_n_per_mm2: f64,
    /// Force towards the axis over f (R − r₀).
    pub krc_n_per_mm2: f64,
    /// Thrust over f (R − r₀).
    pub kac_n_per_mm2: f64,
}

impl DrillForces {
    fn add(&mut self, other: DrillForces) {
        self.thrust_n += other.thrust_n;
        self.torque_nm += other.torque_nm;
        self.inward_n += other.inward_n;
    }

    /// As coefficients of a width from `inner_mm` to `outer_mm`.
    pub fn coefficients(&self, feed_per_rev_mm: f64, inner_mm: f64, outer_mm: f64) -> DrillCoefficients {
        let area = feed_per_rev_mm * (outer_mm - inner_mm);
        let moment = 0.5 * feed_per_rev_mm * (outer_mm * outer_mm - inner_mm * inner_mm);
        DrillCoefficients {
            ktc_n_per_mm2: 1e3 * self.torque_nm / moment,
            krc_n_per_mm2: self.inward_n / area,
            kac_n_per_mm2: self.thrust_n / area,
        }
    }
}

/// The chisel edge in the full.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChiselShare {
    /// Static rake −γ_w.
    pub rake_rad: f64,
    /// Within this radius it is pressed in like a wedge.
    pub indentation_radius_mm: f64,
    /// Cutting with that rake, from there to its end, and pressing in.
    pub forces: DrillForces,
    /// The part of the thrust that presses in.
    pub indentation_thrust_n: f64,
    /// As coefficients of its own width.
    pub coefficients: DrillCoefficients,
}

/// Forces of a drill at full engagement, predicted.
#[derive(Debug, Clone)]
pub struct DrillPrediction {
    /// The drill.
    pub drill: TwistDrill,
    /// Feed per revolution.
    pub feed_per_rev_mm: f64,
    /// Where the lips begin to cut: at the chisel edge, or at the pilot hole.
    pub inner_radius_mm: f64,
    /// From the inside out.
    pub elements: Vec<LipElement>,
    /// Of the lips, edge forces included.
    pub lips: DrillForces,
    /// Of the lips' cutting, edge forces left out.
    pub lip_coefficients: DrillCoefficients,
    /// `None` with a pilot hole that is wider than the chisel edge; in words why not, where the database allows no chip there.
    pub chisel: Option<std::result::Result<ChiselShare, String>>,
}

/// A law at a rake (°), chip thickness (mm) and cutting speed (m/min); `otherwise` where there is none.
fn at(law: Option<LinearLaw>, otherwise: f64, [rake_deg, chip_mm, speed]: [f64; 3]) -> f64 {
    law.map_or(otherwise, |[constant, per_rake, per_chip, per_speed]| {
        constant + per_rake * rake_deg + per_chip * chip_mm + per_speed * speed
    })
}

/// The database at the rake, chip thickness and speed of an element; `None` where it allows no chip.
fn coefficients(
    database: &OrthogonalSection,
    rake_rad: f64,
    inclination_rad: f64,
    chip_mm: f64,
    speed_m_per_min: f64,
) -> Option<[f64; 3]> {
    let rake_deg = rake_rad.to_degrees();
    let here = [rake_deg, chip_mm, speed_m_per_min];
    let chip = match database.chip_ratio_law {
        Some([a, b, c, d]) => ChipFormation::ChipRatio((a + b * rake_deg) * chip_mm.powf(c + d * rake_deg)),
        None => database.chip,
    };
    let friction_angle_rad = at(database.friction_angle_law, database.friction_angle_deg, here).to_radians();
    let edge = ObliqueEdge {
        shear_stress_n_per_mm2: at(database.shear_stress_law, database.shear_stress_mpa, here),
        friction_angle_rad,
        chip,
        rake_rad,
        inclination_rad,
    };
    let found = edge.coefficients()?;
    // Beyond a right angle between the resultant and the shear plane no chip is sheared.
    let normal_friction = (friction_angle_rad.tan() * inclination_rad.cos()).atan();
    let resultant = found.shear_angle_rad + normal_friction - rake_rad;
    let sound = friction_angle_rad > 0.0
        && edge.shear_stress_n_per_mm2 > 0.0
        && resultant < FRAC_PI_2
        && found.ktc_n_per_mm2 > 0.0;
    sound.then_some([found.ktc_n_per_mm2, found.krc_n_per_mm2, found.kac_n_per_mm2])
}

fn no_chip(where_: &str, rake_rad: f64) -> String {
    format!(
        "the orthogonal database allows no chip at the rake of {where_}, {:.1}°: give friction_angle_law and chip_ratio_law in \
         [orthogonal], which say how friction and chip change with the rake",
        rake_rad.to_degrees()
    )
}

impl DrillPrediction {
    /// At full engagement in a hole of this feed and pilot; `rpm`: for the cutting speed along the lips.
    ///
    /// # Errors
    /// A drill whose geometry is not complete, a pilot as wide as the drill, or angles at which the database allows no chip.
    pub fn new(tool: &Tool, geometry: &CutGeometry, rpm: f64, database: &OrthogonalSection) -> Result<Self> {
        let [feed_per_rev_mm, pilot_diameter_mm] = feed_and_pilot_mm(geometry)?;
        let drill = TwistDrill::new(tool)?;
        let pilot_mm = 0.5 * pilot_diameter_mm;
        let inner_radius_mm = drill.chisel_mm.max(pilot_mm);
        if !(inner_radius_mm < drill.radius_mm && feed_per_rev_mm > 0.0) {
            return Err(Error::computation(format!(
                "nothing left to drill: lips from {inner_radius_mm} mm to {} mm, {feed_per_rev_mm} mm per revolution",
                drill.radius_mm
            )));
        }
        let step_mm = (drill.radius_mm - inner_radius_mm) / ELEMENTS as f64;
        let (mut elements, mut lips, mut cutting) =
            (Vec::new(), DrillForces::default(), DrillForces::default());
        for i in 0..ELEMENTS {
            let place = drill.lip(inner_radius_mm + (i as f64 + 0.5) * step_mm);
            let speed_m_per_min = 1e-3 * TAU * place.radius_mm * rpm;
            let chip_mm = feed_per_rev_mm / drill.lips * place.chip_share;
            let found = coefficients(
                database,
                place.rake_rad,
                place.inclination_rad,
                chip_mm,
                speed_m_per_min,
            );
            let k = found.ok_or_else(|| {
                let at = format!("the lip at {:.2} mm from the axis", place.radius_mm);
                Error::computation(no_chip(&at, place.rake_rad))
            })?;
            // The chip's area is (f/N) dr, whatever its angles; the lip is longer than dr.
            let of_chip = lip_forces(&drill, &place, k.map(|k| k * feed_per_rev_mm * step_mm));
            let length_mm = step_mm / (drill.half_point_rad.sin() * place.web_angle_rad.cos());
            let on_edge = [
                database.edge_force_tangential_n_per_mm,
                database.edge_force_normal_n_per_mm,
                0.0,
            ];
            let of_edge = lip_forces(&drill, &place, on_edge.map(|k| k * drill.lips * length_mm));
            cutting.add(of_chip);
            lips.add(of_chip);
            lips.add(of_edge);
            elements.push(LipElement {
                place,
                speed_m_per_min,
                chip_mm,
                coefficients_n_per_mm2: k,
            });
        }
        let chisel = (pilot_mm < drill.chisel_mm)
            .then(|| chisel_edge(&drill, feed_per_rev_mm, pilot_mm, rpm, database));
        Ok(DrillPrediction {
            lip_coefficients: cutting.coefficients(feed_per_rev_mm, inner_radius_mm, drill.radius_mm),
            drill,
            feed_per_rev_mm,
            inner_radius_mm,
            elements,
            lips,
            chisel,
        })
    }

    /// Lips and chisel edge together; the lips alone where the chisel edge is not known.
    pub fn total(&self) -> DrillForces {
        let mut total = self.lips;
        if let Some(Ok(chisel)) = &self.chisel {
            total.add(chisel.forces);
        }
        total
    }

    /// What the lobes take: Ktc and Krc of the lips; Kac with the chisel edge's share of the thrust spread over the lips'
    /// width, so that the slope of the thrust is that of the whole drill in this hole.
    pub fn for_lobes(&self) -> DrillCoefficients {
        let chisel_thrust_n = match &self.chisel {
            Some(Ok(chisel)) => chisel.forces.thrust_n,
            _ => 0.0,
        };
        let area = self.feed_per_rev_mm * (self.drill.radius_mm - self.inner_radius_mm);
        DrillCoefficients {
            kac_n_per_mm2: self.lip_coefficients.kac_n_per_mm2 + chisel_thrust_n / area,
            ..self.lip_coefficients
        }
    }
}

/// Forces of all lips from those of an element along the speed, normal to the cut surface and across both (N, all lips
/// together). The cut surface's normal leans to the axis by p and the lip is inclined by i, so that
/// thrust = (Fr sin p cos ω − Fa cos p)/cos i and inward force = (Fr cos p + Fa sin p cos ω)/cos i.
fn lip_forces(drill: &TwistDrill, place: &LipPlace, [along, normal, across]: [f64; 3]) -> DrillForces {
    let (sin_p, cos_p) = drill.half_point_rad.sin_cos();
    let (cos_w, cos_i) = (place.web_angle_rad.cos(), place.inclination_rad.cos());
    DrillForces {
        thrust_n: (normal * sin_p * cos_w - across * cos_p) / cos_i,
        torque_nm: 1e-3 * along * place.radius_mm,
        inward_n: (normal * cos_p + across * sin_p * cos_w) / cos_i,
    }
}

/// The chisel edge: cutting with a rake of −γ_w + μ, μ = atan(f/2πr) the feed angle, where it has clearance, and pressed in as
/// a wedge further inside.
fn chisel_edge(
    drill: &TwistDrill,
    feed_per_rev_mm: f64,
    pilot_mm: f64,
    rpm: f64,
    database: &OrthogonalSection,
) -> std::result::Result<ChiselShare, String> {
    let wedge = drill.chisel_wedge_rad();
    let indentation_radius_mm = drill.indentation_radius_mm(feed_per_rev_mm);
    let from_mm = indentation_radius_mm.max(pilot_mm);
    let step_mm = (drill.chisel_mm - from_mm) / ELEMENTS as f64;
    let mut forces = DrillForces::default();
    for i in 0..ELEMENTS {
        let radius_mm = from_mm + (i as f64 + 0.5) * step_mm;
        let feed_angle = (feed_per_rev_mm / (TAU * radius_mm)).atan();
        let (sin_mu, cos_mu) = feed_angle.sin_cos();
        let rake_rad = feed_angle - wedge;
        let chip_mm = feed_per_rev_mm / drill.lips * cos_mu;
        let speed = 1e-3 * TAU * radius_mm * rpm / cos_mu;
        let [ktc, krc, _] = coefficients(database, rake_rad, 0.0, chip_mm, speed)
            .ok_or_else(|| no_chip("the chisel edge", rake_rad))?;
        let area = feed_per_rev_mm * cos_mu * step_mm;
        let edge_mm = drill.lips * step_mm;
        let along = ktc * area + database.edge_force_tangential_n_per_mm * edge_mm;
        let normal = krc * area + database.edge_force_normal_n_per_mm * edge_mm;
        forces.add(DrillForces {
            thrust_n: normal * cos_mu + along * sin_mu,
            torque_nm: 1e-3 * radius_mm * (along * cos_mu - normal * sin_mu),
            inward_n: 0.0,
        });
    }
    let pressed_mm = (indentation_radius_mm - pilot_mm).max(0.0);
    let depth_mm = feed_per_rev_mm / drill.lips;
    let stress = at(
        database.shear_stress_law,
        database.shear_stress_mpa,
        [-wedge.to_degrees(), depth_mm, 0.0],
    );
    let indentation_thrust_n = drill.lips * pressed_mm * indentation_n_per_mm(wedge, stress, depth_mm);
    forces.thrust_n += indentation_thrust_n;
    Ok(ChiselShare {
        rake_rad: -wedge,
        indentation_radius_mm,
        coefficients: forces.coefficients(feed_per_rev_mm, pilot_mm, drill.chisel_mm),
        forces,
        indentation_thrust_n,
    })
}

/// Force per length on a smooth wedge of half angle γ pressed by `depth_mm` into a perfectly plastic body of yield stress
/// `shear_n_per_mm2` in shear: 4 k (1 + ε) sin γ · depth/(cos γ − sin(γ − ε)), 2γ = ε + acos tan(π/4 − ε/2) (Hill 1950, The
/// Mathematical Theory of Plasticity, ch. VIII.5).
fn indentation_n_per_mm(wedge_rad: f64, shear_n_per_mm2: f64, depth_mm: f64) -> f64 {
    let e = fan_angle_rad(wedge_rad);
    let raised = wedge_rad.cos() - (wedge_rad - e).sin();
    4.0 * shear_n_per_mm2 * (1.0 + e) * wedge_rad.sin() * depth_mm / raised
}

/// ε of [`indentation_n_per_mm`]: the angle of the centred fan of slip lines.
fn fan_angle_rad(wedge_rad: f64) -> f64 {
    let excess = |e: f64| e + (FRAC_PI_4 - 0.5 * e).tan().clamp(-1.0, 1.0).acos() - 2.0 * wedge_rad;
    let [mut low, mut high] = [0.0, FRAC_PI_2];
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if excess(middle) < 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::Vector3;

    use super::*;
    use crate::cutting::made_tools::drill;

    /// Ti6Al4V as in docs/physics.md, "Reference cases".
    fn titanium() -> OrthogonalSection {
        OrthogonalSection {
            shear_stress_mpa: 613.0,
            friction_angle_deg: 22.58,
            chip: ChipFormation::ChipRatio(0.7),
            rake_deg: 12.0,
            inclination_deg: None,
            shear_stress_law: None,
            friction_angle_law: Some([19.1, 0.29, 0.0, 0.0]),
            chip_ratio_law: Some([1.755, -0.028, 0.331, -0.0082]),
            edge_force_tangential_n_per_mm: 0.0,
            edge_force_normal_n_per_mm: 0.0,
        }
    }

    fn hole(feed_per_rev_mm: f64, pilot_diameter_mm: f64) -> CutGeometry {
        CutGeometry::Drilling {
            feed_per_rev_mm,
            pilot_diameter_mm,
            hole_depth_mm: None,
        }
    }

    fn twisted() -> Tool {
        Tool {
            helix_deg: 30.0,
            ..drill()
        }
    }

    /// No web and no helix: every element is the same orthogonal edge of no rake, and the sums are products.
    #[test]
    fn without_web_and_helix_it_is_merchants_circle() {
        let plain = OrthogonalSection {
            friction_angle_law: None,
            chip_ratio_law: None,
            chip: ChipFormation::ShearAngleRad(0.5),
            ..titanium()
        };
        let tool = Tool {
            web_thickness_mm: Some(1e-9),
            helix_deg: 0.0,
            ..drill()
        };
        let found = DrillPrediction::new(&tool, &hole(0.2, 3.5), 1000.0, &plain).unwrap();
        let (tau, beta, phi) = (613.0, 22.58f64.to_radians(), 0.5f64);
        let circle = tau / phi.sin() / (phi + beta).cos();
        let (kt, kr) = (circle * beta.cos(), circle * beta.sin());
        let p = 67.5f64.to_radians();
        let (outer, inner) = (4.75, 1.75);
        assert_relative_eq!(
            found.lips.torque_nm,
            1e-3 * kt * 0.2 * (outer * outer - inner * inner) / 2.0,
            max_relative = 1e-9
        );
        assert_relative_eq!(
            found.lips.thrust_n,
            kr * p.sin() * 0.2 * (outer - inner),
            max_relative = 1e-9
        );
        assert_relative_eq!(
            found.lips.inward_n,
            kr * p.cos() * 0.2 * (outer - inner),
            max_relative = 1e-9
        );
        // In the words of the lobes: Ktc, Kfc cos κ and Kfc sin κ.
        let k = found.for_lobes();
        assert_relative_eq!(k.ktc_n_per_mm2, kt, max_relative = 1e-9);
        assert_relative_eq!(k.krc_n_per_mm2, kr * p.cos(), max_relative = 1e-9);
        assert_relative_eq!(k.kac_n_per_mm2, kr * p.sin(), max_relative = 1e-9);
        assert!(found.chisel.is_none());
    }

    /// The sums against an integration of our own in space: at each place of the lip the face, the speed and the surface that
    /// is cut are vectors, friction drags along the face in the direction of chip flow, and the shear plane's force balances
    /// it. Simpson's rule over the lip's length instead of the mean over radii.
    #[test]
    fn sums_are_the_integral_over_the_lips_in_space() {
        let (tool, database, feed, rpm) = (twisted(), titanium(), 0.12, 800.0);
        let found = DrillPrediction::new(&tool, &hole(feed, 0.0), rpm, &database).unwrap();
        let drill = found.drill;
        let p = drill.half_point_rad;
        let half_web = 0.5 * drill.web_mm;
        let x_at = |r: f64| (r * r - half_web * half_web).sqrt();
        let (from, to) = (x_at(drill.chisel_mm), x_at(drill.radius_mm));
        // Force on the tool per length of x.
        let density = |x: f64| {
            let at = Vector3::new(x, half_web, 0.0);
            let radius = at.norm();
            let edge = Vector3::new(p.sin(), 0.0, -p.cos());
            let speed = Vector3::z().cross(&at).normalize();
            let normal = edge.cross(&speed).normalize();
            let into_work = normal * normal.z.signum();
            let chip = feed / 2.0 * into_work.z;
            let inclination = (-speed.dot(&edge)).asin();
            // The face holds the edge and the helix.
            let helix =
                (-Vector3::z() - speed * (radius / drill.radius_mm * drill.helix_rad.tan())).normalize();
            let face = edge.cross(&helix).normalize();
            let face = face * -face.dot(&speed).signum(); // out of the face, to where the pressure on the tool goes
            let uphill = {
                let v = edge.cross(&face).normalize();
                v * -v.dot(&into_work).signum()
            };
            let ahead = {
                let v = into_work.cross(&edge).normalize();
                v * v.dot(&speed).signum()
            };
            let rake = (-uphill.dot(&ahead)).atan2(-uphill.dot(&into_work));
            let rake_deg = rake.to_degrees();
            let friction = (19.1 + 0.29 * rake_deg).to_radians();
            let ratio = (1.755 - 0.028 * rake_deg) * chip.powf(0.331 - 0.0082 * rake_deg);
            // Stabler: the chip flows at the inclination to the edge's normal on the face, towards where the edge trails.
            let side = edge * edge.dot(&speed).signum(); // to where it leads
            let flow = uphill * inclination.cos() - side * inclination.sin();
            let push = face * friction.cos() + flow * friction.sin();
            // Normal shear angle, and the shear plane through the edge. Its shear is along the chip's speed change.
            let shear_angle = (ratio * rake.cos() / (1.0 - ratio * rake.sin())).atan();
            let in_plane = ahead * shear_angle.cos() - into_work * shear_angle.sin();
            // Size of the force: its part in the shear plane is τ times the plane's area (the largest shear is along the force's
            // own direction in the plane, which Altintas's closed form of the book takes: the square root D).
            let plane_normal = edge.cross(&in_plane).normalize();
            let sheared = push - plane_normal * push.dot(&plane_normal);
            let plane_per_length = chip / shear_angle.sin();
            (push * (613.0 * plane_per_length / sheared.norm()), at, speed)
        };
        let steps = 4000;
        let h = (to - from) / f64::from(steps);
        let (mut thrust, mut torque, mut inward) = (0.0, 0.0, 0.0);
        for i in 0..=steps {
            let weight = match i {
                0 => 1.0,
                i if i == steps => 1.0,
                i if i % 2 == 1 => 4.0,
                _ => 2.0,
            } * h
                / 3.0
                / p.sin();
            let (force, at, speed) = density(from + h * f64::from(i));
            thrust -= 2.0 * weight * force.z;
            torque -= 2.0e-3 * weight * force.dot(&speed) * at.norm();
            inward -= 2.0 * weight * force.dot(&at.normalize());
        }
        assert_relative_eq!(found.lips.torque_nm, torque, max_relative = 2e-3);
        assert_relative_eq!(found.lips.thrust_n, thrust, max_relative = 2e-3);
        assert_relative_eq!(found.lips.inward_n, inward, max_relative = 2e-3);
    }

    /// The chisel edge of a 118° drill in titanium carries more than half of the thrust and next to no torque, as handbooks say
    /// (edge forces of Budak, Altintas & Armarego 1996); with a pilot hole it is gone; where the database allows no chip at its
    /// rake that is said, and the lips stay.
    #[test]
    fn the_chisel_edge_thrusts_and_hardly_turns() {
        let (tool, database) = (
            Tool {
                half_point_angle_deg: Some(59.0),
                ..twisted()
            },
            OrthogonalSection {
                edge_force_tangential_n_per_mm: 24.0,
                edge_force_normal_n_per_mm: 43.0,
                ..titanium()
            },
        );
        let handbook = DrillPrediction::new(&tool, &hole(0.1, 0.0), 1000.0, &database).unwrap();
        let Some(Ok(chisel)) = &handbook.chisel else {
            panic!("{:?}", handbook.chisel)
        };
        let total = handbook.total();
        let share = chisel.forces.thrust_n / total.thrust_n;
        assert!((0.5..0.7).contains(&share), "{share}");
        assert!(chisel.forces.torque_nm / total.torque_nm < 0.1);
        assert!(
            chisel.indentation_thrust_n > 0.0 && chisel.indentation_thrust_n < 0.1 * chisel.forces.thrust_n
        );
        assert!(chisel.rake_rad.to_degrees() < -50.0);
        // Worked out beside this program (Python, the same formulas written anew): N and N·m.
        assert_relative_eq!(handbook.lips.thrust_n, 398.0, max_relative = 2e-3);
        assert_relative_eq!(handbook.lips.torque_nm, 2.20, max_relative = 3e-3);
        assert_relative_eq!(
            chisel.forces.thrust_n - chisel.indentation_thrust_n,
            684.0,
            max_relative = 2e-3
        );
        assert_relative_eq!(chisel.forces.torque_nm, 0.199, max_relative = 3e-3);
        let found = DrillPrediction::new(&twisted(), &hole(0.1, 0.0), 1000.0, &titanium()).unwrap();
        let total = found.total();
        let k = found.for_lobes();
        let width = 0.1 * (found.drill.radius_mm - found.inner_radius_mm);
        assert_relative_eq!(k.kac_n_per_mm2 * width, total.thrust_n, max_relative = 1e-9);
        let piloted = DrillPrediction::new(&twisted(), &hole(0.1, 4.0), 1000.0, &titanium()).unwrap();
        assert!(piloted.chisel.is_none() && piloted.total() == piloted.lips);
        let sharp_only = OrthogonalSection {
            friction_angle_law: None,
            chip_ratio_law: None,
            friction_angle_deg: 35.0,
            chip: ChipFormation::ChipRatio(0.6),
            ..titanium()
        };
        let lips_only = DrillPrediction::new(&twisted(), &hole(0.1, 0.0), 1000.0, &sharp_only).unwrap();
        let reason = lips_only.chisel.clone().unwrap().unwrap_err();
        assert!(reason.contains("friction_angle_law"), "{reason}");
        assert_eq!(lips_only.total(), lips_only.lips);
    }

    /// Edge forces: the length of the lips (R − r₀ along the radius over sin p cos ω) times the force per length.
    #[test]
    fn edge_forces_go_with_the_length() {
        let edged = OrthogonalSection {
            edge_force_tangential_n_per_mm: 12.0,
            edge_force_normal_n_per_mm: 30.0,
            ..titanium()
        };
        let run = |database| DrillPrediction::new(&twisted(), &hole(0.1, 4.0), 1000.0, database).unwrap();
        let (sharp, blunt) = (run(&titanium()), run(&edged));
        let half_web = 0.5 * sharp.drill.web_mm;
        let x = |r: f64| (r * r - half_web * half_web).sqrt();
        // Torque: 2 × 12 N/mm ∫ r dL with dL = dx/sin p.
        let moment = |r: f64| {
            let x = x(r);
            0.5 * (x * r + half_web * half_web * (x + r).ln())
        };
        let torque = 24e-3 * (moment(4.75) - moment(2.0)) / 67.5f64.to_radians().sin();
        assert_relative_eq!(
            blunt.lips.torque_nm - sharp.lips.torque_nm,
            torque,
            max_relative = 1e-5
        );
        assert_eq!(blunt.lip_coefficients, sharp.lip_coefficients);
        assert!(blunt.lips.thrust_n > sharp.lips.thrust_n + 100.0);
    }

    /// Hill's wedge: a flat punch has a fan of a right angle (pressure 2k(1 + π/2)), a sharp wedge none (force 4kγ per depth); at a
    /// half angle of 30° the equation worked by hand gives ε = 0.3027 and 4.03 k per depth.
    #[test]
    fn the_wedges_pressure() {
        assert_relative_eq!(fan_angle_rad(FRAC_PI_2), FRAC_PI_2, max_relative = 1e-6);
        assert_relative_eq!(fan_angle_rad(30f64.to_radians()), 0.3027, max_relative = 2e-3);
        assert_relative_eq!(
            indentation_n_per_mm(30f64.to_radians(), 500.0, 0.05),
            4.03 * 25.0,
            max_relative = 2e-3
        );
        assert_relative_eq!(
            indentation_n_per_mm(1e-3, 500.0, 0.05),
            4.0 * 25.0 * 1e-3,
            max_relative = 2e-3
        );
    }
}
