//! Packets through objects with instances: down the instance tree with the lanes that want it, and back up with what
//! they met. Rays keep their lanes on the way, so answers need no sorting back.
use fearless_simd::Simd;

use super::{
    Within, batch,
    instances::{self, carried},
    packet::{Octant, Packet, Visit},
    settle::{LANES, MeshOf},
    stack::Stack,
};
use crate::{
    layout::Child,
    object::{Object, PlacedInstance},
    ray::{Hit, PathId},
    through::{Panes, Screen, SeeThrough, Sight},
    triangles::Triangles,
};

/// Up to so many lanes go on alone through instances: each then pays for its own way into each of them.
const FEW: u32 = 2;

/// Where the hits of a packet's rays go.
pub(super) struct Answers<'a> {
    /// None for queries of any hit.
    pub hits: &'a mut [Hit],
    /// The place of each lane.
    pub index: [u8; LANES],
    /// What is no obstacle to queries of any hit.
    pub through: Option<&'a dyn SeeThrough>,
}

impl Answers<'_> {
    #[inline(always)]
    fn of(&mut self, lane: usize) -> &mut Hit {
        &mut self.hits[usize::from(self.index[lane & (LANES - 1)])]
    }
}

/// Memory of a query, shared by all levels.
pub(super) struct Scratch {
    pub visits: Vec<Visit>,
    pub stack: Stack,
    /// Packets for levels that are not in use.
    #[expect(clippy::vec_box, reason = "they change hands at every instance; 25 cache lines each")]
    spare: Vec<Box<Packet>>,
}

impl Scratch {
    pub(super) fn new() -> Self {
        Self { visits: Vec::with_capacity(64), stack: Stack::new(), spare: Vec::new() }
    }
}

/// A packet and the memory that its query takes.
pub(super) struct Walker {
    pub packet: Packet,
    pub scratch: Scratch,
}

impl Walker {
    pub(super) fn new() -> Self {
        Self { packet: Packet::EMPTY, scratch: Scratch::new() }
    }

    /// Gives back what deep nesting took: to be called before it is kept for the next query.
    pub(super) fn trim(&mut self) {
        self.scratch.spare.truncate(4);
    }
}

/// Whether packets go through an object: not through what only single rays know. Nothing may move.
#[inline(always)]
pub(super) fn takes_packets(object: &Object) -> bool {
    object.quadrics.is_none() && !matches!(object.triangles, Some(Triangles::KdTree(_)))
}

/// The lanes in `bits` through an object: returns those that met something that precedes their answer so far and is
/// now their answer (its normal in the object's space); with `ANY`, something that stops them, and their limit is then
/// negative.
///
/// A call of its own, so that nesting recurses; it takes the instruction set along.
#[inline(never)]
pub(super) fn through<S: Simd, const ANY: bool>(
    simd: S,
    within: Within<'_>,
    path: PathId,
    packet: &mut Packet,
    bits: u16,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) -> u16 {
    simd.vectorize(
        #[inline(always)]
        || in_object::<S, ANY>(simd, within, path, packet, bits, answers, scratch),
    )
}

#[inline(always)]
fn in_object<S: Simd, const ANY: bool>(
    simd: S,
    (object, start): Within<'_>,
    path: PathId,
    packet: &mut Packet,
    bits: u16,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) -> u16 {
    if !takes_packets(object) {
        return one_by_one::<S, ANY>(simd, (object, start), path, packet, bits, answers, scratch);
    }
    let mut found = 0;
    if let Some(Triangles::Bvh(bvh)) = &object.triangles {
        let panes = if ANY { Panes::of(answers.through, path) } else { Panes::NONE };
        found = triangles::<S, ANY>(simd, Screen { bvh, start, panes }, path, packet, bits, answers, scratch);
    }
    if !object.instance_tree.wide.nodes.is_empty() {
        packet.prepare_boxes(simd, &object.instance_tree.wide);
        let mut rest = if ANY { bits & !found } else { bits };
        while rest != 0 {
            let (octant, alike) = packet.octant(rest);
            if packet.is_mixed && alike != rest {
                found |= placed::<S, ANY, true>(simd, object, path, packet, octant, rest, answers, scratch);
                break;
            }
            rest &= !alike;
            found |= placed::<S, ANY, false>(simd, object, path, packet, octant, alike, answers, scratch);
        }
    }
    found
}

/// The lanes through the object's own triangles.
#[inline(always)]
fn triangles<S: Simd, const ANY: bool>(
    simd: S,
    screen: Screen<'_>,
    path: PathId,
    packet: &mut Packet,
    bits: u16,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) -> u16 {
    let mut found = packet.trace::<S, ANY>(simd, screen, bits, &mut scratch.visits, &mut scratch.stack);
    if !ANY && found != 0 {
        let words = packet.hits(simd, screen.bvh, found, &mut MeshOf::default());
        for lane in lanes(found) {
            let (hit, answer) = (words.hit(lane, path), answers.of(lane));
            if hit.precedes(answer) {
                *answer = hit;
            } else {
                found &= !(1 << lane);
            }
            packet.settle(lane, answer.t);
        }
    }
    found
}

