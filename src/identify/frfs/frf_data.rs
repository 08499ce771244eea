//! Measured FRFs arranged for fitting: grouped by what the model has to be set up for once.

use std::f64::consts::TAU;
use std::sync::Arc;

use num_complex::Complex64;
use rayon::prelude::*;

use crate::data::{Axis, MeasuredDof, MeasuredFrf, Posture};
use crate::effects::{Conditions, DataSummary};
use crate::robot::Kinematics;
use crate::robot::RobotModel;
use crate::signal::frf_noise;
use crate::{InputError, Result};

/// One FRF as data: receptance and its noise.
#[derive(Debug, Clone)]
pub struct FrfDatum {
    /// Posture and degrees of freedom, `p1 1X/1X`.
    pub name: String,
    /// Index into the postures.
    pub posture: usize,
    /// Point and axis of the response.
    pub response: MeasuredDof,
    /// Point and axis of the hit.
    pub reference: MeasuredDof,
    /// Indices into the block's outputs of the response point's x, y and z.
    pub response_outputs: [usize; 3],
    /// Index into the block's outputs of the reference.
    pub input: usize,
    /// −1 where one of response and reference is along a negative axis.
    pub sign: f64,
    /// m/N, on the block's lines.
    pub receptance: Vec<Complex64>,
    /// Standard deviation of the complex value on each line, m/N, greater than zero.
    pub noise_std: Vec<f64>,
}

/// FRFs of one posture and force level on one frequency axis: the model is set up once for all of them.
#[derive(Debug, Clone)]
pub struct FrfBlock {
    /// Index into the postures.
    pub posture: usize,
    /// Of the hammer; `None` where nobody says.
    pub force_level_n: Option<f64>,
    /// Level of the hammer and order of the posture.
    pub conditions: Conditions,
    /// Where the robot's frames are at the posture.
    pub kinematics: Kinematics,
    /// Ascending, above zero.
    pub frequency_hz: Vec<f64>,
    /// Point (index into the campaign's points) and axis of what the model has to give: the references, and all three
    /// axes of every response point (a turned sensor mixes them).
    pub outputs: Vec<(usize, Axis)>,
    /// In the order in which they were given.
    pub frfs: Vec<FrfDatum>,
}

impl FrfBlock {
    /// iω of each line, rad/s.
    pub fn rates(&self) -> Vec<Complex64> {
        (0..self.frequency_hz.len()).map(|line| self.rate(line)).collect()
    }

    /// iω of a line, rad/s.
    pub fn rate(&self, line: usize) -> Complex64 {
        Complex64::new(0.0, TAU * self.frequency_hz[line])
    }

    /// The outputs that are hit, as indices into them, ascending.
    pub fn inputs(&self) -> Vec<usize> {
        let mut inputs: Vec<usize> = self.frfs.iter().map(|f| f.input).collect();
        inputs.sort_unstable();
        inputs.dedup();
        inputs
    }
}

/// All FRFs of a campaign.
#[derive(Debug, Clone)]
pub struct FrfData {
    /// One a posture, hammer level and frequency axis.
    pub blocks: Vec<Arc<FrfBlock>>,
    /// One a posture, measured or not.
    pub posture_ids: Vec<String>,
}

/// Share of an FRF's rms taken as noise where there are too few lines to estimate it.
const FALLBACK_RELATIVE_NOISE: f64 = 0.05;

impl FrfData {
    /// FRFs arranged for fitting, with the noise that they show. `postures` and the points of the FRFs are told by their
    /// index.
    ///
    /// # Errors
    /// No FRFs, or a posture that does not fit the robot.
    pub fn new(postures: &[Posture], model: &RobotModel, frfs: Vec<MeasuredFrf>) -> Result<Self> {
        if frfs.is_empty() {
            return Err(InputError::new("there are no FRFs to fit a model to").into());
        }
        let mut data = Self::arrange(postures, model, frfs)?;
        data.blocks
            .par_iter_mut()
            .for_each(|block| estimate_noise(Arc::make_mut(block)));
        Ok(data)
    }

