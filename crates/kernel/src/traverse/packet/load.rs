//! How rays come into a packet.
use fearless_simd::{f32x4, f32x16, mask32x16, prelude::*, u32x16};
use glam::Vec3;

use super::{Packet, in_range};
use crate::{
    ray::Ray,
    traverse::settle::{LANES, Lined, load},
};

impl Packet {
    /// Takes up the first `len` of some rays; returns the lanes of those that can hit something, as [`LocalRay::new`] has it.
    #[inline(always)]
    pub(in super::super) fn load<S: Simd>(
        &mut self,
        simd: S,
        rays: &[Ray],
        indices: &[u8; LANES],
        len: usize,
    ) -> u16 {
        let mut of = [&NOTHING; LANES];
        for (to, &index) in of.iter_mut().zip(&indices[..len]) {
            *to = &rays[usize::from(index)];
        }
        let [ox, oy, oz, t_min] = columns(simd, |lane| {
            let Ray { origin, t_min, .. } = of[lane];
            [origin.x, origin.y, origin.z, *t_min]
        });
        let [dx, dy, dz, t_max] = columns(simd, |lane| {
            let Ray { direction, t_max, .. } = of[lane];
            [direction.x, direction.y, direction.z, *t_max]
        });
        self.origin = [ox.into(), oy.into(), oz.into()];
        self.direction = [dx.into(), dy.into(), dz.into()];
        self.is_mixed = false;
        let start = t_min.max(f32x16::splat(simd, 0.0));
        // Every comparison is false for NaN.
        let mut usable = t_min.simd_eq(t_min) & start.simd_lt(t_max);
        usable &= in_range(simd, [ox, oy, oz], [dx, dy, dz]);
        let end = f32x16::from_bits(t_max.to_bits() - 1);
        let none = f32x16::splat(simd, -1.0);
        self.t_min = start.into();
        self.end = end.into();
        self.limit = usable.select(end, none).into();
        self.met = 0;
        usable.to_bitmask() as u16
    }

    /// Takes up rays in lanes, of which those in `used` are known to be in the usable range; each looks as far as to its
    /// limit, excluded. Returns the lanes that can hit something.
    #[inline(always)]
    pub(in super::super) fn take<S: Simd>(
        &mut self,
        simd: S,
        rays: &Lined<f32x16<S>>,
        limit: f32x16<S>,
        used: mask32x16<S>,
    ) -> u16 {
        let limit = f32x16::from_bits(limit.to_bits() - 1).min(rays.end);
        self.origin = rays.origin.map(Into::into);
        self.direction = rays.direction.map(Into::into);
        self.t_min = rays.t_min.into();
        self.end = rays.end.into();
        self.is_mixed = false;
        self.limit = used.select(limit, f32x16::splat(simd, -1.0)).into();
        self.met = 0;
        used.to_bitmask() as u16
    }

    /// Whether the rays in `bits` are of one octant, or else all of them up to `short` long: they then meet about the same
    /// boxes wherever they go.
    #[inline(always)]
    pub(in super::super) fn stays_together<S: Simd>(&mut self, simd: S, bits: u16, short: f32) -> bool {
        let [x, y, z] = load(simd, &self.direction);
        let down =
            |d: f32x16<S>| (d.to_bits() >> 31).simd_gt(u32x16::splat(simd, 0)).to_bitmask() as u16 & bits;
        if [x, y, z].into_iter().all(|d| matches!(down(d), down if down == 0 || down == bits)) {
            return true;
        }
        let length = x.abs().max(y.abs()).max(z.abs()) * f32x16::load_array_ref(simd, &self.limit);
        self.is_mixed = length.simd_le(f32x16::splat(simd, short)).to_bitmask() as u16 & bits == bits;
        self.is_mixed
    }
}

/// A ray that can hit nothing.
static NOTHING: Ray = Ray { t_max: -1.0, ..Ray::new(Vec3::ZERO, Vec3::X) };

/// Four words of each ray, word after word: a perfect shuffle back, twice.
#[inline(always)]
fn columns<S: Simd>(simd: S, words: impl Fn(usize) -> [f32; 4]) -> [f32x16<S>; 4] {
    let of = |lane| f32x4::load_array(simd, words(lane));
    let four = |lane| of(lane).combine(of(lane + 1)).combine(of(lane + 2).combine(of(lane + 3)));
    let (a, b, c, d) = (four(0), four(4), four(8), four(12));
    let ((a, c), (b, d)) = (a.deinterleave(b), c.deinterleave(d));
    let ((a, c), (b, d)) = (a.deinterleave(b), c.deinterleave(d));
    [a, b, c, d]
}
