//! Everything that can be said about a campaign, each part on its own: one that fails takes no other with it.

use std::sync::Arc;

use super::model_stages::{ModelStage, earlier_stages};
use super::structure_case::structure_model;
use super::workbench::Workbench;
use super::{
    CuttingAnalysis, CuttingFindings, DiagnosisFindings, LobeAnalysis, ModalAnalysis, StructureAnalysis,
};
use crate::analysis::forces::force_records::identify_forces;
use crate::analysis::modes::stick_shapes::{self, StickShape};
use crate::campaign::{Campaign, LobeSource};
use crate::cutting::{CfcOptions, CfcResult};
use crate::discrepancy::setup::{SetupCheck, SetupFinding};
use crate::identify::frfs::structure_study::held_out_postures;
use crate::identify::{Options, StructureModel};
use crate::revision::{Revision, Side};
use crate::robot::PostureReport;
use crate::{Error, InputError, Result};

/// The parts that a campaign holds; `None` where it holds nothing of the kind.
pub struct CampaignFindings<'a> {
    /// The campaign itself.
    pub campaign: &'a Campaign,
    /// The same with its files.
    pub bench: Workbench<'a>,
    /// Model against FRFs.
    pub structure: Option<Result<StructureFindings>>,
    /// What the model lacks, where that was asked for.
    pub diagnosis: Option<Result<DiagnosisFindings>>,
    /// The robot at the campaign's postures.
    pub postures: Option<Result<Vec<PostureFindings>>>,
    /// Modes of the measured FRFs.
    pub modal: Option<Result<Arc<ModalAnalysis>>>,
    /// Shapes of the posture that shows most modes, on the robot.
    pub mode_shapes: Vec<StickShape>,
    /// Cutting force coefficients.
    pub cutting: Option<Result<CfcResult>>,
    /// What the force model lacks, where that was asked for.
    pub cutting_diagnosis: Option<Result<CuttingFindings>>,
    /// What was added to the force model so far, the baseline first; empty where nothing was.
    pub cutting_revisions: Vec<Revision>,
    /// Stability lobes.
    pub lobes: Option<Result<LobeFindings>>,
    /// Wrong files and other mistakes of the setup, of the sides that a model could be fitted to.
    pub setup: Vec<Result<SetupCheck>>,
}

/// Model against FRFs.
pub struct StructureFindings {
    /// The model before and after calibration.
    pub analysis: Arc<StructureAnalysis>,
    /// nrms on postures that were left out of the fit.
    pub held_out_nrms: Option<f64>,
    /// The model at the revisions before the present one, oldest first.
    pub earlier: Vec<ModelStage>,
}

/// One posture as the robot file has it and calibrated.
#[derive(Debug, Clone)]
pub struct PostureFindings {
    /// The posture's name.
    pub id: String,
    /// By the robot file.
    pub nominal: PostureReport,
    /// With the calibrated parameters.
    pub calibrated: Option<PostureReport>,
    /// Base, joints, flange, tool centre point; base frame, m.
    pub chain_m: Vec<[f64; 3]>,
}

/// The lobes that the campaign asks for, and a check on them.
pub struct LobeFindings {
    /// What the campaign asks for.
    pub asked: LobeAnalysis,
    /// Where that is the model: the same force on the measured FRFs, or why that cannot be had.
    pub measured: Option<Result<LobeAnalysis>>,
}

impl<'a> CampaignFindings<'a> {
    /// Works out all parts; the diagnoses, which take longest, where `wanted`.
    ///
    /// # Errors
    /// The campaign holds nothing to work on, or every part failed.
    pub fn run(campaign: &'a Campaign, wanted: bool) -> Result<Self> {
        // FRFs without a robot are to be had, too: for their modes.
        let modelled = !campaign.frfs.is_empty() && campaign.robot.is_some();
        let bench = &Workbench::new(campaign);
        let modal = (!campaign.frfs.is_empty()).then(|| ModalAnalysis::usual(bench));
        let modes = modal.as_ref().and_then(|m| m.as_ref().ok());
        let structure = modelled.then(|| StructureFindings::on(bench));
        let calibrated = structure.as_ref().and_then(|s| s.as_ref().ok());
        // Where nothing can be calibrated nothing can be diagnosed, for the same reason.
        let diagnosis = calibrated.filter(|_| wanted).map(|structure| {
            DiagnosisFindings::of(campaign, structure.analysis.settled_case(), Options::default())
        });
        let cutting = (!campaign.cuts.is_empty()).then(|| identify_forces(bench, CfcOptions::default()));
        let cutting_diagnosis = (wanted && matches!(cutting, Some(Ok(_))))
            .then(|| CuttingFindings::on(bench, Options::default()));
        let postures = (campaign.robot.is_some() && !campaign.postures.is_empty())
            .then(|| PostureFindings::run(campaign, calibrated));
        let log = bench.revisions()?;
        let findings = CampaignFindings {
            campaign,
            cutting_revisions: log.revisions(Side::Cutting).cloned().collect(),
            setup: setup_checks(bench, (&structure, &diagnosis), (&cutting, &cutting_diagnosis)),
            postures,
            diagnosis,
            structure,
            mode_shapes: modes.map_or_else(Vec::new, |m| stick_shapes::of_richest_set(campaign, m)),
            modal,
            cutting,
            cutting_diagnosis,
            lobes: campaign.lobes.is_some().then(|| LobeFindings::on(bench)),
            bench: bench.clone(),
        };
        findings.checked()
    }

