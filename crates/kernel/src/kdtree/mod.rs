//! The kd-tree of the 2003 report: SAH with perfect splits, 8-byte nodes, packet and single-ray traversal.
mod build;
mod clip;
mod event;
mod node;
pub(crate) mod packet;
mod ray;
pub(crate) mod single;
mod stats;
mod sweep;

use std::fmt;

use glam::Vec3;
use rayon::prelude::*;

pub use self::{
    node::{KdNode, KdNodeKind},
    stats::KdStats,
};
use crate::{
    aabb::Aabb,
    build::{boxes::PackedBox, triangles, watch::Watch},
    error::BuildError,
    mesh::Mesh,
    through::Panes,
    triangle_bvh::TriangleBvh,
};

/// The corners of a triangle, object space, exactly as in the mesh: 36 B.
pub(crate) type Corners = [[f32; 3]; 3];

/// How the planes of a kd-tree are chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KdSplit {
    /// The cheapest plane by the surface area heuristic, until no plane pays.
    #[default]
    Sah,
    /// The middle of the longest edge, until few triangles are left: the baseline that the heuristic is compared with.
    Median,
}

/// How a kd-tree is built. The defaults suit nearly everything.
///
/// | field | unit | default | meaning |
/// |---|---|---|---|
/// | `split` | – | `Sah` | how planes are chosen |
/// | `traversal_cost` | – | 1.5 | cost of a node, relative to … |
/// | `intersection_cost` | – | 1.0 | … the cost of testing one triangle |
/// | `empty_bonus` | – | 0.2 | part of the cost taken off planes that cut off empty space |
/// | `max_depth` | levels | 8 + 1.3 log₂ N | deepest leaf |
/// | `median_leaf` | triangles | 3 | with `Median`: cells with no more are leaves |
/// | `max_references` | per triangle | 16 | leaf entries, empty leaves included, that the tree may make |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KdOptions {
    /// How planes are chosen.
    pub split: KdSplit,
    /// Cost of visiting an inner node.
    pub traversal_cost: f32,
    /// Cost of testing a ray against one triangle.
    pub intersection_cost: f32,
    /// Part of the cost taken off a plane with nothing on one side, 0..=1.
    pub empty_bonus: f32,
    /// Deepest leaf, at most [`KdTree::MAX_DEPTH`]; `None`: 8 + 1.3 log₂ of the number of triangles.
    pub max_depth: Option<u32>,
    /// Cells with no more triangles are leaves, with [`KdSplit::Median`].
    pub median_leaf: u32,
    /// A hard limit for memory, whatever the input: entries of leaves per triangle, an empty leaf counting as one.
    /// Cells that reach it stay whole.
    pub max_references: u32,
}

impl Default for KdOptions {
    fn default() -> Self {
        Self {
            split: KdSplit::Sah,
            traversal_cost: 1.5,
            intersection_cost: 1.0,
            empty_bonus: 0.2,
            max_depth: None,
            median_leaf: 3,
            max_references: 16,
        }
    }
}

impl KdOptions {
    fn depth_limit(&self, triangles: usize) -> u32 {
        let usual = 8.0 + 1.3 * (triangles.max(1) as f32).log2();
        self.max_depth.unwrap_or(usual as u32).min(KdTree::MAX_DEPTH)
    }

    /// Leaf entries that the tree may make: at least the triangles themselves in one leaf.
    fn budget(&self, triangles: usize) -> u64 {
        let count = triangles as u64;
        let most = u64::from(KdNode::MAX_PAYLOAD) / 2;
        (count * u64::from(self.max_references.max(1))).clamp(count, most)
    }
}

/// A kd-tree over the triangles of one or more meshes, in object space: the accelerator of the 2003 report.
///
/// The tree keeps its own copy of the triangles, 36 B each, so the meshes may be dropped. Nodes, reference lists and
/// triangles can be read (a simulated ray tracing chip walks them); a triangle's index in [`KdTree::corners`] is what
/// the leaves refer to. Building the same meshes gives the same bits for any number of threads. Hits are watertight,
/// as those of [`TriangleBvh`].
///
/// Memory: 8 B per node, 4 B per reference and 40 B per triangle; building takes about 150 B more per reference.
///
/// # References
/// Wald and Havran 2006, "On building fast kd-trees for ray tracing, and on doing that in O(N log N)"; Wald, Slusallek,
/// Benthin and Wagner 2001, "Interactive rendering with coherent ray tracing".
///
/// ```
/// use glam::Vec3;
/// use heliostat_kernel::{Hit, KdOptions, KdTree, Mesh, Object, Ray, RayQuery, World};
///
/// let mesh = Mesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]);
/// let tree = KdTree::build(&[mesh], &KdOptions::default())?;
/// let world = World::new(Object::new(Some(tree.into()), Vec::new())?.into());
/// let mut hits = [Hit::MISS];
/// world.intersect(&[Ray::new(Vec3::new(0.25, 0.25, 2.0), Vec3::NEG_Z)], &mut hits);
/// assert_eq!(hits[0].t, 2.0);
/// # Ok::<(), heliostat_kernel::BuildError>(())
/// ```
pub struct KdTree {
    nodes: Vec<KdNode>,
    references: Vec<u32>,
    corners: Vec<Corners>,
    /// Running number over all meshes of each triangle in `corners`.
    numbers: Vec<u32>,
    /// First running triangle number of each mesh, and the total at the end.
    mesh_starts: Vec<u32>,
    bounds: Aabb,
    stats: KdStats,
}

