//! Measured FRFs arranged for fitting: grouped by what the model has to be set up for once.

use num_complex::Complex64;
use rayon::prelude::*;

use crate::campaign::{Campaign, FrfSet, MeasuredDof};
use crate::robot::Kinematics;
use crate::robot::RobotModel;
use crate::signal::frf_noise;
use crate::{InputError, Result};

/// One FRF as data: receptance and its noise.
#[derive(Debug, Clone)]
pub struct FrfDatum {
    pub name: String,
    pub posture: usize,
    pub response: MeasuredDof,
    pub reference: MeasuredDof,
    /// Index into the block's outputs.
    pub out: usize,
    pub input: usize,
    /// m/N, on the block's lines.
    pub receptance: Vec<Complex64>,
    /// Standard deviation of the complex value on each line, m/N, greater than zero.
    pub noise_std: Vec<f64>,
}

/// FRFs of one posture and force level on one frequency axis: the model is set up once for all of them.
#[derive(Debug, Clone)]
pub struct FrfBlock {
    pub posture: usize,
    pub force_level_n: Option<f64>,
    pub kinematics: Kinematics,
    pub frequency_hz: Vec<f64>,
    /// Degrees of freedom that occur as response or reference.
    pub outputs: Vec<MeasuredDof>,
    pub frfs: Vec<FrfDatum>,
}

/// All FRFs of a campaign.
#[derive(Debug, Clone)]
pub struct FrfData {
    pub blocks: Vec<FrfBlock>,
    pub posture_ids: Vec<String>,
}

/// Share of an FRF's rms taken as noise where there are too few lines to estimate it.
const FALLBACK_RELATIVE_NOISE: f64 = 0.05;

impl FrfData {
    pub fn new(campaign: &Campaign, model: &RobotModel, set: FrfSet) -> Result<Self> {
        if set.frfs.is_empty() {
            return Err(InputError::new("the campaign has no FRFs")
                .file(campaign.dir.join("campaign.toml"))
                .key("frf")
                .remedy("add [[frf]] tables that name the measured FRF files")
                .into());
        }
        let mut blocks: Vec<FrfBlock> = Vec::new();
        for frf in set.frfs {
            let found = blocks.iter_mut().find(|b| {
                b.posture == frf.posture
                    && b.force_level_n == frf.force_level_n
                    && b.frequency_hz == frf.frequency_hz
            });
            let block = match found {
                Some(block) => block,
                None => {
                    let kinematics = model.kinematics(&campaign.postures[frf.posture].joints_deg)?;
                    blocks.push(FrfBlock {
                        posture: frf.posture,
                        force_level_n: frf.force_level_n,
                        kinematics,
                        frequency_hz: frf.frequency_hz.clone(),
                        outputs: Vec::new(),
                        frfs: Vec::new(),
                    });
                    let last = blocks.len() - 1;
                    &mut blocks[last]
                }
            };
            let mut index = |dof: MeasuredDof| match block.outputs.iter().position(|o| *o == dof) {
                Some(i) => i,
                None => {
                    block.outputs.push(dof);
                    block.outputs.len() - 1
                }
            };
            let (out, input) = (index(frf.response), index(frf.reference));
            block.frfs.push(FrfDatum {
                name: frf.name,
                posture: frf.posture,
                response: frf.response,
                reference: frf.reference,
                out,
                input,
                noise_std: Vec::new(),
                receptance: frf.receptance_m_per_n,
            });
        }
        blocks.par_iter_mut().for_each(estimate_noise);
        let posture_ids = campaign.postures.iter().map(|p| p.id.clone()).collect();
        Ok(FrfData { blocks, posture_ids })
    }

    pub fn frfs(&self) -> impl Iterator<Item = (&FrfBlock, &FrfDatum)> {
        self.blocks
            .iter()
            .flat_map(|b| b.frfs.iter().map(move |f| (b, f)))
    }

    /// Postures that have FRFs, in campaign order.
    pub fn measured_postures(&self) -> Vec<usize> {
        let mut postures: Vec<usize> = self.blocks.iter().map(|b| b.posture).collect();
        postures.sort_unstable();
        postures.dedup();
        postures
    }

    /// The FRFs of the postures for which `keep` says yes.
    pub fn filtered(&self, keep: impl Fn(usize) -> bool) -> FrfData {
        FrfData {
            blocks: self.blocks.iter().filter(|b| keep(b.posture)).cloned().collect(),
            posture_ids: self.posture_ids.clone(),
        }
    }

    /// Number of complex values.
    pub fn value_count(&self) -> usize {
        self.frfs().map(|(_, f)| f.receptance.len()).sum()
    }

    /// sqrt(Σ σ² / Σ |H|²): the error that a perfect model would show.
    pub fn noise_floor_nrms(&self) -> f64 {
        let (mut noise, mut signal) = (0.0, 0.0);
        for (_, frf) in self.frfs() {
            noise += frf.noise_std.iter().map(|s| s * s).sum::<f64>();
            signal += frf.receptance.iter().map(|h| h.norm_sqr()).sum::<f64>();
        }
        if signal > 0.0 {
            (noise / signal).sqrt()
        } else {
            0.0
        }
    }
}

/// Sets the noise of every FRF of a block from the block's own scatter.
fn estimate_noise(block: &mut FrfBlock) {
    let slices: Vec<&[Complex64]> = block.frfs.iter().map(|f| f.receptance.as_slice()).collect();
    let estimates = frf_noise::estimate(&block.frequency_hz, &slices);
    for (frf, estimate) in block.frfs.iter_mut().zip(estimates) {
        let rms =
            (frf.receptance.iter().map(|h| h.norm_sqr()).sum::<f64>() / frf.receptance.len() as f64).sqrt();
        let std = match estimate {
            Some(estimate) => estimate.std,
            None => vec![FALLBACK_RELATIVE_NOISE * rms; frf.receptance.len()],
        };
        // A noise-free (synthetic) record must not get infinite weights.
        let least = (1e-6 * rms).max(f64::MIN_POSITIVE);
        frf.noise_std = std.into_iter().map(|s| s.max(least)).collect();
    }
}
