//! From the triangles that rays settled on to hits: the intersection again, in the form that is precise near the ray
//! rather than cheap for many [Woop, Benthin and Wald 2013].
use fearless_simd::{Level, f32x4, f32x16, prelude::*, u32x16};
use glam::Vec3;

use super::local::LocalRay;
use crate::{
    compact::BlockSource,
    layout::{Block, WIDTH},
    ray::{Hit, PathId},
    triangle_bvh::TriangleBvh,
};

pub(super) const LANES: usize = 16;

/// Distances that walks go by are compared in the precise form where they are closer to each other than this share:
/// roundings of two arithmetics, each below half of it, could tell either way.
pub(super) const CLOSE: f32 = 1.0 / 16384.0;

pub(super) type Lanes = [f32; LANES];
pub(super) type Triple<S> = [f32x16<S>; 3];

/// Each lane's triangle.
pub(super) struct Gathered<S: Simd> {
    /// `corners[corner][axis]`.
    pub corners: [Triple<S>; 3],
    geometry: u32x16<S>,
    primitive: u32x16<S>,
}

/// Rays of a width `V`, one per lane.
#[derive(Clone, Copy)]
pub(super) struct Lined<V> {
    pub origin: [V; 3],
    pub direction: [V; 3],
    /// The answer must lie behind this,
    pub t_min: V,
    /// and no farther than this.
    pub end: V,
}

/// Distance, barycentrics and unit normal.
#[derive(Clone, Copy)]
pub(super) struct Exact<V> {
    /// In the ray's interval, from which rounding may have pushed what was computed.
    pub t: V,
    /// As computed.
    pub distance: V,
    pub u: V,
    pub v: V,
    pub normal: [V; 3],
}

/// Intersects each ray with its triangle, `corners[corner][axis]`. The answer depends on the ray and the triangle alone,
/// bit for bit, so that distances can be compared whatever walk they come from.
#[inline(always)]
pub(super) fn exact<S: Simd, V>(simd: S, corners: [[V; 3]; 3], rays: &Lined<V>) -> Exact<V>
where
    V: SimdFloat<S, Element = f32>,
    V::Bits: SimdInt<S, Element = u32>,
{
    let zero = V::splat(simd, 0.0);
    let one = V::splat(simd, 1.0);
    let a = sub(corners[0], rays.origin);
    let b = sub(corners[1], rays.origin);
    let c = sub(corners[2], rays.origin);
    let normal = normal(simd, sub(b, a), sub(c, a));
    let plane = plane(simd, normal, a, rays.direction);
    let size = [rays.direction[0].abs(), rays.direction[1].abs(), rays.direction[2].abs()];
    let x_is_largest = size[0].simd_gt(size[1]) & size[0].simd_gt(size[2]);
    let y_is_largest = !x_is_largest & size[1].simd_gt(size[2]);
    // Seen along the largest component, which comes last.
    let direction = turn(rays.direction, x_is_largest, y_is_largest);
    let a = turn(a, x_is_largest, y_is_largest);
    let b = turn(b, x_is_largest, y_is_largest);
    let c = turn(c, x_is_largest, y_is_largest);
    let scale = one / direction[2];
    let (across, along) = (direction[0] * scale, direction[1] * scale);
    // Each corner as seen along the ray, then the weights of the corners.
    let (ax, ay) = (a[0] - across * a[2], a[1] - along * a[2]);
    let (bx, by) = (b[0] - across * b[2], b[1] - along * b[2]);
    let (cx, cy) = (c[0] - across * c[2], c[1] - along * c[2]);
    let (w0, w1, w2) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
    let side = one.copysign(w0 + w1 + w2);
    let (w0, w1, w2) = ((w0 * side).max(zero), (w1 * side).max(zero), (w2 * side).max(zero));
    let sum = w0 + w1 + w2;
    // No width along the ray: the middle will do.
    let thin = sum.simd_eq(zero);
    let inverse = one / thin.select(one, sum);
    let third = V::splat(simd, 1.0 / 3.0);
    let u = thin.select(third, w1 * inverse).min(one);
    let v = thin.select(third, w2 * inverse).min(one - u);
    let depth = (w0 * a[2] + w1 * b[2] + w2 * c[2]) * inverse;
    let depth = thin.select((a[2] + b[2] + c[2]) * third, depth);
    // The weights of slivers are mostly rounding: where the plane is met is then known better.
    let (nearest, farthest) = (a[2].min(b[2]).min(c[2]), a[2].max(b[2]).max(c[2]));
    let (x, y) = (ax.abs().max(bx.abs()).max(cx.abs()), ay.abs().max(by.abs()).max(cy.abs()));
    let error = x * y * (farthest - nearest) * inverse * (8.0 * f32::EPSILON);
    let [met, off] = plane;
    let better = (off * direction[2].abs()).simd_lt(error) & !thin;
    let met = (met * direction[2]).max(nearest).min(farthest);
    let distance = better.select(met, depth) * scale;
    Exact { t: inside(distance, rays.t_min, rays.end), distance, u, v, normal: unit(simd, normal) }
}

