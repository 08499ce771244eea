//! The lobes that a campaign's `[lobes]` table asks for.

use super::lobe_model::{Dynamics, ModelState};
use super::redundancy::{self, RedundancyAnalysis};
use crate::campaign::{Campaign, LobeMethod, LobeSource, LobesSection, Process};
use crate::cutting::Group;
use crate::lobes::band::{self, LobeBand};
use crate::lobes::hole::{HoleCheck, HoleError};
use crate::lobes::measured::measured_structures;
use crate::lobes::outcome::{LimitRange, NotedCut, Outcomes, noted_cuts};
use crate::lobes::setup::{
    Cut, LobeCoefficients, coefficients_of_group, cut_of, frf_of_modes, group_of_cuts,
};
use crate::lobes::{
    AbsoluteLimit, DirectFrf, LobeCurve, MultiFrequency, Peak, SemiDiscretisation, SpeedLimit,
    StabilitySolver, StateSpace, speed_grid,
};
use crate::{InputError, Result};

/// Best speeds that are listed.
pub const BEST: usize = 10;
/// Changes of the limit below this share are not worth a word.
const SAME: f64 = 0.005;

/// Lobes of one structure.
#[derive(Debug, Clone)]
pub struct LobeCase {
    /// `None` where the FRF belongs to no posture (modes from the campaign file).
    pub posture: Option<String>,
    pub angle_deg: Option<f64>,
    /// For people: where the FRF comes from.
    pub description: String,
    /// Where chatter was sought, Hz.
    pub band_hz: (f64, f64),
    pub curve: LobeCurve,
    pub absolute: Option<AbsoluteLimit>,
    pub best: Vec<Peak>,
    /// From the uncertainty of the calibrated parameters; averaged forces only.
    pub band: Option<LobeBand>,
    /// Without the effects that were added to the model; `None` where there are none.
    pub before: Option<LobesBefore>,
    /// Where the static forces of the cut put the tool; from the model only.
    pub hole: Option<HoleError>,
    /// At the speed of every cut with a noted outcome.
    pub(super) at_cuts: Vec<LimitRange>,
}

/// Lobes of the baseline (revision 0), fitted to the same data as the model with its effects.
#[derive(Debug, Clone)]
pub struct LobesBefore {
    pub curve: LobeCurve,
    pub absolute: Option<AbsoluteLimit>,
}

/// All lobes of a campaign.
#[derive(Debug, Clone)]
pub struct LobeAnalysis {
    pub process: Process,
    pub source: LobeSource,
    pub method: LobeMethod,
    pub coefficients: LobeCoefficients,
    pub teeth: usize,
    pub spindle_rpm: [f64; 3],
    pub cases: Vec<LobeCase>,
    /// Where the campaign asks for the surface over the redundancy angle: its angles are the cases.
    pub redundancy: Option<RedundancyAnalysis>,
    /// `effect@site` of what is in the model beside the baseline.
    pub effects: Vec<String>,
    /// Revision of the model; `None` where nothing was ever added, or the model is not what lobes come from.
    pub revision: Option<usize>,
    /// The cuts whose outcome was noted against these lobes; `None` where there are none.
    pub outcomes: Option<Outcomes>,
    /// The forces on the tool and the tolerances behind the cases' `hole`, or why there are none; `None` where lobes do
    /// not come from the model.
    pub hole: Option<std::result::Result<HoleCheck, String>>,
    pub warnings: Vec<String>,
}

/// One structure that lobes are drawn for.
struct Structure {
    posture: Option<String>,
    dynamics: Dynamics,
    /// The same before effects were added.
    before: Option<Dynamics>,
    hole: Option<HoleError>,
    /// The same structure with parameters drawn from their uncertainty.
    variants: Vec<Box<dyn DirectFrf>>,
    description: String,
}

