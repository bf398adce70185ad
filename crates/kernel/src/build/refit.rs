//! Refitting: new boxes and vertices for the same tree, bottom-up.
use fearless_simd::{Level, Simd, dispatch, f32x8, mask32x8, prelude::*};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{
    boxes::PackedBox,
    triangles::{BATCH, double_area_vector, read_vertices},
    wide::{WideTree, child_order, set_bounds},
};
use crate::{
    compact::CompactBlock,
    layout::{Block, Child, Node, WIDTH},
    mesh::Mesh,
    triangle_bvh::MAX_COORDINATE,
};

/// Reads the vertices of all blocks anew; the bounds of each block. Triangles that cannot be hit become points at the
/// origin, as in empty lanes, and do not count for the bounds.
pub(crate) fn blocks(level: Level, meshes: &[Mesh], starts: &[u32], blocks: &mut [Block]) -> Vec<PackedBox> {
    let mut bounds = vec![PackedBox::EMPTY; blocks.len()];
    let chunks = blocks.par_chunks_mut(BATCH).zip(bounds.par_chunks_mut(BATCH));
    chunks.for_each(|(blocks, bounds)| {
        dispatch!(level, simd => read(simd, meshes, starts, blocks, bounds));
    });
    bounds
}

/// Makes one of what [`blocks`] found at both ends of the shutter interval: a triangle that cannot be hit at one end is a
/// point at both, and boxes hold the whole way.
pub(crate) fn unite(
    opening: &mut [Block],
    closing: &mut [Block],
    bounds: &mut [PackedBox],
    ends: &[PackedBox],
) {
    let blocks = opening.par_iter_mut().zip(closing).with_min_len(BATCH);
    blocks.zip(bounds.par_iter_mut().zip(ends)).for_each(|((opening, closing), (bounds, end))| {
        *bounds = bounds.union(end);
        for lane in 0..WIDTH {
            let is_point = |block: &Block| block.corners(lane) == [[0.0; 3]; 3];
            if is_point(opening) != is_point(closing) {
                for block in [&mut *opening, &mut *closing] {
                    block.vertex.iter_mut().flatten().for_each(|row| row[lane] = 0.0);
                }
            }
        }
    });
}

/// As [`blocks`], for blocks that hold no vertices.
pub(crate) fn compact_blocks(
    level: Level,
    meshes: &[Mesh],
    starts: &[u32],
    blocks: &mut [CompactBlock],
) -> Vec<PackedBox> {
    let mut bounds = vec![PackedBox::EMPTY; blocks.len()];
    let chunks = blocks.par_chunks_mut(BATCH).zip(bounds.par_chunks_mut(BATCH));
    chunks.for_each(|(blocks, bounds)| {
        let numbered = |block: &CompactBlock| Block { triangle: block.triangles(), ..Block::EMPTY };
        let mut full: Vec<Block> = blocks.iter().map(numbered).collect();
        dispatch!(level, simd => read(simd, meshes, starts, &mut full, bounds));
        for (full, block) in full.iter().zip(blocks) {
            block.hide_points(full);
        }
    });
    bounds
}

/// Reads vertices, takes what cannot be hit out of blocks and finds their bounds.
#[inline(always)]
fn read<S: Simd>(simd: S, meshes: &[Mesh], starts: &[u32], blocks: &mut [Block], bounds: &mut [PackedBox]) {
    for (block, bounds) in blocks.iter_mut().zip(bounds) {
        read_vertices(simd, meshes, starts, block);
        let hittable = hittable(simd, block);
        let outside = f32x8::splat(simd, f32::INFINITY);
        let mut lanes = [f32::INFINITY; 8];
        for axis in 0..3 {
            let [a, b, c] = corners(simd, block, axis);
            let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
            // Adding zero turns −0 into +0, between which minima would choose by order.
            lanes[axis] = hittable.select(lo, outside).reduce_min() + 0.0;
            lanes[axis + 4] = -(hittable.select(hi, -outside).reduce_max() + 0.0);
        }
        *bounds = PackedBox(lanes);
        let zero = f32x8::splat(simd, 0.0);
        if !hittable.all_true() {
            for row in block.vertex.iter_mut().flatten() {
                hittable.select(f32x8::load_array_ref(simd, row), zero).store_array(row);
            }
        }
    }
}

/// The lanes whose triangles can be hit: all coordinates in range, and an area.
#[inline(always)]
fn hittable<S: Simd>(simd: S, block: &Block) -> mask32x8<S> {
    let limit = f32x8::splat(simd, MAX_COORDINATE);
    let [e, f] = [edges(simd, block, 1), edges(simd, block, 2)];
    let mut usable = f32x8::splat(simd, 0.0).simd_le(limit);
    let mut certain = limit.simd_lt(f32x8::splat(simd, 0.0));
    for axis in 0..3 {
        let [a, b, c] = corners(simd, block, axis);
        usable = usable & a.abs().simd_le(limit) & b.abs().simd_le(limit) & c.abs().simd_le(limit);
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        let (plus, minus) = (e[j] * f[k], e[k] * f[j]);
        // As in `triangles::has_area`.
        let doubt = (plus.abs() + minus.abs()) * 1.0e-6 + f32x8::splat(simd, 1.0e-36);
        certain |= (plus - minus).abs().simd_gt(doubt);
    }
    let (usable, certain) = (usable.to_bitmask() as u32, certain.to_bitmask() as u32);
    let mut good = usable & certain;
    let mut doubtful = usable & !certain;
    while doubtful != 0 {
        let lane = (doubtful.trailing_zeros() & 7) as usize;
        doubtful &= doubtful - 1;
        let [a, b, c] = block.corners(lane).map(Vec3::from_array);
        good |= u32::from(double_area_vector(a, b, c) != DVec3::ZERO) << lane;
    }
    mask32x8::from_bitmask(simd, u64::from(good))
}

