//! The robot model: a specification turned into a chain at a posture.

use nalgebra::{DMatrix, DVector, Point3, Vector3, Vector6};

use super::beam;
use super::chain::{Body, Chain, Element, Place, Role, Slot};
use super::dual::Dual;
use crate::campaign::{AxesRef, BodyRef, Point};
use crate::data::RobotSpec;
use crate::ingest::Axis;
use crate::robot::kinematics::dh::Kinematics;
use crate::{InputError, Result};

/// A robot whose structure can be set up at any posture.
#[derive(Debug, Clone)]
pub struct RobotModel {
    /// What the robot file says.
    pub spec: RobotSpec,
}

/// The baseline's tunable quantities.
#[derive(Debug, Clone)]
pub struct Baseline {
    /// One a joint, N·m/rad.
    pub joint_stiffness_nm_per_rad: Vec<Dual>,
    /// One for all modes.
    pub damping_ratio: Dual,
    /// Factor on each link's mass and inertia.
    pub mass_scale: Vec<Dual>,
    /// Young's modulus of the links, Pa; `None`: rigid links.
    pub young_pa: Option<Dual>,
}

/// A common Young's modulus beyond that of any material says that no link bends, those with a modulus of their own included.
pub const NOTHING_BENDS_PA: f64 = 2e13;

/// Damping ratio a model starts from when nothing else is given.
pub const NOMINAL_DAMPING_RATIO: f64 = 0.03;

impl Baseline {
    /// What the robot file says.
    pub fn nominal(spec: &RobotSpec) -> Self {
        Baseline {
            joint_stiffness_nm_per_rad: spec
                .joints
                .iter()
                .map(|joint| Dual::constant(1.0 / joint.compliance_rad_per_nm))
                .collect(),
            damping_ratio: Dual::constant(NOMINAL_DAMPING_RATIO),
            mass_scale: vec![Dual::constant(1.0); spec.links.len()],
            young_pa: None,
        }
    }
}

impl RobotModel {
    /// The model of a robot file.
    pub fn new(spec: RobotSpec) -> Self {
        RobotModel { spec }
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.spec.joints.len()
    }

    /// Frames at a posture, joint angles in degrees as campaigns give them.
    pub fn kinematics(&self, joints_deg: &[f64]) -> Result<Kinematics> {
        if joints_deg.len() != self.joint_count() {
            return Err(InputError::new(format!(
                "{} joint angles for a robot of {} joints",
                joints_deg.len(),
                self.joint_count()
            ))
            .remedy("give one angle for each joint of the robot file")
            .into());
        }
        let q: Vec<f64> = joints_deg.iter().map(|d| d.to_radians()).collect();
        Ok(Kinematics::new(&self.spec, &q))
    }

    /// Centre of mass of link `i` (1-based), base frame.
    pub fn link_com(&self, kinematics: &Kinematics, i: usize) -> Point3<f64> {
        match self.spec.links[i - 1].com_m {
            Some(com) => kinematics.frames[i] * Point3::from(Vector3::from(com)),
            None => {
                let end = kinematics.link_ends(i).1;
                let start = if i == self.joint_count() {
                    kinematics.flange()
                } else {
                    kinematics.joint_origin(i)
                };
                nalgebra::center(&start, &end)
            }
        }
    }

    /// The chain at a posture.
    pub fn chain(&self, kinematics: &Kinematics, baseline: &Baseline) -> Chain {
        let n = self.joint_count();
        let mut elements = Vec::new();
        for i in 1..=n {
            let axis = kinematics.joint_axis(i);
            elements.push(Element {
                role: Role::Joint(i),
                place: Place::new(i, Slot::Joint),
                at: kinematics.joint_origin(i),
                directions: vec![Vector6::new(0.0, 0.0, 0.0, axis.x, axis.y, axis.z)],
                shape: DMatrix::identity(1, 1),
                stiffness: baseline.joint_stiffness_nm_per_rad[i - 1].clone(),
                damping: None,
            });
            if let Some(young) = &baseline.young_pa {
                elements.extend(self.link_halves(kinematics, i, young));
            }
        }
        let bodies = (1..=n)
            .map(|i| {
                let link = &self.spec.links[i - 1];
                let rotation = kinematics.link_rotation(i);
                Body {
                    place: Place::new(i, Slot::Body),
                    com: self.link_com(kinematics, i),
                    mass_kg: link.mass_kg,
                    inertia_kg_m2: rotation * link.inertia_tensor() * rotation.transpose(),
                    scale: baseline.mass_scale[i - 1].clone(),
                    inertia_follows_mass: true,
                }
            })
            .collect();
        Chain {
            elements,
            bodies,
            branches: Vec::new(),
            attachments: Vec::new(),
            modal_damping_ratio: baseline.damping_ratio.clone(),
        }
    }

