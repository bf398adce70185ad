//! A block of 8 triangles as a tile sees it.
//!
//! Seen from the common origin, the edge functions and the reciprocal depth of a triangle are linear in a ray's
//! (u, v): a few coefficients per triangle serve all 256 rays. Edge functions are symmetric in the edge's ends,
//! `e = r · ((b + c) × (c − b))`, which keeps their error near that of the vertices even for small far triangles.
//! Each gets a bound of its error added, so no ray that a single ray's test lets in is lost. Depth comes from the
//! plane, not from the sum of the edge functions, which cancels.
use fearless_simd::{f32x8, f32x16, mask32x16, prelude::*};

use super::{walk::Frame, work::Work};
use crate::{
    layout::{Block, WIDTH},
    traverse::settle::CLOSE,
};

/// Error of an edge function relative to the bound Σ|b+c| · Σ|c−b| · max(1, |u|, |v|): eleven roundings, two of which
/// stand for what the test of single rays lets in beyond the edge.
const EDGE_ERROR: f32 = 5.5 * f32::EPSILON;
/// A triangle can matter to a group if its largest reciprocal depth times the group's reach is above this: one, less
/// the rounding of products that cancel.
const DEPTH_SLACK: f32 = 1.0 - 1.0e-4;
/// Edges that are shorter than this share of their distance are in doubt all over.
const SHORT: f32 = 32.0 * f32::EPSILON;
/// Below this, the volume of a triangle with the origin relative to the products it is the sum of, the depth of its plane
/// is in doubt: its error is some nine roundings over that ratio, and half of [`CLOSE`] is granted.
const STEEP: f32 = 9.0 * f32::EPSILON / (0.5 * CLOSE);
/// And below this the side of the plane that the origin is on.
const EDGE_ON: f32 = 8.0 * f32::EPSILON;

/// Coefficients over (u, v, 1) for 8 triangles.
#[repr(C, align(64))]
pub(super) struct Setup {
    /// `edge[i]`: not negative inside,
    pub edge: [[[f32; WIDTH]; 3]; 3],
    /// and beyond doubt from this on: ∞ for triangles in doubt all over.
    pub clear: [f32; WIDTH],
    /// Reciprocal depth.
    pub depth: [[f32; WIDTH]; 3],
    /// Reciprocal depths of the farthest and the nearest corner (the largest there is, if that lies behind the origin):
    /// the plane's answer is clamped to them, and is the latter for triangles in doubt.
    pub depth_range: [[f32; WIDTH]; 2],
}

pub(super) type Triple<S> = [f32x8<S>; 3];

impl Setup {
    pub(super) const EMPTY: Self = Self {
        edge: [[[0.0; WIDTH]; 3]; 3],
        clear: [0.0; WIDTH],
        depth: [[0.0; WIDTH]; 3],
        depth_range: [[0.0; WIDTH]; 2],
    };

