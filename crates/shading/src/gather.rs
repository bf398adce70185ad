//! From hits to points: the corners of triangles are fetched hit by hit, and all that is computed from them runs on lanes.

use fearless_simd::{Level, Simd};
use glam::{Mat3A, Vec2, Vec3};
use heliostat_kernel::Hit;
use heliostat_scene::{Geometry, Mesh};

use crate::lanes::{Floats, Packet, Real, Vector, Vectors, WIDTH, log2};
use crate::material::SurfaceMaterial;
use crate::packet::on_lanes;
use crate::placement::{Placement, ShadedPart};
use crate::point::{Arrival, Corners, Points, corners};
use crate::surface::LaneMode;

/// The triangles of sixteen hits, with all that their points are computed from.
#[repr(C)]
#[derive(Clone, Debug, Default)]
pub(crate) struct Triangles {
    /// Object space.
    positions: [Vectors; 3],
    /// Object space; zero where the mesh has none.
    normals: [Vectors; 3],
    uvs: [[[Floats; 2]; 3]; 2],
    /// 1 where the mesh has the set, 0 elsewhere.
    has_uvs: [Floats; 2],
    /// Barycentric coordinates of the hits.
    at: [Floats; 2],
    /// Of the footprint, metres.
    width: Floats,
    /// Columns of the linear part and the translation.
    world_from_object: [Vectors; 4],
    /// Columns.
    world_from_object_normal: [Vectors; 3],
    detour: Floats,
    /// 1 where the interpolated normal pointed to the back and was turned round, 0 elsewhere.
    turned: Floats,
}

/// A hit with what it lies on.
pub(crate) type Reached<'a> = (Arrival<'a>, &'a Placement, &'a ShadedPart);

