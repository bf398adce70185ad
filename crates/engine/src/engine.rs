//! The backend: owns the scene and what was compiled from it, and schedules the tiles of a frame.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use heliostat_kernel::{Isa, RayQuery};
use heliostat_scene::{
    ApplyReport, Backend, BackendError, Edit, Filter, Frame, FrameRequest, FrameStats, IgiOptions,
    MaterialOverride, Progress, Scene,
};
use heliostat_shading::pixel::PixelRegistry;
use heliostat_shading::{CameraRays, LaneMode, PixelFilter, ShaderRegistry};
use heliostat_transport::{History, Integrator, PixelSum, Region, Settings, View};

use crate::compile::{Compiled, Refused};
use crate::film::Film;
use crate::igi;
use crate::meter::Metered;
use crate::photometry::{self, Photometry, PhotometryRequest};
use crate::post;
use crate::queue::{STACK_BYTES, work_through};

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
    /// How shaders run. Never changes a result.
    pub lanes: LaneMode,
}

impl Default for EngineOptions {
    /// All cores, the fastest accelerator, 10 ms for rebuilds, packets of lanes.
    fn default() -> Self {
        let accelerator = Accelerator::default();
        Self {
            threads: None,
            accelerator,
            rebuild_budget: Duration::from_millis(10),
            lanes: LaneMode::default(),
        }
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
    shaders: Arc<ShaderRegistry>,
    pixel_shaders: PixelRegistry,
    pool: rayon::ThreadPool,
    /// What the frame before has seen, if frames are to go on from each other.
    history: Option<History>,
    buffers: Mutex<igi::Buffers>,
    /// A frame that came back.
    spare: Option<Frame>,
    /// What the materials were overridden with in the last picture.
    overridden: MaterialOverride,
    /// What the next picture has to tell.
    problems: Vec<String>,
}

impl std::fmt::Debug for Engine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Engine").field("threads", &self.pool.current_num_threads()).finish_non_exhaustive()
    }
}

impl Engine {
    /// An engine with an empty scene.
    ///
    /// # Errors
    /// [`BackendError::Request`] if `HELIOSTAT_ISA` names an instruction set that is unknown or missing here,
    /// [`BackendError::Failed`] if threads cannot be started.
    pub fn new(options: EngineOptions) -> Result<Self, BackendError> {
        Self::with_shaders(options, ShaderRegistry::built_in())
    }

