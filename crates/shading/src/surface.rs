//! From a hit to a surface: interpolated attributes, normals, footprint, material.

use std::sync::Arc;

use glam::{Affine3A, Mat3A, Vec2, Vec3, Vec3A, Vec4};
use heliostat_scene::{Geometry, GeometryId, InstanceId, Mesh, ObjectId};

use crate::basis::Basis;
use crate::bsdf::Bsdf;
use crate::camera::Cone;
use crate::material::{LobeGeometry, Slot, SurfaceMaterial, TextureCoordinates};
use crate::quadric::Spot;

/// A geometry of an object with its material, as the shader tables hold it.
#[derive(Clone, Debug)]
pub struct ShadedPart {
    /// The shape with its attributes.
    pub shape: Geometry,
    /// Index into the material table.
    pub material: u32,
    /// The handle.
    pub geometry: GeometryId,
}

/// One object at one place in the expanded tree of instances.
#[derive(Clone, Debug)]
pub struct Placement {
    /// Accumulated over all instances on the way.
    pub world_from_object: Affine3A,
    /// Inverse transpose of the linear part: takes normals to world space, front sides to front sides.
    pub world_from_object_normal: Mat3A,
    /// Sum of the translations of the nested instances on the way, in world units. Rays are carried through them one by
    /// one, so their size adds to rounding errors even where they cancel out.
    pub detour: f32,
    /// The object.
    pub object: ObjectId,
    /// Innermost instance.
    pub instance: InstanceId,
    /// The object's place in the table of parts.
    pub parts: u32,
    /// What moves while the shutter is open, if anything does.
    pub motion: Option<Arc<Sweep>>,
}

/// The placements on the way from the world to an object when the shutter opens and when it closes, outermost
/// first. Each level changes linearly by itself, as in the kernel.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep(pub Vec<[Affine3A; 2]>);

impl Sweep {
    /// World from object at `time` in [0, 1] of the shutter interval.
    pub fn world_from_object(&self, time: f32) -> Affine3A {
        self.0.iter().fold(Affine3A::IDENTITY, |world, [open, close]| world * mix(open, close, time))
    }
}

/// Between two transforms, entry by entry.
pub(crate) fn mix(open: &Affine3A, close: &Affine3A, time: f32) -> Affine3A {
    Affine3A {
        matrix3: open.matrix3 * (1.0 - time) + close.matrix3 * time,
        translation: open.translation * (1.0 - time) + close.translation * time,
    }
}

impl Placement {
    /// A placement with its derived transforms.
    pub fn new(
        world_from_object: Affine3A,
        detour: f32,
        object: ObjectId,
        instance: InstanceId,
        parts: u32,
    ) -> Self {
        let world_from_object_normal = world_from_object.matrix3.inverse().transpose();
        Self { world_from_object, world_from_object_normal, detour, object, instance, parts, motion: None }
    }

    /// The placement at `time` in [0, 1] of the shutter interval, if it moves.
    pub(crate) fn at(&self, time: f32) -> Option<Self> {
        let world_from_object = self.motion.as_ref()?.world_from_object(time);
        let Self { detour, object, instance, parts, .. } = *self;
        Some(Self::new(world_from_object, detour, object, instance, parts))
    }
}

/// Where a ray met a triangle, a sphere or a cone, without reference to any accelerator.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceQuery {
    /// Barycentric weights of the second and third vertex; the kernel's coordinates of a sphere or cone.
    pub uv: Vec2,
    /// Unit geometric normal in world space, on the front side.
    pub ng: Vec3,
    /// Triangle of the part's mesh, or which of its shapes.
    pub primitive: u32,
    /// Unit vector towards where the ray came from.
    pub wo: Vec3,
    /// Footprint at the hit.
    pub cone: Cone,
    /// Time in [0, 1] of the shutter interval.
    pub time: f32,
}

