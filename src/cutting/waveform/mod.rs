//! Cutting forces over a tool revolution (milling) and over a hole (drilling), per unit of each coefficient.
//!
//! Milling forces are periodic in the tool's rotation, so they are kept as Fourier coefficients over its orders
//! (order 1 = once a revolution): the helix is then a factor, a phase is a factor, sensor dynamics are a factor,
//! and the integrals over the immersion have closed forms wherever the force is linear in the chip thickness.

mod drilling;
mod edge_shape;
mod milling;
mod own_teeth;
mod quadrature;
mod tooth_place;
mod vibrating;

pub use drilling::{DrillTerm, DrillingCut};
pub use edge_shape::EdgeShape;
pub use milling::{ChipLaw, MillingCut, SampledForces, UNIT_COUNT, UnitForces};
pub use own_teeth::OwnTeethForces;
pub(super) use quadrature::gauss_legendre;
pub use tooth_place::{TeethSlopes, ToothPlace};
pub use vibrating::{LineForces, VibratingForces};
