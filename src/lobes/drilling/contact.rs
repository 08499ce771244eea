//! Contacts of the tool with the ground (pressure foot, clamp), coupled to the free robot: its receptance R becomes
//! R' = (I + R K)⁻¹ R, K = Σ (k + iωc) b bᵀ with b the displacement that a contact feels (receptance coupling with a
//! spring to ground: Bishop & Johnson 1960, The Mechanics of Vibration; Schmitz & Smith, Machining Dynamics, ch. 7).
//!
//! A contact acts at the tool centre point on what carries the tool: with the tool as a beam on the holder, at the beam's
//! length in front of its face. It resists no turn.

use std::f64::consts::TAU;

use nalgebra::{Matrix6, Vector3, Vector6};
use num_complex::Complex64;
use serde::Serialize;

use crate::Result;
use crate::data::{Contact, ContactDirection};
use crate::lobes::drilling::margin::moved_resonance_grid;
use crate::lobes::dynamics::robot::lobe_axes;
use crate::lobes::dynamics::tool_beam::Receptance6;
use crate::lobes::dynamics::tool_point::Holder;
use crate::robot::static_deflection::wrench;
use crate::robot::{Chain, Kinematics, PostureReport, RobotModel};

/// Directions (of the lobes' x, y, and along the tool) that a contact holds.
fn directions(direction: ContactDirection) -> &'static [usize] {
    match direction {
        ContactDirection::Axial => &[2],
        ContactDirection::Lateral => &[0, 1],
        ContactDirection::X => &[0],
        ContactDirection::Y => &[1],
    }
}

/// x, y of the lobes and the tool axis, base frame.
fn axes(tool_axis: Vector3<f64>) -> [Vector3<f64>; 3] {
    let [x, y] = lobe_axes(tool_axis);
    [x, y, tool_axis]
}

/// The holder of a tool, held by contacts.
pub struct HeldHolder<H> {
    free: H,
    contacts: Vec<Contact>,
    /// From the holder's face to the tool centre point.
    lever_m: f64,
}

impl<H: Holder> HeldHolder<H> {
    /// `lever_m`: how far the contacts lie in front of the face that `free` is the receptance of.
    pub fn new(free: H, contacts: &[Contact], lever_m: f64) -> Self {
        HeldHolder {
            free,
            contacts: contacts.to_vec(),
            lever_m,
        }
    }
}

impl<H: Holder> Holder for HeldHolder<H> {
    fn receptance(&self, frequency_hz: f64) -> Receptance6 {
        let free = self.free.receptance(frequency_hz);
        let mut ground = Receptance6::zeros();
        for contact in &self.contacts {
            let k = Complex64::new(
                contact.stiffness_n_per_m,
                TAU * frequency_hz * contact.damping_ns_per_m,
            );
            for direction in directions(contact.direction) {
                // x, its turn, y, its turn, along the tool, about it: a turn ψ moves what lies s further along by sψ.
                let mut b = Vector6::<Complex64>::zeros();
                b[2 * direction] = Complex64::ONE;
                if *direction < 2 {
                    b[2 * direction + 1] = self.lever_m.into();
                }
                ground += b * b.transpose() * k;
            }
        }
        let dynamic = Receptance6::identity() + free * ground;
        // Singular at most where an undamped structure is hit at a resonance; there the free one says as much.
        dynamic.lu().solve(&free).unwrap_or(free)
    }

    fn band_hz(&self) -> (f64, f64) {
        self.free.band_hz()
    }

    fn seed_grid_hz(&self) -> Vec<f64> {
        moved_resonance_grid(self.free.seed_grid_hz(), self.free.band_hz())
    }
}

/// Static compliance (6×6, base axes) of a tool point of this compliance when the contacts hold it.
pub fn held_compliance(
    free: &Matrix6<f64>,
    tool_axis: Vector3<f64>,
    contacts: &[Contact],
) -> Option<Matrix6<f64>> {
    let axes = axes(tool_axis);
    let mut ground = Matrix6::zeros();
    for contact in contacts {
        for direction in directions(contact.direction) {
            let b = wrench(axes[*direction], Vector3::zeros());
            ground += b * b.transpose() * contact.stiffness_n_per_m;
        }
    }
    (Matrix6::identity() + free * ground).lu().solve(free)
}

/// Natural frequencies and stiffness at a posture where the contacts hold the tool point. The springs act in parallel with those
/// of the chain; the flange and the tool point move with them.
///
/// # Errors
/// As [`PostureReport::new`].
pub fn held_report(
    robot: &RobotModel,
    kinematics: &Kinematics,
    chain: &Chain,
    contacts: &[Contact],
) -> Result<PostureReport> {
    let axes = axes(kinematics.tool_axis());
    let springs = contacts.iter().flat_map(|contact| {
        let along = directions(contact.direction).iter();
        along.map(|direction| (axes[*direction], contact.stiffness_n_per_m))
    });
    PostureReport::with_ground_springs(robot, kinematics, chain, springs)
}

