//! Many campaigns one after the other, each as rows of a table: one broken campaign is a row that says so.

mod manifest;

use crate::identify::Modelled;
pub use manifest::{Manifest, ManifestEntry};

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use crate::analysis::forces::force_records::identify_forces;
use crate::analysis::workbench::Workbench;
use crate::analysis::{CuttingAnalysis, CuttingFindings, DiagnosisFindings, StructureAnalysis};
use crate::campaign::{Campaign, campaign_file};
use crate::cutting::{CfcOptions, ForceGroup};
use crate::discrepancy::setup::{SetupCheck, SetupFinding};
use crate::discrepancy::{Diagnosis, DiagnosisVerdict};
use crate::identify::frfs::structure_study::held_out_postures;
use crate::identify::{Estimate, Options, StructureCase};
use crate::revision::folder_fingerprint;
use crate::{Error, InputError, Result};

/// What is done with every campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum BatchStep {
    /// The model fitted: joint stiffness, damping; of cuts their coefficients and the error of the waveform.
    Calibrate,
    /// Cutting force coefficients.
    Cfc,
    /// The error on data left out of the fit as well.
    Compare,
    /// Which physics the model lacks.
    Diagnose,
}

impl BatchStep {
    fn name(self) -> &'static str {
        match self {
            BatchStep::Calibrate => "calibrate",
            BatchStep::Cfc => "cfc",
            BatchStep::Compare => "compare",
            BatchStep::Diagnose => "diagnose",
        }
    }
}

/// What is done with every campaign, each step once, in one order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Steps(Vec<BatchStep>);

impl Steps {
    /// `steps` in the one order, without repetitions.
    pub fn new(mut steps: Vec<BatchStep>) -> Self {
        steps.sort_unstable();
        steps.dedup();
        Steps(steps)
    }

    fn has(&self, step: BatchStep) -> bool {
        self.0.contains(&step)
    }

    /// `calibrate,diagnose`.
    pub fn name(&self) -> String {
        let names: Vec<&str> = self.0.iter().map(|s| s.name()).collect();
        names.join(",")
    }
}

/// This program, as results name it.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Whether the work was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// All of it.
    Done,
    /// It ended with an error.
    Failed,
}

impl Status {
    /// As tables name it.
    pub fn name(self) -> &'static str {
        match self {
            Status::Done => "done",
            Status::Failed => "failed",
        }
    }
}

/// A number that was estimated, with its standard error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BatchQuantity {
    /// With its unit: `joint-1.stiffness_nm_per_rad`.
    pub name: String,
    /// The estimate; `None` where it is not finite.
    pub value: Option<f64>,
    /// Its standard error, in the same unit.
    pub std_error: Option<f64>,
}

/// What was found out about one side of a campaign: a row of the table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SideResult {
    /// `structure` or `cutting`; empty where the campaign could not be read.
    pub domain: String,
    /// Whether the work was done.
    pub status: Status,
    /// Why it was not.
    pub error: Option<String>,
    /// What it took, s.
    pub seconds: f64,
    /// What was found; empty after an error.
    pub findings: BatchFindings,
}

/// Nothing where it was not asked for.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct BatchFindings {
    /// The campaign whose calibration this one started from, as the manifest names it.
    #[serde(default)]
    pub started_from: Option<String>,
    /// Error of the fit, a ratio.
    pub nrms: Option<f64>,
    /// nrms that the noise alone makes.
    pub noise: Option<f64>,
    /// nrms on data that were left out of the fit.
    pub held_out_nrms: Option<f64>,
    /// Whether the calibration converged.
    pub converged: Option<bool>,
    /// `effect`, `none`, `unknown`.
    pub verdict: Option<String>,
    /// The missing effect, where the verdict is `effect`.
    pub effect: Option<String>,
    /// Where it sits, for effects that have a place.
    pub site: Option<String>,
    /// 0..1.
    pub confidence: Option<f64>,
    /// Mistakes of the files or the setup that are likely.
    pub setup: Vec<String>,
    /// Estimated parameters or coefficients.
    pub quantities: Vec<BatchQuantity>,
}

