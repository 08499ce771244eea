//! What the thesis published: its tables, and the built-in robot with the compliances that it gives.

use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::campaign::RobotSection;
use crate::identify::StructureModel;
use crate::robot::{RobotModel, RobotSpec};
use crate::{Error, Result};

pub(super) const STATIC_STIFFNESS: &str = include_str!("../../datasets/irb6640/static_stiffness.csv");
pub(super) const FREQUENCIES: &str = include_str!("../../datasets/irb6640/frequencies_published_model.csv");
pub(super) const MODAL: &str = include_str!("../../datasets/irb6640/modal_measured.csv");
pub(super) const MINIMA: &str = include_str!("../../datasets/irb6640/real_part_minima_measured.csv");

/// Bands in which the thesis measured resonances again and again, Hz.
pub(super) const RECURRING_BANDS: [(f64, f64); 2] = [(32.0, 37.0), (47.0, 49.0)];

#[derive(Deserialize)]
pub(super) struct StaticRow {
    pub posture: String,
    pub kx_measured_n_per_m: Option<f64>,
    pub ky_measured_n_per_m: Option<f64>,
    pub kx_published_model_n_per_m: f64,
    pub ky_published_model_n_per_m: f64,
}

#[derive(Deserialize)]
pub(super) struct FrequencyRow {
    pub configuration: String,
    pub axis: String,
    pub published_model_hz: f64,
}

#[derive(Deserialize)]
pub(super) struct ModalRow {
    pub configuration: String,
    pub axis: String,
    pub frequency_hz: f64,
    pub peak_real_receptance_m_per_n: f64,
}

#[derive(Deserialize)]
pub(super) struct MinimumRow {
    pub configuration: String,
    pub frequency_hz: f64,
}

/// The rows of a built-in table.
pub(super) fn rows<T: DeserializeOwned>(table: &str) -> Result<Vec<T>> {
    // Notes at the end of a row hold commas of their own.
    csv::ReaderBuilder::new()
        .flexible(true)
        .from_reader(table.as_bytes())
        .deserialize()
        .collect::<std::result::Result<_, _>>()
        .map_err(|e| Error::computation(format!("a built-in table is damaged: {e}")))
}

/// The built-in robot with the published compliances.
pub(super) fn untuned_model() -> Result<StructureModel> {
    let section = RobotSection {
        model: "irb6640".into(),
        mass_tolerance: None,
        stiffness_tolerance: 0.3,
        links: Default::default(),
    };
    let spec = RobotSpec::load(&section.model, std::path::Path::new("."))?;
    Ok(StructureModel::new(RobotModel::new(spec), Vec::new(), &section))
}
