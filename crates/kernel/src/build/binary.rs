//! Binary trees by binned SAH [Wald 2007, "On fast construction of SAH-based bounding volume hierarchies"].
//!
//! Deterministic for any number of threads: bins are merged with minima, maxima and counts only, which do not
//! depend on order, and each range of primitives is partitioned by one thread.
use glam::Vec4;
use rayon::prelude::*;

use super::BuildOptions;

/// Below this many primitives a subtree is one task.
const TASK: usize = 4096;
/// From this many primitives on, one node's binning is spread over threads.
const PARALLEL_BINNING: usize = 1 << 16;
/// From this depth on ranges are halved by count, so that no input makes the tree deeper than about 64.
const SAH_DEPTH: u32 = 40;
const MAX_BINS: usize = 32;

/// The bounds of a primitive. The fourth lanes are not geometry: `lo.w` carries the primitive's number as bits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PrimRef {
    pub lo: Vec4,
    pub hi: Vec4,
}

impl PrimRef {
    pub(crate) fn new(lo: Vec4, hi: Vec4, id: u32) -> Self {
        // Adding zero turns −0 into +0, between which minima would choose by order.
        let (mut lo, hi) = (lo + Vec4::ZERO, hi + Vec4::ZERO);
        lo.w = f32::from_bits(id);
        Self { lo, hi }
    }

    pub(crate) fn id(&self) -> u32 {
        self.lo.w.to_bits()
    }

    fn doubled_center(&self) -> Vec4 {
        self.lo + self.hi
    }
}

/// A node of the binary tree. The left child follows its parent directly.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinaryNode {
    pub lo: Vec4,
    pub hi: Vec4,
    /// Offset from this node to the right child; 0 for a leaf.
    pub right: u32,
    pub begin: u32,
    pub count: u32,
}

impl BinaryNode {
    const UNUSED: Self = Self { lo: Vec4::ZERO, hi: Vec4::ZERO, right: 0, begin: 0, count: 0 };

    pub(crate) fn half_area(&self) -> f32 {
        half_area(self.lo, self.hi)
    }
}

/// What a leaf may hold and what it costs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafRule {
    /// Largest number of primitives.
    pub max: usize,
    /// Primitives tested together.
    pub block: usize,
}

impl LeafRule {
    fn cost(self, count: usize, options: &BuildOptions) -> f32 {
        count.div_ceil(self.block) as f32 * options.intersection_cost
    }
}

/// Builds the tree over `prims` (not empty) and reorders them so that each leaf is a range. The result has gaps:
/// only nodes reached from node 0 are meaningful.
pub(crate) fn build(prims: &mut [PrimRef], rule: LeafRule, options: &BuildOptions) -> Vec<BinaryNode> {
    let mut nodes = vec![BinaryNode::UNUSED; 2 * prims.len() - 1];
    let builder = Builder { rule, options: *options };
    builder.subtree(prims, &mut nodes, 0, 0);
    nodes
}

#[inline(always)]
fn half_area(lo: Vec4, hi: Vec4) -> f32 {
    let s = hi - lo;
    s.x * s.y + s.y * s.z + s.z * s.x
}

#[derive(Clone, Copy)]
struct Bounds {
    lo: Vec4,
    hi: Vec4,
    center_lo: Vec4,
    center_hi: Vec4,
}

impl Bounds {
    const EMPTY: Self = Self {
        lo: Vec4::INFINITY,
        hi: Vec4::NEG_INFINITY,
        center_lo: Vec4::INFINITY,
        center_hi: Vec4::NEG_INFINITY,
    };

    fn of(prims: &[PrimRef]) -> Self {
        if prims.len() >= PARALLEL_BINNING {
            return prims.par_chunks(TASK).map(Self::of).reduce(|| Self::EMPTY, Self::union);
        }
        prims.iter().fold(Self::EMPTY, |b, p| {
            let c = p.doubled_center();
            Self {
                lo: b.lo.min(p.lo),
                hi: b.hi.max(p.hi),
                center_lo: b.center_lo.min(c),
                center_hi: b.center_hi.max(c),
            }
        })
    }

