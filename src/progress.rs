//! How far work is that takes longer than a moment. The library itself prints nothing: the work tells its steps to a
//! [`Gauge`] that somebody looks at, else to the [`Meter`] that a program has installed ([`shown_by`]), else to nobody.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::stop;

/// Counts the steps of a piece of work and tells them to whoever shows them.
pub struct Progress {
    shown_on: Option<Display>,
    label: String,
    done: AtomicU64,
    total: u64,
}

enum Display {
    Gauge(Arc<Gauge>),
    Meter(Box<dyn Meter>),
}

/// Shows one piece of work to a person, as long as it exists.
pub trait Meter: Send + Sync {
    /// One more step is done. Called from several threads.
    fn step(&self);
}

/// Begins to show a piece of work: what it is called, how many steps it has.
pub type NewMeter = fn(label: &str, total: u64) -> Box<dyn Meter>;

static METER: OnceLock<NewMeter> = OnceLock::new();

/// Has every piece of work in this process shown by a meter of its own, unless a [`Gauge`] shows it. The first call counts.
pub fn shown_by(meter: NewMeter) {
    let _ = METER.set(meter);
}

/// Nothing is to be shown.
static SILENT: AtomicBool = AtomicBool::new(false);

/// From now on no meter should show anything.
pub fn silence() {
    SILENT.store(true, Ordering::Relaxed);
}

/// Whether [`silence`] was called.
pub fn is_silent() -> bool {
    SILENT.load(Ordering::Relaxed)
}

/// Steps of the piece of work that is being done.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Reading {
    /// What is being done, in words.
    pub label: String,
    /// Steps done.
    pub done: u64,
    /// Steps in all.
    pub total: u64,
}

/// Shows the steps of work done elsewhere, to whoever looks; nothing between two pieces of work.
#[derive(Debug, Default)]
pub struct Gauge(Mutex<Option<Reading>>);

impl Gauge {
    /// How far the work is now; `None` while none is being done.
    pub fn reading(&self) -> Option<Reading> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn show(&self, reading: Option<Reading>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = reading;
    }
}

thread_local! {
    static GAUGE: RefCell<Option<Arc<Gauge>>> = const { RefCell::new(None) };
}

/// Does `work`; what this thread begins to count meanwhile is shown on `gauge` and by no meter.
pub fn shown_on<T>(gauge: &Arc<Gauge>, work: impl FnOnce() -> T) -> T {
    /// Puts the gauge of before back, also when the work panics.
    struct Before(Option<Arc<Gauge>>);
    impl Drop for Before {
        fn drop(&mut self) {
            GAUGE.set(self.0.take());
        }
    }
    let _before = Before(GAUGE.replace(Some(gauge.clone())));
    work()
}

impl Progress {
    /// A piece of work of `total` steps begins on this thread.
    pub fn new(label: impl Into<String>, total: usize) -> Self {
        stop::point();
        let (label, total) = (label.into(), total as u64);
        let shown_on = match GAUGE.with_borrow(Clone::clone) {
            Some(gauge) => Some(Display::Gauge(gauge)),
            None => METER.get().map(|begin| Display::Meter(begin(&label, total))),
        };
        let progress = Progress {
            shown_on,
            label,
            done: AtomicU64::new(0),
            total,
        };
        if let Some(Display::Gauge(gauge)) = &progress.shown_on {
            gauge.show(Some(progress.reading(0)));
        }
        progress
    }

    fn reading(&self, done: u64) -> Reading {
        Reading {
            label: self.label.clone(),
            done,
            total: self.total,
        }
    }

    /// One step done. May be called from several threads. Work that is asked to end ends here ([`stop::point`]).
    pub fn step(&self) {
        stop::point();
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        match &self.shown_on {
            Some(Display::Gauge(gauge)) => gauge.show(Some(self.reading(done))),
            Some(Display::Meter(meter)) => meter.step(),
            None => {}
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(Display::Gauge(gauge)) = &self.shown_on {
            gauge.show(None);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gauge_shows_the_work_of_its_own_thread_and_only_while_it_is_done() {
        let gauge = Arc::new(Gauge::default());
        let other = Progress::new("not watched", 1);
        shown_on(&gauge, || {
            let progress = Progress::new("parts", 3);
            std::thread::scope(|scope| {
                scope.spawn(|| progress.step());
            });
            other.step();
            let expected = Reading {
                label: "parts".into(),
                done: 1,
                total: 3,
            };
            assert_eq!(gauge.reading(), Some(expected));
            drop(progress);
            assert_eq!(gauge.reading(), None);
        });
        let _after = Progress::new("afterwards", 1);
        assert_eq!(gauge.reading(), None);
    }

    #[test]
    fn a_panic_takes_the_gauge_away() {
        let gauge = Arc::new(Gauge::default());
        let failed = std::panic::catch_unwind(|| {
            shown_on(&gauge, || {
                let _progress = Progress::new("parts", 3);
                panic!("as the test wants it");
            })
        });
        assert!(failed.is_err());
        let _after = Progress::new("afterwards", 1);
        assert_eq!(gauge.reading(), None);
    }
}
