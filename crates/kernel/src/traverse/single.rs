//! One ray through one 8-wide tree of triangles.
use fearless_simd::{f32x8, prelude::*};

use super::{
    local::{LocalRay, behind},
    settle::{self, CLOSE},
    shear::Shear,
    slab::Slab,
    stack::Stack,
};
use crate::{
    compact::BlockSource,
    layout::{Child, WIDTH},
    through::Screen,
    triangle_bvh::TriangleBvh,
};

/// The triangle that a traversal settled on, or none yet.
#[derive(Clone, Copy, Debug)]
pub(super) struct Best {
    /// Its distance, or the last one that counts.
    pub t: f32,
    /// `block · 8 + lane`, or [`Best::NONE`].
    pub id: u32,
}

impl Best {
    pub(super) const NONE: u32 = u32::MAX;

    /// Nothing yet, up to the distance `limit`, which counts.
    #[inline(always)]
    pub(super) fn up_to(limit: f32) -> Self {
        Self { t: limit, id: Self::NONE }
    }

    /// The last distance at which a triangle may still be the nearest one.
    #[inline(always)]
    fn limit(self, ray: &LocalRay) -> f32 {
        if self.id == Self::NONE { self.t } else { (self.t + self.t * CLOSE).min(ray.end) }
    }

    /// Whether triangle `id` at `t`, up to [`Best::limit`], is to be taken instead.
    #[inline(always)]
    fn yields_to<S: Simd>(self, simd: S, blocks: impl BlockSource, ray: &LocalRay, t: f32, id: u32) -> bool {
        if self.id == Self::NONE || (t - self.t).abs() > self.t * CLOSE {
            return t <= self.t;
        }
        settle::precedes(simd, blocks, ray, id, self.id)
    }
}

/// The closest triangle with `t_min < t <= limit` in the subtree `start`.
#[inline(always)]
pub(super) fn closest<S: Simd>(
    simd: S,
    (bvh, start): (&TriangleBvh, Child),
    blocks: impl BlockSource,
    ray: &LocalRay,
    limit: f32,
    stack: &mut Stack,
) -> Option<Best> {
    if bvh.tree.is_empty() {
        return None;
    }
    let slab = Slab::new(simd, ray, &bvh.tree);
    let shear = Shear::new(simd, ray);
    let best = Best::up_to(limit);
    let best = closest_below(simd, bvh, blocks, &slab, &shear, start, best, stack);
    (best.id != Best::NONE).then_some(best)
}

/// As [`closest`], in the subtree `start`, by a ray that has a `best` from elsewhere in the tree.
#[expect(
    clippy::too_many_arguments,
    reason = "a ray set up for boxes and triangles, and the tree in two parts"
)]
#[inline(always)]
pub(super) fn closest_below<S: Simd>(
    simd: S,
    bvh: &TriangleBvh,
    blocks: impl BlockSource,
    slab: &Slab<S>,
    shear: &Shear<S>,
    start: Child,
    best: Best,
    stack: &mut Stack,
) -> Best {
    let nodes = bvh.tree.view();
    let mark = stack.mark();
    let mut best = best;
    let mut reach = behind(best.t);
    let mut current = start;
    loop {
        if current.is_leaf() {
            let (first, end) = current.block_range();
            for block in first..end {
                closest_in_block(simd, shear, blocks, block, &mut best);
            }
            reach = behind(best.t);
        } else {
            let mut place = None;
            let node = nodes.get(simd, current.0 as usize, &mut place);
            let (enter, bits) = slab.test(node, f32x8::splat(simd, reach));
            if bits & bits.wrapping_sub(1) != 0 {
                current = stack.push_sorted(&enter.to_array(), &node.child, bits);
                continue;
            }
            if bits != 0 {
                current = node.child[(bits.trailing_zeros() & 7) as usize];
                continue;
            }
        }
        match stack.pop(mark, reach) {
            Some(next) => current = next,
            None => return best,
        }
    }
}

#[inline(always)]
fn closest_in_block<S: Simd>(
    simd: S,
    shear: &Shear<S>,
    blocks: impl BlockSource,
    block: usize,
    best: &mut Best,
) {
    let (t, mut bits) =
        shear.test(blocks.block(block, &mut None), f32x8::splat(simd, best.limit(&shear.ray)));
    if bits == 0 {
        return;
    }
    let t = t.to_array();
    while bits != 0 {
        let lane = (bits.trailing_zeros() & 7) as usize;
        bits &= bits - 1;
        let id = (block * WIDTH + lane) as u32;
        if best.yields_to(simd, blocks, &shear.ray, t[lane], id) {
            *best = Best { t: t[lane], id };
        }
    }
}

/// Whether any triangle of the subtree lies in the ray's interval. With `PAST` those that let light through do not count,
/// and are noted in `met`.
#[inline(always)]
pub(super) fn any<S: Simd, const PAST: bool>(
    simd: S,
    screen: Screen<'_>,
    blocks: impl BlockSource,
    ray: &LocalRay,
    met: &mut bool,
    stack: &mut Stack,
) -> bool {
    let tree = &screen.bvh.tree;
    if tree.is_empty() {
        return false;
    }
    let slab = Slab::new(simd, ray, tree);
    let shear = Shear::new(simd, ray);
    any_below::<S, PAST>(simd, screen, blocks, &slab, &shear, screen.start, ray.end, met, stack)
}

/// As [`any`], from `start` on instead, up to the distance `limit`, which counts.
#[expect(
    clippy::too_many_arguments,
    reason = "a ray set up for boxes and triangles, and the tree in two parts"
)]
#[inline(always)]
pub(super) fn any_below<S: Simd, const PAST: bool>(
    simd: S,
    screen: Screen<'_>,
    blocks: impl BlockSource,
    slab: &Slab<S>,
    shear: &Shear<S>,
    start: Child,
    limit: f32,
    met: &mut bool,
    stack: &mut Stack,
) -> bool {
    let nodes = screen.bvh.tree.view();
    let limits = f32x8::splat(simd, limit);
    let mark = stack.mark();
    let mut current = start;
    loop {
        if current.is_leaf() {
            let (first, end) = current.block_range();
            for block in first..end {
                let mut place = None;
                let triangles = blocks.block(block, &mut place);
                let (_, bits) = shear.test(triangles, limits);
                let stopped = if PAST { screen.stops(&triangles.triangle, bits, met) } else { bits != 0 };
                if stopped {
                    stack.cut(mark);
                    return true;
                }
            }
        } else {
            let mut place = None;
            let node = nodes.get(simd, current.0 as usize, &mut place);
            let (enter, bits) = slab.test(node, limits);
            if bits & bits.wrapping_sub(1) != 0 {
                current = stack.push_sorted(&enter.to_array(), &node.child, bits);
                continue;
            }
            if bits != 0 {
                current = node.child[(bits.trailing_zeros() & 7) as usize];
                continue;
            }
        }
        match stack.pop(mark, limit) {
            Some(next) => current = next,
            None => return false,
        }
    }
}
