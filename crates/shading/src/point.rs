//! From hits to points: interpolated attributes, normals and footprints, gathered into lanes.

use fearless_simd::{Level, Simd};
use glam::{Affine3A, Vec2, Vec3, Vec4};
use heliostat_kernel::{Hit, Ray};
use heliostat_scene::{Geometry, Mesh, Quadric};

use crate::basis::Basis;
use crate::camera::{Cone, Viewer};
use crate::lanes::{Floats, Packet, Real, Vector, Vectors};
use crate::material::{Slot, SurfaceMaterial, TextureCoordinates};
use crate::packet::on_lanes;
use crate::placement::Placement;
use crate::quadric::Spot;
use crate::shader::Point;
use crate::surface::LaneMode;

/// Sixteen points of surfaces of one material, seen along rays: what surface shaders get. Lanes that hold no point hold
/// whatever was there before.
#[repr(C)]
#[derive(Clone, Debug, Default)]
pub struct Points {
    /// World space, metres.
    pub position: Vectors,
    /// Bound on the rounding error of `position`, metres.
    pub error: Floats,
    /// Unit geometric normal in world space, on the front side.
    pub ng: Vectors,
    /// Unit normal interpolated between the vertices, in world space, on the front side.
    pub normal: Vectors,
    /// Unit vector towards where the ray came from.
    pub wo: Vectors,
    /// Both sets of texture coordinates.
    pub uv: [[Floats; 2]; 2],
    /// log2 of the footprint's width, for each set, in texture space. For materials with a shader.
    pub lod: [Floats; 2],
    /// The footprint as textures are filtered over it.
    pub probes: Probes,
    /// The mesh's linear colour.
    pub color: Vectors,
    /// The mesh's alpha.
    pub alpha: Floats,
    /// Distance along the ray that arrived, metres.
    pub distance: Floats,
    /// Edges between the camera and this point, from 1.
    pub level: Floats,
    /// Width of the footprint across the ray, metres. This and what follows is there for materials with a shader.
    pub width: Floats,
    /// Object space.
    pub object_position: Vectors,
    /// The linear part of the transform from world to object space, column by column.
    pub object_from_world: [Vectors; 3],
    /// Axes of tangent space for the normal map and for the coat's; zero where there are none.
    pub tangents: [[Vectors; 2]; 2],
    /// Values of the parameters that take them from attributes, for materials whose shader has such.
    pub attributes: Vec<Vectors>,
    /// From where the frame is seen, if it is for one.
    pub viewer: Option<Viewer>,
}

/// Squares side by side that cover a long footprint.
#[repr(C)]
#[derive(Clone, Debug, Default)]
pub struct Probes {
    /// How many: a whole number from 1.
    pub count: Floats,
    /// The footprint's longer axis from end to end, for each set, in texture space.
    pub along: [[Floats; 2]; 2],
    /// log2 of the width of a square, for each set, in texture space.
    pub lod: [Floats; 2],
}

/// A ray at the surface it hit.
#[derive(Clone, Copy, Debug)]
pub struct Arrival<'a> {
    /// What was hit.
    pub hit: &'a Hit,
    /// Of unit direction.
    pub ray: &'a Ray,
    /// Footprint at the hit.
    pub cone: Cone,
    /// Edges between the camera and the hit, from 1.
    pub level: u32,
}

impl Points {
    /// Fills a lane with the point of an analytic shape where a ray arrived.
    pub(crate) fn set_quadric(
        &mut self,
        lane: usize,
        (placement, shape, material): (&Placement, &Quadric, &SurfaceMaterial),
        Arrival { hit, cone, .. }: &Arrival<'_>,
    ) {
        let spot = Spot::new(shape, Vec2::new(hit.u, hit.v));
        let (position, error) = spot.point(placement);
        self.position.set(lane, position);
        self.error.0[lane] = error;
        self.normal.set(lane, hit.ng);
        if !material.is_textured() {
            return;
        }
        if material.shader.is_some() {
            self.object_position.set(lane, spot.object_position());
            let inverse = placement.world_from_object_normal.transpose();
            for (column, to) in inverse.to_cols_array_2d().into_iter().zip(&mut self.object_from_world) {
                to.set(lane, column.into());
            }
        }
        let cos = hit.ng.dot(self.wo.get(lane)).abs().max(0.25);
        let at = spot.coordinates(material, &placement.world_from_object, cone.width / cos);
        self.probes.count.0[lane] = at.probes;
        for set in 0..2 {
            self.lod[set].0[lane] = at.lod[set];
            self.probes.lod[set].0[lane] = at.lod[set];
            for axis in 0..2 {
                self.uv[set][axis].0[lane] = at.uv[set][axis];
            }
        }
        self.orient(lane, material, |slot| spot.tangent_basis(&placement.world_from_object, hit.ng, slot));
    }

