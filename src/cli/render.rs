//! `heliostat render`: from a scene to a picture file.

use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::ValueEnum;
use glam::{Mat3, Vec3};
use heliostat::engine::{self, Engine, EngineOptions};
use heliostat::grouping::{GroupingOptions, group};
use heliostat::lighting;
use heliostat::plugins::Plugins;
use heliostat::scene::{
    ApplyReport, Backend, Edit, Environment, EnvironmentMap, Filter, Frame, FrameRequest, IgiOptions, Plane,
    RebuildKind, Scene, ShaderUse, Sky,
};
use heliostat::shading::ShaderRegistry;
use heliostat::shading::pixel::{BoundPixelShader, PixelRegistry};
use heliostat_viewer::{Effect, Own};
use serde_json::{Value, json};

use super::failure::Failure;
use super::pictures::{Expected, Pictures};
use super::playback::Playback;
use super::sequence::{self, Sequence};
use super::values::{self, Exposure, Materials, Size, Surroundings};
use super::{camera, console, input, output};

#[derive(Debug, clap::Args)]
#[command(allow_negative_numbers = true)]
pub(super) struct Arguments {
    /// A file or the name of a built-in scene [default: the replay's, else atrium]
    scene: Option<String>,
    #[command(flatten)]
    reading: input::Reading,
    /// Picture to write: .png is tone mapped, .exr and .hdr hold linear radiance, .apng plays all frames
    #[arg(short, long, value_name = "FILE")]
    output: output::Target,
    /// How light is computed [default: the replay's, else path]
    #[arg(long)]
    renderer: Option<Renderer>,
    /// Width and height in pixels [default: the replay's, else 640x360]
    #[arg(long, value_name = "WxH")]
    size: Option<Size>,
    /// Camera path and changes that the viewer saved
    #[arg(long, value_name = "FILE", conflicts_with_all = ["camera", "eye", "group"])]
    replay: Option<PathBuf>,
    /// Samples per pixel [default: 64 for path, 16 for direct, 1 for igi and cast]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 24))]
    spp: Option<u32>,
    #[command(flatten)]
    camera: camera::Arguments,
    #[command(flatten)]
    sequence: sequence::Arguments,
    /// What triangles are sorted into; the picture depends on it by rounding at most
    #[arg(long, default_value = "bvh")]
    accel: Accelerator,
    /// Threads to work with [default: one per core]; the picture does not depend on it
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Another seed gives other noise
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u32,
    /// Stops by which a .png is brightened, or `auto`: as suits the first frame [default: the replay's, else auto]
    #[arg(long, value_name = "EV", allow_hyphen_values = true)]
    exposure: Option<Exposure>,
    /// Tone curve of a .png: aces, agx, clip, filmic, reinhard[:white=W]; `clip` after a --pixel that answers in colours
    /// [default: filmic]
    #[arg(long, value_name = "NAME[:PARAMETER=VALUE,…]", value_parser = values::shader)]
    tone: Option<ShaderUse>,
    /// Pixel shaders that the picture goes through in this order: edges, exposure, heat, vignette, or a tone curve
    #[arg(long, value_name = "NAME[:PARAMETER=VALUE,…]", value_parser = values::shader)]
    pixel: Vec<ShaderUse>,
    /// Auxiliary planes: into the same file for .exr, else beside it as FILE.NAME.png
    #[arg(long, value_name = "NAME", value_enum, num_args = 1.., value_delimiter = ',')]
    aov: Vec<Aov>,
    /// Longest path in edges: 1 is emission alone, 2 adds direct light, and so on
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    max_depth: Option<u32>,
    /// Reconstruction filter
    #[arg(long, default_value = "box")]
    filter: FilterName,
    /// Constant light on every surface, for the renderer `direct`
    #[arg(long, value_name = "R,G,B", value_parser = values::color, default_value = "0")]
    ambient: Vec3,
    /// Light paths of each set of virtual point lights, for the renderer `igi`
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    paths: u32,
    /// Columns and rows of the pattern in which pixels take different sets, for `igi`
    #[arg(long, value_name = "NxM", default_value = "3x3")]
    interleave: Size,
    /// Leave each pixel of `igi` to its own set
    #[arg(long)]
    no_filter: bool,
    /// Most that a virtual point light of `igi` may add, in multiples of the typical irradiance; `inf` bounds nothing
    #[arg(long, value_name = "X", default_value_t = 2.0)]
    clamp: f32,
    /// Rays from the camera through each pixel that share the light paths of a pass, for `igi`: 1, 2, 4, 8 or 16
    #[arg(long, value_name = "N", default_value_t = 1)]
    antialias: u32,
    /// Leave out the samples that pixels at edges take more, for `igi`: jagged edges, a little faster
    #[arg(long)]
    no_edges: bool,
    /// Leave out the short rays of `igi` that give back what `--clamp` takes away: darker corners, a little faster
    #[arg(long)]
    no_compensation: bool,
    /// Trace every light path of `igi` as it comes, rather than draw eight times as many and keep what matters to the camera
    #[arg(long)]
    no_importance: bool,
    /// Let the frames of an animation by `igi` go on from each other: light is averaged over frames
    #[arg(long)]
    accumulate: bool,
    /// Photons that bring the light which mirrors and glass throw on other surfaces, for `igi`; 0 leaves it out
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = clap::value_parser!(u32).range(0..=1 << 20))]
    photons: u32,
    /// Show materials as they are (`as-is`), all as `diffuse`, or all by a surface shader: show-depth, show-facing,
    /// show-level, show-normal and show-uv are false colours, which a .png shows without exposure or tone curve. NAME or
    /// NAME:PARAMETER=VALUE,…; a value is a number, R/G/B, or an attribute of the scene's meshes, @ATTRIBUTE or
    /// @ATTRIBUTE*FACTOR
    /// [default: the replay's, else as-is]
    #[arg(long, value_name = "HOW")]
    materials: Option<Materials>,
    /// Merge what never moves into one object first: faster to trace where many small objects overlap, slower to start;
    /// object and instance identifiers are those of the merged objects
    #[arg(long)]
    group: bool,
    /// Replaces the scene's environment: a picture, a colour, a gradient of three (up, horizon, down), or `none`
    #[arg(long, value_name = "FILE|R,G,B|UP/HORIZON/DOWN|none", allow_hyphen_values = true)]
    environment: Option<Surroundings>,
    /// Replaces the scene's environment by a clear sky with the sun: haze (1.7 to 10), and where the sun stands in degrees
    /// above the horizon and from −Z towards +X
    #[arg(long, value_name = "TURBIDITY,ELEVATION,AZIMUTH", value_parser = values::sky, conflicts_with = "environment", allow_hyphen_values = true)]
    sky: Option<Sky>,
    /// Leave a scene without any light dark
    #[arg(long)]
    no_default_light: bool,
    /// Load the shader plug-ins that the scene names: they run with all your rights, so allow only what you trust
    #[arg(long)]
    allow_plugins: bool,
    /// Write a report as JSON, one line per frame
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Renderer {
    /// Reference path tracer: all light, unbiased
    Path,
    /// Classical recursive ray tracer: direct light, mirrors, glass
    Direct,
    /// Instant Global Illumination: all light at once, by virtual point lights
    Igi,
    /// Its ancestor, for comparison: one set of virtual point lights for all pixels, nothing filtered
    InstantRadiosity,
    /// Path tracing at a path per pixel with the filter and the history of `igi`, for comparison
    PathFiltered,
    /// Ray casting: first surfaces and all lights, without shadows
    Cast,
    /// The geometry alone, as bright as it faces the camera: no materials, no lights
    Eyelight,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Accelerator {
    /// Wide bounding volume hierarchy: the fastest
    Bvh,
    /// SAH kd-tree with packet traversal, as in the 2003 report on realtime ray tracing
    #[value(name = "kdtree")]
    KdTree,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum FilterName {
    Box,
    Tent,
    Gaussian,
    BlackmanHarris,
}

/// A plane, by the name that the scene crate gives it.
#[derive(Clone, Copy, Debug)]
struct Aov(Plane);

impl ValueEnum for Aov {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [Aov; Plane::ALL.len()] = {
            let mut all = [Aov(Plane::Depth); Plane::ALL.len()];
            let mut i = 0;
            while i < all.len() {
                all[i] = Aov(Plane::ALL[i]);
                i += 1;
            }
            all
        };
        &ALL
    }

    fn to_possible_value(&self) -> Option<clap::builder::PossibleValue> {
        Some(self.0.name().into())
    }
}

impl Renderer {
    fn name(self) -> &'static str {
        match self {
            Self::Path => "path",
            Self::Direct => "direct",
            Self::Igi => "igi",
            Self::InstantRadiosity => "instant-radiosity",
            Self::PathFiltered => "path-filtered",
            Self::Cast => "cast",
            Self::Eyelight => "eyelight",
        }
    }

    fn default_samples(self) -> u32 {
        match self {
            Self::Path => 64,
            Self::Direct => 16,
            Self::Igi | Self::InstantRadiosity | Self::PathFiltered | Self::Cast | Self::Eyelight => 1,
        }
    }
}

