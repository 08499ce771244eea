//! Progress on stderr for work that takes longer than a second.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Counts steps of a piece of work. Silent for the first second; then a bar on a terminal,
/// or a line every few seconds where stderr is a file.
pub struct Progress {
    bar: ProgressBar,
    label: String,
    total: u64,
    started: Instant,
    last_line_s: AtomicU64,
}

/// Seconds between two lines where stderr is not a terminal.
const LINE_EVERY_S: u64 = 5;

impl Progress {
    pub fn new(label: impl Into<String>, total: usize) -> Self {
        let label = label.into();
        let bar = ProgressBar::with_draw_target(Some(total as u64), ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{prefix} [{bar:30}] {pos}/{len} {elapsed}") {
            bar.set_style(style);
        }
        bar.set_prefix(label.clone());
        Progress {
            bar,
            label,
            total: total as u64,
            started: Instant::now(),
            last_line_s: AtomicU64::new(0),
        }
    }

    /// One step done. May be called from several threads.
    pub fn step(&self) {
        self.bar.inc(1);
        let elapsed = self.started.elapsed();
        if elapsed < Duration::from_secs(1) {
            return;
        }
        if self.bar.is_hidden() {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
        // Still hidden: stderr is no terminal.
        if self.bar.is_hidden() {
            let now = elapsed.as_secs();
            let last = self.last_line_s.load(Ordering::Relaxed);
            let due = last == 0 || now >= last + LINE_EVERY_S;
            if due
                && self
                    .last_line_s
                    .compare_exchange(last, now.max(1), Ordering::Relaxed, Ordering::Relaxed)
                    .is_ok()
            {
                eprintln!(
                    "{}: {}/{} after {} s",
                    self.label,
                    self.bar.position(),
                    self.total,
                    now
                );
            }
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
