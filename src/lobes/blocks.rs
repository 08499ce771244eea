//! A cut with averaged forces on a structure: the lateral block and, in drilling, the axial–torsional one.
//!
//! The two blocks of a drill's force do not touch each other (Roukema & Altintas 2007), so the limit is that of the block
//! which chatters first. Cross FRFs between them, which a robot has, are left out.

use super::curve::{AbsoluteLimit, Limit, LobeCurve, SpeedLimit};
use super::force::RegenerativeForce;
use super::solve::StabilitySolver;
use crate::lobes::drilling::flank_damping::{DampedSolver, FlankDamping};
use crate::lobes::dynamics::frf::ToolPointFrf;

/// Forces of a cut averaged over a revolution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AveragedCut {
    /// Force in the plane across the tool axis.
    pub lateral: RegenerativeForce,
    /// Drilling, where what it needs is known.
    pub axial: Option<RegenerativeForce>,
    /// Drilling: process damping of the flanks; `None` where it is not asked for.
    pub damping: Option<FlankDamping>,
}

impl From<RegenerativeForce> for AveragedCut {
    fn from(lateral: RegenerativeForce) -> Self {
        AveragedCut {
            lateral,
            axial: None,
            damping: None,
        }
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
        let [lateral, axial] = match self.damping {
            Some(d) => [[d.lateral_n_per_m2; 2], [d.axial_n_per_m2, 0.0]],
            None => [[0.0; 2]; 2],
        };
        let solver = |force, frf: &'a dyn ToolPointFrf, damping| match self.damping {
            Some(d) => BlockLimit::Damped(DampedSolver::new(force, frf, damping, d.slowest_rpm)),
            None => BlockLimit::Regenerative(StabilitySolver::new(force, frf)),
        };
        BlockSolver {
            lateral: solver(self.lateral, blocks.lateral.as_ref(), lateral),
            axial: self
                .axial
                .zip(blocks.axial.as_ref())
                .map(|(force, frf)| solver(force, frf.as_ref(), axial)),
        }
    }
}

/// The limit of one block.
pub enum BlockLimit<'a> {
    /// Regeneration alone.
    Regenerative(StabilitySolver<'a>),
    /// With process damping of the flanks.
    Damped(DampedSolver<'a>),
}

impl<'a> BlockLimit<'a> {
    fn solver(&self) -> &(dyn SpeedLimit + 'a) {
        match self {
            BlockLimit::Regenerative(solver) => solver,
            BlockLimit::Damped(solver) => solver,
        }
    }
}

impl SpeedLimit for BlockLimit<'_> {
    fn limit_at(&self, spindle_rpm: f64) -> Option<Limit> {
        self.solver().limit_at(spindle_rpm)
    }

    fn absolute_limit(&self) -> Option<AbsoluteLimit> {
        self.solver().absolute_limit()
    }

    fn speeds_per_task(&self) -> usize {
        self.solver().speeds_per_task()
    }
}

/// The limit of whichever block chatters first.
pub struct BlockSolver<'a> {
    /// Solver of the block across the tool axis.
    pub lateral: BlockLimit<'a>,
    /// Solver of the axial–torsional block; `None` where there is none.
    pub axial: Option<BlockLimit<'a>>,
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
        Some([&self.lateral, axial].map(|solver| {
            let curve = solver.curve(spindle_rpm);
            // With process damping no limit holds at every speed: the least of these speeds.
            let absolute = solver.absolute_limit().or_else(|| curve.least());
            BlockLobes { curve, absolute }
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
