//! Sixteen rays in lanes through one tree of triangles, whatever their origins: for the reflections, the refractions
//! and the short rays of neighbouring pixels. (`descent` takes them through trees of instances.)
//!
//! Lanes stay together while it pays: where only a few want a subtree, each goes on alone, 8 boxes at a time [Benthin,
//! Wald, Woop, Ernst and Mark 2012, "Combining single and packet-ray tracing for arbitrary ray distributions"]. So
//! unrelated rays lose nothing: they share the top of the tree and part below it.
mod beam;
mod leaf;
mod load;

use fearless_simd::{f32x16, mask32x16, prelude::*, u32x8, u32x16};

use glam::Affine3A;

use self::beam::Beam;
use super::{
    ahead::Leaves,
    local::{LocalRay, REACH},
    settle::{self, LANES, Lanes, Lined, MeshOf, Triple, Words, load},
    shear::{Shear, Shears},
    single::{self, Best},
    slab::{self, Slab, Slabs},
    stack::Stack,
};
use crate::{
    build::wide::WideTree,
    layout::{Child, Node, WIDTH},
    through::Screen,
    triangle_bvh::{MAX_COORDINATE, TriangleBvh},
};

/// How many lanes stay together: where a packet switches to single rays.
#[derive(Clone, Copy)]
struct Thresholds {
    /// Up to so many go on alone: a step of a packet costs about as much as that many single ones, and less where they
    /// will stay together.
    few: u32,
    /// From so many on, triangles go one by one through all lanes rather than rays one by one through 8 triangles.
    many: u32,
}

/// Up to 16 rays, set up for box and triangle tests.
#[repr(C, align(64))]
#[derive(Clone)]
pub(super) struct Packet {
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    t_min: Lanes,
    /// The last distance that counts, whatever the rays met so far.
    end: Lanes,
    /// The last distance that counts, be it of the nearest hit so far; negative for lanes that want nothing.
    pub limit: Lanes,
    /// `block · 8 + lane` of that hit, or [`Packet::NONE`].
    pub id: [u32; LANES],
    inverse: [Lanes; 3],
    near_shift: [Lanes; 3],
    far_shift: [Lanes; 3],
    /// By how much planes are moved, amply.
    pad: Lanes,
    /// Bits of the lanes whose direction is negative along each axis.
    negative: [u16; 3],
    /// Triangle test: the largest component's axis, the origin with that axis last, and the shear.
    axis: [u32; LANES],
    sheared_origin: [Lanes; 3],
    shear: [Lanes; 3],
    /// Bits of the lanes whose largest component is x, and of those with y.
    turned: [u16; 2],
    /// Bits of the lanes that met what lets light through, in queries of any hit.
    pub met: u16,
    /// Lanes of several octants stay together, as they are short.
    pub is_mixed: bool,
}

/// A subtree to visit, and where each lane enters its box; NaN for lanes that do not.
#[repr(C, align(64))]
#[derive(Clone, Copy)]
pub(super) struct Visit {
    enter: Lanes,
    pub child: Child,
}

/// The directions of one sign octant: which of a node's child orders suits them, and which rows of its bounds are near.
#[derive(Clone, Copy)]
pub(super) struct Octant {
    number: usize,
    pub near: [usize; 3],
}

impl Packet {
    pub(super) const NONE: u32 = Best::NONE;
    pub(super) const EMPTY: Self = Self {
        origin: [[0.0; LANES]; 3],
        direction: [[1.0; LANES]; 3],
        t_min: [0.0; LANES],
        end: [0.0; LANES],
        limit: [-1.0; LANES],
        id: [Self::NONE; LANES],
        inverse: [[1.0; LANES]; 3],
        near_shift: [[0.0; LANES]; 3],
        far_shift: [[0.0; LANES]; 3],
        pad: [0.0; LANES],
        negative: [0; 3],
        axis: [0; LANES],
        sheared_origin: [[0.0; LANES]; 3],
        shear: [[0.0; LANES]; 3],
        turned: [0; 2],
        met: 0,
        is_mixed: false,
    };

    /// The ray in a lane, of a world in which nothing moves.
    #[inline(always)]
    pub(super) fn ray(&self, lane: usize) -> LocalRay {
        LocalRay {
            origin: column(&self.origin, lane).into(),
            direction: column(&self.direction, lane).into(),
            t_min: self.t_min[lane & (LANES - 1)],
            end: self.end[lane & (LANES - 1)],
            time: 0.0,
        }
    }

