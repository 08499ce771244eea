//! The library of physical effects that a baseline model may lack: one file an effect, one registry.
//!
//! An effect says what it is and where it may sit, gives its parameters with priors and bounds, and changes the model:
//! it adds elements, bodies or branches to the chain of a robot, changes a stiffness, filters the measured channels, or
//! writes into the physics of a cut. Its derivative comes with the [`Dual`](crate::robot::Dual) numbers that it is written
//! in. The loop knows effects by the trait [`Effect`] only, and kinds of models by the trait [`Domain`].

pub mod background;
pub mod cutting;
pub mod drawn;
mod effect;
mod possible;
mod registry;
mod request;
mod shift;
mod site;
pub mod spot;
pub(crate) mod structural;
pub mod usual_size;

pub use background::Background;
pub use cutting::Cutting;
pub use effect::{Domain, Effect, Instance, Known};
pub(crate) use possible::NEGLIGIBLE;
pub use possible::Size;
pub use registry::{CUTTING, Registry, STRUCTURAL};
pub use request::requested;
pub use site::{At, EffectName, Site, WrittenEffect};
pub use spot::Spot;
pub use structural::{ChannelFilter, Conditions, DataSummary, LINK_FLEXIBILITY, PostureSetting, Structure};
