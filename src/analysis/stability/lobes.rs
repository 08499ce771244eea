//! The lobes that a campaign's `[lobes]` table asks for.

use std::sync::Arc;

use crate::analysis::stability::hole_check::hole_check;
pub use crate::analysis::stability::lobe_case::{BEST, LobeCase, LobesBefore};
use crate::analysis::stability::lobe_model::{Asked, ModelState};
use crate::analysis::stability::lobe_setup::{
    coefficients_of_group, cut_of, flank_damping, group_of_cuts, predicted_drill,
};
use crate::analysis::stability::lobe_structure::{
    LobeStructure, at_postures, from_measured, from_modes, steps_through_time,
};
use crate::analysis::stability::noted_cuts::noted_cuts;
use crate::analysis::stability::redundancy::{self, RedundancyAnalysis};
use crate::analysis::workbench::Workbench;
use crate::campaign::{Campaign, ContactDirection, LobeMethod, LobeSource, LobesSection, Process};
use crate::cutting::{DrillPrediction, ForceGroup};
use crate::lobes::drilling::flank_damping::FlankDamping;
use crate::lobes::drilling::hole::HoleCheck;
use crate::lobes::outcome::{LimitRange, Outcomes};
use crate::lobes::setup::{DrilledHole, LobeCoefficients, LobeCut, axial_torsional_force};
use crate::lobes::{AbsoluteLimit, Peak, ToolDynamics, speed_grid};
use crate::{InputError, Result};

/// Why a drill's axial–torsional block is left out where the FRFs do not have it.
const NOTHING_ALONG: &str = "the FRFs have nothing along the tool or about it: add [[lobes.mode]] tables with axis = \"z\" \
                             or \"theta\", FRFs ZZ of the tool point, or [lobes.tool]";
/// Changes of the limit below this share are not worth a word.
const SAME: f64 = 0.005;

/// All lobes of a campaign.
#[derive(Debug, Clone)]
pub struct LobeAnalysis {
    /// What is cut, and how.
    pub process: Process,
    /// Where the FRFs come from.
    pub source: LobeSource,
    /// How the limit is computed.
    pub method: LobeMethod,
    /// Cutting force coefficients.
    pub coefficients: LobeCoefficients,
    /// Number of cutting edges.
    pub teeth: usize,
    /// The axial–torsional block of a drill, or why it is left out, in words for people; `None` in milling.
    pub axial_torsional: Option<std::result::Result<(), String>>,
    /// The hole that a drill cuts; `None` in milling, or where the tool is not known.
    pub drilled: Option<DrilledHole>,
    /// The drill predicted from an orthogonal database; `None` where that is not asked for.
    pub drill: Option<DrillPrediction>,
    /// Process damping of a drill's flanks; `None` where it is not asked for.
    pub flank_damping: Option<FlankDamping>,
    /// The tool as a beam; without segments where it is rigid or part of the FRFs.
    pub tool: Arc<ToolDynamics>,
    /// First and last spindle speed and the step, rpm.
    pub spindle_rpm: [f64; 3],
    /// The lobes of each posture, or of each redundancy angle.
    pub cases: Vec<LobeCase>,
    /// Where the campaign asks for the surface over the redundancy angle: its angles are the cases.
    pub redundancy: Option<RedundancyAnalysis>,
    /// `effect@site` of what is in the model besides the baseline.
    pub effects: Vec<String>,
    /// Revision of the model; `None` where nothing was ever added, or the model is not what lobes come from.
    pub revision: Option<usize>,
    /// The cuts whose outcome was noted against these lobes; `None` where there are none.
    pub outcomes: Option<Outcomes>,
    /// The forces on the tool and the tolerances behind the cases' `hole`, or why there are none; `None` where lobes do
    /// not come from the model.
    pub hole: Option<std::result::Result<HoleCheck, String>>,
    /// What was noticed while reading, fitting and computing.
    pub warnings: Vec<String>,
}

impl LobeAnalysis {
    /// # Errors
    /// No `[lobes]` table, something that the process needs is missing, or the structure cannot be had.
    pub fn run(campaign: &Campaign) -> Result<Self> {
        Self::on(&Workbench::new(campaign))
    }

