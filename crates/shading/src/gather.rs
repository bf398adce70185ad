//! From hits to points: the corners of triangles are fetched hit by hit, and all that is computed from them runs on lanes.

use fearless_simd::{Level, Simd};
use glam::{Vec2, Vec3};
use heliostat_kernel::{Hit, Ray};
use heliostat_scene::{Geometry, Mesh};

use crate::lanes::{Floats, Mask, Packet, Real, Vector, Vectors, WIDTH, Whole, log2};
use crate::material::SurfaceMaterial;
use crate::packet::on_lanes;
use crate::placement::{Placement, ShadedPart};
use crate::point::{Arrival, Corners, Points, corners};
use crate::surface::LaneMode;

/// The triangles of sixteen hits, with all that their points are computed from.
#[repr(C)]
#[derive(Clone, Debug, Default)]
pub(crate) struct Triangles {
    /// The corners' positions and normals in object space, the latter zero where the mesh has none; for each set the corners'
    /// texture coordinates, and 1 where the mesh has them, 0 elsewhere.
    corners: Runs<32>,
    /// Columns of the linear part of the transform to the world, its translation, the columns of the transform of normals,
    /// and [`Placement::detour`].
    placements: Runs<22>,
    /// Whether any mesh has normals.
    smooth: bool,
    /// 1 where the interpolated normal pointed to the back and was turned round, 0 elsewhere.
    turned: Floats,
}

/// Values that neighbouring lanes often share.
#[repr(C)]
#[derive(Clone, Debug)]
struct Runs<const N: usize> {
    /// Which of the values is a lane's.
    of: Floats,
    values: [[f32; N]; WIDTH],
    count: usize,
}

impl<const N: usize> Default for Runs<N> {
    fn default() -> Self {
        Self { of: Floats::ZERO, values: [[0.0; N]; WIDTH], count: 0 }
    }
}

impl<const N: usize> Runs<N> {
    /// The place of the values of the lanes from `lane` on.
    #[inline(always)]
    fn begin(&mut self, lane: usize) -> &mut [f32; N] {
        self.count = if lane == 0 { 1 } else { self.count + 1 };
        self.go_on(lane);
        &mut self.values[(self.count - 1) % WIDTH]
    }

    /// Another lane has the values of the lane before.
    #[inline(always)]
    fn go_on(&mut self, lane: usize) {
        self.of.0[lane % WIDTH] = (self.count - 1) as f32;
    }

    /// Which of the values are those of lanes from `lane` on.
    #[inline(always)]
    fn of<F: Real>(&self, token: F::Token, lane: usize) -> F {
        F::gather(token, lane, |lane| self.of.0[lane])
    }

    /// Some values of lanes from `lane` on, `of` being which; the first of them is the one at `start`.
    #[inline(always)]
    fn load<F: Real, const M: usize>(&self, of: F, lane: usize, start: usize) -> [F; M] {
        let mut lanes = [of.splat(0.0); M];
        if F::LANES == 1 {
            let own = &self.values[self.of.0[lane] as usize % WIDTH];
            for (value, &own) in lanes.iter_mut().zip(&own[start..start + M]) {
                *value = of.splat(own);
            }
            return lanes;
        }
        for (run, values) in self.values[..self.count.min(WIDTH)].iter().enumerate() {
            let here = of.equals(of.splat(run as f32));
            for (lanes, &value) in lanes.iter_mut().zip(&values[start..start + M]) {
                *lanes = of.splat(value).where_or(here, *lanes);
            }
        }
        lanes
    }
}

/// A hit with what it lies on.
pub(crate) type Reached<'a> = (Arrival<'a>, &'a Placement, &'a ShadedPart);

