//! One tree over all triangles of an object.
use std::fmt;

use fearless_simd::{Fallback, Level};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::{
    aabb::Aabb,
    build::{
        self, Arranged, BuildOptions, Layout, Refit, RefitPolicy, TreeStats,
        boxes::PackedBox,
        refit::{self, BlockLeaves},
        repair, triangles,
        watch::{BuildProgress, Watch},
        wide::WideTree,
    },
    compact::{BlockSource, Blocks, CompactBlock, CompactBlocks, MovingBlocks},
    error::BuildError,
    layout::{Block, Node, WIDTH},
    mesh::Mesh,
};

/// Coordinates beyond this magnitude are treated like infinite ones: single-precision products would overflow.
pub(crate) const MAX_COORDINATE: f32 = 1.0e10;

/// An 8-wide bounding volume hierarchy over the triangles of one or more meshes, in object space.
///
/// In the full layout the tree keeps its own copy of the vertices (in blocks of 8 triangles), so the meshes may be
/// dropped; in the compact one it shares their arrays.
/// Building the same meshes gives the same bits for any number of threads.
#[derive(Clone, Default)]
pub struct TriangleBvh {
    pub(crate) tree: WideTree,
    /// All blocks in the full layout; none in the compact one.
    blocks: Vec<Block>,
    /// The same blocks when the shutter closes, if anything moves; none otherwise.
    closing: Vec<Block>,
    /// All blocks in the compact layout; none in the full one.
    compact: CompactBlocks,
    /// First running triangle number of each mesh, and the total at the end.
    mesh_starts: Vec<u32>,
    bounds: Aabb,
    triangles: usize,
    /// What a block test costs beside a node visit.
    block_cost: f32,
    sah_at_build: f32,
    /// Its cost when the nodes were last made, or were last found to be as good as new ones.
    sah_when_mended: f32,
}

impl fmt::Debug for TriangleBvh {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TriangleBvh").field("bounds", &self.bounds).field("stats", &self.stats()).finish()
    }
}

impl TriangleBvh {
    /// The largest number of triangles in one tree.
    pub const MAX_TRIANGLES: u64 = 1 << 28;

    /// Builds a tree over all triangles of `meshes`; hits name them as (`geometry`, `primitive`) = (mesh,
    /// triangle). No meshes, or none with triangles, make an empty tree.
    ///
    /// Skipped, so never hit: triangles with a coordinate that is NaN or larger than 1e10 in magnitude, and
    /// triangles of zero area. Runs on the current rayon pool.
    ///
    /// # Errors
    /// [`BuildError::IndexOutOfRange`] for the first bad vertex index, [`BuildError::TooManyTriangles`] past
    /// [`TriangleBvh::MAX_TRIANGLES`], [`BuildError::MotionLength`] for a mesh with too few or too many positions for
    /// its end, [`BuildError::MotionUnsupported`] for a mesh that moves and [`Layout::Compact`].
    pub fn build(meshes: &[Mesh], options: &BuildOptions) -> Result<Self, BuildError> {
        Self::build_with(meshes, options, &())
    }

    /// As [`TriangleBvh::build`], with somebody who follows the work and may stop it.
    ///
    /// # Errors
    /// As there, and [`BuildError::Cancelled`].
    pub fn build_with(
        meshes: &[Mesh],
        options: &BuildOptions,
        progress: &dyn BuildProgress,
    ) -> Result<Self, BuildError> {
        let (level, watch) = (build::level(), Watch::new(progress));
        let mesh_starts = triangles::number(meshes, &watch)?;
        let closing = triangles::closing(meshes);
        if options.layout == Layout::Compact {
            still(meshes)?;
        }
        watch.stage(60);
        let prims = triangles::boxes(level, meshes, &mesh_starts, &watch);
        watch.check()?;
        if prims.is_empty() {
            return Ok(Self { mesh_starts, ..Self::default() });
        }
        watch.stage(800);
        let triangles = prims.len();
        let Arranged { tree, bounds, numbers } =
            build::arrange(level, meshes, &mesh_starts, prims, options, &watch)?;
        watch.stage(1000);
        let mut bvh = Self {
            block_cost: options.intersection_cost,
            sah_at_build: tree.sah,
            sah_when_mended: tree.sah,
            tree,
            mesh_starts,
            bounds,
            triangles,
            ..Self::default()
        };
        match options.layout {
            Layout::Full => {
                bvh.blocks = triangles::blocks(level, meshes, &bvh.mesh_starts, &numbers, &watch);
                if let Some(closing) = closing {
                    bvh.closing = triangles::blocks(level, &closing, &bvh.mesh_starts, &numbers, &watch);
                }
            }
            Layout::Compact => {
                bvh.tree.compress();
                let blocks = numbers.par_iter().map(CompactBlock::new).collect();
                bvh.compact = CompactBlocks { blocks, meshes: meshes.to_vec() };
            }
        }
        watch.check()?;
        watch.finish();
        Ok(bvh)
    }

