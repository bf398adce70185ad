//! The collapse of a binary tree into 8-wide nodes, apart from any builder.
//!
//! Subtrees of a fixed size are collapsed on their own, in parallel, and the lists are joined in order.
use fearless_simd::{Level, Simd, dispatch, f32x8, i32x8, mask32x8, prelude::*};
use rayon::prelude::*;

use super::{
    binary::{BinaryNode, BinaryTree, Content, LeafRule},
    boxes::PackedBox,
    parts,
    watch::Watch,
};
use crate::{
    compact::{CompactNode, Nodes},
    layout::{Child, Node, WIDTH},
};

/// A subtree with no more references than this, or than 1/64 of the whole, is collapsed by one thread.
const TASK: u32 = 1 << 7;

/// A finished 8-wide tree. The root is node 0; no nodes means nothing to hit.
#[derive(Clone, Debug, Default)]
pub(crate) struct WideTree {
    /// All nodes in the full layout; none in the compact one.
    pub nodes: Vec<Node>,
    /// All nodes in the compact layout; none in the full one.
    pub compact: Vec<CompactNode>,
    /// Largest coordinate magnitude per axis: the scale of rounding errors in box tests.
    pub extent: [f32; 3],
    /// Rounding errors that boxes bear beside those of the box tests, in units of these.
    pub excess: f32,
    pub leaves: usize,
    /// Where runs of nodes begin that refer to nothing outside but blocks, and the number of nodes. The first run is
    /// the top, which refers to the first nodes of the others. In each, children come behind their parents.
    pub parts: Vec<u32>,
    /// SAH cost relative to the root's area: node visits plus leaf costs.
    pub sah: f32,
}

impl WideTree {
    pub(crate) fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of nodes.
    pub(crate) fn len(&self) -> usize {
        self.nodes.len() + self.compact.len()
    }

    /// What rounding errors of box tests are measured by, for rays whose origins have coordinates up to `origin`.
    #[inline(always)]
    pub(crate) fn reach(&self, origin: f32) -> f32 {
        let [x, y, z] = self.extent;
        origin.max(x).max(y).max(z) * (1.0 + self.excess)
    }

    /// The nodes of either layout, for a traversal to hold on to.
    #[inline(always)]
    pub(crate) fn view(&self) -> Nodes<'_> {
        Nodes { full: &self.nodes, compact: &self.compact }
    }

    /// Changes to the compact layout.
    pub(crate) fn compress(&mut self) {
        self.compact = std::mem::take(&mut self.nodes).par_iter().map(CompactNode::encode).collect();
    }

    /// Changes to the full layout.
    pub(crate) fn expand(&mut self) {
        self.nodes = std::mem::take(&mut self.compact).par_iter().map(CompactNode::expand).collect();
    }
}

/// First reference and number of references of a block.
pub(crate) type BlockRange = (u32, u32);

/// Collapses into the cheapest wide tree. The leaves' payloads are runs in the list of blocks
/// that is returned too; neighbours in the tree are neighbours in both lists.
pub(crate) fn collapse(
    level: Level,
    tree: &BinaryTree,
    rule: LeafRule,
    block_cost: f32,
    watch: &Watch<'_>,
) -> (WideTree, Vec<BlockRange>) {
    let binary = &tree.nodes[..];
    let Some(root) = binary.first() else { return Default::default() };
    let (lo, hi) = (root.bounds().lo(), root.bounds().hi());
    let plan = &plan(level, tree, rule, block_cost)[..];
    let Content::Inner { count, .. } = root.content() else {
        // A root that is a leaf: one node with one child.
        let part = Collapse { binary, plan, rule, block_cost, cut: 0 }.run(level, 0);
        return finish(vec![part], binary, lo.abs().max(hi.abs()).to_array());
    };
    let collapse = Collapse { binary, plan, rule, block_cost, cut: TASK.max(count / 64) };
    let top = collapse.run(level, 0);
    watch.expect(top.apart.len() as u64);
    let whole = Collapse { cut: 0, ..collapse };
    let below = top.apart.par_iter().map(|&from| {
        let part = if watch.stopped() { Part::default() } else { whole.run(level, from) };
        watch.advance(1);
        part
    });
    let below: Vec<Part> = below.collect();
    let parts: Vec<Part> = std::iter::once(top).chain(below).collect();
    finish(parts, binary, lo.abs().max(hi.abs()).to_array())
}

