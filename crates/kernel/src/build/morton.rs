//! Fast trees: triangles are sorted along a Morton curve and cut into full blocks, over which a binned SAH tree is
//! built [after Pantaleoni and Luebke 2010, "HLBVH", and Garanzha, Pantaleoni and McAllister 2011].
//!
//! Deviations: the treelets at the bottom are single blocks, and where the curve is cut is decided by the blocks'
//! areas: the cuts of each stretch of the curve are optimal. Deterministic for any number of threads.
use fearless_simd::{Level, Simd, dispatch, f32x8, prelude::*};
use glam::Vec3;
use rayon::prelude::*;

use super::{
    BuildOptions,
    binary::{BinaryNode, BinaryTree, LeafRule},
    binned,
    boxes::PackedBox,
    watch::Watch,
    wide::BlockRange,
};
use crate::layout::{LEAF_TRIANGLES, WIDTH};

/// Bits of a cell's number along each axis. With 28 bits of a primitive's place they fill a key.
const AXIS_BITS: u32 = 12;
const PLACE_BITS: u32 = 28;
/// A cell with more primitives than this is sorted by finer cells of its own …
const CROWD: usize = 64;
/// … down to this depth.
const MAX_DEPTH: u32 = 6;
/// Primitives per task.
const STRETCH: usize = 1 << 12;
/// What a block costs beside its area, in mean areas of full blocks: it keeps blocks full.
const BLOCK_COST: f32 = 0.5;

/// The rule for leaves of the tree over blocks: up to two.
pub(crate) const RULE: LeafRule = LeafRule { max: LEAF_TRIANGLES / WIDTH, block_shift: 0 };

/// Sorts `prims` (not empty) and builds the tree over blocks of them. Leaves are ranges of the list of blocks returned,
/// by [`RULE`].
pub(crate) fn build(
    level: Level,
    prims: &mut Vec<PackedBox>,
    options: &BuildOptions,
    watch: &Watch<'_>,
) -> (BinaryTree, Vec<BlockRange>) {
    *prims = sorted(prims, 0, watch);
    let starts = (0..prims.len()).step_by(STRETCH);
    let stretches: Vec<usize> = starts.collect();
    let cut = |&begin: &usize| {
        if watch.stopped() {
            return Vec::new();
        }
        let stretch = &prims[begin..prims.len().min(begin + STRETCH)];
        dispatch!(level, simd => cut(simd, stretch, begin))
    };
    let blocks: Vec<Block> = stretches.par_iter().map(cut).flatten_iter().collect();
    if watch.stopped() {
        return (BinaryTree { nodes: vec![BinaryNode::PAD; 2], runs: vec![0, 2] }, Vec::new());
    }
    let numbered = |(i, block): (usize, &Block)| block.bounds.with_tags([i as u32; 2]);
    let mut items: Vec<PackedBox> = blocks.par_iter().enumerate().map(numbered).collect();
    let nodes = binned::build(level, &mut items, RULE, options, watch);
    (nodes, items.iter().map(|item| blocks[item.id() as usize].range).collect())
}

/// A run of primitives that is tested together.
#[derive(Clone, Copy)]
struct Block {
    bounds: PackedBox,
    range: BlockRange,
}

/// The primitives in the order of the Morton codes of their centres.
fn sorted(prims: &[PackedBox], depth: u32, watch: &Watch<'_>) -> Vec<PackedBox> {
    let grid = Grid::new(prims);
    let key = |(place, prim): (usize, &PackedBox)| grid.code(prim) << PLACE_BITS | place as u64;
    let mut keys: Vec<u64> = prims.par_iter().enumerate().with_min_len(STRETCH).map(key).collect();
    if watch.stopped() {
        return prims.to_vec();
    }
    // The keys are all different, so the result does not depend on how they are sorted.
    keys.par_sort_unstable();
    let gather = |key: &u64| prims[(key & ((1 << PLACE_BITS) - 1)) as usize];
    let mut result: Vec<PackedBox> = keys.par_iter().with_min_len(STRETCH).map(gather).collect();
    if depth < MAX_DEPTH {
        let mut begin = 0;
        for cell in keys.chunk_by(|a, b| a >> PLACE_BITS == b >> PLACE_BITS) {
            let range = begin..begin + cell.len();
            begin = range.end;
            // All in one cell after a whole round of refinement: the centres are equal.
            if cell.len() > CROWD && cell.len() < keys.len() {
                let finer = sorted(&result[range.clone()], depth + 1, watch);
                result[range].copy_from_slice(&finer);
            }
        }
    }
    result
}

