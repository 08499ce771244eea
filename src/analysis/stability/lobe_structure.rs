//! The structures that lobes are drawn for, from modes, the model or measured FRFs, and their lobes.

use crate::analysis::modes::modal::ModalAnalysis;
use crate::analysis::stability::lobe_case::{BEST, LobeCase, LobesBefore};
use crate::analysis::stability::lobe_model::{Asked, Dynamics, ModelState};
use crate::analysis::stability::lobe_setup::modes_of_table;
use crate::analysis::stability::measured_structures::measured_structures;
use crate::analysis::workbench::Workbench;
use crate::campaign::{Campaign, LobeMethod, LobesSection, Process};
use crate::lobes::band;
use crate::lobes::drilling::hole::{HoleCheck, HoleError};
use crate::lobes::drilling::whirling::whirl_speeds;
use crate::lobes::dynamics::feed_stiffness::FeedStiffness;
use crate::lobes::dynamics::tool_point::MeasuredHolder;
use crate::lobes::outcome::{LimitRange, NotedCut};
use crate::lobes::setup::{DrilledHole, LobeCut};
use crate::lobes::{
    BlockSolver, Blocks, MultiFrequency, SemiDiscretisation, SpeedLimit, StateSpace, ToolPointFrf,
};
use crate::{InputError, Result};

/// FRFs measured farther than this from the holder face get a warning, m.
const FACE_OFF_M: f64 = 0.01;
/// Share of the lines on the modes' curve from which on that is said.
const MOSTLY: f64 = 0.5;

/// One structure that lobes are drawn for.
pub(crate) struct LobeStructure {
    pub posture: Option<String>,
    pub dynamics: Dynamics,
    /// The same before effects were added.
    before: Option<Dynamics>,
    hole: Option<HoleError>,
    feed_stiffness: Option<FeedStiffness>,
    /// The same structure with parameters drawn from their uncertainty.
    variants: Vec<Blocks>,
    description: String,
}

impl Dynamics {
    fn method(&self, cut: &LobeCut) -> Box<dyn SpeedLimit + '_> {
        let frf = self.blocks.lateral.as_ref();
        match (cut, &self.states) {
            (LobeCut::Averaged(cut), _) => Box::new(cut.on(&self.blocks)),
            (LobeCut::Periodic(force), Some(states)) => {
                Box::new(SemiDiscretisation::new(*force, states.clone(), frf))
            }
            (LobeCut::Periodic(force), None) => Box::new(MultiFrequency::new(*force, frf)),
        }
    }

    /// The lobes of the model before effects were added.
    pub(crate) fn lobes_before(&self, cut: &LobeCut, speeds: &[f64]) -> LobesBefore {
        let method = self.method(cut);
        let curve = method.curve(speeds);
        LobesBefore {
            absolute: method.absolute_limit().or(curve.least()),
            curve,
        }
    }
}

