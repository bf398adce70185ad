//! Batches of unrelated rays.
use std::cell::Cell;

use fearless_simd::Simd;

use super::{
    Within,
    descent::{self, Answers, Walker},
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
/// After so many rows of 16 rays that did not stay together, the others of a batch are not looked at.
const STRAY_ROWS: u32 = 2;
/// Rays up to this share of a scene's largest extent are short.
const SHORT: f32 = 0.25;

thread_local! {
    /// A walker kept between queries of a thread: a batch of few rays is too short to pay for a fresh one. Holds no state.
    static KEPT: Cell<Option<Box<Walker>>> = const { Cell::new(None) };
}

#[inline(never)]
fn reuse() -> Box<Walker> {
    KEPT.take().unwrap_or_else(|| Box::new(Walker::new()))
}

#[inline(never)]
fn keep(mut walker: Box<Walker>) {
    walker.trim();
    KEPT.set(Some(walker));
}

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
    let mut walker = reuse();
    let Walker { packet, scratch } = &mut *walker;
    let mut mesh = MeshOf::default();
    let short = SHORT * root.bounds().size().max_element();
    for (rays, hits) in rays.chunks(BATCH).zip(hits.chunks_mut(BATCH)) {
        hits.fill(Hit::MISS);
        let mut packets = Packets::of(&rays[..rays.len().min(hits.len())], short);
        if let Some(bvh) = flat(root) {
            let screen = Screen { bvh, start: Child::ROOT, panes: Panes::NONE };
            while let Some(lanes) = packets.next(simd, packet) {
                let found =
                    packet.trace::<S, false>(simd, screen, lanes, &mut scratch.visits, &mut scratch.stack);
                let words = packet.hits(simd, bvh, found, &mut mesh);
                for (lane, &index) in packets.indices().iter().enumerate() {
                    if found >> lane & 1 != 0 {
                        hits[usize::from(index)] = words.hit(lane, PathId::ROOT);
                    }
                }
            }
            continue;
        }
        while let Some(lanes) = packets.next(simd, packet) {
            let mut answers = Answers { hits, index: packets.indices, through: None };
            descent::through::<S, false>(
                simd,
                (root, Child::ROOT),
                PathId::ROOT,
                packet,
                lanes,
                &mut answers,
                scratch,
            );
        }
    }
    keep(walker);
}

/// As [`intersect`], for any hit.
#[inline(always)]
pub(super) fn occluded<S: Simd>(simd: S, root: &Object, rays: &[Ray], mut shadows: Shadows<'_>) {
    let rays = &rays[..rays.len().min(shadows.occluded.len())];
    let mut walker = reuse();
    let Walker { packet, scratch } = &mut *walker;
    let mut answers = Answers { hits: &mut [], index: [0; LANES], through: shadows.through };
    let short = SHORT * root.bounds().size().max_element();
    for (chunk, rays) in rays.chunks(BATCH).enumerate() {
        let first = chunk * BATCH;
        shadows.clear(first, rays.len());
        let mut packets = Packets::of(rays, short);
        if let Some(bvh) = flat(root) {
            let screen = Screen { bvh, start: Child::ROOT, panes: Panes::of(shadows.through, PathId::ROOT) };
            while let Some(lanes) = packets.next(simd, packet) {
                let found =
                    packet.trace::<S, true>(simd, screen, lanes, &mut scratch.visits, &mut scratch.stack);
                for (lane, &index) in packets.indices().iter().enumerate() {
                    let (found, met) = (found >> lane & 1 != 0, packet.met >> lane & 1 != 0);
                    shadows.set(first + usize::from(index), found, met);
                }
            }
            continue;
        }
        while let Some(lanes) = packets.next(simd, packet) {
            let found = descent::through::<S, true>(
                simd,
                (root, Child::ROOT),
                PathId::ROOT,
                packet,
                lanes,
                &mut answers,
                scratch,
            );
            for (lane, &index) in packets.indices().iter().enumerate() {
                let (found, met) = (found >> lane & 1 != 0, packet.met >> lane & 1 != 0);
                shadows.set(first + usize::from(index), found, met);
            }
        }
    }
    keep(walker);
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

/// The packets of a batch: first 16 rays in a row each, then, sorted by octant, the signs of their directions, the rays of
/// those that did not stay together.
struct Packets<'a> {
    rays: &'a [Ray],
    /// How far short rays go.
    short: f32,
    /// The first ray of the next row.
    next: usize,
    /// A bit for each row that did not stay together, or was not looked at.
    apart: u32,
    sorted: Option<Octants>,
    /// The packet at hand: indices of rays in the batch.
    indices: [u8; LANES],
    len: usize,
}

