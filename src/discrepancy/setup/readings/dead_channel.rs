use num_complex::Complex64;

use super::super::finding::SetupFinding;
use super::super::group::FrfGroup;
use super::super::reading::FileReading;
use super::proposal::Proposed;
use super::table::{DistanceTable, distance};
use crate::data::Point;
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// What noise alone makes of |h|²/σ² (1 on average), with what hum and a coloured noise add.
const NOISE_ALONE: f64 = 4.0;

/// FRFs that show nothing of the structure: a sensor that came off, a cable without contact, a channel that was not switched on.
pub struct DeadChannel {
    group: FrfGroup,
}

impl FileReading for DeadChannel {
    fn corrected(&self, data: &FrfData) -> FrfData {
        self.group.changed(data, |_, frf| frf.sign = 0.0)
    }

    fn finding(&self, data: &FrfData, points: &[Point]) -> SetupFinding {
        SetupFinding {
            kind: "dead-channel",
            place: self.group.label(data, points),
            value: Some(0.0),
            std_error: None,
            unit: "1",
            confidence: 0.0,
            remedy: "Take these FRFs out: they hold noise and nothing of the structure; look at the sensor, its cable and the channel's \
                     setting."
                .into(),
        }
    }
}

/// Σ |value|²/σ² over the lines of an FRF, over their number.
pub(super) fn over_noise(values: impl Iterator<Item = Complex64>, frf: &FrfDatum) -> f64 {
    let squares = values
        .zip(&frf.noise_std)
        .map(|(h, std)| h.norm_sqr() / (std * std));
    squares.sum::<f64>() / frf.noise_std.len().max(1) as f64
}

pub fn proposed(table: &DistanceTable, data: &FrfData) -> Vec<Proposed> {
    let nothing: Vec<f64> = data
        .frfs()
        .map(|(_, frf)| distance(frf.receptance.iter().map(|_| Complex64::ZERO), frf))
        .collect();
    let is_dead = |group: &FrfGroup| {
        let mut own = data.frfs().filter(|(_, frf)| group.holds(frf));
        own.all(|(_, frf)| over_noise(frf.receptance.iter().copied(), frf) < NOISE_ALONE)
    };
    FrfGroup::channels(data)
        .into_iter()
        .filter(is_dead)
        .map(|group| Proposed {
            gain: table.gain(data, &group, |i, _| nothing[i]),
            reading: Box::new(DeadChannel { group }),
        })
        .collect()
}