impl Arguments {
    /// Where nothing else is asked for, what a replay says.
    fn adopt(&mut self, playback: &Playback) {
        let replay = &playback.replay;
        self.scene.get_or_insert_with(|| replay.scene.clone());
        if self.renderer.is_none() {
            self.renderer = Renderer::from_str(&replay.renderer, false).ok();
        }
        let [width, height] = replay.size;
        self.size = self.size.or_else(|| format!("{width}x{height}").parse().ok());
        self.exposure = self.exposure.or(replay.exposure.map(Exposure::Ev));
        let surfaces = replay.surfaces.clone().map(Materials::Shader);
        self.materials = self.materials.take().or(surfaces).or(replay.diffuse.then_some(Materials::Diffuse));
        if self.pixel.is_empty() {
            self.pixel = replay.effects.iter().map(Effect::shader).collect();
        }
        self.tone = self.tone.take().or(replay.tone.as_ref().map(Effect::shader));
        self.sequence.adopt(playback);
    }

    fn scene(&self) -> &str {
        self.scene.as_deref().unwrap_or("atrium")
    }

    fn renderer(&self) -> Renderer {
        self.renderer.unwrap_or(Renderer::Path)
    }

    fn materials(&self) -> &Materials {
        self.materials.as_ref().unwrap_or(&Materials::AsIs)
    }

