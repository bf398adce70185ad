//! Threads that draw jobs from one queue.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};

use heliostat_scene::BackendError;

/// Stack of a rendering thread: instances may nest 64 deep, and each level keeps a tile's worth of rays.
const STACK_BYTES: usize = 16 << 20;

/// Does jobs 0 to `jobs` on so many threads, in order of their start, until all are done or `stop` says so.
///
/// # Errors
/// [`BackendError::Failed`] if a thread cannot be started or panics.
pub(crate) fn work_through(
    threads: NonZeroUsize,
    jobs: usize,
    stop: &(dyn Fn() -> bool + Sync),
    job: &(dyn Fn(usize) + Sync),
) -> Result<(), BackendError> {
    let next = AtomicUsize::new(0);
    let work = || {
        while !stop() {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= jobs {
                return;
            }
            job(index);
        }
    };
    std::thread::scope(|scope| {
        let start = |i: usize| {
            let builder = std::thread::Builder::new().name(format!("heliostat-render-{i}"));
            builder.stack_size(STACK_BYTES).spawn_scoped(scope, work)
        };
        let mut result = Ok(());
        let mut workers = Vec::new();
        for i in 0..threads.get().min(jobs) {
            match start(i) {
                Ok(worker) => workers.push(worker),
                Err(error) => {
                    // Nobody waits for this picture any more: empty the queue.
                    next.store(jobs, Ordering::Relaxed);
                    result = Err(BackendError::Failed(format!("cannot start a rendering thread: {error}")));
                    break;
                }
            }
        }
        for worker in workers {
            if worker.join().is_err() {
                result = Err(BackendError::Failed("a rendering thread panicked; please report this".into()));
            }
        }
        result
    })
}
