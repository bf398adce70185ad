//! Alias-free textures: mip pyramids with trilinear interpolation, several times along footprints that are long.

mod lookup;

use std::sync::Arc;

use glam::{Vec2, Vec4};
use heliostat_scene::{ColorSpace, Image, Pixels, Texture, Wrap};

use crate::color::{SRGB8, UNIT8, srgb_encode};
pub(crate) use lookup::Footprint;

/// A texture with its mip pyramid.
#[derive(Clone, Debug)]
pub struct MipMap {
    /// The image itself, then levels of half the size each (rounded down), to 1×1, with the same kind of pixels.
    levels: Vec<Arc<Image>>,
    decode: ColorSpace,
    wrap: [Wrap; 2],
    nearest: bool,
}

impl MipMap {
    /// Builds the pyramid by area averages of linear values.
    pub fn new(texture: &Texture) -> Self {
        let mut levels = vec![texture.image.clone()];
        while let Some(finest) = levels.last().filter(|finest| finest.width.max(finest.height) > 1) {
            levels.push(Arc::new(halved(finest, texture.color_space)));
        }
        Self { levels, decode: texture.color_space, wrap: texture.wrap, nearest: texture.nearest }
    }

    /// Width and height of level 0 in texels.
    pub fn size(&self) -> Vec2 {
        let base = &self.levels[0];
        Vec2::new(base.width as f32, base.height as f32)
    }

    /// Mean over the whole image.
    pub fn mean(&self) -> Vec4 {
        texel(&self.levels[self.coarsest()], 0, 0, self.decode)
    }

    /// The level of a single texel.
    fn coarsest(&self) -> usize {
        self.levels.len() - 1
    }
}

/// Linear RGBA of one texel inside the image.
pub(crate) fn texel(image: &Image, x: u32, y: u32, decode: ColorSpace) -> Vec4 {
    let i = (y as usize * image.width as usize + x as usize) * 4;
    match &image.pixels {
        Pixels::RgbaF32(p) => Vec4::from_slice(&p[i..i + 4]),
        Pixels::Rgba8(p) => {
            let curve: &[f32; 256] = match decode {
                ColorSpace::Srgb => &SRGB8,
                ColorSpace::Linear => &UNIT8,
            };
            let color = |channel: usize| curve[p[i + channel] as usize];
            Vec4::new(color(0), color(1), color(2), UNIT8[p[i + 3] as usize])
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

    fn lookup(map: &MipMap, uv: Vec2, lod: f32) -> Vec4 {
        lookup_along(map, uv, Vec2::ZERO, 1.0, lod)
    }

    fn lookup_along(map: &MipMap, uv: Vec2, along: Vec2, probes: f32, lod: f32) -> Vec4 {
        let (uv, along) = (uv.to_array(), along.to_array());
        map.filtered::<f32>(Footprint { uv, lod, along, probes }).into()
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
        assert!((lookup(&map, Vec2::new(0.3, 0.7), 1.0).x - 0.5).abs() < 1e-6);
        assert_eq!(lookup(&map, Vec2::new(0.5 / 64.0, 0.5 / 64.0), 0.0).x, 0.0);
        assert_eq!(lookup(&map, Vec2::new(1.5 / 64.0, 0.5 / 64.0), -3.0).x, 1.0);
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
                let there = uv + along * at(j % 64, 64) + across * at(j / 64, 8);
                let [x, y] = there.to_array().map(|u| (256.0 * u.rem_euclid(1.0)) as u32 % 256);
                texel(&map.levels[0], x, y, ColorSpace::Linear)
            });
            let exact = inside.map(|texel| texel.x).sum::<f32>() / 512.0;
            // Squares side by side, and one square that is as long up to four widths, as is usual.
            let filtered = [lookup_along(&map, uv, along, 4.0, 3.0), lookup(&map, uv, 4.0)];
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
            lookup(&MipMap::new(&t), Vec2::new(u, 0.0), 0.0).x
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
