//! What motion costs: edits, instances, deforming meshes, animated scenes.

mod alternatives;
mod edits;
mod grouping;
mod instancing;
mod objects;
mod opened;
mod play;

pub(crate) use play::camera;

use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Subcommand;
use heliostat::builtin;
use heliostat::engine::{Engine, EngineOptions};
use heliostat::formats::{Limits, load};
use heliostat::scene::{ApplyReport, Backend, Camera, Edit, FrameRequest, Progress, Timeline};

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// A list outside, a new tree in every frame and the hierarchical grid beside placed objects
    Alternatives,
    /// Time from an edit to a scene that is ready: one instance, all of them, a light, a material
    Edits {
        /// A file or the name of a built-in scene
        #[arg(default_value = "sunflowers")]
        scene: String,
        /// Repetitions, of which the median counts
        #[arg(long, default_value_t = 41)]
        runs: usize,
    },
    /// Scenes as modelled beside the same scenes grouped by motion: time to build, to move and to trace
    Grouping(grouping::Arguments),
    /// Frame time of the sunflowers against the number of plants
    Instancing {
        /// Writes the figures as a chart
        #[arg(long, value_name = "SVG")]
        plot: Option<PathBuf>,
        /// Repetitions, of which the median counts
        #[arg(long, default_value_t = 3)]
        runs: usize,
    },
    /// A scene cut into many placed objects against the same in one tree: frame times without and with shading
    Objects {
        /// A file or the name of a built-in scene
        #[arg(default_value = "conference")]
        scene: String,
        /// About how many objects
        #[arg(long, default_value_t = 500)]
        count: usize,
        /// Turn the objects' axes, so that rays must turn, too
        #[arg(long)]
        turned: bool,
        /// Repetitions, of which the median counts
        #[arg(long, default_value_t = 7)]
        runs: usize,
    },
    /// Heaps of overlapping things, opened in the tree over them where the kernel chooses to, against the same kept closed
    Opened {
        /// Repetitions, of which the median counts
        #[arg(long, default_value_t = 7)]
        runs: usize,
    },
    /// Plays a scene's animation and times update and picture, frame by frame
    Play {
        /// A file or the name of a built-in scene
        scene: String,
        /// Frames, evenly over the whole animation
        #[arg(long, default_value_t = 100)]
        frames: u32,
        /// Writes the figures as a chart
        #[arg(long, value_name = "SVG")]
        plot: Option<PathBuf>,
        /// Renderer for the pictures
        #[arg(long, default_value = "direct")]
        renderer: String,
    },
}

pub(crate) fn run(command: &Command) -> Result<(), String> {
    match command {
        Command::Alternatives => alternatives::run(),
        Command::Edits { scene, runs } => edits::run(scene, *runs),
        Command::Grouping(arguments) => grouping::run(arguments),
        Command::Instancing { plot, runs } => instancing::run(plot.as_deref(), *runs),
        Command::Objects { scene, count, turned, runs } => objects::run(scene, *count, *turned, *runs),
        Command::Opened { runs } => opened::run(*runs),
        Command::Play { scene, frames, plot, renderer } => {
            play::run(scene, *frames, renderer, plot.as_deref())
        }
    }
}

/// A scene with what moves in it.
pub(crate) struct Moving {
    pub(crate) edits: Vec<Edit>,
    timeline: Timeline,
}

pub(crate) fn scene(name: &str) -> Result<Moving, String> {
    if let Some(edits) = builtin::build(name) {
        return Ok(Moving { edits, timeline: builtin::timeline(name) });
    }
    let loaded = load(Path::new(name), &Limits::default()).map_err(|error| error.to_string())?;
    Ok(Moving { edits: loaded.edits, timeline: loaded.timeline })
}

/// An engine with these edits applied, and what that took.
fn engine(edits: &[Edit]) -> Result<(Engine, ApplyReport), String> {
    let mut engine = Engine::new(EngineOptions::default()).map_err(|error| error.to_string())?;
    let report = engine.apply(edits, &Progress::new()).map_err(|error| error.to_string())?;
    Ok((engine, report))
}

/// One sample per pixel at 640×480.
fn request(camera: Camera, renderer: &str) -> FrameRequest {
    let mut request = FrameRequest::new(camera, 640, 480);
    request.renderer = renderer.into();
    request.samples = 1;
    request
}

/// Wall time of some work, milliseconds.
fn milliseconds<T>(work: impl FnOnce() -> Result<T, String>) -> Result<(f64, T), String> {
    let start = Instant::now();
    let value = work()?;
    Ok((start.elapsed().as_secs_f64() * 1e3, value))
}

fn write(path: &Path, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}
