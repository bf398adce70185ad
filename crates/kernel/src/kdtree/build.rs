//! The builder: sorts all events once, then hands them down from cell to cell in order.
//!
//! Deterministic for any number of threads: a cell's split depends on its own content alone, and subtrees are joined
//! in a fixed order. Each triangle of a cell has a number in that cell, so that all side tables are as small as it.
//!
//! # References
//! Wald and Havran 2006, "On building fast kd-trees for ray tracing, and on doing that in O(N log N)", section 4.
use rayon::prelude::*;

use super::{
    Corners, KdOptions, KdSplit,
    clip::clipped_bounds,
    event::{Event, Kind, events_of, merge},
    node::KdNode,
    sweep::{self, Costs, Split},
};
use crate::aabb::Aabb;

/// Up to this many triangles a subtree is one task.
const TASK: usize = 2048;
/// Event lists longer than this are given back to the system rather than kept for later cells.
const KEPT_EVENTS: usize = 1 << 14;

/// The arrays of a tree or of a part of one; node 0 is its root.
#[derive(Debug, Default)]
pub(super) struct Arrays {
    pub nodes: Vec<KdNode>,
    /// Triangles of the leaves, by index in the store.
    pub references: Vec<u32>,
}

/// A cell that is still to be cut, or not.
struct Cell {
    bounds: Aabb,
    /// Where each of the cell's triangles is in the store; ascending.
    triangles: Vec<u32>,
    /// Sorted events of the triangles' parts inside the cell, per axis; triangles by their number in the cell.
    events: [Vec<Event>; 3],
    depth: u32,
    /// Leaf entries that the subtree may make, an empty leaf counting as one: bounds memory for any input.
    budget: u64,
}

impl Cell {
    fn count(&self) -> u32 {
        self.triangles.len() as u32
    }
}

/// Buffers of one task.
#[derive(Default)]
struct Scratch {
    /// Where each triangle of a cell goes: a side and its number there, see [`destination`].
    to: Vec<u32>,
    /// Events of clipped triangles, `[side][axis]`.
    fresh: [[Vec<Event>; 3]; 2],
    free_events: Vec<Vec<Event>>,
    free_triangles: Vec<Vec<u32>>,
}

/// Entries of [`Scratch::to`]: the top bit is the side, the rest the number there.
mod destination {
    pub(super) const LEFT: u32 = 0;
    pub(super) const RIGHT: u32 = 1 << 31;
    /// Crosses the plane: its events are made anew.
    pub(super) const BOTH: u32 = u32::MAX;
    pub(super) const NUMBER: u32 = (1 << 30) - 1;
}

/// Builds the tree over the triangles of `store`, which all lie in `bounds`. `budget` is at least their number.
pub(super) fn build(store: &[Corners], bounds: Aabb, budget: u64, options: &KdOptions) -> Arrays {
    let costs = Costs {
        traversal: f64::from(options.traversal_cost),
        intersection: f64::from(options.intersection_cost),
        empty: 1.0 - f64::from(options.empty_bonus),
    };
    let builder = Builder { store, options, costs, max_depth: options.depth_limit(store.len()) };
    let events = [0, 1, 2].map(|axis| sorted_events(store, axis));
    let triangles = (0..store.len() as u32).collect();
    builder.subtree(Cell { bounds, triangles, events, depth: 0, budget })
}

fn sorted_events(store: &[Corners], axis: usize) -> Vec<Event> {
    let of = |(number, corners): (usize, &Corners)| {
        let bounds = Aabb::from_points(corners.map(glam::Vec3::from_array));
        let (first, second) = events_of(&bounds, axis, number as u32);
        std::iter::once(first).chain(second)
    };
    let mut events: Vec<Event> = store.par_iter().enumerate().flat_map_iter(of).collect();
    events.par_sort_unstable();
    events
}

struct Builder<'a> {
    store: &'a [Corners],
    options: &'a KdOptions,
    costs: Costs,
    max_depth: u32,
}

