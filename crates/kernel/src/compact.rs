//! The compact layout: nodes with boxes in 8 bits, and blocks that name triangles instead of holding their vertices.
//!
//! Both are decoded into the full form when a traversal reads them, so there is one traversal. Boxes only ever grow: a
//! bound is a whole number of steps from the node's corner, and it is chosen by decoding it, so that no rounding can
//! have moved it inwards [after Ylitie, Karras and Laine 2017, "Efficient incoherent ray traversal on GPUs through
//! compressed wide BVHs"]. Vertices are read from the meshes, bit for bit, so hits are the same in both layouts.
use fearless_simd::{Fallback, Simd, f32x8, i32x8, prelude::*, u8x16, u32x8};
use glam::Vec3;

use crate::{
    build::triangles::locate,
    layout::{Block, Child, Node, WIDTH},
    mesh::Mesh,
    prefetch::prefetch,
};

/// A [`Node`] in 128 B.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompactNode {
    /// Lowest corner of all child boxes.
    origin: [f32; 3],
    /// The step along each axis, as the biased exponent of a power of two; 0 is no step.
    exponents: [u8; 3],
    unused: u8,
    /// Child boxes in steps from the corner, in the order of [`Node::bounds`].
    bounds: [[u8; WIDTH]; 6],
    child: [Child; WIDTH],
    order: [u32; WIDTH],
}

const _: () = assert!(size_of::<CompactNode>() == 128);

impl CompactNode {
    /// The node with boxes that hold those of `node`. Inverted boxes stay inverted or become flat.
    pub(crate) fn encode(node: &Node) -> Self {
        let mut compact = Self {
            origin: [0.0; 3],
            exponents: [0; 3],
            unused: 0,
            bounds: [[0; WIDTH]; 6],
            child: node.child,
            order: node.order,
        };
        let is_box = |lane: &usize| node.bounds[0][*lane] <= node.bounds[3][*lane];
        for axis in 0..3 {
            let (lo, hi) = (&node.bounds[axis], &node.bounds[axis + 3]);
            let boxes = || (0..WIDTH).filter(is_box);
            let low = boxes().fold(f32::INFINITY, |low, lane| low.min(lo[lane]));
            let high = boxes().fold(f32::NEG_INFINITY, |high, lane| high.max(hi[lane]));
            if low > high {
                break;
            }
            // The exponent of a value a little below the step needed, then up until the last step reaches far enough.
            let mut exponent = (((high - low) / 255.0).to_bits() >> 23) as u8;
            while at(low, step(exponent), 255) < high {
                exponent += 1;
            }
            let step = step(exponent);
            (compact.origin[axis], compact.exponents[axis]) = (low, exponent);
            for lane in 0..WIDTH {
                let (lower, upper) = if is_box(&lane) {
                    (steps_below(low, step, lo[lane]), steps_above(low, step, hi[lane]))
                } else {
                    (u8::MAX, 0)
                };
                compact.bounds[axis][lane] = lower;
                compact.bounds[axis + 3][lane] = upper;
            }
        }
        compact
    }

    /// The node in full, built in `place`.
    #[inline(always)]
    fn decode<'a, S: Simd>(&self, simd: S, place: &'a mut Option<Node>) -> &'a Node {
        let node = place.insert(Node::EMPTY);
        (node.child, node.order) = (self.child, self.order);
        // Empty lanes keep the box that is never met.
        let used = u32x8::load_array(simd, self.child.map(|child| child.0))
            .simd_ne(u32x8::splat(simd, Child::NONE.0));
        let (pairs, _) = self.bounds.as_flattened().as_chunks::<{ 2 * WIDTH }>();
        for (pair, steps) in pairs.iter().enumerate() {
            let (even, odd) = u8x16::load_array_ref(simd, steps).widen();
            for (row, steps) in [(2 * pair, even), (2 * pair + 1, odd)] {
                let (low, high) = steps.widen();
                let steps: i32x8<S> = low.combine(high).bitcast();
                let steps: f32x8<S> = f32x8::float_from(steps);
                let (origin, step) = (self.origin[row % 3], step(self.exponents[row % 3]));
                let bounds = f32x8::splat(simd, origin) + steps * f32x8::splat(simd, step);
                let empty = f32x8::load_array_ref(simd, &Node::EMPTY.bounds[row]);
                used.select(bounds, empty).store_array(&mut node.bounds[row]);
            }
        }
        node
    }

    /// The node in full, for those who do not hurry.
    pub(crate) fn expand(&self) -> Node {
        *self.decode(Fallback::new(), &mut None)
    }
}

/// The power of two with a biased exponent; 0 for 0.
#[inline(always)]
fn step(exponent: u8) -> f32 {
    f32::from_bits(u32::from(exponent) << 23)
}

/// The coordinate some steps from the corner: one rounding, as the product is exact.
#[inline(always)]
fn at(origin: f32, step: f32, steps: u8) -> f32 {
    origin + f32::from(steps) * step
}