    fn checked(self) -> Result<Self> {
        let errors = self.errors();
        let worked = [
            self.structure.as_ref().is_some_and(Result::is_ok),
            self.postures.as_ref().is_some_and(Result::is_ok),
            self.modal.as_ref().is_some_and(Result::is_ok),
            self.cutting.as_ref().is_some_and(Result::is_ok),
            self.lobes.as_ref().is_some_and(Result::is_ok),
        ];
        if worked.contains(&true) {
            return Ok(self);
        }
        if errors.is_empty() {
            return Err(InputError::new(
                "nothing to report: no FRFs, no cuts, no lobes and no robot with postures",
            )
            .file(self.campaign.dir.join("campaign.toml"))
            .remedy("add [[frf]] or [[cut]] tables")
            .into());
        }
        Err(Error::computation(format!(
            "nothing can be reported:\n{}",
            errors.join("\n")
        )))
    }

    /// What failed and why, each message once.
    pub fn errors(&self) -> Vec<String> {
        let mut messages = self.messages(|_| true);
        let unchecked = self.setup.iter().filter_map(|check| check.as_ref().err());
        for message in unchecked.map(SetupCheck::failed) {
            if !messages.iter().any(|m| message.ends_with(m.as_str())) {
                messages.push(message);
            }
        }
        messages
    }

    /// What failed because a file does not say what it should or cannot be read, each message once.
    pub fn input_errors(&self) -> Vec<String> {
        self.messages(|e| matches!(e, Error::Input(_) | Error::Io { .. }))
    }

    fn messages(&self, wanted: fn(&Error) -> bool) -> Vec<String> {
        let errors = [
            self.structure.as_ref().and_then(|r| r.as_ref().err()),
            self.diagnosis.as_ref().and_then(|r| r.as_ref().err()),
            self.postures.as_ref().and_then(|r| r.as_ref().err()),
            self.modal.as_ref().and_then(|r| r.as_ref().err()),
            self.cutting.as_ref().and_then(|r| r.as_ref().err()),
            self.cutting_diagnosis.as_ref().and_then(|r| r.as_ref().err()),
            self.lobes.as_ref().and_then(|r| r.as_ref().err()),
        ];
        let mut messages: Vec<String> = Vec::new();
        for message in errors
            .into_iter()
            .flatten()
            .filter(|e| wanted(e))
            .map(ToString::to_string)
        {
            if !messages.contains(&message) {
                messages.push(message);
            }
        }
        messages
    }

    /// Wrong files and other mistakes of the setup that are likely, of both sides.
    pub fn likely_mistakes(&self) -> impl Iterator<Item = &SetupFinding> {
        let checks = self.setup.iter().filter_map(|check| check.as_ref().ok());
        checks.flat_map(|check| &check.findings).filter(|f| f.is_likely())
    }

    /// The structural part where it succeeded.
    pub fn structure(&self) -> Option<&StructureFindings> {
        self.structure.as_ref().and_then(|r| r.as_ref().ok())
    }

    /// What the robot model lacks, where that was looked for and found.
    pub fn diagnosis(&self) -> Option<&DiagnosisFindings> {
        self.diagnosis.as_ref().and_then(|r| r.as_ref().ok())
    }

    /// The cutting force coefficients, where they were found.
    pub fn cutting(&self) -> Option<&CfcResult> {
        self.cutting.as_ref().and_then(|r| r.as_ref().ok())
    }

    /// What the force model lacks, where that was looked for and found.
    pub fn cutting_diagnosis(&self) -> Option<&CuttingFindings> {
        self.cutting_diagnosis.as_ref().and_then(|r| r.as_ref().ok())
    }

    /// The lobes, where they were found.
    pub fn lobes(&self) -> Option<&LobeFindings> {
        self.lobes.as_ref().and_then(|r| r.as_ref().ok())
    }