    /// Sets up a block; a bit for each triangle that can be seen from the origin within `far`.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        simd: S,
        frame: &Frame,
        block: &Block,
        rect: [f32; 4],
        far: f32,
    ) -> u32 {
        let a = vertex(simd, frame, &block.vertex[0]);
        let b = vertex(simd, frame, &block.vertex[1]);
        let c = vertex(simd, frame, &block.vertex[2]);
        let (zero, one) = (f32x8::splat(simd, 0.0), f32x8::splat(simd, 1.0));
        let nearest = a[2].min(b[2]).min(c[2]);
        let farthest = a[2].max(b[2]).max(c[2]);
        let in_range = nearest.simd_le(f32x8::splat(simd, far)) & farthest.simd_gt(zero);
        let (f0, f1, f2) = (sub(c, b), sub(a, c), sub(b, a));
        let (n, products) = cross_and_products(f1, f2);
        let volume = a[0] * n[0] + a[1] * n[1] + a[2] * n[2];
        let size = a[0].abs() * products[0] + a[1].abs() * products[1] + a[2].abs() * products[2];
        let sided = volume.abs().simd_gt(size * EDGE_ON);
        let direction = rect[1].abs().max(rect[0].abs()).max(rect[3].abs()).max(rect[2].abs()).max(1.0);
        let distance = largest(a, b, c, 0) + largest(a, b, c, 1) + largest(a, b, c, 2);
        let error = distance * (2.0 * EDGE_ERROR * direction);
        let sign = sided.select(one.copysign(volume), zero);
        let [u0, u1, v0, v1] = rect;
        let mut touching = in_range;
        let (mut longest, mut shortest) = (zero, f32x8::splat(simd, f32::MAX));
        for (i, (s, f)) in [(add(b, c), f0), (add(c, a), f1), (add(a, b), f2)].into_iter().enumerate() {
            let e = cross(s, f);
            let (eu, ev) = (e[0] * sign, e[1] * sign);
            let length = f[0].abs() + f[1].abs() + f[2].abs();
            (longest, shortest) = (longest.max(length), shortest.min(length));
            let ek = e[2].mul_add(sign, error * length);
            let most = (eu * u0).max(eu * u1) + (ev * v0).max(ev * v1) + ek;
            touching &= most.simd_ge(zero);
            self.edge[i] = [eu.into(), ev.into(), ek.into()];
        }
        let sure = volume.abs().simd_gt(size * STEEP) & shortest.simd_gt(distance * SHORT);
        self.clear = sure.select(error * (2.0 * longest), f32x8::splat(simd, f32::INFINITY)).into();
        let behind = f32x8::splat(simd, f32::MAX);
        let nearest = nearest.simd_gt(zero).select((one / nearest).min(behind), behind);
        self.depth_range = [sure.select(one / farthest, nearest).into(), nearest.into()];
        let inverse = one / sure.select(volume, one);
        for (depth, n) in self.depth.iter_mut().zip(n) {
            *depth = sure.select(n * inverse, zero).into();
        }
        // Two corners in one place: nothing meets that, and empty lanes are of that kind.
        (touching & shortest.simd_gt(zero)).to_bitmask() as u32
    }

    /// The triangles in `bits` that a rectangle of rays may meet.
    #[inline(always)]
    pub(super) fn meeting<S: Simd>(&self, simd: S, rect: [f32; 4], reach: f32, bits: u32) -> u32 {
        let [u0, u1, v0, v1] = rect;
        let zero = f32x8::splat(simd, 0.0);
        let [zu, zv, zk] = load(simd, &self.depth);
        let nearest = (zu * u0).max(zu * u1) + ((zv * v0).max(zv * v1) + zk);
        let farthest = f32x8::load_array_ref(simd, &self.depth_range[0]);
        let mut least = nearest.max(farthest) * reach - DEPTH_SLACK;
        for edge in &self.edge {
            let [eu, ev, ek] = load(simd, edge);
            least = least.min((eu * u0).max(eu * u1) + ((ev * v0).max(ev * v1) + ek));
        }
        least.simd_ge(zero).to_bitmask() as u32 & bits
    }

    /// The groups that may meet triangle `lane`.
    #[inline(always)]
    pub(super) fn groups_meeting<S: Simd>(&self, simd: S, work: &Work, lane: usize, mask: u16) -> u16 {
        let (u0, u1) = (f32x16::load_array_ref(simd, &work.u0), f32x16::load_array_ref(simd, &work.u1));
        let (v0, v1) = (f32x16::load_array_ref(simd, &work.v0), f32x16::load_array_ref(simd, &work.v1));
        let [zu, zv, zk] = [self.depth[0][lane & 7], self.depth[1][lane & 7], self.depth[2][lane & 7]];
        let (u, v) = (if zu > 0.0 { u1 } else { u0 }, if zv > 0.0 { v1 } else { v0 });
        let nearest =
            u.mul_add(f32x16::splat(simd, zu), v.mul_add(f32x16::splat(simd, zv), f32x16::splat(simd, zk)));
        let nearest = nearest.max(f32x16::splat(simd, self.depth_range[0][lane & 7]));
        let mut least = nearest * f32x16::load_array_ref(simd, &work.reach) - DEPTH_SLACK;
        for edge in &self.edge {
            let [eu, ev, ek] = [edge[0][lane & 7], edge[1][lane & 7], edge[2][lane & 7]];
            // Which corner counts is the same for all groups.
            let (u, v) = (if eu > 0.0 { u1 } else { u0 }, if ev > 0.0 { v1 } else { v0 });
            let e = u.mul_add(
                f32x16::splat(simd, eu),
                v.mul_add(f32x16::splat(simd, ev), f32x16::splat(simd, ek)),
            );
            least = least.min(e);
        }
        least.simd_ge(f32x16::splat(simd, 0.0)).to_bitmask() as u16 & mask
    }
}