    /// An engine with an empty scene whose materials may name these shaders.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn with_shaders(options: EngineOptions, shaders: ShaderRegistry) -> Result<Self, BackendError> {
        let shaders = Arc::new(shaders);
        Isa::from_env().map_err(|error| BackendError::Request(format!("HELIOSTAT_ISA: {error}")))?;
        let cores = || std::thread::available_parallelism().unwrap_or(NonZeroUsize::MIN);
        let threads = options.threads.unwrap_or_else(cores);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .thread_name(|i| format!("heliostat-{i}"))
            .stack_size(STACK_BYTES)
            .build()
            .map_err(|error| BackendError::Failed(format!("cannot start {threads} threads: {error}")))?;
        let compiled = Compiled::new(&options, shaders.clone());
        let pixel_shaders = PixelRegistry::built_in();
        Ok(Self {
            scene: Scene::default(),
            compiled,
            options,
            shaders,
            pixel_shaders,
            pool,
            history: None,
            buffers: Mutex::default(),
            spare: None,
            overridden: MaterialOverride::None,
            problems: Vec::new(),
        })
    }

    /// Replaces the pixel shaders that requests may name; the default is those that come with the engine.
    pub fn set_pixel_shaders(&mut self, pixel_shaders: PixelRegistry) {
        self.pixel_shaders = pixel_shaders;
    }

    /// The scene as all edits so far have made it.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Answers rays in world space against the scene as it is, for picking and for placing cameras.
    pub fn rays(&self) -> &impl RayQuery {
        self.compiled.world()
    }

    /// Measures how strongly the scene's lights, through its mirrors and lenses, shine in which direction.
    ///
    /// # Errors
    /// [`BackendError::Request`] if the request is out of range or the scene has no light that stands in it,
    /// [`BackendError::Cancelled`], [`BackendError::Failed`] if threads cannot be started.
    pub fn photometry(
        &self,
        request: &PhotometryRequest,
        progress: &Progress,
    ) -> Result<Photometry, BackendError> {
        let scene = self.compiled.shading(&MaterialOverride::None);
        photometry::measure(self.compiled.world(), scene, request, &self.pool, progress)
    }

    /// Compiles the whole scene anew, as after an update that a limit stopped half-way.
    fn recompile(&mut self) -> Result<(), BackendError> {
        let mut scene = Scene::default();
        let edits = self.scene.to_edits();
        let applied = scene.apply(&edits)?;
        let mut compiled = Compiled::new(&self.options, self.shaders.clone());
        let result = self.pool.install(|| compiled.update(&scene, &edits, &applied, &Progress::new()));
        self.compiled = compiled;
        match result {
            Ok(_) => Ok(()),
            Err(Refused::Untouched(error) | Refused::Torn(error)) => Err(error),
        }
    }

    /// Renders a picture into a film and says what it took.
    fn render_frame(
        &self,
        request: &FrameRequest,
        renderer: Renderer,
        camera: &CameraRays,
        film: &Film,
        history: &mut Option<History>,
        progress: &Progress,
    ) -> Result<FrameStats, BackendError> {
        let start = Instant::now();
        let scene = self.compiled.shading(&request.materials);
        let moving = request.camera.motion.is_some() || self.compiled.world().has_motion();
        let query = Metered::new(self.compiled.world());
        let view = View { query: &query, scene, camera, moving };
        let settings = Settings {
            samples: request.samples,
            max_depth: request.max_depth,
            seed: request.seed,
            frame: request.frame,
            filter: PixelFilter::new(request.filter),
            aligned: !matches!(renderer, Renderer::ByRegion(_)),
            ambient: request.ambient,
            planes: film.has_planes(),
        };
        let rays = match renderer {
            Renderer::ByRegion(integrator) => {
                self.render_regions(&view, &settings, integrator, film, progress)?
            }
            Renderer::Igi | Renderer::FilteredPath => igi::render(
                (&self.pool, &self.buffers),
                &view,
                &settings,
                (&request.igi, film, progress),
                renderer == Renderer::FilteredPath,
                history,
            )?,
            Renderer::InstantRadiosity => {
                let alone = IgiOptions {
                    interleave: [1, 1],
                    filter: false,
                    importance: false,
                    accumulate: false,
                    ..request.igi
                };
                igi::render(
                    (&self.pool, &self.buffers),
                    &view,
                    &settings,
                    (&alone, film, progress),
                    false,
                    &mut None,
                )?
            }
        };
        if progress.is_cancelled() {
            return Err(BackendError::Cancelled);
        }
        let milliseconds = start.elapsed().as_secs_f64() * 1e3;
        Ok(FrameStats { milliseconds, rays, query_milliseconds: query.milliseconds() })
    }

    fn render_regions(
        &self,
        view: &View<'_, Metered<'_>>,
        settings: &Settings,
        integrator: Integrator,
        film: &Film,
        progress: &Progress,
    ) -> Result<u64, BackendError> {
        let regions: Vec<Region> = film.regions().collect();
        progress.start(regions.len() as u64 * u64::from(settings.samples));
        let rays = AtomicU64::new(0);
        let after_sample = || advance(progress);
        work_through(&self.pool, regions.len(), &|| progress.is_cancelled(), &|index| {
            let region = &regions[index];
            let mut sums = vec![PixelSum::default(); region.area()];
            let traced = integrator.render(view, settings, region, &mut sums, &after_sample);
            rays.fetch_add(traced, Ordering::Relaxed);
            film.store(region, &sums);
        })?;
        Ok(rays.into_inner())
    }
}

/// Counts a sample of a region and says whether to go on.
fn advance(progress: &Progress) -> bool {
    progress.advance(1);
    !progress.is_cancelled()
}

