//! Figures of FRFs, modes and the robot.

pub(crate) mod coherence;
pub(crate) mod compass;
pub(crate) mod drawn_curve;
pub(crate) mod frf;
pub(crate) mod indicators;
pub(crate) mod mode_shapes;
pub(crate) mod nyquist;
pub(crate) mod resonances;
pub(crate) mod robot;
pub(crate) mod stabilisation;
pub(crate) mod wire;
