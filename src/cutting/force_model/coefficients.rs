//! The unknowns of the force models: cutting and edge coefficients.

use crate::data::Process;

/// One unknown of a force model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CoefficientKind {
    /// Key in JSON, with unit.
    pub key: &'static str,
    /// Symbol, for people: `Ktc`.
    pub label: &'static str,
    /// Unit, for people.
    pub unit: &'static str,
    /// An edge coefficient (N/mm), else a cutting coefficient (N/mm²).
    pub edge: bool,
}

const fn cutting(key: &'static str, label: &'static str) -> CoefficientKind {
    CoefficientKind {
        key,
        label,
        unit: "N/mm²",
        edge: false,
    }
}

const fn edge(key: &'static str, label: &'static str) -> CoefficientKind {
    CoefficientKind {
        key,
        label,
        unit: "N/mm",
        edge: true,
    }
}

/// Ktc Krc Kac Kte Kre Kae: along the cutting speed, normal to the edge out of the work, along the edge away from the tip.
/// Turning has the same.
pub const MILLING_COEFFICIENTS: [CoefficientKind; 6] = [
    cutting("ktc_n_per_mm2", "Ktc"),
    cutting("krc_n_per_mm2", "Krc"),
    cutting("kac_n_per_mm2", "Kac"),
    edge("kte_n_per_mm", "Kte"),
    edge("kre_n_per_mm", "Kre"),
    edge("kae_n_per_mm", "Kae"),
];

/// Ktc Kte Kfc Kfe.
pub const DRILLING_COEFFICIENTS: [CoefficientKind; 4] = [
    cutting("ktc_n_per_mm2", "Ktc"),
    edge("kte_n_per_mm", "Kte"),
    cutting("kfc_n_per_mm2", "Kfc"),
    edge("kfe_n_per_mm", "Kfe"),
];

/// The unknowns of a process, in the order of the columns of [`average_row`](crate::cutting::average_row).
pub fn coefficients_of(process: Process) -> &'static [CoefficientKind] {
    match process {
        Process::Milling | Process::Turning => &MILLING_COEFFICIENTS,
        Process::Drilling => &DRILLING_COEFFICIENTS,
    }
}
