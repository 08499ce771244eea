//! The postures at which the built-in robot, an IRB 6640, was measured in the thesis that it comes from.

use serde::Deserialize;

use crate::{Error, Result};

const POSTURES: &str = include_str!("../../datasets/irb6640/postures.csv");

#[derive(Deserialize)]
struct PostureRow {
    id: String,
    j1_deg: f64,
    j2_deg: f64,
    j3_deg: f64,
    j4_deg: f64,
    j5_deg: f64,
    j6_deg: f64,
}

/// Joint angles of a thesis posture (`A`, `B`, `1` … `4`), degrees.
pub fn posture_deg(id: &str) -> Result<[f64; 6]> {
    // Notes at the end of a row hold commas of their own.
    csv::ReaderBuilder::new()
        .flexible(true)
        .from_reader(POSTURES.as_bytes())
        .deserialize()
        .collect::<std::result::Result<Vec<PostureRow>, _>>()
        .map_err(|e| Error::computation(format!("a built-in table is damaged: {e}")))?
        .into_iter()
        .find(|p| p.id == id)
        .map(|p| [p.j1_deg, p.j2_deg, p.j3_deg, p.j4_deg, p.j5_deg, p.j6_deg])
        .ok_or_else(|| Error::computation(format!("the thesis has no posture {id}")))
}
