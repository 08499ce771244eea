//! A campaign's structural side, loaded and ready to be fitted.

use super::calibrate::Options;
use super::frf_data::FrfData;
use super::structure::StructureModel;
use super::structure_study::StructureStudy;
use crate::campaign::{Campaign, LinkGroup, RobotSection};
use crate::effects::{self, Instance};
use crate::revision::{Domain, RecordedEffect, Revision, RevisionLog, log_file, structure_fingerprint};
use crate::robot::{RobotModel, RobotSpec};
use crate::{InputError, Result};

/// Model, data and what was noticed while reading them.
#[derive(Debug, Clone)]
pub struct StructureCase {
    /// The campaign's current model: the baseline with the effects that were added, starting from where the last
    /// revision stood.
    pub model: StructureModel,
    /// The model as the robot file has it, without effects.
    pub baseline: StructureModel,
    pub data: FrfData,
    /// What was added so far, oldest first; the first is the baseline. Empty where nothing was.
    pub revisions: Vec<Revision>,
    /// Whether the model starts from a solution that was found on these very data.
    settled: bool,
    pub warnings: Vec<String>,
}

/// The robot section of a campaign, or an error that says what is missing.
pub fn robot_section(campaign: &Campaign) -> Result<&RobotSection> {
    campaign.robot.as_ref().ok_or_else(|| {
        InputError::new("the campaign has no [robot]")
            .file(campaign.dir.join("campaign.toml"))
            .key("robot")
            .remedy(
                "add [robot] with model = the path of your robot's file (`lobestone init DIR --robot FILE.urdf` makes one of a \
                 URDF), or \"irb6640\" if it is that robot",
            )
            .into()
    })
}

/// The robot model of a campaign, uncalibrated and without effects.
///
/// # Errors
/// No robot, or a robot file that cannot be read.
pub fn structure_model(campaign: &Campaign) -> Result<StructureModel> {
    structure_model_freeing(campaign, &Freed::default())
}

/// Link parameters that are free beside those that the campaign frees itself.
#[derive(Debug, Clone, Default)]
pub struct Freed<'a> {
    pub groups: &'a [LinkGroup],
    /// Only these of all link parameters, by name; `None`: all of the groups.
    pub only: Option<&'a [String]>,
}

fn structure_model_freeing(campaign: &Campaign, freed: &Freed) -> Result<StructureModel> {
    let section = &robot_section(campaign)?.freeing(freed.groups);
    let spec = RobotSpec::load(&section.model, &campaign.dir)?;
    let kept = |name: &str| freed.only.is_none_or(|only| only.iter().any(|o| o == name));
    Ok(StructureModel::freeing(
        RobotModel::new(spec),
        campaign.points.clone(),
        section,
        kept,
    ))
}

impl StructureCase {
    /// # Errors
    /// FRFs or robot file that cannot be read, a broken revision log, or one with effects that are none of this robot.
    pub fn load(campaign: &Campaign) -> Result<Self> {
        let baseline = structure_model(campaign)?;
        let log = RevisionLog::load(&campaign.dir)?;
        let revisions: Vec<Revision> = log.revisions(Domain::Structure).cloned().collect();
        let (set, mut warnings) = campaign.load_frfs()?;
        warnings.extend(baseline.robot.spec.guesses_told());
        let data = FrfData::new(campaign, &baseline.robot, set)?;
        let mut settled = false;
        let model = match revisions.last() {
            Some(current) => {
                settled = current.data == structure_fingerprint(campaign)?;
                // Of a baseline only the starting point is taken; whose data it was fitted to does not matter.
                if current.revision > 0 && !settled {
                    warnings.push(format!(
                        "revision {} was made with other data (robot, postures, points or FRF files changed since): its \
                         effects stay in the model and are fitted anew, but the errors in its history no longer compare; \
                         `lobestone undo {dir}` takes it back, `lobestone add {dir} …` adds it again",
                        current.revision,
                        dir = campaign.dir.display()
                    ));
                }
                with_revision(campaign, &baseline, &data, current)?
            }
            None => baseline.clone(),
        };
        Ok(StructureCase {
            model,
            baseline,
            data,
            revisions,
            settled,
            warnings,
        })
    }

