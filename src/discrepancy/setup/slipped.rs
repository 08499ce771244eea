//! What the small errors of a setup do all at once, at one posture.

use num_complex::Complex64;

use super::care::Origin;
use super::group::FrfGroup;
use super::mistake::{Distortion, turned_axis};
use super::truth::Truth;
use crate::data::Axis;
use crate::identify::frfs::frf_data::FrfDatum;
use crate::robot::Kinematics;

/// One sort of error, one number of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SmallError {
    /// Joint, from 1 on, deg.
    Encoder(usize),
    /// ln of the hammer's gain.
    Gain,
    /// Component of a rotation vector, deg.
    Hit(usize),
    /// Component of a rotation vector, deg.
    Sensor(usize),
    /// Corner of the sensors, rad/s.
    Corner,
    /// A parameter of the model (solver's scale): its stiffness at this posture.
    Stiffness(usize),
    /// All stiffnesses, ln per campaign, in the order of measurement.
    Warming,
}

impl SmallError {
    /// What each kind is an error of. `hits_repeat`: the hammer's direction is wrong alike at all postures.
    pub fn origins(hits_repeat: bool) -> [Origin; 7] {
        let hits = if hits_repeat {
            Origin::Always
        } else {
            Origin::Files
        };
        [
            Origin::Files,
            Origin::Files,
            hits,
            Origin::Files,
            Origin::Files,
            Origin::Robot,
            Origin::Robot,
        ]
    }

    /// Errors of one kind show the same care; from 0 on.
    pub fn kind(self) -> usize {
        match self {
            SmallError::Encoder(_) => 0,
            SmallError::Gain => 1,
            SmallError::Hit(_) => 2,
            SmallError::Sensor(_) => 3,
            SmallError::Corner => 4,
            SmallError::Stiffness(_) => 5,
            SmallError::Warming => 6,
        }
    }
}

/// The sum of all errors at one posture.
#[derive(Debug, Clone, Default)]
pub struct Slipped {
    joints_deg: Vec<(usize, f64)>,
    /// By axis of the hit.
    gains: [f64; 3],
    hits_deg: [[f64; 3]; 3],
    /// By response point.
    sensors_deg: Vec<(usize, [f64; 3])>,
    corner_rad_per_s: f64,
}

impl Slipped {
    /// Adds an error of size `value` where `place` says, the posture being this one. [`SmallError::Stiffness`] and
    /// [`SmallError::Warming`] are the model's own and not seen here.
    pub fn add(&mut self, error: SmallError, place: &FrfGroup, value: f64) {
        let hits = |i: usize| place.reference_axis.is_none_or(|axis| axis.index() == i);
        match error {
            SmallError::Encoder(joint) => self.joints_deg.push((joint, value)),
            SmallError::Gain => (0..3).filter(|i| hits(*i)).for_each(|i| self.gains[i] += value),
            SmallError::Hit(part) => (0..3)
                .filter(|i| hits(*i))
                .for_each(|i| self.hits_deg[i][part] += value),
            SmallError::Sensor(part) => {
                let mut turn = [0.0; 3];
                turn[part] = value;
                self.sensors_deg.extend(place.response_point.map(|p| (p, turn)));
            }
            SmallError::Corner => self.corner_rad_per_s += value,
            SmallError::Stiffness(_) | SmallError::Warming => {}
        }
    }
}

impl Distortion for Slipped {
    fn kinematics(&self, _values: &[f64], kinematics: &Kinematics) -> Kinematics {
        let turn = |k: Kinematics, (joint, deg): &(usize, f64)| k.turned(*joint, deg.to_radians());
        self.joints_deg.iter().fold(kinematics.clone(), turn)
    }

    fn shown(&self, _values: &[f64], _omega: f64, truth: &Truth, frf: &FrfDatum) -> Complex64 {
        let mut sensor = [0.0; 3];
        for (_, turn) in self.sensors_deg.iter().filter(|(p, _)| *p == frf.response.point) {
            (0..3).for_each(|i| sensor[i] += turn[i]);
        }
        let hit = frf.reference.axis.index();
        let response = turned_axis(frf.response.axis, &sensor);
        let reference = turned_axis(frf.reference.axis, &self.hits_deg[hit]);
        let pairs = Axis::ALL.into_iter().zip(response).flat_map(|(a, part)| {
            let hits = Axis::ALL.into_iter().zip(reference);
            hits.map(move |(b, other)| (a, b, part * other))
        });
        let turned: Complex64 = pairs.map(|(a, b, part)| truth.between(a, b) * part).sum();
        turned * self.gains[hit].exp() * truth.rate / (truth.rate + self.corner_rad_per_s)
    }
}
