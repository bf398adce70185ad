//! Tiles of rays with a common origin: set-up by cube face, traversal of triangles, and instances below.
//!
//! A common origin stays common under an affine map, so the same kernel serves every level of instances.
mod collect;
mod kd;
mod leaf;
mod walk;
mod work;

use std::cell::Cell;

use fearless_simd::prelude::*;
use glam::Vec3A;

use self::{
    leaf::{Leaf, Setup, rays_in_box},
    walk::{Frame, Visit, next_leaf},
    work::{Face, GROUP, LevelRays, Work},
};
use super::{batch, instances, local::LocalRay, stack::Stack};
use crate::{
    layout::Child,
    object::{Object, PlacedInstance},
    ray::{Hit, PathId},
    tile::Tile,
    triangle_bvh::TriangleBvh,
    triangles::Triangles,
};

/// Fewer rays than this on a face are traced singly.
const FEW_RAYS: usize = 6;

/// A bit for each slot of the caller's tile.
type Slots = [u64; 4];

/// Buffers of one query, reused between levels.
struct Scratch {
    visits: Vec<Visit>,
    single: Stack,
    /// Free buffers: nesting takes one more per level.
    levels: Vec<Box<Level>>,
}

struct Level {
    /// All rays of the level, and those of the face at hand.
    rays: LevelRays,
    chosen: LevelRays,
    work: Work,
}

/// Where answers go; `hits` is empty when only occlusion is asked.
struct Answers<'a> {
    hits: &'a mut [Hit],
    /// Slots that found something.
    found: Slots,
}

impl Answers<'_> {
    #[inline(always)]
    fn set(&mut self, slot: u8) {
        self.found[usize::from(slot >> 6)] |= 1 << (slot & 63);
    }
}

#[inline(always)]
fn has(slots: &Slots, slot: u8) -> bool {
    slots[usize::from(slot >> 6)] >> (slot & 63) & 1 != 0
}

thread_local! {
    /// Buffers kept between queries of a thread: a tile is too short to pay for fresh ones. Holds no state.
    static KEPT: Cell<Option<Box<Scratch>>> = const { Cell::new(None) };
}

/// This thread's buffers, or new ones.
#[inline(never)]
fn reuse() -> Box<Scratch> {
    KEPT.take().unwrap_or_else(|| Box::new(Scratch::new()))
}

/// Puts buffers back for the next query, but no more than a few levels of them.
#[inline(never)]
fn keep(mut scratch: Box<Scratch>, level: Box<Level>) {
    scratch.levels.push(level);
    scratch.levels.truncate(4);
    KEPT.set(Some(scratch));
}

impl Scratch {
    fn new() -> Self {
        Self { visits: Vec::with_capacity(64), single: Stack::new(), levels: Vec::new() }
    }

    #[inline(always)]
    fn take(&mut self) -> Box<Level> {
        match self.levels.pop() {
            Some(level) => level,
            None => fresh_level(),
        }
    }
}

/// Apart, because the buffers pass over the stack on their way to the heap.
#[inline(never)]
fn fresh_level() -> Box<Level> {
    Box::new(Level { rays: LevelRays::EMPTY, chosen: LevelRays::EMPTY, work: Work::EMPTY })
}

#[inline(always)]
pub(super) fn intersect<S: Simd>(simd: S, root: &Object, tile: &Tile, hits: &mut [Hit]) {
    let len = tile.len().min(hits.len());
    let hits = &mut hits[..len];
    let mut scratch = reuse();
    let mut level = scratch.take();
    load(simd, &mut level.rays, tile, len);
    for (hit, &t_max) in hits.iter_mut().zip(&tile.t_max) {
        *hit = Hit { t: t_max, ..Hit::MISS };
    }
    let mut answers = Answers { hits: &mut *hits, found: [0; 4] };
    enter::<S, false>(simd, root, PathId::ROOT, &mut level, &mut answers, &mut scratch);
    for (word, found) in answers.found.into_iter().enumerate() {
        let mut missed = !found;
        while missed != 0 {
            let i = word * 64 + missed.trailing_zeros() as usize;
            missed &= missed - 1;
            match hits.get_mut(i) {
                Some(hit) => *hit = Hit::MISS,
                None => break,
            }
        }
    }
    keep(scratch, level);
}

#[inline(always)]
pub(super) fn occluded<S: Simd>(simd: S, root: &Object, tile: &Tile, occluded: &mut [bool]) {
    let len = tile.len().min(occluded.len());
    let mut scratch = reuse();
    let mut level = scratch.take();
    load(simd, &mut level.rays, tile, len);
    let mut answers = Answers { hits: &mut [], found: [0; 4] };
    enter::<S, true>(simd, root, PathId::ROOT, &mut level, &mut answers, &mut scratch);
    for (i, out) in occluded[..len].iter_mut().enumerate() {
        *out = has(&answers.found, i as u8);
    }
    keep(scratch, level);
}

