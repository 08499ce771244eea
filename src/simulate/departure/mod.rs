//! Physics and setups that neither the library of effects nor the baseline model can express, each with a strength that
//! can be made as faint as wanted.
//!
//! Unlike [`super::foreign`], which is written as effects of the model, a departure acts where the fits have no hands:
//! on the true posture, on the dynamic stiffness at each frequency, on single channels and single hits. `simulate::world`
//! computes the FRFs that follow.

use nalgebra::{DMatrix, Vector3};
use num_complex::Complex64;
use serde_json::{Map, Value};

use super::draw::{Draws, Purpose};
use crate::data::RobotSpec;
use crate::ingest::Axis;
use crate::robot::{Chain, Element, Kinematics, RobotModel};

mod measurement;
mod mechanics;

pub(super) use measurement::high_pass;

/// One posture, as a departure sees it.
pub struct Scene<'a> {
    pub robot: &'a RobotModel,
    /// True joint angles.
    pub kinematics: &'a Kinematics,
    /// Index among the postures, in the order of measurement.
    pub posture: usize,
    pub postures: usize,
}

/// One FRF, as a departure sees it.
#[derive(Debug, Clone, Copy)]
pub struct Channel {
    /// Index among all FRFs of the campaign.
    pub frf: usize,
    pub posture: usize,
    pub response: (usize, Axis),
    pub reference: (usize, Axis),
}

/// Mass (kg, kg·m²), damping and stiffness matrices that a departure changes; coordinates as in
/// [`crate::robot::Chain::jacobian`].
pub struct Matrices {
    pub mass: DMatrix<f64>,
    pub damping: DMatrix<f64>,
    pub stiffness: DMatrix<f64>,
}

/// What departs from the model. `strength`: 1 as drawn, towards 0 nothing.
pub trait Departure: Send + Sync {
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

    fn change_chain(&self, _strength: f64, _scene: &Scene, _chain: &mut Chain) {}

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
    fn factor(&self, _strength: f64, _frequency_hz: f64, _channel: &Channel) -> Complex64 {
        Complex64::new(1.0, 0.0)
    }

    /// What is added to an FRF at `frequency_hz`, m/N.
    fn added_m_per_n(&self, _strength: f64, _frequency_hz: f64, _channel: &Channel) -> Complex64 {
        Complex64::ZERO
    }
}

/// Draws one kind of departure.
type Draw = fn(&RobotSpec, &mut Draws) -> Box<dyn Departure>;

/// Every kind with how it is drawn. Random campaigns choose by position in lists of their own: kinds may be added here.
const KINDS: [(&str, Draw); 18] = [
    ("encoder-offset", measurement::EncoderOffset::draw),
    ("tool-point-off", measurement::ToolPointOff::draw),
    ("sensor-high-pass", measurement::HighPass::draw),
    ("gain-of-one-direction", measurement::HitGain::draw),
    ("table-mode", measurement::TableMode::draw),
    ("hysteretic-damping", mechanics::Hysteretic::draw),
    ("joint-loss-factors", mechanics::JointLossFactors::draw),
    ("two-resonators", mechanics::Resonators::draw_two),
    ("resonator-elsewhere", mechanics::Resonators::draw_elsewhere),
    ("resonator-two-axes", mechanics::Resonators::draw_two_axes),
    ("clamp-to-table", mechanics::Clamp::draw_tool),
    ("hose-to-ground", mechanics::Clamp::draw_hose),
    ("soft-servo", mechanics::SoftServo::draw),
    ("gear-saturation", mechanics::GearSaturation::draw),
    ("bearing-radial", mechanics::RadialBearing::draw),
    ("drift-with-order", mechanics::Drift::draw),
    ("floor-mode", mechanics::FloorMode::draw),
    ("counterbalance", mechanics::Counterbalance::draw),
];

/// Ids of all kinds.
pub fn ids() -> impl Iterator<Item = &'static str> {
    KINDS.iter().map(|(id, _)| *id)
}

/// The departure of this id as the seed draws it; `None` if there is no such kind.
pub fn drawn(id: &str, robot: &RobotSpec, seed: u64) -> Option<Box<dyn Departure>> {
    let (_, draw) = KINDS.iter().find(|(known, _)| *known == id)?;
    Some(draw(robot, &mut Draws::new(seed, Purpose::Departure)))
}

/// A departure in the lab.
pub struct Departed {
    pub departure: Box<dyn Departure>,
    pub strength: f64,
}

/// `(key, value)` pairs as the truth file has them.
fn described<const N: usize>(values: [(&str, Value); N]) -> Map<String, Value> {
    values
        .into_iter()
        .map(|(key, value)| (key.to_string(), value))
        .collect()
}

/// 1-based joint or link among `from..=to`, as far as the robot has them.
fn pick_index(count: usize, from: usize, to: usize, draws: &mut Draws) -> usize {
    let last = to.min(count).max(1);
    let all: Vec<usize> = (from.min(last)..=last).collect();
    *draws.pick(&all)
}

/// A unit vector, any direction equally likely.
fn direction(draws: &mut Draws) -> Vector3<f64> {
    let ((x, y), (z, _)) = (draws.normal_pair(), draws.normal_pair());
    Vector3::new(x, y, z).normalize()
}

fn sign(draws: &mut Draws) -> f64 {
    if draws.chance(0.5) { 1.0 } else { -1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::fixture::irb6640;

    #[test]
    fn every_kind_is_what_its_name_says_and_is_drawn_by_its_seed() {
        for id in ids() {
            let one = drawn(id, &irb6640(), 5).unwrap();
            assert_eq!(one.id(), id);
            let same = drawn(id, &irb6640(), 5).unwrap();
            assert_eq!(one.described(0.3), same.described(0.3));
            let other = drawn(id, &irb6640(), 6).unwrap();
            assert_ne!(one.described(0.3), other.described(0.3), "{id}");
            assert!(!one.described(1.0).is_empty());
        }
        assert!(drawn("no-such-thing", &irb6640(), 1).is_none());
    }
}
