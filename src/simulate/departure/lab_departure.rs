//! What a departure may change, and what it sees of the structure.

use nalgebra::{DMatrix, Vector3};
use num_complex::Complex64;
use serde_json::{Map, Value};

use crate::ingest::Axis;
use crate::robot::{Chain, Element, Kinematics, RobotModel};
use crate::simulate::draw::Draws;

/// One posture, as a departure sees it.
pub struct Scene<'a> {
    /// The robot that is measured.
    pub robot: &'a RobotModel,
    /// True joint angles.
    pub kinematics: &'a Kinematics,
    /// Index among the postures, in the order of measurement.
    pub posture: usize,
    /// Number of postures of the campaign.
    pub postures: usize,
}

/// One FRF, as a departure sees it.
#[derive(Debug, Clone, Copy)]
pub struct FrfChannel {
    /// Index among all FRFs of the campaign.
    pub frf: usize,
    /// Index of the posture.
    pub posture: usize,
    /// Index of the measured point, and axis.
    pub response: (usize, Axis),
    /// Index of the point that is hit, and axis.
    pub reference: (usize, Axis),
}

/// Mass (kg, kg·m²), damping and stiffness matrices that a departure changes; coordinates as in
/// [`crate::robot::Chain::jacobian`].
pub struct Matrices {
    /// Mass matrix.
    pub mass: DMatrix<f64>,
    /// Viscous damping matrix.
    pub damping: DMatrix<f64>,
    /// Stiffness matrix.
    pub stiffness: DMatrix<f64>,
}

/// What departs from the model. `strength`: 1 as drawn, towards 0 nothing.
pub trait LabDeparture: Send + Sync {
    /// Name of its kind, as in commands and the truth file.
    fn id(&self) -> &'static str;

    /// `joint-2`, `link-5`; `None` where it has no place of its own.
    fn site(&self) -> Option<String> {
        None
    }

    /// Its quantities at this strength, for the truth file.
    fn described(&self, strength: f64) -> Map<String, Value>;

    /// Turns the joints from what the controller shows to what they are, degrees.
    fn turn_joints(&self, _strength: f64, _posture: usize, _joints_deg: &mut [f64]) {}

    /// How far the true measuring point lies from the written one, point's own body axes, m.
    fn point_offset_m(&self, _strength: f64, _point: usize) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// Changes the chain before its matrices are built.
    fn change_chain(&self, _strength: f64, _scene: &Scene, _chain: &mut Chain) {}

    /// Changes the matrices of the chain.
    fn change_matrices(&self, _strength: f64, _scene: &Scene, _chain: &Chain, _matrices: &mut Matrices) {}

    /// Loss factor of an element's stiffness (hysteretic damping).
    fn loss_factor(&self, _strength: f64, _element: &Element) -> f64 {
        0.0
    }

    /// Rotation vector of the sensor at a point against the written axes, degrees.
    fn sensor_turn_deg(&self, _strength: f64, _posture: usize, _point: usize) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// Rotation vector of the hits along an axis against that axis, degrees.
    fn hit_turn_deg(&self, _strength: f64, _posture: usize, _axis: Axis) -> Vector3<f64> {
        Vector3::zeros()
    }

    /// Factor on an FRF at `frequency_hz`.
    fn factor(&self, _strength: f64, _frequency_hz: f64, _channel: &FrfChannel) -> Complex64 {
        Complex64::new(1.0, 0.0)
    }

    /// What is added to an FRF at `frequency_hz`, m/N.
    fn added_m_per_n(&self, _strength: f64, _frequency_hz: f64, _channel: &FrfChannel) -> Complex64 {
        Complex64::ZERO
    }
}

/// `(key, value)` pairs as the truth file has them.
pub(super) fn described<const N: usize>(values: [(&str, Value); N]) -> Map<String, Value> {
    values
        .into_iter()
        .map(|(key, value)| (key.to_string(), value))
        .collect()
}

/// 1-based joint or link among `from..=to`, as far as the robot has them.
pub(super) fn pick_index(count: usize, from: usize, to: usize, draws: &mut Draws) -> usize {
    let last = to.min(count).max(1);
    let all: Vec<usize> = (from.min(last)..=last).collect();
    *draws.pick(&all)
}

/// A unit vector, any direction equally likely.
pub(super) fn direction(draws: &mut Draws) -> Vector3<f64> {
    let ((x, y), (z, _)) = (draws.normal_pair(), draws.normal_pair());
    Vector3::new(x, y, z).normalize()
}

pub(super) fn sign(draws: &mut Draws) -> f64 {
    if draws.chance(0.5) { 1.0 } else { -1.0 }
}
