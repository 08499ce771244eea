//! Numbers without a phase.

use super::super::finding::SetupFinding;
use super::{LEAST_LINES, SURE};
use crate::identify::frfs::frf_data::{FrfData, FrfDatum};

/// Share of a value that is rounding.
const ROUNDING: f64 = 1e-9;

/// FRFs whose values all lie on one axis of the complex plane: that is no measured phase.
pub fn without_phase(data: &FrfData) -> Option<SetupFinding> {
    let flat = |frf: &FrfDatum| {
        let values = || frf.receptance.iter();
        let within = |part: fn(&num_complex::Complex64) -> f64| {
            values().all(|h| part(h).abs() <= ROUNDING * h.norm()) && values().any(|h| h.norm() > 0.0)
        };
        frf.receptance.len() >= LEAST_LINES && (within(|h| h.re) || within(|h| h.im))
    };
    let mut postures: Vec<usize> = data
        .frfs()
        .filter(|(_, f)| flat(f))
        .map(|(_, f)| f.posture)
        .collect();
    let count = postures.len();
    postures.dedup();
    if postures.is_empty() {
        return None;
    }
    let ids = postures
        .iter()
        .map(|p| data.posture_ids.get(*p).map_or("?", |id| id));
    let place = match count == data.frfs().count() {
        true => "all files".to_string(),
        false => format!("posture {}", ids.collect::<Vec<_>>().join(", ")),
    };
    Some(SetupFinding::without_size(
        "phase-missing",
        place,
        SURE,
        "These FRFs hold magnitudes (or one part of the complex value) alone: export real and imaginary part, or magnitude and phase."
            .into(),
    ))
}
