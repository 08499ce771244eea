//! Departures of the robot itself.

use nalgebra::{DMatrix, DVector, Point3, Vector3, Vector6};
use serde_json::{Map, Value, json};

use super::lab_departure::{LabDeparture, Matrices, Scene, described, direction, pick_index, sign};
use crate::data::RobotSpec;
use crate::robot::{Body, Branch, Chain, Dual, Element, Place, Role, Slot};
use crate::simulate::draw::Draws;

const TAU: f64 = std::f64::consts::TAU;

/// Damping by a loss factor instead of a damping ratio: at resonance the same, elsewhere not.
pub struct Hysteretic {
    /// Loss factor over twice the damping ratio that it replaces.
    ratio: f64,
}

impl Hysteretic {
    pub fn draw(_robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Box::new(Hysteretic {
            ratio: draws.log_uniform(0.7, 1.4),
        })
    }
}

/// The damping ratio that robots of the lab have on average: what a loss factor stands in for.
const DAMPING_RATIO: f64 = 0.03;

impl LabDeparture for Hysteretic {
    fn id(&self) -> &'static str {
        "hysteretic-damping"
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([
            ("loss_factor", json!(2.0 * DAMPING_RATIO * self.ratio * strength)),
            ("viscous_share", json!(1.0 - strength)),
        ])
    }

    fn change_chain(&self, strength: f64, _scene: &Scene, chain: &mut Chain) {
        chain.modal_damping_ratio = chain.modal_damping_ratio.scale(1.0 - strength);
    }

    fn loss_factor(&self, strength: f64, _element: &Element) -> f64 {
        2.0 * DAMPING_RATIO * self.ratio * strength
    }
}

/// Each joint has a loss factor of its own on top of the robot's damping.
pub struct JointLossFactors {
    loss_factors: Vec<f64>,
}

impl JointLossFactors {
    pub fn draw(robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Box::new(JointLossFactors {
            loss_factors: robot
                .joints
                .iter()
                .map(|_| draws.log_uniform(0.02, 0.3))
                .collect(),
        })
    }
}

impl LabDeparture for JointLossFactors {
    fn id(&self) -> &'static str {
        "joint-loss-factors"
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        let factors: Vec<f64> = self.loss_factors.iter().map(|f| strength * f).collect();
        described([("loss_factors", json!(factors))])
    }

    fn loss_factor(&self, strength: f64, element: &Element) -> f64 {
        match element.role {
            Role::Joint(i) => strength * self.loss_factors[i - 1],
            _ => 0.0,
        }
    }
}

/// One mass on a spring.
#[derive(Clone)]
struct Resonator {
    axis: Vector3<f64>,
    mass_kg: f64,
    frequency_hz: f64,
    damping_ratio: f64,
}

impl Resonator {
    fn draw(axis: usize, draws: &mut Draws) -> Self {
        let mut along = Vector3::zeros();
        along[axis] = 1.0;
        Resonator {
            axis: along,
            mass_kg: draws.log_uniform(4.0, 12.0),
            frequency_hz: draws.log_uniform(8.0, 40.0),
            damping_ratio: draws.log_uniform(0.02, 0.08),
        }
    }
}

/// Masses on springs where or as the library does not hang them.
pub struct Resonators {
    id: &'static str,
    link: usize,
    all: Vec<Resonator>,
}

impl Resonators {
    /// Two on one link.
    pub fn draw_two(robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        let link = pick_index(robot.links.len(), 2, 4, draws);
        let first = Resonator::draw(*draws.pick(&[0, 1, 2]), draws);
        let mut second = Resonator::draw(*draws.pick(&[0, 1, 2]), draws);
        // Apart from the first, else the two are one.
        second.frequency_hz = first.frequency_hz * draws.uniform(1.3, 2.0);
        Box::new(Resonators {
            id: "two-resonators",
            link,
            all: vec![first, second],
        })
    }

