//! Which physics a campaign's model lacks, with what the answer rests on.

use super::side::CampaignSide;
use super::workbench::Workbench;
use crate::Result;
use crate::campaign::Campaign;
use crate::discrepancy::setup::{Rival, SetupCheck};
use crate::discrepancy::{
    Diagnosis, DiagnosisVerdict, EffectCandidate, NextMeasurement, diagnose, diagnose_from,
};
use crate::effects::{Cutting, Structure};
use crate::identify::model_history::recorded_effects;
use crate::identify::{Case, Modelled, Options};
use crate::revision::{self, Evidence, RecordedCandidate};

/// The diagnosis of the current model of one side of a campaign.
pub struct Findings<D: CampaignSide> {
    /// Model and data.
    pub case: Case<D>,
    /// The verdict, and what each candidate effect explains.
    pub diagnosis: Diagnosis<D>,
    /// The measurement that would tell most.
    pub next_measurement: NextMeasurement,
    /// The model as it stands.
    pub now: D::View,
    /// Wrong files and other mistakes of the setup.
    pub setup: SetupCheck,
    /// The effect that is missing; where none explains the rest, the leading candidate. `None` where nothing is missing.
    pub leading: Option<Leading<D>>,
    /// Where what the library has no name for sits, and what it does: sought where the verdict is unknown, and of what the missing effect
    /// leaves.
    pub lead: Option<D::Lead>,
}

/// What is missing in a robot model.
pub type DiagnosisFindings = Findings<Structure>;
/// What is missing in a cutting model.
pub type CuttingFindings = Findings<Cutting>;

/// What one candidate makes of the residual.
pub struct Leading<D: CampaignSide> {
    /// Index among the candidates.
    pub candidate: usize,
    /// The model with it.
    pub view: D::View,
    /// The share of the residual that it explains, and where.
    pub explained: D::Explained,
}

/// Something is missing, the files are not to blame, and no effect of the library is it.
fn is_unnamed<D: Modelled>(diagnosis: &Diagnosis<D>, setup: &SetupCheck) -> bool {
    diagnosis.verdict == DiagnosisVerdict::Unknown
        && setup.likely().is_none()
        && diagnosis.apart_from_files().is_none()
        && diagnosis.too_little_data.is_none()
}

impl<D: CampaignSide> Findings<D> {
    /// Loads the campaign and diagnoses its current model.
    ///
    /// # Errors
    /// The case cannot be loaded, or the data do not determine its parameters.
    pub fn run(campaign: &Campaign, options: Options) -> Result<Self> {
        Self::on(&Workbench::new(campaign), options)
    }

    /// As [`run`](Self::run), of files that other analyses read as well.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn on(campaign: &Workbench, options: Options) -> Result<Self> {
        Self::of(campaign, D::case(campaign)?, options)
    }

    /// As [`run`](Self::run), of a case that is there already: best one that was calibrated
    /// ([`StructureAnalysis::settled_case`](super::StructureAnalysis::settled_case)).
    ///
    /// # Errors
    /// A fit that fails.
    pub fn of(campaign: &Campaign, case: Case<D>, options: Options) -> Result<Self> {
        let study = D::study(&case, options);
        let mut diagnosis = diagnose(&study, &case.model)?;
        let setup = D::setup(&case, &study, &diagnosis)?;
        heed_setup(&mut diagnosis, &setup);
        let mut now = D::view(&case, &case.model, &diagnosis.baseline.theta)?;
        let mut lead = match is_unnamed(&diagnosis, &setup) {
            true => D::lead(&case, campaign, &study, &diagnosis, &now)?,
            false => None,
        };
        // What the data draw may have a name after all.
        if let Some(found) = &lead
            && let Some(named) = D::named(&case, &study, &diagnosis, found)?
        {
            let again = diagnose_from(&study, &case.model, named)?;
            if again.verdict == DiagnosisVerdict::Effect {
                // The files are not to blame: nothing of the setup has to be heeded.
                diagnosis = again;
                now = D::view(&case, &case.model, &diagnosis.baseline.theta)?;
                lead = None;
            }
        }
        if let (None, Some(with)) = (setup.likely(), diagnosis.winner())
            && diagnosis.companions.is_empty()
        {
            lead = D::lead_beyond(&study, with)?;
        }
        let leading = leading_candidate(&diagnosis)
            .map(|number| {
                let candidate = &diagnosis.candidates[number];
                let view = D::view(&case, &candidate.model, &candidate.theta)?;
                Ok::<_, crate::Error>(Leading {
                    candidate: number,
                    explained: D::explained(&case, &now, &view),
                    view,
                })
            })
            .transpose()?;
        Ok(Findings {
            next_measurement: D::next(&case, campaign, &diagnosis)?,
            now,
            setup,
            lead,
            leading,
            diagnosis,
            case,
        })
    }

    /// The candidate that [`leading`](Self::leading) is about.
    pub fn leader(&self) -> Option<&EffectCandidate<D>> {
        let leading = self.leading.as_ref()?;
        self.diagnosis.candidates.get(leading.candidate)
    }

    /// Keeps what was found in the campaign's folder, for the revision that an effect is added with.
    ///
    /// # Errors
    /// What the file system refuses: the diagnosis is as good without.
    pub fn keep(&self, campaign: &Workbench) -> Result<()> {
        let of = (campaign.fingerprint(D::SIDE)?, recorded_effects(&self.case.model));
        revision::keep(&campaign.dir, D::SIDE, of, evidence(&self.diagnosis))
    }
}

