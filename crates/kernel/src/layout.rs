//! The packed memory that traversal reads: 8-wide nodes and blocks of 8 triangles.

/// Children of a wide node and triangles of a block.
pub(crate) const WIDTH: usize = 8;
/// Largest number of triangles in a leaf: two blocks.
pub(crate) const LEAF_TRIANGLES: usize = 2 * WIDTH;
/// Coordinate of the inverted box of an empty child: finite, because `0 · ∞` is NaN.
const NOWHERE: f32 = 1.0e30;

/// A node of an 8-wide tree, 256 B. Lanes are children, in no particular order; empty children come last.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    /// Child boxes: lower x, y, z, then upper x, y, z.
    pub bounds: [[f32; WIDTH]; 6],
    /// What each lane holds.
    pub child: [Child; WIDTH],
    /// For each sign octant of the direction (bit k set: axis k negative) eight lane numbers of 3 bits each, the
    /// nearest in the lowest bits [Fuetterling et al. 2017]. An approximate order: culling never relies on it.
    pub order: [u32; WIDTH],
}

const _: () = assert!(size_of::<Node>() == 256);

impl Node {
    /// A node whose lanes are all empty.
    pub(crate) const EMPTY: Self = Self {
        bounds: [
            [NOWHERE; WIDTH],
            [NOWHERE; WIDTH],
            [NOWHERE; WIDTH],
            [-NOWHERE; WIDTH],
            [-NOWHERE; WIDTH],
            [-NOWHERE; WIDTH],
        ],
        child: [Child::NONE; WIDTH],
        order: [0; WIDTH],
    };
}

/// A reference in 32 bits: an inner node, or a leaf with a payload of 31 bits.
///
/// For triangle trees the payload is `first block · 2 + (blocks − 1)`, for instance trees the instance's index, or
/// that of an entry where instances are opened.
#[repr(transparent)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Child(pub u32);

impl Child {
    /// An empty lane; its box is never met.
    pub(crate) const NONE: Self = Self(u32::MAX);
    /// The first node of a tree.
    pub(crate) const ROOT: Self = Self(0);
    const LEAF: u32 = 1 << 31;

    pub(crate) const fn inner(node: u32) -> Self {
        Self(node)
    }

    pub(crate) const fn leaf(payload: u32) -> Self {
        Self(Self::LEAF | payload)
    }

    /// A leaf of `count` (1 or 2) consecutive blocks.
    pub(crate) const fn blocks(first: u32, count: u32) -> Self {
        Self::leaf(first * 2 + (count - 1))
    }

    #[inline(always)]
    pub(crate) const fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    #[inline(always)]
    pub(crate) const fn payload(self) -> u32 {
        self.0 & !Self::LEAF
    }

    /// First block and one past the last.
    #[inline(always)]
    pub(crate) const fn block_range(self) -> (usize, usize) {
        let payload = self.payload();
        let first = (payload >> 1) as usize;
        (first, first + 1 + (payload & 1) as usize)
    }
}

/// Eight triangles, one per lane, 320 B. Empty lanes hold a point at the origin, which nothing hits.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    /// `vertex[corner][axis][lane]`, object space, exactly as in the mesh: shared vertices must stay equal.
    pub vertex: [[[f32; WIDTH]; 3]; 3],
    /// Running number of the triangle over all meshes of the object; [`Block::NO_TRIANGLE`] in empty lanes.
    pub triangle: [u32; WIDTH],
}

const _: () = assert!(size_of::<Block>() == 320);

impl Block {
    pub(crate) const NO_TRIANGLE: u32 = u32::MAX;
    pub(crate) const EMPTY: Self =
        Self { vertex: [[[0.0; WIDTH]; 3]; 3], triangle: [Self::NO_TRIANGLE; WIDTH] };

    /// The three corners of `lane`.
    #[inline(always)]
    pub(crate) fn corners(&self, lane: usize) -> [[f32; 3]; 3] {
        let lane = lane & (WIDTH - 1);
        let mut corners = [[0.0; 3]; 3];
        for (corner, vertex) in corners.iter_mut().zip(&self.vertex) {
            for (value, lanes) in corner.iter_mut().zip(vertex) {
                *value = lanes[lane];
            }
        }
        corners
    }
}
