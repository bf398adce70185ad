//! Objects with instances: down through the instance tree, and back up with the normal.
use fearless_simd::{f32x8, prelude::*};
use glam::{Mat3A, Vec3, Vec3A};

use super::{Within, local::LocalRay, quadrics, settle, single, slab::Slab, stack::Stack};
use crate::{
    compact::{BlockSource, MovingBlocks},
    kdtree,
    layout::{Child, WIDTH},
    object::{Object, PlacedInstance},
    ray::{Hit, PathId},
    through::{Panes, Screen, Sight},
    triangle_bvh::TriangleBvh,
    triangles::Triangles,
};

/// The closest hit in `object`: if it precedes `hit`, writes it there (normal in the object's space) and says so.
#[inline(always)]
pub(super) fn closest<S: Simd>(
    simd: S,
    (object, start): Within<'_>,
    ray: &LocalRay,
    path: PathId,
    hit: &mut Hit,
    stack: &mut Stack,
) -> bool {
    let mut found = false;
    if let Some(triangles) = &object.triangles
        && let Some(nearest) = closest_triangle(simd, (triangles, start), ray, path, ray.reach(hit.t), stack)
        && nearest.precedes(hit)
    {
        *hit = nearest;
        found = true;
    }
    if let Some(shapes) = &object.quadrics {
        found |= quadrics::closest(simd, shapes, ray, path, hit, stack);
    }
    if !object.instance_tree.wide.nodes.is_empty() {
        found |= closest_instance(simd, object, ray, path, hit, stack);
    }
    found
}

/// The closest of the object's own triangles up to `limit`.
#[inline(always)]
fn closest_triangle<S: Simd>(
    simd: S,
    (triangles, start): (&Triangles, Child),
    ray: &LocalRay,
    path: PathId,
    limit: f32,
    stack: &mut Stack,
) -> Option<Hit> {
    let (corners, (geometry, primitive)) = match triangles {
        Triangles::Bvh(bvh) => {
            let (corners, triangle) = match bvh.moving_blocks(ray.time) {
                None => nearest(simd, (bvh, start), bvh.blocks(), ray, limit, stack)?,
                Some(blocks) => nearest_moving(simd, (bvh, start), blocks, ray, limit, stack)?,
            };
            (corners, bvh.locate(triangle))
        }
        Triangles::KdTree(tree) => {
            let best = kdtree::single::closest(tree, ray.origin, ray.direction, ray.t_min, limit)?;
            (tree.corners()[best as usize], tree.identify(best)?)
        }
    };
    Some(Hit { geometry, primitive, path, ..settle::one(simd, ray, corners) })
}

/// Corners and number of the closest triangle.
type Nearest = ([[f32; 3]; 3], u32);

#[inline(always)]
fn nearest<S: Simd>(
    simd: S,
    (bvh, start): (&TriangleBvh, Child),
    blocks: impl BlockSource,
    ray: &LocalRay,
    limit: f32,
    stack: &mut Stack,
) -> Option<Nearest> {
    let best = single::closest(simd, (bvh, start), blocks, ray, limit, stack)?;
    let mut place = None;
    let (block, lane) = (best.id as usize / WIDTH, best.id as usize % WIDTH);
    let block = blocks.block(block, &mut place);
    Some((block.corners(lane), block.triangle[lane]))
}

/// A call, so that the code around it stays as for trees in which nothing moves.
#[inline(never)]
fn nearest_moving<S: Simd>(
    simd: S,
    tree: (&TriangleBvh, Child),
    blocks: MovingBlocks<'_>,
    ray: &LocalRay,
    limit: f32,
    stack: &mut Stack,
) -> Option<Nearest> {
    simd.vectorize(
        #[inline(always)]
        || nearest(simd, tree, blocks, ray, limit, stack),
    )
}

