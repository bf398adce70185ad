//! A tile's rays through a kd-tree, in packets of 16 with equal direction signs.
use fearless_simd::{f32x16, prelude::*};

use super::{
    Answers, collect,
    work::{GROUP, Rays, Work, mask16},
};
use crate::{
    kdtree::{
        KdTree,
        packet::{LANES, Packet, Waiting},
        single,
    },
    ray::{Hit, PathId},
    through::Panes,
    traverse::{
        local::{LocalRay, before},
        settle,
    },
};

const _: () = assert!(LANES == GROUP);

/// Fewer rays than this with the same signs are traced singly.
const FEW_RAYS: u32 = 3;

/// Answers all of `rays` against `tree` and tells `work` what they found, for the instances to come.
#[inline(always)]
pub(super) fn triangles<S: Simd, const ANY: bool>(
    simd: S,
    tree: &KdTree,
    path: PathId,
    rays: Rays<'_>,
    work: &mut Work,
    answers: &mut Answers<'_>,
) {
    let panes = if ANY { Panes::of(answers.through, path) } else { Panes::NONE };
    let mut waiting = Vec::with_capacity(KdTree::MAX_DEPTH as usize);
    for g in 0..work.groups {
        let found = group::<S, ANY>(simd, tree, panes, rays, work, g, &mut waiting);
        let mut any = false;
        for (lane, found) in found.into_iter().enumerate() {
            let i = g * GROUP + lane;
            if found == Packet::<S>::NONE || i >= rays.len {
                continue;
            }
            any = true;
            if ANY {
                answers.set(rays.slot[i]);
                work.iz[g][lane] = f32::INFINITY;
            } else {
                let t = answers.merge(rays.slot[i], finished(simd, tree, path, rays.ray(i), found));
                work.settle(rays, i, t);
            }
        }
        if any {
            work.update_reach(simd, g);
        }
    }
    collect::met(rays, work, answers);
    work.update_far(simd);
}

#[inline(always)]
fn finished<S: Simd>(simd: S, tree: &KdTree, path: PathId, ray: LocalRay, index: u32) -> Hit {
    let (geometry, primitive) = tree.identify(index).unwrap_or_default();
    Hit { geometry, primitive, path, ..settle::one(simd, &ray, tree.corners()[index as usize]) }
}

/// What the rays of group `g` found: indices in the tree's store, or [`Packet::NONE`].
#[inline(always)]
fn group<S: Simd, const ANY: bool>(
    simd: S,
    tree: &KdTree,
    panes: Panes<'_>,
    rays: Rays<'_>,
    work: &mut Work,
    g: usize,
    waiting: &mut Vec<Waiting>,
) -> [u32; LANES] {
    let used = ((1_u32 << (rays.len - g * GROUP).min(GROUP)) - 1) as u16;
    let mut packet = packet(simd, tree, rays, work, g, used);
    let negative = packet.negative();
    let mut alone = 0;
    let mut rest = used;
    while rest != 0 {
        // The first ray that is left, and those with the same signs.
        let lane = rest.trailing_zeros() & 15;
        let (mut same, mut signs) = (rest, 0);
        for (axis, negative) in negative.into_iter().enumerate() {
            let sign = negative >> lane & 1;
            signs |= u32::from(sign) << axis;
            same &= if sign == 1 { negative } else { !negative };
        }
        rest &= !same;
        if same.count_ones() < FEW_RAYS {
            alone |= same;
        } else {
            packet.trace::<ANY>(tree, same, signs, panes, waiting);
        }
    }
    let mut found = packet.index.to_array();
    work.met[g] = packet.met;
    while alone != 0 {
        let lane = (alone.trailing_zeros() & 15) as usize;
        alone &= alone - 1;
        let ray = rays.ray(g * GROUP + lane);
        let limit = before(rays.limit[g * GROUP + lane]);
        let LocalRay { origin, direction, t_min, .. } = ray;
        if ANY {
            let mut met = false;
            if single::any(tree, origin, direction, t_min, limit, panes, &mut met) {
                found[lane] = 0;
            }
            work.met[g] |= u16::from(met) << lane;
        } else if let Some(best) = single::closest(tree, origin, direction, t_min, limit) {
            found[lane] = best;
        }
    }
    found
}

/// The rays of group `g` in lanes; lanes that are not `used` repeat the first direction.
#[inline(always)]
fn packet<S: Simd>(simd: S, tree: &KdTree, rays: Rays<'_>, work: &Work, g: usize, used: u16) -> Packet<S> {
    let lanes = mask16(simd, used);
    let first = rays.direction(g * GROUP).to_array();
    let [x, y, z] = rays.origin.to_array();
    let origin = [f32x16::splat(simd, x), f32x16::splat(simd, y), f32x16::splat(simd, z)];
    let mut direction = origin;
    for (axis, direction) in direction.iter_mut().enumerate() {
        let own = lanes_of(simd, &rays.tile.direction[axis], g);
        *direction = lanes.select(own, f32x16::splat(simd, first[axis]));
    }
    // Limits count for the packet, and not for the rays.
    let before = f32x16::from_bits(lanes_of(simd, rays.limit, g).to_bits() - 1);
    let interval = [lanes_of(simd, &rays.tile.t_min, g), before];
    Packet::new(simd, tree, origin, direction, interval, work.face.axes)
}

#[inline(always)]
fn lanes_of<S: Simd>(simd: S, values: &[f32], g: usize) -> f32x16<S> {
    f32x16::load_array_ref(simd, &values.as_chunks::<LANES>().0[g])
}