/// Wide nodes and blocks, numbered from 0; those of children that are apart are numbers in `apart`.
#[derive(Default)]
struct Part {
    nodes: Vec<Node>,
    blocks: Vec<BlockRange>,
    /// Binary nodes at which other parts begin.
    apart: Vec<u32>,
    leaves: usize,
    /// Σ half area · cost.
    cost: f64,
}

#[derive(Clone, Copy)]
struct Collapse<'a> {
    binary: &'a [BinaryNode],
    plan: &'a [Plan],
    rule: LeafRule,
    block_cost: f32,
    /// Inner children with no more references than this are left to other parts.
    cut: u32,
}

/// Marks a child that is apart.
const APART: u32 = 1 << 30;

impl Collapse<'_> {
    fn run(&self, level: Level, from: u32) -> Part {
        dispatch!(level, simd => self.part(simd, from))
    }

    #[inline(always)]
    fn part<S: Simd>(&self, simd: S, from: u32) -> Part {
        let mut part = Part { nodes: vec![Node::EMPTY], ..Part::default() };
        // Depth first, so that a subtree lies together in memory: (binary node to open, wide node to fill).
        let mut open = vec![(from, 0_usize)];
        while let Some((from, to)) = open.pop() {
            part.cost += f64::from(self.binary[from as usize].bounds().half_area());
            let (members, count) = self.gather(from);
            let mut node = Node::EMPTY;
            for (lane, &member) in members[..count].iter().enumerate() {
                let child = &self.binary[member as usize];
                set_bounds(&mut node, lane, child.bounds());
                node.child[lane] = match child.content() {
                    Content::Inner { count, .. } if count <= self.cut => {
                        part.apart.push(member);
                        Child::inner(APART | (part.apart.len() as u32 - 1))
                    }
                    Content::Inner { .. } => {
                        let index = part.nodes.len();
                        part.nodes.push(Node::EMPTY);
                        open.push((member, index));
                        Child::inner(index as u32)
                    }
                    Content::Leaf { begin, count } => self.leaf(&mut part, child, begin, count),
                    Content::Apart { .. } => Child::NONE,
                };
            }
            node.order = child_order(simd, &node, count);
            part.nodes[to] = node;
        }
        part
    }

    fn leaf(&self, part: &mut Part, leaf: &BinaryNode, begin: u32, count: u32) -> Child {
        let first = part.blocks.len() as u32;
        let blocks = self.rule.blocks(count as usize) as u32;
        for i in 0..blocks {
            let offset = i << self.rule.block_shift;
            part.blocks.push((begin + offset, (count - offset).min(1 << self.rule.block_shift)));
        }
        part.leaves += 1;
        part.cost += f64::from(leaf.bounds().half_area() * blocks as f32 * self.block_cost);
        Child::blocks(first, blocks)
    }

    /// Up to 8 descendants of `from` that together replace it.
    #[inline(always)]
    fn gather(&self, from: u32) -> ([u32; WIDTH], usize) {
        let mut members = [from; WIDTH];
        let mut count = 0;
        // Subtrees to replace, and by how many roots.
        let mut open = [(from, WIDTH); WIDTH];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (node, roots) = open[waiting % WIDTH];
            let left = usize::from(self.plan[node as usize][roots - 1]);
            match self.binary[node as usize].content() {
                Content::Inner { children, .. } if left > 0 => {
                    open[waiting % WIDTH] = (children + 1, roots - left);
                    open[(waiting + 1) % WIDTH] = (children, left);
                    waiting += 2;
                }
                _ => {
                    members[count % WIDTH] = node;
                    count += 1;
                }
            }
        }
        (members, count)
    }
}

/// For each node, into how many roots its left child should go when it is replaced by up to 1 … 8 roots; 0 where it
/// should stay one.
type Plan = [u8; WIDTH];
/// The cost of a subtree as a forest of up to 1 … 8 roots; the last is not used.
type Costs = [f32; WIDTH];

