//! What the viewer needs of this program: opening scenes by name and from memory.

use std::collections::BTreeMap;
use std::sync::Arc;

use heliostat::engine::{Engine, EngineOptions};
use heliostat::formats::image::encode_exr;
use heliostat::formats::{FileSource, Limits, Severity, SourceError, load_bytes};
use heliostat::framing::frame_scene;
use heliostat::lighting::default_light;
use heliostat::plugins::Plugins;
use heliostat::scene::{Backend, Frame, Progress, Scene};
use heliostat::shading::ShaderRegistry;
use heliostat_viewer::{Host, Opened, Refusal, Source};

use super::input;

/// Remarks of a loader that are shown.
const MAX_REMARKS: usize = 5;

/// Opens scenes for the viewer.
#[derive(Debug)]
pub(super) struct CliHost {
    /// Whether scenes named on the command line may load shader plug-ins. Uploads never may.
    pub(super) allow_plugins: bool,
}

/// Limits for files that came from a browser.
fn strict_limits() -> Limits {
    Limits {
        file_bytes: 1 << 30,
        memory_bytes: 2 << 30,
        vertices: 20_000_000,
        triangles: 30_000_000,
        image_pixels: 1 << 26,
        zeros: 4_000_000,
        nodes: 500_000,
        nesting: 128,
        materials: 50_000,
        ..Limits::default()
    }
}

/// What was sent with a scene: in memory, and nothing else can be had.
struct Beside<'a>(&'a BTreeMap<String, Arc<[u8]>>);

impl FileSource for Beside<'_> {
    /// By its path, or, as users drop files side by side that lay in folders, by its name alone.
    fn read(&self, relative: &str, max_bytes: u64) -> Result<Vec<u8>, SourceError> {
        if self.0.is_empty() {
            return Err(SourceError::NoFiles);
        }
        let wanted = relative.trim_start_matches("./");
        let last = |path: &str| path.rsplit('/').next().unwrap_or(path).to_lowercase();
        let named = |(path, _): &(&String, &Arc<[u8]>)| last(path) == last(wanted);
        let found = self.0.get(wanted).or_else(|| self.0.iter().find(named).map(|(_, bytes)| bytes));
        let bytes = found.ok_or(SourceError::NotFound)?;
        if bytes.len() as u64 > max_bytes {
            return Err(SourceError::TooLarge { limit: max_bytes });
        }
        Ok(bytes.to_vec())
    }

    fn list(&self, relative: &str) -> Vec<String> {
        let inside = |path: &String| {
            let (folder, file) = path.rsplit_once('/').unwrap_or(("", path));
            folder.eq_ignore_ascii_case(relative.trim_end_matches('/')).then(|| file.to_owned())
        };
        self.0.keys().filter_map(inside).collect()
    }
}

impl Host for CliHost {
    fn open(&self, source: &Source, progress: &Progress) -> Result<Opened, Refusal> {
        let mut shaders = ShaderRegistry::built_in();
        let (title, read) = match source {
            Source::Named(name) => {
                if self.allow_plugins {
                    shaders.allow_plugins(Arc::new(Plugins::default()));
                }
                (
                    name,
                    input::read(name, &input::Reading::default())
                        .map_err(|failure| Refusal(failure.to_string()))?,
                )
            }
            Source::Upload { name, bytes, beside } => {
                let loaded = load_bytes(name, bytes, &Beside(beside), &strict_limits());
                (name, loaded.map_err(|error| Refusal(error.to_string()))?.into())
            }
        };
        if progress.is_cancelled() {
            return Err(Refusal(format!("{title} was given up")));
        }
        let mut notes = remarks(&read);
        let mut edits = read.edits;
        let mut scene = Scene::default();
        scene.apply(&edits).map_err(|error| Refusal(error.to_string()))?;
        if !scene.has_light() {
            edits.extend(default_light(&scene));
            notes.push("the scene has no light; a clear sky and a sun were added".into());
        }
        let mut engine = Engine::with_shaders(EngineOptions::default(), shaders)?;
        let report = engine.apply(&edits, progress)?;
        notes.extend(report.warnings.into_iter().chain(report.problems).take(MAX_REMARKS));
        let scene = engine.scene().clone();
        let home = match scene.cameras().values().next() {
            Some(camera) => camera.clone(),
            None => {
                let bounds = scene.bounds();
                let bounds =
                    bounds.ok_or_else(|| Refusal(format!("{title}: there is nothing to look at")))?;
                frame_scene(engine.rays(), &bounds, 1.6, None)
            }
        };
        Ok(Opened {
            title: title.clone(),
            backend: Box::new(engine),
            scene,
            timeline: read.timeline,
            home,
            notes,
        })
    }

    fn to_exr(&self, frame: &Frame) -> Result<Vec<u8>, Refusal> {
        encode_exr(frame.width, frame.height, &frame.color, &frame.planes)
            .map_err(|error| Refusal(error.to_string()))
    }
}

/// What the loader has to say, in short.
fn remarks(read: &input::Source) -> Vec<String> {
    let warnings: Vec<_> = read.diagnostics.iter().filter(|d| d.severity >= Severity::Warning).collect();
    let mut notes: Vec<String> = warnings.iter().take(MAX_REMARKS).map(ToString::to_string).collect();
    if warnings.len() > MAX_REMARKS {
        notes.push(format!("{} further warnings; `heliostat info` shows them", warnings.len() - MAX_REMARKS));
    }
    notes
}
