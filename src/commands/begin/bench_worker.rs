//! The work on a campaign that takes long, in a process of its own, so that it can be stopped at any moment: orders come as
//! lines of JSON, and so go progress and answers. Whatever it writes it writes whole or not at all, so ending it does no harm.

use std::collections::HashMap;
use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Stdio};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Duration;

use base64::prelude::{BASE64_STANDARD, Engine};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::analysis::{CampaignFindings, CuttingAnalysis, CuttingFindings, DiagnosisFindings, Workbench};
use crate::campaign::{Campaign, campaign_file};
use crate::commands::Outcome;
use crate::commands::find::diagnose;
use crate::commands::grow::{add, undo};
use crate::commands::relaunch::once_more;
use crate::identify::Options;
use crate::progress::{Gauge, Reading, shown_on};
use crate::report::campaign as pages;
use crate::report::sections::{diagnosis_section, waveform_section};
use crate::revision::{RecordedEffect, RevisionLog, Side, fingerprint, log_file};
use crate::serve::{JobStage, PageOrder, Refusal, locked};
use crate::{Error, InputError, Result};

/// What the worker says.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Line {
    At { stage: String, part: Option<Reading> },
    Done(Box<Answer>),
}

/// What came of an order.
#[derive(Serialize, Deserialize)]
pub struct Answer {
    /// For a person; or why it could not be done.
    pub text: std::result::Result<String, String>,
    pub diagnosis: Option<Diagnosed>,
    /// Where a report was drawn, or could not be.
    pub drawn: Option<Drawn>,
}

/// A diagnosis, for as long as data and model are those that it was made of; also if they come back by an undo.
#[derive(Clone, Serialize, Deserialize)]
pub struct Diagnosed {
    pub side: Side,
    pub of: BenchModel,
    pub document: Value,
    /// The verdict in plain words.
    pub answer: String,
}

/// The model as it stands.
#[derive(Serialize, Deserialize)]
pub struct Drawn {
    /// The folder's stamp when that was begun.
    pub of: String,
    pub report: Option<DrawnReport>,
    /// What the report lacks, and why.
    pub problems: Vec<String>,
    /// Error and noise, side by side.
    pub now: Vec<(Side, Value)>,
}

#[derive(Serialize, Deserialize)]
pub struct DrawnReport {
    pub html: String,
    /// By name; PNG in base64.
    pub images: HashMap<String, String>,
}

/// Data (their fingerprint) and effects.
pub type BenchModel = (String, Vec<RecordedEffect>);

/// Diagnoses kept, at most; each holds all FRFs several times.
pub const KEPT: usize = 6;
/// Between two lines about progress.
const BEAT: Duration = Duration::from_millis(200);

/// The worker as the server sees it.
pub struct Hand {
    child: Arc<Mutex<Child>>,
    orders: ChildStdin,
    answers: std::io::BufReader<ChildStdout>,
}

impl Drop for Hand {
    fn drop(&mut self) {
        let mut child = locked(&self.child);
        let _ = child.kill();
        let _ = child.wait();
    }
}

impl Hand {
    /// # Errors
    /// The program cannot be started a second time.
    pub fn hire(dir: &Path) -> Result<Self> {
        let failed =
            |e: std::io::Error| Error::computation(format!("the program cannot start its worker: {e}"));
        let mut child = once_more()
            .map_err(failed)?
            .arg("--jobs")
            .arg(rayon::current_num_threads().min(1024).to_string())
            .args(["serve", "--worker"])
            .arg(dir)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(failed)?;
        let (Some(orders), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(Error::computation("the program cannot talk to its worker"));
        };
        Ok(Hand {
            child: Arc::new(Mutex::new(child)),
            orders,
            answers: std::io::BufReader::new(answers),
        })
    }

    /// What ends the worker at once.
    pub fn stop(&self) -> impl FnOnce() + Send + 'static {
        let child = self.child.clone();
        move || {
            let _ = locked(&child).kill();
        }
    }

    /// `None` where the worker ended before it was done.
    pub fn answer(&mut self, order: &PageOrder, stage: &JobStage) -> Option<Answer> {
        let line = serde_json::to_string(order).ok()? + "\n";
        self.orders.write_all(line.as_bytes()).ok()?;
        self.orders.flush().ok()?;
        loop {
            let mut line = String::new();
            if self.answers.read_line(&mut line).ok()? == 0 {
                return None;
            }
            match serde_json::from_str(&line).ok()? {
                Line::At { stage: text, part } => stage.now(&text, part),
                Line::Done(answer) => return Some(*answer),
            }
        }
    }
}

/// Says which part of an order is being done.
#[derive(Default)]
struct Teller(Mutex<String>);

impl Teller {
    fn now(&self, text: &str) {
        *locked(&self.0) = text.to_string();
    }
}

