//! `motion grouping`: the same scenes as modelled and grouped by motion, built, moved and traced in turn.

use std::path::{Path, PathBuf};

use heliostat::engine::{Engine, EngineOptions};
use heliostat::formats::{Limits, load};
use heliostat::framing::frame_scene;
use heliostat::grouping::{GroupingOptions, GroupingSummary, group};
use heliostat::kernel::glam::{Quat, Vec3};
use heliostat::kernel::{Hit, Ray, RayQuery, Tile};
use heliostat::scene::{Backend, Camera, Edit, Progress, Projection, Scene, Timeline};
use serde::Serialize;

use crate::kernel::scenes::scenes_folder;
use crate::measure::{Clock, median};
use crate::{report, result};

/// Moments of a clip at which a moving scene is brought up to date.
const MOMENTS: u32 = 8;

#[derive(Debug, clap::Args)]
pub(crate) struct Arguments {
    /// A built-in scene or a file [may be repeated; default: a choice of both]
    #[arg(long, value_name = "NAME|FILE")]
    scene: Vec<String>,
    /// Pixels along the edge of the square picture
    #[arg(long, default_value_t = 512, value_parser = clap::value_parser!(u32).range(16..=4096))]
    size: u32,
    /// Interleaved runs; medians count
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    runs: u32,
    /// Most triangles of all copies of an object that are merged
    #[arg(long, value_name = "N", default_value_t = GroupingOptions::default().max_copied_triangles)]
    copied: u64,
    /// Write the results to a file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What one scene costs in one form, processor time of one thread.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct Cost {
    /// Milliseconds to group by motion; 0 as modelled.
    group: f64,
    /// Milliseconds of the first apply.
    build: f64,
    /// Milliseconds to apply one moment of the timeline; 0 if nothing moves.
    step: f64,
    /// Milliseconds to trace one ray per pixel from the camera.
    primary: f64,
    /// Milliseconds to trace one ray per pixel in a cosine-weighted direction from where those end.
    diffuse: f64,
}

#[derive(Debug, Serialize)]
struct Row {
    scene: String,
    instances: usize,
    instances_grouped: usize,
    merged_triangles: u64,
    modelled: Cost,
    grouped: Cost,
}

/// A scene in one of its forms.
struct Form {
    edits: Vec<Edit>,
    timeline: Timeline,
    engine: Engine,
}

pub(super) fn run(arguments: &Arguments) -> Result<(), String> {
    let scenes = if arguments.scene.is_empty() { standard() } else { arguments.scene.clone() };
    result(
        "scene                 instances      group    build ms      step ms        primary ms       diffuse ms",
    );
    let mut rows = Vec::new();
    for scene in &scenes {
        match measure(scene, arguments) {
            Ok(row) => {
                print(&row);
                rows.push(row);
            }
            // The choice is ours, and what is there depends on the folder.
            Err(problem) if arguments.scene.is_empty() => report(&format!("note: left out: {problem}")),
            Err(problem) => return Err(problem),
        }
    }
    if let Some(path) = &arguments.json {
        let text = serde_json::to_string_pretty(&rows).map_err(|error| error.to_string())?;
        std::fs::write(path, text + "\n").map_err(|error| format!("{}: {error}", path.display()))?;
    }
    Ok(())
}

/// The built-in scenes that are made of many things, and real ones where they are.
fn standard() -> Vec<String> {
    let folder = scenes_folder();
    let files = [
        "sponza-dabrovic/sponza.obj",
        "office-mgf/office.obj",
        "gltf/FlightHelmet/FlightHelmet.gltf",
        "gltf/2CylinderEngine/2CylinderEngine.glb",
        "gltf/CesiumMan/CesiumMan.glb",
        "bart-robots/aff/Robot.aff",
    ];
    let (here, missing): (Vec<PathBuf>, _) = files.iter().map(|f| folder.join(f)).partition(|p| p.exists());
    for path in missing {
        report(&format!("note: left out, for it is not there: {}", path.display()));
    }
    let builtin = ["atrium", "conference", "cornell"].map(str::to_owned);
    builtin.into_iter().chain(here.into_iter().map(|path| path.display().to_string())).collect()
}

