//! Stability lobes: the width of cut at which regenerative chatter starts, against spindle speed.
//!
//! The cutting force answers the change of the tool's displacement since the tooth before,
//! F = b D (r(t) − r(t − T)), T = 60/(N n), and the structure answers the force, r = Φ(iω) F.
//! At the limit a vibration at ω neither grows nor decays: det(I − b (1 − e^{−iωT}) D Φ) = 0.
//! For each eigenvalue λ of D Φ that is b (1 − e^{−iωT}) = 1/λ =: g, hence (with g_R > 0)
//!
//! - b = ½ g_R (1 + (g_I/g_R)²) = 1/(2 Re λ),
//! - ωT = 2πk + ε with ε = 2 atan2(g_R, g_I) = 2 atan2(Re λ, −Im λ) in (0, 2π), k = 0, 1, 2, … the lobe.
//!
//! [`force`] builds D for a process, [`ToolPointFrf`] says what Φ is, [`solve`] finds the smallest b at a speed.
//!
//! Where nothing limits the cut at a speed within the band of the FRF, the limit is `None` (`null` in JSON).

mod arcs;
pub mod band;
pub mod best_speed;
pub mod blocks;
pub mod curve;
pub mod drilling;
pub mod dynamics;
pub mod force;
pub mod milling;
pub mod optimum;
pub mod outcome;
pub mod redundancy;
pub mod setup;
pub mod solve;
pub mod workspace;
pub mod workspace_grid;

pub use band::LobeBand;
pub use blocks::{AveragedCut, BlockLobes, BlockSolver, Blocks};
pub use curve::{AbsoluteLimit, Limit, LobeCurve, Peak, SpeedLimit, peak_near, peaks, speed_grid};
pub use dynamics::frf::{AxisMode, ModalFrf, Mode, ToolPointFrf};
pub use dynamics::poles::PoleFrf;
pub use dynamics::robot::RobotFrf;
pub use dynamics::sampled::SampledFrf;
pub use dynamics::tool_beam::{BeamSegment, ToolBeam};
pub use dynamics::tool_point::{ToolDynamics, ToolPoint};
pub use force::RegenerativeForce;
pub use milling::multi_frequency::MultiFrequency;
pub use milling::periodic_force::{PeriodicForce, ProcessDamping};
pub use milling::semi_discretisation::SemiDiscretisation;
pub use milling::state_space::StateSpace;
pub use solve::StabilitySolver;
