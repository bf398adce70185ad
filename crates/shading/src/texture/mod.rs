//! Alias-free textures: mip pyramids with trilinear interpolation, several times along footprints that are long.

mod lookup;

use glam::{Vec2, Vec4};
use heliostat_scene::{ColorSpace, Image, Pixels, Texture, Wrap};

use crate::color::{SRGB8, UNIT, UNIT8};
pub(crate) use lookup::Footprint;

/// Levels that a pyramid may have.
const MOST_LEVELS: usize = 32;
const _: () = assert!(Image::MAX_SIDE.ilog2() < MOST_LEVELS as u32);

/// A texture with its mip pyramid.
#[derive(Clone, Debug)]
pub struct MipMap {
    /// Width and height of level 0, texels.
    size: Vec2,
    coarsest: usize,
    /// Index of each level's first texel.
    starts: [u32; MOST_LEVELS],
    texels: Texels,
    mean: Vec4,
    wrap: [Wrap; 2],
    nearest: bool,
}

/// The image itself, then levels of half the size each (rounded down), to 1×1, row by row, in linear light. Every row goes on by
/// one texel and every level by one row: by what lies there, so that the four texels around a point are two pairs of neighbours.
#[derive(Clone, Debug)]
enum Texels {
    /// A byte per channel, red lowest: images of linear bytes.
    Bytes(Vec<u32>),
    /// Sixteen bits per channel, red lowest: images of sRGB bytes, whose curve would cost more than all else of a lookup. Half a
    /// step is a fortieth of the least step between codes.
    Shorts(Vec<[u32; 2]>),
    Values(Vec<[f32; 4]>),
}

/// The step between 16-bit values.
const UNIT16: f32 = 1.0 / 65_535.0;

/// Where a level lies among the texels, and its size.
#[derive(Clone, Copy, Debug)]
struct Level {
    start: usize,
    width: u32,
    height: u32,
}

impl Level {
    /// Index of a texel inside the level.
    fn index(self, x: u32, y: u32) -> usize {
        self.start + y as usize * (self.width as usize + 1) + x as usize
    }
}

impl MipMap {
    /// Builds the pyramid by area averages of linear values.
    pub fn new(texture: &Texture) -> Self {
        let Texture { image, color_space, wrap, .. } = texture;
        let mut texels = match (&image.pixels, color_space) {
            (Pixels::Rgba8(_), ColorSpace::Linear) => Texels::Bytes(Vec::new()),
            (Pixels::Rgba8(_), ColorSpace::Srgb) => Texels::Shorts(Vec::new()),
            (Pixels::RgbaF32(_), _) => Texels::Values(Vec::new()),
        };
        let (mut starts, mut coarsest) = ([0; MOST_LEVELS], 0);
        let mut level =
            texels.push(image.width, image.height, *wrap, |x, y| texel(image, x, y, *color_space));
        while level.width.max(level.height) > 1 {
            level = texels.push_halved(level, *wrap);
            coarsest += 1;
            starts[coarsest] = level.start as u32;
        }
        Self {
            size: Vec2::new(image.width as f32, image.height as f32),
            coarsest,
            starts,
            mean: texels.linear(level.start),
            texels,
            wrap: *wrap,
            nearest: texture.nearest,
        }
    }

    /// Width and height of level 0 in texels.
    pub fn size(&self) -> Vec2 {
        self.size
    }

    /// Mean over the whole image.
    pub fn mean(&self) -> Vec4 {
        self.mean
    }
}

impl Texels {
    fn len(&self) -> usize {
        match self {
            Self::Bytes(all) => all.len(),
            Self::Shorts(all) => all.len(),
            Self::Values(all) => all.len(),
        }
    }

    /// Linear RGBA of a texel.
    fn linear(&self, index: usize) -> Vec4 {
        match self {
            Self::Bytes(all) => Vec4::from_array(all[index].to_le_bytes().map(f32::from)) * UNIT,
            Self::Shorts(all) => {
                let [rg, ba] = all[index];
                Vec4::from_array([rg & 0xffff, rg >> 16, ba & 0xffff, ba >> 16].map(|code| code as f32))
                    * UNIT16
            }
            Self::Values(all) => Vec4::from_array(all[index]),
        }
    }

    /// Appends a level of such texels, with the texel and the row more that it goes on by.
    fn push(
        &mut self,
        width: u32,
        height: u32,
        [across, down]: [Wrap; 2],
        of: impl Fn(u32, u32) -> Vec4,
    ) -> Level {
        let level = Level { start: self.len(), width, height };
        let beyond = |wrap: Wrap, side: u32| if wrap == Wrap::Repeat { 0 } else { side - 1 };
        let columns = || (0..width).chain([beyond(across, width)]);
        let rows = (0..height).chain([beyond(down, height)]);
        let texels = rows.flat_map(|y| columns().map(move |x| (x, y))).map(|(x, y)| of(x, y));
        let count = (width as usize + 1) * (height as usize + 1);
        match self {
            Self::Bytes(all) => {
                all.reserve(count);
                all.extend(texels.map(|v| u32::from_le_bytes(codes(v, 255.0).map(|code| code as u8))));
            }
            Self::Shorts(all) => {
                all.reserve(count);
                all.extend(texels.map(|v| {
                    let [r, g, b, a] = codes(v, 65_535.0);
                    [r | g << 16, b | a << 16]
                }));
            }
            Self::Values(all) => {
                all.reserve(count);
                all.extend(texels.map(|v| v.to_array()));
            }
        }
        level
    }