    /// Sets a lane's axes of tangent space for the maps of normals; zero where their coordinates are degenerate.
    pub(crate) fn orient(
        &mut self,
        lane: usize,
        material: &SurfaceMaterial,
        axes: impl Fn(&Slot) -> Option<[Vec3; 2]>,
    ) {
        for (tangents, slot) in self.tangents.iter_mut().zip([&material.normal, &material.coat_normal]) {
            if let Some(slot) = slot {
                let [x, y] = axes(slot).unwrap_or_default();
                tangents[0].set(lane, x);
                tangents[1].set(lane, y);
            }
        }
    }

    /// Unit vectors towards the camera of the frame at the first `count` points; see [`Point::eye`].
    pub fn eye(&self, mode: LaneMode, count: usize) -> Vectors {
        let mut out = Vectors::default();
        on_lanes!(mode, count, |token, lane| store_eye::<_>(token, lane, self, &mut out));
        out
    }

    #[inline(always)]
    fn eye_lanes<F: Real>(&self, token: F::Token, lane: usize) -> Vector<F> {
        let wo = Vector::load(token, &self.wo, lane);
        match self.viewer {
            None => wo,
            Some(Viewer::At(at)) => {
                (Vector::constant(token, at) - Vector::load(token, &self.position, lane)).normalized_or(wo)
            }
            Some(Viewer::Towards(direction)) => Vector::constant(token, direction),
        }
    }

    /// Lanes from `lane` on as shaders see them.
    #[inline(always)]
    pub(crate) fn point<F: Real>(&self, token: F::Token, lane: usize) -> Point<F> {
        let ng = Vector::<F>::load(token, &self.ng, lane);
        let wo = Vector::load(token, &self.wo, lane);
        let [x, y, z] = &self.object_from_world;
        let x = Vector::<F>::load(token, x, lane);
        let y = Vector::<F>::load(token, y, lane);
        let z = Vector::<F>::load(token, z, lane);
        let tangent = Basis::from_normal(Vector::<F>::load(token, &self.normal, lane));
        let (a, b) = (tangent.x, tangent.y);
        Point {
            position: Vector::load(token, &self.position, lane),
            object_position: Vector::load(token, &self.object_position, lane),
            ng,
            wo,
            eye: self.eye_lanes::<F>(token, lane),
            front: ng.dot(wo).gt(ng.x.splat(0.0)),
            uv: [F::load(token, &self.uv[0][0], lane), F::load(token, &self.uv[0][1], lane)],
            width: F::load(token, &self.width, lane),
            distance: F::load(token, &self.distance, lane),
            level: F::load(token, &self.level, lane),
            axes: [a, b],
            object_axes: [x * a.x + y * a.y + z * a.z, x * b.x + y * b.y + z * b.z],
        }
    }

    /// The texture coordinates of lanes from `lane` on.
    #[inline(always)]
    pub(crate) fn coordinates<F: Real>(&self, token: F::Token, lane: usize) -> TextureCoordinates<F> {
        let [[u0, v0], [u1, v1]] = &self.uv;
        let [[along_u0, along_v0], [along_u1, along_v1]] = &self.probes.along;
        TextureCoordinates {
            uv: [
                [F::load(token, u0, lane), F::load(token, v0, lane)],
                [F::load(token, u1, lane), F::load(token, v1, lane)],
            ],
            lod: [F::load(token, &self.probes.lod[0], lane), F::load(token, &self.probes.lod[1], lane)],
            along: [
                [F::load(token, along_u0, lane), F::load(token, along_v0, lane)],
                [F::load(token, along_u1, lane), F::load(token, along_v1, lane)],
            ],
            probes: F::load(token, &self.probes.count, lane),
            color: crate::color::Rgba {
                rgb: Vector::load(token, &self.color, lane),
                a: F::load(token, &self.alpha, lane),
            },
        }
    }
}

