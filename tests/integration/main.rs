//! Integration tests, in one binary so that they link once.

mod campaign;
mod cfc;
mod contract;
mod inspect;
mod modal;
mod robustness;
mod schema;
mod structure;
mod support;