/// What is kept of one campaign: complete, or not there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// As the manifest names it.
    pub campaign: String,
    /// As [`fingerprint`] of the campaign when it was worked on.
    pub fingerprint: String,
    /// Of the program that made the record.
    pub version: String,
    /// `calibrate,diagnose`.
    pub command: String,
    /// What `campaign.toml` says, for a manifest that does not.
    pub robot: Option<String>,
    /// Date of the measurements by `campaign.toml`, likewise.
    pub date: Option<String>,
    /// One for each side of the campaign.
    pub sides: Vec<SideResult>,
}

/// Where the calibration of a campaign's structure starts: what another campaign of the same robot gave.
#[derive(Debug, Clone, PartialEq)]
pub struct WarmStart {
    /// That campaign, as the manifest names it.
    pub campaign: String,
    /// Its calibrated parameters, named as in the table.
    quantities: Vec<BatchQuantity>,
}

impl WarmStart {
    /// The calibration of a record; `None` where there is none of the structure, or it did not converge.
    pub fn of(record: &Record) -> Option<Self> {
        let structure = record.sides.iter().find(|s| s.domain == STRUCTURE)?;
        (structure.findings.converged == Some(true)).then(|| WarmStart {
            campaign: record.campaign.clone(),
            quantities: structure.findings.quantities.clone(),
        })
    }

    /// Name and values, for a fingerprint: numbers as they read back.
    fn text(&self) -> String {
        let values = self
            .quantities
            .iter()
            .map(|q| format!(" {}={:?}", q.name, q.value));
        std::iter::once(self.campaign.clone()).chain(values).collect()
    }

    /// The case, fitted from here; by name, so that a parameter that the other campaign had not starts at its nominal value.
    fn begin(&self, case: StructureCase) -> StructureCase {
        let theta = case.model.theta_of(|parameter| {
            let name = with_unit(&parameter.name, parameter.unit);
            let known = self.quantities.iter().find(|q| q.name == name)?;
            known.value.filter(|v| parameter.internal(*v).is_finite())
        });
        case.starting_from(theta)
    }
}

/// Contents of `campaign.toml`, of the revisions and of all files that it names, the steps, the program's version, and what
/// the calibration starts from.
pub fn fingerprint(dir: &Path, steps: &Steps, start: Option<&WarmStart>) -> String {
    let start = start.map(WarmStart::text);
    let mut about = vec!["batch", VERSION];
    let steps = steps.name();
    about.push(&steps);
    about.extend(start.as_deref());
    folder_fingerprint(dir, &about)
}

/// Works on a campaign; nothing is written into its folder. What cannot be done is told in the record.
pub fn examine(entry: &ManifestEntry, steps: &Steps, start: Option<&WarmStart>, fingerprint: &str) -> Record {
    let begun = Instant::now();
    let loaded = guarded(|| {
        let campaign = Campaign::load(&entry.dir)?;
        let sides = sides(&campaign, steps)?;
        Ok((campaign, sides))
    });
    let mut record = Record {
        campaign: entry.campaign.clone(),
        fingerprint: fingerprint.to_string(),
        version: VERSION.to_string(),
        command: steps.name(),
        robot: None,
        date: None,
        sides: Vec::new(),
    };
    match loaded {
        Ok((campaign, sides)) => {
            record.robot = campaign.robot.as_ref().map(|r| r.model.clone());
            record.date = campaign.date.clone();
            for (domain, work) in sides {
                let begun = Instant::now();
                let found = guarded(|| work(&campaign, steps, start));
                record.sides.push(side(domain, found, begun));
            }
        }
        Err(error) => record.sides.push(side("", Err(error), begun)),
    }
    record
}

fn side(domain: &str, found: Result<BatchFindings>, begun: Instant) -> SideResult {
    let (status, error, findings) = match found {
        Ok(findings) => (Status::Done, None, findings),
        Err(error) => (Status::Failed, Some(error.to_string()), BatchFindings::default()),
    };
    SideResult {
        domain: domain.to_string(),
        status,
        error,
        seconds: (1e3 * begun.elapsed().as_secs_f64()).round() / 1e3,
        findings,
    }
}