/// The worker itself.
struct Worker {
    dir: PathBuf,
    /// Oldest first.
    known: Vec<Known>,
}

struct Known {
    side: Side,
    of: BenchModel,
    /// Lent to the report while that is drawn.
    findings: Option<Findings>,
}

enum Findings {
    Structure(Box<DiagnosisFindings>),
    Cutting(Box<CuttingFindings>),
}

/// Does what is ordered on standard input until that ends, and then ends at once, whatever is being done.
///
/// # Errors
/// Standard output cannot be written.
pub fn work(dir: &Path) -> Result<()> {
    let (taken, orders) = mpsc::channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines() {
            let Some(order) = line
                .ok()
                .and_then(|line| serde_json::from_str::<PageOrder>(&line).ok())
            else {
                break;
            };
            if taken.send(order).is_err() {
                break;
            }
        }
        // The server is gone.
        std::process::exit(0);
    });
    let mut worker = Worker {
        dir: dir.to_path_buf(),
        known: Vec::new(),
    };
    for order in orders {
        let (teller, gauge) = (Teller::default(), Arc::new(Gauge::default()));
        let (finish, finished) = mpsc::channel::<()>();
        let answer = std::thread::scope(|scope| {
            let (teller, gauge) = (&teller, &gauge);
            scope.spawn(move || {
                let mut said = None;
                while finished.recv_timeout(BEAT) == Err(mpsc::RecvTimeoutError::Timeout) {
                    let now = (locked(&teller.0).clone(), gauge.reading());
                    if said.as_ref() != Some(&now) {
                        let (stage, part) = now.clone();
                        let _ = say(&Line::At { stage, part });
                        said = Some(now);
                    }
                }
            });
            let answer = shown_on(gauge, || worker.done(order, teller));
            drop(finish);
            answer
        });
        let answer = answer.unwrap_or_else(|error| Answer {
            text: Err(error.to_string()),
            diagnosis: None,
            drawn: None,
        });
        say(&Line::Done(Box::new(answer)))
            .map_err(|e| Error::computation(format!("the server does not listen: {e}")))?;
    }
    Ok(())
}

fn say(line: &Line) -> std::io::Result<()> {
    let mut text = serde_json::to_string(line)?;
    text.push('\n');
    let mut stdout = std::io::stdout().lock();
    stdout.write_all(text.as_bytes())?;
    stdout.flush()
}

/// A text made for the terminal, without its colours.
fn plain(text: &str) -> String {
    anstream::adapter::strip_str(text).to_string()
}

/// The sides that a campaign holds.
pub fn sides(campaign: &Campaign) -> Vec<Side> {
    let structure = !campaign.frfs.is_empty() && campaign.robot.is_some();
    let cutting = !campaign.cuts.is_empty();
    let all = [(structure, Side::Structure), (cutting, Side::Cutting)];
    all.into_iter()
        .filter(|(there, _)| *there)
        .map(|(_, side)| side)
        .collect()
}

pub fn model_state(campaign: &Campaign, log: &RevisionLog, side: Side) -> Result<BenchModel> {
    let effects = log.current(side).map(|r| r.effects.clone());
    Ok((fingerprint(campaign, side)?, effects.unwrap_or_default()))
}

/// Another text whenever what lies in the folder was changed.
pub fn stamp(dir: &Path) -> String {
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
    format!("{} {}", of(campaign_file(dir)), of(log_file(dir)))
}

