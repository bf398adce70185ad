//! Pictures: PNG, JPEG, TGA, PNM, Radiance HDR and OpenEXR in; PNG (animated, too), HDR and EXR out.

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use heliostat_scene::Image;
use image_crate::{DynamicImage, ImageDecoder, ImageError, ImageFormat, ImageReader};

use crate::error::LoadError;
use crate::limits::Limits;
use crate::place::Place;

mod animated;
mod encode;
mod exr_file;
pub(crate) mod pixels;

// The decoder library shares its name with this module.
use ::image as image_crate;

pub use animated::PngAnimation;
pub use encode::{EncodeError, encode_exr, encode_hdr, encode_png};

/// Reads a picture. The format is recognised by content; TGA, which has no signature, by the extension of `name`.
///
/// 8-bit files become [`Pixels::Rgba8`](heliostat_scene::Pixels::Rgba8) as they are: whoever uses the image knows
/// its colour space. 16-bit PNGs are rounded to 8 bits for the same reason. HDR and EXR files become
/// [`Pixels::RgbaF32`](heliostat_scene::Pixels::RgbaF32). EXR: the first layer's R, G, B, A, or its only channel as
/// grey, at the largest resolution level; deep data is unsupported.
///
/// # Errors
/// [`LoadError`] when the data is broken, too large, or in no supported format.
pub fn decode(name: &str, bytes: &[u8], limits: &Limits) -> Result<Image, LoadError> {
    decode_within(&name.into(), bytes, limits, limits.memory_bytes)
}

/// Reads a picture file; see [`decode`].
///
/// # Errors
/// [`LoadError`] also when the file cannot be read.
pub fn load(path: &Path, limits: &Limits) -> Result<Image, LoadError> {
    decode(&path.display().to_string(), &crate::source::read_named(path, limits)?, limits)
}

/// As [`decode`], using no more than `memory` bytes for the result.
pub(crate) fn decode_within(
    file: &Arc<str>,
    bytes: &[u8],
    limits: &Limits,
    memory: u64,
) -> Result<Image, LoadError> {
    let size = bytes.len() as u64;
    if size > limits.file_bytes {
        return Err(LoadError::limit(Place::whole(file), "bytes", size, "file_bytes", limits.file_bytes));
    }
    if bytes.starts_with(&[0x76, 0x2F, 0x31, 0x01]) {
        return exr_file::decode(file, bytes, limits, memory);
    }
    let format = recognise(file, bytes)?;
    let (width, height) =
        guarded(file, || reader(bytes, format, memory).into_decoder().map(|d| d.dimensions()))?
            .map_err(|error| broken(file, format, &error))?;
    check_size(file, width.into(), height.into(), limits)?;
    let bytes_per_pixel = if format == ImageFormat::Hdr { 16 } else { 4 };
    if u64::from(width) * u64::from(height) * bytes_per_pixel > memory {
        return Err(too_large(file, limits));
    }
    let decoded = guarded(file, || reader(bytes, format, memory).decode())?
        .map_err(|error| broken(file, format, &error))?;
    Ok(match decoded {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            Image::rgba_f32(width, height, decoded.into_rgba32f().into_raw())
        }
        other => Image::rgba8(width, height, other.into_rgba8().into_raw()),
    })
}

/// Runs a decoder library. Some panic on broken files (exr on overflow in B44 blocks, zune-jpeg on odd sampling
/// factors); that becomes an error here. They work on data of their own, so nothing half-done is left behind.
fn guarded<T>(file: &Arc<str>, call: impl FnOnce() -> T + std::panic::UnwindSafe) -> Result<T, LoadError> {
    std::panic::catch_unwind(call).map_err(|_| {
        let hint = "the file may be damaged; if other programs can read it, save it again from there";
        LoadError::input(Place::whole(file), "the data is broken: the decoder gave up", hint)
    })
}

fn reader(bytes: &[u8], format: ImageFormat, memory: u64) -> ImageReader<Cursor<&[u8]>> {
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = image_crate::Limits::default();
    limits.max_alloc = Some(memory);
    reader.limits(limits);
    reader
}

fn recognise(file: &Arc<str>, bytes: &[u8]) -> Result<ImageFormat, LoadError> {
    let extension = file.rsplit_once('.').map_or("", |(_, e)| e);
    Ok(match bytes {
        [0x89, b'P', b'N', b'G', ..] => ImageFormat::Png,
        [0xFF, 0xD8, 0xFF, ..] => ImageFormat::Jpeg,
        [b'#', b'?', ..] => ImageFormat::Hdr,
        [b'P', b'1'..=b'7', space, ..] if space.is_ascii_whitespace() => ImageFormat::Pnm,
        _ if extension.eq_ignore_ascii_case("tga") => ImageFormat::Tga,
        _ => {
            let problem =
                if bytes.is_empty() { "the file is empty" } else { "this is no known image format" };
            let hint = "convert the image to PNG, JPEG, TGA, PPM, HDR or EXR";
            return Err(LoadError::unsupported(Place::whole(file), problem, hint));
        }
    })
}

/// Refuses images that are empty or have too many pixels.
pub(crate) fn check_size(file: &Arc<str>, width: u64, height: u64, limits: &Limits) -> Result<(), LoadError> {
    let pixels = width.saturating_mul(height);
    if pixels == 0 {
        let problem = format!("the image has {width}×{height} pixels");
        return Err(LoadError::input(Place::whole(file), problem, "give it at least one pixel"));
    }
    if pixels > limits.image_pixels {
        return Err(LoadError::limit(
            Place::whole(file),
            "pixels",
            pixels,
            "image_pixels",
            limits.image_pixels,
        ));
    }
    Ok(())
}

pub(crate) fn too_large(file: &Arc<str>, limits: &Limits) -> LoadError {
    let limit = limits.memory_bytes;
    LoadError::limit(
        Place::whole(file),
        "or more bytes decoded with this image",
        limit,
        "memory_bytes",
        limit,
    )
}

fn broken(file: &Arc<str>, format: ImageFormat, error: &ImageError) -> LoadError {
    let kind = format.extensions_str().first().copied().unwrap_or("image").to_uppercase();
    let place = Place::whole(file);
    match error {
        ImageError::Limits(_) => {
            let hint =
                "this is `Limits::memory_bytes` of the importer; a program that trusts the file may raise it";
            LoadError::limit_text(place, format!("the {kind} image is too large: {error}"), hint)
        }
        ImageError::Unsupported(_) => {
            LoadError::unsupported(place, format!("{error}"), "convert the image to an ordinary PNG or JPEG")
        }
        _ => LoadError::input(
            place,
            format!("the {kind} data is broken: {error}"),
            "the file may be truncated",
        ),
    }
}

#[cfg(test)]
mod tests;
