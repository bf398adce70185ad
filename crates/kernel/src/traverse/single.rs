//! One ray through one 8-wide tree of triangles.
use fearless_simd::{f32x8, prelude::*};

use super::{local::LocalRay, shear::Shear, slab::Slab, stack::Stack};
use crate::{compact::BlockSource, layout::Child, triangle_bvh::TriangleBvh};

/// A triangle that a traversal settled on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    pub t: f32,
    pub block: usize,
    pub lane: usize,
}

/// The closest triangle with `t_min < t < t_max`.
#[inline(always)]
pub(super) fn closest<S: Simd>(
    simd: S,
    bvh: &TriangleBvh,
    blocks: impl BlockSource,
    ray: &LocalRay,
    t_max: f32,
    stack: &mut Stack,
) -> Option<Candidate> {
    if bvh.tree.is_empty() {
        return None;
    }
    let slab = Slab::new(simd, ray, bvh.tree.extent);
    let shear = Shear::new(simd, ray);
    closest_below(simd, bvh, blocks, &slab, &shear, Child::inner(0), t_max, stack)
}

/// As [`closest`], in the subtree `start`.
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
    t_max: f32,
    stack: &mut Stack,
) -> Option<Candidate> {
    let nodes = bvh.tree.view();
    let mark = stack.mark();
    let mut best = None;
    let mut t_max = t_max;
    let mut current = start;
    loop {
        if current.is_leaf() {
            let (first, end) = current.block_range();
            for block in first..end {
                closest_in_block(simd, shear, blocks, block, &mut t_max, &mut best);
            }
        } else {
            let mut place = None;
            let node = nodes.get(simd, current.0 as usize, &mut place);
            let (enter, bits) = slab.test(node, f32x8::splat(simd, t_max));
            if bits & bits.wrapping_sub(1) != 0 {
                current = stack.push_sorted(&enter.to_array(), &node.child, bits);
                continue;
            }
            if bits != 0 {
                current = node.child[(bits.trailing_zeros() & 7) as usize];
                continue;
            }
        }
        match stack.pop(mark, t_max) {
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
    t_max: &mut f32,
    best: &mut Option<Candidate>,
) {
    let (t, mut bits) = shear.test(blocks.block(block, &mut None), f32x8::splat(simd, *t_max));
    if bits == 0 {
        return;
    }
    let t = t.to_array();
    while bits != 0 {
        let lane = (bits.trailing_zeros() & 7) as usize;
        bits &= bits - 1;
        if t[lane] < *t_max {
            *t_max = t[lane];
            *best = Some(Candidate { t: t[lane], block, lane });
        }
    }
}

/// Whether any triangle has `t_min < t < t_max`.
#[inline(always)]
pub(super) fn any<S: Simd>(
    simd: S,
    bvh: &TriangleBvh,
    blocks: impl BlockSource,
    ray: &LocalRay,
    t_max: f32,
    stack: &mut Stack,
) -> bool {
    if bvh.tree.is_empty() {
        return false;
    }
    let slab = Slab::new(simd, ray, bvh.tree.extent);
    let shear = Shear::new(simd, ray);
    any_below(simd, bvh, blocks, &slab, &shear, Child::inner(0), t_max, stack)
}

/// As [`any`], in the subtree `start`.
#[expect(
    clippy::too_many_arguments,
    reason = "a ray set up for boxes and triangles, and the tree in two parts"
)]
#[inline(always)]
pub(super) fn any_below<S: Simd>(
    simd: S,
    bvh: &TriangleBvh,
    blocks: impl BlockSource,
    slab: &Slab<S>,
    shear: &Shear<S>,
    start: Child,
    t_max: f32,
    stack: &mut Stack,
) -> bool {
    let nodes = bvh.tree.view();
    let limit = f32x8::splat(simd, t_max);
    let mark = stack.mark();
    let mut current = start;
    loop {
        if current.is_leaf() {
            let (first, end) = current.block_range();
            for block in first..end {
                if shear.test(blocks.block(block, &mut None), limit).1 != 0 {
                    stack.cut(mark);
                    return true;
                }
            }
        } else {
            let mut place = None;
            let node = nodes.get(simd, current.0 as usize, &mut place);
            let (enter, bits) = slab.test(node, limit);
            if bits & bits.wrapping_sub(1) != 0 {
                current = stack.push_sorted(&enter.to_array(), &node.child, bits);
                continue;
            }
            if bits != 0 {
                current = node.child[(bits.trailing_zeros() & 7) as usize];
                continue;
            }
        }
        match stack.pop(mark, t_max) {
            Some(next) => current = next,
            None => return false,
        }
    }
}
