//! One tree over all triangles of an object.
use std::fmt;

use glam::{DVec3, Vec3, Vec4};
use rayon::prelude::*;

use crate::{
    aabb::Aabb,
    build::{
        BuildOptions, TreeStats,
        binary::{self, LeafRule, PrimRef},
        wide::{self, WideTree},
    },
    error::BuildError,
    layout::{Block, Child, LEAF_TRIANGLES, Node, WIDTH},
    mesh::Mesh,
};

/// Coordinates beyond this magnitude are treated like infinite ones: single-precision products would overflow.
pub(crate) const MAX_COORDINATE: f32 = 1.0e10;

/// An 8-wide bounding volume hierarchy over the triangles of one or more meshes, in object space.
///
/// The tree keeps its own copy of the vertices (in blocks of 8 triangles), so the meshes may be dropped.
/// Building the same meshes gives the same bits for any number of threads.
pub struct TriangleBvh {
    pub(crate) tree: WideTree,
    pub(crate) blocks: Vec<Block>,
    /// First running triangle number of each mesh, and the total at the end.
    mesh_starts: Vec<u32>,
    bounds: Aabb,
    triangles: usize,
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
    /// [`TriangleBvh::MAX_TRIANGLES`].
    pub fn build(meshes: &[Mesh], options: &BuildOptions) -> Result<Self, BuildError> {
        let mesh_starts = number_triangles(meshes)?;
        let mut prims = Vec::with_capacity(mesh_starts.last().copied().unwrap_or(0) as usize);
        for (mesh, &start) in meshes.iter().zip(&mesh_starts) {
            let refs = mesh.indices.par_iter().enumerate();
            prims.par_extend(refs.filter_map(|(i, triangle)| prim_ref(mesh, triangle, start + i as u32)));
        }
        if prims.is_empty() {
            return Ok(Self {
                tree: WideTree::default(),
                blocks: Vec::new(),
                mesh_starts,
                bounds: Aabb::EMPTY,
                triangles: 0,
            });
        }

        let rule = LeafRule { max: LEAF_TRIANGLES, block: WIDTH };
        let nodes = binary::build(&mut prims, rule, options);
        let bounds = Aabb::new(nodes[0].lo.truncate(), nodes[0].hi.truncate());
        // Leaves take consecutive blocks: (first primitive, count) of each block.
        let mut ranges: Vec<(u32, u32)> = Vec::with_capacity(prims.len() / 4 + 1);
        let tree = wide::collapse(&nodes, |begin, count| {
            let first = ranges.len() as u32;
            let block_count = count.div_ceil(WIDTH as u32);
            for i in 0..block_count {
                let offset = i * WIDTH as u32;
                ranges.push((begin + offset, (count - offset).min(WIDTH as u32)));
            }
            (Child::blocks(first, block_count), block_count as f32 * options.intersection_cost)
        });
        let triangles = prims.len();
        let pack = |&(begin, count): &(u32, u32)| {
            pack_block(meshes, &mesh_starts, &prims[begin as usize..(begin + count) as usize])
        };
        let blocks = ranges.par_iter().with_min_len(256).map(pack).collect();
        Ok(Self { tree, blocks, mesh_starts, bounds, triangles })
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
            nodes: self.tree.nodes.len(),
            leaves: self.tree.leaves,
            bytes: size_of_val(&self.tree.nodes[..]) + size_of_val(&self.blocks[..]),
            sah: self.tree.sah,
        }
    }

    /// A number that two trees share if their nodes and blocks are equal bit for bit (FNV-1a, 64 bits); for
    /// tests of determinism.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut eat = |word: u32| hash = (hash ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01b3);
        for Node { bounds, child, order } in &self.tree.nodes {
            bounds.iter().flatten().for_each(|x| eat(x.to_bits()));
            child.iter().for_each(|c| eat(c.0));
            order.iter().for_each(|&o| eat(o));
        }
        for block in &self.blocks {
            block.vertex.iter().flatten().flatten().for_each(|x| eat(x.to_bits()));
            block.triangle.iter().for_each(|&t| eat(t));
        }
        hash
    }

    /// Splits a running triangle number into (mesh, triangle of that mesh).
    pub(crate) fn locate(&self, triangle: u32) -> (u32, u32) {
        // Mostly one mesh: the search is then one comparison.
        let mesh = self.mesh_starts.partition_point(|&start| start <= triangle).saturating_sub(1);
        (mesh as u32, triangle - self.mesh_starts.get(mesh).copied().unwrap_or(0))
    }

    /// Triangles of mesh `geometry`.
    pub(crate) fn mesh_len(&self, geometry: u32) -> u32 {
        let at = |i: usize| self.mesh_starts.get(i).copied().unwrap_or(0);
        at(geometry as usize + 1) - at(geometry as usize)
    }

    /// Every triangle that can be hit: corners and running number.
    pub(crate) fn triangles(&self) -> impl Iterator<Item = ([[f32; 3]; 3], u32)> + '_ {
        self.blocks.iter().flat_map(|block| {
            let lanes = (0..WIDTH).filter(|&lane| block.triangle[lane] != Block::NO_TRIANGLE);
            lanes.map(|lane| (block.corners(lane), block.triangle[lane]))
        })
    }
}