    fn union(self, other: Self) -> Self {
        Self {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
            center_lo: self.center_lo.min(other.center_lo),
            center_hi: self.center_hi.max(other.center_hi),
        }
    }
}

/// Maps doubled centres to bins on all three axes at once.
#[derive(Clone, Copy)]
struct Binning {
    offset: Vec4,
    scale: Vec4,
    bins: usize,
}

impl Binning {
    fn new(bounds: &Bounds, count: usize, options: &BuildOptions) -> Self {
        let bins = (4 + count / 8).clamp(4, options.max_bins.clamp(4, MAX_BINS));
        let extent = bounds.center_hi - bounds.center_lo;
        // A flat axis gets scale 0: everything lands in bin 0 and no split is found there.
        let scale = |e: f32| {
            let s = bins as f32 * 0.999_99 / e;
            if s.is_finite() && e > 0.0 { s } else { 0.0 }
        };
        let scale = Vec4::new(scale(extent.x), scale(extent.y), scale(extent.z), 0.0);
        Self { offset: bounds.center_lo, scale, bins }
    }

    #[inline(always)]
    fn bin(&self, prim: &PrimRef, axis: usize) -> usize {
        let x = (prim.doubled_center()[axis] - self.offset[axis]) * self.scale[axis];
        (x as usize).min(self.bins - 1)
    }

    #[inline(always)]
    fn bins_of(&self, prim: &PrimRef) -> [usize; 3] {
        let x = (prim.doubled_center() - self.offset) * self.scale;
        let last = self.bins - 1;
        [(x.x as usize).min(last), (x.y as usize).min(last), (x.z as usize).min(last)]
    }
}

#[derive(Clone, Copy)]
struct Bin {
    lo: Vec4,
    hi: Vec4,
    count: u32,
}

impl Bin {
    const EMPTY: Self = Self { lo: Vec4::INFINITY, hi: Vec4::NEG_INFINITY, count: 0 };

    #[inline(always)]
    fn add(&mut self, other: &Self) {
        self.lo = self.lo.min(other.lo);
        self.hi = self.hi.max(other.hi);
        self.count += other.count;
    }
}

struct Bins([[Bin; MAX_BINS]; 3]);

impl Bins {
    fn fill(prims: &[PrimRef], binning: &Binning) -> Self {
        if prims.len() >= PARALLEL_BINNING {
            let empty = || Self([[Bin::EMPTY; MAX_BINS]; 3]);
            let chunks = prims.par_chunks(PARALLEL_BINNING / 4);
            return chunks.map(|chunk| Self::fill(chunk, binning)).reduce(empty, Self::merge);
        }
        let mut bins = Self([[Bin::EMPTY; MAX_BINS]; 3]);
        for prim in prims {
            let one = Bin { lo: prim.lo, hi: prim.hi, count: 1 };
            for (axis, bin) in bins.0.iter_mut().zip(binning.bins_of(prim)) {
                axis[bin % MAX_BINS].add(&one);
            }
        }
        bins
    }

    fn merge(mut self, other: Self) -> Self {
        for (mine, theirs) in self.0.iter_mut().flatten().zip(other.0.iter().flatten()) {
            mine.add(theirs);
        }
        self
    }
}

/// The best split found: primitives in bins `..bin` of `axis` go left.
struct Split {
    axis: usize,
    bin: usize,
    /// Σ half area · leaf cost of both sides.
    cost: f32,
}

struct Builder {
    rule: LeafRule,
    options: BuildOptions,
}

