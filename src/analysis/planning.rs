//! A campaign before it is measured: its planned FRFs put together, and what they would show.

use std::sync::Arc;

use num_complex::Complex64;

use super::structure_case::{frf_data, structure_model};
use crate::campaign::{BodyRef, Campaign, MeasuredDof, MeasuredFrf, Point};
use crate::discrepancy::outlook::plan::PlanOutlook;
use crate::identify::{FrfData, StructureModel};
use crate::ingest::{Axis, Dof};
use crate::signal::noise_law::FrfNoise;
use crate::{InputError, Result};

/// What is expected where neither file nor campaign says it; every `Some` overrides campaign.toml.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlanRequest {
    /// Noise as a share of the response.
    pub noise_relative: Option<f64>,
    /// Noise that is always there, m/N.
    pub noise_floor_m_per_n: Option<f64>,
    /// First and last line, Hz.
    pub band_hz: Option<[f64; 2]>,
    /// Spacing of the lines, Hz.
    pub lines_hz: Option<f64>,
    /// Where responses are planned; empty: as `[plan]` has it.
    pub responses: Vec<Dof>,
    /// Where hits are planned; empty: as `[plan]` has it.
    pub hits: Vec<Dof>,
}

/// Usual noise: 3 % of the response, and a floor (complex standard deviations).
const NOISE: (f64, f64) = (0.03, 2e-8);
/// Usual band of a robot's tap test, Hz.
const BAND_HZ: [f64; 2] = [3.0, 90.0];
const LINES_HZ: f64 = 0.2;
/// Lines that a planned FRF may have.
const MOST_LINES: f64 = 20_000.0;

/// The plan and what it was made for.
pub struct PlanFindings {
    /// What the planned FRFs would show.
    pub plan: PlanOutlook,
    /// Planned FRFs; measured ones are not counted.
    pub planned: usize,
    /// FRFs that were measured already.
    pub measured: usize,
    /// Names of the postures.
    pub postures: Vec<String>,
    /// Noise that was assumed.
    pub noise: FrfNoise,
    /// What was noticed while the plan was made.
    pub warnings: Vec<String>,
}

