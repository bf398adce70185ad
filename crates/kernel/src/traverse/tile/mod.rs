//! Tiles of rays with a common origin: set-up by cube face, traversal of triangles, and instances below.
//!
//! A common origin stays common under an affine map, so the same kernel serves every level of instances.
mod collect;
mod kd;
mod leaf;
mod nested;
mod packets;
mod setup;
mod walk;
mod work;

use std::cell::Cell;

use fearless_simd::prelude::*;

use self::{
    leaf::Leaf,
    setup::Setup,
    walk::{Frame, Visit, next_leaf},
    work::{Face, GROUP, LevelRays, Rays, Work},
};
use super::{
    Within, batch,
    descent::{self, Walker},
    local::LocalRay,
    stack::Stack,
};
use crate::{
    layout::Child,
    object::Object,
    quadric::Quadrics,
    ray::{Hit, PathId},
    through::{Panes, Screen, SeeThrough, Shadows, Sight},
    tile::Tile,
    triangles::Triangles,
};

/// Fewer rays than this on a face are traced singly.
const FEW_RAYS: usize = 6;
/// Up to so many rays go in packets of 16: a tile's frustum meets most of the boxes that it meets with all rays, so those of
/// 20 shadow rays of a picture take twice as long each in a tile as in packets. Where trees are small, tiles are as fast from
/// 50 rays on, where they are large from 200.
const PACKETS: usize = 96;

/// A bit for each slot of the caller's tile.
type Slots = [u64; 4];

/// Buffers of one query, reused between levels.
struct Scratch {
    visits: Vec<Visit>,
    walker: Walker,
    /// Free buffers: nesting takes one more per level.
    levels: Vec<Box<Level>>,
}

struct Level {
    /// The level's own copy of its rays, where it needs one.
    rays: LevelRays,
    faces: Faces,
}

/// Buffers for going face by face.
struct Faces {
    /// The rays of the face at hand, where there are several.
    chosen: LevelRays,
    work: Work,
}

/// Where answers go; `hits` is empty when only occlusion is asked.
struct Answers<'a> {
    /// Meaningful where `found` says so.
    hits: &'a mut [Hit],
    /// Slots that found something.
    found: Slots,
    /// Those that did so since the last instance was entered.
    below: Slots,
    /// What is no obstacle when only occlusion is asked,
    through: Option<&'a dyn SeeThrough>,
    /// and the slots that met some of it.
    met: Slots,
}

impl<'a> Answers<'a> {
    fn new(hits: &'a mut [Hit], through: Option<&'a dyn SeeThrough>) -> Self {
        Self { hits, found: [0; 4], below: [0; 4], through, met: [0; 4] }
    }

    #[inline(always)]
    fn meet(&mut self, slot: u8) {
        self.met[usize::from(slot >> 6)] |= 1 << (slot & 63);
    }

    #[inline(always)]
    fn set(&mut self, slot: u8) {
        let (word, bit) = (usize::from(slot >> 6), 1 << (slot & 63));
        self.found[word] |= bit;
        self.below[word] |= bit;
    }

    /// Writes the first hit of a slot.
    #[inline(always)]
    fn put(&mut self, slot: u8, hit: Hit) {
        if let Some(to) = self.hits.get_mut(usize::from(slot)) {
            *to = hit;
            self.set(slot);
        }
    }

    /// Writes a hit if it precedes what the slot has; the distance of what it has then.
    #[inline(always)]
    fn merge(&mut self, slot: u8, hit: Hit) -> f32 {
        if has(&self.found, slot)
            && let Some(before) = self.hits.get(usize::from(slot))
            && !hit.precedes(before)
        {
            return before.t;
        }
        self.put(slot, hit);
        hit.t
    }

    /// What a slot has, to be changed by those who tell [`Answers::set`].
    #[inline(always)]
    fn of(&mut self, slot: u8) -> &mut Hit {
        let known = has(&self.found, slot);
        let hit = &mut self.hits[usize::from(slot)];
        if !known {
            *hit = Hit::MISS;
        }
        hit
    }
}