impl Builder<'_> {
    /// Large cells: the two sides run in parallel.
    fn subtree(&self, cell: Cell) -> Arrays {
        if cell.triangles.len() <= TASK {
            let mut arrays = Arrays { nodes: vec![KdNode::leaf(0, 0)], references: Vec::new() };
            self.grow(cell, 0, &mut arrays, &mut Scratch::default());
            return arrays;
        }
        match self.choose(&cell) {
            None => {
                let leaf = KdNode::leaf(0, cell.count());
                Arrays { nodes: vec![leaf], references: cell.triangles }
            }
            Some(split) => {
                let [left, right] = self.divide(cell, &split, &mut Scratch::default());
                let (left, right) = rayon::join(|| self.subtree(left), || self.subtree(right));
                join(&split, left, right)
            }
        }
    }

    /// Small cells: one after the other, into the same arrays. The recursion is as deep as the tree.
    fn grow(&self, cell: Cell, node: usize, arrays: &mut Arrays, scratch: &mut Scratch) {
        let Some(split) = self.choose(&cell) else {
            arrays.nodes[node] = KdNode::leaf(arrays.references.len() as u32, cell.count());
            arrays.references.extend_from_slice(&cell.triangles);
            scratch.recycle(cell);
            return;
        };
        let children = arrays.nodes.len();
        arrays.nodes.extend([KdNode::leaf(0, 0); 2]);
        arrays.nodes[node] = KdNode::inner(split.axis, split.position, children as u32);
        let [left, right] = self.divide(cell, &split, scratch);
        self.grow(left, children, arrays, scratch);
        self.grow(right, children + 1, arrays, scratch);
    }

    /// The plane that cuts `cell`, or `None` if it should be a leaf.
    fn choose(&self, cell: &Cell) -> Option<Split> {
        let count = cell.count();
        if count == 0 || cell.depth >= self.max_depth {
            return None;
        }
        let split = match self.options.split {
            KdSplit::Median if count <= self.options.median_leaf => None,
            KdSplit::Median => sweep::middle(&cell.events, &cell.bounds),
            KdSplit::Sah => {
                let leaf = self.costs.intersection * f64::from(count) * sweep::half_area(&cell.bounds);
                self.cheapest(cell).filter(|split| split.cost < leaf)
            }
        }?;
        (entries(split.left) + entries(split.right) <= cell.budget).then_some(split)
    }

    fn cheapest(&self, cell: &Cell) -> Option<Split> {
        let on = |axis: usize| {
            sweep::best_on_axis(&cell.events[axis], cell.count(), &cell.bounds, axis, &self.costs)
        };
        let (x, (y, z)) = if cell.triangles.len() > TASK {
            rayon::join(|| on(0), || rayon::join(|| on(1), || on(2)))
        } else {
            (on(0), (on(1), on(2)))
        };
        // The first of equals.
        [x, y, z].into_iter().flatten().min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    fn divide(&self, cell: Cell, split: &Split, scratch: &mut Scratch) -> [Cell; 2] {
        let (mut below, mut above) = (cell.bounds, cell.bounds);
        below.max[split.axis] = split.position;
        above.min[split.axis] = split.position;
        classify(&cell, split, &mut scratch.to);
        let triangles = self.number(&cell, &[below, above], scratch);
        let events = distribute_all(&cell.events, scratch);
        let slack = cell.budget - entries(split.left) - entries(split.right);
        let share = f64::from(split.left) / f64::from(split.left + split.right).max(1.0);
        let left_budget = entries(split.left) + (slack as f64 * share) as u64;
        let budgets = [left_budget, cell.budget - left_budget];
        let depth = cell.depth + 1;
        scratch.recycle(cell);
        let [left, right] = triangles;
        let [left_events, right_events] = events;
        [
            Cell { bounds: below, triangles: left, events: left_events, depth, budget: budgets[0] },
            Cell { bounds: above, triangles: right, events: right_events, depth, budget: budgets[1] },
        ]
    }

    /// Gives the triangles of both sides their new numbers, and clips those that cross the plane.
    fn number(&self, cell: &Cell, sides: &[Aabb; 2], scratch: &mut Scratch) -> [Vec<u32>; 2] {
        let mut kept =
            [scratch.free_triangles.pop(), scratch.free_triangles.pop()].map(Option::unwrap_or_default);
        for (to, &triangle) in scratch.to.iter_mut().zip(&cell.triangles) {
            if *to != destination::BOTH {
                let side = &mut kept[usize::from(*to == destination::RIGHT)];
                *to |= side.len() as u32;
                side.push(triangle);
                continue;
            }
            for (side, (kept, fresh)) in sides.iter().zip(kept.iter_mut().zip(&mut scratch.fresh)) {
                let Some(part) = clipped_bounds(&self.store[triangle as usize], side) else { continue };
                for (axis, fresh) in fresh.iter_mut().enumerate() {
                    let (first, second) = events_of(&part, axis, kept.len() as u32);
                    fresh.push(first);
                    fresh.extend(second);
                }
                kept.push(triangle);
            }
        }
        kept
    }
}

