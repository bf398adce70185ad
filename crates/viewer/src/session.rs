//! A session: one scene, one view, looked at by any number of faces. Inputs go in, pictures and states come out; making
//! pictures is a thread of its own, so nobody ever waits for one.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::thread::JoinHandle;
use std::time::Duration;

use heliostat_scene::Progress;

use crate::document::Refusal;
use crate::host::{Host, Source};
use crate::input::Input;
use crate::picture::Picture;
use crate::replay::Replay;
use crate::state::State;
use crate::worker::Worker;

/// Most inputs that wait for the next picture; beyond them new ones are refused.
const MAX_WAITING: usize = 4096;
/// Stack of the session's thread: loaders and the timeline may nest deeply.
const STACK_BYTES: usize = 16 << 20;

/// How a session begins.
#[derive(Clone, Debug)]
pub struct SessionOptions {
    /// Columns and rows of the picture until a face says otherwise.
    pub size: [u32; 2],
    /// How light is computed, if the backend can.
    pub renderer: String,
    /// Threads that render, for statistics.
    pub threads: usize,
}

impl Default for SessionOptions {
    /// 640×360 by Instant Global Illumination.
    fn default() -> Self {
        let threads = std::thread::available_parallelism().map_or(1, Into::into);
        Self { size: [640, 360], renderer: "igi".into(), threads }
    }
}

/// A request that needs the thread's own data.
pub(crate) type Question = Box<dyn FnOnce(&Worker) + Send>;

/// What goes in.
#[derive(Default)]
pub(crate) struct Inbox {
    pub(crate) inputs: VecDeque<(u64, Input)>,
    pub(crate) open: Option<Source>,
    pub(crate) questions: Vec<Question>,
    pub(crate) stop: bool,
}

/// What came out last.
#[derive(Clone, Debug, Default)]
pub struct News {
    /// The latest picture.
    pub picture: Option<Arc<Picture>>,
    /// The latest state.
    pub state: Arc<State>,
}

/// What the thread and the faces share.
pub(crate) struct Shared {
    inbox: Mutex<Inbox>,
    wake: Condvar,
    news: Mutex<News>,
    /// Called after each change of the news, from the session's thread.
    listener: Box<dyn Fn() + Send + Sync>,
    watchers: AtomicUsize,
    /// The picture being made, if it may be given up for an input.
    refining: Mutex<Option<Arc<Progress>>>,
}

/// What a lock holds; whoever panicked while holding it left a whole value behind.
pub(crate) fn locked<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

impl Shared {
    /// Takes what came in; waits for it for so long, or, if nobody watches, until something comes.
    pub(crate) fn receive(&self, patience: Option<Duration>) -> Inbox {
        let mut inbox = locked(&self.inbox);
        let empty = |inbox: &Inbox| {
            inbox.inputs.is_empty() && inbox.open.is_none() && inbox.questions.is_empty() && !inbox.stop
        };
        match patience {
            Some(patience) if patience.is_zero() => {}
            Some(patience) => {
                let waited = self.wake.wait_timeout_while(inbox, patience, |inbox| empty(inbox));
                inbox = waited.unwrap_or_else(|poisoned| poisoned.into_inner()).0;
            }
            None => {
                let waited = self.wake.wait_while(inbox, |inbox| empty(inbox) && !self.is_watched());
                inbox = waited.unwrap_or_else(|poisoned| poisoned.into_inner());
            }
        }
        let stop = inbox.stop;
        let taken = std::mem::take(&mut *inbox);
        inbox.stop = stop;
        taken
    }

    pub(crate) fn is_watched(&self) -> bool {
        self.watchers.load(Ordering::SeqCst) > 0
    }

    /// Changes the news and tells those who listen.
    pub(crate) fn publish(&self, change: impl FnOnce(&mut News)) {
        change(&mut locked(&self.news));
        (self.listener)();
    }

    /// From now on inputs cancel `progress`; `None` ends that.
    pub(crate) fn give_way(&self, progress: Option<Arc<Progress>>) {
        // What came in before this call has not cancelled it.
        let waiting = locked(&self.inbox).inputs.iter().any(|(_, input)| input.is_urgent());
        let mut refining = locked(&self.refining);
        if waiting && let Some(progress) = &progress {
            progress.cancel();
        }
        *refining = progress;
    }

    fn interrupt(&self) {
        if let Some(progress) = &*locked(&self.refining) {
            progress.cancel();
        }
    }

    fn put(&self, change: impl FnOnce(&mut Inbox)) {
        change(&mut locked(&self.inbox));
        self.wake.notify_all();
    }
}

/// A handle to a session; the session ends with it.
pub struct Session {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl std::fmt::Debug for Session {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Session").field("thread", &self.thread).finish_non_exhaustive()
    }
}

impl Session {
    /// Starts a session that opens `source`. `listener` is called, on the session's thread, whenever there is news: it
    /// must be quick.
    ///
    /// # Errors
    /// When no thread can be started.
    pub fn start(
        host: Arc<dyn Host>,
        source: Source,
        options: SessionOptions,
        listener: impl Fn() + Send + Sync + 'static,
    ) -> Result<Self, Refusal> {
        let shared = Arc::new(Shared {
            inbox: Mutex::new(Inbox { open: Some(source), ..Inbox::default() }),
            wake: Condvar::new(),
            news: Mutex::default(),
            listener: Box::new(listener),
            watchers: AtomicUsize::new(0),
            refining: Mutex::new(None),
        });
        let worker = Worker::new(host, shared.clone(), options)?;
        let builder = std::thread::Builder::new().name("heliostat-session".into()).stack_size(STACK_BYTES);
        let thread = builder.spawn(move || worker.run());
        let thread = thread.map_err(|error| Refusal(format!("cannot start a thread: {error}")))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Does something as soon as the current picture allows. The next picture carries `number`, if it is larger than any
    /// before.
    ///
    /// # Errors
    /// When it is out of range, or too much waits already.
    pub fn input(&self, number: u64, input: Input) -> Result<(), Refusal> {
        if let Some(problem) = input.problem() {
            return Err(Refusal(problem));
        }
        let mut full = false;
        let urgent = input.is_urgent();
        self.shared.put(|inbox| {
            full = inbox.inputs.len() >= MAX_WAITING;
            if !full {
                inbox.inputs.push_back((number, input));
            }
        });
        if full {
            return Err(Refusal(format!("{MAX_WAITING} inputs wait already")));
        }
        if urgent {
            self.shared.interrupt();
        }
        Ok(())
    }

    /// Opens another scene; the old one stays until the new one is there.
    pub fn open(&self, source: Source) {
        self.shared.put(|inbox| inbox.open = Some(source));
        self.shared.interrupt();
    }

    /// What came out last.
    pub fn news(&self) -> News {
        locked(&self.shared.news).clone()
    }

    /// Says how many watch; without any no pictures are made.
    pub fn set_watchers(&self, count: usize) {
        self.shared.watchers.store(count, Ordering::SeqCst);
        self.shared.wake.notify_all();
    }

    /// The recording, or, when there is none, the current view with all changes; `None` without a scene.
    pub fn replay(&self) -> Option<Replay> {
        let (sender, receiver) = std::sync::mpsc::channel();
        self.shared.put(|inbox| {
            inbox.questions.push(Box::new(move |worker| {
                // Whoever asked may be gone.
                _ = sender.send(worker.replay());
            }));
        });
        self.shared.interrupt();
        receiver.recv().ok().flatten()
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.shared.put(|inbox| inbox.stop = true);
        self.shared.interrupt();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been reported where it happened.
            _ = thread.join();
        }
    }
}