    /// The first link whose section is not round and has its height along the link, so that it has no direction.
    pub fn link_with_lost_section(&self) -> Option<usize> {
        let kinematics = Kinematics::new(&self.spec, &vec![0.0; self.joint_count()]);
        (1..=self.joint_count()).find(|i| {
            let axis = self.spec.links[i - 1].section.and_then(|s| s.shape.height_axis());
            let (start, end) = kinematics.link_ends(*i);
            let along = end - start;
            axis.filter(|_| along.norm() > 1e-9).is_some_and(|axis| {
                let axis = kinematics.link_rotation(*i) * Vector3::from(axis);
                axis.normalize().cross(&along.normalize()).norm() <= beam::ACROSS
            })
        })
    }

    /// The two beam halves of link `i`; none where the link has no section or no length. `young`: the common modulus, of links that have
    /// no modulus of their own.
    pub fn link_halves(&self, kinematics: &Kinematics, i: usize, young: &Dual) -> Vec<Element> {
        let (start, end) = kinematics.link_ends(i);
        let length_m = (end - start).norm();
        let Some(section) = self.spec.links[i - 1].section.filter(|_| length_m > 1e-9) else {
            return Vec::new();
        };
        let middle = nalgebra::center(&start, &end);
        let shape = beam::tip_stiffness_per_pa(&section, 0.5 * length_m);
        let height_axis = section.shape.height_axis();
        let height_axis = height_axis.map(|axis| kinematics.link_rotation(i) * Vector3::from(axis));
        let young = match section.young_pa {
            Some(own) if young.value > NOTHING_BENDS_PA => young.scale(own / NOTHING_BENDS_PA),
            Some(own) => Dual::constant(own),
            None => young.clone(),
        };
        [(start, middle, Slot::FirstHalf), (middle, end, Slot::SecondHalf)]
            .into_iter()
            .map(|(from, to, slot)| {
                let rotation = beam::tip_frame(from, to, height_axis)
                    .rotation
                    .to_rotation_matrix();
                let directions = (0..6)
                    .map(|k| {
                        let axis = rotation.matrix().column(k % 3).into_owned();
                        let mut twist = Vector6::zeros();
                        twist
                            .fixed_rows_mut::<3>(if k < 3 { 0 } else { 3 })
                            .copy_from(&axis);
                        twist
                    })
                    .collect();
                Element {
                    role: Role::Beam,
                    place: Place::new(i, slot),
                    at: to,
                    directions,
                    shape: DMatrix::from_iterator(6, 6, shape.iter().copied()),
                    stiffness: young.clone(),
                    damping: None,
                }
            })
            .collect()
    }

    /// Position and place on the chain of a measurement point.
    pub fn locate(&self, kinematics: &Kinematics, point: &Point) -> (Point3<f64>, Place) {
        let local = Point3::from(Vector3::from(point.position_m));
        match point.body {
            BodyRef::Base => (local, Place::new(0, Slot::End)),
            BodyRef::Link(i) => (kinematics.frames[i] * local, Place::new(i, Slot::End)),
            BodyRef::Tool => (kinematics.tool * local, Place::new(self.joint_count(), Slot::End)),
        }
    }

