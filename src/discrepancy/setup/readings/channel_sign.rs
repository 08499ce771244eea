use super::super::finding::SetupFinding;
use super::super::group::FrfGroup;
use super::super::reading::FileReading;
use super::proposal::Proposed;
use super::table::{DistanceTable, distance};
use crate::data::Point;
use crate::identify::frfs::frf_data::FrfData;

/// A group of FRFs with the wrong sign: a sensor, a hammer or an amplifier of the other polarity.
pub struct ChannelSign {
    group: FrfGroup,
}

impl FileReading for ChannelSign {
    fn corrected(&self, data: &FrfData) -> FrfData {
        self.group.changed(data, |_, frf| frf.sign = -frf.sign)
    }

    fn finding(&self, data: &FrfData, points: &[Point]) -> SetupFinding {
        SetupFinding {
            kind: "channel-sign",
            place: self.group.label(data, points),
            value: Some(-1.0),
            std_error: None,
            unit: "",
            confidence: 0.0,
            remedy:
                "Turn the sign of these FRFs round: check the polarity of sensor, hammer and amplifier there."
                    .into(),
        }
    }
}

pub fn proposed(table: &DistanceTable, data: &FrfData) -> Vec<Proposed> {
    let turned: Vec<f64> = data
        .frfs()
        .enumerate()
        .map(|(i, (_, frf))| distance(table.own(i, frf).iter().map(|m| -m), frf))
        .collect();
    FrfGroup::channels(data)
        .into_iter()
        .map(|group| Proposed {
            gain: table.gain(data, &group, |i, _| turned[i]),
            reading: Box::new(ChannelSign { group }),
        })
        .collect()
}
