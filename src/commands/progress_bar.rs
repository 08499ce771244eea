//! Progress on stderr: silent for the first second; then a bar, on a terminal only.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::progress::{Meter, is_silent};

struct Bar {
    bar: ProgressBar,
    started: Instant,
}

/// A bar for a piece of work of `total` steps.
pub fn progress_bar(label: &str, total: u64) -> Box<dyn Meter> {
    let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::hidden());
    if let Ok(style) = ProgressStyle::with_template("{prefix} [{bar:30}] {pos}/{len} {elapsed}") {
        bar.set_style(style);
    }
    bar.set_prefix(label.to_string());
    Box::new(Bar {
        bar,
        started: Instant::now(),
    })
}

impl Meter for Bar {
    fn step(&self) {
        self.bar.inc(1);
        let waited = self.started.elapsed() >= Duration::from_secs(1);
        // On a terminal only: nothing is seen elsewhere.
        if waited && self.bar.is_hidden() && !is_silent() {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
        }
    }
}

impl Drop for Bar {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
