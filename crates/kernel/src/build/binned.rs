//! Binary trees by binned SAH [Wald 2007, "On fast construction of SAH-based bounding volume hierarchies"].
//!
//! Deviations: a node's references are partitioned without branches, in the same pass that finds the bounds of the
//! children's centres. Deterministic for any number of threads and any instruction set: how work is cut depends on
//! counts alone, bins are merged with minima and counts, which do not depend on order, and no operation is fused.
use fearless_simd::{Level, Simd, dispatch, f32x4, f32x8, i32x4, prelude::*};
use rayon::prelude::*;

use super::{
    BuildOptions,
    binary::{BinaryNode, BinaryTree, Content, LeafRule, Piece},
    boxes::{PackedBox, doubled_center, half_areas},
    watch::Watch,
};

/// Primitives per task where nothing else is said.
const TASK: usize = 4096;
/// Levels of a task that count as work: what progress is weighted by.
pub(super) const TASK_LEVELS: u64 = 8;
/// From this many primitives on, the passes over one node are spread over threads, in parts of at least this size.
const PARALLEL: usize = 1 << 16;
/// From this depth on ranges are halved by count, so that no input makes the tree deeper than about 64.
const SAH_DEPTH: u32 = 40;
pub(crate) const MAX_BINS: usize = 32;

/// Builds the tree over `prims` (not empty) and reorders them so that each leaf is a range. If `watch` says that the
/// work was cancelled, the result is unfinished.
pub(crate) fn build(
    level: Level,
    prims: &mut [PackedBox],
    rule: LeafRule,
    options: &BuildOptions,
    watch: &Watch<'_>,
) -> BinaryTree {
    Builder::new(level, prims.len(), rule, options, watch).build(prims)
}

/// Bounds of all primitives and of their doubled centres.
pub(super) fn bounds(level: Level, prims: &[PackedBox], watch: &Watch<'_>) -> (PackedBox, PackedBox) {
    let both = |a: (PackedBox, PackedBox), b: (PackedBox, PackedBox)| (a.0.union(&b.0), a.1.union(&b.1));
    let empty = || (PackedBox::EMPTY, PackedBox::EMPTY);
    let of = |chunk| {
        if watch.stopped() { empty() } else { dispatch!(level, simd => bounds_of(simd, chunk)) }
    };
    prims.par_chunks(TASK).map(of).reduce(empty, both)
}

/// A subtree to build.
#[derive(Clone, Copy)]
pub(super) struct Range {
    /// First reference in the whole list.
    pub begin: u32,
    pub count: u32,
    pub depth: u32,
    pub bounds: PackedBox,
    /// Bounds of the doubled centres.
    pub centers: PackedBox,
}

/// How a range is divided: bins `..bin` of `axis` go left.
#[derive(Clone, Copy)]
pub(super) struct Split {
    axis: usize,
    bin: i32,
    pub left: PackedBox,
    pub right: PackedBox,
    /// Σ half area · blocks of both sides.
    pub cost: f32,
}

/// What takes the place of leaves.
pub(super) trait Bottom: Sync {
    /// Puts what stands for a leaf into `nodes[place]`, and what is below it behind the last node.
    fn add<S: Simd>(
        &self,
        simd: S,
        prims: &[PackedBox],
        leaf: &Range,
        nodes: &mut Vec<BinaryNode>,
        place: usize,
    );
}

/// Leaves as they are.
pub(super) struct Leaves;

impl Bottom for Leaves {
    #[inline(always)]
    fn add<S: Simd>(&self, _: S, _: &[PackedBox], leaf: &Range, nodes: &mut Vec<BinaryNode>, place: usize) {
        let content = Content::Leaf { begin: leaf.begin, count: leaf.count };
        nodes[place] = BinaryNode::new(&leaf.bounds, content);
    }
}

pub(super) struct Builder<'a, B = Leaves> {
    pub level: Level,
    pub rule: LeafRule,
    pub options: BuildOptions,
    pub watch: &'a Watch<'a>,
    /// Up to so many primitives a subtree is one task.
    pub task: usize,
    pub bottom: B,
}

impl<'a> Builder<'a> {
    /// Of so many primitives.
    pub(super) fn new(
        level: Level,
        count: usize,
        rule: LeafRule,
        options: &BuildOptions,
        watch: &'a Watch<'a>,
    ) -> Self {
        let task = (count / 64).clamp(TASK / 32, TASK);
        Self { level, rule, options: *options, watch, task, bottom: Leaves }
    }

