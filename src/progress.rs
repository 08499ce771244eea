//! Progress of work that takes longer than a second: on stderr, or on a [`Gauge`] where somebody reads one instead.

use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::stop;

/// Counts steps of a piece of work. Silent for the first second; then a bar where stderr is a terminal.
pub struct Progress {
    gauge: Option<Arc<Gauge>>,
    bar: ProgressBar,
    label: String,
    total: u64,
    started: Instant,
}

/// Nothing is to be shown.
static SILENT: AtomicBool = AtomicBool::new(false);

/// From now on nobody is told how far work is.
pub fn silence() {
    SILENT.store(true, Ordering::Relaxed);
}

pub fn is_silent() -> bool {
    SILENT.load(Ordering::Relaxed)
}

/// Steps of the piece of work that is being done.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Reading {
    pub label: String,
    pub done: u64,
    pub total: u64,
}

/// Shows the steps of work done elsewhere, to whoever looks; nothing between two pieces of work.
#[derive(Debug, Default)]
pub struct Gauge(Mutex<Option<Reading>>);

impl Gauge {
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

/// Does `work`; what this thread begins to count meanwhile is shown on `gauge` and not on stderr.
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
    pub fn new(label: impl Into<String>, total: usize) -> Self {
        stop::point();
        let label = label.into();
        let bar = ProgressBar::with_draw_target(Some(total as u64), ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{prefix} [{bar:30}] {pos}/{len} {elapsed}") {
            bar.set_style(style);
        }
        bar.set_prefix(label.clone());
        let gauge = GAUGE.with_borrow(Clone::clone);
        if let Some(gauge) = &gauge {
            gauge.show(Some(Reading {
                label: label.clone(),
                done: 0,
                total: total as u64,
            }));
        }
        Progress {
            gauge,
            bar,
            label,
            total: total as u64,
            started: Instant::now(),
        }
    }

    /// One step done. May be called from several threads. Work that is asked to end ends here ([`stop::point`]).
    pub fn step(&self) {
        stop::point();
        self.bar.inc(1);
        if let Some(gauge) = &self.gauge {
            gauge.show(Some(Reading {
                label: self.label.clone(),
                done: self.bar.position(),
                total: self.total,
            }));
            return;
        }
        let elapsed = self.started.elapsed();
        if elapsed < Duration::from_secs(1) {
            return;
        }
        // On a terminal only: nothing is seen elsewhere.
        if self.bar.is_hidden() && !is_silent() {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        match &self.gauge {
            Some(gauge) => gauge.show(None),
            None => self.bar.finish_and_clear(),
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
