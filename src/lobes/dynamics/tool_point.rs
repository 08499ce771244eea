//! The tool point: what the tool is clamped in (robot model, measured FRFs, modes) and the tool as a beam, coupled, and
//! from it the FRFs of the lateral and of the axial–torsional block.
//!
//! Axes: d points along the tool from the spindle to the workpiece, x and y as in [`lobe_axes`]. Displacements are along
//! x, y and d (deeper into the workpiece), turns about d × x, d × y (so that a turn ψ moves what lies s further along d by
//! sψ) and d (the sense in which a right-hand tool rotates).

use std::f64::consts::TAU;
use std::sync::Arc;

use num_complex::Complex64;

use crate::lobes::blocks::Blocks;
use crate::lobes::dynamics::frf::{ModalFrf, Receptance, ToolPointFrf, band_around, resonance_grid};
use crate::lobes::dynamics::robot::lobe_axes;
use crate::lobes::dynamics::sampled::SampledFrf;
use crate::lobes::dynamics::tool_beam::{Receptance6, ToolBeam};
use crate::robot::frf::natural_frequencies_hz;
use crate::robot::{Chain, FrfBasis, Kinematics, RobotModel};
use crate::{Error, Result};

/// The receptance of the place that the tool is clamped in.
pub trait Holder: Send + Sync {
    /// All six degrees of freedom, in the order of [`Receptance6`].
    fn receptance(&self, frequency_hz: f64) -> Receptance6;

    /// Where its own resonances are sought, Hz.
    fn band_hz(&self) -> (f64, f64);

    /// Ascending frequencies over that band that none of its own resonances slips through.
    fn seed_grid_hz(&self) -> Vec<f64>;
}

/// The robot model at the holder face, a length behind the tool centre point.
pub struct RobotHolder {
    basis: FrfBasis,
    resonances: Vec<(f64, f64)>,
    band_hz: (f64, f64),
}

impl RobotHolder {
    /// # Errors
    /// A chain whose matrices are not those of a structure, or without a mode.
    pub fn new(robot: &RobotModel, kinematics: &Kinematics, chain: &Chain, behind_m: f64) -> Result<Self> {
        let d = kinematics.tool_axis();
        let [x, y] = lobe_axes(d);
        let place = robot.flange_place();
        let face = kinematics.tcp() - d * behind_m;
        let jacobian = chain.jacobian(face, place);
        let shift = |along| chain.output_row(face, place, true, along);
        let turn = |about| jacobian.fixed_rows::<3>(3).transpose() * about;
        let rows = [
            shift(&x),
            turn(d.cross(&x)),
            shift(&y),
            turn(d.cross(&y)),
            shift(&d),
            turn(d),
        ];
        let system = chain.system(0);
        let frequencies = natural_frequencies_hz(&system)?;
        let band_hz = band_around(frequencies.iter().copied())
            .ok_or_else(|| Error::computation("lobes need at least one mode"))?;
        // As in RobotFrf: only the density of the grid depends on this.
        let zeta = system.modal_damping_ratio.value;
        let zeta = if zeta > 0.0 { zeta } else { 0.01 };
        Ok(RobotHolder {
            basis: FrfBasis::new(&system, &rows)?,
            resonances: frequencies.into_iter().map(|f| (f, zeta)).collect(),
            band_hz,
        })
    }
}

impl Holder for RobotHolder {
    fn receptance(&self, frequency_hz: f64) -> Receptance6 {
        let Ok(response) = self.basis.solve(TAU * frequency_hz) else {
            return Receptance6::identity() * Complex64::new(0.0, -f64::MAX.sqrt());
        };
        Receptance6::from_fn(|out, input| self.basis.receptance(&response, out, input))
    }

    fn band_hz(&self) -> (f64, f64) {
        self.band_hz
    }

    fn seed_grid_hz(&self) -> Vec<f64> {
        resonance_grid(self.resonances.iter().copied(), self.band_hz)
    }
}