    /// With something else in place of leaves.
    pub(super) fn over<B: Bottom>(self, bottom: B) -> Builder<'a, B> {
        let Self { level, rule, options, watch, task, .. } = self;
        Builder { level, rule, options, watch, task, bottom }
    }
}

impl<B: Bottom> Builder<'_, B> {
    /// See [`build`].
    pub(super) fn build(&self, prims: &mut [PackedBox]) -> BinaryTree {
        self.watch.expect(self.work(prims.len()));
        let whole = self.whole(prims);
        self.top(prims, whole).assemble()
    }

    /// Expected work in primitives times levels.
    pub(super) fn work(&self, count: usize) -> u64 {
        let top_levels = (count / self.task + 1).ilog2() + 1;
        (u64::from(top_levels) + TASK_LEVELS) * count as u64
    }

    /// The range of all primitives.
    pub(super) fn whole(&self, prims: &[PackedBox]) -> Range {
        let (bounds, centers) = bounds(self.level, prims, self.watch);
        Range { begin: 0, count: prims.len() as u32, depth: 0, bounds, centers }
    }

    /// A range of any size.
    pub(super) fn top(&self, prims: &mut [PackedBox], range: Range) -> Piece {
        if self.watch.stopped() {
            return Piece::task(vec![BinaryNode::PAD; 2]);
        }
        if prims.len() <= self.task {
            let mut nodes = Vec::with_capacity(prims.len() / 2 + 2);
            nodes.extend([BinaryNode::PAD; 2]);
            self.grow(prims, range, &mut nodes, 0);
            self.watch.advance(TASK_LEVELS * prims.len() as u64);
            return Piece::task(nodes);
        }
        let [left, right] = self.divide(prims, &range);
        self.watch.advance(prims.len() as u64);
        let (left_prims, right_prims) = prims.split_at_mut(left.count as usize);
        let (left, right) = rayon::join(|| self.top(left_prims, left), || self.top(right_prims, right));
        Piece::join(&range.bounds, range.count, left, right)
    }

    /// A whole subtree by this thread alone: its root goes to `nodes[place]`, the rest to the end.
    pub(super) fn grow(
        &self,
        prims: &mut [PackedBox],
        range: Range,
        nodes: &mut Vec<BinaryNode>,
        place: usize,
    ) {
        dispatch!(self.level, simd => self.grow_by(simd, prims, range, nodes, place));
    }

    #[inline(always)]
    fn grow_by<S: Simd>(
        &self,
        simd: S,
        prims: &mut [PackedBox],
        range: Range,
        nodes: &mut Vec<BinaryNode>,
        place: usize,
    ) {
        let mut bins = Bins::empty();
        let mut open = vec![(place, range)];
        let first = range.begin;
        while let Some((place, range)) = open.pop() {
            let begin = (range.begin - first) as usize;
            let prims = &mut prims[begin..begin + range.count as usize];
            let Some([left, right]) = divide_small(simd, prims, &range, self.rule, &self.options, &mut bins)
            else {
                self.bottom.add(simd, prims, &range, nodes, place);
                continue;
            };
            let children = nodes.len();
            let content = Content::Inner { children: children as u32, count: range.count };
            nodes[place] = BinaryNode::new(&range.bounds, content);
            nodes.extend([BinaryNode::PAD; 2]);
            open.extend([(children + 1, right), (children, left)]);
        }
    }

    /// Divides a range that is too large for a leaf, on several threads if it is worth it.
    fn divide(&self, prims: &mut [PackedBox], range: &Range) -> [Range; 2] {
        match self.best_split(prims, range) {
            Some((binning, split)) => self.divide_by(prims, range, &binning, &split),
            None => self.halve(prims, range),
        }
    }

    /// The best division by object, if there is any.
    pub(super) fn best_split(&self, prims: &[PackedBox], range: &Range) -> Option<(Binning, Split)> {
        if range.depth >= SAH_DEPTH {
            return None;
        }
        let binning = Binning::new(range, &self.options);
        let bins = self.fill(prims, &binning);
        let split = dispatch!(self.level, simd => bins.best_split(simd, binning.bins, self.rule));
        split.map(|split| (binning, split))
    }

    pub(super) fn divide_by(
        &self,
        prims: &mut [PackedBox],
        range: &Range,
        binning: &Binning,
        split: &Split,
    ) -> [Range; 2] {
        let (left, centers) = self.partition(prims, binning, split);
        range.divided(left, [split.left, split.right], centers)
    }

    pub(super) fn halve(&self, prims: &mut [PackedBox], range: &Range) -> [Range; 2] {
        dispatch!(self.level, simd => halve(simd, prims, range))
    }

    fn fill(&self, prims: &[PackedBox], binning: &Binning) -> Bins {
        if prims.len() <= TASK {
            let mut bins = Bins::empty();
            dispatch!(self.level, simd => bins.fill(simd, prims, binning));
            return bins;
        }
        let chunks = prims.par_chunks(PARALLEL / 4);
        let fill = |chunk: &[PackedBox]| {
            let mut bins = Bins::empty();
            if !self.watch.stopped() {
                dispatch!(self.level, simd => bins.fill(simd, chunk, binning));
            }
            bins
        };
        chunks.map(fill).reduce(Bins::empty, Bins::merged)
    }

    /// Partitions halves on their own and swaps the inner parts.
    fn partition(
        &self,
        prims: &mut [PackedBox],
        binning: &Binning,
        split: &Split,
    ) -> (usize, [PackedBox; 2]) {
        if prims.len() < 2 * PARALLEL || self.watch.stopped() {
            return dispatch!(self.level, simd => partition(simd, prims, binning, split));
        }
        let middle = prims.len() / 2;
        let (low, high) = prims.split_at_mut(middle);
        let ((low_left, a), (high_left, b)) =
            rayon::join(|| self.partition(low, binning, split), || self.partition(high, binning, split));
        let swapped = (middle - low_left).min(high_left);
        low[low_left..][..swapped].swap_with_slice(&mut high[high_left - swapped..high_left]);
        (low_left + high_left, [a[0].union(&b[0]), a[1].union(&b[1])])
    }
}

