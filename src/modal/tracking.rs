//! The same mode in several sets (postures): pairs by frequency and shape.

use num_complex::Complex64;

use super::shape::mac;
use crate::modal::together::global_modes::{GlobalMode, GlobalModes};

/// Modes further apart than this part of their frequency are different ones.
const APART: f64 = 0.25;
/// What a MAC of zero counts, against a frequency that is [`APART`] off.
const SHAPE_WEIGHT: f64 = 0.5;

/// One mode through all sets.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// By set: index of the mode there, `None` where it was not found.
    pub mode_of_set: Vec<Option<usize>>,
}

/// Two modes of two sets that belong together, with what tells them apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// Index of the mode in the first set.
    pub first: usize,
    /// Index of the mode in the second set.
    pub second: usize,
    /// `None` where the sets have no degree of freedom in common.
    pub mac: Option<f64>,
}

/// MAC of two modes over the degrees of freedom that both shapes have; `None` for fewer than two.
pub fn shape_mac(a: &GlobalMode, b: &GlobalMode) -> Option<f64> {
    let (x, y): (Vec<Complex64>, Vec<Complex64>) = a
        .shape
        .iter()
        .filter_map(|(dof, x)| Some((*x, b.shape.iter().find(|(d, _)| d == dof)?.1)))
        .unzip();
    (x.len() >= 2).then(|| mac(&x, &y))
}

/// MAC of two modes of the same FRFs, from their modal constants in those that both sets have; `None` for fewer than two.
pub fn constants_mac(a: &GlobalMode, b: &GlobalMode) -> Option<f64> {
    let (x, y): (Vec<Complex64>, Vec<Complex64>) = a
        .constants
        .iter()
        .zip(&b.constants)
        .filter_map(|(x, y)| Some(((*x)?.0, (*y)?.0)))
        .unzip();
    (x.len() >= 2).then(|| mac(&x, &y))
}

/// Pairs the modes of two sets, the most alike first; each mode is used once. Degrees of freedom must be numbered alike
/// in both.
pub fn pair(first: &[GlobalMode], second: &[GlobalMode]) -> Vec<Pair> {
    pair_by(first, second, shape_mac)
}

/// As [`pair`], with another measure of likeness of the shapes (0..1).
pub fn pair_by(
    first: &[GlobalMode],
    second: &[GlobalMode],
    likeness: impl Fn(&GlobalMode, &GlobalMode) -> Option<f64>,
) -> Vec<Pair> {
    let mut all: Vec<(f64, Pair)> = Vec::new();
    for (i, a) in first.iter().enumerate() {
        for (j, b) in second.iter().enumerate() {
            let apart = (a.frequency_hz / b.frequency_hz).ln().abs() / APART;
            if apart < 1.0 {
                let mac = likeness(a, b);
                let cost = apart + SHAPE_WEIGHT * (1.0 - mac.unwrap_or(1.0));
                let pair = Pair {
                    first: i,
                    second: j,
                    mac,
                };
                all.push((cost, pair));
            }
        }
    }
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pairs: Vec<Pair> = Vec::new();
    for (_, candidate) in all {
        if !pairs
            .iter()
            .any(|p| p.first == candidate.first || p.second == candidate.second)
        {
            pairs.push(candidate);
        }
    }
    pairs.sort_by_key(|p| p.first);
    pairs
}

/// Follows the modes from set to set, ascending in the frequency where they are first seen.
pub fn track(sets: &[&GlobalModes]) -> Vec<Track> {
    let mut tracks: Vec<Track> = Vec::new();
    for (s, set) in sets.iter().enumerate() {
        // Each track's latest mode stands for it.
        let latest: Vec<(usize, &GlobalMode)> = tracks
            .iter()
            .enumerate()
            .filter_map(|(t, track)| {
                let (set, mode) = (0..s).rev().find_map(|k| Some((k, track.mode_of_set[k]?)))?;
                Some((t, &sets[set].modes[mode]))
            })
            .collect();
        let known: Vec<GlobalMode> = latest.iter().map(|(_, m)| (*m).clone()).collect();
        let pairs = pair(&known, &set.modes);
        for mode in 0..set.modes.len() {
            match pairs.iter().find(|p| p.second == mode) {
                Some(p) => tracks[latest[p.first].0].mode_of_set[s] = Some(mode),
                None => {
                    let mut mode_of_set = vec![None; sets.len()];
                    mode_of_set[s] = Some(mode);
                    tracks.push(Track { mode_of_set });
                }
            }
        }
    }
    let frequency = |t: &Track| {
        let first = t
            .mode_of_set
            .iter()
            .enumerate()
            .find_map(|(s, m)| Some((s, (*m)?)));
        first.map_or(0.0, |(s, m)| sets[s].modes[m].frequency_hz)
    };
    tracks.sort_by(|a, b| frequency(a).total_cmp(&frequency(b)));
    tracks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(frequency_hz: f64, shape: [f64; 3]) -> GlobalMode {
        GlobalMode {
            frequency_hz,
            damping_ratio: 0.03,
            frequency_std_hz: 0.01,
            damping_std: 0.001,
            found_in: 3,
            lines_in_half_power_band: 4.0,
            complexity: None,
            shape: shape
                .iter()
                .enumerate()
                .map(|(k, x)| (k, Complex64::from(*x)))
                .collect(),
            constants: Vec::new(),
        }
    }

    fn set(modes: Vec<GlobalMode>) -> GlobalModes {
        GlobalModes {
            modes,
            ..GlobalModes::default()
        }
    }

    #[test]
    fn close_modes_that_change_their_order_are_followed_by_shape() {
        let (x, y, z) = ([1.0, 0.1, 0.0], [0.1, 1.0, 0.0], [0.0, 0.0, 1.0]);
        let first = set(vec![mode(7.0, x), mode(7.3, y), mode(20.0, z)]);
        let second = set(vec![mode(7.1, y), mode(7.4, x), mode(21.0, z), mode(80.0, x)]);
        let tracks = track(&[&first, &second]);
        let expected = [
            [Some(0), Some(1)],
            [Some(1), Some(0)],
            [Some(2), Some(2)],
            [None, Some(3)],
        ];
        assert_eq!(tracks.len(), expected.len());
        for (track, expected) in tracks.iter().zip(expected) {
            assert_eq!(track.mode_of_set, expected);
        }
    }
}