    /// As [`run`](Self::run), of files that other analyses read as well.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn on(campaign: &Workbench) -> Result<Self> {
        let section = campaign.lobes.as_ref().ok_or_else(|| {
            InputError::new("the campaign has no [lobes] table")
                .file(campaign.dir.join("campaign.toml"))
                .key("lobes")
                .remedy("add one with process, source and spindle_rpm = [from, to, step]")
        })?;
        let mut warnings = Vec::new();
        let CutForce {
            coefficients,
            cut,
            mut axial_torsional,
            own_cuts,
            drill,
        } = CutForce::of(campaign, section, &mut warnings)?;
        let asked = Asked {
            contacts: campaign.contacts.clone(),
            ..Asked::new(section, cut.average().axial.is_some())
        };
        if steps_through_time(section) && asked.couples() {
            let what = match section.tool.is_empty() {
                true => "a structure held by [[contact]]",
                false => "the tool as a beam",
            };
            return Err(
                InputError::new(format!("semi-discretisation needs modes, and {what} has none"))
                    .file(campaign.dir.join("campaign.toml"))
                    .key("lobes.method")
                    .remedy("use method = \"multi-frequency\" or \"zero-order\" with [lobes.tool] and [[contact]]")
                    .into(),
            );
        }
        let speeds = speed_grid(section.spindle_rpm)?;
        let (noted, not_compared) = noted_cuts(campaign, section);
        // With the surface over the angle: the postures of the campaign as they are, for the cuts that were made there.
        let mut as_they_stand = Vec::new();
        let (mut surface, mut effects, mut revision, mut hole) = (None, Vec::new(), None, None);
        let structures = match section.source {
            LobeSource::Modes => from_modes(campaign, section, &asked)?,
            LobeSource::Model => {
                let state = ModelState::of(campaign, asked.clone(), &mut warnings)?;
                (effects, revision) = (state.effects.clone(), state.revision);
                let check = hole_check(campaign, section, own_cuts.as_ref(), drill.as_ref());
                if let (Err(reason), Some(_)) = (&check, &section.hole) {
                    warnings.push(format!("the hole is not worked out: {reason}"));
                }
                let check = hole.insert(check).as_ref().ok();
                match &section.redundancy {
                    Some(wanted) => {
                        let average = cut.average();
                        let swept =
                            redundancy::sweep(campaign, section, wanted, &state, average, &speeds, check)?;
                        surface = Some(swept);
                        if !noted.is_empty() {
                            as_they_stand = at_postures(campaign, section, &state, None)?;
                        }
                        Vec::new()
                    }
                    None => at_postures(campaign, section, &state, check)?,
                }
            }
            LobeSource::Measured => from_measured(campaign, section, &asked, &mut warnings)?,
        };
        if let (Some(Ok(())), Some(one)) = (&axial_torsional, structures.first())
            && one.dynamics.blocks.axial.is_none()
        {
            axial_torsional = Some(Err(NOTHING_ALONG.into()));
        }
        if section.redundancy.is_some() && surface.is_none() {
            warnings
                .push("lobes.redundancy needs source = \"model\": there is no surface over the angle".into());
        }
        let (redundancy, swept) = surface.unzip();
        let drilled = match section.process {
            Process::Drilling => DrilledHole::of(campaign.tool.as_ref(), section),
            Process::Milling | Process::Turning => None,
        };
        let cases: Vec<LobeCase> = structures
            .into_iter()
            .map(|structure| structure.case(&cut, &speeds, &noted, section.process, drilled))
            .chain(swept.unwrap_or_default())
            .collect();
        let standing: Vec<(Option<String>, Vec<LimitRange>)> = as_they_stand
            .into_iter()
            .map(|s: LobeStructure| (s.posture.clone(), s.at_cuts(&cut, &noted, &s.drawn(&cut))))
            .collect();
        let limits: Vec<(Option<&str>, &[LimitRange])> = match redundancy {
            Some(_) => standing.iter().map(|(p, at)| (p.as_deref(), &at[..])).collect(),
            None => cases
                .iter()
                .map(|case| (case.posture.as_deref(), &case.at_cuts[..]))
                .collect(),
        };
        warnings.extend(contacts_that_give_way(&cases));
        warnings.extend(cases.iter().filter_map(where_it_may_whirl));
        let outcomes = Outcomes::score(&noted, &limits, not_compared);
        if limits.len() > 1 && noted.iter().any(|c| c.posture.is_none()) {
            warnings.push(
                "some cuts with an outcome do not say at which posture they were made: they are compared with the limits of \
                 all postures together; add posture = \"…\" to their [[cut]]"
                    .into(),
            );
        }
        Ok(LobeAnalysis {
            process: section.process,
            source: section.source,
            method: section.method,
            coefficients,
            teeth: cut.average().lateral.teeth,
            axial_torsional,
            drilled,
            drill,
            flank_damping: cut.average().damping,
            tool: asked.tool.clone(),
            spindle_rpm: section.spindle_rpm,
            cases,
            redundancy,
            effects,
            revision,
            outcomes,
            hole,
            warnings,
        })
    }

    /// For people: drilling, with the blocks that count.
    pub fn drilling(&self) -> &'static str {
        match self.axial_torsional {
            Some(Ok(())) => "drilling, lateral and axial-torsional",
            _ => "drilling, lateral",
        }
    }

    /// What the added effects did to the limit, a sentence for each posture; empty where nothing was added.
    pub fn what_effects_did(&self) -> Vec<String> {
        let added = match &self.effects[..] {
            [] => return Vec::new(),
            [one] => format!("the added {one}"),
            several => format!("the added effects ({}) together", several.join(", ")),
        };
        let sentence = |case: &LobeCase| {
            let place = case
                .posture
                .as_ref()
                .map(|p| format!("At {p} "))
                .unwrap_or_default();
            let angle = case
                .angle_deg
                .map(|a| format!("and {a:.1}° "))
                .unwrap_or_default();
            let of = |l: &AbsoluteLimit| format!("{:.4} mm ({:.2} Hz)", l.depth_mm, l.chatter_hz);
            let before = &case.before.as_ref()?.absolute;
            Some(match (before, &case.absolute) {
                (Some(before), Some(after)) => {
                    let change = after.depth_mm / before.depth_mm - 1.0;
                    let does = match change {
                        c if c.abs() < SAME => "hardly changes the limit that holds at every speed:",
                        c if c < 0.0 => "lowers the limit that holds at every speed",
                        _ => "raises the limit that holds at every speed",
                    };
                    format!(
                        "{place}{angle}{added} {does} from {} to {}: {:+.1} %",
                        of(before),
                        of(after),
                        100.0 * change
                    )
                }
                (Some(before), None) => format!("{place}{angle}{added} lifts the limit of {}", of(before)),
                (None, Some(after)) => {
                    format!(
                        "{place}{angle}{added} brings a limit of {} where there was none",
                        of(after)
                    )
                }
                (None, None) => return None,
            })
        };
        self.cases.iter().filter_map(sentence).collect()
    }

    /// The least limit of all cases.
    pub fn absolute(&self) -> Option<AbsoluteLimit> {
        self.cases
            .iter()
            .filter_map(|c| c.absolute)
            .min_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm))
    }

    /// The deepest tips of all cases, deepest first; equal depths keep the order of the postures.
    pub fn best(&self) -> Vec<(&LobeCase, Peak)> {
        let mut best: Vec<(&LobeCase, Peak)> = self
            .cases
            .iter()
            .flat_map(|case| case.best.iter().map(move |peak| (case, *peak)))
            .collect();
        let order = |peak: &Peak| peak.depth_mm.unwrap_or(f64::INFINITY);
        best.sort_by(|a, b| order(&b.1).total_cmp(&order(&a.1)));
        best.truncate(BEST);
        best
    }
}

