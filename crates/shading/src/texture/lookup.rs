//! Reading textures on lanes: where the texels are, what their codes stand for and how they are weighted. Only the reads
//! themselves go lane by lane.

use heliostat_scene::{ColorSpace, Pixels, Wrap};

use super::MipMap;
use crate::color::{SRGB8, UNIT, srgb_decode_code};
use crate::lanes::{LaneFn, LanesFn, Mask, Real, WIDTH, Whole, Wholes};

/// What a texture is filtered over: squares side by side, in texture space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint<F> {
    /// Its middle. Coordinates that are not finite read as 0.
    pub(crate) uv: [F; 2],
    /// log2 of a square's width, texels of level 0.
    pub(crate) lod: F,
    /// The longer axis from end to end, over which the squares are spread evenly.
    pub(crate) along: [F; 2],
    /// Number of squares, a whole number up to [`MOST_PROBES`]; anything below 2 is one.
    pub(crate) probes: F,
}

/// Squares of a footprint beyond these are left out.
const MOST_PROBES: u32 = 16;

impl MipMap {
    /// Linear RGBA, the mean over a footprint.
    #[inline(always)]
    pub(crate) fn filtered<F: Real>(&self, footprint: Footprint<F>) -> [F; 4] {
        let Footprint { uv: [u, v], lod, along: [along_u, along_v], probes } = footprint;
        F::call([u, v, lod, along_u, along_v, probes], self)
    }

    /// The mean over a footprint by taps: four texels of one level each.
    ///
    /// # References
    /// Williams, "Pyramidal Parametrics", 1983. McCormack, Perry, Farkas, Jouppi, "Feline: Fast Elliptical Lines for Anisotropic
    /// Texture Mapping", 1999, section 4 (probes along the longer axis).
    #[inline(always)]
    fn mean_of_taps<F: Real>(&self, footprint: Footprint<F>) -> [F; 4] {
        let Footprint { uv: [u, v], lod, along: [along_u, along_v], probes } = footprint;
        let (zero, one) = (u.splat(0.0), u.splat(1.0));
        let coarsest = self.coarsest() as f32;
        let lod = lod.clamp(0.0, coarsest);
        let fine = lod.floor();
        let blend = lod - fine;
        // One square takes the two levels around its width. Of several each takes one, so that together they blend the two.
        let several = probes.ge(one.splat(2.0));
        let taps = probes.where_or(several, one.splat(2.0).where_or(blend.gt(zero), one));
        let step = probes.max(one).recip();
        let magnified = lod.equals(zero) & !several;
        let mut mean = [zero; 4];
        for tap in 0..MOST_PROBES {
            let index = tap as f32;
            let active = one.splat(index).lt(taps);
            if !active.any() {
                break;
            }
            let share = step * (index + 0.5);
            let offset = (share - 0.5).only(several);
            let level = (lod + share).floor().where_or(several, fine + index).min(one.splat(coarsest));
            let uv = [u + along_u * offset, v + along_v * offset];
            let magnified = magnified | (several & level.equals(zero));
            let texel = self.bilinear(uv, level, magnified);
            // A running mean: what is the same everywhere stays exactly that.
            let weight = match tap {
                0 => one,
                _ => one.splat((index + 1.0).recip()).where_or(several, blend),
            };
            for (mean, value) in mean.iter_mut().zip(texel) {
                *mean = mean.mix(value, weight).where_or(active, *mean);
            }
        }
        mean
    }

    /// A mean of four texels around a point, or, where `magnified` and the map is not to be interpolated, the one that is there.
    #[inline(always)]
    fn bilinear<F: Real>(&self, [u, v]: [F; 2], level: F, magnified: F::Mask) -> [F; 4] {
        let zero = u.splat(0.0);
        let finite = (u * 0.0).equals(zero) & (v * 0.0).equals(zero);
        let (u, v) = (u.only(finite), v.only(finite));
        let mut middle = u.splat(0.5);
        if self.nearest {
            middle = zero.where_or(magnified, middle);
        }
        let shrink = (-level + 127.0).truncate().left(23).as_real_bits();
        let base = &self.levels[0];
        let x = Axis::new(u, base.width as f32, shrink, self.wrap[0], middle);
        let y = Axis::new(v, base.height as f32, shrink, self.wrap[1], middle);
        let [a, b, c, d] = self.texels(&Corners::new(level, &x, &y), zero);
        let mut mean = a;
        for channel in 0..4 {
            let near = a[channel].mix(b[channel], x.blend);
            let far = c[channel].mix(d[channel], x.blend);
            mean[channel] = near.mix(far, y.blend);
        }
        mean
    }

    /// Linear RGBA of the texels of all lanes, corner by corner; `like` is in the registers that they come to.
    #[inline(always)]
    fn texels<F: Real>(&self, corners: &Corners, like: F) -> [[F; 4]; 4] {
        let token = like.token();
        let mut texels = [[like; 4]; 4];
        match &self.levels[0].pixels {
            Pixels::Rgba8(_) => {
                let levels = self.levels_of(corners, F::LANES, codes);
                for (texel, at) in texels.iter_mut().zip(&corners.at) {
                    *texel = self.decoded(F::Whole::gather(token, 0, |lane| {
                        u32::from_le_bytes(levels[lane][at.0[lane] as usize])
                    }));
                }
            }
            Pixels::RgbaF32(_) => {
                let levels = self.levels_of(corners, F::LANES, values);
                for (texel, at) in texels.iter_mut().zip(&corners.at) {
                    for (channel, value) in texel.iter_mut().enumerate() {
                        *value = F::gather(token, 0, |lane| levels[lane][at.0[lane] as usize][channel]);
                    }
                }
            }
        }
        texels
    }