    /// One on a link where the library has none.
    pub fn draw_elsewhere(robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        let link = match draws.chance(0.4) {
            true => 1,
            false => pick_index(robot.links.len(), 5, 6, draws),
        };
        let mut one = Resonator::draw(*draws.pick(&[0, 1, 2]), draws);
        if link == 1 {
            // The first link turns about the base axis only, on a short arm: what is to be seen there must be heavy and
            // swing along the turn (its z).
            one.axis = Vector3::z();
            one.mass_kg *= 10.0;
        }
        Box::new(Resonators {
            id: "resonator-elsewhere",
            link,
            all: vec![one],
        })
    }

    /// One that swings both ways, at two frequencies.
    pub fn draw_two_axes(robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        let link = pick_index(robot.links.len(), 2, 4, draws);
        let free = *draws.pick(&[0_usize, 1, 2]);
        let first = Resonator::draw((free + 1) % 3, draws);
        let mut second = Resonator::draw((free + 2) % 3, draws);
        second.mass_kg = first.mass_kg;
        Box::new(Resonators {
            id: "resonator-two-axes",
            link,
            all: vec![first, second],
        })
    }
}

impl LabDeparture for Resonators {
    fn id(&self) -> &'static str {
        self.id
    }

    fn site(&self) -> Option<String> {
        Some(format!("link-{}", self.link))
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        let of = |value: fn(&Resonator) -> f64| json!(self.all.iter().map(value).collect::<Vec<_>>());
        let masses: Vec<f64> = self.all.iter().map(|r| strength * r.mass_kg).collect();
        let axes: Vec<&[f64]> = self.all.iter().map(|r| r.axis.as_slice()).collect();
        described([
            ("mass_kg", json!(masses)),
            ("frequency_hz", of(|r| r.frequency_hz)),
            ("damping_ratio", of(|r| r.damping_ratio)),
            ("axis", json!(axes)),
        ])
    }

    fn change_chain(&self, strength: f64, scene: &Scene, chain: &mut Chain) {
        let (start, end) = scene.kinematics.link_ends(self.link);
        for one in &self.all {
            let omega = TAU * one.frequency_hz;
            let mass_kg = strength * one.mass_kg;
            chain.branches.push(Branch {
                place: Place::new(self.link, Slot::Body),
                at: nalgebra::center(&start, &end),
                directions: vec![scene.kinematics.frames[self.link].rotation * one.axis],
                mass_kg: Dual::constant(mass_kg),
                stiffness_n_per_m: Dual::constant(mass_kg * omega * omega),
                damping_ns_per_m: Dual::constant(2.0 * one.damping_ratio * mass_kg * omega),
                carries_tool_point: false,
            });
        }
    }
}

/// A spring and a damper from the robot to the ground.
pub struct Clamp {
    id: &'static str,
    /// `None`: at the tool point.
    link: Option<usize>,
    direction: Vector3<f64>,
    stiffness_n_per_m: f64,
    damping_ns_per_m: f64,
}

impl Clamp {
    /// The tool touches table or workpiece.
    pub fn draw_tool(_robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Self::draw("clamp-to-table", None, [1e5, 1e6], 5e-4, draws)
    }

    /// A hose pack from a link to the ceiling.
    pub fn draw_hose(robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        let link = pick_index(robot.links.len(), 3, 5, draws);
        Self::draw("hose-to-ground", Some(link), [3e4, 3e5], 1e-2, draws)
    }

    fn draw(
        id: &'static str,
        link: Option<usize>,
        stiffness: [f64; 2],
        damping_time_s: f64,
        draws: &mut Draws,
    ) -> Box<dyn LabDeparture> {
        let stiffness_n_per_m = draws.log_uniform(stiffness[0], stiffness[1]);
        Box::new(Clamp {
            id,
            link,
            direction: direction(draws),
            stiffness_n_per_m,
            damping_ns_per_m: damping_time_s * stiffness_n_per_m,
        })
    }
}

