//! Progress of a build, and its cancellation, as seen from inside.
use std::sync::{
    Mutex, PoisonError,
    atomic::{AtomicBool, AtomicU64, Ordering},
};

use crate::error::BuildError;

/// How a caller follows a long build and stops it.
pub trait BuildProgress: Sync {
    /// The share of the work that is done, from 0 to 1; it never falls. Called by the threads that build, one at a
    /// time, so it should be quick.
    fn fraction(&self, done: f32);

    /// Whether to stop: the build then ends with [`BuildError::Cancelled`](crate::BuildError::Cancelled). Asked
    /// several times in 50 ms.
    fn cancelled(&self) -> bool {
        false
    }
}

/// Nobody follows.
impl BuildProgress for () {
    fn fraction(&self, _: f32) {}
}

/// Counts work in arbitrary units, in stages of given shares of the whole.
pub(crate) struct Watch<'a> {
    progress: &'a dyn BuildProgress,
    stopped: AtomicBool,
    /// Units expected of and done in the current stage.
    expected: AtomicU64,
    done: AtomicU64,
    /// Where the current stage begins and ends, in 1/1000 of the whole.
    stage: (AtomicU64, AtomicU64),
    /// What was last reported.
    reported: Mutex<f32>,
}

impl<'a> Watch<'a> {
    pub(crate) fn new(progress: &'a dyn BuildProgress) -> Self {
        Self {
            progress,
            stopped: AtomicBool::new(false),
            expected: AtomicU64::new(1),
            done: AtomicU64::new(0),
            stage: (AtomicU64::new(0), AtomicU64::new(0)),
            reported: Mutex::new(0.0),
        }
    }

    /// The next stage, which ends at `end`/1000 of the whole.
    pub(crate) fn stage(&self, end: u64) {
        self.stage.0.store(self.stage.1.load(Ordering::Relaxed), Ordering::Relaxed);
        self.stage.1.store(end, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
        self.expected.store(1, Ordering::Relaxed);
    }

    /// The work of the current stage.
    pub(crate) fn expect(&self, units: u64) {
        self.expected.store(units.max(1), Ordering::Relaxed);
    }

    pub(crate) fn advance(&self, units: u64) {
        let done = self.done.fetch_add(units, Ordering::Relaxed) + units;
        let (begin, end) = (self.stage.0.load(Ordering::Relaxed), self.stage.1.load(Ordering::Relaxed));
        let part = (done as f32 / self.expected.load(Ordering::Relaxed) as f32).min(1.0);
        let fraction = (begin as f32 + part * end.saturating_sub(begin) as f32) * 1.0e-3;
        let mut reported = self.reported.lock().unwrap_or_else(PoisonError::into_inner);
        if *reported < fraction {
            *reported = fraction;
            self.progress.fraction(fraction);
        }
    }

    /// Whether somebody found out that the work is to stop; costs next to nothing.
    #[inline(always)]
    pub(crate) fn halted(&self) -> bool {
        self.stopped.load(Ordering::Relaxed)
    }

    /// Asks whether to stop. Once the answer was yes it stays with it.
    pub(crate) fn stopped(&self) -> bool {
        if self.halted() {
            return true;
        }
        let stopped = self.progress.cancelled();
        if stopped {
            self.stopped.store(true, Ordering::Relaxed);
        }
        stopped
    }

    /// All is done.
    pub(crate) fn finish(&self) {
        self.advance(self.expected.load(Ordering::Relaxed));
    }

    /// # Errors
    /// [`BuildError::Cancelled`] once the work is stopped.
    pub(crate) fn check(&self) -> Result<(), BuildError> {
        if self.stopped() { Err(BuildError::Cancelled) } else { Ok(()) }
    }
}
