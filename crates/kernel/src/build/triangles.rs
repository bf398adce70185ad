//! From meshes to what builders work on, and from their result to packed triangles.
use std::sync::atomic::{AtomicBool, Ordering};

use fearless_simd::{Level, Simd, dispatch, f32x4, prelude::*};
use glam::{DVec3, Vec3, Vec3A, Vec3Swizzles};
use rayon::prelude::*;

use super::{
    boxes::PackedBox,
    parts::{self, Slots},
    watch::Watch,
    wide::BlockRange,
};
use crate::{
    error::BuildError,
    layout::{Block, WIDTH},
    mesh::Mesh,
    prefetch::prefetch,
    triangle_bvh::{MAX_COORDINATE, TriangleBvh},
};

/// Triangles per task where they are merely looked at …
const CHUNK: usize = 1 << 13;
/// … and where boxes are made.
const PART: usize = 1 << 11;
/// Blocks per task.
pub(super) const BATCH: usize = 1 << 8;
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
        // Whole chunks first: no early exit inside them, so they are checked many at a time.
        let largest = |chunk: &[[u32; 3]]| chunk.as_flattened().iter().fold(0, |max, &index| index.max(max));
        let good = |chunk: &[[u32; 3]]| chunk.is_empty() || (largest(chunk) as usize) < vertices;
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
pub(crate) fn boxes(level: Level, meshes: &[Mesh], starts: &[u32], watch: &Watch<'_>) -> Vec<PackedBox> {
    let count = starts.last().copied().unwrap_or(0) as usize;
    watch.expect(count as u64);
    let (mut prims, mut skipped) = all_boxes(level, meshes, starts, watch);
    if let Some(closing) = closing(meshes) {
        // Vertices move along lines: what lies between is in the box around both ends.
        let (ends, some) = all_boxes(level, &closing, starts, watch);
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
fn all_boxes(level: Level, meshes: &[Mesh], starts: &[u32], watch: &Watch<'_>) -> (Vec<PackedBox>, bool) {
    let usable: Vec<bool> = meshes
        .iter()
        .map(|mesh| mesh.positions.par_chunks(CHUNK).all(|chunk| watch.stopped() || all_usable(chunk)))
        .collect();
    let skipped = AtomicBool::new(false);
    let count = starts.last().copied().unwrap_or(0) as usize;
    let prims = parts::collect(count, PART, |first, part| {
        let end = first + part.len();
        let mut next = first;
        while next < end && !watch.stopped() {
            let (mesh, triangle) = locate(starts, next as u32);
            let Mesh { positions, indices, .. } = &meshes[mesh];
            let indices = &indices[triangle..indices.len().min(triangle + end - next)];
            let boxes = Boxes { positions, usable: usable[mesh], first: next as u32 };
            if dispatch!(level, simd => boxes.push(simd, indices, part)) {
                skipped.store(true, Ordering::Relaxed);
            }
            next += indices.len();
            watch.advance(indices.len() as u64);
        }
        for _ in next..end {
            part.push(PackedBox::EMPTY);
        }
    });
    (prims, skipped.into_inner())
}

/// Makes boxes of the triangles of a mesh.
struct Boxes<'a> {
    positions: &'a [Vec3],
    /// Nearly always all vertices are good, and triangles need no test of their own.
    usable: bool,
    /// The running number of the first triangle.
    first: u32,
}

impl Boxes<'_> {
    #[inline(always)]
    fn corner(&self, index: u32) -> Vec3A {
        let Vec3 { x, y, z } = self.positions[index as usize];
        Vec3A::new(x, y, z)
    }

    /// Returns whether some triangles cannot be hit.
    #[inline(always)]
    fn push<S: Simd>(&self, _: S, indices: &[[u32; 3]], part: &mut Slots<'_, PackedBox>) -> bool {
        let mut skipped = false;
        for (id, triangle) in (self.first..).zip(indices) {
            let [a, b, c] = [self.corner(triangle[0]), self.corner(triangle[1]), self.corner(triangle[2])];
            let good = (self.usable || all_usable(&[a.into(), b.into(), c.into()])) && has_area([a, b, c]);
            skipped |= !good;
            let id = if good { id } else { SKIPPED };
            part.push(PackedBox::primitive(a.min(b).min(c), a.max(b).max(c), id));
        }
        skipped
    }
}

