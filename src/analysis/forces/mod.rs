//! Force records of a campaign.

pub mod channel_check;
pub mod cutting;
pub mod cutting_case;
pub mod cutting_side;
pub mod force_records;
#[cfg(test)]
pub(crate) mod made_force_records;
pub mod regression_line;
