//! Alias-free texture lookup: mip pyramids with trilinear interpolation, several times along footprints that are long.
//!
//! # References
//! Williams, "Pyramidal Parametrics", 1983. McCormack, Perry, Farkas, Jouppi, "Feline: Fast Elliptical Lines for Anisotropic
//! Texture Mapping", 1999, section 4 (probes along the longer axis).

use std::sync::Arc;

use glam::{Vec2, Vec4};
use heliostat_scene::{ColorSpace, Image, Pixels, Texture, Wrap};

use crate::color::{SRGB8, UNIT, UNIT8, srgb_encode};

/// A texture with its mip pyramid. Level 0 shares the image's memory.
#[derive(Clone, Debug)]
pub struct MipMap {
    base: Arc<Image>,
    /// Levels 1 and up, each half the size (rounded down), to 1×1.
    levels: Vec<Image>,
    decode: ColorSpace,
    /// What 8-bit codes of colours stand for.
    curve: &'static [f32; 256],
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
            curve: curve(texture.color_space),
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
        let uv = Vec2::new(folded(uv.x, self.wrap[0]), folded(uv.y, self.wrap[1]));
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

    /// The mean of `probes` lookups, each of a square of 2^`lod` texels, evenly along a footprint that is `along` long.
    pub fn lookup_along(&self, uv: Vec2, along: Vec2, probes: u32, lod: f32) -> Vec4 {
        if probes <= 1 {
            return self.lookup(uv, lod);
        }
        let step = 1.0 / probes as f32;
        let mut sum = Vec4::ZERO;
        for probe in 0..probes {
            // Each reads one level; together they blend the two around `lod`.
            let share = (probe as f32 + 0.5) * step;
            let level = floor(lod + share).0 as f32;
            sum += self.lookup(uv + along * (share - 0.5), level);
        }
        sum * step
    }

    /// Mean over the whole image.
    pub fn mean(&self) -> Vec4 {
        self.lookup(Vec2::ZERO, f32::INFINITY)
    }

    fn level(&self, level: usize) -> &Image {
        if level == 0 { &self.base } else { &self.levels[(level - 1).min(self.levels.len() - 1)] }
    }

    /// The texel at coordinates that are folded.
    fn point(&self, uv: Vec2) -> Vec4 {
        let (width, height) = (self.base.width, self.base.height);
        let x = neighbour(floor(uv.x * width as f32).0, width, self.wrap[0]);
        let y = neighbour(floor(uv.y * height as f32).0, height, self.wrap[1]);
        texel(&self.base, x as u32, y as u32, self.decode)
    }

    /// A mean of four texels around coordinates that are folded.
    fn bilinear(&self, level: usize, uv: Vec2) -> Vec4 {
        let image = self.level(level);
        let (width, height) = (image.width, image.height);
        let (x, fx) = floor(uv.x * width as f32 - 0.5);
        let (y, fy) = floor(uv.y * height as f32 - 0.5);
        let (left, right) = (neighbour(x, width, self.wrap[0]), neighbour(x + 1, width, self.wrap[0]));
        let (above, below) = (neighbour(y, height, self.wrap[1]), neighbour(y + 1, height, self.wrap[1]));
        let (above, below) = (above * width as usize, below * width as usize);
        // Spelt out, since these are the most frequent reads of all.
        let (a, b, c, d) = match &image.pixels {
            Pixels::Rgba8(p) => {
                let (p, curve) = (p.as_chunks::<4>().0, self.curve);
                let (a, b) = (decoded(p[above + left], curve), decoded(p[above + right], curve));
                (a, b, decoded(p[below + left], curve), decoded(p[below + right], curve))
            }
            Pixels::RgbaF32(p) => {
                let p = p.as_chunks::<4>().0;
                let (a, b) = (Vec4::from_array(p[above + left]), Vec4::from_array(p[above + right]));
                (a, b, Vec4::from_array(p[below + left]), Vec4::from_array(p[below + right]))
            }
        };
        a.lerp(b, fx).lerp(c.lerp(d, fx), fy)
    }
}

