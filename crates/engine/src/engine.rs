//! The backend: owns the scene and what was compiled from it, and schedules the tiles of a frame.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use heliostat_kernel::{Isa, RayQuery};
use heliostat_scene::{
    ApplyReport, Backend, BackendError, Edit, Filter, Frame, FrameRequest, FrameStats, MaterialOverride,
    Progress, Scene,
};
use heliostat_shading::{CameraRays, PixelFilter};
use heliostat_transport::{Integrator, PixelSum, Region, Settings, View};

use crate::compile::{Compiled, Refused};
use crate::film::Film;

/// Stack of a rendering thread: instances may nest 64 deep, and each level keeps a tile's worth of rays.
const STACK_BYTES: usize = 16 << 20;
/// Most pixels of one picture.
const MAX_PIXELS: u64 = 1 << 27;

/// How the engine runs.
#[derive(Clone, Copy, Debug)]
pub struct EngineOptions {
    /// Threads to build and render with; `None` takes one per core. Never changes a result.
    pub threads: Option<NonZeroUsize>,
    /// What the triangles of each object are sorted into. Changes a result by rounding at most.
    pub accelerator: Accelerator,
    /// A tree that deformation has worn out is built anew within [`Backend::apply`] if that is expected to take no longer,
    /// else in the background while the old one serves. No picture depends on which tree serves.
    pub rebuild_budget: Duration,
}

impl Default for EngineOptions {
    /// All cores, the fastest accelerator, 10 ms for rebuilds.
    fn default() -> Self {
        let accelerator = Accelerator::default();
        Self { threads: None, accelerator, rebuild_budget: Duration::from_millis(10) }
    }
}

/// The structure in which rays look for triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Accelerator {
    /// An 8-wide bounding volume hierarchy: the fastest to build and to trace.
    #[default]
    Bvh,
    /// The kd-tree of the 2003 report.
    KdTree,
}

/// The CPU backend.
pub struct Engine {
    scene: Scene,
    compiled: Compiled,
    options: EngineOptions,
    threads: NonZeroUsize,
    pool: rayon::ThreadPool,
}

impl std::fmt::Debug for Engine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Engine").field("threads", &self.threads).finish_non_exhaustive()
    }
}

impl Engine {
    /// An engine with an empty scene.
    ///
    /// # Errors
    /// [`BackendError::Request`] if `HELIOSTAT_ISA` names an instruction set that is unknown or missing here,
    /// [`BackendError::Failed`] if threads cannot be started.
    pub fn new(options: EngineOptions) -> Result<Self, BackendError> {
        Isa::from_env().map_err(|error| BackendError::Request(format!("HELIOSTAT_ISA: {error}")))?;
        let cores = || std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
        let threads = options.threads.unwrap_or_else(cores);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .thread_name(|i| format!("heliostat-build-{i}"))
            .build()
            .map_err(|error| BackendError::Failed(format!("cannot start {threads} threads: {error}")))?;
        Ok(Self { scene: Scene::default(), compiled: Compiled::new(&options), options, threads, pool })
    }

    /// The scene as all edits so far have made it.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Answers rays in world space against the scene as it is, for picking and for placing cameras.
    pub fn rays(&self) -> &impl RayQuery {
        self.compiled.world()
    }

    /// Compiles the whole scene anew, as after an update that a limit stopped half-way.
    fn recompile(&mut self) -> Result<(), BackendError> {
        let mut scene = Scene::default();
        let edits = self.scene.to_edits();
        let applied = scene.apply(&edits)?;
        let mut compiled = Compiled::new(&self.options);
        let result = self.pool.install(|| compiled.update(&scene, &edits, &applied, &Progress::new()));
        self.compiled = compiled;
        match result {
            Ok(_) => Ok(()),
            Err(Refused::Untouched(error) | Refused::Torn(error)) => Err(error),
        }
    }