/// Where rays meet the plane through `a`, relative to their origins, and the error of that.
#[inline(always)]
fn plane<S: Simd, V: SimdFloat<S, Element = f32>>(
    simd: S,
    normal: [V; 3],
    a: [V; 3],
    direction: [V; 3],
) -> [V; 2] {
    let [ax, ay, az] = [normal[0] * a[0], normal[1] * a[1], normal[2] * a[2]];
    let [dx, dy, dz] = [normal[0] * direction[0], normal[1] * direction[1], normal[2] * direction[2]];
    let inverse = V::splat(simd, 1.0) / (dx + dy + dz);
    let met = (ax + ay + az) * inverse;
    let sizes = (ax.abs() + ay.abs() + az.abs()) + met.abs() * (dx.abs() + dy.abs() + dz.abs());
    [met, sizes * inverse.abs() * (4.0 * f32::EPSILON)]
}

/// As [`exact`], for one ray; hits without names.
#[inline(always)]
pub(super) fn one<S: Simd>(simd: S, ray: &LocalRay, corners: [[f32; 3]; 3]) -> Hit {
    let Exact { t, u, v, normal: [x, y, z], .. } = exact_of(simd, ray, [corners; 2]);
    Hit { t: t[0], u: u[0], v: v[0], ng: Vec3::new(x[0], y[0], z[0]), ..Hit::MISS }
}

/// The precise distance to a triangle that the ray's line meets, wherever the ray begins and ends.
#[cold]
#[inline(never)]
pub(super) fn distance<S: Simd>(simd: S, ray: &LocalRay, corners: [[f32; 3]; 3]) -> f32 {
    simd.vectorize(
        #[inline(always)]
        || exact_of(simd, ray, [corners; 2]).distance[0],
    )
}

/// One ray in two triangles.
#[inline(always)]
fn exact_of<S: Simd>(simd: S, ray: &LocalRay, [one, two]: [[[f32; 3]; 3]; 2]) -> Exact<f32x4<S>> {
    let mut lanes = [[f32x4::splat(simd, 0.0); 3]; 3];
    for (corner, lanes) in lanes.iter_mut().enumerate() {
        for (axis, lanes) in lanes.iter_mut().enumerate() {
            let (one, two) = (one[corner][axis], two[corner][axis]);
            *lanes = f32x4::load_array(simd, [one, two, one, two]);
        }
    }
    let rays = Lined {
        origin: splat(simd, ray.origin.to_array()),
        direction: splat(simd, ray.direction.to_array()),
        t_min: f32x4::splat(simd, ray.t_min),
        end: f32x4::splat(simd, ray.end),
    };
    exact(simd, lanes, &rays)
}

/// Whether triangle `id`, `block · 8 + lane`, is the ray's hit rather than triangle `best`: hits are ordered by precise
/// distance, then by number. Trees with split triangles come here often, with one triangle twice.
#[cold]
#[inline(never)]
pub(super) fn precedes<S: Simd>(
    simd: S,
    blocks: impl BlockSource,
    ray: &LocalRay,
    id: u32,
    best: u32,
) -> bool {
    let (number, other) = (blocks.number(id), blocks.number(best));
    if number == other {
        return false;
    }
    simd.vectorize(
        #[inline(always)]
        || {
            let (mut place, mut place_of_best) = (None, None);
            let one = blocks.block(id as usize / WIDTH, &mut place).corners(id as usize % WIDTH);
            let two = blocks.block(best as usize / WIDTH, &mut place_of_best).corners(best as usize % WIDTH);
            let t = exact_of(simd, ray, [one, two]).t;
            t[0] < t[1] || (t[0] == t[1] && number < other)
        },
    )
}

/// As [`precedes`], for the lanes in `bits`, each with its own `best`; returns those in which triangle `id` comes first.
#[inline(always)]
pub(super) fn precede<S: Simd>(
    simd: S,
    blocks: impl BlockSource,
    rays: &Lined<f32x16<S>>,
    id: u32,
    best: &[u32; LANES],
    bits: u16,
) -> u16 {
    let t = exact(simd, corners(simd, blocks, id), rays).t;
    let (others, numbers) = gather_corners(simd, blocks, best, bits);
    let of_best = exact(simd, others, rays).t;
    let earlier = numbers.simd_gt(u32x16::splat(simd, blocks.number(id)));
    let first = t.simd_lt(of_best) | (t.simd_eq(of_best) & earlier);
    first.to_bitmask() as u16 & bits
}