impl Points {
    /// Fills lanes with the points of `material` where `count` rays arrived, in their order. In packets there must be
    /// something to compute with in every lane.
    pub(crate) fn gather<'a>(
        &mut self,
        mode: LaneMode,
        material: &SurfaceMaterial,
        (reached, count): (&[Reached<'a>], usize),
        triangles: &mut Triangles,
    ) {
        let all = reached;
        let reached = &reached[..count];
        self.read_attributes(material, reached);
        (self.color, self.alpha) = (WHITE, WHITE.x);
        let mut others = 0_u32;
        triangles.smooth = false;
        let mut before: Option<&Hit> = None;
        let mut place_before: Option<&Placement> = None;
        for (lane, &(arrival, placement, part)) in reached.iter().enumerate().take(WIDTH) {
            match place_before {
                Some(place) if std::ptr::eq(place, placement) => triangles.placements.go_on(lane),
                _ => {
                    let moved = placement.at(arrival.ray.time);
                    place(moved.as_ref().unwrap_or(placement), triangles.placements.begin(lane));
                }
            }
            place_before = placement.motion.is_none().then_some(placement);
            let hit = arrival.hit;
            match &part.shape {
                Geometry::Mesh(mesh) => {
                    match before {
                        Some(before) if is_same_triangle(before, hit) => triangles.corners.go_on(lane),
                        _ => triangles.fetch(lane, mesh, material, &arrival),
                    }
                    self.paint(lane, mesh, &arrival);
                    before = mesh.motion.is_empty().then_some(hit);
                }
                Geometry::Quadrics(_) => {
                    others |= 1 << lane;
                    // Something to compute with, in vain.
                    *triangles.corners.begin(lane) = [0.0; 32];
                    before = None;
                }
            }
        }
        on_lanes!(mode, count, |token, lane| interpolate::<_>(token, lane, material, all, triangles, self));
        if others == 0 && !material.has_normal_maps() {
            return;
        }
        for (lane, &(arrival, placement, part)) in reached.iter().enumerate().take(WIDTH) {
            let moved = placement.at(arrival.ray.time);
            let placement = moved.as_ref().unwrap_or(placement);
            match &part.shape {
                Geometry::Mesh(mesh) => {
                    let smooth = (self.normal.get(lane), triangles.turned.0[lane] != 0.0);
                    let hit = arrival.hit;
                    let corners =
                        Corners::new(mesh, hit.primitive, Vec2::new(hit.u, hit.v), arrival.ray.time);
                    self.orient(lane, material, |slot| corners.tangent_basis(placement, smooth, slot));
                }
                Geometry::Quadrics(quadrics) => {
                    let shape = &quadrics.shapes[arrival.hit.primitive as usize];
                    self.set_quadric(lane, (placement, shape, material), &arrival);
                }
            }
        }
    }

    /// The mesh's colour in a lane.
    fn paint(&mut self, lane: usize, mesh: &Mesh, Arrival { hit, .. }: &Arrival<'_>) {
        if mesh.colors.is_empty() {
            return;
        }
        let indices = mesh.indices[hit.primitive as usize].map(|i| i as usize);
        if let Some([a, b, c]) = three(&mesh.colors, indices) {
            let color = a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v;
            self.color.set(lane, color.truncate());
            self.alpha.0[lane] = color.w;
        }
    }
}

fn is_same_triangle(a: &Hit, b: &Hit) -> bool {
    a.primitive == b.primitive && a.is_on_part_of(b)
}

const WHITE: Vectors = {
    let one = Floats::splat(1.0);
    Vectors { x: one, y: one, z: one }
};

/// What points need of a placement, in the order of [`Triangles::placements`].
fn place(placement: &Placement, to: &mut [f32; 22]) {
    let (linear, normals) = (&placement.world_from_object.matrix3, &placement.world_from_object_normal);
    to[..9].copy_from_slice(&linear.to_cols_array());
    to[9..12].copy_from_slice(&placement.world_from_object.translation.to_array());
    to[12..21].copy_from_slice(&normals.to_cols_array());
    to[21] = placement.detour;
}

impl Triangles {
    /// Reads the corners of a lane's triangle.
    fn fetch(&mut self, lane: usize, mesh: &Mesh, material: &SurfaceMaterial, arrival: &Arrival<'_>) {
        let [a, b, c] = mesh.indices[arrival.hit.primitive as usize];
        let indices = [a as usize, b as usize, c as usize];
        let to = self.corners.begin(lane);
        let [a, b, c] = corners(mesh, indices, arrival.ray.time);
        to[..9].copy_from_slice(&[a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z]);
        let normals = three(&mesh.normals, indices);
        self.smooth |= normals.is_some();
        let [a, b, c] = normals.unwrap_or([Vec3::ZERO; 3]);
        to[9..18].copy_from_slice(&[a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z]);
        for (set, uvs) in mesh.uvs.iter().enumerate().filter(|&(set, _)| material.uses_uvs(set)) {
            let corners = three(uvs, indices);
            let known = f32::from(u8::from(corners.is_some()));
            let [a, b, c] = corners.unwrap_or([Vec2::ZERO; 3]);
            to[18 + 7 * set..][..7].copy_from_slice(&[a.x, a.y, b.x, b.y, c.x, c.y, known]);
        }
    }
}

/// The values at three vertices; `None` if there are none.
fn three<T: Copy>(values: &[T], [a, b, c]: [usize; 3]) -> Option<[T; 3]> {
    Some([*values.get(a)?, *values.get(b)?, *values.get(c)?])
}

/// What points are computed from, in registers.
#[derive(Clone, Copy)]
struct Lanes<F> {
    /// Barycentric weights of the corners.
    weights: [F; 3],
    /// Columns of the linear part.
    linear: [Vector<F>; 3],
}

impl<F: Real> Lanes<F> {
    #[inline(always)]
    fn mix(&self, [a, b, c]: [Vector<F>; 3]) -> Vector<F> {
        let [wa, wb, wc] = self.weights;
        a * wa + b * wb + c * wc
    }
}

/// Columns times a vector.
#[inline(always)]
fn transform<F: Real>([x, y, z]: [Vector<F>; 3], v: Vector<F>) -> Vector<F> {
    x * v.x + y * v.y + z * v.z
}

/// Three vectors that stand one after the other.
#[inline(always)]
fn vectors<F: Real>([ax, ay, az, bx, by, bz, cx, cy, cz]: [F; 9]) -> [Vector<F>; 3] {
    [Vector::new(ax, ay, az), Vector::new(bx, by, bz), Vector::new(cx, cy, cz)]
}

/// Four numbers that lie side by side in memory, for lanes from `lane` on.
#[inline(always)]
fn quads<F: Real>(token: F::Token, lane: usize, from: impl Fn(usize) -> [u32; 4]) -> [F; 4] {
    let [a, b, c, d] = F::Whole::gather_quads(token, lane, from);
    [a.as_real_bits(), b.as_real_bits(), c.as_real_bits(), d.as_real_bits()]
}

/// A placement in registers.
#[derive(Clone, Copy)]
struct Place<F> {
    /// Columns.
    linear: [Vector<F>; 3],
    translation: Vector<F>,
    /// Columns of the transform of normals.
    normals: [Vector<F>; 3],
    detour: F,
}

impl<F: Real> Place<F> {
    /// The placement of all lanes.
    #[inline(always)]
    fn one(token: F::Token, values: &[f32; 22]) -> Self {
        let mut lanes = [F::constant(token, 0.0); 22];
        for (lanes, &value) in lanes.iter_mut().zip(values) {
            *lanes = F::constant(token, value);
        }
        Self::new(lanes)
    }