impl Range {
    fn divided(&self, left: usize, bounds: [PackedBox; 2], centers: [PackedBox; 2]) -> [Self; 2] {
        let (left, depth) = (left as u32, self.depth + 1);
        [
            Self { begin: self.begin, count: left, depth, bounds: bounds[0], centers: centers[0] },
            Self {
                begin: self.begin + left,
                count: self.count - left,
                depth,
                bounds: bounds[1],
                centers: centers[1],
            },
        ]
    }
}

/// Divides a range, or says that it should be a leaf.
#[inline(always)]
fn divide_small<S: Simd>(
    simd: S,
    prims: &mut [PackedBox],
    range: &Range,
    rule: LeafRule,
    options: &BuildOptions,
    bins: &mut Bins,
) -> Option<[Range; 2]> {
    let count = prims.len();
    // Hardly ever would two blocks that are less full be cheaper.
    if rule.blocks(count) == 1 {
        return None;
    }
    let may_be_leaf = count <= rule.max;
    if range.depth < SAH_DEPTH {
        let binning = Binning::new(range, options);
        bins.clear(binning.bins);
        bins.fill(simd, prims, &binning);
        if let Some(split) = bins.best_split(simd, binning.bins, rule) {
            let area = range.bounds.half_area();
            let split_cost = options.traversal_cost * area + options.intersection_cost * split.cost;
            let leaf_cost = options.intersection_cost * rule.blocks(count) as f32 * area;
            if may_be_leaf && leaf_cost <= split_cost {
                return None;
            }
            let (left, centers) = partition(simd, prims, &binning, &split);
            return Some(range.divided(left, [split.left, split.right], centers));
        }
    }
    if may_be_leaf { None } else { Some(halve(simd, prims, range)) }
}

/// Maps doubled centres to bins on all three axes at once.
#[derive(Clone, Copy)]
pub(super) struct Binning {
    offset: [f32; 4],
    scale: [f32; 4],
    bins: usize,
}

impl Binning {
    #[inline(always)]
    fn new(range: &Range, options: &BuildOptions) -> Self {
        let bins = (4 + range.count as usize / 8).clamp(4, options.max_bins.clamp(4, MAX_BINS));
        let (low, extent) = (range.centers.lo(), range.centers.hi() - range.centers.lo());
        Self {
            offset: [low.x, low.y, low.z, 0.0],
            scale: [scale(bins, extent.x), scale(bins, extent.y), scale(bins, extent.z), 0.0],
            bins,
        }
    }

