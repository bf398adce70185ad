//! A tile's groups against a block of 8 triangles ([`Setup`]), in whichever loop order is cheapest.
//!
//! What rounding leaves in doubt (a ray along an edge, a surface about as near as another one or as the ray's end, a
//! triangle seen along its plane) is decided by the test of single rays. So tiles answer like single rays, bit for bit.
use fearless_simd::{f32x8, f32x16, mask32x16, prelude::*, u32x16};

use super::{
    setup::{Setup, cross_triangle, load, met},
    walk::{BoxRange, Frame, meet},
    work::{GROUP, Rays, Work, mask16},
};
use crate::{
    layout::WIDTH,
    through::Screen,
    traverse::{
        local::REACH,
        settle::{self, CLOSE, Lined},
        shear::Shears,
    },
};

/// A leaf as a tile sees it.
pub(super) struct Leaf<'a> {
    frame: &'a Frame,
    tile: Rays<'a>,
    screen: Screen<'a>,
    /// Groups with a ray that meets the leaf's box, and those rays.
    mask: u16,
    rays: [u16; GROUP],
}

impl<'a> Leaf<'a> {
    /// Narrows the groups in `mask` down to rays, unless they are smaller than the box: a scattered group meets boxes that
    /// none of its rays does.
    #[inline(always)]
    pub(super) fn new<S: Simd>(
        simd: S,
        frame: &'a Frame,
        tile: Rays<'a>,
        screen: Screen<'a>,
        range: &BoxRange,
        mask: u16,
        work: &Work,
    ) -> Self {
        let size = (range.u[1] - range.u[0]).min(range.v[1] - range.v[0]);
        let (mask, rays) = if work.extent * range.near <= size {
            (mask, [u16::MAX; GROUP])
        } else {
            rays_in_box(simd, work, mask, range, frame.slack)
        };
        Self { frame, tile, screen, mask, rays }
    }
}

/// The groups of `mask` with a ray that meets the box nearer than what it has, and those rays.
#[inline(always)]
pub(super) fn rays_in_box<S: Simd>(
    simd: S,
    work: &Work,
    mask: u16,
    range: &BoxRange,
    slack: f32,
) -> (u16, [u16; GROUP]) {
    let (mut met, mut rays) = (0, [0; GROUP]);
    let mut rest = mask;
    while rest != 0 {
        let g = (rest.trailing_zeros() & 15) as usize;
        rest &= rest - 1;
        rays[g] = rays_meeting(simd, work, g, range, slack);
        met |= u16::from(rays[g] != 0) << g;
    }
    (met, rays)
}

/// Tests a block against the rays of a leaf; a bit for each group of which some changed.
#[inline(always)]
pub(super) fn test_block<S: Simd, const ANY: bool, const PAST: bool>(
    simd: S,
    leaf: &Leaf<'_>,
    work: &mut Work,
    setup: &mut Setup,
    block: usize,
) -> u16 {
    let mask = leaf.mask;
    if mask == 0 {
        return 0;
    }
    let rect = work.rect_of(mask);
    let mut place = None;
    let triangles = leaf.screen.bvh.blocks().get(block, &mut place);
    let mut bits = setup.fill(simd, leaf.frame, triangles, rect, work.far);
    if PAST {
        let passed = leaf.screen.passed(&triangles.triangle, bits);
        note(simd, leaf, work, setup, block, passed);
        bits &= !passed;
    }
    if bits == 0 {
        return 0;
    }
    if mask.count_ones() <= bits.count_ones() || is_scattered(leaf) {
        groups_outside::<S, ANY>(simd, leaf, work, setup, block, bits)
    } else {
        triangles_outside::<S, ANY>(simd, leaf, work, setup, block, bits)
    }
}

