//! Writes pictures: whole files or none, in the format that the name asks for.

use std::path::{Path, PathBuf};

use glam::Vec3;
use heliostat::engine::tone;
use heliostat::formats::image::{EncodeError, encode_exr, encode_hdr, encode_png};
use heliostat::scene::{Frame, Plane, PlaneData};
use heliostat::shading::pixel::BoundPixelShader;

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
            let colors = visible(plane);
            let bytes = match self.format {
                Format::Hdr => encode_hdr(width, height, &colors)?,
                _ => encode_png(width, height, &srgb8(&colors, plane.plane))?,
            };
            write(&path, &bytes)?;
            files.push(path);
        }
        Ok(files)
    }
}

/// A plane as colours from 0 to 1: depth and position over their range, normals as 0.5 + 0.5 n, identifiers as
/// distinct colours, the rest as it is.
fn visible(plane: &PlaneData) -> Vec<Vec3> {
    let finite = || plane.values.iter().copied().filter(|v| v.is_finite());
    let (low, high) = (finite().fold(f32::INFINITY, f32::min), finite().fold(f32::NEG_INFINITY, f32::max));
    let over_range = |v: f32| if high > low { (v - low) / (high - low) } else { 0.0 };
    let grey = |map: &dyn Fn(f32) -> f32| plane.values.iter().map(|&v| Vec3::splat(map(v))).collect();
    let triples = |map: &dyn Fn(f32) -> f32| {
        plane.values.chunks_exact(3).map(|v| Vec3::new(map(v[0]), map(v[1]), map(v[2]))).collect()
    };
    match plane.plane {
        // Near is bright; what is hit nowhere stays black.
        Plane::Depth => grey(&|v| if v > 0.0 { 1.0 - 0.9 * v / high } else { 0.0 }),
        Plane::Normal => triples(&|v| 0.5 + 0.5 * v),
        Plane::Position => triples(&over_range),
        Plane::Albedo => triples(&|v| v),
        Plane::Alpha => grey(&|v| v),
        Plane::ObjectId | Plane::InstanceId | Plane::MaterialId => {
            plane.values.iter().map(|&id| identity_color(id as u32)).collect()
        }
    }
}

/// Hues a golden angle apart; 0 is black.
fn identity_color(id: u32) -> Vec3 {
    if id == 0 {
        return Vec3::ZERO;
    }
    let hue = (id as f32 * 0.618_034).fract() * 6.0;
    let channel = |offset: f32| (((hue + offset).rem_euclid(6.0) - 3.0).abs() - 1.0).clamp(0.0, 1.0);
    let value = 0.55 + 0.45 * (id as f32 * 0.754_877).fract();
    value * (Vec3::splat(0.25) + 0.75 * Vec3::new(channel(0.0), channel(4.0), channel(2.0)))
}

/// Albedo is a colour and gets the sRGB curve; everything else is data and is stored as it is.
fn srgb8(colors: &[Vec3], plane: Plane) -> Vec<u8> {
    let curve = |l: f32| if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
    let encode = |v: f32| if plane == Plane::Albedo { curve(v.clamp(0.0, 1.0)) } else { v.clamp(0.0, 1.0) };
    colors.iter().flat_map(|c| c.to_array().map(|v| (encode(v) * 255.0 + 0.5) as u8)).collect()
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
fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
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