/// The files that are read and written by their names alone do not lie elsewhere, behind a symbolic link. (Those that
/// campaign.toml names are looked at where it is read.)
pub fn stays_inside(dir: &Path) -> Result<()> {
    let log = log_file(dir);
    let folder = log.parent().unwrap_or(dir);
    for path in [campaign_file(dir).as_path(), folder, &log] {
        if path.symlink_metadata().is_err() {
            continue;
        }
        let real = path.canonicalize().map_err(|e| Error::io(path, e))?;
        if !real.starts_with(dir) {
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
pub fn log_at(dir: &Path, side: Side, head: &str) -> std::result::Result<RevisionLog, Refusal> {
    stays_inside(dir)?;
    let log = RevisionLog::load(dir)?;
    match log.mark(side) == head {
        true => Ok(log),
        false => Err(Refusal::Late(
            "the model was changed since this page showed it (another click, another window, or a command in a \
             terminal); nothing was done. Look at how it stands now, and click again if you still want to"
                .into(),
        )),
    }
}

impl Worker {
    fn done(&mut self, order: PageOrder, teller: &Teller) -> Result<Answer> {
        let campaign = Campaign::load(&self.dir)?;
        let text = match order {
            PageOrder::Refresh {} => String::new(),
            PageOrder::Diagnose { side } => return self.diagnose(side, teller),
            PageOrder::Add { side, head, effect } => {
                let log = log_at(&self.dir, side, &head)?;
                teller.now("fitting everything again, with the effect");
                add::after(log, &campaign, &effect)?.text
            }
            PageOrder::Undo { side, head } => {
                let log = log_at(&self.dir, side, &head)?;
                teller.now("taking the last revision back");
                undo::after(log, &campaign, side)?.text
            }
        };
        Ok(Answer {
            text: Ok(plain(&text)),
            diagnosis: None,
            drawn: Some(self.draw(&campaign, teller)),
        })
    }

    fn diagnose(&mut self, side: Side, teller: &Teller) -> Result<Answer> {
        let campaign = Campaign::load(&self.dir)?;
        let of = model_state(&campaign, &RevisionLog::load(&self.dir)?, side)?;
        let bench = Workbench::new(&campaign);
        teller.now("looking for what is missing");
        let (Outcome { json, text, .. }, answer, findings) = match side {
            Side::Structure => {
                let found = Box::new(DiagnosisFindings::on(&bench, Options::default())?);
                let outcome = diagnose::structure(&campaign, &found);
                (
                    outcome,
                    diagnosis_section::summary(&found),
                    Findings::Structure(found),
                )
            }
            Side::Cutting => {
                let found = Box::new(CuttingFindings::on(&bench, Options::default())?);
                let outcome = diagnose::cutting(&campaign, &found);
                (
                    outcome,
                    waveform_section::summary(&found),
                    Findings::Cutting(found),
                )
            }
        };
        if stays_inside(&self.dir).is_ok() {
            // A folder that cannot be written to is no reason not to answer.
            let _ = match &findings {
                Findings::Structure(found) => found.keep(&bench),
                Findings::Cutting(found) => found.keep(&bench),
            };
        }
        self.known.retain(|k| !(k.side == side && k.of == of));
        if self.known.len() == KEPT {
            self.known.remove(0);
        }
        self.known.push(Known {
            side,
            of: of.clone(),
            findings: Some(findings),
        });
        Ok(Answer {
            text: Ok(plain(&text)),
            diagnosis: Some(Diagnosed {
                side,
                of,
                document: json,
                answer,
            }),
            drawn: Some(self.draw(&campaign, teller)),
        })
    }

    /// Fits the model as it stands and draws the report of it. What fails stands in the page, and does not undo what was
    /// done before.
    fn draw(&mut self, campaign: &Campaign, teller: &Teller) -> Drawn {
        teller.now("fitting the model as it stands and drawing the report");
        let of = stamp(&self.dir);
        match self.try_to_draw(campaign) {
            Ok(drawn) => Drawn { of, ..drawn },
            Err(error) => Drawn {
                of,
                report: None,
                problems: vec![error.to_string()],
                now: Vec::new(),
            },
        }
    }

    fn try_to_draw(&mut self, campaign: &Campaign) -> Result<Drawn> {
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
        let encoded = |(name, png): (String, &[u8])| (name, BASE64_STANDARD.encode(png));
        let report = page.html().map(|html| DrawnReport {
            html,
            images: page.images().into_iter().map(encoded).collect(),
        });
        let problems = findings.errors();
        let now = sides(campaign)
            .into_iter()
            .filter_map(|side| Some((side, error_now(campaign, &log, &findings, side)?)))
            .collect();
        for (side, of) in lent {
            let back = match side {
                Side::Structure => findings
                    .diagnosis
                    .take()
                    .and_then(Result::ok)
                    .map(|f| Findings::Structure(Box::new(f))),
                Side::Cutting => findings
                    .cutting_diagnosis
                    .take()
                    .and_then(Result::ok)
                    .map(|f| Findings::Cutting(Box::new(f))),
            };
            self.known(side, &of, |known| known.findings = back);
        }
        Ok(Drawn {
            report: Some(report?),
            problems,
            now,
            of: String::new(),
        })
    }

    /// What is known of a side in a state.
    fn known<T>(&mut self, side: Side, of: &BenchModel, look: impl FnOnce(&mut Known) -> T) -> Option<T> {
        let known = self.known.iter_mut().find(|k| k.side == side && k.of == *of);
        known.map(look)
    }
}

/// Error and noise of the model as it stands; `None` where it cannot be fitted.
fn error_now(
    campaign: &Campaign,
    log: &RevisionLog,
    findings: &CampaignFindings,
    side: Side,
) -> Option<Value> {
    let (totals, held_out_nrms) = match side {
        Side::Structure => {
            let structure = findings.structure()?;
            (structure.analysis.after.totals, structure.held_out_nrms)
        }
        Side::Cutting => match findings.cutting_diagnosis() {
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
