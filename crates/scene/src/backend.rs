//! The trait between those who change scenes and those who render them.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use crate::{Edit, EditError, Frame, FrameRequest, Target};

/// Something that turns scenes into pixels: the CPU engine, a cluster, a GPU.
pub trait Backend {
    /// Applies all edits or none, and rebuilds what they touch.
    ///
    /// # Errors
    /// [`BackendError::Edit`] for edits that contradict the scene, [`BackendError::Limit`] for what is too large,
    /// [`BackendError::Cancelled`]; the scene is then as before.
    fn apply(&mut self, edits: &[Edit], progress: &Progress) -> Result<ApplyReport, BackendError>;

    /// Makes one picture of the scene as it is.
    ///
    /// # Errors
    /// [`BackendError::Request`] for a request that cannot be met, [`BackendError::Cancelled`].
    fn render(&mut self, request: &FrameRequest, progress: &Progress) -> Result<Frame, BackendError>;

    /// Takes back a frame that is no longer needed, its own or another backend's: its buffers may serve the next one.
    fn reuse(&mut self, frame: Frame) {
        drop(frame);
    }

    /// The renderers this backend has; names for [`FrameRequest::renderer`].
    fn renderers(&self) -> &[&'static str];
}

/// What [`Backend::apply`] did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ApplyReport {
    /// What was rebuilt, in order. Empty when the edits needed no rebuild.
    pub rebuilt: Vec<Rebuilt>,
    /// Wall time of the whole call, milliseconds.
    pub milliseconds: f64,
    /// What the user should know, such as instances left out for a singular transform.
    pub warnings: Vec<String>,
    /// What is not as the scene asks, in the materials that these edits compiled: shaders and parameters that there are
    /// not, plug-ins that may not or cannot be loaded. A placeholder stands for each.
    pub problems: Vec<String>,
}

/// One thing that was rebuilt.
#[derive(Clone, Debug, PartialEq)]
pub struct Rebuilt {
    /// What: for example an object's triangle tree or the instance tree of the world.
    pub what: String,
    /// Which edit caused it: the first, when there were several.
    pub cause: Target,
    /// Why that edit needs it.
    pub reason: RebuildReason,
    /// How much of it had to be made anew.
    pub kind: RebuildKind,
    /// Primitives (triangles, instances, texels, …) that went in.
    pub primitives: u64,
    /// Wall time, milliseconds.
    pub milliseconds: f64,
}

/// How something was brought up to date.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum RebuildKind {
    /// Made anew.
    Built,
    /// The structure was kept and its bounds were brought up to date. `cost` is what it costs to trace by the
    /// surface area heuristic, relative to its cost when it was built.
    Refitted {
        /// 1 is as good as when built.
        cost: f32,
    },
}

/// Why something was rebuilt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RebuildReason {
    /// It is new.
    New,
    /// Its own data changed.
    Changed,
    /// Something inside it changed its bounds or was replaced.
    ChildChanged,
    /// An instance directly inside it moved.
    InstanceMoved,
    /// Bringing it up to date again and again had made it costly to trace.
    Worn,
}

/// Why a backend could not do its work.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BackendError {
    /// The caller's edits were refused.
    #[error(transparent)]
    Edit(#[from] EditError),
    /// The caller's request cannot be met.
    #[error("the frame request cannot be met: {0}")]
    Request(String),
    /// Something exceeds a limit of the backend.
    #[error("limit exceeded: {0}")]
    Limit(String),
    /// The caller cancelled it.
    #[error("cancelled")]
    Cancelled,
    /// The backend itself failed, for example a worker was lost.
    #[error("the backend failed: {0}")]
    Failed(String),
}

/// Progress of long work, and the way to cancel it; shared between the thread that works and the one that waits.
#[derive(Debug, Default)]
pub struct Progress {
    done: AtomicU64,
    total: AtomicU64,
    cancelled: AtomicBool,
}

impl Progress {
    /// Nothing done of nothing.
    pub const fn new() -> Self {
        Self { done: AtomicU64::new(0), total: AtomicU64::new(0), cancelled: AtomicBool::new(false) }
    }

    /// Asks the work to stop soon.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether the work was asked to stop.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// For those who work: starts a stage of `total` steps.
    pub fn start(&self, total: u64) {
        self.done.store(0, Ordering::Relaxed);
        self.total.store(total, Ordering::Relaxed);
    }

    /// For those who work: `steps` more are done.
    pub fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    /// Steps done and steps in all of the current stage; 0 of 0 before the first.
    pub fn state(&self) -> (u64, u64) {
        (self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed))
    }
}
