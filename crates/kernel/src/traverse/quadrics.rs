//! One ray through the tree of an object's spheres and cones.
use fearless_simd::{f32x8, prelude::*};

use super::{local::LocalRay, slab::Slab, stack::Stack};
use crate::{
    layout::Child,
    quadric::{Crossing, Quadrics},
    ray::{Hit, PathId},
};

/// The closest shape nearer than `hit.t`; writes `hit` (normal in the object's space) and says whether there was one.
#[inline(always)]
pub(super) fn closest<S: Simd>(
    simd: S,
    quadrics: &Quadrics,
    ray: &LocalRay,
    path: PathId,
    hit: &mut Hit,
    stack: &mut Stack,
) -> bool {
    let Some((index, crossing)) = trace::<S, false>(simd, quadrics, ray, hit.t, stack) else { return false };
    let shape = &quadrics.shapes[index];
    let (ng, [u, v]) = (shape.normal(&crossing), shape.coordinates(crossing.point));
    let (geometry, primitive) = quadrics.names[index];
    *hit = Hit { t: crossing.t, u, v, ng, geometry, primitive, path };
    true
}

/// Whether any shape has `t_min < t < t_max`.
#[inline(always)]
pub(super) fn any<S: Simd>(
    simd: S,
    quadrics: &Quadrics,
    ray: &LocalRay,
    t_max: f32,
    stack: &mut Stack,
) -> bool {
    trace::<S, true>(simd, quadrics, ray, t_max, stack).is_some()
}

/// The closest crossing before `t_max`, or with `ANY` the first one found.
#[inline(always)]
fn trace<S: Simd, const ANY: bool>(
    simd: S,
    quadrics: &Quadrics,
    ray: &LocalRay,
    t_max: f32,
    stack: &mut Stack,
) -> Option<(usize, Crossing)> {
    let nodes = &quadrics.tree.nodes[..];
    if nodes.is_empty() {
        return None;
    }
    let slab = Slab::new(simd, ray, quadrics.tree.extent);
    let mark = stack.mark();
    let (mut best, mut t_max) = (None, t_max);
    let mut current = Child::inner(0);
    loop {
        if current.is_leaf() {
            let index = current.payload() as usize;
            let shape = &quadrics.shapes[index];
            if let Some(crossing) = shape.intersect(ray.origin.into(), ray.direction.into(), ray.t_min, t_max)
            {
                t_max = crossing.t;
                best = Some((index, crossing));
                if ANY {
                    stack.cut(mark);
                    return best;
                }
            }
        } else {
            let node = &nodes[current.0 as usize];
            let (enter, bits) = slab.test(node, f32x8::splat(simd, t_max));
            if bits & bits.wrapping_sub(1) != 0 {
                current = stack.push_sorted(&enter.to_array(), &node.child, bits);
                continue;
            }
            if bits != 0 {
                current = node.child[(bits.trailing_zeros() & 7) as usize];
                continue;
            }
        }
        match stack.pop(mark, t_max) {
            Some(next) => current = next,
            None => return best,
        }
    }
}