impl LabDeparture for Clamp {
    fn id(&self) -> &'static str {
        self.id
    }

    fn site(&self) -> Option<String> {
        self.link.map(|link| format!("link-{link}"))
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([
            ("direction", json!(self.direction.as_slice())),
            ("stiffness_n_per_m", json!(strength * self.stiffness_n_per_m)),
            ("damping_ns_per_m", json!(strength * self.damping_ns_per_m)),
        ])
    }

    fn change_matrices(&self, strength: f64, scene: &Scene, chain: &Chain, matrices: &mut Matrices) {
        let (point, place) = match self.link {
            None => (scene.kinematics.tcp(), scene.robot.flange_place()),
            Some(link) => (scene.kinematics.link_ends(link).1, Place::new(link, Slot::End)),
        };
        let row: DVector<f64> = chain.output_row(point, place, self.link.is_none(), &self.direction);
        let square = &row * row.transpose() * strength;
        matrices.stiffness += &square * self.stiffness_n_per_m;
        matrices.damping += square * self.damping_ns_per_m;
    }
}

/// An element in series with a joint's spring about the same axis.
fn behind_joint(joint: usize, chain: &Chain, stiffness: f64, damping: Option<f64>) -> Option<Element> {
    let own = chain.elements.iter().find(|e| e.role == Role::Joint(joint))?;
    Some(Element {
        // Not the gear's own spring: what changes that must not touch this one.
        role: Role::Bearing,
        stiffness: Dual::constant(stiffness),
        damping: damping.map(Dual::constant),
        ..own.clone()
    })
}

/// The position loop behind one gear gives way: rotor and servo spring in series with the gear.
pub struct SoftServo {
    joint: usize,
    /// Servo stiffness over that of the gear.
    ratio: f64,
    /// Rotor on the servo's spring.
    frequency_hz: f64,
    damping_ratio: f64,
    gear_nm_per_rad: f64,
}

impl SoftServo {
    pub fn draw(robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        let joint = pick_index(robot.joints.len(), 1, 4, draws);
        Box::new(SoftServo {
            joint,
            ratio: draws.log_uniform(1.0, 3.0),
            frequency_hz: draws.log_uniform(8.0, 30.0),
            damping_ratio: draws.uniform(0.3, 0.8),
            gear_nm_per_rad: 1.0 / robot.joints[joint - 1].compliance_rad_per_nm,
        })
    }

    fn stiffness(&self, strength: f64) -> f64 {
        self.gear_nm_per_rad * self.ratio / strength
    }

    /// About the joint's axis, gear ratio counted in, kg·m².
    fn inertia(&self, strength: f64) -> f64 {
        self.stiffness(strength) / (TAU * self.frequency_hz).powi(2)
    }
}

impl LabDeparture for SoftServo {
    fn id(&self) -> &'static str {
        "soft-servo"
    }

    fn site(&self) -> Option<String> {
        Some(format!("joint-{}", self.joint))
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([
            ("servo_nm_per_rad", json!(self.stiffness(strength))),
            ("rotor_kg_m2", json!(self.inertia(strength))),
            ("frequency_hz", json!(self.frequency_hz)),
            ("damping_ratio", json!(self.damping_ratio)),
        ])
    }

    fn change_chain(&self, strength: f64, _scene: &Scene, chain: &mut Chain) {
        let momentum = self.inertia(strength) * TAU * self.frequency_hz;
        let damping = Some(2.0 * self.damping_ratio * momentum);
        chain
            .elements
            .extend(behind_joint(self.joint, chain, self.stiffness(strength), damping));
    }

    fn change_matrices(&self, strength: f64, _scene: &Scene, chain: &Chain, matrices: &mut Matrices) {
        // The rotor turns with the servo's coordinate alone: it is geared, its own turning on the arm is negligible.
        let own = |e: &Element| {
            e.role == Role::Bearing
                && e.stiffness.value == self.stiffness(strength)
                && e.place.link == self.joint
        };
        let mut column = 0;
        for element in &chain.elements {
            if own(element) {
                matrices.mass[(column, column)] += self.inertia(strength);
            }
            column += element.directions.len();
        }
    }
}

