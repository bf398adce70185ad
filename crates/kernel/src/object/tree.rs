//! The tree over an object's instances: built, refitted along a few paths, or refitted whole.
use fearless_simd::{Level, Simd, dispatch, f32x8, prelude::*};

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
const ENTRY_COST: f32 = 4.0;
/// No place in the tree: the root's parent, or the leaf of an instance with nothing to hit.
const NOWHERE: u32 = u32::MAX;

/// An 8-wide tree whose leaves are instances, with the way up from each of them.
///
/// Places are lanes of nodes, `node · 8 + lane`.
#[derive(Clone, Debug, Default)]
pub(crate) struct InstanceTree {
    pub wide: WideTree,
    /// The box of each instance, empty where there is nothing to hit.
    boxes: Vec<PackedBox>,
    /// The place of each instance's leaf.
    leaf: Vec<u32>,
    /// The place of each node in its parent.
    parent: Vec<u32>,
    bounds: PackedBox,
    /// Σ half area · cost over all nodes and leaves.
    cost: f64,
    sah_at_build: f32,
}

impl InstanceTree {
    /// A tree over the boxes of instances, in their order.
    pub(super) fn build(boxes: Vec<PackedBox>) -> Self {
        let mut tree = Self { boxes, bounds: PackedBox::EMPTY, ..Self::default() };
        tree.rebuild();
        tree
    }

    /// A new tree over the boxes that it has.
    pub(super) fn rebuild(&mut self) {
        let numbered = self.boxes.iter().enumerate().filter(|(_, bounds)| !bounds.is_empty());
        // Both tags hold the number, see `PackedBox::primitive`.
        let mut prims: Vec<_> = numbered.map(|(index, bounds)| bounds.with_tags([index as u32; 2])).collect();
        if prims.is_empty() {
            *self = Self { boxes: std::mem::take(&mut self.boxes), ..Self::default() };
            self.leaf = vec![NOWHERE; self.boxes.len()];
            return;
        }
        let options = BuildOptions { intersection_cost: ENTRY_COST, ..BuildOptions::default() };
        let (level, watch) = (build::level(), Watch::new(&()));
        let rule = LeafRule { max: 1, block_shift: 0 };
        let nodes = binned::build(level, &mut prims, rule, &options, &watch);
        let ranges;
        (self.wide, ranges) = wide::collapse(level, &nodes, rule, options.intersection_cost, &watch);
        self.bounds = *nodes.nodes[0].bounds();
        self.sah_at_build = self.wide.sah;
        self.cost = f64::from(self.wide.sah) * f64::from(self.bounds.half_area());
        // A block is one instance here, and the leaf names it.
        self.leaf.clear();
        self.leaf.resize(self.boxes.len(), NOWHERE);
        self.parent.clear();
        self.parent.resize(self.wide.nodes.len(), NOWHERE);
        for (index, node) in self.wide.nodes.iter_mut().enumerate() {
            for (lane, child) in node.child.iter_mut().enumerate().filter(|(_, child)| **child != Child::NONE)
            {
                let place = (index * WIDTH + lane) as u32;
                if child.is_leaf() {
                    let instance = prims[ranges[child.block_range().0].0 as usize].id();
                    *child = Child::leaf(instance);
                    self.leaf[instance as usize] = place;
                } else {
                    self.parent[child.0 as usize] = place;
                }
            }
        }
    }

    /// The box around all instances.
    pub(super) fn bounds(&self) -> Aabb {
        match self.wide.is_empty() || self.bounds.is_empty() {
            true => Aabb::EMPTY,
            false => Aabb::new(self.bounds.lo(), self.bounds.hi()),
        }
    }

    pub(super) fn nodes(&self) -> usize {
        self.wide.nodes.len()
    }

    /// Expected cost of a random ray, by the surface area heuristic; and the same when the tree was built.
    pub(super) fn sah(&self) -> (f32, f32) {
        (self.wide.sah, self.sah_at_build)
    }

    /// Takes over a box; false if the instance has no leaf yet but needs one.
    pub(super) fn set_box(&mut self, instance: usize, bounds: PackedBox) -> bool {
        self.boxes[instance] = bounds;
        self.leaf[instance] != NOWHERE || bounds.is_empty()
    }

    /// New boxes on the way from the leaves of `instances` to the root; the number of nodes changed, paths counted apart.
    pub(super) fn refit_paths(&mut self, instances: impl Iterator<Item = usize>) -> usize {
        let level = build::level();
        let touched = instances.map(|instance| self.refit_path(level, instance)).sum();
        self.settle();
        touched
    }

    fn refit_path(&mut self, level: Level, instance: usize) -> usize {
        let mut place = self.leaf[instance];
        let mut bounds = self.boxes[instance];
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

/// Leaves that name instances by their boxes.
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