    /// Unit vector, base frame, of a measurement axis at a point.
    pub fn direction(
        &self,
        kinematics: &Kinematics,
        point: &Point,
        axis: Axis,
        negative: bool,
    ) -> Vector3<f64> {
        let mut unit = Vector3::zeros();
        unit[axis.index()] = if negative { -1.0 } else { 1.0 };
        match (point.axes, point.body) {
            (AxesRef::Base, _) | (AxesRef::Body, BodyRef::Base) => unit,
            (AxesRef::Body, BodyRef::Link(i)) => kinematics.frames[i].rotation * unit,
            (AxesRef::Tool, _) | (AxesRef::Body, BodyRef::Tool) => kinematics.tool.rotation * unit,
        }
    }

    /// Displacement per coordinate of the chain at a measurement point along one of its axes.
    pub fn output_row(
        &self,
        chain: &Chain,
        kinematics: &Kinematics,
        point: &Point,
        axis: Axis,
        negative: bool,
    ) -> DVector<f64> {
        let (position, place) = self.locate(kinematics, point);
        let direction = self.direction(kinematics, point, axis, negative);
        chain.output_row(position, place, point.body == BodyRef::Tool, &direction)
    }

    /// Flange position's place on the chain.
    pub fn flange_place(&self) -> Place {
        Place::new(self.joint_count(), Slot::End)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{BeamSection, JointSpec, LinkSpec, SectionShape, ToolFrame};
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::frf::natural_frequencies_hz;
    use crate::robot::{FrfBasis, ModalBasis};
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    fn frequencies(model: &RobotModel, posture: &[f64], baseline: &Baseline) -> Vec<f64> {
        let kinematics = model.kinematics(posture).unwrap();
        natural_frequencies_hz(&model.chain(&kinematics, baseline).system(0)).unwrap()
    }

    /// One drilling target, tool turned about its axis: whole-degree angles on a 3 m arm put the four tool points
    /// within 20 mm of their centre (17 mm found) and the tool axis within 2° of the vertical (1.9° found).
    #[test]
    fn tap_postures_share_one_tool_point() {
        let model = RobotModel::new(irb6640());
        let tools: Vec<Kinematics> = TAP_POSTURES
            .iter()
            .map(|p| model.kinematics(p).unwrap())
            .collect();
        let centre = tools.iter().map(|k| k.tcp().coords).sum::<Vector3<f64>>() / 4.0;
        for kinematics in &tools {
            let off = (kinematics.tcp().coords - centre).norm();
            assert!(off < 20e-3, "{off}");
            assert!(kinematics.tool_axis().z.abs() > 2f64.to_radians().cos());
        }
    }

    /// Computed independently of this program, within 0.5 %.
    #[test]
    fn flange_stiffness_of_postures_a_and_b() {
        let model = RobotModel::new(irb6640());
        for (j3, kx, ky) in [(50.0, 1.486e6, 0.904e6), (60.0, 1.666e6, 1.039e6)] {
            let kinematics = model.kinematics(&[40.0, 5.0, j3, 40.0, -85.0, -30.0]).unwrap();
            let chain = model.chain(&kinematics, &Baseline::nominal(&model.spec));
            let c = chain
                .compliance(kinematics.flange(), model.flange_place())
                .unwrap();
            assert_relative_eq!(1.0 / c[(0, 0)], kx, max_relative = 5e-3);
            assert_relative_eq!(1.0 / c[(1, 1)], ky, max_relative = 5e-3);
        }
    }

    /// Computed independently of this program, within 0.2 %.
    #[test]
    fn rigid_link_frequencies() {
        let model = RobotModel::new(irb6640());
        let expected = [
            [7.64, 9.22, 13.66, 19.06, 24.20, 81.59],
            [6.72, 6.94, 14.43, 17.63, 23.33, 77.14],
            [6.41, 6.77, 14.86, 17.44, 23.33, 76.48],
            [7.47, 8.60, 13.74, 18.61, 23.61, 80.52],
        ];
        for (posture, expected) in TAP_POSTURES.iter().zip(expected) {
            let found = frequencies(&model, posture, &Baseline::nominal(&model.spec));
            assert_eq!(found.len(), 6);
            for (f, e) in found.iter().zip(expected) {
                assert_relative_eq!(*f, e, max_relative = 2e-3);
            }
        }
    }

    /// Computed independently: link beams at 200 GPa, configuration 1; and, with isotropic inertias, an independent finite-element
    /// program at all four postures.
    #[test]
    fn beam_frequencies_agree_with_finite_elements() {
        let mut model = RobotModel::new(irb6640());
        let mut baseline = Baseline::nominal(&model.spec);
        baseline.young_pa = Some(Dual::constant(200e9));
        let found = frequencies(&model, &TAP_POSTURES[0], &baseline);
        for (f, e) in found.iter().zip([7.47, 8.96, 13.12, 18.39, 23.40, 56.31]) {
            assert_relative_eq!(*f, e, max_relative = 1e-3);
        }
        for (link, inertia) in model.spec.links.iter_mut().zip([20.0, 30.0, 8.0, 20.0, 0.2, 2.5]) {
            link.inertia_kg_m2 = [inertia; 3];
        }
        let expected = [
            [7.630, 9.262, 13.330, 20.014],
            [6.730, 6.799, 13.905, 19.244],
            [6.416, 6.626, 14.259, 19.178],
            [7.439, 8.631, 13.410, 19.580],
        ];
        for (posture, expected) in TAP_POSTURES.iter().zip(expected) {
            for (f, e) in frequencies(&model, posture, &baseline).iter().zip(expected) {
                assert_relative_eq!(*f, e, max_relative = 1e-3);
            }
        }
    }

    /// Four straight beams of 0.5 m along x behind one nearly rigid joint each; z of the links is that of the base.
    fn straight(section: BeamSection) -> RobotModel {
        let joint = JointSpec {
            a_m: 0.5,
            compliance_rad_per_nm: 1e-16,
            ..JointSpec::default()
        };
        let link = LinkSpec {
            mass_kg: 1.0,
            inertia_kg_m2: [0.1; 3],
            section: Some(section),
            ..LinkSpec::default()
        };
        RobotModel::new(RobotSpec {
            name: "straight".into(),
            joints: vec![joint; 4],
            links: vec![link; 4],
            tool: ToolFrame::default(),
            guesses: Vec::new(),
        })
    }

    fn tip_compliance(model: &RobotModel, young_pa: f64) -> nalgebra::Matrix6<f64> {
        let kinematics = model.kinematics(&[0.0; 4]).unwrap();
        let mut baseline = Baseline::nominal(&model.spec);
        baseline.young_pa = Some(Dual::constant(young_pa));
        let chain = model.chain(&kinematics, &baseline);
        chain.compliance(kinematics.tcp(), model.flange_place()).unwrap()
    }

    /// The chain is the Euler–Bernoulli cantilever: static tip compliance L³/3EI exactly, whatever the number of links.
    #[test]
    fn straight_chain_of_beams_is_a_cantilever() {
        let section = BeamSection::tube(0.1, 0.01);
        let young = 70e9;
        let c = tip_compliance(&straight(section), young);
        let stiffness = section.shape.stiffness();
        let (l, i) = (2.0f64, stiffness.about_y_m4);
        assert_relative_eq!(c[(1, 1)], l.powi(3) / (3.0 * young * i), max_relative = 1e-6);
        assert_relative_eq!(c[(2, 2)], l.powi(3) / (3.0 * young * i), max_relative = 1e-6);
        assert_relative_eq!(c[(0, 0)], l / (young * stiffness.area_m2), max_relative = 1e-6);
        assert_relative_eq!(c[(5, 1)], l.powi(2) / (2.0 * young * i), max_relative = 1e-6);
    }

    /// A flat bar bends far more across its height than along it, wherever that points, and with moduli of its own the common one does
    /// nothing, short of one that says that nothing bends.
    #[test]
    fn sections_that_are_not_round_bend_as_they_are_turned() {
        let (width_m, height_m, wall_m) = (0.04, 0.1, 0.005);
        let (young, shear, l) = (70e9, 30e9, 2.0f64);
        let bar = |height_axis, own: bool| BeamSection {
            shape: SectionShape::Box {
                width_m,
                height_m,
                wall_m,
                height_axis,
            },
            young_pa: own.then_some(young),
            shear_pa: own.then_some(shear),
        };
        let hole = |a: f64, b: f64| (a - 2.0 * wall_m) * (b - 2.0 * wall_m).powi(3);
        let along_height = (width_m * height_m.powi(3) - hole(width_m, height_m)) / 12.0;
        let along_width = (height_m * width_m.powi(3) - hole(height_m, width_m)) / 12.0;
        let torsion = bar([0.0; 3], true).shape.stiffness().torsion_m4;
        for (height_axis, along, across) in [
            ([0.0, 0.0, 1.0], 2, 1),
            ([0.0, 3.0, 0.0], 1, 2),
            // What is along the beam does not count.
            ([5.0, 0.0, -1.0], 2, 1),
        ] {
            for (section, common, g) in [
                (bar(height_axis, true), 1e9, shear),
                (bar(height_axis, false), young, young / 2.6),
            ] {
                let c = tip_compliance(&straight(section), common);
                let bent = |i: f64| l.powi(3) / (3.0 * young * i);
                // The joints, 1e-16 rad/(N·m) each, turn about z.
                assert_relative_eq!(c[(along, along)], bent(along_height), max_relative = 1e-6);
                assert_relative_eq!(c[(across, across)], bent(along_width), max_relative = 1e-6);
                assert_relative_eq!(c[(3, 3)], l / (g * torsion), max_relative = 1e-6);
            }
        }
        let rigid = tip_compliance(&straight(bar([0.0, 0.0, 1.0], true)), 1e23);
        assert!(rigid[(1, 1)] < 1e-9 * l.powi(3) / (3.0 * young * along_width) + 1e-14);
    }

    #[test]
    fn a_height_along_the_link_is_no_direction() {
        let mut robot = straight(BeamSection::tube(0.1, 0.01));
        assert_eq!(robot.link_with_lost_section(), None);
        for (axis, lost) in [([0.0, 0.0, 1.0], None), ([1.0, 0.0, 1e-3], Some(3))] {
            robot.spec.links[2].section = Some(BeamSection {
                shape: SectionShape::General {
                    area_m2: 1e-3,
                    second_moment_y_m4: 1e-6,
                    second_moment_z_m4: 2e-6,
                    torsion_constant_m4: 1e-6,
                    height_axis: axis,
                },
                young_pa: None,
                shear_pa: None,
            });
            assert_eq!(robot.link_with_lost_section(), lost);
        }
    }

    /// FRF derivatives against central differences, with modal damping and a branch, for stiffness, damping and mass.
    #[test]
    fn sensitivities_agree_with_differences() {
        let model = RobotModel::new(irb6640());
        let kinematics = model.kinematics(&TAP_POSTURES[1]).unwrap();
        let count = 15;
        let build = |theta: &[f64], with_branch: bool| {
            let v = |i: usize| Dual::variable(theta[i], i, count);
            let baseline = Baseline {
                joint_stiffness_nm_per_rad: (0..6).map(|i| v(i).exp()).collect(),
                damping_ratio: v(6).exp(),
                mass_scale: (0..6).map(|i| v(7 + i)).collect(),
                young_pa: None,
            };
            let mut chain = model.chain(&kinematics, &baseline);
            if with_branch {
                chain.branches.push(crate::robot::Branch {
                    place: Place::new(3, Slot::Body),
                    at: model.link_com(&kinematics, 3),
                    directions: vec![Vector3::x(), Vector3::y()],
                    mass_kg: v(13),
                    stiffness_n_per_m: v(14),
                    damping_ns_per_m: &v(14) * &Dual::constant(1e-3),
                    carries_tool_point: false,
                });
            }
            let rows: Vec<_> = [Vector3::x(), Vector3::y(), Vector3::z()]
                .iter()
                .map(|d| chain.output_row(kinematics.tcp(), model.flange_place(), true, d))
                .collect();
            FrfBasis::new(&chain.system(count), &rows).unwrap()
        };
        let mut theta: Vec<f64> = model
            .spec
            .joints
            .iter()
            .map(|j| -j.compliance_rad_per_nm.ln())
            .collect();
        theta.push(0.03f64.ln());
        theta.extend([1.02, 0.97, 1.01, 1.03, 0.99, 1.0, 9.0, 2e4]);
        for with_branch in [false, true] {
            let basis = build(&theta, with_branch);
            let omega = std::f64::consts::TAU * 13.0;
            let mut found = Vec::new();
            let rate = num_complex::Complex64::new(0.0, omega);
            basis
                .solve_lines_with_slopes(&[rate], &[2, 0], |_, _, slopes| {
                    let of_first = slopes.along(0);
                    found.extend((0..count).map(|p| [0, 1, 2].map(|out| of_first(p, out))));
                    Ok(())
                })
                .unwrap();
            for (p, slopes) in found.iter().enumerate() {
                let h = 1e-6 * theta[p].abs();
                let shifted = |sign: f64| {
                    let mut t = theta.clone();
                    t[p] += sign * h;
                    build(&t, with_branch)
                };
                for (out, slope) in slopes.iter().enumerate() {
                    let difference = (shifted(1.0).receptance_at(omega, out, 0).unwrap()
                        - shifted(-1.0).receptance_at(omega, out, 0).unwrap())
                        / (2.0 * h);
                    let scale = basis.receptance_at(omega, 0, 0).unwrap().norm() / theta[p].abs();
                    assert!(
                        (slope - difference).norm() < 1e-6 * scale,
                        "{p} {out}: {slope} {difference}"
                    );
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Rigid links: stiffness = (J Kθ⁻¹ Jᵀ)⁻¹ with the geometric Jacobian; K positive definite and every
        /// frequency real at random postures; receptances reciprocal.
        #[test]
        fn random_postures(q in proptest::collection::vec(-170.0f64..170.0, 6), f in 3.0f64..90.0) {
            let model = RobotModel::new(irb6640());
            let kinematics = model.kinematics(&q).unwrap();
            let baseline = Baseline::nominal(&model.spec);
            let chain = model.chain(&kinematics, &baseline);
            let c = chain.compliance(kinematics.tcp(), model.flange_place()).unwrap();
            let mut expected = nalgebra::Matrix6::zeros();
            for i in 1..=6 {
                let z = kinematics.joint_axis(i);
                let v = z.cross(&(kinematics.tcp() - kinematics.joint_origin(i)));
                let column = Vector6::new(v.x, v.y, v.z, z.x, z.y, z.z);
                expected += column * column.transpose() * model.spec.joints[i - 1].compliance_rad_per_nm;
            }
            prop_assert!((c - expected).norm() < 1e-12 * expected.norm().max(1e-9));

            let mut flexible = Baseline::nominal(&model.spec);
            flexible.young_pa = Some(Dual::constant(200e9));
            for baseline in [&baseline, &flexible] {
                let chain = model.chain(&kinematics, baseline);
                let system = chain.system(0);
                prop_assert!(system.stiffness.clone().cholesky().is_some());
                let modes = ModalBasis::new(&system.stiffness, &system.mass).unwrap();
                prop_assert!(modes.inverse_omega2.iter().all(|mu| *mu >= 0.0));
                prop_assert!(modes.natural_frequencies_hz().len() >= 6);
                let rows: Vec<_> = [Vector3::x(), Vector3::y(), Vector3::z()]
                    .iter()
                    .map(|d| chain.output_row(kinematics.tcp(), model.flange_place(), true, d))
                    .collect();
                let basis = FrfBasis::new(&system, &rows).unwrap();
                let omega = std::f64::consts::TAU * f;
                let (xy, yx) = (basis.receptance_at(omega, 0, 1).unwrap(), basis.receptance_at(omega, 1, 0).unwrap());
                prop_assert!((xy - yx).norm() <= 1e-10 * (xy.norm() + 1e-12));
                // The modal sum is the inverse of the dynamic stiffness.
                let static_x = basis.receptance_at(0.0, 0, 0).unwrap().re;
                let static_c = chain.compliance(kinematics.tcp(), model.flange_place()).unwrap()[(0, 0)];
                prop_assert!((static_x - static_c).abs() < 1e-9 * static_c);
            }
        }
    }
}