/// Takes over the rays that can hit something.
#[inline(always)]
fn load<S: Simd>(simd: S, rays: &mut LevelRays, tile: &Tile, len: usize) {
    rays.origin = tile.origin.into();
    rays.len = 0;
    if !LocalRay::origin_in_range(rays.origin) {
        return;
    }
    let usable = work::usable(simd, tile, len);
    if usable {
        rays.direction = tile.direction;
        rays.t_min = tile.t_min;
        rays.t_max = tile.t_max;
        rays.slot = IDENTITY;
        rays.len = len;
        return;
    }
    for i in 0..len {
        let direction = Vec3A::new(tile.direction[0][i], tile.direction[1][i], tile.direction[2][i]);
        let ray = LocalRay { origin: rays.origin, direction, t_min: tile.t_min[i].max(0.0) };
        if ray.in_range() && !tile.t_min[i].is_nan() && ray.t_min < tile.t_max[i] {
            rays.push(direction, ray.t_min, tile.t_max[i], i as u8);
        }
    }
}

/// Slots of a tile that is taken over whole.
const IDENTITY: [u8; Tile::CAPACITY] = {
    let mut slots = [0; Tile::CAPACITY];
    let mut i = 0;
    while i < Tile::CAPACITY {
        slots[i] = i as u8;
        i += 1;
    }
    slots
};

/// Answers `level.rays` in `object`, face by face.
#[inline(always)]
fn run<S: Simd, const ANY: bool>(
    simd: S,
    object: &Object,
    path: PathId,
    level: &mut Level,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    let Level { rays, chosen, work } = level;
    while rays.len > 0 {
        let mut face = Face::of(rays.mean_direction(simd));
        let all = rays.all_on(simd, face);
        if all {
            std::mem::swap(rays, chosen);
            rays.len = 0;
        } else {
            if !(0..rays.len).any(|i| face.takes(rays.direction(i))) {
                face = Face::of(rays.direction(0));
            }
            choose(rays, chosen, face);
        }
        if chosen.len < FEW_RAYS {
            few::<S, ANY>(simd, object, path, chosen, answers, scratch);
        } else {
            work.project(simd, chosen, face);
            one_face::<S, ANY>(simd, object, path, chosen, work, answers, scratch);
        }
    }
}

/// Moves the rays that `face` takes from `rays` to `chosen`.
#[inline(always)]
fn choose(rays: &mut LevelRays, chosen: &mut LevelRays, face: Face) {
    chosen.len = 0;
    chosen.origin = rays.origin;
    let len = rays.len;
    rays.len = 0;
    for i in 0..len {
        let (direction, t_min, t_max, slot) = (rays.direction(i), rays.t_min[i], rays.t_max[i], rays.slot[i]);
        let to = if face.takes(direction) { &mut *chosen } else { &mut *rays };
        to.push(direction, t_min, t_max, slot);
    }
}

/// Rays too few for a tile.
#[inline(always)]
fn few<S: Simd, const ANY: bool>(
    simd: S,
    object: &Object,
    path: PathId,
    rays: &LevelRays,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    for i in 0..rays.len {
        let ray = LocalRay { origin: rays.origin, direction: rays.direction(i), t_min: rays.t_min[i] };
        let slot = rays.slot[i];
        let found = if ANY {
            batch::any_local(simd, object, &ray, rays.t_max[i], &mut scratch.single)
        } else {
            let hit = &mut answers.hits[usize::from(slot)];
            batch::closest_local(simd, object, &ray, path, hit, &mut scratch.single)
        };
        if found {
            answers.set(slot);
        }
    }
}

#[inline(always)]
fn one_face<S: Simd, const ANY: bool>(
    simd: S,
    object: &Object,
    path: PathId,
    rays: &LevelRays,
    work: &mut Work,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    match &object.triangles {
        Some(Triangles::Bvh(bvh)) if !bvh.tree.nodes.is_empty() => {
            triangles::<S, ANY>(simd, bvh, rays, work, &mut scratch.visits);
            if ANY {
                collect::occluded(simd, rays, work, answers);
            } else {
                collect::hits(simd, bvh, path, rays, work, answers);
            }
        }
        Some(Triangles::KdTree(tree)) => kd::triangles::<S, ANY>(simd, tree, path, rays, work, answers),
        _ => {}
    }
    if !object.instance_tree.nodes.is_empty() {
        nested::<S, ANY>(simd, object, path, rays, work, answers, scratch);
    }
}

