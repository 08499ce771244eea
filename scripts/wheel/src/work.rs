//! Long work without the interpreter's lock: it can be interrupted, and says how far it is.

use std::sync::{Arc, mpsc};
use std::time::Duration;

use lobestone::progress::{Gauge, Reading, shown_on};
use lobestone::stop::{Stop, stoppable};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::errors::raised;

/// Between two looks at signals and progress.
const BEAT: Duration = Duration::from_millis(100);

/// Does `work` on other threads while Python goes on. `progress(label, done, total)` is called when the counts change. A
/// signal (Ctrl-C) or an exception of `progress` ends the work at its next step, and is what is raised.
pub fn done<T: Send>(
    py: Python<'_>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce() -> lobestone::Result<T> + Send,
) -> PyResult<T> {
    let (stop, gauge) = (Stop::default(), Arc::new(Gauge::default()));
    let (finish, finished) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        let worker = scope.spawn(|| {
            // Dropped at the end, whatever it is.
            let _finish = finish;
            stoppable(&stop, || shown_on(&gauge, work))
        });
        let mut finished = finished;
        let mut interrupted = None;
        let mut said = None;
        loop {
            let (waited, back) = py.detach(move || (finished.recv_timeout(BEAT), finished));
            finished = back;
            if waited != Err(mpsc::RecvTimeoutError::Timeout) {
                break;
            }
            if interrupted.is_none()
                && let Err(error) = look(py, &gauge, progress, &mut said)
            {
                stop.ask();
                interrupted = Some(error);
            }
        }
        let result = py.detach(|| worker.join());
        if let Some(error) = interrupted {
            return Err(error);
        }
        match result {
            Ok(Ok(Some(done))) => done.map_err(|e| raised(py, &e)),
            Ok(Err(error)) => Err(raised(py, &error)),
            Ok(Ok(None)) => Err(PyRuntimeError::new_err("the work was stopped")),
            Err(_) => Err(PyRuntimeError::new_err(
                "Lobestone failed: a fault of its own (what it said stands on the standard error output)",
            )),
        }
    })
}

/// Signals, and progress where it is asked for.
fn look(
    py: Python<'_>,
    gauge: &Gauge,
    progress: Option<&Bound<'_, PyAny>>,
    said: &mut Option<Reading>,
) -> PyResult<()> {
    py.check_signals()?;
    let (Some(tell), Some(now)) = (progress, gauge.reading()) else {
        return Ok(());
    };
    if said.as_ref() != Some(&now) {
        tell.call1((now.label.as_str(), now.done, now.total))?;
        *said = Some(now);
    }
    Ok(())
}
