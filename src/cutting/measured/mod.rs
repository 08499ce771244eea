//! What one force record says.

pub(crate) mod air;
pub(crate) mod average;
pub(crate) mod contact;
pub(crate) mod cut_analysis;
pub(crate) mod faults;
pub(crate) mod in_step;
mod jump;
pub(crate) mod leak;
pub(crate) mod record;
pub(crate) mod record_slips;
pub(crate) mod teeth;
pub(crate) mod uneven_teeth;
pub(crate) mod whole_record;