fn steps_below(origin: f32, step: f32, bound: f32) -> u8 {
    // The conversion saturates, and makes nothing of 0/0.
    let mut steps = ((bound - origin) / step) as u8;
    while steps > 0 && at(origin, step, steps) > bound {
        steps -= 1;
    }
    steps
}

fn steps_above(origin: f32, step: f32, bound: f32) -> u8 {
    let mut steps = ((bound - origin) / step).ceil() as u8;
    while steps < u8::MAX && at(origin, step, steps) < bound {
        steps += 1;
    }
    steps
}

/// A [`Block`] in 32 B: the numbers of its triangles.
#[repr(transparent)]
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompactBlock([u32; WIDTH]);

/// Blocks that name triangles of meshes which they share.
#[derive(Clone, Debug, Default)]
pub(crate) struct CompactBlocks {
    pub blocks: Vec<CompactBlock>,
    pub meshes: Vec<Mesh>,
}

impl CompactBlock {
    /// Set in the number of a triangle that cannot be hit at present, and in that of an empty lane.
    const HIDDEN: u32 = 1 << 31;

    pub(crate) fn new(triangles: &[u32; WIDTH]) -> Self {
        Self(*triangles)
    }

    /// The numbers of all triangles, hidden or not.
    pub(crate) fn triangles(&self) -> [u32; WIDTH] {
        self.0.map(|id| if id == Block::NO_TRIANGLE { id } else { id & !Self::HIDDEN })
    }

    /// Hides the triangles that a refit made points at the origin.
    pub(crate) fn hide_points(&mut self, block: &Block) {
        for (lane, id) in self.0.iter_mut().enumerate().filter(|(_, id)| **id != Block::NO_TRIANGLE) {
            let is_point = block.corners(lane) == [[0.0; 3]; 3];
            *id = (*id & !Self::HIDDEN) | if is_point { Self::HIDDEN } else { 0 };
        }
    }

    /// The block in full, built in `place`.
    #[inline(always)]
    fn decode<'a>(&self, meshes: &[Mesh], starts: &[u32], place: &'a mut Option<Block>) -> &'a Block {
        let block = place.insert(Block::EMPTY);
        let mut corners = [[Vec3::ZERO; WIDTH]; 3];
        for (lane, &id) in self.0.iter().enumerate().filter(|(_, id)| **id != Block::NO_TRIANGLE) {
            // Lanes without a triangle come last; one that is hidden is a point, as in a full block.
            block.triangle[lane] = id & !Self::HIDDEN;
            if id & Self::HIDDEN == 0 {
                let (mesh, triangle) = locate(starts, id);
                let Mesh { positions, indices, .. } = &meshes[mesh];
                for (corner, index) in corners.iter_mut().zip(indices[triangle]) {
                    corner[lane] = positions[index as usize];
                }
            }
        }
        for (vertex, corner) in block.vertex.iter_mut().zip(&corners) {
            for (axis, row) in vertex.iter_mut().enumerate() {
                for (value, p) in row.iter_mut().zip(corner) {
                    *value = p[axis];
                }
            }
        }
        block
    }
}

/// The nodes of a tree in either layout.
#[derive(Clone, Copy)]
pub(crate) struct Nodes<'a> {
    pub full: &'a [Node],
    pub compact: &'a [CompactNode],
}

impl<'a> Nodes<'a> {
    /// Node `index` in full: where it is stored, or decoded in `place`. In the full layout this costs as much as the
    /// bounds check of an index.
    #[inline(always)]
    pub(crate) fn get<S: Simd>(self, simd: S, index: usize, place: &'a mut Option<Node>) -> &'a Node {
        match self.full.get(index) {
            Some(node) => node,
            None => decode_node(simd, &self.compact[index], place),
        }
    }
}

/// A call, so that the code around it stays as for the full layout.
#[inline(never)]
fn decode_node<'a, S: Simd>(simd: S, node: &CompactNode, place: &'a mut Option<Node>) -> &'a Node {
    simd.vectorize(
        #[inline(always)]
        || node.decode(simd, place),
    )
}

/// The blocks of a tree in either layout.
#[derive(Clone, Copy)]
pub(crate) struct Blocks<'a> {
    pub full: &'a [Block],
    pub compact: &'a CompactBlocks,
    /// First running triangle number of each mesh, and the total at the end.
    pub mesh_starts: &'a [u32],
}

impl<'a> Blocks<'a> {
    /// Block `index` in full, as [`Nodes::get`].
    #[inline(always)]
    pub(crate) fn get(self, index: usize, place: &'a mut Option<Block>) -> &'a Block {
        match self.full.get(index) {
            Some(block) => block,
            None => decode_block(self.compact, self.mesh_starts, index, place),
        }
    }

    /// Asks for a block that will be read soon; nothing for compact ones.
    #[inline(always)]
    pub(crate) fn prefetch(self, index: usize) {
        prefetch(self.full, index);
    }
}

/// Where a traversal takes blocks from.
pub(crate) trait BlockSource: Copy {
    /// Block `index` in full: where it is stored, or made in `place`.
    fn block<'p>(self, index: usize, place: &'p mut Option<Block>) -> &'p Block
    where
        Self: 'p;