/// Triangle `id`, `block · 8 + lane`, for all lanes.
#[inline(always)]
pub(super) fn corners<S: Simd>(simd: S, blocks: impl BlockSource, id: u32) -> [Triple<S>; 3] {
    let mut place = None;
    lanes_of(simd, blocks.block(id as usize / WIDTH, &mut place), id as usize % WIDTH)
}

/// Triangle `lane` of a block for all lanes.
#[inline(always)]
pub(super) fn lanes_of<S: Simd>(simd: S, block: &Block, lane: usize) -> [Triple<S>; 3] {
    let mut corners = [[f32x16::splat(simd, 0.0); 3]; 3];
    for (corner, vertex) in corners.iter_mut().zip(&block.vertex) {
        for (lanes, axis) in corner.iter_mut().zip(vertex) {
            *lanes = f32x16::splat(simd, axis[lane & (WIDTH - 1)]);
        }
    }
    corners
}

#[inline(always)]
fn splat<S: Simd>(simd: S, v: [f32; 3]) -> [f32x4<S>; 3] {
    [f32x4::splat(simd, v[0]), f32x4::splat(simd, v[1]), f32x4::splat(simd, v[2])]
}

/// The components with the largest one's axis last, in cyclic order: (y, z, x), (z, x, y) or (x, y, z).
#[inline(always)]
pub(super) fn turn<S: Simd, V: SimdBase<S>>(
    v: [V; 3],
    x_is_largest: V::Mask,
    y_is_largest: V::Mask,
) -> [V; 3] {
    let [x, y, z] = v;
    [
        x_is_largest.select(y, y_is_largest.select(z, x)),
        x_is_largest.select(z, y_is_largest.select(x, y)),
        x_is_largest.select(x, y_is_largest.select(y, z)),
    ]
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

    /// As [`MeshOf::locate`], for the lanes in `bits`.
    #[inline(always)]
    fn locate_lanes<S: Simd>(
        &mut self,
        simd: S,
        bvh: &TriangleBvh,
        triangles: u32x16<S>,
        bits: u16,
    ) -> (u32x16<S>, u32x16<S>) {
        let within = triangles - self.start;
        let inside = within.simd_lt(u32x16::splat(simd, self.len)).to_bitmask() as u16;
        if bits & !inside == 0 {
            return (u32x16::splat(simd, self.geometry), within);
        }
        let triangles: [u32; LANES] = triangles.into();
        let (mut geometry, mut primitive) = ([0; LANES], [0; LANES]);
        let mut rest = bits;
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            (geometry[lane], primitive[lane]) = self.locate(bvh, triangles[lane]);
        }
        (u32x16::load_array(simd, geometry), u32x16::load_array(simd, primitive))
    }
}

/// Takes the triangles `ids`, `block · 8 + lane`, of the lanes in `bits`, with the names of their meshes.
#[inline(always)]
pub(super) fn gather<S: Simd>(
    simd: S,
    bvh: &TriangleBvh,
    ids: &[u32; LANES],
    bits: u16,
    mesh: &mut MeshOf,
) -> Gathered<S> {
    let (corners, triangles) = gather_corners(simd, bvh.blocks(), ids, bits);
    let (geometry, primitive) = mesh.locate_lanes(simd, bvh, triangles, bits);
    Gathered { corners, geometry, primitive }
}

/// The corners and the running numbers of the triangles `ids` of the lanes in `bits`; one that several lanes share is read
/// once. (In registers: words written one by one are slow to read as a whole.)
#[inline(always)]
fn gather_corners<S: Simd>(
    simd: S,
    blocks: impl BlockSource,
    ids: &[u32; LANES],
    bits: u16,
) -> ([Triple<S>; 3], u32x16<S>) {
    let all = u32x16::load_array_ref(simd, ids);
    let mut corners = [[f32x16::splat(simd, 0.0); 3]; 3];
    let mut triangles = u32x16::splat(simd, 0);
    let mut rest = bits;
    while rest != 0 {
        let id = ids[(rest.trailing_zeros() & 15) as usize];
        let sharing = all.simd_eq(u32x16::splat(simd, id));
        rest &= !(sharing.to_bitmask() as u16);
        let mut place = None;
        let block = blocks.block(id as usize / WIDTH, &mut place);
        let lane = id as usize % WIDTH;
        for (corner, vertex) in corners.iter_mut().zip(&block.vertex) {
            for (lanes, axis) in corner.iter_mut().zip(vertex) {
                *lanes = sharing.select(f32x16::splat(simd, axis[lane]), *lanes);
            }
        }
        triangles = sharing.select(u32x16::splat(simd, block.triangle[lane]), triangles);
    }
    (corners, triangles)
}