#[inline(always)]
fn corners<S: Simd>(simd: S, block: &Block, axis: usize) -> [f32x8<S>; 3] {
    [
        f32x8::load_array_ref(simd, &block.vertex[0][axis]),
        f32x8::load_array_ref(simd, &block.vertex[1][axis]),
        f32x8::load_array_ref(simd, &block.vertex[2][axis]),
    ]
}

/// From the first corner to another.
#[inline(always)]
fn edges<S: Simd>(simd: S, block: &Block, corner: usize) -> [f32x8<S>; 3] {
    let [x, y, z] = [corners(simd, block, 0), corners(simd, block, 1), corners(simd, block, 2)];
    [x[corner] - x[0], y[corner] - y[0], z[corner] - z[0]]
}

/// What leaves come to.
pub(crate) trait Leaves: Sync {
    /// The box of a leaf, and what it costs beside a node visit.
    fn bounds_and_cost(&self, leaf: Child) -> (PackedBox, f32);
}

/// Leaves of blocks.
pub(crate) struct BlockLeaves<'a> {
    /// The boxes of all blocks.
    pub blocks: &'a [PackedBox],
    /// What a block test costs beside a node visit.
    pub block_cost: f32,
}

impl Leaves for BlockLeaves<'_> {
    #[inline(always)]
    fn bounds_and_cost(&self, leaf: Child) -> (PackedBox, f32) {
        let (first, end) = leaf.block_range();
        let bounds = self.blocks[first..end].iter().fold(PackedBox::EMPTY, |all, block| all.union(block));
        (bounds, (end - first) as f32 * self.block_cost)
    }
}

/// The largest coordinate magnitude per axis in a box; zero in an empty one.
pub(crate) fn extent(bounds: &PackedBox) -> [f32; 3] {
    if bounds.is_empty() { [0.0; 3] } else { bounds.lo().abs().max(bounds.hi().abs()).to_array() }
}

/// New boxes for all nodes, from those of the leaves; the bounds of the whole.
pub(crate) fn nodes(level: Level, tree: &mut WideTree, leaves: &impl Leaves) -> PackedBox {
    // The parts below the top refer to nothing but themselves and blocks.
    let mut parts = Vec::with_capacity(tree.parts.len());
    let mut rest = &mut tree.nodes[..];
    for (&begin, &end) in tree.parts.iter().zip(tree.parts.iter().skip(1)) {
        let (part, beyond) = rest.split_at_mut((end - begin) as usize);
        parts.push(Part { nodes: part, begin, roots: &[] });
        rest = beyond;
    }
    let mut parts = parts.into_iter();
    let Some(top) = parts.next() else { return PackedBox::EMPTY };
    let below: Vec<Refit> =
        parts.collect::<Vec<_>>().into_par_iter().map(|part| part.refit(level, leaves)).collect();
    let roots: Vec<(u32, PackedBox)> =
        tree.parts.iter().skip(1).copied().zip(below.iter().map(|part| part.bounds)).collect();
    let top = Part { roots: &roots, ..top }.refit(level, leaves);
    let bounds = top.bounds;
    let area = f64::from(bounds.half_area());
    let cost: f64 = top.cost + below.iter().map(|part| part.cost).sum::<f64>();
    tree.sah = if area > 0.0 && area.is_finite() { (cost / area) as f32 } else { 0.0 };
    tree.extent = extent(&bounds);
    bounds
}

/// Nodes that lie together, children behind their parents.
struct Part<'a> {
    nodes: &'a mut [Node],
    /// Index of the first of them in the whole tree.
    begin: u32,
    /// The first nodes of the parts behind, with their bounds.
    roots: &'a [(u32, PackedBox)],
}

/// What a refitted part comes to.
struct Refit {
    bounds: PackedBox,
    /// Σ half area · cost.
    cost: f64,
}

impl Part<'_> {
    fn refit(self, level: Level, leaves: &impl Leaves) -> Refit {
        dispatch!(level, simd => self.refit_simd(simd, leaves))
    }

    #[inline(always)]
    fn refit_simd<S: Simd>(self, simd: S, leaves: &impl Leaves) -> Refit {
        let mut bounds = vec![PackedBox::EMPTY; self.nodes.len()];
        let mut cost = 0.0;
        for index in (0..self.nodes.len()).rev() {
            let mut whole = f32x8::splat(simd, f32::INFINITY);
            let node = &mut self.nodes[index];
            let mut count = 0;
            for lane in 0..WIDTH {
                let child = node.child[lane];
                if child == Child::NONE {
                    break;
                }
                count += 1;
                let child_box = if child.is_leaf() {
                    let (leaf, leaf_cost) = leaves.bounds_and_cost(child);
                    if !leaf.is_empty() {
                        cost += f64::from(leaf.half_area() * leaf_cost);
                    }
                    leaf
                } else {
                    self.roots
                        .binary_search_by_key(&child.0, |&(root, _)| root)
                        .map_or_else(|_| bounds[(child.0 - self.begin) as usize], |found| self.roots[found].1)
                };
                set_bounds(node, lane, &child_box);
                whole = whole.min(child_box.load(simd));
            }
            node.order = child_order(simd, node, count);
            bounds[index] = PackedBox(whole.to_array());
            if !bounds[index].is_empty() {
                cost += f64::from(bounds[index].half_area());
            }
        }
        Refit { bounds: bounds.first().copied().unwrap_or(PackedBox::EMPTY), cost }
    }
}
