//! What is always a little wrong in a laboratory: small errors of setup everywhere at once, none of them worth a name.

use nalgebra::Vector3;
use num_complex::Complex64;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::departure::{FrfChannel, LabDeparture, Scene};
use super::draw::{Draws, Purpose};
use crate::identify::FrfData;
use crate::ingest::Axis;
use crate::robot::{Chain, Role};

/// One kind of small error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Slip {
    /// Joint angles 0.1° off (rms): half of the variance the same at all postures, half new at each.
    Encoders,
    /// Hammer gain 1 % off (rms), new at each posture and direction.
    HammerGain,
    /// Hits 1.5° off their direction (rms), new at each posture and direction.
    HitDirection,
    /// Joint stiffnesses fall by 0.2 % from posture to posture: the gears warm up.
    Warming,
    /// First-order high-pass of the sensors at 0.03 Hz.
    HighPass,
    /// Sensors turned by 0.7° (rms about each axis): half of the variance the same at all postures, half new at each.
    SensorTurn,
    /// Noise of neighbouring lines is correlated, as a Hann window leaves it.
    Lines,
    /// An error of 1 % of each FRF that changes smoothly over some 4 Hz and is new in each FRF.
    Coloured,
}

const ENCODER_DEG: f64 = 0.1;
const HAMMER_GAIN: f64 = 0.01;
const HIT_TURN_DEG: f64 = 1.5;
const WARMING: f64 = -0.002;
const HIGH_PASS_HZ: f64 = 0.03;
const SENSOR_TURN_DEG: f64 = 0.7;
const COLOURED: f64 = 0.01;
/// Spacing of the knots of the coloured error; it is correlated over about this.
const KNOTS_HZ: f64 = 4.0;

/// The errors of one laboratory, drawn.
pub struct Laboratory {
    slips: Vec<Slip>,
    /// Posture × joint.
    encoders_deg: Vec<Vec<f64>>,
    /// Posture × axis.
    hammer_gain: Vec<[f64; 3]>,
    hit_turn_deg: Vec<[Vector3<f64>; 3]>,
    /// Posture × point.
    sensor_turn_deg: Vec<Vec<Vector3<f64>>>,
    /// One list of knots an FRF, from 0 Hz on.
    coloured: Vec<Vec<Complex64>>,
}

/// Draws are made for every slip, whichever are wanted: switching one off changes no other.
impl Laboratory {
    pub fn draw(seed: u64, slips: &[Slip], data: &FrfData, joints: usize, points: usize) -> Self {
        let mut draws = Draws::new(seed, Purpose::Laboratory);
        let postures = data.posture_ids.len();
        let mut normal = move || draws.normal_pair().0;
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let same: Vec<f64> = (0..joints).map(|_| normal()).collect();
        let encoders_deg = (0..postures)
            .map(|_| same.iter().map(|s| ENCODER_DEG * half * (s + normal())).collect())
            .collect();
        let hammer_gain = (0..postures)
            .map(|_| [0; 3].map(|_| 1.0 + HAMMER_GAIN * normal()))
            .collect();
        // A hit is off along the two axes across its own; the third turn does nothing.
        let mut turn = |rms_deg: f64| Vector3::new(normal(), normal(), normal()) * rms_deg;
        let hit_turn_deg = (0..postures)
            .map(|_| [0; 3].map(|_| turn(HIT_TURN_DEG * half)))
            .collect();
        let glued: Vec<Vector3<f64>> = (0..points).map(|_| turn(SENSOR_TURN_DEG * half)).collect();
        let sensor_turn_deg = (0..postures)
            .map(|_| glued.iter().map(|g| g + turn(SENSOR_TURN_DEG * half)).collect())
            .collect();
        let highest = data.summary().highest_hz;
        let knots = (highest / KNOTS_HZ).ceil() as usize + 2;
        let mut draws = Draws::new(seed, Purpose::ColouredError);
        let coloured = data
            .frfs()
            .map(|_| {
                (0..knots)
                    .map(|_| {
                        let (re, im) = draws.normal_pair();
                        Complex64::new(re, im) * (COLOURED * half)
                    })
                    .collect()
            })
            .collect();
        Laboratory {
            slips: slips.to_vec(),
            encoders_deg,
            hammer_gain,
            hit_turn_deg,
            sensor_turn_deg,
            coloured,
        }
    }