fn read(name: &str) -> Result<(Vec<Edit>, Timeline), String> {
    if let Some(edits) = heliostat::builtin::build(name) {
        return Ok((edits, heliostat::builtin::timeline(name)));
    }
    let loaded = load(Path::new(name), &Limits::default()).map_err(|error| error.to_string())?;
    Ok((loaded.edits, loaded.timeline))
}

fn measure(name: &str, arguments: &Arguments) -> Result<Row, String> {
    let (edits, timeline) = read(name)?;
    let mut scene = Scene::default();
    scene.apply(&edits).map_err(|error| error.to_string())?;
    let options = GroupingOptions { max_copied_triangles: arguments.copied };
    let clock = Clock::start(false);
    let grouped = group(&scene, &timeline, options);
    let grouping = clock.seconds() * 1e3;
    let GroupingSummary { instances_before, instances_after, merged_triangles, .. } = grouped.summary;
    let mut forms = [Form::new(edits, timeline.clone())?, Form::new(grouped.edits, timeline)?];
    let camera = view(&forms[0].engine)?;
    let mut costs = [Vec::new(), Vec::new()];
    for _ in 0..arguments.runs {
        for (form, costs) in forms.iter_mut().zip(&mut costs) {
            costs.push(form.cost(&camera, arguments.size)?);
        }
    }
    let [modelled, grouped] = costs.map(|costs| middle(&costs));
    let stem =
        Path::new(name).file_stem().map_or_else(|| name.into(), |stem| stem.to_string_lossy().into_owned());
    Ok(Row {
        scene: stem,
        instances: instances_before,
        instances_grouped: instances_after,
        merged_triangles,
        modelled,
        grouped: Cost { group: grouping, ..grouped },
    })
}

/// The medians of each figure.
fn middle(costs: &[Cost]) -> Cost {
    let of = |figure: fn(&Cost) -> f64| median(&mut costs.iter().map(figure).collect::<Vec<_>>());
    Cost {
        group: of(|cost| cost.group),
        build: of(|cost| cost.build),
        step: of(|cost| cost.step),
        primary: of(|cost| cost.primary),
        diffuse: of(|cost| cost.diffuse),
    }
}

fn print(row: &Row) {
    let (a, b) = (&row.modelled, &row.grouped);
    let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 1.0 };
    result(&format!(
        "{:<20} {:>5} → {:<5} {:>6.1}  {:>6.1} → {:<6.1} {:>5.2} → {:<5.2} {:>6.1} → {:<6.1}×{:<5.2} {:>6.1} → {:<6.1}×{:.2}",
        row.scene,
        row.instances,
        row.instances_grouped,
        b.group,
        a.build,
        b.build,
        a.step,
        b.step,
        a.primary,
        b.primary,
        ratio(a.primary, b.primary),
        a.diffuse,
        b.diffuse,
        ratio(a.diffuse, b.diffuse),
    ));
}

/// The scene's own camera, or one that shows it well.
fn view(engine: &Engine) -> Result<Camera, String> {
    let scene = engine.scene();
    let perspective = |camera: &&Camera| matches!(camera.projection, Projection::Perspective { .. });
    if let Some(camera) = scene.cameras().values().find(perspective) {
        return Ok(camera.clone());
    }
    let bounds = scene.bounds().ok_or("the scene shows nothing")?;
    Ok(frame_scene(engine.rays(), &bounds, 1.0, None))
}

impl Form {
    fn new(edits: Vec<Edit>, timeline: Timeline) -> Result<Self, String> {
        let mut form = Self { edits, timeline, engine: engine()? };
        form.rebuild()?;
        Ok(form)
    }

    /// Builds from nothing; returns milliseconds of wall time, for builds take several threads.
    fn rebuild(&mut self) -> Result<f64, String> {
        self.engine = engine()?;
        let report = self.engine.apply(&self.edits, &Progress::new()).map_err(|error| error.to_string())?;
        Ok(report.milliseconds)
    }