impl<'a> Packets<'a> {
    /// Of a batch of rays.
    #[inline(always)]
    fn of(rays: &'a [Ray], short: f32) -> Self {
        Self { rays, short, next: 0, apart: 0, sorted: None, indices: [0; LANES], len: 0 }
    }

    /// Goes on to the next packet and takes it up; the lanes that can hit something, or `None` at the end.
    #[inline(always)]
    fn next<S: Simd>(&mut self, simd: S, packet: &mut Packet) -> Option<u16> {
        while self.next < self.rays.len() {
            let start = self.next;
            if self.apart.count_ones() == STRAY_ROWS {
                self.apart |= u32::MAX << (start / LANES);
                self.next = self.rays.len();
                break;
            }
            self.len = (self.rays.len() - start).min(LANES);
            self.next += LANES;
            for (lane, index) in self.indices.iter_mut().enumerate() {
                *index = (start + lane) as u8;
            }
            let lanes = packet.load(simd, self.rays, &self.indices, self.len);
            if packet.stays_together(simd, lanes, self.short) {
                return Some(lanes);
            }
            self.apart |= 1 << (start / LANES);
        }
        if self.apart == 0 {
            return None;
        }
        let sorted = self.sorted.get_or_insert_with(|| Octants::sort(self.rays, self.apart));
        self.len = sorted.next(&mut self.indices)?;
        Some(packet.load(simd, self.rays, &self.indices, self.len))
    }

    /// The indices of the packet's rays in the batch.
    #[inline(always)]
    fn indices(&self) -> &[u8] {
        &self.indices[..self.len]
    }
}

/// Rays of a batch sorted by octant.
struct Octants {
    indices: [u8; BATCH],
    ends: [usize; 8],
    octant: usize,
    next: usize,
}

impl Octants {
    /// The rays of the rows in `apart`.
    #[inline(always)]
    fn sort(rays: &[Ray], apart: u32) -> Self {
        let mut octants = [0; BATCH];
        let mut counts = [0_usize; 8];
        let rows = || (0..BATCH / LANES).filter(|row| apart >> row & 1 != 0);
        let row = |row: usize| row * LANES..((row + 1) * LANES).min(rays.len());
        for index in rows().flat_map(row) {
            let [x, y, z] = rays[index].direction.to_array().map(|d| d.to_bits() >> 31);
            let octant = (x | y << 1 | z << 2) as u8;
            octants[index & (BATCH - 1)] = octant;
            counts[usize::from(octant & 7)] += 1;
        }
        let mut ends = [0; 8];
        for octant in 1..8 {
            ends[octant] = ends[octant - 1] + counts[octant - 1];
        }
        let mut indices = [0; BATCH];
        for index in rows().flat_map(row) {
            let end = &mut ends[usize::from(octants[index & (BATCH - 1)] & 7)];
            indices[*end & (BATCH - 1)] = index as u8;
            *end += 1;
        }
        Self { indices, ends, octant: 0, next: 0 }
    }

    /// Up to 16 rays at a time, none of two octants; their number.
    #[inline(always)]
    fn next(&mut self, indices: &mut [u8; LANES]) -> Option<usize> {
        while self.next >= *self.ends.get(self.octant)? {
            self.octant += 1;
        }
        let len = (self.ends[self.octant] - self.next).min(LANES);
        for (to, from) in indices.iter_mut().zip(&self.indices[self.next..self.next + len]) {
            *to = *from;
        }
        self.next += len;
        Some(len)
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