    fn size(&self) -> Size {
        self.size.unwrap_or(Size { width: 640, height: 360 })
    }
}

pub(super) fn run(mut arguments: Arguments) -> Result<(), Failure> {
    let playback = arguments.replay.as_deref().map(Playback::load).transpose()?;
    if let Some(playback) = &playback {
        arguments.adopt(playback);
    }
    make(&arguments, playback)
}

fn make(arguments: &Arguments, playback: Option<Playback>) -> Result<(), Failure> {
    arguments.output.check()?;
    if arguments.output.format == output::Format::Apng && !arguments.aov.is_empty() {
        return Err(Failure::usage("an animated picture has no room for planes")
            .with_help("write numbered files: `-o NAME.exr`, with `--animate NAME.apng` for the animation"));
    }
    let source = input::scene(arguments.scene(), &arguments.reading)?;
    input::show(&source.diagnostics);
    let mut edits = source.edits;
    edits.extend(environment(arguments.environment.as_ref())?);
    edits.extend(arguments.sky.map(|sky| Edit::Environment(Environment::Sky(sky))));
    let mut scene = Scene::default();
    scene.apply(&edits)?;
    if !scene.has_light() && !arguments.no_default_light && arguments.environment.is_none() {
        let light = lighting::default_light(&scene);
        scene.apply(&light)?;
        edits.extend(light);
        note("the scene has no light; a clear sky and a sun were added (--no-default-light leaves it dark)");
    }
    camera::choose(&arguments.camera, &scene)?;
    let mut sequence = Sequence::new(&arguments.sequence, source.timeline, playback)?;
    let expected = Expected {
        frames: sequence.frames().len() as u32,
        frames_per_second: sequence.frames_per_second,
        size: arguments.size(),
    };
    let animate = arguments.sequence.animate.as_deref();
    let (curve, exposure) = tone(arguments)?;
    let mut pictures = Pictures::new(&arguments.output, animate, exposure, curve, &expected)?;
    if arguments.group {
        let mut scene = Scene::default();
        scene.apply(&edits)?;
        edits = group(&scene, sequence.timeline(), GroupingOptions::default()).edits;
    }
    let first = sequence.frames().start;
    edits.extend(sequence.edits(first));
    let own = Own::of(&scene);
    edits.extend(sequence.changes(first, &scene, &own)?);
    let engine = build(arguments, edits)?;
    render(arguments, &mut sequence, &mut pictures, engine, &own)?;
    if let Some(file) = pictures.finish()? {
        let (frames, rate) = (expected.frames, expected.frames_per_second);
        console::message(&format!("wrote {}: {frames} frames, {rate} per second", file.display()));
    }
    Ok(())
}