    /// Takes over new vertex positions: the same tree with new boxes, at a fraction of the time of a build. `meshes` are
    /// those that the tree was built over with the same numbers of triangles; vertex indices may have changed too.
    ///
    /// Triangles that are now degenerate or not finite are not hit, and come back when they are whole again; those that
    /// were skipped when the tree was built stay skipped. The tree fits worse the more the shape changes:
    /// [`TreeStats::sah`] tells, and after spatial splits it starts out worse, as the parts' boxes are whole again. Gives
    /// the same bits for any number of threads. Runs on the current rayon pool.
    ///
    /// # Errors
    /// [`BuildError::MeshCountChanged`], [`BuildError::TriangleCountChanged`], and as in [`TriangleBvh::build`]; the tree
    /// is then as it was.
    pub fn refit(&mut self, meshes: &[Mesh]) -> Result<(), BuildError> {
        self.refit_blocks(meshes).map(|_| ())
    }

    /// As [`TriangleBvh::refit`], with an eye on the cost: where it has risen too far by `policy`, the tree over the
    /// blocks of triangles is made anew, which takes a fraction of a build.
    ///
    /// # Errors
    /// As there.
    pub fn follow(&mut self, meshes: &[Mesh], policy: &RefitPolicy) -> Result<Refit, BuildError> {
        let blocks = self.refit_blocks(meshes)?;
        let sah_refitted = self.tree.sah;
        let mut repaired = false;
        if sah_refitted > policy.repair_above * self.sah_when_mended {
            let mended = repair::over_blocks(build::level(), &blocks, self.block_cost);
            if let Some(tree) = mended.filter(|tree| tree.sah < sah_refitted) {
                let compact = !self.tree.compact.is_empty();
                self.tree = tree;
                if compact {
                    self.tree.compress();
                }
                repaired = true;
            }
            // Where it did not help it is not tried again at once.
            self.sah_when_mended = self.tree.sah;
        }
        let (sah, sah_at_build) = (self.tree.sah, self.sah_at_build);
        Ok(Refit {
            repaired,
            rebuild: sah > policy.rebuild_above * sah_at_build,
            sah_refitted,
            sah,
            sah_at_build,
        })
    }

    /// Refits, and returns the boxes of all blocks.
    fn refit_blocks(&mut self, meshes: &[Mesh]) -> Result<Vec<PackedBox>, BuildError> {
        let (built, given) = (self.mesh_starts.len().saturating_sub(1), meshes.len());
        if built != given {
            return Err(BuildError::MeshCountChanged { built, given });
        }
        for (mesh, (starts, now)) in self.mesh_starts.windows(2).zip(meshes).enumerate() {
            let (built, given) = ((starts[1] - starts[0]) as usize, now.indices.len());
            if built != given {
                return Err(BuildError::TriangleCountChanged { mesh, built, given });
            }
        }
        triangles::number(meshes, &Watch::new(&()))?;
        let (level, block_cost) = (build::level(), self.block_cost);
        let (blocks, bounds);
        if self.tree.compact.is_empty() {
            blocks = self.refit_full(level, meshes);
            bounds = refit::nodes(level, &mut self.tree, &BlockLeaves { blocks: &blocks, block_cost });
        } else {
            still(meshes)?;
            blocks = refit::compact_blocks(level, meshes, &self.mesh_starts, &mut self.compact.blocks);
            self.compact.meshes = meshes.to_vec();
            self.tree.expand();
            bounds = refit::nodes(level, &mut self.tree, &BlockLeaves { blocks: &blocks, block_cost });
            self.tree.compress();
        }
        self.bounds = if bounds.is_empty() { Aabb::EMPTY } else { Aabb::new(bounds.lo(), bounds.hi()) };
        Ok(blocks)
    }

    /// New vertices for blocks in full; the box of each.
    fn refit_full(&mut self, level: Level, meshes: &[Mesh]) -> Vec<PackedBox> {
        let mut boxes = refit::blocks(level, meshes, &self.mesh_starts, &mut self.blocks);
        match triangles::closing(meshes) {
            None => self.closing = Vec::new(),
            Some(meshes) => {
                self.closing.clone_from(&self.blocks);
                let ends = refit::blocks(level, &meshes, &self.mesh_starts, &mut self.closing);
                refit::unite(&mut self.blocks, &mut self.closing, &mut boxes, &ends);
            }
        }
        boxes
    }

