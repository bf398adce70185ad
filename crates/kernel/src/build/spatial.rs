//! Binary trees with spatial splits [Stich, Friedrich and Dietrich 2009, "Spatial splits in bounding volume
//! hierarchies"]: a triangle that straddles a plane may be referred to from both sides, by the part on each side.
//!
//! The number of references is bounded beforehand: every range owns its references and some free places, and hands
//! both on to its children. Splits are tried where the sides of the best division by object overlap in a part of the
//! node and of the scene that matters. Deterministic for any number of threads.
//!
//! The parts' boxes are padded by more than the clipping rounds, within the whole triangle's box, and parts on both
//! sides of a plane share it. So every point of a triangle lies in one of its boxes, and a ray that passes it within
//! the rounding that the box tests allow for meets that box as it would have met the whole one.
use fearless_simd::{Level, Simd, dispatch, f32x4, f32x8, prelude::*};
use glam::Vec3;
use rayon::prelude::*;

use super::{
    BuildOptions,
    binary::{BinaryNode, BinaryTree, Content, LeafRule, Piece},
    binned::{Builder, Range, TASK_LEVELS},
    boxes::PackedBox,
    watch::Watch,
};

/// Candidate planes per axis, plus one.
const BINS: usize = 16;
/// Overlap of the best division's sides, relative to the node, from which spatial splits are tried …
const OVERLAP_OF_NODE: f32 = 0.1;
/// … and relative to the root.
const OVERLAP_OF_ROOT: f32 = 5.0e-6;
/// A spatial split must cost at most this much of the division by object.
const GAIN: f32 = 0.99;
/// From this many references on, binning is spread over threads.
const PARALLEL: usize = 1 << 12;
/// Padding of parts relative to the largest coordinate: several roundings.
const PAD: f32 = 4.0 * f32::EPSILON;

/// The corners of a primitive by its number.
pub(crate) type Corners<'a> = dyn Fn(u32) -> [Vec3; 3] + Sync + 'a;

/// Builds the tree over `prims` (not empty), which grows by up to `budget` references to parts. Afterwards leaves are
/// ranges of `prims`; places in no leaf mean nothing.
pub(crate) fn build(
    level: Level,
    prims: &mut Vec<PackedBox>,
    budget: usize,
    corners: &Corners<'_>,
    rule: LeafRule,
    options: &BuildOptions,
    watch: &Watch<'_>,
) -> BinaryTree {
    let object = Builder::new(level, prims.len(), rule, options, watch);
    let whole = object.whole(prims);
    let reach = whole.bounds.lo().abs().max(whole.bounds.hi().abs()).max_element();
    let root_area = whole.bounds.half_area();
    prims.resize(prims.len() + budget, PackedBox::EMPTY);
    watch.expect(object.work(prims.len()));
    Spatial { object, corners, root_area, pad: reach * PAD }.top(prims, whole).assemble()
}

struct Spatial<'a> {
    object: Builder<'a>,
    corners: &'a Corners<'a>,
    root_area: f32,
    pad: f32,
}

/// A plane and what lies on its sides.
#[derive(Clone, Copy)]
struct Plane {
    axis: usize,
    position: f32,
    left: PackedBox,
    right: PackedBox,
    left_count: u32,
    right_count: u32,
    /// Σ half area · blocks of both sides.
    cost: f32,
}