/// Notes the rays that meet one of the triangles in `passed`, which let light through; once for each is enough.
#[inline(always)]
fn note<S: Simd>(simd: S, leaf: &Leaf<'_>, work: &mut Work, setup: &Setup, block: usize, passed: u32) {
    let mut mask = leaf.mask;
    for (g, (rays, met)) in leaf.rays.iter().zip(&work.met).enumerate() {
        mask &= !(u16::from(rays & !met == 0) << g);
    }
    let mut rest = if mask == 0 { 0 } else { passed };
    while rest != 0 {
        let lane = (rest.trailing_zeros() & 7) as usize;
        rest &= rest - 1;
        let mut groups = setup.groups_meeting(simd, work, lane, mask);
        while groups != 0 {
            let g = (groups.trailing_zeros() & 15) as usize;
            groups &= groups - 1;
            let (met, doubt) = meeting(simd, work, setup, g, lane);
            work.met[g] |= met;
            let doubt = doubt & !work.met[g];
            if doubt != 0 {
                work.met[g] |= settle_meeting(simd, leaf, g, doubt, block, lane);
            }
        }
    }
}

/// The rays of group `g` that meet a triangle nearer than their ends, and those that may.
#[inline(always)]
fn meeting<S: Simd>(simd: S, work: &Work, setup: &Setup, g: usize, lane: usize) -> (u16, u16) {
    let (u, v) = (f32x16::load_array_ref(simd, &work.u[g]), f32x16::load_array_ref(simd, &work.v[g]));
    let start = f32x16::load_array_ref(simd, &work.iz_start[g]);
    let iz = f32x16::load_array_ref(simd, &work.iz[g]);
    let (least, z) = cross_triangle(simd, setup, lane, [u, v]);
    let met = met(simd, setup, lane, least, z, [start, iz]).to_bitmask() as u16;
    let may = least.simd_ge(f32x16::splat(simd, 0.0)) & z.simd_ge(iz * (1.0 - CLOSE));
    (met, may.to_bitmask() as u16 & !met)
}

/// Those rays in `doubt` of group `g` that meet triangle `lane` of a block, by the test of single rays, and where.
#[inline(always)]
fn test_again<S: Simd>(
    simd: S,
    rays: &Lined<f32x16<S>>,
    corners: &[[f32x16<S>; 3]; 3],
    doubt: u16,
) -> (f32x16<S>, mask32x16<S>) {
    let shears = Shears::new(simd, rays.origin, rays.direction);
    let meeting = shears.test(simd, corners, mask16(simd, doubt), [rays.t_min, rays.end]);
    let t = meeting.settled(simd, corners, rays);
    (t, meeting.inside & t.simd_gt(rays.t_min) & t.simd_le(rays.end))
}

/// Those rays in `doubt` of group `g` that meet triangle `lane` of a block.
#[cold]
#[inline(never)]
fn settle_meeting<S: Simd>(simd: S, leaf: &Leaf<'_>, g: usize, doubt: u16, block: usize, lane: usize) -> u16 {
    simd.vectorize(
        #[inline(always)]
        || {
            let corners = settle::corners(simd, leaf.screen.bvh.blocks(), (block * WIDTH + lane) as u32);
            let (_, met) = test_again(simd, &leaf.tile.lined(simd, g), &corners, doubt);
            met.to_bitmask() as u16
        },
    )
}

/// Decides whether triangle `lane` of a block is to be kept for the rays in `doubt` of group `g`; whether it was for some.
#[cold]
#[inline(never)]
fn settle_doubt<S: Simd, const ANY: bool>(
    simd: S,
    leaf: &Leaf<'_>,
    work: &mut Work,
    g: usize,
    doubt: u16,
    block: usize,
    lane: usize,
) -> bool {
    simd.vectorize(
        #[inline(always)]
        || {
            let blocks = leaf.screen.bvh.blocks();
            let id = (block * WIDTH + lane) as u32;
            let rays = leaf.tile.lined(simd, g);
            let (t, met) = test_again(simd, &rays, &settle::corners(simd, blocks, id), doubt);
            let ids = u32x16::load_array_ref(simd, &work.id[g]);
            let iz = f32x16::load_array_ref(simd, &work.iz[g]);
            let z = f32x16::splat(simd, 1.0) / (t * f32x16::load_array_ref(simd, &work.scale[g]));
            let fresh = ids.simd_eq(u32x16::splat(simd, Work::NONE)) | z.simd_gt(iz * (1.0 + CLOSE));
            let tied = (met & !fresh & z.simd_ge(iz * (1.0 - CLOSE))).to_bitmask() as u16;
            let mut nearest = met & fresh;
            if tied != 0 {
                let first = settle::precede(simd, blocks, &rays, id, &work.id[g], tied);
                nearest |= mask16(simd, first);
            }
            let z = if ANY { f32x16::splat(simd, f32::INFINITY) } else { z };
            work.iz[g] = nearest.select(z, iz).into();
            work.id[g] = nearest.select(u32x16::splat(simd, id), ids).into();
            nearest.to_bitmask() != 0
        },
    )
}

