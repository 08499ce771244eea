//! Which physics a campaign's model lacks, with what the answer rests on.

use num_complex::Complex64;

use super::structure::study_of;
use crate::Result;
use crate::campaign::Campaign;
use crate::discrepancy::{
    Candidate, CuttingComparison, Diagnosis, Explained, FrfComparison, Verdict, diagnose, next_measurement,
};
use crate::effects::Instance;
use crate::effects::cutting::CuttingInstance;
use crate::identify::cutting_problem::{CutFit, CuttingProblem};
use crate::identify::structure_study::{ResidualPeak, residual_peaks};
use crate::identify::{CuttingCase, CuttingModel, CuttingStudy, Options, StructureCase, StructureModel};

/// The diagnosis of the campaign's current model.
pub struct DiagnosisFindings {
    pub case: StructureCase,
    pub diagnosis: Diagnosis<StructureModel, Instance>,
    /// In a sentence.
    pub next_measurement: String,
    /// Predictions of the model as it stands, in the order of `case.data.frfs()`, m/N.
    pub predicted: Vec<Vec<Complex64>>,
    pub now: FrfComparison,
    pub residual_peaks: Vec<ResidualPeak>,
    /// The effect that is missing; where none explains the rest, the leading candidate. `None` where nothing is missing.
    pub leading: Option<Leading>,
}

/// What one candidate makes of the residual.
pub struct Leading {
    /// Index among the candidates.
    pub candidate: usize,
    pub predicted: Vec<Vec<Complex64>>,
    pub comparison: FrfComparison,
    pub explained: Explained,
}

impl DiagnosisFindings {
    pub fn run(campaign: &Campaign, options: Options) -> Result<Self> {
        let case = StructureCase::load(campaign)?;
        let study = study_of(&case, options);
        let diagnosis = diagnose(&study, &case.model)?;
        let next_measurement = next_measurement::advise(&case.data, &diagnosis)?;
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
            next_measurement,
            predicted,
            leading,
            diagnosis,
            case,
        })
    }

    pub fn leader(&self) -> Option<&Candidate<StructureModel, Instance>> {
        let leading = self.leading.as_ref()?;
        self.diagnosis.candidates.get(leading.candidate)
    }
}

/// The effect that is missing; where none explains the rest, the leading candidate; `None` where nothing is missing.
fn leading_candidate<M, I>(diagnosis: &Diagnosis<M, I>) -> Option<usize> {
    match diagnosis.verdict {
        Verdict::Effect => diagnosis.effect,
        Verdict::Unknown => (!diagnosis.candidates.is_empty()).then_some(0),
        Verdict::None => None,
    }
}

/// The diagnosis of a campaign's current cutting model.
pub struct CuttingFindings {
    pub case: CuttingCase,
    pub diagnosis: Diagnosis<CuttingModel, CuttingInstance>,
    /// In a sentence.
    pub next_measurement: String,
    /// The model as it stands.
    pub now: CuttingView,
    /// Index of the leading candidate, and the model with it; `None` where nothing is missing.
    pub leading: Option<(usize, CuttingView)>,
}

/// A cutting model against the records.
pub struct CuttingView {
    /// In the order of the data's cuts.
    pub fits: Vec<CutFit>,
    pub comparison: CuttingComparison,
}

impl CuttingFindings {
    /// # Errors
    /// No cuts, or none that can be used.
    pub fn run(campaign: &Campaign) -> Result<Self> {
        let case = CuttingCase::load(campaign)?;
        let diagnosis = diagnose(&CuttingStudy::new(case.data.clone()), &case.model)?;
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
        Ok(CuttingFindings {
            now: view(&case.model, &diagnosis.baseline.theta)?,
            next_measurement: next_measurement::advise_cutting(&diagnosis),
            leading,
            diagnosis,
            case,
        })
    }
}
