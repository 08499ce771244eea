//! Departures of the measurement: wrong angles, points, gains, filters, and motion that is not the robot's.

use nalgebra::Vector3;
use num_complex::Complex64;
use serde_json::{Map, Value, json};

use super::lab_departure::{FrfChannel, LabDeparture, described, direction, pick_index, sign};
use crate::data::RobotSpec;
use crate::ingest::Axis;
use crate::simulate::draw::Draws;

/// The controller shows one joint's angle wrongly, everywhere by as much.
pub struct ShiftedEncoder {
    joint: usize,
    offset_deg: f64,
}

impl ShiftedEncoder {
    pub fn draw(robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Box::new(ShiftedEncoder {
            joint: pick_index(robot.joints.len(), 2, 5, draws),
            offset_deg: sign(draws) * draws.log_uniform(2.0, 5.0),
        })
    }
}

impl LabDeparture for ShiftedEncoder {
    fn id(&self) -> &'static str {
        "encoder-offset"
    }

    fn site(&self) -> Option<String> {
        Some(format!("joint-{}", self.joint))
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([("offset_deg", json!(strength * self.offset_deg))])
    }

    fn turn_joints(&self, strength: f64, _posture: usize, joints_deg: &mut [f64]) {
        joints_deg[self.joint - 1] += strength * self.offset_deg;
    }
}

/// The tool point is measured and hit next to where it is written to be.
pub struct ToolPointOff {
    offset_m: Vector3<f64>,
}

impl ToolPointOff {
    pub fn draw(_robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Box::new(ToolPointOff {
            offset_m: direction(draws) * draws.log_uniform(0.03, 0.08),
        })
    }
}

impl LabDeparture for ToolPointOff {
    fn id(&self) -> &'static str {
        "tool-point-off"
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([("offset_m", json!((self.offset_m * strength).as_slice()))])
    }

    fn point_offset_m(&self, strength: f64, point: usize) -> Vector3<f64> {
        match point {
            0 => self.offset_m * strength,
            _ => Vector3::zeros(),
        }
    }
}

/// The response channels lose low frequencies: first-order high-pass of an IEPE sensor's supply.
pub struct HighPass {
    corner_hz: f64,
}

impl HighPass {
    pub fn draw(_robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        Box::new(HighPass {
            corner_hz: draws.log_uniform(0.5, 2.0),
        })
    }
}

/// First-order high-pass, 1 far above its corner.
pub(crate) fn high_pass(frequency_hz: f64, corner_hz: f64) -> Complex64 {
    let ratio = Complex64::new(0.0, frequency_hz);
    ratio / (ratio + corner_hz)
}

impl LabDeparture for HighPass {
    fn id(&self) -> &'static str {
        "sensor-high-pass"
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([("corner_hz", json!(strength * self.corner_hz))])
    }

    fn factor(&self, strength: f64, frequency_hz: f64, _channel: &FrfChannel) -> Complex64 {
        high_pass(frequency_hz, strength * self.corner_hz)
    }
}

/// Hits along one axis count too much or too little.
pub struct HitGain {
    axis: Axis,
    gain: f64,
}

impl HitGain {
    pub fn draw(_robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        // X or Y: every layout has them.
        Box::new(HitGain {
            axis: *draws.pick(&[Axis::X, Axis::Y]),
            gain: sign(draws) * draws.log_uniform(0.1, 0.3),
        })
    }
}

impl LabDeparture for HitGain {
    fn id(&self) -> &'static str {
        "gain-of-one-direction"
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([
            ("axis", json!(self.axis.letter().to_string())),
            ("gain", json!(1.0 + strength * self.gain)),
        ])
    }

    fn factor(&self, strength: f64, _frequency_hz: f64, channel: &FrfChannel) -> Complex64 {
        let own = channel.reference.1 == self.axis;
        Complex64::from(if own { 1.0 + strength * self.gain } else { 1.0 })
    }
}

/// A table or stand next to the robot is felt at the tool point: one resonance that no posture moves.
pub struct TableMode {
    direction: Vector3<f64>,
    frequency_hz: f64,
    damping_ratio: f64,
    mass_kg: f64,
}

impl TableMode {
    pub fn draw(_robot: &RobotSpec, draws: &mut Draws) -> Box<dyn LabDeparture> {
        // Mostly horizontal: every layout hits along X and Y.
        let across = direction(draws);
        Box::new(TableMode {
            direction: Vector3::new(across.x, across.y, 0.3 * across.z).normalize(),
            frequency_hz: draws.log_uniform(15.0, 50.0),
            damping_ratio: draws.log_uniform(0.01, 0.04),
            mass_kg: draws.log_uniform(300.0, 900.0),
        })
    }
}

impl LabDeparture for TableMode {
    fn id(&self) -> &'static str {
        "table-mode"
    }

    fn described(&self, strength: f64) -> Map<String, Value> {
        described([
            ("direction", json!(self.direction.as_slice())),
            ("frequency_hz", json!(self.frequency_hz)),
            ("damping_ratio", json!(self.damping_ratio)),
            ("mass_kg", json!(self.mass_kg / strength)),
        ])
    }

    fn added_m_per_n(&self, strength: f64, frequency_hz: f64, channel: &FrfChannel) -> Complex64 {
        let ((point, out), (_, into)) = (channel.response, channel.reference);
        if point != 0 {
            return Complex64::ZERO;
        }
        let shape = self.direction[out.index()] * self.direction[into.index()];
        let (omega, own) = (
            std::f64::consts::TAU * frequency_hz,
            std::f64::consts::TAU * self.frequency_hz,
        );
        let dynamic = Complex64::new(own * own - omega * omega, 2.0 * self.damping_ratio * own * omega);
        strength * shape / self.mass_kg / dynamic
    }
}