/// Whether the groups have few rays each in the leaf, so that going ray by ray is cheaper.
#[inline(always)]
fn is_scattered(leaf: &Leaf<'_>) -> bool {
    let mut rays = 0;
    for bits in leaf.rays {
        rays += bits.count_ones();
    }
    rays <= 3 * leaf.mask.count_ones()
}

/// Loops over groups, then over their rays or triangles, whichever are fewer.
#[inline(always)]
fn groups_outside<S: Simd, const ANY: bool>(
    simd: S,
    leaf: &Leaf<'_>,
    work: &mut Work,
    setup: &Setup,
    block: usize,
    bits: u32,
) -> u16 {
    let mut changed = 0;
    let mut rest = leaf.mask;
    while rest != 0 {
        let g = (rest.trailing_zeros() & 15) as usize;
        rest &= rest - 1;
        let rays = leaf.rays[g];
        let hit = if rays.count_ones() <= 2 {
            each_ray::<S, ANY>(simd, leaf, work, setup, g, bits, block)
        } else {
            let rect = [work.u0[g], work.u1[g], work.v0[g], work.v1[g]];
            let bits = setup.meeting(simd, rect, work.reach[g], bits);
            if rays.count_ones() <= bits.count_ones() {
                each_ray::<S, ANY>(simd, leaf, work, setup, g, bits, block)
            } else {
                each_triangle::<S, ANY>(simd, leaf, work, setup, g, bits, block)
            }
        };
        changed |= u16::from(hit) << g;
    }
    changed
}

/// Loops over triangles, then over the groups that each may meet.
#[inline(always)]
fn triangles_outside<S: Simd, const ANY: bool>(
    simd: S,
    leaf: &Leaf<'_>,
    work: &mut Work,
    setup: &Setup,
    block: usize,
    bits: u32,
) -> u16 {
    let mut changed = 0;
    let mut rest = bits;
    while rest != 0 {
        let lane = (rest.trailing_zeros() & 7) as usize;
        rest &= rest - 1;
        let mut groups = setup.groups_meeting(simd, work, lane, leaf.mask);
        while groups != 0 {
            let g = (groups.trailing_zeros() & 15) as usize;
            groups &= groups - 1;
            let hit = each_triangle::<S, ANY>(simd, leaf, work, setup, g, 1 << lane, block);
            changed |= u16::from(hit) << g;
        }
    }
    changed
}

/// The rays of group `g` that meet the leaf's box nearer than what they have.
#[inline(always)]
fn rays_meeting<S: Simd>(simd: S, work: &Work, g: usize, range: &BoxRange, slack: f32) -> u16 {
    let (u, v) = (&work.u[g], &work.v[g]);
    let met = meet(simd, range, slack, [u, u], [v, v]);
    let iz = f32x16::load_array_ref(simd, &work.iz[g]);
    let nearer = (iz * range.near).simd_le(f32x16::splat(simd, REACH));
    (met & nearer).to_bitmask() as u16
}

