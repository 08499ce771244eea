//! Fewer lines that say as much: where an FRF is smooth its lines are averaged, where a pole may be they are kept.
//!
//! The width of a bin is a fixed share of its distance from the nearest pole in the complex plane, so that a pole costs
//! some fifty bins however fine the lines are, and a fit takes a time that does not grow with them. Models are averaged
//! in the same way ([`crate::modal::max_likelihood::ml_fit`]), so nothing is biased.

use num_complex::Complex64;

use crate::modal::max_likelihood::joint_fit::Data;
use crate::modal::single::local_fit::Pole;

/// Width of a bin over its distance from the nearest pole.
const BIN: f64 = 0.2;
/// A band keeps at least about this many bins: modes may be where none is known.
const LEAST_BINS: usize = 500;

/// The lines of an FRF in bins, for modes near `poles`. (Of single lines neither spread nor count need be given.)
pub(crate) fn condense(data: &Data, poles: &[Pole]) -> Data {
    let lines = data.frequency_hz.len();
    let most = (lines / LEAST_BINS).max(1);
    if most == 1 {
        return Data {
            spread_hz: vec![0.0; lines],
            count: vec![1.0; lines],
            ..data.clone()
        };
    }
    let mut sorted = poles.to_vec();
    sorted.sort_by(|a, b| a.frequency_hz.total_cmp(&b.frequency_hz));
    let mut bins = Data {
        frequency_hz: Vec::new(),
        receptance: Vec::new(),
        sigma: Vec::new(),
        spread_hz: Vec::new(),
        count: Vec::new(),
    };
    let mut from = 0;
    while from < lines {
        let width = BIN * distance_hz(data.frequency_hz[from], &sorted);
        let mut to = from + 1;
        while to < lines && to - from < most && data.frequency_hz[to] - data.frequency_hz[from] < width {
            to += 1;
        }
        bins.push(data, from, to);
        from = to;
    }
    bins
}

/// From the nearest pole, Hz.
fn distance_hz(f: f64, sorted: &[Pole]) -> f64 {
    let at = sorted.partition_point(|p| p.frequency_hz < f);
    // A pole further off is nearer only where a neighbour is damped much less; a few on either side will do.
    sorted[at.saturating_sub(3)..(at + 3).min(sorted.len())]
        .iter()
        .map(|p| (f - p.frequency_hz).hypot(p.damping_ratio * p.frequency_hz))
        .fold(f64::INFINITY, f64::min)
}

impl Data {
    /// Appends the mean of the lines `from..to` of another.
    fn push(&mut self, data: &Data, from: usize, to: usize) {
        let n = (to - from) as f64;
        let mean_hz = data.frequency_hz[from..to].iter().sum::<f64>() / n;
        let variance = data.frequency_hz[from..to]
            .iter()
            .map(|f| (f - mean_hz).powi(2))
            .sum::<f64>()
            / n;
        self.frequency_hz.push(mean_hz);
        self.spread_hz
            .push(if to - from > 1 { variance.sqrt() } else { 0.0 });
        self.receptance
            .push(data.receptance[from..to].iter().sum::<Complex64>() / n);
        self.sigma
            .push(data.sigma[from..to].iter().map(|s| s * s).sum::<f64>().sqrt() / n);
        self.count.push(n);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::modal::max_likelihood::ml_fit::{self, SETTLED};
    use crate::modal::max_likelihood::ml_linear::NoisyFrf;
    use crate::modal::synthetic::{Synthetic, SyntheticMode};

    #[test]
    fn bins_give_the_same_poles_as_their_lines() {
        let modes = [
            SyntheticMode::new(40.0, 0.01, 1.0),
            SyntheticMode::new(41.0, 0.008, -0.7),
            SyntheticMode::new(150.0, 0.002, 2.0),
        ];
        let (frequency_hz, receptance) = Synthetic::new(5.0, 205.0, 0.01, &modes).frf();
        let lines = frequency_hz.len();
        let data = Data {
            sigma: receptance.iter().map(|h| 0.01 * h.norm()).collect(),
            frequency_hz,
            receptance,
            spread_hz: vec![0.0; lines],
            count: vec![1.0; lines],
        };
        let start: Vec<Pole> = modes
            .iter()
            .map(|m| Pole {
                frequency_hz: m.frequency_hz * 1.001,
                damping_ratio: m.damping_ratio * 1.1,
            })
            .collect();
        let bins = condense(&data, &start);
        assert!(bins.frequency_hz.len() < lines / 8, "{}", bins.frequency_hz.len());
        assert_eq!(bins.count.iter().sum::<f64>(), lines as f64);
        let frf = NoisyFrf {
            frequency_hz: &bins.frequency_hz,
            receptance: &bins.receptance,
            sigma: &bins.sigma,
            spread_hz: &bins.spread_hz,
        };
        let solution = ml_fit::fit(&[frf], &start, &[], SETTLED).unwrap();
        for (pole, mode) in solution.poles.iter().zip(&modes) {
            approx::assert_relative_eq!(pole.frequency_hz, mode.frequency_hz, max_relative = 1e-6);
            approx::assert_relative_eq!(pole.damping_ratio, mode.damping_ratio, max_relative = 1e-3);
        }
    }
}