/// A surface point ready for light transport.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World space.
    pub position: Vec3,
    /// Bound on the rounding error of `position`, metres.
    pub error: f32,
    /// Unit geometric normal, on the viewer's side.
    pub ng: Vec3,
    /// Whether the viewer is on the front side.
    pub front: bool,
    /// Radiance emitted towards the viewer by the part of the surface that is there (see `coverage`).
    pub emission: Vec3,
    /// Share of light that meets the surface; the rest passes.
    pub coverage: f32,
    /// Transmittance straight through, per channel: holes and clear thin sheets.
    pub through: Vec3,
    /// How the surface scatters, for the share of light that meets it.
    pub bsdf: Bsdf,
    /// Share of uniform white light that is reflected or transmitted.
    pub albedo: Vec3,
    /// Radiance of the classical ambient term, which renderers add that do not follow light between surfaces.
    pub ambient: Vec3,
    /// Absorption per metre along the ray that arrived: non-zero if it came through a solid.
    pub absorption: Vec3,
}

impl Surface {
    /// Origin for a ray that leaves towards `direction`: moved off the surface by its error bound.
    pub fn spawn(&self, direction: Vec3) -> Vec3 {
        offset_origin(self.position, self.ng, self.error, direction)
    }
}

/// Moves a point of known error off its plane, to the side of `direction`.
pub(crate) fn offset_origin(position: Vec3, ng: Vec3, error: f32, direction: Vec3) -> Vec3 {
    position + ng * error.copysign(ng.dot(direction))
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
        let mut positions = indices.map(|i| mesh.positions[i]);
        if !mesh.motion.is_empty() {
            let ends = indices.map(|i| mesh.motion[i]);
            positions = [0, 1, 2].map(|i| positions[i] * (1.0 - time) + ends[i] * time);
        }
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

    /// World-space point and a bound on its rounding error.
    pub(crate) fn point(&self, placement: &Placement) -> (Vec3, f32) {
        let world_from_object = &placement.world_from_object;
        let [a, b, c] = self.positions();
        let [wa, wb, wc] = self.weights;
        let p = a * wa + b * wb + c * wc;
        let largest = a.abs().max(b.abs()).max(c.abs());
        (world_from_object.transform_point3(p), placement.rounding(largest))
    }

    /// Texture coordinates with their footprints, and the mesh's colour. `width` is the footprint's, in metres.
    pub(crate) fn coordinates(
        &self,
        material: &SurfaceMaterial,
        world_area: f32,
        width: f32,
    ) -> TextureCoordinates {
        let mut at = TextureCoordinates { color: Vec4::ONE, ..TextureCoordinates::default() };
        if let Some(color) = self.interpolate(&self.mesh.colors) {
            at.color = color;
        }
        if !material.is_textured() {
            return at;
        }
        for (set, uvs) in self.mesh.uvs.iter().enumerate() {
            let Some(uv) = self.interpolate(uvs) else { continue };
            at.uv[set] = uv;
            let [a, b, c] = self.indices.map(|i| uvs[i]);
            let uv_area = (b - a).perp_dot(c - a).abs();
            at.lod[set] = 0.5 * (uv_area * width * width / world_area).max(1e-30).log2();
        }
        at
    }

    /// Shading normal in world space, on the front side of `ng`, and whether it had to be turned there.
    fn shading_normal(&self, placement: &Placement, ng: Vec3) -> (Vec3, bool) {
        let Some(n) = self.interpolate(&self.mesh.normals) else { return (ng, false) };
        let n = Vec3::from(placement.world_from_object_normal * Vec3A::from(n));
        let n = n.try_normalize().unwrap_or(ng);
        // Some files' normals disagree with their winding; the winding decides which side is the front.
        if n.dot(ng) < 0.0 { (-n, true) } else { (n, false) }
    }

    /// The basis of tangent space at unit normal `n`: x along +u and y along −v of the texture, as normal maps
    /// expect. `None` where the texture coordinates are degenerate. `turned` normals point against those of the file, to
    /// which its tangents refer.
    fn tangent_basis(&self, placement: &Placement, (n, turned): (Vec3, bool), slot: &Slot) -> Option<Basis> {
        let matrix = &placement.world_from_object;
        let set = usize::from(slot.reference.uv_set.min(1));
        if let (0, Some(tangent)) = (set, self.interpolate(&self.mesh.tangents)) {
            let t = matrix.transform_vector3(tangent.truncate());
            let x = t.reject_from_normalized(n).try_normalize()?;
            let mirrored = matrix.matrix3.determinant() < 0.0;
            let sign = if (tangent.w < 0.0) != (mirrored != turned) { -1.0 } else { 1.0 };
            return Some(Basis { x, y: n.cross(x) * sign, z: n });
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
        Some(Basis { x, y: if y.dot(along_v) > 0.0 { -y } else { y }, z: n })
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
    ) -> TextureCoordinates {
        let matrix = &placement.world_from_object;
        match self {
            Self::Triangle(corners) => corners.coordinates(material, corners.doubled_area(matrix), width),
            Self::Quadric(spot) => spot.coordinates(material, matrix, width),
        }
    }

    /// Shading normal in world space, on the front side of `ng`, and whether it had to be turned there.
    fn shading_normal(&self, placement: &Placement, ng: Vec3) -> (Vec3, bool) {
        match self {
            Self::Triangle(corners) => corners.shading_normal(placement, ng),
            Self::Quadric(_) => (ng, false),
        }
    }

    /// The normal of a normal map, in world space.
    fn mapped_normal(
        &self,
        placement: &Placement,
        smooth: (Vec3, bool),
        slot: &Slot,
        scale: f32,
        at: &TextureCoordinates,
    ) -> Vec3 {
        let basis = match self {
            Self::Triangle(corners) => corners.tangent_basis(placement, smooth, slot),
            Self::Quadric(spot) => spot.tangent_basis(&placement.world_from_object, smooth.0, slot),
        };
        let Some(basis) = basis else { return smooth.0 };
        let t = slot.lookup(at).truncate() * 2.0 - 1.0;
        let t = Vec3::new(t.x * scale, t.y * scale, t.z);
        basis.to_world(t).try_normalize().unwrap_or(smooth.0)
    }
}

/// Bends a normal just enough that the viewer is above its horizon.
fn towards_viewer(n: Vec3, wo: Vec3) -> Vec3 {
    const LEAST_COSINE: f32 = 0.01;
    let cos = n.dot(wo);
    if cos >= LEAST_COSINE { n } else { (n + wo * (LEAST_COSINE - cos)).normalize_or(wo) }
}

/// Builds the surface point of a hit on `part` of `placement`.
pub(crate) fn surface(
    placement: &Placement,
    part: &ShadedPart,
    material: &SurfaceMaterial,
    query: &SurfaceQuery,
) -> Surface {
    let met = Met::new(&part.shape, query.primitive, query.uv, query.time);
    let (position, error) = met.point(placement);
    let cos = query.ng.dot(query.wo);
    // At grazing angles the footprint is an ellipse; limiting its length keeps textures sharp, and the samples of the
    // pixel filter the rest.
    let at = met.coordinates(material, placement, query.cone.width / cos.abs().max(0.25));
    let front = cos > 0.0;
    let side = if front { 1.0 } else { -1.0 };

    let source = material.source();
    let smooth = met.shading_normal(placement, query.ng);
    let mapped = |slot: &Option<Slot>, scale: f32| match slot {
        Some(slot) => met.mapped_normal(placement, smooth, slot, scale, &at),
        None => smooth.0,
    };
    let basis =
        Basis::from_normal(towards_viewer(side * mapped(&material.normal, source.normal_scale), query.wo));
    let coat_basis = match &source.clearcoat {
        Some(coat) => {
            let n = mapped(&material.coat_normal, coat.normal_scale);
            Basis::from_normal(towards_viewer(side * n, query.wo))
        }
        None => basis,
    };
    let geometry = LobeGeometry { basis, coat_basis, ng: side * query.ng, wo: query.wo, front };
    let mut appearance = material.appearance(&at, &geometry);
    let mut emission = material.emission(&at, front);
    if source.unlit {
        emission = material.base_color(&at).truncate();
        appearance.bsdf = appearance.bsdf.black();
        appearance.through = Vec3::splat(1.0 - appearance.coverage);
        appearance.albedo = emission;
        appearance.ambient = Vec3::ZERO;
    }
    Surface {
        position,
        error,
        ng: geometry.ng,
        front,
        emission,
        coverage: appearance.coverage,
        through: appearance.through,
        bsdf: appearance.bsdf,
        albedo: appearance.albedo,
        ambient: appearance.ambient,
        absorption: if front { Vec3::ZERO } else { material.absorption() },
    }
}
