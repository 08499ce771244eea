//! A calibration with link parameters free that the campaign takes for exact, beside the one without.

use super::StructureAnalysis;
use crate::campaign::{Campaign, LinkGroup};
use crate::discrepancy::verdict::is_progress;
use crate::identify::levenberg_marquardt::Stopping;
use crate::identify::study::{Extent, held_out};
use crate::identify::{HeldOut, Options, StructureCase, Undetermined};
use crate::{InputError, Result};

/// What freeing groups of link parameters does.
pub struct FreedLinks {
    pub groups: Vec<LinkGroup>,
    /// As the campaign stands.
    pub before: StructureAnalysis,
    /// With the groups free, started from there.
    pub after: StructureAnalysis,
    /// Errors on postures left out of the fit, before and after; `None` with one posture.
    pub held_out: Option<[HeldOut; 2]>,
    /// Whether that error fell by more than chance would let it; `None` with one posture.
    pub progress: Option<bool>,
    /// What the data do not determine, with the groups free.
    pub undetermined: Undetermined,
}

const REFIT_WITHOUT_FOLD: Stopping = Stopping {
    max_iterations: 15,
    relative_decrease: 1e-6,
};

impl FreedLinks {
    /// # Errors
    /// Groups that the model cannot have free, and as for [`StructureAnalysis::run`].
    pub fn run(campaign: &Campaign, groups: &[LinkGroup], options: Options) -> Result<Self> {
        let case = StructureCase::load_freeing(campaign, groups)?;
        let bends = case.effects().iter().any(|e| e.starts_with("link-flexibility"));
        if groups.contains(&LinkGroup::Walls) && !bends {
            return Err(InputError::new(
                "the links of this model are rigid: their walls do nothing, and cannot be fitted",
            )
            .remedy(format!(
                "let them bend first: `lobestone add {} link-flexibility`",
                campaign.dir.display()
            ))
            .into());
        }
        let before = StructureAnalysis::run(campaign, options)?;
        // By name: what is free now stands at the robot file's values.
        let known = |name: &str| before.calibration.parameters.iter().find(|p| p.name == name);
        let of = |p: &crate::parameter::Parameter| p.internal(known(&p.name).map_or(p.nominal, |e| e.value));
        let start = case.model.parameters.iter().map(of).collect();
        let after = StructureAnalysis::of(case.starting_from(start), None, options)?;
        let error = |analysis: &StructureAnalysis| {
            let case = &analysis.case;
            let study = case.study(options);
            let theta = &analysis.calibration.theta;
            held_out(&study, &case.model, theta, Extent::Coarse, REFIT_WITHOUT_FOLD)
        };
        let held_out = error(&before)?.zip(error(&after)?).map(<[HeldOut; 2]>::from);
        let more = after.calibration.theta.len() - before.calibration.theta.len();
        let chance = after.calibration.reduced_chi2.max(1.0);
        Ok(FreedLinks {
            groups: groups.to_vec(),
            progress: held_out.as_ref().map(|[a, b]| is_progress(a, b, more, chance)),
            undetermined: Undetermined::new(&after.case.model.parameters, &after.calibration)?,
            held_out,
            before,
            after,
        })
    }
}