/// What makes a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Renderer {
    /// Region by region, each by itself.
    ByRegion(Integrator),
    /// Instant Global Illumination.
    Igi,
    /// Its ancestor, for comparison: all pixels share one set of virtual point lights and nothing is filtered (Keller,
    /// "Instant Radiosity", 1997).
    InstantRadiosity,
    /// Path tracing with the filter and the history of `igi`, for comparison.
    FilteredPath,
}

impl Renderer {
    const NAMES: [&str; 7] =
        ["path", "direct", "igi", "instant-radiosity", "path-filtered", "cast", "eyelight"];

    fn by_name(name: &str) -> Option<Self> {
        match name {
            "igi" => Some(Self::Igi),
            "instant-radiosity" => Some(Self::InstantRadiosity),
            "path-filtered" => Some(Self::FilteredPath),
            _ => Integrator::by_name(name).map(Self::ByRegion),
        }
    }

    /// Samples of a pixel that are made at once.
    fn samples_of_pass(self, igi: &IgiOptions) -> u32 {
        match self {
            Self::ByRegion(_) => 1,
            Self::Igi | Self::InstantRadiosity | Self::FilteredPath => igi.antialias,
        }
    }
}

impl Backend for Engine {
    fn apply(&mut self, edits: &[Edit], progress: &Progress) -> Result<ApplyReport, BackendError> {
        let start = Instant::now();
        if let Some(history) = self.history.as_mut().filter(|_| !edits.is_empty()) {
            history.distrust();
        }
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
        let renderer = check(request)?;
        if self.compiled.has_finished() {
            self.apply(&[], progress)?;
        }
        if let MaterialOverride::Shader { shader, .. } = &request.materials {
            self.shaders.find(shader).map_err(|problem| BackendError::Request(problem.0))?;
        }
        if request.materials != MaterialOverride::None {
            self.problems.extend(self.compiled.prepare_override(&self.scene, &request.materials));
        }
        let bind =
            |wanted| self.pixel_shaders.bind(wanted).map_err(|problem| BackendError::Request(problem.0));
        let pixel_shaders = request.pixel_shaders.iter().map(bind).collect::<Result<Vec<_>, _>>()?;
        let samples = request.samples.saturating_mul(renderer.samples_of_pass(&request.igi));
        let camera =
            CameraRays::with_shaders(&request.camera, (request.width, request.height), &self.shaders)
                .map_err(|problem| BackendError::Request(problem.0))?;
        let planes = post::planes(request, &pixel_shaders);
        let film = Film::new(request, samples, &planes, self.spare.take());
        let mut history = self.history.take();
        if self.overridden != request.materials {
            self.overridden = request.materials.clone();
            history.iter_mut().for_each(History::distrust);
        }
        self.compiled.set_viewer(&request.materials, Some(camera.viewer()));
        let stats = self.render_frame(request, renderer, &camera, &film, &mut history, progress);
        self.compiled.set_viewer(&request.materials, None);
        self.history = history;
        let mut frame = film.finish();
        let stats = match stats {
            Ok(stats) => stats,
            Err(error) => {
                self.reuse(frame);
                return Err(error);
            }
        };
        self.pool.install(|| {
            post::count_visits(&mut frame, self.compiled.world(), &camera);
            post::shade(&mut frame, &pixel_shaders, self.options.lanes);
        });
        frame.planes.truncate(request.planes.len());
        frame.problems = std::mem::take(&mut self.problems);
        frame.problems.extend(self.compiled.shading(&request.materials).take_problems());
        frame.stats = stats;
        Ok(frame)
    }

    fn reuse(&mut self, frame: Frame) {
        self.spare = Some(frame);
    }

    fn renderers(&self) -> &[&'static str] {
        &Renderer::NAMES
    }
}

/// What is wrong with a request, or the renderer it asks for.
fn check(request: &FrameRequest) -> Result<Renderer, BackendError> {
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
    if let Some(problem) = request.igi.problem() {
        return refuse(format!("Instant Global Illumination: {problem}"));
    }
    Renderer::by_name(&request.renderer).map_or_else(
        || {
            let known = Renderer::NAMES;
            refuse(format!(
                "there is no renderer `{}`; this backend has: {}",
                request.renderer,
                known.join(", ")
            ))
        },
        Ok,
    )
}
