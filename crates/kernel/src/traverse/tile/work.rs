//! The rays of a tile in projective form: 16 groups of 16 rays, seen from their common origin.
//!
//! The dominant axis k points away from the origin; a ray is (u, v) = its direction over its k component, and a
//! depth K along k is kept as its reciprocal `iz`, which is linear over a triangle. A larger `iz` is nearer.
use fearless_simd::{f32x16, mask32x16, prelude::*};
use glam::{Affine3A, Vec3, Vec3A};

use crate::{
    tile::Tile,
    traverse::{
        local::{LocalRay, REACH, before},
        settle::Lined,
    },
};

/// Rays per group, and groups per tile.
pub(super) const GROUP: usize = 16;
/// A ray belongs to a face if its k component is at least this fraction of the others, so |u|, |v| ≤ 4.
const FACE_FRACTION: f32 = 0.25;

/// The rectangles of groups that lie side by side are together at most this share of the tile's: those of a picture, sixteen
/// squares of four by four pixels, which are rectangles of three by three.
const COMPACT: f32 = 0.8;

/// One value per ray of a tile, by group and lane.
pub(super) type PerRay<T> = [[T; GROUP]; GROUP];

/// Rays in the space of the object at hand; `slot` is each ray's place in the caller's tile.
#[derive(Clone, Copy)]
pub(super) struct Rays<'a> {
    /// Common origin; that of the tile counts for nothing.
    pub origin: Vec3,
    pub tile: &'a Tile,
    /// How far each looks, given what it met before.
    pub limit: &'a [f32; Tile::CAPACITY],
    pub slot: &'a [u8; Tile::CAPACITY],
    pub len: usize,
}

/// A buffer of such rays.
#[repr(align(64))]
pub(super) struct LevelRays {
    pub tile: Tile,
    pub limit: [f32; Tile::CAPACITY],
    pub slot: [u8; Tile::CAPACITY],
}

impl LevelRays {
    pub(super) const EMPTY: Self = {
        let tile = Tile::new(Vec3::ZERO);
        Self { tile, limit: [0.0; Tile::CAPACITY], slot: [0; Tile::CAPACITY] }
    };

    #[inline(always)]
    pub(super) fn push(&mut self, direction: Vec3A, [t_min, t_max, limit]: [f32; 3], slot: u8) {
        if let Some(i) = self.tile.push_interval(direction.into(), t_min, t_max) {
            self.limit[i & (Tile::CAPACITY - 1)] = limit;
            self.slot[i & (Tile::CAPACITY - 1)] = slot;
        }
    }

    /// Adds the lanes in `bits` of a group: directions, starts, ends and limits.
    #[inline(always)]
    pub(super) fn push_group(&mut self, lanes: &[[f32; GROUP]; 6], slots: &[u8], bits: u16) {
        let [x, y, z, t_min, t_max, limit] = lanes;
        let at = self.tile.len;
        if bits == u16::MAX && at + GROUP <= Tile::CAPACITY {
            for (to, from) in self.tile.direction.iter_mut().zip([x, y, z]) {
                to[at..at + GROUP].copy_from_slice(from);
            }
            self.tile.t_min[at..at + GROUP].copy_from_slice(t_min);
            self.tile.t_max[at..at + GROUP].copy_from_slice(t_max);
            self.limit[at..at + GROUP].copy_from_slice(limit);
            self.slot[at..at + GROUP].copy_from_slice(slots);
            self.tile.len = at + GROUP;
            return;
        }
        let mut rest = bits;
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            let interval = [t_min[lane], t_max[lane], limit[lane]];
            self.push(Vec3A::new(x[lane], y[lane], z[lane]), interval, slots[lane]);
        }
    }

    #[inline(always)]
    pub(super) fn rays(&self) -> Rays<'_> {
        let Self { tile, limit, slot } = self;
        Rays { origin: tile.origin, tile, limit, slot, len: tile.len }
    }
}

