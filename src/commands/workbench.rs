//! A campaign as the page of `serve` works on it: the documents and texts are those of the commands of the same names.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};

use super::{Outcome, add, diagnose, explain, history, undo};
use crate::analysis::{CampaignFindings, CuttingAnalysis, CuttingFindings, DiagnosisFindings};
use crate::campaign::{Campaign, campaign_file};
use crate::identify::Options;
use crate::report::{campaign as pages, diagnosis_section, waveform_section};
use crate::revision::{Domain, RecordedEffect, RevisionLog, fingerprint, hold, log_file};
use crate::robot::RobotSpec;
use crate::serve::{Job, Order, Refusal, Report, Stage, Workbench};
use crate::{Error, InputError, Result};

/// One campaign folder, and what was found out about it since the server began.
pub struct CampaignBench {
    /// Without symbolic links in it.
    dir: PathBuf,
    title: String,
    found: Mutex<Found>,
}

#[derive(Default)]
struct Found {
    report: Option<Arc<Report>>,
    /// Reports drawn so far.
    drawn: usize,
    /// The folder's stamp when the report was drawn, or failed to be.
    drawn_of: Option<String>,
    /// What the report lacks, and why.
    problems: Vec<String>,
    /// The model as it stands then, side by side.
    now: Vec<(Domain, Value)>,
    /// Oldest first.
    diagnoses: Vec<Known>,
}

/// The model as it stands.
struct Drawn {
    report: Report,
    problems: Vec<String>,
    now: Vec<(Domain, Value)>,
}

/// A diagnosis, for as long as data and model are those that it was made of; also if they come back by an undo.
struct Known {
    side: Domain,
    of: ModelState,
    document: Value,
    /// The verdict in plain words.
    answer: String,
    /// Lent to the report while that is drawn.
    findings: Option<Findings>,
}

enum Findings {
    Structure(Box<DiagnosisFindings>),
    Cutting(Box<CuttingFindings>),
}

/// Data (their fingerprint) and effects.
type ModelState = (String, Vec<RecordedEffect>);

/// Diagnoses kept, at most; each holds all FRFs several times.
const KEPT: usize = 6;

/// A text made for the terminal, without its colours.
fn plain(text: &str) -> String {
    anstream::adapter::strip_str(text).to_string()
}

/// The sides that a campaign holds.
fn sides(campaign: &Campaign) -> Vec<Domain> {
    let structure = !campaign.frfs.is_empty() && campaign.robot.is_some();
    let cutting = !campaign.cuts.is_empty();
    let all = [(structure, Domain::Structure), (cutting, Domain::Cutting)];
    all.into_iter()
        .filter(|(there, _)| *there)
        .map(|(_, side)| side)
        .collect()
}

fn model_state(campaign: &Campaign, log: &RevisionLog, side: Domain) -> Result<ModelState> {
    let effects = log.current(side).map(|r| r.effects.clone());
    Ok((fingerprint(campaign, side)?, effects.unwrap_or_default()))
}

impl CampaignBench {
    /// # Errors
    /// There is no campaign, or not a valid one; what the program keeps of it lies elsewhere.
    pub fn open(dir: &Path) -> Result<Self> {
        let title = Campaign::load(dir)?.name;
        let dir = dir.canonicalize().map_err(|e| Error::io(dir, e))?;
        let bench = CampaignBench {
            dir,
            title,
            found: Mutex::default(),
        };
        bench.stays_inside()?;
        RevisionLog::load(&bench.dir)?;
        Ok(bench)
    }

    pub fn dir(&self) -> &Path {
        &self.dir
    }

