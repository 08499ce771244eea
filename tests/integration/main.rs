//! Integration tests, in one binary so that they link once.

mod campaign;
mod cfc;
mod cfc_methods;
mod contract;
mod demo;
mod diagnose;
mod hole;
mod init;
mod inspect;
mod lobes;
mod modal;
mod next_step;
mod records;
mod report;
mod revisions;
mod robustness;
mod sample_reports;
mod schema;
mod serve;
mod shell;
mod simulate;
mod structure;
mod support;
mod tour;
mod waveform;
mod where_it_fails;
