//! All scenes of a folder on one picture: a look at what importers and shading make of real files.

use std::path::{Path, PathBuf};
use std::time::Instant;

use heliostat::engine::{Engine, EngineOptions, tone};
use heliostat::formats::{Limits, image, load};
use heliostat::framing::frame_scene;
use heliostat::lighting::default_light;
use heliostat::scene::{Backend, FrameRequest, Progress};

const COLUMNS: usize = 6;
const WIDTH: u32 = 240;
const HEIGHT: u32 = 180;

/// Renders the scenes and writes the sheet; a line per picture goes to stdout. Files that fail leave a black field
/// and make the whole run fail at its end.
pub(crate) fn run(folder: &Path, output: &Path, spp: u32, per_folder: usize) -> Result<(), String> {
    let mut files = Vec::new();
    collect(folder, per_folder, &mut files)?;
    if files.is_empty() {
        return Err(format!(
            "{}: no .gltf, .glb, .obj, .ply or .ply.gz file in or below it",
            folder.display()
        ));
    }
    let rows = files.len().div_ceil(COLUMNS);
    let sheet_width = COLUMNS * WIDTH as usize;
    let mut sheet = vec![0; sheet_width * rows * HEIGHT as usize * 3];
    let mut failed = 0;
    for (index, file) in files.iter().enumerate() {
        let (row, column) = (index / COLUMNS, index % COLUMNS);
        let start = Instant::now();
        let name = file.strip_prefix(folder).unwrap_or(file).display();
        match thumbnail(file, spp) {
            Ok((pixels, triangles)) => {
                let seconds = start.elapsed().as_secs_f64();
                crate::result(&format!(
                    "row {row} column {column}: {name}: {triangles} triangles, {seconds:.2} s"
                ));
                for (y, line) in pixels.chunks(WIDTH as usize * 3).enumerate() {
                    let at = ((row * HEIGHT as usize + y) * sheet_width + column * WIDTH as usize) * 3;
                    sheet[at..at + line.len()].copy_from_slice(line);
                }
            }
            Err(message) => {
                failed += 1;
                crate::result(&format!("row {row} column {column}: {name}: FAILED: {message}"));
            }
        }
    }
    let png =
        image::encode_png(sheet_width as u32, rows as u32 * HEIGHT, &sheet).map_err(|e| e.to_string())?;
    std::fs::write(output, png).map_err(|error| format!("{}: {error}", output.display()))?;
    match failed {
        0 => Ok(()),
        _ => Err(format!("{failed} of {} files failed", files.len())),
    }
}

/// Scene files below a folder, sorted; of one folder's files only the first few.
fn collect(folder: &Path, per_folder: usize, files: &mut Vec<PathBuf>) -> Result<(), String> {
    let entries = std::fs::read_dir(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    let is_scene = |path: &&PathBuf| {
        let name = path.to_string_lossy().to_lowercase();
        [".gltf", ".glb", ".obj", ".ply", ".ply.gz"].iter().any(|ending| name.ends_with(ending))
    };
    files.extend(paths.iter().filter(|path| path.is_file()).filter(is_scene).take(per_folder).cloned());
    paths.iter().filter(|path| path.is_dir()).try_for_each(|path| collect(path, per_folder, files))
}

/// A small picture of one file, as the command would show it, and its number of triangles.
fn thumbnail(file: &Path, spp: u32) -> Result<(Vec<u8>, u64), String> {
    let progress = Progress::new();
    let loaded = load(file, &Limits::default()).map_err(|error| error.to_string())?;
    let mut engine = Engine::new(EngineOptions::default()).map_err(|error| error.to_string())?;
    let report = engine.apply(&loaded.edits, &progress).map_err(|error| error.to_string())?;
    let triangles =
        report.rebuilt.iter().filter(|r| r.what.starts_with("triangle")).map(|r| r.primitives).sum();
    if !engine.scene().has_light() {
        let light = default_light(engine.scene());
        engine.apply(&light, &progress).map_err(|error| error.to_string())?;
    }
    let camera = match (engine.scene().cameras().values().next(), engine.scene().bounds()) {
        (Some(camera), _) => camera.clone(),
        (None, Some(bounds)) => frame_scene(engine.rays(), &bounds, WIDTH as f32 / HEIGHT as f32, None),
        (None, None) => return Err("nothing to see".into()),
    };
    let request = FrameRequest { samples: spp, ..FrameRequest::new(camera, WIDTH, HEIGHT) };
    let frame = engine.render(&request, &progress).map_err(|error| error.to_string())?;
    Ok((tone::tone_map(&frame.color, tone::auto_exposure(&frame.color)), triangles))
}
