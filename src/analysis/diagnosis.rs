//! Which physics a campaign's model lacks, with what the answer rests on.

use num_complex::Complex64;

use crate::Result;
use crate::campaign::Campaign;
use crate::discrepancy::{
    Candidate, Diagnosis, Explained, FrfComparison, Verdict, diagnose, next_measurement,
};
use crate::effects::Instance;
use crate::identify::structure_study::{ResidualPeak, residual_peaks};
use crate::identify::{Options, StructureCase, StructureModel};

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
        let study = case.study(options);
        let diagnosis = diagnose(&study, &case.model)?;
        let next_measurement = next_measurement::advise(&case.data, &diagnosis)?;
        let (data, points) = (&case.data, &case.model.points);
        let predicted = case.model.predict(&diagnosis.baseline.theta, data)?;
        let number = match diagnosis.verdict {
            Verdict::Effect => diagnosis.effect,
            Verdict::Unknown => (!diagnosis.candidates.is_empty()).then_some(0),
            Verdict::None => None,
        };
        let leading = number
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
