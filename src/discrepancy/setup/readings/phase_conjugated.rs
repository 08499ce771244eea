use super::super::finding::SetupFinding;
use super::super::group::FrfGroup;
use super::super::reading::FileReading;
use super::proposal::Proposed;
use super::table::{DistanceTable, distance};
use crate::data::Point;
use crate::identify::frfs::frf_data::FrfData;

/// Imaginary parts with the wrong sign: the other convention of the Fourier transform, or force over response phase.
pub struct PhaseConjugated {
    group: FrfGroup,
}

impl FileReading for PhaseConjugated {
    fn corrected(&self, data: &FrfData) -> FrfData {
        self.group.changed(data, |_, frf| {
            for h in &mut frf.receptance {
                *h = h.conj();
            }
        })
    }

    fn finding(&self, data: &FrfData, points: &[Point]) -> SetupFinding {
        SetupFinding {
            kind: "phase-conjugated",
            place: self.group.label(data, points),
            value: None,
            std_error: None,
            unit: "",
            confidence: 0.0,
            remedy: "Turn the sign of the imaginary parts round: Im H of a driving point must be negative. The files were \
                     written with the other sign convention of the transform."
                .into(),
        }
    }
}

pub fn proposed(table: &DistanceTable, data: &FrfData) -> Vec<Proposed> {
    let turned: Vec<f64> = data
        .frfs()
        .enumerate()
        .map(|(i, (_, frf))| distance(table.own(i, frf).iter().map(|m| m.conj()), frf))
        .collect();
    FrfGroup::postures(data)
        .into_iter()
        .map(|group| Proposed {
            gain: table.gain(data, &group, |i, _| turned[i]),
            reading: Box::new(PhaseConjugated { group }),
        })
        .collect()
}
