//! The thread of a session: takes inputs, lets time pass, makes the next picture, tells the faces.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError};
use std::time::{Duration, Instant};

use glam::Vec3;
use heliostat_scene::{BackendError, Frame, FrameRequest, Progress};
use heliostat_shading::tone;

use crate::document::Refusal;
use crate::governor::Governor;
use crate::host::{Host, Opened, Source};
use crate::input::Input;
use crate::lent::Lent;
use crate::navigator::Mode;
use crate::picture::{Picture, count_range, plane_bytes};
use crate::refine::Refinement;
use crate::replay::Replay;
use crate::session::{Inbox, SessionOptions, Shared};
use crate::stage::{Effect, Stage};
use crate::state::{Loading, Message, State};
use crate::stats::Meter;

/// How often progress is told while a scene is opened.
const TICK: Duration = Duration::from_millis(100);
/// How often a session looks around when there is nothing to do.
const IDLE: Duration = Duration::from_millis(250);
/// Without a movement for so long the view stands still.
const CALM: Duration = Duration::from_millis(120);
/// Longest step of time that a movement takes at once: after a stall nothing jumps.
const LONGEST_STEP: f64 = 0.25;
/// Frames of which a still picture is the mean, at most.
const MAX_FRAMES: u32 = 512;
/// Time in which automatic exposure goes two thirds of its way, seconds.
const ADAPTATION: f32 = 0.3;
/// Inputs kept for a scene that is still being opened.
const MAX_EARLY: usize = 256;
/// Messages kept.
const MAX_MESSAGES: usize = 20;

/// The thread's data.
pub(crate) struct Worker {
    host: Arc<dyn Host>,
    shared: Arc<Shared>,
    options: SessionOptions,
    /// For tone curves and filters. Its threads stay: allocators keep memory for each, and new ones for every picture would
    /// make it more and more.
    pool: rayon::ThreadPool,
    stage: Option<Stage>,
    opening: Option<Opening>,
    governor: Governor,
    refinement: Refinement,
    meter: Meter,
    state: State,
    messages: u64,
    /// Number of the last picture, of the first one of what stands still, and of the last input that it shows.
    pictures: u64,
    first: u64,
    input: u64,
    /// When something last moved, and when time was last advanced.
    moved: Instant,
    last: Instant,
    /// Inputs that wait for the first scene.
    early: Vec<(u64, Input)>,
    /// Stops, as adapted so far.
    exposure: Option<f32>,
    /// Frames and rows of bytes that faces look at, and a buffer for what is made of a frame.
    frames: Lent<Frame>,
    bytes: Lent<Vec<u8>>,
    colors: Vec<Vec3>,
    /// The picture on show.
    shown: Option<Arc<Picture>>,
    /// Whether it shows something else than there is now.
    dirty: bool,
    /// Whether the picture on show is the best there will be.
    done: bool,
}

/// A scene on its way.
struct Opening {
    title: String,
    progress: Arc<Progress>,
    result: Receiver<Result<Opened, Refusal>>,
    since: Instant,
}

impl Drop for Opening {
    fn drop(&mut self) {
        self.progress.cancel();
    }
}

impl Worker {
    /// # Errors
    /// When no threads can be started.
    pub(crate) fn new(
        host: Arc<dyn Host>,
        shared: Arc<Shared>,
        options: SessionOptions,
    ) -> Result<Self, Refusal> {
        let now = Instant::now();
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(options.threads)
            .thread_name(|i| format!("heliostat-finish-{i}"))
            .build()
            .map_err(|error| Refusal(format!("cannot start {} threads: {error}", options.threads)))?;
        Ok(Self {
            pool,
            host,
            shared,
            options,
            stage: None,
            opening: None,
            governor: Governor::default(),
            refinement: Refinement::default(),
            meter: Meter::default(),
            state: State::default(),
            messages: 0,
            pictures: 0,
            first: 0,
            input: 0,
            moved: now,
            last: now,
            early: Vec::new(),
            exposure: None,
            frames: Lent::default(),
            bytes: Lent::default(),
            colors: Vec::new(),
            shown: None,
            dirty: false,
            done: false,
        })
    }