/// The force of the cut that the `[lobes]` table asks for.
pub(crate) struct CutForce {
    pub coefficients: LobeCoefficients,
    pub cut: LobeCut,
    /// Drilling: whether the axial–torsional block takes part, or why not.
    pub axial_torsional: Option<std::result::Result<(), String>>,
    /// The campaign's own cuts, where the coefficients come from those.
    pub own_cuts: Option<ForceGroup>,
    /// The drill, where the coefficients are predicted from an orthogonal database.
    pub drill: Option<DrillPrediction>,
}

impl CutForce {
    /// # Errors
    /// Something that the process needs is missing.
    pub fn of(campaign: &Workbench, section: &LobesSection, warnings: &mut Vec<String>) -> Result<Self> {
        let drill = match section.from_orthogonal {
            true => Some(predicted_drill(campaign, section)?),
            false => None,
        };
        let chisel = drill.as_ref().and_then(|d| d.chisel.as_ref());
        if let Some(Err(reason)) = chisel {
            warnings.push(format!("the chisel edge is left out: {reason}"));
        }
        if let (Some(Ok(_)), Some(database)) = (chisel, &campaign.orthogonal)
            && (database.friction_angle_law.is_none() || database.chip_ratio_law.is_none())
        {
            warnings.push(format!(
                "friction and chip ratio of [orthogonal] are those of one rake angle ({}°) and are taken for the whole lip, whose rake changes by \
                 tens of degrees, and for the chisel edge, whose rake is strongly negative: thrust and limits may be off by a factor of several; \
                 give friction_angle_law and chip_ratio_law, or coefficients from drilling cuts",
                database.rake_deg
            ));
        }
        let (coefficients, own_cuts) = match (&drill, LobeCoefficients::given(section)) {
            (Some(drill), _) => (LobeCoefficients::of_drill(drill), None),
            (None, Some(given)) => (given, None),
            (None, None) => {
                let group = group_of_cuts(campaign, section, warnings)?;
                (coefficients_of_group(campaign, section, &group)?, Some(group))
            }
        };
        let mut cut = cut_of(campaign, section, coefficients)?;
        let shaped = campaign
            .tool
            .as_ref()
            .is_some_and(|tool| !tool.has_straight_edge());
        if section.process == Process::Milling && shaped {
            warnings.push(
                "the lobes take the edge as straight up the side of the tool: corner_radius_mm and lead_angle_deg of [tool] are \
                 left out of the dynamics (they are in the coefficients), so that the limits hold for depths well beyond the \
                 corner only"
                    .into(),
            );
        }
        let differ = campaign
            .tool
            .as_ref()
            .is_some_and(|tool| !tool.each_tooth.is_empty());
        if section.process == Process::Milling && differ {
            warnings.push(
                "the lobes take all teeth as alike and evenly spaced: pitch_deg, tooth_helix_deg and tooth_radius_offset_mm of [tool] are \
                 left out of the dynamics (they are in the coefficients); a variable pitch moves the lobes"
                    .into(),
            );
        }
        if section.process == Process::Turning {
            warnings.extend(what_turning_lobes_leave_out(campaign));
        }
        let teeth = cut.average().lateral.teeth;
        let axial = (section.process == Process::Drilling)
            .then(|| axial_torsional_force(campaign.tool.as_ref(), section, coefficients, teeth));
        if let LobeCut::Averaged(cut) = &mut cut {
            cut.damping = flank_damping(campaign, section, teeth)?;
        }
        if let (LobeCut::Averaged(cut), Some(Ok(force))) = (&mut cut, &axial) {
            cut.axial = Some(*force);
        }
        Ok(CutForce {
            coefficients,
            cut,
            axial_torsional: axial.map(|force| force.map(|_| ())),
            own_cuts,
            drill,
        })
    }
}