/// Torque that gravity puts on a joint, N·m.
fn gravity_torque_nm(joint: usize, scene: &Scene, chain: &Chain) -> f64 {
    let (axis, origin) = (
        scene.kinematics.joint_axis(joint),
        scene.kinematics.joint_origin(joint),
    );
    let behind = chain.bodies.iter().filter(|b| b.place.link >= joint);
    behind
        .map(|b| {
            let weight = Vector3::new(0.0, 0.0, -9.81 * b.mass_kg * b.scale.value);
            (b.com - origin).cross(&weight).dot(&axis)
        })
        .sum()
}

fn scale_joint(joint: usize, factor: f64, chain: &mut Chain) {
    for element in chain.elements.iter_mut().filter(|e| e.role == Role::Joint(joint)) {
        element.stiffness = element.stiffness.scale(factor);
    }
}

/// Gears with lost motion: soft while unloaded, and no stiffer than themselves once the teeth lie on.
pub struct GearSaturation {
    loss: f64,
    torque_nm: f64,
}

impl GearSaturation {
    pub fn draw(_robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Box::new(GearSaturation {
            loss: draws.uniform(0.3, 0.6),
            torque_nm: draws.log_uniform(30.0, 300.0),
        })
    }
}

impl LabDeparture for GearSaturation {
    fn id(&self) -> &'static str {
        "gear-saturation"
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([
            ("stiffness_lost_unloaded", json!(strength * self.loss)),
            ("torque_nm", json!(self.torque_nm)),
        ])
    }

    fn change_chain(&self, strength: f64, scene: &Scene, chain: &mut Chain) {
        for joint in 1..=scene.robot.joint_count() {
            let load = gravity_torque_nm(joint, scene, chain).abs() / self.torque_nm;
            scale_joint(joint, 1.0 - strength * self.loss * (-load).exp(), chain);
        }
    }
}

/// A joint's bearing gives way across its axis without tilting.
pub struct RadialBearing {
    joint: usize,
    stiffness_n_per_m: f64,
}

impl RadialBearing {
    pub fn draw(robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Box::new(RadialBearing {
            joint: pick_index(robot.joints.len(), 2, 5, draws),
            stiffness_n_per_m: draws.log_uniform(2e6, 8e6),
        })
    }
}

impl LabDeparture for RadialBearing {
    fn id(&self) -> &'static str {
        "bearing-radial"
    }

    fn site(&self) -> Option<String> {
        Some(format!("joint-{}", self.joint))
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([("radial_n_per_m", json!(self.stiffness_n_per_m / strength))])
    }

    fn change_chain(&self, strength: f64, scene: &Scene, chain: &mut Chain) {
        let rotation = scene.kinematics.joint_frame(self.joint).rotation;
        let across = [Vector3::x(), Vector3::y()].map(|a| {
            let v = rotation * a;
            Vector6::new(v.x, v.y, v.z, 0.0, 0.0, 0.0)
        });
        chain.elements.push(Element {
            role: Role::Bearing,
            place: Place::new(self.joint, Slot::Joint),
            at: scene.kinematics.joint_origin(self.joint),
            directions: across.to_vec(),
            shape: DMatrix::identity(2, 2),
            stiffness: Dual::constant(self.stiffness_n_per_m / strength),
            damping: None,
        });
    }
}

/// Stiffness and damping change from posture to posture as they were measured: the robot warms up.
pub struct Drift {
    stiffness: f64,
    damping: f64,
}

impl Drift {
    pub fn draw(_robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Box::new(Drift {
            stiffness: sign(draws) * draws.log_uniform(0.05, 0.2),
            damping: sign(draws) * draws.log_uniform(0.1, 0.4),
        })
    }
}

