//! Ray against the 8 boxes of a node, conservative under rounding.
use fearless_simd::{f32x8, f32x16, mask32x16, prelude::*};

use super::{local::LocalRay, settle::Triple};
use crate::{build::wide::WideTree, layout::Node};

/// Directions this much smaller than the largest component count as this large: 1/d stays finite, and over the
/// length of any scene the ray moves by less than the boxes are padded.
pub(super) const SMALLEST_COMPONENT: f32 = 1.0e-15;
/// Relative widening of the far distance, above 3 roundings of each side [Ize 2013, "Robust BVH ray traversal"].
pub(super) const FAR_SLACK: f32 = 1.0 + 8.0 * f32::EPSILON;
/// Padding of a plane in units of the largest coordinate involved, on any axis: covers the rounding of `o/d`, of
/// the products, and of the shear in the triangle test, none of which shrinks with the distance to the plane.
pub(super) const PLANE_SLACK: f32 = 3.0 * f32::EPSILON;

/// A ray set up for box tests: distance to a plane = `plane / d − o / d`, one fused operation.
#[derive(Clone, Copy)]
pub(super) struct Slab<S: Simd> {
    inverse: [f32x8<S>; 3],
    near_shift: [f32x8<S>; 3],
    far_shift: [f32x8<S>; 3],
    /// Which row of the node's bounds is the near plane; the far one is 3 away.
    near: [usize; 3],
    t_min: f32x8<S>,
}

impl<S: Simd> Slab<S> {
    /// For the boxes of `tree`.
    #[inline(always)]
    pub(super) fn new(simd: S, ray: &LocalRay, tree: &WideTree) -> Self {
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        let reach = tree.reach(ray.origin.abs().max_element());
        let smallest = ray.direction.abs().max_element() * SMALLEST_COMPONENT;
        let (mut inverse, mut near_shift, mut far_shift) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        let mut near = [0; 3];
        for k in 0..3 {
            let inv = 1.0 / d[k].abs().max(smallest).copysign(d[k]);
            let pad = inv.abs() * reach * PLANE_SLACK;
            inverse[k] = inv;
            near_shift[k] = o[k] * inv + pad;
            far_shift[k] = o[k] * inv - pad;
            near[k] = if inv < 0.0 { k + 3 } else { k };
        }
        Self::splat(simd, inverse, near_shift, far_shift, near, ray.t_min)
    }

    /// From what is the same for all boxes.
    #[inline(always)]
    pub(super) fn splat(
        simd: S,
        inverse: [f32; 3],
        near_shift: [f32; 3],
        far_shift: [f32; 3],
        near: [usize; 3],
        t_min: f32,
    ) -> Self {
        Self {
            inverse: splat(simd, inverse),
            near_shift: splat(simd, near_shift),
            far_shift: splat(simd, far_shift),
            near,
            t_min: f32x8::splat(simd, t_min),
        }
    }

    /// Entry distances, and a bit for each child that the ray meets up to `t_max`.
    #[inline(always)]
    pub(super) fn test(&self, node: &Node, t_max: f32x8<S>) -> (f32x8<S>, u32) {
        let simd = self.t_min.token();
        let [x, y, z] = self.near;
        let (fx, fy, fz) = ((x + 3) % 6, (y + 3) % 6, (z + 3) % 6);
        let near_x = plane(simd, &node.bounds[x], self.inverse[0], self.near_shift[0]);
        let near_y = plane(simd, &node.bounds[y], self.inverse[1], self.near_shift[1]);
        let near_z = plane(simd, &node.bounds[z], self.inverse[2], self.near_shift[2]);
        let far_x = plane(simd, &node.bounds[fx], self.inverse[0], self.far_shift[0]);
        let far_y = plane(simd, &node.bounds[fy], self.inverse[1], self.far_shift[1]);
        let far_z = plane(simd, &node.bounds[fz], self.inverse[2], self.far_shift[2]);
        let enter = near_x.max(near_y).max(near_z.max(self.t_min));
        let leave = (far_x.min(far_y).min(far_z) * FAR_SLACK).min(t_max);
        (enter, enter.simd_le(leave).to_bitmask() as u32)
    }
}

/// Sixteen rays set up for box tests: [`Slab`] with the roles of rays and boxes exchanged.
#[derive(Clone, Copy)]
pub(super) struct Slabs<S: Simd> {
    pub inverse: Triple<S>,
    pub near_shift: Triple<S>,
    pub far_shift: Triple<S>,
    /// For each axis, the rays that go down it.
    pub negative: [mask32x16<S>; 3],
    pub t_min: f32x16<S>,
}

impl<S: Simd> Slabs<S> {
    /// Where rays enter box `lane` of a node, and which of them do before `reach`. Unless they are `MIXED`, they have one
    /// octant, for which `near` tells the rows of near planes.
    #[inline(always)]
    pub(super) fn test<const MIXED: bool>(
        &self,
        simd: S,
        node: &Node,
        lane: usize,
        near: [usize; 3],
        reach: f32x16<S>,
    ) -> (f32x16<S>, mask32x16<S>) {
        let mut enter = self.t_min;
        let mut leave = f32x16::splat(simd, f32::INFINITY);
        for (axis, near) in near.into_iter().enumerate() {
            let row = if MIXED { axis } else { near };
            let (mut first, mut last) = (
                f32x16::splat(simd, node.bounds[row % 6][lane & 7]),
                f32x16::splat(simd, node.bounds[(row + 3) % 6][lane & 7]),
            );
            if MIXED {
                let down = self.negative[axis];
                (first, last) = (down.select(last, first), down.select(first, last));
            }
            enter = enter.max(first.mul_sub(self.inverse[axis], self.near_shift[axis]));
            leave = leave.min(last.mul_sub(self.inverse[axis], self.far_shift[axis]));
        }
        let leave = (leave * FAR_SLACK).min(reach);
        (enter, enter.simd_le(leave))
    }
}

#[inline(always)]
fn plane<S: Simd>(simd: S, planes: &[f32; 8], inverse: f32x8<S>, shift: f32x8<S>) -> f32x8<S> {
    f32x8::load_array_ref(simd, planes).mul_sub(inverse, shift)
}

#[inline(always)]
pub(super) fn rows<S: Simd>(simd: S, rows: [&[f32; 8]; 3]) -> [f32x8<S>; 3] {
    [
        f32x8::load_array_ref(simd, rows[0]),
        f32x8::load_array_ref(simd, rows[1]),
        f32x8::load_array_ref(simd, rows[2]),
    ]
}

#[inline(always)]
pub(super) fn splat<S: Simd>(simd: S, v: [f32; 3]) -> [f32x8<S>; 3] {
    [f32x8::splat(simd, v[0]), f32x8::splat(simd, v[1]), f32x8::splat(simd, v[2])]
}