impl fmt::Debug for KdTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("KdTree")
            .field("bounds", &self.bounds)
            .field("stats", &self.stats)
            .finish_non_exhaustive()
    }
}

impl KdTree {
    /// The largest number of triangles in one tree.
    pub const MAX_TRIANGLES: u64 = TriangleBvh::MAX_TRIANGLES;
    /// The deepest that a leaf may lie, whatever the options say.
    pub const MAX_DEPTH: u32 = 60;

    /// Builds a tree over all triangles of `meshes`; hits name them as (`geometry`, `primitive`) = (mesh, triangle).
    /// No meshes, or none with triangles, make an empty tree.
    ///
    /// Skipped, so never hit: triangles with a coordinate that is NaN or larger than 1e10 in magnitude, and triangles
    /// of zero area. Runs on the current rayon pool.
    ///
    /// # Errors
    /// [`BuildError::IndexOutOfRange`] for the first bad vertex index, [`BuildError::TooManyTriangles`] past
    /// [`KdTree::MAX_TRIANGLES`], [`BuildError::MotionUnsupported`] if a mesh moves.
    pub fn build(meshes: &[Mesh], options: &KdOptions) -> Result<Self, BuildError> {
        let watch = Watch::new(&());
        let mesh_starts = triangles::number(meshes, &watch)?;
        if let Some(mesh) = meshes.iter().position(|mesh| mesh.motion.is_some()) {
            return Err(BuildError::MotionUnsupported { mesh, tree: "a kd-tree" });
        }
        let boxes = triangles::boxes(crate::build::level(), meshes, &mesh_starts, &watch);
        let numbers: Vec<u32> = boxes.iter().map(PackedBox::id).collect();
        drop(boxes);
        let corners_of =
            |&number: &u32| triangles::corners(meshes, &mesh_starts, number).map(|corner| corner.to_array());
        let corners: Vec<Corners> = numbers.par_iter().map(corners_of).collect();
        let bounds = Aabb::from_points(corners.iter().flatten().map(|&p| Vec3::from_array(p)));
        let mut tree = Self {
            nodes: Vec::new(),
            references: Vec::new(),
            corners,
            numbers,
            mesh_starts,
            bounds,
            stats: KdStats::default(),
        };
        if !tree.corners.is_empty() {
            let budget = options.budget(tree.corners.len());
            let arrays = build::build(&tree.corners, bounds, budget, options);
            (tree.nodes, tree.references) = (arrays.nodes, arrays.references);
            tree.sort_store();
            tree.stats = KdStats::of(&tree, options);
        }
        Ok(tree)
    }

    /// Brings the triangles into the order in which the leaves first list them, so that neighbours lie together.
    fn sort_store(&mut self) {
        const UNSEEN: u32 = u32::MAX;
        let mut moved_to = vec![UNSEEN; self.corners.len()];
        let mut order = Vec::with_capacity(self.corners.len());
        for reference in &mut self.references {
            let to = &mut moved_to[*reference as usize];
            if *to == UNSEEN {
                *to = order.len() as u32;
                order.push(*reference);
            }
            *reference = *to;
        }
        self.corners = order.par_iter().map(|&from| self.corners[from as usize]).collect();
        self.numbers = order.par_iter().map(|&from| self.numbers[from as usize]).collect();
    }

    /// The box around all triangles that can be hit, object space: the cell of node 0.
    #[must_use]
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Size and quality of the tree.
    #[must_use]
    pub fn stats(&self) -> KdStats {
        self.stats
    }

    /// The nodes; the root is node 0. None at all if there is nothing to hit.
    #[must_use]
    pub fn nodes(&self) -> &[KdNode] {
        &self.nodes
    }

    /// The lists of the leaves: indices into [`KdTree::corners`].
    #[must_use]
    pub fn references(&self) -> &[u32] {
        &self.references
    }

    /// The three corners of each triangle that can be hit, object space.
    #[must_use]
    pub fn corners(&self) -> &[[[f32; 3]; 3]] {
        &self.corners
    }

    /// Which triangle of the meshes an index into [`KdTree::corners`] stands for: (`geometry`, `primitive`), or `None`
    /// past the end.
    #[must_use]
    pub fn identify(&self, index: u32) -> Option<(u32, u32)> {
        self.numbers.get(index as usize).map(|&number| self.locate(number))
    }

    /// Splits a running triangle number into (mesh, triangle of that mesh).
    pub(crate) fn locate(&self, number: u32) -> (u32, u32) {
        let (mesh, triangle) = triangles::locate(&self.mesh_starts, number);
        (mesh as u32, triangle as u32)
    }

    /// Whether the triangle `index` of [`KdTree::corners`] is one of `panes`.
    #[inline(always)]
    fn lets_through(&self, index: u32, panes: Panes<'_>) -> bool {
        !panes.is_empty() && self.identify(index).is_some_and(|(geometry, _)| panes.has(geometry))
    }

    /// Every triangle that can be hit: corners and running number.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = (Corners, u32)> + '_ {
        self.corners.iter().copied().zip(self.numbers.iter().copied())
    }
}