    /// Until the session ends.
    pub(crate) fn run(mut self) {
        loop {
            let inbox = self.shared.receive(self.patience());
            if inbox.stop {
                return;
            }
            // Time in which nothing moved does not count for what begins to move now.
            let seconds = self.clock();
            let mut changed = self.take(inbox);
            self.poll_opening();
            changed |= self.pass_time(seconds);
            self.react(changed);
            if self.opening.is_none() && self.shared.is_watched() {
                self.make_picture();
            }
        }
    }

    /// Seconds since the last call while something moves by itself, else 0.
    fn clock(&mut self) -> f64 {
        let now = Instant::now();
        let seconds = (now - self.last).as_secs_f64().min(LONGEST_STEP);
        self.last = now;
        let moves = |stage: &Stage| {
            stage.playing || stage.navigator.is_moving() || stage.navigator.mode() == Mode::Walk
        };
        if self.stage.as_ref().is_some_and(moves) { seconds } else { 0.0 }
    }

    /// How long the next inputs are waited for; `None` is for ever.
    fn patience(&self) -> Option<Duration> {
        if self.opening.is_some() {
            return Some(TICK);
        }
        let Some(stage) = self.stage.as_ref().filter(|_| self.shared.is_watched()) else {
            // Woken by inputs and by the first who watches.
            return if self.shared.is_watched() { Some(IDLE) } else { None };
        };
        if self.dirty || stage.playing {
            Some(Duration::ZERO)
        } else if stage.navigator.is_moving() {
            // Before a wall nothing changes, but it may be left.
            Some(Duration::from_millis(if self.done { 15 } else { 0 }))
        } else if self.done {
            Some(IDLE)
        } else {
            Some(CALM.saturating_sub(self.moved.elapsed()))
        }
    }

    /// Takes in what users did.
    fn take(&mut self, inbox: Inbox) -> Changed {
        if let Some(source) = inbox.open {
            self.open(source);
        }
        let mut changed = Changed::default();
        if self.stage.is_none() {
            // What is asked of a scene that is still being opened is done when it is there.
            self.early.extend(inbox.inputs);
            let excess = self.early.len().saturating_sub(MAX_EARLY);
            self.early.drain(..excess);
        } else {
            changed |= self.handle(inbox.inputs);
        }
        for question in inbox.questions {
            question(self);
        }
        changed
    }

    fn handle(&mut self, inputs: impl IntoIterator<Item = (u64, Input)>) -> Changed {
        let mut changed = Changed::default();
        for (number, input) in inputs {
            let Some(stage) = &mut self.stage else { break };
            self.input = self.input.max(number);
            let outcome = stage.handle(input);
            changed |= self.outcome(outcome);
            changed.state = true;
        }
        changed
    }

    /// Notes what an input did, or tells why it could not be done.
    fn outcome(&mut self, outcome: Result<Effect, Refusal>) -> Changed {
        match outcome {
            Ok(effect) => {
                if let Some(report) = &effect.report {
                    self.meter.applied(report);
                    for text in report.warnings.iter().chain(&report.problems) {
                        self.tell(false, text.clone());
                    }
                }
                Changed { picture: effect.picture, lines: effect.lines, state: effect.report.is_some() }
            }
            Err(refusal) => {
                self.tell(true, refusal.0);
                Changed { state: true, ..Changed::default() }
            }
        }
    }

    /// Lets the clip and the view move on.
    fn pass_time(&mut self, seconds: f64) -> Changed {
        let mut changed = Changed::default();
        let Some(stage) = self.stage.as_mut().filter(|_| seconds > 0.0 && self.opening.is_none()) else {
            return changed;
        };
        if stage.navigator.is_moving() || stage.navigator.mode() == Mode::Walk {
            changed.picture = stage.advance_view(seconds as f32);
        }
        let passed = stage.advance_time(seconds);
        let failed = passed.is_err();
        let mut timed = self.outcome(passed);
        // Playing goes on all the time: the state tells only that it does.
        timed.state = failed;
        changed |= timed;
        changed
    }

    fn react(&mut self, changed: Changed) {
        if changed.picture {
            self.moved = Instant::now();
            self.refinement.restart();
            (self.dirty, self.done) = (true, false);
        } else if changed.lines && !self.dirty {
            self.redraw_lines();
        }
        if changed.state {
            self.publish_state();
        }
    }