/// What a contact takes of the cutting forces.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ContactForce {
    /// What people call it.
    pub name: String,
    /// Along what it holds.
    pub direction: ContactDirection,
    /// Along the tool: what the thrust takes off the foot's pressure. Across: the greatest force over the directions of the
    /// lateral load.
    pub force_n: f64,
    /// What it holds; `None`: whatever comes.
    pub preload_n: Option<f64>,
    /// The force is beyond that: the foot lifts off or slips, and what was computed with it does not hold.
    pub gives_way: bool,
}

/// Forces of the contacts; `twists`: of the tool point for each direction of the lateral load.
pub fn contact_forces(
    contacts: &[Contact],
    tool_axis: Vector3<f64>,
    twists: &[Vector6<f64>],
) -> Vec<ContactForce> {
    let axes = axes(tool_axis);
    let force = |contact: &Contact, twist: &Vector6<f64>| {
        let shift: Vector3<f64> = twist.fixed_rows::<3>(0).into_owned();
        let along = |direction: usize| shift.dot(&axes[direction]);
        let travel = match contact.direction {
            ContactDirection::Axial => -along(2),
            ContactDirection::Lateral => along(0).hypot(along(1)),
            ContactDirection::X => along(0).abs(),
            ContactDirection::Y => along(1).abs(),
        };
        contact.stiffness_n_per_m * travel
    };
    contacts
        .iter()
        .map(|contact| {
            let forces = twists.iter().map(|twist| force(contact, twist));
            let force_n = forces.fold(f64::NEG_INFINITY, f64::max);
            ContactForce {
                name: contact.title(),
                direction: contact.direction,
                force_n,
                preload_n: contact.preload_n,
                gives_way: contact.preload_n.is_some_and(|preload| force_n > preload),
            }
        })
        .collect()
}

