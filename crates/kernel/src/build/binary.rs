//! The binary tree between builders and the collapse.
use super::boxes::PackedBox;
use crate::aabb::Aabb;

/// A node of the binary tree, 32 B. Two siblings share a cache line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BinaryNode(PackedBox);

/// What a [`BinaryNode`] holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Content {
    /// Children are the nodes `children` and `children + 1`; `count` references lie below.
    Inner { children: u32, count: u32 },
    /// References `begin .. begin + count` of the builder's list.
    Leaf { begin: u32, count: u32 },
    /// A subtree that is still apart: its number in a [`Piece`].
    Apart { task: u32 },
}

impl BinaryNode {
    const LEAF: u32 = 1 << 31;
    const APART: u32 = 1 << 30;
    /// Fills the place beside the root, so that siblings start at even indices: a leaf of nothing.
    pub(crate) const PAD: Self = {
        let mut bounds = PackedBox::EMPTY;
        [bounds.0[3], bounds.0[7]] = [f32::from_bits(Self::LEAF), 0.0];
        Self(bounds)
    };

    pub(crate) fn new(bounds: &PackedBox, content: Content) -> Self {
        Self(bounds.with_tags(match content {
            Content::Inner { children, count } => [children, count],
            Content::Leaf { begin, count } => [Self::LEAF | count, begin],
            Content::Apart { task } => [Self::LEAF | Self::APART, task],
        }))
    }

    #[inline(always)]
    pub(crate) fn content(&self) -> Content {
        let [a, b] = self.0.tags();
        if a & Self::LEAF == 0 {
            Content::Inner { children: a, count: b }
        } else if a & Self::APART == 0 {
            Content::Leaf { begin: b, count: a & !Self::LEAF }
        } else {
            Content::Apart { task: b }
        }
    }

    /// The bounds; their tags mean nothing.
    #[inline(always)]
    pub(crate) fn bounds(&self) -> &PackedBox {
        &self.0
    }

    /// The same node when all nodes of its list moved by `nodes` places and tasks by `tasks`.
    fn moved(&self, nodes: u32, tasks: u32) -> Self {
        let content = match self.content() {
            Content::Inner { children, count } => Content::Inner { children: children + nodes, count },
            Content::Apart { task } => Content::Apart { task: task + tasks },
            leaf @ Content::Leaf { .. } => leaf,
        };
        Self::new(&self.0, content)
    }
}

/// A finished binary tree; the root is node 0.
#[derive(Debug)]
pub(crate) struct BinaryTree {
    pub nodes: Vec<BinaryNode>,
    /// Where runs of nodes begin, and the number of nodes. The first run is the top; from its nodes one gets into the
    /// others, whose nodes have children in the same run alone. Children always come behind their parents.
    pub runs: Vec<u32>,
}

impl BinaryTree {
    /// The box around everything.
    pub(crate) fn bounds(&self) -> Aabb {
        let root = self.nodes[0].bounds();
        Aabb::new(root.lo(), root.hi())
    }
}

/// A tree in the making: the nodes near the root, and the subtrees that tasks built.
pub(crate) struct Piece {
    root: BinaryNode,
    /// Pairs of siblings; indices count from the first of them.
    nodes: Vec<BinaryNode>,
    /// Whole subtrees: root, padding, then pairs.
    tasks: Vec<Vec<BinaryNode>>,
}

impl Piece {
    /// A piece that is one task's subtree.
    pub(crate) fn task(subtree: Vec<BinaryNode>) -> Self {
        let root = BinaryNode::new(&PackedBox::EMPTY, Content::Apart { task: 0 });
        Self { root, nodes: Vec::new(), tasks: vec![subtree] }
    }

    /// A node over two pieces with `count` references in all.
    pub(crate) fn join(bounds: &PackedBox, count: u32, left: Self, right: Self) -> Self {
        let (left_at, right_at) = (2, 2 + left.nodes.len() as u32);
        let tasks_at = left.tasks.len() as u32;
        let mut nodes = Vec::with_capacity(2 + left.nodes.len() + right.nodes.len());
        nodes.extend([left.root.moved(left_at, 0), right.root.moved(right_at, tasks_at)]);
        nodes.extend(left.nodes.iter().map(|node| node.moved(left_at, 0)));
        nodes.extend(right.nodes.iter().map(|node| node.moved(right_at, tasks_at)));
        let mut tasks = left.tasks;
        tasks.extend(right.tasks);
        Self { root: BinaryNode::new(bounds, Content::Inner { children: 0, count }), nodes, tasks }
    }

    /// The whole tree as one list: root, padding, then pairs.
    pub(crate) fn assemble(self) -> BinaryTree {
        let mut nodes = Vec::with_capacity(
            2 + self.nodes.len() + self.tasks.iter().map(|task| task.len() - 2).sum::<usize>(),
        );
        nodes.extend([self.root.moved(2, 0), BinaryNode::PAD]);
        nodes.extend(self.nodes.iter().map(|node| node.moved(2, 0)));
        let mut runs = vec![0];
        for place in 0..nodes.len() {
            if let Content::Apart { task } = nodes[place].content() {
                let subtree = &self.tasks[task as usize];
                runs.push(nodes.len() as u32);
                let shift = nodes.len() as u32 - 2;
                nodes[place] = subtree[0].moved(shift, 0);
                nodes.extend(subtree[2..].iter().map(|node| node.moved(shift, 0)));
            }
        }
        runs.push(nodes.len() as u32);
        BinaryTree { nodes, runs }
    }
}

/// What a leaf may hold and what it costs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LeafRule {
    /// Largest number of primitives.
    pub max: usize,
    /// Binary logarithm of the number of primitives tested together.
    pub block_shift: u32,
}

impl LeafRule {
    /// Blocks that `count` primitives fill.
    #[inline(always)]
    pub(crate) fn blocks(self, count: usize) -> usize {
        (count + (1 << self.block_shift) - 1) >> self.block_shift
    }
}
