//! Ray against 8 triangles, watertight [Woop, Benthin and Wald 2013, "Watertight ray/triangle intersection"].
//!
//! Vertices are sheared into a frame in which the ray is the z axis. The result depends on vertex and ray alone,
//! so a shared vertex lands on the same point for all its triangles, and a mesh stays a mesh. Edge functions are
//! computed without fused operations: the two rounded products then compare like the exact ones or come out
//! equal, so a sign is never wrong, only zero at times, and zero counts as inside. Deviation from the paper: no
//! second pass in double precision for the zeros; neighbours may both claim such a ray, but none is lost.
//!
//! The distance is a mean of the corners' with the edge functions as weights. Those of a sliver are mostly rounding, and a
//! ray that leaves it would meet it again: where the distance is in doubt, the precise form decides.
use fearless_simd::{f32x8, prelude::*};

use super::{
    local::LocalRay,
    settle::{self, CLOSE},
    slab,
};
use crate::layout::Block;

/// The roundings in a distance, eight in products of the corners' largest sheared coordinates and their range of depths,
/// over the share of it that is granted.
pub(super) const SLIVER: f32 = 8.0 * f32::EPSILON / (0.5 * CLOSE);

/// A ray set up for triangle tests.
#[derive(Clone, Copy)]
pub(super) struct Shear<S: Simd> {
    /// Axis order: the last is the direction's largest component.
    axes: [usize; 3],
    /// Origin in that order.
    origin: [f32x8<S>; 3],
    /// Shear along x and y, and scale of z.
    shear: [f32x8<S>; 3],
    t_min: f32x8<S>,
    pub ray: LocalRay,
}

impl<S: Simd> Shear<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, ray: &LocalRay) -> Self {
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        let (ax, ay, az) = (d[0].abs(), d[1].abs(), d[2].abs());
        let z = if ax > ay && ax > az {
            0
        } else if ay > az {
            1
        } else {
            2
        };
        let (x, y) = ((z + 1) % 3, (z + 2) % 3);
        let scale = 1.0 / d[z];
        Self::splat(simd, z, [o[x], o[y], o[z]], [-d[x] / d[z], -d[y] / d[z], scale], *ray)
    }

    /// From the largest component's axis, the origin in cyclic order with that axis last, and the shear.
    #[inline(always)]
    pub(super) fn splat(simd: S, z: usize, origin: [f32; 3], shear: [f32; 3], ray: LocalRay) -> Self {
        Self {
            axes: [(z + 1) % 3, (z + 2) % 3, z],
            origin: slab::splat(simd, origin),
            shear: slab::splat(simd, shear),
            t_min: f32x8::splat(simd, ray.t_min),
            ray,
        }
    }

    /// Distances, and a bit for each triangle hit with `t_min < t <= limit`, which is finite.
    #[inline(always)]
    pub(super) fn test(&self, block: &Block, limit: f32x8<S>) -> (f32x8<S>, u32) {
        let (ax, ay, az) = self.vertex(&block.vertex[0]);
        let (bx, by, bz) = self.vertex(&block.vertex[1]);
        let (cx, cy, cz) = self.vertex(&block.vertex[2]);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let lowest = u.min(v).min(w);
        let highest = u.max(v).max(w);
        let simd = self.t_min.token();
        let zero = f32x8::splat(simd, 0.0);
        let inside = lowest.simd_ge(zero) | highest.simd_le(zero);
        if inside.to_bitmask() == 0 {
            return (zero, 0);
        }
        let determinant = u + v + w;
        // u, v and w have one sign, so neither sum cancels: t stays between the corners' distances.
        let depth = u.mul_add(az, v.mul_add(bz, w * cz));
        let t = depth * self.shear[2] / determinant;
        // A zero determinant gives a NaN or an infinite t; NaN fails these tests, and t <= limit fails for ∞.
        let valid = inside & t.simd_gt(self.t_min) & t.simd_le(limit);
        let (x, y) = (ax.abs().max(bx.abs()).max(cx.abs()), ay.abs().max(by.abs()).max(cy.abs()));
        let range = az.max(bz).max(cz) - az.min(bz).min(cz);
        let doubt = (x * y * range * SLIVER).simd_gt(depth.abs()) & inside & !determinant.simd_eq(zero);
        let doubt = doubt.to_bitmask() as u32;
        if doubt != 0 {
            return self.settle(block, limit, t, valid.to_bitmask() as u32, doubt);
        }
        (t, valid.to_bitmask() as u32)
    }

    /// The answer of [`Shear::test`] with precise distances to the triangles in `doubt`.
    #[cold]
    #[inline(never)]
    fn settle(&self, block: &Block, limit: f32x8<S>, t: f32x8<S>, valid: u32, doubt: u32) -> (f32x8<S>, u32) {
        let simd = self.t_min.token();
        let (mut t, limit): ([f32; 8], [f32; 8]) = (t.into(), limit.into());
        let (mut valid, mut rest) = (valid, doubt);
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 7) as usize;
            rest &= rest - 1;
            t[lane] = settle::distance(simd, &self.ray, block.corners(lane));
            let met = t[lane] > self.ray.t_min && t[lane] <= limit[lane];
            valid = valid & !(1 << lane) | u32::from(met) << lane;
        }
        (f32x8::load_array(simd, t), valid)
    }

    #[inline(always)]
    fn vertex(&self, vertex: &[[f32; 8]; 3]) -> (f32x8<S>, f32x8<S>, f32x8<S>) {
        let simd = self.t_min.token();
        let [kx, ky, kz] = self.axes;
        let z = f32x8::load_array_ref(simd, &vertex[kz % 3]) - self.origin[2];
        let x = f32x8::load_array_ref(simd, &vertex[kx % 3]) - self.origin[0];
        let y = f32x8::load_array_ref(simd, &vertex[ky % 3]) - self.origin[1];
        (z.mul_add(self.shear[0], x), z.mul_add(self.shear[1], y), z)
    }
}
