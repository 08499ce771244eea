//! What was cut, as plain values.

use crate::data::{Cut, OrthogonalSection, Tool};

/// Cuts made with one tool on one dynamometer: what is known of them besides their force records.
#[derive(Debug, Clone, Copy)]
pub struct CuttingTrials<'a> {
    /// The tool that made all of the cuts.
    pub tool: &'a Tool,
    /// The cuts in the order in which they are listed; results point to them by index.
    pub cuts: &'a [Cut],
    /// Rows of A in F_tool = A F_recorded.
    pub tool_from_dyno: &'a [[f64; 3]; 3],
    /// The main material, which an orthogonal database is of.
    pub material: Option<&'a str>,
    /// What orthogonal cuts of that material gave.
    pub orthogonal: Option<OrthogonalSection>,
}
