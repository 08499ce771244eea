//! The library of physical effects that a baseline model may lack: one file an effect, one registry.
//!
//! An effect says what it is and where it may sit, gives its parameters with priors and bounds, and changes the model:
//! it adds elements, bodies or branches to the chain, changes a stiffness, or filters the measured channels. Its
//! derivative comes with the [`Dual`](crate::robot::Dual) numbers that it is written in. The loop knows effects by this trait only.

pub mod background;
pub mod cutting;
pub mod drawn;
mod effect;
mod possible;
mod registry;
mod request;
pub mod spot;
pub(crate) mod structural;
pub mod usual_size;

pub use background::Background;
pub use effect::{ChannelFilter, DataSummary, Instance, Setting, Site, StructuralEffect};
pub use possible::Size;
pub use registry::{DRAWN, STRUCTURAL, find, instances};
pub use request::requested;
pub use spot::Spot;
