//! From the triangles that a tile settled on to hits.
use fearless_simd::{f32x16, prelude::*, u32x16};

use super::{
    Answers,
    work::{GROUP, Rays, Work},
};
use crate::{
    layout::WIDTH,
    ray::PathId,
    tile::Tile,
    traverse::settle::{self, Gathered, Lined, MeshOf, Words},
    triangle_bvh::TriangleBvh,
};

/// Up to so many lanes that share a triangle are filled one by one.
const FEW_LANES: u32 = 3;

/// Writes the hits of the rays of `work` in the groups of `mask` that found a triangle, and makes room for the next. If
/// there is `more` to come, it is looked for as far as to where something may coincide with them.
#[expect(
    clippy::too_many_arguments,
    reason = "the rays, what they meet and where the answers go; a struct would only rename them"
)]
#[inline(always)]
pub(super) fn hits<S: Simd>(
    simd: S,
    bvh: &TriangleBvh,
    path: PathId,
    rays: Rays<'_>,
    mask: u16,
    work: &mut Work,
    answers: &mut Answers<'_>,
    more: bool,
) {
    let mut gathered = Gathered::EMPTY;
    let mut mesh = MeshOf::default();
    for g in 0..work.groups {
        let bits = if mask >> g & 1 != 0 { found(simd, work, g) } else { 0 };
        if bits == 0 {
            continue;
        }
        gather(simd, &mut gathered, bvh, &work.id[g], bits, &mut mesh);
        let words = intersect(simd, &gathered, rays, g);
        let mut rest = bits;
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            let i = (g * GROUP + lane) & (Tile::CAPACITY - 1);
            let t = answers.put(rays.slot[i], words.hit(lane, path));
            if more {
                work.settle(rays, i, t);
            }
        }
        work.id[g] = [Work::NONE; GROUP];
        if more {
            work.update_reach(simd, g);
        }
    }
    if more {
        work.update_far(simd);
    }
}

/// Marks the rays of `work` in the groups of `mask` that found a triangle, and makes room for the next.
#[inline(always)]
pub(super) fn occluded<S: Simd>(
    simd: S,
    rays: Rays<'_>,
    mask: u16,
    work: &mut Work,
    answers: &mut Answers<'_>,
) {
    for g in 0..work.groups {
        let mut rest = if mask >> g & 1 != 0 { found(simd, work, g) } else { 0 };
        if rest == 0 {
            continue;
        }
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            answers.set(rays.slot[g * GROUP + lane]);
        }
        work.id[g] = [Work::NONE; GROUP];
    }
}

/// The lanes of group `g` that found a triangle.
#[inline(always)]
fn found<S: Simd>(simd: S, work: &Work, g: usize) -> u16 {
    let id = u32x16::load_array_ref(simd, &work.id[g]);
    id.simd_lt(u32x16::splat(simd, Work::NONE)).to_bitmask() as u16
}

/// Takes the triangles `ids` of the lanes in `bits`; triangles that several lanes share are read once.
#[inline(always)]
fn gather<S: Simd>(
    simd: S,
    gathered: &mut Gathered,
    bvh: &TriangleBvh,
    ids: &[u32; GROUP],
    bits: u16,
    mesh: &mut MeshOf,
) {
    let all = u32x16::load_array_ref(simd, ids);
    let mut rest = bits;
    while rest != 0 {
        let lane = (rest.trailing_zeros() & 15) as usize;
        let id = ids[lane];
        let mut place = None;
        let block = bvh.blocks().get(id as usize / WIDTH, &mut place);
        let from = id as usize % WIDTH;
        let same = all.simd_eq(u32x16::splat(simd, id));
        let sharing = same.to_bitmask() as u16;
        for (corner, vertex) in gathered.corners.iter_mut().zip(&block.vertex) {
            for (lanes, axis) in corner.iter_mut().zip(vertex) {
                let value = axis[from];
                if sharing.count_ones() > FEW_LANES {
                    let before = f32x16::load_array_ref(simd, lanes);
                    *lanes = same.select(f32x16::splat(simd, value), before).into();
                } else {
                    lanes[lane] = value;
                }
            }
        }
        let (geometry, primitive) = mesh.locate(bvh, block.triangle[from]);
        if sharing.count_ones() > FEW_LANES {
            for (lanes, value) in [(&mut gathered.geometry, geometry), (&mut gathered.primitive, primitive)] {
                let before = u32x16::load_array_ref(simd, lanes);
                *lanes = same.select(u32x16::splat(simd, value), before).into();
            }
            rest &= !sharing;
        } else {
            gathered.geometry[lane] = geometry;
            gathered.primitive[lane] = primitive;
            rest &= rest - 1;
        }
    }
}

/// The hits of group `g` in their triangles.
#[inline(always)]
fn intersect<S: Simd>(simd: S, gathered: &Gathered, rays: Rays<'_>, g: usize) -> Words {
    let [ox, oy, oz] = rays.origin.to_array();
    let rays = Lined {
        origin: [f32x16::splat(simd, ox), f32x16::splat(simd, oy), f32x16::splat(simd, oz)],
        direction: [
            lanes(simd, &rays.tile.direction[0], g),
            lanes(simd, &rays.tile.direction[1], g),
            lanes(simd, &rays.tile.direction[2], g),
        ],
        t_min: lanes(simd, &rays.tile.t_min, g),
        end: f32x16::from_bits(lanes(simd, &rays.tile.t_max, g).to_bits() - 1),
    };
    Words::new(simd, &settle::exact(simd, gathered.corners(simd), &rays), gathered)
}

#[inline(always)]
fn lanes<S: Simd>(simd: S, values: &[f32; Tile::CAPACITY], g: usize) -> f32x16<S> {
    f32x16::load_array_ref(simd, &values.as_chunks::<GROUP>().0[g])
}