    fn found(&self) -> MutexGuard<'_, Found> {
        self.found.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The files that are read and written by their names alone do not lie elsewhere, behind a symbolic link. (Those that
    /// campaign.toml names are looked at where it is read.)
    fn stays_inside(&self) -> Result<()> {
        let log = log_file(&self.dir);
        let folder = log.parent().unwrap_or(&self.dir);
        for path in [campaign_file(&self.dir).as_path(), folder, &log] {
            if path.symlink_metadata().is_err() {
                continue;
            }
            let real = path.canonicalize().map_err(|e| Error::io(path, e))?;
            if !real.starts_with(&self.dir) {
                return Err(
                    InputError::new("leads out of the campaign folder (symbolic link)")
                        .file(path)
                        .remedy("put the file or folder itself there")
                        .into(),
                );
            }
        }
        Ok(())
    }

    /// The log, if one side of it still is what the page showed.
    fn log_at(&self, side: Domain, head: &str) -> std::result::Result<RevisionLog, Refusal> {
        self.stays_inside()?;
        let log = RevisionLog::load(&self.dir)?;
        match log.mark(side) == head {
            true => Ok(log),
            false => Err(Refusal::Late(
                "the model was changed since this page showed it (another click, another window, or a command in a \
                 terminal); nothing was done. Look at how it stands now, and click again if you still want to"
                    .into(),
            )),
        }
    }

    fn diagnose(&self, side: Domain, stage: &Stage) -> Result<String> {
        let campaign = Campaign::load(&self.dir)?;
        let of = model_state(&campaign, &RevisionLog::load(&self.dir)?, side)?;
        stage.now("looking for what is missing");
        let (Outcome { json, text, .. }, answer, findings) = match side {
            Domain::Structure => {
                let found = Box::new(DiagnosisFindings::run(&campaign, Options::default())?);
                let outcome = diagnose::structure(&campaign, &found);
                (
                    outcome,
                    diagnosis_section::summary(&found),
                    Findings::Structure(found),
                )
            }
            Domain::Cutting => {
                let found = Box::new(CuttingFindings::run(&campaign)?);
                let outcome = diagnose::cutting(&campaign, &found);
                (
                    outcome,
                    waveform_section::summary(&found),
                    Findings::Cutting(found),
                )
            }
        };
        if self.stays_inside().is_ok() {
            // A folder that cannot be written to is no reason not to answer.
            let _ = match &findings {
                Findings::Structure(found) => found.keep(&campaign),
                Findings::Cutting(found) => found.keep(&campaign),
            };
        }
        {
            let diagnoses = &mut self.found().diagnoses;
            diagnoses.retain(|k| !(k.side == side && k.of == of));
            if diagnoses.len() == KEPT {
                diagnoses.remove(0);
            }
            diagnoses.push(Known {
                side,
                of,
                document: json,
                answer,
                findings: Some(findings),
            });
        }
        self.draw(&campaign, stage);
        Ok(plain(&text))
    }

    fn add(&self, log: RevisionLog, effect: &str, stage: &Stage) -> Result<String> {
        let campaign = Campaign::load(&self.dir)?;
        stage.now("fitting everything again, with the effect");
        let Outcome { text, .. } = add::after(log, &campaign, effect)?;
        self.draw(&campaign, stage);
        Ok(plain(&text))
    }

    fn undo(&self, log: RevisionLog, side: Domain, stage: &Stage) -> Result<String> {
        let campaign = Campaign::load(&self.dir)?;
        stage.now("taking the last revision back");
        let Outcome { text, .. } = undo::after(log, &campaign, side)?;
        self.draw(&campaign, stage);
        Ok(plain(&text))
    }

    /// Fits the model as it stands and draws the report of it. What fails stands in the page, and does not undo what was
    /// done before.
    fn draw(&self, campaign: &Campaign, stage: &Stage) {
        stage.now("fitting the model as it stands and drawing the report");
        let stamp = self.stamp();
        let drawn = self.try_to_draw(campaign);
        let mut found = self.found();
        found.drawn_of = Some(stamp);
        match drawn {
            Ok(drawn) => {
                found.report = Some(Arc::new(drawn.report));
                found.problems = drawn.problems;
                found.now = drawn.now;
            }
            Err(error) => {
                found.report = None;
                found.problems = vec![error.to_string()];
                found.now.clear();
            }
        }
        found.drawn += 1;
    }

    fn try_to_draw(&self, campaign: &Campaign) -> Result<Drawn> {
        let log = RevisionLog::load(&self.dir)?;
        let mut findings = CampaignFindings::run(campaign, false)?;
        let mut lent = Vec::new();
        for side in sides(campaign) {
            let of = model_state(campaign, &log, side)?;
            let taken = self.known(side, &of, |known| known.findings.take());
            match taken.flatten() {
                Some(Findings::Structure(found)) => findings.diagnosis = Some(Ok(*found)),
                Some(Findings::Cutting(found)) => findings.cutting_diagnosis = Some(Ok(*found)),
                None => continue,
            }
            lent.push((side, of));
        }
        let page = pages::page(&findings, None);
        let report = page.html().map(|html| Report {
            html,
            images: page
                .images()
                .into_iter()
                .map(|(n, png)| (n, png.to_vec()))
                .collect::<HashMap<_, _>>(),
        });
        let problems = findings.errors();
        let now = sides(campaign)
            .into_iter()
            .filter_map(|side| Some((side, self.error_now(campaign, &log, &findings, side)?)))
            .collect();
        for (side, of) in lent {
            let back = match side {
                Domain::Structure => findings
                    .diagnosis
                    .take()
                    .and_then(Result::ok)
                    .map(|f| Findings::Structure(Box::new(f))),
                Domain::Cutting => findings
                    .cutting_diagnosis
                    .take()
                    .and_then(Result::ok)
                    .map(|f| Findings::Cutting(Box::new(f))),
            };
            self.known(side, &of, |known| known.findings = back);
        }
        Ok(Drawn {
            report: report?,
            problems,
            now,
        })
    }

    /// Error and noise of the model as it stands; `None` where it cannot be fitted.
    fn error_now(
        &self,
        campaign: &Campaign,
        log: &RevisionLog,
        findings: &CampaignFindings,
        side: Domain,
    ) -> Option<Value> {
        let (totals, held_out_nrms) = match side {
            Domain::Structure => {
                let structure = findings.structure()?;
                (structure.analysis.after.totals, structure.held_out_nrms)
            }
            Domain::Cutting => match findings.cutting_diagnosis() {
                Some(found) => {
                    let held_out = &found.diagnosis.baseline.held_out;
                    (found.now.comparison.totals, held_out.as_ref().map(|h| h.nrms()))
                }
                // What is recorded need not be fitted again for its error alone.
                None if log.current(side).is_some() => return None,
                None => {
                    let analysis = CuttingAnalysis::run(campaign).ok()?;
                    (analysis.comparison.totals, analysis.held_out_nrms)
                }
            },
        };
        let mut error = json!(totals);
        error["held_out_nrms"] = json!(held_out_nrms);
        Some(error)
    }

    /// What is known of a side in a state.
    fn known<T>(&self, side: Domain, of: &ModelState, look: impl FnOnce(&mut Known) -> T) -> Option<T> {
        let mut found = self.found();
        let known = found.diagnoses.iter_mut().find(|k| k.side == side && k.of == *of);
        known.map(look)
    }

    fn side_document(&self, campaign: &Campaign, log: &RevisionLog, side: Domain) -> Result<Value> {
        let of = model_state(campaign, log, side)?;
        let diagnosis = self.known(side, &of, |known| {
            let mut document = known.document.clone();
            document["answer"] = json!(known.answer);
            document
        });
        let now = self
            .found()
            .now
            .iter()
            .find(|(s, _)| *s == side)
            .map(|(_, error)| error.clone());
        Ok(json!({
            "side": side,
            "head": log.mark(side),
            "can_undo": log.current(side).is_some_and(|r| r.revision > 0),
            "history": history::of(campaign, side)?.json,
            "now": now,
            "diagnosis": diagnosis,
        }))
    }
}

impl Workbench for CampaignBench {
    fn title(&self) -> String {
        self.title.clone()
    }