    /// Shows the last picture again with the lines as they are now.
    fn redraw_lines(&mut self) {
        let (Some(stage), Some(last)) = (&self.stage, &self.shown) else { return };
        self.pictures += 1;
        let lines = stage.lines(&stage.navigator.camera());
        let picture = Picture { number: self.pictures, lines, input: self.input, ..Picture::clone(last) };
        self.put_up(picture);
    }

    fn put_up(&mut self, picture: Picture) {
        let picture = Arc::new(picture);
        self.shown = Some(picture.clone());
        self.shared.publish(|news| news.picture = Some(picture));
    }

    fn tell(&mut self, error: bool, text: String) {
        if self.state.messages.last().is_some_and(|last| last.text == text) {
            return;
        }
        self.messages += 1;
        self.state.messages.push(Message { number: self.messages, error, text });
        let excess = self.state.messages.len().saturating_sub(MAX_MESSAGES);
        self.state.messages.drain(..excess);
    }

    fn publish_state(&mut self) {
        self.state.number += 1;
        self.state.scene = self.stage.as_mut().map(Stage::state);
        let state = Arc::new(self.state.clone());
        self.shared.publish(|news| news.state = state);
    }

    fn open(&mut self, source: Source) {
        let (sender, result) = std::sync::mpsc::channel();
        let progress = Arc::new(Progress::new());
        let title = match &source {
            Source::Named(name) | Source::Upload { name, .. } => name.clone(),
        };
        let (host, shared) = (self.host.clone(), progress.clone());
        let builder = std::thread::Builder::new().name("heliostat-open".into()).stack_size(16 << 20);
        // Detached: when nobody waits for its result any more it has been cancelled and ends by itself.
        let started = builder.spawn(move || _ = sender.send(host.open(&source, &shared)));
        match started {
            Ok(_) => self.opening = Some(Opening { title, progress, result, since: Instant::now() }),
            Err(error) => self.tell(true, format!("cannot start a thread: {error}")),
        }
        self.tell_progress();
    }

    fn tell_progress(&mut self) {
        self.state.loading = self.opening.as_ref().map(|opening| {
            let (done, total) = opening.progress.state();
            Loading {
                title: opening.title.clone(),
                done,
                total,
                seconds: opening.since.elapsed().as_secs_f64(),
            }
        });
        self.publish_state();
    }

    fn poll_opening(&mut self) {
        let Some(opening) = &self.opening else { return };
        match opening.result.try_recv() {
            Err(TryRecvError::Empty) => return self.tell_progress(),
            Ok(Ok(opened)) => self.show(opened),
            Ok(Err(refusal)) => self.tell(true, refusal.0),
            Err(TryRecvError::Disconnected) => {
                self.tell(true, "opening the scene failed; please report this".into());
            }
        }
        self.opening = None;
        self.tell_progress();
    }

    fn show(&mut self, opened: Opened) {
        for note in &opened.notes {
            self.tell(false, note.clone());
        }
        let size = self.stage.as_ref().map_or(self.options.size, |stage| stage.size);
        self.state.title = opened.title.clone();
        match Stage::new(opened, size, &self.options.renderer) {
            Ok(stage) => self.stage = Some(stage),
            Err(refusal) => return self.tell(true, refusal.0),
        }
        self.governor = Governor::default();
        self.exposure = None;
        self.last = Instant::now();
        self.refinement.restart();
        // A first picture soon, however small; whole ones follow at once where nothing plays.
        (self.dirty, self.done, self.shown) = (true, false, None);
        let early = std::mem::take(&mut self.early);
        self.handle(early);
        self.moved = Instant::now().checked_sub(CALM).unwrap_or_else(Instant::now);
    }

    pub(crate) fn replay(&self) -> Option<Replay> {
        self.stage.as_ref().map(Stage::replay)
    }