#[inline(always)]
fn store_eye<F: Real>(token: F::Token, lane: usize, points: &Points, out: &mut Vectors) {
    points.eye_lanes::<F>(token, lane).store(out, lane);
}

/// Positions of three vertices at `time` in [0, 1] of the shutter interval, object space.
#[inline]
pub(crate) fn corners(mesh: &Mesh, indices: [usize; 3], time: f32) -> [Vec3; 3] {
    let positions = indices.map(|i| mesh.positions[i]);
    if mesh.motion.is_empty() {
        return positions;
    }
    let ends = indices.map(|i| mesh.motion[i]);
    [0, 1, 2].map(|i| positions[i] * (1.0 - time) + ends[i] * time)
}

/// A triangle's corners and attributes, gathered for one hit.
pub(crate) struct Corners<'a> {
    mesh: &'a Mesh,
    indices: [usize; 3],
    /// Barycentric weights of the three corners.
    weights: [f32; 3],
    positions: [Vec3; 3],
}

impl<'a> Corners<'a> {
    /// `time` in [0, 1] of the shutter interval.
    pub(crate) fn new(mesh: &'a Mesh, primitive: u32, uv: Vec2, time: f32) -> Self {
        let indices = mesh.indices[primitive as usize].map(|i| i as usize);
        let positions = corners(mesh, indices, time);
        Self { mesh, indices, weights: [1.0 - uv.x - uv.y, uv.x, uv.y], positions }
    }

    /// Object space.
    pub(crate) fn positions(&self) -> [Vec3; 3] {
        self.positions
    }

    /// World-space corners.
    pub(crate) fn world(&self, world_from_object: &Affine3A) -> [Vec3; 3] {
        self.positions().map(|p| world_from_object.transform_point3(p))
    }

    /// Twice the area in the world.
    pub(crate) fn doubled_area(&self, world_from_object: &Affine3A) -> f32 {
        let [a, b, c] = self.world(world_from_object);
        (b - a).cross(c - a).length()
    }

    fn interpolate<T>(&self, values: &[T]) -> Option<T>
    where
        T: Copy + std::ops::Mul<f32, Output = T> + std::ops::Add<Output = T>,
    {
        let [a, b, c] = self.indices;
        let [wa, wb, wc] = self.weights;
        Some(*values.get(a)? * wa + *values.get(b)? * wb + *values.get(c)? * wc)
    }

    fn object_position(&self) -> Vec3 {
        let [a, b, c] = self.positions();
        let [wa, wb, wc] = self.weights;
        a * wa + b * wb + c * wc
    }

    /// World-space point and a bound on its rounding error.
    pub(crate) fn point(&self, placement: &Placement) -> (Vec3, f32) {
        let world_from_object = &placement.world_from_object;
        let [a, b, c] = self.positions();
        let p = self.object_position();
        let largest = a.abs().max(b.abs()).max(c.abs());
        (world_from_object.transform_point3(p), placement.rounding(largest))
    }

    /// Texture coordinates with their footprints, and the mesh's colour. `width` is the footprint's, in metres.
    pub(crate) fn coordinates(
        &self,
        material: &SurfaceMaterial,
        world_area: f32,
        width: f32,
    ) -> TextureCoordinates<f32> {
        let color = self.interpolate(&self.mesh.colors).unwrap_or(Vec4::ONE);
        let mut at = TextureCoordinates::square([[0.0; 2]; 2], [0.0; 2], color.into());
        if !material.is_textured() {
            return at;
        }
        for (set, uvs) in self.mesh.uvs.iter().enumerate() {
            let Some(uv) = self.interpolate(uvs) else { continue };
            at.uv[set] = uv.to_array();
            let [a, b, c] = self.indices.map(|i| uvs[i]);
            let uv_area = (b - a).perp_dot(c - a).abs();
            at.lod[set] = 0.5 * (uv_area * width * width / world_area).max(1e-30).log2();
        }
        at
    }

