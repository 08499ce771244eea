//! A cut with averaged forces on a structure: the lateral block and, in drilling, the axial–torsional one.
//!
//! The two blocks of a drill's force do not touch each other (Roukema & Altintas 2007), so the limit is that of the block
//! which chatters first. Cross FRFs between them, which a robot has, are left out.

use super::curve::{AbsoluteLimit, Limit, LobeCurve, SpeedLimit};
use super::force::RegenerativeForce;
use super::solve::StabilitySolver;
use crate::lobes::dynamics::frf::ToolPointFrf;

/// Forces of a cut averaged over a revolution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AveragedCut {
    /// Force in the plane across the tool axis.
    pub lateral: RegenerativeForce,
    /// Drilling, where what it needs is known.
    pub axial: Option<RegenerativeForce>,
}

impl From<RegenerativeForce> for AveragedCut {
    fn from(lateral: RegenerativeForce) -> Self {
        AveragedCut { lateral, axial: None }
    }
}

/// The FRFs that a cut of [`AveragedCut`] meets.
pub struct Blocks {
    /// Across the tool axis: x and y.
    pub lateral: Box<dyn ToolPointFrf>,
    /// Along the tool axis and about it; `None` where it is not known or not asked for.
    pub axial: Option<Box<dyn ToolPointFrf>>,
}

impl AveragedCut {
    /// The solver of these forces on the FRFs of `blocks`; an axial–torsional block takes part where both have one.
    pub fn on<'a>(&self, blocks: &'a Blocks) -> BlockSolver<'a> {
        BlockSolver {
            lateral: StabilitySolver::new(self.lateral, blocks.lateral.as_ref()),
            axial: self
                .axial
                .zip(blocks.axial.as_ref())
                .map(|(force, frf)| StabilitySolver::new(force, frf.as_ref())),
        }
    }
}

/// The limit of whichever block chatters first.
pub struct BlockSolver<'a> {
    /// Solver of the block across the tool axis.
    pub lateral: StabilitySolver<'a>,
    /// Solver of the axial–torsional block; `None` where there is none.
    pub axial: Option<StabilitySolver<'a>>,
}

impl Blocks {
    /// Where chatter is sought, Hz.
    pub fn band_hz(&self) -> (f64, f64) {
        let (low, high) = self.lateral.band_hz();
        let (also_low, also_high) = self.axial.as_ref().map_or((low, high), |a| a.band_hz());
        (low.min(also_low), high.max(also_high))
    }
}

/// The limits of one block alone.
#[derive(Debug, Clone)]
pub struct BlockLobes {
    /// Limit over spindle speed.
    pub curve: LobeCurve,
    /// Absolute stability limit; `None` where nothing is limited.
    pub absolute: Option<AbsoluteLimit>,
}

impl BlockSolver<'_> {
    /// Lateral and axial–torsional limits; `None` where there is but one block.
    pub fn by_block(&self, spindle_rpm: &[f64]) -> Option<[BlockLobes; 2]> {
        let axial = self.axial.as_ref()?;
        Some([&self.lateral, axial].map(|solver| BlockLobes {
            curve: solver.curve(spindle_rpm),
            absolute: solver.absolute_limit(),
        }))
    }
}

impl SpeedLimit for BlockSolver<'_> {
    fn limit_at(&self, spindle_rpm: f64) -> Option<Limit> {
        let axial = self.axial.as_ref().and_then(|a| a.limit_at(spindle_rpm));
        let both = self.lateral.limit_at(spindle_rpm).into_iter().chain(axial);
        both.min_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm))
    }

    fn absolute_limit(&self) -> Option<AbsoluteLimit> {
        let axial = self.axial.as_ref().and_then(|a| a.absolute_limit());
        let both = self.lateral.absolute_limit().into_iter().chain(axial);
        both.min_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm))
    }

    fn speeds_per_task(&self) -> usize {
        self.lateral.speeds_per_task()
    }
}