    /// Appends the next coarser level: every texel is the area average of the finer ones it covers, fractions included.
    fn push_halved(&mut self, finer: Level, wrap: [Wrap; 2]) -> Level {
        let (width, height) = ((finer.width / 2).max(1), (finer.height / 2).max(1));
        let (columns, rows) = (coverage(finer.width, width), coverage(finer.height, height));
        let mut values = Vec::with_capacity(width as usize * height as usize);
        for row in &rows {
            for column in &columns {
                let mut sum = Vec4::ZERO;
                for &(y, wy) in row {
                    for &(x, wx) in column {
                        sum += wx * wy * self.linear(finer.index(x, y));
                    }
                }
                values.push(sum);
            }
        }
        self.push(width, height, wrap, |x, y| values[y as usize * width as usize + x as usize])
    }
}

/// Whole numbers that stand for linear values from 0 to 1.
fn codes(linear: Vec4, white: f32) -> [u32; 4] {
    linear.to_array().map(|value| (value * white).round().min(white) as u32)
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
    use std::sync::Arc;

    use super::*;
    use crate::color::srgb_decode;

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
    fn srgb_keeps_its_codes() {
        for code in 0..=255_u8 {
            let image = Image::rgba8(1, 1, vec![code, code, code, code]);
            let map = MipMap::new(&Texture::new("code", Arc::new(image), ColorSpace::Srgb));
            let found = lookup(&map, Vec2::splat(0.5), 0.0);
            let exact = srgb_decode(f32::from(code) / 255.0);
            // The step between the darkest codes is 3e-4.
            assert!((found.x - exact).abs() < 8e-6, "code {code}: {}, not {exact}", found.x);
            assert!((found.w - f32::from(code) / 255.0).abs() < 1e-6, "{}", found.w);
            assert_eq!(map.mean(), found);
        }
    }

    #[test]
    fn long_footprints_stay_sharp() {
        // A checkerboard of 16 texels a square, looked at through footprints that are 4 texels wide and 32 long.
        let texture = texture(256, 256, |x, y| ((x / 16 + y / 16) % 2) as f32);
        let (map, image) = (MipMap::new(&texture), texture.image);
        let mut errors = [0.0_f64; 2];
        for i in 0..500_u32 {
            let [x, y, turn] = [0.618_034, 0.754_878, 0.569_84].map(|step| (i as f32 * step).fract());
            let (uv, axis) = (Vec2::new(x, y), Vec2::from_angle(std::f32::consts::TAU * turn));
            let (along, across) = (axis * (32.0 / 256.0), axis.perp() * (4.0 / 256.0));
            let inside = (0..64 * 8).map(|j| {
                let at = |k: u32, n: u32| (k as f32 + 0.5) / n as f32 - 0.5;
                let there = uv + along * at(j % 64, 64) + across * at(j / 64, 8);
                let [x, y] = there.to_array().map(|u| (256.0 * u.rem_euclid(1.0)) as u32 % 256);
                texel(&image, x, y, ColorSpace::Linear)
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
    fn every_level_is_interpolated_across_its_borders() {
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            for (width, height) in [(8, 8), (5, 3), (1, 4), (6, 1)] {
                let mut t = texture(width, height, |x, y| (x * x + 7 * y + 1) as f32);
                t.wrap = [wrap; 2];
                let map = MipMap::new(&t);
                let (mut level, mut lod) = (t.image.clone(), 0.0);
                loop {
                    for i in 0..200_u32 {
                        let [u, v] =
                            [0.618_034_f32, 0.754_878].map(|step| 4.0 * (i as f32 * step).fract() - 2.0);
                        let expected = interpolated(&level, Vec2::new(u, v), wrap);
                        let found = lookup(&map, Vec2::new(u, v), lod).x;
                        assert!(
                            (found - expected).abs() < 1e-3,
                            "{wrap:?} {lod} {u} {v}: {found}, not {expected}"
                        );
                    }
                    if level.width.max(level.height) == 1 {
                        break;
                    }
                    (level, lod) = (halved(&level), lod + 1.0);
                }
            }
        }
    }

    /// The next coarser level, by itself: no level goes on beyond its borders.
    fn halved(image: &Image) -> Arc<Image> {
        let (width, height) = ((image.width / 2).max(1), (image.height / 2).max(1));
        let (columns, rows) = (coverage(image.width, width), coverage(image.height, height));
        let mean = |row: &[(u32, f32)], column: &[(u32, f32)]| {
            let pairs = row.iter().flat_map(|&(y, wy)| column.iter().map(move |&(x, wx)| (x, y, wx * wy)));
            pairs.map(|(x, y, weight)| weight * texel(image, x, y, ColorSpace::Linear)).sum::<Vec4>()
        };
        let values = rows.iter().flat_map(|row| columns.iter().map(|column| mean(row, column)));
        Arc::new(Image::rgba_f32(width, height, values.flat_map(|v| v.to_array()).collect()))
    }

    /// Red between the four texels around a point.
    fn interpolated(image: &Image, uv: Vec2, wrap: Wrap) -> f32 {
        let index = |i: i32, side: u32| {
            let side = side as i32;
            let inside = match wrap {
                Wrap::Repeat => i.rem_euclid(side),
                Wrap::Clamp => i.clamp(0, side - 1),
                Wrap::Mirror => i.rem_euclid(2 * side).min(2 * side - 1 - i.rem_euclid(2 * side)),
            };
            inside as u32
        };
        let at = uv * Vec2::new(image.width as f32, image.height as f32) - 0.5;
        let (low, blend) = (at.floor().as_ivec2(), at - at.floor());
        let red = |x: i32, y: i32| {
            texel(image, index(x, image.width), index(y, image.height), ColorSpace::Linear).x
        };
        let row = |y: i32| red(low.x, y) * (1.0 - blend.x) + red(low.x + 1, y) * blend.x;
        row(low.y) * (1.0 - blend.y) + row(low.y + 1) * blend.y
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