    /// Where the robot's frames are at each posture; `None` where nothing was measured.
    pub fn kinematics_by_posture(&self) -> Vec<Option<&Kinematics>> {
        let mut all = vec![None; self.posture_ids.len()];
        for block in &self.blocks {
            all[block.posture] = Some(&block.kinematics);
        }
        all
    }

    /// The same FRFs where the robot stood as `at` has it by posture; as it is filed where that says nothing.
    pub fn with_kinematics<'k>(&self, at: impl Fn(usize) -> Option<&'k Kinematics>) -> FrfData {
        let mut data = self.clone();
        for block in &mut data.blocks {
            if let Some(kinematics) = at(block.posture) {
                Arc::make_mut(block).kinematics = kinematics.clone();
            }
        }
        data
    }

    /// Groups FRFs into blocks; their noise is not known yet (`noise_std` stays empty).
    ///
    /// # Errors
    /// A posture that does not fit the robot.
    pub fn arrange(postures: &[Posture], model: &RobotModel, frfs: Vec<MeasuredFrf>) -> Result<Self> {
        let mut blocks: Vec<FrfBlock> = Vec::new();
        for frf in frfs {
            let found = blocks.iter_mut().find(|b| {
                b.posture == frf.posture
                    && b.force_level_n == frf.force_level_n
                    && b.frequency_hz == frf.frequency_hz
            });
            let block = match found {
                Some(block) => block,
                None => {
                    let kinematics = model.kinematics(&postures[frf.posture].joints_deg)?;
                    blocks.push(FrfBlock {
                        posture: frf.posture,
                        force_level_n: frf.force_level_n,
                        conditions: Conditions {
                            level_fraction: 0.0,
                            order_fraction: frf.posture as f64 / (postures.len().max(2) - 1) as f64,
                        },
                        kinematics,
                        frequency_hz: frf.frequency_hz.clone(),
                        outputs: Vec::new(),
                        frfs: Vec::new(),
                    });
                    let last = blocks.len() - 1;
                    &mut blocks[last]
                }
            };
            let mut index = |point: usize, axis: Axis| {
                let known = block.outputs.iter().position(|o| *o == (point, axis));
                known.unwrap_or_else(|| {
                    block.outputs.push((point, axis));
                    block.outputs.len() - 1
                })
            };
            let response_outputs = Axis::ALL.map(|axis| index(frf.response.point, axis));
            let input = index(frf.reference.point, frf.reference.axis);
            let sign = if frf.response.negative == frf.reference.negative {
                1.0
            } else {
                -1.0
            };
            block.frfs.push(FrfDatum {
                name: frf.name,
                posture: frf.posture,
                response: frf.response,
                reference: frf.reference,
                response_outputs,
                input,
                sign,
                noise_std: Vec::new(),
                receptance: frf.receptance_m_per_n,
            });
        }
        set_lowness(&mut blocks);
        let posture_ids = postures.iter().map(|p| p.id.clone()).collect();
        let blocks = blocks.into_iter().map(Arc::new).collect();
        Ok(FrfData { blocks, posture_ids })
    }

    /// These FRFs and those of `other`, which has the same postures; hammer levels are ordered anew.
    pub fn joined(&self, other: &FrfData) -> FrfData {
        let all = self.blocks.iter().chain(&other.blocks);
        let mut blocks: Vec<FrfBlock> = all.map(|b| b.as_ref().clone()).collect();
        set_lowness(&mut blocks);
        FrfData {
            blocks: blocks.into_iter().map(Arc::new).collect(),
            posture_ids: self.posture_ids.clone(),
        }
    }

    /// Every FRF with its block, block by block: the order of all predictions.
    pub fn frfs(&self) -> impl Iterator<Item = (&FrfBlock, &FrfDatum)> {
        let blocks = self.blocks.iter().map(Arc::as_ref);
        blocks.flat_map(|b: &FrfBlock| b.frfs.iter().map(move |f| (b, f)))
    }

    /// Postures that have FRFs, in campaign order.
    pub fn measured_postures(&self) -> Vec<usize> {
        let mut postures: Vec<usize> = self.blocks.iter().map(|b| b.posture).collect();
        postures.sort_unstable();
        postures.dedup();
        postures
    }

    /// Numbers of the points that responses were measured at, in order.
    pub fn response_points(&self) -> Vec<usize> {
        let mut points: Vec<usize> = self.frfs().map(|(_, f)| f.response.point).collect();
        points.sort_unstable();
        points.dedup();
        points
    }

    /// The FRFs of the postures for which `keep` says yes.
    pub fn filtered(&self, keep: impl Fn(usize) -> bool) -> FrfData {
        FrfData {
            blocks: self.blocks.iter().filter(|b| keep(b.posture)).cloned().collect(),
            posture_ids: self.posture_ids.clone(),
        }
    }

    /// Every `stride`-th line, and of the FRFs of each response point and axis every `every`-th reference in turn, so that
    /// all points, axes and references stay represented.
    pub fn thinned(&self, stride: usize, every: usize) -> FrfData {
        let thin = |block: &Arc<FrfBlock>| {
            let mut block = block.as_ref().clone();
            let mut responses: Vec<(MeasuredDof, usize)> = Vec::new();
            block.frfs.retain(|frf| {
                let index = responses.iter().position(|(dof, _)| *dof == frf.response);
                let index = index.unwrap_or_else(|| {
                    // The first reference that is kept differs from response to response.
                    responses.push((frf.response, responses.len() % every));
                    responses.len() - 1
                });
                responses[index].1 += 1;
                responses[index].1.is_multiple_of(every)
            });
            block.frequency_hz = block.frequency_hz.iter().step_by(stride).copied().collect();
            for frf in &mut block.frfs {
                frf.receptance = frf.receptance.iter().step_by(stride).copied().collect();
                frf.noise_std = frf.noise_std.iter().step_by(stride).copied().collect();
            }
            Arc::new(block)
        };
        FrfData {
            blocks: self
                .blocks
                .iter()
                .map(thin)
                .filter(|b| !b.frfs.is_empty())
                .collect(),
            posture_ids: self.posture_ids.clone(),
        }
    }

    /// What effects need to know of the data.
    pub fn summary(&self) -> DataSummary {
        let lines = || self.blocks.iter().flat_map(|b| b.frequency_hz.iter().copied());
        let mut levels: Vec<f64> = self.blocks.iter().map(|b| b.conditions.level_fraction).collect();
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        DataSummary {
            force_levels: levels.len(),
            postures: self.measured_postures().len(),
            lowest_hz: lines().fold(f64::INFINITY, f64::min),
            highest_hz: lines().fold(0.0, f64::max),
        }
    }

    /// Number of complex values.
    pub fn value_count(&self) -> usize {
        self.frfs().map(|(_, f)| f.receptance.len()).sum()
    }

    /// At most `most` FRFs of each block, evenly chosen.
    pub fn fewer_frfs(&self, most: usize) -> FrfData {
        let fewer = |block: &Arc<FrfBlock>| {
            let count = block.frfs.len();
            if count <= most {
                return block.clone();
            }
            let mut block = block.as_ref().clone();
            let mut index = 0..;
            // Where i · most / count passes a whole number.
            let kept = |i: usize| i * most / count != (i + 1) * most / count;
            block.frfs.retain(|_| index.next().is_some_and(kept));
            Arc::new(block)
        };
        FrfData {
            blocks: self.blocks.iter().map(fewer).collect(),
            posture_ids: self.posture_ids.clone(),
        }
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

fn set_lowness(blocks: &mut [FrfBlock]) {
    let levels = || blocks.iter().filter_map(|b| b.force_level_n);
    let (low, high) = (
        levels().fold(f64::INFINITY, f64::min),
        levels().fold(0.0, f64::max),
    );
    if high > low && low > 0.0 {
        for block in blocks.iter_mut() {
            let level = block.force_level_n.unwrap_or(high);
            block.conditions.level_fraction = (high / level).ln() / (high / low).ln();
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
