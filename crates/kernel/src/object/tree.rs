//! The tree over an object's instances: built, refitted along a few paths, or refitted whole.
use fearless_simd::{Level, Simd, dispatch, f32x8, prelude::*};

use super::{
    PlacedInstance,
    open::{self, Entry},
};
use crate::{
    aabb::Aabb,
    build::{
        self, BuildOptions,
        binary::LeafRule,
        binned,
        boxes::PackedBox,
        refit::{self, Leaves},
        watch::Watch,
        wide::{self, WideTree},
    },
    layout::{Child, Node, WIDTH},
};

/// What entering an instance costs beside a node visit: a transform and at least one node, far more than a step here.
pub(super) const ENTRY_COST: f32 = 4.0;
/// No place in the tree: the root's parent, or the leaf of what has nothing to hit.
const NOWHERE: u32 = u32::MAX;

/// An 8-wide tree whose leaves are instances, or parts of them, with the way up from each of them.
///
/// Places are lanes of nodes, `node · 8 + lane`.
#[derive(Clone, Debug, Default)]
pub(crate) struct InstanceTree {
    pub wide: WideTree,
    /// What the leaves stand for, instance after instance, where these are opened; else none: instances, by their index.
    pub entries: Vec<Entry>,
    /// The first entry of each instance, and the number of entries; none where there are no entries.
    starts: Vec<u32>,
    /// The box of each instance where these are opened, else none.
    wholes: Vec<PackedBox>,
    /// The box of each entry or instance, empty where there is nothing to hit.
    boxes: Vec<PackedBox>,
    /// The place of each one's leaf.
    leaf: Vec<u32>,
    /// The place of each node in its parent.
    parent: Vec<u32>,
    bounds: PackedBox,
    /// Σ half area · cost over all nodes and leaves.
    cost: f64,
    sah_at_build: f32,
}

impl InstanceTree {
    /// A tree over instances with these boxes.
    pub(super) fn build(instances: &[PlacedInstance], boxes: Vec<PackedBox>) -> Self {
        if !open::may_open(instances.len()) || !instances.iter().any(open::is_opened) {
            return Self::over(boxes);
        }
        let (mut entries, mut starts, mut parts) = (Vec::new(), vec![0], Vec::new());
        for ((placed, whole), instance) in instances.iter().zip(&boxes).zip(0..) {
            open::places(placed, *whole, |(child, bounds)| {
                entries.push(Entry { instance, child });
                parts.push(bounds);
            });
            starts.push(entries.len() as u32);
        }
        let mut tree = Self { entries, starts, wholes: boxes, ..Self::over(parts) };
        tree.wide.excess = open::EXCESS;
        tree
    }

    /// A new tree over the instances that it is over.
    pub(super) fn rebuild(&mut self, instances: &[PlacedInstance]) {
        let boxes = if self.starts.is_empty() { &mut self.boxes } else { &mut self.wholes };
        *self = Self::build(instances, std::mem::take(boxes));
    }

    /// A tree over boxes.
    fn over(boxes: Vec<PackedBox>) -> Self {
        let mut tree = Self { leaf: vec![NOWHERE; boxes.len()], boxes, ..Self::default() };
        let numbered = tree.boxes.iter().enumerate().filter(|(_, bounds)| !bounds.is_empty());
        // Both tags hold the number, see `PackedBox::primitive`.
        let mut prims: Vec<_> = numbered.map(|(index, bounds)| bounds.with_tags([index as u32; 2])).collect();
        if prims.is_empty() {
            return tree;
        }
        let options = BuildOptions { intersection_cost: ENTRY_COST, ..BuildOptions::default() };
        let (level, watch) = (build::level(), Watch::new(&()));
        let rule = LeafRule { max: 1, block_shift: 0 };
        let nodes = binned::build(level, &mut prims, rule, &options, &watch);
        let ranges;
        (tree.wide, ranges) = wide::collapse(level, &nodes, rule, options.intersection_cost, &watch);
        tree.bounds = *nodes.nodes[0].bounds();
        tree.sah_at_build = tree.wide.sah;
        tree.cost = f64::from(tree.wide.sah) * f64::from(tree.bounds.half_area());
        // A block is one box here, and the leaf names it.
        tree.parent.resize(tree.wide.nodes.len(), NOWHERE);
        for (index, node) in tree.wide.nodes.iter_mut().enumerate() {
            for (lane, child) in node.child.iter_mut().enumerate().filter(|(_, child)| **child != Child::NONE)
            {
                let place = (index * WIDTH + lane) as u32;
                if child.is_leaf() {
                    let number = prims[ranges[child.block_range().0].0 as usize].id();
                    *child = Child::leaf(number);
                    tree.leaf[number as usize] = place;
                } else {
                    tree.parent[child.0 as usize] = place;
                }
            }
        }
        tree
    }

    /// The box around all instances: that of their boxes, be they opened or not, so that nobody can tell from it.
    pub(super) fn bounds(&self) -> Aabb {
        let bounds = match self.starts.is_empty() {
            true => self.bounds,
            false => self.wholes.iter().fold(PackedBox::EMPTY, |all, whole| all.union(whole)),
        };
        match self.wide.is_empty() || bounds.is_empty() {
            true => Aabb::EMPTY,
            false => Aabb::new(bounds.lo(), bounds.hi()),
        }
    }

    pub(super) fn nodes(&self) -> usize {
        self.wide.nodes.len()
    }