    /// The running number of triangle `id`, which is `block · 8 + lane`.
    fn number(self, id: u32) -> u32;
}

impl BlockSource for Blocks<'_> {
    #[inline(always)]
    fn block<'p>(self, index: usize, place: &'p mut Option<Block>) -> &'p Block
    where
        Self: 'p,
    {
        self.get(index, place)
    }

    #[inline(always)]
    fn number(self, id: u32) -> u32 {
        let (index, lane) = (id as usize / WIDTH, id as usize % WIDTH);
        match self.full.get(index) {
            Some(block) => block.triangle[lane],
            None => self.compact.blocks[index].0[lane],
        }
    }
}

/// The blocks of moving triangles at one moment.
#[derive(Clone, Copy)]
pub(crate) struct MovingBlocks<'a> {
    /// When the shutter opens, and when it closes.
    pub ends: [&'a [Block]; 2],
    /// From 0 to 1.
    pub time: f32,
}

impl BlockSource for MovingBlocks<'_> {
    #[inline(always)]
    fn block<'p>(self, index: usize, place: &'p mut Option<Block>) -> &'p Block
    where
        Self: 'p,
    {
        let [opening, closing] = self.ends.map(|blocks| &blocks[index]);
        let block = place.insert(Block { triangle: opening.triangle, ..Block::EMPTY });
        let rows = block.vertex.iter_mut().flatten();
        let ends = opening.vertex.iter().flatten().zip(closing.vertex.iter().flatten());
        for (row, (from, to)) in rows.zip(ends) {
            for lane in 0..WIDTH {
                // In this form both ends are met exactly; vertices that are shared stay so.
                row[lane] = from[lane] * (1.0 - self.time) + to[lane] * self.time;
            }
        }
        block
    }

    #[inline(always)]
    fn number(self, id: u32) -> u32 {
        self.ends[0][id as usize / WIDTH].triangle[id as usize % WIDTH]
    }
}

/// A call, as [`decode_node`].
#[inline(never)]
fn decode_block<'a>(
    compact: &CompactBlocks,
    starts: &[u32],
    index: usize,
    place: &'a mut Option<Block>,
) -> &'a Block {
    compact.blocks[index].decode(&compact.meshes, starts, place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoded_boxes_hold_the_boxes_encoded() {
        let mut bits = 1_u64;
        let mut random = || {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (bits >> 40) as f32 / (1 << 24) as f32
        };
        for round in 0..20_000 {
            let mut node = Node::EMPTY;
            let used = 1 + round % WIDTH;
            let center = (random() - 0.5) * 10.0_f32.powf(random() * 30.0 - 20.0);
            let size = center.abs() * 10.0_f32.powf(random() * 12.0 - 10.0);
            for lane in 0..used {
                node.child[lane] = Child::inner(lane as u32);
                for axis in 0..3 {
                    let low = center + size * random();
                    let extent = if round % 7 == axis { 0.0 } else { size * random() * random() };
                    (node.bounds[axis][lane], node.bounds[axis + 3][lane]) = (low, low + extent);
                }
            }
            let decoded = CompactNode::encode(&node).expand();
            assert_eq!((decoded.child, decoded.order), (node.child, node.order));
            for axis in 0..3 {
                for lane in 0..used {
                    assert!(decoded.bounds[axis][lane] <= node.bounds[axis][lane], "{node:?}");
                    assert!(decoded.bounds[axis + 3][lane] >= node.bounds[axis + 3][lane], "{node:?}");
                }
                let step = |b: &[f32; WIDTH], other: &[f32; WIDTH]| {
                    (0..used).map(|i| (b[i] - other[i]).abs()).fold(0.0, f32::max)
                };
                let widest = (0..used).map(|i| node.bounds[axis + 3][i]).fold(f32::MIN, f32::max)
                    - (0..used).map(|i| node.bounds[axis][i]).fold(f32::MAX, f32::min);
                // A step is less than twice what it needs to be, plus the rounding of a coordinate.
                let allowed = widest / 255.0 * 2.0
                    + 2.0 * f32::EPSILON * (center.abs() + 2.0 * size)
                    + f32::MIN_POSITIVE;
                assert!(step(&decoded.bounds[axis], &node.bounds[axis]) <= allowed);
                assert!(step(&decoded.bounds[axis + 3], &node.bounds[axis + 3]) <= allowed);
            }
            for lane in used..WIDTH {
                assert!((0..6).all(|row| decoded.bounds[row][lane] == Node::EMPTY.bounds[row][lane]));
            }
        }
    }
}