/// The first running triangle number of each mesh and the total, after checking counts and vertex indices.
pub(crate) fn number_triangles(meshes: &[Mesh]) -> Result<Vec<u32>, BuildError> {
    let count = meshes.iter().map(|mesh| mesh.indices.len() as u64).sum::<u64>();
    if count > TriangleBvh::MAX_TRIANGLES {
        return Err(BuildError::TooManyTriangles { count, limit: TriangleBvh::MAX_TRIANGLES });
    }
    let mut starts = Vec::with_capacity(meshes.len() + 1);
    let mut next = 0;
    for (mesh, Mesh { positions, indices }) in meshes.iter().enumerate() {
        let vertices = positions.len();
        let bad = |index: &u32| *index as usize >= vertices;
        if let Some(triangle) = indices.par_iter().position_first(|t| t.iter().any(bad)) {
            let index = indices[triangle].into_iter().find(bad).unwrap_or_default();
            return Err(BuildError::IndexOutOfRange { mesh, triangle, index, vertices });
        }
        starts.push(next);
        next += indices.len() as u32;
    }
    starts.push(next);
    Ok(starts)
}

/// The bounds of a triangle, or `None` if it can never be hit.
pub(crate) fn prim_ref(mesh: &Mesh, triangle: &[u32; 3], id: u32) -> Option<PrimRef> {
    let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
    let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
    // Minima may drop a NaN, so ask each vertex.
    let usable = |v: Vec3| v.abs().cmple(Vec3::splat(MAX_COORDINATE)).all();
    if !(usable(a) && usable(b) && usable(c)) || double_area_vector(a, b, c) == DVec3::ZERO {
        return None;
    }
    Some(PrimRef::new(Vec4::from((lo, 0.0)), Vec4::from((hi, 0.0)), id))
}

/// `(b−a) × (c−a)` in double precision, where it is zero only for triangles that have no area.
pub(crate) fn double_area_vector(a: Vec3, b: Vec3, c: Vec3) -> DVec3 {
    let a = a.as_dvec3();
    (b.as_dvec3() - a).cross(c.as_dvec3() - a)
}

fn pack_block(meshes: &[Mesh], starts: &[u32], prims: &[PrimRef]) -> Block {
    let mut block = Block::EMPTY;
    for (lane, prim) in prims.iter().enumerate() {
        let id = prim.id();
        let mesh = starts.partition_point(|&start| start <= id) - 1;
        let Mesh { positions, indices } = &meshes[mesh];
        let triangle = indices[(id - starts[mesh]) as usize];
        for (corner, index) in triangle.into_iter().enumerate() {
            let p = positions[index as usize];
            for (axis, value) in p.to_array().into_iter().enumerate() {
                block.vertex[corner][axis][lane] = value;
            }
        }
        block.triangle[lane] = id;
    }
    block
}