impl LabDeparture for Drift {
    fn id(&self) -> &'static str {
        "drift-with-order"
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([
            ("stiffness_from_first_to_last", json!(strength * self.stiffness)),
            ("damping_from_first_to_last", json!(strength * self.damping)),
        ])
    }

    fn change_chain(&self, strength: f64, scene: &Scene, chain: &mut Chain) {
        let last = scene.postures.saturating_sub(1).max(1);
        let along = strength * scene.posture as f64 / last as f64;
        for joint in 1..=scene.robot.joint_count() {
            scale_joint(joint, 1.0 + along * self.stiffness, chain);
        }
        chain.modal_damping_ratio = chain.modal_damping_ratio.scale(1.0 + along * self.damping);
    }
}

/// The floor under the pedestal moves as a mass on a spring along one direction.
pub struct FloorMode {
    direction: Vector3<f64>,
    mass_kg: f64,
    frequency_hz: f64,
    damping_ratio: f64,
}

impl FloorMode {
    pub fn draw(_robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Box::new(FloorMode {
            direction: direction(draws),
            mass_kg: draws.log_uniform(1000.0, 4000.0),
            frequency_hz: draws.log_uniform(12.0, 40.0),
            damping_ratio: draws.log_uniform(0.01, 0.05),
        })
    }
}

impl LabDeparture for FloorMode {
    fn id(&self) -> &'static str {
        "floor-mode"
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([
            ("direction", json!(self.direction.as_slice())),
            ("mass_kg", json!(self.mass_kg / strength)),
            ("frequency_hz", json!(self.frequency_hz)),
            ("damping_ratio", json!(self.damping_ratio)),
        ])
    }

    fn change_chain(&self, strength: f64, _scene: &Scene, chain: &mut Chain) {
        let (mass_kg, omega) = (self.mass_kg / strength, TAU * self.frequency_hz);
        let v = self.direction;
        chain.elements.push(Element {
            role: Role::Base,
            place: Place::new(0, Slot::Joint),
            at: Point3::origin(),
            directions: vec![Vector6::new(v.x, v.y, v.z, 0.0, 0.0, 0.0)],
            shape: DMatrix::identity(1, 1),
            stiffness: Dual::constant(mass_kg * omega * omega),
            damping: Some(Dual::constant(2.0 * self.damping_ratio * mass_kg * omega)),
        });
        chain.bodies.push(Body {
            place: Place::new(0, Slot::Body),
            com: Point3::origin(),
            mass_kg,
            inertia_kg_m2: nalgebra::Matrix3::zeros(),
            scale: Dual::constant(1.0),
            inertia_follows_mass: true,
        });
    }
}

/// A spring about joint 2 (of a counterbalance cylinder) whose stiffness follows the cylinder's lever arm.
pub struct CounterbalanceCylinder {
    share: f64,
    phase_rad: f64,
}

impl CounterbalanceCylinder {
    pub fn draw(_robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Box::new(CounterbalanceCylinder {
            share: draws.uniform(0.2, 0.5),
            phase_rad: draws.uniform(0.0, TAU),
        })
    }
}

impl LabDeparture for CounterbalanceCylinder {
    fn id(&self) -> &'static str {
        "counterbalance"
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([
            ("share_of_joint_2", json!(strength * self.share)),
            ("phase_rad", json!(self.phase_rad)),
        ])
    }

    fn change_chain(&self, strength: f64, scene: &Scene, chain: &mut Chain) {
        // The lever arm turns with the second link.
        let joint = 2.min(scene.robot.joint_count());
        let (start, end) = scene.kinematics.link_ends(joint);
        let along = end - start;
        let angle = along.z.atan2(along.x.hypot(along.y));
        let lever = (2.0 * angle + self.phase_rad).cos();
        scale_joint(joint, 1.0 + strength * self.share * lever, chain);
    }
}
