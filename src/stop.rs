//! Ends work from outside, between two of its steps: whoever calls the library from another program (the Python module)
//! wants Ctrl-C to work.
//!
//! Between the one who asks and the loop that works lie many layers that hand back results, and an interruption is not
//! a result. So [`point`] unwinds them, past the hook that would print a panic; rayon carries it from its threads to the
//! caller, and [`stoppable`] catches it. Points lie where nothing is half written: files are written in one piece elsewhere.

use std::cell::RefCell;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::{Error, Result};

/// Asks a piece of work to end. Clones ask the same work.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// The work ends at the next [`point`] that it comes to.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the work is asked to end.
    pub fn is_asked(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// What [`point`] throws.
struct Stopped;

thread_local! {
    static STOP: RefCell<Option<Stop>> = const { RefCell::new(None) };
}

/// A place at which the work of this thread may end. Cheap enough for every iteration of a fit; nothing where nobody can
/// ask.
pub fn point() {
    if STOP.with_borrow(|stop| stop.as_ref().is_some_and(Stop::is_asked)) {
        resume_unwind(Box::new(Stopped));
    }
}

/// Does `work` on threads of its own (as many as rayon has), which all know `stop`; `None` where that was asked in time.
///
/// # Errors
/// There are no threads to be had.
pub fn stoppable<T: Send>(stop: &Stop, work: impl FnOnce() -> T + Send) -> Result<Option<T>> {
    let known = stop.clone();
    let pool = rayon::ThreadPoolBuilder::new()
        .start_handler(move |_| STOP.set(Some(known.clone())))
        .build()
        .map_err(|e| Error::computation(format!("threads cannot be had: {e}")))?;
    match catch_unwind(AssertUnwindSafe(|| pool.install(work))) {
        Ok(result) => Ok(Some(result)),
        Err(thrown) if thrown.is::<Stopped>() => Ok(None),
        Err(thrown) => resume_unwind(thrown),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use rayon::prelude::*;

    use super::*;

    #[test]
    fn work_on_all_threads_ends_when_asked() {
        let stop = Stop::default();
        let ended = std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(50));
                stop.ask();
            });
            let forever = |_| {
                loop {
                    point();
                }
            };
            stoppable(&stop, || (0..64).into_par_iter().for_each(forever))
        });
        assert!(ended.unwrap().is_none());
    }

    #[test]
    fn work_that_nobody_stops_comes_to_its_end() {
        let asked = Stop::default();
        asked.ask();
        // Not this work's.
        let sum = stoppable(&Stop::default(), || {
            point();
            (1..=10_u32).into_par_iter().inspect(|_| point()).sum::<u32>()
        });
        assert_eq!(sum.unwrap(), Some(55));
        // On a thread that knows of none.
        point();
        assert!(stoppable(&asked, || {}).unwrap().is_some());
    }

    #[test]
    fn a_panic_stays_one() {
        let failed = catch_unwind(|| stoppable(&Stop::default(), || panic!("as the test wants it")));
        assert!(failed.is_err_and(|thrown| thrown.is::<&str>()));
    }
}