impl PlanFindings {
    /// `campaign`: from [`Campaign::load_planned`].
    ///
    /// # Errors
    /// No robot, no postures, no points, a node without a point, or a file that cannot be read.
    pub fn run(campaign: &Campaign, request: &PlanRequest) -> Result<Self> {
        let model = structure_model(campaign)?;
        let plan = &campaign.plan;
        let or_section = |own: &[Dof], section: &[Dof]| {
            if own.is_empty() {
                section.to_vec()
            } else {
                own.to_vec()
            }
        };
        let hits = or_section(&request.hits, &plan.hits);
        let responses = or_section(&request.responses, &plan.responses);
        let tool = campaign
            .points
            .iter()
            .position(|p| p.body == BodyRef::Tool)
            .unwrap_or(0);
        if campaign.points.is_empty() {
            return Err(missing(
                campaign,
                "point",
                "add a [[point]] for each node that is to be measured or hit",
            ));
        }
        if campaign.postures.is_empty() {
            return Err(missing(
                campaign,
                "posture",
                "add a [[posture]] for each posture that is planned",
            ));
        }
        let everything = (0..campaign.points.len()).flat_map(|p| Axis::ALL.map(|a| along(p, a)));
        let hits = match hits.is_empty() {
            true => Axis::ALL.map(|a| along(tool, a)).to_vec(),
            false => resolved(campaign, &hits, "hits")?,
        };
        let responses = match responses.is_empty() {
            true => everything.collect(),
            false => resolved(campaign, &responses, "responses")?,
        };
        let band_hz = request.band_hz.or(plan.band_hz).unwrap_or(BAND_HZ);
        let step = request.lines_hz.or(plan.lines_hz).unwrap_or(LINES_HZ);
        let count = ((band_hz[1] - band_hz[0]) / step + 1e-6).floor() + 1.0;
        if !(band_hz[0] > 0.0 && (10.0..=MOST_LINES).contains(&count)) {
            return Err(InputError::new(format!(
                "{step} Hz from {} to {} Hz gives fewer than ten lines, or far too many",
                band_hz[0], band_hz[1]
            ))
            .file(campaign.dir.join("campaign.toml"))
            .key("plan.lines_hz")
            .remedy("give band_hz = [3.0, 90.0] and lines_hz = 0.2, or --band 3,90 --lines-hz 0.2")
            .into());
        }
        let lines: Vec<f64> = (0..count as usize)
            .map(|k| band_hz[0] + step * k as f64)
            .collect();

        // Which files are there, and which are still to come.
        let (there, to_come): (Vec<_>, Vec<_>) =
            campaign.frfs.iter().cloned().partition(|f| f.file.is_file());
        let mut stands: Vec<(usize, Option<f64>)> =
            to_come.iter().map(|f| (f.posture, f.force_level_n)).collect();
        if campaign.frfs.is_empty() {
            stands = (0..campaign.postures.len()).map(|p| (p, None)).collect();
        }
        stands.dedup();
        let mut warnings = campaign.beyond_limits.clone();
        let measured = match there.is_empty() {
            true => None,
            false => {
                let present = Campaign {
                    frfs: there,
                    ..campaign.clone()
                };
                let (set, notes) = present.load_frfs()?;
                warnings.extend(notes);
                Some(frf_data(&present, &model.robot, set)?)
            }
        };
        let mut frfs = Vec::new();
        for (posture, force_level_n) in &stands {
            for response in &responses {
                for reference in &hits {
                    frfs.push(MeasuredFrf {
                        posture: *posture,
                        response: *response,
                        reference: *reference,
                        name: name(&campaign.points, response, reference),
                        frequency_hz: lines.clone(),
                        receptance_m_per_n: Vec::new(),
                        coherence: None,
                        force_level_n: *force_level_n,
                        file: Default::default(),
                    });
                }
            }
        }
        let noise = FrfNoise {
            relative: request.noise_relative.or(plan.noise_relative).unwrap_or(NOISE.0),
            floor: request
                .noise_floor_m_per_n
                .or(plan.noise_floor_m_per_n)
                .unwrap_or(NOISE.1),
            power: 0,
            reference_hz: band_hz[0],
        };
        if noise.relative <= 0.0 && noise.floor <= 0.0 {
            return Err(InputError::new("without noise everything shows")
                .file(campaign.dir.join("campaign.toml"))
                .key("plan.noise_relative")
                .remedy("give the noise that is expected, such as --noise 0.03")
                .into());
        }
        let planned = frfs.len();
        let mut data = expected(
            &model,
            FrfData::arrange(&campaign.postures, &model.robot, frfs)?,
            noise,
        )?;
        let counted = measured.as_ref().map_or(0, |m| m.frfs().count());
        if let Some(measured) = measured {
            data = measured.joined(&data);
        }
        let mut postures: Vec<String> = Vec::new();
        for block in &data.blocks {
            let id = &data.posture_ids[block.posture];
            if !postures.contains(id) {
                postures.push(id.clone());
            }
        }
        Ok(PlanFindings {
            plan: PlanOutlook::new(&model, &campaign.postures, &data)?,
            planned,
            measured: counted,
            postures,
            noise,
            warnings,
        })
    }
}

/// The FRFs as the robot file predicts them, with the noise that is expected.
fn expected(model: &StructureModel, mut data: FrfData, noise: FrfNoise) -> Result<FrfData> {
    let mut predicted = model.predict(&model.nominal_theta(), &data)?.into_iter();
    for block in &mut data.blocks {
        let block = Arc::make_mut(block);
        for frf in &mut block.frfs {
            let values: Vec<Complex64> = predicted.next().unwrap_or_default();
            let lines = block.frequency_hz.iter().zip(&values);
            frf.noise_std = lines.map(|(f, h)| noise.std(*f, h.norm()).max(1e-15)).collect();
            frf.receptance = values;
        }
    }
    Ok(data)
}

fn along(point: usize, axis: Axis) -> MeasuredDof {
    MeasuredDof {
        point,
        axis,
        negative: false,
    }
}

fn resolved(campaign: &Campaign, dofs: &[Dof], key: &str) -> Result<Vec<MeasuredDof>> {
    dofs.iter()
        .map(|dof| {
            let point = campaign
                .points
                .iter()
                .position(|p| p.node == dof.node)
                .ok_or_else(|| {
                    InputError::new(format!("{dof}: there is no [[point]] with node = {}", dof.node))
                        .file(campaign.dir.join("campaign.toml"))
                        .key(format!("plan.{key}"))
                        .remedy("name a node that has a [[point]], or add one")
                })?;
            Ok(MeasuredDof {
                point,
                axis: dof.axis,
                negative: dof.negative,
            })
        })
        .collect()
}

fn name(points: &[Point], response: &MeasuredDof, reference: &MeasuredDof) -> String {
    let dof = |d: &MeasuredDof| format!("{}{}", points[d.point].node, d.axis.letter());
    format!("{}/{}", dof(response), dof(reference))
}

fn missing(campaign: &Campaign, key: &str, remedy: &str) -> crate::Error {
    InputError::new(format!("there is no [[{key}]]: nothing is planned"))
        .file(campaign.dir.join("campaign.toml"))
        .key(key)
        .remedy(remedy)
        .into()
}
