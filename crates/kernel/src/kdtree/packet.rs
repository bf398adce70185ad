//! Sixteen rays through the kd-tree at once: every step loads one node for all of them.
//!
//! The rays share the signs of their directions, and so the order in which cells are met; each has its own interval,
//! and one whose interval is empty waits until the others have left the cell.
//!
//! # References
//! Wald, Slusallek, Benthin and Wagner 2001, "Interactive rendering with coherent ray tracing", section 3.3.
use fearless_simd::{f32x16, mask32x16, prelude::*, u32x16};

use super::{
    KdTree,
    ray::{PLANE_SLACK, SMALLEST_COMPONENT},
};
use crate::through::Panes;

/// Rays of a packet.
pub(crate) const LANES: usize = 16;

type Triple<S> = [f32x16<S>; 3];

/// A far child that waits, with the parts of the rays inside it.
#[repr(C, align(64))]
#[derive(Clone, Debug)]
pub(crate) struct Waiting {
    enter: [f32; LANES],
    leave: [f32; LANES],
    node: u32,
}

/// Sixteen rays set up for the tree, and what they have found so far. Origins may differ; unused lanes hold copies of
/// others and are left out of [`Packet::trace`].
#[derive(Clone, Copy)]
pub(crate) struct Packet<S: Simd> {
    origin: Triple<S>,
    /// 1 / direction, finite.
    inverse: Triple<S>,
    /// Half the thickness of planes in the rays' parameters.
    pad: Triple<S>,
    /// Axis order of the shear.
    axes: [usize; 3],
    /// Shear along the first two axes, and scale of the last.
    shear: Triple<S>,
    t_min: f32x16<S>,
    /// Distances of the nearest hits so far, at first the last ones that count.
    pub limit: f32x16<S>,
    /// Indices of the triangles hit, or [`Packet::NONE`].
    pub index: u32x16<S>,
    /// Bits of the rays that met what lets light through, in queries of any hit.
    pub met: u16,
}

impl<S: Simd> Packet<S> {
    pub(crate) const NONE: u32 = u32::MAX;

    /// Rays over the interval `t_min < t <= limit`, `t_min` not negative. `axes` is a cyclic order whose last axis is at
    /// least a quarter of the largest component of every direction.
    #[inline(always)]
    pub(crate) fn new(
        simd: S,
        tree: &KdTree,
        origin: Triple<S>,
        direction: Triple<S>,
        interval: [f32x16<S>; 2],
        axes: [usize; 3],
    ) -> Self {
        let one = f32x16::splat(simd, 1.0);
        let largest = direction[0].abs().max(direction[1].abs()).max(direction[2].abs());
        let mut reach = f32x16::splat(simd, 0.0);
        for (axis, &from) in origin.iter().enumerate() {
            let lo = f32x16::splat(simd, tree.bounds.min[axis]) - from;
            let hi = f32x16::splat(simd, tree.bounds.max[axis]) - from;
            reach = reach.max(lo.abs()).max(hi.abs());
        }
        let (mut inverse, mut pad) = (direction, direction);
        for axis in 0..3 {
            let size = direction[axis].abs().max(largest * SMALLEST_COMPONENT);
            inverse[axis] = one / size.copysign(direction[axis]);
            pad[axis] = inverse[axis].abs() * (reach * PLANE_SLACK);
        }
        let [x, y, z] = axes;
        let scale = one / direction[z % 3];
        let shear = [-direction[x % 3] * scale, -direction[y % 3] * scale, scale];
        let [t_min, limit] = interval;
        let index = u32x16::splat(simd, Self::NONE);
        Self { origin, inverse, pad, axes, shear, t_min, limit, index, met: 0 }
    }

    /// For each axis the lanes whose direction is negative.
    #[inline(always)]
    pub(crate) fn negative(&self) -> [u16; 3] {
        let zero = f32x16::splat(self.t_min.token(), 0.0);
        let [x, y, z] = self.inverse;
        [
            x.simd_lt(zero).to_bitmask() as u16,
            y.simd_lt(zero).to_bitmask() as u16,
            z.simd_lt(zero).to_bitmask() as u16,
        ]
    }

