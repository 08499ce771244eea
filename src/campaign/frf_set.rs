//! stub, replaced at merge
use crate::ingest::Axis;
use num_complex::Complex64;
use std::path::PathBuf;
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MeasuredDof {
    pub point: usize,
    pub axis: Axis,
    pub negative: bool,
}
#[derive(Debug, Clone)]
pub struct FrfSet {
    pub frfs: Vec<MeasuredFrf>,
}
#[derive(Debug, Clone)]
pub struct MeasuredFrf {
    pub posture: usize,
    pub response: MeasuredDof,
    pub reference: MeasuredDof,
    pub name: String,
    pub frequency_hz: Vec<f64>,
    pub receptance_m_per_n: Vec<Complex64>,
    pub coherence: Option<Vec<f64>>,
    pub force_level_n: Option<f64>,
    pub file: PathBuf,
}