/// What 8-bit codes of colours stand for.
fn curve(decode: ColorSpace) -> &'static [f32; 256] {
    match decode {
        ColorSpace::Srgb => &SRGB8,
        ColorSpace::Linear => &UNIT8,
    }
}

/// Linear RGBA of four bytes.
#[inline(always)]
fn decoded([r, g, b, a]: [u8; 4], curve: &[f32; 256]) -> Vec4 {
    Vec4::new(curve[r as usize], curve[g as usize], curve[b as usize], UNIT * f32::from(a))
}

/// Whole and fractional part of a texel coordinate. Spelt out because the library's `floor` is a call where the
/// instruction is not part of the baseline.
#[inline(always)]
fn floor(x: f32) -> (i32, f32) {
    // Beyond this there are no fractions; the bound keeps the neighbour's index from overflowing.
    let x = x.clamp(-1e9, 1e9);
    let truncated = x as i32;
    let whole = truncated - i32::from(x < truncated as f32);
    (whole, x - whole as f32)
}

/// A texture coordinate brought into [0, 1], where the picture is.
#[inline(always)]
fn folded(u: f32, wrap: Wrap) -> f32 {
    match wrap {
        Wrap::Repeat => floor(u).1,
        // Every second time backwards.
        Wrap::Mirror => 1.0 - (2.0 * floor(0.5 * u).1 - 1.0).abs(),
        Wrap::Clamp => u.clamp(0.0, 1.0),
    }
}

/// Index of a texel inside the image, or next to it before wrapping.
#[inline(always)]
fn neighbour(at: i32, size: u32, wrap: Wrap) -> usize {
    // The scene limits sides to `Image::MAX_SIDE`, so nothing here overflows.
    let last = size as i32 - 1;
    let inside = match wrap {
        _ if (0..=last).contains(&at) => at,
        Wrap::Repeat if at < 0 => last,
        Wrap::Repeat => 0,
        Wrap::Mirror | Wrap::Clamp => at.clamp(0, last),
    };
    inside as usize
}

/// Linear RGBA of one texel inside the image.
pub(crate) fn texel(image: &Image, x: u32, y: u32, decode: ColorSpace) -> Vec4 {
    let i = (y as usize * image.width as usize + x as usize) * 4;
    match &image.pixels {
        Pixels::RgbaF32(p) => Vec4::from_slice(&p[i..i + 4]),
        Pixels::Rgba8(p) => decoded([p[i], p[i + 1], p[i + 2], p[i + 3]], curve(decode)),
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
    fn long_footprints_stay_sharp() {
        // A checkerboard of 16 texels a square, looked at through footprints that are 4 texels wide and 32 long.
        let map = MipMap::new(&texture(256, 256, |x, y| ((x / 16 + y / 16) % 2) as f32));
        let mut errors = [0.0_f64; 2];
        for i in 0..500_u32 {
            let [x, y, turn] = [0.618_034, 0.754_878, 0.569_84].map(|step| (i as f32 * step).fract());
            let (uv, axis) = (Vec2::new(x, y), Vec2::from_angle(std::f32::consts::TAU * turn));
            let (along, across) = (axis * (32.0 / 256.0), axis.perp() * (4.0 / 256.0));
            let inside = (0..64 * 8).map(|j| {
                let at = |k: u32, n: u32| (k as f32 + 0.5) / n as f32 - 0.5;
                map.point(Vec2::from_array(
                    (uv + along * at(j % 64, 64) + across * at(j / 64, 8))
                        .to_array()
                        .map(|u| u.rem_euclid(1.0)),
                ))
            });
            let exact = inside.map(|texel| texel.x).sum::<f32>() / 512.0;
            // Squares side by side, and one square that is as long up to four widths, as is usual.
            let filtered = [map.lookup_along(uv, along, 4, 3.0), map.lookup(uv, 4.0)];
            for (error, texel) in errors.iter_mut().zip(filtered) {
                *error += f64::from((texel.x - exact).powi(2));
            }
        }
        let [row, square] = errors.map(|error| (error / 500.0).sqrt());
        assert!(row < 0.6 * square, "root mean square errors: {row} of a row, {square} of a square");
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
