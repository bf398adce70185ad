//! Alias-free texture lookup: mip pyramids with trilinear interpolation.
//!
//! # References
//! Williams, "Pyramidal Parametrics", 1983.

use std::sync::Arc;

use glam::{Vec2, Vec4};
use heliostat_scene::{ColorSpace, Image, Pixels, Texture, Wrap};

use crate::color::{SRGB8, srgb_encode};

/// A texture with its mip pyramid. Level 0 shares the image's memory.
#[derive(Clone, Debug)]
pub struct MipMap {
    base: Arc<Image>,
    /// Levels 1 and up, each half the size (rounded down), to 1×1.
    levels: Vec<Image>,
    decode: ColorSpace,
    wrap: [Wrap; 2],
    nearest: bool,
}

impl MipMap {
    /// Builds the pyramid by area averages of linear values.
    pub fn new(texture: &Texture) -> Self {
        let mut map = Self {
            base: texture.image.clone(),
            levels: Vec::new(),
            decode: texture.color_space,
            wrap: texture.wrap,
            nearest: texture.nearest,
        };
        loop {
            let finest = map.levels.last().unwrap_or(&map.base);
            if finest.width == 1 && finest.height == 1 {
                return map;
            }
            let next = halved(finest, map.decode);
            map.levels.push(next);
        }
    }

    /// Width and height of level 0 in texels.
    pub fn size(&self) -> Vec2 {
        Vec2::new(self.base.width as f32, self.base.height as f32)
    }

    /// Linear RGBA at texture coordinates, filtered over a square footprint of 2^`lod` texels of level 0.
    /// Coordinates that are not finite read as (0, 0).
    pub fn lookup(&self, uv: Vec2, lod: f32) -> Vec4 {
        let uv = if uv.is_finite() { uv } else { Vec2::ZERO };
        let coarsest = self.levels.len() as f32;
        let lod = if lod > 0.0 { lod.min(coarsest) } else { 0.0 };
        if lod == 0.0 {
            return if self.nearest { self.point(uv) } else { self.bilinear(0, uv) };
        }
        let level = (lod as usize).min(self.levels.len().saturating_sub(1));
        let fine = self.bilinear(level, uv);
        let blend = lod - level as f32;
        if blend == 0.0 { fine } else { fine.lerp(self.bilinear(level + 1, uv), blend) }
    }

    /// Mean over the whole image.
    pub fn mean(&self) -> Vec4 {
        self.lookup(Vec2::ZERO, f32::INFINITY)
    }

    fn level(&self, level: usize) -> &Image {
        if level == 0 { &self.base } else { &self.levels[(level - 1).min(self.levels.len() - 1)] }
    }

    fn point(&self, uv: Vec2) -> Vec4 {
        let (x, _) = floor(uv.x * self.base.width as f32);
        let (y, _) = floor(uv.y * self.base.height as f32);
        let x = wrapped(x, self.base.width, self.wrap[0]);
        texel(&self.base, x, wrapped(y, self.base.height, self.wrap[1]), self.decode)
    }

    fn bilinear(&self, level: usize, uv: Vec2) -> Vec4 {
        let image = self.level(level);
        let (x, fx) = floor(uv.x * image.width as f32 - 0.5);
        let (y, fy) = floor(uv.y * image.height as f32 - 0.5);
        let columns = [x, x + 1].map(|x| wrapped(x, image.width, self.wrap[0]));
        let rows = [y, y + 1].map(|y| wrapped(y, image.height, self.wrap[1]));
        let at = |row: usize, column: usize| texel(image, columns[column], rows[row], self.decode);
        at(0, 0).lerp(at(0, 1), fx).lerp(at(1, 0).lerp(at(1, 1), fx), fy)
    }
}

/// Whole and fractional part of a texel coordinate. Spelt out because the library's `floor` is a call where the
/// instruction is not part of the baseline.
fn floor(x: f32) -> (i32, f32) {
    // Beyond this there are no fractions; the bound keeps the neighbour's index from overflowing.
    let x = x.clamp(-1e9, 1e9);
    let truncated = x as i32;
    let whole = truncated - i32::from(x < truncated as f32);
    (whole, x - whole as f32)
}

/// Index of a texel after wrapping.
fn wrapped(at: i32, size: u32, wrap: Wrap) -> u32 {
    // The scene limits sides to `Image::MAX_SIDE`, so nothing here overflows.
    let n = size as i32;
    let inside = match wrap {
        _ if (0..n).contains(&at) => at,
        Wrap::Repeat => at.rem_euclid(n),
        Wrap::Mirror => {
            let period = at.rem_euclid(2 * n);
            period.min(2 * n - 1 - period)
        }
        Wrap::Clamp => at.clamp(0, n - 1),
    };
    inside as u32
}

/// Linear RGBA of one texel inside the image.
pub(crate) fn texel(image: &Image, x: u32, y: u32, decode: ColorSpace) -> Vec4 {
    let i = (y as usize * image.width as usize + x as usize) * 4;
    match &image.pixels {
        Pixels::RgbaF32(p) => Vec4::from_slice(&p[i..i + 4]),
        Pixels::Rgba8(p) => {
            let [r, g, b, a] = [p[i], p[i + 1], p[i + 2], p[i + 3]];
            let unit = |code: u8| f32::from(code) * (1.0 / 255.0);
            match decode {
                ColorSpace::Srgb => {
                    let curve = &*SRGB8;
                    Vec4::new(curve[r as usize], curve[g as usize], curve[b as usize], unit(a))
                }
                ColorSpace::Linear => Vec4::new(unit(r), unit(g), unit(b), unit(a)),
            }
        }
    }
}