    /// The texels of the level of each of the first `lanes` lanes.
    #[inline(always)]
    fn levels_of<T>(&self, corners: &Corners, lanes: usize, texels: fn(&Pixels) -> &[T]) -> [&[T]; WIDTH] {
        let mut levels: [&[T]; WIDTH] = [&[]; WIDTH];
        for (level, &number) in levels.iter_mut().zip(&corners.level.0).take(lanes) {
            *level = texels(&self.levels[number as usize].pixels);
        }
        levels
    }

    /// Linear RGBA of four bytes.
    #[inline(always)]
    fn decoded<F: Real>(&self, codes: F::Whole) -> [F; 4] {
        let byte = codes.splat(0xff);
        let r = (codes & byte).to_real();
        let g = (codes.right(8) & byte).to_real();
        let b = (codes.right(16) & byte).to_real();
        let a = codes.right(24).to_real() * UNIT;
        match self.decode {
            ColorSpace::Linear => [r * UNIT, g * UNIT, b * UNIT, a],
            // A single number is quicker looked up; the table holds what lanes compute.
            ColorSpace::Srgb if F::LANES == 1 => {
                let [r, g, b] = F::each([r, g, b], &Srgb8);
                [r, g, b, a]
            }
            ColorSpace::Srgb => [srgb_decode_code(r), srgb_decode_code(g), srgb_decode_code(b), a],
        }
    }
}

impl LanesFn<6, 4> for MipMap {
    #[inline(always)]
    fn on<F: Real>(&self, [u, v, lod, along_u, along_v, probes]: [F; 6]) -> [F; 4] {
        self.mean_of_taps(Footprint { uv: [u, v], lod, along: [along_u, along_v], probes })
    }
}

/// Two neighbouring texels along an axis.
struct Axis<F> {
    /// Number of texels.
    side: F,
    near: F,
    far: F,
    /// Weight of the far one.
    blend: F,
}

impl<F: Real> Axis<F> {
    /// Around a finite coordinate of a level whose side is `shrink` times `side` texels, rounded down; with `middle` 0 rather
    /// than ½ `near` is the texel that is there.
    #[inline(always)]
    fn new(coordinate: F, side: f32, shrink: F, wrap: Wrap, middle: F) -> Self {
        let one = shrink.splat(1.0);
        let side = (shrink * side).floor().max(one);
        let last = side - 1.0;
        let at = folded(coordinate, wrap) * side - middle;
        let near = at.floor();
        let blend = (at - near).only(middle.gt(one.splat(0.0)));
        let far = near + 1.0;
        let zero = one.splat(0.0);
        match wrap {
            Wrap::Repeat => Self {
                side,
                near: zero.where_or(last.lt(near), last.where_or(near.lt(zero), near)),
                far: zero.where_or(last.lt(far), far),
                blend,
            },
            Wrap::Mirror | Wrap::Clamp => {
                Self { side, near: near.positive().min(last), far: far.min(last), blend }
            }
        }
    }
}

/// A texture coordinate brought into [0, 1], where the picture is.
#[inline(always)]
fn folded<F: Real>(u: F, wrap: Wrap) -> F {
    match wrap {
        Wrap::Repeat => u - u.floor(),
        // Every second time backwards.
        Wrap::Mirror => ((u * 0.5 - (u * 0.5).floor()) * 2.0 - 1.0).abs().complement(),
        Wrap::Clamp => u.clamp(0.0, 1.0),
    }
}

/// Where the four texels of each lane are: the level, and indices into it.
struct Corners {
    level: Wholes,
    at: [Wholes; 4],
}

impl Corners {
    #[inline(always)]
    fn new<F: Real>(level: F, x: &Axis<F>, y: &Axis<F>) -> Self {
        let mut corners = Self { level: Wholes::default(), at: [Wholes::default(); 4] };
        level.truncate().store(&mut corners.level, 0);
        let (left, right, width) = (x.near.truncate(), x.far.truncate(), x.side.truncate());
        let (above, below) = (y.near.truncate().times(width), y.far.truncate().times(width));
        let [a, b, c, d] = &mut corners.at;
        above.plus(left).store(a, 0);
        above.plus(right).store(b, 0);
        below.plus(left).store(c, 0);
        below.plus(right).store(d, 0);
        corners
    }
}

/// Linear values of 8-bit sRGB codes.
struct Srgb8;

impl LaneFn<3, 3> for Srgb8 {
    #[inline(always)]
    fn at(&self, [r, g, b]: [f32; 3]) -> [f32; 3] {
        let table: &[f32; 256] = &SRGB8;
        [table[r as usize & 255], table[g as usize & 255], table[b as usize & 255]]
    }
}

/// Texels of four bytes, red first; none if they are floats.
#[inline(always)]
fn codes(pixels: &Pixels) -> &[[u8; 4]] {
    match pixels {
        Pixels::Rgba8(bytes) => bytes.as_chunks().0,
        Pixels::RgbaF32(_) => &[],
    }
}

/// Texels of four floats; none if they are bytes.
#[inline(always)]
fn values(pixels: &Pixels) -> &[[f32; 4]] {
    match pixels {
        Pixels::Rgba8(_) => &[],
        Pixels::RgbaF32(floats) => floats.as_chunks().0,
    }
}