impl Spatial<'_> {
    /// A range whose references come first in `places`; the rest is free.
    fn top(&self, places: &mut [PackedBox], range: Range) -> Piece {
        let count = range.count as usize;
        if places.len() == count {
            return self.object.top(places, range);
        }
        if self.object.watch.stopped() {
            return Piece::task(vec![BinaryNode::PAD; 2]);
        }
        if count <= self.object.task {
            let mut nodes = vec![BinaryNode::PAD; 2];
            self.grow(places, range, &mut nodes, 0);
            self.object.watch.advance(TASK_LEVELS * places.len() as u64);
            return Piece::task(nodes);
        }
        let [left, right] = self
            .divide(places, &range)
            .unwrap_or_else(|| self.share(places, |prims| self.object.halve(prims, &range), count));
        self.object.watch.advance(places.len() as u64);
        let (left_places, right_places) = places.split_at_mut((right.begin - left.begin) as usize);
        let (a, b) = rayon::join(|| self.top(left_places, left), || self.top(right_places, right));
        Piece::join(&range.bounds, range.count, a, b)
    }

    /// As [`Builder::grow`], with free places.
    fn grow(&self, places: &mut [PackedBox], range: Range, nodes: &mut Vec<BinaryNode>, place: usize) {
        let count = range.count as usize;
        if places.len() == count {
            return self.object.grow(places, range, nodes, place);
        }
        let Some([left, right]) = self.divide(places, &range) else {
            let content = Content::Leaf { begin: range.begin, count: range.count };
            nodes[place] = BinaryNode::new(&range.bounds, content);
            return;
        };
        let children = nodes.len();
        let content = Content::Inner { children: children as u32, count: range.count };
        nodes[place] = BinaryNode::new(&range.bounds, content);
        nodes.extend([BinaryNode::PAD; 2]);
        let (left_places, right_places) = places.split_at_mut((right.begin - left.begin) as usize);
        self.grow(left_places, left, nodes, children);
        self.grow(right_places, right, nodes, children + 1);
    }

    /// Divides a range in the better way, or says that it should be a leaf.
    fn divide(&self, places: &mut [PackedBox], range: &Range) -> Option<[Range; 2]> {
        let count = range.count as usize;
        let (rule, options) = (self.object.rule, &self.object.options);
        if rule.blocks(count) == 1 {
            return None;
        }
        let by_object = self.object.best_split(&places[..count], range);
        let object_cost = by_object.as_ref().map_or(f32::INFINITY, |(_, split)| split.cost);
        let plane = match &by_object {
            Some((_, split)) if !self.is_overlap(&split.left, &split.right, range) => None,
            Some(_) => {
                self.best_plane(&places[..count], range).filter(|plane| plane.cost < GAIN * object_cost)
            }
            None => None,
        };
        let cost = plane.as_ref().map_or(object_cost, |plane| plane.cost);
        if count <= rule.max {
            let area = range.bounds.half_area();
            let split_cost = options.traversal_cost * area + options.intersection_cost * cost;
            if options.intersection_cost * rule.blocks(count) as f32 * area <= split_cost
                || by_object.is_none()
            {
                return None;
            }
        }
        if let Some(divided) = plane.and_then(|plane| self.divide_at(places, range, &plane)) {
            return Some(divided);
        }
        Some(self.share(
            places,
            |prims| match by_object {
                Some((binning, split)) => self.object.divide_by(prims, range, &binning, &split),
                None => self.object.halve(prims, range),
            },
            count,
        ))
    }

    fn is_overlap(&self, left: &PackedBox, right: &PackedBox, range: &Range) -> bool {
        let extent = (left.hi().min(right.hi()) - left.lo().max(right.lo())).max(Vec3::ZERO);
        let overlap = extent.x * extent.y + extent.y * extent.z + extent.z * extent.x;
        overlap > OVERLAP_OF_NODE * range.bounds.half_area() && overlap > OVERLAP_OF_ROOT * self.root_area
    }

    /// Divides without new references and shares the free places out.
    fn share(
        &self,
        places: &mut [PackedBox],
        divide: impl FnOnce(&mut [PackedBox]) -> [Range; 2],
        count: usize,
    ) -> [Range; 2] {
        let [left, mut right] = divide(&mut places[..count]);
        let middle = left.count as usize;
        let free = free_share(places.len() - count, middle, count);
        places.copy_within(middle..count, middle + free);
        right.begin += free as u32;
        [left, right]
    }

    /// Divides at a plane; `None`, with nothing changed, if that leaves one side empty.
    fn divide_at(&self, places: &mut [PackedBox], range: &Range, plane: &Plane) -> Option<[Range; 2]> {
        let count = range.count as usize;
        let mut free = places.len() - count;
        let (mut left, mut right) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let mut sides = Sides::new(plane);
        for prim in &places[..count] {
            match sides.place(prim, free > 0, || self.clip(prim, plane.axis, plane.position)) {
                Placed::Left => left.push(*prim),
                Placed::Right => right.push(*prim),
                Placed::Both(a, b) => {
                    free -= 1;
                    left.push(a);
                    right.push(b);
                }
            }
        }
        if left.is_empty() || right.is_empty() {
            return None;
        }
        let begin = left.len() + free_share(free, left.len(), left.len() + right.len());
        places[..left.len()].copy_from_slice(&left);
        places[begin..begin + right.len()].copy_from_slice(&right);
        let side = |prims: &[PackedBox], begin: u32| {
            let whole = self.object.whole(prims);
            Range { begin, depth: range.depth + 1, ..whole }
        };
        Some([side(&left, range.begin), side(&right, range.begin + begin as u32)])
    }

    /// The parts of `prim` on both sides of a plane; a side that it does not reach is empty.
    fn clip(&self, prim: &PackedBox, axis: usize, position: f32) -> [PackedBox; 2] {
        let corners = (self.corners)(prim.id());
        let mut sides = [[Vec3::INFINITY, Vec3::NEG_INFINITY]; 2];
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            let mut include =
                |side: usize, p: Vec3| sides[side] = [sides[side][0].min(p), sides[side][1].max(p)];
            if a[axis] <= position {
                include(0, a);
            }
            if a[axis] >= position {
                include(1, a);
            }
            if (a[axis] < position && position < b[axis]) || (b[axis] < position && position < a[axis]) {
                let (from, to) = (a.as_dvec3(), b.as_dvec3());
                let along = (f64::from(position) - from[axis]) / (to[axis] - from[axis]);
                let mut p = (from + (to - from) * along).as_vec3();
                p[axis] = position;
                include(0, p);
                include(1, p);
            }
        }
        sides.map(|[lo, hi]| {
            let (lo, hi) = ((lo - self.pad).max(prim.lo()), (hi + self.pad).min(prim.hi()));
            if lo.cmple(hi).all() { PackedBox::primitive(lo, hi, prim.id()) } else { PackedBox::EMPTY }
        })
    }

    /// The best plane over all axes, if there is any.
    fn best_plane(&self, prims: &[PackedBox], range: &Range) -> Option<Plane> {
        let slabs = Slabs::new(range);
        let fill = |prims: &[PackedBox]| {
            let mut bins = Bins::empty();
            dispatch!(self.object.level, simd => bins.fill(simd, prims, &slabs, self.corners));
            bins
        };
        let bins = if prims.len() < PARALLEL {
            fill(prims)
        } else {
            prims.par_chunks(PARALLEL / 4).map(fill).reduce(Bins::empty, Bins::merged)
        };
        (0..3)
            .filter(|&axis| slabs.scale[axis] > 0.0)
            .fold(None, |best, axis| bins.best_plane(axis, &slabs, self.object.rule, best))
    }
}

