//! The collapse of a binary tree into 8-wide nodes, apart from any builder.
use super::binary::BinaryNode;
use crate::layout::{Child, Node, WIDTH};

/// A finished 8-wide tree. The root is node 0; no nodes means nothing to hit.
#[derive(Debug, Default)]
pub(crate) struct WideTree {
    pub nodes: Vec<Node>,
    /// Largest coordinate magnitude per axis: the scale of rounding errors in box tests.
    pub extent: [f32; 3],
    pub leaves: usize,
    /// SAH cost relative to the root's area: node visits plus leaf costs.
    pub sah: f32,
}

/// Collapses by opening the largest child until a node is full. `leaf` turns a leaf (first primitive, count)
/// into a payload and its cost; it is called in depth-first order.
pub(crate) fn collapse(binary: &[BinaryNode], mut leaf: impl FnMut(u32, u32) -> (Child, f32)) -> WideTree {
    let Some(root) = binary.first() else { return WideTree::default() };
    let extent = root.lo.abs().max(root.hi.abs());
    let mut tree = WideTree { extent: [extent.x, extent.y, extent.z], ..WideTree::default() };
    let root_area = root.half_area();
    let scale = if root_area > 0.0 && root_area.is_finite() { 1.0 / root_area } else { 0.0 };
    let mut sah = 0.0_f64;

    tree.nodes.push(Node::EMPTY);
    // Depth first, so that a subtree lies together in memory: (binary node to open, wide node to fill).
    let mut open = vec![(0_usize, 0_usize)];
    while let Some((from, to)) = open.pop() {
        sah += f64::from(binary[from].half_area() * scale);
        let (members, count) = gather(binary, from);
        let mut node = Node::EMPTY;
        for (lane, &member) in members[..count].iter().enumerate() {
            let child = &binary[member];
            set_bounds(&mut node, lane, child);
            node.child[lane] = if child.right == 0 {
                let (code, cost) = leaf(child.begin, child.count);
                tree.leaves += 1;
                sah += f64::from(child.half_area() * scale * cost);
                code
            } else {
                let index = tree.nodes.len();
                tree.nodes.push(Node::EMPTY);
                open.push((member, index));
                Child::inner(index as u32)
            };
        }
        node.order = child_order(&node);
        tree.nodes[to] = node;
    }
    tree.sah = sah as f32;
    tree
}

/// Up to 8 descendants of `from` that together replace it.
fn gather(binary: &[BinaryNode], from: usize) -> ([usize; WIDTH], usize) {
    let mut members = [from; WIDTH];
    let mut count = 1;
    while count < WIDTH {
        let mut largest: Option<(usize, f32)> = None;
        for (i, &member) in members[..count].iter().enumerate() {
            let area = binary[member].half_area();
            if binary[member].right != 0 && largest.is_none_or(|(_, a)| area > a) {
                largest = Some((i, area));
            }
        }
        let Some((i, _)) = largest else { break };
        let opened = members[i];
        members[i] = opened + 1;
        members[count] = opened + binary[opened].right as usize;
        count += 1;
    }
    (members, count)
}

fn set_bounds(node: &mut Node, lane: usize, child: &BinaryNode) {
    for axis in 0..3 {
        node.bounds[axis][lane] = child.lo[axis];
        node.bounds[axis + 3][lane] = child.hi[axis];
    }
}

/// For each sign octant the lanes from near to far, by the centre's distance along the octant's diagonal.
fn child_order(node: &Node) -> [u32; WIDTH] {
    let mut order = [0; WIDTH];
    for (octant, packed) in order.iter_mut().enumerate() {
        let key = |lane: usize| {
            if node.child[lane] == Child::NONE {
                return f32::INFINITY;
            }
            (0..3).fold(0.0, |sum, axis| {
                let center = node.bounds[axis][lane] + node.bounds[axis + 3][lane];
                if octant >> axis & 1 == 0 { sum + center } else { sum - center }
            })
        };
        let mut lanes = [0, 1, 2, 3, 4, 5, 6, 7];
        lanes.sort_by(|&a, &b| key(a).total_cmp(&key(b)));
        *packed = lanes.iter().rev().fold(0, |bits, &lane| bits << 3 | lane as u32);
    }
    order
}