    /// The same data and revision, with link parameters free that the campaign may take for exact.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    pub fn freeing(&self, campaign: &Campaign, freed: &Freed) -> Result<Self> {
        let baseline = structure_model_freeing(campaign, freed)?;
        let model = match self.revisions.last() {
            Some(current) => with_revision(campaign, &baseline, &self.data, current)?,
            None => baseline.clone(),
        };
        Ok(StructureCase {
            model,
            baseline,
            settled: false,
            ..self.clone()
        })
    }

    /// Whether the links of the model bend.
    pub fn bends(&self) -> bool {
        self.model.has("link-flexibility")
    }

    /// How to calibrate this case where `wanted` was asked for. Further starting points were tried when the revision was
    /// made; the same ones again would lead to the same answer, so that only others are.
    pub fn options(&self, wanted: Options) -> Options {
        match self.settled && wanted == Options::default() {
            true => Options {
                extra_starts: 0,
                ..wanted
            },
            false => wanted,
        }
    }

    /// The same case, whose fits start from `theta` (solver's scale), found by calibrating it: nothing is searched again.
    pub fn settled_at(self, theta: &[f64]) -> Self {
        StructureCase {
            model: self.model.with_start(theta.to_vec()),
            settled: true,
            ..self
        }
    }

    /// The same case, whose fits start from `theta` (solver's scale) and search from there.
    pub fn starting_from(self, theta: Vec<f64>) -> Self {
        StructureCase {
            model: self.model.with_start(theta),
            settled: false,
            ..self
        }
    }

    /// Makes fits start from the nominal values, not from where the last revision stood.
    pub fn forget_start(&mut self) {
        self.model = self.model.without_start();
        self.settled = false;
    }

    /// The case as the loop works on it.
    pub fn study(&self, wanted: Options) -> StructureStudy {
        StructureStudy::new(&self.model.robot.spec, self.data.clone(), self.options(wanted))
    }

    /// The model without the effects that were added, starting from where it stood when the first of them was; `None`
    /// where the model has no effects.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    pub fn before_effects(&self, campaign: &Campaign) -> Result<Option<StructureModel>> {
        match self.revisions.first() {
            Some(first) if !self.model.effects().is_empty() => self.model_of(campaign, first).map(Some),
            _ => Ok(None),
        }
    }

    /// The model of one of the [`revisions`](Self::revisions), starting from where that stood.
    ///
    /// # Errors
    /// As for [`load`](Self::load).
    pub fn model_of(&self, campaign: &Campaign, revision: &Revision) -> Result<StructureModel> {
        with_revision(campaign, &self.baseline, &self.data, revision)
    }

    /// Number of the current revision; `None` where nothing was ever added.
    pub fn revision(&self) -> Option<usize> {
        self.revisions.last().map(|r| r.revision)
    }

    /// `effect@site` of what is in the model beside the baseline.
    pub fn effects(&self) -> Vec<String> {
        let effects = self.model.effects().iter();
        effects.map(|added| added.instance.label()).collect()
    }

    /// What the model is, for people: `baseline + payload + local-resonator@link-3 (direction y), revision 2`.
    pub fn model_description(&self) -> String {
        let mut text = "baseline".to_string();
        for added in self.model.effects() {
            text += &format!(" + {}", added.instance.title());
        }
        match self.revision().filter(|r| *r > 0) {
            Some(revision) => format!("{text}, revision {revision}"),
            None => format!("{text}, no effect added"),
        }
    }
}

/// How an instance stands in the log.
pub fn recorded_effect(instance: &Instance) -> RecordedEffect {
    let variant = instance.effect.variant_label(instance.variant);
    RecordedEffect {
        effect: instance.label(),
        variant: variant.map(|(_, value)| value.to_string()),
    }
}

/// The model of a revision, starting from where that stood.
fn with_revision(
    campaign: &Campaign,
    baseline: &StructureModel,
    data: &FrfData,
    revision: &Revision,
) -> Result<StructureModel> {
    let summary = data.summary();
    let spec = &baseline.robot.spec;
    let mut model = baseline.clone();
    for (i, recorded) in revision.effects.iter().enumerate() {
        let wrong = |problem: String| {
            InputError::new(problem)
                .file(log_file(&campaign.dir))
                .key(format!("revisions[{}].effects[{i}]", revision.revision))
        };
        let instance = effects::find(spec, &recorded.effect)
            .into_iter()
            .find(|instance| recorded_effect(instance) == *recorded)
            .ok_or_else(|| {
                let variant = recorded.variant.as_ref();
                let choice = variant.map_or(String::new(), |v| format!(" ({v})"));
                wrong(format!(
                    "this robot has no effect {}{choice}",
                    crate::campaign::suggest::shown(&recorded.effect)
                ))
                .remedy("was the robot changed? undo the revision with `lobestone undo DIR`")
            })?;
        if let Some(obstacle) = instance.effect.obstacle(spec, &summary) {
            return Err(wrong(format!(
                "{} is in the model, but cannot be any more: {obstacle}",
                recorded.effect
            ))
            .remedy("were files taken away? undo the revision with `lobestone undo DIR`")
            .into());
        }
        model = model.with_effect(instance, &summary);
    }
    // By name: a tolerance that campaign.toml got since brings parameters that the revision did not have.
    let start = model
        .parameters
        .iter()
        .map(|parameter| {
            let known = revision.parameters.iter().find(|r| r.name == parameter.name);
            let value = known.map_or(parameter.nominal, |r| r.value);
            // Into the range, or at an effect's vanishing limit: `with_start` sees to it.
            parameter.internal(value)
        })
        .collect();
    Ok(model.with_start(start))
}