    /// Finds the closest triangle for each ray of `lanes`; `ANY`: some triangle that is none of `panes`. The directions of all
    /// these rays are negative along the axes whose bit in `negative` is set, and along no other. `waiting` is empty before and after.
    #[inline(always)]
    pub(crate) fn trace<const ANY: bool>(
        &mut self,
        tree: &KdTree,
        lanes: u16,
        negative: u32,
        panes: Panes<'_>,
        waiting: &mut Vec<Waiting>,
    ) {
        let simd = self.t_min.token();
        let nothing = f32x16::splat(simd, -1.0);
        let lanes = mask32x16::from_bitmask(simd, u64::from(lanes));
        let ends = self.limit;
        // Lanes left out want nothing, here and below.
        self.limit = lanes.select(ends, nothing);
        let (mut enter, mut leave) = self.span(tree);
        if tree.nodes.is_empty() || enter.simd_le(leave).to_bitmask() == 0 {
            self.limit = ends;
            return;
        }
        let mut current = 0;
        loop {
            let node = tree.nodes[current as usize];
            if !node.is_leaf() {
                let axis = node.axis() % 3;
                let t = (f32x16::splat(simd, node.split()) - self.origin[axis]) * self.inverse[axis];
                let begin_far = enter.max(t - self.pad[axis]);
                let end_near = leave.min(t + self.pad[axis]);
                let to_near = enter.simd_le(end_near).to_bitmask();
                let to_far = begin_far.simd_le(leave).to_bitmask();
                let upper = negative >> axis & 1;
                let (near, far) = (node.payload() + upper, node.payload() + (upper ^ 1));
                if to_far == 0 {
                    current = near;
                } else if to_near == 0 {
                    current = far;
                } else {
                    waiting.push(Waiting { enter: begin_far.into(), leave: leave.into(), node: far });
                    leave = end_near;
                    current = near;
                }
                continue;
            }
            for &index in &tree.references[node.range()] {
                self.test::<ANY>(tree, index, panes);
            }
            loop {
                let Some(next) = waiting.pop() else {
                    self.limit = lanes.select(self.limit, ends);
                    return;
                };
                enter = f32x16::load_array_ref(simd, &next.enter);
                leave = f32x16::load_array_ref(simd, &next.leave).min(self.limit);
                if enter.simd_le(leave).to_bitmask() != 0 {
                    current = next.node;
                    break;
                }
            }
        }
    }

    /// Where the rays are inside the tree's bounds, widened, up to their limits.
    #[inline(always)]
    fn span(&self, tree: &KdTree) -> (f32x16<S>, f32x16<S>) {
        let simd = self.t_min.token();
        let (mut enter, mut leave) = (self.t_min, self.limit);
        for axis in 0..3 {
            let a = (f32x16::splat(simd, tree.bounds.min[axis]) - self.origin[axis]) * self.inverse[axis];
            let b = (f32x16::splat(simd, tree.bounds.max[axis]) - self.origin[axis]) * self.inverse[axis];
            enter = enter.max(a.min(b) - self.pad[axis]);
            leave = leave.min(a.max(b) + self.pad[axis]);
        }
        (enter, leave)
    }

    /// All rays against one triangle: the test of `traverse/shear.rs` with rays in the lanes.
    #[inline(always)]
    fn test<const ANY: bool>(&mut self, tree: &KdTree, index: u32, panes: Panes<'_>) {
        let simd = self.t_min.token();
        let corners = &tree.corners[index as usize];
        let [ax, ay, az] = self.sheared(&corners[0]);
        let [bx, by, bz] = self.sheared(&corners[1]);
        let [cx, cy, cz] = self.sheared(&corners[2]);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let zero = f32x16::splat(simd, 0.0);
        let inside = u.min(v).min(w).simd_ge(zero) | u.max(v).max(w).simd_le(zero);
        if inside.to_bitmask() == 0 {
            return;
        }
        let t = (u * az + v * bz + w * cz) * self.shear[2] / (u + v + w);
        let mut hit = inside & t.simd_gt(self.t_min) & t.simd_le(self.limit);
        if !ANY {
            // A triangle in several leaves is no tie.
            let other = self.index.simd_ne(u32x16::splat(simd, index));
            let tied = (hit & t.simd_eq(self.limit) & other).to_bitmask() as u16;
            if tied != 0 {
                let kept = keeping(tree, &self.index.into(), tied, index);
                hit &= !mask32x16::from_bitmask(simd, u64::from(kept));
            }
        }
        if ANY && tree.lets_through(index, panes) {
            self.met |= hit.to_bitmask() as u16;
            return;
        }
        // A ray that wants nothing more ends before it begins.
        let limit = if ANY { f32x16::splat(simd, -1.0) } else { t };
        self.limit = hit.select(limit, self.limit);
        self.index = hit.select(u32x16::splat(simd, index), self.index);
    }

    #[inline(always)]
    fn sheared(&self, corner: &[f32; 3]) -> Triple<S> {
        let simd = self.t_min.token();
        let [x, y, z] = self.axes;
        let depth = f32x16::splat(simd, corner[z % 3]) - self.origin[z % 3];
        let across = f32x16::splat(simd, corner[x % 3]) - self.origin[x % 3];
        let along = f32x16::splat(simd, corner[y % 3]) - self.origin[y % 3];
        [depth.mul_add(self.shear[0], across), depth.mul_add(self.shear[1], along), depth]
    }
}

/// The lanes in `tied` that keep what they have, at the distance of triangle `index`: it has the lesser number.
#[cold]
#[inline(never)]
fn keeping(tree: &KdTree, indices: &[u32; LANES], tied: u16, index: u32) -> u16 {
    let number = |index: u32| tree.numbers.get(index as usize).copied().unwrap_or(u32::MAX);
    let keeps = |lane: usize| tied >> lane & 1 == 1 && number(indices[lane]) <= number(index);
    (0..LANES).filter(|&lane| keeps(lane)).fold(0, |kept, lane| kept | 1 << lane)
}