    /// Takes over the rays of another packet, carried into another space; of the lanes in `bits`, returns those that stay
    /// in the usable range. Operation by operation [`LocalRay::transformed`].
    #[inline(always)]
    pub(super) fn carry<S: Simd>(&mut self, simd: S, from: &Self, map: &Affine3A, bits: u16) -> u16 {
        let (x, y, z) = (map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis);
        let [ox, oy, oz] = load(simd, &from.origin);
        let [dx, dy, dz] = load(simd, &from.direction);
        for axis in 0..3 {
            let origin = ((ox * x[axis] + oy * y[axis]) + oz * z[axis]) + map.translation[axis];
            let direction = (dx * x[axis] + dy * y[axis]) + dz * z[axis];
            self.origin[axis] = origin.into();
            self.direction[axis] = direction.into();
        }
        (self.t_min, self.end, self.limit) = (from.t_min, from.end, from.limit);
        (self.met, self.is_mixed) = (0, from.is_mixed);
        in_range(simd, load(simd, &self.origin), load(simd, &self.direction)).to_bitmask() as u16 & bits
    }

    /// Finds the closest hit of each ray in `bits` in a subtree, or with `ANY` some hit that stops it; the answers are in
    /// `id` and `limit`. Returns the lanes that have one. A call: it is long, and compiled once for all who come here.
    #[inline(never)]
    pub(super) fn trace<S: Simd, const ANY: bool>(
        &mut self,
        simd: S,
        screen: Screen<'_>,
        bits: u16,
        visits: &mut Vec<Visit>,
        stack: &mut Stack,
    ) -> u16 {
        if ANY && !screen.panes.is_empty() {
            return self.trace_past(simd, screen, bits, visits, stack);
        }
        simd.vectorize(
            #[inline(always)]
            || self.trace_all::<S, ANY, false>(simd, screen, bits, visits, stack),
        )
    }

    /// For any hit past what lets light through. A call, so that the code above stays as where there is nothing of it.
    #[inline(never)]
    fn trace_past<S: Simd>(
        &mut self,
        simd: S,
        screen: Screen<'_>,
        bits: u16,
        visits: &mut Vec<Visit>,
        stack: &mut Stack,
    ) -> u16 {
        simd.vectorize(
            #[inline(always)]
            || self.trace_all::<S, true, true>(simd, screen, bits, visits, stack),
        )
    }

    #[inline(always)]
    fn trace_all<S: Simd, const ANY: bool, const PAST: bool>(
        &mut self,
        simd: S,
        screen: Screen<'_>,
        bits: u16,
        visits: &mut Vec<Visit>,
        stack: &mut Stack,
    ) -> u16 {
        let tree = &screen.bvh.tree;
        if tree.is_empty() {
            return 0;
        }
        self.id = [Self::NONE; LANES];
        self.prepare_boxes(simd, tree);
        self.prepare_triangles(simd);
        let mut rest = bits;
        while rest != 0 {
            let (octant, alike) = self.octant(rest);
            if self.is_mixed && alike != rest {
                self.trace_octant::<S, ANY, PAST, true>(simd, screen, octant, rest, visits, stack);
                break;
            }
            rest &= !alike;
            self.trace_octant::<S, ANY, PAST, false>(simd, screen, octant, alike, visits, stack);
        }
        let none = u32x16::splat(simd, Self::NONE);
        !(u32x16::load_array_ref(simd, &self.id).simd_eq(none).to_bitmask() as u16)
    }

