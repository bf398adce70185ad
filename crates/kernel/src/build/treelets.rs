//! Fast trees: triangles are sorted along a Morton curve, which is cut into blocks of up to 8 triangles and these into
//! treelets of up to 8 blocks, over which a binned SAH tree is built [after Pantaleoni and Luebke 2010, "HLBVH", and
//! Garanzha, Pantaleoni and McAllister 2011].
//!
//! Deviations: surface areas decide where the curve is cut. For blocks and treelets the cuts of each stretch of the curve
//! are optimal; a treelet is a binary tree, cut where that is cheapest, so that the collapse may open it. Deterministic for
//! any number of threads.
use std::ops::RangeInclusive;

use fearless_simd::{Level, Simd, dispatch, f32x8, mask32x8, prelude::*};
use rayon::prelude::*;

use super::{
    BuildOptions,
    binary::{BinaryNode, BinaryTree, Content, LeafRule},
    binned::{self, Bottom},
    boxes::PackedBox,
    morton,
    watch::Watch,
};
use crate::layout::{Block, WIDTH};

/// Primitives per task: a sixteenth of all, within these limits.
const STRETCH: RangeInclusive<usize> = 1 << 9..=1 << 12;
/// What a group costs beside its area, in mean areas of full groups: it keeps groups full.
const GROUP_COST: f32 = 0.5;
/// Lines in which a stretch is cut side by side, as every cut waits for the one before …
const LINES: usize = 4;
/// … and the least number of boxes in a line.
const LINE: usize = 64;

/// The triangles of a block; [`Block::NO_TRIANGLE`] behind the last.
type Numbers = [u32; WIDTH];

/// The rule for leaves: a block each.
pub(crate) const RULE: LeafRule = LeafRule { max: 1, block_shift: 0 };

/// Sorts `prims` (not empty) and builds the tree over blocks of them, which are returned too: leaves are ranges of these,
/// by [`RULE`].
pub(crate) fn build(
    level: Level,
    prims: &[PackedBox],
    options: &BuildOptions,
    watch: &Watch<'_>,
) -> (BinaryTree, Vec<Numbers>) {
    let order = morton::sorted(level, prims, watch);
    let stretch = (prims.len() / 16).clamp(*STRETCH.start(), *STRETCH.end());
    let stretches = order.par_chunks(stretch).map(|keys| {
        if watch.stopped() {
            return Stretch::default();
        }
        let prims: Vec<PackedBox> = keys.iter().map(|key| prims[key.place()]).collect();
        dispatch!(level, simd => Stretch::new(simd, &prims))
    });
    let stretches: Vec<Stretch> = stretches.collect();
    if watch.stopped() {
        let nothing = BinaryTree { nodes: vec![BinaryNode::PAD; 2], runs: vec![0, 2] };
        return (nothing, Vec::new());
    }
    let (mut blocks, mut treelets) = (Vec::new(), Treelets::default());
    let mut items = Vec::new();
    for Stretch { blocks: more, boxes, groups } in stretches {
        let before = blocks.len() as u32;
        for (bounds, Group { first, count }) in groups {
            items.push(bounds.with_tags([items.len() as u32; 2]));
            treelets.groups.push(Group { first: before + first, count });
        }
        blocks.extend(more);
        treelets.boxes.extend(boxes);
    }
    let builder = binned::Builder::new(level, items.len(), RULE, options, watch);
    (builder.over(treelets).build(&mut items), blocks)
}

/// A run in a list.
#[derive(Clone, Copy)]
struct Group {
    first: u32,
    count: u32,
}

impl Group {
    fn of<T>(self, list: &[T]) -> &[T] {
        &list[self.first as usize..(self.first + self.count) as usize]
    }
}

/// A part of the curve, cut.
#[derive(Default)]
struct Stretch {
    blocks: Vec<Numbers>,
    /// Of each block.
    boxes: Vec<PackedBox>,
    /// Blocks of each treelet, and the box around them.
    groups: Vec<(PackedBox, Group)>,
}

impl Stretch {
    #[inline(always)]
    fn new<S: Simd>(simd: S, prims: &[PackedBox]) -> Self {
        let mut cuts = Vec::with_capacity(prims.len() / 4);
        cut(simd, prims, &mut cuts);
        let (mut blocks, mut boxes) = (Vec::with_capacity(cuts.len()), Vec::with_capacity(cuts.len()));
        for group in &cuts {
            let prims = group.of(prims);
            let mut numbers = [Block::NO_TRIANGLE; WIDTH];
            for (number, prim) in numbers.iter_mut().zip(prims) {
                *number = prim.id();
            }
            blocks.push(numbers);
            boxes.push(union(simd, prims));
        }
        cuts.clear();
        cut(simd, &boxes, &mut cuts);
        let mut groups = Vec::with_capacity(cuts.len());
        for group in cuts {
            groups.push((union(simd, group.of(&boxes)), group));
        }
        Self { blocks, boxes, groups }
    }
}