/// Plans the cheapest collapse by dynamic programming over the forests that replace each subtree [Ylitie, Karras and
/// Laine 2017, section 4.1]. Leaves are as the builder made them.
fn plan(level: Level, tree: &BinaryTree, rule: LeafRule, block_cost: f32) -> Vec<Plan> {
    let planner = Planner { rule, block_cost };
    let mut plans = vec![[0; WIDTH]; tree.nodes.len()];
    let top = tree.runs.get(1).map_or(0, |&end| end as usize);
    let (top_plans, mut rest) = plans.split_at_mut(top);
    let mut runs = Vec::with_capacity(tree.runs.len());
    for (&begin, &end) in tree.runs.iter().zip(tree.runs.iter().skip(1)).skip(1) {
        let run;
        (run, rest) = rest.split_at_mut((end - begin) as usize);
        runs.push((begin as usize, run));
    }
    // Children of the top's nodes that lie in a run are its first two.
    let below = runs.into_par_iter().map(|(begin, plans)| {
        let nodes = &tree.nodes[begin..begin + plans.len()];
        let mut costs = dispatch!(level, simd => planner.run(simd, nodes, begin, plans, &[]));
        costs.truncate(2);
        (begin, costs)
    });
    let below: Vec<(usize, Vec<Costs>)> = below.collect();
    dispatch!(level, simd => planner.run(simd, &tree.nodes[..top], 0, top_plans, &below));
    plans
}

struct Planner {
    rule: LeafRule,
    block_cost: f32,
}

impl Planner {
    /// Plans for a run of nodes, of which the first is number `first` of the tree; their costs. `below` has the costs of
    /// the first nodes of other runs.
    #[inline(always)]
    fn run<S: Simd>(
        &self,
        simd: S,
        nodes: &[BinaryNode],
        first: usize,
        plans: &mut [Plan],
        below: &[(usize, Vec<Costs>)],
    ) -> Vec<Costs> {
        let mut costs: Vec<Costs> = vec![[0.0; WIDTH]; nodes.len()];
        for (index, node) in nodes.iter().enumerate().rev() {
            let area = node.bounds().half_area();
            match node.content() {
                Content::Inner { children, .. } => {
                    let children = children as usize;
                    let (left, right) = match below.binary_search_by_key(&children, |&(begin, _)| begin) {
                        Ok(run) => (below[run].1[0], below[run].1[1]),
                        Err(_) => (costs[children - first], costs[children - first + 1]),
                    };
                    (plans[index], costs[index]) = plan_node(simd, area, &left, &right);
                }
                Content::Leaf { count, .. } => {
                    let blocks = self.rule.blocks(count as usize) as f32;
                    costs[index] = [area * blocks * self.block_cost; WIDTH];
                }
                Content::Apart { .. } => {}
            }
        }
        costs
    }
}

/// The plan for a node of the given half area, and its costs, by those of its children.
#[inline(always)]
fn plan_node<S: Simd>(simd: S, area: f32, left: &Costs, right: &Costs) -> (Plan, Costs) {
    let never = f32x8::splat(simd, f32::INFINITY);
    let right = f32x8::load_array_ref(simd, right);
    // Lanes are numbers of roots less one: where the left child has some of them, the right one has so many fewer.
    let fewer = [
        never.slide::<7>(right),
        never.slide::<6>(right),
        never.slide::<5>(right),
        never.slide::<4>(right),
        never.slide::<3>(right),
        never.slide::<2>(right),
        never.slide::<1>(right),
    ];
    let (mut least, mut to_left) = (never, i32x8::splat(simd, 0));
    for (number, (&left, right)) in (1..).zip(left.iter().zip(fewer)) {
        let cost = right + left;
        let better = cost.simd_lt(least);
        least = better.select(cost, least);
        to_left = better.select(i32x8::splat(simd, number), to_left);
    }
    // As one root it is a wide node of up to 8 children, which is visited.
    let least_of_all = least.to_array()[WIDTH - 1];
    let alone = f32x8::splat(simd, least_of_all + area);
    let whole = alone.simd_le(least);
    let mut plan = whole.select(i32x8::splat(simd, 0), to_left).to_array();
    // Whatever the costs, a wide node opens the binary one that it stands for.
    plan[WIDTH - 1] = to_left.to_array()[WIDTH - 1].max(1);
    (plan.map(|roots| roots as u8), alone.min(least).to_array())
}

/// Stores a child's box. An empty one must stay finite, as [`Node::EMPTY`] says.
#[inline(always)]
pub(crate) fn set_bounds(node: &mut Node, lane: usize, child: &PackedBox) {
    if child.is_empty() {
        for (row, nowhere) in node.bounds.iter_mut().zip(&Node::EMPTY.bounds) {
            row[lane] = nowhere[lane];
        }
        return;
    }
    for axis in 0..3 {
        node.bounds[axis][lane] = child.0[axis];
        node.bounds[axis + 3][lane] = -child.0[axis + 4];
    }
}