#[inline(always)]
fn has(slots: &Slots, slot: u8) -> bool {
    slots[usize::from(slot >> 6)] >> (slot & 63) & 1 != 0
}

/// The first `len` slots.
#[inline(always)]
fn first_slots(len: usize) -> Slots {
    [0, 64, 128, 192].map(|start| match len.saturating_sub(start) {
        0 => 0,
        rest => u64::MAX >> (64 - rest.min(64)),
    })
}

#[inline(always)]
fn lowest(slots: &Slots) -> Option<usize> {
    let word = slots.iter().position(|&word| word != 0)?;
    Some(word * 64 + slots[word].trailing_zeros() as usize)
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
    scratch.walker.trim();
    KEPT.set(Some(scratch));
}

impl Scratch {
    fn new() -> Self {
        Self { visits: Vec::with_capacity(64), walker: Walker::new(), levels: Vec::new() }
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
    let faces = Faces { chosen: LevelRays::EMPTY, work: Work::EMPTY };
    Box::new(Level { rays: LevelRays::EMPTY, faces })
}

#[inline(always)]
pub(super) fn intersect<S: Simd>(simd: S, root: &Object, tile: &Tile, hits: &mut [Hit]) {
    let len = tile.len().min(hits.len());
    let hits = &mut hits[..len];
    let mut scratch = reuse();
    let mut level = scratch.take();
    let mut answers = Answers::new(&mut *hits, None);
    let Level { rays, faces } = &mut *level;
    let rays = usable(simd, rays, tile, len);
    whole::<S, false>(simd, root, rays, faces, &mut answers, &mut scratch);
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
pub(super) fn occluded<S: Simd>(simd: S, root: &Object, tile: &Tile, shadows: Shadows<'_>) {
    let len = tile.len().min(shadows.occluded.len());
    let mut scratch = reuse();
    let mut level = scratch.take();
    let mut answers = Answers::new(&mut [], shadows.through);
    let Level { rays, faces } = &mut *level;
    let rays = usable(simd, rays, tile, len);
    whole::<S, true>(simd, root, rays, faces, &mut answers, &mut scratch);
    let Answers { found, met, .. } = answers;
    for (i, occluded) in shadows.occluded[..len].iter_mut().enumerate() {
        *occluded = has(&found, i as u8);
    }
    // In a loop of its own, as in one with the other it would be stored to no purpose where nobody asks.
    if shadows.through.is_some() {
        for (i, filtered) in shadows.filtered[..len].iter_mut().enumerate() {
            *filtered = has(&met, i as u8) && !has(&found, i as u8);
        }
    }
    keep(scratch, level);
}

/// The rays that can hit something: mostly all of them, else copied to `some`.
#[inline(always)]
fn usable<'a, S: Simd>(simd: S, some: &'a mut LevelRays, tile: &'a Tile, len: usize) -> Rays<'a> {
    let all = Rays { origin: tile.origin, tile, limit: &tile.t_max, slot: &IDENTITY, len };
    let in_range = LocalRay::origin_in_range(tile.origin.into());
    if in_range && work::all_usable(simd, tile, len) {
        return all;
    }
    some.tile.restart(tile.origin);
    for i in 0..len {
        let ray = LocalRay { t_min: tile.t_min[i].max(0.0), ..all.ray(i) };
        if ray.in_range() && !tile.t_min[i].is_nan() && ray.t_min < tile.t_max[i] {
            some.push(ray.direction, [ray.t_min, tile.t_max[i], tile.t_max[i]], i as u8);
        }
    }
    some.rays()
}

/// Slots of a tile that is taken over whole.
static IDENTITY: [u8; Tile::CAPACITY] = {
    let mut slots = [0; Tile::CAPACITY];
    let mut i = 0;
    while i < Tile::CAPACITY {
        slots[i] = i as u8;
        i += 1;
    }
    slots
};

/// Answers all rays of a query.
#[inline(always)]
fn whole<S: Simd, const ANY: bool>(
    simd: S,
    root: &Object,
    rays: Rays<'_>,
    faces: &mut Faces,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    let within = (root, Child::ROOT);
    // Not below: the few rays that enter an instance are neighbours.
    if (FEW_RAYS..=PACKETS).contains(&rays.len) && descent::takes_packets(root) {
        packets::trace::<S, ANY>(simd, within, PathId::ROOT, rays, answers, scratch);
    } else {
        run::<S, ANY>(simd, within, PathId::ROOT, rays, faces, answers, scratch);
    }
}

/// Answers `rays` in `object`, face by face.
#[inline(always)]
fn run<S: Simd, const ANY: bool>(
    simd: S,
    (object, start): Within<'_>,
    path: PathId,
    rays: Rays<'_>,
    faces: &mut Faces,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    let Faces { chosen, work } = faces;
    let mut face = Face::of(rays.mean_direction(simd));
    if rays.all_on(simd, face) {
        return one_face::<S, ANY>(simd, (object, start), path, rays, face, work, answers, scratch);
    }
    let mut waiting = first_slots(rays.len);
    while let Some(first) = lowest(&waiting) {
        choose(rays, face, &mut waiting, chosen);
        if !chosen.tile.is_empty() {
            one_face::<S, ANY>(simd, (object, start), path, chosen.rays(), face, work, answers, scratch);
        }
        // A face takes the ray that it is the face of: the next round gets on.
        face = Face::of(rays.direction(lowest(&waiting).unwrap_or(first)));
    }
}

/// Moves the rays that `face` takes from the `waiting` ones to `chosen`.
#[inline(always)]
fn choose(rays: Rays<'_>, face: Face, waiting: &mut Slots, chosen: &mut LevelRays) {
    chosen.tile.restart(rays.origin);
    for i in 0..rays.len {
        let direction = rays.direction(i);
        if has(waiting, i as u8) && face.takes(direction) {
            waiting[(i / 64) & 3] &= !(1 << (i % 64));
            let interval = [rays.tile.t_min[i], rays.tile.t_max[i], rays.limit[i]];
            chosen.push(direction, interval, rays.slot[i]);
        }
    }
}

/// Rays too few for a tile.
#[inline(always)]
fn few<S: Simd, const ANY: bool>(
    simd: S,
    (object, start): Within<'_>,
    path: PathId,
    rays: Rays<'_>,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    for i in 0..rays.len {
        let ray = rays.ray(i);
        let slot = rays.slot[i];
        let found = if ANY {
            let mut sight = Sight { through: answers.through, met: false };
            let found = batch::any_local(
                simd,
                (object, start),
                &ray,
                path,
                &mut sight,
                &mut scratch.walker.scratch.stack,
            );
            if sight.met {
                answers.meet(slot);
            }
            found
        } else {
            batch::closest_local(
                simd,
                (object, start),
                &ray,
                path,
                answers.of(slot),
                &mut scratch.walker.scratch.stack,
            )
        };
        if found {
            answers.set(slot);
        }
    }
}

#[expect(
    clippy::too_many_arguments,
    reason = "the rays, what they meet and where the answers go; a struct would only rename them"
)]
#[inline(always)]
fn one_face<S: Simd, const ANY: bool>(
    simd: S,
    (object, start): Within<'_>,
    path: PathId,
    rays: Rays<'_>,
    face: Face,
    work: &mut Work,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    if rays.len < FEW_RAYS {
        return few::<S, ANY>(simd, (object, start), path, rays, answers, scratch);
    }
    work.project(simd, rays, face);
    in_object::<S, ANY>(simd, (object, start), path, rays, u16::MAX, false, work, answers, scratch);
}

