//! Writes pictures: whole files or none, in the format that the name asks for.

use std::path::{Path, PathBuf};

use heliostat::engine::tone;
use heliostat::formats::image::{EncodeError, encode_exr, encode_hdr, encode_png};
use heliostat::scene::Frame;
use heliostat::shading::pixel::BoundPixelShader;
use heliostat_viewer::{plane_bytes, plane_colors};

use super::failure::Failure;

/// Picture formats, by extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    /// 8 bits, tone mapped.
    Png,
    /// All frames in one file, 8 bits, tone mapped.
    Apng,
    /// Linear radiance, shared exponent.
    Hdr,
    /// Linear radiance, 32-bit floats; holds auxiliary planes as further channels.
    Exr,
}

/// A file to be written, for clap: its extension must be one of the formats.
#[derive(Clone, Debug)]
pub(super) struct Target {
    pub(super) path: PathBuf,
    pub(super) format: Format,
}

impl std::str::FromStr for Target {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let path = PathBuf::from(text);
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        let format = match extension.as_deref() {
            Some("png") => Format::Png,
            Some("apng") => Format::Apng,
            Some("hdr") => Format::Hdr,
            Some("exr") => Format::Exr,
            _ => {
                return Err(format!(
                    "`{text}` is no picture format; end the name in .png, .exr, .hdr or .apng"
                ));
            }
        };
        Ok(Self { path, format })
    }
}

impl Target {
    /// Checks, before long work, that the file can be put where it should go.
    ///
    /// # Errors
    /// When the directory is missing or the name is taken by a directory.
    pub(super) fn check(&self) -> Result<(), Failure> {
        let folder = folder(&self.path);
        if !folder.is_dir() {
            return Err(Failure::new(format!("the folder `{}` does not exist", folder.display()))
                .with_help("create it, or write somewhere else"));
        }
        if self.path.is_dir() {
            return Err(Failure::new(format!("`{}` is a folder", self.path.display())));
        }
        let trial = temporary(&self.path);
        let written = std::fs::File::create_new(&trial).and_then(|_| std::fs::remove_file(&trial));
        written.map_err(|error| Failure::new(format!("`{}` cannot be written: {error}", self.path.display())))
    }

    /// `picture.png` → `picture.0007.png`.
    pub(super) fn numbered(&self, frame: u32) -> Self {
        Self { path: self.path.with_extension(format!("{frame:04}.{}", self.extension())), ..*self }
    }

    fn extension(&self) -> String {
        self.path.extension().map_or(String::new(), |e| e.to_string_lossy().into_owned())
    }

    /// Writes the frame, and its planes: into the same file for EXR, else beside it as `picture.NAME.png`. A PNG is
    /// brightened by `ev` stops and goes through the tone curve. Returns the files written.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(super) fn write(
        &self,
        frame: &Frame,
        curve: &BoundPixelShader,
        ev: f32,
    ) -> Result<Vec<PathBuf>, Failure> {
        let (width, height) = (frame.width, frame.height);
        let bytes = match self.format {
            Format::Exr => encode_exr(width, height, &frame.color, &frame.planes)?,
            Format::Hdr => encode_hdr(width, height, &frame.color)?,
            Format::Png | Format::Apng => {
                encode_png(width, height, &tone::tone_map_by(curve, &frame.color, width, ev))?
            }
        };
        write(&self.path, &bytes)?;
        let mut files = vec![self.path.clone()];
        for plane in frame.planes.iter().filter(|_| self.format != Format::Exr) {
            let path = self.path.with_extension(format!("{}.{}", plane.plane.name(), self.extension()));
            let bytes = match self.format {
                Format::Hdr => encode_hdr(width, height, &plane_colors(plane))?,
                _ => {
                    let mut rgb = Vec::new();
                    plane_bytes(plane, &mut rgb);
                    encode_png(width, height, &rgb)?
                }
            };
            write(&path, &bytes)?;
            files.push(path);
        }
        Ok(files)
    }
}

/// Where a file lies.
pub(super) fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

/// Beside the file, and so short that it fits wherever the file's own name does.
fn temporary(path: &Path) -> PathBuf {
    folder(path).join(format!(".heliostat-{}.part", std::process::id()))
}

/// Writes under a temporary name in the same folder, then renames: whoever looks sees the old file or the new one.
///
/// # Errors
/// When the file cannot be written.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let temporary = temporary(path);
    let written = std::fs::write(&temporary, bytes).and_then(|()| std::fs::rename(&temporary, path));
    written.map_err(|error| {
        // Whatever is left of it is of no use; that it may already be gone is fine.
        _ = std::fs::remove_file(&temporary);
        Failure::new(format!("`{}` cannot be written: {error}", path.display()))
    })
}

impl From<EncodeError> for Failure {
    fn from(error: EncodeError) -> Self {
        Self::new(error.to_string())
    }
}
