//! From the triangles that a tile settled on to hits: the intersection again, 16 rays at a time, in the form that
//! is precise near the ray rather than cheap for many [Woop, Benthin and Wald 2013].
use fearless_simd::{f32x16, prelude::*, u32x16};
use glam::Vec3;

use super::{
    Answers,
    work::{Face, GROUP, Rays, Work},
};
use crate::{
    layout::WIDTH,
    ray::{Hit, PathId},
    tile::Tile,
    triangle_bvh::TriangleBvh,
};

/// Up to so many lanes that share a triangle are filled one by one.
const FEW_LANES: u32 = 3;

type Lanes = [f32; GROUP];
type Triple<S> = [f32x16<S>; 3];

type Corners = [[Lanes; 3]; 3];

/// Each lane's triangle.
#[repr(C, align(64))]
struct Gathered {
    /// In the face's axis order.
    corners: Corners,
    geometry: [u32; GROUP],
    primitive: [u32; GROUP],
}

/// The eight words of 16 hits before the path, hit after hit.
#[repr(C, align(64))]
struct Words([Lanes; 8]);

impl Words {
    #[inline(always)]
    fn hit(&self, lane: usize, path: PathId) -> Hit {
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

/// Writes the hits of all rays of `work` that found a triangle.
#[inline(always)]
pub(super) fn hits<S: Simd>(
    simd: S,
    bvh: &TriangleBvh,
    path: PathId,
    rays: Rays<'_>,
    work: &Work,
    answers: &mut Answers<'_>,
) {
    let corners = [[[0.0; GROUP]; 3]; 3];
    let mut gathered = Gathered { corners, geometry: [0; GROUP], primitive: [0; GROUP] };
    let mut mesh = MeshOf::default();
    for g in 0..work.groups {
        let bits = found(simd, work, g);
        if bits == 0 {
            continue;
        }
        gathered.fill(simd, bvh, work.face, &work.id[g], bits, &mut mesh);
        let words = exact(simd, &gathered, rays, work, g);
        let mut rest = bits;
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            let slot = rays.slot[(g * GROUP + lane) & (Tile::CAPACITY - 1)];
            answers.put(slot, words.hit(lane, path));
        }
    }
}

/// The mesh that the last triangle was in: neighbouring rays mostly share it.
#[derive(Default)]
struct MeshOf {
    geometry: u32,
    start: u32,
    len: u32,
}

impl MeshOf {
    /// As [`TriangleBvh::locate`], with a short cut for triangles of the same mesh as before.
    #[inline(always)]
    fn locate(&mut self, bvh: &TriangleBvh, triangle: u32) -> (u32, u32) {
        let within = triangle.wrapping_sub(self.start);
        if within < self.len {
            return (self.geometry, within);
        }
        let (geometry, primitive) = bvh.locate(triangle);
        *self = Self { geometry, start: triangle - primitive, len: bvh.mesh_len(geometry) };
        (geometry, primitive)
    }
}

/// Marks all rays of `work` that found a triangle.
#[inline(always)]
pub(super) fn occluded<S: Simd>(simd: S, rays: Rays<'_>, work: &Work, answers: &mut Answers<'_>) {
    for g in 0..work.groups {
        let mut rest = found(simd, work, g);
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            answers.set(rays.slot[g * GROUP + lane]);
        }
    }
}

/// The lanes of group `g` that found a triangle.
#[inline(always)]
fn found<S: Simd>(simd: S, work: &Work, g: usize) -> u16 {
    let id = u32x16::load_array_ref(simd, &work.id[g]);
    id.simd_lt(u32x16::splat(simd, Work::NONE)).to_bitmask() as u16
}

impl Gathered {
    /// Takes the triangles `ids` of the lanes in `bits`; triangles that several lanes share are read once.
    #[inline(always)]
    fn fill<S: Simd>(
        &mut self,
        simd: S,
        bvh: &TriangleBvh,
        face: Face,
        ids: &[u32; GROUP],
        bits: u16,
        mesh: &mut MeshOf,
    ) {
        let all = u32x16::load_array_ref(simd, ids);
        let mut rest = bits;
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            let id = ids[lane];
            let mut place = None;
            let block = bvh.blocks().get(id as usize / WIDTH, &mut place);
            let from = id as usize % WIDTH;
            let same = all.simd_eq(u32x16::splat(simd, id));
            let sharing = same.to_bitmask() as u16;
            for (corner, vertex) in self.corners.iter_mut().zip(&block.vertex) {
                for (lanes, axis) in corner.iter_mut().zip(face.axes) {
                    let value = vertex[axis % 3][from];
                    if sharing.count_ones() > FEW_LANES {
                        let before = f32x16::load_array_ref(simd, lanes);
                        *lanes = same.select(f32x16::splat(simd, value), before).into();
                    } else {
                        lanes[lane] = value;
                    }
                }
            }
            let (geometry, primitive) = mesh.locate(bvh, block.triangle[from]);
            if sharing.count_ones() > FEW_LANES {
                for (lanes, value) in [(&mut self.geometry, geometry), (&mut self.primitive, primitive)] {
                    let before = u32x16::load_array_ref(simd, lanes);
                    *lanes = same.select(u32x16::splat(simd, value), before).into();
                }
                rest &= !sharing;
            } else {
                self.geometry[lane] = geometry;
                self.primitive[lane] = primitive;
                rest &= rest - 1;
            }
        }
    }
}