    fn has(&self, slip: Slip) -> bool {
        self.slips.contains(&slip)
    }

    /// Complex, rms [`COLOURED`], changes smoothly with frequency: knots joined so that the variance is the same between
    /// them as on them.
    fn coloured_error(&self, frf: usize, frequency_hz: f64) -> Complex64 {
        let knots = &self.coloured[frf];
        let at = frequency_hz / KNOTS_HZ;
        let i = (at.floor() as usize).min(knots.len() - 2);
        let (sine, cosine) = (std::f64::consts::FRAC_PI_2 * (at - i as f64)).sin_cos();
        knots[i] * cosine + knots[i + 1] * sine
    }
}

impl LabDeparture for Laboratory {
    fn id(&self) -> &'static str {
        "laboratory"
    }

    fn described(&self, _strength: f64) -> Map<String, Value> {
        let turns = |v: &Vector3<f64>| json!(v.as_slice());
        let of = |slip: Slip| -> Value {
            match slip {
                Slip::Encoders => json!({ "joints_off_deg": self.encoders_deg }),
                Slip::HammerGain => json!({ "gain": self.hammer_gain }),
                Slip::HitDirection => {
                    let all: Vec<Vec<Value>> = self
                        .hit_turn_deg
                        .iter()
                        .map(|p| p.iter().map(turns).collect())
                        .collect();
                    json!({ "rotation_vectors_deg": all })
                }
                Slip::Warming => json!({ "stiffness_per_posture": WARMING }),
                Slip::HighPass => json!({ "corner_hz": HIGH_PASS_HZ }),
                Slip::SensorTurn => {
                    let all: Vec<Vec<Value>> = self
                        .sensor_turn_deg
                        .iter()
                        .map(|p| p.iter().map(turns).collect())
                        .collect();
                    json!({ "rotation_vectors_deg": all })
                }
                Slip::Lines => json!({ "noise": "as a Hann window leaves it" }),
                Slip::Coloured => json!({ "rms": COLOURED, "correlated_over_hz": KNOTS_HZ }),
            }
        };
        let key = |slip: &Slip| json!(slip).as_str().unwrap_or_default().to_string();
        self.slips.iter().map(|slip| (key(slip), of(*slip))).collect()
    }

    fn turn_joints(&self, _strength: f64, posture: usize, joints_deg: &mut [f64]) {
        if self.has(Slip::Encoders) {
            for (q, off) in joints_deg.iter_mut().zip(&self.encoders_deg[posture]) {
                *q += off;
            }
        }
    }

    fn change_chain(&self, _strength: f64, scene: &Scene, chain: &mut Chain) {
        if self.has(Slip::Warming) {
            let factor = (1.0 + WARMING).powi(scene.posture as i32);
            let joints = chain
                .elements
                .iter_mut()
                .filter(|e| matches!(e.role, Role::Joint(_)));
            joints.for_each(|e| e.stiffness = e.stiffness.scale(factor));
        }
    }

    fn sensor_turn_deg(&self, _strength: f64, posture: usize, point: usize) -> Vector3<f64> {
        match self.has(Slip::SensorTurn) {
            true => self.sensor_turn_deg[posture][point],
            false => Vector3::zeros(),
        }
    }

    fn hit_turn_deg(&self, _strength: f64, posture: usize, axis: Axis) -> Vector3<f64> {
        match self.has(Slip::HitDirection) {
            true => self.hit_turn_deg[posture][axis.index()],
            false => Vector3::zeros(),
        }
    }

    fn factor(&self, _strength: f64, frequency_hz: f64, channel: &FrfChannel) -> Complex64 {
        let mut factor = Complex64::new(1.0, 0.0);
        if self.has(Slip::HammerGain) {
            factor *= self.hammer_gain[channel.posture][channel.reference.1.index()];
        }
        if self.has(Slip::HighPass) {
            factor *= super::departure::high_pass(frequency_hz, HIGH_PASS_HZ);
        }
        if self.has(Slip::Coloured) {
            factor *= 1.0 + self.coloured_error(channel.frf, frequency_hz);
        }
        factor
    }
}
