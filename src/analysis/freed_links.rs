//! A calibration with link parameters free that the campaign takes for exact, compared with the one without.

use super::StructureAnalysis;
use super::structure_case::Freed;
use crate::campaign::{Campaign, LinkGroup};
use crate::data::RobotSpec;
use crate::discrepancy::verdict::is_progress;
use crate::identify::departures::departures;
use crate::identify::frfs::calibrate::FAR_ABOVE_NOISE;
use crate::identify::levenberg_marquardt::Stopping;
use crate::identify::study::{Extent, held_out};
use crate::identify::{Calibration, Estimate, HeldOut, Options, Parameter, StructureCase, Undetermined};
use crate::text::shell_word;
use crate::{InputError, Result};

/// What freeing groups of link parameters does.
pub struct FreedLinks {
    /// The groups of link parameters that were freed.
    pub groups: Vec<LinkGroup>,
    /// As the campaign stands.
    pub before: StructureAnalysis,
    /// With those parameters of the groups free that must differ from the robot file; the others are as it has them.
    pub after: StructureAnalysis,
    /// Their names; empty where all agree with the file.
    pub departing: Vec<String>,
    /// How many were free.
    pub freed: usize,
    /// Errors on postures left out of the fit, before and after; `None` with one posture.
    pub held_out: Option<[HeldOut; 2]>,
    /// Whether that error fell by more than chance would let it; `None` with one posture.
    pub progress: Option<bool>,
    /// What the data do not determine, with all of the groups free.
    pub undetermined: Undetermined,
}

const REFIT_WITHOUT_FOLD: Stopping = Stopping {
    max_iterations: 15,
    relative_decrease: 1e-6,
};

impl FreedLinks {
    /// Names of the departing parameters that stopped at the end of their range.
    pub fn at_end_of_range(&self) -> Vec<&str> {
        let stopped = self.departures().filter(|p| p.at_bound);
        stopped.map(|p| p.name.as_str()).collect()
    }

    /// Whether the departing values can be those of the links: not where some only stopped at the end of their range and far more than
    /// noise is left all the same. Links imitate much that the model does not have.
    pub fn is_believable(&self) -> bool {
        self.at_end_of_range().is_empty() || self.after.calibration.reduced_chi2 <= FAR_ABOVE_NOISE
    }

    /// The departing parameters as fitted.
    pub fn departures(&self) -> impl Iterator<Item = &Estimate> {
        let fitted = self.after.calibration.parameters.iter();
        fitted.filter(|p| self.departing.contains(&p.name))
    }

    /// The robot file's robot with the departing parameters as fitted. Joints, and what the campaign frees itself, stay as in the file:
    /// a calibration on this robot comes to the same fit.
    pub fn robot(&self) -> RobotSpec {
        let (model, theta) = (&self.after.case.model, &self.after.calibration.theta);
        let departs = |name: &str| self.departing.iter().any(|d| d == name);
        model.robot_with(theta, departs).spec
    }

    /// Fits `case` with the groups free, finds which of their parameters must differ from the robot file, and fits those alone.
    ///
    /// # Errors
    /// Groups that the model cannot have free, and as for [`StructureAnalysis::run`].
    pub fn run(
        campaign: &Campaign,
        case: StructureCase,
        groups: &[LinkGroup],
        options: Options,
    ) -> Result<Self> {
        if groups.contains(&LinkGroup::Walls) && !case.bends() {
            return Err(InputError::new(
                "the links of this model are rigid: their walls do nothing, and cannot be fitted",
            )
            .remedy(format!(
                "let them bend first: `lobestone add {} link-flexibility`",
                shell_word(&campaign.dir)
            ))
            .into());
        }
        let before = StructureAnalysis::of_case(case, options)?;
        let free = |only: Option<&[String]>| before.case.freeing(campaign, &Freed { groups, only });
        let every = from_where_it_stood(free(None)?, &before.calibration, options)?;
        let parameters = &every.case.model.parameters;
        let undetermined = Undetermined::new(parameters, &every.calibration)?;
        // What the campaign frees itself stays free.
        let (departing, after) = fitted_departing(
            &before.calibration,
            &every,
            |fit| (&fit.case.model.parameters, &fit.calibration),
            |kept, fit| from_where_it_stood(free(Some(kept))?, &fit.calibration, options),
        )?;
        let error = |analysis: &StructureAnalysis| {
            let case = &analysis.case;
            let study = case.study(options);
            let theta = &analysis.calibration.theta;
            held_out(&study, &case.model, theta, Extent::Coarse, REFIT_WITHOUT_FOLD)
        };
        let held_out = error(&before)?.zip(error(&after)?).map(<[HeldOut; 2]>::from);
        let chance = after.calibration.reduced_chi2.max(1.0);
        let better =
            |[a, b]: &[HeldOut; 2]| !departing.is_empty() && is_progress(a, b, departing.len(), chance);
        Ok(FreedLinks {
            groups: groups.to_vec(),
            progress: held_out.as_ref().map(better),
            freed: parameters.len() - before.calibration.parameters.len(),
            undetermined,
            departing,
            held_out,
            before,
            after,
        })
    }
}

/// Of the parameters that are free in the fit `every` and not in `before`, the names of those that must differ from the robot file, and
/// the fit with them alone. `of`: a fit's parameters and their values; `refit`: a fit with the parameters named, from an earlier one.
pub(super) fn fitted_departing<F>(
    before: &Calibration,
    every: &F,
    of: impl Fn(&F) -> (&[Parameter], &Calibration),
    refit: impl Fn(&[String], &F) -> Result<F>,
) -> Result<(Vec<String>, F)> {
    let known: Vec<&String> = before.parameters.iter().map(|p| &p.name).collect();
    let departing = |fit: &F| -> Vec<String> {
        let (parameters, calibration) = of(fit);
        let new: Vec<usize> = (0..parameters.len())
            .filter(|i| !known.contains(&&parameters[*i].name))
            .collect();
        let found = departures(parameters, calibration, &new).into_iter();
        found.map(|i| parameters[i].name.clone()).collect()
    };
    let with = |names: &[String], start: &F| {
        let kept: Vec<String> = known.iter().copied().chain(names).cloned().collect();
        refit(&kept, start)
    };
    let mut names = departing(every);
    let mut fit = with(&names, every)?;
    // The choice was made on the quadratic form of a fit with everything free; what agrees with the file once the others are back at
    // their values has nothing to depart from.
    loop {
        let still = departing(&fit);
        if still.len() == names.len() {
            return Ok((names, fit));
        }
        fit = with(&still, &fit)?;
        names = still;
    }
}

/// Calibrates `case` from an earlier solution, by name; what that has not stands at the robot file's values.
fn from_where_it_stood(
    case: StructureCase,
    earlier: &Calibration,
    options: Options,
) -> Result<StructureAnalysis> {
    let start = by_name(&case.model.parameters, &earlier.parameters);
    StructureAnalysis::of(case.starting_from(start), None, options)
}

/// Starting point (solver's scale) of a model with these `parameters`: the values that are `known` by name, the robot file's of the
/// others.
pub(super) fn by_name(parameters: &[Parameter], known: &[Estimate]) -> Vec<f64> {
    let value = |p: &Parameter| {
        let known = known.iter().find(|k| k.name == p.name);
        p.internal(known.map_or(p.nominal, |k| k.value))
    };
    parameters.iter().map(value).collect()
}