    /// Leaves of an instance: the mean, rounded up.
    pub(super) fn leaves_each(&self) -> usize {
        if self.starts.is_empty() { 1 } else { self.entries.len().div_ceil(self.starts.len() - 1) }
    }

    /// Expected cost of a random ray, by the surface area heuristic; and the same when the tree was built.
    pub(super) fn sah(&self) -> (f32, f32) {
        (self.wide.sah, self.sah_at_build)
    }

    /// Takes over a placement, the box of which is `whole`; false if something has no leaf yet but needs one.
    pub(super) fn set_box(&mut self, instance: usize, placed: &PlacedInstance, whole: PackedBox) -> bool {
        if self.starts.is_empty() {
            self.boxes[instance] = whole;
            let opens = open::may_open(self.boxes.len()) && open::is_opened(placed);
            return !opens && (self.leaf[instance] != NOWHERE || whole.is_empty());
        }
        self.wholes[instance] = whole;
        let leaves = self.leaves_of(instance);
        let (mut next, mut fits) = (leaves.start, true);
        open::places(placed, whole, |(child, bounds)| {
            if next < leaves.end {
                self.entries[next].child = child;
                self.boxes[next] = bounds;
                fits &= self.leaf[next] != NOWHERE || bounds.is_empty();
            }
            next += 1;
        });
        // Leaves that it needs no more stay, with nothing to hit.
        self.boxes[next.min(leaves.end)..leaves.end].fill(PackedBox::EMPTY);
        fits && next <= leaves.end
    }

    /// The leaves of an instance, by their numbers.
    fn leaves_of(&self, instance: usize) -> std::ops::Range<usize> {
        match self.starts.is_empty() {
            true => instance..instance + 1,
            false => self.starts[instance] as usize..self.starts[instance + 1] as usize,
        }
    }

    /// New boxes on the way from the leaves of `instances` to the root; the number of nodes changed, paths counted apart.
    pub(super) fn refit_paths(&mut self, instances: impl Iterator<Item = usize>) -> usize {
        let level = build::level();
        let mut touched = 0;
        for instance in instances {
            for leaf in self.leaves_of(instance) {
                touched += self.refit_path(level, leaf);
            }
        }
        self.settle();
        touched
    }

    fn refit_path(&mut self, level: Level, leaf: usize) -> usize {
        let mut place = self.leaf[leaf];
        let mut bounds = self.boxes[leaf];
        let (mut weight, mut touched) = (f64::from(ENTRY_COST), 0);
        while place != NOWHERE {
            let (node, lane) = (place as usize / WIDTH, place as usize % WIDTH);
            let (before, around) =
                dispatch!(level, simd => replace(simd, &mut self.wide.nodes[node], lane, &bounds));
            if before == bounds.0 {
                return touched;
            }
            self.cost += weight * (area(&bounds) - area(&PackedBox(before)));
            touched += 1;
            (place, bounds, weight) = (self.parent[node], around, 1.0);
        }
        if touched > 0 {
            self.cost += area(&bounds) - area(&self.bounds);
            self.bounds = bounds;
        }
        touched
    }

    /// New boxes for the whole tree, bottom-up.
    pub(super) fn refit(&mut self) {
        if !self.wide.is_empty() {
            self.bounds = refit::nodes(build::level(), &mut self.wide, &Entries(&self.boxes));
            self.cost = f64::from(self.wide.sah) * area(&self.bounds);
        }
    }

    /// Brings what hangs on the root's box up to date.
    fn settle(&mut self) {
        let area = area(&self.bounds);
        self.wide.sah = if area > 0.0 && area.is_finite() { (self.cost / area) as f32 } else { 0.0 };
        self.wide.extent = refit::extent(&self.bounds);
    }
}

/// Leaves that name boxes.
struct Entries<'a>(&'a [PackedBox]);

impl Leaves for Entries<'_> {
    fn bounds_and_cost(&self, leaf: Child) -> (PackedBox, f32) {
        (self.0[leaf.payload() as usize], ENTRY_COST)
    }
}

/// Half the surface area; zero for an empty box.
fn area(bounds: &PackedBox) -> f64 {
    if bounds.is_empty() { 0.0 } else { f64::from(bounds.half_area()) }
}

/// Stores the box of a lane; the one before, and the box around all lanes.
#[inline(always)]
fn replace<S: Simd>(simd: S, node: &mut Node, lane: usize, bounds: &PackedBox) -> ([f32; 8], PackedBox) {
    let before = lane_box(node, lane);
    let after = PackedBox(bounds.0).with_tags([0; 2]);
    wide::set_bounds(node, lane, &after);
    let count = node.child.iter().take_while(|child| **child != Child::NONE).count();
    node.order = wide::child_order(simd, node, count);
    let mut around = [0.0; WIDTH];
    for axis in 0..3 {
        around[axis] = f32x8::load_array_ref(simd, &node.bounds[axis]).reduce_min();
        around[axis + 4] = -f32x8::load_array_ref(simd, &node.bounds[axis + 3]).reduce_max();
    }
    let around = PackedBox(around);
    (before.0, if around.is_empty() { PackedBox::EMPTY } else { around })
}

fn lane_box(node: &Node, lane: usize) -> PackedBox {
    let [a, b, c, d, e, f] = node.bounds.map(|row| row[lane]);
    let bounds = PackedBox([a, b, c, 0.0, -d, -e, -f, 0.0]);
    if bounds.is_empty() { PackedBox::EMPTY } else { bounds }
}
