//! Which physics a campaign's model lacks, with what the answer rests on.

use num_complex::Complex64;

use super::structure::study_of;
use super::workbench::Workbench;
use crate::Result;
use crate::campaign::Campaign;
use crate::discrepancy::localise::{Localisation, localise};
use crate::discrepancy::outlook::{next_cut, next_measurement};
use crate::discrepancy::setup::{Rival, SetupCheck, examine, examine_cutting};
use crate::discrepancy::{
    CuttingComparison, CuttingLead, Diagnosis, DiagnosisVerdict, EffectCandidate, Explained, FrfComparison,
    NextMeasurement, cutting_lead, diagnose,
};
use crate::effects::Instance;
use crate::effects::cutting::CuttingInstance;
use crate::identify::forces::cutting_problem::{CutFit, CuttingProblem};
use crate::identify::frfs::structure_study::{ResidualPeak, residual_peaks};
use crate::identify::model_history::{recorded_cutting_effect, recorded_effect};
use crate::identify::{CuttingCase, CuttingModel, CuttingStudy, Options, StructureCase, StructureModel};
use crate::revision::{self, Domain, Evidence, RecordedCandidate};

/// The diagnosis of the campaign's current model.
pub struct DiagnosisFindings {
    /// Model and data.
    pub case: StructureCase,
    /// The verdict, and what each candidate effect explains.
    pub diagnosis: Diagnosis<StructureModel, Instance>,
    /// The measurement that would tell most.
    pub next_measurement: NextMeasurement,
    /// Predictions of the model as it stands, in the order of `case.data.frfs()`, m/N.
    pub predicted: Vec<Vec<Complex64>>,
    /// The model as it stands against the measurement.
    pub now: FrfComparison,
    /// Frequencies around which the residual stands out.
    pub residual_peaks: Vec<ResidualPeak>,
    /// Wrong files and other mistakes of the setup.
    pub setup: SetupCheck,
    /// The effect that is missing; where none explains the rest, the leading candidate. `None` where nothing is missing.
    pub leading: Option<Leading>,
    /// Where what the library has no name for sits, and what it does: sought where the verdict is unknown, and kept where one
    /// place explains more than chance.
    pub lead: Option<Localisation>,
}

/// Something is missing, the files are not to blame, and no effect of the library is it.
fn is_unnamed<M, I>(diagnosis: &Diagnosis<M, I>, setup: &SetupCheck) -> bool {
    diagnosis.verdict == DiagnosisVerdict::Unknown
        && setup.likely().is_none()
        && diagnosis.too_little_data.is_none()
}

/// What one candidate makes of the residual.
pub struct Leading {
    /// Index among the candidates.
    pub candidate: usize,
    /// Predictions with it, in the order of `case.data.frfs()`, m/N.
    pub predicted: Vec<Vec<Complex64>>,
    /// The model with it against the measurement.
    pub comparison: FrfComparison,
    /// The share of the residual that it explains, and where.
    pub explained: Explained,
}

impl DiagnosisFindings {
    /// Loads the campaign and diagnoses its current model.
    ///
    /// # Errors
    /// The case cannot be loaded, or the FRFs do not determine its parameters.
    pub fn run(campaign: &Campaign, options: Options) -> Result<Self> {
        Self::on(&Workbench::new(campaign), options)
    }

