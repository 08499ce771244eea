//! What the values of FRFs say without any model.

mod contradictions;
mod copies;
mod names;
mod phase_missing;

use super::finding::SetupFinding;
use crate::data::Point;
use crate::identify::frfs::frf_data::FrfData;

/// Lines from which on equal or flat numbers are no accident.
const LEAST_LINES: usize = 8;
/// As sure as ever: it comes before a fitted mistake that says the same.
const SURE: f64 = 0.98;

/// FRFs that contradict each other, that are one measurement under two names, and that hold magnitudes alone.
pub fn without_model(data: &FrfData, points: &[Point]) -> Vec<SetupFinding> {
    let mut findings = contradictions::contradictions(data, points);
    findings.extend(copies::copies(data, points));
    findings.extend(phase_missing::without_phase(data));
    findings
}
