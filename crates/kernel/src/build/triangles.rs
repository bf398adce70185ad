//! From meshes to what builders work on, and from their result to packed triangles.
use std::sync::atomic::{AtomicBool, Ordering};

use glam::{DVec3, Vec3, Vec3Swizzles};
use rayon::prelude::*;

use super::{boxes::PackedBox, watch::Watch, wide::BlockRange};
use crate::{
    error::BuildError,
    layout::{Block, WIDTH},
    mesh::Mesh,
    triangle_bvh::{MAX_COORDINATE, TriangleBvh},
};

/// Triangles per task, and between two looks at the watch.
const CHUNK: usize = 1 << 13;
/// Blocks whose vertices are read together.
pub(super) const BATCH: usize = 16;
/// The number of a triangle that can never be hit.
const SKIPPED: u32 = u32::MAX;

/// The first running triangle number of each mesh and the total, after checking counts and vertex indices.
pub(crate) fn number(meshes: &[Mesh], watch: &Watch<'_>) -> Result<Vec<u32>, BuildError> {
    let count = meshes.iter().map(|mesh| mesh.indices.len() as u64).sum::<u64>();
    if count > TriangleBvh::MAX_TRIANGLES {
        return Err(BuildError::TooManyTriangles { count, limit: TriangleBvh::MAX_TRIANGLES });
    }
    let mut starts = Vec::with_capacity(meshes.len() + 1);
    let mut next = 0;
    for (mesh, Mesh { positions, indices, motion }) in meshes.iter().enumerate() {
        if let Some(motion) = motion.as_ref().filter(|motion| motion.len() != positions.len()) {
            let (positions, motion) = (positions.len(), motion.len());
            return Err(BuildError::MotionLength { mesh, positions, motion });
        }
        let vertices = positions.len();
        let bad = |index: &u32| *index as usize >= vertices;
        let good = |chunk: &[[u32; 3]]| !chunk.iter().flatten().any(bad);
        // Whole chunks first: no early exit inside them, so they are checked many at a time.
        if let Some(chunk) =
            indices.par_chunks(CHUNK).position_first(|chunk| !watch.stopped() && !good(chunk))
        {
            let in_chunk = indices[chunk * CHUNK..].iter().position(|t| t.iter().any(bad)).unwrap_or(0);
            let triangle = chunk * CHUNK + in_chunk;
            let index = indices[triangle].into_iter().find(bad).unwrap_or_default();
            return Err(BuildError::IndexOutOfRange { mesh, triangle, index, vertices });
        }
        starts.push(next);
        next += indices.len() as u32;
    }
    starts.push(next);
    Ok(starts)
}

/// The meshes when the shutter closes, if any of them moves.
pub(crate) fn closing(meshes: &[Mesh]) -> Option<Vec<Mesh>> {
    let moving = meshes.iter().any(|mesh| mesh.motion.is_some());
    moving.then(|| meshes.iter().map(Mesh::closing).collect())
}

/// The boxes of all triangles that can be hit, in order; of moving ones, around the whole way.
pub(crate) fn boxes(meshes: &[Mesh], starts: &[u32], watch: &Watch<'_>) -> Vec<PackedBox> {
    let count = starts.last().copied().unwrap_or(0) as usize;
    watch.expect(count as u64);
    let (mut prims, mut skipped) = all_boxes(meshes, starts, watch);
    if let Some(closing) = closing(meshes) {
        // Vertices move along lines: what lies between is in the box around both ends.
        let (ends, some) = all_boxes(&closing, starts, watch);
        skipped |= some;
        prims.par_iter_mut().zip(ends).with_min_len(CHUNK).for_each(|(prim, end)| {
            let id = if end.id() == SKIPPED { SKIPPED } else { prim.id() };
            *prim = prim.union(&end).with_tags([id; 2]);
        });
    }
    if skipped {
        prims.retain(|prim| prim.id() != SKIPPED);
    }
    prims
}

/// The boxes of all triangles where the shutter opens, and whether some cannot be hit; those are marked.
fn all_boxes(meshes: &[Mesh], starts: &[u32], watch: &Watch<'_>) -> (Vec<PackedBox>, bool) {
    let count = starts.last().copied().unwrap_or(0) as usize;
    let mut prims = Vec::with_capacity(count);
    let skipped = AtomicBool::new(false);
    for (Mesh { positions, indices, .. }, &start) in meshes.iter().zip(starts) {
        // Nearly always all vertices are good, and triangles need no test of their own.
        let good = positions.par_chunks(CHUNK).all(|chunk| watch.stopped() || chunk.iter().all(usable));
        let one = |(i, triangle): (usize, &[u32; 3])| {
            if i % CHUNK == CHUNK - 1 && !watch.stopped() {
                watch.advance(CHUNK as u64);
            }
            if watch.halted() {
                return PackedBox::EMPTY;
            }
            let corners = triangle.map(|i| positions[i as usize]);
            let hittable = (good || corners.iter().all(usable)) && has_area(corners);
            if !hittable {
                skipped.store(true, Ordering::Relaxed);
            }
            let [a, b, c] = corners;
            let id = if hittable { start + i as u32 } else { SKIPPED };
            PackedBox::primitive(a.min(b).min(c), a.max(b).max(c), id)
        };
        if watch.stopped() {
            break;
        }
        if indices.len() < CHUNK {
            prims.extend(indices.iter().enumerate().map(one));
        } else {
            prims.par_extend(indices.par_iter().enumerate().with_min_len(CHUNK / 4).map(one));
        }
    }
    (prims, skipped.into_inner())
}

