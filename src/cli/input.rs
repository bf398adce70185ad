//! Reads what the command line names: scenes and pictures.

use std::path::Path;

use heliostat::builtin;
use heliostat::formats::{Diagnostic, Limits, Severity, image, load};
use heliostat::scene::{Edit, Image, Timeline};

use super::console;
use super::failure::Failure;

/// A scene as named on the command line.
pub(super) struct Source {
    pub(super) edits: Vec<Edit>,
    pub(super) timeline: Timeline,
    pub(super) diagnostics: Vec<Diagnostic>,
}

/// Reads a scene: a built-in one by its name, else a file. `detail_level` is that of [`Limits`].
///
/// # Errors
/// When there is neither, or the file cannot be loaded.
pub(super) fn scene(name: &str, detail_level: Option<u32>) -> Result<Source, Failure> {
    if let Some(edits) = builtin::build(name) {
        return Ok(Source { edits, timeline: builtin::timeline(name), diagnostics: Vec::new() });
    }
    let path = Path::new(name).to_path_buf();
    if !path.exists() {
        let names: Vec<_> = builtin::names().iter().map(|(name, _)| *name).collect();
        return Err(Failure::new(format!("there is no file `{name}` and no built-in scene of that name"))
            .with_help(format!("the built-in scenes are {}", names.join(", "))));
    }
    let limits = Limits { detail_level, ..Limits::default() };
    let loaded = console::with_progress("loading", move |_| Ok(load(&path, &limits)?))?;
    Ok(Source { edits: loaded.edits, timeline: loaded.timeline, diagnostics: loaded.diagnostics })
}

/// Writes what the loader has to say to stderr.
pub(super) fn show(diagnostics: &[Diagnostic]) {
    for diagnostic in diagnostics.iter().filter(|d| d.severity >= Severity::Warning) {
        console::message(&diagnostic.to_string());
    }
    let notes = diagnostics.iter().filter(|d| d.severity < Severity::Warning).count();
    if notes > 0 {
        console::message(&format!("note: {notes} further remarks on the file; `heliostat info` shows them"));
    }
}

/// Reads a picture.
///
/// # Errors
/// When the file cannot be read or decoded.
pub(super) fn picture(path: &Path) -> Result<Image, Failure> {
    Ok(image::load(path, &Limits::default())?)
}