impl Points {
    /// Fills lanes with the points of `material` where rays arrived, in their order.
    pub(crate) fn gather<'a>(
        &mut self,
        mode: LaneMode,
        material: &SurfaceMaterial,
        reached: &[Reached<'a>],
        triangles: &mut Triangles,
    ) {
        self.read_attributes(material, reached);
        let first = reached.first().map(|(_, placement, _)| *placement);
        let is_first = |first| reached.iter().all(|(_, placement, _)| std::ptr::eq(*placement, first));
        let shared = first.filter(|&first| first.motion.is_none() && is_first(first));
        if let Some(placement) = shared {
            triangles.place_all(placement);
        }
        (self.color, self.alpha) = (WHITE, WHITE.x);
        let (mut count, mut others) = (0, 0_u32);
        let mut before: Option<&Hit> = None;
        for (lane, &(arrival, placement, part)) in reached.iter().enumerate().take(WIDTH) {
            count = lane + 1;
            self.arrive(lane, material, arrival);
            if shared.is_none() {
                let moved = placement.at(arrival.ray.time);
                triangles.place(lane, moved.as_ref().unwrap_or(placement));
            }
            match &part.shape {
                Geometry::Mesh(mesh) => {
                    match before {
                        Some(hit) if is_same_triangle(hit, arrival.hit) => {
                            triangles.repeat(lane, material, &arrival);
                        }
                        _ => triangles.fetch(lane, mesh, material, &arrival),
                    }
                    self.paint(lane, mesh, &arrival);
                    before = mesh.motion.is_empty().then_some(arrival.hit);
                }
                Geometry::Quadrics(_) => {
                    others |= 1 << lane;
                    before = None;
                }
            }
        }
        on_lanes!(mode, count, |token, lane| interpolate::<_>(token, lane, material, triangles, self));
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

    /// What a lane takes from the ray.
    fn arrive(
        &mut self,
        lane: usize,
        material: &SurfaceMaterial,
        Arrival { hit, ray, cone, level }: Arrival<'_>,
    ) {
        self.ng.set(lane, hit.ng);
        self.wo.set(lane, -ray.direction);
        if material.shader.is_some() {
            self.distance.0[lane] = hit.t;
            self.level.0[lane] = level as f32;
            self.width.0[lane] = cone.width;
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
    (a.primitive, a.geometry, a.path) == (b.primitive, b.geometry, b.path)
}

const WHITE: Vectors = {
    let one = Floats::splat(1.0);
    Vectors { x: one, y: one, z: one }
};

impl Triangles {
    fn place(&mut self, lane: usize, placement: &Placement) {
        let world = &placement.world_from_object;
        let Mat3A { x_axis, y_axis, z_axis } = world.matrix3;
        for (column, to) in
            [x_axis, y_axis, z_axis, world.translation].into_iter().zip(&mut self.world_from_object)
        {
            to.set(lane, column.into());
        }
        let Mat3A { x_axis, y_axis, z_axis } = placement.world_from_object_normal;
        for (column, to) in [x_axis, y_axis, z_axis].into_iter().zip(&mut self.world_from_object_normal) {
            to.set(lane, column.into());
        }
        self.detour.0[lane] = placement.detour;
    }

    /// The same for all lanes.
    fn place_all(&mut self, placement: &Placement) {
        self.place(0, placement);
        for vectors in self.world_from_object.iter_mut().chain(&mut self.world_from_object_normal) {
            *vectors = Vectors::splat(vectors.get(0));
        }
        self.detour = Floats::splat(placement.detour);
    }

    /// Takes the corners that the lane before has: neighbours often lie on one triangle.
    fn repeat(&mut self, lane: usize, material: &SurfaceMaterial, Arrival { hit, cone, .. }: &Arrival<'_>) {
        let lane = lane % WIDTH;
        let before = (lane + WIDTH - 1) % WIDTH;
        for v in self.positions.iter_mut().chain(&mut self.normals) {
            (v.x.0[lane], v.y.0[lane], v.z.0[lane]) = (v.x.0[before], v.y.0[before], v.z.0[before]);
        }
        for set in 0..2 {
            if material.uses_uvs(set) {
                self.has_uvs[set].0[lane] = self.has_uvs[set].0[before];
                for [u, v] in &mut self.uvs[set] {
                    (u.0[lane], v.0[lane]) = (u.0[before], v.0[before]);
                }
            }
        }
        (self.at[0].0[lane], self.at[1].0[lane], self.width.0[lane]) = (hit.u, hit.v, cone.width);
    }

    /// Reads the corners of a lane's triangle.
    fn fetch(&mut self, lane: usize, mesh: &Mesh, material: &SurfaceMaterial, arrival: &Arrival<'_>) {
        let (lane, hit) = (lane % WIDTH, arrival.hit);
        let indices = mesh.indices[hit.primitive as usize].map(|i| i as usize);
        for (to, position) in self.positions.iter_mut().zip(corners(mesh, indices, arrival.ray.time)) {
            to.set(lane, position);
        }
        let normals = three(&mesh.normals, indices).unwrap_or([Vec3::ZERO; 3]);
        for (to, normal) in self.normals.iter_mut().zip(normals) {
            to.set(lane, normal);
        }
        (self.at[0].0[lane], self.at[1].0[lane]) = (hit.u, hit.v);
        self.width.0[lane] = arrival.cone.width;
        for (set, uvs) in mesh.uvs.iter().enumerate().filter(|&(set, _)| material.uses_uvs(set)) {
            let corners = three(uvs, indices);
            self.has_uvs[set].0[lane] = f32::from(u8::from(corners.is_some()));
            for (to, uv) in self.uvs[set].iter_mut().zip(corners.unwrap_or([Vec2::ZERO; 3])) {
                (to[0].0[lane], to[1].0[lane]) = (uv.x, uv.y);
            }
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

#[inline(always)]
fn load<F: Real>(token: F::Token, [a, b, c]: &[Vectors; 3], lane: usize) -> [Vector<F>; 3] {
    [Vector::load(token, a, lane), Vector::load(token, b, lane), Vector::load(token, c, lane)]
}

/// The points of triangles, from `lane` on.
#[inline(always)]
fn interpolate<F: Real>(
    token: F::Token,
    lane: usize,
    material: &SurfaceMaterial,
    triangles: &mut Triangles,
    points: &mut Points,
) {
    let (u, v) = (F::load(token, &triangles.at[0], lane), F::load(token, &triangles.at[1], lane));
    let [x, y, z, translation] = &triangles.world_from_object;
    let lanes = Lanes {
        weights: [u.complement() - v, u, v],
        linear: [Vector::load(token, x, lane), Vector::load(token, y, lane), Vector::load(token, z, lane)],
    };
    let corners = load::<F>(token, &triangles.positions, lane);
    let translation = Vector::load(token, translation, lane);
    let at = lanes.mix(corners);
    (transform(lanes.linear, at) + translation).store(&mut points.position, lane);

    // As for `Placement::rounding`.
    let [a, b, c] = corners;
    let [mx, my, mz] = lanes.linear;
    let largest = a.abs().max(b.abs()).max(c.abs());
    let magnitude = (transform([mx.abs(), my.abs(), mz.abs()], largest) + translation.abs()).largest();
    let error = (magnitude + F::load(token, &triangles.detour, lane)) * Placement::ROUNDING;
    error.store(&mut points.error, lane);

    let ng = Vector::<F>::load(token, &points.ng, lane);
    let normals = load(token, &triangles.world_from_object_normal, lane);
    let smooth = transform(normals, lanes.mix(load(token, &triangles.normals, lane))).normalized_or(ng);
    // Some files' normals disagree with their winding; the winding decides which side is the front.
    let turned = smooth.dot(ng).lt(u.splat(0.0));
    (-smooth).where_or(turned, smooth).store(&mut points.normal, lane);
    u.splat(1.0).only(turned).store(&mut triangles.turned, lane);
    if !material.is_textured() {
        return;
    }
    if material.shader.is_some() {
        at.store(&mut points.object_position, lane);
        let [x, y, z] = normals;
        // The inverse is the transpose of what takes normals.
        Vector::new(x.x, y.x, z.x).store(&mut points.object_from_world[0], lane);
        Vector::new(x.y, y.y, z.y).store(&mut points.object_from_world[1], lane);
        Vector::new(x.z, y.z, z.z).store(&mut points.object_from_world[2], lane);
    }
    let (along_u, along_v) = (transform(lanes.linear, b - a), transform(lanes.linear, c - a));
    let world_area = along_u.cross(along_v).length();
    let wo = Vector::<F>::load(token, &points.wo, lane);
    let cos = ng.dot(wo).abs();
    let width = F::load(token, &triangles.width, lane);
    // At grazing angles the footprint is an ellipse, which a row of squares covers. Limiting its length bounds the work, and
    // the samples of the pixel filter the rest.
    let stretch = cos.max(cos.splat(1.0 / LONGEST)).recip();
    let count = (stretch / LONGEST_PROBE).floor() + 1.0;
    count.store(&mut points.probes.count, lane);
    let probe = width * stretch / count;
    // Where the longer axis ends, from the corner of the triangle: its shares of the edges.
    let flat = wo - ng * ng.dot(wo);
    let axis = flat.normalized_or(flat) * (width * stretch);
    let normal = along_u.cross(along_v);
    let inverse = normal.length_squared().max(cos.splat(f32::MIN_POSITIVE)).recip();
    let axis = [axis.cross(along_v).dot(normal) * inverse, along_u.cross(axis).dot(normal) * inverse];
    let square = |width: F| width * width / world_area;
    for set in 0..2 {
        if material.uses_uvs(set) {
            let area = map(token, lane, (set, lanes.weights, axis), triangles, points);
            let lod = |share: F| log2((area * share).max(share.splat(1e-30))) * 0.5;
            let known = F::load(token, &triangles.has_uvs[set], lane).gt(cos.splat(0.0));
            lod(square(probe)).only(known).store(&mut points.probes.lod[set], lane);
            if material.shader.is_some() {
                // One square as wide as the ellipse is long, up to a limit.
                let widest = width * stretch.min(cos.splat(WIDEST));
                lod(square(widest)).only(known).store(&mut points.lod[set], lane);
            }
        }
    }
}

/// Footprints are no longer than so many of their widths.
const LONGEST: f32 = 7.99;
/// A probe's share of a footprint is no longer than so many of its widths.
const LONGEST_PROBE: f32 = 2.0;
/// The square that shaders are told of is at most so many times as wide as the footprint.
const WIDEST: f32 = 4.0;

/// Texture coordinates of a set, the footprint's longer axis in them, and twice the triangle's area.
#[inline(always)]
fn map<F: Real>(
    token: F::Token,
    lane: usize,
    (set, [wa, wb, wc], [axis_b, axis_c]): (usize, [F; 3], [F; 2]),
    triangles: &Triangles,
    points: &mut Points,
) -> F {
    let [[ua, va], [ub, vb], [uc, vc]] = &triangles.uvs[set];
    let (ua, va) = (F::load(token, ua, lane), F::load(token, va, lane));
    let (ub, vb) = (F::load(token, ub, lane), F::load(token, vb, lane));
    let (uc, vc) = (F::load(token, uc, lane), F::load(token, vc, lane));
    (ua * wa + ub * wb + uc * wc).store(&mut points.uv[set][0], lane);
    (va * wa + vb * wb + vc * wc).store(&mut points.uv[set][1], lane);
    let (u_b, u_c, v_b, v_c) = (ub - ua, uc - ua, vb - va, vc - va);
    (u_b * axis_b + u_c * axis_c).store(&mut points.probes.along[set][0], lane);
    (v_b * axis_b + v_c * axis_c).store(&mut points.probes.along[set][1], lane);
    (u_b * v_c - v_b * u_c).abs()
}