/// Answers the groups in `mask` of projected rays in `object`. `shared`: others will use `work` after it.
#[expect(
    clippy::too_many_arguments,
    reason = "the rays, what they meet and where the answers go; a struct would only rename them"
)]
#[inline(always)]
fn in_object<S: Simd, const ANY: bool>(
    simd: S,
    (object, start): Within<'_>,
    path: PathId,
    rays: Rays<'_>,
    mask: u16,
    shared: bool,
    work: &mut Work,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    let panes = if ANY { Panes::of(answers.through, path) } else { Panes::NONE };
    match &object.triangles {
        Some(Triangles::Bvh(bvh)) if !bvh.tree.is_empty() => {
            let (screen, visits) = (Screen { bvh, start, panes }, &mut scratch.visits);
            if ANY && !panes.is_empty() {
                triangles_past(simd, screen, rays, mask, work, visits);
                collect::met(rays, work, answers);
            } else {
                triangles::<S, ANY, false>(simd, screen, rays, mask, work, visits);
            }
            if ANY {
                collect::occluded(simd, rays, mask, work, answers);
            } else {
                let more = shared || object.quadrics.is_some() || !object.instance_tree.wide.is_empty();
                collect::hits(simd, bvh, path, rays, mask, work, answers, more);
            }
        }
        // It looks at all groups, and as far as the rays go.
        Some(Triangles::KdTree(tree)) => {
            kd::triangles::<S, ANY>(simd, tree, path, rays, work, answers);
        }
        _ => {}
    }
    if let Some(shapes) = &object.quadrics {
        quadrics::<S, ANY>(simd, shapes, path, rays, mask, work, answers, &mut scratch.walker.scratch.stack);
    }
    if !object.instance_tree.wide.nodes.is_empty() {
        nested::instances::<S, ANY>(simd, object, path, rays, mask, work, answers, scratch);
    }
}

