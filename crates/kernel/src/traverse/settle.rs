//! From the triangles that 16 rays settled on to hits: the intersection again, in the form that is precise near the
//! ray rather than cheap for many [Woop, Benthin and Wald 2013].
use fearless_simd::{f32x16, prelude::*, u32x16};
use glam::Vec3;

use crate::{
    ray::{Hit, PathId},
    triangle_bvh::TriangleBvh,
};

pub(super) const LANES: usize = 16;

pub(super) type Lanes = [f32; LANES];
pub(super) type Triple<S> = [f32x16<S>; 3];

/// Each lane's triangle.
#[repr(C, align(64))]
pub(super) struct Gathered {
    /// `corners[corner][axis][lane]`; the axes in cyclic order, the one along which the ray is projected last.
    pub corners: [[Lanes; 3]; 3],
    pub geometry: [u32; LANES],
    pub primitive: [u32; LANES],
}

impl Gathered {
    pub(super) const EMPTY: Self =
        Self { corners: [[[0.0; LANES]; 3]; 3], geometry: [0; LANES], primitive: [0; LANES] };
}

/// How 16 rays are seen along their last axis.
#[derive(Clone, Copy)]
pub(super) struct Projection<S: Simd> {
    /// In the axis order of the corners.
    pub origin: Triple<S>,
    /// Direction over its last component.
    pub u: f32x16<S>,
    pub v: f32x16<S>,
    /// Ray parameter per unit along the last axis.
    pub scale: f32x16<S>,
    /// What stands if the triangle has no width along the ray.
    pub t: f32x16<S>,
    /// The open interval in which the answer must lie.
    pub t_min: f32x16<S>,
    pub t_max: f32x16<S>,
}

/// Distance and barycentrics, and the unit normal in the axis order of the corners.
pub(super) struct Exact<S: Simd> {
    pub t: f32x16<S>,
    pub u: f32x16<S>,
    pub v: f32x16<S>,
    pub normal: Triple<S>,
}

/// Intersects 16 rays with a triangle each.
#[inline(always)]
pub(super) fn exact<S: Simd>(simd: S, corners: &[[Lanes; 3]; 3], rays: &Projection<S>) -> Exact<S> {
    let a = relative(simd, &corners[0], rays.origin);
    let b = relative(simd, &corners[1], rays.origin);
    let c = relative(simd, &corners[2], rays.origin);
    // Each corner as seen along the ray, then the weights of the corners.
    let (ax, ay) = (a[0] - rays.u * a[2], a[1] - rays.v * a[2]);
    let (bx, by) = (b[0] - rays.u * b[2], b[1] - rays.v * b[2]);
    let (cx, cy) = (c[0] - rays.u * c[2], c[1] - rays.v * c[2]);
    let (w0, w1, w2) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
    let zero = f32x16::splat(simd, 0.0);
    let one = f32x16::splat(simd, 1.0);
    let side = one.copysign(w0 + w1 + w2);
    let (w0, w1, w2) = ((w0 * side).max(zero), (w1 * side).max(zero), (w2 * side).max(zero));
    let sum = w0 + w1 + w2;
    let thin = sum.simd_eq(zero);
    let inverse = one / thin.select(one, sum);
    let third = f32x16::splat(simd, 1.0 / 3.0);
    let u = thin.select(third, w1 * inverse).min(one);
    let v = thin.select(third, w2 * inverse).min(one - u);
    let depth = (w0 * a[2] + w1 * b[2] + w2 * c[2]) * inverse;
    let t = inside(thin.select(rays.t, depth * rays.scale), rays.t_min, rays.t_max);
    Exact { t, u, v, normal: normal(simd, sub(b, a), sub(c, a)) }
}

/// The eight words of 16 hits before the path, hit after hit.
#[repr(C, align(64))]
pub(super) struct Words([Lanes; 8]);

impl Words {
    #[inline(always)]
    pub(super) fn hit(&self, lane: usize, path: PathId) -> Hit {
        let [t, u, v, x, y, z, geometry, primitive] = self.0.as_flattened().as_chunks::<8>().0[lane & 15];
        Hit {
            t,
            u,
            v,
            ng: Vec3::new(x, y, z),
            geometry: geometry.to_bits(),
            primitive: primitive.to_bits(),
            path,
        }
    }
}

/// The mesh that the last triangle was in: neighbouring rays mostly share it.
#[derive(Default)]
pub(super) struct MeshOf {
    geometry: u32,
    start: u32,
    len: u32,
}