    /// Makes the picture that is due, if one is: of what has moved, or a better one of what stands still.
    fn make_picture(&mut self) {
        let Some(stage) = &mut self.stage else { return };
        let still = !self.dirty;
        if still && (self.done || self.moved.elapsed() < CALM) {
            return;
        }
        let scale = if still { 1.0 } else { self.governor.scale(stage.goal) };
        // Moving pictures all have the same noise: it does not boil.
        let number = if still { self.refinement.frames() } else { 0 };
        let mut request = stage.request(scale, number);
        if !still {
            request.igi.paths = self.governor.paths(stage.goal, request.igi.paths);
        }
        // What moves goes on from the picture before; better ones show nothing that an edit has made untrue.
        request.igi.accumulate = !still;
        request.igi.first_pass = number;
        let progress = Arc::new(Progress::new());
        // Whatever input stops a better picture makes a moving one, which nothing stops: there is always something to see.
        self.shared.give_way(still.then(|| progress.clone()));
        let backend = stage.document.backend();
        if let Some(frame) = self.frames.returned() {
            backend.reuse(frame);
        }
        let outcome = backend.render(&request, &progress);
        self.shared.give_way(None);
        match outcome {
            Ok(mut frame) => {
                let pixels = frame.width * frame.height;
                if !still {
                    let full = stage.size[0] * stage.size[1];
                    self.governor.learn(stage.goal, full, pixels, frame.stats.milliseconds);
                }
                for text in std::mem::take(&mut frame.problems) {
                    self.tell(false, text);
                }
                self.finish(frame, &request, scale, still);
            }
            Err(BackendError::Cancelled) => {}
            Err(error) => {
                self.tell(true, error.to_string());
                (self.dirty, self.done) = (false, true);
                self.publish_state();
            }
        }
    }

    /// Tone maps a frame and shows it.
    fn finish(&mut self, mut frame: Frame, request: &FrameRequest, scale: f32, still: bool) {
        let Some(stage) = &mut self.stage else { return };
        let (camera, igi) = (&request.camera, &request.igi);
        let start = Instant::now();
        let mut stats = self.meter.shown(&frame, self.options.threads);
        if still {
            self.refinement.add(&mut frame);
        }
        let frames = if still { self.refinement.frames() } else { 1 };
        self.dirty &= still;
        if stage.plane.is_none() {
            let planes = std::mem::take(&mut frame.planes);
            let planes = if still { self.refinement.planes() } else { &planes };
            self.pool.install(|| stage.finish.apply(&mut frame, planes, &mut self.colors));
        }
        let mut rgb = self.bytes.returned().unwrap_or_default();
        let exposure = match frame.planes.first().filter(|_| stage.plane.is_some()) {
            Some(data) => {
                stats.counts = count_range(data);
                plane_bytes(data, &mut rgb);
                0.0
            }
            None => {
                // What is in colours for a display has its brightness already.
                let usual = if stage.finish.shown { Some(0.0) } else { None };
                let ev = stage.exposure.or(usual).unwrap_or_else(|| adapt(&frame, &mut self.exposure));
                stage.shown_exposure = ev;
                self.pool.install(|| stage.finish.tone.map(&frame.color, frame.width, ev, &mut rgb));
                ev
            }
        };
        stats.tone = start.elapsed().as_secs_f64() * 1e3;
        stats.scale = scale;
        if stage.renderer == "igi" {
            stats.light_paths = igi.paths * igi.interleave[0] * igi.interleave[1];
        }
        self.pictures += 1;
        if frames == 1 {
            self.first = self.pictures;
        }
        self.done = still && (frames >= MAX_FRAMES || stage.plane.is_some());
        stage.record(camera);
        let picture = Picture {
            number: self.pictures,
            rgb: self.bytes.lend(rgb),
            exposure,
            frames,
            first: self.first,
            still,
            done: self.done,
            view: stage.navigator.to_text(),
            time: stage.time,
            lines: stage.lines(camera),
            stats,
            input: self.input,
            frame: self.frames.lend(frame),
        };
        self.put_up(picture);
    }
}

/// Goes a step towards the exposure that suits a picture; at once for the first one.
fn adapt(frame: &Frame, exposure: &mut Option<f32>) -> f32 {
    // A seventh of the pixels tells as much.
    let some: Vec<_> = frame.color.iter().step_by(7).copied().collect();
    let goal = tone::auto_exposure(&some);
    let seconds = (frame.stats.milliseconds * 1e-3) as f32;
    let step = exposure.map_or(1.0, |_| 1.0 - (-seconds / ADAPTATION).exp());
    let now = exposure.map_or(goal, |now| now + step * (goal - now));
    *exposure = Some(now);
    now
}

/// What has to be made or told anew.
#[derive(Clone, Copy, Debug, Default)]
struct Changed {
    picture: bool,
    lines: bool,
    state: bool,
}

impl std::ops::BitOrAssign for Changed {
    fn bitor_assign(&mut self, other: Self) {
        self.picture |= other.picture;
        self.lines |= other.lines;
        self.state |= other.state;
    }
}
