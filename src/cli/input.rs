//! Reads what the command line names: scenes and pictures.

use std::path::Path;

use heliostat::builtin;
use heliostat::formats::{Diagnostic, Limits, Loaded, Severity, image, load};
use heliostat::scene::{Edit, Image, Timeline};

use super::console;
use super::failure::Failure;

/// A scene as named on the command line.
pub(super) struct Source {
    pub(super) edits: Vec<Edit>,
    pub(super) timeline: Timeline,
    pub(super) diagnostics: Vec<Diagnostic>,
}

/// What is read of a file.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
#[group(skip)]
pub(super) struct Reading {
    /// Detail of files that have levels of it (AFF): 0 is the coarsest [default: as the file says]
    #[arg(long, value_name = "N")]
    detail_level: Option<u32>,
    /// Show the light that is baked into a map (BSP) instead of its lights
    #[arg(long)]
    lightmaps: bool,
}

/// Reads a scene: a built-in one by its name, else a file, of which as much as is asked for.
///
/// # Errors
/// When there is neither, or the file cannot be loaded.
pub(super) fn scene(name: &str, reading: &Reading) -> Result<Source, Failure> {
    check(name)?;
    let (name, reading) = (name.to_owned(), *reading);
    console::with_progress("loading", move |_| read(&name, &reading))
}

/// Whether there is a scene of this name.
///
/// # Errors
/// When there is neither a built-in one nor a file.
pub(super) fn check(name: &str) -> Result<(), Failure> {
    let names: Vec<_> = builtin::names().iter().map(|(name, _)| *name).collect();
    if names.contains(&name) || Path::new(name).exists() {
        return Ok(());
    }
    Err(Failure::new(format!("there is no file `{name}` and no built-in scene of that name"))
        .with_help(format!("the built-in scenes are {}", names.join(", "))))
}

/// Reads a scene as [`scene`] does, without showing progress.
///
/// # Errors
/// When the file cannot be loaded.
pub(super) fn read(name: &str, reading: &Reading) -> Result<Source, Failure> {
    if let Some(edits) = builtin::build(name) {
        return Ok(Source { edits, timeline: builtin::timeline(name), diagnostics: Vec::new() });
    }
    let Reading { detail_level, lightmaps } = *reading;
    let limits = Limits { detail_level, lightmaps, ..Limits::default() };
    Ok(load(Path::new(name), &limits)?.into())
}

impl From<Loaded> for Source {
    fn from(Loaded { edits, timeline, diagnostics }: Loaded) -> Self {
        Self { edits, timeline, diagnostics }
    }
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