/// Receptances measured in x and y (and z) at the holder face. What was not measured is the model's where there is one,
/// else zero: the holder face then does not turn. Above the last line the holder is a free mass (∝ 1/f²), below the first
/// a spring.
pub struct MeasuredHolder {
    /// Measured receptances in x and y.
    pub lateral: SampledFrf,
    /// Entry 00 is along the tool axis, away from and towards the workpiece alike.
    pub axial: Option<SampledFrf>,
    /// The robot model at the holder face, for what was not measured.
    pub model: Option<RobotHolder>,
}

fn beyond_lines(frf: &SampledFrf, frequency_hz: f64) -> Receptance {
    let (low, high) = frf.band_hz();
    let h = frf.receptance(frequency_hz.clamp(low, high));
    let fall = (high / frequency_hz).min(1.0).powi(2);
    h.map(|row| row.map(|v| v * fall))
}

impl Holder for MeasuredHolder {
    fn receptance(&self, frequency_hz: f64) -> Receptance6 {
        let model = self.model.as_ref().map(|m| m.receptance(frequency_hz));
        let mut r = model.unwrap_or_else(Receptance6::zeros);
        let lateral = beyond_lines(&self.lateral, frequency_hz);
        for (i, row) in lateral.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                r[(2 * i, 2 * j)] = *value;
            }
        }
        if let Some(axial) = &self.axial {
            r[(4, 4)] = beyond_lines(axial, frequency_hz)[0][0];
        }
        r
    }

    fn band_hz(&self) -> (f64, f64) {
        self.lateral.band_hz()
    }

    fn seed_grid_hz(&self) -> Vec<f64> {
        self.lateral.seed_grid_hz()
    }
}

/// Modes in x and y, and in z and θ: rotations about x and y are rigid.
pub struct ModesHolder {
    /// Modes in x and y, m/N.
    pub lateral: ModalFrf,
    /// First axis: along the tool, m/N; second: about it, rad/(N·m).
    pub axial: Option<ModalFrf>,
}

impl ModesHolder {
    fn blocks(&self) -> impl Iterator<Item = (usize, &ModalFrf)> {
        std::iter::once((0, &self.lateral)).chain(self.axial.iter().map(|frf| (4, frf)))
    }
}

impl Holder for ModesHolder {
    fn receptance(&self, frequency_hz: f64) -> Receptance6 {
        let mut r = Receptance6::zeros();
        for (corner, frf) in self.blocks() {
            let step = if corner == 0 { 2 } else { 1 };
            for (i, row) in frf.receptance(frequency_hz).iter().enumerate() {
                for (j, value) in row.iter().enumerate() {
                    r[(corner + step * i, corner + step * j)] = *value;
                }
            }
        }
        r
    }

    fn band_hz(&self) -> (f64, f64) {
        let bands = self.blocks().map(|(_, frf)| frf.band_hz());
        bands
            .reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
            .unwrap_or((1.0, 2.0))
    }

    fn seed_grid_hz(&self) -> Vec<f64> {
        self.blocks().flat_map(|(_, frf)| frf.seed_grid_hz()).collect()
    }
}

/// A tool beam with the frequencies that are worth looking at.
#[derive(Debug, Clone, Default)]
pub struct ToolDynamics {
    /// The tool as a beam.
    pub beam: ToolBeam,
    /// Of the tool clamped at the holder face, Hz: bending, and tension and twist.
    pub clamped_hz: [Vec<f64>; 2],
    /// Up to where chatter of the tool is sought; 0 without a tool.
    top_hz: f64,
}

/// No mode of the tool above this limits a cut that a robot makes.
const HIGHEST_HZ: f64 = 30_000.0;
/// Modes in bending, and in tension and twist, that chatter is sought around …
const MODES: [usize; 2] = [2, 1];
/// … up to the highest of them times this.
const ABOVE: f64 = 1.3;
/// Frequencies are seeded densely from the tool's lowest mode times this on (the holder's give lowers it) …
const BELOW: f64 = 0.3;
/// … in steps of this share: closer than where the flank of any resonance that matters shows.
const STEP: f64 = 0.015;