/// Whether a vertex is finite and not too far away.
fn usable(vertex: &Vec3) -> bool {
    vertex.abs().cmple(Vec3::splat(MAX_COORDINATE)).all()
}

/// Whether a triangle of usable vertices has an area, however small.
fn has_area([a, b, c]: [Vec3; 3]) -> bool {
    let (e, f) = (b - a, c - a);
    let (plus, minus) = (e.zxy() * f, e * f.zxy());
    // Each difference and product rounds by 2^-24 relative to itself: beyond the sum of that, it is not zero.
    let doubt = (plus.abs() + minus.abs()) * 1.0e-6 + Vec3::splat(1.0e-36);
    (plus - minus).abs().cmpgt(doubt).any() || double_area_vector(a, b, c) != DVec3::ZERO
}

/// `(b−a) × (c−a)` in double precision, where it is zero only for triangles that have no area.
pub(crate) fn double_area_vector(a: Vec3, b: Vec3, c: Vec3) -> DVec3 {
    let a = a.as_dvec3();
    (b.as_dvec3() - a).cross(c.as_dvec3() - a)
}

/// The corners of a triangle by its running number.
pub(crate) fn corners(meshes: &[Mesh], starts: &[u32], id: u32) -> [Vec3; 3] {
    let (mesh, triangle) = locate(starts, id);
    let Mesh { positions, indices, .. } = &meshes[mesh];
    indices[triangle].map(|index| positions[index as usize])
}

/// Splits a running triangle number into (mesh, triangle of that mesh).
#[inline(always)]
pub(crate) fn locate(starts: &[u32], id: u32) -> (usize, usize) {
    // Mostly there is one mesh: its start and the total.
    let mesh = if starts.len() <= 2 { 0 } else { starts.partition_point(|&start| start <= id).max(1) - 1 };
    (mesh, (id - starts.get(mesh).copied().unwrap_or(0)) as usize)
}

/// The numbers of the triangles in the order of their boxes.
pub(crate) fn order(prims: Vec<PackedBox>) -> Vec<u32> {
    prims.par_iter().with_min_len(CHUNK).map(PackedBox::id).collect()
}

/// The numbers of the triangles of each block: ranges of `order`.
pub(crate) fn numbers(order: &[u32], ranges: &[BlockRange]) -> Vec<[u32; WIDTH]> {
    let of_block = |&(begin, count): &BlockRange| {
        let mut numbers = [Block::NO_TRIANGLE; WIDTH];
        numbers[..count as usize].copy_from_slice(&order[begin as usize..(begin + count) as usize]);
        numbers
    };
    ranges.par_iter().with_min_len(256).map(of_block).collect()
}

/// Blocks of the triangles given, 8 each.
pub(crate) fn blocks(
    meshes: &[Mesh],
    starts: &[u32],
    numbers: &[[u32; WIDTH]],
    watch: &Watch<'_>,
) -> Vec<Block> {
    watch.expect(numbers.len() as u64);
    // Memory is touched for the first time by all threads.
    let numbered = |&triangle: &[u32; WIDTH]| Block { triangle, ..Block::EMPTY };
    let mut blocks: Vec<Block> = numbers.par_iter().map(numbered).collect();
    blocks.par_chunks_mut(BATCH).with_min_len(16).enumerate().for_each(|(i, blocks)| {
        if i % 64 == 63 && !watch.stopped() {
            watch.advance(64 * BATCH as u64);
        }
        if !watch.halted() {
            gather(meshes, starts, blocks);
        }
    });
    blocks
}

/// Reads the vertices of a few blocks from the meshes. Vertex indices come first and then the positions: in each of the
/// loops, many loads wait for memory together.
pub(super) fn gather(meshes: &[Mesh], starts: &[u32], blocks: &mut [Block]) {
    let mut triangles = [[(0, [0; 3]); WIDTH]; BATCH];
    for (block, triangles) in blocks.iter().zip(&mut triangles) {
        let used = block.triangle.iter().take_while(|&&id| id != Block::NO_TRIANGLE);
        for (&id, into) in used.zip(triangles) {
            let (mesh, triangle) = locate(starts, id);
            *into = (mesh, meshes[mesh].indices[triangle]);
        }
    }
    for (block, triangles) in blocks.iter_mut().zip(&triangles) {
        let used = block.triangle.iter().take_while(|&&id| id != Block::NO_TRIANGLE);
        for (lane, (_, &(mesh, triangle))) in used.zip(triangles).enumerate() {
            let positions = &meshes[mesh].positions;
            for (vertex, index) in block.vertex.iter_mut().zip(triangle) {
                let p = positions[index as usize];
                [vertex[0][lane], vertex[1][lane], vertex[2][lane]] = p.to_array();
            }
        }
    }
}