impl Rays<'_> {
    /// The sum of all directions.
    #[inline(always)]
    pub(super) fn mean_direction<S: Simd>(&self, simd: S) -> Vec3A {
        let zero = f32x16::splat(simd, 0.0);
        let mut sum = [zero; 3];
        for (axis, sum) in sum.iter_mut().enumerate() {
            for g in 0..self.len.div_ceil(GROUP) {
                let d = f32x16::load_array_ref(simd, &self.tile.direction[axis].as_chunks::<GROUP>().0[g]);
                *sum += first_lanes(simd, self.len - g * GROUP).select(d, zero);
            }
        }
        Vec3A::new(sum[0].reduce_sum(), sum[1].reduce_sum(), sum[2].reduce_sum())
    }

    /// Whether `face` takes every ray.
    #[inline(always)]
    pub(super) fn all_on<S: Simd>(&self, simd: S, face: Face) -> bool {
        let [u, v, k] = face.axes.map(|axis| self.tile.direction[axis % 3].as_chunks::<GROUP>().0);
        let mut outside = 0;
        for g in 0..self.len.div_ceil(GROUP) {
            let across =
                f32x16::load_array_ref(simd, &u[g]).abs().max(f32x16::load_array_ref(simd, &v[g]).abs());
            let along = f32x16::load_array_ref(simd, &k[g]) * face.sign;
            let used = first_lanes(simd, self.len - g * GROUP);
            outside |= (used & along.simd_lt(across * FACE_FRACTION)).to_bitmask();
        }
        outside == 0
    }

    #[inline(always)]
    pub(super) fn direction(&self, i: usize) -> Vec3A {
        let [x, y, z] = &self.tile.direction;
        Vec3A::new(x[i], y[i], z[i])
    }

    /// The directions of group `g` after `map`, and those of its lanes that stay in the usable range. Operation by
    /// operation [`LocalRay::transformed`].
    #[inline(always)]
    pub(super) fn mapped<S: Simd>(
        &self,
        simd: S,
        map: &Affine3A,
        g: usize,
    ) -> ([f32x16<S>; 3], mask32x16<S>) {
        let [dx, dy, dz] = &self.tile.direction;
        let dx = f32x16::load_array_ref(simd, &dx.as_chunks::<GROUP>().0[g]);
        let dy = f32x16::load_array_ref(simd, &dy.as_chunks::<GROUP>().0[g]);
        let dz = f32x16::load_array_ref(simd, &dz.as_chunks::<GROUP>().0[g]);
        let columns = map.matrix3;
        let (x, y, z) = (columns.x_axis, columns.y_axis, columns.z_axis);
        let mapped = [
            (dx * x.x + dy * y.x) + dz * z.x,
            (dx * x.y + dy * y.y) + dz * z.y,
            (dx * x.z + dy * y.z) + dz * z.z,
        ];
        (mapped, directions_usable(simd, mapped))
    }

    /// The rays of group `g`.
    #[inline(always)]
    pub(super) fn lined<S: Simd>(&self, simd: S, g: usize) -> Lined<f32x16<S>> {
        let [x, y, z] = self.origin.to_array();
        let tile = self.tile;
        Lined {
            origin: [f32x16::splat(simd, x), f32x16::splat(simd, y), f32x16::splat(simd, z)],
            direction: [
                lanes(simd, &tile.direction[0], g),
                lanes(simd, &tile.direction[1], g),
                lanes(simd, &tile.direction[2], g),
            ],
            t_min: lanes(simd, &tile.t_min, g),
            end: f32x16::from_bits(lanes(simd, &tile.t_max, g).to_bits() - 1),
        }
    }

    /// Ray `i` on its own.
    #[inline(always)]
    pub(super) fn ray(&self, i: usize) -> LocalRay {
        let (t_min, end) = (self.tile.t_min[i], before(self.tile.t_max[i]));
        LocalRay { origin: self.origin.into(), direction: self.direction(i), t_min, end, time: 0.0 }
    }
}

/// One of the six directions of the cube, and the axis order (u, v, k) that goes with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Face {
    pub axes: [usize; 3],
    /// +1 or −1: the sign of k components.
    pub sign: f32,
}

