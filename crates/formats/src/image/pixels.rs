//! Small operations on pixels that importers need.

use heliostat_scene::{Image, Pixels};

/// Bytes of an image's pixels.
pub(crate) fn byte_len(image: &Image) -> u64 {
    match &image.pixels {
        Pixels::Rgba8(values) => values.len() as u64,
        Pixels::RgbaF32(values) => values.len() as u64 * 4,
    }
}

/// The pixels in 8 bits; float values are clamped to [0, 1].
pub(crate) fn to_rgba8(image: &Image) -> Vec<[u8; 4]> {
    match &image.pixels {
        Pixels::Rgba8(values) => values.as_chunks().0.to_vec(),
        Pixels::RgbaF32(values) => {
            let quantise = |v: f32| (v.clamp(0.0, 1.0) * 255.0).round() as u8;
            values.as_chunks::<4>().0.iter().map(|p| p.map(quantise)).collect()
        }
    }
}

/// The transfer curve of IEC 61966-2-1, from encoded to linear.
pub(crate) fn srgb_to_linear(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// The value at the same relative position in an image of another size: no interpolation.
fn resample<'p>(
    source: &'p [[u8; 4]],
    [source_width, source_height]: [u32; 2],
    [width, height]: [u32; 2],
) -> impl Iterator<Item = [u8; 4]> + 'p {
    let at = |i: u32, from: u32, to: u32| u64::from(i) * u64::from(from) / u64::from(to);
    (0..height).flat_map(move |y| {
        let row = at(y, source_height, height) * u64::from(source_width);
        (0..width).map(move |x| source[(row + at(x, source_width, width)) as usize])
    })
}

/// Brightness of a pixel as data: the mean of its colours.
fn grey(pixel: [u8; 4]) -> u8 {
    ((u16::from(pixel[0]) + u16::from(pixel[1]) + u16::from(pixel[2])) / 3) as u8
}

/// `base` with the brightness of the `(lane, image)` pairs in its lanes (0 red … 3 alpha).
pub(crate) fn with_lanes(base: &Image, lanes: &[(usize, &Image)]) -> Image {
    let mut pixels = to_rgba8(base);
    for (lane, image) in lanes {
        let source = to_rgba8(image);
        let values = resample(&source, [image.width, image.height], [base.width, base.height]);
        // A mask may be a picture with transparency instead of a grey one.
        let has_alpha = *lane == 3 && source.iter().any(|p| p[3] != 255);
        for (pixel, value) in pixels.iter_mut().zip(values) {
            pixel[*lane] = if has_alpha { value[3] } else { grey(value) };
        }
    }
    Image::rgba8(base.width, base.height, pixels.into_flattened())
}

/// A white image of the size of `like`.
pub(crate) fn white_like(like: &Image) -> Image {
    Image::rgba8(like.width, like.height, vec![255; like.width as usize * like.height as usize * 4])
}

/// Whether all colours are grey: then a `bump` map holds heights, otherwise normals.
pub(crate) fn is_grey(image: &Image) -> bool {
    to_rgba8(image).iter().all(|p| p[0] == p[1] && p[1] == p[2])
}

/// Height of a bump map's white over its black, as a share of the texture's width. Files do not state it.
const BUMP_DEPTH: f32 = 1.0 / 64.0;

/// Tangent-space normals (+Y towards the top of the image) of a repeating height field; `strength` scales heights.
///
/// # References
/// Blinn, "Simulation of Wrinkled Surfaces", 1978.
pub(crate) fn normals_from_heights(image: &Image, strength: f32) -> Image {
    let pixels = to_rgba8(image);
    let (width, height) = (image.width as usize, image.height as usize);
    let at = |x: usize, y: usize| f32::from(pixels[(y % height) * width + x % width][0]) / 255.0;
    let scale = strength * BUMP_DEPTH * 0.5 * width as f32;
    let encode = |v: f32| ((0.5 + 0.5 * v) * 255.0).round() as u8;
    let mut normals = Vec::with_capacity(pixels.len());
    for y in 0..height {
        for x in 0..width {
            let right = at(x + 1, y) - at(x + width - 1, y);
            let up = at(x, y + height - 1) - at(x, y + 1);
            let normal = glam::Vec3::new(-right * scale, -up * scale, 1.0).normalize_or(glam::Vec3::Z);
            normals.push([encode(normal.x), encode(normal.y), encode(normal.z), 255]);
        }
    }
    Image::rgba8(image.width, image.height, normals.into_flattened())
}