impl LobeStructure {
    /// The cut on the structure as drawn from its uncertainty; empty where that is not known.
    pub fn drawn(&self, cut: &LobeCut) -> Vec<BlockSolver<'_>> {
        match cut {
            LobeCut::Averaged(cut) => band::solvers(cut, &self.variants),
            LobeCut::Periodic(_) => Vec::new(),
        }
    }

    /// The limit at the speed of every noted cut, with what the draws make of it.
    pub fn at_cuts(&self, cut: &LobeCut, noted: &[NotedCut], drawn: &[BlockSolver<'_>]) -> Vec<LimitRange> {
        let speeds: Vec<f64> = noted.iter().map(|c| c.spindle_rpm).collect();
        let band = (!drawn.is_empty()).then(|| band::band(drawn, &speeds));
        let limits = self.dynamics.method(cut).curve(&speeds).depth_limit_mm;
        let limits = limits.into_iter().enumerate().map(|(i, limit)| {
            let quantiles = band.as_ref().map(|b| [b.lower_mm[i], b.upper_mm[i]]);
            LimitRange::new(limit, quantiles)
        });
        limits.collect()
    }

    /// `drilled`: the hole, where it is known.
    pub fn case(
        self,
        cut: &LobeCut,
        speeds: &[f64],
        noted: &[NotedCut],
        process: Process,
        drilled: Option<DrilledHole>,
    ) -> LobeCase {
        let method = self.dynamics.method(cut);
        let curve = method.curve(speeds);
        let (absolute, mut best) = (
            method.absolute_limit().or(curve.least()),
            method.best(&curve, BEST),
        );
        let drawn = self.drawn(cut);
        let band_at = |at: &[f64]| (!drawn.is_empty()).then(|| band::band(&drawn, at));
        let at_cuts = self.at_cuts(cut, noted, &drawn);
        let band = band_at(speeds);
        let by_block = match cut {
            LobeCut::Averaged(cut) => cut.on(&self.dynamics.blocks).by_block(speeds),
            LobeCut::Periodic(_) => None,
        };
        let whirling = match process {
            Process::Drilling => whirl_speeds(
                self.dynamics.blocks.lateral.as_ref(),
                &cut.average().on(&self.dynamics.blocks).lateral,
                cut.average().lateral.teeth,
                [
                    speeds.first().copied().unwrap_or(0.0),
                    speeds.last().copied().unwrap_or(0.0),
                ],
                drilled.map(|h| h.width_mm),
            ),
            Process::Milling | Process::Turning => Vec::new(),
        };
        let tips: Vec<f64> = best.iter().map(|p| p.spindle_rpm).collect();
        if let Some(at_tips) = band_at(&tips) {
            for (peak, lower) in best.iter_mut().zip(at_tips.lower_mm) {
                peak.lower_quantile_mm = lower;
            }
        }
        LobeCase {
            angle_deg: None,
            band_hz: self.dynamics.blocks.band_hz(),
            absolute,
            by_block,
            best,
            band,
            before: self.before.as_ref().map(|b| b.lobes_before(cut, speeds)),
            hole: self.hole,
            feed_stiffness: self.feed_stiffness,
            whirling,
            at_cuts,
            curve,
            posture: self.posture,
            description: self.description,
        }
    }
}

pub(crate) fn from_modes(
    campaign: &Campaign,
    section: &LobesSection,
    asked: &Asked,
) -> Result<Vec<LobeStructure>> {
    let modes = modes_of_table(campaign, section)?;
    let count = modes.lateral.modes().len();
    let along = section.modes.len() - count;
    let mut description = format!("{count} modes in x and y from campaign.toml");
    match (along, asked.axial) {
        (0, _) => {}
        (_, true) => description += &format!(", {along} in z and theta"),
        (_, false) => description += &format!("; {along} in z or theta not used (the lateral block only)"),
    }
    description += &asked.with_tool();
    let states = steps_through_time(section).then(|| StateSpace::from(&modes.lateral));
    let blocks = if asked.couples() {
        asked.point(modes).blocks(asked.axial)
    } else {
        let axial = modes.axial.filter(|_| asked.axial);
        Blocks {
            lateral: Box::new(modes.lateral),
            axial: axial.map(|frf| Box::new(frf) as Box<dyn ToolPointFrf>),
        }
    };
    let blocks = asked.in_hole(blocks);
    Ok(vec![LobeStructure {
        posture: None,
        dynamics: Dynamics { blocks, states },
        before: None,
        hole: None,
        feed_stiffness: None,
        variants: Vec::new(),
        description,
    }])
}

pub(crate) fn steps_through_time(section: &LobesSection) -> bool {
    section.method == LobeMethod::SemiDiscretisation
}

/// The robot model at every posture.
pub(crate) fn at_postures(
    campaign: &Campaign,
    section: &LobesSection,
    state: &ModelState,
    check: Option<&HoleCheck>,
) -> Result<Vec<LobeStructure>> {
    campaign
        .postures
        .iter()
        .map(|posture| {
            let (joints, through_time) = (&posture.joints_deg, steps_through_time(section));
            let before = state.before.as_ref();
            Ok(LobeStructure {
                posture: Some(posture.id.clone()),
                dynamics: state.dynamics(&state.current, joints, through_time)?,
                before: before
                    .map(|b| state.dynamics(b, joints, through_time))
                    .transpose()?,
                hole: check.map(|c| state.hole(joints, &c.load)).transpose()?,
                feed_stiffness: state.feed_stiffness(joints, section.process)?,
                variants: state.variants(joints)?,
                description: state.description.clone(),
            })
        })
        .collect()
}

