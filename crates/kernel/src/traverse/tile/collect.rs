//! From the triangles that a tile settled on to hits.
use fearless_simd::{prelude::*, u32x16};

use super::{
    Answers,
    work::{GROUP, Rays, Work},
};
use crate::{
    ray::PathId,
    tile::Tile,
    traverse::settle::{self, Lanes, MeshOf, Words},
    triangle_bvh::TriangleBvh,
};

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
    // Mostly there is nothing to compare with.
    let fresh = answers.found == [0; 4];
    let mut mesh = MeshOf::default();
    for g in 0..work.groups {
        let bits = if mask >> g & 1 != 0 { found(simd, work, g) } else { 0 };
        if bits == 0 {
            continue;
        }
        let gathered = settle::gather(simd, bvh, &work.id[g], bits, &mut mesh);
        let exact = settle::exact(simd, gathered.corners, &rays.lined(simd, g));
        let words = Words::new(&exact, &gathered);
        let mut t: Lanes = exact.t.into();
        let mut rest = bits;
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            let slot = rays.slot[(g * GROUP + lane) & (Tile::CAPACITY - 1)];
            let hit = words.hit(lane, path);
            if fresh {
                answers.put(slot, hit);
            } else {
                t[lane] = answers.merge(slot, hit);
            }
        }
        work.id[g] = [Work::NONE; GROUP];
        if more {
            work.settle_group(simd, rays, g, bits, &t);
        }
    }
    if more {
        work.update_far(simd);
    }
}

/// Marks the rays of `work` in the groups of `mask` that a triangle stopped, and makes room for the next.
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

/// Marks the rays of `work` that met what lets light through.
#[inline(always)]
pub(super) fn met(rays: Rays<'_>, work: &mut Work, answers: &mut Answers<'_>) {
    for (g, met) in work.met.iter_mut().enumerate() {
        while *met != 0 {
            answers.meet(rays.slot[(g * GROUP + met.trailing_zeros() as usize) & (Tile::CAPACITY - 1)]);
            *met &= *met - 1;
        }
    }
}

/// The lanes of group `g` that found a triangle.
#[inline(always)]
fn found<S: Simd>(simd: S, work: &Work, g: usize) -> u16 {
    let id = u32x16::load_array_ref(simd, &work.id[g]);
    id.simd_lt(u32x16::splat(simd, Work::NONE)).to_bitmask() as u16
}