impl Dynamics {
    fn method(&self, cut: &Cut) -> Box<dyn SpeedLimit + '_> {
        let frf = self.frf.as_ref();
        match (cut, &self.states) {
            (Cut::Averaged(force), _) => Box::new(StabilitySolver::new(*force, frf)),
            (Cut::Periodic(force), Some(states)) => {
                Box::new(SemiDiscretisation::new(*force, states.clone(), frf))
            }
            (Cut::Periodic(force), None) => Box::new(MultiFrequency::new(*force, frf)),
        }
    }

    /// The lobes of the model before effects were added.
    pub(super) fn lobes_before(&self, cut: &Cut, speeds: &[f64]) -> LobesBefore {
        let method = self.method(cut);
        let curve = method.curve(speeds);
        LobesBefore {
            absolute: method.absolute_limit().or(curve.least()),
            curve,
        }
    }
}

impl Structure {
    fn case(self, cut: &Cut, speeds: &[f64], noted: &[NotedCut]) -> LobeCase {
        let method = self.dynamics.method(cut);
        let curve = method.curve(speeds);
        let (absolute, mut best) = (
            method.absolute_limit().or(curve.least()),
            method.best(&curve, BEST),
        );
        let band_at = |at: &[f64]| match cut {
            Cut::Averaged(force) if !self.variants.is_empty() => Some(band::band(*force, &self.variants, at)),
            _ => None,
        };
        let tips: Vec<f64> = best.iter().map(|p| p.spindle_rpm).collect();
        if let Some(at_tips) = band_at(&tips) {
            for (peak, lower) in best.iter_mut().zip(at_tips.lower_mm) {
                peak.lower_quantile_mm = lower;
            }
        }
        let cut_speeds: Vec<f64> = noted.iter().map(|c| c.spindle_rpm).collect();
        let cut_band = band_at(&cut_speeds);
        let at_cuts = method.curve(&cut_speeds).depth_limit_mm;
        let at_cuts = at_cuts.into_iter().enumerate().map(|(i, limit)| {
            let quantiles = cut_band.as_ref().map(|b| [b.lower_mm[i], b.upper_mm[i]]);
            LimitRange::new(limit, quantiles)
        });
        LobeCase {
            angle_deg: None,
            band_hz: self.dynamics.frf.band_hz(),
            absolute,
            best,
            band: band_at(speeds),
            before: self.before.as_ref().map(|b| b.lobes_before(cut, speeds)),
            hole: self.hole,
            at_cuts: at_cuts.collect(),
            curve,
            posture: self.posture,
            description: self.description,
        }
    }
}