pub(crate) fn from_measured(
    campaign: &Workbench,
    section: &LobesSection,
    asked: &Asked,
    warnings: &mut Vec<String>,
) -> Result<Vec<LobeStructure>> {
    if steps_through_time(section) {
        return Err(InputError::new("semi-discretisation needs modes, and measured FRFs are none")
            .file(campaign.dir.join("campaign.toml"))
            .key("lobes.method")
            .remedy("use method = \"multi-frequency\" on the measured FRFs, or source = \"model\" or \"modes\"")
            .into());
    }
    let (set, read_warnings) = campaign.load_frfs()?;
    warnings.extend(read_warnings);
    // Too few lines for modes: as measured.
    let modes = ModalAnalysis::usual(campaign).ok();
    let structures = measured_structures(campaign, &set, modes.as_deref())?;
    let has_tool = !asked.tool.beam.segments.is_empty();
    let coupled = asked.couples();
    let model = match (coupled, &campaign.robot) {
        (true, Some(_)) => Some(ModelState::of(campaign, asked.clone(), warnings)?),
        _ => None,
    };
    if has_tool {
        warnings.push(match model {
            Some(_) => "the tool of [lobes.tool] is coupled to the measured FRFs: the turns of the holder face, which were not \
                        measured, are the calibrated robot model's"
                .into(),
            None => "the tool of [lobes.tool] is coupled to the measured FRFs: the holder face is taken not to turn, as \
                     rotations were not measured and there is no [robot] to take them from"
                .into(),
        });
    }
    if !asked.contacts.is_empty() {
        warnings.push(match model {
            Some(_) => "[[contact]] is coupled to the measured FRFs: how motion along the tool and across it go together, which was \
                        not measured, is the calibrated robot model's"
                .into(),
            None => "[[contact]] is coupled to the measured FRFs: motion along the tool and across it are taken as having nothing \
                     to do with each other, as there is no [robot] to take that from"
                .into(),
        });
    }
    let length_m = asked.tool.beam.length_m();
    structures
        .into_iter()
        .map(|s| {
            let posture = &campaign.postures[s.posture];
            warnings.extend(s.notes.iter().map(|n| format!("{}: {n}", posture.id)));
            // In the tool's frame z points from the spindle to the workpiece, its origin is the tool point.
            let off_m = (s.position_m[2] + length_m).abs();
            if has_tool && off_m > FACE_OFF_M {
                warnings.push(format!(
                    "{}: the FRFs were measured {:.0} mm from the holder face, which lies {:.0} mm behind the tool point by \
                     [lobes.tool]; they are taken as the holder face's",
                    posture.id,
                    1e3 * off_m,
                    1e3 * length_m
                ));
            }
            let blocks = if coupled {
                let holder = MeasuredHolder {
                    lateral: s.frf,
                    axial: s.axial,
                    model: model.as_ref().map(|m| m.holder(&posture.joints_deg)).transpose()?,
                };
                asked.point(holder).blocks(asked.axial)
            } else {
                Blocks {
                    lateral: Box::new(s.frf),
                    axial: s
                        .axial
                        .filter(|_| asked.axial)
                        .map(|frf| Box::new(frf) as Box<dyn ToolPointFrf>),
                }
            };
            let blocks = asked.in_hole(blocks);
            Ok(LobeStructure {
                posture: Some(posture.id.clone()),
                dynamics: Dynamics { blocks, states: None },
                before: None,
                hole: None,
                feed_stiffness: None,
                variants: Vec::new(),
                description: format!(
                    "measured FRFs{}{}",
                    match s.smoothed_share > MOSTLY {
                        true => ", noise taken out by their modes",
                        false => "",
                    },
                    asked.with_tool()
                ),
            })
        })
        .collect()
}