/// 16 rays in lanes, one triangle after the other.
#[inline(always)]
fn each_triangle<S: Simd, const ANY: bool>(
    simd: S,
    leaf: &Leaf<'_>,
    work: &mut Work,
    setup: &Setup,
    g: usize,
    bits: u32,
    block: usize,
) -> bool {
    let mut changed = false;
    let mut rest = bits;
    // Left for what is in doubt, and begun anew behind it: a call inside would cost the loop its registers.
    while rest != 0 {
        let u = f32x16::load_array_ref(simd, &work.u[g]);
        let v = f32x16::load_array_ref(simd, &work.v[g]);
        let start = f32x16::load_array_ref(simd, &work.iz_start[g]);
        let mut iz = f32x16::load_array_ref(simd, &work.iz[g]);
        let mut id = u32x16::load_array_ref(simd, &work.id[g]);
        let (mut any, mut doubt, mut lane) = (0, 0, 0);
        while rest != 0 && doubt == 0 {
            lane = (rest.trailing_zeros() & 7) as usize;
            rest &= rest - 1;
            let (least, z) = cross_triangle(simd, setup, lane, [u, v]);
            let may = least.simd_ge(f32x16::splat(simd, 0.0)) & z.simd_ge(iz * (1.0 - CLOSE));
            let may = may.to_bitmask() as u16;
            if may == 0 {
                continue;
            }
            let hit = met(simd, setup, lane, least, z, [start, iz]);
            any |= hit.to_bitmask() as u16;
            doubt = may & !(hit.to_bitmask() as u16);
            iz = hit.select(if ANY { f32x16::splat(simd, f32::INFINITY) } else { z }, iz);
            id = hit.select(u32x16::splat(simd, (block * WIDTH + lane) as u32), id);
        }
        if any != 0 {
            work.iz[g] = iz.into();
            work.id[g] = id.into();
            changed = true;
        }
        if doubt != 0 {
            changed |= settle_doubt::<S, ANY>(simd, leaf, work, g, doubt, block, lane);
        }
    }
    changed
}

/// 8 triangles in lanes, one ray after the other: for the few rays of a scattered group.
#[inline(always)]
fn each_ray<S: Simd, const ANY: bool>(
    simd: S,
    leaf: &Leaf<'_>,
    work: &mut Work,
    setup: &Setup,
    g: usize,
    bits: u32,
    block: usize,
) -> bool {
    let edge = [load(simd, &setup.edge[0]), load(simd, &setup.edge[1]), load(simd, &setup.edge[2])];
    let depth = load(simd, &setup.depth);
    let farthest = f32x8::load_array_ref(simd, &setup.depth_range[0]);
    let nearest = f32x8::load_array_ref(simd, &setup.depth_range[1]);
    let clear = f32x8::load_array_ref(simd, &setup.clear);
    let zero = f32x8::splat(simd, 0.0);
    let mut any = false;
    let mut rest = leaf.rays[g];
    while rest != 0 {
        let r = (rest.trailing_zeros() & 15) as usize;
        rest &= rest - 1;
        let (u, v) = (f32x8::splat(simd, work.u[g][r]), f32x8::splat(simd, work.v[g][r]));
        let e0 = edge[0][0].mul_add(u, edge[0][1].mul_add(v, edge[0][2]));
        let e1 = edge[1][0].mul_add(u, edge[1][1].mul_add(v, edge[1][2]));
        let e2 = edge[2][0].mul_add(u, edge[2][1].mul_add(v, edge[2][2]));
        let z = depth[0].mul_add(u, depth[1].mul_add(v, depth[2])).max(farthest).min(nearest);
        let least = e0.min(e1).min(e2);
        let so_far = f32x8::splat(simd, work.iz[g][r] * (1.0 - CLOSE));
        let may = least.simd_ge(zero) & z.simd_ge(so_far);
        let mut may = may.to_bitmask() as u32 & bits;
        if may == 0 {
            continue;
        }
        let start = f32x8::splat(simd, work.iz_start[g][r] * (1.0 - CLOSE));
        let sure = (least.simd_ge(clear) & z.simd_lt(start)).to_bitmask() as u32;
        let z: [f32; 8] = z.into();
        while may != 0 {
            let lane = (may.trailing_zeros() & 7) as usize;
            may &= may - 1;
            let so_far = work.iz[g][r];
            if z[lane] < so_far * (1.0 - CLOSE) {
                continue;
            }
            if sure >> lane & 1 != 0 && z[lane] > so_far * (1.0 + CLOSE) {
                any = true;
                work.iz[g][r] = if ANY { f32::INFINITY } else { z[lane] };
                work.id[g][r] = (block * WIDTH + lane) as u32;
            } else {
                any |= settle_doubt::<S, ANY>(simd, leaf, work, g, 1 << r, block, lane);
            }
            if ANY && work.iz[g][r] == f32::INFINITY {
                break;
            }
        }
    }
    any
}