impl Builder {
    fn subtree(&self, prims: &mut [PrimRef], nodes: &mut [BinaryNode], begin: u32, depth: u32) {
        let count = prims.len();
        let bounds = Bounds::of(prims);
        let node = BinaryNode { lo: bounds.lo, hi: bounds.hi, right: 0, begin, count: count as u32 };
        let middle = if count == 1 { None } else { self.divide(prims, &bounds, &node, depth) };
        let Some(middle) = middle else {
            nodes[0] = node;
            return;
        };
        nodes[0] = BinaryNode { right: 2 * middle as u32, ..node };
        let (left_prims, right_prims) = prims.split_at_mut(middle);
        let (left_nodes, right_nodes) = nodes[1..].split_at_mut(2 * middle - 1);
        let right_begin = begin + middle as u32;
        if count > TASK {
            rayon::join(
                || self.subtree(left_prims, left_nodes, begin, depth + 1),
                || self.subtree(right_prims, right_nodes, right_begin, depth + 1),
            );
        } else {
            self.subtree(left_prims, left_nodes, begin, depth + 1);
            self.subtree(right_prims, right_nodes, right_begin, depth + 1);
        }
    }

    /// Partitions `prims` and returns the size of the left part, or `None` if they should be one leaf.
    fn divide(&self, prims: &mut [PrimRef], bounds: &Bounds, node: &BinaryNode, depth: u32) -> Option<usize> {
        let count = prims.len();
        let may_be_leaf = count <= self.rule.max;
        if depth < SAH_DEPTH {
            let binning = Binning::new(bounds, count, &self.options);
            let bins = Bins::fill(prims, &binning);
            if let Some(split) = self.best_split(&bins, &binning) {
                let area = node.half_area();
                let split_cost = self.options.traversal_cost * area + split.cost;
                if may_be_leaf && self.rule.cost(count, &self.options) * area <= split_cost {
                    return None;
                }
                let middle = partition(prims, |p| binning.bin(p, split.axis) < split.bin);
                if middle > 0 && middle < count {
                    return Some(middle);
                }
            }
        }
        if may_be_leaf { None } else { Some(halve(prims, bounds)) }
    }

    fn best_split(&self, bins: &Bins, binning: &Binning) -> Option<Split> {
        let mut best: Option<Split> = None;
        for (axis, bins) in bins.0.iter().enumerate() {
            if binning.scale[axis] == 0.0 {
                continue;
            }
            let mut right_cost = [0.0_f32; MAX_BINS];
            let mut right = Bin::EMPTY;
            for i in (1..binning.bins).rev() {
                right.add(&bins[i]);
                right_cost[i] = self.side_cost(&right);
            }
            let mut left = Bin::EMPTY;
            for i in 1..binning.bins {
                left.add(&bins[i - 1]);
                let cost = self.side_cost(&left) + right_cost[i];
                // Written so that a NaN or infinite cost is never chosen.
                if cost < best.as_ref().map_or(f32::INFINITY, |b| b.cost) {
                    best = Some(Split { axis, bin: i, cost });
                }
            }
        }
        best
    }

    #[inline(always)]
    fn side_cost(&self, side: &Bin) -> f32 {
        if side.count == 0 {
            return f32::INFINITY; // An empty side is no split.
        }
        half_area(side.lo, side.hi) * self.rule.cost(side.count as usize, &self.options)
    }
}

/// Moves the primitives for which `left` holds to the front and returns their number.
fn partition(prims: &mut [PrimRef], left: impl Fn(&PrimRef) -> bool) -> usize {
    let (mut i, mut j) = (0, prims.len());
    loop {
        while i < j && left(&prims[i]) {
            i += 1;
        }
        while i < j && !left(&prims[j - 1]) {
            j -= 1;
        }
        if i >= j {
            return i;
        }
        prims.swap(i, j - 1);
        i += 1;
        j -= 1;
    }
}

/// Halves by count along the axis on which the centres spread widest; always makes progress.
fn halve(prims: &mut [PrimRef], bounds: &Bounds) -> usize {
    let spread = bounds.center_hi - bounds.center_lo;
    let axis = if spread.x >= spread.y && spread.x >= spread.z {
        0
    } else if spread.y >= spread.z {
        1
    } else {
        2
    };
    let middle = prims.len() / 2;
    prims.select_nth_unstable_by(middle, |a, b| {
        let (x, y) = (a.doubled_center()[axis], b.doubled_center()[axis]);
        x.total_cmp(&y).then(a.id().cmp(&b.id()))
    });
    middle
}