#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, v: &[Lanes; 3]) -> Triple<S> {
    [
        f32x16::load_array_ref(simd, &v[0]),
        f32x16::load_array_ref(simd, &v[1]),
        f32x16::load_array_ref(simd, &v[2]),
    ]
}

impl Words {
    /// The hits of 16 rays.
    #[inline(always)]
    pub(super) fn new<S: Simd>(exact: &Exact<f32x16<S>>, gathered: &Gathered<S>) -> Self {
        let [x, y, z] = exact.normal;
        let (geometry, primitive) = (gathered.geometry.bitcast(), gathered.primitive.bitcast());
        transpose([exact.t, exact.u, exact.v, x, y, z, geometry, primitive])
    }
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

/// The direction of `e1 × e2`: its largest component lies between 1 and 2.
#[inline(always)]
fn normal<S: Simd, V>(simd: S, e1: [V; 3], e2: [V; 3]) -> [V; 3]
where
    V: SimdFloat<S, Element = f32>,
    V::Bits: SimdInt<S, Element = u32>,
{
    let x = product_difference(simd, e1[1], e2[2], e1[2], e2[1]);
    let y = product_difference(simd, e1[2], e2[0], e1[0], e2[2]);
    let z = product_difference(simd, e1[0], e2[1], e1[1], e2[0]);
    let (least, most) = (V::splat(simd, f32::MIN_POSITIVE), V::splat(simd, 2.0_f32.powi(126)));
    let largest = x.abs().max(y.abs()).max(z.abs()).max(least).min(most);
    // A power of two, 2^(127 − e) for the exponent e, does not round.
    let exponent = largest.to_bits() & V::Bits::splat(simd, 0xff << 23);
    let scale = V::from_bits(V::Bits::splat(simd, 254 << 23) - exponent);
    [x * scale, y * scale, z * scale]
}

/// The unit vector along what [`normal`] returns; 0 stays 0.
#[inline(always)]
fn unit<S: Simd, V: SimdFloat<S, Element = f32>>(simd: S, [x, y, z]: [V; 3]) -> [V; 3] {
    let length = (x * x + y * y + z * z).sqrt();
    let one = V::splat(simd, 1.0);
    let inverse = one / length.simd_gt(V::splat(simd, 0.0)).select(length, one);
    [x * inverse, y * inverse, z * inverse]
}

/// `ab − cd` with the rounding errors of the products put back (Kahan): thin triangles keep their normal.
#[inline(always)]
fn product_difference<S: Simd, V>(simd: S, a: V, b: V, c: V, d: V) -> V
where
    V: SimdFloat<S, Element = f32>,
    V::Bits: SimdInt<S, Element = u32>,
{
    let cd = c * d;
    if is_fused(simd) {
        return a.mul_sub(b, cd) + (-c).mul_add(d, cd);
    }
    let ab = a * b;
    (ab - cd) + (product_error(simd, a, b, ab) - product_error(simd, c, d, cd))
}

/// Whether multiplication and addition round once.
#[inline(always)]
fn is_fused<S: Simd>(simd: S) -> bool {
    #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
    if simd.level().as_avx2().is_none() {
        return false;
    }
    !matches!(simd.level(), Level::Fallback(_))
}

/// `ab − product`, where the latter is the rounded product: exact, by halves of 12 bits [Dekker 1971, "A floating-point
/// technique for extending the available precision", section 5].
#[inline(always)]
fn product_error<S: Simd, V>(simd: S, a: V, b: V, product: V) -> V
where
    V: SimdFloat<S, Element = f32>,
    V::Bits: SimdInt<S, Element = u32>,
{
    let upper = V::Bits::splat(simd, !0xfff);
    let (a_upper, b_upper) = (V::from_bits(a.to_bits() & upper), V::from_bits(b.to_bits() & upper));
    let (a_lower, b_lower) = (a - a_upper, b - b_upper);
    (a_upper * b_upper - product + a_upper * b_lower + a_lower * b_upper) + a_lower * b_lower
}

#[inline(always)]
fn sub<S: Simd, V: SimdBase<S>>(a: [V; 3], b: [V; 3]) -> [V; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `t` moved into the interval, from which rounding may have pushed it.
#[inline(always)]
fn inside<S: Simd, V>(t: V, t_min: V, end: V) -> V
where
    V: SimdFloat<S, Element = f32>,
    V::Bits: SimdInt<S, Element = u32>,
{
    // The next float: those that are not negative are ordered like their bits, once −0 is 0.
    let after_start = V::from_bits(t_min.abs().to_bits() + 1);
    t.simd_le(t_min).select(after_start, t).min(end)
}