/// Lanes of one octant, or `MIXED` ones, through the object's instances.
#[expect(clippy::too_many_arguments, reason = "the rays, what they meet and where the answers go")]
#[inline(always)]
fn placed<S: Simd, const ANY: bool, const MIXED: bool>(
    simd: S,
    object: &Object,
    path: PathId,
    packet: &mut Packet,
    octant: Octant,
    bits: u16,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) -> u16 {
    let nodes = &object.instance_tree.wide.nodes[..];
    let beam = if MIXED { packet.hull(simd, bits) } else { packet.beam(simd, octant, bits) };
    let mark = scratch.visits.len();
    scratch.visits.push(packet.visit(simd, Child::ROOT, bits));
    let mut found = 0;
    while scratch.visits.len() > mark {
        let Some(visit) = scratch.visits.pop() else { break };
        let wanting = packet.wanting(simd, &visit);
        let bits = fearless_simd::SimdMask::to_bitmask(wanting) as u16;
        if bits == 0 {
            continue;
        }
        if bits.count_ones() <= FEW {
            found |= alone::<S, ANY>(simd, object, path, packet, visit.child, bits, answers, scratch);
        } else if visit.child.is_leaf() {
            found |= enter::<S, ANY>(simd, object.behind(visit.child), path, packet, bits, answers, scratch);
        } else {
            let node = &nodes[visit.child.0 as usize];
            packet.open::<S, MIXED>(simd, node, object, (octant, &beam), wanting, &mut scratch.visits);
        }
    }
    found
}

/// The lanes into an instance, and what they met there back up.
#[inline(always)]
fn enter<S: Simd, const ANY: bool>(
    simd: S,
    (placed, start): (&PlacedInstance, Child),
    path: PathId,
    packet: &mut Packet,
    bits: u16,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) -> u16 {
    let mut below = scratch.spare.pop().unwrap_or_else(|| Box::new(Packet::EMPTY));
    let bits = below.carry(simd, packet, &placed.object_from_parent, bits);
    let path = PathId(path.0 + placed.path_offset);
    let within = (&*placed.instance.object, start);
    let found = through::<S, ANY>(simd, within, path, &mut below, bits, answers, scratch);
    packet.limit = below.limit;
    packet.met |= below.met;
    scratch.spare.push(below);
    if !ANY {
        for lane in lanes(found) {
            let hit = answers.of(lane);
            hit.ng = carried(placed, hit.ng);
        }
    }
    found
}

/// The lanes one by one through a subtree of instances.
#[expect(clippy::too_many_arguments, reason = "the rays, what they meet and where the answers go")]
#[inline(always)]
fn alone<S: Simd, const ANY: bool>(
    simd: S,
    object: &Object,
    path: PathId,
    packet: &mut Packet,
    start: Child,
    bits: u16,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) -> u16 {
    let (stack, mut found) = (&mut scratch.stack, 0);
    for lane in lanes(bits) {
        let (ray, slab) = (packet.ray(lane), packet.slab_of(simd, lane, packet.near_of(lane)));
        if ANY {
            let mut sight = Sight { through: answers.through, met: false };
            if instances::any_instance_below(simd, object, &ray, &slab, start, path, &mut sight, stack) {
                packet.limit[lane] = -1.0;
                found |= 1 << lane;
            }
            packet.met |= u16::from(sight.met) << lane;
            continue;
        }
        let hit = answers.of(lane);
        if instances::closest_instance_below(simd, object, &ray, &slab, start, path, hit, stack) {
            packet.settle(lane, hit.t);
            found |= 1 << lane;
        }
    }
    found
}

/// The lanes one by one through an object that takes no packets.
#[inline(always)]
fn one_by_one<S: Simd, const ANY: bool>(
    simd: S,
    within: Within<'_>,
    path: PathId,
    packet: &mut Packet,
    bits: u16,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) -> u16 {
    let (stack, mut found) = (&mut scratch.stack, 0);
    for lane in lanes(bits) {
        let ray = packet.ray(lane);
        if ANY {
            let mut sight = Sight { through: answers.through, met: false };
            if batch::any_local(simd, within, &ray, path, &mut sight, stack) {
                packet.limit[lane] = -1.0;
                found |= 1 << lane;
            }
            packet.met |= u16::from(sight.met) << lane;
            continue;
        }
        let hit = answers.of(lane);
        if batch::closest_local(simd, within, &ray, path, hit, stack) {
            packet.settle(lane, hit.t);
            found |= 1 << lane;
        }
    }
    found
}

/// The lanes of a bit mask.
#[inline(always)]
fn lanes(bits: u16) -> Lanes {
    Lanes(bits)
}

struct Lanes(u16);

impl Iterator for Lanes {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let lane = (self.0.trailing_zeros() & 15) as usize;
        let some = self.0 != 0;
        self.0 &= self.0.wrapping_sub(1);
        some.then_some(lane)
    }
}
