//! Physics and setups that the baseline model cannot express, each with a strength that can be made as faint as wanted. Most
//! have no name in the library of effects; for the others (a loss factor, a drive, a contact, a bearing, a drift) this is the
//! program apart from the model on which the library's verdict can be tried.
//!
//! Unlike [`super::foreign`], which is written as effects of the model, a departure acts where the fits have no parameters:
//! on the true posture, on the dynamic stiffness at each frequency, on single channels and single hits. `simulate::world`
//! computes the FRFs that follow.

use super::draw::{Draws, Purpose};
use crate::data::RobotSpec;

mod lab_departure;
mod measurement;
mod mechanics;

pub use lab_departure::{FrfChannel, LabDeparture, Matrices, Scene};
pub(super) use measurement::high_pass;

/// Draws one kind of departure.
type Draw = fn(&RobotSpec, &mut Draws) -> Box<dyn LabDeparture>;

/// Every kind with how it is drawn. Random campaigns choose by position in lists of their own: kinds may be added here.
const KINDS: [(&str, Draw); 18] = [
    ("encoder-offset", measurement::ShiftedEncoder::draw),
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
    ("counterbalance", mechanics::CounterbalanceCylinder::draw),
];

/// Ids of all kinds.
pub fn ids() -> impl Iterator<Item = &'static str> {
    KINDS.iter().map(|(id, _)| *id)
}

/// The departure of this id as the seed draws it; `None` if there is no such kind.
pub fn drawn(id: &str, robot: &RobotSpec, seed: u64) -> Option<Box<dyn LabDeparture>> {
    let (_, draw) = KINDS.iter().find(|(known, _)| *known == id)?;
    Some(draw(robot, &mut Draws::new(seed, Purpose::Departure)))
}

/// A departure in the lab.
pub struct Departed {
    /// What departs from the model.
    pub departure: Box<dyn LabDeparture>,
    /// Its strength: 1 as drawn, towards 0 nothing.
    pub strength: f64,
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