/// All groups through the triangle tree.
#[inline(always)]
fn triangles<S: Simd, const ANY: bool>(
    simd: S,
    bvh: &TriangleBvh,
    rays: &LevelRays,
    work: &mut Work,
    visits: &mut Vec<Visit>,
) {
    let frame = Frame::new(rays.origin.to_array(), bvh.tree.extent, work);
    let mut setup = Setup::EMPTY;
    let mark = visits.len();
    visits.push(Visit { child: Child::inner(0), depth: 0.0, mask: u16::MAX, lane: 0, node: 0 });
    while let Some(visit) = next_leaf(simd, &bvh.tree, &frame, work, visits, mark) {
        let range = frame.box_range(&bvh.tree.nodes[visit.node as usize], usize::from(visit.lane));
        let (first, end) = visit.child.block_range();
        let leaf = Leaf::new(simd, &frame, &bvh.blocks, &range, visit.mask, work);
        let mut changed = 0;
        for block in first..end {
            changed |= leaf::test_block::<S, ANY>(simd, &leaf, work, &mut setup, block);
        }
        if changed != 0 {
            while changed != 0 {
                work.update_reach(simd, (changed.trailing_zeros() & 15) as usize);
                changed &= changed - 1;
            }
            work.update_far(simd);
            if work.far < 0.0 {
                break;
            }
        }
    }
    visits.truncate(mark);
}

/// All groups through the instance tree.
#[inline(always)]
fn nested<S: Simd, const ANY: bool>(
    simd: S,
    object: &Object,
    path: PathId,
    rays: &LevelRays,
    work: &mut Work,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    let frame = Frame::new(rays.origin.to_array(), object.instance_tree.extent, work);
    let mark = scratch.visits.len();
    scratch.visits.push(Visit { child: Child::inner(0), depth: 0.0, mask: u16::MAX, lane: 0, node: 0 });
    while let Some(visit) = next_leaf(simd, &object.instance_tree, &frame, work, &mut scratch.visits, mark) {
        let placed = &object.instances[visit.child.payload() as usize];
        let range =
            frame.box_range(&object.instance_tree.nodes[visit.node as usize], usize::from(visit.lane));
        let (mask, wanted) = rays_in_box(simd, work, visit.mask, &range, frame.slack);
        if mask == 0 {
            continue;
        }
        let mut level = scratch.take();
        if descend::<ANY>(placed, rays, &wanted, answers, &mut level.rays) {
            let before = std::mem::take(&mut answers.found);
            let path = PathId(path.0 + placed.path_offset);
            enter::<S, ANY>(simd, &placed.instance.object, path, &mut level, answers, scratch);
            let below = std::mem::replace(&mut answers.found, before);
            merge::<S, ANY>(simd, placed, rays, work, mask, &below, answers);
        }
        scratch.levels.push(level);
        if work.far < 0.0 {
            break;
        }
    }
    scratch.visits.truncate(mark);
}

/// Carries the `wanted` rays of each group into the instance's space; false if none stays in the usable range.
#[inline(always)]
fn descend<const ANY: bool>(
    placed: &PlacedInstance,
    rays: &LevelRays,
    wanted: &[u16; GROUP],
    answers: &Answers<'_>,
    below: &mut LevelRays,
) -> bool {
    let map = &placed.object_from_parent;
    below.len = 0;
    below.origin = map.transform_point3a(rays.origin);
    for i in 0..rays.len {
        if wanted[i / GROUP] >> (i % GROUP) & 1 == 0 {
            continue;
        }
        let slot = rays.slot[i];
        let t_max = if ANY { rays.t_max[i] } else { answers.hits[usize::from(slot)].t };
        let direction = map.transform_vector3a(rays.direction(i));
        let local = LocalRay { origin: below.origin, direction, t_min: rays.t_min[i] };
        if local.in_range() {
            below.push(direction, rays.t_min[i], t_max, slot);
        }
    }
    below.len > 0
}

/// A call of its own, so that nesting recurses; it takes the instruction set along.
#[inline(never)]
fn enter<S: Simd, const ANY: bool>(
    simd: S,
    object: &Object,
    path: PathId,
    level: &mut Level,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    simd.vectorize(
        #[inline(always)]
        || run::<S, ANY>(simd, object, path, level, answers, scratch),
    );
}

/// Brings what an instance found back up: normals, limits, and which slots.
#[inline(always)]
fn merge<S: Simd, const ANY: bool>(
    simd: S,
    placed: &PlacedInstance,
    rays: &LevelRays,
    work: &mut Work,
    mask: u16,
    below: &Slots,
    answers: &mut Answers<'_>,
) {
    if *below == [0; 4] {
        return;
    }
    for i in 0..rays.len {
        let (g, lane, slot) = (i / GROUP, i % GROUP, rays.slot[i]);
        if mask >> g & 1 == 0 || !has(below, slot) {
            continue;
        }
        answers.set(slot);
        if ANY {
            work.iz[g][lane] = f32::INFINITY;
        } else {
            let hit = &mut answers.hits[usize::from(slot)];
            hit.ng = instances::carry_normal(&placed.normal_from_object, hit.ng);
            work.iz[g][lane] = 1.0 / (hit.t * work.scale[g][lane]);
        }
    }
    let mut rest = mask;
    while rest != 0 {
        work.update_reach(simd, (rest.trailing_zeros() & 15) as usize);
        rest &= rest - 1;
    }
    work.update_far(simd);
}