    #[inline(always)]
    fn trace_octant<S: Simd, const ANY: bool, const PAST: bool, const MIXED: bool>(
        &mut self,
        simd: S,
        screen: Screen<'_>,
        octant: Octant,
        bits: u16,
        visits: &mut Vec<Visit>,
        stack: &mut Stack,
    ) {
        let nodes = screen.bvh.tree.view();
        let beam = if MIXED { self.hull(simd, bits) } else { self.beam(simd, octant, bits) };
        let Thresholds { few, many } = self.thresholds::<MIXED>(&beam, bits);
        let mark = visits.len();
        visits.push(self.visit(simd, screen.start, bits));
        while visits.len() > mark {
            let Some(visit) = visits.pop() else { return };
            let wanting = self.wanting(simd, &visit);
            let bits = wanting.to_bitmask() as u16;
            if bits == 0 {
                continue;
            }
            if visit.child.is_leaf() && bits.count_ones() >= many {
                let (first, end) = visit.child.block_range();
                for block in first..end {
                    self.together::<S, ANY, PAST, MIXED>(simd, screen, (octant, &beam), block, bits);
                }
                continue;
            }
            if bits.count_ones() <= few || visit.child.is_leaf() {
                self.alone::<S, ANY, PAST>(simd, screen, visit.child, bits, stack);
                continue;
            }
            let mut place = None;
            let node = nodes.get(simd, visit.child.0 as usize, &mut place);
            self.open::<S, MIXED>(simd, node, &screen.bvh.blocks(), (octant, &beam), wanting, visits);
        }
    }

    /// The octant of the first lane in `bits` (not empty), and the lanes among them that share it.
    #[inline(always)]
    pub(super) fn octant(&self, bits: u16) -> (Octant, u16) {
        let first = bits.trailing_zeros() & 15;
        let (mut number, mut near, mut alike) = (0, [0, 1, 2], bits);
        for (axis, (&negative, near)) in self.negative.iter().zip(&mut near).enumerate() {
            if negative >> first & 1 == 1 {
                number |= 1 << axis;
                *near += 3;
                alike &= negative;
            } else {
                alike &= !negative;
            }
        }
        (Octant { number, near }, alike)
    }

    /// A subtree that is wanted by the lanes in `bits`, wherever they enter it.
    #[inline(always)]
    pub(super) fn visit<S: Simd>(&self, simd: S, child: Child, bits: u16) -> Visit {
        let wanted = mask32x16::from_bitmask(simd, u64::from(bits));
        let start = f32x16::load_array_ref(simd, &self.t_min);
        let enter = wanted.select(start, f32x16::splat(simd, f32::NAN));
        Visit { enter: enter.into(), child }
    }

    /// The lanes that enter a subtree before they end.
    #[inline(always)]
    pub(super) fn wanting<S: Simd>(&self, simd: S, visit: &Visit) -> mask32x16<S> {
        f32x16::load_array_ref(simd, &visit.enter).simd_le(self.reach(simd))
    }

    /// How far boxes count.
    #[inline(always)]
    fn reach<S: Simd>(&self, simd: S) -> f32x16<S> {
        f32x16::load_array_ref(simd, &self.limit) * REACH
    }

    /// Makes something met at `t`, in whatever object, the limit for what is still to come.
    #[inline(always)]
    pub(super) fn settle(&mut self, lane: usize, t: f32) {
        self.limit[lane] = (t * REACH).min(self.end[lane]);
    }

    /// Pushes the children of a node that some of the `wanting` lanes meet, far ones first.
    #[inline(always)]
    pub(super) fn open<S: Simd, const MIXED: bool>(
        &self,
        simd: S,
        node: &Node,
        leaves: &(impl Leaves + ?Sized),
        (octant, beam): (Octant, &Beam),
        wanting: mask32x16<S>,
        visits: &mut Vec<Visit>,
    ) {
        let reach = self.reach(simd);
        let slabs = self.slabs(simd);
        let met_by_beam = beam.meet::<S, MIXED>(simd, node, octant.near, reach.reduce_max());
        let order = node.order[octant.number & 7];
        let mut ranks = ranks_of(simd, order, met_by_beam);
        visits.reserve(WIDTH);
        while ranks != 0 {
            let rank = 31 - ranks.leading_zeros();
            ranks &= !(1 << rank);
            let lane = (order >> (3 * rank) & 7) as usize;
            let (enter, met) = slabs.test::<MIXED>(simd, node, lane, octant.near, reach);
            let met = met & wanting;
            if met.to_bitmask() != 0 {
                let child = node.child[lane];
                if child.is_leaf() {
                    leaves.prefetch(child);
                }
                let enter = met.select(enter, f32x16::splat(simd, f32::NAN));
                visits.push(Visit { enter: enter.into(), child });
            }
        }
    }