    /// The measured modes, where they were found.
    pub fn modal(&self) -> Option<&ModalAnalysis> {
        self.modal.as_ref().and_then(|r| r.as_deref().ok())
    }
}

/// From the diagnoses where they were made.
fn setup_checks(
    campaign: &Workbench,
    (structure, diagnosis): (
        &Option<Result<StructureFindings>>,
        &Option<Result<DiagnosisFindings>>,
    ),
    (cutting, cutting_diagnosis): (&Option<Result<CfcResult>>, &Option<Result<CuttingFindings>>),
) -> Vec<Result<SetupCheck>> {
    let of_structure = match (diagnosis, structure) {
        (Some(Ok(d)), _) => Some(Ok(d.setup.clone())),
        (_, Some(Ok(s))) => Some(s.analysis.setup_check()),
        _ => None,
    };
    let of_cutting = match (cutting_diagnosis, cutting) {
        (Some(Ok(d)), _) => Some(Ok(d.setup.clone())),
        (_, Some(Ok(_))) => Some(CuttingAnalysis::on(campaign).and_then(|c| c.setup_check())),
        _ => None,
    };
    of_structure.into_iter().chain(of_cutting).collect()
}

impl StructureFindings {
    /// Calibrates the model, and once more for each posture without that posture.
    ///
    /// # Errors
    /// As [`StructureAnalysis::run`].
    pub fn on(campaign: &Workbench) -> Result<Self> {
        let analysis = StructureAnalysis::on(campaign)?;
        let held_out_nrms = held_out_postures(
            &analysis.case.model,
            &analysis.case.data,
            &analysis.calibration.theta,
        )?
        .map(|h| h.nrms());
        Ok(StructureFindings {
            earlier: earlier_stages(campaign, &analysis.case)?,
            analysis,
            held_out_nrms,
        })
    }
}

impl PostureFindings {
    /// The robot at every posture; `structure` gives the calibrated values.
    ///
    /// # Errors
    /// No robot, or a posture that it cannot take.
    pub fn run(campaign: &Campaign, structure: Option<&StructureFindings>) -> Result<Vec<PostureFindings>> {
        let model = structure_model(campaign)?;
        let nominal = posture_reports(campaign, &model, &model.nominal_theta())?;
        let mut calibrated: Vec<Option<PostureReport>> = match structure {
            Some(s) => posture_reports(campaign, &s.analysis.case.model, &s.analysis.calibration.theta)?
                .into_iter()
                .map(Some)
                .collect(),
            None => vec![None; nominal.len()],
        };
        campaign
            .postures
            .iter()
            .zip(nominal)
            .zip(&mut calibrated)
            .map(|((posture, nominal), calibrated)| {
                let kinematics = model.robot.kinematics(&posture.joints_deg)?;
                Ok(PostureFindings {
                    id: posture.id.clone(),
                    nominal,
                    calibrated: calibrated.take(),
                    chain_m: stick_shapes::chain(&kinematics)
                        .iter()
                        .map(|p| p.coords.into())
                        .collect(),
                })
            })
            .collect()
    }
}

fn posture_reports(campaign: &Campaign, model: &StructureModel, theta: &[f64]) -> Result<Vec<PostureReport>> {
    campaign
        .postures
        .iter()
        .map(|posture| {
            let kinematics = model.robot.kinematics(&posture.joints_deg)?;
            let chain = model.chain(theta, &kinematics, Default::default(), false);
            PostureReport::new(&model.robot, &model.kinematics_at(theta, &kinematics), &chain)
        })
        .collect()
}

impl LobeFindings {
    /// The lobes as asked for; those from the model on the measured FRFs as well.
    ///
    /// # Errors
    /// As [`LobeAnalysis::run`].
    pub fn run(campaign: &Campaign) -> Result<Self> {
        Self::on(&Workbench::new(campaign))
    }

    /// As [`run`](Self::run), of files that other analyses read as well.
    ///
    /// # Errors
    /// As [`LobeAnalysis::run`].
    pub fn on(campaign: &Workbench) -> Result<Self> {
        let asked = LobeAnalysis::on(campaign)?;
        let measured = (asked.source == LobeSource::Model && !campaign.frfs.is_empty()).then(|| {
            let other = with_source(campaign, LobeSource::Measured);
            LobeAnalysis::on(&campaign.for_request(&other))
        });
        Ok(LobeFindings { asked, measured })
    }
}

fn with_source(campaign: &Campaign, source: LobeSource) -> Campaign {
    let mut other = campaign.clone();
    if let Some(section) = other.lobes.as_mut() {
        section.source = source;
    }
    other
}
