//! One ray through the kd-tree, from front to back.
use glam::Vec3A;

use super::{KdTree, ray::KdRay};
use crate::through::Panes;

/// A power of two above the depth of any tree.
const STACK: usize = 64;
const _: () = assert!(STACK >= KdTree::MAX_DEPTH as usize);

/// A far child that waits, with the part of the ray inside it.
#[derive(Clone, Copy, Debug, Default)]
struct Waiting {
    node: u32,
    enter: f32,
    leave: f32,
}

/// The index, in the tree's store, of the closest triangle with `t_min < t <= limit`, of several the one with the least
/// number. The ray must be finite, with a direction whose largest component is within 1e-12..=1e12, and `t_min` not
/// negative.
#[inline(always)]
pub(crate) fn closest(tree: &KdTree, origin: Vec3A, direction: Vec3A, t_min: f32, limit: f32) -> Option<u32> {
    trace::<false>(tree, origin, direction, t_min, limit, Panes::NONE, &mut false)
}

/// Whether some triangle with `t_min < t <= limit` stops the ray; `met`: one in `panes` did not. The rest as in
/// [`closest`].
#[inline(always)]
pub(crate) fn any(
    tree: &KdTree,
    origin: Vec3A,
    direction: Vec3A,
    t_min: f32,
    limit: f32,
    panes: Panes<'_>,
    met: &mut bool,
) -> bool {
    trace::<true>(tree, origin, direction, t_min, limit, panes, met).is_some()
}

/// [`closest`], or with `ANY` the first one found that stops the ray.
///
/// # References
/// Wald 2004, "Realtime ray tracing and interactive global illumination", section 7.2.1. Deviation: planes are a few
/// rounding errors thick, and rays pass on both sides of them inside that thickness.
#[inline(always)]
fn trace<const ANY: bool>(
    tree: &KdTree,
    origin: Vec3A,
    direction: Vec3A,
    t_min: f32,
    limit: f32,
    panes: Panes<'_>,
    met: &mut bool,
) -> Option<u32> {
    if tree.nodes.is_empty() {
        return None;
    }
    let ray = KdRay::new(tree, origin, direction, t_min);
    let (mut enter, mut leave) = ray.span(tree, limit);
    if enter > leave {
        return None;
    }
    let mut waiting = [Waiting::default(); STACK];
    let mut height = 0;
    let mut best = None;
    let mut limit = limit;
    let mut current = 0;
    loop {
        let node = tree.nodes[current as usize];
        if !node.is_leaf() {
            let axis = node.axis() % 3;
            let t = (node.split() - ray.origin[axis]) * ray.inverse[axis];
            let (begin_far, end_near) = (t - ray.pad[axis], t + ray.pad[axis]);
            let upper = ray.negative >> axis & 1;
            let (near, far) = (node.payload() + upper, node.payload() + (upper ^ 1));
            if begin_far > leave {
                current = near;
            } else if end_near < enter {
                current = far;
            } else {
                // The tree is no deeper than the stack; the remainder tells the compiler so.
                waiting[height % STACK] = Waiting { node: far, enter: begin_far.max(enter), leave };
                height += 1;
                leave = end_near.min(leave);
                current = near;
            }
            continue;
        }
        for &index in &tree.references[node.range()] {
            if let Some(t) = ray.test(&tree.corners[index as usize], limit) {
                if ANY && tree.lets_through(index, panes) {
                    *met = true;
                    continue;
                }
                if t == limit && !yields(tree, best, index) {
                    continue;
                }
                limit = t;
                best = Some(index);
                if ANY {
                    return best;
                }
            }
        }
        loop {
            if height == 0 {
                return best;
            }
            height -= 1;
            let next = waiting[height % STACK];
            if next.enter <= limit {
                (current, enter, leave) = (next.node, next.enter, next.leave.min(limit));
                break;
            }
        }
    }
}

/// Whether triangle `index` at the same distance is to be kept instead.
#[cold]
#[inline(never)]
fn yields(tree: &KdTree, best: Option<u32>, index: u32) -> bool {
    best.is_none_or(|best| tree.numbers[index as usize] < tree.numbers[best as usize])
}