    /// As [`run`](Self::run), of files that other analyses read as well.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn on(campaign: &Workbench, options: Options) -> Result<Self> {
        Self::of(campaign, StructureCase::on(campaign)?, options)
    }

    /// As [`run`](Self::run), of a case that is there already: best one that was calibrated
    /// ([`StructureAnalysis::settled_case`](super::StructureAnalysis::settled_case)).
    ///
    /// # Errors
    /// A fit that fails.
    pub fn of(campaign: &Campaign, case: StructureCase, options: Options) -> Result<Self> {
        let study = study_of(&case, options);
        let mut diagnosis = diagnose(&study, &case.model)?;
        let baseline = &diagnosis.baseline;
        let slips = baseline.rest.beyond_slips.as_ref();
        let setup = examine(&case.model, &case.data, &baseline.theta, slips, || {
            rival(&diagnosis, |_| true)
        })?;
        heed_setup(&mut diagnosis, &setup);
        let lead = match is_unnamed(&diagnosis, &setup) {
            true => Some(localise(&study, &case.model)?).filter(|found| found.significant),
            false => None,
        };
        let next_measurement = next_measurement::advise(&case.data, &campaign.postures, &diagnosis)?;
        let (data, points) = (&case.data, &case.model.points);
        let predicted = case.model.predict(&diagnosis.baseline.theta, data)?;
        let leading = leading_candidate(&diagnosis)
            .map(|number| {
                let candidate = &diagnosis.candidates[number];
                let with = candidate.model.predict(&candidate.theta, data)?;
                Ok::<_, crate::Error>(Leading {
                    candidate: number,
                    comparison: FrfComparison::new(data, points, &with),
                    explained: Explained::new(data, points, &predicted, &with),
                    predicted: with,
                })
            })
            .transpose()?;
        Ok(DiagnosisFindings {
            now: FrfComparison::new(data, points, &predicted),
            residual_peaks: residual_peaks(&predicted, data),
            setup,
            lead,
            next_measurement,
            predicted,
            leading,
            diagnosis,
            case,
        })
    }

    /// The candidate that [`leading`](Self::leading) is about.
    pub fn leader(&self) -> Option<&EffectCandidate<StructureModel, Instance>> {
        let leading = self.leading.as_ref()?;
        self.diagnosis.candidates.get(leading.candidate)
    }
}