/// A cube of cells around all centres.
struct Grid {
    offset: Vec3,
    scale: f32,
}

impl Grid {
    fn new(prims: &[PackedBox]) -> Self {
        let of = |chunk: &[PackedBox]| {
            let centers = chunk.iter().map(|prim| prim.lo() + prim.hi());
            centers.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), c| (lo.min(c), hi.max(c)))
        };
        let join = |a: (Vec3, Vec3), b: (Vec3, Vec3)| (a.0.min(b.0), a.1.max(b.1));
        let nothing = || (Vec3::INFINITY, Vec3::NEG_INFINITY);
        let (offset, hi) = prims.par_chunks(STRETCH).map(of).reduce(nothing, join);
        let scale = (1 << AXIS_BITS) as f32 * 0.999_99 / (hi - offset).max_element();
        Self { offset, scale: if scale < f32::MAX { scale } else { 0.0 } }
    }

    fn code(&self, prim: &PackedBox) -> u64 {
        let cell = (prim.lo() + prim.hi() - self.offset) * self.scale;
        spread(cell.x as u64) | spread(cell.y as u64) << 1 | spread(cell.z as u64) << 2
    }
}

/// Moves bit k (of 12) to bit 3k.
fn spread(x: u64) -> u64 {
    let x = (x | x << 16) & 0x0f00_00ff;
    let x = (x | x << 8) & 0x0f00_f00f;
    let x = (x | x << 4) & 0x0_c30c_30c3;
    (x | x << 2) & 0x2_4924_9249
}

/// Cuts a stretch of the curve into blocks such that the sum of their costs is least, by dynamic programming.
#[inline(always)]
fn cut<S: Simd>(simd: S, prims: &[PackedBox], first: usize) -> Vec<Block> {
    let mut mean = 0.0;
    for full in prims.chunks(WIDTH) {
        mean += union(simd, full).half_area();
    }
    let fixed = BLOCK_COST * mean / prims.len().div_ceil(WIDTH) as f32;
    // For each place the least cost of all before it, and the length of the last block there.
    let (mut costs, mut lengths) = (vec![0.0_f32; prims.len() + 1], vec![0_u32; prims.len() + 1]);
    for end in 1..=prims.len() {
        let mut bounds = f32x8::splat(simd, f32::INFINITY);
        let (mut best, mut length) = (f32::INFINITY, 1);
        for back in 1..=WIDTH.min(end) {
            bounds = bounds.min(prims[end - back].load(simd));
            let cost = costs[end - back] + PackedBox(bounds.to_array()).half_area();
            if cost < best {
                (best, length) = (cost, back as u32);
            }
        }
        costs[end] = best + fixed;
        lengths[end] = length;
    }
    let mut blocks = Vec::with_capacity(prims.len() / 4);
    let mut end = prims.len();
    while end > 0 {
        let count = lengths[end];
        let begin = end - count as usize;
        let bounds = union(simd, &prims[begin..end]);
        blocks.push(Block { bounds, range: ((first + begin) as u32, count) });
        end = begin;
    }
    blocks.reverse();
    blocks
}

#[inline(always)]
fn union<S: Simd>(simd: S, prims: &[PackedBox]) -> PackedBox {
    let mut all = f32x8::splat(simd, f32::INFINITY);
    for prim in prims {
        all = all.min(prim.load(simd));
    }
    PackedBox(all.to_array())
}