    fn stamp(&self) -> String {
        let of = |path: PathBuf| match path.metadata() {
            Ok(meta) => {
                let since = meta
                    .modified()
                    .ok()
                    .and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok());
                format!("{}@{}", meta.len(), since.map_or(0, |s| s.as_nanos()))
            }
            Err(_) => "none".into(),
        };
        format!("{} {}", of(campaign_file(&self.dir)), of(log_file(&self.dir)))
    }

    fn state(&self) -> Result<Value> {
        let stamp = self.stamp();
        let campaign = Campaign::load(&self.dir)?;
        let log = RevisionLog::load(&self.dir)?;
        let sides: Vec<Value> = sides(&campaign)
            .into_iter()
            .map(|side| self.side_document(&campaign, &log, side))
            .collect::<Result<_>>()?;
        let robot = match &campaign.robot {
            Some(robot) => RobotSpec::load(&robot.model, &self.dir)?,
            None => RobotSpec::load("irb6640", &self.dir)?,
        };
        let found = self.found();
        Ok(json!({
            "name": campaign.name,
            "dir": self.dir,
            "stamp": stamp,
            "sides": sides,
            "effects": explain::all(&robot),
            "report": found.report.is_some().then_some(found.drawn),
            "drawn_of": found.drawn_of,
            "problems": found.problems,
        }))
    }

    fn prepare(self: Arc<Self>, order: Order) -> std::result::Result<Job, Refusal> {
        match order {
            Order::Refresh {} => Ok(Job::new("drawing the report", move |stage| {
                self.draw(&Campaign::load(&self.dir)?, stage);
                Ok(String::new())
            })),
            Order::Diagnose { side } => {
                Ok(Job::new("the diagnosis", move |stage| self.diagnose(side, stage)))
            }
            Order::Add { side, head, effect } => {
                let log = self.log_at(side, &head)?;
                let cutting = !crate::effects::cutting::find(&effect).is_empty();
                if cutting != (side == Domain::Cutting) {
                    return Err(Refusal::Impossible(format!(
                        "\"{effect}\" is no effect of this side of the campaign"
                    )));
                }
                let name = format!("adding {effect}");
                Ok(Job::new(name, move |stage| self.add(log, &effect, stage)))
            }
            Order::Undo { side, head } => {
                let log = self.log_at(side, &head)?;
                Ok(Job::new("the undo", move |stage| self.undo(log, side, stage)))
            }
        }
    }

    fn report(&self) -> Option<Arc<Report>> {
        self.found().report.clone()
    }

    fn settle(&self) {
        // Kept until the process ends, which is next. Where it cannot be had, a write is still whole or not there.
        if let Ok(held) = hold(&self.dir) {
            std::mem::forget(held);
        }
    }
}
