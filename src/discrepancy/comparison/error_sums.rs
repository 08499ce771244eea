//! Sums behind the errors of a comparison: over all, by group, by band.

use num_complex::Complex64;
use serde::Serialize;

use crate::identify::FrfData;

/// Error over everything compared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorTotals {
    /// sqrt(Σ|model − measured|² / Σ|measured|²).
    pub nrms: f64,
    /// Mean of |20 log10(|model| / |measured|)|, dB.
    pub mean_abs_db: f64,
    /// nrms of a perfect model: the measurement's own noise.
    pub noise_floor_nrms: f64,
}

/// Error of one group of FRFs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GroupError {
    /// What the group has in common: a posture, an axis, a cut.
    pub name: String,
    /// Error over the signal.
    pub nrms: f64,
    /// nrms of a perfect model.
    pub noise_floor_nrms: f64,
}

/// Sums behind an nrms.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Sums {
    pub error: f64,
    pub noise: f64,
    pub signal: f64,
    /// Σ|model − measured|²/σ²: as large as `values` where only noise is left.
    pub weighted: f64,
    pub values: usize,
}

impl Sums {
    pub fn of_line(model: Complex64, measured: Complex64, noise_std: f64) -> Self {
        let error = (model - measured).norm_sqr();
        let noise = noise_std.powi(2);
        Sums {
            error,
            noise,
            signal: measured.norm_sqr(),
            weighted: error / noise,
            values: 1,
        }
    }

    pub fn add(&mut self, other: Sums) {
        self.error += other.error;
        self.noise += other.noise;
        self.signal += other.signal;
        self.weighted += other.weighted;
        self.values += other.values;
    }

    pub fn nrms(&self) -> f64 {
        ratio(self.error, self.signal)
    }

    /// `None` where nothing was measured.
    pub fn measured_nrms(&self) -> Option<f64> {
        (self.signal > 0.0).then(|| self.nrms())
    }

    /// Error over noise; `None` where nothing was measured.
    pub fn times_noise(&self) -> Option<f64> {
        let floor = self.floor();
        (self.signal > 0.0 && floor > 0.0).then(|| self.nrms() / floor)
    }

    pub(crate) fn floor(&self) -> f64 {
        ratio(self.noise, self.signal)
    }
}

fn ratio(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { (part / whole).sqrt() } else { 0.0 }
}

/// Sums by name, in order of first appearance.
#[derive(Default)]
pub(crate) struct Groups(Vec<(String, Sums)>);

impl Groups {
    pub(crate) fn add(&mut self, name: &str, sums: Sums) {
        match self.0.iter_mut().find(|(n, _)| n == name) {
            Some((_, s)) => s.add(sums),
            None => self.0.push((name.to_string(), sums)),
        }
    }

    pub(crate) fn finish(self) -> Vec<GroupError> {
        self.0
            .into_iter()
            .map(|(name, s)| GroupError {
                name,
                nrms: s.nrms(),
                noise_floor_nrms: s.floor(),
            })
            .collect()
    }
}

/// Number of bands the measured range is divided into, equal on a logarithmic scale.
pub(crate) const BANDS: usize = 10;

pub(crate) fn band_edges_hz(data: &FrfData) -> Vec<f64> {
    let all = || data.blocks.iter().flat_map(|b| b.frequency_hz.iter().copied());
    let high = all().fold(0.0, f64::max);
    let low = all().filter(|f| *f > 0.0).fold(high, f64::min).max(1e-3 * high);
    let ratio = (high / low).max(1.0 + 1e-9);
    (0..=BANDS)
        .map(|i| low * ratio.powf(i as f64 / BANDS as f64))
        .collect()
}

pub(crate) fn band_of(edges: &[f64], frequency_hz: f64) -> usize {
    edges[1..edges.len() - 1]
        .iter()
        .take_while(|e| frequency_hz >= **e)
        .count()
}