impl ToolDynamics {
    /// Finds the frequencies of the clamped tool.
    pub fn new(beam: ToolBeam) -> Self {
        if beam.segments.is_empty() {
            return ToolDynamics::default();
        }
        let clamped_hz = beam.clamped_hz(HIGHEST_HZ);
        let highest = clamped_hz
            .iter()
            .zip(MODES)
            .filter_map(|(f, count)| f.iter().take(count).next_back())
            .fold(0.0, |a: f64, b| a.max(*b));
        ToolDynamics {
            beam,
            top_hz: if highest > 0.0 {
                (ABOVE * highest).min(HIGHEST_HZ)
            } else {
                HIGHEST_HZ
            },
            clamped_hz,
        }
    }

    fn seeds_hz(&self) -> impl Iterator<Item = f64> {
        let lowest = self
            .clamped_hz
            .iter()
            .flatten()
            .copied()
            .fold(f64::INFINITY, f64::min);
        let from = BELOW * lowest.min(self.top_hz);
        let count = if self.top_hz > 0.0 {
            ((self.top_hz / from).ln() / STEP).ceil() as i32
        } else {
            0
        };
        let top = self.top_hz;
        (0..count).map(move |i| (from * (STEP * f64::from(i)).exp()).min(top))
    }
}

/// Holder and tool, coupled at the holder face.
#[derive(Clone)]
pub struct ToolPoint {
    /// What the tool is clamped in.
    pub holder: Arc<dyn Holder>,
    /// The tool from the holder face on.
    pub tool: Arc<ToolDynamics>,
}

impl ToolPoint {
    /// Receptance of the tool point in all six degrees of freedom.
    pub fn receptance(&self, frequency_hz: f64) -> Receptance6 {
        let root = self.holder.receptance(frequency_hz);
        self.tool.beam.tip(&root, frequency_hz)
    }

    /// The FRFs that a cut meets; with the axial–torsional block where `axial`.
    pub fn blocks(&self, axial: bool) -> Blocks {
        Blocks {
            lateral: Box::new(self.lateral()),
            axial: axial.then(|| Box::new(self.axial()) as Box<dyn ToolPointFrf>),
        }
    }

    /// The FRF of the lateral block: x, y.
    pub fn lateral(&self) -> ToolPointBlock {
        ToolPointBlock {
            point: self.clone(),
            at: [0, 2],
        }
    }

    /// The FRF of the axial–torsional block: along the tool (m, N), about it (rad, N·m).
    pub fn axial(&self) -> ToolPointBlock {
        ToolPointBlock {
            point: self.clone(),
            at: [4, 5],
        }
    }
}

/// Two of the six degrees of freedom of a tool point.
pub struct ToolPointBlock {
    point: ToolPoint,
    at: [usize; 2],
}

impl ToolPointFrf for ToolPointBlock {
    fn receptance(&self, frequency_hz: f64) -> Receptance {
        let all = self.point.receptance(frequency_hz);
        self.at.map(|i| self.at.map(|j| all[(i, j)]))
    }

    fn band_hz(&self) -> (f64, f64) {
        let (low, high) = self.point.holder.band_hz();
        (low, high.max(self.point.tool.top_hz))
    }

    fn seed_grid_hz(&self) -> Vec<f64> {
        let (low, high) = self.band_hz();
        let mut grid = self.point.holder.seed_grid_hz();
        grid.extend(self.point.tool.seeds_hz());
        grid.extend([low, high]);
        grid.retain(|f| (low..=high).contains(f));
        grid.sort_by(f64::total_cmp);
        grid.dedup_by(|b, a| *b - *a <= 1e-9 * *b);
        grid
    }
}