    /// The bin of `prim` along one axis, by the same roundings as in [`Bins::fill`].
    #[inline(always)]
    fn bin(&self, prim: &PackedBox, axis: usize) -> i32 {
        ((prim.doubled_center(axis) - self.offset[axis & 3]) * self.scale[axis & 3]) as i32
    }
}

/// Bins per unit along an axis. A flat axis gets 0: everything lands in bin 0 and no split is found there.
#[inline(always)]
fn scale(bins: usize, extent: f32) -> f32 {
    let scale = bins as f32 * 0.999_99 / extent;
    if scale < f32::MAX { scale } else { 0.0 }
}

/// What fell into each bin of each axis.
#[repr(C, align(64))]
struct Bins {
    boxes: [[PackedBox; 3]; MAX_BINS],
    /// Primitives per bin and axis; the fourth lane stays zero.
    counts: [[i32; 4]; MAX_BINS],
}

impl Bins {
    fn empty() -> Self {
        Self { boxes: [[PackedBox::EMPTY; 3]; MAX_BINS], counts: [[0; 4]; MAX_BINS] }
    }

    #[inline(always)]
    fn clear(&mut self, bins: usize) {
        self.boxes[..bins].fill([PackedBox::EMPTY; 3]);
        self.counts[..bins].fill([0; 4]);
    }

    fn merged(mut self, other: Self) -> Self {
        for (mine, theirs) in self.boxes.iter_mut().flatten().zip(other.boxes.iter().flatten()) {
            *mine = mine.union(theirs);
        }
        for (mine, theirs) in self.counts.iter_mut().flatten().zip(other.counts.iter().flatten()) {
            *mine += theirs;
        }
        self
    }

    #[inline(always)]
    fn fill<S: Simd>(&mut self, simd: S, prims: &[PackedBox], binning: &Binning) {
        let offset = f32x4::load_array(simd, binning.offset);
        let scale = f32x4::load_array(simd, binning.scale);
        for prim in prims {
            let prim = prim.load(simd);
            let bin: i32x4<S> = i32x4::truncate_from((doubled_center(prim) - offset) * scale);
            let [x, y, z, _] = bin.to_array();
            for (axis, bin) in [x, y, z].into_iter().enumerate() {
                let bin = bin as usize % MAX_BINS;
                let into = &mut self.boxes[bin][axis];
                prim.min(into.load(simd)).store_array(&mut into.0);
                self.counts[bin][axis] += 1;
            }
        }
    }

    /// The cheapest way to cut between bins; `None` if there is none, or none with a finite cost.
    #[inline(always)]
    fn best_split<S: Simd>(&self, simd: S, bins: usize, rule: LeafRule) -> Option<Split> {
        let empty = f32x8::splat(simd, f32::INFINITY);
        let mut right_costs = [[0.0_f32; 4]; MAX_BINS];
        let (mut sides, mut counts) = ([empty; 3], i32x4::splat(simd, 0));
        for bin in (1..bins.min(MAX_BINS)).rev() {
            self.add(simd, bin, &mut sides, &mut counts);
            costs(simd, &sides, counts, rule).store_array(&mut right_costs[bin]);
        }
        (sides, counts) = ([empty; 3], i32x4::splat(simd, 0));
        let (mut best, mut best_bin) = (f32x4::splat(simd, f32::INFINITY), i32x4::splat(simd, 0));
        for (bin, right_cost) in right_costs.iter().enumerate().take(bins).skip(1) {
            self.add(simd, bin - 1, &mut sides, &mut counts);
            // An empty side costs 0 · ∞, and NaN is never better.
            let cost = costs(simd, &sides, counts, rule) + f32x4::load_array_ref(simd, right_cost);
            let better = cost.simd_lt(best);
            best = better.select(cost, best);
            best_bin = better.select(i32x4::splat(simd, bin as i32), best_bin);
        }
        let (cost, bin) = (best.to_array(), best_bin.to_array());
        let axis = if cost[0] <= cost[1] && cost[0] <= cost[2] {
            0
        } else if cost[1] <= cost[2] {
            1
        } else {
            2
        };
        if cost[axis] == f32::INFINITY {
            return None;
        }
        let (left, right) = self.boxes[..bins].split_at((bin[axis] as usize).min(bins));
        Some(Split {
            axis,
            bin: bin[axis],
            left: union_of(simd, left, axis),
            right: union_of(simd, right, axis),
            cost: cost[axis],
        })
    }