/// The tone curve and the exposure of 8-bit pictures: what a pixel shader has made for a display is left as it is.
fn tone(arguments: &Arguments) -> Result<(BoundPixelShader, Exposure), Failure> {
    let shaders = PixelRegistry::built_in();
    let bind = |wanted: &ShaderUse| shaders.bind(wanted).map_err(|problem| Failure::usage(problem.0));
    let mut shown = arguments.materials().are_false_colors();
    for wanted in &arguments.pixel {
        shown = bind(wanted)?.info().for_display;
    }
    let default = ShaderUse::named(if shown { "clip" } else { "filmic" });
    let curve = bind(arguments.tone.as_ref().unwrap_or(&default))?;
    let info = curve.info();
    if !info.for_display {
        let help = "tone curves are aces, agx, clip, filmic and reinhard; give others with --pixel";
        return Err(Failure::usage(format!("`{}` is no tone curve", info.name)).with_help(help));
    }
    let exposure = match arguments.exposure.unwrap_or(Exposure::Auto) {
        Exposure::Auto if shown => Exposure::Ev(0.0),
        exposure => exposure,
    };
    Ok((curve, exposure))
}

/// Builds the scene as it is in the first frame.
fn build(arguments: &Arguments, edits: Vec<Edit>) -> Result<(Engine, ApplyReport), Failure> {
    let options = EngineOptions {
        threads: arguments.threads.and_then(|n| NonZeroUsize::new(n.into())),
        accelerator: match arguments.accel {
            Accelerator::Bvh => engine::Accelerator::Bvh,
            Accelerator::KdTree => engine::Accelerator::KdTree,
        },
        ..EngineOptions::default()
    };
    let mut shaders = ShaderRegistry::built_in();
    if arguments.allow_plugins {
        shaders.allow_plugins(Arc::new(Plugins::default()));
    }
    console::with_progress("building", move |progress| {
        let mut engine = Engine::with_shaders(options, shaders)?;
        let applied = engine.apply(&edits, progress)?;
        Ok((engine, applied))
    })
}

/// Makes all frames, one after the other.
fn render(
    arguments: &Arguments,
    sequence: &mut Sequence,
    pictures: &mut Pictures,
    (mut engine, mut applied): (Engine, ApplyReport),
    own: &Own,
) -> Result<(), Failure> {
    let frames = sequence.frames();
    let mut framed = None;
    let mut warned = BTreeSet::new();
    for number in frames.clone() {
        let label = match frames.len() {
            1 => "rendering".to_owned(),
            count => format!("frame {} of {count}", number - frames.start + 1),
        };
        if number != frames.start {
            let mut edits = sequence.edits(number);
            edits.extend(sequence.changes(number, engine.scene(), own)?);
            (engine, applied) = console::with_progress(label.clone(), move |progress| {
                let applied = engine.apply(&edits, progress)?;
                Ok((engine, applied))
            })?;
        }
        warn(&mut warned, applied.warnings.iter().chain(&applied.problems));
        // The scene's cameras may move; one that was found for it stands still.
        let chosen = match sequence.camera(number) {
            Some(camera) => Some(camera),
            None => camera::choose(&arguments.camera, engine.scene())?,
        };
        let camera = match (chosen, framed.clone()) {
            (Some(camera), _) | (None, Some(camera)) => camera,
            (None, None) => {
                let aspect = arguments.size().width as f32 / arguments.size().height as f32;
                let camera = camera::framed(&arguments.camera, &engine, aspect)?;
                note(&format!("the scene has no camera; this one looks at it from the {}", camera.name));
                framed.insert(camera).clone()
            }
        };
        let request = FrameRequest { frame: number, ..request(arguments, camera)? };
        let (asked, frame);
        (engine, asked, frame) = console::with_progress(label, move |progress| {
            let frame = engine.render(&request, progress)?;
            Ok((engine, request, frame))
        })?;
        warn(&mut warned, &frame.problems);
        let (files, ev) = pictures.add(number, &frame)?;
        report(
            arguments,
            sequence,
            &Finished { request: &asked, applied: &applied, frame: &frame, files, ev },
        )?;
    }
    Ok(())
}

/// A frame and how it came about.
struct Finished<'a> {
    request: &'a FrameRequest,
    applied: &'a ApplyReport,
    frame: &'a Frame,
    files: Vec<PathBuf>,
    ev: Option<f32>,
}

/// Says what was not said before.
fn warn<'a>(said: &mut BTreeSet<String>, warnings: impl IntoIterator<Item = &'a String>) {
    for warning in warnings {
        if said.insert(warning.clone()) {
            console::message(&format!("warning: {warning}"));
        }
    }
}

fn note(text: &str) {
    console::message(&format!("note: {text}"));
}