/// How a warning begins that tells the speeds at which a drill may whirl.
pub(crate) const MAY_WHIRL: &str = "the drill may whirl";

/// The speeds at which a drill may whirl at a posture, in words.
fn where_it_may_whirl(case: &LobeCase) -> Option<String> {
    let speeds: Vec<String> = case
        .whirling
        .iter()
        .filter(|w| w.may_occur == Some(true))
        .map(|w| {
            format!(
                "{:.0} rpm ({:.1} Hz is {} times the turn: {} or {} lobes)",
                w.spindle_rpm,
                w.mode_hz,
                w.lobes[0] + 1,
                w.lobes[0],
                w.lobes[1]
            )
        })
        .collect();
    (!speeds.is_empty()).then(|| {
        format!(
            "{MAY_WHIRL}{} and leave a hole that is not round at and up to a tenth above {}: take another speed or a pilot hole",
            case.at_posture(),
            speeds.join(", ")
        )
    })
}

/// Feet that lift off and clamps that slip: what was computed with them does not hold there.
fn contacts_that_give_way(cases: &[LobeCase]) -> Vec<String> {
    let mut told: Vec<String> = Vec::new();
    for case in cases {
        let contacts = case.hole.iter().flat_map(|hole| &hole.contacts);
        for contact in contacts.filter(|c| c.gives_way) {
            let gives_way = match contact.direction {
                ContactDirection::Axial => "lifts off",
                _ => "slips",
            };
            let angle = case
                .angle_deg
                .map(|a| format!(" and {a:.1}°"))
                .unwrap_or_default();
            told.push(format!(
                "{}{}{angle}: the cutting forces take {:.0} N of the {:.0} N that hold it, so it {gives_way}: limits and hole there \
                 are those of a contact that holds; press harder, or cut with less thrust",
                contact.name,
                case.at_posture(),
                contact.force_n,
                contact.preload_n.unwrap_or(0.0),
            ));
        }
    }
    let (count, most) = (told.len(), 4);
    if count > most {
        told.truncate(most);
        told.push(format!(
            "and {} more places where a contact gives way",
            count - most
        ));
    }
    told
}

/// What the lobes of turning take for granted.
fn what_turning_lobes_leave_out(campaign: &Campaign) -> Option<String> {
    let tool = campaign.tool.as_ref()?;
    (tool.corner_radius_mm > 0.0).then(|| {
        "the lobes take the edge as straight at cutting_edge_angle_deg: nose_radius_mm of [tool] is left out of the dynamics (it is in \
         the coefficients), so that the limits hold for depths well beyond the nose only"
            .into()
    })
}
