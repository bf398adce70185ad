//! Pictures to bytes. Writing them to a file is the caller's matter.

use std::io::Cursor;

use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec,
    WritableImage,
};
use glam::Vec3;
use heliostat_scene::{Plane, PlaneData};
use image_crate::codecs::{hdr::HdrEncoder, png::PngEncoder};
use image_crate::{ExtendedColorType, ImageEncoder, Rgb};

use super::image_crate;

/// Why a picture could not be encoded: the caller's data contradicts itself.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// An array has the wrong length.
    #[error("{what} has {len} values for {width}×{height} pixels, expected {expected}")]
    Size {
        /// Which array.
        what: String,
        /// Its length.
        len: usize,
        /// Pixels per row.
        width: u32,
        /// Rows.
        height: u32,
        /// The right length.
        expected: usize,
    },
    /// The format cannot hold such a picture.
    #[error("the picture cannot be encoded: {0}")]
    Format(String),
}

/// An 8-bit RGB PNG of sRGB values, rows from the top.
///
/// # Errors
/// [`EncodeError`] when `rgb` is not `width × height × 3` long or the picture is empty.
pub fn encode_png(width: u32, height: u32, rgb: &[u8]) -> Result<Vec<u8>, EncodeError> {
    check("the picture", rgb.len(), width, height, 3)?;
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(rgb, width, height, ExtendedColorType::Rgb8)
        .map_err(|error| EncodeError::Format(error.to_string()))?;
    Ok(bytes)
}

/// A Radiance picture (shared exponent, about 1 % precision) of linear values, rows from the top. Negative values
/// become 0.
///
/// # Errors
/// [`EncodeError`] when `color` is not `width × height` long or the picture is empty.
pub fn encode_hdr(width: u32, height: u32, color: &[Vec3]) -> Result<Vec<u8>, EncodeError> {
    check("the picture", color.len(), width, height, 1)?;
    let pixels: Vec<Rgb<f32>> = color.iter().map(|c| Rgb(c.max(Vec3::ZERO).to_array())).collect();
    let mut bytes = Vec::new();
    HdrEncoder::new(&mut bytes)
        .encode(&pixels, width as usize, height as usize)
        .map_err(|error| EncodeError::Format(error.to_string()))?;
    Ok(bytes)
}

/// An OpenEXR file of linear values in 32-bit floats with lossless ZIP compression, rows from the top: channels
/// R, G, B, then each plane's channels as `name.component`, for example `depth.Z` and `normal.X`.
///
/// # Errors
/// [`EncodeError`] when an array has the wrong length or the picture is empty.
pub fn encode_exr(
    width: u32,
    height: u32,
    color: &[Vec3],
    planes: &[PlaneData],
) -> Result<Vec<u8>, EncodeError> {
    check("the picture", color.len(), width, height, 1)?;
    let mut channels: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
    for (lane, name) in ["R", "G", "B"].into_iter().enumerate() {
        channels.push(AnyChannel::new(name, FlatSamples::F32(color.iter().map(|c| c[lane]).collect())));
    }
    for plane in planes {
        let components = components(plane.plane);
        check(plane.plane.name(), plane.values.len(), width, height, components.len())?;
        for (lane, component) in components.iter().enumerate() {
            let name = format!("{}.{component}", plane.plane.name());
            let values = plane.values.iter().skip(lane).step_by(components.len()).copied().collect();
            channels.push(AnyChannel::new(name.as_str(), FlatSamples::F32(values)));
        }
    }
    let encoding = Encoding { compression: Compression::ZIP16, ..Encoding::default() };
    let size = (width as usize, height as usize);
    let layer = Layer::new(size, LayerAttributes::default(), encoding, AnyChannels::sort(channels));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(|error| EncodeError::Format(error.to_string()))?;
    Ok(bytes.into_inner())
}

/// The component names of a plane, as OpenEXR's conventions have them.
fn components(plane: Plane) -> &'static [&'static str] {
    match plane {
        Plane::Depth => &["Z"],
        Plane::Normal | Plane::Position => &["X", "Y", "Z"],
        Plane::Albedo => &["R", "G", "B"],
        Plane::Alpha => &["A"],
        Plane::ObjectId | Plane::InstanceId | Plane::MaterialId => &["id"],
        Plane::Nodes | Plane::Triangles | Plane::Cost => &["count"],
    }
}

pub(super) fn check(
    what: &str,
    len: usize,
    width: u32,
    height: u32,
    channels: usize,
) -> Result<(), EncodeError> {
    let expected = (width as usize).saturating_mul(height as usize).saturating_mul(channels);
    if expected == 0 {
        return Err(EncodeError::Format(format!("it has {width}×{height} pixels; give it at least one")));
    }
    if len == expected {
        return Ok(());
    }
    Err(EncodeError::Size { what: what.into(), len, width, height, expected })
}
