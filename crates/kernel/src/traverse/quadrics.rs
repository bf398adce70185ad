//! One ray through the tree of an object's spheres and cones.
use fearless_simd::{f32x8, prelude::*};

use super::{
    local::{LocalRay, behind},
    slab::Slab,
    stack::Stack,
};
use crate::{
    layout::Child,
    quadric::{Crossing, Quadrics},
    ray::{Hit, PathId},
    through::Panes,
};

/// The closest shape: if it precedes `hit`, writes it there (normal in the object's space) and says so.
#[inline(always)]
pub(super) fn closest<S: Simd>(
    simd: S,
    quadrics: &Quadrics,
    ray: &LocalRay,
    path: PathId,
    hit: &mut Hit,
    stack: &mut Stack,
) -> bool {
    let Some((index, crossing)) =
        trace::<S, false>(simd, quadrics, ray, ray.reach(hit.t), Panes::NONE, &mut false, stack)
    else {
        return false;
    };
    let shape = &quadrics.shapes[index];
    let (ng, [u, v]) = (shape.normal(&crossing), shape.coordinates(crossing.point));
    let (geometry, primitive) = quadrics.names[index];
    let nearest = Hit { t: crossing.t, u, v, ng, geometry, primitive, path };
    let found = nearest.precedes(hit);
    if found {
        *hit = nearest;
    }
    found
}

/// Whether any shape that stops light lies in the ray's interval; `met`: others do.
#[inline(always)]
pub(super) fn any<S: Simd>(
    simd: S,
    quadrics: &Quadrics,
    ray: &LocalRay,
    panes: Panes<'_>,
    met: &mut bool,
    stack: &mut Stack,
) -> bool {
    trace::<S, true>(simd, quadrics, ray, ray.end, panes, met, stack).is_some()
}

/// The closest crossing up to `limit`, or with `ANY` the first one found that stops light.
#[inline(always)]
fn trace<S: Simd, const ANY: bool>(
    simd: S,
    quadrics: &Quadrics,
    ray: &LocalRay,
    limit: f32,
    panes: Panes<'_>,
    met: &mut bool,
    stack: &mut Stack,
) -> Option<(usize, Crossing)> {
    let nodes = &quadrics.tree.nodes[..];
    if nodes.is_empty() {
        return None;
    }
    let slab = Slab::new(simd, ray, &quadrics.tree);
    let mark = stack.mark();
    let (mut best, mut limit) = (None::<(usize, Crossing)>, limit);
    let mut current = Child::inner(0);
    loop {
        if current.is_leaf() {
            let index = current.payload() as usize;
            let shape = &quadrics.shapes[index];
            let crossing =
                shape.intersect(ray.origin.into(), ray.direction.into(), ray.t_min, limit.next_up());
            let precedes = |crossing: &Crossing| {
                let same = best.filter(|(_, best)| best.t == crossing.t);
                same.is_none_or(|(best, _)| quadrics.names[index] < quadrics.names[best])
            };
            if ANY && panes.has(quadrics.names[index].0) {
                *met |= crossing.is_some();
            } else if let Some(crossing) = crossing.filter(precedes) {
                limit = crossing.t;
                best = Some((index, crossing));
                if ANY {
                    stack.cut(mark);
                    return best;
                }
            }
        } else {
            let node = &nodes[current.0 as usize];
            let (enter, bits) = slab.test(node, f32x8::splat(simd, behind(limit)));
            if bits & bits.wrapping_sub(1) != 0 {
                current = stack.push_sorted(&enter.to_array(), &node.child, bits);
                continue;
            }
            if bits != 0 {
                current = node.child[(bits.trailing_zeros() & 7) as usize];
                continue;
            }
        }
        match stack.pop(mark, behind(limit)) {
            Some(next) => current = next,
            None => return best,
        }
    }
}
