//! Images as data, and how they are sampled.

use std::sync::Arc;

/// Pixels in rows from the top left corner.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Four channels (RGBA) per pixel, `width × height × 4` values, alpha not premultiplied.
    pub pixels: Pixels,
}

/// The values of an [`Image`].
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// 8 bits per channel; the [`ColorSpace`] of the texture says how RGB is encoded.
    Rgba8(Vec<u8>),
    /// Linear values.
    RgbaF32(Vec<f32>),
}

impl Image {
    /// Most pixels along either side: texel coordinates stay exact in single precision.
    pub const MAX_SIDE: u32 = 1 << 24;

    /// Most pixels in all: 32 bits number them together with their mip levels.
    pub const MAX_AREA: u64 = 1 << 31;

    /// An 8-bit RGBA image.
    pub fn rgba8(width: u32, height: u32, pixels: Vec<u8>) -> Self {
        Self { width, height, pixels: Pixels::Rgba8(pixels) }
    }

    /// A linear float RGBA image.
    pub fn rgba_f32(width: u32, height: u32, pixels: Vec<f32>) -> Self {
        Self { width, height, pixels: Pixels::RgbaF32(pixels) }
    }

    /// The picture shown where a texture could not be read: an 8×8 magenta and black checkerboard.
    pub fn placeholder() -> Self {
        let pixel =
            |i: u32| if (i % 8 + i / 8).is_multiple_of(2) { [255, 0, 255, 255] } else { [0, 0, 0, 255] };
        Self::rgba8(8, 8, (0..64).flat_map(pixel).collect())
    }

    /// What is wrong with the size, if anything.
    pub(crate) fn inconsistency(&self) -> Option<String> {
        let expected = u64::from(self.width) * u64::from(self.height) * 4;
        let len = match &self.pixels {
            Pixels::Rgba8(p) => p.len(),
            Pixels::RgbaF32(p) => p.len(),
        } as u64;
        if expected == 0 {
            return Some(format!("the image is {}×{}; give it at least one pixel", self.width, self.height));
        }
        if self.width.max(self.height) > Self::MAX_SIDE {
            let (width, height, limit) = (self.width, self.height, Self::MAX_SIDE);
            return Some(format!("the image is {width}×{height}; the limit for either side is {limit}"));
        }
        if expected / 4 > Self::MAX_AREA {
            let (width, height, limit) = (self.width, self.height, Self::MAX_AREA);
            return Some(format!("the image is {width}×{height}; the limit is {limit} pixels in all"));
        }
        (len != expected).then(|| {
            format!(
                "{len} channel values for {}×{} RGBA pixels, expected {expected}",
                self.width, self.height
            )
        })
    }
}

/// An image with its colour space and wrap modes. Lookups interpolate and are filtered over the footprint.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// For people; need not be unique.
    pub name: String,
    /// Shared: two textures may sample one image differently.
    pub image: Arc<Image>,
    /// How 8-bit RGB is encoded. Alpha and float images are always linear.
    pub color_space: ColorSpace,
    /// What lies outside 0 ≤ u < 1 and 0 ≤ v < 1.
    pub wrap: [Wrap; 2],
    /// Show texels as squares when magnified instead of interpolating.
    pub nearest: bool,
}

impl Texture {
    /// A repeating, interpolated texture.
    pub fn new(name: impl Into<String>, image: Arc<Image>, color_space: ColorSpace) -> Self {
        Self { name: name.into(), image, color_space, wrap: [Wrap::Repeat; 2], nearest: false }
    }
}

/// Encoding of 8-bit RGB values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorSpace {
    /// IEC 61966-2-1 transfer curve: colours.
    Srgb,
    /// No curve: normals, roughness and other data.
    Linear,
}

/// Texture coordinates outside the unit interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The image repeats.
    Repeat,
    /// The image repeats, every second time mirrored.
    Mirror,
    /// The border texel continues.
    Clamp,
}