    #[inline(always)]
    fn slabs<S: Simd>(&self, simd: S) -> Slabs<S> {
        let negative = |axis: usize| mask32x16::from_bitmask(simd, u64::from(self.negative[axis]));
        Slabs {
            inverse: load(simd, &self.inverse),
            near_shift: load(simd, &self.near_shift),
            far_shift: load(simd, &self.far_shift),
            negative: [negative(0), negative(1), negative(2)],
            t_min: f32x16::load_array_ref(simd, &self.t_min),
        }
    }

    /// The hits of the lanes that found something.
    #[inline(always)]
    pub(super) fn hits<S: Simd>(&self, simd: S, bvh: &TriangleBvh, found: u16, mesh: &mut MeshOf) -> Words {
        let gathered = settle::gather(simd, bvh, &self.id, found, mesh);
        Words::new(&settle::exact(simd, gathered.corners, &self.lined(simd)), &gathered)
    }

    /// The lanes in `bits` one by one through a subtree.
    #[inline(always)]
    fn alone<S: Simd, const ANY: bool, const PAST: bool>(
        &mut self,
        simd: S,
        screen: Screen<'_>,
        child: Child,
        bits: u16,
        stack: &mut Stack,
    ) {
        let mut rest = bits;
        while rest != 0 {
            let lane = (rest.trailing_zeros() & 15) as usize;
            rest &= rest - 1;
            let shear = self.shear_of(simd, lane);
            let best = Best { t: self.limit[lane], id: self.id[lane] };
            let slab = self.slab_of(simd, lane, self.near_of(lane));
            if ANY {
                let (limit, mut met) = (best.t, false);
                let blocks = screen.bvh.blocks();
                if single::any_below::<S, PAST>(
                    simd, screen, blocks, &slab, &shear, child, limit, &mut met, stack,
                ) {
                    (self.id[lane], self.limit[lane]) = (0, -1.0);
                }
                if PAST {
                    self.met |= u16::from(met) << lane;
                }
                continue;
            }
            let bvh = screen.bvh;
            let found = single::closest_below(simd, bvh, bvh.blocks(), &slab, &shear, child, best, stack);
            // Single words that were just written are slow to read with their neighbours.
            if found.id != best.id {
                (self.limit[lane], self.id[lane]) = (found.t, found.id);
            }
        }
    }

    #[inline(always)]
    pub(super) fn slab_of<S: Simd>(&self, simd: S, lane: usize, near: [usize; 3]) -> Slab<S> {
        let inverse = column(&self.inverse, lane);
        let (start, end) = (column(&self.near_shift, lane), column(&self.far_shift, lane));
        Slab::splat(simd, inverse, start, end, near, self.t_min[lane])
    }

    /// Which rows of a node's bounds are near for the ray in a lane.
    #[inline(always)]
    pub(super) fn near_of(&self, lane: usize) -> [usize; 3] {
        [0, 1, 2].map(|axis| axis + 3 * usize::from(self.negative[axis] >> (lane & 15) & 1))
    }

    #[inline(always)]
    fn shear_of<S: Simd>(&self, simd: S, lane: usize) -> Shear<S> {
        let (origin, shear) = (column(&self.sheared_origin, lane), column(&self.shear, lane));
        Shear::splat(simd, self.axis[lane] as usize, origin, shear, self.ray(lane))
    }

    /// How many of the lanes in `used` stay together.
    #[inline(always)]
    fn thresholds<const MIXED: bool>(&self, beam: &Beam, used: u16) -> Thresholds {
        if MIXED {
            return Thresholds { few: 5, many: 8 };
        }
        // Of lanes whose largest axes differ, triangles take longer.
        let alike = self.turned.iter().any(|turned| used & !turned == 0)
            || used & (self.turned[0] | self.turned[1]) == 0;
        match (beam.is_narrow(), alike) {
            (true, _) => Thresholds { few: 1, many: 2 },
            (false, true) => Thresholds { few: 5, many: 6 },
            (false, false) => Thresholds { few: 5, many: 8 },
        }
    }