/// Joins parts into one tree; the first is the top, whose children that are apart begin the others, in order.
fn finish(parts: Vec<Part>, binary: &[BinaryNode], extent: [f32; 3]) -> (WideTree, Vec<BlockRange>) {
    let (mut node_starts, mut block_starts) = (vec![0], vec![0]);
    for part in &parts {
        node_starts.push(node_starts[node_starts.len() - 1] + part.nodes.len());
        block_starts.push(block_starts[block_starts.len() - 1] + part.blocks.len() as u32);
    }
    let total = node_starts[parts.len()];
    let moved = |part: usize, node: &Node| {
        let mut node = *node;
        for child in node.child.iter_mut().filter(|child| **child != Child::NONE) {
            *child = if child.is_leaf() {
                Child::leaf(child.payload() + 2 * block_starts[part])
            } else if child.0 & APART != 0 {
                Child::inner(node_starts[(child.0 & !APART) as usize + 1] as u32)
            } else {
                Child::inner(child.0 + node_starts[part] as u32)
            };
        }
        node
    };
    let nodes = parts::collect(total, 256, |first, to| {
        let mut part = node_starts.partition_point(|&start| start <= first) - 1;
        for index in first..first + to.len() {
            while node_starts[part + 1] <= index {
                part += 1;
            }
            to.push(moved(part, &parts[part].nodes[index - node_starts[part]]));
        }
    });
    let root_area = binary[0].bounds().half_area();
    let scale = if root_area > 0.0 && root_area.is_finite() { 1.0 / f64::from(root_area) } else { 0.0 };
    let tree = WideTree {
        nodes,
        compact: Vec::new(),
        extent,
        excess: 0.0,
        parts: node_starts.iter().map(|&start| start as u32).collect(),
        leaves: parts.iter().map(|part| part.leaves).sum(),
        sah: (parts.iter().map(|part| part.cost).sum::<f64>() * scale) as f32,
    };
    let mut blocks = Vec::with_capacity(block_starts[parts.len()] as usize);
    for part in &parts {
        blocks.extend_from_slice(&part.blocks);
    }
    (tree, blocks)
}

/// For each sign octant the lanes from near to far, by the centre's distance along the octant's diagonal.
#[inline(always)]
pub(crate) fn child_order<S: Simd>(simd: S, node: &Node, count: usize) -> [u32; WIDTH] {
    let [x, y, z] =
        [doubled_centers(simd, node, 0), doubled_centers(simd, node, 1), doubled_centers(simd, node, 2)];
    let lanes = i32x8::load_array(simd, [0, 1, 2, 3, 4, 5, 6, 7]);
    let used = lanes.simd_lt(i32x8::splat(simd, count as i32));
    let mut order = [0; WIDTH];
    // The opposite octant has the opposite order.
    for (octant, key) in [x + y + z, y + z - x, x + z - y, z - x - y].into_iter().enumerate() {
        let ranks = ranks(simd, key, used, lanes);
        let reversed = i32x8::splat(simd, count as i32 - 1) - ranks;
        order[octant] = packed(lanes, ranks);
        order[7 - octant] = packed(lanes, used.select(reversed, ranks));
    }
    order
}

#[inline(always)]
fn doubled_centers<S: Simd>(simd: S, node: &Node, axis: usize) -> f32x8<S> {
    f32x8::load_array_ref(simd, &node.bounds[axis]) + f32x8::load_array_ref(simd, &node.bounds[axis + 3])
}

/// The place of each lane in the order of `keys`; unused lanes keep theirs, behind the used ones.
#[inline(always)]
fn ranks<S: Simd>(simd: S, keys: f32x8<S>, used: mask32x8<S>, lanes: i32x8<S>) -> i32x8<S> {
    // As integers that compare like the keys, whose lowest bits give way to the lane: no two are equal.
    let bits: i32x8<S> = keys.bitcast();
    let sortable = bits ^ ((bits >> 31) & i32x8::splat(simd, i32::MAX));
    let last = i32x8::splat(simd, i32::MAX);
    let sortable = (used.select(sortable, last) & i32x8::splat(simd, !7)) | lanes;
    let (mut ranks, one) = (i32x8::splat(simd, 0), i32x8::splat(simd, 1));
    for key in sortable.to_array() {
        let behind = i32x8::splat(simd, key).simd_lt(sortable);
        ranks = behind.select(ranks + one, ranks);
    }
    ranks
}

/// Each lane's number, 3 bits wide, at its rank.
#[inline(always)]
fn packed<S: Simd>(lanes: i32x8<S>, ranks: i32x8<S>) -> u32 {
    let mut bits = 0;
    for place in (lanes << (ranks + ranks + ranks)).to_array() {
        bits |= place as u32;
    }
    bits
}