/// As [`nearest_moving`], for any hit in moving triangles, and past those that let light through.
#[inline(never)]
fn any_apart<S: Simd>(
    simd: S,
    screen: Screen<'_>,
    blocks: impl BlockSource,
    ray: &LocalRay,
    met: &mut bool,
    stack: &mut Stack,
) -> bool {
    simd.vectorize(
        #[inline(always)]
        || single::any::<S, true>(simd, screen, blocks, ray, met, stack),
    )
}

#[inline(always)]
fn closest_instance<S: Simd>(
    simd: S,
    object: &Object,
    ray: &LocalRay,
    path: PathId,
    hit: &mut Hit,
    stack: &mut Stack,
) -> bool {
    let slab = Slab::new(simd, ray, &object.instance_tree.wide);
    closest_instance_below(simd, object, ray, &slab, Child::inner(0), path, hit, stack)
}

/// The closest hit in the instances of the subtree `start`; the rest as in [`closest`].
#[expect(
    clippy::too_many_arguments,
    reason = "a ray set up for boxes, where it begins, and where the answer goes"
)]
#[inline(always)]
pub(super) fn closest_instance_below<S: Simd>(
    simd: S,
    object: &Object,
    ray: &LocalRay,
    slab: &Slab<S>,
    start: Child,
    path: PathId,
    hit: &mut Hit,
    stack: &mut Stack,
) -> bool {
    let nodes = &object.instance_tree.wide.nodes[..];
    let mark = stack.mark();
    let mut found = false;
    let mut current = start;
    loop {
        if current.is_leaf() {
            found |= enter_closest(simd, object.behind(current), ray, path, hit, stack);
        } else {
            let node = &nodes[current.0 as usize];
            let (enter, bits) = slab.test(node, f32x8::splat(simd, ray.reach(hit.t)));
            if bits & bits.wrapping_sub(1) != 0 {
                current = stack.push_sorted(&enter.to_array(), &node.child, bits);
                continue;
            }
            if bits != 0 {
                current = node.child[(bits.trailing_zeros() & 7) as usize];
                continue;
            }
        }
        match stack.pop(mark, ray.reach(hit.t)) {
            Some(next) => current = next,
            None => return found,
        }
    }
}

/// A call of its own, so that nesting recurses; it takes the instruction set along.
#[inline(never)]
fn enter_closest<S: Simd>(
    simd: S,
    (placed, start): (&PlacedInstance, Child),
    ray: &LocalRay,
    path: PathId,
    hit: &mut Hit,
    stack: &mut Stack,
) -> bool {
    let moved = placed.instance.motion.and_then(|_| placed.at(ray.time));
    let object_from_parent = match &moved {
        Some((object_from_parent, _)) => object_from_parent,
        None if placed.instance.motion.is_none() => &placed.object_from_parent,
        None => return false,
    };
    let Some(local) = ray.transformed(object_from_parent) else { return false };
    let path = PathId(path.0 + placed.path_offset);
    let object = &placed.instance.object;
    let found = simd.vectorize(
        #[inline(always)]
        || closest(simd, (object, start), &local, path, hit, stack),
    );
    if found {
        hit.ng = match &moved {
            Some((_, normal_from_object)) => carry_normal(normal_from_object, hit.ng),
            None => carried(placed, hit.ng),
        };
    }
    found
}

/// A unit normal of what is placed, one level up; nothing moves.
#[inline(always)]
pub(super) fn carried(placed: &PlacedInstance, ng: Vec3) -> Vec3 {
    if placed.only_moved { ng } else { carry_normal(&placed.normal_from_object, ng) }
}

/// A unit normal one level up.
#[inline(always)]
fn carry_normal(normal_from_object: &Mat3A, ng: Vec3) -> Vec3 {
    let n = *normal_from_object * Vec3A::from(ng);
    // Scaling by the largest entry first keeps the squares in range for any placement.
    let largest = n.abs().max_element();
    if largest > 0.0 { (n / largest).normalize_or_zero().into() } else { Vec3::ZERO }
}

