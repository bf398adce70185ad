//! Batches of unrelated rays.
use fearless_simd::Simd;

use super::{
    Within,
    descent::{self, Answers, Scratch},
    instances,
    local::LocalRay,
    packet::Packet,
    settle::{LANES, MeshOf},
    stack::Stack,
};
use crate::{
    layout::Child,
    object::Object,
    ray::{Hit, PathId, Ray},
    through::{Panes, Screen, Shadows, Sight},
    triangle_bvh::TriangleBvh,
    triangles::Triangles,
};

/// Rays taken up together, to be sorted into packets.
const BATCH: usize = 256;
/// Fewer rays than this are not worth a packet.
const FEW_RAYS: usize = 4;

/// One ray after the other.
#[inline(always)]
pub(super) fn intersect_singly<S: Simd>(simd: S, root: &Object, rays: &[Ray], hits: &mut [Hit]) {
    let mut stack = Stack::new();
    for (ray, hit) in rays.iter().zip(hits) {
        *hit = closest(simd, root, ray, &mut stack);
    }
}

/// As [`intersect_singly`], for any hit.
#[inline(always)]
pub(super) fn occluded_singly<S: Simd>(simd: S, root: &Object, rays: &[Ray], mut shadows: Shadows<'_>) {
    let mut stack = Stack::new();
    for (index, ray) in rays.iter().take(shadows.occluded.len()).enumerate() {
        let mut sight = Sight { through: shadows.through, met: false };
        let found = any(simd, root, ray, &mut sight, &mut stack);
        shadows.set(index, found, sight.met);
    }
}

/// In packets of 16.
#[inline(always)]
pub(super) fn intersect<S: Simd>(simd: S, root: &Object, rays: &[Ray], hits: &mut [Hit]) {
    let (mut scratch, mut packet) = (Scratch::new(), Packet::EMPTY);
    let mut mesh = MeshOf::default();
    for (rays, hits) in rays.chunks(BATCH).zip(hits.chunks_mut(BATCH)) {
        hits.fill(Hit::MISS);
        let sorted = Octants::sort(rays, hits.len());
        if let Some(bvh) = flat(root) {
            let screen = Screen { bvh, start: Child::ROOT, panes: Panes::NONE };
            for indices in sorted.packets() {
                let lanes = packet.load(simd, rays, indices);
                let found =
                    packet.trace::<S, false>(simd, screen, lanes, &mut scratch.visits, &mut scratch.stack);
                let words = packet.hits(simd, bvh, found, &mut mesh);
                for (lane, &index) in indices.iter().enumerate() {
                    if packet.id[lane] != Packet::NONE {
                        hits[usize::from(index)] = words.hit(lane, PathId::ROOT);
                    }
                }
            }
            continue;
        }
        for indices in sorted.packets() {
            let mut answers = Answers { hits, index: [0; LANES], through: None };
            answers.index[..indices.len()].copy_from_slice(indices);
            let lanes = packet.load(simd, rays, indices);
            descent::through::<S, false>(
                simd,
                (root, Child::ROOT),
                PathId::ROOT,
                &mut packet,
                lanes,
                &mut answers,
                &mut scratch,
            );
        }
    }
}

/// As [`intersect`], for any hit.
#[inline(always)]
pub(super) fn occluded<S: Simd>(simd: S, root: &Object, rays: &[Ray], mut shadows: Shadows<'_>) {
    let rays = &rays[..rays.len().min(shadows.occluded.len())];
    let (mut scratch, mut packet) = (Scratch::new(), Packet::EMPTY);
    let mut answers = Answers { hits: &mut [], index: [0; LANES], through: shadows.through };
    for (chunk, rays) in rays.chunks(BATCH).enumerate() {
        let first = chunk * BATCH;
        shadows.clear(first, rays.len());
        let sorted = Octants::sort(rays, rays.len());
        if let Some(bvh) = flat(root) {
            let screen = Screen { bvh, start: Child::ROOT, panes: Panes::of(shadows.through, PathId::ROOT) };
            for indices in sorted.packets() {
                let lanes = packet.load(simd, rays, indices);
                packet.trace::<S, true>(simd, screen, lanes, &mut scratch.visits, &mut scratch.stack);
                for (lane, &index) in indices.iter().enumerate() {
                    let found = packet.id[lane] != Packet::NONE;
                    shadows.set(first + usize::from(index), found, packet.met >> lane & 1 != 0);
                }
            }
            continue;
        }
        for indices in sorted.packets() {
            let lanes = packet.load(simd, rays, indices);
            let found = descent::through::<S, true>(
                simd,
                (root, Child::ROOT),
                PathId::ROOT,
                &mut packet,
                lanes,
                &mut answers,
                &mut scratch,
            );
            for (lane, &index) in indices.iter().enumerate() {
                let (found, met) = (found >> lane & 1 != 0, packet.met >> lane & 1 != 0);
                shadows.set(first + usize::from(index), found, met);
            }
        }
    }
}