    fn cost(&mut self, camera: &Camera, size: u32) -> Result<Cost, String> {
        let mut cost = Cost { build: self.rebuild()?, ..Cost::default() };
        let duration = self.timeline.duration();
        let mut steps = Vec::new();
        for moment in 0..=MOMENTS {
            let edits = self.timeline.edits_at(duration * f64::from(moment) / f64::from(MOMENTS));
            let applied = self.engine.apply(&edits, &Progress::new()).map_err(|error| error.to_string())?;
            // The first has everything that moves, whether it does or not.
            if moment > 0 && !edits.is_empty() {
                steps.push(applied.milliseconds);
            }
        }
        cost.step = if steps.is_empty() { 0.0 } else { median(&mut steps) };
        let tiles = camera_tiles(camera, size);
        let mut hits = vec![Hit::MISS; tiles.len() * Tile::CAPACITY];
        let rays = self.engine.rays();
        let clock = Clock::start(false);
        for (tile, hits) in tiles.iter().zip(hits.chunks_mut(Tile::CAPACITY)) {
            rays.intersect_tile(tile, hits);
        }
        cost.primary = clock.seconds() * 1e3;
        let bounces = bounces(&tiles, &hits);
        let mut hits = vec![Hit::MISS; bounces.len()];
        let clock = Clock::start(false);
        for (bounces, hits) in bounces.chunks(Tile::CAPACITY).zip(hits.chunks_mut(Tile::CAPACITY)) {
            rays.intersect(bounces, hits);
        }
        cost.diffuse = clock.seconds() * 1e3;
        Ok(cost)
    }
}

fn engine() -> Result<Engine, String> {
    Engine::new(EngineOptions::default()).map_err(|error| error.to_string())
}

/// Squares of 16×16 pixels, each in blocks of 4×4.
fn camera_tiles(camera: &Camera, size: u32) -> Vec<Tile> {
    let Projection::Perspective { vertical_fov } = camera.projection else { return Vec::new() };
    let slope = (0.5 * vertical_fov).tan();
    let pixel = |p: u32| (p as f32 + 0.5) / size as f32 * 2.0 - 1.0;
    let squares = size.div_ceil(16);
    let mut tiles = Vec::new();
    for square in 0..squares * squares {
        let mut tile = Tile::new(camera.world_from_camera.translation.into());
        for i in 0..Tile::CAPACITY as u32 {
            let (block, inside) = (i / 16, i % 16);
            let x = square % squares * 16 + block % 4 * 4 + inside % 4;
            let y = square / squares * 16 + block / 4 * 4 + inside / 4;
            let toward = Vec3::new(pixel(x) * slope, -pixel(y) * slope, -1.0);
            tile.push(camera.world_from_camera.transform_vector3(toward), f32::INFINITY);
        }
        tiles.push(tile);
    }
    tiles
}

/// A ray from each hit, cosine-weighted around the side that was seen.
fn bounces(tiles: &[Tile], hits: &[Hit]) -> Vec<Ray> {
    let rays = tiles.iter().flat_map(|tile| (0..tile.len()).filter_map(|i| tile.ray(i)));
    let hit_rays = rays.zip(hits).filter(|(_, hit)| hit.is_hit());
    hit_rays
        .enumerate()
        .map(|(i, (ray, hit))| {
            let ng = if hit.ng.dot(ray.direction) > 0.0 { -hit.ng } else { hit.ng }.normalize_or_zero();
            // Points of the golden spiral, in an order that looks random.
            let [u, v] = [0.754_877_7, 0.569_840_3].map(|step: f64| (step * i as f64).fract() as f32);
            let (radius, angle) = (u.sqrt(), std::f32::consts::TAU * v);
            let local = Vec3::new(radius * angle.cos(), radius * angle.sin(), (1.0 - u).max(0.0).sqrt());
            let direction = Quat::from_rotation_arc(Vec3::Z, ng) * local;
            let start = ray.at(hit.t);
            let away = 1e-4 * (start - ray.origin).length();
            Ray::new(start + ng * away, direction)
        })
        .collect()
}