impl LobeAnalysis {
    /// # Errors
    /// No `[lobes]` table, something that the process needs is missing, or the structure cannot be had.
    pub fn run(campaign: &Campaign) -> Result<Self> {
        let section = campaign.lobes.as_ref().ok_or_else(|| {
            InputError::new("the campaign has no [lobes] table")
                .file(campaign.dir.join("campaign.toml"))
                .key("lobes")
                .remedy("add one with process, source and spindle_rpm = [from, to, step]")
        })?;
        let mut warnings = Vec::new();
        let (coefficients, cut, own_cuts) = force_of(campaign, section, &mut warnings)?;
        let speeds = speed_grid(section.spindle_rpm)?;
        let (noted, not_compared) = noted_cuts(campaign, section);
        let (mut surface, mut effects, mut revision, mut hole) = (None, Vec::new(), None, None);
        let structures = match section.source {
            LobeSource::Modes => from_modes(campaign, section)?,
            LobeSource::Model => {
                let state = ModelState::of(campaign, &mut warnings)?;
                (effects, revision) = (state.effects.clone(), state.revision);
                let check = HoleCheck::new(campaign, section, own_cuts.as_ref());
                if let (Err(reason), Some(_)) = (&check, &section.hole) {
                    warnings.push(format!("the hole is not worked out: {reason}"));
                }
                let check = hole.insert(check).as_ref().ok();
                match &section.redundancy {
                    Some(wanted) => {
                        let force = cut.average();
                        let swept =
                            redundancy::sweep(campaign, section, wanted, &state, force, &speeds, check)?;
                        surface = Some(swept);
                        Vec::new()
                    }
                    None => at_postures(campaign, section, &state, check)?,
                }
            }
            LobeSource::Measured => from_measured(campaign, section, &mut warnings)?,
        };
        if section.redundancy.is_some() && surface.is_none() {
            warnings
                .push("lobes.redundancy needs source = \"model\": there is no surface over the angle".into());
        }
        let (redundancy, swept) = surface.unzip();
        let cases: Vec<LobeCase> = structures
            .into_iter()
            .map(|structure| structure.case(&cut, &speeds, &noted))
            .chain(swept.unwrap_or_default())
            .collect();
        let limits: Vec<(Option<&str>, &[LimitRange])> = cases
            .iter()
            .map(|case| (case.posture.as_deref(), &case.at_cuts[..]))
            .collect();
        let outcomes = Outcomes::score(&noted, &limits, not_compared);
        if limits.len() > 1 && redundancy.is_none() && noted.iter().any(|c| c.posture.is_none()) {
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
            teeth: cut.average().teeth,
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

/// The cut that the `[lobes]` table asks for, and the group of the campaign's own cuts where the coefficients come from
/// those.
pub(super) fn force_of(
    campaign: &Campaign,
    section: &LobesSection,
    warnings: &mut Vec<String>,
) -> Result<(LobeCoefficients, Cut, Option<Group>)> {
    let (coefficients, own_cuts) = match LobeCoefficients::given(section) {
        Some(given) => (given, None),
        None => {
            let group = group_of_cuts(campaign, section, warnings)?;
            (coefficients_of_group(campaign, section, &group)?, Some(group))
        }
    };
    Ok((coefficients, cut_of(campaign, section, coefficients)?, own_cuts))
}

fn from_modes(campaign: &Campaign, section: &LobesSection) -> Result<Vec<Structure>> {
    let frf = frf_of_modes(campaign, section)?;
    let count = frf.modes().len();
    let left_out = section.modes.len() - count;
    let mut description = format!("{count} modes in x and y from campaign.toml");
    if left_out > 0 {
        description += &format!("; {left_out} in z or theta not used (the lateral block only)");
    }
    Ok(vec![Structure {
        posture: None,
        dynamics: Dynamics {
            states: steps_through_time(section).then(|| StateSpace::from(&frf)),
            frf: Box::new(frf),
        },
        before: None,
        hole: None,
        variants: Vec::new(),
        description,
    }])
}

fn steps_through_time(section: &LobesSection) -> bool {
    section.method == LobeMethod::SemiDiscretisation
}

/// The robot model at every posture.
fn at_postures(
    campaign: &Campaign,
    section: &LobesSection,
    state: &ModelState,
    check: Option<&HoleCheck>,
) -> Result<Vec<Structure>> {
    campaign
        .postures
        .iter()
        .map(|posture| {
            let (joints, through_time) = (&posture.joints_deg, steps_through_time(section));
            let before = state.before.as_ref();
            Ok(Structure {
                posture: Some(posture.id.clone()),
                dynamics: state.current.dynamics(joints, through_time)?,
                before: before.map(|b| b.dynamics(joints, through_time)).transpose()?,
                hole: check.map(|c| state.hole(joints, &c.load)).transpose()?,
                variants: state.variants(joints)?,
                description: state.description.clone(),
            })
        })
        .collect()
}

fn from_measured(
    campaign: &Campaign,
    section: &LobesSection,
    warnings: &mut Vec<String>,
) -> Result<Vec<Structure>> {
    if steps_through_time(section) {
        return Err(InputError::new("semi-discretisation needs modes, and measured FRFs are none")
            .file(campaign.dir.join("campaign.toml"))
            .key("lobes.method")
            .remedy("use method = \"multi-frequency\" on the measured FRFs, or source = \"model\" or \"modes\"")
            .into());
    }
    let (set, read_warnings) = campaign.load_frfs()?;
    warnings.extend(read_warnings);
    let structures = measured_structures(campaign, &set)?;
    Ok(structures
        .into_iter()
        .map(|s| {
            let posture = campaign.postures[s.posture].id.clone();
            warnings.extend(s.notes.iter().map(|n| format!("{posture}: {n}")));
            Structure {
                posture: Some(posture),
                dynamics: Dynamics {
                    frf: Box::new(s.frf),
                    states: None,
                },
                before: None,
                hole: None,
                variants: Vec::new(),
                description: "measured FRFs".to_string(),
            }
        })
        .collect())
}