/// Whether packets can pay where there are vectors: several rays, and nothing that moves.
pub(super) fn in_packets(root: &Object, rays: usize) -> bool {
    rays >= FEW_RAYS && !root.has_motion() && descent::takes_packets(root)
}

/// The tree of a root without instances: its packets need no way down and up again.
#[inline(always)]
fn flat(root: &Object) -> Option<&TriangleBvh> {
    match &root.triangles {
        Some(Triangles::Bvh(bvh)) if root.instance_tree.wide.nodes.is_empty() => Some(bvh),
        _ => None,
    }
}

/// The rays of a batch, sorted by the signs of their directions: those of a packet agree.
struct Octants {
    indices: [u8; BATCH],
    ends: [usize; 8],
}

impl Octants {
    #[inline(always)]
    fn sort(rays: &[Ray], len: usize) -> Self {
        let mut octants = [u8::MAX; BATCH];
        let mut counts = [0_usize; 8];
        for (ray, octant) in rays[..rays.len().min(len)].iter().zip(&mut octants) {
            let [x, y, z] = ray.direction.to_array().map(|d| d.to_bits() >> 31);
            *octant = (x | y << 1 | z << 2) as u8;
            counts[usize::from(*octant)] += 1;
        }
        let mut ends = [0; 8];
        for octant in 1..8 {
            ends[octant] = ends[octant - 1] + counts[octant - 1];
        }
        let mut indices = [0; BATCH];
        for (i, &octant) in octants.iter().enumerate() {
            if let Some(end) = ends.get_mut(usize::from(octant)) {
                indices[*end & (BATCH - 1)] = i as u8;
                *end += 1;
            }
        }
        Self { indices, ends }
    }

    /// Up to 16 rays at a time, none of two octants.
    #[inline(always)]
    fn packets(&self) -> impl Iterator<Item = &[u8]> {
        (0..8).flat_map(|octant| self.rays_of(octant).chunks(LANES))
    }

    #[inline(always)]
    fn rays_of(&self, octant: usize) -> &[u8] {
        let start = if octant == 0 { 0 } else { self.ends[octant - 1] };
        &self.indices[start..self.ends[octant]]
    }
}

#[inline(always)]
fn closest<S: Simd>(simd: S, root: &Object, ray: &Ray, stack: &mut Stack) -> Hit {
    let mut hit = Hit::MISS;
    if let Some(local) = LocalRay::new(ray) {
        instances::closest(simd, (root, Child::ROOT), &local, PathId::ROOT, &mut hit, stack);
    }
    hit
}

#[inline(always)]
fn any<S: Simd>(simd: S, root: &Object, ray: &Ray, sight: &mut Sight<'_>, stack: &mut Stack) -> bool {
    match LocalRay::new(ray) {
        Some(local) => instances::any(simd, (root, Child::ROOT), &local, PathId::ROOT, sight, stack),
        None => false,
    }
}

/// A local ray in an object, for callers that have a kernel of their own around them: a call, not inlined twice.
#[inline(never)]
pub(super) fn closest_local<S: Simd>(
    simd: S,
    within: Within<'_>,
    ray: &LocalRay,
    path: PathId,
    hit: &mut Hit,
    stack: &mut Stack,
) -> bool {
    simd.vectorize(
        #[inline(always)]
        || instances::closest(simd, within, ray, path, hit, stack),
    )
}

/// As [`closest_local`], for any hit.
#[inline(never)]
pub(super) fn any_local<S: Simd>(
    simd: S,
    within: Within<'_>,
    ray: &LocalRay,
    path: PathId,
    sight: &mut Sight<'_>,
    stack: &mut Stack,
) -> bool {
    simd.vectorize(
        #[inline(always)]
        || instances::any(simd, within, ray, path, sight, stack),
    )
}
