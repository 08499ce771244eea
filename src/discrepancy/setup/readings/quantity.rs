use num_complex::Complex64;

use super::super::finding::SetupFinding;
use super::super::group::FrfGroup;
use super::super::reading::FileReading;
use super::dead_channel::over_noise;
use super::proposal::Proposed;
use super::table::{DistanceTable, distance};
use crate::data::Point;
use crate::identify::frfs::frf_data::FrfData;

/// Displacement, velocity and acceleration per force taken for one another: the file holds (iω)^power times what it is read
/// as.
pub struct MisreadQuantity {
    group: FrfGroup,
    power: i32,
}

/// (iω)^power at a frequency, SI.
pub(super) fn factor(frequency_hz: f64, power: i32) -> Complex64 {
    Complex64::new(0.0, std::f64::consts::TAU * frequency_hz).powi(power)
}

impl FileReading for MisreadQuantity {
    fn corrected(&self, data: &FrfData) -> FrfData {
        self.group.changed(data, |frequency_hz, frf| {
            let lines = frequency_hz.iter();
            for ((f, h), std) in lines.zip(&mut frf.receptance).zip(&mut frf.noise_std) {
                let factor = factor(*f, self.power);
                *h /= factor;
                *std /= factor.norm();
            }
        })
    }

    fn finding(&self, data: &FrfData, points: &[Point]) -> SetupFinding {
        let is = match self.power {
            1 => {
                "mobility where campaign.toml or the file says receptance (or accelerance where it says mobility)"
            }
            2 => "accelerance where campaign.toml or the file says receptance",
            -1 => {
                "receptance where campaign.toml or the file says mobility (or mobility where it says accelerance)"
            }
            _ => "receptance where campaign.toml or the file says accelerance",
        };
        SetupFinding {
            kind: "quantity",
            place: self.group.label(data, points),
            value: Some(f64::from(self.power)),
            std_error: None,
            unit: "powers of iω",
            confidence: 0.0,
            remedy: format!("Set quantity of these [[frf]] right: they hold {is}."),
        }
    }
}

pub fn proposed(table: &DistanceTable, data: &FrfData) -> Vec<Proposed> {
    let mut all = Vec::new();
    for power in [-2, -1, 1, 2] {
        let turned: Vec<f64> = data
            .frfs()
            .enumerate()
            .map(|(i, (block, frf))| {
                let lines = table.own(i, frf).iter().zip(&block.frequency_hz);
                distance(lines.map(|(m, f)| m * factor(*f, power)), frf)
            })
            .collect();
        // Read so, the structure would hardly be seen in the file: any file that shows nothing would do.
        let is_seen = |group: &FrfGroup| {
            data.frfs().enumerate().any(|(i, (block, frf))| {
                let read = table.own(i, frf).iter().zip(&block.frequency_hz);
                group.holds(frf) && over_noise(read.map(|(m, f)| m * factor(*f, power)), frf) > 1.0
            })
        };
        for group in FrfGroup::channels(data).into_iter().filter(is_seen) {
            all.push(Proposed {
                gain: table.gain(data, &group, |i, _| turned[i]),
                reading: Box::new(MisreadQuantity { group, power }),
            });
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a harmonic motion the velocity is iω times, the acceleration −ω² times the displacement.
    #[test]
    fn powers_of_i_omega_are_derivatives() {
        let omega = std::f64::consts::TAU * 10.0;
        let close = |power: i32, re: f64, im: f64| {
            let expected = Complex64::new(re, im);
            assert!(
                (factor(10.0, power) - expected).norm() < 1e-9 * expected.norm(),
                "{power}"
            );
        };
        close(1, 0.0, omega);
        close(2, -omega * omega, 0.0);
        close(-1, 0.0, -1.0 / omega);
        close(-2, -1.0 / (omega * omega), 0.0);
    }
}