/// The part of the free places that goes to the left.
fn free_share(free: usize, left: usize, all: usize) -> usize {
    (free as u64 * left as u64 / all as u64) as usize
}

enum Placed {
    Left,
    Right,
    /// The parts on both sides.
    Both(PackedBox, PackedBox),
}

/// Decides for each reference on which side it goes, whole if that is cheaper ("reference unsplitting").
struct Sides {
    plane: Plane,
}

impl Sides {
    fn new(plane: &Plane) -> Self {
        Self { plane: *plane }
    }

    fn place(&mut self, prim: &PackedBox, may_split: bool, clip: impl FnOnce() -> [PackedBox; 2]) -> Placed {
        let Plane { axis, position, left, right, left_count, right_count, .. } = &mut self.plane;
        if prim.hi()[*axis] <= *position {
            return Placed::Left;
        }
        if prim.lo()[*axis] >= *position {
            return Placed::Right;
        }
        let [a, b] = clip();
        if a.0[0] == f32::INFINITY {
            return Placed::Right;
        }
        if b.0[0] == f32::INFINITY {
            return Placed::Left;
        }
        let (left_area, right_area) = (left.half_area(), right.half_area());
        let (l, r) = (*left_count as f32, *right_count as f32);
        let split = left_area * l + right_area * r;
        let (with_left, with_right) = (left.union(prim), right.union(prim));
        let all_left = with_left.half_area() * l + right_area * (r - 1.0);
        let all_right = left_area * (l - 1.0) + with_right.half_area() * r;
        if may_split && split <= all_left && split <= all_right {
            Placed::Both(a, b)
        } else if all_left <= all_right {
            *left = with_left;
            *right_count -= 1;
            Placed::Left
        } else {
            *right = with_right;
            *left_count -= 1;
            Placed::Right
        }
    }
}

/// Equal slabs of a node along each axis.
struct Slabs {
    lo: [f32; 3],
    width: [f32; 3],
    /// Slabs per unit; 0 along a flat axis.
    scale: [f32; 3],
}

impl Slabs {
    fn new(range: &Range) -> Self {
        let (lo, extent) = (range.bounds.lo(), range.bounds.hi() - range.bounds.lo());
        let scale = extent.to_array().map(|e| BINS as f32 / e).map(|s| if s < f32::MAX { s } else { 0.0 });
        Self { lo: lo.to_array(), width: (extent / BINS as f32).to_array(), scale }
    }

    #[inline(always)]
    fn bin(&self, axis: usize, x: f32) -> usize {
        (((x - self.lo[axis]) * self.scale[axis]) as usize).min(BINS - 1)
    }

    /// The plane before slab `bin`.
    #[inline(always)]
    fn plane(&self, axis: usize, bin: usize) -> f32 {
        self.lo[axis] + self.width[axis] * bin as f32
    }
}

#[derive(Clone, Copy)]
struct Bin {
    bounds: PackedBox,
    /// References that begin and that end here.
    entries: u32,
    exits: u32,
}

struct Bins([[Bin; BINS]; 3]);

impl Bins {
    fn empty() -> Self {
        Self([[Bin { bounds: PackedBox::EMPTY, entries: 0, exits: 0 }; BINS]; 3])
    }