impl Face {
    /// The face that `direction` points through.
    #[inline(always)]
    pub(super) fn of(direction: Vec3A) -> Self {
        let a = direction.abs();
        let k = if a.x >= a.y && a.x >= a.z {
            0
        } else if a.y >= a.z {
            1
        } else {
            2
        };
        Self { axes: [(k + 1) % 3, (k + 2) % 3, k], sign: 1.0_f32.copysign(direction[k]) }
    }

    /// Whether a ray may be projected on this face.
    #[inline(always)]
    pub(super) fn takes(&self, d: Vec3A) -> bool {
        let [u, v, k] = self.axes;
        d[k] * self.sign >= d[u].abs().max(d[v].abs()) * FACE_FRACTION
    }
}

/// Rays on one face, ready for traversal.
#[repr(C, align(64))]
#[derive(Clone, Debug)]
pub(super) struct Work {
    pub u: PerRay<f32>,
    pub v: PerRay<f32>,
    /// Reciprocal depth of the nearest hit so far or of the ray's end; +∞ for lanes that want nothing more.
    pub iz: PerRay<f32>,
    /// Reciprocal depth of the ray's start; +∞ for starts at the origin.
    pub iz_start: PerRay<f32>,
    /// Depth per unit of the ray's parameter.
    pub scale: PerRay<f32>,
    /// `block · 8 + lane` of the nearest hit, or [`Work::NONE`].
    pub id: PerRay<u32>,
    /// Rectangle of each group, and the depth beyond which it wants nothing; negative if it is done.
    pub u0: [f32; GROUP],
    pub u1: [f32; GROUP],
    pub v0: [f32; GROUP],
    pub v1: [f32; GROUP],
    pub reach: [f32; GROUP],
    /// Rectangle and reach of all groups together.
    pub rect: [f32; 4],
    pub far: f32,
    pub groups: usize,
    /// Width or height of the largest group's rectangle where groups lie side by side, as those of a picture do; else ∞.
    pub extent: f32,
    /// For each group, bits of the rays that met what lets light through, in queries of any hit.
    pub met: [u16; GROUP],
    /// The face that all rays are on.
    pub face: Face,
}

impl Work {
    pub(super) const NONE: u32 = u32::MAX;
    pub(super) const EMPTY: Self = Self {
        face: Face { axes: [0, 1, 2], sign: 1.0 },
        u: [[0.0; GROUP]; GROUP],
        v: [[0.0; GROUP]; GROUP],
        iz: [[f32::INFINITY; GROUP]; GROUP],
        iz_start: [[f32::INFINITY; GROUP]; GROUP],
        scale: [[1.0; GROUP]; GROUP],
        id: [[Self::NONE; GROUP]; GROUP],
        u0: [f32::INFINITY; GROUP],
        u1: [f32::NEG_INFINITY; GROUP],
        v0: [f32::INFINITY; GROUP],
        v1: [f32::NEG_INFINITY; GROUP],
        reach: [-1.0; GROUP],
        rect: [0.0; 4],
        far: -1.0,
        groups: 0,
        extent: f32::INFINITY,
        met: [0; GROUP],
    };

