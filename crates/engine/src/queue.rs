//! Threads that draw jobs from one queue.

use std::panic::AssertUnwindSafe;
use std::sync::atomic::{AtomicUsize, Ordering};

use heliostat_scene::BackendError;

/// Stack of a rendering thread: instances may nest 64 deep, and each level keeps a tile's worth of rays.
pub(crate) const STACK_BYTES: usize = 16 << 20;

/// Does jobs 0 to `jobs` on the threads of a pool, in order of their start, until all are done or `stop` says so. The threads
/// stay: allocators keep memory for each, and new ones for every picture would make it more and more.
///
/// # Errors
/// [`BackendError::Failed`] if a job panics.
pub(crate) fn work_through(
    pool: &rayon::ThreadPool,
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
    let threads = pool.current_num_threads().min(jobs);
    let scope = || {
        pool.scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|_| work());
            }
        });
    };
    // Whatever a job that panicked was making is given up with the picture.
    std::panic::catch_unwind(AssertUnwindSafe(scope))
        .map_err(|_| BackendError::Failed("a rendering thread panicked; please report this".into()))
}