impl MeshOf {
    /// As [`TriangleBvh::locate`], with a short cut for triangles of the same mesh as before.
    #[inline(always)]
    pub(super) fn locate(&mut self, bvh: &TriangleBvh, triangle: u32) -> (u32, u32) {
        let within = triangle.wrapping_sub(self.start);
        if within < self.len {
            return (self.geometry, within);
        }
        let (geometry, primitive) = bvh.locate(triangle);
        *self = Self { geometry, start: triangle - primitive, len: bvh.mesh_len(geometry) };
        (geometry, primitive)
    }
}

impl Words {
    /// The hits of 16 rays; the normal in the object's axis order.
    #[inline(always)]
    pub(super) fn new<S: Simd>(simd: S, exact: &Exact<S>, normal: Triple<S>, gathered: &Gathered) -> Self {
        let [x, y, z] = normal;
        let (geometry, primitive) = (as_float(simd, &gathered.geometry), as_float(simd, &gathered.primitive));
        transpose([exact.t, exact.u, exact.v, x, y, z, geometry, primitive])
    }
}

#[inline(always)]
fn as_float<S: Simd>(simd: S, bits: &[u32; LANES]) -> f32x16<S> {
    u32x16::load_array_ref(simd, bits).bitcast()
}

/// From eight words of 16 hits each to 16 hits of eight words: a perfect shuffle, three times.
#[inline(always)]
fn transpose<S: Simd>(words: [f32x16<S>; 8]) -> Words {
    let mut words = words;
    for _ in 0..3 {
        let [a, b, c, d, e, f, g, h] = words;
        let ((a, e), (b, f), (c, g), (d, h)) =
            (a.interleave(e), b.interleave(f), c.interleave(g), d.interleave(h));
        words = [a, e, b, f, c, g, d, h];
    }
    let [a, b, c, d, e, f, g, h] = words;
    Words([a.into(), b.into(), c.into(), d.into(), e.into(), f.into(), g.into(), h.into()])
}

/// The unit vector along `e1 × e2`. Axis orders are cyclic, so the cross product keeps its sense.
#[inline(always)]
fn normal<S: Simd>(simd: S, e1: Triple<S>, e2: Triple<S>) -> Triple<S> {
    let x = product_difference(e1[1], e2[2], e1[2], e2[1]);
    let y = product_difference(e1[2], e2[0], e1[0], e2[2]);
    let z = product_difference(e1[0], e2[1], e1[1], e2[0]);
    // Scaled first, so that squares neither overflow nor vanish.
    let largest = x.abs().max(y.abs()).max(z.abs()).max(f32x16::splat(simd, f32::MIN_POSITIVE));
    let scale = f32x16::splat(simd, 1.0) / largest;
    let (x, y, z) = (x * scale, y * scale, z * scale);
    let length = (x * x + y * y + z * z).sqrt();
    let usable = length.simd_gt(f32x16::splat(simd, 0.0));
    let inverse = f32x16::splat(simd, 1.0) / usable.select(length, f32x16::splat(simd, 1.0));
    [x * inverse, y * inverse, z * inverse]
}

/// `ab − cd` with the second product's rounding error put back (Kahan): thin triangles keep their normal.
#[inline(always)]
fn product_difference<S: Simd>(a: f32x16<S>, b: f32x16<S>, c: f32x16<S>, d: f32x16<S>) -> f32x16<S> {
    let cd = c * d;
    let error = (-c).mul_add(d, cd);
    a.mul_sub(b, cd) + error
}

#[inline(always)]
fn relative<S: Simd>(simd: S, corner: &[Lanes; 3], origin: Triple<S>) -> Triple<S> {
    [
        f32x16::load_array_ref(simd, &corner[0]) - origin[0],
        f32x16::load_array_ref(simd, &corner[1]) - origin[1],
        f32x16::load_array_ref(simd, &corner[2]) - origin[2],
    ]
}

#[inline(always)]
fn sub<S: Simd>(a: Triple<S>, b: Triple<S>) -> Triple<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `t` moved into the open interval, from which rounding may have pushed it.
#[inline(always)]
fn inside<S: Simd>(t: f32x16<S>, t_min: f32x16<S>, t_max: f32x16<S>) -> f32x16<S> {
    let one = u32x16::splat(t.token(), 1);
    // The next float: those that are not negative are ordered like their bits, once −0 is 0.
    let after_start = (t_min.abs().bitcast::<u32x16<S>>() + one).bitcast::<f32x16<S>>();
    let before_end = (t_max.bitcast::<u32x16<S>>() - one).bitcast::<f32x16<S>>();
    let t = t.simd_le(t_min).select(after_start, t);
    t.simd_ge(t_max).select(before_end, t)
}