/// One campaign that makes the program panic is a fault of the program, and no reason to lose the others.
fn guarded<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|cause| {
        let text = cause.downcast_ref::<String>().map(String::as_str);
        let text = text
            .or(cause.downcast_ref::<&str>().copied())
            .unwrap_or("no message");
        Err(Error::computation(format!(
            "a fault of this program, please report it: {text}"
        )))
    })
}

/// Name of the side of the FRFs.
const STRUCTURE: &str = "structure";

type Work = fn(&Campaign, &Steps, Option<&WarmStart>) -> Result<BatchFindings>;

/// The sides that the campaign holds and the steps are about.
///
/// # Errors
/// There is none.
fn sides(campaign: &Campaign, steps: &Steps) -> Result<Vec<(&'static str, Work)>> {
    let mut sides: Vec<(&'static str, Work)> = Vec::new();
    // Coefficients are all that `cfc` is about.
    if !campaign.frfs.is_empty() && steps.0 != [BatchStep::Cfc] {
        sides.push((STRUCTURE, structure));
    }
    if !campaign.cuts.is_empty() {
        sides.push(("cutting", cutting));
    }
    if !sides.is_empty() {
        return Ok(sides);
    }
    let (problem, remedy) = match campaign.frfs.is_empty() {
        true => (
            "nothing to work on: no FRFs and no cuts".to_string(),
            "add [[frf]] or [[cut]] tables",
        ),
        false => (
            format!(
                "nothing to work on: {} needs cuts, and there are FRFs only",
                steps.name()
            ),
            "ask for calibrate or diagnose as well",
        ),
    };
    Err(InputError::new(problem)
        .file(campaign_file(&campaign.dir))
        .remedy(remedy)
        .into())
}

fn structure(campaign: &Campaign, steps: &Steps, start: Option<&WarmStart>) -> Result<BatchFindings> {
    let case = StructureCase::load(campaign)?;
    // A revision has a start of its own.
    let start = start.filter(|_| case.model.start().is_none());
    let case = match start {
        Some(start) => start.begin(case),
        None => case,
    };
    let analysis = StructureAnalysis::of_case(case, Options::default())?;
    let (case, calibration) = (&analysis.case, &analysis.calibration);
    let mut found = BatchFindings {
        started_from: start.map(|s| s.campaign.clone()),
        nrms: finite(analysis.after.totals.nrms),
        noise: finite(analysis.after.totals.noise_floor_nrms),
        converged: Some(calibration.converged()),
        quantities: calibration.parameters.iter().map(quantity).collect(),
        ..BatchFindings::default()
    };
    if steps.has(BatchStep::Compare) {
        let held_out = held_out_postures(&case.model, &case.data, &calibration.theta)?;
        found.held_out_nrms = held_out.and_then(|h| finite(h.nrms()));
    }
    if steps.has(BatchStep::Diagnose) {
        let d = DiagnosisFindings::of(campaign, analysis.settled_case(), Options::default())?;
        found.diagnosed(&d.diagnosis, &d.setup);
    } else {
        found.setup = likely(&analysis.setup_check()?);
    }
    Ok(found)
}

fn cutting(campaign: &Campaign, steps: &Steps, _: Option<&WarmStart>) -> Result<BatchFindings> {
    let campaign = &Workbench::new(campaign);
    let mut found = BatchFindings::default();
    if steps.has(BatchStep::Calibrate) || steps.has(BatchStep::Cfc) {
        let result = identify_forces(campaign, CfcOptions::default())?;
        found.quantities = result.pooled.iter().flat_map(coefficients).collect();
    }
    if steps.has(BatchStep::Diagnose) {
        let d = CuttingFindings::on(campaign, Options::default())?;
        let totals = &d.now.comparison.totals;
        (found.nrms, found.noise) = (finite(totals.nrms), finite(totals.noise_floor_nrms));
        found.diagnosed(&d.diagnosis, &d.setup);
    }
    if steps.has(BatchStep::Compare) || (steps.has(BatchStep::Calibrate) && !steps.has(BatchStep::Diagnose)) {
        let analysis = CuttingAnalysis::on(campaign)?;
        let totals = &analysis.comparison.totals;
        (found.nrms, found.noise) = (finite(totals.nrms), finite(totals.noise_floor_nrms));
        found.converged = Some(analysis.calibration.converged());
        if steps.has(BatchStep::Compare) {
            found.held_out_nrms = analysis.held_out_nrms.and_then(finite);
        }
        if !steps.has(BatchStep::Diagnose) {
            found.setup = likely(&analysis.setup_check()?);
        }
    }
    Ok(found)
}

impl BatchFindings {
    fn diagnosed<D: Modelled>(&mut self, diagnosis: &Diagnosis<D>, setup: &SetupCheck) {
        let verdict = match diagnosis.verdict {
            DiagnosisVerdict::Effect => "effect",
            DiagnosisVerdict::None => "none",
            DiagnosisVerdict::Unknown => "unknown",
        };
        let winner = diagnosis.winner();
        self.verdict = Some(verdict.into());
        self.effect = winner.map(|c| c.name.effect.to_string());
        self.site = winner.and_then(|c| c.name.site.as_ref()).map(|s| s.to_string());
        self.confidence = finite(diagnosis.confidence);
        self.setup = likely(setup);
    }
}

fn likely(setup: &SetupCheck) -> Vec<String> {
    let likely = setup.findings.iter().filter(|f| f.is_likely());
    likely.map(SetupFinding::sentence).collect()
}

fn finite(value: f64) -> Option<f64> {
    Some(value).filter(|v| v.is_finite())
}

fn quantity(estimate: &Estimate) -> BatchQuantity {
    BatchQuantity {
        name: with_unit(&estimate.name, estimate.unit),
        value: finite(estimate.value),
        std_error: finite(estimate.std_error),
    }
}

/// `joint-1.stiffness` in `N·m/rad` is `joint-1.stiffness_nm_per_rad`; names that say their unit stay.
fn with_unit(name: &str, unit: &str) -> String {
    let unit = unit
        .replace('·', "")
        .replace('/', "_per_")
        .replace('²', "2")
        .to_lowercase();
    let said = name.split('[').next().unwrap_or(name);
    match unit.is_empty() || unit == "1" || said.ends_with(&format!("_{unit}")) {
        true => name.to_string(),
        false => format!("{name}_{unit}"),
    }
}

/// The coefficients of a group over all speeds. Their names say process and material, so that those of different ones are
/// never on one chart: `milling.Ti-6Al-4V.ktc_n_per_mm2`.
fn coefficients(group: &ForceGroup) -> Vec<BatchQuantity> {
    let process = group.process.name();
    let prefix = match &group.material {
        Some(material) => format!("{process}.{material}."),
        None => format!("{process}."),
    };
    let of_group = group.coefficients.iter();
    of_group
        .map(|c| BatchQuantity {
            name: format!("{prefix}{}", c.key),
            value: c.value.and_then(finite),
            std_error: c.std_error.and_then(finite),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_said_once() {
        assert_eq!(
            with_unit("joint-1.stiffness", "N·m/rad"),
            "joint-1.stiffness_nm_per_rad"
        );
        assert_eq!(
            with_unit("joint-damping.c_nms_per_rad[0]", "N·m·s/rad"),
            "joint-damping.c_nms_per_rad[0]"
        );
        assert_eq!(with_unit("payload.mass_kg", "kg"), "payload.mass_kg");
        assert_eq!(with_unit("damping_ratio", "1"), "damping_ratio");
    }

    #[test]
    fn a_panic_is_an_error_with_its_message() {
        let fault = guarded(|| -> Result<()> { panic!("index {} of 3", 7) }).unwrap_err();
        assert!(
            fault.to_string().ends_with("please report it: index 7 of 3"),
            "{fault}"
        );
        assert!(guarded(|| Ok(1)).is_ok());
    }

    #[test]
    fn steps_have_one_order() {
        let steps = Steps::new(vec![
            BatchStep::Diagnose,
            BatchStep::Calibrate,
            BatchStep::Diagnose,
        ]);
        assert_eq!(steps.name(), "calibrate,diagnose");
    }
}
