//! The 8-byte node of the kd-tree, and how to read it.

/// A node of a [`KdTree`](super::KdTree), 8 B as in the hardware of the 2003 report: two words.
///
/// | | word 0, bits 31…2 | word 0, bits 1…0 | word 1 |
/// |---|---|---|---|
/// | inner | index of the lower child; the upper one follows it | split axis, 0…2 | split position, bits of an `f32` |
/// | leaf | number of references | 3 | index of the first reference |
///
/// # References
/// Wald 2004, "Realtime ray tracing and interactive global illumination", section 7.2.
#[repr(C, align(8))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KdNode {
    words: [u32; 2],
}

const _: () = assert!(size_of::<KdNode>() == 8);

/// A [`KdNode`] taken apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum KdNodeKind {
    /// A cell that a plane cuts in two.
    Inner {
        /// Axis that the plane is perpendicular to, 0…2.
        axis: usize,
        /// Where the plane cuts the axis, object space.
        split: f32,
        /// Index of the child below the plane; the one above is the next node.
        children: u32,
    },
    /// A cell with a list of triangles.
    Leaf {
        /// Index of its first entry in [`KdTree::references`](super::KdTree::references).
        first: u32,
        /// Number of entries; may be 0.
        count: u32,
    },
}

impl KdNode {
    const LEAF: u32 = 3;
    /// Largest index or count that fits.
    pub(super) const MAX_PAYLOAD: u32 = (1 << 30) - 1;

    pub(super) const fn inner(axis: usize, split: f32, children: u32) -> Self {
        Self { words: [children << 2 | axis as u32, split.to_bits()] }
    }

    pub(super) const fn leaf(first: u32, count: u32) -> Self {
        Self { words: [count << 2 | Self::LEAF, first] }
    }

    /// The node with its children or references moved: for joining trees.
    pub(super) fn shifted(self, nodes: u32, references: u32) -> Self {
        match self.kind() {
            KdNodeKind::Inner { axis, split, children } => Self::inner(axis, split, children + nodes),
            KdNodeKind::Leaf { first, count } => Self::leaf(first + references, count),
        }
    }

    /// The two words as they lie in memory.
    #[must_use]
    pub const fn words(self) -> [u32; 2] {
        self.words
    }

    /// What the node says.
    #[must_use]
    pub const fn kind(self) -> KdNodeKind {
        if self.is_leaf() {
            KdNodeKind::Leaf { first: self.words[1], count: self.payload() }
        } else {
            KdNodeKind::Inner { axis: self.axis(), split: self.split(), children: self.payload() }
        }
    }

    #[inline(always)]
    pub(super) const fn is_leaf(self) -> bool {
        self.words[0] & 3 == Self::LEAF
    }

    /// Split axis of an inner node.
    #[inline(always)]
    pub(super) const fn axis(self) -> usize {
        (self.words[0] & 3) as usize
    }

    /// Split position of an inner node.
    #[inline(always)]
    pub(super) const fn split(self) -> f32 {
        f32::from_bits(self.words[1])
    }

    /// Lower child of an inner node, number of references of a leaf.
    #[inline(always)]
    pub(super) const fn payload(self) -> u32 {
        self.words[0] >> 2
    }

    /// References of a leaf.
    #[inline(always)]
    pub(super) const fn range(self) -> std::ops::Range<usize> {
        let first = self.words[1] as usize;
        first..first + self.payload() as usize
    }
}
