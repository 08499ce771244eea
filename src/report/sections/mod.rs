//! The sections of a report.

pub(crate) mod cutting_section;
pub(crate) mod diagnosis_section;
pub(crate) mod error_map_section;
pub(crate) mod history_section;
pub(crate) mod hole_section;
pub(crate) mod lobes_figure;
pub(crate) mod lobes_section;
pub(crate) mod modal_section;
pub(crate) mod real_case_section;
pub(crate) mod redundancy_section;
pub(crate) mod structure_section;
pub(crate) mod thesis_cutting;
pub(crate) mod thesis_section;
pub(crate) mod waveform_section;