/// What a diagnosis says, as `add` keeps it.
fn evidence<M, I>(d: &Diagnosis<M, I>) -> Evidence {
    let finite = |v: f64| Some(v).filter(|v| v.is_finite());
    let candidate = |c: &EffectCandidate<M, I>| RecordedCandidate {
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

impl DiagnosisFindings {
    /// Keeps what was found in the campaign's folder, for the revision that an effect is added with.
    ///
    /// # Errors
    /// What the file system refuses: the diagnosis is as good without.
    pub fn keep(&self, campaign: &Workbench) -> Result<()> {
        let effects = self.case.model.effects().iter();
        let effects = effects.map(|a| recorded_effect(&a.instance)).collect();
        let of = (campaign.fingerprint(Domain::Structure)?, effects);
        revision::keep(&campaign.dir, Domain::Structure, of, evidence(&self.diagnosis))
    }
}

impl CuttingFindings {
    /// As [`DiagnosisFindings::keep`].
    ///
    /// # Errors
    /// As there.
    pub fn keep(&self, campaign: &Workbench) -> Result<()> {
        let effects = self.case.model.effects().iter();
        let effects = effects.map(|a| recorded_cutting_effect(&a.instance)).collect();
        let of = (campaign.fingerprint(Domain::Cutting)?, effects);
        revision::keep(&campaign.dir, Domain::Cutting, of, evidence(&self.diagnosis))
    }
}

/// What the best effect of the library takes away.
fn rival<M, I>(
    diagnosis: &Diagnosis<M, I>,
    possible: impl Fn(&EffectCandidate<M, I>) -> bool,
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

/// A dynamometer that is damped like a filter is a filter (quartz dynamometers have a few per cent).
fn is_possible(candidate: &EffectCandidate<CuttingModel, CuttingInstance>) -> bool {
    const MOST_DAMPING: f64 = 0.3;
    let damping = candidate.parameters.iter().filter(|p| p.name.contains("zeta["));
    let least = damping.map(|p| p.value).fold(f64::INFINITY, f64::min);
    candidate.name.effect != "dynamometer-resonance" || least < MOST_DAMPING
}

/// Confidence from which on a mistake of the setup takes an effect's place, where the effect explains the data as well.
const SURE: f64 = 0.8;

/// Mistakes of the setup that are what an effect of the library describes, where both explain the data: a filter far above the
/// band shows as the delay that it is.
const SAME: [(&str, &str); 1] = [("time-delay", "amplifier-low-pass")];

/// A likely mistake of the setup leaves no effect certain: what is missing in the model cannot be told before the files are
/// right. One that is hardly likelier than an effect which explains the data shares the confidence with it, unless both are
/// the same thing.
fn heed_setup<M, I>(diagnosis: &mut Diagnosis<M, I>, setup: &SetupCheck) {
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
        diagnosis.companion = None;
        diagnosis.indistinguishable.clear();
        diagnosis.confidence = finding.confidence;
    }
}

/// The effect that is missing; where none explains the rest, the leading candidate; `None` where nothing is missing.
fn leading_candidate<M, I>(diagnosis: &Diagnosis<M, I>) -> Option<usize> {
    match diagnosis.verdict {
        DiagnosisVerdict::Effect => diagnosis.effect,
        DiagnosisVerdict::Unknown => diagnosis.best_guess,
        DiagnosisVerdict::None => None,
    }
}

/// The diagnosis of a campaign's current cutting model.
pub struct CuttingFindings {
    /// Model and data.
    pub case: CuttingCase,
    /// The verdict, and what each candidate effect explains.
    pub diagnosis: Diagnosis<CuttingModel, CuttingInstance>,
    /// The measurement that would tell most.
    pub next_measurement: NextMeasurement,
    /// The model as it stands.
    pub now: CuttingView,
    /// Index of the leading candidate, and the model with it; `None` where nothing is missing.
    pub leading: Option<(usize, CuttingView)>,
    /// Wrong wiring and filters.
    pub setup: SetupCheck,
    /// What the model leaves, by what it follows: where the verdict is unknown.
    pub lead: Option<CuttingLead>,
}

/// A cutting model against the records.
pub struct CuttingView {
    /// In the order of the data's cuts.
    pub fits: Vec<CutFit>,
    /// Errors by cut and axis.
    pub comparison: CuttingComparison,
}

impl CuttingFindings {
    /// # Errors
    /// No cuts, or none that can be used.
    pub fn run(campaign: &Campaign) -> Result<Self> {
        Self::on(&Workbench::new(campaign))
    }

    /// As [`run`](Self::run), of files that other analyses read as well.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn on(campaign: &Workbench) -> Result<Self> {
        let case = CuttingCase::on(campaign)?;
        let mut diagnosis = diagnose(&CuttingStudy::new(case.data.clone()), &case.model)?;
        // With effects in the model what they took up may be what is wrong.
        let setup = match case.model.effects().is_empty() {
            true => examine_cutting(&case.data, || rival(&diagnosis, is_possible))?,
            false => SetupCheck::default(),
        };
        heed_setup(&mut diagnosis, &setup);
        let view = |model: &CuttingModel, theta: &[f64]| -> Result<CuttingView> {
            let data = &case.data;
            let fits = CuttingProblem { model, data }.fits(theta)?;
            let comparison = CuttingComparison::new(data, &fits);
            Ok(CuttingView { fits, comparison })
        };
        let leading = leading_candidate(&diagnosis)
            .map(|number| {
                let candidate = &diagnosis.candidates[number];
                Ok::<_, crate::Error>((number, view(&candidate.model, &candidate.theta)?))
            })
            .transpose()?;
        let now = view(&case.model, &diagnosis.baseline.theta)?;
        let lead = is_unnamed(&diagnosis, &setup).then(|| cutting_lead(&case.data, &now.fits));
        Ok(CuttingFindings {
            now,
            lead: lead.flatten(),
            next_measurement: next_cut::advise_cutting(&case.data, &diagnosis)?,
            leading,
            setup,
            diagnosis,
            case,
        })
    }
}
