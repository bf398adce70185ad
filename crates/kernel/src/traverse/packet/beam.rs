//! What the rays of a packet have in common, to leave out at once what none of them meets.
use fearless_simd::{f32x8, f32x16, mask32x16, prelude::*};

use super::{Octant, Packet};
use crate::{
    layout::{Block, Node},
    traverse::{local::REACH, slab},
};

/// Directions of a narrow beam differ, along each axis, by this share of their largest component at most.
const NARROW: f32 = 0.25;

/// What the rays of a packet have in common: bounds of their origins and directions, for a quick test of all boxes of a
/// node at once [Boulos, Wald and Shirley 2006, "Geometric and arithmetic culling methods for entire ray packets"].
#[derive(Clone, Copy)]
pub(in super::super) struct Beam {
    t_min: f32,
    /// Of each axis, the least and the greatest reciprocal direction.
    inverse: [[f32; 2]; 3],
    /// Of each axis, what origins are at most on the side from which near planes, and from which far planes are farthest;
    /// padded.
    origin: [[f32; 2]; 3],
    /// Of each axis, between what the rays' ends lie. For `MIXED` rays, of several octants, this is all that is known.
    hull: [[f32; 2]; 3],
}

impl Beam {
    /// Whether the directions are about the same.
    #[inline(always)]
    pub(super) fn is_narrow(&self) -> bool {
        let (mut spread, mut largest) = (0.0_f32, 0.0_f32);
        for [low, high] in self.inverse {
            let (one, other) = (1.0 / low, 1.0 / high);
            spread = spread.max((one - other).abs());
            largest = largest.max(one.abs());
        }
        spread <= NARROW * largest
    }

    /// The children of a node that some ray may meet up to `reach`.
    #[inline(always)]
    pub(super) fn meet<S: Simd, const MIXED: bool>(
        &self,
        simd: S,
        node: &Node,
        near: [usize; 3],
        reach: f32,
    ) -> u32 {
        if MIXED {
            let [a, b, c, d, e, f] = &node.bounds;
            return self.overlap(simd, slab::rows(simd, [a, b, c]), slab::rows(simd, [d, e, f]));
        }
        let [x, y, z] = near;
        let first = slab::rows(simd, [&node.bounds[x % 6], &node.bounds[y % 6], &node.bounds[z % 6]]);
        let (x, y, z) = ((x + 3) % 6, (y + 3) % 6, (z + 3) % 6);
        let last = slab::rows(simd, [&node.bounds[x], &node.bounds[y], &node.bounds[z]]);
        self.meet_planes(simd, first, last, reach)
    }

    /// The triangles of a block that some ray may meet up to `reach`, by their boxes.
    #[inline(always)]
    pub(super) fn meet_triangles<S: Simd, const MIXED: bool>(
        &self,
        simd: S,
        block: &Block,
        near: [usize; 3],
        reach: f32,
    ) -> u32 {
        let [a, b, c] = &block.vertex;
        let zero = f32x8::splat(simd, 0.0);
        let (mut first, mut last) = ([zero; 3], [zero; 3]);
        for axis in 0..3 {
            let a = f32x8::load_array_ref(simd, &a[axis]);
            let b = f32x8::load_array_ref(simd, &b[axis]);
            let c = f32x8::load_array_ref(simd, &c[axis]);
            let (low, high) = (a.min(b).min(c), a.max(b).max(c));
            (first[axis], last[axis]) = if MIXED || near[axis] < 3 { (low, high) } else { (high, low) };
        }
        if MIXED {
            return self.overlap(simd, first, last);
        }
        self.meet_planes(simd, first, last, reach)
    }

    #[inline(always)]
    fn overlap<S: Simd>(&self, simd: S, low: [f32x8<S>; 3], high: [f32x8<S>; 3]) -> u32 {
        let side = |axis: usize| {
            let [least, most] = self.hull[axis];
            low[axis].simd_le(f32x8::splat(simd, most)) & high[axis].simd_ge(f32x8::splat(simd, least))
        };
        (side(0) & side(1) & side(2)).to_bitmask() as u32
    }

    #[inline(always)]
    fn meet_planes<S: Simd>(&self, simd: S, first: [f32x8<S>; 3], last: [f32x8<S>; 3], reach: f32) -> u32 {
        let mut enter = f32x8::splat(simd, self.t_min);
        let mut leave = f32x8::splat(simd, f32::INFINITY);
        for axis in 0..3 {
            let ([low, high], [far_side, near_side]) = (self.inverse[axis], self.origin[axis]);
            let (first, last) = (first[axis] - far_side, last[axis] - near_side);
            enter = enter.max((first * low).min(first * high));
            leave = leave.min((last * low).max(last * high));
        }
        let leave = (leave * slab::FAR_SLACK).min(f32x8::splat(simd, reach));
        enter.simd_le(leave).to_bitmask() as u32
    }
}

impl Packet {
    /// The beam of the lanes in `bits` (not empty), which share an octant.
    #[inline(always)]
    pub(in super::super) fn beam<S: Simd>(&self, simd: S, octant: Octant, bits: u16) -> Beam {
        let used = mask32x16::from_bitmask(simd, u64::from(bits));
        let infinity = f32x16::splat(simd, f32::INFINITY);
        let pad = used.select(f32x16::load_array_ref(simd, &self.pad), -infinity).reduce_max();
        let mut beam =
            Beam { t_min: 0.0, inverse: [[0.0; 2]; 3], origin: [[0.0; 2]; 3], hull: [[0.0; 2]; 3] };
        for axis in 0..3 {
            let inverse = f32x16::load_array_ref(simd, &self.inverse[axis]);
            let origin = f32x16::load_array_ref(simd, &self.origin[axis]);
            let least = used.select(origin, infinity).reduce_min() - pad;
            let most = used.select(origin, -infinity).reduce_max() + pad;
            beam.inverse[axis] =
                [used.select(inverse, infinity).reduce_min(), used.select(inverse, -infinity).reduce_max()];
            beam.origin[axis] = if octant.near[axis] < 3 { [most, least] } else { [least, most] };
        }
        let t_min = f32x16::load_array_ref(simd, &self.t_min);
        beam.t_min = used.select(t_min, infinity).reduce_min();
        beam
    }

    /// The box around the lanes in `bits`, which may be of several octants; small for short rays.
    #[inline(always)]
    pub(in super::super) fn hull<S: Simd>(&self, simd: S, bits: u16) -> Beam {
        let used = mask32x16::from_bitmask(simd, u64::from(bits));
        let infinity = f32x16::splat(simd, f32::INFINITY);
        let pad = f32x16::load_array_ref(simd, &self.pad);
        let mut beam =
            Beam { t_min: 0.0, inverse: [[1.0; 2]; 3], origin: [[0.0; 2]; 3], hull: [[0.0; 2]; 3] };
        let end = (f32x16::load_array_ref(simd, &self.limit) * REACH).min(f32x16::splat(simd, f32::MAX));
        let t_min = f32x16::load_array_ref(simd, &self.t_min);
        for axis in 0..3 {
            let way = f32x16::load_array_ref(simd, &self.direction[axis]);
            let origin = f32x16::load_array_ref(simd, &self.origin[axis]);
            let (first, last) = (way.mul_add(t_min, origin), way.mul_add(end, origin));
            let pad = first.abs().max(last.abs()).mul_add(f32x16::splat(simd, 4.0 * f32::EPSILON), pad);
            let (least, most) = (first.min(last) - pad, first.max(last) + pad);
            beam.hull[axis] =
                [used.select(least, infinity).reduce_min(), used.select(most, -infinity).reduce_max()];
        }
        beam
    }
}
