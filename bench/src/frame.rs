//! What a frame takes and where its time goes: triangles, preprocessing, rays, ray queries against shading, threads, lanes
//! against single values, one landscape in meshes of several sizes. For Instant Global Illumination these are the constraints that its authors state.
//!
//! # References
//! Wald, Kollig, Benthin, Keller, Slusallek, "Interactive Global Illumination using Fast Ray Tracing", 2002.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use heliostat::engine::{Engine, EngineOptions, LaneMode};
use heliostat::kernel::glam::{Affine3A, Vec3};
use heliostat::lighting;
use heliostat::scene::{
    Backend, Camera, Edit, Frame, FrameRequest, IgiOptions, Material, Mesh, Progress, SceneBuilder,
};

use crate::kernel::terrain;
use crate::measure::median;
use crate::result;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// Scenes by name or file
    #[arg(long, value_name = "NAME|FILE", num_args = 1.., value_delimiter = ',', default_value = "cornell,conference-1")]
    scene: Vec<String>,
    /// Renderers
    #[arg(long, value_name = "NAME", num_args = 1.., value_delimiter = ',', default_value = "cast,direct,igi")]
    renderer: Vec<String>,
    /// Columns and rows
    #[arg(long, num_args = 2, value_names = ["COLUMNS", "ROWS"], default_values_t = [640, 480])]
    size: Vec<u32>,
    /// Samples per pixel, or passes
    #[arg(long, default_value_t = 1)]
    spp: u32,
    /// Light paths of each set, for `igi`
    #[arg(long, default_value_t = 8)]
    paths: u32,
    /// Rays from the camera through each pixel that share light paths, for `igi`
    #[arg(long, default_value_t = 1)]
    antialias: u32,
    /// Triangles of one landscape in ever finer meshes: cost against their number
    #[arg(long, value_name = "COUNT", num_args = 0.., value_delimiter = ',', default_value = "10000,100000,1000000")]
    terrain: Vec<usize>,
    /// Frames; medians are printed
    #[arg(long, default_value_t = 5)]
    runs: u32,
    /// Writes the rows as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// How an engine is set up for a column of the table.
struct Setup {
    name: &'static str,
    threads: Option<NonZeroUsize>,
    lanes: LaneMode,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let setups = [
        Setup { name: "1 thread", threads: NonZeroUsize::new(1), lanes: LaneMode::default() },
        Setup { name: "1 thread, single lanes", threads: NonZeroUsize::new(1), lanes: LaneMode::Single },
        Setup { name: "all threads", threads: None, lanes: LaneMode::default() },
    ];
    let mut rows = Vec::new();
    for scene in &arguments.scene {
        let mut engines = Vec::new();
        let mut preprocessing = 0.0;
        for setup in &setups {
            let (engine, milliseconds) = engine(scene, setup)?;
            engines.push(engine);
            preprocessing = milliseconds;
        }
        let meshes = engines[0].scene().geometries().values().filter_map(|geometry| geometry.as_mesh());
        let triangles: usize = meshes.map(|mesh| mesh.indices.len()).sum();
        result(&format!(
            "{scene:20} {triangles} triangles in its meshes, ready after {preprocessing:.1} ms on all threads"
        ));
        let camera = crate::motion::camera(&engines[0])?;
        for renderer in &arguments.renderer {
            let request = request(arguments, renderer, &camera);
            rows.extend(measure(scene, &request, &setups, &mut engines, arguments.runs)?);
        }
    }
    rows.extend(by_triangles(arguments)?);
    match &arguments.json {
        None => Ok(()),
        Some(file) => std::fs::write(file, serde_json::json!({ "rows": rows }).to_string())
            .map_err(|error| format!("cannot write {}: {error}", file.display())),
    }
}

fn request(arguments: &Arguments, renderer: &str, camera: &Camera) -> FrameRequest {
    let igi = IgiOptions { paths: arguments.paths, antialias: arguments.antialias, ..IgiOptions::default() };
    FrameRequest {
        renderer: renderer.into(),
        samples: arguments.spp,
        igi,
        ..FrameRequest::new(camera.clone(), arguments.size[0], arguments.size[1])
    }
}

/// An engine with a scene, and what it takes to be ready, milliseconds.
fn engine(name: &str, setup: &Setup) -> Result<(Engine, f64), String> {
    let options = EngineOptions { threads: setup.threads, lanes: setup.lanes, ..EngineOptions::default() };
    ready(&crate::motion::scene(name)?.edits, options)
}

fn ready(edits: &[Edit], options: EngineOptions) -> Result<(Engine, f64), String> {
    let mut engine = Engine::new(options).map_err(|error| error.to_string())?;
    let report = engine.apply(edits, &Progress::new()).map_err(|error| error.to_string())?;
    if !engine.scene().has_light() {
        let light = lighting::default_light(engine.scene());
        engine.apply(&light, &Progress::new()).map_err(|error| error.to_string())?;
    }
    Ok((engine, report.milliseconds))
}

