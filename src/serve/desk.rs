//! One job at a time, whoever asks for it and however often; each is done to its end, whether or not the browser that
//! asked for it still listens, or until somebody cancels it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde_json::{Value, json};

use super::refusal::Refusal;
use crate::progress::Reading;
use crate::{Error, Result};

/// Gives the text that the page shows when it is done.
type Work = Box<dyn FnOnce(&JobStage) -> Result<String> + Send>;

/// What is to be done, and its name as a reader meets it ("the diagnosis").
pub struct Job {
    name: String,
    work: Work,
}

impl Job {
    pub fn new(
        name: impl Into<String>,
        work: impl FnOnce(&JobStage) -> Result<String> + Send + 'static,
    ) -> Self {
        Job {
            name: name.into(),
            work: Box::new(work),
        }
    }
}

/// Where a job says which part of it is being done, and how it can be stopped.
#[derive(Default)]
pub struct JobStage(Mutex<At>);

#[derive(Default)]
struct At {
    text: String,
    part: Option<Reading>,
    stop: Option<Box<dyn FnOnce() + Send>>,
    cancelled: bool,
}

impl JobStage {
    pub fn now(&self, text: &str, part: Option<Reading>) {
        let mut at = locked(&self.0);
        at.text = text.to_string();
        at.part = part;
    }

    /// `stop` is called once if the job is cancelled; at once if it was already.
    pub fn on_cancel(&self, stop: impl FnOnce() + Send + 'static) {
        let mut at = locked(&self.0);
        match at.cancelled {
            true => {
                drop(at);
                stop();
            }
            false => at.stop = Some(Box::new(stop)),
        }
    }

    pub fn is_cancelled(&self) -> bool {
        locked(&self.0).cancelled
    }

    fn cancel(&self) {
        let stop = {
            let mut at = locked(&self.0);
            at.cancelled = true;
            at.stop.take()
        };
        if let Some(stop) = stop {
            stop();
        }
    }
}

/// Takes jobs.
#[derive(Default)]
pub struct Desk(Mutex<State>);

#[derive(Default)]
struct State {
    /// Jobs taken so far.
    count: u64,
    running: Option<Running>,
    /// The job that was done last.
    last: Option<Value>,
}

struct Running {
    number: u64,
    name: String,
    since: Instant,
    stage: Arc<JobStage>,
}

