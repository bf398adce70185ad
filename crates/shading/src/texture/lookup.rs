//! Reading textures on lanes: where the texels are and how they are weighted. Only the reads themselves go lane by lane.

use heliostat_scene::Wrap;

use super::{MOST_LEVELS, MipMap, Texels, UNIT16};
use crate::color::UNIT;
use crate::lanes::{LanesFn, Mask, Real, Whole, Wholes};

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
        let coarsest = self.coarsest as f32;
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
        let x = Axis::new(u, self.size.x, shrink, self.wrap[0], middle);
        let y = Axis::new(v, self.size.y, shrink, self.wrap[1], middle);
        // Widths may be beyond the whole numbers that floats hold.
        let last = x.last.truncate();
        let width = last.plus(last.splat(2));
        let upper = self.start(level).plus(y.near.truncate().times(width)).plus(x.near.truncate());
        let token = level.token();
        let [a, b] = self.pair::<F>(token, upper);
        let [c, d] = self.pair::<F>(token, upper.plus(width));
        let (mut mean, unit) = (a, self.unit());
        for channel in 0..4 {
            let near = a[channel].mix(b[channel], x.blend);
            let far = c[channel].mix(d[channel], x.blend);
            mean[channel] = near.mix(far, y.blend) * unit;
        }
        mean
    }

    /// Indices of the first texels of levels.
    #[inline(always)]
    fn start<F: Real>(&self, level: F) -> F::Whole {
        let mut levels = Wholes::default();
        level.truncate().store(&mut levels, 0);
        F::Whole::gather(level.token(), 0, |lane| self.starts[levels.0[lane] as usize % MOST_LEVELS])
    }

    /// RGBA of texels and of those after them, in steps of [`Self::unit`].
    #[inline(always)]
    fn pair<F: Real>(&self, token: F::Token, at: F::Whole) -> [[F; 4]; 2] {
        let mut indices = Wholes::default();
        at.store(&mut indices, 0);
        let index = |lane: usize| indices.0[lane] as usize;
        match &self.texels {
            Texels::Bytes(codes) => {
                let [near, far] = F::Whole::gather_pairs(token, 0, |lane| {
                    let pair = &codes[index(lane)..index(lane) + 2];
                    u64::from(pair[0]) | u64::from(pair[1]) << 32
                });
                [bytes(near), bytes(far)]
            }
            Texels::Shorts(codes) => {
                let [near_rg, near_ba, far_rg, far_ba] = F::Whole::gather_quads(token, 0, |lane| {
                    let pair = &codes[index(lane)..index(lane) + 2];
                    [pair[0][0], pair[0][1], pair[1][0], pair[1][1]]
                });
                let ([r, g], [b, a]) = (shorts(near_rg), shorts(near_ba));
                let ([s, t], [u, v]) = (shorts(far_rg), shorts(far_ba));
                [[r, g, b, a], [s, t, u, v]]
            }
            Texels::Values(values) => {
                let mut pair = [[F::constant(token, 0.0); 4]; 2];
                for (next, texel) in pair.iter_mut().enumerate() {
                    for (channel, value) in texel.iter_mut().enumerate() {
                        *value = F::gather(token, 0, |lane| values[index(lane) + next][channel]);
                    }
                }
                pair
            }
        }
    }

    /// What texels count in.
    #[inline(always)]
    fn unit(&self) -> f32 {
        match &self.texels {
            Texels::Bytes(_) => UNIT,
            Texels::Shorts(_) => UNIT16,
            Texels::Values(_) => 1.0,
        }
    }
}

/// The four bytes of numbers.
#[inline(always)]
fn bytes<W: Whole>(codes: W) -> [W::Real; 4] {
    let byte = codes.splat(0xff);
    [
        (codes & byte).to_real(),
        (codes.right(8) & byte).to_real(),
        (codes.right(16) & byte).to_real(),
        codes.right(24).to_real(),
    ]
}

/// The two halves of numbers.
#[inline(always)]
fn shorts<W: Whole>(codes: W) -> [W::Real; 2] {
    [(codes & codes.splat(0xffff)).to_real(), codes.right(16).to_real()]
}

impl LanesFn<6, 4> for MipMap {
    #[inline(always)]
    fn on<F: Real>(&self, [u, v, lod, along_u, along_v, probes]: [F; 6]) -> [F; 4] {
        self.mean_of_taps(Footprint { uv: [u, v], lod, along: [along_u, along_v], probes })
    }
}

/// A point between two neighbouring texels along an axis.
struct Axis<F> {
    /// The level's last texel. One more follows it, see [`Texels`].
    last: F,
    /// The texel before the point.
    near: F,
    /// Weight of the one after it.
    blend: F,
}

impl<F: Real> Axis<F> {
    /// At a finite coordinate of a level whose side is `shrink` times `side` texels, rounded down; with `middle` 0 rather
    /// than ½ `near` is the texel that is there.
    #[inline(always)]
    fn new(coordinate: F, side: f32, shrink: F, wrap: Wrap, middle: F) -> Self {
        let (zero, one) = (shrink.splat(0.0), shrink.splat(1.0));
        let side = (shrink * side).floor().max(one);
        let last = side - 1.0;
        let at = folded(coordinate, wrap) * side - middle;
        // Before the first texel lies the last one of the repetition before, or the first itself.
        let at = if wrap == Wrap::Repeat { at } else { at.positive() };
        let near = at.floor();
        let blend = (at - near).only(middle.gt(zero));
        let near = last.where_or(near.lt(zero), near.min(last));
        Self { last, near, blend }
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
