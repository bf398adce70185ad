//! Tree construction: a binary tree by the surface area heuristic, then its collapse to 8-wide nodes.
pub(crate) mod binary;
pub(crate) mod binned;
pub(crate) mod boxes;
pub(crate) mod morton;
mod parts;
pub(crate) mod refit;
pub(crate) mod repair;
pub(crate) mod spatial;
pub(crate) mod treelets;
pub(crate) mod triangles;
pub(crate) mod watch;
pub(crate) mod wide;

use fearless_simd::Level;
use rayon::prelude::*;

use self::{binary::LeafRule, boxes::PackedBox, watch::Watch, wide::WideTree};
use crate::layout::{LEAF_TRIANGLES, WIDTH};
use crate::{aabb::Aabb, error::BuildError, mesh::Mesh};

use crate::isa::Isa;

/// Which method builds the binary tree that is then collapsed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Builder {
    /// Top down by the surface area heuristic over binned centres: good trees, quickly [Wald 2007].
    #[default]
    BinnedSah,
    /// The same with spatial splits: triangles that straddle a plane may go to both sides. Several times slower to
    /// build, faster to trace where triangles are long or large [Stich, Friedrich and Dietrich 2009].
    SpatialSah,
    /// Blocks of neighbours along a Morton curve under a binned tree: the fastest to build, somewhat slower to trace;
    /// for geometry that changes at every frame [after Pantaleoni and Luebke 2010].
    Morton,
}

/// How a finished tree lies in memory. Hits are the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Layout {
    /// Boxes in single precision, and a copy of the vertices in blocks of 8 triangles: the fastest to trace. About 55
    /// bytes per triangle; the meshes may be dropped.
    #[default]
    Full,
    /// Boxes in 8 bits per bound, and blocks that read the vertices from the meshes, whose arrays the tree shares. About
    /// 10 bytes per triangle beside the meshes.
    Compact,
}

/// How a tree is built. The defaults suit nearly everything.
///
/// | field | unit | default | meaning |
/// |---|---|---|---|
/// | `builder` | – | [`Builder::BinnedSah`] | the method |
/// | `layout` | – | [`Layout::Full`] | how it lies in memory |
/// | `spatial_budget` | triangles | 0.3 | references that spatial splits may add, per triangle |
/// | `max_bins` | – | 32 | split candidates per axis; more is slower and slightly better |
/// | `traversal_cost` | – | 0.8 | cost of a binary step, relative to … |
/// | `intersection_cost` | – | 1.0 | … the cost of testing one block of 8 triangles |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildOptions {
    /// The method.
    pub builder: Builder,
    /// How the finished tree lies in memory.
    pub layout: Layout,
    /// How many references [`Builder::SpatialSah`] may add, relative to the number of triangles; clamped to 0..=4.
    pub spatial_budget: f32,
    /// Split candidates per axis, clamped to 4..=32.
    pub max_bins: usize,
    /// Cost of a binary traversal step.
    pub traversal_cost: f32,
    /// Cost of testing a ray against one block of 8 triangles.
    pub intersection_cost: f32,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            builder: Builder::BinnedSah,
            layout: Layout::Full,
            spatial_budget: 0.3,
            max_bins: 32,
            traversal_cost: 0.8,
            intersection_cost: 1.0,
        }
    }
}

impl BuildOptions {
    /// For geometry that changes all the time: the fastest build.
    #[must_use]
    pub fn fast() -> Self {
        Self { builder: Builder::Morton, ..Self::default() }
    }

    /// For geometry that stays: the slowest build, the fastest tree.
    #[must_use]
    pub fn quality() -> Self {
        Self { builder: Builder::SpatialSah, ..Self::default() }
    }
}

/// What a finished tree looks like.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TreeStats {
    /// Triangles that could be hit when the tree was built; those skipped as degenerate or not finite are not counted.
    pub triangles: usize,
    /// Inner nodes, 8 children wide.
    pub nodes: usize,
    /// Leaves.
    pub leaves: usize,
    /// Memory of nodes and triangle blocks, bytes; without the meshes that the compact layout shares.
    pub bytes: usize,
    /// Expected cost of a random ray: node visits plus block tests, by the surface area heuristic.
    pub sah: f32,
    /// The same when the tree was built: how far [`TreeStats::sah`] lies above it tells when to rebuild instead of
    /// refitting.
    pub sah_at_build: f32,
}

