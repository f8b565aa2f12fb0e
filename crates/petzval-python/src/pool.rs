//! The threads of this process.

use std::sync::{Arc, Mutex, PoisonError};

use petzval_jobs::JobError;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// A pool, and the process that has its threads.
struct Kept {
    process: u32,
    pool: Arc<ThreadPool>,
}

/// The pool of this process, and how many threads it shall have; 0 means those of a batch system, else one per core.
static POOL: Mutex<(usize, Option<Kept>)> = Mutex::new((0, None));

/// The pool in which all work is done. A process that was forked has none of its parent's threads and gets a pool of its own.
pub fn pool() -> Result<Arc<ThreadPool>, JobError> {
    let mut kept = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some(kept) = &kept.1
        && kept.process == process
    {
        return Ok(kept.pool.clone());
    }
    // The parent's pool is not dropped: dropping waits for threads that do not exist here.
    if let Some(parent) = kept.1.take() {
        std::mem::forget(parent);
    }
    let number = petzval_jobs::threads::threads(kept.0)?.number;
    let pool = ThreadPoolBuilder::new().num_threads(number).build();
    let pool = Arc::new(pool.map_err(|e| JobError::failed(format!("{number} threads: {e}")))?);
    kept.1 = Some(Kept { process, pool: pool.clone() });
    Ok(pool)
}

/// How many threads the pool of this process has.
pub fn threads() -> Result<usize, JobError> {
    Ok(pool()?.current_num_threads())
}

/// Chooses how many threads the next work has; 0 means those of a batch system, else one per core. Work that runs keeps its threads.
pub fn set_threads(threads: usize) {
    let mut kept = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let mine = kept.1.take();
    *kept = (threads, None);
    match mine {
        Some(mine) if mine.process != std::process::id() => std::mem::forget(mine),
        mine => drop(mine),
    }
}
