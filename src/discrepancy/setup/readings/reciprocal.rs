use num_complex::Complex64;

use super::super::finding::SetupFinding;
use super::super::group::FrfGroup;
use super::super::reading::FileReading;
use super::proposal::Proposed;
use super::quantity::factor;
use super::table::{DistanceTable, distance};
use crate::data::Point;
use crate::identify::frfs::frf_data::FrfData;

/// Force per motion (dynamic stiffness, impedance, apparent mass) read as motion per force: what is read as receptance is
/// 1 / ((iω)^power × receptance).
pub struct Reciprocal {
    group: FrfGroup,
    /// Derivatives in what the file holds and in what it is read as, 0 to 4.
    power: i32,
}

/// What is read where the receptance is `h`, m/N.
fn read_as(h: Complex64, frequency_hz: f64, power: i32) -> Complex64 {
    (h * factor(frequency_hz, power)).finv()
}

impl FileReading for Reciprocal {
    fn corrected(&self, data: &FrfData) -> FrfData {
        self.group.changed(data, |frequency_hz, frf| {
            let lines = frequency_hz.iter();
            for ((f, h), std) in lines.zip(&mut frf.receptance).zip(&mut frf.noise_std) {
                let right = read_as(*h, *f, self.power);
                // A line without a value says nothing: as good as no line.
                if !right.is_finite() {
                    continue;
                }
                *std *= right.norm() / h.norm();
                *h = right;
            }
        })
    }

    fn finding(&self, data: &FrfData, points: &[Point]) -> SetupFinding {
        SetupFinding::without_size(
            "quantity",
            self.group.label(data, points),
            0.0,
            "These [[frf]] hold force per motion (dynamic stiffness, impedance or apparent mass), not motion per force: export \
             receptance, mobility or accelerance."
                .into(),
        )
    }
}

pub fn proposed(table: &DistanceTable, data: &FrfData) -> Vec<Proposed> {
    let mut all = Vec::new();
    for power in 0..=4 {
        let turned: Vec<f64> = data
            .frfs()
            .enumerate()
            .map(|(i, (block, frf))| {
                let lines = table.own(i, frf).iter().zip(&block.frequency_hz);
                distance(lines.map(|(m, f)| read_as(*m, *f, power)), frf)
            })
            .collect();
        all.extend(FrfGroup::postures(data).into_iter().map(|group| Proposed {
            gain: table.gain(data, &group, |i, _| turned[i]),
            reading: Box::new(Reciprocal { group, power }),
        }));
    }
    // A model without a response somewhere has no reciprocal there.
    all.retain(|p| p.gain.is_finite());
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Apparent mass of 2 kg read as accelerance: (2 / (iω)²), of a free mass whose receptance is 1 / (2 (iω)²).
    #[test]
    fn a_mass_is_read_as_its_reciprocal() {
        let f = 7.0;
        let receptance = (2.0 * factor(f, 2)).finv();
        let read = read_as(receptance, f, 4);
        assert!((read - 2.0 / factor(f, 2)).norm() < 1e-12 * read.norm());
        assert!((read_as(read, f, 4) - receptance).norm() < 1e-12 * receptance.norm());
    }
}
