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
use fearless_simd::{f32x8, f32x16, mask32x16, prelude::*};

use super::{
    local::LocalRay,
    settle::{self, CLOSE, Lined, Triple, turn},
    slab,
};
use crate::layout::Block;

/// Roundings in a distance, in products of the corners' largest sheared coordinates and their range of depths.
const ROUNDINGS: f32 = 8.0 * f32::EPSILON;
/// The same over the share of the distance that is granted.
const SLIVER: f32 = ROUNDINGS / (0.5 * CLOSE);
/// What the roundings of both forms can be apart, generously: where that leaves no choice, neither is there a doubt. A ray
/// nearly in the plane of a triangle that lies behind it is of that kind, and so are most that leave a surface.
const UNSURE: f32 = 4.0 * ROUNDINGS;

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
        let weight = x * y * range;
        let doubt = (weight * SLIVER).simd_gt(depth.abs()) & inside;
        if doubt.to_bitmask() != 0 {
            let error = (weight * self.shear[2] / determinant).abs() * UNSURE;
            let doubt = doubt & (t + error).simd_gt(self.t_min) & (t - error).simd_le(limit);
            let doubt = doubt.to_bitmask() as u32;
            if doubt != 0 {
                return self.settle(block, limit, t, valid.to_bitmask() as u32, doubt);
            }
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

/// Sixteen rays set up for triangle tests: [`Shear`] with the roles of rays and triangles exchanged, operation by
/// operation, so that both give the same answers.
#[derive(Clone, Copy)]
pub(super) struct Shears<S: Simd> {
    /// The lanes whose direction's largest component is x, and those with y.
    pub turned: [mask32x16<S>; 2],
    pub origin: Triple<S>,
    pub shear: Triple<S>,
}

impl<S: Simd> Shears<S> {
    #[inline(always)]
    pub(super) fn new(simd: S, origin: Triple<S>, direction: Triple<S>) -> Self {
        let size = [direction[0].abs(), direction[1].abs(), direction[2].abs()];
        let x_is_largest = size[0].simd_gt(size[1]) & size[0].simd_gt(size[2]);
        let y_is_largest = !x_is_largest & size[1].simd_gt(size[2]);
        let [x, y, z] = turn(direction, x_is_largest, y_is_largest);
        Self {
            turned: [x_is_largest, y_is_largest],
            origin: turn(origin, x_is_largest, y_is_largest),
            shear: [-x / z, -y / z, f32x16::splat(simd, 1.0) / z],
        }
    }

    /// Distances to a triangle, the `wanted` lanes whose lines meet it, and those of them whose distance is in doubt: it may
    /// lie beyond `t_min`, up to `limit`.
    #[inline(always)]
    pub(super) fn test(
        &self,
        simd: S,
        corners: &[Triple<S>; 3],
        wanted: mask32x16<S>,
        [t_min, limit]: [f32x16<S>; 2],
    ) -> Meeting<S> {
        let (ax, ay, az) = self.corner(corners[0]);
        let (bx, by, bz) = self.corner(corners[1]);
        let (cx, cy, cz) = self.corner(corners[2]);
        let zero = f32x16::splat(simd, 0.0);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let inside = u.min(v).min(w).simd_ge(zero) | u.max(v).max(w).simd_le(zero);
        let inside = inside & wanted;
        if inside.to_bitmask() == 0 {
            return Meeting { t: zero, inside, doubt: inside };
        }
        let determinant = u + v + w;
        let depth = u.mul_add(az, v.mul_add(bz, w * cz));
        let t = depth * self.shear[2] / determinant;
        let (x, y) = (ax.abs().max(bx.abs()).max(cx.abs()), ay.abs().max(by.abs()).max(cy.abs()));
        let range = az.max(bz).max(cz) - az.min(bz).min(cz);
        let weight = x * y * range;
        let mut doubt = (weight * SLIVER).simd_gt(depth.abs()) & inside;
        if doubt.to_bitmask() != 0 {
            let error = (weight * self.shear[2] / determinant).abs() * UNSURE;
            doubt = doubt & (t + error).simd_gt(t_min) & (t - error).simd_le(limit);
        }
        Meeting { t, inside, doubt }
    }

    /// A corner as each ray sees it.
    #[inline(always)]
    fn corner(&self, corner: Triple<S>) -> (f32x16<S>, f32x16<S>, f32x16<S>) {
        let [x, y, z] = turn(corner, self.turned[0], self.turned[1]);
        let (x, y, z) = (x - self.origin[0], y - self.origin[1], z - self.origin[2]);
        (z.mul_add(self.shear[0], x), z.mul_add(self.shear[1], y), z)
    }
}

/// What [`Shears::test`] found.
#[derive(Clone, Copy)]
pub(super) struct Meeting<S: Simd> {
    pub t: f32x16<S>,
    pub inside: mask32x16<S>,
    pub doubt: mask32x16<S>,
}

impl<S: Simd> Meeting<S> {
    /// The distances, precise where they were in doubt.
    #[inline(always)]
    pub(super) fn settled(&self, simd: S, corners: &[Triple<S>; 3], rays: &Lined<f32x16<S>>) -> f32x16<S> {
        if self.doubt.to_bitmask() == 0 {
            return self.t;
        }
        self.doubt.select(settle::exact(simd, *corners, rays).distance, self.t)
    }
}
