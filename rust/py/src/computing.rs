//! Where the crates compute: without the GIL, on threads that belong to this very process.
//!
//! A process that was forked has the memory of its parent but none of its threads: whatever is handed to rayon's own pool
//! there waits for ever. So every process has a pool of its own, made when it first computes.

use std::mem::forget;
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// The pool and the number of the process that its threads run in. Locked only by who holds the GIL, as who forks does: a
/// forked process never finds it locked.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// The pool of this process.
pub fn pool(_gil: Python<'_>) -> PyResult<Arc<ThreadPool>> {
    let mut kept = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some((_, pool)) = kept.as_ref().filter(|(owner, _)| *owner == process) {
        return Ok(Arc::clone(pool));
    }
    let made = ThreadPoolBuilder::new().thread_name(|k| format!("imufit-{k}")).build();
    let pool = Arc::new(made.map_err(|error| {
        PyRuntimeError::new_err(format!(
            "no threads to compute with: {error}. Set RAYON_NUM_THREADS to fewer."
        ))
    })?);
    // To end the parent's pool would be to tell threads that are not there.
    forget(kept.replace((process, Arc::clone(&pool))));
    Ok(pool)
}

/// Does some work on the threads of this process, without the GIL. What looks for Ctrl-C meanwhile stays on the caller's
/// thread, to which Python tells of it, and takes the [`pool`].
pub fn compute<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool(py)?;
    #[allow(clippy::disallowed_methods)] // the one place for it
    let done = py.detach(|| pool.install(work));
    Ok(done)
}