    /// Projects `rays`, all of which `face` takes.
    #[inline(always)]
    pub(super) fn project<S: Simd>(&mut self, simd: S, rays: Rays<'_>, face: Face) {
        let [u, v, k] = face.axes.map(|axis| rays.tile.direction[axis % 3].as_chunks::<GROUP>().0);
        let t_min = rays.tile.t_min.as_chunks::<GROUP>().0;
        let limit = rays.limit.as_chunks::<GROUP>().0;
        let one = f32x16::splat(simd, 1.0);
        let (zero, infinity) = (f32x16::splat(simd, 0.0), f32x16::splat(simd, f32::INFINITY));
        self.face = face;
        self.groups = rays.len.div_ceil(GROUP);
        for g in 0..GROUP {
            if g >= self.groups {
                (self.reach[g], self.u0[g], self.u1[g]) = (-1.0, f32::INFINITY, f32::NEG_INFINITY);
                (self.v0[g], self.v1[g]) = (f32::INFINITY, f32::NEG_INFINITY);
                continue;
            }
            let used = first_lanes(simd, rays.len - g * GROUP);
            let scale = f32x16::load_array_ref(simd, &k[g]) * face.sign;
            let scale = used.select(scale, one);
            let inverse = one / scale;
            let u = used.select(f32x16::load_array_ref(simd, &u[g]) * inverse, infinity);
            let v = used.select(f32x16::load_array_ref(simd, &v[g]) * inverse, infinity);
            self.u0[g] = u.reduce_min();
            self.v0[g] = v.reduce_min();
            self.u1[g] = used.select(u, -infinity).reduce_max();
            self.v1[g] = used.select(v, -infinity).reduce_max();
            self.u[g] = used.select(u, zero).into();
            self.v[g] = used.select(v, zero).into();
            let end = one / (f32x16::load_array_ref(simd, &limit[g]) * scale);
            let start = one / (f32x16::load_array_ref(simd, &t_min[g]).max(zero) * scale);
            self.iz[g] = used.select(end, infinity).into();
            self.iz_start[g] = used.select(start, infinity).into();
            self.scale[g] = scale.into();
            self.id[g] = [Self::NONE; GROUP];
            self.update_reach(simd, g);
        }
        self.rect = [
            f32x16::load_array_ref(simd, &self.u0).reduce_min(),
            f32x16::load_array_ref(simd, &self.u1).reduce_max(),
            f32x16::load_array_ref(simd, &self.v0).reduce_min(),
            f32x16::load_array_ref(simd, &self.v1).reduce_max(),
        ];
        let width = f32x16::load_array_ref(simd, &self.u1) - f32x16::load_array_ref(simd, &self.u0);
        let height = f32x16::load_array_ref(simd, &self.v1) - f32x16::load_array_ref(simd, &self.v0);
        // Groups without rays have no finite rectangle.
        let areas = width.simd_ge(zero).select(width * height, zero).reduce_sum();
        let [u0, u1, v0, v1] = self.rect;
        let compact = areas <= COMPACT * (u1 - u0) * (v1 - v0);
        self.extent = if compact { width.max(height).reduce_max() } else { f32::INFINITY };
        self.update_far(simd);
    }

    /// Recomputes how far group `g` still looks.
    #[inline(always)]
    pub(super) fn update_reach<S: Simd>(&mut self, simd: S, g: usize) {
        let least = f32x16::load_array_ref(simd, &self.iz[g]).reduce_min();
        self.reach[g] = if least < f32::INFINITY { REACH / least } else { -1.0 };
    }

    #[inline(always)]
    pub(super) fn update_far<S: Simd>(&mut self, simd: S) {
        self.far = f32x16::load_array_ref(simd, &self.reach).reduce_max();
    }

    /// The groups that look at least as far as `depth`.
    #[inline(always)]
    pub(super) fn reaching<S: Simd>(&self, simd: S, depth: f32) -> u16 {
        let reach = f32x16::load_array_ref(simd, &self.reach);
        reach.simd_ge(f32x16::splat(simd, depth)).to_bitmask() as u16
    }

    /// Makes what ray `i` met at `t`, in whatever object, the limit for what is still to come.
    #[inline(always)]
    pub(super) fn settle(&mut self, rays: Rays<'_>, i: usize, t: f32) {
        let (g, lane) = (i / GROUP, i % GROUP);
        let limit = (t * REACH).min(rays.tile.t_max[i]);
        self.iz[g][lane] = 1.0 / (limit * self.scale[g][lane]);
    }

