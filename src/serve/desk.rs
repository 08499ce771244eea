//! One job at a time, whoever asks for it and however often; each is done to its end, whether or not the browser that
//! asked for it still listens.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde_json::{Value, json};

use super::Refusal;
use crate::progress::{Gauge, shown_on};
use crate::{Error, Result};

/// Gives the text that the page shows when it is done.
type Work = Box<dyn FnOnce(&Stage) -> Result<String> + Send>;

/// What is to be done, and its name as a reader meets it ("the diagnosis").
pub struct Job {
    name: String,
    work: Work,
}

impl Job {
    pub fn new(
        name: impl Into<String>,
        work: impl FnOnce(&Stage) -> Result<String> + Send + 'static,
    ) -> Self {
        Job {
            name: name.into(),
            work: Box::new(work),
        }
    }
}

/// Where a job says which part of it is being done.
#[derive(Default)]
pub struct Stage(Mutex<String>);

impl Stage {
    pub fn now(&self, text: &str) {
        *locked(&self.0) = text.to_string();
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
    stage: Arc<Stage>,
    gauge: Arc<Gauge>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A job that panics holds none of these locks; and what they guard is whole at every moment.
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
        let (stage, gauge) = (Arc::new(Stage::default()), Arc::new(Gauge::default()));
        let desk = self.clone();
        let (own_stage, own_gauge) = (stage.clone(), gauge.clone());
        std::thread::Builder::new()
            .name("job".into())
            .spawn(move || {
                let done = catch_unwind(AssertUnwindSafe(|| shown_on(&own_gauge, || work(&own_stage))));
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
            gauge,
        });
        Ok(number)
    }

    fn done(&self, result: Result<String>) {
        let mut state = locked(&self.0);
        if let Some(running) = state.running.take() {
            state.last = Some(json!({
                "number": running.number,
                "name": running.name,
                "ok": result.is_ok(),
                "text": result.unwrap_or_else(|e| e.to_string()),
                "seconds": running.since.elapsed().as_secs_f64(),
            }));
        }
    }

    /// `job`: what is being done and how far it is, or null; `last`: what was done last and what came of it, or null.
    pub fn status(&self) -> Value {
        let state = locked(&self.0);
        let job = state.running.as_ref().map(|running| {
            let part = running.gauge.reading();
            json!({
                "number": running.number,
                "name": running.name,
                "seconds": running.since.elapsed().as_secs_f64(),
                "stage": *locked(&running.stage.0),
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
                stage.now("trying");
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