/// The groups in `mask`, ray by ray, through the spheres and cones.
#[expect(
    clippy::too_many_arguments,
    reason = "the rays, what they meet and where the answers go; a struct would only rename them"
)]
#[inline(always)]
fn quadrics<S: Simd, const ANY: bool>(
    simd: S,
    shapes: &Quadrics,
    path: PathId,
    rays: Rays<'_>,
    mask: u16,
    work: &mut Work,
    answers: &mut Answers<'_>,
    stack: &mut Stack,
) {
    for i in 0..rays.len {
        let (g, lane, slot) = (i / GROUP, i % GROUP, rays.slot[i]);
        if mask >> g & 1 == 0 {
            continue;
        }
        let ray = rays.ray(i);
        // What was found is also a limit for what the groups meet next.
        if ANY {
            if has(&answers.found, slot) {
                continue;
            }
            let (panes, mut met) = (Panes::of(answers.through, path), false);
            if super::quadrics::any(simd, shapes, &ray, panes, &mut met, stack) {
                answers.set(slot);
                work.iz[g][lane] = f32::INFINITY;
                work.update_reach(simd, g);
            } else if met {
                answers.meet(slot);
            }
        } else if super::quadrics::closest(simd, shapes, &ray, path, answers.of(slot), stack) {
            answers.set(slot);
            work.settle(rays, i, answers.of(slot).t);
            work.update_reach(simd, g);
        }
    }
    work.update_far(simd);
}

/// The groups in `mask` through the triangle tree, past what lets light through. A call, so that the code around it stays
/// as where there is nothing of it.
#[inline(never)]
fn triangles_past<S: Simd>(
    simd: S,
    screen: Screen<'_>,
    rays: Rays<'_>,
    mask: u16,
    work: &mut Work,
    visits: &mut Vec<Visit>,
) {
    simd.vectorize(
        #[inline(always)]
        || triangles::<S, true, true>(simd, screen, rays, mask, work, visits),
    );
}

/// The groups in `mask` through the triangle tree.
#[inline(always)]
fn triangles<S: Simd, const ANY: bool, const PAST: bool>(
    simd: S,
    screen: Screen<'_>,
    rays: Rays<'_>,
    mask: u16,
    work: &mut Work,
    visits: &mut Vec<Visit>,
) {
    let bvh = screen.bvh;
    let frame = Frame::new(rays.origin.to_array(), &bvh.tree, work);
    let mut setup = Setup::EMPTY;
    let mark = visits.len();
    visits.push(Visit { child: screen.start, mask, ..Visit::ROOT });
    while let Some(visit) = next_leaf(simd, &bvh.tree, bvh.blocks().full, &frame, work, visits, mark) {
        let (first, end) = visit.child.block_range();
        let leaf = Leaf::new(simd, &frame, rays, screen, &visit.range, visit.mask, work);
        let mut changed = 0;
        for block in first..end {
            changed |= leaf::test_block::<S, ANY, PAST>(simd, &leaf, work, &mut setup, block);
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
