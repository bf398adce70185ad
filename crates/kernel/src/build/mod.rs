//! Tree construction: a binary tree by the surface area heuristic, then its collapse to 8-wide nodes.
pub(crate) mod binary;
pub(crate) mod binned;
pub(crate) mod boxes;
pub(crate) mod triangles;
pub(crate) mod watch;
pub(crate) mod wide;

use fearless_simd::Level;

use crate::isa::Isa;

/// How a tree is built. The defaults suit nearly everything.
///
/// | field | unit | default | meaning |
/// |---|---|---|---|
/// | `max_bins` | – | 32 | split candidates per axis; more is slower and slightly better |
/// | `traversal_cost` | – | 0.8 | cost of a binary step, relative to … |
/// | `intersection_cost` | – | 1.0 | … the cost of testing one block of 8 triangles |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildOptions {
    /// Split candidates per axis, clamped to 4..=32.
    pub max_bins: usize,
    /// Cost of a binary traversal step.
    pub traversal_cost: f32,
    /// Cost of testing a ray against one block of 8 triangles.
    pub intersection_cost: f32,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { max_bins: 32, traversal_cost: 0.8, intersection_cost: 1.0 }
    }
}

/// What a finished tree looks like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TreeStats {
    /// Triangles that can be hit; those skipped as degenerate or not finite are not counted.
    pub triangles: usize,
    /// Inner nodes, 8 children wide.
    pub nodes: usize,
    /// Leaves.
    pub leaves: usize,
    /// Memory of nodes and triangle blocks, bytes.
    pub bytes: usize,
    /// Expected cost of a random ray: node visits plus block tests, by the surface area heuristic.
    pub sah: f32,
}

/// The instruction set that builders run on: the one that `HELIOSTAT_ISA` forces, otherwise the best. It makes no
/// difference to the result.
pub(crate) fn level() -> Level {
    let forced = Isa::from_env().ok().flatten();
    forced.unwrap_or_else(Isa::best).checked_level().unwrap_or_else(|_| Level::baseline())
}
