//! The source thesis put right: its tables, its measurements and this model, side by side.
//!
//! Everything the thesis measured on the robot itself is in `datasets/irb6640/`: the static stiffness of two postures,
//! the strongest mode of four, and the minima of the real part of their FRFs. The raw FRFs are not public.

mod answer;
pub mod case_study;
pub mod checked;
mod cutting_reading;
pub mod cutting_tables;
pub mod drawn_case;
pub mod findings;
pub mod lobe_assumptions;
pub mod measured_lobes;
mod published;
pub mod real_case;

pub use case_study::{CaseStudy, ComparedRow, FITTED_CONFIGURATIONS, LobeTips, case_study};
pub use cutting_tables::{CuttingTables, cutting_tables};
pub use findings::ThesisFindings;
pub use real_case::{RealCase, real_case};