    /// Renders all regions into a film; threads draw from one queue. Returns the number of rays.
    fn render_regions(
        &self,
        request: &FrameRequest,
        integrator: Integrator,
        film: &Film,
        progress: &Progress,
    ) -> Result<u64, BackendError> {
        let camera = CameraRays::new(&request.camera, request.width, request.height);
        let scene = self.compiled.shading(request.materials);
        let moving = request.camera.motion.is_some() || self.compiled.world().has_motion();
        let view = View { query: self.compiled.world(), scene, camera: &camera, moving };
        let settings = Settings {
            samples: request.samples,
            max_depth: request.max_depth,
            seed: request.seed,
            frame: request.frame,
            filter: PixelFilter::new(request.filter),
            ambient: request.ambient,
        };
        let regions: Vec<Region> = Region::cover(request.width, request.height).collect();
        progress.start(regions.len() as u64 * u64::from(request.samples));
        let next = AtomicUsize::new(0);
        let rays = AtomicU64::new(0);
        let after_sample = || {
            progress.advance(1);
            !progress.is_cancelled()
        };
        let work = || {
            while !progress.is_cancelled() {
                let Some(region) = regions.get(next.fetch_add(1, Ordering::Relaxed)) else { return };
                let mut sums = vec![PixelSum::default(); (region.width * region.height) as usize];
                let traced = integrator.render(&view, &settings, region, &mut sums, &after_sample);
                rays.fetch_add(traced, Ordering::Relaxed);
                film.store(region, &sums);
            }
        };
        std::thread::scope(|scope| {
            let start = |i: usize| {
                let builder = std::thread::Builder::new().name(format!("heliostat-render-{i}"));
                builder.stack_size(STACK_BYTES).spawn_scoped(scope, work)
            };
            let mut result = Ok(());
            let mut workers = Vec::new();
            for i in 0..self.threads.get().min(regions.len()) {
                match start(i) {
                    Ok(worker) => workers.push(worker),
                    Err(error) => {
                        // Nobody waits for this picture any more: empty the queue.
                        next.store(regions.len(), Ordering::Relaxed);
                        result =
                            Err(BackendError::Failed(format!("cannot start a rendering thread: {error}")));
                        break;
                    }
                }
            }
            for worker in workers {
                if worker.join().is_err() {
                    result =
                        Err(BackendError::Failed("a rendering thread panicked; please report this".into()));
                }
            }
            result
        })?;
        if progress.is_cancelled() { Err(BackendError::Cancelled) } else { Ok(rays.into_inner()) }
    }
}

impl Backend for Engine {
    fn apply(&mut self, edits: &[Edit], progress: &Progress) -> Result<ApplyReport, BackendError> {
        let start = Instant::now();
        let applied = self.scene.apply(edits)?;
        let result = self.pool.install(|| self.compiled.update(&self.scene, edits, &applied, progress));
        let error = match result {
            Ok(mut report) => {
                report.milliseconds = start.elapsed().as_secs_f64() * 1e3;
                return Ok(report);
            }
            Err(Refused::Untouched(error)) => {
                self.scene.revert(applied);
                error
            }
            Err(Refused::Torn(error)) => {
                self.scene.revert(applied);
                self.recompile()?;
                error
            }
        };
        Err(error)
    }

    fn render(&mut self, request: &FrameRequest, progress: &Progress) -> Result<Frame, BackendError> {
        let start = Instant::now();
        let integrator = check(request)?;
        if self.compiled.has_finished() {
            self.apply(&[], progress)?;
        }
        if request.materials != MaterialOverride::None {
            self.compiled.prepare_override(&self.scene, request.materials);
        }
        let film = Film::new(request);
        let rays = self.render_regions(request, integrator, &film, progress)?;
        let mut frame = film.finish();
        frame.stats = FrameStats { milliseconds: start.elapsed().as_secs_f64() * 1e3, rays };
        Ok(frame)
    }

    fn renderers(&self) -> &[&'static str] {
        const NAMES: [&str; Integrator::NAMES.len()] = {
            let mut names = [""; Integrator::NAMES.len()];
            let mut i = 0;
            while i < names.len() {
                names[i] = Integrator::NAMES[i].0;
                i += 1;
            }
            names
        };
        &NAMES
    }
}

/// What is wrong with a request, or the integrator it asks for.
fn check(request: &FrameRequest) -> Result<Integrator, BackendError> {
    let refuse = |reason: String| Err(BackendError::Request(reason));
    let pixels = u64::from(request.width) * u64::from(request.height);
    if pixels == 0 {
        return refuse(format!(
            "the picture is {}×{} pixels; give it at least one",
            request.width, request.height
        ));
    }
    if pixels > MAX_PIXELS {
        return Err(BackendError::Limit(format!(
            "{}×{} are {pixels} pixels; the limit is {MAX_PIXELS}",
            request.width, request.height
        )));
    }
    if request.samples == 0 {
        return refuse("0 samples per pixel; ask for at least 1".into());
    }
    if request.max_depth == Some(0) {
        return refuse("a path depth of 0 shows nothing; 1 shows emission alone".into());
    }
    if let Filter::Gaussian(sigma) = request.filter
        && !(0.0..=16.0).contains(&sigma)
    {
        return refuse(format!(
            "the filter's standard deviation is {sigma} pixels; give a value from 0 to 16"
        ));
    }
    if !(request.ambient.is_finite() && request.ambient.min_element() >= 0.0) {
        return refuse(format!(
            "the ambient radiance is {}; give finite values of at least 0",
            request.ambient
        ));
    }
    if let Some(problem) = request.camera.problem() {
        return refuse(format!("the camera: {problem}"));
    }
    Integrator::by_name(&request.renderer).map_or_else(
        || {
            let known: Vec<_> = Integrator::NAMES.iter().map(|(name, _)| *name).collect();
            refuse(format!(
                "there is no renderer `{}`; this backend has: {}",
                request.renderer,
                known.join(", ")
            ))
        },
        Ok,
    )
}
