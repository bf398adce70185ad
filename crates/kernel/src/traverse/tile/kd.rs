//! A tile's rays through a kd-tree, in packets of 16 with equal direction signs.
use fearless_simd::{f32x16, prelude::*};
use glam::Vec3A;

use super::{
    Answers,
    work::{GROUP, LevelRays, Work},
};
use crate::{
    kdtree::{
        KdTree,
        packet::{LANES, Packet, Waiting},
        single,
    },
    ray::{Hit, PathId},
    traverse::{finish, local::LocalRay},
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
    rays: &LevelRays,
    work: &mut Work,
    answers: &mut Answers<'_>,
) {
    let mut waiting = Vec::with_capacity(KdTree::MAX_DEPTH as usize);
    for g in 0..work.groups {
        let found = group::<S, ANY>(simd, tree, rays, work, g, &mut waiting);
        let mut any = false;
        for (lane, (t, index)) in found.into_iter().enumerate() {
            let i = g * GROUP + lane;
            if index == Packet::<S>::NONE || i >= rays.len {
                continue;
            }
            any = true;
            answers.set(rays.slot[i]);
            if ANY {
                work.iz[g][lane] = f32::INFINITY;
            } else {
                let hit = &mut answers.hits[usize::from(rays.slot[i])];
                let ray =
                    LocalRay { origin: rays.origin, direction: rays.direction(i), t_min: rays.t_min[i] };
                *hit = finished(tree, path, &ray, t, index, hit.t);
                work.iz[g][lane] = 1.0 / (hit.t * work.scale[g][lane]);
            }
        }
        if any {
            work.update_reach(simd, g);
        }
    }
    work.update_far(simd);
}

#[inline(always)]
fn finished(tree: &KdTree, path: PathId, ray: &LocalRay, t: f32, index: u32, t_max: f32) -> Hit {
    let exact = finish::exact(ray, tree.corners()[index as usize], t, t_max);
    let (geometry, primitive) = tree.identify(index).unwrap_or_default();
    Hit { t: exact.t, u: exact.u, v: exact.v, ng: exact.normal, geometry, primitive, path }
}

/// What the rays of group `g` found: distance, and index in the tree's store or [`Packet::NONE`].
#[inline(always)]
fn group<S: Simd, const ANY: bool>(
    simd: S,
    tree: &KdTree,
    rays: &LevelRays,
    work: &Work,
    g: usize,
    waiting: &mut Vec<Waiting>,
) -> [(f32, u32); LANES] {
    let [x, y, z] = rays.origin.to_array();
    let origin = [f32x16::splat(simd, x), f32x16::splat(simd, y), f32x16::splat(simd, z)];
    let mut direction = [
        lanes_of(simd, &rays.direction[0], g),
        lanes_of(simd, &rays.direction[1], g),
        lanes_of(simd, &rays.direction[2], g),
    ];
    let used = (rays.len - g * GROUP).min(GROUP);
    let used = ((1_u32 << used) - 1) as u16;
    let lanes = fearless_simd::mask32x16::from_bitmask(simd, u64::from(used));
    let first = rays.direction(g * GROUP).to_array();
    for axis in 0..3 {
        direction[axis] = lanes.select(direction[axis], f32x16::splat(simd, first[axis]));
    }
    let interval =
        [lanes_of(simd, &rays.t_min, g).max(f32x16::splat(simd, 0.0)), lanes_of(simd, &rays.t_max, g)];
    let mut packet = Packet::new(simd, tree, origin, direction, interval, work.face.axes);
    let negative = packet.negative();
    let mut alone = 0;
    let mut rest = used;
    while rest != 0 {
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
            packet.trace::<ANY>(tree, same, signs, waiting);
        }
    }
    let (t, index) = (packet.limit.to_array(), packet.index.to_array());
    let mut found = [(0.0, Packet::<S>::NONE); LANES];
    for lane in 0..LANES {
        found[lane] = (t[lane], index[lane]);
    }
    while alone != 0 {
        let lane = (alone.trailing_zeros() & 15) as usize;
        alone &= alone - 1;
        let i = g * GROUP + lane;
        let origin: Vec3A = rays.origin;
        if let Some(best) =
            single::trace::<ANY>(tree, origin, rays.direction(i), rays.t_min[i].max(0.0), rays.t_max[i])
        {
            found[lane] = (best.t, best.index);
        }
    }
    found
}

#[inline(always)]
fn lanes_of<S: Simd>(simd: S, values: &[f32], g: usize) -> f32x16<S> {
    f32x16::load_array_ref(simd, &values.as_chunks::<LANES>().0[g])
}