    /// The axes of tangent space at unit normal `n`: x along +u and y along −v of the texture, as normal maps
    /// expect. `None` where the texture coordinates are degenerate. `turned` normals point against those of the file, to
    /// which its tangents refer.
    pub(crate) fn tangent_basis(
        &self,
        placement: &Placement,
        (n, turned): (Vec3, bool),
        slot: &Slot,
    ) -> Option<[Vec3; 2]> {
        let matrix = &placement.world_from_object;
        let set = usize::from(slot.reference.uv_set.min(1));
        if let (0, Some(tangent)) = (set, self.interpolate(&self.mesh.tangents)) {
            let t = matrix.transform_vector3(tangent.truncate());
            let x = t.reject_from_normalized(n).try_normalize()?;
            let mirrored = matrix.matrix3.determinant() < 0.0;
            let sign = if (tangent.w < 0.0) != (mirrored != turned) { -1.0 } else { 1.0 };
            return Some([x, n.cross(x) * sign]);
        }
        let uvs = &self.mesh.uvs[set];
        let at =
            |i: usize| uvs.get(self.indices[i]).map(|&uv| slot.reference.transform.0.transform_point2(uv));
        let (a, b, c) = (at(0)?, at(1)?, at(2)?);
        let [pa, pb, pc] = self.world(matrix);
        let (e1, e2, d1, d2) = (pb - pa, pc - pa, b - a, c - a);
        let determinant = d1.perp_dot(d2);
        let along_u = (e1 * d2.y - e2 * d1.y) * determinant.signum();
        let along_v = (e2 * d1.x - e1 * d2.x) * determinant.signum();
        let x = along_u.reject_from_normalized(n).try_normalize()?;
        let y = n.cross(x);
        Some([x, if y.dot(along_v) > 0.0 { -y } else { y }])
    }
}

/// What was hit, with the attributes at the hit.
pub(crate) enum Met<'a> {
    Triangle(Corners<'a>),
    Quadric(Spot),
}

impl<'a> Met<'a> {
    /// `time` in [0, 1] of the shutter interval.
    pub(crate) fn new(shape: &'a Geometry, primitive: u32, uv: Vec2, time: f32) -> Self {
        match shape {
            Geometry::Mesh(mesh) => Self::Triangle(Corners::new(mesh, primitive, uv, time)),
            Geometry::Quadrics(quadrics) => {
                Self::Quadric(Spot::new(&quadrics.shapes[primitive as usize], uv))
            }
        }
    }

    /// World-space point and a bound on its rounding error.
    pub(crate) fn point(&self, placement: &Placement) -> (Vec3, f32) {
        match self {
            Self::Triangle(corners) => corners.point(placement),
            Self::Quadric(spot) => spot.point(placement),
        }
    }

    /// World-space point, a bound on its rounding error, the normal as [`Self::normal`] gives it, and [`Self::area_pdf`]: what
    /// sampling a light takes, at once.
    pub(crate) fn on_light(&self, placement: &Placement) -> (Vec3, f32, Vec3, f32) {
        let (point, error) = self.point(placement);
        let normal = self.normal(placement);
        let area_pdf = match self {
            // The normal of a triangle is as long as twice its area.
            Self::Triangle(_) => 2.0 / normal.length(),
            Self::Quadric(_) => self.area_pdf(placement),
        };
        (point, error, normal, area_pdf)
    }

    /// Density per square metre of the world of points distributed evenly over this primitive, in object space.
    pub(crate) fn area_pdf(&self, placement: &Placement) -> f32 {
        match self {
            Self::Triangle(corners) => 2.0 / corners.doubled_area(&placement.world_from_object),
            Self::Quadric(spot) => spot.area_pdf(&placement.world_from_object),
        }
    }

    /// World-space geometric normal on the front side; not unit length.
    pub(crate) fn normal(&self, placement: &Placement) -> Vec3 {
        match self {
            Self::Triangle(corners) => {
                let [a, b, c] = corners.world(&placement.world_from_object);
                let cross = (b - a).cross(c - a);
                // A mirroring transform turns the winding but not the front.
                if placement.world_from_object.matrix3.determinant() < 0.0 { -cross } else { cross }
            }
            Self::Quadric(spot) => spot.normal(placement),
        }
    }

    /// Texture coordinates with their footprints, and the mesh's colour. `width` is the footprint's, in metres.
    pub(crate) fn coordinates(
        &self,
        material: &SurfaceMaterial,
        placement: &Placement,
        width: f32,
    ) -> TextureCoordinates<f32> {
        let matrix = &placement.world_from_object;
        match self {
            Self::Triangle(corners) => {
                let area = if material.is_textured() { corners.doubled_area(matrix) } else { 1.0 };
                corners.coordinates(material, area, width)
            }
            Self::Quadric(spot) => spot.coordinates(material, matrix, width),
        }
    }
}
