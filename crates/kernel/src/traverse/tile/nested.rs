//! A tile's way into instances: turned and scaled ones get rays of their own, moved ones share those of their parent.
use fearless_simd::{f32x16, prelude::*};
use glam::Vec3;

use super::{
    Answers, Faces, Level, Scratch, Slots, has, in_object,
    leaf::rays_in_box,
    run,
    walk::{Frame, Visit, next_leaf},
    work::{GROUP, LevelRays, Rays, Work},
};
use crate::{
    layout::Child,
    object::{Object, PlacedInstance},
    ray::PathId,
    traverse::{instances, local::LocalRay},
    triangles::Triangles,
};

/// Limits of rays that already hit something, taken back from reciprocal depths, reach farther by this factor: three
/// roundings.
const LIMIT_SLACK: f32 = 1.0 + 4.0 * f32::EPSILON;

/// The groups in `mask` through the instance tree of `object`.
#[expect(
    clippy::too_many_arguments,
    reason = "the rays, what they meet and where the answers go; a struct would only rename them"
)]
#[inline(always)]
pub(super) fn instances<S: Simd, const ANY: bool>(
    simd: S,
    object: &Object,
    path: PathId,
    rays: Rays<'_>,
    mask: u16,
    work: &mut Work,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    let tree = &object.instance_tree.wide;
    let frame = Frame::new(rays.origin.to_array(), tree, work);
    let mark = scratch.visits.len();
    scratch.visits.push(Visit { mask, ..Visit::ROOT });
    while let Some(visit) = next_leaf(simd, tree, object, &frame, work, &mut scratch.visits, mark) {
        let (placed, start) = object.behind(visit.child);
        let (mask, wanted) = rays_in_box(simd, work, visit.mask, &visit.range, frame.slack);
        if mask == 0 {
            continue;
        }
        let path = PathId(path.0 + placed.path_offset);
        if let Some(origin) = moved_origin(placed, rays) {
            let rays = Rays { origin, ..rays };
            enter_moved::<S, ANY>(simd, (placed, start), path, rays, mask, work, answers, scratch);
        } else {
            let mut level = scratch.take();
            if descend::<S, ANY>(simd, placed, rays, work, mask, &wanted, &mut level.rays) {
                let before = std::mem::take(&mut answers.below);
                let Level { rays: below, faces } = &mut *level;
                enter::<S, ANY>(simd, (placed, start), path, below.rays(), faces, answers, scratch);
                let below = std::mem::replace(&mut answers.below, before);
                merge::<S, ANY>(simd, placed, rays, work, mask, &wanted, &below, answers);
            }
            scratch.levels.push(level);
        }
        if work.far < 0.0 {
            break;
        }
    }
    scratch.visits.truncate(mark);
}

/// The rays' origin in an instance that is neither turned nor scaled: their directions, and with them all that is
/// projected, stay as they are. (A kd-tree does not look at how far rays already got, so it wants rays of its own.)
#[inline(always)]
fn moved_origin(placed: &PlacedInstance, rays: Rays<'_>) -> Option<Vec3> {
    if !placed.only_moved || matches!(placed.instance.object.triangles, Some(Triangles::KdTree(_))) {
        return None;
    }
    let origin = rays.origin + Vec3::from(placed.object_from_parent.translation);
    LocalRay::origin_in_range(origin.into()).then_some(origin)
}

/// A call of its own, so that nesting recurses; it takes the instruction set along.
#[expect(
    clippy::too_many_arguments,
    reason = "the rays, what they meet and where the answers go; a struct would only rename them"
)]
#[inline(never)]
fn enter_moved<S: Simd, const ANY: bool>(
    simd: S,
    (placed, start): (&PlacedInstance, Child),
    path: PathId,
    rays: Rays<'_>,
    mask: u16,
    work: &mut Work,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    let object = &placed.instance.object;
    simd.vectorize(
        #[inline(always)]
        || in_object::<S, ANY>(simd, (object, start), path, rays, mask, true, work, answers, scratch),
    );
}

/// Carries the `wanted` rays of each group into the instance's space; false if none stays in the usable range.
#[inline(always)]
fn descend<S: Simd, const ANY: bool>(
    simd: S,
    placed: &PlacedInstance,
    rays: Rays<'_>,
    work: &Work,
    mask: u16,
    wanted: &[u16; GROUP],
    below: &mut LevelRays,
) -> bool {
    let map = &placed.object_from_parent;
    let origin = map.transform_point3a(rays.origin.into());
    below.tile.restart(origin.into());
    if !LocalRay::origin_in_range(origin) {
        return false;
    }
    let mut rest = mask;
    while rest != 0 {
        let g = (rest.trailing_zeros() & 15) as usize;
        rest &= rest - 1;
        let ([x, y, z], usable) = rays.mapped(simd, map, g);
        let start = f32x16::load_array_ref(simd, &rays.tile.t_min.as_chunks::<GROUP>().0[g]);
        let end = f32x16::load_array_ref(simd, &rays.tile.t_max.as_chunks::<GROUP>().0[g]);
        let mut limit = end;
        if !ANY {
            let per_length =
                f32x16::load_array_ref(simd, &work.iz[g]) * f32x16::load_array_ref(simd, &work.scale[g]);
            limit = (f32x16::splat(simd, LIMIT_SLACK) / per_length).min(end);
        }
        let bits = wanted[g] & (usable & start.simd_lt(limit)).to_bitmask() as u16;
        let lanes = [x.into(), y.into(), z.into(), start.into(), end.into(), limit.into()];
        below.push_group(&lanes, &rays.slot[g * GROUP..(g + 1) * GROUP], bits);
    }
    !below.tile.is_empty()
}

/// A call of its own, so that nesting recurses; it takes the instruction set along.
#[inline(never)]
fn enter<S: Simd, const ANY: bool>(
    simd: S,
    (placed, start): (&PlacedInstance, Child),
    path: PathId,
    rays: Rays<'_>,
    faces: &mut Faces,
    answers: &mut Answers<'_>,
    scratch: &mut Scratch,
) {
    let object = &placed.instance.object;
    simd.vectorize(
        #[inline(always)]
        || run::<S, ANY>(simd, (object, start), path, rays, faces, answers, scratch),
    );
}

/// Brings what an instance found back up: normals, limits, and which slots.
#[expect(
    clippy::too_many_arguments,
    reason = "the rays, what they met and where the answers go; a struct would only rename them"
)]
#[inline(always)]
fn merge<S: Simd, const ANY: bool>(
    simd: S,
    placed: &PlacedInstance,
    rays: Rays<'_>,
    work: &mut Work,
    mask: u16,
    wanted: &[u16; GROUP],
    below: &Slots,
    answers: &mut Answers<'_>,
) {
    if *below == [0; 4] {
        return;
    }
    let mut groups = mask;
    while groups != 0 {
        let g = (groups.trailing_zeros() & 15) as usize;
        groups &= groups - 1;
        let mut rest = wanted[g];
        let mut changed = false;
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            let slot = rays.slot[g * GROUP + lane];
            if !has(below, slot) {
                continue;
            }
            changed = true;
            answers.set(slot);
            if ANY {
                work.iz[g][lane] = f32::INFINITY;
            } else {
                let hit = &mut answers.hits[usize::from(slot)];
                hit.ng = instances::carried(placed, hit.ng);
                let t = hit.t;
                work.settle(rays, g * GROUP + lane, t);
            }
        }
        if changed {
            work.update_reach(simd, g);
        }
    }
    work.update_far(simd);
}
