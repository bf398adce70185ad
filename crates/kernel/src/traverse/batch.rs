//! Batches of unrelated rays.
use fearless_simd::{Level, Simd};

use super::{
    instances,
    local::LocalRay,
    packet::{Packet, Visit},
    settle::{LANES, Lanes, MeshOf},
    stack::Stack,
};
use crate::{
    object::Object,
    ray::{Hit, PathId, Ray},
    triangle_bvh::TriangleBvh,
    triangles::Triangles,
};

/// Rays taken up together, to be sorted into packets.
const BATCH: usize = 256;
/// Fewer rays than this are not worth a packet.
const FEW_RAYS: usize = 4;

#[inline(always)]
pub(super) fn intersect<S: Simd>(simd: S, root: &Object, rays: &[Ray], hits: &mut [Hit]) {
    let mut stack = Stack::new();
    let Some(bvh) = flat(simd, root, rays.len()) else {
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = closest(simd, root, ray, &mut stack);
        }
        return;
    };
    let mut packets = Packets::new();
    let mut mesh = MeshOf::default();
    for (rays, hits) in rays.chunks(BATCH).zip(hits.chunks_mut(BATCH)) {
        hits.fill(Hit::MISS);
        let sorted = Octants::sort(rays, hits.len());
        for octant in 0..8 {
            for indices in sorted.rays_of(octant).chunks(LANES) {
                packets.load(rays, indices);
                packets.packet.trace::<S, false>(simd, bvh, octant, &mut packets.visits, &mut stack);
                let words = packets.packet.hits(simd, bvh, &packets.t_end, &mut mesh);
                for (lane, &index) in indices.iter().enumerate() {
                    if packets.packet.id[lane] != Packet::NONE {
                        hits[usize::from(index)] = words.hit(lane, PathId::ROOT);
                    }
                }
            }
        }
    }
}

#[inline(always)]
pub(super) fn occluded<S: Simd>(simd: S, root: &Object, rays: &[Ray], occluded: &mut [bool]) {
    let mut stack = Stack::new();
    let Some(bvh) = flat(simd, root, rays.len()) else {
        for (ray, out) in rays.iter().zip(occluded) {
            *out = any(simd, root, ray, &mut stack);
        }
        return;
    };
    let mut packets = Packets::new();
    for (rays, occluded) in rays.chunks(BATCH).zip(occluded.chunks_mut(BATCH)) {
        occluded.fill(false);
        let sorted = Octants::sort(rays, occluded.len());
        for octant in 0..8 {
            for indices in sorted.rays_of(octant).chunks(LANES) {
                packets.load(rays, indices);
                packets.packet.trace::<S, true>(simd, bvh, octant, &mut packets.visits, &mut stack);
                for (&index, &id) in indices.iter().zip(&packets.packet.id) {
                    occluded[usize::from(index)] = id != Packet::NONE;
                }
            }
        }
    }
}

/// The tree to send packets through, if that can pay: several rays, vectors, no instances, and nothing that moves.
#[inline(always)]
fn flat<S: Simd>(simd: S, root: &Object, rays: usize) -> Option<&TriangleBvh> {
    let packets = rays >= FEW_RAYS && !matches!(simd.level(), Level::Fallback(_));
    match &root.triangles {
        Some(Triangles::Bvh(bvh))
            if packets
                && root.instance_tree.wide.is_empty()
                && root.quadrics.is_none()
                && !bvh.has_motion() =>
        {
            Some(bvh)
        }
        _ => None,
    }
}

/// Buffers for packets.
struct Packets {
    packet: Packet,
    /// Where each ray ends.
    t_end: Lanes,
    visits: Vec<Visit>,
}

impl Packets {
    fn new() -> Self {
        Self { packet: Packet::EMPTY, t_end: [0.0; LANES], visits: Vec::with_capacity(64) }
    }

    /// Takes up rays known to be valid.
    #[inline(always)]
    fn load(&mut self, rays: &[Ray], indices: &[u8]) {
        self.packet.clear();
        for &index in indices {
            let ray = &rays[usize::from(index)];
            self.packet.push(&LocalRay::unchecked(ray), ray.t_max);
        }
        self.t_end = self.packet.t_max;
    }
}

/// The valid rays of a batch, sorted by the signs of their directions: those of a packet agree.
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
            if LocalRay::new(ray).is_some() {
                let [x, y, z] = ray.direction.to_array().map(|d| d.to_bits() >> 31);
                *octant = (x | y << 1 | z << 2) as u8;
                counts[usize::from(*octant)] += 1;
            }
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

    #[inline(always)]
    fn rays_of(&self, octant: usize) -> &[u8] {
        let start = if octant == 0 { 0 } else { self.ends[octant - 1] };
        &self.indices[start..self.ends[octant]]
    }
}

#[inline(always)]
pub(super) fn closest<S: Simd>(simd: S, root: &Object, ray: &Ray, stack: &mut Stack) -> Hit {
    let mut hit = Hit::MISS;
    if let Some(local) = LocalRay::new(ray) {
        hit.t = ray.t_max;
        if !instances::closest(simd, root, &local, PathId::ROOT, &mut hit, stack) {
            hit = Hit::MISS;
        }
    }
    hit
}

#[inline(always)]
pub(super) fn any<S: Simd>(simd: S, root: &Object, ray: &Ray, stack: &mut Stack) -> bool {
    match LocalRay::new(ray) {
        Some(local) => instances::any(simd, root, &local, ray.t_max, stack),
        None => false,
    }
}

/// A local ray in an object, for callers that have a kernel of their own around them: a call, not inlined twice.
#[inline(never)]
pub(super) fn closest_local<S: Simd>(
    simd: S,
    object: &Object,
    ray: &LocalRay,
    path: PathId,
    hit: &mut Hit,
    stack: &mut Stack,
) -> bool {
    simd.vectorize(
        #[inline(always)]
        || instances::closest(simd, object, ray, path, hit, stack),
    )
}

/// As [`closest_local`], for any hit.
#[inline(never)]
pub(super) fn any_local<S: Simd>(
    simd: S,
    object: &Object,
    ray: &LocalRay,
    t_max: f32,
    stack: &mut Stack,
) -> bool {
    simd.vectorize(
        #[inline(always)]
        || instances::any(simd, object, ray, t_max, stack),
    )
}