/// What a diagnosis says, as `add` keeps it.
fn evidence<D: Modelled>(d: &Diagnosis<D>) -> Evidence {
    let finite = |v: f64| Some(v).filter(|v| v.is_finite());
    let candidate = |c: &EffectCandidate<D>| RecordedCandidate {
        effect: c.label(),
        variant: c.name.variant.as_ref().map(|(_, value)| value.to_string()),
        nrms: finite(c.nrms),
        held_out_nrms: c.held_out.as_ref().and_then(|h| finite(h.nrms())),
        delta_bic: finite(c.delta_bic),
        p_value: finite(c.p_value),
        reduced_chi2: finite(c.reduced_chi2),
        remark: c.remark().to_string(),
    };
    Evidence {
        verdict: match d.verdict {
            DiagnosisVerdict::Effect => "effect",
            DiagnosisVerdict::None => "none",
            DiagnosisVerdict::Unknown => "unknown",
        }
        .into(),
        effect: d.winner().map(EffectCandidate::label),
        confidence: d.confidence,
        candidates: d.candidates.iter().map(candidate).collect(),
        when: revision::now(),
    }
}

/// What the best effect of the library takes away.
pub(super) fn rival<D: Modelled>(
    diagnosis: &Diagnosis<D>,
    possible: impl Fn(&EffectCandidate<D>) -> bool,
) -> Option<Rival> {
    let base = diagnosis.baseline.reduced_chi2;
    let all = diagnosis.candidates.iter();
    let candidates = all.filter(|c| c.refined && !c.at_bound && possible(c));
    let best = candidates.min_by(|a, b| a.reduced_chi2.total_cmp(&b.reduced_chi2))?;
    Some(Rival {
        label: best.label(),
        gain_share: (1.0 - best.reduced_chi2 / base).max(0.0),
        parameters: best.parameters.len(),
    })
}

/// Confidence from which on a mistake of the setup takes an effect's place, where the effect explains the data as well.
const SURE: f64 = 0.8;

/// Mistakes of the setup that are what an effect of the library describes, where both explain the data: a filter far above the
/// band shows as the delay that it is.
const SAME: [(&str, &str); 1] = [("time-delay", "amplifier-low-pass")];

/// A likely mistake of the setup leaves no effect certain: what is missing in the model cannot be told before the files are
/// right. One that is hardly likelier than an effect which explains the data shares the confidence with it, unless both are
/// the same thing. Of what was taken out of the measurements no effect has to be doubted; but where nothing else is missing, something
/// was there that the library has no name for.
fn heed_setup<D: Modelled>(diagnosis: &mut Diagnosis<D>, setup: &SetupCheck) {
    if let Some(finding) = setup.likely() {
        if diagnosis.verdict == DiagnosisVerdict::Effect && finding.confidence < SURE {
            let effect = diagnosis.winner().map(|c| c.name.effect.as_str());
            if !SAME
                .iter()
                .any(|(of, kind)| effect == Some(*of) && finding.kind == *kind)
            {
                diagnosis.confidence *= 1.0 - finding.confidence;
            }
            return;
        }
        diagnosis.verdict = DiagnosisVerdict::Unknown;
        diagnosis.effect = None;
        diagnosis.companions.clear();
        diagnosis.indistinguishable.clear();
        diagnosis.confidence = finding.confidence;
    } else if let (DiagnosisVerdict::None, Some(taken_out)) = (diagnosis.verdict, setup.taken_out().first()) {
        diagnosis.verdict = DiagnosisVerdict::Unknown;
        diagnosis.confidence = taken_out.confidence;
    }
}

/// The effect that is missing; where none explains the rest, the leading candidate; `None` where nothing is missing.
fn leading_candidate<D: Modelled>(diagnosis: &Diagnosis<D>) -> Option<usize> {
    match diagnosis.verdict {
        DiagnosisVerdict::Effect => diagnosis.effect,
        DiagnosisVerdict::Unknown => diagnosis.best_guess,
        DiagnosisVerdict::None => None,
    }
}