/// Cuts a list into groups of up to 8 such that the sum of their costs is least in each line, by dynamic programming; the
/// groups go to `cuts`.
#[inline(always)]
fn cut<S: Simd>(simd: S, boxes: &[PackedBox], cuts: &mut Vec<Group>) {
    let mut mean = 0.0;
    for full in boxes.chunks(WIDTH) {
        mean += union(simd, full).half_area();
    }
    let fixed = GROUP_COST * mean / boxes.len().div_ceil(WIDTH) as f32;
    let length = boxes.len().div_ceil(LINES).max(LINE);
    // The length of the last group up to each box, if the cost up to there is least.
    let mut lengths = vec![0_u8; boxes.len()];
    let mut lines = [Line::new(simd); LINES];
    for at in 0..length {
        for (number, line) in lines.iter_mut().enumerate() {
            let place = number * length + at;
            if let Some(next) = boxes.get(place) {
                lengths[place] = line.step(simd, at, next, fixed);
            }
        }
    }
    for begin in (0..LINES).map(|line| line * length) {
        let mut end = (begin + length).min(boxes.len());
        let first = cuts.len();
        while end > begin {
            let count = u32::from(lengths[end - 1]);
            end -= count as usize;
            cuts.push(Group { first: end as u32, count });
        }
        cuts[first..].reverse();
    }
}

/// A list of boxes that is being cut: the eight groups that end at the last box so far, by the place of their first box
/// modulo 8.
#[derive(Clone, Copy)]
struct Line<S: Simd> {
    bounds: [f32x8<S>; 6],
    /// The least cost of all before each group.
    before: f32x8<S>,
    /// The least cost of all so far.
    cost: f32,
}

impl<S: Simd> Line<S> {
    #[inline(always)]
    fn new(simd: S) -> Self {
        let infinity = f32x8::splat(simd, f32::INFINITY);
        Self { bounds: [f32x8::splat(simd, 0.0); 6], before: infinity, cost: 0.0 }
    }

    /// Adds box number `at`; the length of the last group if all is to cost least.
    #[inline(always)]
    fn step(&mut self, simd: S, at: usize, next: &PackedBox, fixed: f32) -> u8 {
        let at = at % WIDTH;
        let starting = mask32x8::from_bitmask(simd, 1 << at);
        let PackedBox([x, y, z, _, minus_x, minus_y, minus_z, _]) = *next;
        for (bounds, of_next) in self.bounds.iter_mut().zip([x, y, z, minus_x, minus_y, minus_z]) {
            let of_next = f32x8::splat(simd, of_next);
            *bounds = starting.select(of_next, bounds.min(of_next));
        }
        self.before = starting.select(f32x8::splat(simd, self.cost), self.before);
        let [x, y, z, minus_x, minus_y, minus_z] = self.bounds;
        let (x, y, z) = (x + minus_x, y + minus_y, z + minus_z);
        let costs = self.before + (x * y + (y * z + z * x));
        let least = costs.reduce_min();
        self.cost = least + fixed;
        // Among equals the longest, which began first.
        let best = costs.simd_le(f32x8::splat(simd, least)).to_bitmask() as u8;
        8 - (best.rotate_right(at as u32 + 1).trailing_zeros() as u8).min(7)
    }
}

#[inline(always)]
fn union<S: Simd>(simd: S, prims: &[PackedBox]) -> PackedBox {
    let mut all = f32x8::splat(simd, f32::INFINITY);
    for prim in prims {
        all = all.min(prim.load(simd));
    }
    PackedBox(all.to_array())
}

/// What is below the binned tree.
#[derive(Default)]
struct Treelets {
    /// Of all blocks.
    boxes: Vec<PackedBox>,
    /// Blocks of each treelet.
    groups: Vec<Group>,
}

impl Bottom for Treelets {
    /// A binary tree that cuts the curve where that is cheapest by the surface area heuristic.
    #[inline(always)]
    fn add<S: Simd>(
        &self,
        simd: S,
        items: &[PackedBox],
        _: &binned::Range,
        nodes: &mut Vec<BinaryNode>,
        place: usize,
    ) {
        let mut open = [(place, self.groups[items[0].id() as usize]); WIDTH];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (place, Group { first, count }) = open[waiting % WIDTH];
            let boxes = Group { first, count }.of(&self.boxes);
            if count == 1 {
                nodes[place] = BinaryNode::new(&boxes[0], Content::Leaf { begin: first, count });
                continue;
            }
            let (bounds, left) = halve(simd, boxes);
            let children = nodes.len();
            nodes[place] = BinaryNode::new(&bounds, Content::Inner { children: children as u32, count });
            nodes.extend([BinaryNode::PAD; 2]);
            open[waiting % WIDTH] = (children + 1, Group { first: first + left, count: count - left });
            open[(waiting + 1) % WIDTH] = (children, Group { first, count: left });
            waiting += 2;
        }
    }
}

/// The box around 2 to 8 boxes, and how many of them go left where cutting the list costs least.
#[inline(always)]
fn halve<S: Simd>(simd: S, boxes: &[PackedBox]) -> (PackedBox, u32) {
    let empty = f32x8::splat(simd, f32::INFINITY);
    // Costs of the right side by the number of boxes on the left.
    let (mut bounds, mut right) = (empty, [0.0; WIDTH]);
    for (left, item) in boxes.iter().enumerate().skip(1).rev() {
        bounds = bounds.min(item.load(simd));
        right[left % WIDTH] = PackedBox(bounds.to_array()).half_area() * (boxes.len() - left) as f32;
    }
    let (mut bounds, mut best, mut count) = (empty, f32::INFINITY, 1);
    for (left, item) in boxes.iter().enumerate() {
        if left > 0 {
            let cost = PackedBox(bounds.to_array()).half_area() * left as f32 + right[left % WIDTH];
            if cost < best {
                (best, count) = (cost, left as u32);
            }
        }
        bounds = bounds.min(item.load(simd));
    }
    (PackedBox(bounds.to_array()), count)
}