    /// The placements of lanes from `lane` on.
    #[inline(always)]
    fn load(token: F::Token, placements: &Runs<22>, lane: usize) -> Self {
        let of = placements.of::<F>(token, lane);
        Self::new(placements.load(of, lane, 0))
    }

    /// From values in the order of [`Triangles::placements`].
    #[inline(always)]
    fn new(values: [F; 22]) -> Self {
        let [
            ax,
            ay,
            az,
            bx,
            by,
            bz,
            cx,
            cy,
            cz,
            x,
            y,
            z,
            nax,
            nay,
            naz,
            nbx,
            nby,
            nbz,
            ncx,
            ncy,
            ncz,
            detour,
        ] = values;
        Self {
            linear: vectors([ax, ay, az, bx, by, bz, cx, cy, cz]),
            translation: Vector::new(x, y, z),
            normals: vectors([nax, nay, naz, nbx, nby, nbz, ncx, ncy, ncz]),
            detour,
        }
    }
}

/// The points of triangles, from `lane` on.
#[inline(always)]
fn interpolate<F: Real>(
    token: F::Token,
    lane: usize,
    material: &SurfaceMaterial,
    reached: &[Reached<'_>],
    triangles: &mut Triangles,
    points: &mut Points,
) {
    // One placement for all is the rule, and takes no registers.
    if triangles.placements.count == 1 {
        let place = Place::<F>::one(token, &triangles.placements.values[0]);
        interpolate_at((token, lane), material, place, reached, triangles, points);
    } else {
        let place = Place::<F>::load(token, &triangles.placements, lane);
        interpolate_at((token, lane), material, place, reached, triangles, points);
    }
}

#[inline(always)]
fn interpolate_at<F: Real>(
    (token, lane): (F::Token, usize),
    material: &SurfaceMaterial,
    Place { linear, translation, normals, detour }: Place<F>,
    reached: &[Reached<'_>],
    triangles: &mut Triangles,
    points: &mut Points,
) {
    let own = &reached[lane..lane + F::LANES];
    let arrival = |at: usize| &own[at - lane].0;
    let hit = |lane: usize| arrival(lane).hit;
    // Words that lie side by side in memory, read together.
    let [distance, u, v, ng_x] = quads::<F>(token, lane, |lane| {
        let &Hit { t, u, v, ng, .. } = hit(lane);
        [t, u, v, ng.x].map(f32::to_bits)
    });
    let [ng_y, ng_z, ..] = quads::<F>(token, lane, |lane| {
        let &Hit { ng, geometry, primitive, .. } = hit(lane);
        [ng.y.to_bits(), ng.z.to_bits(), geometry, primitive]
    });
    let [x, y, z, _] = quads::<F>(token, lane, |lane| {
        let &Ray { direction, t_max, .. } = arrival(lane).ray;
        [direction.x, direction.y, direction.z, t_max].map(f32::to_bits)
    });
    let (ng, wo) = (Vector::new(ng_x, ng_y, ng_z), -Vector::new(x, y, z));
    let width = F::gather(token, lane, |lane| arrival(lane).cone.width);
    ng.store(&mut points.ng, lane);
    wo.store(&mut points.wo, lane);
    let corner_of = triangles.corners.of::<F>(token, lane);
    let lanes = Lanes { weights: [u.complement() - v, u, v], linear };
    let corners = vectors(triangles.corners.load(corner_of, lane, 0));
    let at = lanes.mix(corners);
    (transform(lanes.linear, at) + translation).store(&mut points.position, lane);

    // As for `Placement::rounding`.
    let [a, b, c] = corners;
    let [mx, my, mz] = lanes.linear;
    let largest = a.abs().max(b.abs()).max(c.abs());
    let magnitude = (transform([mx.abs(), my.abs(), mz.abs()], largest) + translation.abs()).largest();
    let error = (magnitude + detour) * Placement::ROUNDING;
    error.store(&mut points.error, lane);

    if triangles.smooth {
        let smooth = lanes.mix(vectors(triangles.corners.load(corner_of, lane, 9)));
        let smooth = transform(normals, smooth).normalized_or(ng);
        // Some files' normals disagree with their winding; the winding decides which side is the front.
        let turned = smooth.dot(ng).lt(u.splat(0.0));
        (-smooth).where_or(turned, smooth).store(&mut points.normal, lane);
        u.splat(1.0).only(turned).store(&mut triangles.turned, lane);
    } else {
        ng.store(&mut points.normal, lane);
        u.splat(0.0).store(&mut triangles.turned, lane);
    }
    if !material.is_textured() {
        return;
    }
    if material.shader.is_some() {
        width.store(&mut points.width, lane);
        distance.store(&mut points.distance, lane);
        let level = F::gather(token, lane, |lane| arrival(lane).level as f32);
        level.store(&mut points.level, lane);
        at.store(&mut points.object_position, lane);
        let [x, y, z] = normals;
        // The inverse is the transpose of what takes normals.
        Vector::new(x.x, y.x, z.x).store(&mut points.object_from_world[0], lane);
        Vector::new(x.y, y.y, z.y).store(&mut points.object_from_world[1], lane);
        Vector::new(x.z, y.z, z.z).store(&mut points.object_from_world[2], lane);
    }
    let (along_u, along_v) = (transform(lanes.linear, b - a), transform(lanes.linear, c - a));
    let normal = along_u.cross(along_v);
    let world_area = normal.length();
    let cos = ng.dot(wo).abs();
    // At grazing angles the footprint is an ellipse, which a row of squares covers. Limiting its length bounds the work, and
    // the samples of the pixel filter the rest.
    let stretch = cos.max(cos.splat(1.0 / LONGEST)).recip();
    let count = (stretch / LONGEST_PROBE).floor() + 1.0;
    count.store(&mut points.probes.count, lane);
    let (mut probe, mut axis) = (width * stretch, [cos.splat(0.0); 2]);
    // Squares lie side by side for few lanes.
    if count.gt(cos.splat(1.0)).any() {
        probe = probe / count;
        // Where the longer axis ends, from the corner of the triangle: its shares of the edges.
        let flat = wo - ng * ng.dot(wo);
        let along = flat.normalized_or(flat) * (width * stretch);
        let inverse = normal.length_squared().max(cos.splat(f32::MIN_POSITIVE)).recip();
        axis = [along.cross(along_v).dot(normal) * inverse, along_u.cross(along).dot(normal) * inverse];
    }
    for set in 0..2 {
        if material.uses_uvs(set) {
            let (area, known) = map(lane, (set, corner_of), (lanes.weights, axis), triangles, points);
            let texels = area / world_area;
            lod(texels, probe).only(known).store(&mut points.probes.lod[set], lane);
            if material.shader.is_some() {
                // One square as wide as the ellipse is long, up to a limit.
                let widest = width * stretch.min(cos.splat(WIDEST));
                lod(texels, widest).only(known).store(&mut points.lod[set], lane);
            }
        }
    }
}

/// log2 of the width in texture space of a square, metres wide, where a square metre has `area` there.
#[inline(always)]
fn lod<F: Real>(area: F, width: F) -> F {
    log2((area * width.squared()).max(width.splat(1e-30))) * 0.5
}

/// Footprints are no longer than so many of their widths.
const LONGEST: f32 = 7.99;
/// A probe's share of a footprint is no longer than so many of its widths.
const LONGEST_PROBE: f32 = 2.0;
/// The square that shaders are told of is at most so many times as wide as the footprint.
const WIDEST: f32 = 4.0;

/// Texture coordinates of a set and the footprint's longer axis in them. Twice the triangle's area there, and where the mesh
/// has the set.
#[inline(always)]
fn map<F: Real>(
    lane: usize,
    (set, corner_of): (usize, F),
    ([wa, wb, wc], [axis_b, axis_c]): ([F; 3], [F; 2]),
    triangles: &Triangles,
    points: &mut Points,
) -> (F, F::Mask) {
    let [ua, va, ub, vb, uc, vc, known] = triangles.corners.load(corner_of, lane, 18 + 7 * set);
    (ua * wa + ub * wb + uc * wc).store(&mut points.uv[set][0], lane);
    (va * wa + vb * wb + vc * wc).store(&mut points.uv[set][1], lane);
    let (u_b, u_c, v_b, v_c) = (ub - ua, uc - ua, vb - va, vc - va);
    (u_b * axis_b + u_c * axis_c).store(&mut points.probes.along[set][0], lane);
    (v_b * axis_b + v_c * axis_c).store(&mut points.probes.along[set][1], lane);
    ((u_b * v_c - v_b * u_c).abs(), known.gt(known.splat(0.0)))
}
