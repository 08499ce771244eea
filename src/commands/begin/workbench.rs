//! A campaign as the page of `serve` works on it: the documents and texts are those of the commands of the same names. What
//! takes long a worker does (`bench_worker`).

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard};

use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::{Value, json};

use crate::campaign::Campaign;
use crate::commands::begin::bench_worker::{
    Answer, Diagnosed, Drawn, Hand, KEPT, log_at, model_state, sides, stamp, stays_inside,
};
use crate::commands::find::explain;
use crate::commands::grow::history;
use crate::effects::Registry;
use crate::revision::{RevisionLog, Side, hold};
use crate::robot::RobotSpec;
use crate::serve::{Job, JobStage, PageOrder, PageSubject, Refusal, Report, locked};
use crate::{Error, Result};

/// One campaign folder, and what was found out about it since the server began.
pub struct CampaignBench {
    /// Without symbolic links in it.
    dir: PathBuf,
    title: String,
    found: Mutex<Found>,
    /// From the first order on.
    worker: Mutex<Option<Hand>>,
}

#[derive(Default)]
struct Found {
    report: Option<Arc<Report>>,
    /// Reports drawn so far.
    drawn: usize,
    /// The folder's stamp when the report was drawn, or failed to be.
    drawn_of: Option<String>,
    problems: Vec<String>,
    /// The model as it stands then, side by side.
    now: Vec<(Side, Value)>,
    /// Oldest first.
    diagnoses: Vec<Diagnosed>,
}

impl CampaignBench {
    /// # Errors
    /// There is no campaign, or not a valid one; what the program keeps of it lies elsewhere.
    pub fn open(dir: &Path) -> Result<Self> {
        let title = Campaign::load(dir)?.name;
        let dir = dir.canonicalize().map_err(|e| Error::io(dir, e))?;
        stays_inside(&dir)?;
        RevisionLog::load(&dir)?;
        Ok(CampaignBench {
            dir,
            title,
            found: Mutex::default(),
            worker: Mutex::default(),
        })
    }

    pub fn dir(&self) -> &Path {
        &self.dir
    }

    fn found(&self) -> MutexGuard<'_, Found> {
        locked(&self.found)
    }

    /// Has an order done.
    fn have_done(&self, order: PageOrder, stage: &JobStage) -> Result<String> {
        let mut worker = locked(&self.worker);
        let mut hand = match worker.take() {
            Some(hand) => hand,
            None => Hand::hire(&self.dir)?,
        };
        stage.on_cancel(hand.stop());
        let Some(answer) = hand.answer(&order, stage) else {
            drop(hand);
            return Err(Error::computation(match stage.is_cancelled() {
                true => self.cancelled(&order),
                false => "the program failed at this: a fault of its own, no fault of yours (what it said stands in the \
                          terminal it was started from). The page shows how the campaign stands now"
                    .into(),
            }));
        };
        *worker = Some(hand);
        self.learn(answer)
    }

    /// What a worker that was ended left behind.
    fn cancelled(&self, order: &PageOrder) -> String {
        let recorded = match order {
            PageOrder::Add { side, head, .. } | PageOrder::Undo { side, head } => {
                RevisionLog::load(&self.dir).is_ok_and(|log| log.mark(*side) != *head)
            }
            _ => false,
        };
        match recorded {
            true => {
                "cancelled while the report was drawn; what was asked for had been recorded already".into()
            }
            false => "cancelled; nothing was recorded, the campaign is as it was".into(),
        }
    }

    fn learn(&self, answer: Answer) -> Result<String> {
        let mut found = self.found();
        if let Some(diagnosis) = answer.diagnosis {
            found
                .diagnoses
                .retain(|d| !(d.side == diagnosis.side && d.of == diagnosis.of));
            if found.diagnoses.len() == KEPT {
                found.diagnoses.remove(0);
            }
            found.diagnoses.push(diagnosis);
        }
        if let Some(Drawn {
            of,
            report,
            problems,
            now,
        }) = answer.drawn
        {
            let decoded = |(name, png): (String, String)| Some((name, BASE64_STANDARD.decode(png).ok()?));
            found.report = report.map(|report| {
                Arc::new(Report {
                    html: report.html,
                    images: report
                        .images
                        .into_iter()
                        .filter_map(decoded)
                        .collect::<HashMap<_, _>>(),
                })
            });
            found.drawn_of = Some(of);
            found.problems = problems;
            found.now = now;
            found.drawn += 1;
        }
        answer.text.map_err(Error::Computation)
    }

    fn side_document(&self, campaign: &Campaign, log: &RevisionLog, side: Side) -> Result<Value> {
        let of = model_state(campaign, log, side)?;
        let found = self.found();
        let diagnosis = found
            .diagnoses
            .iter()
            .find(|d| d.side == side && d.of == of)
            .map(|known| {
                let mut document = known.document.clone();
                document["answer"] = json!(known.answer);
                document
            });
        let now = found
            .now
            .iter()
            .find(|(s, _)| *s == side)
            .map(|(_, error)| error.clone());
        drop(found);
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

impl PageSubject for CampaignBench {
    fn title(&self) -> String {
        self.title.clone()
    }

    fn stamp(&self) -> String {
        stamp(&self.dir)
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
            "effects": explain::library(&robot),
            "report": found.report.is_some().then_some(found.drawn),
            "drawn_of": found.drawn_of,
            "problems": found.problems,
        }))
    }

    fn prepare(self: Arc<Self>, order: PageOrder) -> std::result::Result<Job, Refusal> {
        let name = match &order {
            PageOrder::Refresh {} => "drawing the report".into(),
            PageOrder::Diagnose { .. } => "the diagnosis".into(),
            PageOrder::Add { side, head, effect } => {
                log_at(&self.dir, *side, head)?;
                let cutting = Registry::cutting().effect_of(effect).is_some();
                if cutting != (*side == Side::Cutting) {
                    return Err(Refusal::Impossible(format!(
                        "\"{effect}\" is no effect of this side of the campaign"
                    )));
                }
                format!("adding {effect}")
            }
            PageOrder::Undo { side, head } => {
                log_at(&self.dir, *side, head)?;
                "the undo".into()
            }
        };
        Ok(Job::new(name, move |stage| self.have_done(order, stage)))
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