    /// As [`Work::settle`], for the lanes in `bits` of group `g`.
    #[inline(always)]
    pub(super) fn settle_group<S: Simd>(
        &mut self,
        simd: S,
        rays: Rays<'_>,
        g: usize,
        bits: u16,
        t: &[f32; GROUP],
    ) {
        let end = f32x16::load_array_ref(simd, &rays.tile.t_max.as_chunks::<GROUP>().0[g]);
        let limit = (f32x16::load_array_ref(simd, t) * REACH).min(end);
        let iz = f32x16::splat(simd, 1.0) / (limit * f32x16::load_array_ref(simd, &self.scale[g]));
        let before = f32x16::load_array_ref(simd, &self.iz[g]);
        self.iz[g] = mask16(simd, bits).select(iz, before).into();
        self.update_reach(simd, g);
    }

    /// The smallest rectangle around the groups in `mask`: (u0, u1, v0, v1).
    #[inline(always)]
    pub(super) fn rect_of(&self, mask: u16) -> [f32; 4] {
        if mask.count_ones() > 4 {
            return self.rect;
        }
        let mut rect = [f32::INFINITY, f32::NEG_INFINITY, f32::INFINITY, f32::NEG_INFINITY];
        let mut rest = mask;
        while rest != 0 {
            let g = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            rect[0] = rect[0].min(self.u0[g]);
            rect[1] = rect[1].max(self.u1[g]);
            rect[2] = rect[2].min(self.v0[g]);
            rect[3] = rect[3].max(self.v1[g]);
        }
        rect
    }
}

/// Whether the first `len` rays of a tile can all hit something, as far as their directions and intervals go.
#[inline(always)]
pub(super) fn all_usable<S: Simd>(simd: S, tile: &Tile, len: usize) -> bool {
    let [x, y, z] = &tile.direction;
    let (x, y, z) = (x.as_chunks::<GROUP>().0, y.as_chunks::<GROUP>().0, z.as_chunks::<GROUP>().0);
    let (t_min, t_max) = (tile.t_min.as_chunks::<GROUP>().0, tile.t_max.as_chunks::<GROUP>().0);
    let zero = f32x16::splat(simd, 0.0);
    let mut bad = 0;
    for g in 0..len.div_ceil(GROUP) {
        let dx = f32x16::load_array_ref(simd, &x[g]);
        let dy = f32x16::load_array_ref(simd, &y[g]);
        let dz = f32x16::load_array_ref(simd, &z[g]);
        let start = f32x16::load_array_ref(simd, &t_min[g]);
        let end = f32x16::load_array_ref(simd, &t_max[g]);
        // Negative starts go the slow way, which clamps them.
        let interval = start.simd_lt(end) & start.simd_ge(zero);
        let good = (directions_usable(simd, [dx, dy, dz]) & interval).to_bitmask();
        bad |= !good & first_lanes(simd, len - g * GROUP).to_bitmask();
    }
    bad == 0
}

/// Whether directions are in the range where the arithmetic holds, as [`LocalRay::in_range`].
#[inline(always)]
fn directions_usable<S: Simd>(simd: S, direction: [f32x16<S>; 3]) -> mask32x16<S> {
    let [x, y, z] = direction;
    let (x, y, z) = (x.abs(), y.abs(), z.abs());
    let (least, most) = (*LocalRay::DIRECTION_RANGE.start(), *LocalRay::DIRECTION_RANGE.end());
    let most = f32x16::splat(simd, most);
    // Every comparison is false for NaN.
    let finite = x.simd_le(most) & y.simd_le(most) & z.simd_le(most);
    finite & x.max(y).max(z).simd_ge(f32x16::splat(simd, least))
}

/// The values of group `g`.
#[inline(always)]
fn lanes<S: Simd>(simd: S, values: &[f32; Tile::CAPACITY], g: usize) -> f32x16<S> {
    f32x16::load_array_ref(simd, &values.as_chunks::<GROUP>().0[g])
}

/// The first `count` of 16 lanes.
#[inline(always)]
pub(super) fn first_lanes<S: Simd>(simd: S, count: usize) -> mask32x16<S> {
    mask16(simd, ((1_u32 << count.min(GROUP)) - 1) as u16)
}

#[inline(always)]
pub(super) fn mask16<S: Simd>(simd: S, bits: u16) -> mask32x16<S> {
    mask32x16::from_bitmask(simd, u64::from(bits))
}