    fn merged(mut self, other: Self) -> Self {
        for (mine, theirs) in self.0.iter_mut().flatten().zip(other.0.iter().flatten()) {
            mine.bounds = mine.bounds.union(&theirs.bounds);
            mine.entries += theirs.entries;
            mine.exits += theirs.exits;
        }
        self
    }

    /// Cuts references at all planes. An estimate: parts are not padded here.
    #[inline(always)]
    fn fill<S: Simd>(&mut self, simd: S, prims: &[PackedBox], slabs: &Slabs, corners: &Corners<'_>) {
        for prim in prims {
            let mut triangle = None;
            for (axis, bins) in self.0.iter_mut().enumerate() {
                let first = slabs.bin(axis, prim.0[axis]);
                let last = slabs.bin(axis, -prim.0[axis + 4]);
                bins[first].entries += 1;
                bins[last].exits += 1;
                if first == last {
                    let bounds = bins[first].bounds.load(simd).min(prim.load(simd));
                    bounds.store_array(&mut bins[first].bounds.0);
                } else {
                    let corners = triangle.get_or_insert_with(|| corners(prim.id()));
                    cut(simd, bins, (first, last), prim, corners, axis, slabs);
                }
            }
        }
    }

    /// The best plane of one axis, or `best` if that is better.
    fn best_plane(&self, axis: usize, slabs: &Slabs, rule: LeafRule, best: Option<Plane>) -> Option<Plane> {
        let mut rights = [(PackedBox::EMPTY, 0); BINS];
        let (mut right, mut right_count) = (PackedBox::EMPTY, 0);
        for (bin, into) in self.0[axis].iter().zip(&mut rights).skip(1).rev() {
            right = right.union(&bin.bounds);
            right_count += bin.exits;
            *into = (right, right_count);
        }
        let mut best = best;
        let (mut left, mut left_count) = (PackedBox::EMPTY, 0);
        let blocks = |count: u32| rule.blocks(count as usize) as f32;
        for (bin, &(right, right_count)) in rights.iter().enumerate().skip(1) {
            left = left.union(&self.0[axis][bin - 1].bounds);
            left_count += self.0[axis][bin - 1].entries;
            // An empty side costs 0 · ∞, and NaN is never better.
            let cost = left.half_area() * blocks(left_count) + right.half_area() * blocks(right_count);
            if cost < best.map_or(f32::INFINITY, |best| best.cost) {
                let position = slabs.plane(axis, bin);
                best = Some(Plane { axis, position, left, right, left_count, right_count, cost });
            }
        }
        best
    }
}

/// Adds the parts of a reference in the slabs `first..=last` to their bins.
#[inline(always)]
fn cut<S: Simd>(
    simd: S,
    bins: &mut [Bin; BINS],
    (first, last): (usize, usize),
    prim: &PackedBox,
    corners: &[Vec3; 3],
    axis: usize,
    slabs: &Slabs,
) {
    let empty = f32x8::splat(simd, f32::INFINITY);
    let mut parts = [empty; BINS];
    for k in 0..3 {
        let (a, b) = (corners[k].to_array(), corners[(k + 1) % 3].to_array());
        let (a, b) = if a[axis] <= b[axis] { (a, b) } else { (b, a) };
        let (from, to) = (slabs.bin(axis, a[axis]), slabs.bin(axis, b[axis]));
        let (start, end) = (lanes(simd, a), lanes(simd, b));
        parts[from] = parts[from].min(point(start));
        parts[to] = parts[to].min(point(end));
        let per_unit = 1.0 / (b[axis] - a[axis]);
        for bin in (from + 1).max(first)..=to.min(last + 1).min(BINS - 1) {
            let along = (slabs.plane(axis, bin) - a[axis]) * per_unit;
            let crossing = point(start + (end - start) * along);
            parts[bin - 1] = parts[bin - 1].min(crossing);
            parts[bin] = parts[bin].min(crossing);
        }
    }
    let whole = prim.load(simd);
    for (bin, part) in bins.iter_mut().zip(parts).take(last + 1).skip(first) {
        // The maximum of packed boxes is their intersection. One that is inverted is kept within the reference, which
        // is as good an estimate.
        let part = part.max(whole);
        bin.bounds.load(simd).min(part).store_array(&mut bin.bounds.0);
    }
}

#[inline(always)]
fn lanes<S: Simd>(simd: S, p: [f32; 3]) -> f32x4<S> {
    f32x4::load_array(simd, [p[0], p[1], p[2], 0.0])
}

/// The packed box of a point.
#[inline(always)]
fn point<S: Simd>(p: f32x4<S>) -> f32x8<S> {
    p.combine(-p)
}