/// Leaf entries that `count` triangles need at least.
fn entries(count: u32) -> u64 {
    u64::from(count.max(1))
}

/// Which side of the plane each triangle of the cell is on, without numbers yet.
fn classify(cell: &Cell, split: &Split, to: &mut Vec<u32>) {
    to.clear();
    to.resize(cell.triangles.len(), destination::BOTH);
    for event in &cell.events[split.axis] {
        let position = event.position();
        let side = match event.kind() {
            Kind::End if position <= split.position => destination::LEFT,
            Kind::Start if position >= split.position => destination::RIGHT,
            Kind::Planar
                if position < split.position || (position == split.position && split.planar_left) =>
            {
                destination::LEFT
            }
            Kind::Planar => destination::RIGHT,
            Kind::End | Kind::Start => continue,
        };
        to[event.triangle()] = side;
    }
}

/// Sorts the events of a cell to the sides `[side][axis]`, in order, with the fresh ones merged in.
fn distribute_all(events: &[Vec<Event>; 3], scratch: &mut Scratch) -> [[Vec<Event>; 3]; 2] {
    let mut out: [[Vec<Event>; 3]; 2] = Default::default();
    for list in out.iter_mut().flatten() {
        *list = scratch.free_events.pop().unwrap_or_default();
    }
    let [left, right] = &mut out;
    let [fresh_left, fresh_right] = &mut scratch.fresh;
    let to = &scratch.to;
    let axes = events.iter().zip(left.iter_mut().zip(right)).zip(fresh_left.iter_mut().zip(fresh_right));
    let run = |((events, (left, right)), (fresh_left, fresh_right)): (
        (&Vec<Event>, (&mut _, &mut _)),
        (&mut _, &mut _),
    )| {
        distribute(events, to, left, right);
        merge(left, fresh_left);
        merge(right, fresh_right);
    };
    if to.len() > TASK {
        axes.collect::<Vec<_>>().into_par_iter().for_each(run);
    } else {
        axes.for_each(run);
    }
    out
}

/// Without branches: every event is written to both lists, and only one of them grows.
fn distribute(events: &[Event], to: &[u32], left: &mut Vec<Event>, right: &mut Vec<Event>) {
    left.resize(events.len(), Event::default());
    right.resize(events.len(), Event::default());
    let (mut lefts, mut rights) = (0, 0);
    for event in events {
        let to = to[event.triangle()];
        let moved = event.renumbered(to & destination::NUMBER);
        left[lefts] = moved;
        right[rights] = moved;
        lefts += usize::from(to < destination::RIGHT);
        rights += usize::from(to >= destination::RIGHT && to != destination::BOTH);
    }
    left.truncate(lefts);
    right.truncate(rights);
}

/// A node over two finished subtrees: the root, its children side by side, and the rest of either.
fn join(split: &Split, left: Arrays, right: Arrays) -> Arrays {
    let mut nodes = Vec::with_capacity(1 + left.nodes.len() + right.nodes.len());
    nodes.push(KdNode::inner(split.axis, split.position, 1));
    // The nodes below a subtree's root move by what then lies before them.
    let left_shift = 2;
    let right_shift = left.nodes.len() as u32 + 1;
    let right_references = left.references.len() as u32;
    let [left_root, left_rest @ ..] = &left.nodes[..] else { return right };
    let [right_root, right_rest @ ..] = &right.nodes[..] else { return left };
    let moved_left = |node: &KdNode| node.shifted(left_shift, 0);
    let moved_right = |node: &KdNode| node.shifted(right_shift, right_references);
    nodes.extend([moved_left(left_root), moved_right(right_root)]);
    nodes.extend(left_rest.iter().map(moved_left));
    nodes.extend(right_rest.iter().map(moved_right));
    let mut references = left.references;
    references.extend_from_slice(&right.references);
    Arrays { nodes, references }
}

impl Scratch {
    /// Keeps the buffers of a finished cell for the next ones, unless they are large.
    fn recycle(&mut self, cell: Cell) {
        let small = |events: &Vec<Event>| events.capacity() <= KEPT_EVENTS;
        self.free_events.extend(cell.events.into_iter().filter(small));
        let mut triangles = cell.triangles;
        if triangles.capacity() <= KEPT_EVENTS {
            triangles.clear();
            self.free_triangles.push(triangles);
        }
    }
}