/// How far the tool point skates across its axis while the foot is pressed on the workpiece with its preload, if nothing
/// but the free robot holds it; m. `None` without an axial preload.
pub fn skating_m(free: &Matrix6<f64>, tool_axis: Vector3<f64>, contacts: &[Contact]) -> Option<f64> {
    let axial = contacts.iter().filter(|c| c.direction == ContactDirection::Axial);
    let preload_n = axial.filter_map(|c| c.preload_n).reduce(|a, b| a + b)?;
    let shift: Vector3<f64> = (free * wrench(-tool_axis * preload_n, Vector3::zeros()))
        .fixed_rows::<3>(0)
        .into_owned();
    Some((shift - tool_axis * shift.dot(&tool_axis)).norm())
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;
    use crate::lobes::drilling::hole::{Deflection, HoleLoad};
    use crate::lobes::dynamics::tool_point::RobotHolder;
    use crate::robot::fixture::{TAP_POSTURES, irb6640};
    use crate::robot::{Attachment, AttachmentLaw, Baseline, Dual, Grip};

    fn contact(direction: ContactDirection, stiffness_n_per_m: f64, damping_ns_per_m: f64) -> Contact {
        Contact {
            name: String::new(),
            direction,
            stiffness_n_per_m,
            damping_ns_per_m,
            preload_n: None,
        }
    }

    /// A robot with dampers in its joints (no modal damping, which would follow the contact), at a tap posture.
    fn damped() -> (RobotModel, Kinematics, Chain) {
        let robot = RobotModel::new(irb6640());
        let kinematics = robot.kinematics(&TAP_POSTURES[0]).unwrap();
        let mut chain = robot.chain(&kinematics, &Baseline::nominal(&robot.spec));
        chain.modal_damping_ratio = Dual::constant(0.0);
        for element in &mut chain.elements {
            element.damping = Some(Dual::constant(1500.0));
        }
        (robot, kinematics, chain)
    }

    /// Receptance coupling against the same springs and dampers assembled into the robot's matrices, at the tool point and
    /// at a holder's face behind it.
    #[test]
    fn coupled_receptances_are_those_of_the_assembled_structure() {
        let (robot, kinematics, chain) = damped();
        let contacts = [
            contact(ContactDirection::Axial, 4e6, 3e3),
            contact(ContactDirection::Lateral, 7e5, 0.0),
            contact(ContactDirection::Y, 2e5, 900.0),
        ];
        let mut assembled = chain.clone();
        let axes = axes(kinematics.tool_axis());
        for contact in &contacts {
            for direction in directions(contact.direction) {
                let mut attach = |law, size| {
                    assembled.attachments.push(Attachment {
                        grip: Grip {
                            coordinates: Vec::new(),
                            point: Some((kinematics.tcp(), robot.flange_place(), axes[*direction])),
                        },
                        law,
                        size: Dual::constant(size),
                    });
                };
                attach(AttachmentLaw::Spring, contact.stiffness_n_per_m);
                attach(AttachmentLaw::Damper, contact.damping_ns_per_m);
            }
        }
        for behind_m in [0.0, 0.12] {
            let holder = |chain: &Chain| RobotHolder::new(&robot, &kinematics, chain, behind_m).unwrap();
            let expected = holder(&assembled);
            let held = HeldHolder::new(holder(&chain), &contacts, behind_m);
            for f in [0.5, 7.6, 13.0, 24.0, 80.0] {
                let (a, b) = (expected.receptance(f), held.receptance(f));
                assert!(
                    (a - b).norm() < 1e-9 * a.norm(),
                    "{behind_m} m, {f} Hz: {}",
                    (a - b).norm()
                );
                let free = holder(&chain).receptance(f);
                assert!(
                    (a - free).norm() > 1e-2 * free.norm(),
                    "the contacts do something at {f} Hz"
                );
            }
        }
        // The same frequencies, too.
        let held = held_report(&robot, &kinematics, &chain, &contacts).unwrap();
        let found = PostureReport::new(&robot, &kinematics, &assembled).unwrap();
        for (a, b) in held
            .natural_frequencies_hz
            .iter()
            .zip(&found.natural_frequencies_hz)
        {
            assert_relative_eq!(a, b, max_relative = 1e-9);
        }
        for i in 0..3 {
            assert_relative_eq!(
                held.tcp_stiffness_n_per_m[i],
                found.tcp_stiffness_n_per_m[i],
                max_relative = 1e-9
            );
        }
    }

    /// No stiffness changes nothing; a rigid foot leaves what a bearing along the axis leaves: C − c cᵀ/(bᵀc), c = C b.
    #[test]
    fn soft_and_rigid_limits() {
        let (robot, kinematics, chain) = damped();
        let axis = kinematics.tool_axis();
        let free = chain.tool_compliance(&robot, &kinematics).unwrap();
        let held =
            |k: f64| held_compliance(&free, axis, &[contact(ContactDirection::Axial, k, 0.0)]).unwrap();
        assert!((held(0.0) - free).norm() < 1e-15 * free.norm());
        let b = wrench(axis, Vector3::zeros());
        let c = free * b;
        let bearing = free - c * c.transpose() / b.dot(&c);
        assert!((held(1e14) - bearing).norm() < 1e-7 * free.norm());
        assert!(b.dot(&(held(1e14) * b)) < 1e-13);
        // Softer than that and stiffer than nothing: in between, and exactly two springs in parallel along the axis.
        assert_relative_eq!(
            1.0 / b.dot(&(held(3e6) * b)),
            3e6 + 1.0 / b.dot(&c),
            max_relative = 1e-12
        );
        let dynamic = |k: f64| {
            let holder = RobotHolder::new(&robot, &kinematics, &chain, 0.0).unwrap();
            let free = holder.receptance(9.0);
            let held = HeldHolder::new(holder, &[contact(ContactDirection::Axial, k, 0.0)], 0.0);
            (free, held.receptance(9.0))
        };
        let (free, soft) = dynamic(0.0);
        assert!((soft - free).norm() < 1e-14 * free.norm());
        let (free, rigid) = dynamic(1e14);
        assert!(rigid.row(4).norm() < 1e-6 * free.row(4).norm());
        assert!(rigid[(0, 0)].norm() > 1e-3 * free[(0, 0)].norm());
    }

    /// Springs along the axes: the foot takes its share of the thrust, T k/(k + K), and gives way beyond its preload; the
    /// clamp takes its share of the lateral force whatever its direction. A robot whose spring leans skates.
    #[test]
    fn what_the_contacts_take() {
        let down = -Vector3::z();
        let (robot, foot) = (1e6, 4e6);
        let free = Matrix6::from_diagonal(&Vector6::new(
            1.0 / robot,
            1.0 / robot,
            1.0 / robot,
            1e-9,
            1e-9,
            1e-9,
        ));
        let contacts = [
            Contact {
                name: "foot".into(),
                preload_n: Some(300.0),
                ..contact(ContactDirection::Axial, foot, 0.0)
            },
            contact(ContactDirection::Lateral, robot, 0.0),
        ];
        let load = HoleLoad {
            thrust_n: 400.0,
            torque_nm: 1.0,
            lateral_n: 60.0,
            source: String::new(),
        };
        let held = held_compliance(&free, down, &contacts).unwrap();
        let forces =
            |load: &HoleLoad| contact_forces(&contacts, down, &Deflection::new(&held, down, load).all);
        let [on_foot, on_clamp] = &forces(&load)[..] else {
            panic!("two contacts")
        };
        assert_relative_eq!(on_foot.force_n, 400.0 * 0.8, max_relative = 1e-12);
        assert_relative_eq!(on_clamp.force_n, 30.0, max_relative = 1e-9);
        assert!(on_foot.gives_way && !on_clamp.gives_way);
        assert_eq!(
            (on_foot.name.as_str(), on_clamp.name.as_str()),
            ("foot", "lateral contact")
        );
        let gentle = HoleLoad {
            thrust_n: 370.0,
            ..load
        };
        assert!(!forces(&gentle)[0].gives_way);
        assert_eq!(skating_m(&free, down, &contacts), Some(0.0));
        let mut leaning = free;
        (leaning[(0, 2)], leaning[(2, 0)]) = (2e-7, 2e-7);
        assert_relative_eq!(
            skating_m(&leaning, down, &contacts).unwrap(),
            6e-5,
            max_relative = 1e-12
        );
        assert_eq!(skating_m(&leaning, down, &contacts[1..]), None);
    }
}