/// When a tree that follows deforming geometry is mended; for [`TriangleBvh::follow`](crate::TriangleBvh::follow).
///
/// | field | unit | default | meaning |
/// |---|---|---|---|
/// | `repair_above` | – | 1.15 | expected cost over that of the last build or repair |
/// | `rebuild_above` | – | 1.5 | expected cost over that of the last build |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefitPolicy {
    /// A refitted tree that costs more than this many times what it did after the last build or attempt at a repair is
    /// repaired.
    pub repair_above: f32,
    /// A tree that then still costs more than this many times what it did when it was built should be built anew.
    pub rebuild_above: f32,
}

impl Default for RefitPolicy {
    fn default() -> Self {
        Self { repair_above: 1.15, rebuild_above: 1.5 }
    }
}

/// What following deforming geometry took and what it led to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refit {
    /// Whether the tree over the blocks was made anew. It is not where that would have cost more.
    pub repaired: bool,
    /// Whether the caller should build a new tree, now or while this one goes on serving: the triangles that lie
    /// together no longer belong together. A shape that is larger or more tangled than it was costs more in any tree.
    pub rebuild: bool,
    /// Expected cost of a random ray after refitting alone, by the surface area heuristic.
    pub sah_refitted: f32,
    /// The same now.
    pub sah: f32,
    /// The same when the tree was built.
    pub sah_at_build: f32,
}

/// The instruction set that builders run on: the one that `HELIOSTAT_ISA` forces, otherwise the best. It makes no
/// difference to the result.
pub(crate) fn level() -> Level {
    let forced = Isa::from_env().ok().flatten();
    forced.unwrap_or_else(Isa::best).checked_level().unwrap_or_else(|_| Level::baseline())
}

/// A tree without its triangles' vertices.
pub(crate) struct Arranged {
    pub tree: WideTree,
    pub bounds: Aabb,
    /// The triangles of each block.
    pub numbers: Vec<[u32; WIDTH]>,
}

/// Arranges triangles, whose boxes are `prims` (not empty), in a tree.
///
/// # Errors
/// [`BuildError::Cancelled`].
pub(crate) fn arrange(
    level: Level,
    meshes: &[Mesh],
    mesh_starts: &[u32],
    mut prims: Vec<PackedBox>,
    options: &BuildOptions,
    watch: &Watch<'_>,
) -> Result<Arranged, BuildError> {
    if options.builder == Builder::Morton {
        let (binary, blocks) = treelets::build(level, &prims, options, watch);
        watch.check()?;
        drop(prims);
        watch.stage(850);
        let (tree, places) = wide::collapse(level, &binary, treelets::RULE, options.intersection_cost, watch);
        watch.check()?;
        let numbers = places.par_iter().with_min_len(256).map(|&(block, _)| blocks[block as usize]).collect();
        return Ok(Arranged { tree, bounds: binary.bounds(), numbers });
    }
    let rule = LeafRule { max: LEAF_TRIANGLES, block_shift: WIDTH.ilog2() };
    // A triangle that moves has no parts that stay on either side of a plane.
    let splits = options.builder == Builder::SpatialSah && meshes.iter().all(|mesh| mesh.motion.is_none());
    let binary = if splits {
        let budget = (prims.len() as f32 * options.spatial_budget.clamp(0.0, 4.0)) as usize;
        let corners = |id| triangles::corners(meshes, mesh_starts, id);
        spatial::build(level, &mut prims, budget, &corners, rule, options, watch)
    } else {
        binned::build(level, &mut prims, rule, options, watch)
    };
    watch.check()?;
    // From here on the order alone counts; the memory of the boxes will serve for nodes and blocks.
    let order = triangles::order(prims);
    watch.stage(850);
    let (tree, ranges) = wide::collapse(level, &binary, rule, options.intersection_cost, watch);
    watch.check()?;
    Ok(Arranged { tree, bounds: binary.bounds(), numbers: triangles::numbers(&order, &ranges) })
}
