//! What a finished kd-tree looks like, by one walk over its nodes.
use super::{KdOptions, KdTree, node::KdNodeKind, sweep::half_area};

/// Size and quality of a [`KdTree`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct KdStats {
    /// Triangles that can be hit; those skipped as degenerate or not finite are not counted.
    pub triangles: usize,
    /// Nodes, leaves included.
    pub nodes: usize,
    /// Leaves, empty ones included.
    pub leaves: usize,
    /// Leaves without triangles.
    pub empty_leaves: usize,
    /// Entries in the lists of the leaves.
    pub references: usize,
    /// Levels below the root of the deepest leaf.
    pub depth: u32,
    /// Memory of nodes, references and triangles, bytes.
    pub bytes: usize,
    /// Expected cost of a random ray through the bounds by the surface area heuristic, in the units of the build
    /// options' costs.
    pub sah: f32,
}

impl KdStats {
    pub(super) fn of(tree: &KdTree, options: &KdOptions) -> Self {
        let mut stats = Self {
            triangles: tree.corners.len(),
            nodes: tree.nodes.len(),
            references: tree.references.len(),
            bytes: size_of_val(&tree.nodes[..])
                + size_of_val(&tree.references[..])
                + size_of_val(&tree.corners[..])
                + size_of_val(&tree.numbers[..]),
            ..Self::default()
        };
        let (traversal, intersection) =
            (f64::from(options.traversal_cost), f64::from(options.intersection_cost));
        let mut cost = 0.0;
        let mut open = vec![(0_u32, tree.bounds, 0_u32)];
        while let Some((node, cell, depth)) = open.pop() {
            match tree.nodes[node as usize].kind() {
                KdNodeKind::Leaf { count, .. } => {
                    stats.leaves += 1;
                    stats.empty_leaves += usize::from(count == 0);
                    stats.depth = stats.depth.max(depth);
                    cost += half_area(&cell) * intersection * f64::from(count);
                }
                KdNodeKind::Inner { axis, split, children } => {
                    cost += half_area(&cell) * traversal;
                    let (mut below, mut above) = (cell, cell);
                    below.max[axis] = split;
                    above.min[axis] = split;
                    open.extend([(children + 1, above, depth + 1), (children, below, depth + 1)]);
                }
            }
        }
        stats.sah = (cost / half_area(&tree.bounds)) as f32;
        stats
    }
}