    #[inline(always)]
    fn add<S: Simd>(&self, simd: S, bin: usize, sides: &mut [f32x8<S>; 3], counts: &mut i32x4<S>) {
        for (side, into) in sides.iter_mut().zip(&self.boxes[bin]) {
            *side = side.min(into.load(simd));
        }
        *counts += i32x4::load_array(simd, self.counts[bin]);
    }
}

#[inline(always)]
fn union_of<S: Simd>(simd: S, bins: &[[PackedBox; 3]], axis: usize) -> PackedBox {
    let mut all = f32x8::splat(simd, f32::INFINITY);
    for bin in bins {
        all = all.min(bin[axis].load(simd));
    }
    PackedBox(all.to_array())
}

/// Half area · blocks of one side for each axis.
#[inline(always)]
fn costs<S: Simd>(simd: S, sides: &[f32x8<S>; 3], counts: i32x4<S>, rule: LeafRule) -> f32x4<S> {
    let up = i32x4::splat(simd, (1 << rule.block_shift) - 1);
    let blocks: f32x4<S> = f32x4::float_from((counts + up) >> rule.block_shift);
    half_areas(*sides) * blocks
}

/// Bounds of primitives and of their doubled centres.
#[inline(always)]
fn bounds_of<S: Simd>(simd: S, prims: &[PackedBox]) -> (PackedBox, PackedBox) {
    let (mut bounds, mut centers) = (f32x8::splat(simd, f32::INFINITY), f32x8::splat(simd, f32::INFINITY));
    for prim in prims {
        let prim = prim.load(simd);
        let center = doubled_center(prim);
        bounds = bounds.min(prim);
        centers = centers.min(center.combine(-center));
    }
    (PackedBox(bounds.to_array()), PackedBox(centers.to_array()))
}

/// Moves the primitives of the left side to the front; their number, and the bounds of both sides' centres.
#[inline(always)]
fn partition<S: Simd>(
    simd: S,
    prims: &mut [PackedBox],
    binning: &Binning,
    split: &Split,
) -> (usize, [PackedBox; 2]) {
    let empty = f32x8::splat(simd, f32::INFINITY);
    let (mut left_centers, mut right_centers) = (empty, empty);
    let mut left = 0;
    for i in 0..prims.len() {
        let prim = prims[i];
        let is_left = binning.bin(&prim, split.axis) < split.bin;
        // Whether or not it goes left, so that there is nothing to predict: with a left primitive the first of the
        // right side changes places, or a primitive with itself.
        prims[i] = prims[left];
        prims[left] = prim;
        left += usize::from(is_left);
        let center = doubled_center(prim.load(simd));
        let center = center.combine(-center);
        // Centres of the other side are moved to infinity, where minima pass them over.
        let [from_left, from_right] = [[f32::INFINITY, 0.0], [0.0, f32::INFINITY]][usize::from(is_left)];
        left_centers = left_centers.min(center + f32x8::splat(simd, from_left));
        right_centers = right_centers.min(center + f32x8::splat(simd, from_right));
    }
    (left, [PackedBox(left_centers.to_array()), PackedBox(right_centers.to_array())])
}

/// Halves by count along the axis on which the centres spread widest; always makes progress.
#[inline(always)]
fn halve<S: Simd>(simd: S, prims: &mut [PackedBox], range: &Range) -> [Range; 2] {
    let middle = order_halves(prims, range);
    let (left, right) = prims.split_at(middle);
    let (left, right) = (bounds_of(simd, left), bounds_of(simd, right));
    range.divided(middle, [left.0, right.0], [left.1, right.1])
}

#[inline(never)]
fn order_halves(prims: &mut [PackedBox], range: &Range) -> usize {
    let axis = (range.centers.hi() - range.centers.lo()).max_position();
    let middle = prims.len() / 2;
    prims.select_nth_unstable_by(middle, |a, b| {
        a.doubled_center(axis).total_cmp(&b.doubled_center(axis)).then(a.id().cmp(&b.id()))
    });
    middle
}