    /// What [`Slab::new`] does, for all lanes.
    #[inline(always)]
    pub(super) fn prepare_boxes<S: Simd>(&mut self, simd: S, tree: &WideTree) {
        let o = load(simd, &self.origin);
        let d = load(simd, &self.direction);
        let (one, zero) = (f32x16::splat(simd, 1.0), f32x16::splat(simd, 0.0));
        let a = [d[0].abs(), d[1].abs(), d[2].abs()];
        let reach = o[0].abs().max(o[1].abs()).max(o[2].abs());
        let reach = (reach * (1.0 + tree.excess)).max(f32x16::splat(simd, tree.reach(0.0)));
        self.pad = (reach * (4.0 * slab::PLANE_SLACK)).into();
        let smallest = a[0].max(a[1]).max(a[2]) * slab::SMALLEST_COMPONENT;
        for axis in 0..3 {
            let inverse = one / a[axis].max(smallest).copysign(d[axis]);
            let pad = inverse.abs() * reach * slab::PLANE_SLACK;
            self.inverse[axis] = inverse.into();
            self.near_shift[axis] = o[axis].mul_add(inverse, pad).into();
            self.far_shift[axis] = o[axis].mul_sub(inverse, pad).into();
            self.negative[axis] = inverse.simd_lt(zero).to_bitmask() as u16;
        }
    }

    /// What [`Shear::new`] does, for all lanes.
    #[inline(always)]
    fn prepare_triangles<S: Simd>(&mut self, simd: S) {
        let shears = Shears::new(simd, load(simd, &self.origin), load(simd, &self.direction));
        self.sheared_origin = shears.origin.map(Into::into);
        self.shear = shears.shear.map(Into::into);
        let [x_is_largest, y_is_largest] = shears.turned;
        let axis = y_is_largest.select(u32x16::splat(simd, 1), u32x16::splat(simd, 2));
        let axis = x_is_largest.select(u32x16::splat(simd, 0), axis);
        self.axis = axis.into();
        self.turned = [x_is_largest.to_bitmask() as u16, y_is_largest.to_bitmask() as u16];
    }

    #[inline(always)]
    fn shears<S: Simd>(&self, simd: S) -> Shears<S> {
        let [x_is_largest, y_is_largest] = self.turned;
        Shears {
            turned: [
                mask32x16::from_bitmask(simd, u64::from(x_is_largest)),
                mask32x16::from_bitmask(simd, u64::from(y_is_largest)),
            ],
            origin: load(simd, &self.sheared_origin),
            shear: load(simd, &self.shear),
        }
    }

    #[inline(always)]
    fn lined<S: Simd>(&self, simd: S) -> Lined<f32x16<S>> {
        Lined {
            origin: load(simd, &self.origin),
            direction: load(simd, &self.direction),
            t_min: f32x16::load_array_ref(simd, &self.t_min),
            end: f32x16::load_array_ref(simd, &self.end),
        }
    }
}

/// What [`LocalRay::in_range`] says, for all lanes.
#[inline(always)]
fn in_range<S: Simd>(simd: S, origin: Triple<S>, direction: Triple<S>) -> mask32x16<S> {
    let limit = f32x16::splat(simd, MAX_COORDINATE);
    let longest = f32x16::splat(simd, *LocalRay::DIRECTION_RANGE.end());
    let shortest = f32x16::splat(simd, *LocalRay::DIRECTION_RANGE.start());
    let ([ox, oy, oz], [dx, dy, dz]) = (origin, direction);
    let (dx, dy, dz) = (dx.abs(), dy.abs(), dz.abs());
    // Comparisons are false for NaN; a maximum alone might drop one.
    let placed = ox.abs().simd_le(limit) & oy.abs().simd_le(limit) & oz.abs().simd_le(limit);
    let finite = dx.simd_le(longest) & dy.simd_le(longest) & dz.simd_le(longest);
    placed & finite & dx.max(dy).max(dz).simd_ge(shortest)
}

/// The children in `bits`, by their places in `order`.
#[inline(always)]
fn ranks_of<S: Simd>(simd: S, order: u32, bits: u32) -> u32 {
    let shifts = u32x8::load_array(simd, [0, 3, 6, 9, 12, 15, 18, 21]);
    let lanes = (u32x8::splat(simd, order) >> shifts) & 7;
    let there = (u32x8::splat(simd, bits) >> lanes) & 1;
    there.simd_gt(u32x8::splat(simd, 0)).to_bitmask() as u32
}

#[inline(always)]
fn column(v: &[Lanes; 3], lane: usize) -> [f32; 3] {
    let lane = lane & (LANES - 1);
    [v[0][lane], v[1][lane], v[2][lane]]
}