    /// The box around all triangles that can be hit, object space.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Size and quality of the tree.
    #[must_use]
    pub fn stats(&self) -> TreeStats {
        TreeStats {
            triangles: self.triangles,
            nodes: self.tree.len(),
            leaves: self.tree.leaves,
            bytes: size_of_val(&self.tree.nodes[..])
                + size_of_val(&self.tree.compact[..])
                + size_of_val(&self.blocks[..])
                + size_of_val(&self.closing[..])
                + size_of_val(&self.compact.blocks[..]),
            sah: self.tree.sah,
            sah_at_build: self.sah_at_build,
        }
    }

    /// A number that two trees share if their nodes and blocks are equal bit for bit (FNV-1a, 64 bits); for
    /// tests of determinism.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut eat = |word: u32| hash = (hash ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01b3);
        for index in 0..self.tree.len() {
            let mut place = None;
            let Node { bounds, child, order } = self.tree.view().get(Fallback::new(), index, &mut place);
            bounds.iter().flatten().for_each(|x| eat(x.to_bits()));
            child.iter().for_each(|c| eat(c.0));
            order.iter().for_each(|&o| eat(o));
        }
        for index in 0..self.block_count() {
            let mut place = None;
            let block = self.blocks().get(index, &mut place);
            block.vertex.iter().flatten().flatten().for_each(|x| eat(x.to_bits()));
            block.triangle.iter().for_each(|&t| eat(t));
        }
        for block in &self.closing {
            block.vertex.iter().flatten().flatten().for_each(|x| eat(x.to_bits()));
        }
        hash
    }

    /// The blocks of either layout, for a traversal to hold on to.
    #[inline(always)]
    pub(crate) fn blocks(&self) -> Blocks<'_> {
        Blocks { full: &self.blocks, compact: &self.compact, mesh_starts: &self.mesh_starts }
    }

    /// Whether any of the meshes moves while the shutter is open.
    #[must_use]
    pub fn has_motion(&self) -> bool {
        !self.closing.is_empty()
    }

    /// The blocks at a moment in the shutter interval, if anything moves.
    #[inline(always)]
    pub(crate) fn moving_blocks(&self, time: f32) -> Option<MovingBlocks<'_>> {
        self.has_motion().then(|| MovingBlocks { ends: [&self.blocks, &self.closing], time })
    }

    fn block_count(&self) -> usize {
        self.blocks.len() + self.compact.blocks.len()
    }

    /// Splits a running triangle number into (mesh, triangle of that mesh).
    pub(crate) fn locate(&self, triangle: u32) -> (u32, u32) {
        let (mesh, triangle) = triangles::locate(&self.mesh_starts, triangle);
        (mesh as u32, triangle as u32)
    }

    /// Triangles of mesh `geometry`.
    pub(crate) fn mesh_len(&self, geometry: u32) -> u32 {
        let at = |i: usize| self.mesh_starts.get(i).copied().unwrap_or(0);
        at(geometry as usize + 1) - at(geometry as usize)
    }

    /// Every triangle that can be hit, once: corners at a moment in the shutter interval and running number.
    pub(crate) fn triangles(&self, time: f32) -> Vec<([[f32; 3]; 3], u32)> {
        let of_block = |index: usize| {
            let mut place = None;
            let block = match self.moving_blocks(time) {
                None => self.blocks().get(index, &mut place),
                Some(blocks) => blocks.block(index, &mut place),
            };
            let lanes = (0..WIDTH).filter(|&lane| block.triangle[lane] != Block::NO_TRIANGLE);
            lanes.map(|lane| (block.corners(lane), block.triangle[lane])).collect::<Vec<_>>()
        };
        let mut found: Vec<_> = (0..self.block_count()).flat_map(of_block).collect();
        // Those that a refit found degenerate are points.
        found.retain(|(corners, _)| {
            let [a, b, c] = corners.map(Vec3::from_array);
            triangles::double_area_vector(a, b, c) != DVec3::ZERO
        });
        // Spatial splits put a triangle into several blocks.
        found.sort_unstable_by_key(|&(_, triangle)| triangle);
        found.dedup_by_key(|&mut (_, triangle)| triangle);
        found
    }
}

/// # Errors
/// [`BuildError::MotionUnsupported`] for the first mesh that moves.
fn still(meshes: &[Mesh]) -> Result<(), BuildError> {
    match meshes.iter().position(|mesh| mesh.motion.is_some()) {
        Some(mesh) => Err(BuildError::MotionUnsupported { mesh, tree: "the compact layout" }),
        None => Ok(()),
    }
}
