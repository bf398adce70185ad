//! A packet's rays against the triangles of a leaf.
use fearless_simd::{f32x16, mask32x16, prelude::*, u32x8, u32x16};

use super::{Beam, Octant, Packet};
use crate::{
    layout::{Block, WIDTH},
    through::Screen,
    traverse::settle::{self, Lanes},
    triangle_bvh::TriangleBvh,
};

impl Packet {
    /// The lanes in `bits` against a block's triangles one by one.
    #[inline(always)]
    pub(super) fn together<S: Simd, const ANY: bool, const PAST: bool, const MIXED: bool>(
        &mut self,
        simd: S,
        screen: Screen<'_>,
        (octant, beam): (Octant, &Beam),
        block: usize,
        bits: u16,
    ) {
        let mut place = None;
        let triangles = screen.bvh.blocks().get(block, &mut place);
        let passed = if PAST { screen.passed_of(&triangles.triangle) } else { 0 };
        let there = u32x8::load_array_ref(simd, &triangles.triangle);
        let there = !there.simd_eq(u32x8::splat(simd, Block::NO_TRIANGLE)).to_bitmask() as u32;
        let met =
            beam.meet_triangles::<S, MIXED>(simd, triangles, octant.near, self.reach(simd).reduce_max());
        let mut rest = there & met & 0xff;
        while rest != 0 {
            rest = self.together_from::<S, ANY, PAST>(simd, screen.bvh, triangles, block, bits, rest, passed);
        }
    }

    /// The triangles in `rest`, up to a tie, as a call inside the loop would cost it its registers; returns those that are
    /// left. The triangles in `passed` let light through.
    #[expect(clippy::too_many_arguments, reason = "rays, a block of triangles, and which of them")]
    #[inline(always)]
    fn together_from<S: Simd, const ANY: bool, const PAST: bool>(
        &mut self,
        simd: S,
        bvh: &TriangleBvh,
        triangles: &Block,
        block: usize,
        bits: u16,
        rest: u32,
        passed: u32,
    ) -> u32 {
        let shears = self.shears(simd);
        let wanted = mask32x16::from_bitmask(simd, u64::from(bits));
        let t_min = f32x16::load_array_ref(simd, &self.t_min);
        let mut limit = f32x16::load_array_ref(simd, &self.limit);
        let mut id = u32x16::load_array_ref(simd, &self.id);
        let zero = f32x16::splat(simd, 0.0);
        let (mut rest, mut lane, mut tied, mut distance) = (rest, 0, 0, zero);
        while rest != 0 && tied == 0 {
            lane = (rest.trailing_zeros() & 7) as usize;
            rest &= rest - 1;
            if PAST && passed >> lane & 1 != 0 && bits & !self.met == 0 {
                continue;
            }
            let corners = settle::lanes_of(simd, triangles, lane);
            let meeting = shears.test(simd, &corners, wanted, [t_min, limit * (1.0 + settle::CLOSE)]);
            let inside = meeting.inside;
            if inside.to_bitmask() == 0 {
                continue;
            }
            let mut t = meeting.t;
            if meeting.doubt.to_bitmask() != 0 {
                t = self.distances(simd, triangles, lane, meeting.doubt.to_bitmask() as u16, &t.into());
            }
            let inside = inside & t.simd_gt(t_min);
            let close = limit * settle::CLOSE;
            let hit = inside & if ANY { t.simd_le(limit) } else { t.simd_lt(limit - close) };
            if PAST && passed >> lane & 1 != 0 {
                self.met |= hit.to_bitmask() as u16;
                continue;
            }
            if !ANY {
                tied = (inside & !hit & t.simd_le(limit + close)).to_bitmask() as u16;
                distance = t;
            }
            limit = hit.select(if ANY { f32x16::splat(simd, -1.0) } else { t }, limit);
            id = hit.select(u32x16::splat(simd, (block * WIDTH + lane) as u32), id);
            if ANY && (limit.simd_ge(zero) & wanted).to_bitmask() == 0 {
                rest = 0;
            }
        }
        self.limit = limit.into();
        self.id = id.into();
        if tied != 0 {
            self.choose(simd, bvh, tied, (block * WIDTH + lane) as u32, &distance.into());
        }
        rest
    }

    /// `t` with the precise distances to a triangle for the lanes in `doubt`.
    #[cold]
    #[inline(never)]
    fn distances<S: Simd>(&self, simd: S, block: &Block, lane: usize, doubt: u16, t: &Lanes) -> f32x16<S> {
        simd.vectorize(
            #[inline(always)]
            || {
                let corners = settle::lanes_of(simd, block, lane);
                let precise = settle::exact(simd, corners, &self.lined(simd)).distance;
                let doubt = mask32x16::from_bitmask(simd, u64::from(doubt));
                doubt.select(precise, f32x16::load_array_ref(simd, t))
            },
        )
    }

    /// Gives triangle `id`, which is met at the distances `t`, to those lanes in `close` that have nothing nearer: about
    /// as near they have another one, or their end.
    #[cold]
    #[inline(never)]
    fn choose<S: Simd>(&mut self, simd: S, bvh: &TriangleBvh, close: u16, id: u32, t: &Lanes) {
        simd.vectorize(
            #[inline(always)]
            || {
                let (distance, ids) =
                    (f32x16::load_array_ref(simd, t), u32x16::load_array_ref(simd, &self.id));
                let limit = f32x16::load_array_ref(simd, &self.limit);
                let unmet = ids.simd_eq(u32x16::splat(simd, Self::NONE));
                let end = unmet.select(limit, f32x16::load_array_ref(simd, &self.end));
                let close = distance.simd_le(end).to_bitmask() as u16 & close;
                let unmet = unmet.to_bitmask() as u16;
                let mut nearer = close & unmet;
                if close & !unmet != 0 {
                    let rays = self.lined(simd);
                    nearer |= settle::precede(simd, bvh.blocks(), &rays, id, &self.id, close & !unmet);
                }
                let nearer = mask32x16::from_bitmask(simd, u64::from(nearer));
                self.limit = nearer.select(distance, limit).into();
                self.id = nearer.select(u32x16::splat(simd, id), ids).into();
            },
        );
    }
}