/// The next coarser level: every texel is the area average of the finer ones it covers, fractions included.
fn halved(image: &Image, decode: ColorSpace) -> Image {
    let (width, height) = ((image.width / 2).max(1), (image.height / 2).max(1));
    let (columns, rows) = (coverage(image.width, width), coverage(image.height, height));
    let mut values = Vec::with_capacity(width as usize * height as usize);
    for row in &rows {
        for column in &columns {
            let mut sum = Vec4::ZERO;
            for &(y, wy) in row {
                for &(x, wx) in column {
                    sum += wx * wy * texel(image, x, y, decode);
                }
            }
            values.push(sum);
        }
    }
    let pixels = match image.pixels {
        Pixels::RgbaF32(_) => Pixels::RgbaF32(values.iter().flat_map(|v| v.to_array()).collect()),
        Pixels::Rgba8(_) => Pixels::Rgba8(values.iter().flat_map(|v| encoded(*v, decode)).collect()),
    };
    Image { width, height, pixels }
}

fn encoded(v: Vec4, color_space: ColorSpace) -> [u8; 4] {
    let code = |x: f32| (x * 255.0).round() as u8;
    match color_space {
        ColorSpace::Linear => v.to_array().map(code),
        ColorSpace::Srgb => {
            [code(srgb_encode(v.x)), code(srgb_encode(v.y)), code(srgb_encode(v.z)), code(v.w)]
        }
    }
}

/// For each of `coarse` intervals, the `fine` ones it covers with weights that sum to one.
fn coverage(fine: u32, coarse: u32) -> Vec<Vec<(u32, f32)>> {
    let ratio = fine as f32 / coarse as f32;
    let interval = |i: u32| {
        let (start, end) = (i as f32 * ratio, ((i + 1) as f32 * ratio).min(fine as f32));
        let first = start as u32;
        let last = (end.ceil() as u32).min(fine);
        let weight = move |j: u32| ((end.min((j + 1) as f32) - start.max(j as f32)) / ratio).max(0.0);
        (first..last).map(|j| (j, weight(j))).collect()
    };
    (0..coarse).map(interval).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texture(width: u32, height: u32, value: impl Fn(u32, u32) -> f32) -> Texture {
        let pixels = (0..width * height).flat_map(|i| [value(i % width, i / width); 4]).collect();
        Texture::new("test", Arc::new(Image::rgba_f32(width, height, pixels)), ColorSpace::Linear)
    }

    #[test]
    fn every_level_keeps_the_mean() {
        for (width, height) in [(8, 8), (5, 3), (1, 7), (1, 1), (13, 64)] {
            let map = MipMap::new(&texture(width, height, |x, y| (x * 7 + y * 3) as f32));
            let n = (width * height) as f32;
            let mean = (0..width * height).map(|i| (i % width * 7 + i / width * 3) as f32).sum::<f32>() / n;
            assert!(
                (map.mean().x - mean).abs() < 1e-3 * mean.max(1.0),
                "{width}×{height}: {} {mean}",
                map.mean().x
            );
        }
    }

    #[test]
    fn checkerboard_turns_grey_when_minified_and_stays_when_magnified() {
        let map = MipMap::new(&texture(64, 64, |x, y| ((x + y) % 2) as f32));
        assert!((map.lookup(Vec2::new(0.3, 0.7), 1.0).x - 0.5).abs() < 1e-6);
        assert_eq!(map.lookup(Vec2::new(0.5 / 64.0, 0.5 / 64.0), 0.0).x, 0.0);
        assert_eq!(map.lookup(Vec2::new(1.5 / 64.0, 0.5 / 64.0), -3.0).x, 1.0);
    }

    #[test]
    fn srgb_is_averaged_in_linear_light() {
        let image = Image::rgba8(2, 1, vec![0, 0, 0, 255, 255, 255, 255, 255]);
        let map = MipMap::new(&Texture::new("bw", Arc::new(image), ColorSpace::Srgb));
        assert!((map.mean().x - 0.5).abs() < 0.005, "half of the light, not code 128: {}", map.mean());
        assert_eq!(map.mean().w, 1.0);
    }

    #[test]
    fn wrap_modes() {
        let at = |u: f32, wrap: Wrap| {
            let mut t = texture(4, 1, |x, _| x as f32);
            t.wrap = [wrap; 2];
            t.nearest = true;
            MipMap::new(&t).lookup(Vec2::new(u, 0.0), 0.0).x
        };
        assert_eq!(at(1.125, Wrap::Repeat), 0.0);
        assert_eq!(at(-0.125, Wrap::Repeat), 3.0);
        assert_eq!(at(1.125, Wrap::Mirror), 3.0);
        assert_eq!(at(-0.125, Wrap::Mirror), 0.0);
        assert_eq!(at(1.125, Wrap::Clamp), 3.0);
        assert_eq!(at(-9.0, Wrap::Clamp), 0.0);
        assert_eq!(at(f32::NAN, Wrap::Repeat), 0.0);
        assert!((0.0..4.0).contains(&at(1e30, Wrap::Repeat)));
    }
}