/// The same view of one landscape in meshes of several sizes, on all threads: a line for each renderer and size.
fn by_triangles(arguments: &Arguments) -> Result<Vec<serde_json::Value>, String> {
    let (eye, target, degrees) = terrain::look();
    let camera = Camera::look_at("", eye, target, Vec3::Y, degrees.to_radians());
    let mut engines =
        arguments.terrain.iter().map(|&count| landscape(count)).collect::<Result<Vec<_>, _>>()?;
    let mut rows = Vec::new();
    for renderer in &arguments.renderer {
        let request = request(arguments, renderer, &camera);
        let mut times = vec![Vec::new(); engines.len()];
        let mut rays = vec![0; engines.len()];
        for _ in 0..arguments.runs.max(1) {
            for (((engine, _), times), rays) in engines.iter_mut().zip(&mut times).zip(&mut rays) {
                let frame = engine.render(&request, &Progress::new()).map_err(|error| error.to_string())?;
                times.push(frame.stats.milliseconds);
                *rays = frame.stats.rays;
            }
        }
        let mut first = None;
        for (((_, triangles), times), rays) in engines.iter().zip(&mut times).zip(rays) {
            let milliseconds = median(times);
            let per_pixel = rays as f64 / (f64::from(request.width) * f64::from(request.height));
            let (fewest, fastest) = *first.get_or_insert((*triangles, milliseconds));
            let (times, more) = (milliseconds / fastest, *triangles as f64 / fewest as f64);
            result(&format!(
                "{:20} {renderer:8} {triangles:9} triangles {milliseconds:14.1} ms  {per_pixel:6.1} rays/pixel  {:7.1} Mray/s  {times:5.2}× the time for {more:.0}× the triangles",
                "terrain",
                rays as f64 / milliseconds * 1e-3,
            ));
            rows.push(serde_json::json!({
                "scene": "terrain", "renderer": renderer, "triangles": triangles,
                "milliseconds": milliseconds, "rays_per_pixel": per_pixel,
            }));
        }
    }
    Ok(rows)
}

/// An engine with a landscape of about so many triangles, and their number.
fn landscape(count: usize) -> Result<(Engine, usize), String> {
    let (positions, indices) = terrain::make(count);
    let triangles = indices.len();
    let mut scene = SceneBuilder::new();
    let material = scene.material(Material::diffuse("land", Vec3::splat(0.5)));
    let mesh = scene.mesh(Mesh::new(positions, indices));
    let land = scene.object("land", [(mesh, material)]);
    scene.instance(land, Affine3A::IDENTITY);
    let (engine, milliseconds) = ready(&scene.finish(), EngineOptions::default())?;
    result(&format!("{:20} {triangles} triangles, ready after {milliseconds:.1} ms", "terrain"));
    Ok((engine, triangles))
}

/// Frames of all setups in turn, so that a busy machine disturbs all alike.
fn measure(
    scene: &str,
    request: &FrameRequest,
    setups: &[Setup],
    engines: &mut [Engine],
    runs: u32,
) -> Result<Vec<serde_json::Value>, String> {
    let mut frames: Vec<Vec<Frame>> = setups.iter().map(|_| Vec::new()).collect();
    for _ in 0..runs.max(1) {
        for (engine, frames) in engines.iter_mut().zip(&mut frames) {
            frames.push(engine.render(request, &Progress::new()).map_err(|error| error.to_string())?);
        }
    }
    let mut rows = Vec::new();
    let mut one_thread = None;
    for (setup, frames) in setups.iter().zip(&frames) {
        let of = |value: &dyn Fn(&Frame) -> f64| median(&mut frames.iter().map(value).collect::<Vec<_>>());
        let threads = setup.threads.map_or_else(
            || std::thread::available_parallelism().map_or(1, NonZeroUsize::get),
            NonZeroUsize::get,
        );
        let milliseconds = of(&|frame| frame.stats.milliseconds);
        let share = of(&|frame| frame.stats.query_milliseconds / (frame.stats.milliseconds * threads as f64));
        let pixels = f64::from(request.width) * f64::from(request.height);
        let per_pixel = frames[0].stats.rays as f64 / pixels;
        let rate = frames[0].stats.rays as f64 / milliseconds * 1e-3;
        let scaling = *one_thread.get_or_insert(milliseconds) / milliseconds;
        result(&format!(
            "{scene:20} {:8} {:24} {milliseconds:9.1} ms  {per_pixel:6.1} rays/pixel  {rate:7.1} Mray/s  queries {:3.0} %  {scaling:5.2}×",
            request.renderer,
            setup.name,
            100.0 * share
        ));
        rows.push(serde_json::json!({
            "scene": scene, "renderer": request.renderer, "setup": setup.name, "threads": threads,
            "milliseconds": milliseconds, "rays_per_pixel": per_pixel, "mrays_per_s": rate, "query_share": share,
        }));
    }
    Ok(rows)
}
