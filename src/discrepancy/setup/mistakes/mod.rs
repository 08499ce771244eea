//! The mistakes that have a size, one file each.

mod amplifier_low_pass;
pub(super) mod channel_gain;
mod coarse_lines;
pub(super) mod encoder_offset;
mod exponential_window;
mod frequency_axis;
pub(super) mod hit_direction;
mod late_channel;
mod point_position;
pub(super) mod sensor_high_pass;
mod sensor_mass;
pub(super) mod turned_sensor;

use super::mistake::Mistake;
use crate::identify::StructureModel;
use crate::identify::frfs::frf_data::FrfData;

/// Everything that these data could show.
pub fn all(model: &StructureModel, data: &FrfData) -> Vec<Box<dyn Mistake>> {
    let mut all: Vec<Box<dyn Mistake>> = Vec::new();
    all.extend((1..=model.robot.joint_count()).map(|joint| {
        let mistake: Box<dyn Mistake> = Box::new(encoder_offset::EncoderOffset { joint });
        mistake
    }));
    let mut points: Vec<usize> = data
        .frfs()
        .flat_map(|(_, f)| [f.response.point, f.reference.point])
        .collect();
    points.sort_unstable();
    points.dedup();
    for point in points {
        all.push(Box::new(point_position::PointPosition { point }));
    }
    all.push(Box::new(channel_gain::ChannelGain));
    all.push(Box::new(hit_direction::HitDirection));
    all.push(Box::new(turned_sensor::TurnedSensor));
    all.push(Box::new(exponential_window::ExponentialWindow));
    for order in [1, 2] {
        all.push(Box::new(sensor_high_pass::SensorHighPass { order }));
        all.push(Box::new(amplifier_low_pass::AmplifierLowPass { order }));
    }
    all.push(Box::new(sensor_mass::SensorMass));
    all.push(Box::new(late_channel::LateChannel));
    all.push(Box::new(coarse_lines::CoarseLines));
    all.push(Box::new(frequency_axis::FrequencyAxis));
    all
}