/// Where 16 rays cross the plane of triangle `lane`: the least edge function, not negative inside, and the reciprocal
/// depth.
#[inline(always)]
pub(super) fn cross_triangle<S: Simd>(
    simd: S,
    setup: &Setup,
    lane: usize,
    [u, v]: [f32x16<S>; 2],
) -> (f32x16<S>, f32x16<S>) {
    let e0 = plane(simd, &setup.edge[0], lane, u, v);
    let e1 = plane(simd, &setup.edge[1], lane, u, v);
    let e2 = plane(simd, &setup.edge[2], lane, u, v);
    let farthest = f32x16::splat(simd, setup.depth_range[0][lane & 7]);
    let nearest = f32x16::splat(simd, setup.depth_range[1][lane & 7]);
    let z = plane(simd, &setup.depth, lane, u, v).max(farthest).min(nearest);
    (e0.min(e1).min(e2), z)
}

/// Those that meet it beyond doubt behind their starts and nearer than `iz`.
#[inline(always)]
pub(super) fn met<S: Simd>(
    simd: S,
    setup: &Setup,
    lane: usize,
    least: f32x16<S>,
    z: f32x16<S>,
    [start, iz]: [f32x16<S>; 2],
) -> mask32x16<S> {
    let inside = least.simd_ge(f32x16::splat(simd, setup.clear[lane & 7]));
    inside & z.simd_gt(iz * (1.0 + CLOSE)) & z.simd_lt(start * (1.0 - CLOSE))
}

/// A linear function of (u, v) with the coefficients of one lane.
#[inline(always)]
fn plane<S: Simd>(simd: S, c: &[[f32; WIDTH]; 3], lane: usize, u: f32x16<S>, v: f32x16<S>) -> f32x16<S> {
    let [cu, cv, ck] = [c[0][lane & 7], c[1][lane & 7], c[2][lane & 7]];
    u.mul_add(f32x16::splat(simd, cu), v.mul_add(f32x16::splat(simd, cv), f32x16::splat(simd, ck)))
}

#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, c: &[[f32; WIDTH]; 3]) -> Triple<S> {
    [
        f32x8::load_array_ref(simd, &c[0]),
        f32x8::load_array_ref(simd, &c[1]),
        f32x8::load_array_ref(simd, &c[2]),
    ]
}

/// A corner relative to the origin, in the face's axis order.
#[inline(always)]
fn vertex<S: Simd>(simd: S, frame: &Frame, vertex: &[[f32; WIDTH]; 3]) -> Triple<S> {
    let [u, v, k] = frame.face.axes;
    [
        f32x8::load_array_ref(simd, &vertex[u % 3]) - frame.origin[0],
        f32x8::load_array_ref(simd, &vertex[v % 3]) - frame.origin[1],
        (f32x8::load_array_ref(simd, &vertex[k % 3]) - frame.origin[2]) * frame.face.sign,
    ]
}

#[inline(always)]
fn add<S: Simd>(a: Triple<S>, b: Triple<S>) -> Triple<S> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn sub<S: Simd>(a: Triple<S>, b: Triple<S>) -> Triple<S> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn cross<S: Simd>(a: Triple<S>, b: Triple<S>) -> Triple<S> {
    [a[1].mul_sub(b[2], a[2] * b[1]), a[2].mul_sub(b[0], a[0] * b[2]), a[0].mul_sub(b[1], a[1] * b[0])]
}

/// `a × b`, and for each component the sum of the absolute products that it is the difference of.
#[inline(always)]
fn cross_and_products<S: Simd>(a: Triple<S>, b: Triple<S>) -> (Triple<S>, Triple<S>) {
    let products = [
        (a[1] * b[2]).abs() + (a[2] * b[1]).abs(),
        (a[2] * b[0]).abs() + (a[0] * b[2]).abs(),
        (a[0] * b[1]).abs() + (a[1] * b[0]).abs(),
    ];
    (cross(a, b), products)
}

#[inline(always)]
fn largest<S: Simd>(a: Triple<S>, b: Triple<S>, c: Triple<S>, axis: usize) -> f32x8<S> {
    a[axis].abs().max(b[axis].abs()).max(c[axis].abs())
}