fn request(arguments: &Arguments, camera: heliostat::scene::Camera) -> Result<FrameRequest, Failure> {
    Ok(FrameRequest {
        renderer: arguments.renderer().name().into(),
        samples: arguments.spp.unwrap_or(arguments.renderer().default_samples()),
        max_depth: arguments.max_depth,
        seed: arguments.seed,
        filter: match arguments.filter {
            FilterName::Box => Filter::Box,
            FilterName::Tent => Filter::Tent,
            FilterName::Gaussian => Filter::Gaussian(0.5),
            FilterName::BlackmanHarris => Filter::BlackmanHarris,
        },
        ambient: arguments.ambient,
        materials: arguments.materials().to_override().map_err(Failure::usage)?,
        igi: IgiOptions {
            paths: arguments.paths,
            interleave: [arguments.interleave.width, arguments.interleave.height],
            filter: !arguments.no_filter,
            edges: !arguments.no_edges,
            antialias: arguments.antialias,
            clamp: arguments.clamp,
            compensate: !arguments.no_compensation,
            importance: !arguments.no_importance,
            first_pass: 0,
            accumulate: arguments.accumulate,
            photons: arguments.photons,
        },
        pixel_shaders: arguments.pixel.clone(),
        planes: arguments.aov.iter().map(|aov| aov.0).collect::<BTreeSet<_>>().into_iter().collect(),
        ..FrameRequest::new(camera, arguments.size().width, arguments.size().height)
    })
}

/// The edit that replaces the environment, if one is asked for.
fn environment(surroundings: Option<&Surroundings>) -> Result<Option<Edit>, Failure> {
    Ok(match surroundings {
        None => None,
        Some(Surroundings::None) => Some(Edit::Environment(Environment::None)),
        Some(Surroundings::Constant(radiance)) => Some(Edit::Environment(Environment::Constant(*radiance))),
        Some(Surroundings::Gradient(gradient)) => Some(Edit::Environment(Environment::Gradient(*gradient))),
        Some(Surroundings::File(path)) => Some(Edit::Environment(environment_map(path)?)),
    })
}

fn environment_map(path: &Path) -> Result<Environment, Failure> {
    let image = Arc::new(input::picture(path)?);
    Ok(Environment::Map(EnvironmentMap { image, scale: Vec3::ONE, world_from_environment: Mat3::IDENTITY }))
}

/// Says what a frame took.
fn report(arguments: &Arguments, sequence: &Sequence, finished: &Finished<'_>) -> Result<(), Failure> {
    let Finished { request, applied, frame, files, ev } = finished;
    let seconds = frame.stats.milliseconds * 1e-3;
    let mrays = if seconds > 0.0 { frame.stats.rays as f64 * 1e-6 / seconds } else { 0.0 };
    let exposure = ev.map_or(String::new(), |ev| format!(", exposure {ev:+.2} EV"));
    let names: Vec<_> = files.iter().map(|file| file.display().to_string()).collect();
    let what = if names.is_empty() {
        format!("made frame {}", request.frame)
    } else {
        format!("wrote {}", names.join(", "))
    };
    console::message(&format!(
        "{what}: {}×{}, {} samples, {seconds:.2} s, {mrays:.2} Mray/s{exposure}",
        frame.width, frame.height, request.samples
    ));
    if arguments.json {
        let report = json!({
            "scene": arguments.scene(),
            "files": names,
            "renderer": request.renderer,
            "width": frame.width,
            "height": frame.height,
            "samples": request.samples,
            "seed": request.seed,
            "frame": request.frame,
            "clip": sequence.clip(),
            "time": sequence.time(request.frame),
            "milliseconds": frame.stats.milliseconds,
            "rays": frame.stats.rays,
            "mrays_per_second": mrays,
            "exposure": ev,
            "apply": apply_report(applied),
        });
        console::result(&report.to_string())?;
    }
    Ok(())
}

fn apply_report(applied: &ApplyReport) -> Value {
    let rebuilt = applied.rebuilt.iter().map(|r| {
        json!({
            "what": r.what,
            "cause": r.cause.to_string(),
            "reason": format!("{:?}", r.reason),
            "refitted": match r.kind {
                RebuildKind::Refitted { cost } => Some(cost),
                _ => None,
            },
            "primitives": r.primitives,
            "milliseconds": r.milliseconds,
        })
    });
    json!({
        "milliseconds": applied.milliseconds,
        "rebuilt": rebuilt.collect::<Vec<_>>(),
        "warnings": applied.warnings,
        "problems": applied.problems,
    })
}