/// Whether anything in `object` that stops light lies in the ray's interval.
#[inline(always)]
pub(super) fn any<S: Simd>(
    simd: S,
    (object, start): Within<'_>,
    ray: &LocalRay,
    path: PathId,
    sight: &mut Sight<'_>,
    stack: &mut Stack,
) -> bool {
    let panes = Panes::of(sight.through, path);
    let met = &mut sight.met;
    let stopped = match &object.triangles {
        None => false,
        Some(Triangles::Bvh(bvh)) => match bvh.moving_blocks(ray.time) {
            None if panes.is_empty() => {
                single::any::<S, false>(simd, Screen { bvh, start, panes }, bvh.blocks(), ray, met, stack)
            }
            None => any_apart(simd, Screen { bvh, start, panes }, bvh.blocks(), ray, met, stack),
            Some(blocks) => any_apart(simd, Screen { bvh, start, panes }, blocks, ray, met, stack),
        },
        Some(Triangles::KdTree(tree)) => {
            kdtree::single::any(tree, ray.origin, ray.direction, ray.t_min, ray.end, panes, met)
        }
    };
    if stopped {
        return true;
    }
    if let Some(shapes) = &object.quadrics
        && quadrics::any(simd, shapes, ray, panes, met, stack)
    {
        return true;
    }
    !object.instance_tree.wide.nodes.is_empty() && any_instance(simd, object, ray, path, sight, stack)
}

#[inline(always)]
fn any_instance<S: Simd>(
    simd: S,
    object: &Object,
    ray: &LocalRay,
    path: PathId,
    sight: &mut Sight<'_>,
    stack: &mut Stack,
) -> bool {
    let slab = Slab::new(simd, ray, &object.instance_tree.wide);
    any_instance_below(simd, object, ray, &slab, Child::inner(0), path, sight, stack)
}

/// As [`any`], for the instances of the subtree `start`.
#[expect(clippy::too_many_arguments, reason = "a ray set up for boxes, where it begins, and what it meets")]
#[inline(always)]
pub(super) fn any_instance_below<S: Simd>(
    simd: S,
    object: &Object,
    ray: &LocalRay,
    slab: &Slab<S>,
    start: Child,
    path: PathId,
    sight: &mut Sight<'_>,
    stack: &mut Stack,
) -> bool {
    let nodes = &object.instance_tree.wide.nodes[..];
    let limit = f32x8::splat(simd, ray.end);
    let mark = stack.mark();
    let mut current = start;
    loop {
        if current.is_leaf() {
            if enter_any(simd, object.behind(current), ray, path, sight, stack) {
                stack.cut(mark);
                return true;
            }
        } else {
            let node = &nodes[current.0 as usize];
            let (enter, bits) = slab.test(node, limit);
            if bits & bits.wrapping_sub(1) != 0 {
                current = stack.push_sorted(&enter.to_array(), &node.child, bits);
                continue;
            }
            if bits != 0 {
                current = node.child[(bits.trailing_zeros() & 7) as usize];
                continue;
            }
        }
        match stack.pop(mark, ray.end) {
            Some(next) => current = next,
            None => return false,
        }
    }
}

#[inline(never)]
fn enter_any<S: Simd>(
    simd: S,
    (placed, start): (&PlacedInstance, Child),
    ray: &LocalRay,
    path: PathId,
    sight: &mut Sight<'_>,
    stack: &mut Stack,
) -> bool {
    let local = if placed.instance.motion.is_none() {
        ray.transformed(&placed.object_from_parent)
    } else {
        placed.at(ray.time).and_then(|(object_from_parent, _)| ray.transformed(&object_from_parent))
    };
    let Some(local) = local else { return false };
    let path = PathId(path.0 + placed.path_offset);
    let object = &placed.instance.object;
    simd.vectorize(
        #[inline(always)]
        || any(simd, (object, start), &local, path, sight, stack),
    )
}
