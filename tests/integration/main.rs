//! Integration tests, in one binary so that they link once.

mod campaign;
mod cfc;
mod cfc_methods;
mod contract;
mod demo;
mod diagnose;
mod inspect;
mod modal;
mod records;
mod report;
mod revisions;
mod robustness;
mod schema;
mod simulate;
mod structure;
mod support;
mod waveform;
mod where_it_fails;