/// The lock, also where a thread panicked with it: what such locks guard is whole at every moment.
pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Desk {
    /// Starts the job that `prepare` makes, on a thread of its own, and gives its number. Nobody else's order is looked
    /// at while `prepare` runs.
    ///
    /// # Errors
    /// A job is being done already, or `prepare` refuses.
    pub fn start(
        self: &Arc<Self>,
        prepare: impl FnOnce() -> std::result::Result<Job, Refusal>,
    ) -> std::result::Result<u64, Refusal> {
        let mut state = locked(&self.0);
        if let Some(running) = &state.running {
            return Err(Refusal::Late(format!(
                "{} is still running ({} s): wait until it is done",
                running.name,
                running.since.elapsed().as_secs()
            )));
        }
        let Job { name, work } = prepare()?;
        let number = state.count + 1;
        let stage = Arc::new(JobStage::default());
        let desk = self.clone();
        let own_stage = stage.clone();
        std::thread::Builder::new()
            .name("job".into())
            .spawn(move || {
                let done = catch_unwind(AssertUnwindSafe(|| work(&own_stage)));
                desk.done(done.unwrap_or_else(|_| {
                    Err(Error::computation(
                        "the program failed at this: a fault of its own, no fault of yours (what it said stands in the \
                         terminal it was started from). The page shows how the campaign stands now",
                    ))
                }));
            })
            .map_err(|e| Refusal::Impossible(format!("no thread can be had: {e}")))?;
        state.count = number;
        state.running = Some(Running {
            number,
            name,
            since: Instant::now(),
            stage,
        });
        Ok(number)
    }

    /// Stops the job of this number.
    ///
    /// # Errors
    /// It is not being done (any more).
    pub fn cancel(&self, number: u64) -> std::result::Result<(), Refusal> {
        let stage = match &locked(&self.0).running {
            Some(running) if running.number == number => running.stage.clone(),
            _ => return Err(Refusal::Late("that is done already".into())),
        };
        stage.cancel();
        Ok(())
    }

    /// Does `change` while nothing is being done and nothing can be begun.
    ///
    /// # Errors
    /// A job is being done.
    pub fn while_idle<T>(&self, change: impl FnOnce() -> T) -> std::result::Result<T, Refusal> {
        let state = locked(&self.0);
        match &state.running {
            Some(running) => Err(Refusal::Late(format!("{} is still running", running.name))),
            None => Ok(change()),
        }
    }

    fn done(&self, result: Result<String>) {
        let mut state = locked(&self.0);
        if let Some(running) = state.running.take() {
            state.last = Some(json!({
                "number": running.number,
                "name": running.name,
                "ok": result.is_ok(),
                "cancelled": running.stage.is_cancelled(),
                "text": result.unwrap_or_else(|e| e.to_string()),
                "seconds": running.since.elapsed().as_secs_f64(),
            }));
        }
    }

    /// `job`: what is being done and how far it is, or null; `last`: what was done last and what came of it, or null.
    pub fn status(&self) -> Value {
        let state = locked(&self.0);
        let job = state.running.as_ref().map(|running| {
            let at = locked(&running.stage.0);
            let part = at.part.as_ref();
            json!({
                "number": running.number,
                "name": running.name,
                "seconds": running.since.elapsed().as_secs_f64(),
                "stage": at.text,
                "cancelled": at.cancelled,
                "part": part.map(|p| json!({ "label": p.label, "done": p.done, "total": p.total })),
            })
        });
        json!({ "job": job, "last": state.last })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;
    use std::time::Duration;

    fn wait_until_idle(desk: &Desk) -> Value {
        for _ in 0..500 {
            let status = desk.status();
            if status["job"].is_null() {
                return status["last"].clone();
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("the job does not end");
    }

    #[test]
    fn a_second_order_is_refused_while_the_first_is_done() {
        let desk = Arc::new(Desk::default());
        let (end, ended) = mpsc::channel::<()>();
        let number = desk.start(|| {
            Ok(Job::new("the diagnosis", move |stage| {
                stage.now("trying", None);
                let _ = ended.recv_timeout(Duration::from_secs(10));
                Ok("found".into())
            }))
        });
        assert_eq!(number, Ok(1));
        let second = desk.start(|| panic!("nobody looks at it"));
        let Err(Refusal::Late(sentence)) = second else {
            panic!("{second:?}");
        };
        assert!(
            sentence.starts_with("the diagnosis is still running (0 s)"),
            "{sentence}"
        );
        assert_eq!(desk.status()["job"]["name"], "the diagnosis");
        end.send(()).unwrap();
        let last = wait_until_idle(&desk);
        assert_eq!((&last["ok"], &last["text"]), (&json!(true), &json!("found")));
        assert_eq!(desk.start(|| Ok(Job::new("next", |_| Ok(String::new())))), Ok(2));
    }

    #[test]
    fn a_job_is_stopped_once_and_only_while_it_is_done() {
        let desk = Arc::new(Desk::default());
        let (stop, stopped) = mpsc::channel::<()>();
        let job = Job::new("the diagnosis", move |stage| {
            stage.on_cancel(move || stop.send(()).unwrap());
            stopped.recv_timeout(Duration::from_secs(10)).unwrap();
            Err(Error::computation("cancelled"))
        });
        assert_eq!(desk.start(|| Ok(job)), Ok(1));
        assert!(matches!(desk.cancel(2), Err(Refusal::Late(_))));
        assert!(desk.while_idle(|| ()).is_err());
        assert_eq!(
            (
                desk.cancel(1),
                desk.cancel(1).is_ok() || desk.status()["job"].is_null()
            ),
            (Ok(()), true)
        );
        let last = wait_until_idle(&desk);
        assert_eq!((&last["ok"], &last["cancelled"]), (&json!(false), &json!(true)));
        assert!(matches!(desk.cancel(1), Err(Refusal::Late(_))));
        assert_eq!(desk.while_idle(|| 7), Ok(7));
    }

    #[test]
    fn what_fails_or_panics_leaves_the_desk_free() {
        let desk = Arc::new(Desk::default());
        desk.start(|| {
            Ok(Job::new("one", |_| {
                Err(Error::computation("no mode in the band"))
            }))
        })
        .unwrap();
        let last = wait_until_idle(&desk);
        assert_eq!(
            (&last["ok"], &last["text"]),
            (&json!(false), &json!("no mode in the band"))
        );
        desk.start(|| Ok(Job::new("two", |_| panic!("as the test wants it"))))
            .unwrap();
        let last = wait_until_idle(&desk);
        assert_eq!((&last["number"], &last["ok"]), (&json!(2), &json!(false)));
        let refused = desk.start(|| Err(Refusal::Late("moved".into())));
        assert_eq!(refused, Err(Refusal::Late("moved".into())));
        assert!(desk.status()["job"].is_null());
    }
}