/// Whether vertices are finite and not too far away.
fn all_usable(vertices: &[Vec3]) -> bool {
    // As integers, which NaN and infinity are the largest of, many at a time.
    let bits = |x: f32| x.to_bits() & !(1 << 31);
    let largest = vertices.iter().fold(0, |max, v| bits(v.x).max(bits(v.y)).max(bits(v.z)).max(max));
    largest <= MAX_COORDINATE.to_bits()
}

/// Whether a triangle of usable vertices has an area, however small.
#[inline(always)]
fn has_area([a, b, c]: [Vec3A; 3]) -> bool {
    let (e, f) = (b - a, c - a);
    let (plus, minus) = (e.zxy() * f, e * f.zxy());
    // Each difference and product rounds by 2^-24 relative to itself: beyond the sum of that, it is not zero.
    let doubt = (plus.abs() + minus.abs()) * 1.0e-6 + Vec3A::splat(1.0e-36);
    (plus - minus).abs().cmpgt(doubt).any() || has_tiny_area([a, b, c])
}

#[cold]
fn has_tiny_area([a, b, c]: [Vec3A; 3]) -> bool {
    double_area_vector(a.into(), b.into(), c.into()) != DVec3::ZERO
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
    level: Level,
    meshes: &[Mesh],
    starts: &[u32],
    numbers: &[[u32; WIDTH]],
    watch: &Watch<'_>,
) -> Vec<Block> {
    watch.expect(numbers.len() as u64);
    parts::collect(numbers.len(), BATCH, |first, part| {
        let numbers = &numbers[first..first + part.len()];
        if watch.stopped() {
            for _ in numbers {
                part.push(Block::EMPTY);
            }
        } else {
            dispatch!(level, simd => push_blocks(simd, meshes, starts, numbers, part));
            watch.advance(numbers.len() as u64);
        }
    })
}

#[inline(always)]
fn push_blocks<S: Simd>(
    simd: S,
    meshes: &[Mesh],
    starts: &[u32],
    numbers: &[[u32; WIDTH]],
    part: &mut Slots<'_, Block>,
) {
    for (place, &triangle) in numbers.iter().enumerate() {
        prefetch_vertices(meshes, starts, &numbers[place..]);
        read_vertices(simd, meshes, starts, part.push(Block { triangle, ..Block::EMPTY }));
    }
}

/// Asks for what blocks further on will need: along a curve through space, triangles lie anywhere in a mesh.
#[inline(always)]
fn prefetch_vertices(meshes: &[Mesh], starts: &[u32], numbers: &[[u32; WIDTH]]) {
    let located = |place: usize| {
        let block = numbers.get(place).into_iter().flatten();
        block.filter(|&&id| id != Block::NO_TRIANGLE).map(|&id| locate(starts, id))
    };
    for (mesh, triangle) in located(4) {
        prefetch(&meshes[mesh].indices, triangle);
    }
    // Their indices were asked for two blocks ago.
    for (mesh, triangle) in located(2) {
        for index in meshes[mesh].indices[triangle] {
            prefetch(&meshes[mesh].positions, index as usize);
        }
    }
}

/// Reads the vertices of a block's triangles from the meshes.
#[inline(always)]
pub(super) fn read_vertices<S: Simd>(simd: S, meshes: &[Mesh], starts: &[u32], block: &mut Block) {
    let mut corners = [[f32x4::splat(simd, 0.0); WIDTH]; 3];
    for (lane, &id) in block.triangle.iter().enumerate() {
        if id == Block::NO_TRIANGLE {
            break;
        }
        let (mesh, triangle) = locate(starts, id);
        let Mesh { positions, indices, .. } = &meshes[mesh];
        for (corner, index) in corners.iter_mut().zip(indices[triangle]) {
            let [x, y, z] = positions[index as usize].to_array();
            corner[lane] = f32x4::load_array(simd, [x, y, z, 0.0]);
        }
    }
    for (rows, corner) in block.vertex.iter_mut().zip(&corners) {
        let [a, b] = [columns(&corner[..4]), columns(&corner[4..])];
        for (row, (a, b)) in rows.iter_mut().zip(a.into_iter().zip(b)) {
            a.combine(b).store_array(row);
        }
    }
}

/// The first three components of four vectors.
#[inline(always)]
fn columns<S: Simd>(of: &[f32x4<S>]) -> [f32x4<S>; 3] {
    let (ac, bd) = (of[0].zip_low(of[2]), of[1].zip_low(of[3]));
    let z = of[0].zip_high(of[2]).zip_low(of[1].zip_high(of[3]));
    [ac.zip_low(bd), ac.zip_high(bd), z]
}