/// Distance, barycentrics and normal of 16 rays in their triangles.
#[inline(always)]
fn exact<S: Simd>(simd: S, gathered: &Gathered, rays: Rays<'_>, work: &Work, g: usize) -> Words {
    let Gathered { corners, geometry, primitive } = gathered;
    let face = work.face;
    let [ku, kv, kk] = face.axes;
    let origin = rays.tile.origin.to_array();
    let origin = [origin[ku % 3], origin[kv % 3], origin[kk % 3]];
    let a = relative(simd, &corners[0], origin);
    let b = relative(simd, &corners[1], origin);
    let c = relative(simd, &corners[2], origin);
    let sign = f32x16::splat(simd, face.sign);
    let u = f32x16::load_array_ref(simd, &work.u[g]) * sign;
    let v = f32x16::load_array_ref(simd, &work.v[g]) * sign;
    // Each corner as seen along the ray, then the weights of the corners.
    let (ax, ay) = (a[0] - u * a[2], a[1] - v * a[2]);
    let (bx, by) = (b[0] - u * b[2], b[1] - v * b[2]);
    let (cx, cy) = (c[0] - u * c[2], c[1] - v * c[2]);
    let (w0, w1, w2) = (cx * by - cy * bx, ax * cy - ay * cx, bx * ay - by * ax);
    let zero = f32x16::splat(simd, 0.0);
    let one = f32x16::splat(simd, 1.0);
    let side = one.copysign(w0 + w1 + w2);
    let (w0, w1, w2) = ((w0 * side).max(zero), (w1 * side).max(zero), (w2 * side).max(zero));
    let sum = w0 + w1 + w2;
    let thin = sum.simd_eq(zero);
    let inverse = one / thin.select(one, sum);
    let third = f32x16::splat(simd, 1.0 / 3.0);
    let bu = thin.select(third, w1 * inverse).min(one);
    let bv = thin.select(third, w2 * inverse).min(one - bu);
    let depth = (w0 * a[2] + w1 * b[2] + w2 * c[2]) * inverse * sign;
    let depth = thin.select(one / f32x16::load_array_ref(simd, &work.iz[g]), depth);
    let t = inside(simd, depth / f32x16::load_array_ref(simd, &work.scale[g]), rays, g);
    let normal = normal(simd, sub(b, a), sub(c, a));
    let mut words = [t, bu, bv, t, t, t, as_float(simd, geometry), as_float(simd, primitive)];
    for (axis, n) in face.axes.into_iter().zip(normal) {
        words[3 + axis % 3] = n;
    }
    transpose(words)
}

#[inline(always)]
fn as_float<S: Simd>(simd: S, bits: &[u32; GROUP]) -> f32x16<S> {
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
fn relative<S: Simd>(simd: S, corner: &[Lanes; 3], origin: [f32; 3]) -> Triple<S> {
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

/// `t` moved into the open interval from `t_min` to `t_max`, from which rounding may have pushed it.
#[inline(always)]
fn inside<S: Simd>(simd: S, t: f32x16<S>, rays: Rays<'_>, g: usize) -> f32x16<S> {
    let start = f32x16::load_array_ref(simd, &rays.tile.t_min.as_chunks::<GROUP>().0[g]);
    let end = f32x16::load_array_ref(simd, &rays.tile.t_max.as_chunks::<GROUP>().0[g]);
    let one = u32x16::splat(simd, 1);
    // The next float: positive ones are ordered like their bits.
    let after_start = (start.bitcast::<u32x16<S>>() + one).bitcast::<f32x16<S>>();
    let before_end = (end.bitcast::<u32x16<S>>() - one).bitcast::<f32x16<S>>();
    let t = t.simd_le(start).select(after_start, t);
    t.simd_ge(end).select(before_end, t)
}
