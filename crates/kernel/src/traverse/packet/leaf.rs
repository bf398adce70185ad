//! A packet's rays against the triangles of a leaf: [`Shear::test`](super::Shear::test) with the roles of rays and triangles
//! exchanged, operation by operation, so that a mesh stays watertight.
use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};

use super::Packet;
use crate::{
    layout::{Block, WIDTH},
    through::Screen,
    traverse::{
        settle::{self, Lanes, Triple, load, turn},
        shear::SLIVER,
    },
    triangle_bvh::TriangleBvh,
};

impl Packet {
    /// The lanes in `bits` against a block's triangles one by one: [`Shear::test`] with the roles of rays and
    /// triangles exchanged, operation by operation, so that a mesh stays watertight.
    #[inline(always)]
    pub(super) fn together<S: Simd, const ANY: bool, const PAST: bool>(
        &mut self,
        simd: S,
        screen: Screen<'_>,
        block: usize,
        bits: u16,
    ) {
        let mut place = None;
        let triangles = screen.bvh.blocks().get(block, &mut place);
        let passed = if PAST { screen.passed_of(&triangles.triangle) } else { 0 };
        let mut first = 0;
        loop {
            first =
                self.together_from::<S, ANY, PAST>(simd, screen.bvh, triangles, block, bits, first, passed);
            if ANY || first == WIDTH {
                return;
            }
        }
    }

    /// From triangle `first` on, up to where it returns: it stops behind a tie, as a call inside the loop would cost it
    /// its registers. The triangles in `passed` let light through.
    #[expect(clippy::too_many_arguments, reason = "rays, a block of triangles, and which of them")]
    #[inline(always)]
    fn together_from<S: Simd, const ANY: bool, const PAST: bool>(
        &mut self,
        simd: S,
        bvh: &TriangleBvh,
        triangles: &Block,
        block: usize,
        bits: u16,
        first: usize,
        passed: u32,
    ) -> usize {
        let turned = [
            mask32x16::from_bitmask(simd, u64::from(self.turned[0])),
            mask32x16::from_bitmask(simd, u64::from(self.turned[1])),
        ];
        let origin = load(simd, &self.sheared_origin);
        let shear = load(simd, &self.shear);
        let wanted = mask32x16::from_bitmask(simd, u64::from(bits));
        let t_min = f32x16::load_array_ref(simd, &self.t_min);
        let mut limit = f32x16::load_array_ref(simd, &self.limit);
        let mut id = u32x16::load_array_ref(simd, &self.id);
        let zero = f32x16::splat(simd, 0.0);
        let (mut next, mut tied, mut distance) = (WIDTH, 0, zero);
        for lane in first..WIDTH {
            if triangles.triangle[lane] == Block::NO_TRIANGLE {
                break;
            }
            if PAST && passed >> lane & 1 != 0 && bits & !self.met == 0 {
                continue;
            }
            let (ax, ay, az) = sheared(simd, triangles, 0, lane, turned, origin, shear);
            let (bx, by, bz) = sheared(simd, triangles, 1, lane, turned, origin, shear);
            let (cx, cy, cz) = sheared(simd, triangles, 2, lane, turned, origin, shear);
            let u = cx * by - cy * bx;
            let v = ax * cy - ay * cx;
            let w = bx * ay - by * ax;
            let inside = u.min(v).min(w).simd_ge(zero) | u.max(v).max(w).simd_le(zero);
            let inside = inside & wanted;
            if inside.to_bitmask() == 0 {
                continue;
            }
            let determinant = u + v + w;
            let depth = u.mul_add(az, v.mul_add(bz, w * cz));
            let t = depth * shear[2] / determinant;
            let (x, y) = (ax.abs().max(bx.abs()).max(cx.abs()), ay.abs().max(by.abs()).max(cy.abs()));
            let range = az.max(bz).max(cz) - az.min(bz).min(cz);
            let sliver = (x * y * range * SLIVER).simd_gt(depth.abs()) & inside & !determinant.simd_eq(zero);
            let mut t = t;
            if sliver.to_bitmask() != 0 {
                t = self.distances(simd, triangles, lane, sliver.to_bitmask() as u16, &t.into());
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
                break;
            }
            if tied != 0 {
                next = lane + 1;
                break;
            }
        }
        self.limit = limit.into();
        self.id = id.into();
        if tied != 0 {
            self.choose(simd, bvh, tied, (block * WIDTH + next - 1) as u32, &distance.into());
        }
        next
    }

    /// `t` with the precise distances to a triangle for the lanes in `doubt`.
    #[cold]
    #[inline(never)]
    fn distances<S: Simd>(&self, simd: S, block: &Block, lane: usize, doubt: u16, t: &Lanes) -> f32x16<S> {
        let (mut t, mut rest) = (*t, doubt);
        while rest != 0 {
            let ray = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            t[ray] = settle::distance(simd, &self.ray(ray), block.corners(lane));
        }
        f32x16::load_array(simd, t)
    }

    /// Gives triangle `id`, which is met at the distances `t`, to those lanes in `close` that have nothing nearer: about
    /// as near they have another one, or their end.
    #[cold]
    #[inline(never)]
    fn choose<S: Simd>(&mut self, simd: S, bvh: &TriangleBvh, close: u16, id: u32, t: &Lanes) {
        let mut rest = close;
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            let nearest = if self.id[lane] == Self::NONE {
                t[lane] <= self.limit[lane]
            } else {
                t[lane] <= self.end[lane]
                    && settle::precedes(simd, bvh.blocks(), &self.ray(lane), id, self.id[lane])
            };
            if nearest {
                (self.id[lane], self.limit[lane]) = (id, t[lane]);
            }
        }
    }
}

/// A corner as one ray per lane sees it.
#[inline(always)]
fn sheared<S: Simd>(
    simd: S,
    block: &Block,
    corner: usize,
    lane: usize,
    turned: [mask32x16<S>; 2],
    origin: Triple<S>,
    shear: Triple<S>,
) -> (f32x16<S>, f32x16<S>, f32x16<S>) {
    let [x, y, z] = &block.vertex[corner];
    let vertex = [f32x16::splat(simd, x[lane]), f32x16::splat(simd, y[lane]), f32x16::splat(simd, z[lane])];
    let [x, y, z] = turn(vertex, turned[0], turned[1]);
    let (x, y, z) = (x - origin[0], y - origin[1], z - origin[2]);
    (z.mul_add(shear[0], x), z.mul_add(shear[1], y), z)
}
